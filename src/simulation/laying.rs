//! A path that is laid while the needle comes: a free path in the scheme `opening`.
//!
//! The scheme carries the tissue beside one line through the material. Where a hand leads the needle, or a motion turns it, that line is not
//! known before the run, so it is laid between two frames: along the needle where the tip meets the skin, anew where it slides over the skin
//! before it has cut, and anew ahead of the tip where the needle has turned, along `F^-1 t`. What is cut stays. A tip that comes out leaves its
//! track, and takes it up again where it comes back to it: there it cuts nothing until the end of the track.
//!
//! Nothing acts on a needle that is on no line: the engine sees it far above the surface.

use glam::{DVec2, DVec3};
use serde::{Deserialize, Serialize};

use crate::engine::{State, StepInput};
use crate::mesh::BlockMesh;
use crate::mesh::material_place::{material_place, pulled_back, rest_position_at};
use crate::model::{LaidPath, Model, TipAnchor};
use crate::needle::ToolPose;
use crate::needle::path_line::PathLine;
use crate::needle::tip_contact::{TipContact, Touch};

/// Height over the skin at which a tip comes to it, and at which it has left it [m].
const COMES: f64 = 0.02e-3;
/// See [`COMES`].
const LEFT: f64 = 0.3e-3;

/// Depth behind which nobody asks whether a tip has left the tissue: by so much friction may lift the skin [m].
const DEEP: f64 = 2.0e-3;

/// By so much the needle turns until the line ahead of it is looked at, and by so much it has to be off to be laid anew [rad].
const TURNED: f64 = 0.5 * std::f64::consts::PI / 180.0;

/// Angle between a needle that comes back along its track and this track from which on it cuts a way of its own [rad]. A choice.
const BRANCHES: f64 = 10.0 * std::f64::consts::PI / 180.0;

/// Way over which the line ahead turns to a needle that has turned, in radii of the needle. A choice: that of F^-1 t before a tip, whose dent
/// cells of a radius or two hardly resolve, goes to and fro by 10 to 25 degrees.
const FOLLOWS: f64 = 3.0;

/// Part of its radius that a needle moves aside until the line is looked at: in the tissue, and on the skin. There a new place of the tip is
/// one where the skin is less deep, by the square of the way: with a quarter of the radius a slide of 3 mm created 3.9 % of the work.
const ASIDE: f64 = 0.25;
/// See [`ASIDE`].
const ASIDE_ON_SKIN: f64 = 0.05;

/// A needle that has gone aside by less is where it was [m].
const SAME_PLACE: f64 = 1e-8;

/// A needle this many radii beside its path in the material has left it: less than half of the opening is left there (OpeningPlan::left_beside).
const BESIDE: f64 = crate::model::opening::LEAVES * std::f64::consts::SQRT_2;

/// A track is the same where it begins within this part of the radius of the needle, at an angle below this [rad].
const SAME_ENTRY: f64 = 0.5;
/// See [`SAME_ENTRY`].
const SAME_ANGLE: f64 = 3.0 * std::f64::consts::PI / 180.0;

/// Where the engine sees a needle that is on no line, above the entry [m].
const PARKED: f64 = 20.0e-3;

/// A line that a needle has left, cut up to a material coordinate [m].
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Track {
    line: PathLine,
    cut: f64,
}

/// How far the laying has come.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Laying {
    /// The needle is on the line, and has cut.
    is_on: bool,
    has_cut: bool,
    /// The present line.
    line: PathLine,
    /// The needle as it was when its line was looked at last.
    tip: DVec3,
    direction: DVec3,
    /// Lines that were left.
    tracks: Vec<Track>,
}

/// The tissue as it is between two frames.
struct Tissue<'a> {
    mesh: &'a BlockMesh,
    laid: &'a LaidPath,
    u: &'a [DVec3],
}

