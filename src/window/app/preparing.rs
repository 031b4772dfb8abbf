//! A scene is made ready on a thread of its own: read, meshed, its kernels compiled, its surfaces drawn. The window says so meanwhile.

use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::mpsc::{Receiver, TryRecvError, channel};
use std::time::Instant;

use super::stage::Stage;
use crate::gpu::Gpu;
use crate::scene::Scene;
use crate::training::Watcher;
use crate::training::scene_words;
use crate::window::anatomy_view::{Entry, legend};
use crate::window::help;
use crate::window::practice::{Leader, Practice};
use crate::window::scene_view::SceneView;
use crate::window::settings::Settings;
use crate::window::source::Source;
use crate::words::{say, say_with};
use crate::{Error, Result};

/// What is to be made ready.
pub struct Order {
    pub scene: Wanted,
    pub leader: Leader,
    /// Folder of the attempts, number of the next, and whether results that are there may be replaced.
    pub out: Option<PathBuf>,
    pub attempt: u32,
    pub force: bool,
}

pub enum Wanted {
    /// As it was read before.
    Read(Box<(Source, Scene)>),
    File(PathBuf),
}

/// What a practice screen needs that takes its time.
pub struct Prepared {
    pub practice: Practice,
    pub view: SceneView,
    /// Names and colours of the parts of a scene with labels.
    pub parts: Vec<Entry>,
    /// Has found what is to be avoided.
    pub watcher: Watcher,
}

/// Words for what the thread is at.
const WORK: [&str; 3] = ["preparing-reading", "preparing-tissue", "preparing-view"];

/// A scene that is on its way.
pub struct Preparing {
    /// For people.
    name: String,
    made: Receiver<Result<Prepared>>,
    /// Number of what the thread is at, in [`WORK`].
    at: Arc<AtomicUsize>,
    since: Instant,
}

/// What has come of it.
pub enum Outcome {
    Waiting,
    /// Nobody wants it any more.
    Left,
    Ready(Box<Prepared>),
    Refused(Error),
}

impl Preparing {
    /// Begins. `format`: that of the pictures.
    pub fn begin(gpu: Gpu, format: wgpu::TextureFormat, order: Order) -> Self {
        let name = match &order.scene {
            Wanted::Read(read) => scene_words::title(&read.1.title).to_string(),
            Wanted::File(path) => path.display().to_string(),
        };
        let (sender, made) = channel();
        let at = Arc::new(AtomicUsize::new(0));
        let told = at.clone();
        std::thread::spawn(move || {
            // Nobody waits any more where the window was closed.
            let _ = sender.send(prepare(gpu, format, order, &told));
        });
        Preparing { name, made, at, since: Instant::now() }
    }

    /// A picture that says what is going on; what has come of it.
    ///
    /// # Errors
    /// `Error::Device` of the picture.
    pub fn picture(&mut self, stage: &mut Stage, settings: &mut Settings) -> Result<Outcome> {
        match self.made.try_recv() {
            Ok(Ok(prepared)) => return Ok(Outcome::Ready(Box::new(prepared))),
            Ok(Err(error)) => return Ok(Outcome::Refused(error)),
            Err(TryRecvError::Disconnected) => {
                return Ok(Outcome::Refused(Error::Device("the scene could not be made ready".into())));
            }
            Err(TryRecvError::Empty) => {}
        }
        let work = say(WORK[self.at.load(Ordering::Relaxed).min(WORK.len() - 1)]);
        let seconds = self.since.elapsed().as_secs();
        let mut left = false;
        stage.flat(settings, (&[help::EVERYWHERE], false), |ui, _| {
            ui.add_space((0.35 * ui.available_height()).max(0.0));
            ui.vertical_centered(|ui| {
                ui.heading(say("preparing"));
                ui.label(&self.name);
                ui.label(say_with("preparing-at", &[("work", work.into()), ("seconds", seconds.into())]));
                ui.add_space(12.0);
                left = ui.button(say("preparing-leave")).clicked() || ui.input(|i| i.key_pressed(egui::Key::Escape));
            });
            // The seconds go on by themselves; a spinner would take a software adapter from the work.
            ui.ctx().request_repaint_after_secs(0.2);
        })?;
        Ok(if left { Outcome::Left } else { Outcome::Waiting })
    }
}

fn prepare(gpu: Gpu, format: wgpu::TextureFormat, order: Order, at: &AtomicUsize) -> Result<Prepared> {
    let (source, scene) = match order.scene {
        Wanted::Read(read) => *read,
        Wanted::File(path) => Source::read(path, Vec::new())?,
    };
    at.store(1, Ordering::Relaxed);
    let out = order.out.as_deref().map(|out| Practice::folder_of(out, order.attempt));
    let practice = Practice::new(scene, source, gpu.clone(), order.leader, out.as_deref(), order.force)?;
    let practice = practice.counted_from(order.out, order.attempt);
    at.store(2, Ordering::Relaxed);
    let model = practice.simulation.model.clone();
    let engine = practice.simulation.on_device();
    let engine = engine.ok_or_else(|| Error::Device("the window needs the engine of a device".into()))?;
    let view = SceneView::new(&gpu, engine, &model, format)?;
    let parts = legend(&model);
    let watcher = Watcher::new(practice.scene());
    Ok(Prepared { practice, view, parts, watcher })
}
