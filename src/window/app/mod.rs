//! The window itself: events in, pictures out, one device for tissue and drawing.

mod canvas;
mod opening;
mod outcome;
mod pace;
mod pointer;
mod reference;
mod renewal;
mod scale;

use std::sync::Arc;
use std::time::Instant;

use winit::application::ApplicationHandler;
use winit::event::{ElementState, WindowEvent};
use winit::event_loop::{ActiveEventLoop, ControlFlow, EventLoop};
use winit::keyboard::{KeyCode, PhysicalKey};
use winit::window::{Window, WindowId};

use self::canvas::canvas;
use self::opening::no_display;
pub use self::outcome::ViewOutcome;
use self::reference::{read_curve, read_score};
use super::PACES;
use super::camera::Camera;
use super::devices::Devices;
use super::foresight::Foresight;
use super::grip::Grip;
use super::hand::{Desk, Key, Recording};
use super::lost_display::OpenWindow;
use super::panels::{Choices, ReferenceCurve};
use super::practice::{Practice, Renewed, State};
use super::scan::Scan;
use super::scene_view::SceneView;
use super::source::Source;
use super::watch::Watch;
use crate::commands::replay::session_file;
use crate::commands::view::ViewArgs;
use crate::ending;
use crate::gpu::Gpu;
use crate::gpu::compose::read_sources;
use crate::scene::Scene;
use crate::session::Session;
use crate::simulation::change::Reach;
use crate::training::history::{History, progress};
use crate::training::score::Score;
use crate::{Error, Result};

/// What the progress of a trainee is shown of.
const PROGRESS_KEY: &str = "peak_axial_force";

/// Opens the window and returns when it is closed.
///
/// # Errors
/// Those of the scene come first. `Error::Input` where there is no display, `Error::Adapter` where no adapter can draw on it.
pub fn view(options: &ViewArgs, program_start: Instant) -> Result<ViewOutcome> {
    if !PACES.contains(&options.pace) {
        let way_out = format!("write a number from {} to {}", PACES.start(), PACES.end());
        return Err(Error::input(
            format!("--speed-factor {} is not a speed that the window can aim at", options.pace),
            way_out,
        ));
    }
    let (source, scene, recorded) = match &options.session {
        None => {
            let (source, scene) = Source::read(options.scene.file.clone(), options.scene.overrides.clone())?;
            (source, scene, None)
        }
        Some(path) => {
            let session = Session::read(&session_file(path))?;
            session.scene()?;
            let (source, scene) = Source::read(session.scene.clone(), session.overrides.clone())?;
            (source, scene, Some(session))
        }
    };
    if let Some(folder) = &options.shaders {
        read_sources(folder)?;
    }
    for notice in &scene.notices {
        eprintln!("note: {notice}");
    }
    let reference = options.reference.as_deref().map(read_curve).transpose()?;
    // Libraries of the display that are missing end in an error or, some of them, in a panic.
    let opened = std::panic::catch_unwind(EventLoop::new);
    let event_loop = match opened {
        Ok(Ok(event_loop)) => event_loop,
        Ok(Err(reason)) => return Err(no_display(&reason.to_string())),
        Err(_) => return Err(no_display("a library of the window system is missing")),
    };
    let mut app = App {
        options: options.clone(),
        scene,
        source,
        recorded,
        reference: reference.into_iter().collect(),
        reference_score: options.reference.as_deref().and_then(read_score).transpose()?,
        program_start,
        open: None,
        outcome: ViewOutcome::default(),
        failure: None,
    };
    event_loop.run_app(&mut app).map_err(|reason| no_display(&reason.to_string()))?;
    match app.failure {
        Some(error) => Err(error),
        None => Ok(app.outcome),
    }
}

struct App {
    options: ViewArgs,
    scene: Scene,
    source: Source,
    recorded: Option<Session>,
    reference: Vec<ReferenceCurve>,
    reference_score: Option<Score>,
    program_start: Instant,
    open: Option<Open>,
    outcome: ViewOutcome,
    failure: Option<Error>,
}

