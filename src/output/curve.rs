//! Figures read off the curve of axial force against depth.
//!
//! Only frames on the way in count: those deeper than every frame before them. Holding, withdrawing and frames whose
//! depth or force is not a finite number are left out.

use serde::{Deserialize, Serialize};

use crate::observables::FrameRecord;

/// Travel after the peak within which the force has to fall, and in which the force after puncture is sought [m].
pub const DROP_TRAVEL: f64 = 0.5e-3;
/// Fraction of the peak by which the force has to fall.
pub const DROP_FRACTION: f64 = 0.10;
/// Depth from which the force is expected to grow linearly [m].
pub const LINEAR_FROM: f64 = 5.0e-3;
/// The same, counted from the puncture, for insertions that end before [`LINEAR_FROM`] plus [`LINEAR_AT_LEAST`] [m].
pub const LINEAR_AFTER_PUNCTURE: f64 = 2.0e-3;
/// Shortest travel over which a slope is fitted [m].
pub const LINEAR_AT_LEAST: f64 = 1.0e-3;
/// Travel at the end of the insertion over which the force at full depth is averaged [m].
pub const END_TRAVEL: f64 = 0.25e-3;
/// Fraction of the largest force so far by which the force falls in a major drop.
pub const MAJOR_DROP: f64 = 0.15;
/// A drop smaller than this many standard deviations of the frame-to-frame noise is noise.
const NOISE_FACTOR: f64 = 4.0;
/// A peak below this fraction of the largest force is first contact, not puncture, unless the tip begins to cut there. Where it has cut nothing
/// by the end of the fall, and does so later, any peak is first contact.
const LEAST_PEAK: f64 = 0.05;
/// A tip that has cut less far has not entered the tissue, one that has cut twice as far has [m].
const ENTERED: f64 = 0.05e-3;

/// What the curve tells. `None` where the curve does not hold it.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct CurveFigures {
    /// Largest axial force on the way in [N].
    pub peak_force: Option<f64>,
    /// Axial force at the puncture peak [N].
    pub puncture_force: Option<f64>,
    /// Depth of the puncture peak [m].
    pub puncture_depth: Option<f64>,
    /// Smallest axial force within [`DROP_TRAVEL`] after the peak [N].
    pub force_after_puncture: Option<f64>,
    /// Fall of the force at puncture over the force at the peak.
    pub drop_fraction: Option<f64>,
    /// Largest depth [m].
    pub max_depth: Option<f64>,
    /// Mean axial force over the last [`END_TRAVEL`] of the insertion [N].
    pub force_at_max_depth: Option<f64>,
    /// Least-squares slope of the force over the linear part [N/m].
    pub slope_after_puncture: Option<f64>,
    /// Coefficient of determination of that fit.
    pub r2: Option<f64>,
}

impl CurveFigures {
    /// Reads the figures off the records of a run, in order of time.
    pub fn from_records(records: &[FrameRecord]) -> Self {
        let curve: Vec<Point> = frames_on_the_way_in(records)
            .map(|r| Point { depth: r.depth, force: r.force.axial, tip: r.tip_coordinate })
            .filter(|p| p.force.is_finite())
            .collect();
        let Some(end) = curve.last() else {
            return Self::default();
        };
        let peak_force = curve.iter().map(|p| p.force).fold(f64::NEG_INFINITY, f64::max);
        let at_end: Vec<f64> = curve.iter().filter(|p| p.depth >= end.depth - END_TRAVEL).map(|p| p.force).collect();
        let mut figures = Self {
            peak_force: Some(peak_force),
            max_depth: Some(end.depth),
            force_at_max_depth: Some(at_end.iter().sum::<f64>() / at_end.len() as f64),
            ..Self::default()
        };
        if let Some(puncture) =
            find_drops(&curve, &median_of_three(&curve), DROP_FRACTION, NOISE_FACTOR * frame_noise(&curve), 1).first()
        {
            figures.puncture_force = Some(puncture.force);
            figures.puncture_depth = Some(puncture.depth);
            figures.force_after_puncture = Some(puncture.force_after);
            figures.drop_fraction = Some(puncture.fraction());
        }
        let linear_from = if end.depth >= LINEAR_FROM + LINEAR_AT_LEAST {
            Some(LINEAR_FROM)
        } else {
            figures.puncture_depth.map(|d| d + LINEAR_AFTER_PUNCTURE)
        };
        if let Some(from) = linear_from
            && end.depth - from >= LINEAR_AT_LEAST
        {
            let linear: Vec<Point> = curve.iter().copied().filter(|p| p.depth >= from).collect();
            if let Some((slope, r2)) = fit_line(&linear) {
                figures.slope_after_puncture = Some(slope);
                figures.r2 = r2;
            }
        }
        figures
    }
}

