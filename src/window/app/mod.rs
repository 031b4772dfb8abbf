//! The window itself: events in, pictures out, one device for tissue and drawing, and the screens that fill it one after the other.
//!
//! [`stage`] is the window with its device. On it stand the start screen ([`super::start`]), that of teachers ([`super::teacher`]), a scene
//! that is made ready ([`preparing`]) or one that is practised ([`practice_screen`]). A screen that wants another hands up a [`Next`], which
//! [`App::go`] follows.

mod canvas;
mod display;
mod outcome;
mod pace;
mod pointer;
mod practice_screen;
mod preparing;
mod reader;
mod reference;
mod renewal;
mod scale;
mod stage;

use std::path::PathBuf;
use std::time::Instant;

use winit::application::ApplicationHandler;
use winit::event::WindowEvent;
use winit::event_loop::{ActiveEventLoop, ControlFlow, EventLoop, EventLoopProxy};
use winit::keyboard::KeyCode;
use winit::window::WindowId;

use self::display::no_display;
pub use self::outcome::ViewOutcome;
use self::practice_screen::{PracticeScreen, Reference, first_of};
use self::preparing::{Order, Outcome, Preparing, Wanted};
use self::reader::Message;
use self::reference::{read_curve, read_score};
use self::stage::Stage;
use super::PACES;
use super::devices::Devices;
use super::help;
use super::practice::Leader;
use super::screens::Next;
use super::settings::Keeper;
use super::source::Source;
use super::start::StartScreen;
use super::teacher::Teacher;
use crate::commands::replay::session_file;
use crate::commands::view::ViewArgs;
use crate::ending;
use crate::gpu::compose::read_sources;
use crate::scene::Scene;
use crate::session::Session;
use crate::training::scene_words;
use crate::words::say;
use crate::{Error, Result};

/// Opens the window and returns when it is closed.
///
/// # Errors
/// Those of the scene come first. `Error::Input` where there is no display, `Error::Adapter` where no adapter can draw on it.
pub fn view(options: &ViewArgs, program_start: Instant) -> Result<ViewOutcome> {
    let app = App::new(options, program_start)?;
    match open_display() {
        Ok(event_loop) => app.run(event_loop),
        Err(reason) => Err(no_display(&reason)),
    }
}

/// The same for a program that was called without a word: `None` where no display can be reached.
///
/// # Errors
/// Those of [`view`].
pub fn view_where_possible(options: &ViewArgs, program_start: Instant) -> Result<Option<ViewOutcome>> {
    let app = App::new(options, program_start)?;
    match open_display() {
        Ok(event_loop) => app.run(event_loop).map(Some),
        Err(_) => Ok(None),
    }
}

/// Libraries of the display that are missing end in an error or, some of them, in a panic.
fn open_display() -> std::result::Result<EventLoop<Message>, String> {
    match std::panic::catch_unwind(|| EventLoop::with_user_event().build()) {
        Ok(Ok(event_loop)) => Ok(event_loop),
        Ok(Err(reason)) => Err(reason.to_string()),
        Err(_) => Err("a library of the window system is missing".into()),
    }
}

/// A scene that the command line names.
struct Given {
    source: Source,
    scene: Scene,
    recorded: Option<Session>,
}

impl Given {
    /// `None` where the start screen is asked for.
    fn of(options: &ViewArgs) -> Result<Option<Given>> {
        let (source, scene, recorded) = match (&options.session, options.scene_file()) {
            (Some(path), _) => {
                let session = Session::read(&session_file(path))?;
                session.scene()?;
                let (source, scene) = Source::read(session.scene.clone(), session.overrides.clone())?;
                (source, scene, Some(session))
            }
            (None, Some(path)) => {
                let (source, scene) = Source::read(path, options.overrides.clone())?;
                (source, scene, None)
            }
            (None, None) => return Ok(None),
        };
        for notice in &scene.notices {
            crate::eprintln!("note: {notice}");
        }
        Ok(Some(Given { source, scene, recorded }))
    }
}

struct App {
    options: ViewArgs,
    keeper: Keeper,
    given: Option<Given>,
    reference: Reference,
    program_start: Instant,
    /// For screen readers, who speak from other threads.
    proxy: Option<EventLoopProxy<Message>>,
    open: Option<Open>,
    outcome: ViewOutcome,
    failure: Option<Error>,
}

