//! What is drawn after a restart, a switch of effects, a change of the files or of the cut.

use std::path::{Path, PathBuf};

use glam::DVec3;

use super::practice_screen::PracticeScreen;
use super::stage::Stage;
use crate::Result;
use crate::gpu::compose::{SOURCES, read_sources};
use crate::reading;
use crate::simulation::change::Reach;
use crate::window::anatomy_view::legend;
use crate::window::scene_view::SceneView;
use crate::window::section::RestPlane;
use crate::window::source::Source;

impl PracticeScreen {
    /// Cuts the tissue, and sees through layers, as the choices say.
    pub(super) fn cut(&mut self, stage: &Stage) {
        let model = &self.practice.simulation.model;
        let (low, high) = model.mesh.bounds();
        let plane = self.choices.cut.map(|(axis, at)| {
            // The half towards the viewer is taken away: -x, -y, +z.
            let along = low[axis] + at * (high[axis] - low[axis]);
            let sign = if axis == 2 { 1.0 } else { -1.0 };
            RestPlane { normal: DVec3::AXES[axis] * sign, offset: sign * along }
        });
        self.view.cut(&stage.gpu, model, plane, self.choices.look.through);
    }

    /// After a restart: the buffers are new.
    pub(super) fn rebind(&mut self, stage: &mut Stage) -> Result<()> {
        let model = self.practice.simulation.model.clone();
        if let Some(engine) = self.practice.simulation.on_device()
            && !self.view.take_model(&stage.gpu, engine, &model)?
        {
            self.view = SceneView::new(&stage.gpu, engine, &model, stage.config.format)?;
        }
        self.choices.parts = legend(&model);
        self.scan.close(&mut stage.painter);
        self.cut(stage);
        stage.alive.writes_to(self.practice.folder());
        self.due = 0.0;
        Ok(())
    }

    /// Asks for what somebody has written into the files meanwhile.
    pub(super) fn read_anew(&mut self, shaders: Option<&Path>) {
        let tuning = &mut self.practice.tuning;
        if self.recorded.is_none() && self.scene_file.has_changed() {
            match reading::text(&tuning.source.path, reading::most::SCENE) {
                Ok(text) => tuning.wish_for(Source { text, ..tuning.coming().clone() }, Reach::Start),
                Err(error) => tuning.refusal = Some(error.of(&tuning.source.path, "save the file again").to_string()),
            }
        }
        if let Some(folder) = shaders
            && self.shader_files.has_changed()
        {
            match read_sources(folder) {
                Ok(()) => tuning.wish_for(tuning.coming().clone(), Reach::Kernels),
                Err(error) => tuning.refusal = Some(error.to_string()),
            }
        }
    }

    /// After a change of effects: the engine is new, the mesh and all that is drawn of it the same.
    pub(super) fn take_buffers(&mut self, stage: &mut Stage) -> Result<()> {
        self.scan.close(&mut stage.painter);
        match self.practice.simulation.on_device() {
            Some(engine) => self.view.take_buffers(&stage.gpu, engine),
            None => Ok(()),
        }
    }
}

/// The shaders of a folder.
pub(super) fn shader_files(folder: &Path) -> Vec<PathBuf> {
    SOURCES.iter().map(|(name, _)| folder.join(name).with_extension("wgsl")).collect()
}
