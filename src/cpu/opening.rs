//! Stage `opening` in f64: tissue beside the path of the needle, carried by points. Equations: src/needle/opening.rs.

use glam::{DMat3, DVec3};

use super::lanes::LaneCells;
use super::{ContactSums, CpuEngine};
use crate::engine::elements::{CellForces, CellShape};
use crate::material::TangentBound;
use crate::material::kinematics::cofactor;
use crate::material::regular::{Polynomial, Regular};
use crate::material_point::{Material, PointState, Volumetric};
use crate::mesh::CORNERS;
use crate::model::opening::{NearCell, OpeningPlan, OpeningStation, mean_place};
use crate::model::{Model, PuncturePlan};
use crate::needle::ToolPose;
use crate::needle::centre_line::Bend;
use crate::needle::opening::{Derivatives, Opening, Station, outer, squared_norm_bound};

/// What is derived of one station: of the energy E.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct StationSums {
    /// By its centre and the rate of its centre [N], [J].
    centre: DVec3,
    centre_rate: DVec3,
    /// By rc [N] and rc_Z [J].
    radius: f64,
    radius_rate: f64,
    energy: f64,
}

impl StationSums {
    /// Adds derivatives of an energy per volume, of the volume `by` [m^3].
    fn add(&mut self, d: &Derivatives, by: f64) {
        self.centre -= d.place * by;
        self.centre_rate += d.centre_rate * by;
        self.radius += d.radius * by;
        self.radius_rate += d.radius_rate * by;
    }
}

/// A station as it is: geometry, place along the needle, and what the tip has cut.
#[derive(Debug, Clone, Copy)]
struct Now {
    section: Station,
    /// Distance behind the tip [m].
    behind: f64,
    cut: f64,
    cut_rate: f64,
    /// rc that a cut station would have [m], and its rate with `behind`; the same of the needle itself.
    full: f64,
    slope: f64,
    radius: f64,
    rate: f64,
}

/// Differences of a quantity along the stations: weights of the neighbours before and behind station `i`.
fn neighbours(i: usize, count: usize, spacing: f64) -> (usize, usize, f64) {
    let (before, behind) = (i.saturating_sub(1), (i + 1).min(count - 1));
    (before, behind, 1.0 / (spacing * (behind - before) as f64))
}

/// The path in a cell: the mean of the stations in it.
fn within(now: &[Now], cell: &NearCell) -> Station {
    let mut mean = Station::default();
    let by = 1.0 / f64::from(cell.count);
    for n in &now[usize::from(cell.first)..][..usize::from(cell.count)] {
        mean.centre += n.section.centre * by;
        mean.centre_rate += n.section.centre_rate * by;
        mean.radius += n.section.radius * by;
        mean.radius_rate += n.section.radius_rate * by;
    }
    mean
}

