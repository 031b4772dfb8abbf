//! The screen on which an insertion is practised: one scene, its attempts, what is chosen around them. Its pictures are in `canvas`, when
//! they come in `pace`, what a change renews in `renewal`.

use std::time::Instant;

use winit::event::ElementState;
use winit::keyboard::{KeyCode, PhysicalKey};

use super::outcome::ViewOutcome;
use super::preparing::Prepared;
use super::renewal::shader_files;
use super::stage::Stage;
use crate::commands::view::ViewArgs;
use crate::session::Session;
use crate::simulation::change::Reach;
use crate::training::history::History;
use crate::training::score::Score;
use crate::window::camera::Camera;
use crate::window::debriefing::{After, Answer};
use crate::window::devices::Devices;
use crate::window::foresight::Foresight;
use crate::window::grip::Grip;
use crate::window::hand::{Desk, Key, Recording};
use crate::window::kernels_on_disk::KernelsOnDisk;
use crate::window::lesson::Lesson;
use crate::window::panels::{Choices, ReferenceCurve, Wishes};
use crate::window::practice::{Practice, Renewed, State};
use crate::window::scan::Scan;
use crate::window::scene_view::SceneView;
use crate::window::screens::Next;
use crate::window::settings::Settings;
use crate::window::watch::Watch;
use crate::{Error, Result};

/// An attempt that attempts are compared with.
#[derive(Debug, Clone, Default)]
pub struct Reference {
    pub curves: Vec<ReferenceCurve>,
    pub score: Option<Score>,
}

/// A scene that is practised.
pub struct PracticeScreen {
    pub(super) practice: Practice,
    pub(super) view: SceneView,
    pub(super) scan: Scan,
    foresight: Foresight,
    pub(super) desk: Desk,
    pub(super) devices: Devices,
    pub(super) recording: Option<Recording>,
    pub(super) recorded: Option<Session>,
    pub(super) choices: Choices,
    pub(super) camera: Camera,
    pub(super) reference: Vec<ReferenceCurve>,
    reference_score: Option<Score>,
    options: ViewArgs,
    /// The next frame of the tissue is under way already.
    pub(super) ahead: bool,
    /// Simulated time that is due [s], and when it was counted last.
    pub(super) due: f64,
    pub(super) counted: Instant,
    /// When the last picture was begun.
    pub(super) shown: Instant,
    /// Where the tissue is drawn [points].
    pub(super) area: egui::Rect,
    /// What is written over it.
    pub(super) overlay: Vec<egui::ClippedPrimitive>,
    /// When the range of the field was looked at last.
    pub(super) ranged: Option<Instant>,
    /// Of which engine of the simulation the buffers are that are drawn.
    pub(super) engines: u64,
    /// When the panels were drawn last, and how often.
    pub(super) panelled: Option<Instant>,
    pub(super) panel_count: u64,
    /// Scene and shaders, to be read anew when they change.
    pub(super) scene_file: Watch,
    pub(super) shader_files: Watch,
    /// What the drag under way does.
    pub(super) grip: Grip,
    pub(super) lesson: Lesson,
    /// What comes behind the attempt.
    pub(super) after: After,
}

