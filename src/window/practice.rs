//! An insertion as it is practised: a simulation, the hand that leads it or the script of the scene, and what was recorded.
//!
//! Knows nothing of a window. One frame is [`Practice::start`] - the device computes, the window draws - and
//! [`Practice::finish`].

use std::path::{Path, PathBuf};
use std::time::Instant;

use glam::DVec3;

use super::band::Band;
use super::hand::InputDevice;
use super::reach::Reach;
use super::source::Source;
use super::texts;
use super::tuning::{Taken, Tuning};
use crate::gpu::Gpu;
use crate::needle::motion::HandPose;
use crate::observables::FrameRecord;
use crate::output::{DrivenFace, OutputFolder, Tables};
use crate::scene::Scene;
use crate::session::{SESSION, SceneChange, Session, SessionFile};
use crate::simulation::advice::tool_mach;
use crate::simulation::checkpoint::Checkpoint;
use crate::simulation::{Purpose, Simulation};
use crate::training::kinematic::Sample;
use crate::training::score::Score;
use crate::{Error, Result};

/// Tool speed over the scaled shear wave speed beyond which inertia, not tissue, answers the hand.
const LARGEST_MACH: f64 = 0.3;

/// Frames between two moments of a script that one can go back to, and how many of them are kept.
const MARK_EVERY: usize = 30;
const MOST_MARKS: usize = 64;

/// Who leads the needle.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Leader {
    Hand,
    /// The motion of the scene.
    Script,
}

/// What a change has left behind for those who draw.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Renewed {
    Nothing,
    /// The buffers are those of before.
    Constants,
    /// The buffers of the engine are new, the mesh is the same.
    Buffers,
    /// Everything is new.
    Attempt,
}

/// What the insertion is doing.
#[derive(Debug, Clone, PartialEq)]
pub enum State {
    Running,
    Paused,
    /// The script is at its end.
    Ended,
    /// The run was stopped, with the reason.
    Stopped(String),
}

/// Times of the last frames [s].
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Timing {
    /// Simulated time of a frame.
    pub simulated: f64,
    /// Wall time from the start of a frame to its results, smoothed.
    pub physics: f64,
    /// Wall time from one drawn frame to the next, smoothed.
    pub between: f64,
    /// Wall time for which the run has been on, and what was simulated in it.
    pub running: f64,
    pub done: f64,
}

/// How long inputs took until the hand felt them.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Latency {
    /// Inputs that were measured.
    pub count: u64,
    /// Frames of the tissue that ended between an input and its force, the frame that has it included; most of all.
    pub most_frames: u64,
    /// Wall time, mean and longest [s].
    pub mean: f64,
    pub longest: f64,
}

impl Latency {
    fn add(&mut self, frames: u64, time: f64) {
        self.count += 1;
        self.most_frames = self.most_frames.max(frames);
        self.mean += (time - self.mean) / self.count as f64;
        self.longest = self.longest.max(time);
    }
}

impl Timing {
    /// Takes a wall time into a mean over about ten frames.
    fn smooth(mean: &mut f64, value: f64) {
        *mean = if *mean == 0.0 { value } else { 0.9 * *mean + 0.1 * value };
    }

    /// Simulated over wall time while the run was on.
    pub fn achieved(&self) -> f64 {
        if self.running > 0.0 { self.done / self.running } else { 0.0 }
    }

    /// Simulated time over wall time that the physics alone would reach.
    pub fn real_time_factor(&self) -> f64 {
        if self.physics > 0.0 { self.simulated / self.physics } else { 0.0 }
    }

    pub fn frames_per_second(&self) -> f64 {
        if self.between > 0.0 { 1.0 / self.between } else { 0.0 }
    }
}

fn purpose(leader: Leader) -> Purpose {
    Purpose { led: leader == Leader::Hand, drawn: true, lanes: true }
}

/// Largest speed of a hand that is let through [m/s].
fn speed_limit(simulation: &Simulation) -> f64 {
    let script = simulation.model.scene.motion.largest_speed();
    let wave = tool_mach(&simulation.model).map(|mach| script / mach);
    wave.map_or(f64::INFINITY, |wave| LARGEST_MACH * wave).max(script)
}

/// Where an attempt is written to.
struct Written {
    folder: OutputFolder,
    tables: Tables,
    /// Where a hand leads.
    session: Option<SessionFile>,
}

/// The file of what a hand does.
fn session_file(folder: &OutputFolder, leader: Leader, session: &Session) -> Result<Option<SessionFile>> {
    match leader {
        Leader::Hand => SessionFile::create(&folder.file(SESSION), session).map(Some),
        Leader::Script => Ok(None),
    }
}

