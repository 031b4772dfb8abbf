//! Least squares of a few unknowns: linear ones, and those of a curve that is not linear in them.
//!
//! Linear: one-sided Jacobi rotations turn the columns until they are orthogonal, which is the singular value decomposition
//! (Hestenes 1958); its small singular values are exact enough to tell what the points do not determine. Not linear: damped
//! Gauss-Newton steps,
//! ```text
//! min over p of |r + J p|^2 + damping |D p|^2
//! ```
//! with the damping of Marquardt 1963, and D, the largest lengths that the columns of J have had, and the rules to stop of
//! More 1978.

/// Ratio of singular values below which columns leave constants to rounding.
const LEAST_RATIO: f64 = 1e-9;
/// Rounds of rotations; four columns take five.
const MOST_ROUNDS: usize = 40;
/// Relative change that counts as none.
const NO_CHANGE: f64 = 30.0 * f64::EPSILON;
/// Steps that are tried, and the damping beyond which none is left that helps.
const MOST_STEPS: usize = 600;
const MOST_DAMPING: f64 = 1e20;

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

fn length(a: &[f64]) -> f64 {
    dot(a, a).sqrt()
}

/// Turns `a` and `b` into each other.
fn rotate(a: &mut [f64], b: &mut [f64], cosine: f64, sine: f64) {
    for (a, b) in a.iter_mut().zip(b) {
        (*a, *b) = (cosine * *a - sine * *b, sine * *a + cosine * *b);
    }
}

/// Factors of the columns whose sum comes nearest to `right`; `None` where the columns do not determine them.
pub fn linear(columns: &[&[f64]], right: &[f64]) -> Option<Vec<f64>> {
    // Columns of unit length, so that the rank does not depend on the size of a constant.
    let lengths: Vec<f64> = columns.iter().map(|column| length(column)).collect();
    if lengths.iter().any(|l| !(l.is_finite() && *l > 0.0)) {
        return None;
    }
    let count = columns.len();
    let mut turned: Vec<Vec<f64>> =
        columns.iter().zip(&lengths).map(|(column, length)| column.iter().map(|x| x / length).collect()).collect();
    let unit = |k: usize| (0..count).map(|i| if i == k { 1.0 } else { 0.0 }).collect();
    let mut directions: Vec<Vec<f64>> = (0..count).map(unit).collect();
    for _ in 0..MOST_ROUNDS {
        let mut is_done = true;
        for k in 1..count {
            for i in 0..k {
                let (mine, other) = (dot(&turned[i], &turned[i]), dot(&turned[k], &turned[k]));
                let common = dot(&turned[i], &turned[k]);
                if common.abs() <= f64::EPSILON * (mine * other).sqrt() {
                    continue;
                }
                is_done = false;
                let ratio = (other - mine) / (2.0 * common);
                let tangent = ratio.signum() / (ratio.abs() + (1.0 + ratio * ratio).sqrt());
                let cosine = 1.0 / (1.0 + tangent * tangent).sqrt();
                for columns in [&mut turned, &mut directions] {
                    let (low, high) = columns.split_at_mut(k);
                    rotate(&mut low[i], &mut high[0], cosine, cosine * tangent);
                }
            }
        }
        if is_done {
            break;
        }
    }
    let sizes: Vec<f64> = turned.iter().map(|column| length(column)).collect();
    let (least, largest) = sizes.iter().fold((f64::INFINITY, 0.0_f64), |(a, b), s| (a.min(*s), b.max(*s)));
    if least < LEAST_RATIO * largest {
        return None;
    }
    let mut factors = vec![0.0; count];
    for ((column, size), direction) in turned.iter().zip(&sizes).zip(&directions) {
        let share = dot(column, right) / (size * size);
        factors.iter_mut().zip(direction).for_each(|(factor, part)| *factor += share * part);
    }
    Some(factors.iter().zip(&lengths).map(|(factor, length)| factor / length).collect())
}

/// What a search looks for: the least sum of squares.
pub trait Curve<const N: usize> {
    /// Differences from the points.
    fn residuals(&self, at: [f64; N]) -> Vec<f64>;
    /// Their derivatives by each unknown.
    fn jacobian(&self, at: [f64; N]) -> [Vec<f64>; N];
}

