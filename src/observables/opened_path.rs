//! The tissue beside an opened path as it is seen. Cells carry a path of no width; where tissue lies around the needle, and how it is strained
//! there, is told by the opening map (src/needle/opening.rs).

use std::collections::BTreeMap;
use std::sync::Arc;

use glam::{DMat3, DVec3};

use crate::engine::State;
use crate::engine::elements::CellShape;
use crate::material::kinematics::jacobian_minus_one;
use crate::material::von_mises;
use crate::material_point::{PointState, Volumetric};
use crate::mesh::tets::lattice;
use crate::mesh::{Mesh, trilinear};
use crate::model::opening::NearCell;
use crate::model::{Model, NearTets};
use crate::needle::lateral_axes;
use crate::needle::opening::{FADED, OpeningMap, Station};
use crate::needle::path_line::PathLine;

/// Places along an edge of a cell at which its mean is taken.
const PLACES: usize = 4;

/// Within the first distance from the middle of the path the stress is that of the map, beyond the second that of cells whose nodes are where
/// they are seen, which resolve it there [needle radii]. What the map does where it fades cells take back between their nodes only.
const NEAR: [f64; 2] = [1.0, 2.0];

/// How far beside the middle of the path a cut may run that is drawn as through it, in needle radii.
const NEARLY_THROUGH: f64 = 0.25;

/// Radius of a section that hardly shows, in needle radii.
const HARDLY_OPEN: f64 = 0.1;

/// The path as it is open at one moment.
#[derive(Debug, Clone)]
pub struct OpenedPath {
    model: Arc<Model>,
    map: OpeningMap,
    line: PathLine,
    /// Material coordinate of the first section and distance between two [m].
    first: f64,
    spacing: f64,
    sections: Vec<Station>,
    /// Tetrahedra that the map reaches; none of a block, whose cells are found by their place.
    near: Option<NearTets>,
    /// Gradient of the displacement at the nodes that the map reaches: mean of the cells around each, by their volumes.
    gradients: BTreeMap<usize, DMat3>,
    /// Von Mises stress of the cells, of the places where their nodes are seen [Pa]; NaN in those that the path runs through.
    coarse: Vec<f64>,
    /// Displacement to where every node is seen [m].
    pub displacement: Vec<DVec3>,
}

/// Sections and gradients tell one path from another.
impl PartialEq for OpenedPath {
    fn eq(&self, other: &Self) -> bool {
        (&self.map, &self.line, &self.sections, &self.gradients)
            == (&other.map, &other.line, &other.sections, &other.gradients)
    }
}

/// What opening does at one place.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct OpenedPlace {
    /// Where the tissue is seen [m].
    pub place: DVec3,
    /// Von Mises stress beside the path [Pa], and the part that it has of the stress there: 1 near the path, 0 where cells resolve it.
    pub von_mises: f64,
    /// See `von_mises`.
    pub weight: f64,
}

/// What opening does to one cell.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct OpenedCell {
    /// Index of the cell.
    pub cell: usize,
    /// Mean von Mises stress [Pa].
    pub von_mises: f64,
    /// Volume over that of the closed path, less one.
    pub grown: f64,
}

