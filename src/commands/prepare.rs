//! `stylet prepare`: has the driver compile the kernels that a window may need, before it needs them.
//!
//! Software drivers compile a kernel when it is first used, in the queue that the frames go through, and keep it on disk. A window
//! starts this command at its side, for what is one switch away from what runs; whoever wants all of it ready before the first
//! window opens calls it once after an installation.

use std::collections::BTreeSet;
use std::time::Instant;

use clap::Args;

use super::SceneArgs;
use crate::effects::parameter::with_overrides;
use crate::effects::{exactly, one_switch_away};
use crate::ending;
use crate::error::Result;
use crate::gpu::Gpu;
use crate::scene::Scene;
use crate::simulation::change::Reach;
use crate::simulation::{Purpose, Simulation};

#[derive(Debug, Clone, Default, Args)]
pub struct PrepareArgs {
    #[command(flatten)]
    pub scene: SceneArgs,
    /// Only as a hand leads the needle [default: hand and script]
    #[arg(long, conflicts_with = "script")]
    pub hand: bool,
    /// Only as the script leads the needle
    #[arg(long)]
    pub script: bool,
    /// Only this scene, without the switches of its effects
    #[arg(long)]
    pub only: bool,
    /// Only the switches, at the side of a window that runs the scene
    #[arg(long, hide = true, conflicts_with = "only")]
    pub beside: bool,
}

impl PrepareArgs {
    /// Who will lead the needle: a hand (`true`), the script, or who comes (`None`).
    fn led(&self) -> Option<bool> {
        (self.hand || self.script).then_some(self.hand)
    }

    fn part(&self) -> Part {
        match (self.only, self.beside) {
            (true, _) => Part::Scene,
            (_, true) => Part::Switches,
            _ => Part::All,
        }
    }
}

/// What of a scene is compiled.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Part {
    /// The scene and the switches of its effects.
    All,
    /// The scene as it is.
    Scene,
    /// The switches, beside a window that runs the scene: only with processor time that nobody else wants.
    Switches,
}

/// Begin of a line that tells what is ready now; an override that names the effects follows.
pub const READY: &str = "ready: ";

/// The command: prints what is ready as it comes, then how long all took.
///
/// # Errors
/// As [`prepare`].
pub fn execute(args: &PrepareArgs) -> Result<u8> {
    ending::watch();
    println!("{}", prepare(args, |text| println!("{text}"))?);
    Ok(0)
}

/// Compiles the kernels of a scene and of each switch of one of its effects that a run can take without beginning anew.
/// `tell` gets a line for each of them as soon as it is ready.
///
/// # Errors
/// Those of [`Scene::load`]; `Error::Device` without an adapter.
pub fn prepare(args: &PrepareArgs, mut tell: impl FnMut(&str)) -> Result<String> {
    let part = args.part();
    if part == Part::Switches {
        crate::process::idle();
    }
    let begin = Instant::now();
    let load = |more: &[String]| Scene::load(&args.scene.file, &with_overrides(&args.scene.overrides, more));
    let gpu = Gpu::open()?;
    let leads = args.led().map_or_else(|| vec![false, true], |led| vec![led]);
    let (mut ready, mut apart) = (BTreeSet::new(), BTreeSet::new());
    for led in leads {
        let simulation =
            Simulation::for_purpose(load(&[])?, Some(gpu.clone()), Purpose { led, drawn: true, lanes: true })?;
        let on = simulation.model.effects.keys();
        if part != Part::Switches {
            simulation.plan_change(load(&[])?)?.prepare()?;
            tell(&format!("{READY}{}", exactly(&on)));
        }
        for wanted in one_switch_away(&on).filter(|_| part != Part::Scene) {
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
        args.scene.file.display(),
        if part == Part::Switches { "" } else { "the scene and " },
        ready.len(),
        crate::gpu::device::describe(&gpu.info),
        begin.elapsed().as_secs_f64()
    );
    if !apart.is_empty() {
        text += &format!("\n{} switch(es) begin the run anew and were left out", apart.len());
    }
    Ok(text)
}
