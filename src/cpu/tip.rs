//! Stages `advance_tip` and `soften_path` in f64. Equations: src/effects/puncture.rs.

use std::sync::Arc;

use glam::{DVec2, DVec3};

use super::CpuEngine;
use crate::effects::adhesion::{self, Bond};
use crate::effects::puncture::{self, advance_limit, bounded_stretch, tip_advance};
use crate::engine::elements::CellStates;
use crate::mesh::{BlockMesh, CORNERS, Mesh};
use crate::model::{Model, PuncturePlan};
use crate::needle::ToolPose;
use crate::needle::tip_contact::{Spreading, Touch};

/// Nodes around a material point, their weights, and the derivative of the weights along the path [1/m].
type Around = ([usize; 8], [f64; 8], [f64; 8]);

/// A column of cells, and a place in it, 0..1 per axis.
pub(super) type Column = ([usize; 2], DVec2);

/// The columns of a block in which its anchors stand before a path straight down. A bent grid takes iterations to find them.
pub(super) fn anchor_columns(model: &Model) -> Arc<[Column]> {
    let (Some(plan), Some(block)) = (&model.puncture, model.mesh.as_block()) else { return [].into() };
    plan.anchors.iter().map(|anchor| block.column(anchor.surface.truncate())).collect()
}

/// A material coordinate [m], and the layer of a block that the anchor before was found in there: most lie in the same.
struct Depth {
    a: f64,
    found: Option<(f64, (usize, f64))>,
}

impl Depth {
    fn new(a: f64) -> Self {
        Depth { a, found: None }
    }

    /// The layer at the height z [m], and the place in it, 0..1.
    fn layer(&mut self, block: &BlockMesh, z: f64) -> (usize, f64) {
        match self.found {
            Some((height, layer)) if height == z => layer,
            _ => {
                let layer = block.along(2, z);
                self.found = Some((z, layer));
                layer
            }
        }
    }
}

/// An anchor at the material coordinate of the tip.
struct PlacedAnchor {
    /// Distance of the tip plane beyond it along the insertion, and its positive part inside the material [m].
    distance: f64,
    gap: f64,
    /// d(x.t)/da.
    stretch: f64,
    nodes: [usize; 8],
    weights: [f64; 8],
}

/// What the tip does to its anchors.
struct TipLoads {
    /// Force on all and on each of them [N], and what their springs hold [J].
    force: f64,
    each: Vec<f64>,
    stored: f64,
    /// In the scheme `opening`, where all carry the same; else each has its own spring.
    touch: Touch,
}

impl TipLoads {
    /// With the tip at `a` [m], the stiffness `spring` per anchor [N/m] and what spreads the opened path.
    fn new(plan: &PuncturePlan, spring: f64, anchors: &[PlacedAnchor], a: f64, spreading: &Spreading) -> Self {
        let Some(contact) = &plan.contact else {
            let each: Vec<f64> = anchors.iter().map(|p| spring * p.gap).collect();
            let stored = anchors.iter().map(|p| 0.5 * spring * p.gap * p.gap).sum();
            return TipLoads { force: each.iter().sum(), each, stored, touch: Touch::default() };
        };
        let count = anchors.len() as f64;
        let gap = anchors.iter().map(|p| p.distance).sum::<f64>() / count;
        let stretch = anchors.iter().map(|p| p.stretch).sum::<f64>() / count;
        let touch =
            Touch { stretch, ..contact.touch(if a < plan.exit { gap } else { 0.0 }, contact.part(a), spreading) };
        let each = vec![touch.force / count; anchors.len()];
        TipLoads { force: touch.force, each, stored: contact.stored(touch), touch }
    }
}

impl CpuEngine {
    /// What is around the anchor number `index` at the material coordinate `a` [m].
    fn around_anchor(mesh: &Mesh, plan: &PuncturePlan, (index, columns): (usize, &[Column]), at: &mut Depth) -> Around {
        let a = at.a;
        let direction = plan.path.direction;
        match mesh {
            Mesh::Block(block) => {
                let x = plan.anchors[index].surface + direction * a;
                let is_vertical = direction.truncate() == DVec2::ZERO;
                let column = if is_vertical { columns[index] } else { block.column(x.truncate()) };
                Self::weights(block, column, at.layer(block, x.z), direction)
            }
            Mesh::Tets(_) => {
                let (nodes, weights, slopes) = plan.lines[index].weights(a);
                let none = |values: [f64; 4]| std::array::from_fn(|i| values.get(i).copied().unwrap_or(0.0));
                let nodes = std::array::from_fn(|i| nodes[i.min(3)] as usize);
                (nodes, none(weights), none(slopes))
            }
        }
    }

