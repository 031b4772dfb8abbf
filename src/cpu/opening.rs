//! Stage `opening`: tissue beside the path of the needle, carried by points, in f64 or by the lanes; stations, guide and friction. Equations:
//! src/needle/opening.rs.

use super::CpuEngine;
use super::lanes::Opened;
use super::lanes::opening::PointSums;
use super::path_reactions::guide;
use crate::engine::State;
use crate::engine::elements::{CellForces, CellShape, CellStates, Grown};
use crate::material::TangentBound;
use crate::material::kinematics::{J_CONTINUATION, cofactor, jacobian_minus_one, norm_squared};
use crate::material_point::{Material, PointState, Volumetric};
use crate::mesh::Mesh;
use crate::model::opening::{NearCell, OpeningPlan, OpeningStation, PathPoint, mean_of};
use crate::model::{Model, PuncturePlan};
use crate::needle::centre_line::{Bend, CentreLine};
use crate::needle::opening::{Derivatives, Dilation, Opening, OpeningMap, Station, outer, squared_norm_bound};
use crate::needle::{ToolPose, swing};
use glam::{DMat3, DVec3};
use std::sync::Arc;

/// What is derived of one station: of the energy E.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct StationSums {
    /// By its centre and the rate of its centre [N], [J].
    pub(super) centre: DVec3,
    pub(super) centre_rate: DVec3,
    /// By rc [N] and rc_Z [J].
    pub(super) radius: f64,
    pub(super) radius_rate: f64,
    /// Moment of the forces on nodes (with the sign of f_int) about the centre [N m]: what a needle that turns feels.
    pub(super) moment: DVec3,
    pub(super) energy: f64,
    /// Energy of the shape without relaxation, its part in cells around the path with it [J].
    pub(super) shape: f64,
}

impl StationSums {
    /// Adds derivatives of an energy per volume, of the volume `by` [m^3].
    /// `moment`: that of its forces about the centre, per volume.
    fn add(&mut self, d: &Derivatives<f64>, moment: DVec3, by: f64) {
        self.moment += moment * by;
        self.centre -= DVec3::from(d.place) * by;
        self.centre_rate += DVec3::from(d.centre_rate) * by;
        self.radius += d.radius * by;
        self.radius_rate += d.radius_rate * by;
    }

    fn add_other(&mut self, other: &StationSums) {
        self.centre += other.centre;
        self.centre_rate += other.centre_rate;
        self.radius += other.radius;
        self.radius_rate += other.radius_rate;
        self.moment += other.moment;
        self.shape += other.shape;
    }
}

impl From<&PointSums> for StationSums {
    fn from(p: &PointSums) -> Self {
        let PointSums { place, centre_rate, radius, radius_rate, moment, energy, shape } = *p;
        StationSums { centre: -place, centre_rate, radius, radius_rate, moment, energy, shape }
    }
}

/// A station as it is: geometry, place along the needle, and what the tip has cut.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Now {
    pub(super) section: Station,
    /// Middle of the section of the needle [m], and velocity of the tissue there, where it may rub [m/s].
    pub(super) disc: DVec3,
    pub(super) velocity: DVec3,
    /// Distance behind the tip [m].
    pub(super) behind: f64,
    pub(super) cut: f64,
    pub(super) cut_rate: f64,
    /// rc that a cut station would have [m], and its rate with `behind`.
    pub(super) full: f64,
    pub(super) slope: f64,
    /// Middle of the path from the axis of the needle, across it [m], and that axis.
    pub(super) aside: DVec3,
    pub(super) axis: Axis,
    /// Part of the opening that is left where it lies beside the needle, and its rate with the square of that distance [1/m^2].
    pub(super) left: f64,
    pub(super) leaving: f64,
}

/// The axis of the needle at a station: how it changes with the distance behind the tip, and its velocity [m/s], where the needle bends.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Axis {
    pub(super) slope: DVec3,
    pub(super) rate: DVec3,
}

/// Where the path is open in a step.
pub(super) struct OpenPath {
    now: Vec<Now>,
    sections: Vec<Station>,
    map: OpeningMap,
}

impl OpenPath {
    /// Map and sections.
    pub fn opened(&self) -> Opened<'_> {
        (&self.map, &self.sections)
    }
}