/// An open window and what fills it.
struct Open {
    stage: Stage,
    screen: Screen,
    /// What is connected, while no screen has it.
    devices: Devices,
    /// Number of the next attempt of this window, and whether its folder is one of ours that nothing was written into.
    attempt: u32,
    empty: bool,
    /// A session that leads, until a screen has it.
    recorded: Option<Session>,
    /// Ctrl is held.
    control: bool,
    /// A file that was dropped on the window.
    dropped: Option<PathBuf>,
}

enum Screen {
    Start(Box<StartScreen>),
    Preparing(Preparing),
    Practice(Box<PracticeScreen>),
    Teacher(Box<Teacher>),
}

impl ApplicationHandler<Message> for App {
    fn user_event(&mut self, _: &ActiveEventLoop, message: Message) {
        if let Some(open) = &mut self.open {
            reader::heed(&mut open.stage.egui, message);
            (open.stage.stale, open.stage.next) = (true, Instant::now());
        }
    }

    fn resumed(&mut self, event_loop: &ActiveEventLoop) {
        if self.open.is_some() {
            return;
        }
        match self.open_window(event_loop) {
            Ok(open) => {
                // From here on there is something to keep.
                ending::begin();
                open.stage.window.request_redraw();
                self.open = Some(open);
            }
            Err(error) => self.fail(event_loop, error),
        }
    }

