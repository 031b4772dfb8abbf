//! Draws one scene: its parts, then its pace, so that it takes the work that is meant.

mod effects;
mod fitting;
mod needle;
mod opened;
mod sample;
mod tissue;

use std::path::{Path, PathBuf};

use self::sample::tetrahedra;
use super::numbers::{Numbers, list, written};
use crate::scene::Scene;

/// Part of the scenes that are drawn within what a user would do; whether a scene is so is then measured, not remembered.
const TAME: f64 = 0.75;

/// Part of the scenes that hold one deliberate mistake.
const MISTAKEN: f64 = 0.04;

/// One random scene.
#[derive(Debug, Clone)]
pub struct RandomScene {
    pub seed: u64,
    pub index: u64,
    /// Stem of its file.
    pub name: String,
    /// The scene, without a head of comments.
    pub text: String,
    /// Name and text of the mesh file beside it, if it needs one.
    pub mesh: Option<(String, String)>,
    /// What its refusal must contain, where it holds a mistake.
    pub mistake: Option<&'static str>,
}

impl RandomScene {
    /// The scene `index` of `seed`. Its mesh, if it has one, is written into `folder`.
    ///
    /// # Errors
    /// Where the mesh cannot be written.
    pub fn make(seed: u64, index: u64, folder: &Path) -> crate::Result<Self> {
        let mut numbers = Numbers::of(seed, index);
        let tame = numbers.chance(TAME);
        let mut draft = Draft::draw(&mut numbers, tame);
        draft.title = format!("random {seed} {index}");
        let name = format!("random_{seed}_{index}");
        let mesh = draft.mesh_cells.map(|cells| {
            let (file, jitter) = (format!("{name}.msh"), numbers.between(0.0, 0.15));
            (file, tetrahedra(&mut numbers, draft.size, cells, jitter))
        });
        if let Some((file, text)) = &mesh {
            let path = folder.join(file);
            std::fs::write(&path, text).map_err(|source| crate::Error::file(&path, source))?;
            draft.mesh_file = Some(file.clone());
        }
        let path = folder.join(format!("{name}.toml"));
        draft.open_the_path((seed, index), tame, &path);
        draft.fit(&path);
        let mistake = numbers.chance(MISTAKEN).then(|| draft.mistake(&mut numbers));
        Ok(RandomScene { seed, index, name, text: draft.text(), mesh, mistake })
    }

    /// Where its file lies in `folder`.
    pub fn path(&self, folder: &Path) -> PathBuf {
        folder.join(format!("{}.toml", self.name))
    }

    /// The scene as the reader of scene files has it.
    ///
    /// # Errors
    /// Those of [`Scene::parse`].
    pub fn scene(&self, folder: &Path) -> crate::Result<Scene> {
        Scene::parse(&self.path(folder), &self.text, &[])
    }
}

/// A phase whose speed is still to be settled; lengths in mm, times in s.
#[derive(Debug, Clone)]
enum Phase {
    Insert { speed: f64, depth: f64 },
    Withdraw { speed: f64, depth: f64 },
    Hold { duration: f64 },
    Move { speed: f64, to: [f64; 3] },
    Turn { rate: f64, angle: f64, azimuth: f64 },
    Reposition { entry: [f64; 2], angle: f64, azimuth: f64 },
}

/// What [solver] says of mass scaling.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Scaling {
    Absent,
    Auto,
    Factor(f64),
}

/// A scene whose pace and cells may still change.
#[derive(Debug, Clone, Default)]
struct Draft {
    title: String,
    effects: Vec<&'static str>,
    size: [f64; 3],
    /// [mm]
    cell: f64,
    /// Cells along the edges of a mesh of tetrahedra.
    mesh_cells: Option<[usize; 3]>,
    mesh_file: Option<String>,
    /// Other lines of [tissue].
    tissue: Vec<String>,
    /// Material, regions, tool.
    body: String,
    /// Lines of [motion] before the phases.
    motion: Vec<String>,
    phases: Vec<Phase>,
    /// Amplitude [mm] and frequency [Hz].
    vibration: Option<(f64, f64)>,
    /// Face and lines with `{}` where a time stands, and that time [s].
    faces: Vec<(&'static str, String, f64)>,
    /// Tables of effects and targets.
    tables: String,
    scaling: Option<Scaling>,
    solver: Vec<String>,
    /// Of a scene without a tool [s].
    duration: Option<f64>,
    /// Wanted frames, and the rate that gives them [Hz].
    frames: f64,
    frame_rate: f64,
    /// The scene's own step over the stable one, and that step [us].
    own_step: Option<f64>,
    time_step: Option<f64>,
    /// Failure displacement over the least that does not snap back, and that displacement [mm].
    damage: Option<f64>,
    failure: f64,
    /// Everything moves so many times as fast, at most so many.
    pace: f64,
    most_pace: f64,
}

/// A material as drawn.
struct Drawn {
    lines: Vec<String>,
    /// [Pa]
    shear: f64,
    young: f64,
    bulk: f64,
    /// [kg/m^3]
    density: f64,
}

impl Draft {
    fn draw(n: &mut Numbers, tame: bool) -> Self {
        let mut draft = Draft {
            pace: 1.0,
            most_pace: f64::INFINITY,
            frames: n.between(30.0, 150.0).round(),
            failure: 100.0,
            ..Draft::default()
        };
        match n.unit() {
            x if x < 0.7 => draft.needle(n, tame),
            x if x < 0.81 => draft.indenter(n, tame),
            _ => draft.sample(n, tame),
        }
        draft.solver_keys(n, tame);
        draft
    }