/// Differences of a quantity along the stations: weights of the neighbours before and behind station `i`.
pub(super) fn neighbours(i: usize, count: usize, spacing: f64) -> (usize, usize, f64) {
    let (before, behind) = (i.saturating_sub(1), (i + 1).min(count - 1));
    (before, behind, 1.0 / (spacing * (behind - before) as f64))
}

/// The path in a cell: the mean of the stations in it.
fn within(stations: &[Station], near: &NearCell) -> Station {
    Station::mean(&stations[usize::from(near.first)..][..usize::from(near.count)])
}

impl CpuEngine {
    /// Where all stations are.
    fn stations_now(&self, plan: &PuncturePlan, opening: &OpeningPlan, (pose, step): (&ToolPose, u64)) -> Vec<Now> {
        let (u, a) = (&self.state.displacement, self.state.tip_coordinate);
        let t = pose.direction;
        let shift = plan.contact.as_ref().map_or(0.0, |c| c.part(a)) * self.state.touch.dimple;
        let (velocities, rubs) = (&self.state.velocity, self.model.effects.friction.is_some());
        // Sections of a bevel lie aside of the tip as far as they are wide.
        let bevel = swing(plan.reference, t, plan.profile.shift);
        let mut now = vec![Now::default(); opening.stations.len()];
        self.fill(&mut now, |i| {
            let station = &opening.stations[i];
            if opening.is_ahead(station, a) {
                return Now::default();
            }
            let centre = station.centre_at_rest + mean_of(&station.centre, &station.nodes, u);
            let disc = station.disc_at_rest + mean_of(&station.disc, &station.nodes, u);
            let behind = (pose.tip - disc).dot(t) - shift;
            let ((radius, rate), opened) = (opening.radius(behind), station.opened(opening.shaft));
            let (full, slope) = (radius * opened, rate * opened);
            let (cut, cut_rate) = opening.cut(station, a);
            let bend = match &self.centre_line {
                Some(line) => line.at(behind, (step - line.first_step) as f64 * self.dt),
                None => Bend::default(),
            };
            let aside = centre - pose.tip;
            let aside = aside - t * aside.dot(t) - bend.offset - bevel * radius;
            let (left, leaving) = opening.left_beside(aside.length_squared());
            let axis = Axis { slope: bend.slope + bevel * rate, rate: bend.rate };
            let section = Station {
                centre,
                radius: full * cut * left,
                rest_direction: station.direction,
                growth: station.growth,
                relaxed: self.state.relaxation.get(i).map_or(0.0, |r| 1.0 - r.left),
                ..Station::default()
            };
            let velocity = if rubs { mean_of(&station.disc, &station.nodes, velocities) } else { DVec3::ZERO };
            Now { section, disc, velocity, behind, cut, cut_rate, full, slope, aside, axis, left, leaving }
        });
        for i in 0..now.len() {
            let (before, behind, by) = neighbours(i, now.len(), opening.spacing);
            let (a, b) = (now[before].section, now[behind].section);
            let rate = (b.centre - a.centre) * by;
            now[i].section.centre_rate = rate - t * rate.dot(t);
            now[i].section.radius_rate = (b.radius - a.radius) * by;
        }
        now
    }

    /// The path of a state of `model` as it is open: all sections, with the needle where `pose` says, bent along `line`.
    pub(crate) fn opened_sections(
        model: &Arc<Model>,
        state: &State,
        pose: &ToolPose,
        line: Option<&CentreLine>,
    ) -> Vec<Station> {
        let (Some(plan), Some(opening)) = (&model.puncture, model.opening()) else { return Vec::new() };
        let mut engine = CpuEngine::new(model.clone(), 1.0);
        engine.state = state.clone();
        engine.centre_line = line.copied();
        let first_step = line.map_or(0, |line| line.first_step);
        engine.stations_now(plan, opening, (pose, first_step)).iter().map(|n| n.section).collect()
    }

