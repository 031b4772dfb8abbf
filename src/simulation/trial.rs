//! A cure is tried before it is named: the run again from an image, with a shorter step or another number of the scene.

use super::Simulation;
use super::checkpoint::Checkpoint;
use crate::error::Result;
use crate::needle::Tool;
use crate::scene::Scene;

/// What may cure a run.
#[derive(Debug, Clone, PartialEq)]
pub struct Cure {
    /// In words, and as the line of a scene that has this effect.
    pub name: String,
    pub line: String,
    kind: Kind,
}

#[derive(Debug, Clone, Copy, PartialEq)]
enum Kind {
    HalfStep,
    /// Mass damping [1/s].
    Damping(f64),
    /// Coefficient of friction in the bore of a hollow needle.
    BoreFriction(f64),
}

/// What came of the cures that were tried.
#[derive(Debug, Clone, PartialEq)]
pub struct Trial {
    /// Frame to which they were tried.
    pub last: u64,
    /// Change of the imbalance from the image to there without a cure; `None` where the run is stopped.
    pub without: Option<f64>,
    /// The same for each cure, or why it was stopped as well.
    pub with: Vec<(Cure, std::result::Result<f64, String>)>,
}

impl Trial {
    /// The first cure that held: not stopped, with less than half of the imbalance.
    pub fn best(&self) -> Option<(&Cure, f64)> {
        let without = self.without.unwrap_or(f64::INFINITY);
        self.with.iter().find_map(|(cure, end)| Some((cure, *end.as_ref().ok().filter(|with| **with < 0.5 * without)?)))
    }
}

/// What can be tried on a run of this scene without another mesh, path or set of effects.
fn cures(scene: &Scene, dt: f64) -> Vec<Cure> {
    let line = match scene.solver.time_step {
        Some(_) => format!("solver.time_step_us = {:.4}", 0.5 * dt * 1e6),
        None => format!("solver.safety = {}", crate::units::four_digits(0.5 * scene.solver.safety)),
    };
    let mut cures =
        vec![Cure { name: format!("half the step ({:.3} us)", 0.5 * dt * 1e6), line, kind: Kind::HalfStep }];
    if let Some(Tool::Needle(needle)) = &scene.tool
        && needle.bore.is_some_and(|bore| bore.friction < 0.1)
    {
        let (name, line) = ("friction in the bore".into(), "needle.bore_friction = 0.1".into());
        cures.push(Cure { name, line, kind: Kind::BoreFriction(0.1) });
    }
    let damping = (2.0 * scene.solver.mass_damping).max(20.0);
    let line = format!("solver.mass_damping_per_s = {damping}");
    cures.push(Cure { name: "more damping".into(), line, kind: Kind::Damping(damping) });
    cures
}

impl Simulation {
    /// Goes on from `image` to the end of frame `last`, as it was and with one cure after the other until one holds; the
    /// simulation itself means nothing afterwards.
    ///
    /// # Errors
    /// As [`Simulation::halved`], and `Error::Device`.
    pub fn try_cures(&mut self, image: &Checkpoint, last: u64) -> Result<Trial> {
        self.resume(image)?;
        let without = self.imbalance_gained(last)?.ok();
        let mut trial = Trial { last, without, with: Vec::new() };
        for cure in cures(&self.model.scene, image.clock.dt) {
            let mut scene = self.model.scene.clone();
            let mut clock = image.clock;
            match (cure.kind, &mut scene.tool) {
                (Kind::HalfStep, _) => {
                    clock = clock.halved();
                    scene.solver.time_step = Some(clock.dt);
                }
                (Kind::Damping(damping), _) => scene.solver.mass_damping = damping,
                (Kind::BoreFriction(friction), Some(Tool::Needle(needle))) => {
                    needle.bore.iter_mut().for_each(|bore| bore.friction = friction);
                }
                (Kind::BoreFriction(_), _) => {}
            }
            let end = self.forked(image, scene, clock)?.imbalance_gained(last)?;
            trial.with.push((cure, end));
            if trial.best().is_some() {
                break;
            }
        }
        Ok(trial)
    }

    /// How much of the work so far is missing or too much up to the end of frame `last`, beyond what it was at first; the reason
    /// where the run is stopped before.
    fn imbalance_gained(&mut self, last: u64) -> Result<std::result::Result<f64, String>> {
        let (mut first, mut largest) = (None, 0.0_f64);
        while self.collected <= last {
            match self.next_frame() {
                Ok(Some(record)) => {
                    let now = record.energy.imbalance();
                    let first = *first.get_or_insert(now);
                    largest = largest.max((now - first).abs());
                }
                Ok(None) => break,
                Err(error @ crate::Error::Diverged { .. }) => return Ok(Err(error.to_string())),
                Err(error) => return Err(error),
            }
        }
        Ok(Ok(largest))
    }
}