impl Tissue<'_> {
    /// The rest position that is at a place.
    fn rest(&self, x: DVec3) -> DVec3 {
        rest_position_at(self.mesh, self.u, x, x, |at| self.laid.skin.nearest(self.mesh, at))
    }

    /// Height of a rest position over the skin [m]; `None` beside the tissue.
    fn height(&self, rest: DVec3) -> Option<f64> {
        self.laid.skin.skin_at(self.mesh, rest).map(|skin| rest.z - skin)
    }

    /// A direction in space as one in the material.
    fn pulled_back(&self, rest: DVec3, direction: DVec3) -> DVec3 {
        let at = material_place(self.mesh, self.u, self.laid.skin.nearest(self.mesh, rest));
        pulled_back(at.gradient, direction).normalize()
    }

    /// The line of a needle from where its axis meets the deformed skin, looked for from the rest position `near`; `None` where there is no
    /// tissue, or the needle points out of it.
    fn line(&self, near: DVec3, pose: &ToolPose) -> Option<PathLine> {
        const ROUNDS: usize = 12;
        let mut entry = near;
        for _ in 0..ROUNDS {
            entry.z = self.laid.skin.skin_at(self.mesh, entry)?;
            let at = material_place(self.mesh, self.u, self.laid.skin.nearest(self.mesh, entry));
            let away = pose.tip - at.position;
            let aside = away - pose.direction * away.dot(pose.direction);
            if aside.length() < 1e-8 {
                break;
            }
            entry += pulled_back(at.gradient, aside);
        }
        entry.z = self.laid.skin.skin_at(self.mesh, entry)?;
        let along = self.pulled_back(entry, pose.direction);
        (along.z < 0.0).then(|| PathLine::straight(entry, along))
    }
}

impl Laying {
    /// Before the run the tip stands on the surface, on the line of the scene.
    pub(super) fn of(model: &Model) -> Option<Self> {
        let laid = model.laid.as_ref()?;
        let motion = &model.scene.motion;
        let (tip, direction) = (motion.entry, motion.direction);
        Some(Laying { is_on: true, has_cut: false, line: laid.line.clone(), tip, direction, tracks: Vec::new() })
    }

    /// The needle is on a line.
    pub(super) fn is_on(&self) -> bool {
        self.is_on
    }

    /// The needle has left its line, which is cut up to a material coordinate [m].
    pub(super) fn leave(&mut self, cut: f64) {
        self.is_on = false;
        if cut > 0.0 {
            self.tracks.push(Track { line: self.line.clone(), cut });
        }
    }

    /// The needle comes to a line, or its line was looked at.
    pub(super) fn come(&mut self, line: &PathLine, pose: &ToolPose) {
        (self.is_on, self.tip, self.direction) = (true, pose.tip, pose.direction);
        self.tracks.retain(|track| track.line != *line);
    }

    /// The model has this line now.
    pub(super) fn take(&mut self, line: PathLine) {
        self.line = line;
    }

    /// The tip is at the material coordinate `cut` [m] at the end of a frame.
    pub(super) fn follow(&mut self, cut: f64) {
        self.has_cut = cut > 0.0;
    }

    /// The line that the needle is on.
    pub(super) fn line(&self) -> &PathLine {
        &self.line
    }

    /// The needle as the engine sees it where it is on no line.
    pub(super) fn seen(&self, input: StepInput) -> StepInput {
        if self.is_on {
            return input;
        }
        let ahead = self.line.piece(0.0);
        let parked = |pose: ToolPose| ToolPose {
            tip: ahead.origin - ahead.direction * PARKED,
            direction: ahead.direction,
            velocity: DVec3::ZERO,
            angular_velocity: DVec3::ZERO,
            velocity_ahead: DVec3::ZERO,
            angular_velocity_ahead: DVec3::ZERO,
            depth: -PARKED,
            ..pose
        };
        StepInput { pose: input.pose.map(parked), ..input }
    }

    /// True where the tissue has to be looked at before the needle moves on to `next`.
    pub(super) fn must_look(&self, next: &ToolPose, radius: f64) -> bool {
        let near = (next.tip - self.line.piece(0.0).origin).dot(next.direction) < DEEP;
        !self.is_on || near || self.has_moved(next, radius * if self.has_cut { ASIDE } else { ASIDE_ON_SKIN })
    }

    /// True where the needle has turned since its line was looked at, or gone aside by more than this [m].
    fn has_moved(&self, next: &ToolPose, way: f64) -> bool {
        let aside = next.tip - self.tip;
        let aside = aside - self.direction * aside.dot(self.direction);
        aside.length() > way || self.direction.angle_between(next.direction) > TURNED
    }
}

/// What a look at the tissue has found.
pub(super) enum Found {
    /// Nothing new.
    Nothing,
    /// The tip has left the tissue.
    Left,
    /// Another line, cut up to a material coordinate [m].
    Line(PathLine, f64),
}