    /// What an opened path holds in a state of `model`, with the needle where `pose` says [J]: tissue, guide and stick springs.
    pub(crate) fn opening_energy(model: &Arc<Model>, state: &State, pose: &ToolPose) -> f64 {
        let (Some(plan), Some(opening)) = (&model.puncture, model.opening()) else { return 0.0 };
        let mut engine = CpuEngine::new(model.clone(), 1.0);
        engine.state = state.clone();
        engine.measures = true;
        let Some(OpenPath { now, sections, map }) = engine.open_path(plan, pose, 0) else { return 0.0 };
        let mut by_volume = [0.0; 2];
        if let Mesh::Tets(_) = model.mesh {
            for (sum, grown) in by_volume.iter_mut().zip([&[][..], &engine.grown]) {
                let states = CellStates::default();
                let averaged = engine.elements.averaged_volumetrics(model, &state.displacement, states, grown);
                engine.averaged = averaged.unwrap_or_default();
                let of_cells = engine.averaged.iter().enumerate();
                *sum = of_cells.map(|(cell, v)| model.mesh.cell_volume(cell) * v.energy).sum::<f64>();
            }
        }
        let (_, in_shape) = engine.opened_in_f64(model, (opening, &map), &sections);
        let elastic = in_shape + by_volume[1] - by_volume[0];
        let stick = model.effects.friction.as_ref().map_or(0.0, |f| 0.5 * f.stiffness_ratio);
        let springs = now.iter().zip(&opening.stations).zip(&state.stations).map(|((n, station), stretch)| {
            guide(opening, (station.guide, n), 0.0).stored + stick * station.stick * stretch * stretch
        });
        elastic + springs.sum::<f64>()
    }

    /// Where the path is open, which the averaged pressure of tetrahedra depends on. `None` in the other scheme.
    pub(super) fn open_path(&mut self, plan: &PuncturePlan, pose: &ToolPose, step: u64) -> Option<OpenPath> {
        let opening = plan.opening.as_ref()?;
        let now = self.stations_now(plan, opening, (pose, step));
        let sections: Vec<Station> = now.iter().map(|n| n.section).collect();
        let map = opening.map(pose.direction);
        // Lanes know by themselves, but for the measures.
        let is_asked = self.measures || self.lanes.as_mut().is_none_or(|lanes| lanes.opening().is_none());
        if self.model.mesh.as_tets().is_some() && is_asked {
            self.grown = self.grown_beside(opening, &map, &sections);
        }
        Some(OpenPath { now, sections, map })
    }

    /// Tetrahedra that an opened path makes grow or shrink.
    fn grown_beside(&self, opening: &OpeningPlan, map: &OpeningMap, sections: &[Station]) -> Vec<Grown> {
        let (model, displacement) = (&self.model, &self.state.displacement);
        let by = self.each(opening.cells.len(), |i| {
            let (near, section) = (&opening.cells[i], within(sections, &opening.cells[i]));
            if section.radius == 0.0 {
                return 0.0;
            }
            let cell = CellNow::new(model, near.cell as usize, displacement);
            dilations(model, map, (near, &section), &cell).1
        });
        let cells = opening.cells.iter().map(|near| near.cell).zip(by);
        cells.filter(|(_, by)| *by != 0.0).map(|(cell, by)| Grown { cell, by }).collect()
    }

    /// Stage `opening`: forces of points, near cells, the guide on the needle and friction.
    pub(super) fn opening(
        &mut self,
        opening: &OpeningPlan,
        pose: &ToolPose,
        OpenPath { now, sections, map }: &OpenPath,
    ) {
        let model = self.model.clone();
        let (sums, elastic) = match self.opened_in_lanes(&model, (opening, map), sections) {
            Some(found) => found,
            None => self.opened_in_f64(&model, (opening, map), sections),
        };
        if self.measures {
            self.opening_elastic = elastic;
        }
        self.station_reactions(opening, pose, now, &sums);
        if self.measures {
            self.relax(&model, opening, now, &sums);
        }
    }

    /// Averaged pressure of a tetrahedron in the last forces [Pa]; `None` for a hexahedron, which has its own.
    fn averaged_pressure(&self, cell: usize) -> Option<f64> {
        self.model.mesh.as_tets()?;
        if let Some(lanes) = &self.lanes {
            return Some(lanes.averaged_pressure(&self.model.mesh.cell_nodes(cell)));
        }
        // Without what a tetrahedron that is nearly flat has of its own.
        let shape = CellShape::new(&self.model.mesh, cell);
        let j = 1.0 + jacobian_minus_one(shape.displacement_gradient(&shape.gather(&self.state.displacement)));
        let flat = (j - self.elements.flat_below()).min(0.0);
        Some(self.averaged.get(cell)?.stress - self.model.material(cell).law.bulk_modulus * flat)
    }

