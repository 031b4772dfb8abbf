//! What a few samples say: how well two groups are told apart, whether two figures say the same, which way a figure goes.
//!
//! ```text
//! AUC        P(x > y) + P(x = y)/2 for x of the one group and y of the other: 1/2 where they are alike     (Mann and Whitney 1947)
//! interval   95 %, the variance of DeLong, DeLong and Clarke-Pearson (1988), on the scale of the logit so that it stays within
//!            0 and 1; where no pair is the other way round, that variance is 0: the score interval of Newcombe (2006), method 5
//! rank correlation   Spearman's, ties share their ranks
//! slope      median of the slopes of all pairs (Theil 1950, Sen 1968): one odd attempt does not turn it
//! ```

use serde::{Deserialize, Serialize};

/// Quantile of the normal distribution for 95 % on both sides.
const Z: f64 = 1.959_963_984_540_054;

/// How well two groups are told apart.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Auc {
    pub value: f64,
    /// Ends of the 95 % interval.
    pub low: f64,
    pub high: f64,
}

/// Part of 1 that a pair adds.
fn order(x: f64, y: f64) -> f64 {
    match x.total_cmp(&y) {
        std::cmp::Ordering::Greater => 1.0,
        std::cmp::Ordering::Equal => 0.5,
        std::cmp::Ordering::Less => 0.0,
    }
}

fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len() as f64
}

/// Mean square deviation with n - 1.
fn variance(values: &[f64]) -> f64 {
    let mean = mean(values);
    values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / (values.len() as f64 - 1.0)
}

/// The AUC of `high` over `low` without its interval; `None` where a group is empty.
pub fn auc_value(high: &[f64], low: &[f64]) -> Option<f64> {
    let parts: Vec<f64> = high.iter().map(|x| mean(&low.iter().map(|y| order(*x, *y)).collect::<Vec<_>>())).collect();
    (!high.is_empty() && !low.is_empty()).then(|| mean(&parts))
}

/// Variance of the AUC by DeLong and others.
pub fn delong_variance(high: &[f64], low: &[f64]) -> f64 {
    let of_high: Vec<f64> = high.iter().map(|x| mean(&low.iter().map(|y| order(*x, *y)).collect::<Vec<_>>())).collect();
    let of_low: Vec<f64> = low.iter().map(|y| mean(&high.iter().map(|x| order(*x, *y)).collect::<Vec<_>>())).collect();
    variance(&of_high) / high.len() as f64 + variance(&of_low) / low.len() as f64
}

/// Probability that a value of `high` is above one of `low`, with its interval; `None` with fewer than two values in a group.
pub fn auc(high: &[f64], low: &[f64]) -> Option<Auc> {
    let value = auc_value(high, low)?;
    if high.len() < 2 || low.len() < 2 {
        return None;
    }
    let error = delong_variance(high, low).sqrt();
    if value <= 0.0 || value >= 1.0 || error == 0.0 {
        let [low, high] = score_interval(value, high.len() as f64, low.len() as f64);
        return Some(Auc { value, low, high });
    }
    let logit = (value / (1.0 - value)).ln();
    let half = Z * error / (value * (1.0 - value));
    let back = |x: f64| 1.0 / (1.0 + (-x).exp());
    Some(Auc { value, low: back(logit - half), high: back(logit + half) })
}

/// The AUCs t with |value - t| = Z sqrt(V(t)), V that of two exponential groups of equal size.
fn score_interval(value: f64, m: f64, n: f64) -> [f64; 2] {
    let size = 0.5 * (m + n) - 1.0;
    let variance = |t: f64| t * (1.0 - t) * (1.0 + size * ((1.0 - t) / (2.0 - t) + t / (1.0 + t))) / (m * n);
    let end = |mut out: f64| {
        let mut inside = value;
        for _ in 0..60 {
            let middle = 0.5 * (inside + out);
            if (middle - value).abs() < Z * variance(middle).sqrt() { inside = middle } else { out = middle }
        }
        inside
    };
    [end(0.0), end(1.0)]
}

/// Ranks from 1, ties with the mean of theirs.
fn ranks(values: &[f64]) -> Vec<f64> {
    let mut places: Vec<usize> = (0..values.len()).collect();
    places.sort_by(|a, b| values[*a].total_cmp(&values[*b]));
    let mut ranks = vec![0.0; values.len()];
    let mut begin = 0;
    while begin < places.len() {
        let same = places[begin..].iter().take_while(|p| values[**p] == values[places[begin]]).count().max(1);
        for place in &places[begin..begin + same] {
            ranks[*place] = begin as f64 + 0.5 * (same as f64 + 1.0);
        }
        begin += same;
    }
    ranks
}

/// Spearman's rank correlation of pairs; `None` with fewer than three, or where one side is constant.
pub fn rank_correlation(pairs: &[(f64, f64)]) -> Option<f64> {
    let [x, y] =
        [ranks(&pairs.iter().map(|p| p.0).collect::<Vec<_>>()), ranks(&pairs.iter().map(|p| p.1).collect::<Vec<_>>())];
    if pairs.len() < 3 {
        return None;
    }
    let (mx, my) = (mean(&x), mean(&y));
    let sum = |f: &dyn Fn(usize) -> f64| (0..pairs.len()).map(f).sum::<f64>();
    let (xy, xx, yy) =
        (sum(&|i| (x[i] - mx) * (y[i] - my)), sum(&|i| (x[i] - mx).powi(2)), sum(&|i| (y[i] - my).powi(2)));
    (xx > 0.0 && yy > 0.0).then(|| xy / (xx * yy).sqrt())
}