    /// Changes one thing so that the scene must be refused; what the refusal must contain.
    fn mistake(&mut self, n: &mut Numbers) -> &'static str {
        let tool = !self.phases.is_empty();
        match n.below(if tool { 8 } else { 4 }) {
            0 => {
                self.effects.push("puncutre");
                "no effect called \"puncutre\""
            }
            1 => {
                self.solver.push("saftey = 0.5".into());
                "unknown field `saftey`"
            }
            2 => {
                self.body = self.body.replacen("[material]\n", "[material]\npoisson_ratio = 0.5\n#", 1);
                "poisson_ratio"
            }
            3 => {
                self.solver.push("hourglass_quartic = -1.0".into());
                "solver.hourglass_quartic"
            }
            4 => {
                self.phases.insert(0, Phase::Withdraw { speed: 1.0, depth: -5.0 });
                "withdraws before it inserts"
            }
            5 => {
                self.phases[0] = Phase::Insert { speed: 0.0, depth: 3.0 };
                "motion.phase.0.speed_mm_s"
            }
            6 => {
                // A table that is there already would be no TOML at all.
                for tool in ["flat_punch", "sphere"] {
                    let table = format!("[{tool}]\n");
                    if !self.body.contains(&table) {
                        self.body += &format!("{table}radius_mm = 3.0\n\n");
                    }
                }
                "tools"
            }
            _ => {
                self.motion.retain(|line| !line.starts_with("entry_mm"));
                self.motion.insert(0, "entry_mm = [500.0, 0.0]".into());
                "outside the top face"
            }
        }
    }

    fn text(&self) -> String {
        let mut text = format!("title = \"{}\"\neffects = {:?}\n\n[tissue]\n", self.title, self.effects);
        let mut line = |out: &str| {
            text += out;
            text.push('\n');
        };
        match &self.mesh_file {
            Some(file) => line(&format!("mesh = \"{file}\"\nunit = \"mm\"")),
            None => {
                line(&format!("size_mm = {}\ncell_size_mm = {}", list(&self.size), written(self.cell)));
                self.tissue.iter().for_each(|l| line(l));
            }
        }
        line("");
        line(self.body.trim_end());
        let pace = self.pace;
        if !self.phases.is_empty() {
            if !self.motion.is_empty() {
                line("\n[motion]");
                self.motion.iter().for_each(|l| line(l));
            }
            if let Some((amplitude, frequency)) = self.vibration {
                line("\n[motion.vibration]");
                line(&format!("amplitude_mm = {}", written(amplitude)));
                line(&format!("frequency_hz = {}", written((frequency * pace).min(1000.0))));
            }
            self.phases.iter().for_each(|phase| line(&format!("\n[[motion.phase]]\n{}", phase.text(pace))));
        }
        line("");
        line(self.tables.trim_end());
        if self.damage.is_some() {
            line(&format!("\n[damage]\nfailure_displacement_mm = {}", written(self.failure)));
        }
        if !self.faces.is_empty() {
            line("\n[boundaries]");
            for (key, value, time) in &self.faces {
                line(&format!("{key} = {}", value.replace("{}", &written(time / pace))));
            }
        }
        line("\n[solver]");
        match self.scaling {
            Some(Scaling::Auto) => line("mass_scaling = \"auto\""),
            Some(Scaling::Factor(factor)) => line(&format!("mass_scaling = {}", written(factor))),
            _ => {}
        }
        if let Some(step) = self.time_step {
            line(&format!("time_step_us = {}", written(step)));
        }
        if let Some(duration) = self.duration {
            line(&format!("duration_s = {}", written(duration / pace)));
        }
        line(&format!("frame_rate_hz = {}", written(self.frame_rate)));
        self.solver.iter().for_each(|l| line(l));
        text
    }
}

impl Phase {
    fn text(&self, pace: f64) -> String {
        let fast = |speed: f64| written((speed * pace).min(1000.0));
        match self {
            Phase::Insert { speed, depth } => {
                format!("kind = \"insert\"\nspeed_mm_s = {}\ndepth_mm = {}", fast(*speed), written(*depth))
            }
            Phase::Withdraw { speed, depth } => {
                format!("kind = \"withdraw\"\nspeed_mm_s = {}\ndepth_mm = {}", fast(*speed), written(*depth))
            }
            Phase::Hold { duration } => format!("kind = \"hold\"\nduration_s = {}", written(duration / pace)),
            Phase::Move { speed, to } => {
                format!("kind = \"move\"\nspeed_mm_s = {}\nto_mm = {}", fast(*speed), list(to))
            }
            Phase::Turn { rate, angle, azimuth } => format!(
                "kind = \"turn\"\nrate_deg_s = {}\nangle_deg = {}\nazimuth_deg = {}",
                written((rate * pace).min(3600.0)),
                written(*angle),
                written(*azimuth)
            ),
            Phase::Reposition { entry, angle, azimuth } => format!(
                "kind = \"reposition\"\nentry_mm = {}\nangle_deg = {}\nazimuth_deg = {}",
                list(entry),
                written(*angle),
                written(*azimuth)
            ),
        }
    }
}
