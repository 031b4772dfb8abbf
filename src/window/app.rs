//! The window itself: events in, pictures out, one device for tissue and drawing.

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::{Duration, Instant};

use egui_wgpu::{RendererOptions, ScreenDescriptor};
use glam::{DVec3, Vec2};
use winit::application::ApplicationHandler;
use winit::event::{ElementState, WindowEvent};
use winit::event_loop::{ActiveEventLoop, ControlFlow, EventLoop};
use winit::keyboard::{KeyCode, PhysicalKey};
use winit::window::{Window, WindowId};

use super::camera::Camera;
use super::devices::Devices;
use super::foresight::Foresight;
use super::grip::{Grip, Modifiers, Sight};
use super::hand::{Desk, InputDevice, Key, Recording};
use super::kernels_on_disk::KernelsOnDisk;
use super::lost_display::OpenWindow;
use super::marks;
use super::panels::{self, Choices, ReferenceCurve, Wishes};
use super::practice::{Latency, Leader, Practice, Renewed, State};
use super::scan::{self, Scan};
use super::scene_view::{Area, SceneView};
use super::section::RestPlane;
use super::source::Source;
use super::texts;
use super::tool_shape::{self, ToolPlace};
use super::tuning::Pace;
use super::watch::Watch;
use super::{PACES, ViewOptions};
use crate::ending;
use crate::gpu::compose::{SOURCES, read_sources};
use crate::gpu::{Gpu, Memory};
use crate::haptic::LoopTiming;
use crate::observables::field::{Lane, Range};
use crate::reading;
use crate::scene::Scene;
use crate::session::Session;
use crate::simulation::change::Reach;
use crate::training::history::{History, progress};
use crate::training::score::Score;
use crate::{Error, Result};

/// Shortest time between two pictures [s].
const PICTURE: f64 = 1.0 / 60.0;
/// Longest time between two pictures while the tissue lags behind [s].
const SLOWEST_PICTURE: f64 = 1.0 / 21.0;
/// Longest simulated time that is made up for [s].
const DEBT: f64 = 0.2;
/// Way that a notch of the wheel asks for [m].
const NOTCH: f64 = 0.25e-3;
/// Size of the window at the start, in points.
const SIZE: [u32; 2] = [1280, 800];
/// Pictures after which pauses are counted.
const WARM_UP: u64 = 5;
/// Time between two looks at the range of the field [s].
const LOOK_AT_RANGE: f64 = 0.4;
/// What the progress of a trainee is shown of.
const PROGRESS_KEY: &str = "peak_axial_force";
/// Time between two drawings of the panels on a software adapter that has better things to do [s].
const PANELS_EVERY: f64 = 0.35;
/// Drawings of the panels of which one shows all of them, the others what lies beside the view on the right.
const WHOLE_EVERY: u64 = 4;
/// Part of the nodes that may lie beyond the automatic scale.
const BEYOND_SCALE: f64 = 0.002;

/// What a session may come to: how many pictures were drawn, how fast, and how the run stands.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct ViewOutcome {
    pub pictures: u64,
    /// Wall time from the start of the program to the first picture [s].
    pub first_picture: f64,
    pub frames: u64,
    pub depth: f64,
    pub force: f64,
    /// Pictures a second, mean from the first to the last one.
    pub frames_per_second: f64,
    /// Longest time between two pictures [s].
    pub longest_pause: f64,
    /// Simulated over wall time while the run was on, the window with its pictures included; at most the pace.
    pub achieved: f64,
    /// The same of the frames alone, from their start to their results.
    pub real_time_factor: f64,
    pub latency: Latency,
    /// How switches of effects went.
    pub switches: Vec<Pace>,
    /// How the loop of the forces kept its time, where there was one.
    pub haptic: Option<LoopTiming>,
    pub stopped: Option<String>,
}

