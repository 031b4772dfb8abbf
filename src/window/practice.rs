//! An insertion as it is practised: a simulation, the hand that leads it or the script of the scene, and what was recorded.
//!
//! Knows nothing of a window. One frame is [`Practice::start`] - the device computes, the window draws - and
//! [`Practice::finish`].

use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use glam::DVec3;

use super::band::Band;
use super::hand::{InputDevice, Recording};
use super::source::Source;
pub use super::times::{Latency, Timing};
use super::tuning::{Taken, Tuning};
use super::written::{Written, session_file};
use crate::gpu::Gpu;
use crate::needle::motion::HandPose;
use crate::observables::FrameRecord;
use crate::output::{DrivenFace, OutputFolder, Tables};
use crate::scene::Scene;
use crate::session::{SceneChange, Session};
use crate::simulation::change;
use crate::simulation::checkpoint::Checkpoint;
use crate::simulation::reach::{Reach, speed_limit};
use crate::simulation::{Purpose, Simulation};
use crate::training::kinematic::Sample;
use crate::training::score::Score;
use crate::words::say;
use crate::{Error, Result};

/// Frames between two moments of a script, or of an attempt that is seen again, that one can go back to: half a second. Beyond so many of
/// them every second one goes, and from there on they lie twice as far apart.
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

