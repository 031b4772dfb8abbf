//! `stylet prepare`: has the driver compile the kernels that a window may need, before it needs them.
//!
//! Software drivers compile a kernel when it is first used, in the queue that the frames go through, and keep it on disk. A window
//! starts this command at its side, for what is one switch away from what runs; whoever wants all of it ready before the first
//! window opens calls it once after an installation.

use std::collections::BTreeSet;
use std::path::PathBuf;
use std::time::Instant;

use crate::effects::parameter::with_overrides;
use crate::effects::{exactly, one_switch_away};
use crate::error::Result;
use crate::gpu::Gpu;
use crate::scene::Scene;
use crate::simulation::change::Reach;
use crate::simulation::{Purpose, Simulation};

/// What the command line says.
#[derive(Debug, Clone, Default)]
pub struct PrepareOptions {
    pub scene: PathBuf,
    pub overrides: Vec<String>,
    /// Who will lead the needle: a hand (`true`), the script, or who comes (`None`).
    pub led: Option<bool>,
    pub part: Part,
}

/// What of a scene is compiled.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Part {
    /// The scene and the switches of its effects.
    #[default]
    All,
    /// The scene as it is.
    Scene,
    /// The switches, beside a window that runs the scene: only with processor time that nobody else wants.
    Switches,
}

/// Begin of a line that tells what is ready now; an override that names the effects follows.
pub const READY: &str = "ready: ";

/// Compiles the kernels of a scene and of each switch of one of its effects that a run can take without beginning anew.
/// `tell` gets a line for each of them as soon as it is ready.
///
/// # Errors
/// Those of [`Scene::load`]; `Error::Device` without an adapter.
pub fn prepare(options: &PrepareOptions, mut tell: impl FnMut(&str)) -> Result<String> {
    if options.part == Part::Switches {
        crate::process::idle();
    }
    let begin = Instant::now();
    let load = |more: &[String]| Scene::load(&options.scene, &with_overrides(&options.overrides, more));
    let gpu = Gpu::open()?;
    let leads = options.led.map_or_else(|| vec![false, true], |led| vec![led]);
    let (mut ready, mut apart) = (BTreeSet::new(), BTreeSet::new());
    for led in leads {
        let simulation = Simulation::for_purpose(load(&[])?, Some(gpu.clone()), Purpose { led, drawn: true })?;
        let on = simulation.model.effects.keys();
        if options.part != Part::Switches {
            simulation.plan_change(load(&[])?)?.prepare()?;
            tell(&format!("{READY}{}", exactly(&on)));
        }
        for wanted in one_switch_away(&on).filter(|_| options.part != Part::Scene) {
            // A scene that cannot do without an effect, or not with it, is none that a switch leads to.
            let change = load(std::slice::from_ref(&wanted)).and_then(|scene| simulation.plan_change(scene));
            match change {
                Ok(change) if change.reach == Reach::Kernels => {
                    change.prepare()?;
                    tell(&format!("{READY}{wanted}"));
                    ready.insert(wanted);
                }
                Ok(_) => _ = apart.insert(wanted),
                Err(_) => {}
            }
        }
    }
    let mut text = format!(
        "{}: {}{} switch(es) of one effect are compiled for {} in {:.1} s",
        options.scene.display(),
        if options.part == Part::Switches { "" } else { "the scene and " },
        ready.len(),
        crate::gpu::device::describe(&gpu.info),
        begin.elapsed().as_secs_f64()
    );
    if !apart.is_empty() {
        text += &format!("\n{} switch(es) begin the run anew and were left out", apart.len());
    }
    Ok(text)
}