/// One attempt.
pub struct Practice {
    scene: Scene,
    gpu: Gpu,
    out: Option<PathBuf>,
    /// Number of this attempt since the window was opened, from 1.
    attempt: u32,
    written: Option<Written>,
    /// Why the folder takes nothing more; everything is still in memory.
    pub unwritten: Option<String>,
    pub simulation: Simulation,
    pub leader: Leader,
    pub state: State,
    pub tuning: Tuning,
    pub records: Vec<FrameRecord>,
    pub session: Session,
    pub timing: Timing,
    /// Largest speed of the hand that is let through [m/s].
    pub speed_limit: f64,
    /// Frames in which the hand was faster.
    pub limited_frames: u64,
    started: Option<Instant>,
    /// Input that the frame under way has, with the frames that had ended when it came.
    fresh: Option<(Instant, u64)>,
    pub latency: Latency,
    /// The next frame is the first after a change: what it takes longer is part of it.
    freshly_changed: bool,
    /// Moments of a script that one can go back to.
    marks: Vec<Checkpoint>,
    /// The user wants a band around the force; why there is none, where there cannot be one.
    wants_band: bool,
    band: Option<Band>,
    pub no_band: Option<String>,
    last_drawn: Option<Instant>,
}

impl Practice {
    /// Prepares an attempt on a device. `out`: the folder that its tables and its session go to.
    ///
    /// # Errors
    /// As [`Simulation::for_purpose`]; `Error::Input` for a scene without a tool.
    pub fn new(
        scene: Scene,
        source: Source,
        gpu: Gpu,
        leader: Leader,
        out: Option<&Path>,
        force: bool,
    ) -> Result<Self> {
        if scene.tool.is_none() || scene.motion.phases.is_empty() {
            return Err(Error::input(
                format!("{}: there is no tool to lead", scene.path.display()),
                "take a scene with a needle, e.g. scenes/muscle_biopsy.toml, or run this one with `stylet run`",
            ));
        }
        let simulation = Simulation::for_purpose(scene.clone(), Some(gpu.clone()), purpose(leader))?;
        Self::with(simulation, scene, source, gpu, leader, out, force)
    }

    /// The same with a simulation at its beginning.
    fn with(
        mut simulation: Simulation,
        scene: Scene,
        source: Source,
        gpu: Gpu,
        leader: Leader,
        out: Option<&Path>,
        force: bool,
    ) -> Result<Self> {
        let session = Session::new(&scene, &source.overrides, simulation.engine().info());
        let written = match out {
            None => None,
            Some(out) => {
                let folder = OutputFolder::create(Some(out), &scene.name, force)?;
                let driven = DrivenFace::of_scene(&scene.faces, &simulation.model.mesh);
                let tables = Tables::create(&folder, &driven, simulation.model.has_bore(), &scene)?;
                let file = session_file(&folder, leader, &session)?;
                Some(Written { folder, tables, session: file })
            }
        };
        let speed_limit = speed_limit(&simulation);
        let simulated = simulation.steps_per_frame() as f64 * simulation.dt();
        Ok(Practice {
            tuning: Tuning::new(source),
            gpu,
            out: out.map(Path::to_path_buf),
            attempt: 1,
            written,
            unwritten: None,
            simulation,
            leader,
            state: State::Paused,
            records: Vec::new(),
            session,
            timing: Timing { simulated, ..Default::default() },
            speed_limit,
            limited_frames: 0,
            started: None,
            fresh: None,
            latency: Latency::default(),
            freshly_changed: false,
            marks: Vec::new(),
            wants_band: false,
            band: None,
            no_band: None,
            last_drawn: None,
            scene,
        })
    }

    /// Switches the band around the force on or off, from the next frame on; frames that went before get theirs by and by.
    pub fn show_band(&mut self, on: bool) {
        if on == self.wants_band {
            return;
        }
        (self.wants_band, self.band, self.no_band) = (on, None, None);
        if !on {
            return;
        }
        if !self.session.changes.is_empty() {
            self.no_band = Some(texts::BAND_ENDED.into());
            return;
        }
        match Band::of(&self.simulation, &self.tuning.source, &self.session.poses) {
            Ok(band) => {
                self.band = Some(band);
                self.add_column();
            }
            Err(error) => self.no_band = Some(error.to_string()),
        }
    }

