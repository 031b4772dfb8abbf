//! The band of the force: what cells of this edge may be off, from a companion run with cells twice as wide.
//!
//! With an error that falls as `h^p`, the exact force lies `|F_h - F_2h| / (2^p - 1)` from `F_h` (Richardson). The grid convergence index
//! (Roache 1994, J. Fluids Eng. 116:405) multiplies that by 3 where the order is assumed and by 1.25 where three or more meshes showed it. Without a
//! study the order is taken as 1: the element is of second order, but the tip of a needle and the rim of a contact are places where strain has
//! no bound, and there forces converge with the first at best. The band is then three times the difference.

use std::collections::VecDeque;

/// Order that is assumed where none was observed.
pub const ASSUMED_ORDER: f64 = 1.0;
/// Roache's factors of safety for an assumed and for an observed order.
const SAFETY_ASSUMED: f64 = 3.0;
const SAFETY_OBSERVED: f64 = 1.25;
/// Observed orders beyond these are taken as these: below the lower one nothing converges, and what falls faster than it can fell by chance.
pub const ORDERS: [f64; 2] = [0.5, ASSUMED_ORDER];
/// Travel over which a difference counts on, in cell edges of the companion. Curves cross, and two that cross agree by chance; the force of
/// a tip that cuts comes and goes with the cells that it passes.
const REACH_CELLS: f64 = 1.0;

/// Half-width of the band over the difference between the two runs, whose cells differ by a factor of two.
///
/// `observed`: order of the error in the cell edge that a study has found.
pub fn factor(observed: Option<f64>) -> f64 {
    let (order, safety) = match observed {
        Some(order) => (order.clamp(ORDERS[0], ORDERS[1]), SAFETY_OBSERVED),
        None => (ASSUMED_ORDER, SAFETY_ASSUMED),
    };
    safety / (2f64.powf(order) - 1.0)
}

/// The band along a run: the largest difference over the last of its travel.
#[derive(Debug, Clone)]
pub struct ErrorBar {
    factor: f64,
    /// [m]
    reach: f64,
    depth: Option<f64>,
    travel: f64,
    /// Travel and difference, the differences falling: what is smaller than a later one will never be the largest again.
    recent: VecDeque<(f64, f64)>,
}

impl ErrorBar {
    /// `companion_cell`: edge of the companion's cells [m]; `order`: as in [`factor`].
    pub fn new(companion_cell: f64, order: Option<f64>) -> Self {
        let reach = REACH_CELLS * companion_cell;
        ErrorBar { factor: factor(order), reach, depth: None, travel: 0.0, recent: VecDeque::new() }
    }

    /// The same at its beginning.
    pub fn anew(&self) -> Self {
        ErrorBar { depth: None, travel: 0.0, recent: VecDeque::new(), ..*self }
    }

    /// Half-width of the band [N] in a frame at `depth` [m] with the axial forces of both runs [N].
    pub fn at(&mut self, depth: f64, force: f64, companion: f64) -> f64 {
        self.travel += self.depth.replace(depth).map_or(0.0, |before| (depth - before).abs());
        let difference = (force - companion).abs();
        while self.recent.back().is_some_and(|(_, smaller)| *smaller <= difference) {
            self.recent.pop_back();
        }
        self.recent.push_back((self.travel, difference));
        while self.recent.front().is_some_and(|(travel, _)| *travel < self.travel - self.reach) {
            self.recent.pop_front();
        }
        self.factor * self.recent.front().map_or(difference, |(_, largest)| *largest)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_power_law_lies_in_the_band() {
        for order in [0.5, 0.7, 1.0] {
            assert!((factor(Some(order)) * (2f64.powf(order) - 1.0) - 1.25).abs() < 1e-12);
            // F_h = F + C h^p with F = 1 N and an error of 0.1 N on the fine mesh.
            let (fine, coarse) = (1.1, 1.0 + 0.1 * 2f64.powf(order));
            let seen = ErrorBar::new(1e-3, Some(order)).at(0.0, fine, coarse);
            assert!((seen - 0.125).abs() < 1e-12, "{order}: {seen}");
        }
        let assumed = ErrorBar::new(1e-3, None).at(0.0, 1.1, 1.2);
        assert!((assumed - 0.3).abs() < 1e-12);
    }

    #[test]
    fn an_order_that_means_nothing_is_held_within_bounds() {
        assert_eq!(factor(Some(9.0)), factor(Some(1.0)));
        assert_eq!(factor(Some(0.1)), factor(Some(0.5)));
        assert_eq!(factor(None), 3.0);
    }

    #[test]
    fn a_difference_counts_on_for_a_cell() {
        let mut bar = ErrorBar { factor: 1.0, ..ErrorBar::new(1e-3, None) };
        let seen: Vec<f64> = (0..8)
            .map(|n| {
                let difference = [0.1, 0.5, 0.2, 0.0, 0.1, 0.0, 0.0, 0.0][n];
                bar.at(0.5e-3 * n as f64, 1.0, 1.0 - difference)
            })
            .collect();
        // 0.5 at 0.5 mm is the largest until 1.5 mm, 0.2 at 1 mm until 2 mm.
        for (seen, expected) in seen.iter().zip([0.1, 0.5, 0.5, 0.5, 0.2, 0.1, 0.1, 0.0]) {
            assert!((seen - expected).abs() < 1e-12, "{seen} instead of {expected}");
        }
        // A needle that stands keeps its band; one that withdraws travels too.
        assert!((bar.at(3.5e-3, 1.0, 0.7) - 0.3).abs() < 1e-12);
        assert!((bar.at(3.5e-3, 1.0, 1.0) - 0.3).abs() < 1e-12);
        assert!(bar.at(2.0e-3, 1.0, 1.0) < 1e-12);
    }
}