impl OpenedPath {
    /// The path of a `state` of `model` with these `sections` of its stations. `None` where the scene has none, or where nothing is open.
    /// `closed`: von Mises stress of the cells with the path closed [Pa].
    pub fn new(
        model: &Arc<Model>,
        state: &State,
        (direction, sections): (DVec3, Vec<Station>),
        closed: &[f64],
    ) -> Option<Self> {
        let opening = model.opening()?;
        if sections.iter().all(|section| section.radius == 0.0) {
            return None;
        }
        let mut sums: BTreeMap<usize, (DMat3, f64)> =
            opening.nodes.iter().map(|node| (*node as usize, (DMat3::ZERO, 0.0))).collect();
        for near in &opening.cells {
            let cell = near.cell as usize;
            if model.mesh.is_empty(cell) {
                continue;
            }
            let shape = CellShape::new(&model.mesh, cell);
            let h = shape.displacement_gradient(&shape.gather(&state.displacement));
            for node in model.mesh.cell_nodes(cell).iter() {
                if let Some((sum, volume)) = sums.get_mut(node) {
                    *sum += h * shape.volume;
                    *volume += shape.volume;
                }
            }
        }
        let mean = |(node, (sum, volume)): (usize, (DMat3, f64))| (volume > 0.0).then(|| (node, sum * (1.0 / volume)));
        let mut path = OpenedPath {
            map: opening.map(direction),
            line: model.path_line(),
            first: opening.stations[0].depth,
            spacing: opening.spacing,
            sections,
            near: model.mesh.as_tets().map(|mesh| NearTets::new(mesh, &model.path_line(), FADED * opening.shaft)),
            gradients: sums.into_iter().filter_map(mean).collect(),
            model: model.clone(),
            coarse: closed.to_vec(),
            displacement: state.displacement.clone(),
        };
        for node in &opening.nodes {
            let (rest, u) = (model.mesh.rest_position(*node as usize), &mut path.displacement[*node as usize]);
            let y = rest + *u;
            let section = path.section_at(rest);
            if section.radius > 0.0 {
                path.displacement[*node as usize] = path.map.place(&section, y) - rest;
            }
        }
        for near in &opening.cells {
            let cell = near.cell as usize;
            path.coarse[cell] = path.coarse_stress(cell, closed[cell], &state.displacement);
        }
        Some(path)
    }

    /// Stress of a cell whose nodes are where they are seen, with that of the closed path as `closed` [Pa].
    fn coarse_stress(&self, cell: usize, closed: f64, u: &[DVec3]) -> f64 {
        let mesh = &self.model.mesh;
        let nodes = mesh.cell_nodes(cell);
        let middle = |of: &dyn Fn(usize) -> DVec3| nodes.iter().map(|n| of(*n)).sum::<DVec3>() / nodes.len() as f64;
        let rest = middle(&|n| mesh.rest_position(n));
        let section = self.section_at(rest);
        if section.radius == 0.0 || mesh.is_empty(cell) {
            return closed;
        }
        if self.offset(&section, rest + middle(&|n| u[n])).length() < NEAR[0] * self.map.shaft {
            return f64::NAN;
        }
        let shape = CellShape::new(mesh, cell);
        let of = |u: &[DVec3]| self.shape_stress(cell, shape.displacement_gradient(&shape.gather(u)));
        (closed + section.left() * (of(&self.displacement) - of(u))).max(0.0)
    }

    /// Von Mises stress of law and fibres of a cell's material; a folded place has none, its J tells [Pa].
    fn shape_stress(&self, cell: usize, h: DMat3) -> f64 {
        let j = 1.0 + jacobian_minus_one(h);
        if j <= 0.0 {
            return 0.0;
        }
        let material = self.model.material(cell);
        let p = material.stress(h, Volumetric { stress: 0.0, energy: 0.0 }, 1.0, &PointState::default());
        von_mises(p * (DMat3::IDENTITY + h).transpose() * (1.0 / j))
    }

    /// Von Mises stress of the cells as their nodes are seen, without what lies in them beside the path [Pa]; NaN where the path runs through.
    pub fn coarse(&self) -> &[f64] {
        &self.coarse
    }

    /// Radius of the needle [m].
    pub fn shaft(&self) -> f64 {
        self.map.shaft
    }

    /// The path at the material coordinate of a rest position, between two sections.
    fn section_at(&self, rest: DVec3) -> Station {
        let along = (self.line.coordinates(rest).1 - self.first) / self.spacing;
        let last = self.sections.len() - 1;
        let before = (along.floor().max(0.0) as usize).min(last);
        let (a, b) = (self.sections[before], self.sections[(before + 1).min(last)]);
        // What is ahead of the tip is nowhere.
        if a.radius == 0.0 || b.radius == 0.0 {
            let open = if a.radius == 0.0 { b } else { a };
            let part = (along - before as f64).clamp(0.0, 1.0);
            let left = if a.radius == 0.0 { part } else { 1.0 - part };
            return Station { radius: open.radius * left, ..open };
        }
        let t = (along - before as f64).clamp(0.0, 1.0);
        let mix = |a: f64, b: f64| a + t * (b - a);
        Station {
            centre: a.centre.lerp(b.centre, t),
            centre_rate: a.centre_rate.lerp(b.centre_rate, t),
            radius: mix(a.radius, b.radius),
            radius_rate: mix(a.radius_rate, b.radius_rate),
            rest_direction: a.rest_direction,
            growth: a.growth,
            relaxed: mix(a.relaxed, b.relaxed),
        }
    }

