//! Pace and cells of a scene, so that it takes the work that is meant.

use std::path::Path;

use super::super::{MOST_CELL_STEPS, MOST_CELLS};
use super::{Draft, Phase, Scaling};
use crate::engine::stable_dt::wave_speed_bound;
use crate::mesh::Mesh;
use crate::model::Model;
use crate::scene::Scene;
use crate::simulation::choose_step;

/// Changes of pace and cells until a scene fits its bounds.
const FITTINGS: usize = 12;

impl Draft {
    /// Settles pace, cells, frame rate, own step and failure displacement on the scene as the reader has it. A scene that is
    /// refused stays as it is.
    pub(super) fn fit(&mut self, path: &Path) {
        self.frame_rate = 1000.0;
        for _ in 0..FITTINGS {
            let Ok(scene) = Scene::parse(path, &self.text(), &[]) else { return };
            let mesh = Mesh::of_scene(&scene);
            if mesh.cell_count() > MOST_CELLS && self.mesh_cells.is_none() {
                self.cell *= 1.08;
                continue;
            }
            if let (Some(part), true) = (self.damage, self.failure == 100.0) {
                self.failure = 1e3 * part * least_failure(&scene);
                continue;
            }
            let model = Model::new(scene, mesh);
            let stable = wave_speed_bound(&model);
            self.frame_rate = (self.frames / model.duration()).clamp(0.5, 5e4);
            if let (Some(part), None) = (self.own_step, self.time_step) {
                self.time_step = Some(part * stable * 1e6);
                continue;
            }
            // With the wanted frames, of which each is a whole number of steps.
            let steps = model.duration() / choose_step(&model, stable).0;
            let cost = steps * model.mesh.cell_count() as f64;
            if cost <= MOST_CELL_STEPS {
                return;
            }
            match self.scaling {
                // Its factor would undo every change of pace.
                Some(Scaling::Auto) => {
                    let factor = model.mass_scaling() * (1.2 * cost / MOST_CELL_STEPS).powi(2);
                    self.scaling = Some(Scaling::Factor(factor.min(1e8)));
                }
                _ => {
                    let wanted = self.pace * 1.1 * cost / MOST_CELL_STEPS;
                    self.pace = wanted.min(self.most_pace);
                    if wanted > self.most_pace {
                        self.shorten(self.most_pace / wanted);
                    }
                }
            }
            self.time_step = None;
        }
    }

    /// Shortens the way of the tool to this part of it; a millimetre stays.
    fn shorten(&mut self, part: f64) {
        let short = |depth: &mut f64| *depth = if *depth > 0.0 { (*depth * part).max(1.0) } else { *depth };
        for phase in &mut self.phases {
            match phase {
                Phase::Insert { depth, .. } | Phase::Withdraw { depth, .. } => short(depth),
                Phase::Hold { duration } => *duration *= part,
                _ => {}
            }
        }
        // A way back ends above where it began.
        let mut at = 0.0;
        for phase in &mut self.phases {
            match phase {
                Phase::Insert { depth, .. } => {
                    *depth = depth.max(at + 0.3);
                    at = *depth;
                }
                Phase::Withdraw { depth, .. } => {
                    *depth = depth.min(at - 0.3);
                    at = *depth;
                }
                _ => {}
            }
        }
    }
}

/// Least failure displacement for which no cell of the fine zone snaps back, `sigma h/E` of the worst material [m].
fn least_failure(scene: &Scene) -> f64 {
    let worst = |material: &crate::effects::TissueMaterial| {
        let flow = material.plasticity.or(scene.effects.plasticity).unwrap_or_default();
        let onset = material.damage.or(scene.effects.damage).unwrap_or_default().onset;
        (flow.yield_stress + flow.hardening * onset) / material.law.youngs_modulus()
    };
    let regions = scene.regions.iter().map(|region| worst(&region.material));
    scene.tissue.cell_size * regions.fold(worst(&scene.material), f64::max)
}