impl PracticeScreen {
    pub fn new(
        stage: &mut Stage,
        prepared: Prepared,
        options: &ViewArgs,
        recorded: Option<Session>,
        reference: Reference,
        devices: Devices,
    ) -> Self {
        let Prepared { mut practice, view, parts, watcher } = prepared;
        let scene = practice.scene();
        let (low, high) = practice.simulation.model.mesh.bounds();
        let centre = 0.5 * (low + high);
        let camera = Camera::around(centre.as_vec3(), (0.62 * (high - low).length()) as f32);
        // Open through the entry point, so that the needle is seen.
        let at = (scene.motion.entry.y - low.y) / (high.y - low.y);
        // That of the script, which mass scaling is chosen for; a slider has others.
        let desk = Desk::new(scene.motion.largest_speed().min(practice.speed_limit));
        if options.script || recorded.is_some() || options.frames.is_some() {
            practice.state = State::Running;
        }
        // Only Mesa is known to keep the kernels of a software adapter on disk. Another process has the shaders of this program.
        if stage.gpu.is_software() && cfg!(target_os = "linux") && options.shaders.is_none() {
            practice.tuning.kernels = Some(KernelsOnDisk::default());
        }
        stage.alive.writes_to(practice.folder());
        let now = Instant::now();
        let path = practice.tuning.source.path.clone();
        let mut screen = PracticeScreen {
            view,
            scan: Scan::default(),
            foresight: Foresight::default(),
            desk,
            devices,
            recording: recorded.as_ref().map(|session| Recording::new(session.poses.clone())),
            recorded,
            choices: Choices { error_bar: options.error_bar, parts, ..Choices::new(Some((1, at)), options.pace) },
            camera,
            reference: reference.curves,
            reference_score: reference.score,
            options: options.clone(),
            ahead: false,
            due: 0.0,
            counted: now,
            shown: now,
            area: egui::Rect::NOTHING,
            overlay: Vec::new(),
            ranged: None,
            engines: 0,
            panelled: None,
            panel_count: 0,
            scene_file: Watch::new([path]),
            shader_files: Watch::new(options.shaders.iter().flat_map(|folder| shader_files(folder))),
            grip: Grip::Camera,
            lesson: Lesson::with(&practice, watcher),
            after: After::default(),
            practice,
        };
        screen.choices.look.probe.on = options.ultrasound;
        let scene = screen.practice.scene();
        screen.choices.look.natural = scene.task.is_some() || scene.case.is_some();
        screen.cut(stage);
        stage.count_anew();
        screen
    }

    /// One picture, the frame of the tissue that is due, and what the panels asked for; where the user wants to go.
    ///
    /// # Errors
    /// What befalls the device, and what a folder cannot take.
    pub fn turn(&mut self, stage: &mut Stage, settings: &mut Settings) -> Result<Option<Next>> {
        let mut wishes = self.picture(stage, settings)?;
        self.practice.show_band(self.choices.error_bar);
        if wishes.debrief {
            self.debrief(stage, settings)?;
        }
        self.answer(&mut wishes, stage)?;
        if wishes.write_again {
            // What is still wrong stands in the panel.
            let _ = self.practice.write_again();
        }
        if let Some(time) = wishes.go_back {
            self.practice.go_back(time)?;
        }
        if wishes.next == Some(Next::Again) {
            wishes.restart = Some(self.practice.leader);
        }
        if let Some(leader) = wishes.restart {
            self.after.forget();
            self.practice.again(leader);
            stage.stale = true;
        }
        // Hardware leaves the processor alone; a software adapter needs it for the tissue.
        let at_leisure = !stage.gpu.is_software() || self.practice.state != State::Running;
        let practice = &self.practice;
        self.foresight.tend(&practice.tuning, &practice.simulation, practice.purpose(), at_leisure);
        let shaders = self.options.shaders.clone();
        self.read_anew(shaders.as_deref());
        if self.practice.tuning.waits() {
            self.settle(stage)?;
        }
        match self.practice.take_changes()? {
            Renewed::Nothing | Renewed::Constants => {}
            Renewed::Buffers => self.take_buffers(stage)?,
            Renewed::Attempt => {
                self.after.forget();
                self.rebind(stage)?;
            }
        }
        Ok(wishes.next.filter(|next| *next != Next::Again))
    }

    /// What was clicked in the debriefing, and the way to a moment of an attempt that is seen again.
    fn answer(&mut self, wishes: &mut Wishes, stage: &mut Stage) -> Result<()> {
        match wishes.answer {
            None => {}
            Some(Answer::Again) => wishes.next = Some(Next::Again),
            Some(Answer::NextTask) => wishes.next = Some(Next::NextTask),
            Some(Answer::Start) => wishes.next = Some(Next::Start),
            Some(Answer::Close) => self.after.forget(),
            Some(Answer::InTissue(time)) => {
                self.settle(stage)?;
                self.after.see_again(&mut self.practice, time)?;
                self.rebind(stage)?;
            }
        }
        if self.after.is_asked(&self.practice) {
            self.settle(stage)?;
            stage.stale |= self.after.tend(&mut self.practice)?;
            self.lesson.tend(&self.practice);
        }
        Ok(())
    }

