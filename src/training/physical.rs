//! What the tissue felt: forces, punctures, energies, targets and core of an attempt, and whether its numbers can be trusted.
//!
//! No coded public definition of these was found (the figures of comparable tools are kinematic); they are those of this
//! project, all from what the solver reports per frame:
//! ```text
//! peak, mean axial force    largest F; time mean over the frames with the tip below the surface              [N]
//! force rate                largest (F_j - F_i)/(t_j - t_i) over the first j with t_j - t_i >= RATE_WINDOW: rises only,
//!                           a fall is the tissue giving way and not the hand                                 [N/s]
//! impulse                   int |F| dt, so that pull does not cancel push                                    [N s]
//! injury                    cutting + cohesive + plastic + damage                                            [J]
//! dissipated                injury + friction + adhesion + viscous + damping; what contact damping takes cannot be told
//!                           from what contact stores and is left out                                         [J]
//! overshoot                 travel of the needle after a layer gave way until it is slower than STANDSTILL   [m]
//! ```
//! A layer gives way in the frame in which the tip law's own material coordinate a has got beyond the layer's top by the
//! transition length l_p, over which the law's threshold falls from puncture to cutting force, or has left the layer.
//! The tip lies in the layer at the depth a below the surface along the needle, on the way out at the depth of the tip itself; the
//! growth of an energy within a frame belongs to the layer at the frame's end.

use glam::DVec3;
use serde::{Deserialize, Serialize};

use super::kinematic::Sample;
use super::texts;
use crate::observables::{CoreSample, EnergyAccount, FrameRecord};
use crate::output::{Summary, TargetFigures};
use crate::scene::Scene;
use crate::verdict::{Doubt, Quantity};

/// Time over which a force rate is taken [s]: several frames, shorter than a reaction of the hand.
pub const RATE_WINDOW: f64 = 0.1;

/// Speed below which the needle counts as standing [m/s].
pub const STANDSTILL: f64 = 0.2e-3;

/// Largest kinetic over internal energy, a median over the way in: beyond it mass scaling shows in the force.
pub const LARGEST_KINETIC: f64 = 0.05;

/// Largest hourglass over internal energy, a median over the way in: the usual bound for reduced integration.
pub const LARGEST_HOURGLASS: f64 = 0.10;

/// Most clamped node steps. Layers that are squeezed to nothing clamp some hundreds (scenes/layers.toml, on its skin).
pub const MOST_CLAMPED: u64 = 100;

/// Step along the needle in which its way through the layers is followed [m]; a layer is not thinner.
const LAYER_STEP: f64 = 2e-5;

/// Whether the numbers of a run mean something.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct Trust {
    /// Largest energy imbalance, see [`crate::verdict`]; `None` where it is NaN.
    pub energy_imbalance: Option<f64>,
    /// Medians over the way in.
    pub kinetic_to_internal: Option<f64>,
    pub hourglass_to_internal: Option<f64>,
    /// Node steps whose speed was clamped.
    pub clamped_nodes: u64,
    /// Why the run is not scored, one sentence each; empty where it is.
    pub reasons: Vec<String>,
}