    /// Begins the tables anew, with the column of the band.
    fn add_column(&mut self) {
        let Some(written) = self.written.as_mut().filter(|_| self.unwritten.is_none()) else { return };
        let model = &self.simulation.model;
        let driven = DrivenFace::of_scene(&self.scene.faces, &model.mesh);
        match Tables::with_band(&written.folder, &driven, model.has_bore(), &self.scene, &self.records, true) {
            Ok(tables) => written.tables = tables,
            Err(error) => self.hold_back(error),
        }
    }

    /// The companion does not know what was changed in a scene that runs.
    fn end_band(&mut self) {
        if self.band.take().is_some() {
            self.no_band = Some(texts::BAND_ENDED.into());
        }
    }

    /// The same from the beginning.
    ///
    /// # Errors
    /// As [`Practice::new`].
    pub fn again(&mut self, leader: Leader) -> Result<()> {
        self.save()?;
        let (scene, source, gpu) = (self.scene.clone(), self.tuning.source.clone(), self.gpu.clone());
        let simulation = Simulation::for_purpose(scene.clone(), Some(gpu.clone()), purpose(leader))?;
        self.begin(simulation, scene, source, leader)
    }

    /// Begins with a simulation at its beginning.
    fn begin(&mut self, simulation: Simulation, scene: Scene, source: Source, leader: Leader) -> Result<()> {
        let gpu = self.gpu.clone();
        let (out, attempt) = (self.out.clone(), self.attempt + u32::from(!self.records.is_empty()));
        // The attempt before keeps its folder; one without a frame leaves its place to the next.
        let folder = out.as_deref().map(|out| match attempt {
            1 => out.to_path_buf(),
            n => PathBuf::from(format!("{}_{n}", out.display())),
        });
        self.written = None;
        // What the window was opened with stays what one goes back to.
        let first = self.tuning.opened_with();
        let mut next = Practice::with(simulation, scene, source, gpu, leader, folder.as_deref(), true)?;
        next.tuning.set_opened_with(first);
        next.show_band(self.wants_band);
        *self = Practice { out, attempt, latency: self.latency, ..next };
        Ok(())
    }

    /// Makes the changes that a session made before its next frame.
    ///
    /// # Errors
    /// As [`Session::change`].
    pub fn follow(&mut self, session: &Session) -> Result<Renewed> {
        let frame = self.session.poses.len() as u64;
        let Some(last) = session.changes.iter().rfind(|change| change.frame == frame) else {
            return Ok(Renewed::Nothing);
        };
        session.change(&mut self.simulation, frame)?;
        self.tuning.source.overrides.clone_from(&last.overrides);
        self.session.changes.extend(session.changes.iter().filter(|change| change.frame == frame).cloned());
        self.end_band();
        self.scene = self.tuning.source.scene()?;
        self.timing.simulated = self.simulation.steps_per_frame() as f64 * self.simulation.dt();
        Ok(Renewed::Buffers)
    }

    /// What its simulation is made for.
    pub fn purpose(&self) -> Purpose {
        purpose(self.leader)
    }

    /// Takes the changes that are ready; call it between frames.
    ///
    /// # Errors
    /// What befalls the engine, and what the folder of a new attempt cannot take.
    pub fn take_changes(&mut self) -> Result<Renewed> {
        let taken = match self.tuning.take(&mut self.simulation, &self.gpu, purpose(self.leader)) {
            Ok(taken) => taken,
            Err(error @ (Error::Diverged { .. } | Error::Device(_))) => {
                self.state = State::Stopped(error.to_string());
                return Ok(Renewed::Nothing);
            }
            Err(error) => return Err(error),
        };
        let renewed = match taken {
            Taken::Nothing => return Ok(Renewed::Nothing),
            Taken::Constants => Renewed::Constants,
            Taken::Engine => Renewed::Buffers,
            Taken::Simulation(source, simulation) => {
                self.save()?;
                let (leader, runs) = (self.leader, self.state == State::Running);
                let paces = std::mem::take(&mut self.tuning.paces);
                self.begin(*simulation, source.scene()?, source, leader)?;
                self.tuning.paces = paces;
                // What ran goes on running, from its beginning.
                if runs {
                    self.state = State::Running;
                }
                return Ok(Renewed::Attempt);
            }
        };
        // The session says which frame is the first that has it.
        let frame = self.session.poses.len() as u64;
        self.end_band();
        self.session.changes.push(SceneChange { frame, overrides: self.tuning.source.overrides.clone() });
        self.scene = self.tuning.source.scene()?;
        self.speed_limit = speed_limit(&self.simulation);
        self.freshly_changed = true;
        // What was before had other constants.
        self.marks.clear();
        self.timing.simulated = self.simulation.steps_per_frame() as f64 * self.simulation.dt();
        Ok(renewed)
    }