    /// Trilinear position in a column, in a layer and at a place in it: nodes, weights and derivative of the weights along `direction` (in a bent
    /// grid the direction of its axis).
    fn weights(mesh: &BlockMesh, ([i, j], in_column): Column, (k, zeta): (usize, f64), direction: DVec3) -> Around {
        let xi = in_column.extend(zeta);
        let cell = mesh.cell_index(i, j, k);
        let width = mesh.cell_size(cell);
        let (mut weight, mut slope) = ([0.0; 8], [0.0; 8]);
        for (i, signs) in CORNERS.iter().enumerate() {
            let n: [f64; 3] = std::array::from_fn(|a| 0.5 + signs[a] * (xi[a] - 0.5));
            let d: [f64; 3] = std::array::from_fn(|a| signs[a] * direction[a] / width[a]);
            weight[i] = n[0] * n[1] * n[2];
            slope[i] = d[0] * n[1] * n[2] + n[0] * d[1] * n[2] + n[0] * n[1] * d[2];
        }
        (mesh.cell_nodes(cell), weight, slope)
    }

    /// Stage `advance_tip`: each anchor k carries a spring between the tip plane and the material point at `a`.
    ///
    /// `g_k = max(0, (p_tip - x_k).t)`, `F = k_tip/N sum g_k`, threshold `F_c(a)` falls from F_pun to F_cut over l_p;
    /// where F > F_c: `a += min((F - F_c) / (k_tip lambda), cap)`, `lambda = <dx_k/da . t>` clamped to 0.2..3. No spring from
    /// `a = a_exit` on. The needle, of the direction t, may be turned against its path T: what lies at `a` is `a T.t` along it.
    pub(super) fn advance_tip(&mut self, plan: &PuncturePlan, pose: &ToolPose) {
        let model = self.model.clone();
        let mesh = &model.mesh;
        let columns = self.anchor_columns.clone();
        let t = pose.direction;
        let count = plan.anchors.len() as f64;
        let spring = plan.params.tip_stiffness / count;
        let tip_axial = (pose.tip - plan.path.entry).dot(t);
        let along_needle = if plan.path.direction == t { 1.0 } else { plan.path.direction.dot(t) };
        let place = |u: &[DVec3], a: f64| -> Vec<PlacedAnchor> {
            let mut at = Depth::new(a);
            (0..plan.anchors.len())
                .map(|index| {
                    let (nodes, weights, slope) = Self::around_anchor(mesh, plan, (index, &columns), &mut at);
                    let (mut du, mut stretch) = (0.0, along_needle);
                    for i in 0..8 {
                        let along = u[nodes[i]].dot(t);
                        du += weights[i] * along;
                        stretch += slope[i] * along;
                    }
                    let distance = tip_axial - a * along_needle - du;
                    let gap = if a < plan.exit { distance.max(0.0) } else { 0.0 };
                    PlacedAnchor { distance, gap, stretch, nodes, weights }
                })
                .collect()
        };
        let mean_distance = |anchors: &[PlacedAnchor]| anchors.iter().map(|p| p.distance).sum::<f64>() / count;
        let a = self.state.tip_coordinate;
        let spreading = plan.contact.as_ref().map_or_else(Spreading::default, |contact| self.state.spreading(contact));
        let loads = |anchors: &[PlacedAnchor], a: f64| TipLoads::new(plan, spring, anchors, a, &spreading);
        let mut anchors = place(&self.state.displacement, a);
        let bond_force = match model.effects.adhesion {
            Some(adhesion) => self.advance_bond(&adhesion, mean_distance(&anchors), a > 0.0 && a < plan.exit),
            None => 0.0,
        };
        let mut now = loads(&anchors, a);
        let stretch = now.touch.stretch;
        let p = &plan.params;
        let speed = pose.velocity.length();
        // The tissue that the tip opens as it advances is strained at once.
        let resistance = self.state.opening_resistance;
        let closing = plan.contact.as_ref().map_or(0.0, |c| c.closing(a) * now.touch.dimple * spreading.force);
        let threshold = plan.threshold(a) * p.rate_factor(speed) + resistance + closing;
        self.advanced = [0.0; 2];
        if now.force > threshold {
            let lambda = bounded_stretch(anchors.iter().map(|p| p.stretch).sum::<f64>() / count);
            let (advance, cap) = match (&plan.opening, &plan.contact) {
                (Some(opening), Some(contact)) => {
                    let cap = opening.advance_limit(plan.segment(a).shear_wave_speed, speed * self.dt, self.dt);
                    let excess = contact.excess(now.force, threshold, contact.part(a), &spreading);
                    let shortened = (lambda - contact.closing(a) * now.touch.dimple).max(puncture::LEAST_STRETCH);
                    ((excess / shortened).max(0.0).min(cap), cap)
                }
                _ => {
                    let cap = advance_limit(a == 0.0, speed * self.dt);
                    let stretched = anchors.iter().filter(|p| p.gap > 0.0).count() as f64 / count;
                    (tip_advance(now.force, threshold, p.tip_stiffness * stretched, lambda, cap), cap)
                }
            };
            self.state.tip_coordinate = a + advance;
            let before = anchors;
            anchors = place(&self.state.displacement, a + advance);
            now = loads(&anchors, a + advance);
            let lost = match &plan.contact {
                Some(contact) => {
                    let (old, new) = (self.state.touch, now.touch);
                    let way = mean_distance(&before) - self.state.bond.gap;
                    let shift = contact.part(a + advance) * new.dimple - contact.part(a) * old.dimple;
                    self.advanced = [advance, shift];
                    // What the stretch became over the step, at the place where the tip was.
                    let stretched = advance * (stretch - old.stretch);
                    contact.dissipated((old, new), (way, stretched), shift, spreading.force)
                }
                // Force after the advance times the loss of stretch: with the force of the next step this closes the
                // trapezoidal rule of the leapfrog work; the loss of spring energy would count half a step twice.
                None => before.iter().zip(&anchors).map(|(b, p)| spring * p.gap * (b.gap - p.gap)).sum(),
            };
            let beyond = if advance == cap { puncture::share_beyond(now.force, threshold) } else { 0.0 };
            self.sums.energy.tip += lost * (1.0 - beyond) - resistance * advance;
            self.sums.energy.advance_cap += lost * beyond;
        }
        self.state.touch = now.touch;
        self.state.bond.gap = mean_distance(&anchors);
        let bond_energy = model.effects.adhesion.map_or(0.0, |p| 0.5 * p.stiffness * self.state.bond.stretch.powi(2));
        self.tip_energy = now.stored + bond_energy;
        // Contact books the whole force of the anchors as cutting; what is not comes off here.
        let membrane = match plan.segment(self.state.tip_coordinate).membrane {
            true => now.force * self.dt,
            false => 0.0,
        };
        self.sums.membrane_impulse += membrane;
        self.sums.adhesion_impulse += bond_force * self.dt;
        self.sums.cutting_impulse -= membrane + bond_force * self.dt;
        let each = now.each.into_iter().map(|f| f + bond_force / count);
        self.tip_forces = anchors.into_iter().zip(each).map(|(p, f)| (f, p.nodes, p.weights)).collect();
    }