impl Laying {
    /// What the tissue says of a needle that moves from one pose to another.
    pub(super) fn look(&self, model: &Model, state: &State, (now, next): (&ToolPose, &ToolPose)) -> Found {
        let (Some(laid), Some(mesh)) = (&model.laid, model.mesh.as_block()) else { return Found::Nothing };
        let radius = model.scene.needle().map_or(0.0, |needle| needle.radius);
        let tissue = Tissue { mesh, laid, u: &state.displacement };
        let rest = tissue.rest(next.tip);
        // Beside the tissue, over the level of the entry.
        let beside = if self.is_on { rest.z - self.line.piece(0.0).origin.z } else { f64::INFINITY };
        let height = tissue.height(rest).unwrap_or(beside);
        if !self.is_on {
            if height > COMES {
                return Found::Nothing;
            }
            let Some(line) = tissue.line(rest, next) else { return Found::Nothing };
            if recedes(now, next) && !presses(&model.relaid(line.clone()), state, next) {
                return Found::Nothing;
            }
            return match self.tracks.iter().find(|track| track.is_the_same(&line, radius)) {
                Some(track) => Found::Line(track.line.clone(), track.cut),
                None => Found::Line(line, 0.0),
            };
        }
        let was = tissue.height(tissue.rest(now.tip)).unwrap_or(height);
        if height > LEFT && was > LEFT {
            return Found::Left;
        }
        let cut = state.tip_coordinate;
        if cut == 0.0 {
            return self.slide(model, state, &tissue, (now, next));
        }
        if !self.has_moved(next, radius * ASIDE) {
            return Found::Nothing;
        }
        if next.depth <= now.depth {
            return Found::Nothing;
        }
        if could_dent(model, height, next) && self.lies_beside(&tissue, next, radius) {
            return tissue.line(rest, next).map_or(Found::Nothing, |line| Found::Line(line, 0.0));
        }
        // What is open ends where the tip has cut, or at the section that it stands at if it was drawn back: there it presses on nothing.
        let at = self.section_at_tip(&tissue, next, cut);
        let is_back = at + radius < cut;
        let cut = if is_back { at } else { cut };
        let end = cut + model.opening().map_or(0.0, |opening| opening.spacing);
        let piece = self.line.piece(end);
        let wanted = direction_ahead(model, &tissue, self.line.point(end), next.direction);
        // The tip's own dent turns the tissue before it, and not its way: the line follows over some of it.
        let part = if is_back { 1.0 } else { ((end - piece.start) / (FOLLOWS * radius)).clamp(0.0, 1.0) };
        let ahead = piece.direction.lerp(wanted, part).normalize();
        match piece.direction.angle_between(ahead) > if is_back { BRANCHES } else { TURNED } && ahead.z < 0.0 {
            true => Found::Line(self.line.turned(end, ahead), cut),
            false => Found::Nothing,
        }
    }
}

impl Laying {
    /// Material coordinate of the section of the line through whose middle the plane of the tip goes, at most `cut` [m]. A needle that turns
    /// draws its path aside and tilts it: after 20 degrees in soft tissue the place of the line that is nearest to the tip in the material lay
    /// 1 mm before that section, and a tip that was taken to be there pressed on what it had cut, with half of all work so far.
    fn section_at_tip(&self, tissue: &Tissue, pose: &ToolPose, cut: f64) -> f64 {
        const HALVINGS: i32 = 24;
        let is_before = |z: f64| {
            let x = tissue.laid.skin.nearest(tissue.mesh, self.line.point(z));
            (material_place(tissue.mesh, tissue.u, x).position - pose.tip).dot(pose.direction) < 0.0
        };
        if is_before(cut) {
            return cut;
        }
        let (mut before, mut behind) = (0.0, cut);
        for _ in 0..HALVINGS {
            let middle = 0.5 * (before + behind);
            *(if is_before(middle) { &mut before } else { &mut behind }) = middle;
        }
        before
    }

    /// True where the needle lies beside its path as far as it is in the tissue: the sections have slid off it, and where it goes on it
    /// meets tissue that is whole.
    fn lies_beside(&self, tissue: &Tissue, pose: &ToolPose, radius: f64) -> bool {
        const PLACES: i32 = 5;
        let depth = (pose.tip - self.line.piece(0.0).origin).dot(pose.direction);
        (0..PLACES).all(|i| {
            let behind = depth * f64::from(i) / f64::from(PLACES);
            let (aside, _) = self.line.coordinates(tissue.rest(pose.tip - pose.direction * behind));
            aside > BESIDE * radius
        })
    }