    /// Where a place of the closed tissue lies from the middle of the path, across the needle [m].
    fn offset(&self, section: &Station, y: DVec3) -> DVec3 {
        let offset = y - section.centre;
        offset - self.map.direction * offset.dot(self.map.direction)
    }

    /// Where a place of the closed tissue lies from the middle of the path, across the needle [m]. `None` where it is
    /// hardly open.
    pub fn offset_at(&self, rest: DVec3, y: DVec3) -> Option<DVec3> {
        let section = self.section_at(rest);
        (section.radius > HARDLY_OPEN * self.map.shaft).then(|| self.offset(&section, y))
    }

    /// The place of the closed tissue beside `y` along `normal` [m] in which a cut with that normal holds the middle of the path, where it runs
    /// nearly through it: a little beside the middle the map leads out of the cut.
    pub fn level_with_middle(&self, rest: DVec3, y: DVec3, normal: DVec3) -> DVec3 {
        let section = self.section_at(rest);
        let aside = self.offset(&section, y).dot(normal);
        if section.radius > 0.0 && aside.abs() < NEARLY_THROUGH * self.map.shaft { y - normal * aside } else { y }
    }

    /// Where a place of the closed tissue lies from the middle of the path, in needle radii. `None` where the map does not reach.
    pub fn distance(&self, rest: DVec3, y: DVec3) -> Option<f64> {
        let section = self.section_at(rest);
        let distance = self.offset(&section, y).length() / self.map.shaft;
        (section.radius > 0.0 && distance < FADED).then_some(distance)
    }

    /// The smoothed gradient at a rest position, and the cell there.
    fn gradient_at(&self, rest: DVec3) -> Option<(DMat3, usize)> {
        let (cell, weights) = match &self.model.mesh {
            Mesh::Block(block) => {
                let ([i, j, k], at) = block.locate(rest);
                let cell = block.cell_index(i, j, k);
                (cell, trilinear(at, block.cell_size(cell)).0)
            }
            Mesh::Tets(mesh) => {
                let (cell, weights, _) = self.near.as_ref()?.find(mesh, rest)?;
                (cell, std::array::from_fn(|i| weights.get(i).copied().unwrap_or(0.0)))
            }
        };
        let (mut sum, mut total) = (DMat3::ZERO, 0.0);
        for (node, weight) in self.model.mesh.cell_nodes(cell).iter().zip(weights) {
            if let Some(h) = self.gradients.get(node) {
                sum += *h * weight;
                total += weight;
            }
        }
        (total > 1e-9).then(|| (sum * (1.0 / total), cell))
    }

    /// Rest radius of the hole that the slit acts like, beside a rest position [m].
    fn hole_at(&self, rest: DVec3) -> f64 {
        let along = ((self.line.coordinates(rest).1 - self.first) / self.spacing).round().max(0.0);
        let stations = self.model.opening().map_or(&[][..], |opening| &opening.stations);
        stations.get((along as usize).min(stations.len().saturating_sub(1))).map_or(0.0, |station| station.hole)
    }

    /// What opening does to the tissue that is at `rest` [m] at rest, and at `y` [m] with the closed path. `None` where it does nothing.
    pub fn at(&self, rest: DVec3, y: DVec3) -> Option<OpenedPlace> {
        let section = self.section_at(rest);
        let eta = self.offset(&section, y);
        if section.radius == 0.0 || eta.length() >= FADED * self.map.shaft {
            return None;
        }
        let place = self.map.place(&section, y);
        let [near, far] = NEAR.map(|r| r * self.map.shaft);
        let x = ((far - eta.length()) / (far - near)).clamp(0.0, 1.0);
        let weight = x * x * (3.0 - 2.0 * x);
        let (h, cell) = self.gradient_at(rest)?;
        // No tissue is stretched more than at the rim of the slit.
        let rim = self.hole_at(rest);
        let away = eta.try_normalize().unwrap_or_else(|| lateral_axes(self.map.direction).0);
        let y = y + away * (rim - eta.length()).max(0.0);
        let f = DMat3::from_cols_array_2d(&self.map.at(&section, y, h).gradient(&h.to_cols_array_2d()));
        let von_mises = if weight > 0.0 { section.left() * self.shape_stress(cell, f) } else { 0.0 };
        Some(OpenedPlace { place, von_mises, weight })
    }