    /// The attempt is over: its scores, kept for the trainee where there is one.
    fn debrief(&mut self, stage: &mut Stage, settings: &Settings) -> Result<()> {
        stage.stale = true;
        if self.practice.is_replay() {
            // It was scored when it was made.
            self.after.return_to();
            return Ok(());
        }
        self.practice.state = match &self.practice.state {
            State::Running => State::Paused,
            other => other.clone(),
        };
        let score = self.practice.debrief(self.reference_score.as_ref())?;
        crate::println!("{}", score.text());
        let mut attempts = Vec::new();
        if let (Some(trainee), Some(_)) = (&settings.trainee, &score.task) {
            let history = History::new(&self.options.history);
            // A history that takes nothing costs neither the scores nor the attempt.
            match history.add(trainee, &score).and_then(|_| history.attempts(trainee)) {
                Ok(found) => {
                    for broken in &found.broken {
                        crate::eprintln!("note: {broken}");
                    }
                    attempts = found.attempts;
                }
                Err(error) => self.practice.hold_back(error),
            }
        }
        self.after.begin(&self.practice, &self.lesson, score, &attempts);
        Ok(())
    }

    /// Writes what is not written yet, and tells how it went; the devices go to the screen that follows.
    ///
    /// # Errors
    /// What the folder cannot take; the session is then kept elsewhere, and told.
    pub fn leave(&mut self, stage: &mut Stage, outcome: &mut ViewOutcome) -> (Devices, Result<()>) {
        let settled = self.settle(stage);
        self.scan.close(&mut stage.painter);
        let written = match self.practice.unwritten {
            Some(_) => self.practice.write_again().inspect_err(|_| {
                if let Some(place) = self.practice.rescue() {
                    crate::eprintln!(
                        "note: the session was kept in {}; stylet replay computes its tables again",
                        place.display()
                    );
                }
            }),
            None => self.practice.save(),
        };
        let last = self.practice.records.last();
        outcome.practised = true;
        outcome.pictures = stage.pictures;
        outcome.frames = self.practice.records.len() as u64;
        outcome.depth = last.map_or(0.0, |r| r.depth);
        outcome.force = last.map_or(0.0, |r| r.force.axial);
        outcome.longest_pause = stage.longest_pause;
        outcome.real_time_factor = self.practice.timing.real_time_factor();
        outcome.achieved = self.practice.timing.achieved();
        outcome.latency = self.practice.latency;
        let switches = self.practice.tuning.paces.iter().filter(|pace| pace.reach == Reach::Kernels);
        outcome.switches = switches.copied().collect();
        outcome.stopped = match &self.practice.state {
            State::Stopped(reason) => Some(reason.clone()),
            _ => None,
        };
        (std::mem::take(&mut self.devices), settled.and(written))
    }

    /// The scene that is practised.
    pub fn path(&self) -> &std::path::Path {
        &self.practice.tuning.source.path
    }

    /// Number that the next attempt has, whoever makes it.
    pub fn next_attempt(&self) -> u32 {
        self.practice.next_attempt()
    }

    /// True where the attempt has no frame yet.
    pub fn is_empty(&self) -> bool {
        self.practice.records.is_empty()
    }

    pub fn let_go(&mut self) {
        self.desk.let_go();
    }

    pub fn shifting(&mut self, shifting: bool) {
        self.desk.shifting(shifting);
    }

    /// Where the tissue is drawn [points].
    pub fn area(&self) -> egui::Rect {
        self.area
    }

    pub fn key(&mut self, key: PhysicalKey, state: ElementState, repeat: bool) {
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

/// No attempt is lost with an error on the way out.
pub fn first_of(first: &mut Option<Error>, result: Result<()>) {
    if let Err(error) = result {
        first.get_or_insert(error);
    }
}