    fn window_event(&mut self, event_loop: &ActiveEventLoop, _: WindowId, event: WindowEvent) {
        let Some(open) = &mut self.open else { return };
        let stage = &mut open.stage;
        // A key that is held comes again 25 times a second; every event of the panels has them drawn, which takes longer than tissue and
        // view together. Only where somebody writes does it mean anything.
        let repeats = matches!(&event, WindowEvent::KeyboardInput { event, .. } if event.repeat);
        if repeats && !stage.egui.egui_ctx().egui_wants_keyboard_input() {
            return;
        }
        let response = stage.egui.on_window_event(&stage.window, &event);
        let taken = response.consumed;
        if response.repaint && !matches!(open.screen, Screen::Practice(_)) && event != WindowEvent::RedrawRequested {
            (stage.stale, stage.next) = (true, Instant::now());
        }
        match event {
            WindowEvent::CloseRequested => self.close(event_loop),
            WindowEvent::Resized(size) => stage.resize(size),
            WindowEvent::Focused(false) => open.screen.let_go(),
            WindowEvent::ModifiersChanged(modifiers) => {
                open.control = modifiers.state().control_key();
                if let Screen::Practice(practice) = &mut open.screen {
                    practice.shifting(open.control);
                }
            }
            WindowEvent::KeyboardInput { event, .. } if event.physical_key == KeyCode::KeyQ && open.control => {
                self.close(event_loop);
            }
            WindowEvent::DroppedFile(path) => {
                open.dropped = Some(path);
                stage.stale = true;
            }
            // Who reads the keys does not lead the needle.
            WindowEvent::KeyboardInput { event, .. } if !taken && !stage.help.open => {
                if let Screen::Practice(practice) = &mut open.screen {
                    practice.key(event.physical_key, event.state, event.repeat);
                }
            }
            WindowEvent::RedrawRequested => {
                if let Err(error) = self.picture(event_loop) {
                    self.fail(event_loop, error);
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
        if Instant::now() >= open.stage.next {
            open.stage.window.request_redraw();
        }
        event_loop.set_control_flow(ControlFlow::WaitUntil(open.stage.next));
    }
}

impl Screen {
    fn let_go(&mut self) {
        if let Screen::Practice(practice) = self {
            practice.let_go();
        }
    }
}

impl App {
    /// Reads what the options name.
    fn new(options: &ViewArgs, program_start: Instant) -> Result<Self> {
        if !PACES.contains(&options.pace) {
            let way_out = format!("write a number from {} to {}", PACES.start(), PACES.end());
            return Err(Error::input(
                format!("--speed-factor {} is not a speed that the window can aim at", options.pace),
                way_out,
            ));
        }
        let mut keeper = Keeper::open(options.settings.as_deref());
        keeper.settings.speak();
        if let Some(notice) = &keeper.notice {
            crate::eprintln!("note: {notice}");
        }
        if options.trainee.is_some() {
            keeper.settings.trainee.clone_from(&options.trainee);
        }
        let given = Given::of(options)?;
        if let Some(folder) = &options.shaders {
            read_sources(folder)?;
        }
        let curve = options.reference.as_deref().map(read_curve).transpose()?;
        let score = options.reference.as_deref().and_then(read_score).transpose()?;
        Ok(App {
            options: options.clone(),
            keeper,
            given,
            reference: Reference { curves: curve.into_iter().collect(), score },
            program_start,
            proxy: None,
            open: None,
            outcome: ViewOutcome::default(),
            failure: None,
        })
    }

    fn run(mut self, event_loop: EventLoop<Message>) -> Result<ViewOutcome> {
        self.proxy = Some(event_loop.create_proxy());
        event_loop.run_app(&mut self).map_err(|reason| no_display(&reason.to_string()))?;
        match self.failure {
            Some(error) => Err(error),
            None => Ok(self.outcome),
        }
    }

    fn open_window(&mut self, event_loop: &ActiveEventLoop) -> Result<Open> {
        let stage = Stage::open(event_loop, &self.options, self.proxy.clone())?;
        let devices = Devices::open(&self.options)?;
        let given = self.given.take();
        let recorded = given.as_ref().and_then(|given| given.recorded.clone());
        let mut open = Open {
            stage,
            screen: Screen::Start(Box::new(StartScreen::new(&self.options.history))),
            devices,
            attempt: 1,
            empty: false,
            recorded,
            control: false,
            dropped: None,
        };
        if let Some(Given { source, scene, .. }) = given {
            open.prepare(&self.options, Wanted::Read(Box::new((source, scene))));
        }
        Ok(open)
    }

    /// One picture of the screen that is shown, and the way to the next where one is asked for.
    fn picture(&mut self, event_loop: &ActiveEventLoop) -> Result<()> {
        let Some(open) = &mut self.open else { return Ok(()) };
        let settings = &mut self.keeper.settings;
        let next = match &mut open.screen {
            Screen::Start(start) => {
                let mut next = None;
                let every = self.options.frames.is_some();
                if let Some(path) = open.dropped.take() {
                    next = start.bring(path);
                }
                let topics = [help::START, help::EVERYWHERE];
                open.stage.flat(settings, (&topics, every), |ui, settings| {
                    let wanted = start.show(ui, settings);
                    next = next.take().or(wanted);
                })?;
                if start.wants_help() {
                    (open.stage.help.open, open.stage.stale) = (true, true);
                }
                next
            }
            Screen::Teacher(teacher) => {
                let (mut next, every) = (None, self.options.frames.is_some());
                open.stage
                    .flat(settings, (&[help::EVERYWHERE], every), |ui, _| next = next.take().or(teacher.show(ui)))?;
                next
            }
            Screen::Preparing(preparing) => match preparing.picture(&mut open.stage, settings)? {
                Outcome::Waiting => None,
                Outcome::Left => Some(Next::Start),
                Outcome::Ready(prepared) => {
                    let (devices, recorded) = (std::mem::take(&mut open.devices), open.recorded.take());
                    let reference = self.reference.clone();
                    let options = &self.options;
                    settings.opened(&prepared.practice.tuning.source.path);
                    let title = format!("{} - {}", say("title"), scene_words::title(&prepared.practice.scene().title));
                    open.stage.window.set_title(&title);
                    let screen = PracticeScreen::new(&mut open.stage, *prepared, options, recorded, reference, devices);
                    open.screen = Screen::Practice(Box::new(screen));
                    None
                }
                // Who named the scene in the call is told there.
                Outcome::Refused(error) if self.options.names_a_scene() && !self.outcome.practised => {
                    return Err(error);
                }
                Outcome::Refused(error) => {
                    let mut start = StartScreen::new(&self.options.history);
                    start.tell(error.to_string());
                    open.screen = Screen::Start(Box::new(start));
                    None
                }
            },
            Screen::Practice(practice) => {
                let mut next = practice.turn(&mut open.stage, settings)?;
                if let Some(path) = open.dropped.take() {
                    next = Some(Next::Bring(path));
                }
                if open.stage.pictures == 1 && self.outcome.first_picture == 0.0 {
                    self.outcome.first_picture = self.program_start.elapsed().as_secs_f64();
                }
                next
            }
        };
        self.keeper.keep();
        let counts = !matches!(open.screen, Screen::Preparing(_));
        let enough = counts && self.options.frames.is_some_and(|n| open.stage.pictures >= n);
        match next {
            _ if enough => self.close(event_loop),
            Some(Next::Close) => self.close(event_loop),
            Some(next) => self.go(next)?,
            None => {}
        }
        Ok(())
    }

    /// Follows what a screen asked for.
    fn go(&mut self, next: Next) -> Result<()> {
        let Some(open) = &mut self.open else { return Ok(()) };
        let mut start = StartScreen::new(&self.options.history);
        let mut here = None;
        if let Screen::Practice(practice) = &mut open.screen {
            here = Some(practice.path().to_path_buf());
            (open.attempt, open.empty) = (practice.next_attempt(), practice.is_empty());
            let (devices, left) = practice.leave(&mut open.stage, &mut self.outcome);
            open.devices = devices;
            // The session was kept elsewhere: the window stays, and says so.
            if let Err(error) = left {
                start.tell(error.to_string());
            }
        }
        let teacher = next == Next::Teacher;
        let scene = match next {
            Next::Scene(path) => Some(path),
            Next::Bring(path) => match start.bring(path) {
                Some(Next::Scene(path)) => Some(path),
                _ => None,
            },
            Next::NextTask => here.and_then(|path| start.task_behind(&path)),
            // A practice screen begins again by itself.
            Next::Start | Next::Again | Next::Teacher | Next::Close => None,
        };
        open.stage.count_anew();
        open.stage.window.set_title(say("title"));
        open.screen = match teacher {
            true => Screen::Teacher(Box::new(Teacher::new(&self.options.history))),
            false => Screen::Start(Box::new(start)),
        };
        if let Some(path) = scene {
            open.prepare(&self.options, Wanted::File(path));
        }
        Ok(())
    }

    fn close(&mut self, event_loop: &ActiveEventLoop) {
        if let Some(mut open) = self.open.take() {
            let settings = &mut self.keeper.settings;
            let shots = (self.options.screenshot.clone(), self.options.picture.clone());
            first_of(&mut self.failure, open.capture(settings, shots));
            if let Screen::Practice(practice) = &mut open.screen {
                let (devices, left) = practice.leave(&mut open.stage, &mut self.outcome);
                open.devices = devices;
                first_of(&mut self.failure, left);
                self.outcome.frames_per_second = open.stage.pictures.saturating_sub(1) as f64
                    / (self.program_start.elapsed().as_secs_f64() - self.outcome.first_picture).max(f64::MIN_POSITIVE);
            }
            match open.devices.finish() {
                Ok(timing) => self.outcome.haptic = timing,
                Err(error) => _ = self.failure.get_or_insert(error),
            }
            self.keeper.keep();
        }
        event_loop.exit();
    }

    fn fail(&mut self, event_loop: &ActiveEventLoop, error: Error) {
        self.failure.get_or_insert(error);
        self.close(event_loop);
    }
}

impl Open {
    /// Has a scene made ready.
    fn prepare(&mut self, options: &ViewArgs, scene: Wanted) {
        let order = Order {
            scene,
            leader: if options.script { Leader::Script } else { Leader::Hand },
            out: options.out.clone(),
            attempt: self.attempt,
            force: options.force || self.empty,
        };
        let preparing = Preparing::begin(self.stage.gpu.clone(), self.stage.config.format, order);
        self.screen = Screen::Preparing(preparing);
        self.stage.count_anew();
    }

    /// Writes the last picture, or the view alone, where that is asked for.
    fn capture(
        &mut self,
        settings: &mut super::settings::Settings,
        (whole, view): (Option<PathBuf>, Option<PathBuf>),
    ) -> Result<()> {
        if whole.is_none() && view.is_none() {
            return Ok(());
        }
        let mut area = None;
        if let Screen::Practice(practice) = &mut self.screen {
            practice.settle(&mut self.stage)?;
            practice.redraw(&mut self.stage, settings)?;
            area = Some(practice.area());
        }
        if let Some(path) = whole {
            self.stage.write(&path, None)?;
        }
        match view {
            Some(path) => self.stage.write(&path, area),
            None => Ok(()),
        }
    }
}