impl Trust {
    /// Judges the records of a run by the definitions of its summary.
    pub fn of(records: &[FrameRecord]) -> Trust {
        let mut summary = Summary::default();
        summary.take_frames(records);
        let number = |value: f64| value.is_finite().then_some(value);
        let mut trust = Trust {
            energy_imbalance: number(summary.energy_imbalance),
            kinetic_to_internal: number(summary.kinetic_to_internal),
            hourglass_to_internal: number(summary.hourglass_to_internal),
            clamped_nodes: summary.clamped_nodes,
            reasons: Vec::new(),
        };
        if records.is_empty() {
            trust.reasons.push(texts::NO_FRAMES.into());
            return trust;
        }
        if records.iter().any(|r| r.health.not_finite || !r.force.axial.is_finite()) {
            trust.reasons.push(texts::NOT_A_NUMBER.into());
        }
        let doubts = records.last().into_iter().flat_map(|r| &r.verdict.doubts);
        trust.reasons.extend(doubts.filter(|doubt| !is_a_touch(records, doubt)).map(Doubt::sentence));
        for (value, bound, name) in [
            (trust.kinetic_to_internal, LARGEST_KINETIC, texts::KINETIC_TO_INTERNAL),
            (trust.hourglass_to_internal, LARGEST_HOURGLASS, texts::HOURGLASS_TO_INTERNAL),
        ] {
            if value.is_none_or(|value| value > bound) {
                trust.reasons.push(texts::outside_gate(name, value, bound));
            }
        }
        if trust.clamped_nodes > MOST_CLAMPED {
            trust.reasons.push(texts::too_many_clamped(trust.clamped_nodes, MOST_CLAMPED));
        }
        trust
    }

    /// True where the run can be scored.
    pub fn is_good(&self) -> bool {
        self.reasons.is_empty()
    }
}

/// True for an energy that was missing while next to no work had been done, and is small against that of the whole attempt: a hand that
/// trembles touches the skin for a few steps before it goes in, and the work of a touch is known to half a step only. Figures come from
/// the whole attempt.
fn is_a_touch(records: &[FrameRecord], doubt: &Doubt) -> bool {
    let whole = records.last().map_or(0.0, |r| r.energy.external_max);
    let small = |r: &FrameRecord| (r.energy.external - r.energy.accounted()).abs() <= doubt.bound * whole;
    doubt.quantity == Quantity::EnergyImbalance && records.iter().all(small)
}

/// A layer that gave way before the tip.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Puncture {
    /// Name of the region; that of the tissue's own material has a word of its own.
    pub layer: String,
    /// End of the frame in which it gave way [s].
    pub time: f64,
    /// Material coordinate of its top [m].
    pub top: f64,
    /// Travel of the needle from then until it stopped or turned back [m].
    pub overshoot: f64,
    /// How far beyond the top the tip had cut by then [m].
    pub beyond: f64,
}

/// What one layer took.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct LayerFigures {
    pub layer: String,
    /// Largest axial force with the tip in it [N].
    pub peak_force: f64,
    /// [J]
    pub injury: f64,
    pub dissipated: f64,
}

/// The figures of one run; see the head of this file for their definitions. `None`: the run does not hold this number.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct PhysicalFigures {
    /// [N]
    pub peak_axial_force: f64,
    /// Of bone against the tip [N]; 0: it was not touched.
    #[serde(default)]
    pub peak_bone_force: f64,
    pub mean_axial_force: Option<f64>,
    /// [N/s]
    pub largest_force_rate: Option<f64>,
    /// [N]
    pub peak_lateral_force: f64,
    /// [N s]
    pub impulse: f64,
    /// [J]
    pub injury: f64,
    pub dissipated: f64,
    /// In the order in which the tip came to them.
    pub layers: Vec<LayerFigures>,
    pub punctures: Vec<Puncture>,
    /// Deepest point below the top face that the tip has cut to, in the material at rest [m].
    pub deepest_cut: f64,
    /// Area of the cohesive faces that parted [m^2].
    pub separated_area: Option<f64>,
    /// Largest damage d, 0 to 1.
    pub largest_damage: Option<f64>,
    /// In the order of the scene.
    pub targets: Vec<TargetFigures>,
    /// Core in the bore at the end.
    pub core: Option<CoreSample>,
}

/// Energy that separated, tore or crushed tissue [J].
fn injury(e: &EnergyAccount) -> f64 {
    e.cutting + e.cohesive + e.plastic + e.damage
}

/// Energy that did not come back [J].
fn dissipated(e: &EnergyAccount) -> f64 {
    injury(e) + e.friction + e.adhesion + e.viscous + e.damping
}

