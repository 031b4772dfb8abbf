//! Needles whose path is opened (scheme `opening`) instead of softened.

use std::path::Path;

use super::super::numbers::{Numbers, written};
use super::Draft;
use crate::needle::Tool;
use crate::scene::Scene;

/// Part of the needles that open their path, of those that can.
const OPENED: f64 = 0.35;

/// What the numbers of the scheme are drawn from, apart from all others: scenes that have no part in it stay what they were.
const APART: u64 = 0x5EED_0F0B_E41E_5CED;

impl Draft {
    /// Opens the path, where the draw says so and the reader takes it.
    pub(super) fn open_the_path(&mut self, (seed, index): (u64, u64), tame: bool, path: &Path) {
        let mut n = Numbers::of(seed ^ APART, index);
        if !self.effects.contains(&"puncture") || !n.chance(OPENED) {
            return;
        }
        // Settled later; without one no reader takes a scene.
        self.frame_rate = 1000.0;
        let Ok(scene) = Scene::parse(path, &self.text(), &[]) else { return };
        let Some(Tool::Needle(needle)) = &scene.tool else { return };
        // J_c over mu R: 7.3 for a needle of 1.65 mm in muscle.
        let part = if tame { n.log(1.0, 15.0) } else { n.log(0.1, 100.0) };
        let toughness = |shear: f64| format!("toughness_j_m2 = {}", written(part * shear * needle.radius));
        let mut opened = self.clone();
        let own = toughness(scene.material.law.shear_modulus());
        opened.body = opened.body.replacen("[material]\n", &format!("[material]\n{own}\n"), 1);
        // Regions in the order in which they stand.
        let mut pieces = opened.body.split("material = { ");
        let mut body = pieces.next().unwrap_or_default().to_string();
        for (piece, region) in pieces.zip(&scene.regions) {
            let own = toughness(region.material.law.shear_modulus());
            body += &format!("material = {{ {own}, {piece}");
        }
        opened.body = body;
        let forces = ["puncture_force_n", "cutting_force_n"];
        let kept = |line: &&str| !forces.iter().any(|key| line.starts_with(key));
        opened.tables = opened.tables.lines().filter(kept).map(|line| format!("{line}\n")).collect();
        if !opened.tables.contains("[puncture]\n") {
            opened.tables = format!("[puncture]\n\n{}", opened.tables);
        }
        opened.tables = opened.tables.replacen("[puncture]\n", "[puncture]\nscheme = \"opening\"\n", 1);
        if Scene::parse(path, &opened.text(), &[]).is_ok() {
            *self = opened;
        }
    }
}