impl CpuEngine {
    /// Where all stations are.
    fn stations_now(&self, plan: &PuncturePlan, opening: &OpeningPlan, tip: DVec3) -> Vec<Now> {
        let mesh = self.model.mesh.block();
        let (u, a) = (&self.state.displacement, self.state.tip_coordinate);
        let t = plan.path.direction;
        let shift = plan.contact.as_ref().map_or(0.0, |c| c.part(a)) * self.state.touch.dimple;
        let mut now = self.each(opening.stations.len(), |i| {
            let station = &opening.stations[i];
            let centre = mean_place(&station.centre, &station.nodes, mesh, u);
            let behind = (tip - mean_place(&station.disc, &station.nodes, mesh, u)).dot(t) - shift;
            let ((radius, rate), opened) = (opening.radius(behind), station.opened(opening.map.shaft));
            let (full, slope) = (radius * opened, rate * opened);
            let (cut, cut_rate) = opening.cut(station, a);
            let section = Station { centre, radius: full * cut, ..Station::default() };
            Now { section, behind, cut, cut_rate, full, slope, radius, rate }
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

    /// Stage `opening`: forces of points, near cells, the guide on the needle and friction.
    pub(super) fn opening(&mut self, plan: &PuncturePlan, opening: &OpeningPlan, pose: &ToolPose, step: u64) {
        let model = self.model.clone();
        let now = self.stations_now(plan, opening, pose.tip);
        let mut sums = vec![StationSums::default(); now.len()];
        let mut elastic = 0.0;
        // Points: every station its own.
        let displacement = &self.state.displacement;
        let (lanes, measures) = (&self.lanes, self.measures);
        let shape = |lanes: &Option<LaneCells>, cell: u32| Shape {
            material: model.material(cell as usize),
            regular: lanes.as_ref().and_then(|lanes| lanes.law(model.material_index(cell as usize))),
            measures,
        };
        let points = self.each(now.len(), |i| {
            point_forces(&|cell| shape(lanes, cell), opening, &opening.stations[i], &now[i].section, displacement)
        });
        for ((station, local), sums) in opening.stations.iter().zip(&points).zip(&mut sums) {
            for (node, (force, bound)) in station.nodes.iter().zip(&local.1) {
                self.external[*node as usize] -= *force;
                self.added_bound[*node as usize] += bound;
            }
            *sums = local.0;
            elastic += local.0.energy;
        }
        // Cells that the map reaches.
        let (lanes, displacement) = (&self.lanes, &self.state.displacement);
        let cells = self.each(opening.cells.len(), |i| {
            let near = &opening.cells[i];
            near_cell_forces(&model, shape(lanes, near.cell), opening, near, &within(&now, near), displacement)
        });
        for (near, added) in opening.cells.iter().zip(cells) {
            let Some((forces, derivatives, energy)) = added else { continue };
            self.add_to_cell(near.cell as usize, &forces);
            elastic += energy;
            for sums in &mut sums[usize::from(near.first)..][..usize::from(near.count)] {
                sums.add(&derivatives, 1.0 / f64::from(near.count));
            }
        }
        if measures {
            self.opening_elastic = elastic;
        }
        self.station_reactions(opening, plan, (pose, step), &now, &sums);
    }

    /// Forces of the stations on their nodes, on the needle and on the tip; friction.
    fn station_reactions(
        &mut self,
        opening: &OpeningPlan,
        plan: &PuncturePlan,
        (pose, step): (&ToolPose, u64),
        now: &[Now],
        sums: &[StationSums],
    ) {
        let t = plan.path.direction;
        let model = self.model.clone();
        let count = now.len();
        // By rc with all that follows from it, and by the centre.
        let mut radius: Vec<f64> = sums.iter().map(|s| s.radius).collect();
        let mut centre: Vec<DVec3> = sums.iter().map(|s| s.centre).collect();
        for (i, s) in sums.iter().enumerate() {
            let (before, behind, by) = neighbours(i, count, opening.spacing);
            radius[behind] += s.radius_rate * by;
            radius[before] -= s.radius_rate * by;
            let rate = s.centre_rate - t * s.centre_rate.dot(t);
            centre[behind] += rate * by;
            centre[before] -= rate * by;
        }
        let guides: Vec<Guide> = now.iter().map(|n| self.guide(opening, plan, pose, step, n)).collect();
        // Along the needle: by how rc and the axis change behind the tip.
        let spreads: Vec<f64> =
            now.iter().zip(&radius).zip(&guides).map(|((n, r), g)| r * n.slope * n.cut + g.along).collect();
        let old = [self.state.opening_resistance, self.state.opening_spreading];
        self.state.opening_resistance =
            now.iter().zip(&radius).zip(&guides).map(|((n, r), g)| (r + g.by_radius) * n.full * n.cut_rate).sum();
        self.state.opening_spreading = spreads.iter().sum();
        // The tip was told what the path took before it advanced: half of what that changed by comes off.
        let [advance, shift] = self.advanced;
        self.sums.energy.tip += 0.5 * (self.state.opening_spreading - old[1]) * shift
            - 0.5 * (self.state.opening_resistance - old[0]) * advance;
        let normal = averaged_normal(opening, now, sums);
        let velocity = &self.state.velocity;
        let mut stored = 0.0;
        let (mut booked, mut bend_work) = (ContactSums::default(), 0.0);
        let friction = model.effects.friction.unwrap_or_default();
        for (i, station) in opening.stations.iter().enumerate() {
            let n = &now[i];
            let Guide { force: guide, held, .. } = guides[i];
            stored += guides[i].stored;
            let spread = spreads[i];
            let mean_velocity: DVec3 =
                station.disc.iter().map(|(p, w)| velocity[station.nodes[usize::from(*p)] as usize] * *w).sum();
            let mut rubbing = 0.0;
            let memory = &mut self.state.stations[i];
            let on_shaft =
                crate::effects::friction::part_on_shaft(n.behind, opening.tip_length, friction.fade_length) * n.cut;
            let squeeze = normal[i].max(0.0) * on_shaft;
            self.sums.shaft_normal_impulse += squeeze * self.dt;
            if model.effects.friction.is_some() {
                let limit = friction.coefficient * squeeze;
                let kt = friction.stiffness_ratio * opening.stick;
                let motion = (mean_velocity - pose.velocity).dot(t) * self.dt;
                let (old, trial) = (*memory, *memory + motion);
                *memory = if limit > 0.0 { trial.clamp(-limit / kt, limit / kt) } else { 0.0 };
                rubbing = -kt * *memory;
                booked.friction_work += 0.5 * kt * (old + *memory) * (trial - *memory);
                stored += 0.5 * kt * *memory * *memory;
                for (place, w) in &station.disc {
                    self.added_bound[station.nodes[usize::from(*place)] as usize] += 2.0 * kt * w;
                }
            }
            let along = t * (spread + rubbing);
            for (place, w) in &station.disc {
                self.external[station.nodes[usize::from(*place)] as usize] += along * *w;
            }
            let across = guide - centre[i];
            for (place, w) in &station.centre {
                let node = station.nodes[usize::from(*place)] as usize;
                self.external[node] += across * *w;
                self.added_bound[node] += 2.0 * held * w;
            }
            booked.normal += t * spread + guide;
            booked.friction += t * rubbing;
            let lever = n.section.centre - pose.tip;
            booked.torque += (lever - t * lever.dot(t) - t * n.behind).cross(guide);
            if let Some(line) = self.centre_line {
                let impulse = (t * (spread + rubbing) + guide) * self.dt;
                line.share(&mut self.sums.needle_loads, n.behind, impulse);
                bend_work += guide.dot(guides[i].rate) * self.dt;
            }
        }
        self.sums.book(&booked, pose, self.dt);
        self.sums.tool_work += bend_work;
        self.sums.last_tool_work += bend_work;
        self.contact_energy += stored;
    }
}

impl CpuEngine {
    /// What holds the middle of a station on the axis of the needle where it is open.
    fn guide(&self, opening: &OpeningPlan, plan: &PuncturePlan, pose: &ToolPose, step: u64, now: &Now) -> Guide {
        let t = pose.direction;
        let bend = match &self.centre_line {
            Some(line) => line.at(now.behind, (step - line.first_step) as f64 * self.dt),
            None => Bend::default(),
        };
        // Sections of a bevel lie aside of the tip as far as they are wide.
        let axis = bend.offset + plan.profile.shift * now.radius;
        let aside = now.section.centre - pose.tip;
        let aside = aside - t * aside.dot(t) - axis;
        let per_radius = opening.guide / opening.map.shaft;
        let held = per_radius * now.section.radius;
        let by_radius = 0.5 * per_radius * aside.length_squared();
        Guide {
            force: aside * -held,
            held,
            stored: 0.5 * held * aside.length_squared(),
            by_radius,
            along: by_radius * now.slope * now.cut - held * aside.dot(bend.slope + plan.profile.shift * now.rate),
            rate: bend.rate,
        }
    }
}

/// What holds the middle of a station on the needle.
#[derive(Debug, Clone, Copy)]
struct Guide {
    /// Force on the path, across the needle [N], and its stiffness [N/m].
    force: DVec3,
    held: f64,
    stored: f64,
    /// Derivatives of what is stored by rc at fixed place, and by the distance behind the tip [N].
    by_radius: f64,
    along: f64,
    /// Velocity of the axis of a flexible needle there [m/s].
    rate: DVec3,
}

/// Normal force of every station [N], averaged over its neighbours on the shaft: it is known cell by cell.
fn averaged_normal(opening: &OpeningPlan, now: &[Now], sums: &[StationSums]) -> Vec<f64> {
    let on = |n: &Now| if n.behind >= opening.tip_length { n.cut } else { 0.0 };
    (0..now.len())
        .map(|i| {
            let around = i.saturating_sub(opening.averaged)..=(i + opening.averaged).min(now.len() - 1);
            let weight: f64 = around.clone().map(|j| on(&now[j])).sum();
            let sum: f64 = around.map(|j| on(&now[j]) * sums[j].radius).sum();
            if weight > 0.0 { sum / weight } else { 0.0 }
        })
        .collect()
}

/// What keeps the shape: law and fibres, without the pressure, which is the cell's.
#[derive(Clone, Copy)]
struct Shape<'a> {
    material: &'a Material,
    /// Form of the law that lanes know, without powers and with all that stress and bound share; `None` on the f64 engine.
    regular: Option<Polynomial>,
    /// True where the energy is asked for.
    measures: bool,
}

impl Shape<'_> {
    /// Stress [Pa] and bound of the tangent of F.
    fn stress_and_bound(&self, f: DMat3) -> (DMat3, TangentBound) {
        let h = f - DMat3::IDENTITY;
        if let Some((law, state)) = self.regular.as_ref().zip(Regular::new(h.to_cols_array_2d())) {
            let [straight, turned] = state.tangent_bound(&law.in_lanes(0.0), self.material.law.bulk_modulus);
            let stress = state.stress(&law.in_lanes(0.0), 0.0);
            return (DMat3::from_cols_array_2d(&stress), TangentBound { straight, turned });
        }
        (self.stress(f), self.material.tangent_bound(h, &PointState::default()))
    }

    fn stress(&self, f: DMat3) -> DMat3 {
        let h = f - DMat3::IDENTITY;
        if let Some((law, state)) = self.regular.as_ref().zip(Regular::new(h.to_cols_array_2d())) {
            return DMat3::from_cols_array_2d(&state.stress(&law.in_lanes(0.0), 0.0));
        }
        self.material.stress(h, Volumetric { stress: 0.0, energy: 0.0 }, 1.0, &PointState::default())
    }

    /// Energy of F over that of F_h [J/m^3]; 0 where nobody asks.
    fn energy_over(&self, f: DMat3, gradient: DMat3) -> f64 {
        let energy = |f: DMat3| self.material.energy(f - DMat3::IDENTITY, 0.0, 1.0, &PointState::default()).stored;
        if self.measures { energy(f) - energy(gradient) } else { 0.0 }
    }

    /// What opening adds at a place: derivatives of `W(F) - W(F_h)`, that difference, per volume, and the bound of the tangent there.
    fn opened(&self, map: &Opening, gradient: DMat3) -> (Derivatives, f64, TangentBound) {
        let f = map.gradient(gradient);
        let (stress, bound) = self.stress_and_bound(f);
        let mut d = map.pull_back(stress);
        d.gradient -= self.stress(gradient);
        (d, self.energy_over(f, gradient), bound)
    }
}

/// Forces (with the sign of f_int) and bounds of the points of a station at its nodes.
fn point_forces<'a>(
    shape: &impl Fn(u32) -> Shape<'a>,
    opening: &OpeningPlan,
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
        let (y, gradient) = point.place_and_gradient(&u);
        let map = opening.map.at(section, y, gradient);
        let (d, energy, tangent) = shape(point.cell).opened(&map, gradient);
        sums.energy += point.volume * energy;
        sums.add(&d, point.volume);
        // Rows of the point's own stiffness.
        let (by_gradient, by_place) = map.amplification();
        let grown = by_gradient + by_place * map.eta().length();
        let stiffness = tangent.straight * grown * grown + tangent.turned * squared_norm_bound(cofactor(gradient));
        let sizes = point.gradients.map(|g| g.length());
        let bound = point.volume * stiffness * sizes.iter().sum::<f64>();
        for (c, node) in point.corners.iter().enumerate() {
            let out = &mut local[usize::from(*node)];
            out.0 += (d.gradient * point.gradients[c] + d.place * point.weights[c]) * point.volume;
            out.1 += bound * sizes[c];
        }
    }
    (sums, local)
}

