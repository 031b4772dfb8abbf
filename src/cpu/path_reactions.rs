//! What the sections of an opened path do to their tissue, to the needle and to its tip: normal forces, the guide that holds them on the needle,
//! friction. Equations: src/needle/opening.rs, `OpeningPlan::left_beside`.

use glam::DVec3;

use super::opening::{Now, StationSums, neighbours};
use super::{ContactSums, CpuEngine};
use crate::model::Model;
use crate::model::opening::{OpeningPlan, OpeningStation};
use crate::needle::ToolPose;

impl CpuEngine {
    /// Forces of the stations on their nodes, on the needle and on the tip; friction.
    pub(super) fn station_reactions(
        &mut self,
        opening: &OpeningPlan,
        pose: &ToolPose,
        now: &[Now],
        sums: &[StationSums],
    ) {
        let t = pose.direction;
        let model = self.model.clone();
        let count = now.len();
        // By rc with all that follows from it, and by the centre.
        let mut radius: Vec<f64> = sums.iter().map(|s| s.radius).collect();
        let mut rates = vec![DVec3::ZERO; count];
        for (i, s) in sums.iter().enumerate() {
            let (before, behind, by) = neighbours(i, count, opening.spacing);
            radius[behind] += s.radius_rate * by;
            radius[before] -= s.radius_rate * by;
            let rate = s.centre_rate - t * s.centre_rate.dot(t);
            rates[behind] += rate * by;
            rates[before] -= rate * by;
        }
        let guides: Vec<Guide> = now
            .iter()
            .zip(&opening.stations)
            .zip(&radius)
            .map(|((n, station), by_radius)| guide(opening, (station.guide, n), *by_radius))
            .collect();
        // Along the needle: by how rc and the axis change behind the tip.
        let spreads: Vec<f64> = guides.iter().map(|g| g.along).collect();
        let old = [self.state.opening_resistance, self.state.opening_spreading];
        self.state.opening_resistance =
            now.iter().zip(&guides).map(|(n, g)| g.by_radius * n.full * n.left * n.cut_rate).sum();
        self.state.opening_spreading = spreads.iter().sum();
        self.state.opening_stiffness = opening.shift_stiffness(&spreads);
        // The tip was told what the path took before it advanced: half of what that changed by comes off.
        let [advance, shift] = self.advanced;
        self.sums.energy.tip += 0.5 * (self.state.opening_spreading - old[1]) * shift
            - 0.5 * (self.state.opening_resistance - old[0]) * advance;
        let normal = averaged_normal(opening, now, sums);
        let mut stored = 0.0;
        let (mut booked, mut bend_work) = (ContactSums::default(), 0.0);
        let friction = model.effects.friction.unwrap_or_default();
        let rubs = model.effects.friction.is_some();
        for (i, station) in opening.stations.iter().enumerate() {
            let n = &now[i];
            let kt = friction.stiffness_ratio * station.stick;
            let Guide { force: guide, held, .. } = guides[i];
            stored += guides[i].stored;
            let spread = spreads[i];
            let mut rubbing = 0.0;
            let memory = &mut self.state.stations[i];
            let on_shaft =
                crate::effects::friction::part_on_shaft(n.behind, opening.tip_length, friction.fade_length) * n.cut;
            let squeeze = normal[i].max(0.0) * on_shaft;
            self.sums.shaft_normal_impulse += squeeze * self.dt;
            let limit = friction.coefficient * squeeze;
            if rubs && (limit > 0.0 || *memory != 0.0) {
                let motion = (n.velocity - pose.velocity_behind()).dot(t) * self.dt;
                let (old, trial) = (*memory, *memory + motion);
                *memory = if limit > 0.0 { trial.clamp(-limit / kt, limit / kt) } else { 0.0 };
                rubbing = -kt * *memory;
                booked.friction_work += 0.5 * kt * (old + *memory) * (trial - *memory);
                stored += 0.5 * kt * *memory * *memory;
            }
            let along = t * (spread + rubbing);
            for (place, w) in station.disc.iter().filter(|_| along != DVec3::ZERO) {
                self.added.add(station.nodes[usize::from(*place)] as usize, along * *w, 0.0);
            }
            let across = guide - sums[i].centre - rates[i];
            for (place, w) in station.centre.iter().filter(|_| across != DVec3::ZERO || held > 0.0) {
                let node = station.nodes[usize::from(*place)] as usize;
                self.added.add(node, across * *w, 2.0 * held * w);
            }
            booked.normal += t * spread + guide;
            booked.friction += t * rubbing;
            // As the moment of all forces on the tissue.
            let lever = n.section.centre - pose.tip;
            booked.torque += match model.laid {
                Some(_) => {
                    let along_at = n.disc - pose.tip;
                    lever.cross(guide - rates[i]) + along_at.cross(along) - sums[i].moment
                }
                None => (lever - t * lever.dot(t) - t * n.behind).cross(guide),
            };
            if let Some(line) = self.centre_line {
                let impulse = (t * (spread + rubbing) + guide) * self.dt;
                line.share(&mut self.sums.needle_loads, n.behind, impulse);
                bend_work += guide.dot(n.axis.rate) * self.dt;
            }
        }
        self.sums.book(&booked, pose, self.dt);
        self.sums.tool_work += bend_work;
        self.sums.last_tool_work += bend_work;
        self.contact_energy += stored;
    }
}

