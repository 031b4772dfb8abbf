//! What cells are made of: one material, a mixture of several, a part of one at a surface, nothing, or what does not deform.
//!
//! In a block every cell that the face of a region may cut is sampled at a lattice of points, and all cells of a label map are; `f_m` is
//! the part of them in the material m. A cell with a mixture has one material of its own, with the constants `sum f_m c_m` where its
//! laws are one and linear in them, else the law of its largest part scaled to the mean shear modulus. Where a part of the cell is nothing, the sum is less than the whole: stiffness and mass shrink
//! alike, so that a surface is no staircase and the time step stays (finite cell method, Parvizian, Duester & Rank 2007). The mean of
//! stiffnesses is the upper bound of Voigt.
//!
//! Cells with the same composition share a material. The device holds 256 of them, so the parts are rounded, to 1/64 or as coarse
//! as that number asks for.

use std::collections::HashMap;

use glam::DVec3;
use rayon::prelude::*;

use super::LARGEST_MATERIAL_COUNT;
use crate::anatomy::Case;
use crate::material::law::{MOST_CONSTANTS, Search};
use crate::material::{ElasticLaw, LAWS};
use crate::material_point::Material;
use crate::mesh::{BlockMesh, Mesh};
use crate::scene::{CELL_SAMPLES, RegionShape, Scene, sample_points};

/// Cells that are filled less hold nothing.
pub(super) const LEAST_FILL: f64 = 0.02;

/// Parts that a composition is rounded to, the first that gives few enough materials.
const LEVELS: [u16; 10] = [64, 48, 32, 24, 16, 12, 8, 6, 4, 2];

/// What all cells are made of.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Composition {
    /// Index into the materials per cell; empty where there is one material only.
    pub cell_material: Vec<u8>,
    /// The material of the scene that fills most of each cell, or does not deform in it.
    pub main: Vec<u8>,
    /// Materials behind those of the scene.
    pub mixtures: Vec<Material>,
    /// Cells in which nothing is, or what does not deform; no entries: there are none.
    pub empty: Vec<bool>,
    /// Those of them that do not deform; no entries: there are none.
    pub rigid: Vec<bool>,
    /// Nodes that stand still: of cells that do not deform, those that no tissue moves, and held skin; no entries: there are none.
    pub held: Vec<bool>,
    /// Those of them that are held skin, ascending.
    pub skin: Vec<usize>,
    /// Part of every cell that tissue fills; no entries: all of it where it is not empty.
    pub fill: Vec<f32>,
    /// What parts of a mixture were rounded to; 0: there is none.
    pub levels: u16,
}

/// Parts of a cell, which sum to the number of levels: per material of the scene, then nothing.
type Parts = Vec<u16>;

impl Composition {
    /// Of the cells of a mesh; `materials`: those of the scene, its own first.
    pub fn new(scene: &Scene, mesh: &Mesh, materials: &[Material]) -> Self {
        let any_rigid = scene.regions.iter().any(|region| region.material.rigid);
        let mut composition = match (mesh, &scene.case) {
            (Mesh::Block(block), Some(case)) => by_parts(scene, block, Some(case), materials),
            _ if scene.regions.is_empty() => return Composition::default(),
            (Mesh::Block(block), None) => {
                let whole = by_parts(scene, block, None, materials);
                if any_rigid { whole } else { whole.of_tissue_only() }
            }
            (Mesh::Tets(_), _) => {
                let cell_material = by_centre(scene, mesh);
                let is_rigid = |m: &u8| *m > 0 && scene.regions[usize::from(*m) - 1].material.rigid;
                let rigid: Vec<bool> =
                    if any_rigid { cell_material.iter().map(is_rigid).collect() } else { Vec::new() };
                let mixtures = if any_rigid { vec![mixture(&[(0.0, &materials[0])])] } else { Vec::new() };
                Composition { cell_material, mixtures, empty: rigid.clone(), rigid, ..Composition::default() }
            }
        };
        if composition.main.is_empty() {
            composition.main.clone_from(&composition.cell_material);
        }
        if !composition.empty.is_empty() {
            composition.settle(mesh);
            // The last mixture is one of nothing.
            let nothing = (materials.len() + composition.mixtures.len() - 1) as u8;
            for (material, empty) in composition.cell_material.iter_mut().zip(&composition.empty) {
                *material = if *empty { nothing } else { *material };
            }
        }
        composition
    }