/// A sudden fall of the axial force on the way in.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ForceDrop {
    /// Depth of the peak [m].
    pub depth: f64,
    /// Axial force at the peak [N].
    pub force: f64,
    /// Smallest axial force within [`DROP_TRAVEL`] after it [N].
    pub force_after: f64,
}

impl ForceDrop {
    /// Fall over the force at the peak.
    pub fn fraction(&self) -> f64 {
        (self.force - self.force_after) / self.force
    }
}

/// All falls by at least `fraction` within [`DROP_TRAVEL`], from the depths [m] and axial forces [N] of a run in order of
/// time. Every frame counts as it is, unlike in the search for the puncture.
pub fn sudden_drops(curve: &[(f64, f64)], fraction: f64) -> Vec<ForceDrop> {
    let mut deepest = f64::NEG_INFINITY;
    let mut points = Vec::new();
    for &(depth, force) in curve {
        if depth.is_finite() && depth > deepest && force.is_finite() {
            deepest = depth;
            points.push(Point { depth, force, tip: 0.0 });
        }
    }
    find_drops(&points, &points, fraction, 0.0, usize::MAX)
}

#[derive(Debug, Clone, Copy)]
struct Point {
    /// [m]
    depth: f64,
    /// Axial force [N].
    force: f64,
    /// How far the tip has cut into the material [m].
    tip: f64,
}

/// Value at `x` between the points of a curve with ascending abscissae; `None` outside.
pub fn interpolated(curve: &[(f64, f64)], x: f64) -> Option<f64> {
    let after = curve.partition_point(|p| p.0 < x);
    let b = curve.get(after)?;
    if b.0 == x {
        return Some(b.1);
    }
    let a = curve[after.checked_sub(1)?];
    Some(a.1 + (x - a.0) / (b.0 - a.0) * (b.1 - a.1))
}

/// Frames deeper than every frame before them.
pub fn frames_on_the_way_in(records: &[FrameRecord]) -> impl Iterator<Item = &FrameRecord> {
    let mut deepest = f64::NEG_INFINITY;
    records.iter().filter(move |r| {
        let deeper = r.depth.is_finite() && r.depth > deepest;
        if deeper {
            deepest = r.depth;
        }
        deeper
    })
}

/// A fall of the axial force on the way in whose size is at least [`MAJOR_DROP`] of the largest force before it.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct MajorDrop {
    /// Depth of the tip on the needle's axis at the peak [m]; it includes the dimple.
    pub depth_m: f64,
    /// How far the tip has cut into the material at the peak [m].
    pub tip_coordinate_m: f64,
    /// Axial force at the peak, and at the lowest point before it rises as much again [N].
    pub force_n: f64,
    pub force_after_n: f64,
}