/// The middle value; the mean of the two in the middle. `None` without values.
pub fn median(values: &[f64]) -> Option<f64> {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    let half = sorted.len() / 2;
    match sorted.len() {
        0 => None,
        n if n % 2 == 1 => Some(sorted[half]),
        _ => Some(0.5 * (sorted[half - 1] + sorted[half])),
    }
}

/// Change of y per unit of x over (x, y): the median of the slopes of all pairs; `None` without two different x.
pub fn slope(points: &[(f64, f64)]) -> Option<f64> {
    let mut slopes = Vec::new();
    for (i, a) in points.iter().enumerate() {
        slopes.extend(points[i + 1..].iter().filter(|b| b.0 != a.0).map(|b| (b.1 - a.1) / (b.0 - a.0)));
    }
    median(&slopes)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::stability::random::numbers::Numbers;

    fn near(found: f64, expected: f64, tolerance: f64) {
        assert!((found - expected).abs() <= tolerance, "{found} instead of {expected}");
    }

    #[test]
    fn auc_by_hand() {
        // Of the 6 pairs (3|1 2.5) (2|1 2.5) (2.5|1 2.5): 2 + 1 + 1.5.
        let (high, low) = ([3.0, 2.0, 2.5], [1.0, 2.5]);
        near(auc_value(&high, &low).unwrap(), 4.5 / 6.0, 1e-15);
        // Means over the low of the high: 1, 1/2, 3/4; over the high of the low: 1, 1/2. Variances 1/16 and 1/8.
        near(delong_variance(&high, &low), 1.0 / 16.0 / 3.0 + 1.0 / 8.0 / 2.0, 1e-15);
        assert_eq!(auc_value(&[], &low), None);
        assert_eq!(auc(&[1.0], &low), None);
    }

    /// Two normal groups d deviations apart have the AUC Phi(d / sqrt 2), and 95 % of the intervals hold it.
    #[test]
    fn intervals_hold_the_auc_of_normal_groups() {
        // Phi(1 / sqrt 2).
        let truth = 0.760_249_938_906_523_3;
        let mut numbers = Numbers::of(7, 0);
        let (mut held, mut sum, rounds) = (0, 0.0, 2000);
        for _ in 0..rounds {
            let low: Vec<f64> = (0..40).map(|_| numbers.normal()).collect();
            let high: Vec<f64> = (0..60).map(|_| 1.0 + numbers.normal()).collect();
            let found = auc(&high, &low).unwrap();
            held += u32::from(found.low <= truth && truth <= found.high);
            sum += found.value;
        }
        near(sum / f64::from(rounds), truth, 0.004);
        let part = f64::from(held) / f64::from(rounds);
        assert!((0.935..=0.965).contains(&part), "{part}");
    }

    #[test]
    fn groups_apart_keep_an_open_end() {
        let low: Vec<f64> = (0..67).map(f64::from).collect();
        let high: Vec<f64> = low.iter().map(|x| x + 100.0).collect();
        let found = auc(&high, &low).unwrap();
        assert_eq!((found.value, found.high), (1.0, 1.0));
        assert!(found.low > 0.9 && found.low < 0.99, "{}", found.low);
        let turned = auc(&low, &high).unwrap();
        near(turned.high, 1.0 - found.low, 1e-9);
        // All alike: no order, and nothing is known.
        let same = auc(&[1.0; 10], &[1.0; 10]).unwrap();
        assert!(same.value == 0.5 && same.low < 0.3 && same.high > 0.7, "{same:?}");
    }

    #[test]
    fn ranks_and_slopes() {
        assert_eq!(ranks(&[10.0, 20.0, 10.0, 5.0]), [2.5, 4.0, 2.5, 1.0]);
        let cubes: Vec<(f64, f64)> = (0..9).map(|i| (f64::from(i), f64::from(i).powi(3))).collect();
        near(rank_correlation(&cubes).unwrap(), 1.0, 1e-15);
        // 1 - 6 sum d^2 / (n (n^2 - 1)) with d = 0, 1, -1, 0, 0.
        let pairs = [(1.0, 1.0), (2.0, 3.0), (3.0, 2.0), (4.0, 4.0), (5.0, 5.0)];
        near(rank_correlation(&pairs).unwrap(), 1.0 - 12.0 / 120.0, 1e-15);
        assert_eq!(rank_correlation(&[(1.0, 2.0); 5]), None);
        // One attempt that went wrong does not turn a line of slope 2.
        let mut line: Vec<(f64, f64)> = (0..9).map(|i| (f64::from(i), 2.0 * f64::from(i))).collect();
        line[4].1 = -100.0;
        near(slope(&line).unwrap(), 2.0, 1e-12);
        assert_eq!(slope(&[(1.0, 2.0), (1.0, 3.0)]), None);
        assert_eq!((median(&[]), median(&[3.0, 1.0, 2.0, 10.0])), (None, Some(2.5)));
    }
}
