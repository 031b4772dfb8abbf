//! Observed order of convergence in mesh size.

use serde::{Deserialize, Serialize};

/// Slope below which, and coefficient of determination below which, a fit does not count as convergence.
const LEAST_ORDER: f64 = 0.5;
const LEAST_R2: f64 = 0.8;
/// Orders between which the three-mesh form is solved.
const ORDERS: [f64; 2] = [0.01, 20.0];

/// Least-squares line of log error over log edge.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Fit {
    /// Slope: the observed order.
    pub order: f64,
    /// Error at an edge of 1 mm, as the line has it.
    pub error_at_1mm: f64,
    /// Coefficient of determination.
    pub r2: f64,
    pub points: usize,
}

/// Three-mesh form after Richardson: what order and limit three values would have if they converged with one power of the edge.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Richardson {
    pub order: f64,
    /// Value at an edge of zero.
    pub limit: f64,
    /// |finest value - limit| over |limit|.
    pub error_of_finest: f64,
}

/// Fits a power law to (edge [mm], error); `None` with fewer than three usable points.
pub fn fit(points: &[(f64, f64)]) -> Option<Fit> {
    let usable = |(h, e): &&(f64, f64)| *h > 0.0 && *e > 0.0 && h.is_finite() && e.is_finite();
    let logs: Vec<(f64, f64)> = points.iter().filter(usable).map(|(h, e)| (h.ln(), e.ln())).collect();
    if logs.len() < 3 {
        return None;
    }
    let n = logs.len() as f64;
    let (mx, my) = (logs.iter().map(|p| p.0).sum::<f64>() / n, logs.iter().map(|p| p.1).sum::<f64>() / n);
    let (mut sxx, mut sxy, mut syy) = (0.0, 0.0, 0.0);
    for (x, y) in &logs {
        sxx += (x - mx).powi(2);
        sxy += (x - mx) * (y - my);
        syy += (y - my).powi(2);
    }
    let order = sxy / sxx;
    order.is_finite().then(|| Fit {
        order,
        error_at_1mm: (my - order * mx).exp(),
        r2: if syy > 0.0 { sxy * sxy / (sxx * syy) } else { 0.0 },
        points: logs.len(),
    })
}

impl Fit {
    /// True where the errors fall steadily enough with the edge to speak of an order.
    pub fn converges(&self) -> bool {
        self.order >= LEAST_ORDER && self.r2 >= LEAST_R2
    }
}

/// Order and limit of the values on three meshes, (edge [mm], value) from fine to coarse. `None` where the values do not
/// approach a limit from one side.
pub fn richardson(meshes: [(f64, f64); 3]) -> Option<Richardson> {
    let [(h1, f1), (h2, f2), (h3, f3)] = meshes;
    let (near, far) = (f2 - f1, f3 - f2);
    if !(h1 > 0.0 && h1 < h2 && h2 < h3) || near * far <= 0.0 {
        return None;
    }
    let ratio = far / near;
    let of = |p: f64| (h3.powf(p) - h2.powf(p)) / (h2.powf(p) - h1.powf(p)) - ratio;
    let [mut low, mut high] = ORDERS;
    // The quotient grows with the order.
    if of(low) > 0.0 || of(high) < 0.0 {
        return None;
    }
    for _ in 0..100 {
        let middle = 0.5 * (low + high);
        if of(middle) < 0.0 { low = middle } else { high = middle }
    }
    let order = 0.5 * (low + high);
    let limit = f1 - near * h1.powf(order) / (h2.powf(order) - h1.powf(order));
    Some(Richardson { order, limit, error_of_finest: ((f1 - limit) / limit).abs() })
}