    /// The line of a needle that has not cut: without friction the tip slides over the skin, and the entry is where it presses.
    ///
    /// A line is where the needle will be at the end of the frame; a tilted needle that goes aside is at another height over it now. One that
    /// touches the skin neither now nor then must not press on either line in between: it keeps the one that it rises from.
    fn slide(&self, model: &Model, state: &State, tissue: &Tissue, (now, next): (&ToolPose, &ToolPose)) -> Found {
        let radius = model.scene.needle().map_or(0.0, |needle| needle.radius);
        let is_free = state.touch.force == 0.0 && !presses(model, state, now);
        let way = if is_free && presses(model, state, next) { SAME_PLACE } else { radius * ASIDE_ON_SKIN };
        if !self.has_moved(next, way) {
            return Found::Nothing;
        }
        match tissue.line(self.line.piece(0.0).origin, next) {
            Some(line) if is_free && recedes(now, next) && !presses(&model.relaid(line.clone()), state, next) => {
                Found::Nothing
            }
            Some(line) => Found::Line(line, 0.0),
            None => Found::Nothing,
        }
    }
}

/// True where a tip as deep as this under the skin may be one that dents skin which is whole: deeper it would have cut. A needle that a hand
/// forced against bone at 37 mm lay 1 mm beside all of its path, and was taken to dent the skin by 37 mm: 1.2 J in a spring.
fn could_dent(model: &Model, height: f64, pose: &ToolPose) -> bool {
    let Some((plan, contact)) = model.puncture.as_ref().zip(model.tip_contact()) else { return true };
    let force = plan.segments[0].cutting.puncture_force;
    -height <= (contact.depth(force) + force / contact.stiffness) * -pose.direction.z
}

/// True where a needle moves against its own direction.
fn recedes(now: &ToolPose, next: &ToolPose) -> bool {
    (next.tip - now.tip).dot(next.direction) < 0.0
}

/// True where a tip that has not cut is below the deformed skin, on the line of a model.
fn presses(model: &Model, state: &State, pose: &ToolPose) -> bool {
    touch_at(model, state, 0.0, pose).0 > 0.0
}

/// Direction in the material of a needle that goes on along `direction` from the rest position `at`: the mean over the lines of the tip.
fn direction_ahead(model: &Model, tissue: &Tissue, at: DVec3, direction: DVec3) -> DVec3 {
    let Some(plan) = &model.puncture else { return direction };
    let middle = plan.anchors[0].surface;
    let of_anchor = |anchor: &TipAnchor| tissue.pulled_back(at + (anchor.surface - middle), direction);
    plan.anchors.iter().map(of_anchor).sum::<DVec3>().normalize()
}

impl Track {
    /// True where a needle that would go along `line` comes back to this track.
    fn is_the_same(&self, line: &PathLine, radius: f64) -> bool {
        let (own, other) = (self.line.piece(0.0), line.piece(0.0));
        own.origin.distance(other.origin) < SAME_ENTRY * radius
            && own.direction.angle_between(other.direction) < SAME_ANGLE
    }
}

/// Mean distance of the tip beyond its anchors at the material coordinate `cut` [m], and the tip on the surface: as CpuEngine::advance_tip.
pub(super) fn touch_at(model: &Model, state: &State, cut: f64, pose: &ToolPose) -> (f64, Touch) {
    let (Some(plan), Some(mesh)) = (&model.puncture, model.mesh.as_block()) else { return Default::default() };
    let (path, t) = (plan.path, pose.direction);
    let moved = |anchor: &TipAnchor| {
        let x = anchor.surface + path.direction * cut;
        let at = material_place(mesh, &state.displacement, x);
        DVec2::new((at.position - x).dot(t), (at.gradient * path.direction).dot(t))
    };
    let [mean, stretch] = (plan.anchors.iter().map(moved).sum::<DVec2>() / plan.anchors.len() as f64).to_array();
    let gap = (pose.tip - path.entry).dot(t) - cut * path.direction.dot(t) - mean;
    let touch = |contact: &TipContact| contact.touch(gap, contact.part(cut), &state.spreading(contact));
    let touch = plan.contact.as_ref().map(touch);
    (gap, Touch { stretch, ..touch.unwrap_or_default() })
}