fn purpose(leader: Leader) -> Purpose {
    Purpose { led: leader == Leader::Hand, drawn: true, lanes: true }
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
    /// Who leads the attempt behind this one.
    next_leader: Leader,
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
    /// Moments that one can go back to, and the frames between two of them.
    marks: Vec<Checkpoint>,
    mark_every: usize,
    /// An attempt that is seen again: where its hand led the needle, frame by frame.
    replay: Option<Vec<HandPose>>,
    /// The moment that it is on its way to [s].
    heading: Option<f64>,
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
        let speed_limit = speed_limit(&simulation.model);
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
            next_leader: leader,
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
            mark_every: MARK_EVERY,
            replay: None,
            heading: None,
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
            self.no_band = Some(say("band-ended").into());
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
            self.no_band = Some(say("band-ended").into());
        }
    }

    /// The same from the beginning: made ready on a thread, and taken by [`Practice::take_changes`]. The run waits meanwhile.
    pub fn again(&mut self, leader: Leader) {
        if self.state == State::Running {
            self.state = State::Paused;
        }
        self.next_leader = leader;
        self.tuning.wish_for(self.tuning.coming().clone(), change::Reach::Start);
    }

    /// Where the attempt of a number goes: `out`, `out_2`, `out_3`, ...
    pub fn folder_of(out: &Path, attempt: u32) -> PathBuf {
        match attempt {
            1 => out.to_path_buf(),
            n => PathBuf::from(format!("{}_{n}", out.display())),
        }
    }

    /// The same as attempt number `attempt` of those that go to `out`.
    pub fn counted_from(self, out: Option<PathBuf>, attempt: u32) -> Self {
        Practice { out, attempt, ..self }
    }

    /// Number of the attempt behind this one; one without a frame leaves its place to the next, and seeing one again is none.
    pub fn next_attempt(&self) -> u32 {
        self.attempt + u32::from(!self.records.is_empty() && self.replay.is_none())
    }

    /// Begins with a simulation at its beginning.
    fn begin(&mut self, simulation: Simulation, scene: Scene, source: Source, leader: Leader) -> Result<()> {
        let gpu = self.gpu.clone();
        let (out, attempt) = (self.out.clone(), self.next_attempt());
        // The attempt before keeps its folder.
        let folder = out.as_deref().map(|out| Self::folder_of(out, attempt));
        self.written = None;
        // What the window was opened with stays what one goes back to.
        let first = self.tuning.opened_with();
        let mut next = Practice::with(simulation, scene, source, gpu, leader, folder.as_deref(), true)?;
        next.tuning.set_opened_with(first);
        next.show_band(self.wants_band);
        *self = Practice { out, attempt, latency: self.latency, ..next };
        Ok(())
    }

    /// Begins the attempt again as it was, led by what the hand did. Nothing of it is written; one can go to any moment of it.
    ///
    /// # Errors
    /// As [`Practice::new`]; `Error::Input` where no hand led, and where the scene was changed meanwhile.
    pub fn see_again(&mut self) -> Result<()> {
        self.save()?;
        let poses = match &self.replay {
            Some(poses) => poses.clone(),
            None if self.may_see_again() => self.session.poses.clone(),
            None => return Err(Error::input(say("replay-refused"), say("replay-refused-way-out"))),
        };
        let (scene, source, gpu) = (self.scene.clone(), self.tuning.source.clone(), self.gpu.clone());
        let simulation = Simulation::for_purpose(scene.clone(), Some(gpu.clone()), purpose(Leader::Hand))?;
        let (out, attempt, first) = (self.out.take(), self.next_attempt(), self.tuning.opened_with());
        let mut next = Practice::with(simulation, scene, source, gpu, Leader::Hand, None, false)?;
        next.tuning.set_opened_with(first);
        *self = Practice { out, attempt, latency: self.latency, replay: Some(poses), ..next };
        Ok(())
    }

    /// True where a hand led, and the scene stayed what it was.
    pub fn may_see_again(&self) -> bool {
        self.leader == Leader::Hand && self.session.changes.is_empty() && !self.session.poses.is_empty()
    }

    /// True while an attempt is seen again.
    pub fn is_replay(&self) -> bool {
        self.replay.is_some()
    }

    /// Length of the attempt that is seen again [frames].
    pub fn replay_frames(&self) -> usize {
        self.replay.as_ref().map_or(0, Vec::len)
    }

    /// Goes to a moment of an attempt that is seen again [s]: back at once, ahead by [`Practice::catch_up`]. Call it between frames.
    ///
    /// # Errors
    /// `Error::Device`.
    pub fn go_to(&mut self, time: f64) -> Result<()> {
        if self.records.last().is_some_and(|r| r.time > time) {
            self.go_back(time)?;
        }
        self.heading = Some(time);
        Ok(())
    }

    /// The moment that an attempt that is seen again is on its way to [s].
    pub fn heading(&self) -> Option<f64> {
        self.heading
    }

    /// True where frames are to be computed to get there.
    pub fn is_heading(&self) -> bool {
        self.heading.is_some()
    }

    /// Computes frames towards the moment that was asked for, for about `budget`; call it between frames.
    ///
    /// # Errors
    /// As [`Practice::finish`].
    pub fn catch_up(&mut self, budget: Duration) -> Result<()> {
        let (begin, state) = (Instant::now(), self.state.clone());
        while let Some(time) = self.heading {
            let reached = self.end_of_next().is_none_or(|end| end > time + 1e-9);
            if reached {
                self.heading = None;
            } else if begin.elapsed() >= budget {
                break;
            } else {
                // The poses of the attempt lead, whatever hand is there.
                let mut nobody = Recording::new(Vec::new());
                self.start(&mut nobody)?;
                self.finish(&mut nobody)?;
            }
        }
        if !matches!(self.state, State::Ended | State::Stopped(_)) {
            self.state = state;
        }
        Ok(())
    }

    /// End of the next frame of an attempt that is seen again [s]; `None` behind its last.
    fn end_of_next(&self) -> Option<f64> {
        let more = matches!(self.state, State::Running | State::Paused) && self.records.len() < self.replay_frames();
        more.then(|| self.simulation.end_of(self.records.len() as u64))
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
        // Other kernels serve the attempt that runs.
        let taken = match self.tuning.take(&mut self.simulation, &self.gpu, purpose(self.next_leader)) {
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
                let (leader, runs) = (self.next_leader, self.state == State::Running);
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
        self.speed_limit = speed_limit(&self.simulation.model);
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
        if let Some(poses) = &self.replay {
            // None is left: nothing is started, and the run is at its end.
            if let Some(pose) = poses.get(self.session.poses.len()).copied() {
                self.session.poses.push(pose);
                self.simulation.lead(&pose);
                if let Some(band) = &mut self.band {
                    band.lead(&pose);
                }
            }
        } else if let Some(now) = self.simulation.hand() {
            // Nothing is under way: what ends next has the input.
            self.fresh = hand.fresh_input().map(|since| (since, self.records.len() as u64));
            // The first frame is a single step: the way of a whole frame in it would be a blow that stores energy no work paid for.
            let first = self.session.poses.is_empty();
            let duration = if first { self.simulation.end_of(0) } else { self.timing.simulated };
            let wanted = hand.pose(&now, duration);
            let pose = self.within_reach(&now, wanted, duration, hand.places_the_tip());
            self.session.poses.push(pose);
            self.simulation.lead(&pose);
            if let Some(band) = &mut self.band {
                band.lead(&pose);
            }
        }
        self.started = Some(Instant::now());
        self.simulation.start_frames()
    }

    /// True before the first frame of an attempt that a hand leads: its first input begins it.
    pub fn waits_for_a_hand(&self) -> bool {
        self.leader == Leader::Hand && self.state == State::Paused && self.records.is_empty()
    }

    /// True where a hand may choose the angle and the point of entry.
    pub fn path_is_free(&self) -> bool {
        self.simulation.model.skin().is_some()
    }

    /// What the tissue can follow of what the hand wants.
    fn within_reach(&mut self, now: &HandPose, wanted: HandPose, duration: f64, places_the_tip: bool) -> HandPose {
        let reach = Reach::of(&self.simulation.model, self.speed_limit);
        let wanted = if places_the_tip { reach.behind_the_skin(wanted) } else { wanted };
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

    /// True where one can go back: a script is watched, or an attempt seen again, and nothing of it is written.
    pub fn may_go_back(&self) -> bool {
        self.is_marked() && !self.marks.is_empty()
    }

    fn is_marked(&self) -> bool {
        (self.leader == Leader::Script || self.replay.is_some()) && self.written.is_none()
    }

    /// Keeps this moment, where one may want to go back to it.
    fn mark(&mut self) -> Result<()> {
        // The first frame is a mark whatever their distance: there is always one to go back to.
        if !self.is_marked() || self.records.len() % self.mark_every != 1 {
            return Ok(());
        }
        if self.marks.len() == MOST_MARKS {
            self.mark_every *= 2;
            let every = self.mark_every as u64;
            self.marks.retain(|mark| mark.frames % every == 1);
            if self.records.len() % self.mark_every != 1 {
                return Ok(());
            }
        }
        self.marks.push(self.simulation.checkpoint()?);
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
        self.simulation.forget_the_lead();
        self.records.truncate(place(&self.marks[index]));
        if self.replay.is_some() {
            self.session.poses.truncate(self.records.len());
        }
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
        let samples = self.samples();
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

    /// The needle at the end of a frame that was recorded.
    pub fn sample(&self, record: &FrameRecord) -> Option<Sample> {
        let pose = self.simulation.tool_pose(record.time)?;
        Some(Sample { time: record.time, tip: pose.tip, direction: pose.direction })
    }

    /// The same of all frames.
    pub fn samples(&self) -> Vec<Sample> {
        self.records.iter().filter_map(|record| self.sample(record)).collect()
    }

    /// Where the tool is drawn: tip and direction at the end of the last frame that was started.
    pub fn tool_place(&self) -> Option<(DVec3, DVec3)> {
        let time = self.records.last().map_or(0.0, |r| r.time);
        let retreat = self.records.last().map_or(0.0, |r| r.needle.retreat);
        self.simulation.tool_pose(time).map(|pose| (pose.tip - pose.direction * retreat, pose.direction))
    }
}