    /// The stress beside every station relaxes, at the end of a frame whose energies are known.
    fn relax(&mut self, model: &Model, opening: &OpeningPlan, now: &[Now], sums: &[StationSums]) {
        let time = f64::from(self.sums.steps) * self.dt;
        for (((relaxation, station), now), sums) in
            self.state.relaxation.iter_mut().zip(&opening.stations).zip(now).zip(sums)
        {
            let before = relaxation.dissipated;
            relaxation.advance(model.terms_at(station), now.section.radius, sums.shape, time);
            // What is measured is what the next frame begins with.
            self.opening_elastic -= relaxation.dissipated - before;
        }
    }

    /// Forces of points and near cells on nodes; what is derived of the stations, and the energy that opening adds.
    fn opened_in_f64(
        &mut self,
        model: &Model,
        (opening, map): (&OpeningPlan, &OpeningMap),
        sections: &[Station],
    ) -> (Vec<StationSums>, f64) {
        let mut sums = vec![StationSums::default(); sections.len()];
        let mut elastic = 0.0;
        // Points: every station its own.
        let (displacement, measures) = (&self.state.displacement, self.measures);
        let shape = |cell: u32| Shape { material: model.material(cell as usize), measures };
        let points =
            self.each(sections.len(), |i| point_forces(&shape, map, &opening.stations[i], &sections[i], displacement));
        for ((station, local), sums) in opening.stations.iter().zip(&points).zip(&mut sums) {
            for (node, (force, bound)) in station.nodes.iter().zip(&local.1) {
                self.added.add(*node as usize, -*force, *bound);
            }
            *sums = local.0;
            elastic += local.0.energy;
        }
        let displacement = &self.state.displacement;
        let cells = self.each(opening.cells.len(), |i| {
            let near = &opening.cells[i];
            let (section, pressure) = (within(sections, near), self.averaged_pressure(near.cell as usize));
            near_cell_forces(model, shape(near.cell), map, (near, &section), displacement, pressure)
        });
        for (near, added) in opening.cells.iter().zip(cells) {
            let Some(found) = added else { continue };
            elastic += self.add_near_cell(near, &found, &mut sums);
        }
        (sums, elastic)
    }

    /// Adds a near cell to its nodes and stations; returns its energy.
    fn add_near_cell(&mut self, near: &NearCell, found: &NearCellForces, sums: &mut [StationSums]) -> f64 {
        let (forces, (derivatives, moment), [energy, shape]) = found;
        self.add_to_cell(near.cell as usize, forces);
        for sums in &mut sums[usize::from(near.first)..][..usize::from(near.count)] {
            sums.add(derivatives, *moment, 1.0 / f64::from(near.count));
            sums.shape += shape / f64::from(near.count);
        }
        *energy
    }