    /// The scene that runs, and what changes it.
    pub fn tunable(&mut self) -> (&Scene, &mut Tuning) {
        (&self.scene, &mut self.tuning)
    }

    pub fn scene(&self) -> &Scene {
        &self.scene
    }

    /// Where this attempt is written to.
    pub fn folder(&self) -> Option<&Path> {
        self.written.as_ref().map(|written| written.folder.path())
    }

    /// Where the tool is at the end of the last frame that was started.
    pub fn depth(&self) -> f64 {
        self.simulation.hand().map_or_else(|| self.records.last().map_or(0.0, |r| r.depth), |pose| pose.depth)
    }

    /// Gives the device the next frame, led by what the hand wants.
    ///
    /// # Errors
    /// `Error::Device`.
    pub fn start(&mut self, hand: &mut dyn InputDevice) -> Result<()> {
        if let Some(now) = self.simulation.hand() {
            // Nothing is under way: what ends next has the input.
            self.fresh = hand.fresh_input().map(|since| (since, self.records.len() as u64));
            // The first frame is a single step: the way of a whole frame in it would be a blow that stores energy no work paid for.
            let first = self.session.poses.is_empty();
            let duration = if first { self.simulation.end_of(0) } else { self.timing.simulated };
            let wanted = hand.pose(&now, duration);
            let pose = self.within_reach(&now, wanted, duration);
            self.session.poses.push(pose);
            self.simulation.lead(&pose);
            if let Some(band) = &mut self.band {
                band.lead(&pose);
            }
        }
        self.started = Some(Instant::now());
        self.simulation.start_frames()
    }

    /// True where a hand may choose the angle and the point of entry.
    pub fn path_is_free(&self) -> bool {
        self.simulation.model.puncture.as_ref().is_some_and(|p| p.free.is_some())
    }

    /// What the tissue can follow of what the hand wants.
    fn within_reach(&mut self, now: &HandPose, wanted: HandPose, duration: f64) -> HandPose {
        let reach = Reach::of(&self.simulation.model, self.speed_limit);
        let (pose, limited) = reach.within(now, &wanted, duration);
        self.limited_frames += u64::from(limited);
        pose
    }

    /// Waits for the results of the frame that was started, and keeps them.
    ///
    /// # Errors
    /// What the folder cannot take. A run that the guard stops is a state, no error.
    pub fn finish(&mut self, hand: &mut dyn InputDevice) -> Result<()> {
        match self.simulation.next_frame() {
            Ok(Some(record)) => {
                hand.feel(record.force.axial, record.force.lateral);
                if let Some((since, frames)) = self.fresh.take() {
                    self.latency.add(self.records.len() as u64 + 1 - frames, since.elapsed().as_secs_f64());
                }
                self.records.push(record);
                self.fill_band();
                if let Some((written, record)) = self.written.as_mut().zip(self.records.last())
                    && self.unwritten.is_none()
                    && let Err(error) = written.tables.append(record).and_then(|()| self.save())
                {
                    self.hold_back(error);
                }
                self.timing.done += self.timing.simulated;
                self.mark()?;
                if let Some(begin) = self.started.take() {
                    if std::mem::take(&mut self.freshly_changed)
                        && let Some(pace) = self.tuning.paces.last_mut()
                    {
                        pace.halted += begin.elapsed();
                        pace.whole += begin.elapsed();
                    }
                    Timing::smooth(&mut self.timing.physics, begin.elapsed().as_secs_f64());
                }
            }
            Ok(None) => self.state = State::Ended,
            Err(error @ (Error::Diverged { .. } | Error::Device(_))) => self.state = State::Stopped(error.to_string()),
            Err(error) => return Err(error),
        }
        Ok(())
    }

    /// The band of the last frame, and of some that still lack it.
    fn fill_band(&mut self) {
        if let Some(band) = &mut self.band {
            band.fill(&mut self.records);
            self.no_band = band.stopped().map(str::to_string);
        }
    }

    /// The folder takes nothing more: the run waits for the user, and goes on in memory.
    pub fn hold_back(&mut self, error: Error) {
        self.unwritten = Some(error.to_string());
        if self.state == State::Running {
            self.state = State::Paused;
        }
    }

