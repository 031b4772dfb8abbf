//! A label map as it lies in a scene: turned so that the grid follows the needle, and asked at points.
//!
//! The label at a point is the one with the largest trilinear weight among the eight voxels around it: the boundary between two labels
//! is then as smooth as voxels let it be, without the steps of the nearest voxel.

use std::ops::RangeInclusive;
use std::sync::Arc;

use glam::{DMat3, DVec3};

use super::LabelMap;

/// How far from a point of entry its skin is looked for [m].
const REACH_OF_SKIN: f64 = 60e-3;
/// Step of that search; thinner skins and gaps are passed over [m].
const SEARCH_STEP: f64 = 0.1e-3;

/// Where the scene lies in the patient: `patient = origin + axes * scene`, all in metres, the patient in RAS.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Frame {
    /// The axes of the scene in the patient, as columns: a rotation.
    pub axes: DMat3,
    /// The origin of the scene in the patient, RAS [m].
    pub origin: DVec3,
}

impl Frame {
    /// The axes of the patient.
    pub fn of_patient(origin: DVec3) -> Self {
        Frame { axes: DMat3::IDENTITY, origin }
    }

    /// The frame of a needle: z against its `direction`, x as near to the patient's right as that allows, or to the front where the
    /// needle runs from side to side.
    pub fn of_needle(entry: DVec3, direction: DVec3) -> Self {
        let z = -direction.normalize();
        let side = if z.x.abs() < 0.9 { DVec3::X } else { DVec3::Y };
        let x = (side - z * side.dot(z)).normalize();
        Frame { axes: DMat3::from_cols(x, z.cross(x), z), origin: entry }
    }

    /// A point of the scene in the patient, RAS [m].
    pub fn to_patient(&self, x: DVec3) -> DVec3 {
        self.origin + self.axes * x
    }

    /// A point of the patient in the scene [m].
    pub fn to_scene(&self, x: DVec3) -> DVec3 {
        self.axes.transpose() * (x - self.origin)
    }
}

/// A label map in a scene.
#[derive(Debug, Clone, PartialEq)]
pub struct Case {
    /// The volume.
    pub map: Arc<LabelMap>,
    /// Where the scene lies in it.
    pub frame: Frame,
    /// Index of a voxel, not whole, from a point of the scene: `index = from_scene * x + offset`.
    from_scene: DMat3,
    offset: DVec3,
}

impl Case {
    /// The volume seen from a frame.
    pub fn new(map: Arc<LabelMap>, frame: Frame) -> Self {
        let inverse = map.steps.inverse();
        let (from_scene, offset) = (inverse * frame.axes, inverse * (frame.origin - map.origin));
        Case { map, frame, from_scene, offset }
    }

    /// Calls `visit` with label and trilinear weight of the eight voxels around a point of the scene; outside the volume is label 0.
    #[inline]
    fn around(&self, x: DVec3, mut visit: impl FnMut(u16, f64)) {
        let at = self.from_scene * x + self.offset;
        let low = at.floor();
        let part = at - low;
        let [nx, ny, nz] = self.map.size.map(|n| n as i64);
        let low = [low.x as i64, low.y as i64, low.z as i64];
        for corner in 0..8i64 {
            let [a, b, c] = [corner & 1, corner >> 1 & 1, corner >> 2];
            let [i, j, k] = [low[0] + a, low[1] + b, low[2] + c];
            let share = |bit: i64, part: f64| if bit == 1 { part } else { 1.0 - part };
            let weight = share(a, part.x) * share(b, part.y) * share(c, part.z);
            let inside = (0..nx).contains(&i) && (0..ny).contains(&j) && (0..nz).contains(&k);
            let label = if inside { self.map.labels[((k * ny + j) * nx + i) as usize] } else { 0 };
            visit(label, weight);
        }
    }

