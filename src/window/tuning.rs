//! Changes of the scene while an attempt goes on: what is wanted, what is being made ready, what came of it.
//!
//! Numbers are in the next frame. Other effects, another mesh or another file are made ready on a thread of their own, while the old
//! tissue goes on.

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::mpsc::{Receiver, TryRecvError, channel};
use std::time::{Duration, Instant};

use super::kernels_on_disk::KernelsOnDisk;
use super::source::Source;
use crate::gpu::Gpu;
use crate::scene::Scene;
use crate::simulation::change::{Change, Reach};
use crate::simulation::{Purpose, RunEngine, Simulation};
use crate::{Error, Result};

/// What is asked for.
#[derive(Debug, Clone, PartialEq)]
struct Wanted {
    source: Source,
    /// At least this, even where nothing seems to have changed.
    least: Reach,
}

/// What a thread makes ready.
enum Made {
    Engine(RunEngine),
    Simulation(Box<Simulation>),
}

struct Job {
    source: Source,
    change: Arc<Change>,
    made: Receiver<Result<Made>>,
    since: Instant,
}

/// What has taken the place of what was there.
pub enum Taken {
    Nothing,
    /// The buffers are the same.
    Constants,
    /// The buffers are new.
    Engine,
    /// A simulation at its beginning.
    Simulation(Source, Box<Simulation>),
}

/// How the last change went: for people who watch frames.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Pace {
    pub reach: Reach,
    /// From the wish to the results of the frame that has it.
    pub whole: Duration,
    /// From the last frame before to the results of that frame: the work of the change, first use of its kernels, the frame.
    pub halted: Duration,
}

/// The changes of one window.
pub struct Tuning {
    /// What runs.
    pub source: Source,
    /// Overrides that the window was opened with.
    first: Vec<String>,
    /// Where the scene was saved last.
    pub saved: Option<PathBuf>,
    wanted: Option<(Wanted, Instant)>,
    job: Option<Job>,
    /// Why the last wish could not be granted.
    pub refusal: Option<String>,
    /// Where another process compiles what the driver keeps on disk.
    pub kernels: Option<KernelsOnDisk>,
    /// How the changes of this window went, the last one at the end.
    pub paces: Vec<Pace>,
}

impl Tuning {
    pub fn new(source: Source) -> Self {
        Tuning {
            first: source.overrides.clone(),
            saved: None,
            source,
            wanted: None,
            job: None,
            refusal: None,
            kernels: None,
            paces: Vec::new(),
        }
    }

    /// Overrides as they will be when everything wanted has come.
    pub fn coming(&self) -> &Source {
        match (&self.wanted, &self.job) {
            (Some((wanted, _)), _) => &wanted.source,
            (None, Some(job)) => &job.source,
            (None, None) => &self.source,
        }
    }

    /// True while something is being made ready.
    pub fn is_busy(&self) -> bool {
        self.job.is_some()
    }

    /// Asks for more overrides.
    pub fn wish(&mut self, more: &[String]) {
        self.wish_for(self.coming().with(more), Reach::Constants);
    }

    /// Overrides that the window was opened with.
    pub fn opened_with(&self) -> Vec<String> {
        self.first.clone()
    }

    pub fn set_opened_with(&mut self, overrides: Vec<String>) {
        self.first = overrides;
    }

    /// True where something was changed since the window was opened.
    pub fn is_changed(&self) -> bool {
        self.coming().overrides != self.first
    }

    /// Asks for what the window was opened with.
    pub fn go_back(&mut self) {
        self.wish_for(Source { overrides: self.first.clone(), ..self.coming().clone() }, Reach::Constants);
    }

    /// Writes the scene that runs into a file of its own; a file that is there already is not touched.
    pub fn save(&mut self, path: &Path) {
        match self.try_save(path) {
            Ok(()) => (self.saved, self.refusal) = (Some(path.to_path_buf()), None),
            Err(error) => self.refusal = Some(error.to_string()),
        }
    }