    /// The same in lanes, and in f64 where these do not know a state; `None`: there are no lanes.
    fn opened_in_lanes(
        &mut self,
        model: &Model,
        (opening, map): (&OpeningPlan, &OpeningMap),
        sections: &[Station],
    ) -> Option<(Vec<StationSums>, f64)> {
        let measures = self.measures;
        let shape = |cell: u32| Shape { material: model.material(cell as usize), measures };
        let CpuEngine { lanes, state, added, .. } = self;
        let mut lanes = lanes.as_mut()?.opening()?;
        let displacement = &state.displacement;
        let [vectors, cells] = lanes.compute(map, sections, displacement, measures);
        let (mut points, cells_of_spans) = lanes.gather(sections);
        // What lanes do not know, in f64.
        for (station, index) in vectors.into_iter().flat_map(|number| lanes.points_of(number)).copied() {
            let (section, station_now) = (&sections[station], &opening.stations[station]);
            if section.radius == 0.0 {
                continue;
            }
            let u: Vec<DVec3> = station_now.nodes.iter().map(|n| displacement[*n as usize]).collect();
            let point = &station_now.points[index];
            let (d, moment, energy) = point_force(shape(point.cell), map, point, section, &u, |place, force, bound| {
                added.add(station_now.nodes[place] as usize, -force, bound);
            });
            let left = section.left();
            let found = PointSums::new(&d, moment, energy, point.volume * left);
            points[station].add(&PointSums { shape: found.shape / left, ..found });
        }
        let mut sums: Vec<StationSums> = points.iter().map(StationSums::from).collect();
        let mut elastic: f64 = sums.iter().map(|s| s.energy).sum();
        for ((first, count), found) in cells_of_spans {
            elastic += found.energy;
            let found = StationSums::from(&found.times(1.0 / f64::from(count)));
            for sums in &mut sums[usize::from(first)..][..usize::from(count)] {
                sums.add_other(&found);
            }
        }
        for near in cells.into_iter().map(|i| &opening.cells[i]) {
            let section = within(sections, near);
            let (u, pressure) = (&self.state.displacement, self.averaged_pressure(near.cell as usize));
            let found = near_cell_forces(model, shape(near.cell), map, (near, &section), u, pressure);
            if let Some(found) = found {
                elastic += self.add_near_cell(near, &found, &mut sums);
            }
        }
        Some((sums, elastic))
    }
}

/// What keeps the shape: law and fibres, without the pressure, which is the cell's.
#[derive(Clone, Copy)]
struct Shape<'a> {
    material: &'a Material,
    /// True where the energy is asked for.
    measures: bool,
}

impl Shape<'_> {
    /// Stress of F = I + h [Pa].
    fn stress(&self, h: DMat3) -> DMat3 {
        self.material.stress(h, Volumetric { stress: 0.0, energy: 0.0 }, 1.0, &PointState::default())
    }

    /// What opening adds at a place: derivatives of `W(F) - a(J_h) W(F_h)`, that difference (0 where nobody asks), per volume, and the bound of
    /// the tangent there.
    fn opened(&self, map: &Opening<f64>, h: DMat3) -> (Derivatives<f64>, f64, TangentBound) {
        let f = DMat3::from_cols_array_2d(&map.gradient(&h.to_cols_array_2d()));
        let mut bound = self.material.tangent_bound(f, &PointState::default());
        let mut d = map.pull_back(&self.stress(f).to_cols_array_2d());
        let energy = |h: DMat3| self.material.energy(h, 0.0, 1.0, &PointState::default()).stored;
        let (stress, taken) = (self.stress(h), Taken::new(1.0 + jacobian_minus_one(h)));
        let mut by_closed = stress * taken.part;
        if taken.rate > 0.0 {
            let (cof, w) = (cofactor(DMat3::IDENTITY + h), energy(h));
            by_closed += cof * (taken.rate * w);
            bound.turned +=
                Taken::LARGEST_CURVATURE * w + 2.0 * taken.rate * (norm_squared(stress) / norm_squared(cof)).sqrt();
        }
        d.gradient = (DMat3::from_cols_array_2d(&d.gradient) - by_closed).to_cols_array_2d();
        (d, if self.measures { energy(f) - taken.part * energy(h) } else { 0.0 }, bound)
    }
}

/// Part a of the energy of the closed gradient that opening takes off at a place, by J of that gradient, and da/dJ. The cell counts what its
/// middle holds. A corner that is inside out would hold far more by itself, and taking that off would fold it further, without bound. As
/// `taken` in shaders/shared/opened_point.wgsl.
struct Taken {
    part: f64,
    rate: f64,
}

impl Taken {
    /// Most of d2a/dJ2.
    const LARGEST_CURVATURE: f64 = 6.0 / (J_CONTINUATION * J_CONTINUATION);

    /// All from the J on from which the law is that of tissue, nothing of what is inside out.
    fn new(j: f64) -> Self {
        let x = (j / J_CONTINUATION).clamp(0.0, 1.0);
        Taken { part: x * x * (3.0 - 2.0 * x), rate: 6.0 * x * (1.0 - x) / J_CONTINUATION }
    }
}

