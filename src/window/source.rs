//! The scene file that a window shows.

use std::path::PathBuf;

use crate::Result;
use crate::effects::parameter::with_overrides;
use crate::reading;
use crate::scene::Scene;

/// A scene file as it was read, with what replaces its values.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Source {
    pub path: PathBuf,
    pub text: String,
    pub overrides: Vec<String>,
}

impl Source {
    /// # Errors
    /// Those of [`Scene::load`], for a file that cannot be read too.
    pub fn read(path: PathBuf, overrides: Vec<String>) -> Result<(Self, Scene)> {
        let scene = Scene::load(&path, &overrides)?;
        let text = reading::text(&path, reading::most::SCENE).map_err(|e| e.of(&path, "name a scene file"))?;
        Ok((Source { path, text, overrides }, scene))
    }

    /// # Errors
    /// Those of [`Scene::parse`].
    pub fn scene(&self) -> Result<Scene> {
        Scene::parse(&self.path, &self.text, &self.overrides)
    }

    /// The same with more overrides.
    pub fn with(&self, more: &[String]) -> Self {
        Source { overrides: with_overrides(&self.overrides, more), ..self.clone() }
    }
}