    /// Lets nodes of the skin stand still. The engines look at single nodes where cells may be empty, so that a block has room for that
    /// then, though none is.
    pub(super) fn hold(&mut self, skin: Vec<usize>, mesh: &Mesh, materials: &[Material]) {
        if skin.is_empty() {
            return;
        }
        if mesh.as_block().is_some() && self.empty.is_empty() {
            self.empty = vec![false; mesh.cell_count()];
            self.mixtures.push(mixture(&[(0.0, &materials[0])]));
            self.cell_material.resize(mesh.cell_count(), 0);
            self.main.clone_from(&self.cell_material);
        }
        self.held.resize(mesh.node_count(), false);
        skin.iter().for_each(|node| self.held[*node] = true);
        self.skin = skin;
    }

    /// The same without room for cells that hold nothing, where there is none.
    fn of_tissue_only(mut self) -> Self {
        self.mixtures.pop();
        Composition { empty: Vec::new(), rigid: Vec::new(), ..self }
    }

    /// Part of a cell that tissue fills.
    pub fn fill(&self, cell: usize) -> f64 {
        match self.empty.get(cell) {
            Some(true) => 0.0,
            _ => self.fill.get(cell).map_or(1.0, |fill| f64::from(*fill)),
        }
    }

    /// Nodes that stand still, and cells that all of their nodes hold.
    fn settle(&mut self, mesh: &Mesh) {
        let mut in_rigid = vec![false; mesh.node_count()];
        let cells = 0..mesh.cell_count();
        for cell in cells.clone().filter(|cell| self.rigid.get(*cell).is_some_and(|rigid| *rigid)) {
            mesh.cell_nodes(cell).iter().for_each(|node| in_rigid[*node] = true);
        }
        let mut moved = vec![false; mesh.node_count()];
        for cell in cells {
            let nodes = mesh.cell_nodes(cell);
            self.empty[cell] |= nodes.iter().all(|node| in_rigid[*node]);
            if !self.empty[cell] {
                nodes.iter().for_each(|node| moved[*node] = true);
            }
        }
        self.held = in_rigid.iter().zip(&moved).map(|(rigid, moved)| *rigid || !*moved).collect();
    }
}

/// Material of every tetrahedron: the last region that holds its centre, else the scene's own.
fn by_centre(scene: &Scene, mesh: &Mesh) -> Vec<u8> {
    let holds = |shape: &RegionShape, cell: usize| match (shape, mesh) {
        (RegionShape::MeshTag(name), Mesh::Tets(tets)) => tets.regions[tets.tags[cell] as usize] == *name,
        _ => shape.contains(mesh.cell_centre(cell)),
    };
    (0..mesh.cell_count())
        .map(|cell| scene.regions.iter().rposition(|r| holds(&r.shape, cell)).map_or(0, |i| i as u8 + 1))
        .collect()
}

/// What a point is made of: the index of its material, or none where nothing is.
fn material_at(scene: &Scene, by_label: &[Option<u8>], case: Option<&Case>, x: DVec3) -> Option<usize> {
    // Regions with a shape of their own lie over the labels, as far as there is tissue.
    let label = case.map_or(Some(0), |case| by_label[usize::from(case.label_at(x))])?;
    let shaped = scene.regions.iter().rposition(|region| match region.shape {
        RegionShape::Labels { .. } => false,
        _ => region.shape.contains(x),
    });
    Some(shaped.map_or(usize::from(label), |index| (index + 1).max(usize::from(label))))
}