/// Places of Gauss' rule in a cell, -1..1, are at the corners times this.
const GAUSS: f64 = 0.577_350_269_189_625_8;

/// Four of the corners of a cell, no two on one edge, give its volume: to second order as good as all eight, and all four across a path
/// along an edge.
fn is_volume_place(corner: usize) -> bool {
    CORNERS[corner].iter().product::<f64>() < 0.0
}

/// What opening adds to a cell: forces, derivatives of its energy by the path, and that energy. The gradient of y is that of its centre,
/// as elsewhere; the volume is taken at four places, the shape at one.
fn near_cell_forces(
    model: &Model,
    shape_of: Shape,
    opening: &OpeningPlan,
    near: &NearCell,
    section: &Station,
    displacement: &[DVec3],
) -> Option<(CellForces, Derivatives, f64)> {
    if section.radius == 0.0 {
        return None;
    }
    let cell = near.cell as usize;
    let shape = CellShape::new(&model.mesh, cell);
    let u = shape.gather(displacement);
    let nodes = model.mesh.cell_nodes(cell);
    let y: [DVec3; 8] = std::array::from_fn(|i| model.mesh.rest_position(nodes[i]) + u[i]);
    let gradient = DMat3::IDENTITY + shape.displacement_gradient(&u);
    let material = shape_of.material;
    let (mut sum, mut energy) = (Derivatives::ZERO, 0.0);
    let mut grown = 1.0f64;
    // y is linear in the cell, as its gradient is one: a force at a place is one on the middle and one on the gradient.
    let middle = y.iter().copied().sum::<DVec3>() / 8.0;
    let width = model.mesh.block().cell_size(cell);
    let map = |offset: DVec3| opening.map.at(section, middle + gradient * offset, gradient);
    let add = |sum: &mut Derivatives, d: &Derivatives, offset: DVec3, by: f64| {
        sum.add(d, by);
        sum.gradient += outer(d.place * by, offset);
    };
    let at_volume_places: Vec<_> = (0..8)
        .filter(|corner| is_volume_place(*corner))
        .map(|corner| {
            let offset = DVec3::from(CORNERS[corner]) * (0.5 * GAUSS) * width;
            (map(offset), offset)
        })
        .collect();
    let tangent = material.tangent_bound(gradient - DMat3::IDENTITY, &PointState::default());
    let (mut straight, mut turned) = (tangent.straight, tangent.turned);
    let dilation = at_volume_places.iter().map(|(m, _)| m.dilation).sum::<f64>() / 4.0;
    // What keeps the shape, of what points do not carry.
    if near.share > 0.0 {
        let offset = near.place * width;
        let map = map(offset);
        let volume = near.share * shape.volume;
        let (d, w, tangent) = shape_of.opened(&map, gradient);
        energy += volume * w;
        add(&mut sum, &d, offset, volume);
        let (by_gradient, by_place) = map.amplification();
        grown = grown.max(by_gradient + by_place * shape.edge());
        (straight, turned) = (straight.max(tangent.straight), turned.max(tangent.turned));
    }
    // The volume is the cell's.
    let (j, cof) = (gradient.determinant(), cofactor(gradient));
    let bulk = material.law.bulk_modulus;
    let (closed, open) = (j - 1.0, j * dilation - 1.0);
    energy += shape.volume * 0.5 * bulk * (open * open - closed * closed);
    sum.gradient += cof * (bulk * (open * dilation - closed) * shape.volume);
    for (map, offset) in &at_volume_places {
        add(&mut sum, &map.pull_back_dilation(bulk * open * j), *offset, 0.25 * shape.volume);
    }
    // Bound of the stiffness beyond that of the closed cell, where open faces may meet (see Elements::stiffness_bound).
    let b = 0.25 / model.mesh.block().cell_size(cell);
    let b = b.length_squared();
    let cof_b = squared_norm_bound(cof) * b;
    let with = (bulk + turned) * cof_b * dilation.max(1.0).powi(2) + straight * grown * grown * b;
    let without = (bulk + tangent.turned) * cof_b + tangent.straight * b;
    let mut forces = CellForces { bound: [8.0 * shape.volume * (with - without).max(0.0); 8], ..CellForces::default() };
    for (i, b) in shape.gradients().iter().enumerate() {
        forces.force[i] = sum.gradient * *b + sum.place / 8.0;
    }
    Some((forces, sum, energy))
}
