//! The effects that somebody may switch next, made ready while nothing else is to be done.
//!
//! A switch needs kernels that no run has used: validating and compiling them takes most of the time to the first frame that has the
//! effect. While a software adapter computes tissue there is no time to spare; while the window waits, before an attempt and in a
//! pause, there is.

use std::collections::BTreeSet;
use std::thread::JoinHandle;

use super::tuning::Tuning;
use crate::effects::{EFFECTS, switched};
use crate::solver::change::Reach;
use crate::solver::simulation::Simulation;

/// What was made ready so far.
#[derive(Default)]
pub struct Foresight {
    /// Sets of effects that were thought through, as overrides: one switch away from some that ran.
    known: BTreeSet<String>,
    job: Option<JoinHandle<()>>,
}

impl Foresight {
    /// Begins with the next of the switches that have not been prepared; call it while the window has time.
    pub fn tend(&mut self, tuning: &Tuning, simulation: &Simulation) {
        match self.job.take() {
            Some(job) if !job.is_finished() => self.job = Some(job),
            _ if tuning.is_busy() => {}
            _ => self.job = self.next(tuning, simulation),
        }
    }

    /// At most one switch is thought through, so that no picture waits for long.
    fn next(&mut self, tuning: &Tuning, simulation: &Simulation) -> Option<JoinHandle<()>> {
        let on = simulation.model.effects.keys();
        let fresh = EFFECTS.iter().find_map(|effect| {
            let effects = switched(&on, effect.key, !on.contains(&effect.key));
            self.known.insert(effects.clone()).then(|| tuning.source.with(&[effects]))
        })?;
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
