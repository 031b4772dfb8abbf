//! A label map: a small number per voxel that says what is there, and where the voxels lie in the patient.

use std::collections::BTreeMap;
use std::fmt;
use std::hash::{DefaultHasher, Hash, Hasher};

use glam::{DMat3, DVec3};

use crate::mesh::Placement;

/// Most voxels of a volume: a whole body at 1 mm has 2e8.
pub const MOST_VOXELS: usize = 300_000_000;

/// Labels on a regular grid of voxels, in patient coordinates RAS (x to the right, y to the front, z to the head).
#[derive(Clone, PartialEq, Default)]
pub struct LabelMap {
    /// Voxels along i, j, k.
    pub size: [usize; 3],
    /// Step from a voxel to the next along i, j, k, as columns, RAS [m]; never singular, possibly mirrored.
    pub steps: DMat3,
    /// Centre of voxel (0, 0, 0), RAS [m].
    pub origin: DVec3,
    /// Label of every voxel, i fastest, then j; 0: nothing.
    pub labels: Vec<u16>,
    /// Names that the file gives to labels.
    pub names: BTreeMap<u16, String>,
}

/// A hash stands for the labels: scenes are told apart by this text, and written out millions of labels took longer than a scene to load.
impl fmt::Debug for LabelMap {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        let mut hasher = DefaultHasher::new();
        self.labels.hash(&mut hasher);
        f.debug_struct("LabelMap")
            .field("size", &self.size)
            .field("steps", &self.steps)
            .field("origin", &self.origin)
            .field("labels", &format_args!("{:016x}", hasher.finish()))
            .field("names", &self.names)
            .finish()
    }
}

impl LabelMap {
    /// The same labels where `placement` puts them.
    pub fn placed(self, placement: &Placement) -> Self {
        LabelMap { steps: placement.steps(self.steps), origin: placement.point(self.origin), ..self }
    }

    /// Centre of voxel (i, j, k), RAS [m].
    pub fn position(&self, i: usize, j: usize, k: usize) -> DVec3 {
        self.origin + self.steps * DVec3::new(i as f64, j as f64, k as f64)
    }

    /// Where `x`, RAS [m], stands between the voxels: whole numbers at their centres, along i, j, k.
    pub fn index_of(&self, x: DVec3) -> DVec3 {
        self.steps.inverse() * (x - self.origin)
    }

    /// Label of the voxel that is nearest to `x`, RAS [m]; 0 outside. For many places a [`LabelSampler`] is faster.
    pub fn label_at(&self, x: DVec3) -> u16 {
        self.sampler().label_at(x)
    }

    /// The map made ready to be asked at many places.
    pub fn sampler(&self) -> LabelSampler<'_> {
        let inverse = self.steps.inverse();
        // The half turns the cut to whole numbers into the choice of the nearest voxel.
        LabelSampler { map: self, inverse, offset: DVec3::splat(0.5) - inverse * self.origin }
    }

    /// Number of voxels and volume [m^3] of every label that occurs, without 0.
    pub fn volumes(&self) -> BTreeMap<u16, (usize, f64)> {
        let mut counts = vec![0_usize; 1 << 16];
        for label in &self.labels {
            counts[usize::from(*label)] += 1;
        }
        let voxel = self.steps.determinant().abs();
        let found = (0..=u16::MAX).zip(counts).skip(1).filter(|(_, count)| *count > 0);
        found.map(|(label, count)| (label, (count, count as f64 * voxel))).collect()
    }

    /// Distance from a voxel to the next along i, j, k [m].
    pub fn spacing(&self) -> DVec3 {
        DVec3::from_array(self.steps.to_cols_array_2d().map(|step| DVec3::from_array(step).length()))
    }

    /// Where i, j, k run to, by the closest axes of the patient: one of R, L, A, P, S, I each, such as `RAS` or `LPS`. No axis is
    /// named twice; the clearest direction chooses first.
    pub fn orientation(&self) -> String {
        let cosines = self.steps.to_cols_array_2d().map(|step| DVec3::from_array(step).normalize_or_zero().to_array());
        let (mut letters, mut taken) = (['?'; 3], [false; 3]);
        for _ in 0..3 {
            let free = (0..9).map(|n| (n / 3, n % 3)).filter(|(step, axis)| letters[*step] == '?' && !taken[*axis]);
            let clearest = free.max_by(|a, b| cosines[a.0][a.1].abs().total_cmp(&cosines[b.0][b.1].abs()));
            if let Some((step, axis)) = clearest {
                let ends = [['R', 'L'], ['A', 'P'], ['S', 'I']][axis];
                letters[step] = ends[usize::from(cosines[step][axis] < 0.0)];
                taken[axis] = true;
            }
        }
        letters.iter().collect()
    }

    /// Lowest and highest corner of the box, RAS [m], around all voxels that have a label, their full extent included; none where
    /// none has.
    pub fn bounds(&self) -> Option<(DVec3, DVec3)> {
        let mut found: Option<(DVec3, DVec3)> = None;
        let row_length = self.size[0].max(1);
        for (row, labels) in self.labels.chunks(row_length).enumerate() {
            // Along a row positions go straight on: its ends suffice.
            let ends = [labels.iter().position(|l| *l != 0), labels.iter().rposition(|l| *l != 0)];
            for i in ends.into_iter().flatten() {
                let x = self.position(i, row % self.size[1].max(1), row / self.size[1].max(1));
                found = Some(found.map_or((x, x), |(low, high)| (low.min(x), high.max(x))));
            }
        }
        let half = 0.5 * (self.steps.x_axis.abs() + self.steps.y_axis.abs() + self.steps.z_axis.abs());
        found.map(|(low, high)| (low - half, high + half))
    }
}