    /// Where tissue is with the closed path that rests at `rest` [m] and is seen at `seen` [m]; what would lie within the needle comes from the
    /// middle of the path.
    pub fn closed_place(&self, rest: DVec3, seen: DVec3) -> DVec3 {
        let section = self.section_at(rest);
        let eta = self.offset(&section, seen);
        let distance = eta.length();
        if section.radius == 0.0 || distance == 0.0 || distance >= FADED * self.map.shaft {
            return seen;
        }
        // The map keeps the order of distances.
        let reach = |part: f64| self.offset(&section, self.map.place(&section, seen + eta * (part - 1.0))).length();
        let (mut low, mut high) = (0.0, 1.0);
        while high - low > 1e-9 {
            let middle = 0.5 * (low + high);
            if reach(middle) < distance { low = middle } else { high = middle }
        }
        seen + eta * (low - 1.0)
    }

    /// Cells that the map reaches; `u`: displacement of every node, `closed`: von Mises stress of every cell, both with the closed path [m, Pa].
    pub fn cells(&self, u: &[DVec3], closed: &[f64]) -> Vec<OpenedCell> {
        let (Some(opening), mesh) = (self.model.opening(), &self.model.mesh) else { return Vec::new() };
        // Places in a cell by the weights of its corners, with their parts of its volume.
        let part = |n: usize| (n as f64 + 0.5) / PLACES as f64;
        let in_cube = |n: usize| DVec3::new(part(n % PLACES), part(n / PLACES % PLACES), part(n / PLACES / PLACES));
        let places: Vec<([f64; 8], f64)> = match mesh {
            Mesh::Block(_) => {
                let count = PLACES.pow(3);
                (0..count).map(|n| (trilinear(in_cube(n), DVec3::ONE).0, 1.0 / count as f64)).collect()
            }
            Mesh::Tets(_) => {
                let of_eight = |w: [f64; 4]| std::array::from_fn(|i| w.get(i).copied().unwrap_or(0.0));
                lattice(PLACES).into_iter().map(|(weights, part)| (of_eight(weights), part)).collect()
            }
        };
        let of_cell = |near: &NearCell| {
            let cell = near.cell as usize;
            let nodes = mesh.cell_nodes(cell);
            let at = |weights: &[f64; 8]| {
                nodes.iter().zip(weights).fold([DVec3::ZERO; 2], |[rest, moved], (node, weight)| {
                    [rest + mesh.rest_position(*node) * *weight, moved + u[*node] * *weight]
                })
            };
            let stress = |weights: &[f64; 8]| {
                let [rest, moved] = at(weights);
                // Ahead of the tip cells that the path runs through further up are those of the closed path.
                let coarse = if self.coarse[cell].is_nan() { closed[cell] } else { self.coarse[cell] };
                self.at(rest, rest + moved).map_or(coarse, |at| coarse + at.weight * (at.von_mises - coarse))
            };
            let von_mises = places.iter().map(|(weights, part)| part * stress(weights)).sum();
            // As the engines take the volume: what fading does at four places, what tissue grows by in the whole cell.
            let stations = &self.sections[usize::from(near.first)..][..usize::from(near.count)];
            let section = Station::mean(stations);
            if section.radius == 0.0 {
                return OpenedCell { cell, von_mises, grown: 0.0 };
            }
            let shape = CellShape::new(mesh, cell);
            let gradient = DMat3::IDENTITY + shape.displacement_gradient(&shape.gather(u));
            let middle =
                nodes.iter().map(|node| mesh.rest_position(*node) + u[*node]).sum::<DVec3>() / nodes.len() as f64;
            let dilation = |offset: DVec3| self.map.dilation(&section, middle + gradient * offset).less_one;
            let fades = mesh.volume_places(cell).map(dilation).iter().sum::<f64>() / 4.0;
            OpenedCell { cell, von_mises, grown: fades + section.radius.powi(2) * near.growth[0] }
        };
        opening.cells.iter().map(of_cell).collect()
    }
}
