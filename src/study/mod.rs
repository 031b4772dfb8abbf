//! What accuracy costs: one scene over mesh size, mass scaling, step, engine and effects, against a reference that the study
//! computes itself.
//!
//! [`subject`] reads the scene, [`plan`] chooses the runs that a budget of time allows, [`runner`] measures and runs them,
//! [`store`] keeps each finished run, [`analysis`] turns them into errors ([`metrics`]), fronts ([`pareto`]) and orders
//! ([`order`]), [`tables`] and [`page`] write them down, [`advice`] looks up what they mean for a frame rate.
//! [`precision`] chooses cells and mass scaling for a wanted error, from a few coarse runs of its own.

pub mod advice;
pub mod analysis;
pub mod metrics;
pub mod order;
pub mod page;
pub mod pareto;
pub mod plan;
pub mod precision;
pub mod runner;
pub mod store;
pub mod subject;
pub mod tables;

use serde::{Deserialize, Serialize};

use crate::error::Error;
use crate::hash::fnv1a;
use crate::simulation::EngineChoice;
use crate::units::trimmed;

/// An engine with its precision.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Engine {
    Gpu,
    /// Cells in lanes of f32.
    Cpu,
    /// All in f64.
    Cpu64,
}

impl Engine {
    pub fn choice(self) -> EngineChoice {
        match self {
            Engine::Gpu => EngineChoice::Gpu,
            Engine::Cpu => EngineChoice::Cpu,
            Engine::Cpu64 => EngineChoice::Cpu64,
        }
    }

    /// As the command line has it.
    pub fn key(self) -> &'static str {
        self.choice().key()
    }

    /// With its precision, for people.
    pub fn describe(self) -> &'static str {
        match self {
            Engine::Gpu => "gpu f32",
            Engine::Cpu => "cpu f32",
            Engine::Cpu64 => "cpu64 f64",
        }
    }
}

/// What a study varies.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Axis {
    Mesh,
    Mass,
    Step,
    Engine,
    Effects,
}

impl Axis {
    pub const ALL: [Axis; 5] = [Axis::Mesh, Axis::Mass, Axis::Step, Axis::Engine, Axis::Effects];

    /// As the command line has it.
    pub fn key(self) -> &'static str {
        match self {
            Axis::Mesh => "mesh",
            Axis::Mass => "mass",
            Axis::Step => "step",
            Axis::Engine => "engine",
            Axis::Effects => "effects",
        }
    }

    /// The axes of a list such as `mesh,mass`, each once, in the order of [`Axis::ALL`].
    ///
    /// # Errors
    /// `Error::Input` with the known names where one is not.
    pub fn list(text: &str) -> crate::Result<Vec<Axis>> {
        let names: Vec<&str> = text.split(',').map(str::trim).filter(|name| !name.is_empty()).collect();
        let known = Axis::ALL.map(Axis::key).join(",");
        let unknown = names.iter().find(|name| !Axis::ALL.iter().any(|axis| axis.key() == **name));
        match unknown {
            Some(name) => Err(Error::input(
                format!("there is no axis `{name}` of a study"),
                format!("write some of these, separated by commas: --axes {known}"),
            )),
            None if names.is_empty() => {
                Err(Error::input("--axes names no axis", format!("write some of these: --axes {known}")))
            }
            None => Ok(Axis::ALL.into_iter().filter(|axis| names.contains(&axis.key())).collect()),
        }
    }
}

/// What two studies must share to be joined: the scene file and its overrides, as one number.
pub fn scene_hash(text: &str, overrides: &[String]) -> String {
    fnv1a(&[text, &overrides.join("\n")])
}

/// Everything by which two runs of one study differ.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Settings {
    /// Cell edge around the path [mm], as the scene file has it.
    pub cell_size_mm: f64,
    /// Factor S on the inertia of the tissue, 1 or more.
    pub mass_scaling: f64,
    /// Fraction of the stable step, 0..1.
    pub safety: f64,
    pub engine: Engine,
    /// Keys of the effects that are on.
    pub effects: Vec<String>,
    /// 0, or 1 for the second run of the same settings, which tells the scatter of the times.
    #[serde(default)]
    pub repetition: u32,
}

impl Settings {
    /// One line for people, without the effects.
    pub fn describe(&self) -> String {
        format!(
            "cells of {} mm, mass scaling {}, safety {}, {}",
            trimmed(self.cell_size_mm),
            trimmed(self.mass_scaling),
            trimmed(self.safety),
            self.engine.describe()
        )
    }

    /// Effects of `self` that `other` lacks, and the other way round.
    pub fn effects_beside(&self, other: &Settings) -> (Vec<String>, Vec<String>) {
        let missing = |a: &Settings, b: &Settings| -> Vec<String> {
            a.effects.iter().filter(|key| !b.effects.contains(key)).cloned().collect()
        };
        (missing(self, other), missing(other, self))
    }

    /// Name of its file, unique among the runs of a study with this base.
    pub fn id(&self, base: &Settings) -> String {
        let mut id = format!(
            "h{}_S{}_s{}_{}",
            trimmed(self.cell_size_mm),
            trimmed(self.mass_scaling),
            trimmed(self.safety),
            self.engine.key()
        );
        let (added, removed) = self.effects_beside(base);
        // Mass scaling comes and goes with its factor, which the name has already.
        for (word, keys) in [("with", added), ("without", removed)] {
            for key in keys.iter().filter(|key| *key != "mass_scaling") {
                id += &format!("_{word}_{key}");
            }
        }
        if self.repetition > 0 {
            id += "_again";
        }
        id
    }
}

/// What a mesh costs before its engine is known.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MeshSize {
    pub cells: u64,
    /// Stable step without mass scaling [s]; it grows with the root of the factor.
    pub unit_step_s: f64,
}
