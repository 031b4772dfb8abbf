//! The effects that somebody may switch next, made ready before somebody does.
//!
//! A switch needs kernels that no run has used: compiling them takes most of the time to the first frame that has the effect.
//! Hardware drivers compile beside the frames, so a thread prepares one switch after the other. For llvmpipe another process fills the
//! driver's cache ([`super::kernels_on_disk`]) with the time that is left over. What lies there still has to be validated and loaded:
//! that is done while the window waits.

use std::collections::BTreeSet;
use std::path::PathBuf;
use std::thread::JoinHandle;

use super::kernels_on_disk::Helper;
use super::tuning::Tuning;
use crate::effects::one_switch_away;
use crate::simulation::change::Reach;
use crate::simulation::{Purpose, Simulation};

/// What was made ready so far.
#[derive(Default)]
pub struct Foresight {
    /// Sets of effects that were thought through, as overrides: one switch away from some that ran.
    known: BTreeSet<String>,
    job: Option<JoinHandle<()>>,
    helper: Option<Helper>,
    /// Scene and effects that the last helper was started for.
    helped: Option<(PathBuf, Vec<&'static str>)>,
}

impl Foresight {
    /// Goes on with what has not been prepared; call it with every picture. `at_leisure`: the device has time for it.
    pub fn tend(&mut self, tuning: &Tuning, simulation: &Simulation, purpose: Purpose, at_leisure: bool) {
        self.help(tuning, simulation, purpose);
        if !at_leisure || self.helper.is_some() {
            return;
        }
        match self.job.take() {
            Some(job) if !job.is_finished() => self.job = Some(job),
            _ if tuning.is_busy() => {}
            _ => self.job = self.next(tuning, simulation),
        }
    }

    /// Keeps a helper at work for the effects that are on.
    fn help(&mut self, tuning: &Tuning, simulation: &Simulation, purpose: Purpose) {
        if self.helper.as_mut().is_some_and(|helper| !helper.works()) {
            self.helper = None;
        }
        let Some(kernels) = tuning.kernels.as_ref().filter(|_| !tuning.waits()) else { return };
        let on = simulation.model.effects.keys();
        if self.helped.as_ref().is_some_and(|(path, for_those)| *path == tuning.source.path && *for_those == on) {
            return;
        }
        self.helper = kernels
            .ahead(&tuning.source, &simulation.model.scene, purpose)
            .inspect_err(|error| log::debug!("no helper compiles ahead: {error}"))
            .ok();
        self.helped = Some((tuning.source.path.clone(), on));
    }

    /// At most one switch is thought through, so that no picture waits for long.
    fn next(&mut self, tuning: &Tuning, simulation: &Simulation) -> Option<JoinHandle<()>> {
        let on = simulation.model.effects.keys();
        let fresh = one_switch_away(&on)
            .find_map(|effects| self.known.insert(effects.clone()).then(|| tuning.source.with(&[effects])))?;
        // A scene that cannot do without the effect, or not with it, is none that a switch leads to.
        let change = fresh.scene().and_then(|scene| simulation.plan_change(scene)).ok()?;
        (change.reach == Reach::Kernels).then(|| {
            std::thread::spawn(move || {
                if let Err(error) = change.prepare() {
                    log::debug!("effects {:?} were not made ready: {error}", change.scene().effects.keys());
                }
            })
        })
    }
}
