//! Stages `advance_free_tip` and `soften_free_path` in f64. Equations: src/needle/free_path.rs.

use glam::{DMat3, DVec3};

use super::CpuEngine;
use crate::effects::puncture::{
    advance_limit, bounded_stretch, retreat, share_beyond, slip_limit, sway_beyond, tip_advance,
};
use crate::mesh::BlockMesh;
use crate::mesh::material_place::{grid_place, material_place, pulled_back, within_block};
use crate::model::{ANCHOR_COUNT, FreePlan, PuncturePlan};
use crate::needle::free_path::{
    AS_BEFORE, FreeTip, LOOK_AHEAD, MARKED_BEHIND, SAMPLES, SOFTENING_RATE, TURNING, anchor_offset,
};
use crate::needle::{ToolPose, lateral_axes};

/// The springs of the tip at one place.
struct TipSprings {
    /// Raw gap of every anchor [m], with nodes and weights.
    anchors: Vec<(f64, [usize; 8], [f64; 8])>,
    /// Mean raw gap and sway l [m].
    mean_gap: f64,
    sway: DVec3,
    /// Mean F.
    gradient: DMat3,
}

/// Cells of the box whose middle is no farther from `x` than `reach` and half their diagonal; some more, found axis by axis.
fn cells_near(mesh: &BlockMesh, free: &FreePlan, x: DVec3, reach: f64) -> Vec<[usize; 3]> {
    let edge = |a: usize, i: usize| mesh.lines[a][i + 1] - mesh.lines[a][i];
    let range = |a: usize| free.skin.low[a]..free.skin.low[a] + free.skin.count[a];
    let longest = [0, 1].map(|a| range(a).map(|i| edge(a, i)).fold(0.0, f64::max));
    let near = |a: usize, i: usize, size: DVec3| {
        (0.5 * (mesh.lines[a][i] + mesh.lines[a][i + 1]) - x[a]).abs() <= reach + 0.5 * size.length()
    };
    let mut cells = Vec::new();
    for k in range(2).filter(|k| near(2, *k, DVec3::new(longest[0], longest[1], edge(2, *k)))) {
        for j in range(1).filter(|j| near(1, *j, DVec3::new(longest[0], edge(1, *j), edge(2, k)))) {
            let size = |i: usize| DVec3::new(edge(0, i), edge(1, j), edge(2, k));
            cells.extend(range(0).filter(|i| near(0, *i, size(*i))).map(|i| [i, j, k]));
        }
    }
    cells
}

fn tip_springs(
    (mesh, free): (&BlockMesh, &FreePlan),
    u: &[DVec3],
    radius: f64,
    tip: &FreeTip,
    pose: &ToolPose,
) -> TipSprings {
    let other = tip.along.cross(tip.across);
    let t = pose.direction;
    let mut springs = TipSprings { anchors: Vec::new(), mean_gap: 0.0, sway: DVec3::ZERO, gradient: DMat3::ZERO };
    let part = 1.0 / ANCHOR_COUNT as f64;
    for anchor in 0..ANCHOR_COUNT {
        let (a, b) = anchor_offset(anchor, radius);
        let x = free.skin.nearest(mesh, tip.place + tip.across * a + other * b);
        let at = material_place(mesh, u, x);
        let offset = x - tip.place;
        let gap = (pose.tip - at.position).dot(t) + offset.dot(tip.along);
        springs.anchors.push((gap, at.nodes, at.weights));
        springs.mean_gap += part * gap;
        springs.sway += (pose.tip - at.position + offset) * part;
        springs.gradient += at.gradient * part;
    }
    springs.sway -= t * springs.sway.dot(t);
    springs
}

/// Outside: one step of Newton's iteration for the point of the tissue that the tip is at, for the needle moves little from step to
/// step; through the skin, or the top face, a track begins.
fn look_for_surface((mesh, free): (&BlockMesh, &FreePlan), u: &[DVec3], tip: &mut FreeTip, pose: &ToolPose) {
    let near = free.skin.nearest(mesh, tip.place);
    let at = material_place(mesh, u, near);
    let away = pose.tip - at.position - (tip.place - near);
    tip.place += pulled_back(at.gradient, away);
    let Some(skin) = free.skin.skin_at(mesh, tip.place) else { return };
    let over = within_block(mesh, tip.place.with_z(skin)) == tip.place.with_z(skin);
    // Nearer than a tenth of a millimetre: far from the solution a step may end anywhere.
    if over && tip.place.z <= skin + 1e-9 && away.length() < 1e-4 {
        // Where the tip is, not at the height: it may be a part of a step behind the skin, or some hundredths of a millimetre behind the
        // lattice of heights, and springs that were tight at once would be work of nobody.
        *tip = FreeTip {
            place: tip.place.with_z(tip.place.z.min(skin)),
            along: pose.direction,
            across: lateral_axes(pose.direction).0,
            inside: true,
            ..FreeTip::default()
        };
    }
}

