//! How far the outside of a needle is from what it has to stay away from: of the tip, and of the shaft behind the tip's cone with its radius
//! taken off.
//!
//! The obstacle is a place, it does not move with the tissue; the shaft is straight. A region is known by points of a lattice at its border, to
//! a quarter of a millimetre; whether the tip is in it is asked of the region itself. They are found once and lie in bins with a ball around each, so that a pose looks at few of them.

use std::collections::BTreeMap;

use glam::DVec3;
use rayon::prelude::*;

use super::kinematic::Sample;
use crate::scene::{Obstacle, RegionShape, Scene};

/// Distance of the points that stand for a region [m].
const POINT_STEP: f64 = 0.5e-3;
/// Edge of a bin [m].
const BIN: f64 = 5e-3;
/// Way of a tip that is not looked at again [m].
const STANDING: f64 = 1e-6;

/// One obstacle, ready to be measured from.
#[derive(Debug, Clone)]
pub struct Clearance {
    /// Axes of round bodies, a point is one of no length; bin after bin.
    axes: Vec<[DVec3; 2]>,
    bins: Vec<Bin>,
    /// Of the bodies [m].
    radius: f64,
    /// Of the needle [m].
    needle_radius: f64,
    tip_length: f64,
    length: f64,
    /// The region itself: a tip in it touches it, wherever the points are.
    region: Option<RegionShape>,
}

/// Some of the axes and the ball that holds them.
#[derive(Debug, Clone)]
struct Bin {
    centre: DVec3,
    radius: f64,
    from: usize,
    to: usize,
}

impl Clearance {
    /// An obstacle for the needle of a scene; `None` without one. The points of a region are found here, which takes a tenth of a second.
    pub fn new(scene: &Scene, obstacle: &Obstacle) -> Option<Clearance> {
        let needle = scene.needle()?;
        let (axes, radius) = match *obstacle {
            Obstacle::Sphere { centre, radius } => (vec![[centre, centre]], radius),
            Obstacle::Cylinder { from, to, radius } => (vec![[from, to]], radius),
            Obstacle::Region(index) => {
                (points_of_region(scene, index).into_iter().map(|x| [x, x]).collect(), 0.5 * POINT_STEP)
            }
        };
        let (axes, bins) = binned(axes);
        let length = needle.length.max(needle.tip_length);
        let region = match *obstacle {
            Obstacle::Region(index) => scene.regions.get(index).map(|region| region.shape.clone()),
            _ => None,
        };
        let (needle_radius, tip_length) = (needle.radius, needle.tip_length);
        Some(Clearance { axes, bins, radius, needle_radius, tip_length, length, region })
    }

    /// Distance of a needle whose tip is at `tip` [m], negative inside the obstacle; infinite where there is none of it.
    pub fn of(&self, tip: DVec3, direction: DVec3) -> f64 {
        let behind = |s: f64| tip - direction * s;
        let shaft = [behind(self.tip_length), behind(self.length)];
        let distance = |axis: [DVec3; 2]| {
            let of_tip = segment_distance([tip; 2], axis);
            of_tip.min(segment_distance(shaft, axis) - self.needle_radius) - self.radius
        };
        // No axis of a bin is nearer than this.
        let bound = |bin: &Bin| distance([bin.centre; 2]) - bin.radius - 1e-9;
        let least =
            |bin: &Bin| self.axes[bin.from..bin.to].iter().map(|axis| distance(*axis)).fold(f64::INFINITY, f64::min);
        let bounds: Vec<f64> = self.bins.iter().map(bound).collect();
        let Some(first) = (0..bounds.len()).min_by(|a, b| bounds[*a].total_cmp(&bounds[*b])) else {
            return f64::INFINITY;
        };
        let mut nearest = least(&self.bins[first]);
        for (n, bin) in self.bins.iter().enumerate() {
            if n != first && bounds[n] < nearest {
                nearest = nearest.min(least(bin));
            }
        }
        // Bone stops a tip before the points of its border are reached.
        if self.region.as_ref().is_some_and(|region| region.contains(tip)) { nearest.min(0.0) } else { nearest }
    }

    /// The sample at which the needle is nearest, and how near [m]; `None` without a sample.
    pub fn nearest(&self, samples: &[Sample]) -> Option<(usize, f64)> {
        // A needle that stands adds nothing.
        let mut last: Option<&Sample> = None;
        let moved = samples.iter().enumerate().filter(|(_, sample)| {
            let stands = last.is_some_and(|l| l.tip.distance(sample.tip) < STANDING && l.direction == sample.direction);
            if !stands {
                last = Some(sample);
            }
            !stands
        });
        let measured = moved.map(|(index, sample)| (index, self.of(sample.tip, sample.direction)));
        measured.reduce(|a, b| if b.1 < a.1 { b } else { a }).filter(|(_, distance)| distance.is_finite())
    }

    /// Length of the needle that is measured from [m].
    pub fn length(&self) -> f64 {
        self.length
    }

    /// Middles of the axes, at most `most` of them, for a drawing [m].
    pub fn points(&self, most: usize) -> Vec<DVec3> {
        let every = self.axes.len().div_ceil(most.max(1)).max(1);
        self.axes.iter().step_by(every).map(|[from, to]| 0.5 * (*from + *to)).collect()
    }
}