/// An open window.
struct Open {
    alive: OpenWindow,
    window: Arc<Window>,
    surface: wgpu::Surface<'static>,
    config: wgpu::SurfaceConfiguration,
    gpu: Gpu,
    egui: egui_winit::State,
    painter: egui_wgpu::Renderer,
    view: SceneView,
    scan: Scan,
    practice: Practice,
    foresight: Foresight,
    desk: Desk,
    devices: Devices,
    recording: Option<Recording>,
    recorded: Option<Session>,
    choices: Choices,
    camera: Camera,
    /// The next frame of the tissue is under way already.
    ahead: bool,
    /// Simulated time that is due [s], and when it was counted last.
    due: f64,
    counted: Instant,
    next: Instant,
    /// When the last picture was begun.
    shown: Instant,
    pictures: u64,
    /// What the window shows. It stays from picture to picture: a software adapter draws the panels on some of them only.
    canvas: wgpu::Texture,
    /// Where the tissue is drawn [points], and pixels per point, since the panels were drawn last.
    area: egui::Rect,
    scale: f32,
    /// When the last picture was shown, and the longest time between two of them [s].
    presented: Option<Instant>,
    longest_pause: f64,
    /// When the range of the field was looked at last.
    ranged: Option<Instant>,
    /// When the panels were drawn last, and how often.
    panelled: Option<Instant>,
    panel_count: u64,
    /// The panels are drawn on the next picture.
    stale: bool,
    /// Scene and shaders, to be read anew when they change.
    scene_file: Watch,
    shader_files: Watch,
    /// Ctrl is held.
    control: bool,
    /// What the drag under way does.
    grip: Grip,
    /// What the attempt was worth, with those before it, while that is shown.
    debriefing: Option<Debriefing>,
}

/// A finished attempt.
struct Debriefing {
    score: Score,
    /// The trainee's attempts at this task: number, time, value of what the progress is shown of.
    before: Vec<(u32, u64, f64)>,
}

impl ApplicationHandler for App {
    fn resumed(&mut self, event_loop: &ActiveEventLoop) {
        if self.open.is_some() {
            return;
        }
        match self.open_window(event_loop) {
            Ok(open) => {
                // From here on there is something to keep.
                ending::begin();
                open.window.request_redraw();
                self.open = Some(open);
            }
            Err(error) => self.fail(event_loop, error),
        }
    }

    fn window_event(&mut self, event_loop: &ActiveEventLoop, _: WindowId, event: WindowEvent) {
        let Some(open) = &mut self.open else { return };
        // A key that is held comes again 25 times a second; every event of the panels has them drawn, which takes longer than tissue and
        // view together. Only where somebody writes does it mean anything.
        let repeats = matches!(&event, WindowEvent::KeyboardInput { event, .. } if event.repeat);
        if repeats && !open.egui.egui_ctx().egui_wants_keyboard_input() {
            return;
        }
        let taken = open.egui.on_window_event(&open.window, &event).consumed;
        match event {
            WindowEvent::CloseRequested => self.close(event_loop),
            // A minimised window has no size; its surface stays as it was.
            WindowEvent::Resized(size) if size.width > 0 && size.height > 0 => {
                (open.config.width, open.config.height) = (size.width, size.height);
                open.surface.configure(&open.gpu.device, &open.config);
                open.canvas = canvas(&open.gpu, &open.config);
                open.stale = true;
            }
            WindowEvent::Focused(false) => open.desk.let_go(),
            WindowEvent::ModifiersChanged(modifiers) => {
                open.control = modifiers.state().control_key();
                open.desk.shifting(open.control);
            }
            WindowEvent::KeyboardInput { event, .. } if event.physical_key == KeyCode::KeyQ && open.control => {
                self.close(event_loop);
            }
            WindowEvent::KeyboardInput { event, .. } if !taken => {
                open.key(event.physical_key, event.state, event.repeat)
            }
            WindowEvent::RedrawRequested => {
                if let Err(error) = self.picture() {
                    self.fail(event_loop, error);
                    return;
                }
                let done = self.options.frames.is_some_and(|n| self.open.as_ref().is_some_and(|o| o.pictures >= n));
                if done {
                    self.close(event_loop);
                }
            }
            _ => {}
        }
    }

    fn about_to_wait(&mut self, event_loop: &ActiveEventLoop) {
        if ending::is_asked() {
            self.close(event_loop);
            return;
        }
        let Some(open) = &self.open else { return };
        if Instant::now() >= open.next {
            open.window.request_redraw();
        }
        event_loop.set_control_flow(ControlFlow::WaitUntil(open.next));
    }
}