    /// Moves the bond between tip and tissue by what the tip has moved against its anchors, `distance` on average; returns
    /// its force [N]. A tip outside the material, or drawn back by more than D, has no bond.
    fn advance_bond(&mut self, p: &adhesion::Params, distance: f64, inside: bool) -> f64 {
        let old = self.state.bond;
        let motion = distance - old.gap;
        let (stretch, slid) = match inside && distance > -p.sliding_distance {
            true => p.advance(old.stretch, old.slid, motion),
            false => (0.0, 0.0),
        };
        self.state.bond = Bond { stretch, slid, gap: old.gap };
        // Mean force of both steps times the slip; nothing slips where there was and is no bond.
        let slip = old.stretch + motion - stretch;
        self.sums.energy.adhesion += 0.5 * p.stiffness * (old.stretch + stretch) * slip;
        p.stiffness * stretch
    }

    /// Stage `soften_path`: factor `1 - ramp(a) (1 - left)`; the energy that a cell loses is dissipated.
    pub(super) fn soften_path(&mut self, plan: &PuncturePlan) {
        let tears = self.core_tears(plan);
        let a = self.state.tip_coordinate;
        for path_cell in &plan.cells {
            let cell = path_cell.cell as usize;
            let length = path_cell.axial_end - path_cell.axial_start;
            let ramp = ((a - path_cell.axial_start) / length.max(1e-9)).clamp(0.0, 1.0);
            let factor = match plan.needle.bore {
                // The core tears off where the tip has cut to.
                Some(_) => {
                    let here = (path_cell.axial_start..path_cell.axial_end).contains(&a);
                    if here && tears { 0.0 } else { 1.0 }
                }
                None => 1.0 - ramp * (1.0 - path_cell.left),
            };
            self.soften_cell(cell, factor);
        }
    }

    /// Whether the tip of a hollow needle has gone back from where it has cut to so far that the core tears off there.
    pub(super) fn core_tears(&self, plan: &PuncturePlan) -> bool {
        let bore = plan.needle.bore.map_or(f64::INFINITY, |bore| bore.radius);
        self.state.tip_coordinate > 0.0 && self.state.bond.gap < -puncture::CORE_TEARS * bore
    }

    /// Leaves a cell the part `factor` of its stiffness, if that is less than it has, and books the energy that it loses.
    pub(super) fn soften_cell(&mut self, cell: usize, factor: f64) {
        let old = self.state.stiffness[cell];
        if factor >= old {
            return;
        }
        // Half a step back: the mean of the energies before and after the step, as the leapfrog work has it.
        let half = 0.5 * self.dt;
        let place = |node: usize| self.state.displacement[node] - self.state.velocity[node] * half;
        let mut u = [DVec3::ZERO; 8];
        for (u, n) in u.iter_mut().zip(self.model.mesh.cell_nodes(cell).iter()) {
            *u = place(*n);
        }
        let intact = CellStates { points: &self.state.points, stiffness: &[] };
        let averaged = self.elements.averaged_energy_of(&self.model, cell, place);
        let m = self.elements.measure_corners(&self.model, cell, &u, averaged, intact);
        // What Prony terms hold is booked with their work, which the softening does not touch.
        self.sums.energy.softening += (old - factor) * (m.elastic - m.held + m.hourglass);
        self.state.stiffness[cell] = factor;
    }
}