/// The major drops of a curve, in order. A peak is one when the force falls below it by [`MAJOR_DROP`] of the largest force so
/// far before it rises above the peak again; the drop is over when the force has risen by as much from its lowest point.
pub fn major_drops(records: &[FrameRecord]) -> Vec<MajorDrop> {
    let frames = frames_on_the_way_in(records).filter(|r| r.force.axial.is_finite());
    let frames: Vec<&FrameRecord> = frames.collect();
    let largest = frames.iter().map(|r| r.force.axial).fold(0.0, f64::max);
    let mut drops: Vec<MajorDrop> = Vec::new();
    let (mut falling, mut running, mut extreme) = (false, 0.0_f64, None::<&FrameRecord>);
    let enters_at_all = frames.iter().any(|r| r.tip_coordinate > 2.0 * ENTERED);
    for frame in frames {
        let force = frame.force.axial;
        running = running.max(force);
        let needed = MAJOR_DROP * running;
        let before = *extreme.get_or_insert(frame);
        let further = if falling { force < before.force.axial } else { force >= before.force.axial };
        if further {
            extreme = Some(frame);
        }
        match drops.last_mut() {
            Some(drop) if falling => drop.force_after_n = drop.force_after_n.min(force),
            _ => {}
        }
        let turned = (force - before.force.axial).abs() >= needed && !further;
        let has_entered = frame.tip_coordinate > 2.0 * ENTERED;
        let enters = has_entered && before.tip_coordinate < ENTERED;
        let is_high = before.force.axial >= LEAST_PEAK * largest && (has_entered || !enters_at_all);
        if turned && !falling && (enters || is_high) {
            drops.push(MajorDrop {
                depth_m: before.depth,
                tip_coordinate_m: before.tip_coordinate,
                force_n: before.force.axial,
                force_after_n: force,
            });
        }
        if turned {
            (falling, extreme) = (!falling, Some(frame));
        }
    }
    drops
}

/// Points after index `i` within [`DROP_TRAVEL`], at least one where there is one.
fn window_after(curve: &[Point], i: usize) -> &[Point] {
    let rest = &curve[i + 1..];
    let within = rest.partition_point(|p| p.depth <= curve[i].depth + DROP_TRAVEL);
    &rest[..within.max(1).min(rest.len())]
}

/// The median of each frame and its neighbours, so that one stray frame is no peak.
fn median_of_three(curve: &[Point]) -> Vec<Point> {
    (0..curve.len())
        .map(|i| {
            let mut force = match i {
                _ if i == 0 || i + 1 == curve.len() => [curve[i].force; 3],
                _ => [curve[i - 1].force, curve[i].force, curve[i + 1].force],
            };
            force.sort_by(f64::total_cmp);
            Point { force: force[1], ..curve[i] }
        })
        .collect()
}

/// The first `at_most` peaks after which the force falls by `fraction`, and by at least `least` [N], within
/// [`DROP_TRAVEL`], before it rises above the peak again. Sought on `smooth`, which has the points of `curve`; read off
/// the curve.
fn find_drops(curve: &[Point], smooth: &[Point], fraction: f64, least: f64, at_most: usize) -> Vec<ForceDrop> {
    let mut drops = Vec::new();
    if curve.len() < 3 {
        return drops;
    }
    let largest = curve.iter().map(|p| p.force).fold(f64::NEG_INFINITY, f64::max);
    let enters_at_all = curve.iter().any(|p| p.tip > 2.0 * ENTERED);
    // The bottom of the last drop: what lies before it belongs to that drop.
    let mut from = 0;
    while drops.len() < at_most {
        let falls_after = |&i: &usize| {
            let here = smooth[i];
            let has_entered = || window_after(smooth, i).iter().any(|p| p.tip > 2.0 * ENTERED);
            let enters = || here.tip < ENTERED && has_entered();
            let is_high = || here.force >= LEAST_PEAK * largest && (!enters_at_all || has_entered());
            if here.force <= 0.0 || !(is_high() || enters()) {
                return false;
            }
            let before = smooth[from..i].iter().rev().take_while(|p| p.depth >= here.depth - DROP_TRAVEL);
            if before.map(|p| p.force).any(|force| force > here.force) {
                return false;
            }
            let drop = (fraction * here.force).max(least);
            window_after(smooth, i).iter().take_while(|p| p.force <= here.force).any(|p| p.force <= here.force - drop)
        };
        let Some(candidate) = (from..smooth.len()).find(falls_after) else { break };
        // The median flattens a sharp peak: take the largest of the three frames themselves.
        let nearby = candidate.saturating_sub(1)..=(candidate + 1).min(curve.len() - 1);
        let peak = nearby.max_by(|&a, &b| curve[a].force.total_cmp(&curve[b].force)).unwrap_or(candidate);
        let (mut bottom, mut force_after) = (peak, curve[peak].force);
        for (i, p) in window_after(curve, peak).iter().enumerate() {
            if p.force < force_after {
                (bottom, force_after) = (peak + 1 + i, p.force);
            }
        }
        drops.push(ForceDrop { depth: curve[peak].depth, force: curve[peak].force, force_after });
        from = bottom.max(candidate + 1);
    }
    drops
}