/// Length of every frame [s].
fn durations(records: &[FrameRecord]) -> impl Iterator<Item = f64> {
    let before = std::iter::once(0.0).chain(records.iter().map(|r| r.time));
    records.iter().zip(before).map(|(r, before)| r.time - before)
}

/// The straight axis of the needle at a time: where it meets the top face [m], its direction, and the depth of the tip along
/// it [m].
fn axis_at(scene: &Scene, samples: &[Sample], time: f64) -> (DVec3, DVec3, f64) {
    let index = samples.partition_point(|s| s.time <= time).max(1) - 1;
    let (tip, direction) =
        samples.get(index).map_or((scene.motion.entry, scene.motion.direction), |s| (s.tip, s.direction));
    axis_of(tip, direction)
}

/// The same of a needle whose tip is at `tip` [m].
pub fn axis_of(tip: DVec3, direction: DVec3) -> (DVec3, DVec3, f64) {
    // A needle that lies flat meets no top face.
    let depth = if direction.z.abs() > 1e-6 { tip.z / direction.z } else { 0.0 };
    (tip - direction * depth, direction, depth)
}

/// Where the end of the cut is: what the tip has cut to, on the way out where the tip is [m].
pub fn cut_end((surface, direction, depth): (DVec3, DVec3, f64), record: &FrameRecord) -> DVec3 {
    // The surface itself belongs to what lies under it.
    surface + direction * record.tip_coordinate.min(depth).max(0.5 * LAYER_STEP)
}

/// Name of what lies at a rest position.
pub fn layer_at(scene: &Scene, x: DVec3) -> &str {
    let region = scene.regions.iter().rfind(|r| r.shape.contains(x));
    region.map_or(texts::OWN_MATERIAL, |r| r.name.as_str())
}

impl PhysicalFigures {
    /// The figures of a run. `samples`: the trajectory of its needle, which must cover the time of the records.
    pub fn of(scene: &Scene, samples: &[Sample], records: &[FrameRecord]) -> PhysicalFigures {
        let mut figures = PhysicalFigures {
            peak_bone_force: records.iter().map(|r| r.force.bone).fold(0.0, f64::max),
            peak_axial_force: records.iter().map(|r| r.force.axial).fold(0.0, f64::max),
            mean_axial_force: mean_axial_force(records),
            largest_force_rate: largest_force_rate(records),
            peak_lateral_force: records.iter().map(|r| r.force.lateral.length()).fold(0.0, f64::max),
            impulse: records.iter().zip(durations(records)).map(|(r, dt)| r.force.axial.abs() * dt).sum(),
            punctures: punctures(scene, samples, records),
            targets: TargetFigures::of_run(&scene.targets, records),
            core: records.last().and_then(|r| r.core),
            ..Default::default()
        };
        let largest = |of: fn(&FrameRecord) -> f64| records.iter().map(of).fold(0.0, f64::max);
        figures.separated_area = scene.effects.cohesive.is_some().then(|| largest(|r| r.health.torn_area));
        figures.largest_damage = scene.effects.damage.is_some().then(|| largest(|r| r.health.largest_damage));
        let mut before = EnergyAccount::default();
        for record in records {
            let axis = axis_at(scene, samples, record.time);
            let place = cut_end(axis, record);
            figures.deepest_cut = figures.deepest_cut.max(record.tip_coordinate * -axis.1.z);
            let name = layer_at(scene, place);
            let index = figures.layers.iter().position(|l| l.layer == name).unwrap_or_else(|| {
                figures.layers.push(LayerFigures { layer: name.into(), ..Default::default() });
                figures.layers.len() - 1
            });
            let layer = &mut figures.layers[index];
            layer.peak_force = layer.peak_force.max(record.force.axial);
            layer.injury += injury(&record.energy) - injury(&before);
            layer.dissipated += dissipated(&record.energy) - dissipated(&before);
            before = record.energy;
        }
        figures.injury = injury(&before);
        figures.dissipated = dissipated(&before);
        figures
    }