    fn try_save(&self, path: &Path) -> Result<()> {
        if path.exists() {
            return Err(Error::input(format!("{} is there already", path.display()), "give another name"));
        }
        let text = crate::scene::edit::written(&self.source.text, &self.source.overrides)?;
        // Files that it names start from its folder: what cannot be read there is not written.
        Scene::parse(path, &text, &[])?;
        crate::whole_file::write(path, text.as_bytes())
    }

    /// Asks for another scene text, or for what is there to be made anew.
    pub fn wish_for(&mut self, source: Source, least: Reach) {
        let since = self.wanted.take().map_or_else(Instant::now, |(_, since)| since);
        self.wanted = Some((Wanted { source, least }, since));
    }

    /// True while a change is wished for or being made.
    pub fn waits(&self) -> bool {
        self.job.is_some() || self.wanted.is_some()
    }

    /// Takes what is ready; call it between frames.
    ///
    /// # Errors
    /// What befalls the running engine. A wish that cannot be granted is a refusal.
    pub fn take(&mut self, simulation: &mut Simulation, gpu: &Gpu, purpose: Purpose) -> Result<Taken> {
        if let Some(job) = &self.job {
            match job.made.try_recv() {
                Err(TryRecvError::Empty) => return Ok(Taken::Nothing),
                Err(TryRecvError::Disconnected) => self.refuse(Error::Device("the change could not be made".into())),
                Ok(Err(error)) => self.refuse(error),
                Ok(Ok(made)) => return self.arrived(made, simulation),
            }
        }
        let Some((wanted, since)) = self.wanted.take() else { return Ok(Taken::Nothing) };
        let begin = Instant::now();
        let scene = match wanted.source.scene() {
            Ok(scene) => scene,
            Err(error) => {
                self.refuse(error);
                return Ok(Taken::Nothing);
            }
        };
        let change = match simulation.plan_change(scene.clone()) {
            Ok(change) => change,
            Err(error) => {
                self.refuse(error);
                return Ok(Taken::Nothing);
            }
        };
        let reach = match (wanted.least, change.reach) {
            (Reach::Start, _) | (_, Reach::Start) => Reach::Start,
            (Reach::Kernels, _) | (_, Reach::Kernels) => Reach::Kernels,
            _ => Reach::Constants,
        };
        if reach == Reach::Constants && simulation.retune(&change)? {
            self.refusal = None;
            self.source = wanted.source;
            self.paces.push(Pace { reach, whole: since.elapsed(), halted: begin.elapsed() });
            return Ok(Taken::Constants);
        }
        let (sender, made) = channel();
        let change = Arc::new(change);
        let (shared, gpu) = (change.clone(), gpu.clone());
        let (kernels, source) = (self.kernels.clone(), wanted.source.clone());
        std::thread::spawn(move || {
            let result = match reach {
                Reach::Start => {
                    Simulation::for_purpose(scene, Some(gpu), purpose).map(|s| Made::Simulation(Box::new(s)))
                }
                _ => {
                    if let Some(kernels) = kernels {
                        kernels.wait_for(&source, shared.scene(), purpose);
                    }
                    shared.engine().map(Made::Engine)
                }
            };
            // Nobody waits any more where the window was closed.
            let _ = sender.send(result);
        });
        self.job = Some(Job { source: wanted.source, change, made, since });
        Ok(Taken::Nothing)
    }

    fn arrived(&mut self, made: Made, simulation: &mut Simulation) -> Result<Taken> {
        let Some(job) = self.job.take() else { return Ok(Taken::Nothing) };
        let begin = Instant::now();
        self.refusal = None;
        let (taken, reach) = match made {
            Made::Engine(engine) => {
                simulation.adopt(&job.change, engine)?;
                self.source = job.source;
                (Taken::Engine, Reach::Kernels)
            }
            Made::Simulation(next) => (Taken::Simulation(job.source, next), Reach::Start),
        };
        self.paces.push(Pace { reach, whole: job.since.elapsed(), halted: begin.elapsed() });
        Ok(taken)
    }

    fn refuse(&mut self, error: Error) {
        self.job = None;
        self.refusal = Some(error.to_string());
    }
}