    /// Writes everything anew, once there is room again.
    ///
    /// # Errors
    /// What the folder still cannot take; nothing in memory is lost.
    pub fn write_again(&mut self) -> Result<()> {
        let Some(written) = &self.written else { return Ok(()) };
        let model = &self.simulation.model;
        let driven = DrivenFace::of_scene(&self.scene.faces, &model.mesh);
        let folder = &written.folder;
        let band = self.band.is_some() || self.records.iter().any(|record| record.force_error.is_some());
        let tables = Tables::with_band(folder, &driven, model.has_bore(), &self.scene, &self.records, band);
        let session = || session_file(folder, self.leader, &self.session);
        let done = tables.and_then(|tables| Ok((tables, session()?))).map(|(tables, session)| {
            if let Some(written) = &mut self.written {
                (written.tables, written.session) = (tables, session);
            }
        });
        self.unwritten = done.as_ref().err().map(|error| error.to_string());
        done
    }

    /// Writes the session where there is room, when its own folder has none; tells where.
    pub fn rescue(&self) -> Option<PathBuf> {
        let place = std::env::temp_dir().join(format!("stylet-session-{}.json", std::process::id()));
        (self.leader == Leader::Hand && self.session.write(&place).is_ok()).then_some(place)
    }

    /// True where one can go back: a script is watched, and nothing of it is written.
    pub fn may_go_back(&self) -> bool {
        self.leader == Leader::Script && self.written.is_none() && !self.marks.is_empty()
    }

    /// Keeps this moment, where one may want to go back to it.
    fn mark(&mut self) -> Result<()> {
        if self.leader == Leader::Script
            && self.written.is_none()
            && self.marks.len() < MOST_MARKS
            && self.records.len() % MARK_EVERY == 1
        {
            self.marks.push(self.simulation.checkpoint()?);
        }
        Ok(())
    }

    /// Goes back to the last mark at or before `time` [s]; call it between frames. The way from there is computed again.
    ///
    /// # Errors
    /// `Error::Device`.
    pub fn go_back(&mut self, time: f64) -> Result<()> {
        let place = |mark: &Checkpoint| mark.frames as usize;
        let before = |mark: &Checkpoint| self.records.get(place(mark) - 1).is_some_and(|r| r.time <= time);
        let Some(index) = self.marks.iter().rposition(before) else { return Ok(()) };
        self.marks.truncate(index + 1);
        self.simulation.resume(&self.marks[index])?;
        self.records.truncate(place(&self.marks[index]));
        if let Some(band) = &mut self.band {
            band.go_back(&mut self.records);
        }
        if matches!(self.state, State::Ended | State::Stopped(_)) {
            self.state = State::Paused;
        }
        Ok(())
    }

    /// Notes that a frame was drawn.
    pub fn drawn(&mut self) {
        if let Some(before) = self.last_drawn.replace(Instant::now()) {
            Timing::smooth(&mut self.timing.between, before.elapsed().as_secs_f64());
        }
    }

    /// Writes what the hand did since the last time behind the session beside the tables.
    ///
    /// # Errors
    /// `Error::File`.
    pub fn save(&mut self) -> Result<()> {
        match self.written.as_mut().and_then(|written| written.session.as_mut()) {
            Some(file) => file.append(&self.session),
            None => Ok(()),
        }
    }

    /// What the attempt is worth; a run that was stopped is told, and not scored.
    ///
    /// # Errors
    /// `Error::Input` where nothing was recorded. A folder that takes no scores is told in the window.
    pub fn debrief(&mut self, reference: Option<&Score>) -> Result<Score> {
        let sample = |record: &FrameRecord| {
            let pose = self.simulation.tool_pose(record.time)?;
            Some(Sample { time: record.time, tip: pose.tip, direction: pose.direction })
        };
        let samples: Vec<Sample> = self.records.iter().filter_map(sample).collect();
        let mut score = Score::of(&self.scene, &samples, &self.records, reference)?;
        if let State::Stopped(reason) = &self.state {
            score.fail(reason.clone());
        }
        let kept = self.save().and_then(|()| match &self.written {
            Some(written) => score.write(&written.folder),
            None => Ok(()),
        });
        if let Err(error) = kept {
            self.hold_back(error);
        }
        Ok(score)
    }

    /// Where the tool is drawn: tip and direction at the end of the last frame that was started.
    pub fn tool_place(&self) -> Option<(DVec3, DVec3)> {
        let time = self.records.last().map_or(0.0, |r| r.time);
        let retreat = self.records.last().map_or(0.0, |r| r.needle.retreat);
        self.simulation.tool_pose(time).map(|pose| (pose.tip - pose.direction * retreat, pose.direction))
    }
}