/// Axes sorted into bins by their middles.
fn binned(axes: Vec<[DVec3; 2]>) -> (Vec<[DVec3; 2]>, Vec<Bin>) {
    let middle = |axis: &[DVec3; 2]| 0.5 * (axis[0] + axis[1]);
    let mut cells: BTreeMap<[i32; 3], Vec<[DVec3; 2]>> = BTreeMap::new();
    for axis in axes {
        let cell = (middle(&axis) / BIN).floor().to_array().map(|n| n as i32);
        cells.entry(cell).or_default().push(axis);
    }
    let (mut sorted, mut bins) = (Vec::new(), Vec::with_capacity(cells.len()));
    for cell in cells.into_values() {
        let centre = cell.iter().map(middle).sum::<DVec3>() / cell.len() as f64;
        let radius = cell.iter().flatten().map(|x| x.distance(centre)).fold(0.0, f64::max);
        bins.push(Bin { centre, radius, from: sorted.len(), to: sorted.len() + cell.len() });
        sorted.extend(cell);
    }
    (sorted, bins)
}

/// Points on a lattice that lie at the border of a region, within the block of the scene [m].
fn points_of_region(scene: &Scene, index: usize) -> Vec<DVec3> {
    let size = scene.tissue.size;
    let low = DVec3::new(-0.5 * size.x, -0.5 * size.y, -size.z);
    let counts = ((size + DVec3::Z * scene.tissue.top) / POINT_STEP).floor();
    let [nx, ny, nz] = counts.to_array().map(|n| n.max(1.0) as usize);
    let inside: Vec<bool> =
        (0..nx * ny * nz).into_par_iter().map(|n| scene.region_at(low + lattice(n, nx, ny)) == Some(index)).collect();
    let at = |i: usize, j: usize, k: usize| inside[(k * ny + j) * nx + i];
    (0..inside.len())
        .filter(|n| inside[*n])
        .filter(|n| {
            let (i, j, k) = (n % nx, n / nx % ny, n / (nx * ny));
            let border = i == 0 || j == 0 || k == 0 || i + 1 == nx || j + 1 == ny || k + 1 == nz;
            border
                || !(at(i - 1, j, k) && at(i + 1, j, k) && at(i, j - 1, k) && at(i, j + 1, k))
                || !(at(i, j, k - 1) && at(i, j, k + 1))
        })
        .map(|n| low + lattice(n, nx, ny))
        .collect()
}

/// Middle of a cube of the lattice.
fn lattice(n: usize, nx: usize, ny: usize) -> DVec3 {
    DVec3::new((n % nx) as f64 + 0.5, (n / nx % ny) as f64 + 0.5, (n / (nx * ny)) as f64 + 0.5) * POINT_STEP
}

/// Least distance of two straight lines between points [m]; a line may be a point.
fn segment_distance([p, p_end]: [DVec3; 2], [q, q_end]: [DVec3; 2]) -> f64 {
    let (d, e, r) = (p_end - p, q_end - q, p - q);
    let (a, b, c) = (d.length_squared(), d.dot(e), e.length_squared());
    let (f, g) = (d.dot(r), e.dot(r));
    let determinant = a * c - b * b;
    let part = |numerator: f64, denominator: f64| {
        if denominator > 0.0 { (numerator / denominator).clamp(0.0, 1.0) } else { 0.0 }
    };
    // Along the first where the lines are closest, any place where they are parallel; then the foot on the second, and back.
    let s = if determinant > 1e-12 * a * c { part(b * g - c * f, determinant) } else { 0.0 };
    let t = part(b * s + g, c);
    let s = part(b * t - f, a);
    (p + d * s).distance(q + e * t)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn distances_of_segments() {
        let v = DVec3::new;
        for (first, second, expected) in [
            // Crossing at a height of 2.
            ([v(-1.0, 0.0, 2.0), v(1.0, 0.0, 2.0)], [v(0.0, -1.0, 0.0), v(0.0, 1.0, 0.0)], 2.0),
            // End to end, 3-4-5.
            ([v(0.0, 0.0, 0.0), v(1.0, 0.0, 0.0)], [v(4.0, 4.0, 0.0), v(9.0, 9.0, 0.0)], 5.0),
            // Parallel beside each other, and behind each other.
            ([v(0.0, 0.0, 0.0), v(4.0, 0.0, 0.0)], [v(1.0, 3.0, 0.0), v(9.0, 3.0, 0.0)], 3.0),
            ([v(0.0, 0.0, 0.0), v(4.0, 0.0, 0.0)], [v(9.0, 0.0, 0.0), v(6.0, 0.0, 0.0)], 2.0),
            // Points.
            ([v(1.0, 1.0, 0.0); 2], [v(-5.0, 0.0, 0.0), v(5.0, 0.0, 0.0)], 1.0),
            ([v(-5.0, 0.0, 0.0), v(5.0, 0.0, 0.0)], [v(8.0, 4.0, 0.0); 2], 5.0),
            ([v(1.0, 0.0, 0.0); 2], [v(1.0, 0.0, 7.0); 2], 7.0),
            // The foot on the second line lies beyond its end.
            ([v(0.0, 0.0, 0.0), v(10.0, 0.0, 0.0)], [v(5.0, 5.0, 0.0), v(5.0, 2.0, 0.0)], 2.0),
        ] {
            for pair in [[first, second], [second, first], [[first[1], first[0]], second]] {
                let found = segment_distance(pair[0], pair[1]);
                assert!((found - expected).abs() < 1e-12, "{pair:?}: {found} instead of {expected}");
            }
        }
    }
}