/// Standard deviation of the frame-to-frame noise [N], from the median size of the second differences: a smooth curve
/// contributes little to them, and the few frames around a puncture do not move a median.
fn frame_noise(curve: &[Point]) -> f64 {
    if curve.len() < 3 {
        return 0.0;
    }
    let mut second: Vec<f64> = curve.windows(3).map(|w| (w[0].force - 2.0 * w[1].force + w[2].force).abs()).collect();
    second.sort_by(f64::total_cmp);
    // 1.4826: median of |x| to standard deviation; the second difference of white noise has variance 6.
    1.4826 * second[second.len() / 2] / 6f64.sqrt()
}

/// Slope and coefficient of determination of the least-squares line.
fn fit_line(points: &[Point]) -> Option<(f64, Option<f64>)> {
    if points.len() < 3 {
        return None;
    }
    let n = points.len() as f64;
    let mean_depth = points.iter().map(|p| p.depth).sum::<f64>() / n;
    let mean_force = points.iter().map(|p| p.force).sum::<f64>() / n;
    let (mut sxx, mut sxy, mut syy) = (0.0, 0.0, 0.0);
    for p in points {
        let (x, y) = (p.depth - mean_depth, p.force - mean_force);
        sxx += x * x;
        sxy += x * y;
        syy += y * y;
    }
    let slope = sxy / sxx;
    let r2 = (syy > 0.0).then(|| sxy * sxy / (sxx * syy));
    slope.is_finite().then_some((slope, r2))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::observables::ForceParts;

    /// Records with a depth step of 0.05 mm and the given force law [m -> N].
    fn insertion(max_depth: f64, force: impl Fn(f64) -> f64) -> Vec<FrameRecord> {
        let step = 0.05e-3;
        (0..=(max_depth / step).round() as usize).map(|i| record(i as f64 * step, force(i as f64 * step))).collect()
    }

    fn record(depth: f64, axial: f64) -> FrameRecord {
        FrameRecord { depth, force: ForceParts { axial, ..Default::default() }, ..Default::default() }
    }

    /// Rise to 1 N at 3 mm, fall to 0.6 N within 0.2 mm, then 50 N/m.
    fn punctured(d: f64) -> f64 {
        if d <= 3e-3 {
            d / 3e-3
        } else if d <= 3.2e-3 {
            1.0 - 0.4 * (d - 3e-3) / 0.2e-3
        } else {
            0.6 + 50.0 * (d - 3.2e-3)
        }
    }

    /// Repeatable noise in -1..1 (SplitMix64).
    fn noise(i: u64) -> f64 {
        let mut z = i.wrapping_add(1).wrapping_mul(0x9E37_79B9_7F4A_7C15);
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        (z ^ (z >> 31)) as f64 / u64::MAX as f64 * 2.0 - 1.0
    }

    fn near(value: Option<f64>, expected: f64, tolerance: f64) {
        let value = value.expect("a figure");
        assert!((value - expected).abs() <= tolerance, "{value} instead of {expected}");
    }

    #[test]
    fn smooth_puncture() {
        let figures = CurveFigures::from_records(&insertion(12e-3, punctured));
        near(figures.puncture_depth, 3e-3, 1e-9);
        near(figures.puncture_force, 1.0, 1e-9);
        near(figures.force_after_puncture, 0.6, 1e-9);
        near(figures.drop_fraction, 0.4, 1e-9);
        near(figures.slope_after_puncture, 50.0, 1e-6);
        near(figures.r2, 1.0, 1e-9);
        near(figures.max_depth, 12e-3, 1e-12);
        // Mean over 11.75 to 12 mm: the line at 11.875 mm.
        near(figures.force_at_max_depth, 0.6 + 50.0 * 8.675e-3, 1e-9);
        near(figures.peak_force, 0.6 + 50.0 * 8.8e-3, 1e-9);
    }

    #[test]
    fn noise_neither_hides_nor_invents_a_puncture() {
        let mut records = insertion(12e-3, punctured);
        for (i, r) in records.iter_mut().enumerate() {
            r.force.axial += 0.02 * noise(i as u64);
        }
        let figures = CurveFigures::from_records(&records);
        near(figures.puncture_depth, 3e-3, 0.15e-3);
        near(figures.puncture_force, 1.0, 0.03);
        near(figures.force_after_puncture, 0.6, 0.03);
        near(figures.slope_after_puncture, 50.0, 1.0);

        let mut without = insertion(12e-3, |d| 100.0 * d);
        for (i, r) in without.iter_mut().enumerate() {
            r.force.axial += 0.02 * noise(i as u64);
        }
        assert_eq!(CurveFigures::from_records(&without).puncture_force, None);
    }

    #[test]
    fn one_stray_frame_is_no_puncture() {
        let mut records = insertion(12e-3, |d| 100.0 * d);
        records[100].force.axial = 2.0;
        assert_eq!(CurveFigures::from_records(&records).puncture_force, None);
    }

    #[test]
    fn without_a_drop_there_is_no_puncture() {
        let figures = CurveFigures::from_records(&insertion(8e-3, |d| 100.0 * d));
        assert_eq!(figures.puncture_force, None);
        assert_eq!(figures.force_after_puncture, None);
        near(figures.slope_after_puncture, 100.0, 1e-9);
        near(figures.peak_force, 0.8, 1e-9);
    }

    /// Liver before a gallbladder that takes a hundred times its force.
    #[test]
    fn a_soft_surface_before_tough_tissue_is_punctured() {
        let mut records = insertion(12e-3, |d| if d < 8e-3 { 0.02 * punctured(d) } else { 0.02 + 600.0 * (d - 8e-3) });
        let figures = CurveFigures::from_records(&records);
        assert_eq!((figures.puncture_force, major_drops(&records)), (None, vec![]));
        records
            .iter_mut()
            .for_each(|r| r.tip_coordinate = (r.depth - 2.95e-3).max(0.0) * if r.depth > 3.02e-3 { 1.0 } else { 0.0 });
        let figures = CurveFigures::from_records(&records);
        near(figures.puncture_force, 0.02, 1e-9);
        near(figures.puncture_depth, 3e-3, 1e-9);
        let drops = major_drops(&records);
        assert_eq!(drops.len(), 1, "{drops:?}");
        near(Some(drops[0].depth_m), 3e-3, 1e-9);
        // The needle sets the surface moving at once: a peak of half the largest force, before anything is cut.
        records.truncate(160);
        records[1].force.axial = 0.01;
        records[2].force.axial = 0.008;
        near(CurveFigures::from_records(&records).puncture_depth, 3e-3, 1e-9);
        assert_eq!(major_drops(&records).len(), 1);
    }

    #[test]
    fn a_slow_fall_is_no_puncture() {
        // 10 % over 1 mm.
        let figures =
            CurveFigures::from_records(&insertion(
                4e-3,
                |d| {
                    if d < 3e-3 { d / 3e-3 } else { 1.0 - 100.0 * (d - 3e-3) }
                },
            ));
        assert_eq!(figures.puncture_force, None);
    }

    #[test]
    fn the_first_of_two_drops_counts() {
        let second = |d: f64| {
            if d < 8e-3 { punctured(d) } else { punctured(d) - 0.4 }
        };
        let figures = CurveFigures::from_records(&insertion(12e-3, second));
        near(figures.puncture_depth, 3e-3, 1e-9);
    }

    #[test]
    fn all_drops_of_a_saw_are_counted() {
        // Teeth of 1 mm: up by 0.5 N, down by 0.2 N within 0.1 mm.
        let saw = |d: f64| {
            let (tooth, within) = ((d / 1e-3).floor(), (d / 1e-3).fract());
            0.3 * tooth + if within <= 0.9 { 0.5 * within / 0.9 } else { 0.5 - 0.2 * (within - 0.9) / 0.1 }
        };
        let curve: Vec<(f64, f64)> = insertion(6.05e-3, saw)
            .iter()
            .chain(&insertion(3e-3, |_| -1.0))
            .map(|r| (r.depth, r.force.axial))
            .collect();
        let drops = sudden_drops(&curve, 0.05);
        assert_eq!(drops.len(), 6, "{drops:?}");
        for (tooth, drop) in drops.iter().enumerate() {
            near(Some(drop.depth), 1e-3 * tooth as f64 + 0.9e-3, 0.06e-3);
            near(Some(drop.force - drop.force_after), 0.2, 0.08);
        }
        assert_eq!(sudden_drops(&curve, 0.3).len(), 1);
        assert!(sudden_drops(&[], 0.1).is_empty());
    }

    #[test]
    fn withdrawal_is_left_out() {
        let mut records = insertion(12e-3, punctured);
        for i in 0..100 {
            records.push(record(12e-3 - i as f64 * 0.1e-3, -5.0));
        }
        let figures = CurveFigures::from_records(&records);
        near(figures.force_at_max_depth, 0.6 + 50.0 * 8.675e-3, 1e-9);
        near(figures.puncture_depth, 3e-3, 1e-9);
    }

    #[test]
    fn a_shallow_insertion_is_fitted_from_the_puncture() {
        let shallow = |d: f64| punctured(d + 2e-3);
        let figures = CurveFigures::from_records(&insertion(4.5e-3, shallow));
        near(figures.puncture_depth, 1e-3, 1e-9);
        near(figures.slope_after_puncture, 50.0, 1e-6);
        let too_short = CurveFigures::from_records(&insertion(3.5e-3, shallow));
        assert_eq!(too_short.slope_after_puncture, None);
    }

    #[test]
    fn major_drops_are_counted_once() {
        // Up to 1 N, down to 0.6, up to 1.2, a ripple of 0.1, down to 0.8 in two stairs.
        let law = |d: f64| {
            let points = [
                (0.0, 0.0),
                (3.0, 1.0),
                (3.3, 0.6),
                (6.0, 1.2),
                (6.3, 1.1),
                (6.6, 1.19),
                (7.0, 1.0),
                (7.3, 1.1),
                (8.0, 0.8),
            ];
            let after = points.partition_point(|p| p.0 * 1e-3 <= d).clamp(1, points.len() - 1);
            let (a, b) = (points[after - 1], points[after]);
            a.1 + (b.1 - a.1) * (d * 1e3 - a.0) / (b.0 - a.0)
        };
        let mut records = insertion(8e-3, law);
        for i in 0..50 {
            records.push(record(8e-3 - f64::from(i) * 0.1e-3, -1.0));
        }
        let drops = major_drops(&records);
        assert_eq!(drops.len(), 2, "{drops:?}");
        for (drop, (depth, force, after)) in drops.iter().zip([(3e-3, 1.0, 0.6), (6e-3, 1.2, 0.8)]) {
            near(Some(drop.depth_m), depth, 1e-9);
            near(Some(drop.force_n), force, 1e-9);
            near(Some(drop.force_after_n), after, 1e-9);
        }
        assert!(major_drops(&insertion(8e-3, |d| 100.0 * d)).is_empty());
    }

    #[test]
    fn nothing_and_not_a_number() {
        assert_eq!(CurveFigures::from_records(&[]), CurveFigures::default());
        let broken = [record(f64::NAN, 1.0), record(1e-3, f64::NAN)];
        assert_eq!(CurveFigures::from_records(&broken), CurveFigures::default());
        let mut records = insertion(12e-3, punctured);
        records[60].force.axial = f64::NAN;
        records[61].depth = f64::NAN;
        near(CurveFigures::from_records(&records).puncture_depth, 3e-3, 0.11e-3);
        let one = CurveFigures::from_records(&[record(0.0, 0.5)]);
        assert_eq!(one.peak_force, Some(0.5));
        assert_eq!(one.slope_after_puncture, None);
    }
}
