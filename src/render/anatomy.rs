//! What the tissue of a scene is called and in which colour it is drawn, asked at points of the tissue at rest.
//!
//! Labels of a map are blended with the weights of a bell curve over 6 x 6 x 6 voxels, and the heaviest one is drawn: a slanted boundary
//! then is a line and not the steps of the voxels. So wide a bell takes thin layers away; a label that has little weight even in the middle
//! of its own voxels counts more, by as much as brings it back.

use glam::{DMat3, DVec3};

use crate::anatomy::colours::{self, Rgb};
use crate::anatomy::{Case, LabelMap};
use crate::scene::{RegionShape, Scene};

/// A part of the tissue that is drawn in one colour.
#[derive(Debug, Clone, PartialEq)]
pub struct Part {
    /// As the segmentation calls it, or the scene.
    pub name: String,
    /// Natural colour, sRGB.
    pub colour: Rgb,
    /// True for bone and other parts that do not deform.
    pub rigid: bool,
    /// What it is made of: 0 the material of the scene, else that of region `material - 1`.
    pub material: usize,
}

/// More labels than this do not meet in 216 voxels of a body; what comes after them is light.
const MOST_MET: usize = 16;
/// Voxels around a point along each axis, and the standard deviation of the bell in voxels.
const TAPS: usize = 6;
const BELL: f64 = 1.0;
/// Weight in its own voxels that every label is brought to, and what this takes at most.
const OWN_WEIGHT: f64 = 0.75;
const MOST_GAIN: f64 = 2.0;
/// So many voxels of a label are looked at for that.
const LOOKED_AT: usize = 200;

/// Nothing is there.
pub const NOTHING: usize = 0;
/// What tissue is called whose material says little to who looks at it.
pub const UNNAMED: &str = "tissue";

/// Parts of the tissue of a scene and where they lie.
#[derive(Debug, Clone)]
pub struct Anatomy<'a> {
    scene: &'a Scene,
    /// The first one is nothing.
    parts: Vec<Part>,
    voxels: Option<Voxels<'a>>,
    /// Part of the region, where it has a shape of its own; behind them that of the scene's material.
    of_region: Vec<Option<usize>>,
}

#[derive(Debug, Clone)]
struct Voxels<'a> {
    map: &'a LabelMap,
    /// Index of a voxel, not whole, from a point of the scene.
    from_scene: DMat3,
    offset: DVec3,
    /// Part of every label.
    by_label: Vec<u16>,
    /// What the weight of every part counts.
    gain: Vec<f64>,
}

impl<'a> Anatomy<'a> {
    /// Parts of a scene with a label map, or with regions that have shapes; none where all is one tissue, and where cells of a mesh tell
    /// their region.
    pub fn of_scene(scene: &'a Scene) -> Option<Self> {
        if scene.case.is_none() && scene.regions.is_empty() {
            return None;
        }
        Self::of_any(scene)
    }