/// Bounds of the stiffness of the stick springs of all stations at their nodes [N/m]. Everywhere along the path, and in every step: a mass that
/// was raised where friction sets in would swing with another energy.
pub(super) fn stick_bounds(model: &Model) -> Vec<(usize, f64)> {
    let (Some(opening), Some(friction)) = (model.opening(), &model.effects.friction) else { return Vec::new() };
    let of_station = |station: &OpeningStation| -> Vec<(usize, f64)> {
        let bound = 2.0 * friction.stiffness_ratio * station.stick;
        station.disc.iter().map(|(place, w)| (station.nodes[usize::from(*place)] as usize, bound * w)).collect()
    };
    opening.stations.iter().flat_map(of_station).collect()
}

/// What holds the middle of a station on the axis of the needle where it is open, by its spring of that stiffness [N/m]; `opened`: derivative of the energy of opening by rc [N].
pub(super) fn guide(opening: &OpeningPlan, (stiffness, now): (f64, &Now), opened: f64) -> Guide {
    let per_radius = stiffness / opening.shaft;
    let square = now.aside.length_squared();
    let by_radius = opened + 0.5 * per_radius * square;
    let (rc, whole) = (now.section.radius, now.full * now.cut);
    let stiffness = per_radius * rc + 2.0 * by_radius * whole * now.leaving;
    Guide {
        force: now.aside * -stiffness,
        held: whole * (per_radius + opening.leaving_curvature() * opened.abs()),
        stored: 0.5 * per_radius * rc * square,
        by_radius,
        along: by_radius * now.slope * now.cut * now.left - stiffness * now.aside.dot(now.axis.slope),
    }
}

/// What holds the middle of a station on the needle.
#[derive(Debug, Clone, Copy)]
pub(super) struct Guide {
    /// Force on the path, across the needle [N], and bound of its stiffness [N/m].
    pub(super) force: DVec3,
    pub(super) held: f64,
    pub(super) stored: f64,
    /// Derivatives of all that opening stores by rc at fixed place, and by the distance behind the tip [N].
    pub(super) by_radius: f64,
    pub(super) along: f64,
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

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use super::*;
    use crate::needle::opening::Station;

    /// A section that hangs beside the needle closes, and what holds it is the derivative of all that it stores, whichever way it goes: as far
    /// as it lies on the needle it is pulled back, further off it is pushed away and let go.
    #[test]
    fn a_section_beside_the_needle_is_held_by_the_derivative_of_its_energy() {
        let (shaft, opened) = (0.8e-3, 0.05);
        let plan = OpeningPlan {
            shaft,
            least: 0.0,
            tip_length: 2.5e-3,
            spacing: 0.18e-3,
            stations: Vec::new(),
            clusters: Vec::new(),
            cells: Vec::new(),
            longest_span: 0,
            nodes: BTreeSet::new(),
            averaged: 0,
            nodes_follow: 0.0,
        };
        let at = |aside: f64| {
            let aside = DVec3::new(0.6, -0.8, 0.0) * aside;
            let (left, leaving) = plan.left_beside(aside.length_squared());
            let section = Station { radius: 0.7e-3 * left, ..Station::default() };
            guide(
                &plan,
                (240.0, &Now { section, full: 0.7e-3, cut: 1.0, aside, left, leaving, ..Now::default() }),
                opened,
            )
        };
        let stored = |aside: f64| at(aside).stored + opened * 0.7e-3 * plan.left_beside(aside * aside).0;
        let along = |aside: f64| -at(aside).force.dot(DVec3::new(0.6, -0.8, 0.0));
        for aside in [0.1, 0.5, 1.0, 1.7, 2.5, 3.0, 4.0].map(|part| part * shaft) {
            let step = 1e-8;
            let difference = (stored(aside + step) - stored(aside - step)) / (2.0 * step);
            assert!((along(aside) - difference).abs() < 1e-6, "{aside}: {} {difference}", along(aside));
        }
        assert!(along(0.5 * shaft) > 0.0 && along(3.0 * shaft) < 0.0);
        assert!(stored(12.0 * shaft) < 0.15 * stored(1.7 * shaft), "{} {}", stored(12.0 * shaft), stored(1.7 * shaft));
        // It is nowhere stiffer than the bound by which masses are raised (where it gives way nothing swings).
        let steepest = (1..600).map(|i| {
            let (aside, step) = (f64::from(i) * 0.01 * shaft, 1e-7);
            (along(aside + step) - along(aside - step)) / (2.0 * step) / at(aside).held
        });
        assert!(steepest.fold(0.0, f64::max) < 1.0);
    }
}