/// The last entry of the mixtures is one of nothing; without a label map every cell is full.
fn by_parts(scene: &Scene, block: &BlockMesh, case: Option<&Case>, materials: &[Material]) -> Composition {
    let by_label: Vec<Option<u8>> = (0..=u16::MAX)
        .filter(|_| case.is_some())
        .map(|label| {
            let region = scene.regions.iter().rposition(|region| match &region.shape {
                RegionShape::Labels { labels, .. } => labels.binary_search(&label).is_ok(),
                _ => false,
            });
            (label != 0).then(|| region.map_or(0, |index| index as u8 + 1))
        })
        .collect();
    let is_rigid: Vec<bool> =
        std::iter::once(false).chain(scene.regions.iter().map(|region| region.material.rigid)).collect();
    let nothing = materials.len();
    // Counts of the sampled points per material, then of nothing; and whether most of the cell is rigid.
    let sampled: Vec<(Parts, bool, u8)> = (0..block.cell_count())
        .into_par_iter()
        .map(|cell| {
            let size = block.cell_size(cell);
            let low = block.rest_position(block.cell_nodes(cell)[0]);
            let is_cut = case.is_some() || scene.regions.iter().any(|region| region.shape.may_cut(low, low + size));
            let samples = if is_cut { CELL_SAMPLES } else { 1 };
            let mut counts = vec![0u16; nothing + 1];
            let mut of_rigid = vec![0u16; nothing];
            for point in sample_points(low, size, samples) {
                match material_at(scene, &by_label, case, point) {
                    Some(material) if is_rigid[material] => of_rigid[material] += 1,
                    Some(material) => counts[material] += 1,
                    None => counts[nothing] += 1,
                }
            }
            let rigid = 2 * usize::from(of_rigid.iter().sum::<u16>()) > samples.pow(3);
            let of = if rigid { &of_rigid } else { &counts };
            let main = (0..nothing).max_by_key(|m| (of[*m], std::cmp::Reverse(*m))).unwrap_or(0);
            (counts, rigid, main as u8)
        })
        .collect();
    let rigid: Vec<bool> = sampled.iter().map(|(_, rigid, _)| *rigid).collect();
    let fill = |counts: &[u16]| {
        let tissue: u16 = counts[..nothing].iter().sum();
        f64::from(tissue) / f64::from((tissue + counts[nothing]).max(1))
    };
    let empty: Vec<bool> = sampled.iter().map(|(counts, rigid, _)| *rigid || fill(counts) < LEAST_FILL).collect();
    let (levels, cell_parts, numbers) = LEVELS
        .into_iter()
        .find_map(|levels| {
            let parts: Vec<Option<Parts>> = sampled
                .iter()
                .zip(&empty)
                .map(|((counts, ..), empty)| (!*empty).then(|| rounded(counts, levels)))
                .collect();
            let mut numbers: HashMap<Parts, usize> = HashMap::new();
            for parts in parts.iter().flatten().filter(|parts| pure(parts, levels).is_none()) {
                let next = nothing + numbers.len();
                numbers.entry(parts.clone()).or_insert(next);
            }
            // One more for cells that are empty.
            (nothing + numbers.len() < LARGEST_MATERIAL_COUNT).then_some((levels, parts, numbers))
        })
        .unwrap_or_else(|| (1, vec![None; sampled.len()], HashMap::new()));
    let mut by_number: Vec<&Parts> = vec![&EMPTY; numbers.len()];
    for (parts, number) in &numbers {
        by_number[number - nothing] = parts;
    }
    let mut mixtures: Vec<Material> = by_number
        .iter()
        .map(|parts| {
            let share = |count: u16| f64::from(count) / f64::from(levels);
            let parts = parts[..nothing].iter().zip(materials).filter(|(count, _)| **count > 0);
            mixture(&parts.map(|(count, material)| (share(*count), material)).collect::<Vec<_>>())
        })
        .collect();
    let nothing_number = nothing + mixtures.len();
    mixtures.push(mixture(&[(0.0, &materials[0])]));
    let cell_material = cell_parts
        .iter()
        .map(|parts| match parts {
            None => nothing_number as u8,
            Some(parts) => pure(parts, levels).unwrap_or_else(|| numbers[parts]) as u8,
        })
        .collect();
    let levels = if mixtures.len() > 1 { levels } else { 0 };
    let main = sampled.iter().map(|(.., main)| *main).collect();
    let fill = sampled.iter().filter(|_| case.is_some()).map(|(counts, ..)| fill(counts) as f32).collect();
    Composition { cell_material, main, mixtures, empty, rigid, fill, levels, ..Composition::default() }
}

static EMPTY: Parts = Vec::new();

/// The material that a cell is made of as a whole.
fn pure(parts: &[u16], levels: u16) -> Option<usize> {
    parts[..parts.len() - 1].iter().position(|part| *part == levels)
}

/// Counts as parts that sum to `levels`, the largest remainders rounded up; what fills a cell as a whole, or has no part in it, stays
/// so, and a cell with tissue in it keeps a part of it.
fn rounded(counts: &[u16], levels: u16) -> Parts {
    let all: u32 = counts.iter().map(|c| u32::from(*c)).sum();
    let scaled = |count: u16| u32::from(count) * u32::from(levels);
    let mut parts: Parts = counts.iter().map(|count| (scaled(*count) / all) as u16).collect();
    let mut order: Vec<usize> = (0..counts.len()).collect();
    order.sort_by_key(|m| std::cmp::Reverse(scaled(counts[*m]) % all));
    let missing = levels - parts.iter().sum::<u16>();
    order.iter().take(usize::from(missing)).for_each(|m| parts[*m] += 1);
    let nothing = parts.len() - 1;
    if parts[nothing] == levels {
        let largest = (0..nothing).max_by_key(|m| counts[*m]).unwrap_or(0);
        (parts[nothing], parts[largest]) = (levels - 1, 1);
    }
    parts
}