impl CpuEngine {
    /// Stage `advance_free_tip`.
    pub(super) fn advance_free_tip(&mut self, plan: &PuncturePlan, free: &FreePlan, pose: &ToolPose) {
        let model = self.model.clone();
        let mesh = model.mesh.block();
        let u = &self.state.displacement;
        let p = &plan.params;
        let radius = plan.needle.radius;
        let spring = p.tip_stiffness / ANCHOR_COUNT as f64;
        let mut tip = FreeTip { advance: 0.0, ..self.state.tip };
        if !tip.inside {
            look_for_surface((mesh, free), u, &mut tip, pose);
        }
        let before = tip_springs((mesh, free), u, radius, &tip, pose);
        let capped = if tip.inside { self.move_tip(plan, free, pose, &mut tip, &before) } else { None };
        let after = match capped {
            Some(_) if tip.inside => tip_springs((mesh, free), u, radius, &tip, pose),
            _ => TipSprings { anchors: before.anchors.clone(), ..before },
        };
        let on = if tip.inside { 1.0 } else { 0.0 };
        let sway = after.sway * on;
        if let Some(threshold) = capped {
            let pairs = before.anchors.iter().zip(&after.anchors);
            let lost: f64 = pairs.map(|(b, a)| on * spring * a.0.max(0.0) * (b.0.max(0.0) - a.0.max(0.0))).sum();
            let force = after.anchors.iter().map(|a| on * spring * a.0.max(0.0)).sum();
            let beyond = lost * share_beyond(force, threshold);
            self.sums.energy.advance_cap += beyond;
            self.sums.energy.tip += lost - beyond + p.tip_stiffness * sway.dot(before.sway - sway);
        }
        self.tip_sway = sway * spring;
        self.tip_energy = 0.5 * p.tip_stiffness * sway.length_squared()
            + after.anchors.iter().map(|a| on * 0.5 * spring * a.0.max(0.0).powi(2)).sum::<f64>();
        self.tip_forces = after.anchors.into_iter().map(|a| (on * spring * a.0.max(0.0), a.1, a.2)).collect();
        self.state.tip_coordinate = tip.coordinate;
        self.state.tip = tip;
    }

    /// Moves the tip through the material: advance, slip, retreat. `None`: it stays; else the threshold [N] that the cap on the
    /// advance holds the force above, infinite where it does not.
    fn move_tip(
        &self,
        plan: &PuncturePlan,
        free: &FreePlan,
        pose: &ToolPose,
        tip: &mut FreeTip,
        springs: &TipSprings,
    ) -> Option<f64> {
        let (mesh, p) = (self.model.mesh.block(), &plan.params);
        let (t, f, direction) = (pose.direction, springs.gradient, tip.along);
        let spring = p.tip_stiffness / ANCHOR_COUNT as f64;
        let force: f64 = springs.anchors.iter().map(|a| spring * a.0.max(0.0)).sum();
        let stretch = bounded_stretch((f * direction).dot(t));
        let (material, open) = self.material_ahead(free, tip);
        if material != tip.material {
            (tip.material, tip.entry) = (material, tip.coordinate);
        }
        let threshold = match open {
            true => 0.0,
            false => {
                free.cuttings[material].threshold(tip.coordinate - tip.entry, p.transition_length)
                    * p.rate_factor(pose.velocity.length())
            }
        };
        let travel = (pose.velocity.length() + plan.needle.radius * pose.angular_velocity.length()) * self.dt;
        let cap = advance_limit(tip.coordinate == 0.0, travel);
        let slip_cap = slip_limit(travel);
        let stretched = springs.anchors.iter().filter(|a| a.0 > 0.0).count() as f64 / ANCHOR_COUNT as f64;
        let advance = tip_advance(force, threshold, p.tip_stiffness * stretched, stretch, cap);
        let retreat = retreat(springs.mean_gap, stretch, slip_cap);
        let mut slip = pulled_back(f, sway_beyond(springs.sway, force, threshold, p.tip_stiffness));
        if slip.length() > slip_cap {
            slip *= slip_cap / slip.length();
        }
        if tip.coordinate == 0.0 {
            // Not through the surface yet: the tip glides on it.
            slip.z = 0.0;
        }
        if !(advance > 0.0 || retreat > 0.0 || slip != DVec3::ZERO) {
            return None;
        }
        let before = free.skin.skin_at(mesh, tip.place);
        tip.place += direction * (advance - retreat) + slip;
        let skin = free.skin.skin_at(mesh, tip.place);
        // What glides on the skin goes up and down with it.
        if let (Some(from), Some(to), true) = (before, skin, tip.coordinate == 0.0 && advance == retreat) {
            tip.place.z += to - from;
        }
        tip.coordinate = (tip.coordinate + advance - retreat).max(0.0);
        let wanted = pulled_back(f, t);
        if wanted.length() > 1e-3 {
            let part = ((advance + retreat + slip.length()) / TURNING).min(1.0);
            tip.along = direction.lerp(wanted.normalize(), part).normalize();
        }
        tip.across = tip.across.reject_from(tip.along).normalize();
        if retreat == 0.0 && tip.coordinate > 0.0 {
            tip.advance = advance + slip.length();
        }
        // Beside the tissue the needle comes back through it.
        if retreat > 0.0 && skin.is_some_and(|skin| tip.place.z > skin) {
            *tip = FreeTip { inside: false, advance: 0.0, coordinate: 0.0, entry: 0.0, ..*tip };
        }
        tip.place = if tip.inside { free.skin.nearest(mesh, tip.place) } else { tip.place };
        Some(if advance == cap { threshold } else { f64::INFINITY })
    }