impl App {
    /// One picture, and the frame of the tissue that is due.
    fn picture(&mut self) -> Result<()> {
        let Some(open) = &mut self.open else { return Ok(()) };
        let wishes = open.picture(&self.reference)?;
        open.practice.show_band(open.choices.error_bar);
        if open.pictures == 1 {
            self.outcome.first_picture = self.program_start.elapsed().as_secs_f64();
        }
        if wishes.debrief {
            open.practice.state = match &open.practice.state {
                State::Running => State::Paused,
                other => other.clone(),
            };
            let score = open.practice.debrief(self.reference_score.as_ref())?;
            println!("{}", score.text());
            let mut before = Vec::new();
            if let (Some(trainee), Some(task)) = (&self.options.trainee, &score.task) {
                let history = History::new(&self.options.history);
                // A history that takes nothing costs neither the scores nor the attempt.
                match history.add(trainee, &score).and_then(|_| history.attempts(trainee)) {
                    Ok(found) => {
                        for broken in &found.broken {
                            eprintln!("note: {broken}");
                        }
                        before = progress(&found.attempts, task, PROGRESS_KEY);
                    }
                    Err(error) => open.practice.hold_back(error),
                }
            }
            open.debriefing = Some(Debriefing { score, before });
            open.stale = true;
        }
        if wishes.write_again {
            // What is still wrong stands in the panel.
            let _ = open.practice.write_again();
        }
        if let Some(time) = wishes.go_back {
            open.practice.go_back(time)?;
        }
        if let Some(leader) = wishes.restart {
            open.debriefing = None;
            open.practice.again(leader)?;
            open.rebind()?;
        }
        // Hardware leaves the processor alone; a software adapter needs it for the tissue.
        let at_leisure = !open.gpu.is_software() || open.practice.state != State::Running;
        let practice = &open.practice;
        open.foresight.tend(&practice.tuning, &practice.simulation, practice.purpose(), at_leisure);
        open.read_anew(self.options.shaders.as_deref());
        if open.practice.tuning.waits() {
            open.settle()?;
        }
        match open.practice.take_changes()? {
            Renewed::Nothing | Renewed::Constants => {}
            Renewed::Buffers => open.take_buffers()?,
            Renewed::Attempt => {
                open.debriefing = None;
                open.rebind()?;
            }
        }
        Ok(())
    }

    fn close(&mut self, event_loop: &ActiveEventLoop) {
        if let Some(mut open) = self.open.take() {
            if let Err(error) = open.settle() {
                self.failure.get_or_insert(error);
            }
            if let Some(path) = &self.options.screenshot
                && let Err(error) = open.screenshot(&self.reference, path)
            {
                self.failure.get_or_insert(error);
            }
            match open.devices.finish() {
                Ok(timing) => self.outcome.haptic = timing,
                Err(error) => _ = self.failure.get_or_insert(error),
            }
            if open.practice.unwritten.is_some()
                && let Err(error) = open.practice.write_again()
            {
                if let Some(place) = open.practice.rescue() {
                    eprintln!(
                        "note: the session was kept in {}; stylet replay computes its tables again",
                        place.display()
                    );
                }
                self.failure.get_or_insert(error);
            } else if let Err(error) = open.practice.save() {
                self.failure.get_or_insert(error);
            }
            let last = open.practice.records.last();
            self.outcome.pictures = open.pictures;
            self.outcome.frames = open.practice.records.len() as u64;
            self.outcome.depth = last.map_or(0.0, |r| r.depth);
            self.outcome.force = last.map_or(0.0, |r| r.force.axial);
            self.outcome.longest_pause = open.longest_pause;
            self.outcome.frames_per_second = open.pictures.saturating_sub(1) as f64
                / (self.program_start.elapsed().as_secs_f64() - self.outcome.first_picture).max(f64::MIN_POSITIVE);
            self.outcome.real_time_factor = open.practice.timing.real_time_factor();
            self.outcome.achieved = open.practice.timing.achieved();
            self.outcome.latency = open.practice.latency;
            let switches = open.practice.tuning.paces.into_iter().filter(|pace| pace.reach == Reach::Kernels);
            self.outcome.switches = switches.collect();
            self.outcome.stopped = match &open.practice.state {
                State::Stopped(reason) => Some(reason.clone()),
                _ => None,
            };
        }
        event_loop.exit();
    }

    fn fail(&mut self, event_loop: &ActiveEventLoop, error: Error) {
        self.failure.get_or_insert(error);
        self.close(event_loop);
    }
}

impl Open {
    fn key(&mut self, key: PhysicalKey, state: ElementState, repeat: bool) {
        let held = state == ElementState::Pressed;
        match key {
            PhysicalKey::Code(KeyCode::ArrowDown | KeyCode::KeyS) => self.desk.hold(Key::Advance, held),
            PhysicalKey::Code(KeyCode::ArrowUp | KeyCode::KeyW) => self.desk.hold(Key::Withdraw, held),
            PhysicalKey::Code(KeyCode::ArrowLeft | KeyCode::KeyA) => self.desk.hold(Key::Left, held),
            PhysicalKey::Code(KeyCode::ArrowRight | KeyCode::KeyD) => self.desk.hold(Key::Right, held),
            PhysicalKey::Code(KeyCode::PageUp | KeyCode::KeyR) => self.desk.hold(Key::Away, held),
            PhysicalKey::Code(KeyCode::PageDown | KeyCode::KeyF) => self.desk.hold(Key::Towards, held),
            PhysicalKey::Code(KeyCode::Space) if held && !repeat => {
                self.practice.state = match &self.practice.state {
                    State::Running => State::Paused,
                    State::Paused => State::Running,
                    other => other.clone(),
                };
            }
            _ => {}
        }
    }
}