    /// Overshoot behind the last layer that gave way, the one after which the trainee had to stop [m]; `None` where only the
    /// surface did, since the travel after that is the insertion itself.
    pub fn overshoot(&self) -> Option<f64> {
        self.punctures.last().filter(|_| self.punctures.len() > 1).map(|p| p.overshoot)
    }
}

fn mean_axial_force(records: &[FrameRecord]) -> Option<f64> {
    let inside = records.iter().zip(durations(records)).filter(|(r, _)| r.depth > 0.0);
    let (impulse, time) = inside.fold((0.0, 0.0), |(i, t), (r, dt)| (i + r.force.axial * dt, t + dt));
    (time > 0.0).then(|| impulse / time)
}

fn largest_force_rate(records: &[FrameRecord]) -> Option<f64> {
    let mut end = 0;
    let mut largest = None;
    for begin in records {
        // A frame at the very distance counts, whatever its last bit.
        while end < records.len() && records[end].time - begin.time < RATE_WINDOW * (1.0 - 1e-9) {
            end += 1;
        }
        let Some(record) = records.get(end) else { break };
        let rate = (record.force.axial - begin.force.axial) / (record.time - begin.time);
        largest = Some(rate.max(largest.unwrap_or(0.0)));
    }
    largest
}

/// The way of a tip through the layers of its path, as far as it has cut.
#[derive(Debug, Clone, Default)]
pub struct Track {
    /// The layer that the tip is entering, with its top [m].
    entering: Option<(String, f64)>,
    /// The layer of the end of the way; none before the first.
    present: Option<String>,
    /// How far the tip has cut, along its path [m].
    cut: f64,
}

impl Track {
    /// Goes on to the frame of `record`. `gave_way` is told the layer that gave way and its top [m].
    pub fn advance(
        &mut self,
        scene: &Scene,
        (surface, direction): (DVec3, DVec3),
        record: &FrameRecord,
        mut gave_way: impl FnMut(&str, f64),
    ) {
        let Some(puncture) = &scene.effects.puncture else { return };
        let a = record.tip_coordinate;
        if a <= 0.0 {
            // Outside, or not through the surface yet: a track that begins anew.
            *self = Track::default();
            return;
        }
        while self.cut < a {
            let next = (self.cut + LAYER_STEP).min(a);
            let name = layer_at(scene, surface + direction * (0.5 * (self.cut + next)));
            if self.present.as_deref() != Some(name) {
                if let Some((layer, top)) = &self.entering {
                    gave_way(layer, *top);
                }
                (self.entering, self.present) = (Some((name.into(), self.cut)), Some(name.into()));
            }
            if let Some((layer, top)) = &self.entering
                && next >= top + puncture.transition_length * (1.0 - 1e-9)
            {
                gave_way(layer, *top);
                self.entering = None;
            }
            self.cut = next;
        }
    }
}

/// The layers that gave way, in order.
fn punctures(scene: &Scene, samples: &[Sample], records: &[FrameRecord]) -> Vec<Puncture> {
    let (mut found, mut track) = (Vec::new(), Track::default());
    for (index, record) in records.iter().enumerate() {
        let (surface, direction, _) = axis_at(scene, samples, record.time);
        track.advance(scene, (surface, direction), record, |layer, top| {
            let stop = standstill(records, index);
            found.push(Puncture {
                layer: layer.into(),
                time: record.time,
                top,
                overshoot: stop.depth - record.depth,
                beyond: stop.tip_coordinate - top,
            });
        });
    }
    found
}

/// The first frame from `index` on after which the needle stands or turns back.
fn standstill(records: &[FrameRecord], index: usize) -> &FrameRecord {
    let rest = &records[index..];
    let stands = |pair: &[FrameRecord]| pair[1].depth - pair[0].depth < STANDSTILL * (pair[1].time - pair[0].time);
    &rest[rest.windows(2).position(stands).unwrap_or(rest.len() - 1)]
}