    /// The same where all is one tissue, too.
    pub fn of_any(scene: &'a Scene) -> Option<Self> {
        if scene.regions.iter().any(|region| matches!(region.shape, RegionShape::MeshTag(_))) {
            return None;
        }
        let mut parts = vec![Part { name: String::new(), colour: [0; 3], rigid: false, material: 0 }];
        let mut by_label = Vec::new();
        if let Some(case) = &scene.case {
            by_label = vec![NOTHING as u16; 1 << 16];
            // A segmentation has tens of labels, a body some hundred.
            for label in case.map.volumes().into_keys() {
                let region = region_of(scene, label);
                let material = region.map_or(0, |index| index + 1);
                let rigid = region.is_some_and(|index| scene.regions[index].material.rigid);
                let own = case.map.names.get(&label).filter(|name| !name.is_empty());
                let otherwise = || region.map_or_else(|| format!("label {label}"), |n| scene.regions[n].name.clone());
                by_label[usize::from(label)] = parts.len() as u16;
                parts.push(Part { name: own.cloned().unwrap_or_else(otherwise), colour: [0; 3], rigid, material });
            }
        }
        let mut of_region = Vec::new();
        for (index, region) in scene.regions.iter().enumerate() {
            let shaped = !matches!(region.shape, RegionShape::Labels { .. });
            of_region.push(shaped.then_some(parts.len()));
            if shaped {
                let (name, rigid) = (region.name.clone(), region.material.rigid);
                parts.push(Part { name, colour: [0; 3], rigid, material: index + 1 });
            }
        }
        if scene.case.is_none() {
            of_region.push(Some(parts.len()));
            // `across-fibre` says little to who looks at it.
            let named = colours::of_kind(&scene.material.name).is_some();
            let name = if named { scene.material.name.clone() } else { UNNAMED.into() };
            parts.push(Part { name, colour: [0; 3], rigid: false, material: 0 });
        }
        let found = colours::of_names(parts[1..].iter().map(|part| part.name.as_str()));
        parts[1..].iter_mut().zip(found).for_each(|(part, colour)| part.colour = colour);
        let voxels = scene.case.as_deref().map(|case| Voxels::new(case, by_label, parts.len()));
        Some(Anatomy { scene, parts, voxels, of_region })
    }

    /// Parts by their number; the first one is nothing.
    pub fn parts(&self) -> &[Part] {
        &self.parts
    }

    /// Number of the part at a point of the tissue at rest, in the scene [m].
    pub fn part_at(&self, x: DVec3) -> usize {
        let regions = &self.scene.regions;
        let shaped = (0..regions.len()).rev().find(|n| self.of_region[*n].is_some() && regions[*n].shape.contains(x));
        let Some(voxels) = &self.voxels else {
            return shaped.map_or(self.parts.len() - 1, |n| self.of_region[n].unwrap_or(NOTHING));
        };
        // A region with a shape of its own lies over labels of regions before it, as far as there is tissue.
        let part = voxels.part_at(x);
        match shaped {
            Some(n) if part != NOTHING && n + 1 > self.parts[part].material => self.of_region[n].unwrap_or(part),
            _ => part,
        }
    }

    /// Number of the part of a label; nothing where the map does not hold it.
    pub fn part_of_label(&self, label: u16) -> usize {
        self.voxels.as_ref().map_or(NOTHING, |voxels| usize::from(voxels.by_label[usize::from(label)]))
    }
}

/// The region that takes a label: the last one that names it.
fn region_of(scene: &Scene, label: u16) -> Option<usize> {
    scene.regions.iter().rposition(|region| match &region.shape {
        RegionShape::Labels { labels, .. } => labels.binary_search(&label).is_ok(),
        _ => false,
    })
}

impl<'a> Voxels<'a> {
    fn new(case: &'a Case, by_label: Vec<u16>, parts: usize) -> Self {
        let (map, frame) = (case.map.as_ref(), &case.frame);
        let inverse = map.steps.inverse();
        let (from_scene, offset) = (inverse * frame.axes, inverse * (frame.origin - map.origin));
        let mut voxels = Voxels { map, from_scene, offset, by_label, gain: vec![1.0; parts] };
        voxels.weigh();
        voxels
    }

    /// Lets parts that are thin count more.
    fn weigh(&mut self) {
        let [nx, ny, _] = self.map.size;
        let mut counts = vec![0usize; self.gain.len()];
        self.map.labels.iter().for_each(|label| counts[usize::from(self.by_label[usize::from(*label)])] += 1);
        let mut own: Vec<Vec<f64>> = vec![Vec::new(); self.gain.len()];
        let mut met = vec![0usize; self.gain.len()];
        for (n, label) in self.map.labels.iter().enumerate() {
            let part = usize::from(self.by_label[usize::from(*label)]);
            if part == NOTHING {
                continue;
            }
            met[part] += 1;
            if met[part].is_multiple_of((counts[part] / LOOKED_AT).max(1)) {
                let at = DVec3::new((n % nx) as f64, (n / nx % ny) as f64, (n / (nx * ny)) as f64);
                let (found, count) = self.weights(at);
                let weight = found[..count].iter().find(|(p, _)| usize::from(*p) == part).map_or(0.0, |(_, w)| *w);
                own[part].push(weight);
            }
        }
        for (gain, own) in self.gain.iter_mut().zip(&mut own) {
            own.sort_by(f64::total_cmp);
            if let Some(median) = own.get(own.len() / 2) {
                *gain = (OWN_WEIGHT / median).clamp(1.0, MOST_GAIN);
            }
        }
    }