/// Mean of materials by their parts of a cell; less than the whole: the rest is nothing.
pub fn mixture(parts: &[(f64, &Material)]) -> Material {
    let fill: f64 = parts.iter().map(|(part, _)| part).sum();
    let sum = |of: &dyn Fn(&Material) -> f64| parts.iter().map(|(part, m)| part * of(m)).sum::<f64>();
    let largest = parts.iter().max_by(|a, b| a.0.total_cmp(&b.0)).map(|(_, m)| *m).expect("a mixture of something");
    let word = largest.law.isochoric.word();
    let law = &LAWS[word as usize];
    let one_law = parts.iter().all(|(_, m)| m.law.isochoric.word() == word);
    let mut constants = [0.0; MOST_CONSTANTS];
    if one_law && matches!(law.search, Search::Linear) {
        for (part, m) in parts {
            for (constant, value) in constants.iter_mut().zip(m.law.isochoric.values()) {
                *constant += part * value;
            }
        }
    } else {
        let scale = sum(&|m| m.law.shear_modulus()) / largest.law.shear_modulus();
        constants = largest.law.isochoric.values();
        for (constant, value) in law.constants.iter().zip(&mut constants) {
            *value *= if constant.is_stress() { scale } else { 1.0 };
        }
    }
    let mut mixed = Material {
        law: ElasticLaw { isochoric: (law.build)(constants), bulk_modulus: sum(&|m| m.law.bulk_modulus) },
        density: sum(&|m| m.density),
        ..largest.clone()
    };
    if let Some(plasticity) = &mut mixed.plasticity {
        plasticity.yield_stress = sum(&|m| m.plasticity.map_or(0.0, |p| p.yield_stress));
        plasticity.hardening = sum(&|m| m.plasticity.map_or(0.0, |p| p.hardening));
    }
    if let Some(fibres) = &mut mixed.fibres {
        fibres.k1 *= fill;
    }
    mixed
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parts_keep_their_sum_and_what_is_whole() {
        for levels in LEVELS {
            for counts in [[64, 0, 0], [0, 64, 0], [63, 1, 0], [1, 0, 63], [20, 21, 23], [32, 0, 32]] {
                let parts = rounded(&counts, levels);
                assert_eq!(parts.iter().sum::<u16>(), levels, "{counts:?} {levels}");
                assert!(counts.iter().zip(&parts).all(|(c, p)| *c > 0 || *p == 0), "{counts:?} {parts:?}");
                assert!(parts[2] < levels, "{counts:?} {parts:?}");
                if counts.contains(&64) {
                    assert!(parts.contains(&levels));
                }
            }
        }
    }

    #[test]
    fn a_mixture_has_the_mean_of_what_is_linear() {
        let soft = Material::elastic(ElasticLaw::mooney_rivlin(1e3, 5e2, 2e5), 1000.0);
        let stiff = Material::elastic(ElasticLaw::mooney_rivlin(4e3, 1e3, 5e5), 1100.0);
        let half = mixture(&[(0.5, &soft), (0.25, &stiff)]);
        assert!((half.law.shear_modulus() - (0.5 * 3e3 + 0.25 * 1e4)).abs() < 1e-9);
        assert!((half.law.bulk_modulus - (0.5 * 2e5 + 0.25 * 5e5)).abs() < 1e-6);
        assert!((half.density - 775.0).abs() < 1e-9);
    }

    #[test]
    fn laws_that_differ_keep_the_mean_shear_modulus() {
        for (a, b) in LAWS.iter().zip(LAWS.iter().cycle().skip(1)) {
            let law =
                |law: &crate::material::Law| ElasticLaw { isochoric: (law.build)(law.example), bulk_modulus: 1e5 };
            let (one, two) = (Material::elastic(law(a), 1000.0), Material::elastic(law(b), 1000.0));
            let mixed = mixture(&[(0.6, &one), (0.3, &two)]);
            let mean = 0.6 * one.law.shear_modulus() + 0.3 * two.law.shear_modulus();
            assert!((mixed.law.shear_modulus() / mean - 1.0).abs() < 1e-9, "{} {}", a.key, b.key);
        }
    }
}