    /// Label at a point of the scene [m]; 0: nothing is there.
    pub fn label_at(&self, x: DVec3) -> u16 {
        let mut found = [(0u16, 0.0f64); 8];
        let mut count = 0;
        self.around(x, |label, weight| match found[..count].iter_mut().find(|(known, _)| *known == label) {
            Some((_, sum)) => *sum += weight,
            None => {
                found[count] = (label, weight);
                count += 1;
            }
        });
        let best = found[1..count].iter().fold(found[0], |best, other| if other.1 > best.1 { *other } else { best });
        best.0
    }

    /// Part of the surroundings of a point of the scene that is something, 0 to 1; one half at the surface.
    pub fn fill_at(&self, x: DVec3) -> f64 {
        let mut fill = 0.0;
        self.around(x, |label, weight| fill += if label != 0 { weight } else { 0.0 });
        fill
    }

    /// Distance from `x` along the unit vector `direction` at which something begins, the nearest within `reach` before or behind [m].
    pub fn surface_along(&self, x: DVec3, direction: DVec3, reach: f64) -> Option<f64> {
        let is_inside = |s: f64| self.fill_at(x + direction * s) >= 0.5;
        let steps = (reach / SEARCH_STEP).ceil() as i64;
        let mut best: Option<f64> = None;
        let mut before = is_inside(-reach);
        for i in -steps + 1..=steps {
            let s = i as f64 * SEARCH_STEP;
            let now = is_inside(s);
            if now && !before && best.is_none_or(|b| s.abs() < b.abs()) {
                let (mut low, mut high) = (s - SEARCH_STEP, s);
                for _ in 0..40 {
                    let middle = 0.5 * (low + high);
                    if is_inside(middle) {
                        high = middle;
                    } else {
                        low = middle;
                    }
                }
                best = Some(high);
            }
            before = now;
        }
        best
    }

    /// Where the line from `entry` in `direction` meets the skin: the distance from `entry` [m], both in the scene.
    pub fn skin_along(&self, entry: DVec3, direction: DVec3) -> Option<f64> {
        self.surface_along(entry, direction, REACH_OF_SKIN)
    }

    /// Height of the skin of the scene at a place across, looked for from the upper end of `heights` to the lower [m].
    pub fn skin_over(&self, x: f64, y: f64, heights: RangeInclusive<f64>) -> Option<f64> {
        let (bottom, top) = (*heights.start(), *heights.end());
        let is_inside = |z: f64| self.fill_at(DVec3::new(x, y, z)) >= 0.5;
        let steps = ((top - bottom) / SEARCH_STEP).ceil() as usize;
        let first = (0..=steps).map(|i| (top - i as f64 * SEARCH_STEP).max(bottom)).find(|z| is_inside(*z))?;
        let (mut inside, mut outside) = (first, (first + SEARCH_STEP).min(top));
        for _ in 0..30 {
            let middle = 0.5 * (inside + outside);
            if is_inside(middle) {
                inside = middle;
            } else {
                outside = middle;
            }
        }
        Some(inside)
    }

    /// The box around all labels in the scene [m]; `None` where there are none.
    pub fn bounds(&self) -> Option<(DVec3, DVec3)> {
        let [nx, ny, _] = self.map.size;
        let (mut low, mut high) = ([usize::MAX; 3], [0usize; 3]);
        for (row, labels) in self.map.labels.chunks(nx).enumerate() {
            let Some(first) = labels.iter().position(|l| *l != 0) else { continue };
            let last = labels.iter().rposition(|l| *l != 0).unwrap_or(first);
            for (a, (from, to)) in [(first, last), (row % ny, row % ny), (row / ny, row / ny)].into_iter().enumerate() {
                low[a] = low[a].min(from);
                high[a] = high[a].max(to);
            }
        }
        if low[0] > high[0] {
            return None;
        }
        let corner = |bits: usize| {
            let at = |a: usize| if bits >> a & 1 == 1 { high[a] as f64 + 0.5 } else { low[a] as f64 - 0.5 };
            self.frame.to_scene(self.map.origin + self.map.steps * DVec3::new(at(0), at(1), at(2)))
        };
        let first = (DVec3::INFINITY, DVec3::NEG_INFINITY);
        Some((0..8).map(corner).fold(first, |(low, high), x| (low.min(x), high.max(x))))
    }
}