    fn part_at(&self, x: DVec3) -> usize {
        let at = self.from_scene * x + self.offset;
        // Written so that what is no number is outside.
        let inside = |x: f64, n: usize| x > -0.5 && x < n as f64 - 0.5;
        let [nx, ny, nz] = self.map.size;
        if !(inside(at.x, nx) && inside(at.y, ny) && inside(at.z, nz)) {
            return NOTHING;
        }
        if let Some(part) = self.only_part(at) {
            return part;
        }
        let (found, count) = self.weights(at);
        let counted = found[..count].iter().map(|(part, weight)| (*part, weight * self.gain[usize::from(*part)]));
        let heaviest = counted.fold((NOTHING as u16, -1.0), |best, one| if one.1 > best.1 { one } else { best });
        usize::from(heaviest.0)
    }

    /// The voxels around a place between the voxels; those at the border count beyond it too.
    fn around(&self, at: DVec3) -> [[usize; TAPS]; 3] {
        let at = at.to_array();
        std::array::from_fn(|axis| {
            let first = at[axis].floor() as i64 - TAPS as i64 / 2 + 1;
            std::array::from_fn(|n| (first + n as i64).clamp(0, self.map.size[axis] as i64 - 1) as usize)
        })
    }

    /// The part around a place where there is but one.
    fn only_part(&self, at: DVec3) -> Option<usize> {
        let [nx, ny, _] = self.map.size;
        let [x, y, z] = self.around(at);
        let first = self.map.labels[(z[0] * ny + y[0]) * nx + x[0]];
        for z in z {
            for y in y {
                let row = (z * ny + y) * nx;
                if self.map.labels[row + x[0]..=row + x[TAPS - 1]].iter().any(|label| *label != first) {
                    return None;
                }
            }
        }
        Some(usize::from(self.by_label[usize::from(first)]))
    }

    /// Parts around a place between the voxels with their weights, and how many.
    fn weights(&self, at: DVec3) -> ([(u16, f64); MOST_MET], usize) {
        let [nx, ny, _] = self.map.size;
        let [x, y, z] = self.around(at);
        let [wx, wy, wz] = (at - at.floor()).to_array().map(bell);
        let mut found = [(NOTHING as u16, 0.0f64); MOST_MET];
        let mut count = 0;
        for (z, wz) in z.into_iter().zip(wz) {
            for (y, wy) in y.into_iter().zip(wy) {
                let row = (z * ny + y) * nx;
                for (x, wx) in x.into_iter().zip(wx) {
                    let part = self.by_label[usize::from(self.map.labels[row + x])];
                    let weight = wx * wy * wz;
                    match found[..count].iter_mut().find(|(known, _)| *known == part) {
                        Some((_, sum)) => *sum += weight,
                        None if count < MOST_MET => {
                            found[count] = (part, weight);
                            count += 1;
                        }
                        None => {}
                    }
                }
            }
        }
        (found, count)
    }
}

/// Weights of the points around a place that lies `t` behind the middle one, of sum 1.
fn bell(t: f64) -> [f64; TAPS] {
    let weights: [f64; TAPS] = std::array::from_fn(|n| {
        let way = n as f64 - (TAPS as f64 / 2.0 - 1.0) - t;
        (-0.5 * way * way / (BELL * BELL)).exp()
    });
    let sum: f64 = weights.iter().sum();
    weights.map(|weight| weight / sum)
}
