//! Scenes without a file: a block of tissue with the defaults of scene files, for programs that use the library, benchmarks and tests.

#![warn(missing_docs)]

use glam::DVec3;

use super::{FaceCondition, Outputs, Scene, SolverSettings};
use crate::effects::own::OwnEffect;
use crate::effects::{EffectSet, TissueMaterial};
use crate::mesh::Tissue;
use crate::needle::{Motion, Phase, Tool};

/// Hourglass factor c of a scene without puncture, and of one with it in cells of `cell_size` [m].
///
/// Under a needle tip cells fold with less; elsewhere it would stiffen the block (30 % compression of a cube: 5.16 N with 15000,
/// 4.75 N with 1000, 4.65 N converged). The smallest factor without folding grows like h^-4: 2000, 5000, 15000 at 0.6, 0.5, 0.4 mm;
/// at 0.3 mm 15000 fold, 50000 do not.
pub fn hourglass_quartic(punctures: bool, cell_size: f64) -> f64 {
    if punctures { 15_000.0 * (0.4e-3 / cell_size).powi(4).max(1.0) } else { 1000.0 }
}

impl SolverSettings {
    /// What a scene file has that says nothing, in cells of `cell_size` [m].
    pub fn usual(punctures: bool, cell_size: f64) -> Self {
        SolverSettings {
            safety: 0.8,
            time_step: None,
            mass_damping: 10.0,
            hourglass_stiffness: 0.1,
            hourglass_quartic: hourglass_quartic(punctures, cell_size),
            frame_rate: 60.0,
            duration: None,
            on_trouble: Default::default(),
        }
    }
}

impl Scene {
    /// A block of `size` [m] with its top face at z = 0 and its centre on the z axis, in cells of `cell_size` [m]; held at its sides
    /// and its bottom, without tool and effects. Set the fields that differ; what a scene file is refused for is not looked at.
    ///
    /// ```
    /// use stylet::{EngineChoice, Scene, Simulation, TissueMaterial};
    /// let material = TissueMaterial::preset("across-fibre").unwrap();
    /// let scene = Scene::block([8e-3, 8e-3, 8e-3], 2e-3, material).lasting(0.05);
    /// let mut simulation = Simulation::new(scene, EngineChoice::Cpu)?;
    /// while let Some(frame) = simulation.next_frame()? {
    ///     assert!(frame.verdict.is_ok());
    /// }
    /// # Ok::<(), stylet::Error>(())
    /// ```
    pub fn block(size: impl Into<DVec3>, cell_size: f64, material: TissueMaterial) -> Scene {
        let held = FaceCondition { fixed: [true; 3], ..Default::default() };
        Scene {
            name: "block".into(),
            title: "block".into(),
            path: "block".into(),
            tissue: Tissue {
                size: size.into(),
                top: 0.0,
                cell_size,
                fine_radius: 2.5e-3,
                growth: 1.25,
                axis_offset_cells: [0.23, 0.31],
            },
            material,
            regions: Vec::new(),
            mesh: None,
            case: None,
            supports: Vec::new(),
            loads: Vec::new(),
            skin_free: None,
            faces: [held.clone(), held.clone(), held.clone(), held.clone(), held, FaceCondition::default()],
            tool: None,
            motion: Motion::default(),
            effects: EffectSet::default(),
            solver: SolverSettings::usual(false, cell_size),
            outputs: Outputs::default(),
            targets: Vec::new(),
            task: None,
            notices: Vec::new(),
        }
    }

    /// The same for a run of `duration` [s]; with a tool its phases decide.
    pub fn lasting(mut self, duration: f64) -> Scene {
        self.solver.duration = Some(duration);
        self
    }

    /// The same with a tool that enters at `entry` [m] (z = 0) along `direction`. It touches the tissue by the effect `puncture` or
    /// `indentation`, which come with it; switch on what else shall happen.
    pub fn with_tool(mut self, tool: Tool, entry: DVec3, direction: DVec3, phases: Vec<Phase>) -> Scene {
        let needle = matches!(tool, Tool::Needle(_));
        if needle {
            self.effects.puncture.get_or_insert_default();
            self.solver.hourglass_quartic = hourglass_quartic(true, self.tissue.cell_size);
        } else {
            self.effects.indentation.get_or_insert_default();
        }
        self.tool = Some(tool);
        self.motion = Motion { entry, direction: direction.normalize(), phases, vibration: None };
        self
    }

    /// The same with an effect that the program brings along, and values of its numbers in SI; those that are left out have their
    /// defaults.
    ///
    /// # Panics
    /// Where the effect has no such number, or a flaw ([`OwnEffect::flaw`]).
    pub fn with_own(mut self, effect: &'static OwnEffect, numbers: &[(&str, f64)]) -> Scene {
        if let Some(flaw) = effect.flaw() {
            panic!("{flaw}");
        }
        let mut chosen = effect.chosen();
        for (key, value) in numbers {
            let place = effect.numbers.iter().position(|number| number.key == *key);
            let place = place.unwrap_or_else(|| panic!("the effect `{}` has no number `{key}`", effect.effect.key));
            chosen.numbers[place] = *value;
        }
        self.effects.own.push(chosen);
        self
    }
}