/// Forces (with the sign of f_int) and bounds of the points of a station at its nodes.
fn point_forces<'a>(
    shape: &impl Fn(u32) -> Shape<'a>,
    map: &OpeningMap,
    station: &OpeningStation,
    section: &Station,
    displacement: &[DVec3],
) -> (StationSums, Vec<(DVec3, f64)>) {
    let mut sums = StationSums::default();
    // What is not opened is as its cells have it.
    if section.radius == 0.0 {
        return (sums, Vec::new());
    }
    let u: Vec<DVec3> = station.nodes.iter().map(|n| displacement[*n as usize]).collect();
    let mut local = vec![(DVec3::ZERO, 0.0); u.len()];
    for point in &station.points {
        let (d, moment, energy) = point_force(shape(point.cell), map, point, section, &u, |place, force, bound| {
            local[place].0 += force;
            local[place].1 += bound;
        });
        let left = point.volume * section.left();
        sums.shape += point.volume * energy;
        sums.energy += left * energy;
        sums.add(&d, moment, left);
    }
    (sums, local)
}

/// What opening adds at a point: derivatives, moment about the centre and energy per volume, without relaxation; `add` gets places of its
/// corners in the station, forces and bounds.
fn point_force(
    shape: Shape,
    map: &OpeningMap,
    point: &PathPoint,
    section: &Station,
    u: &[DVec3],
    mut add: impl FnMut(usize, DVec3, f64),
) -> (Derivatives<f64>, DVec3, f64) {
    let (y, h) = point.place_and_gradient(u);
    let map = map.at(section, y, h);
    let (d, energy, tangent) = shape.opened(&map, h);
    // Rows of the point's own stiffness.
    let (by_gradient, by_place) = map.amplification();
    let grown = by_gradient + by_place * map.distance();
    let cof = cofactor(DMat3::IDENTITY + h).to_cols_array_2d();
    let stiffness = tangent.straight * grown * grown + tangent.turned * squared_norm_bound(&cof);
    let (by_gradient, by_place) = (DMat3::from_cols_array_2d(&d.gradient), DVec3::from(d.place));
    let sizes = point.gradients.map(|g| g.length());
    let bound = point.volume * stiffness * sizes.iter().sum::<f64>();
    for (c, place) in point.corners.iter().enumerate() {
        let left = point.volume * section.left();
        let force = (by_gradient * point.gradients[c] + by_place * point.weights[c]) * left;
        add(usize::from(*place), force, bound * sizes[c]);
    }
    (d, moment_of(DMat3::IDENTITY + h, y - section.centre, by_gradient, by_place), energy)
}

/// Moment of forces on nodes that have these derivatives of an energy by the gradient and by the place, about what lies at `-offset`.
fn moment_of(gradient: DMat3, offset: DVec3, by_gradient: DMat3, by_place: DVec3) -> DVec3 {
    let of_columns = [0, 1, 2].map(|a| gradient.col(a).cross(by_gradient.col(a)));
    offset.cross(by_place) + of_columns[0] + of_columns[1] + of_columns[2]
}

/// A cell as it is, with the closed path.
struct CellNow {
    shape: CellShape,
    /// Its middle [m].
    middle: DVec3,
    /// Displacement gradient.
    h: DMat3,
}

impl CellNow {
    fn new(model: &Model, cell: usize, displacement: &[DVec3]) -> Self {
        let shape = CellShape::new(&model.mesh, cell);
        let u = shape.gather(displacement);
        let corners = shape.nodes.iter().zip(u).map(|(node, u)| model.mesh.rest_position(*node) + u);
        let middle = corners.sum::<DVec3>() / shape.nodes.len() as f64;
        CellNow { h: shape.displacement_gradient(&u), middle, shape }
    }
}

/// By how much the volume of a cell around the path grows at four places (with their offsets from its middle [m]), and in all of it.
fn dilations(
    model: &Model,
    map: &OpeningMap,
    (near, section): (&NearCell, &Station),
    cell: &CellNow,
) -> ([(Dilation<f64>, DVec3); 4], f64) {
    let gradient = DMat3::IDENTITY + cell.h;
    let places = model.mesh.volume_places(near.cell as usize);
    let found = places.map(|offset| (map.dilation(section, cell.middle + gradient * offset), offset));
    let mean = found.iter().map(|(d, _)| d.less_one).sum::<f64>() / 4.0;
    (found, mean + section.radius.powi(2) * near.growth[0])
}