/// The bottom of the valley that a search from `start` comes to; `None` where it finds none.
pub fn search<const N: usize>(curve: &impl Curve<N>, start: [f64; N]) -> Option<[f64; N]> {
    let finite = |list: &[f64]| list.iter().all(|x| x.is_finite());
    let mut at = start;
    let mut residuals = curve.residuals(at);
    let mut scale = [0.0_f64; N];
    let mut damping = 1e-3;
    let mut steps = 0;
    while steps < MOST_STEPS {
        let jacobian = curve.jacobian(at);
        if !finite(&residuals) || !jacobian.iter().all(|column| finite(column)) {
            return None;
        }
        let error = length(&residuals);
        if error == 0.0 {
            return Some(at);
        }
        for (scale, column) in scale.iter_mut().zip(&jacobian) {
            *scale = scale.max(length(column));
        }
        let size = |p: [f64; N]| length(&std::array::from_fn::<f64, N, _>(|k| scale[k] * p[k]));
        // Damping upwards until a step helps.
        loop {
            steps += 1;
            if damping > MOST_DAMPING || steps > MOST_STEPS {
                return None;
            }
            let step = damped_step(&jacobian, &residuals, scale.map(|s| damping.sqrt() * s));
            let Some(step) = step else {
                damping *= 10.0;
                continue;
            };
            let next: [f64; N] = std::array::from_fn(|k| at[k] + step[k]);
            let is_short = size(step) <= NO_CHANGE * size(at);
            let promised: Vec<f64> = (0..residuals.len())
                .map(|i| residuals[i] + (0..N).map(|k| jacobian[k][i] * step[k]).sum::<f64>())
                .collect();
            let promised = 1.0 - (length(&promised) / error).powi(2);
            let found = curve.residuals(next);
            let gained = 1.0 - (length(&found) / error).powi(2);
            // What is not a number helps neither.
            let helps = gained >= 0.0;
            if helps {
                (at, residuals) = (next, found);
                damping = (0.1 * damping).max(1e-16);
            } else {
                damping *= 10.0;
            }
            if is_short || (promised <= NO_CHANGE && gained.abs() <= NO_CHANGE) {
                return Some(at);
            }
            if helps {
                break;
            }
        }
    }
    None
}

/// The step of least `|r + J p|^2 + |d p|^2`: the damping as further rows.
fn damped_step<const N: usize>(jacobian: &[Vec<f64>; N], residuals: &[f64], damping: [f64; N]) -> Option<[f64; N]> {
    let columns: [Vec<f64>; N] = std::array::from_fn(|k| {
        let mut rows = [0.0; N];
        rows[k] = damping[k];
        jacobian[k].iter().copied().chain(rows).collect()
    });
    let right: Vec<f64> = residuals.iter().map(|r| -r).chain([0.0; N]).collect();
    linear(&columns.each_ref().map(Vec::as_slice), &right)?.try_into().ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn linear_answers_are_exact_and_columns_that_agree_give_none() {
        let x: Vec<f64> = (0..20).map(|i| 0.1 * f64::from(i)).collect();
        let power = |p: i32| x.iter().map(|x| x.powi(p)).collect::<Vec<f64>>();
        let right: Vec<f64> = x.iter().map(|x| 3.0 - 2.0 * x + 5e3 * x.powi(3)).collect();
        let found = linear(&[&power(0), &power(1), &power(3)], &right).unwrap();
        for (found, expected) in found.iter().zip([3.0, -2.0, 5e3]) {
            assert!((found / expected - 1.0).abs() < 1e-9, "{found} for {expected}");
        }
        // What is left over stands across the columns.
        let found = linear(&[&power(0), &power(1)], &right).unwrap();
        let left: Vec<f64> = x.iter().zip(&right).map(|(x, right)| found[0] + found[1] * x - right).collect();
        assert!(dot(&left, &power(1)).abs() < 1e-10 * length(&left));
        let nearly: Vec<f64> = x.iter().map(|x| x * (1.0 + 1e-11 * x)).collect();
        assert_eq!(linear(&[&power(1), &nearly], &right), None);
        assert_eq!(linear(&[&power(1), &[0.0; 20]], &right), None);
    }

    /// The valley of Rosenbrock 1960, bent like a banana, from the start that everybody uses: its bottom is (1, 1).
    struct Banana;

    impl Curve<2> for Banana {
        fn residuals(&self, [x, y]: [f64; 2]) -> Vec<f64> {
            vec![10.0 * (y - x * x), 1.0 - x]
        }

        fn jacobian(&self, [x, _]: [f64; 2]) -> [Vec<f64>; 2] {
            [vec![-20.0 * x, -1.0], vec![10.0, 0.0]]
        }
    }

    #[test]
    fn a_bent_valley_is_followed_to_its_bottom() {
        let [x, y] = search(&Banana, [-1.2, 1.0]).unwrap();
        assert!((x - 1.0).abs() < 1e-9 && (y - 1.0).abs() < 1e-9, "{x} {y}");
        assert_eq!(search(&Banana, [f64::NAN, 1.0]), None);
    }
}
