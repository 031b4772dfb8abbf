//! Accuracy against time: mesh and mass scaling with what they are predicted to cost, and the error where a study has measured it.

use super::practice::Timing;
use super::slider::named;
use super::tuning::Tuning;
use crate::engine::stable_dt::wave_speed_bound;
use crate::mesh::Mesh;
use crate::model::Model;
use crate::scene::Scene;
use crate::study::advice::Candidate;
use crate::study::analysis::Analysis;
use crate::study::plan::UnitCost;
use crate::study::runner::predicted_factor;
use crate::study::store::{Store, default_folder};
use crate::study::{MeshSize, Settings};
use crate::words::say;

/// What the sliders stand at, and what is known of it.
pub struct Accuracy {
    edge_mm: f64,
    mass_scaling: f64,
    /// Size of the mesh with an edge [mm].
    size: Option<(f64, Result<MeshSize, String>)>,
    /// Runs of a study of the scene, with their errors.
    studied: Vec<Candidate>,
}

impl Accuracy {
    /// At what the scene has.
    pub fn new(scene: &Scene) -> Self {
        Accuracy {
            edge_mm: scene.tissue.cell_size * 1e3,
            mass_scaling: scene.effects.mass_scaling.map_or(1.0, |m| m.factor),
            size: None,
            studied: studied(scene),
        }
    }

    /// Draws the sliders for the scene that runs.
    pub fn show(&mut self, ui: &mut egui::Ui, scene: &Scene, tuning: &mut Tuning, timing: &Timing, now: (u64, u64)) {
        let base = scene.tissue.cell_size * 1e3;
        let block = scene.mesh.is_none();
        ui.add_enabled_ui(block, |ui| {
            let slider = egui::Slider::new(&mut self.edge_mm, 0.3..=2.0).step_by(0.05).suffix(" mm");
            named(ui, slider, say("edge"));
        });
        let slider = egui::Slider::new(&mut self.mass_scaling, 1.0..=1e5).logarithmic(true).max_decimals(0);
        ui.add_enabled_ui(scene.effects.mass_scaling.is_some(), |ui| named(ui, slider, say("mass-scaling")));
        if self.size.as_ref().is_none_or(|(edge, _)| *edge != self.edge_mm) {
            self.size = Some((self.edge_mm, self.measured_size(scene)));
        }
        let Some((_, size)) = &self.size else { return };
        match size {
            Ok(size) => {
                let factor = self.predicted(*size, scene, timing, now);
                let factor = factor.map_or(say("after-the-first-frame").into(), |factor| format!("{factor:.2}"));
                ui.label(format!("{} {}, {} {factor}", size.cells, say("cells"), say("predicted")));
            }
            Err(reason) => {
                ui.colored_label(ui.visuals().error_fg_color, reason);
            }
        }
        ui.label(self.error_in_words(scene));
        let same_mesh = (self.edge_mm - base).abs() < 1e-9;
        let factor = scene.effects.mass_scaling.map(|m| m.factor);
        let same = same_mesh && factor.is_none_or(|f| (f / self.mass_scaling - 1.0).abs() < 1e-3);
        let text = if same_mesh { say("apply") } else { say("apply-anew") };
        if ui.add_enabled(!same && size.is_ok() && !tuning.is_busy(), egui::Button::new(text)).clicked() {
            let mut wishes = Vec::new();
            if !same_mesh {
                wishes.push(format!("tissue.cell_size_mm={}", self.edge_mm));
            }
            if factor.is_some() {
                wishes.push(format!("solver.mass_scaling={}", self.mass_scaling.round().max(1.0)));
            }
            tuning.wish(&wishes);
        }
    }

    fn measured_size(&self, scene: &Scene) -> Result<MeshSize, String> {
        let mut scene = scene.clone();
        scene.tissue.cell_size = self.edge_mm * 1e-3;
        let model = Model::new(scene.clone(), Mesh::of_scene(&scene));
        let unit_step_s = wave_speed_bound(&model) / model.mass_scaling().sqrt();
        Ok(MeshSize { cells: model.mesh.cell_count() as u64, unit_step_s })
    }

    /// Real-time factor of the tissue alone, from what a frame of `now` (cells, steps) takes here; `None` before there was one.
    fn predicted(&self, size: MeshSize, scene: &Scene, timing: &Timing, (cells, steps): (u64, u64)) -> Option<f64> {
        if timing.physics <= 0.0 {
            return None;
        }
        let cost = UnitCost { step_s: 0.0, cell_step_s: timing.physics / (cells * steps).max(1) as f64 };
        Some(predicted_factor(size, &self.settings(scene), &cost, scene.solver.frame_rate))
    }

    fn settings(&self, scene: &Scene) -> Settings {
        Settings {
            cell_size_mm: self.edge_mm,
            mass_scaling: self.mass_scaling,
            safety: scene.solver.safety,
            engine: crate::study::Engine::Gpu,
            effects: scene.effects.keys().into_iter().map(String::from).collect(),
            repetition: 0,
        }
    }

    /// The error that the study measured nearest to what the sliders stand at.
    fn error_in_words(&self, scene: &Scene) -> String {
        let far = |c: &Candidate| {
            (c.settings.cell_size_mm / self.edge_mm).ln().abs()
                + 0.25 * (c.settings.mass_scaling / self.mass_scaling).ln().abs()
        };
        // On the mesh of the reference no error of the mesh was measured.
        match self
            .studied
            .iter()
            .filter(|c| c.error.is_finite() && !c.same_mesh)
            .min_by(|a, b| far(a).total_cmp(&far(b)))
        {
            Some(c) => format!(
                "{} {:.1} % {} {} mm, S {:.0}",
                say("error"),
                100.0 * c.error,
                say("measured-at"),
                c.settings.cell_size_mm,
                c.settings.mass_scaling
            ),
            None => format!("{} stylet study {}", say("no-study"), scene.path.display()),
        }
    }
}

/// What a study of the scene in its usual folder found.
fn studied(scene: &Scene) -> Vec<Candidate> {
    let Ok((store, plan)) = Store::existing(&default_folder(&scene.name)) else { return Vec::new() };
    Analysis::read(&store, &plan).map(|analysis| analysis.candidates()).unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;

    /// Nothing was timed yet: no factor, rather than an infinite one.
    #[test]
    fn nothing_is_predicted_before_the_first_frame() {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/effects/puncture.toml");
        let scene = Scene::load(&path, &[]).unwrap_or_else(|e| panic!("{e}"));
        let accuracy = Accuracy::new(&scene);
        let size = accuracy.measured_size(&scene).unwrap();
        assert_eq!(accuracy.predicted(size, &scene, &Timing::default(), (1000, 10)), None);
        let timed = Timing { physics: 0.01, ..Timing::default() };
        assert!(accuracy.predicted(size, &scene, &timed, (1000, 10)).is_some_and(|f| f > 0.0 && f.is_finite()));
    }
}