/// Forces and bounds of a near cell, derivatives of its energy with their moment about the path, that energy, and what the shape of its part
/// would hold without relaxation [J].
type NearCellForces = (CellForces, (Derivatives<f64>, DVec3), [f64; 2]);

/// What opening adds to a cell: forces, derivatives of its energy by the path, and that energy. The gradient of y is that of its centre,
/// as elsewhere; the volume is taken at four places, the shape at one. `averaged`: pressure of a tetrahedron, whose volume is that of the
/// nodes around it with what opening adds, and whose energy by volume is booked there.
fn near_cell_forces(
    model: &Model,
    shape_of: Shape,
    map: &OpeningMap,
    (near, section): (&NearCell, &Station),
    displacement: &[DVec3],
    averaged: Option<f64>,
) -> Option<NearCellForces> {
    if section.radius == 0.0 {
        return None;
    }
    let now = CellNow::new(model, near.cell as usize, displacement);
    let CellNow { shape, middle, h } = &now;
    let (middle, h) = (*middle, *h);
    let gradient = DMat3::IDENTITY + h;
    let material = shape_of.material;
    let (mut sum, mut energy, mut intact) = (Derivatives::none(0.0), 0.0, 0.0);
    let mut grown = 1.0f64;
    // y is linear in the cell, as its gradient is one: a force at a place is one on the middle and one on the gradient.
    let add = |sum: &mut Derivatives<f64>, d: &Derivatives<f64>, offset: DVec3, by: f64| {
        sum.add(d, by);
        let by_offset = outer((DVec3::from(d.place) * by).to_array(), offset.to_array());
        sum.gradient =
            (DMat3::from_cols_array_2d(&sum.gradient) + DMat3::from_cols_array_2d(&by_offset)).to_cols_array_2d();
    };
    let (at_volume_places, less) = dilations(model, map, (near, section), &now);
    let tangent = material.tangent_bound(h, &PointState::default());
    let (mut straight, mut turned) = (tangent.straight, tangent.turned);
    let [grows, varies] = near.growth;
    let rc = section.radius;
    // What keeps the shape, of what points do not carry.
    if near.share > 0.0 {
        let map = map.at(section, middle + gradient * near.place, h);
        let volume = near.share * shape.volume;
        let (d, w, tangent) = shape_of.opened(&map, h);
        let left = volume * section.left();
        intact = volume * w;
        energy += left * w;
        add(&mut sum, &d, near.place, left);
        let (by_gradient, by_place) = map.amplification();
        grown = grown.max(by_gradient + by_place * shape.edge());
        (straight, turned) = (straight.max(tangent.straight), turned.max(tangent.turned));
    }
    // The volume is the cell's, or that of the nodes around it.
    let (closed, cof) = (jacobian_minus_one(h), cofactor(gradient));
    let bulk = material.law.bulk_modulus;
    let open = closed + less + closed * less;
    let uneven = rc.powi(4) * varies;
    let beyond = bulk * (1.0 + closed) * uneven;
    energy += shape.volume * 0.5 * (1.0 + closed) * beyond;
    let (pressure, by_jacobian) = match averaged {
        Some(pressure) => (pressure, pressure * less),
        None => {
            energy += shape.volume * 0.5 * bulk * (open - closed) * (open + closed);
            (bulk * open, bulk * less * (1.0 + closed + open))
        }
    };
    let by_gradient = cof * ((by_jacobian + beyond) * shape.volume);
    let j = 1.0 + closed;
    sum.radius += 2.0 * shape.volume * rc * j * (pressure * grows + bulk * j * rc * rc * varies);
    sum.gradient = (DMat3::from_cols_array_2d(&sum.gradient) + by_gradient).to_cols_array_2d();
    for (dilation, offset) in &at_volume_places {
        let (place, radius) = dilation.pull_back(pressure * (1.0 + closed));
        add(&mut sum, &Derivatives { place, radius, ..Derivatives::none(0.0) }, *offset, 0.25 * shape.volume);
    }
    // Bound of the stiffness beyond that of the closed cell, where open faces may meet (see Elements::stiffness_bound).
    let widened = (1.0 + less).max(1.0).powi(2) + uneven;
    let added = |cof_b: f64, b: f64| {
        let with = (bulk + turned) * cof_b * widened + straight * grown * grown * b;
        let without = (bulk + tangent.turned) * cof_b + tangent.straight * b;
        shape.volume * (with - without).max(0.0)
    };
    let mut forces = CellForces::default();
    match &model.mesh {
        Mesh::Block(block) => {
            let b = (0.25 / block.cell_size(near.cell as usize)).length_squared();
            forces.bound = [8.0 * added(squared_norm_bound(&cof.to_cols_array_2d()) * b, b); 8];
        }
        Mesh::Tets(_) => {
            let lengths = shape.gradients().iter().map(|b| ((cof * *b).length(), b.length()));
            let (sum_cof, sum) = lengths.clone().fold((0.0, 0.0), |s, l| (s.0 + l.0, s.1 + l.1));
            for (bound, (cof_b, b)) in forces.bound.iter_mut().zip(lengths) {
                *bound = added(cof_b * sum_cof, b * sum);
            }
        }
    }
    let (by_gradient, by_place) = (DMat3::from_cols_array_2d(&sum.gradient), DVec3::from(sum.place));
    let part = 1.0 / shape.nodes.len() as f64;
    for (i, b) in shape.gradients().iter().enumerate() {
        forces.force[i] = by_gradient * *b + by_place * part;
    }
    let moment = moment_of(gradient, middle - section.centre, by_gradient, by_place);
    Some((forces, (sum, moment), [energy, intact]))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::material::ElasticLaw;

    /// What opening adds where a corner is squeezed flat and folded ever further: with the whole energy of the closed gradient taken off it fell
    /// without bound, and a corner beside a needle that was turned hard folded until the run broke.
    #[test]
    fn a_folded_corner_gains_nothing_by_the_needle_beside_it() {
        let material = Material::elastic(ElasticLaw::from_moduli(4.1e3, 4e4, 0.7), 1060.0);
        let shape = Shape { material: &material, measures: true };
        let direction = DVec3::new(0.019, 0.0815, -0.996).normalize();
        let map = OpeningMap { direction, shaft: 0.454e-3, least: 1e-16 };
        let rest_direction = DVec3::new(-0.03, -0.02, -1.0).normalize();
        let section = Station { radius: 0.454e-3, rest_direction, ..Station::default() };
        // As in a cell that folded: -0.5, -2.2 and, three times as far, -60.
        let folded = DMat3::from_cols_array_2d(&[[-0.52, -1.25, -0.73], [-1.0, 0.16, -0.52], [-0.27, -0.58, 0.83]]);
        let jacobian = |t: f64| 1.0 + jacobian_minus_one(folded * t);
        let added = |t: f64, y: DVec3| shape.opened(&map.at(&section, y, folded * t), folded * t);
        let around = (0..64).map(|i| DVec3::new((0.098 * f64::from(i)).cos(), (0.098 * f64::from(i)).sin(), 0.0));
        let flat = (1..1000).map(|i| 1e-3 * f64::from(i)).find(|t| jacobian(*t) < 0.25).unwrap();
        for (t, r) in [1.0, 2.0, 3.0].into_iter().flat_map(|t| [0.25e-3, 0.38e-3, 0.6e-3].map(|r| (t, r))) {
            let least = around.clone().map(|y| added(t, y * r).1).fold(f64::INFINITY, f64::min);
            assert!(least > 0.0, "J {:.2}, {r:.1e} m: {least:.2e} J/m^3", jacobian(t));
        }
        // The force is the derivative of this energy, too, where part of it is taken off.
        let (y, step) = (DVec3::new(0.25e-3, 0.1e-3, 0.0), 1e-6);
        let difference = (added(flat + step, y).1 - added(flat - step, y).1) / (2.0 * step);
        let by_gradient = DMat3::from_cols_array_2d(&added(flat, y).0.gradient);
        let exact: f64 = (0..3).map(|a| by_gradient.col(a).dot(folded.col(a))).sum();
        assert!((difference / exact - 1.0).abs() < 1e-4, "{difference} {exact}");
    }
}