    /// The material just ahead of the tip, farther than a sample that the tip's plane has marked, and whether it is cut already.
    fn material_ahead(&self, free: &FreePlan, tip: &FreeTip) -> (usize, bool) {
        let mesh = self.model.mesh.block();
        let (cell, _, width) = grid_place(mesh, within_block(mesh, tip.place));
        let samples = SAMPLES as f64;
        let look = LOOK_AHEAD * 0.5 * tip.along.abs().dot(width / samples);
        let (cell, local, _) = match free.index(cell) {
            Some(_) => grid_place(mesh, within_block(mesh, tip.place + tip.along * look)),
            None => (cell, DVec3::ZERO, width),
        };
        let sample: [usize; 3] = std::array::from_fn(|a| ((local[a] * samples) as usize).min(SAMPLES - 1));
        let bit = sample[0] + SAMPLES * (sample[1] + SAMPLES * sample[2]);
        let open = free.index(cell).is_some_and(|i| self.state.cut_samples[i] >> bit & 1 == 1);
        let tissue = match free.index(cell).map(|index| free.tissues[index]) {
            Some(AS_BEFORE) => tip.material,
            Some(tissue) => usize::from(tissue),
            None => self.model.region_index(mesh.cell_index(cell[0], cell[1], cell[2])),
        };
        (tissue, open)
    }

    /// Stage `soften_free_path`: factor `residual^(marked/64)`; the energy that a cell loses is dissipated.
    pub(super) fn soften_free_path(&mut self, plan: &PuncturePlan, free: &FreePlan) {
        let tip = self.state.tip;
        if tip.advance == 0.0 {
            return;
        }
        let model = self.model.clone();
        let mesh = model.mesh.block();
        let a0 = plan.params.softened_radius;
        for at in cells_near(mesh, free, tip.place, a0.hypot(MARKED_BEHIND * a0)) {
            let Some(index) = free.index(at) else { continue };
            let cell = mesh.cell_index(at[0], at[1], at[2]);
            let size = mesh.cell_size(cell);
            let low = DVec3::new(mesh.lines[0][at[0]], mesh.lines[1][at[1]], mesh.lines[2][at[2]]);
            let reach = 0.5 * size.length();
            if (low + 0.5 * size - tip.place).length() > a0.hypot(MARKED_BEHIND * a0) + reach {
                continue;
            }
            let mut marked = self.state.cut_samples[index];
            for bit in 0..SAMPLES.pow(3) {
                let part = |i: usize| (i as f64 + 0.5) / SAMPLES as f64;
                let at = DVec3::new(part(bit % SAMPLES), part(bit / SAMPLES % SAMPLES), part(bit / SAMPLES.pow(2)));
                let relative = low + at * size - tip.place;
                let ahead = relative.dot(tip.along);
                let square = relative.length_squared() - ahead * ahead;
                if ahead <= 0.0 && ahead > -MARKED_BEHIND * a0 && square < a0 * a0 {
                    marked |= 1 << bit;
                }
            }
            self.state.cut_samples[index] = marked;
            let fraction = f64::from(marked.count_ones()) / SAMPLES.pow(3) as f64;
            let slowly = self.state.stiffness[cell] - SOFTENING_RATE * tip.advance / size.min_element();
            self.soften_cell(cell, plan.params.stiffness_left(fraction).max(slowly));
        }
    }
}