/// Opens the window and returns when it is closed.
///
/// # Errors
/// Those of the scene come first. `Error::Input` where there is no display, `Error::Adapter` where no adapter can draw on it.
pub fn view(options: &ViewOptions, program_start: Instant) -> Result<ViewOutcome> {
    if !PACES.contains(&options.pace) {
        let way_out = format!("write a number from {} to {}", PACES.start(), PACES.end());
        return Err(Error::input(
            format!("--speed-factor {} is not a speed that the window can aim at", options.pace),
            way_out,
        ));
    }
    let (source, scene, recorded) = match &options.session {
        None => {
            let (source, scene) = Source::read(options.scene.clone(), options.overrides.clone())?;
            (source, scene, None)
        }
        Some(path) => {
            let session = Session::read(path)?;
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

/// The reason of a library without the place in its source, which helps nobody who wants a window: `os error at FILE.rs:LINE: REASON`.
fn without_place(reason: &str) -> &str {
    reason.split_once(".rs:").and_then(|(_, rest)| rest.split_once(": ")).map_or(reason, |(_, reason)| reason)
}

/// There is a display, and nothing that can draw on it.
fn no_driver(reason: &str) -> Error {
    Error::input(
        format!("no graphics driver can draw on this display: {}", reason.trim_end_matches(": {}")),
        "install a Vulkan driver (Debian/Ubuntu: mesa-vulkan-drivers, which draws without a graphics card too), look at `stylet \
         adapters`, or use `stylet run`, which needs no picture and computes on the processor where there is no adapter",
    )
}

fn no_display(reason: &str) -> Error {
    Error::input(
        format!("no window can be opened here: {}", without_place(reason)),
        "start it on a desktop; on a terminal alone use `stylet run` (pictures, charts and tables in a folder) or a virtual \
         display: xvfb-run stylet view. Debian/Ubuntu: libx11-6 libxcursor1 libxi6 libxrandr2 libxkbcommon-x11-0",
    )
}

/// The scores of an attempt, where its folder holds some.
fn read_score(folder: &Path) -> Option<Result<Score>> {
    let path = folder.join("score.json");
    let text = reading::text(&path, reading::most::OWN).ok()?;
    let wrong = |e: serde_json::Error| {
        Error::input(
            format!("{}: no scores: {e}", path.display()),
            "give the folder of an attempt, or take the file away",
        )
    };
    Some(serde_json::from_str(&text).map_err(wrong))
}

/// The force curve of a run.
fn read_curve(folder: &Path) -> Result<ReferenceCurve> {
    let path = if folder.is_dir() { folder.join("force.csv") } else { folder.to_path_buf() };
    let bytes = reading::bytes(&path, reading::most::TABLE).map_err(|e| e.of(&path, "give the folder of a run"))?;
    let mut reader = csv::Reader::from_reader(bytes.as_slice());
    let wrong = |reason: String| Error::input(format!("{}: {reason}", path.display()), "give the folder of a run");
    let headers = reader.headers().map_err(|e| wrong(e.to_string()))?.clone();
    let column = |name: &str| headers.iter().position(|h| h == name).ok_or_else(|| wrong(format!("no column {name}")));
    let (depth, force) = (column("depth_m")?, column("axial_force_n")?);
    let mut points = Vec::new();
    for row in reader.records() {
        let row = row.map_err(|e| wrong(e.to_string()))?;
        let number = |n: usize| row.get(n).and_then(|text| text.parse::<f64>().ok());
        match (number(depth), number(force)) {
            (Some(depth), Some(force)) => points.push([depth * 1e3, force]),
            _ => return Err(wrong(format!("row {} holds no numbers", points.len() + 1))),
        }
    }
    let name = path.parent().and_then(Path::file_name).map_or("reference".into(), |n| n.to_string_lossy().into_owned());
    Ok(ReferenceCurve { name, points })
}

struct App {
    options: ViewOptions,
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

/// The panels as triangles.
struct Panels {
    triangles: Vec<egui::ClippedPrimitive>,
    textures: egui::TexturesDelta,
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
    fn open_window(&mut self, event_loop: &ActiveEventLoop) -> Result<Open> {
        let refused = |reason: String| no_display(&reason);
        let [width, height] = self.options.size.unwrap_or(SIZE);
        let attributes = Window::default_attributes()
            .with_title(format!("{} - {}", texts::TITLE, self.scene.title))
            .with_inner_size(winit::dpi::LogicalSize::new(width, height));
        let window = Arc::new(event_loop.create_window(attributes).map_err(|e| refused(e.to_string()))?);
        let display = Box::new(event_loop.owned_display_handle());
        let instance = wgpu::Instance::new(wgpu::InstanceDescriptor::new_with_display_handle_from_env(display));
        let surface = instance.create_surface(window.clone()).map_err(|e| no_driver(&e.to_string()))?;
        let (gpu, adapter) = Gpu::for_surface(&instance, &surface)?;
        let leader = if self.options.script { Leader::Script } else { Leader::Hand };
        let practice = Practice::new(
            self.scene.clone(),
            self.source.clone(),
            gpu.clone(),
            leader,
            self.options.out.as_deref(),
            self.options.force,
        )?;
        let size = window.inner_size();
        let mut config = surface
            .get_default_config(&adapter, size.width.max(1), size.height.max(1))
            .ok_or_else(|| refused("the adapter cannot draw into this window".into()))?;
        // The panels blend bytes, not light.
        let formats = surface.get_capabilities(&adapter).formats;
        config.format = formats.into_iter().find(|f| !f.is_srgb()).unwrap_or(config.format);
        config.present_mode = wgpu::PresentMode::AutoNoVsync;
        config.usage = wgpu::TextureUsages::COPY_DST;
        surface.configure(&gpu.device, &config);
        let canvas = canvas(&gpu, &config);
        let context = egui::Context::default();
        let largest = gpu.device.limits().max_texture_dimension_2d as usize;
        let egui = egui_winit::State::new(
            context,
            egui::ViewportId::ROOT,
            &window,
            Some(window.scale_factor() as f32),
            None,
            Some(largest),
        );
        let painter = egui_wgpu::Renderer::new(
            &gpu.device,
            config.format,
            RendererOptions { dithering: false, ..Default::default() },
        );
        let mut practice = practice;
        let model = practice.simulation.model.clone();
        let engine = practice.simulation.on_device();
        let engine = engine.ok_or_else(|| Error::Device("the window needs the engine of a device".into()))?;
        let view = SceneView::new(&gpu, engine, &model, config.format)?;
        let (low, high) = model.mesh.bounds();
        let centre = 0.5 * (low + high);
        let camera = Camera::around(centre.as_vec3(), (0.62 * (high - low).length()) as f32);
        // Open through the entry point, so that the needle is seen.
        let at = (self.scene.motion.entry.y - low.y) / (high.y - low.y);
        // That of the script, which mass scaling is chosen for; a slider has others.
        let desk = Desk::new(self.scene.motion.largest_speed().min(practice.speed_limit));
        if self.options.script || self.recorded.is_some() || self.options.frames.is_some() {
            practice.state = State::Running;
        }
        // Only Mesa is known to keep the kernels of a software adapter on disk. Another process has the shaders of this program.
        if gpu.is_software() && cfg!(target_os = "linux") && self.options.shaders.is_none() {
            practice.tuning.kernels = Some(KernelsOnDisk::default());
        }
        let devices = Devices::open(&self.options, desk.speed)?;
        let now = Instant::now();
        let mut open = Open {
            alive: OpenWindow::with(practice.folder()),
            window,
            surface,
            config,
            gpu,
            egui,
            painter,
            view,
            scan: Scan::default(),
            practice,
            foresight: Foresight::default(),
            desk,
            devices,
            recording: self.recorded.as_ref().map(|session| Recording::new(session.poses.clone())),
            recorded: self.recorded.clone(),
            choices: Choices::new(Some((1, at)), self.options.pace),
            camera,
            ahead: false,
            due: 0.0,
            counted: now,
            next: now,
            shown: now,
            pictures: 0,
            canvas,
            area: egui::Rect::NOTHING,
            scale: 1.0,
            presented: None,
            longest_pause: 0.0,
            ranged: None,
            panelled: None,
            panel_count: 0,
            stale: true,
            scene_file: Watch::new([self.source.path.clone()]),
            shader_files: Watch::new(self.options.shaders.iter().flat_map(|folder| shader_files(folder))),
            control: false,
            grip: Grip::Camera,
            debriefing: None,
        };
        open.choices.look.probe.on = self.options.ultrasound;
        open.cut();
        Ok(open)
    }

    /// One picture, and the frame of the tissue that is due.
    fn picture(&mut self) -> Result<()> {
        let Some(open) = &mut self.open else { return Ok(()) };
        let wishes = open.picture(&self.reference)?;
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

    /// Cuts the tissue, and sees through layers, as the choices say.
    fn cut(&mut self) {
        let model = &self.practice.simulation.model;
        let (low, high) = model.mesh.bounds();
        let plane = self.choices.cut.map(|(axis, at)| {
            // The half towards the viewer is taken away: -x, -y, +z.
            let along = low[axis] + at * (high[axis] - low[axis]);
            let sign = if axis == 2 { 1.0 } else { -1.0 };
            RestPlane { normal: DVec3::AXES[axis] * sign, offset: sign * along }
        });
        self.view.cut(&self.gpu, model, plane, self.choices.look.through);
    }

    /// After a restart: the buffers are new.
    fn rebind(&mut self) -> Result<()> {
        let model = self.practice.simulation.model.clone();
        if let Some(engine) = self.practice.simulation.on_device()
            && !self.view.take_model(&self.gpu, engine, &model)?
        {
            self.view = SceneView::new(&self.gpu, engine, &model, self.config.format)?;
        }
        self.scan.close(&mut self.painter);
        self.cut();
        self.alive.writes_to(self.practice.folder());
        self.due = 0.0;
        Ok(())
    }

    /// Asks for what somebody has written into the files meanwhile.
    fn read_anew(&mut self, shaders: Option<&Path>) {
        let tuning = &mut self.practice.tuning;
        if self.recorded.is_none() && self.scene_file.has_changed() {
            match reading::text(&tuning.source.path, reading::most::SCENE) {
                Ok(text) => tuning.wish_for(Source { text, ..tuning.coming().clone() }, Reach::Start),
                Err(error) => tuning.refusal = Some(error.of(&tuning.source.path, "save the file again").to_string()),
            }
        }
        if let Some(folder) = shaders
            && self.shader_files.has_changed()
        {
            match read_sources(folder) {
                Ok(()) => tuning.wish_for(tuning.coming().clone(), Reach::Kernels),
                Err(error) => tuning.refusal = Some(error.to_string()),
            }
        }
    }

    /// After a change of effects: the engine is new, the mesh and all that is drawn of it the same.
    fn take_buffers(&mut self) -> Result<()> {
        self.scan.close(&mut self.painter);
        match self.practice.simulation.on_device() {
            Some(engine) => self.view.take_buffers(&self.gpu, engine),
            None => Ok(()),
        }
    }

    /// True where a frame of the tissue is due. Time that a picture took is made up for; a slow machine shows slow motion and owes
    /// nothing beyond that.
    fn frame_is_due(&mut self) -> bool {
        let passed = self.counted.elapsed().as_secs_f64();
        self.counted = Instant::now();
        if self.practice.state != State::Running {
            self.due = 0.0;
            // An input that nothing answers is no latency.
            let _ = self.desk.fresh_input();
            return false;
        }
        self.practice.timing.running += passed;
        let frame = self.practice.timing.simulated;
        self.due = (self.due + passed * self.choices.pace).min(DEBT.max(2.0 * frame));
        let due = self.due >= frame;
        if due {
            self.due -= frame;
        }
        due
    }

    /// Draws a picture, and computes the frame of the tissue that is due beside it.
    fn picture(&mut self, reference: &[ReferenceCurve]) -> Result<Wishes> {
        let begin = Instant::now();
        self.next = begin + Duration::from_secs_f64(PICTURE);
        self.devices.tend(&mut self.practice, &self.desk);
        let due = std::mem::take(&mut self.ahead) || self.start_if_due()?;
        // Tissue that lags behind goes first, as long as the eye does not see it.
        let late = self.due >= self.practice.timing.simulated;
        if due && late && self.shown.elapsed().as_secs_f64() < SLOWEST_PICTURE {
            self.next = begin;
            self.finish()?;
            return Ok(Wishes::default());
        }
        self.shown = begin;
        let mut wishes = Wishes::default();
        let mut encoder = self.gpu.device.create_command_encoder(&Default::default());
        let panels = self.panels_are_due().then(|| self.run_panels(reference, &mut wishes));
        self.draw(&mut encoder, panels)?;
        // Nothing to show it on: the tissue goes on, the picture is left out.
        let shown = match self.surface.get_current_texture() {
            wgpu::CurrentSurfaceTexture::Success(texture) | wgpu::CurrentSurfaceTexture::Suboptimal(texture) => {
                Some(texture).filter(|shown| shown.texture.size() == self.canvas.size())
            }
            wgpu::CurrentSurfaceTexture::Outdated | wgpu::CurrentSurfaceTexture::Lost => {
                self.surface.configure(&self.gpu.device, &self.config);
                None
            }
            _ => None,
        };
        if let Some(shown) = &shown {
            let (from, to) = (self.canvas.as_image_copy(), shown.texture.as_image_copy());
            encoder.copy_texture_to_texture(from, to, self.canvas.size());
        }
        self.gpu.queue.submit([encoder.finish()]);
        if wishes.step && !due {
            self.start()?;
        }
        if due || wishes.step {
            self.finish()?;
        }
        // A software adapter shows a picture by copying it, on this thread: the tissue goes on meanwhile.
        let wished = wishes != Wishes::default() || self.practice.tuning.waits();
        self.ahead = self.gpu.is_software() && !wished && self.start_if_due()?;
        if let Some(shown) = shown {
            self.window.pre_present_notify();
            self.gpu.queue.present(shown);
            self.pictures += 1;
            self.practice.drawn();
            // The first pictures wait for their shaders.
            if let Some(before) = self.presented.replace(Instant::now())
                && self.pictures > WARM_UP
            {
                self.longest_pause = self.longest_pause.max(before.elapsed().as_secs_f64());
            }
        }
        self.gpu.check()?;
        if self.choices.automatic && self.ranged.is_none_or(|at| at.elapsed().as_secs_f64() >= LOOK_AT_RANGE) {
            self.ranged = Some(begin);
            self.follow_range()?;
        }
        Ok(wishes)
    }

    fn start_if_due(&mut self) -> Result<bool> {
        let due = self.frame_is_due();
        if due {
            self.start()?;
        }
        Ok(due)
    }

    /// Waits for the frame that was begun ahead, if one was: nothing is under way then.
    fn settle(&mut self) -> Result<()> {
        match std::mem::take(&mut self.ahead) {
            true => self.finish(),
            false => Ok(()),
        }
    }

    /// Gives the device the next frame.
    fn start(&mut self) -> Result<()> {
        if let Some(session) = &self.recorded
            && self.practice.follow(session)? == Renewed::Buffers
        {
            self.take_buffers()?;
        }
        match &mut self.recording {
            Some(recording) => self.practice.start(recording),
            None => self.practice.start(&mut self.devices.with(&mut self.desk)),
        }
    }

    /// Waits for the frame that was given.
    fn finish(&mut self) -> Result<()> {
        let inputs = self.practice.latency.count;
        match &mut self.recording {
            Some(recording) => self.practice.finish(recording)?,
            None => self.practice.finish(&mut self.devices.with(&mut self.desk))?,
        }
        self.devices.felt(&self.practice);
        // The force that answers an input is read at once.
        self.stale |= self.practice.latency.count > inputs;
        Ok(())
    }

    /// Filling the panels takes a software adapter longer than drawing the tissue.
    fn panels_are_due(&self) -> bool {
        // A pointer that only wanders over the view says nothing to them.
        let wanders = |event: &egui::Event| matches!(event, egui::Event::PointerMoved(at) if self.area.contains(*at));
        let spoken = self.egui.egui_input().events.iter().any(|event| !wanders(event));
        let input = spoken || self.egui.is_any_pointer_button_down();
        let waited = self.panelled.is_none_or(|at| at.elapsed().as_secs_f64() >= PANELS_EVERY);
        !self.gpu.is_software() || self.stale || input || waited
    }

    /// Asks the panels what they show and what was clicked.
    fn run_panels(&mut self, reference: &[ReferenceCurve], wishes: &mut Wishes) -> Panels {
        // The canvas keeps what is not drawn: without input the left side changes little.
        let still = self.gpu.is_software() && !self.stale && self.egui.egui_input().events.is_empty();
        self.panel_count += 1;
        let part = still && !self.panel_count.is_multiple_of(WHOLE_EVERY);
        self.panelled = Some(Instant::now());
        let input = self.egui.take_egui_input(&self.window);
        let context = self.egui.egui_ctx().clone();
        let mut turned = false;
        let output = context.run_ui(input, |ui| {
            if let Some(Debriefing { score, before }) = &self.debriefing
                && !panels::debriefing(ui.ctx(), score, before)
            {
                self.debriefing = None;
            }
            egui::Panel::left("controls").default_size(250.0).show(ui, |ui| {
                egui::ScrollArea::vertical().show(ui, |ui| {
                    let (practice, choices) = (&mut self.practice, &mut self.choices);
                    *wishes = panels::controls(ui, practice, choices, &mut self.camera, &mut self.desk);
                    self.devices.show(ui, &self.practice);
                });
            });
            egui::Panel::right("readings").default_size(330.0).show(ui, |ui| {
                panels::readings(ui, &self.practice, &mut self.choices, reference, self.devices.timing());
            });
            if self.choices.look.probe.on {
                egui::Panel::bottom("ultrasound").default_size(270.0).resizable(true).show(ui, |ui| {
                    let (scene, mesh) = (self.practice.scene(), &self.practice.simulation.model.mesh);
                    turned = self.scan.panel(ui, &mut self.choices.look.probe, scene, mesh);
                });
            }
            egui::CentralPanel::no_frame().show(ui, |ui| {
                self.area = ui.available_rect_before_wrap();
                let response = ui.allocate_rect(self.area, egui::Sense::click_and_drag());
                look(&response, ui, &mut self.camera, &mut self.desk, (self.practice.tool_place(), &mut self.grip));
            });
        });
        self.scale = output.pixels_per_point;
        // What moves goes on moving on the next picture.
        self.stale = output.viewport_output.values().any(|v| v.repaint_delay.is_zero())
            || egui::Popup::is_any_open(&context)
            || turned
            || self.debriefing.is_some();
        self.egui.handle_platform_output(&self.window, output.platform_output);
        if wishes.recut {
            self.cut();
        }
        let mut triangles = context.tessellate(output.shapes, self.scale);
        if part {
            triangles.retain(|shape| shape.clip_rect.right() > self.area.left());
        }
        Panels { triangles, textures: output.textures_delta }
    }

    /// Draws the tissue on the canvas, and the panels where they were asked.
    fn draw(&mut self, encoder: &mut wgpu::CommandEncoder, panels: Option<Panels>) -> Result<()> {
        let place = self.place_tool();
        if let Some(engine) = self.practice.simulation.on_device() {
            engine.encode_fields(encoder);
        }
        let (size, view) = (self.canvas.size(), self.canvas.create_view(&Default::default()));
        let pixels = Area {
            x: self.area.left() * self.scale,
            y: self.area.top() * self.scale,
            width: self.area.width() * self.scale,
            height: self.area.height() * self.scale,
        };
        let look = &self.choices.look;
        self.view.draw(&self.gpu, encoder, (&view, size), pixels, (&self.camera, &self.choices.scale, look));
        let Some(mut panels) = panels else { return Ok(()) };
        let probe = (&look.probe, place.as_ref());
        self.scan.draw(&self.gpu, &mut self.painter, encoder, &mut self.practice, probe)?;
        let (device, queue) = (&self.gpu.device, &self.gpu.queue);
        for (id, mut deltas) in panels.textures.set.drain() {
            for delta in &mut deltas {
                if self.gpu.is_software() {
                    // Letters lie on pixels: mixing four texels takes a software adapter longer, and changes nothing.
                    delta.options = egui::TextureOptions::NEAREST;
                }
                self.painter.update_texture(device, queue, id, delta);
            }
        }
        let screen = ScreenDescriptor { size_in_pixels: [size.width, size.height], pixels_per_point: self.scale };
        let more = self.painter.update_buffers(device, queue, encoder, &panels.triangles, &screen);
        // Only paint callbacks ask for buffers of their own, and there are none.
        debug_assert!(more.is_empty());
        let pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
            label: Some("panels"),
            color_attachments: &[Some(wgpu::RenderPassColorAttachment {
                view: &view,
                depth_slice: None,
                resolve_target: None,
                ops: wgpu::Operations { load: wgpu::LoadOp::Load, store: wgpu::StoreOp::Store },
            })],
            ..Default::default()
        });
        self.painter.render(&mut pass.forget_lifetime(), &panels.triangles, &screen);
        for id in panels.textures.free.drain() {
            self.painter.free_texture(&id);
        }
        Ok(())
    }

    /// Brings the ends of the scale to what the field holds now.
    fn follow_range(&mut self) -> Result<()> {
        let scale = &mut self.choices.scale;
        let (Lane::Node(lane), Range::Positive(_) | Range::Signed(_)) = (scale.field.lane, scale.field.range) else {
            *scale = panels::default_scale(scale.field);
            return Ok(());
        };
        let Some(engine) = self.practice.simulation.on_device() else { return Ok(()) };
        let Some(buffer) = engine.memory("drawn_nodes").and_then(Memory::buffer) else { return Ok(()) };
        let bytes = self.gpu.read_back(buffer)?;
        let mut values: Vec<f32> =
            bytes.chunks_exact(16).map(|b| bytemuck::pod_read_unaligned::<[f32; 4]>(b)[lane].abs()).collect();
        values.sort_unstable_by(f32::total_cmp);
        let at = ((1.0 - BEYOND_SCALE) * values.len() as f64) as usize;
        // A scale with three digits that moves little from look to look; never below 0.1 kPa.
        let high = f64::from(values.get(at).copied().unwrap_or(0.0)).max(100.0);
        scale.high = if (high / scale.high - 1.0).abs() > 0.1 { high } else { scale.high };
        scale.low = match scale.field.range {
            Range::Signed(_) => -scale.high,
            _ if scale.logarithmic => 0.01 * scale.high,
            _ => 0.0,
        };
        Ok(())
    }

    /// Puts tool, targets and the frame of the slice to their places; the tool's place is returned.
    fn place_tool(&mut self) -> Option<ToolPlace> {
        let (scene, look) = (self.practice.scene(), &self.choices.look);
        let last = self.practice.records.last();
        let line = self.practice.simulation.centre_line();
        let core = last.and_then(|r| r.core).map_or(0.0, |core| core.length);
        let place = self.practice.tool_place().map(|(tip, direction)| ToolPlace { tip, direction, line, core });
        let mut corners = scan::frame(&look.probe, scene, &self.practice.simulation.model.mesh);
        if let Some((tool, place)) = scene.tool.as_ref().zip(place.as_ref()) {
            corners.extend(tool_shape::triangles(tool, place));
        }
        for (n, target) in scene.targets.iter().enumerate().filter(|_| look.targets) {
            let moved = last.and_then(|r| r.targets.get(n)).map_or(DVec3::ZERO, |t| t.displacement);
            corners.extend(marks::target(target.position + moved, target.radius));
        }
        self.view.place_tool(&self.gpu, &corners);
        place
    }

    /// Draws the canvas once more, and writes it.
    fn screenshot(&mut self, reference: &[ReferenceCurve], path: &Path) -> Result<()> {
        let size = self.canvas.size();
        let mut encoder = self.gpu.device.create_command_encoder(&Default::default());
        let panels = self.run_panels(reference, &mut Wishes::default());
        self.draw(&mut encoder, Some(panels))?;
        let row = (4 * size.width).next_multiple_of(wgpu::COPY_BYTES_PER_ROW_ALIGNMENT);
        let buffer = self.gpu.device.create_buffer(&wgpu::BufferDescriptor {
            label: Some("screenshot"),
            size: u64::from(row) * u64::from(size.height),
            usage: wgpu::BufferUsages::COPY_DST | wgpu::BufferUsages::COPY_SRC,
            mapped_at_creation: false,
        });
        encoder.copy_texture_to_buffer(
            self.canvas.as_image_copy(),
            wgpu::TexelCopyBufferInfo {
                buffer: &buffer,
                layout: wgpu::TexelCopyBufferLayout { offset: 0, bytes_per_row: Some(row), rows_per_image: None },
            },
            size,
        );
        self.gpu.queue.submit([encoder.finish()]);
        let bytes = self.gpu.read_back(&buffer)?;
        let swapped =
            matches!(self.config.format, wgpu::TextureFormat::Bgra8Unorm | wgpu::TextureFormat::Bgra8UnormSrgb);
        let mut pixels = Vec::with_capacity(4 * (size.width * size.height) as usize);
        for line in bytes.chunks_exact(row as usize) {
            for pixel in line[..4 * size.width as usize].chunks_exact(4) {
                let [a, g, c] = [pixel[0], pixel[1], pixel[2]];
                pixels.extend(if swapped { [c, g, a, 255] } else { [a, g, c, 255] });
            }
        }
        crate::render::write_png(path, &pixels, size.width, size.height)
    }
}

/// The shaders of a folder.
fn shader_files(folder: &Path) -> Vec<PathBuf> {
    SOURCES.iter().map(|(name, _)| folder.join(name).with_extension("wgsl")).collect()
}

/// A texture as large as the window.
fn canvas(gpu: &Gpu, config: &wgpu::SurfaceConfiguration) -> wgpu::Texture {
    gpu.device.create_texture(&wgpu::TextureDescriptor {
        label: Some("canvas"),
        size: wgpu::Extent3d { width: config.width, height: config.height, depth_or_array_layers: 1 },
        mip_level_count: 1,
        sample_count: 1,
        dimension: wgpu::TextureDimension::D2,
        format: config.format,
        usage: wgpu::TextureUsages::RENDER_ATTACHMENT | wgpu::TextureUsages::COPY_SRC,
        view_formats: &[],
    })
}

/// Mouse over the view: drags turn and shift it or lead the needle where they begin on it, the wheel leads the needle or, with Ctrl,
/// zooms.
fn look(
    response: &egui::Response,
    ui: &egui::Ui,
    camera: &mut Camera,
    desk: &mut Desk,
    (tool, grip): (Option<(DVec3, DVec3)>, &mut Grip),
) {
    desk.seen_from(camera.level().map(|axis| axis.as_dvec3()));
    let led = tool.is_some_and(|needle| {
        let size = Vec2::new(response.rect.width(), response.rect.height());
        take_hold(response, ui, &Sight { camera, size, needle }, (desk, grip))
    });
    let height = response.rect.height().max(1.0);
    let drag = response.drag_delta() / height;
    let drag = Vec2::new(drag.x, drag.y);
    if response.dragged_by(egui::PointerButton::Primary) {
        if !led {
            camera.orbit(drag);
        }
    } else if response.dragged_by(egui::PointerButton::Secondary) || response.dragged_by(egui::PointerButton::Middle) {
        camera.pan(drag);
    }
    if response.hovered() {
        let (notches, zoom) = ui.input(|input| {
            let mut notches = 0.0;
            for event in &input.events {
                if let egui::Event::MouseWheel { unit, delta, modifiers, .. } = event
                    && !modifiers.command
                {
                    notches += match unit {
                        egui::MouseWheelUnit::Point => delta.y / 50.0,
                        egui::MouseWheelUnit::Line => delta.y,
                        egui::MouseWheelUnit::Page => 10.0 * delta.y,
                    };
                }
            }
            (notches, input.zoom_delta())
        });
        // Towards the user is into the tissue, as a page goes down.
        desk.ask(-f64::from(notches) * NOTCH);
        camera.zoom(zoom.ln() / 1.1f32.ln());
    }
}

/// The left button over the needle; true while a drag leads it.
fn take_hold(response: &egui::Response, ui: &egui::Ui, sight: &Sight, (desk, grip): (&mut Desk, &mut Grip)) -> bool {
    let place = |at: egui::Pos2| Vec2::new(at.x - response.rect.left(), at.y - response.rect.top());
    let (held, pressed_at) = ui.input(|input| {
        let m = input.modifiers;
        (Modifiers { shift: m.shift, control: m.ctrl || m.command, alt: m.alt }, input.pointer.press_origin())
    });
    if response.drag_started_by(egui::PointerButton::Primary) {
        // A drag is one some points after the button went down.
        *grip = Grip::begin(held, pressed_at.is_some_and(|at| sight.is_on_needle(place(at))));
    }
    if *grip == Grip::Camera && response.hover_pos().is_some_and(|at| sight.is_on_needle(place(at))) {
        ui.ctx().set_cursor_icon(egui::CursorIcon::Grab);
    }
    if !response.dragged_by(egui::PointerButton::Primary) {
        *grip = Grip::Camera;
        return false;
    }
    let Some(to) = response.interact_pointer_pos().map(place) else { return *grip != Grip::Camera };
    let drag = response.drag_delta();
    sight.drag(*grip, to - Vec2::new(drag.x, drag.y), to, desk)
}
