//! What does not deform, before the tip of a needle: bone.
//!
//! The tip meets it with the force `k d` along the needle, at the depth `d` of the tip in it; whoever or whatever drives the needle stops
//! pushing at [`LARGEST_FORCE`], so the tip gets no deeper than that force over k. The bone stands still, so that this spring is one
//! between the needle and the ground: it acts on the needle alone, and holds what work goes into it.

use glam::DVec3;

use super::Model;
use crate::needle::motion::HandPose;
use crate::scene::Scene;

/// Stiffness k of the contact of a tip with bone [N/m]. Choice of this project: a tip of steel is that stiff within a few hundredths of a
/// millimetre, far stiffer than all tissue before it.
pub const STIFFNESS: f64 = 50.0e3;

/// Force at which a hand or a drive stops pushing against bone [N].
pub const LARGEST_FORCE: f64 = crate::scene::LARGEST_FORCE_LIMIT;

/// How deep a tip gets into it [m].
pub const DEEPEST: f64 = LARGEST_FORCE / STIFFNESS;

/// Steps in which bone is looked for along a path [m].
const STEP: f64 = 0.02e-3;

/// What does not deform on a path.
fn is_rigid(scene: &Scene, x: DVec3) -> bool {
    scene.material_at(x).rigid
}

/// Depth at which the straight path of a scene meets bone, down to `deepest` [m].
pub fn depth_of_bone(scene: &Scene, deepest: f64) -> Option<f64> {
    if !scene.regions.iter().any(|region| region.material.rigid) {
        return None;
    }
    let at = |depth: f64| scene.motion.entry + scene.motion.direction * depth;
    let steps = (deepest / STEP).ceil() as usize;
    let first = (0..=steps).map(|i| i as f64 * STEP).find(|depth| is_rigid(scene, at(*depth)))?;
    let (mut low, mut high) = ((first - STEP).max(0.0), first);
    for _ in 0..30 {
        let middle = 0.5 * (low + high);
        if is_rigid(scene, at(middle)) {
            high = middle;
        } else {
            low = middle;
        }
    }
    Some(high)
}

/// How deep the tip of a needle gets on the straight path of a scene [m]; `None`: as deep as its motion goes.
pub fn deepest(scene: &Scene) -> Option<f64> {
    let straight = scene.needle().is_some() && !scene.motion.is_free();
    let bone = straight.then(|| depth_of_bone(scene, scene.motion.deepest())).flatten();
    bone.map(|depth| depth + DEEPEST)
}

impl Model {
    /// How deep a tip is in bone, along the needle [m]; 0 outside.
    pub fn depth_in_bone(&self, tip: DVec3, direction: DVec3) -> f64 {
        if !self.has_rigid || !is_rigid(&self.scene, tip) {
            return 0.0;
        }
        let (mut low, mut high) = (0.0, 2.0 * DEEPEST);
        for _ in 0..30 {
            let middle = 0.5 * (low + high);
            if is_rigid(&self.scene, tip - direction * middle) {
                low = middle;
            } else {
                high = middle;
            }
        }
        high
    }

    /// Where a hand that wants the needle at `wanted` gets it, from `now`: not deeper into bone than [`DEEPEST`].
    pub fn before_bone(&self, now: &HandPose, wanted: &HandPose) -> HandPose {
        if !self.has_rigid {
            return *wanted;
        }
        let tip = |pose: &HandPose| pose.entry + pose.direction * pose.depth;
        let (from, way) = (tip(now), tip(wanted) - tip(now));
        let steps = (way.length() / STEP).ceil().max(1.0);
        let direction = wanted.direction;
        let mut part = 0.0;
        for i in 1..=steps as usize {
            let next = i as f64 / steps;
            let x = from + way * next;
            let deeper = self.depth_in_bone(x, direction);
            if deeper > DEEPEST && deeper > self.depth_in_bone(from + way * part, direction) {
                break;
            }
            part = next;
        }
        if part >= 1.0 {
            return *wanted;
        }
        let stopped = from + way * part;
        let depth = wanted.depth - (tip(wanted) - stopped).dot(direction);
        HandPose { entry: stopped - direction * depth, direction, depth }
    }
}