/// A [`LabelMap`] with the way from a place to a voxel worked out.
#[derive(Debug, Clone, Copy)]
pub struct LabelSampler<'a> {
    map: &'a LabelMap,
    inverse: DMat3,
    /// Index of the origin of the patient, and a half along each axis.
    offset: DVec3,
}

impl LabelSampler<'_> {
    /// Label of the voxel that is nearest to `x`, RAS [m]; 0 outside.
    pub fn label_at(&self, x: DVec3) -> u16 {
        let at = self.inverse * x + self.offset;
        let [ni, nj, nk] = self.map.size;
        // Written so that what is no number is outside.
        let inside = |at: f64, n: usize| at >= 0.0 && at < n as f64;
        if !(inside(at.x, ni) && inside(at.y, nj) && inside(at.z, nk)) {
            return 0;
        }
        let index = at.x as usize + ni * (at.y as usize + nj * at.z as usize);
        self.map.labels.get(index).copied().unwrap_or(0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// 3 x 2 x 2 voxels of 1, 2, 4 mm whose i runs to the left and whose j leans.
    fn leaning() -> LabelMap {
        let steps =
            DMat3::from_cols(DVec3::new(-1e-3, 0.0, 0.0), DVec3::new(0.2e-3, 2e-3, 0.0), DVec3::new(0.0, 0.5e-3, 4e-3));
        let labels = vec![0, 0, 7, 0, 0, 0, 0, 7, 0, 9, 0, 0];
        LabelMap { size: [3, 2, 2], steps, origin: DVec3::new(0.01, -0.02, 0.03), labels, names: BTreeMap::new() }
    }

    #[test]
    fn every_voxel_is_found_at_its_place_and_nowhere_else() {
        let map = leaning();
        let sampler = map.sampler();
        for (n, label) in map.labels.iter().enumerate() {
            let (i, j, k) = (n % 3, n / 3 % 2, n / 6);
            let x = map.position(i, j, k);
            assert!((map.index_of(x) - DVec3::new(i as f64, j as f64, k as f64)).length() < 1e-9);
            for corner in 0..8 {
                let towards = DVec3::from_array([1, 2, 4].map(|bit| if corner & bit == 0 { -0.49 } else { 0.49 }));
                assert_eq!(sampler.label_at(x + map.steps * towards), *label);
                assert_eq!(map.label_at(x + map.steps * towards), *label);
            }
        }
        let behind = map.position(2, 0, 0) + map.steps * DVec3::new(0.51, 0.0, 0.0);
        assert_eq!(map.label_at(behind), 0);
        assert_eq!(map.label_at(map.position(2, 0, 0) - map.steps * DVec3::new(0.0, 0.51, 0.0)), 0);
        assert_eq!([f64::NAN, f64::INFINITY, 1e300, -1e300].map(|x| map.label_at(DVec3::splat(x))), [0; 4]);
    }

    #[test]
    fn maps_are_told_apart_by_their_text_without_all_labels_in_it() {
        let map = leaning();
        let mut other = map.clone();
        other.labels[5] = 1;
        let text = |map: &LabelMap| format!("{map:?}");
        assert_eq!(text(&map), text(&leaning()));
        assert_ne!(text(&map), text(&other));
        let many = LabelMap { labels: vec![1; 100_000], ..map };
        assert!(text(&many).len() < 500, "{}", text(&many).len());
    }

    #[test]
    fn volumes_bounds_and_directions() {
        let map = leaning();
        let volumes = map.volumes();
        assert_eq!(volumes.keys().copied().collect::<Vec<_>>(), [7, 9]);
        assert_eq!(volumes[&7].0, 2);
        assert!((volumes[&9].1 - 8e-9).abs() < 1e-18);
        assert!((map.spacing() - DVec3::new(1e-3, 4.04_f64.sqrt() * 1e-3, 16.25_f64.sqrt() * 1e-3)).length() < 1e-12);
        assert_eq!(map.orientation(), "LAS");
        // Corners of the labelled voxels, one by one.
        let (mut low, mut high) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
        for n in (0..12).filter(|n| map.labels[*n] != 0) {
            for corner in 0..8 {
                let half = DVec3::from_array([1, 2, 4].map(|bit| if corner & bit == 0 { -0.5 } else { 0.5 }));
                let x = map.position(n % 3, n / 3 % 2, n / 6) + map.steps * half;
                (low, high) = (low.min(x), high.max(x));
            }
        }
        let found = map.bounds().unwrap();
        assert!((found.0 - low).length() < 1e-12 && (found.1 - high).length() < 1e-12, "{found:?} {low} {high}");
        assert_eq!(LabelMap { labels: vec![0; 12], ..leaning() }.bounds(), None);
        assert_eq!(LabelMap::default().bounds(), None);
    }

    #[test]
    fn no_axis_is_named_twice() {
        let (c, s) = (0.6, 0.8);
        let steps = DMat3::from_cols(DVec3::new(c, s, 0.0), DVec3::new(s, -c, 0.0), DVec3::Z) * 1e-3;
        assert_eq!(LabelMap { steps, ..leaning() }.orientation(), "ARS");
        let even = DMat3::from_cols(DVec3::new(1.0, 1.0, 0.0), DVec3::new(1.0, -1.0, 0.0), -DVec3::Z) * 1e-3;
        let letters = LabelMap { steps: even, ..leaning() }.orientation();
        assert!(letters == "RPI" || letters == "ARI", "{letters}");
    }
}
