//! Draws one scene: its parts, then its pace, so that it takes the work that is meant.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use super::numbers::{Numbers, list, written};
use super::{MOST_CELL_STEPS, MOST_CELLS};
use crate::engine::stable_dt::wave_speed_bound;
use crate::material::ElasticLaw;
use crate::mesh::Mesh;
use crate::model::Model;
use crate::scene::{Scene, needles, presets};
use crate::simulation::choose_step;

/// Part of the scenes that are drawn within what a user would do; whether a scene is so is then measured, not remembered.
const TAME: f64 = 0.75;

/// Part of the shear wave speed, and speed [mm/s], that a tool of a tame scene keeps below.
const TAME_MACH: f64 = 0.09;
const TAME_SPEED: f64 = 150.0;

/// Part of the scenes that hold one deliberate mistake.
const MISTAKEN: f64 = 0.04;

/// Changes of pace and cells until a scene fits its bounds.
const FITTINGS: usize = 12;

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
        draft.fit(&folder.join(format!("{name}.toml")));
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

    /// A needle goes into a block.
    fn needle(&mut self, n: &mut Numbers, tame: bool) {
        let gauges: Vec<&needles::NeedlePreset> = needles::needles().iter().collect();
        let gauge = gauges[n.below(if tame { 7 } else { gauges.len() })];
        let by_gauge = n.chance(0.7);
        let diameter = if by_gauge { gauge.outer_diameter * 1e3 } else { n.between(0.8, 2.2) };
        let fine = if tame { n.between(0.35, 0.7) } else { n.log(0.45, 1.8) };
        self.cell = (fine * diameter).clamp(0.4, 1.3);
        let h = self.cell;
        let radius = 0.5 * diameter;
        let free = n.chance(0.18);
        let hollow = !free && n.chance(0.12);
        let slit = !free && !hollow && n.chance(0.15);
        let upright = hollow || n.chance(0.45);
        let angle: f64 = match upright {
            true => 0.0,
            false if tame => n.between(3.0, 50.0).round(),
            false => n.between(3.0, 78.0).round(),
        };
        let azimuth = if slit { 90.0 * n.below(4) as f64 } else { n.between(0.0, 359.0).round() };
        let wide = |n: &mut Numbers| (h * n.between(11.0, 16.0)).max(2.0 * radius + 7.0 + 2.0 * h);
        self.size = [wide(n), wide(n), (h * n.between(9.0, 13.0)).max(6.0)];
        let entry = [n.between(-1.5, 1.5), n.between(-1.5, 1.5)].map(|x| if n.chance(0.3) { 0.0 } else { x });
        let soft = self.tissue_keys(n, tame);
        self.axis_keys(n);
        // How deep the path may go.
        let (sin, cos) = angle.to_radians().sin_cos();
        let (heading_y, heading_x) = azimuth.to_radians().sin_cos();
        let keep = if tame { 2.0 * h } else { 1.02 };
        let sideways = [(heading_x, 0), (heading_y, 1)]
            .map(|(part, axis)| {
                let room = 0.5 * self.size[axis] - radius - keep.max(1.05) - entry[axis] * part.signum();
                room / (sin * part.abs()).max(1e-9)
            })
            .into_iter()
            .fold(f64::INFINITY, f64::min);
        let deepest = ((self.size[2] - keep.max(1.05)) / cos).min(sideways).max(1.0);
        let through = !tame && !slit && !hollow && !free && angle == 0.0 && n.chance(0.15);
        let depth = match through {
            true => self.size[2] + n.between(1.0, 3.0),
            false => deepest * n.between(0.4, 0.95),
        };
        if through {
            self.faces.push(("z_min", "\"free\"".into(), 0.0));
        } else {
            self.other_faces(n);
        }
        self.effects.push("puncture");
        // The tool.
        let mut tool = String::from("[needle]\n");
        match by_gauge {
            true => writeln!(tool, "gauge = \"{}\"", gauge.gauge),
            false => writeln!(tool, "outer_diameter_mm = {}", written(diameter)),
        }
        .expect("text grows");
        if hollow {
            writeln!(
                tool,
                "bore_diameter_mm = {}\ntip_length_mm = {}\ncutting_edge = {}\nbore_friction = {}",
                written(diameter * n.between(0.55, 0.8)),
                written(n.between(0.6, 1.6)),
                written(n.pick(&[0.0, 0.25, 0.5, 1.0])),
                written(n.pick(&[0.0, 0.05, 0.1, 0.3]))
            )
        } else {
            match n.below(3) {
                0 => writeln!(tool, "tip_half_angle_deg = {}", written(n.pick(&[10.0, 15.0, 18.0, 25.0, 40.0]))),
                1 => writeln!(tool, "tip_length_mm = {}", written(diameter * n.between(0.8, 3.0))),
                _ => writeln!(
                    tool,
                    "bevel_angle_deg = {}\nbevel_heading_deg = {}",
                    written(n.pick(&[12.0, 20.0, 30.0, 45.0])),
                    written(45.0 * n.below(8) as f64)
                ),
            }
        }
        .expect("text grows");
        let flexible = !free && !hollow && n.chance(0.14);
        if n.chance(0.2) {
            writeln!(tool, "material = \"{}\"", n.pick(&["steel-304", "nitinol", "tungsten-carbide"])).expect("grows");
        }
        self.body += &tool;
        self.body.push('\n');
        // The motion.
        if entry != [0.0, 0.0] {
            self.motion.push(format!("entry_mm = {}", list(&entry)));
        }
        if angle > 0.0 {
            if !slit && n.chance(0.2) {
                self.motion.push(format!("direction = {}", list(&[sin * heading_x, sin * heading_y, -cos])));
            } else {
                self.motion.push(format!("angle_deg = {}\nazimuth_deg = {}", written(angle), written(azimuth)));
            }
        }
        let speed = self.speed(n, tame, &soft);
        self.insertion(n, speed, depth, deepest);
        if free {
            self.free_motion(n, speed, depth, [entry[0], entry[1], angle, azimuth], tame);
        }
        if !flexible && n.chance(0.05) {
            let amplitude = n.between(0.02, 0.2);
            self.vibration = Some((amplitude, speed / amplitude * n.between(0.05, 0.3)));
        }
        let force = self.puncture(n, tame, free, diameter, &soft);
        if hollow || slit {
            self.cohesive(n, tame, &soft, &[], true);
        }
        if !free && n.chance(0.15) {
            self.adhesion(n, force);
        }
        if flexible {
            self.effects.push("flexible_needle");
            let length = if tame { n.between(25.0, 90.0) } else { n.between(15.0, 150.0) }.max(depth + 5.0);
            write!(self.tables, "[flexible_needle]\nfree_length_mm = {}\n\n", written(length)).expect("text grows");
        }
        self.friction(n, 0.6);
        self.bulk_effects(n, tame, &soft);
        self.targets(n);
    }

    /// Speed [mm/s] and mass scaling of a needle or indenter, by the part of the shear wave speed at which it moves.
    fn speed(&mut self, n: &mut Numbers, tame: bool, soft: &Drawn) -> f64 {
        let wave = (soft.shear / soft.density).sqrt() * 1e3;
        let part = if tame { n.log(0.01, 0.07) } else { n.log(0.02, 0.5) };
        if tame {
            self.most_pace = TAME_MACH / part;
        }
        if n.chance(0.25) {
            self.scaling = Some(Scaling::Absent);
            let speed = if tame { (part * wave).min(TAME_SPEED) } else { part * wave };
            if tame {
                self.most_pace = (TAME_MACH * wave).min(TAME_SPEED) / speed;
            }
            return speed;
        }
        let speed = n.pick(&[0.5, 1.0, 2.0, 5.0, 10.0, 20.0, 50.0]);
        self.effects.push("mass_scaling");
        self.scaling = Some(match n.unit() {
            x if x < 0.3 => Scaling::Auto,
            _ => Scaling::Factor((part * wave / speed).powi(2).clamp(1.0, 1e8)),
        });
        speed
    }

    /// In, and what may follow.
    fn insertion(&mut self, n: &mut Numbers, speed: f64, depth: f64, deepest: f64) {
        self.phases.push(Phase::Insert { speed, depth });
        let while_in = depth / speed;
        if n.chance(0.35) {
            self.phases.push(Phase::Hold { duration: while_in * n.between(0.1, 0.5) });
        }
        if !n.chance(0.4) {
            return;
        }
        let out = n.pick(&[-1.0, 0.0, 0.3, 0.6]);
        let to = if out > 0.0 { out * depth } else { 2.0 * out };
        self.phases.push(Phase::Withdraw { speed, depth: to });
        if n.chance(0.5) {
            let again = (depth * n.between(0.7, 1.2)).min(deepest).max(to + 0.5);
            self.phases.push(Phase::Insert { speed, depth: again });
        }
    }

    /// A motion that leaves its line, or the word that frees the path.
    fn free_motion(&mut self, n: &mut Numbers, speed: f64, depth: f64, from: [f64; 4], tame: bool) {
        let [x, y, angle, azimuth] = from;
        let (sin, cos) = angle.to_radians().sin_cos();
        let (sy, sx) = azimuth.to_radians().sin_cos();
        match n.below(4) {
            0 => self.tables += "path = \"free\"\n",
            1 => {
                self.phases.truncate(1);
                let by = if tame { n.between(0.3, 1.0) } else { n.between(0.5, 3.0) };
                let heading = n.between(0.0, std::f64::consts::TAU);
                let tip = [x + depth * sin * sx, y + depth * sin * sy, -depth * cos];
                let to = [tip[0] + by * heading.cos(), tip[1] + by * heading.sin(), tip[2] + n.between(0.0, 1.0)];
                self.phases.push(Phase::Move { speed, to });
            }
            2 => {
                self.phases.truncate(1);
                let more = if tame { n.between(2.0, 8.0) } else { n.between(5.0, 25.0) };
                let rate = more / (depth / speed * n.between(0.3, 1.0));
                let leaning = if angle + more < 79.0 { angle + more } else { angle - more };
                self.phases.push(Phase::Turn { rate, angle: leaning, azimuth });
            }
            _ => {
                self.phases.truncate(1);
                self.phases.push(Phase::Withdraw { speed, depth: -2.0 });
                let entry = [-x - 0.5, y * 0.5];
                self.phases.push(Phase::Reposition { entry, angle: 0.0, azimuth: 0.0 });
                self.phases.push(Phase::Insert { speed, depth: (depth * cos * 0.7).max(1.0) });
            }
        }
    }

    /// A sphere or a punch presses on a block.
    fn indenter(&mut self, n: &mut Numbers, tame: bool) {
        self.cell = n.between(0.6, 1.0);
        let h = self.cell;
        self.size = [h * n.between(11.0, 15.0), h * n.between(11.0, 15.0), h * n.between(7.0, 11.0)];
        let soft = self.tissue_keys(n, tame);
        self.axis_keys(n);
        self.other_faces(n);
        let radius = h * if tame { n.between(2.5, 5.0) } else { n.between(1.0, 6.0) };
        if n.chance(0.6) {
            write!(self.body, "[sphere]\nradius_mm = {}\n\n", written(radius)).expect("text grows");
        } else {
            let bonded = if n.chance(0.5) { "bonded = true\n" } else { "" };
            write!(self.body, "[flat_punch]\nradius_mm = {}\n{bonded}\n", written(0.6 * radius)).expect("text grows");
        }
        if n.chance(0.95) {
            self.effects.push("indentation");
        }
        let most = (0.5 * radius).min(0.25 * self.size[2]);
        let depth =
            if tame { most * n.between(0.2, 0.9) } else { (most * n.between(0.5, 3.0)).min(0.6 * self.size[2]) };
        let speed = self.speed(n, tame, &soft);
        self.phases.push(Phase::Insert { speed, depth });
        if n.chance(0.4) {
            self.phases.push(Phase::Hold { duration: depth / speed * n.between(0.1, 1.0) });
        }
        if n.chance(0.5) {
            self.phases.push(Phase::Withdraw { speed, depth: n.pick(&[-0.5, 0.0, 0.5 * depth]) });
        }
        if n.chance(0.15) {
            write!(
                self.tables,
                "[indentation]\ncontact_stiffness_factor = {}\ncontact_damping = {}\n\n",
                written(n.log(0.3, 4.0)),
                written(n.between(0.0, 0.8))
            )
            .expect("text grows");
        }
        self.friction(n, 0.4);
        self.bulk_effects(n, tame, &soft);
        self.targets(n);
    }

    /// A block or a mesh without a tool: faces move or are loaded.
    fn sample(&mut self, n: &mut Numbers, tame: bool) {
        self.cell = n.between(0.5, 1.0);
        let h = self.cell;
        let counts = [5 + n.below(6), 5 + n.below(6), 5 + n.below(7)];
        self.size = counts.map(|count| count as f64 * h);
        if n.chance(0.3) {
            self.mesh_cells = Some(counts.map(|count| count.min(7)));
        }
        let soft = self.tissue_keys(n, tame);
        let height = self.size[2];
        let wave = (soft.shear / soft.density).sqrt() * 1e3;
        // Time that a shear wave takes through the block, several times.
        let transits = if tame { n.log(15.0, 80.0) } else { n.log(2.0, 40.0) };
        let mut time = transits * height / wave;
        let scaling = match n.unit() {
            x if x < 0.4 => Scaling::Absent,
            x if x < 0.7 => Scaling::Auto,
            _ => Scaling::Factor(n.log(1.0, 1e6)),
        };
        if scaling != Scaling::Absent {
            self.effects.push("mass_scaling");
        }
        if let Scaling::Factor(factor) = scaling {
            time *= factor.sqrt();
        }
        if scaling == Scaling::Auto {
            // Any time will do: the factor follows the speed.
            time = n.log(0.05, 2.0);
        }
        self.scaling = Some(scaling);
        let sides = n.pick(&["free", "free", "free", "roller", "fixed"]);
        let block = self.mesh_cells.is_none();
        for key in ["x_min", "x_max", "y_min", "y_max"] {
            if sides != "fixed" || key == "x_min" {
                self.faces.push((key, format!("\"{sides}\""), 0.0));
            } else {
                self.faces.push((key, "\"free\"".into(), 0.0));
            }
        }
        self.faces.push(("z_min", "\"fixed\"".into(), 0.0));
        let twist_free = sides == "free";
        let most = if tame { 0.3 } else { 0.7 };
        let strain = n.between(0.03, most);
        let line = match n.below(8) {
            0 => format!(
                "{{ fixed = [\"x\", \"y\", \"z\"], displacement_mm = {}, duration_s = {{}} }}",
                list(&[0.0, 0.0, -strain * height])
            ),
            1 => format!(
                "{{ fixed = [\"z\"], displacement_mm = {}, duration_s = {{}}{} }}",
                list(&[0.0, 0.0, 1.3 * strain * height]),
                if n.chance(0.3) { ", cycles = 2" } else { "" }
            ),
            2 | 4 if twist_free => format!(
                "{{ fixed = [\"x\", \"y\", \"z\"], rotation_deg = {}, duration_s = {{}} }}",
                written(strain * 200.0)
            ),
            3 | 5 if block => {
                let pull = n.between(-0.2, 0.25) * soft.young * 1e-3;
                let across = n.between(-0.05, 0.05) * soft.young * 1e-3;
                format!("{{ traction_kpa = {}, traction_ramp_s = {{}} }}", list(&[across, 0.0, pull]))
            }
            _ if twist_free => format!(
                "{{ fixed = [\"x\", \"y\", \"z\"], displacement_mm = {}, duration_s = {{}} }}",
                list(&[strain * height, 0.3 * strain * height, 0.0])
            ),
            _ => format!(
                "{{ fixed = [\"z\"], displacement_mm = {}, duration_s = {{}} }}",
                list(&[0.0, 0.0, -0.7 * strain * height])
            ),
        };
        let cycles = if line.contains("cycles") { 4.0 } else { 1.0 };
        self.faces.push(("z_max", line, time));
        self.duration = Some(time * cycles * n.between(1.0, 1.4));
        if block && n.chance(0.25) {
            let at = -h * (1 + n.below(counts[2] - 1)) as f64;
            self.cohesive(n, tame, &soft, &[at], false);
        }
        self.bulk_effects(n, tame, &soft);
        self.targets(n);
    }

    /// Material, regions and the block; the softest material.
    fn tissue_keys(&mut self, n: &mut Numbers, tame: bool) -> Drawn {
        let own = material(n, tame);
        self.body = format!("[material]\n{}\n\n", own.lines.join("\n"));
        let mut soft = Drawn { lines: Vec::new(), ..own };
        let [lx, ly, lz] = self.size;
        let count = if n.chance(0.4) { 1 + n.below(3) } else { 0 };
        for index in 0..count {
            let other = material(n, tame);
            if tame && !(1.0 / 25.0..25.0).contains(&(other.young / own.young)) {
                continue;
            }
            let lines: Vec<&String> = other.lines.iter().filter(|l| !l.starts_with("allow")).collect();
            let table = lines.iter().map(|l| l.as_str()).collect::<Vec<_>>().join(", ");
            let h = self.cell;
            let shape = match n.below(4) {
                0 | 1 if index == 0 => {
                    let thick = h * n.between(1.0, 3.0);
                    let top = if n.chance(0.7) { 0.0 } else { h * n.between(1.0, 3.0) };
                    format!("layer_mm = {}", list(&[top, (top + thick).min(lz)]))
                }
                // Each within the block.
                2 => format!(
                    "sphere_mm = {{ centre = {}, radius = {} }}",
                    list(&[n.between(-2.5, 2.5), n.between(-2.5, 2.5), -lz * n.between(0.25, 0.75)]),
                    written(h * n.between(1.3, 3.0))
                ),
                3 => {
                    let (x, z) = (n.between(-3.0, 3.0), -lz * n.between(0.3, 0.8));
                    format!(
                        "cylinder_mm = {{ from = {}, to = {}, radius = {} }}",
                        list(&[x, -ly, z]),
                        list(&[x, ly, z]),
                        written(h * n.between(1.2, 2.0))
                    )
                }
                _ => format!(
                    "box_mm = {{ low = {}, high = {} }}",
                    list(&[-0.3 * lx, -0.5 * ly, -0.9 * lz]),
                    list(&[0.3 * lx, 0.2 * ly, -0.5 * lz])
                ),
            };
            let membrane = if shape.starts_with("layer") && n.chance(0.4) {
                match n.chance(0.5) {
                    true => format!("membrane = {{ puncture_energy_mj = {} }}\n", written(n.log(0.02, 0.3))),
                    false => format!("membrane = {{ toughness_j_m2 = {} }}\n", written(n.log(20.0, 200.0))),
                }
            } else {
                String::new()
            };
            write!(self.body, "[[region]]\nname = \"part {index}\"\n{shape}\nmaterial = {{ {table} }}\n{membrane}\n")
                .expect("text grows");
            if other.shear < soft.shear {
                soft = Drawn { lines: Vec::new(), ..other };
            }
        }
        soft
    }

    /// How the grid lies.
    fn axis_keys(&mut self, n: &mut Numbers) {
        if n.chance(0.4) {
            let offset = [n.unit(), n.unit()].map(|x| if n.chance(0.3) { n.pick(&[0.0, 0.5, 1.0]) } else { x });
            self.tissue.push(format!("axis_offset_cells = {}", list(&offset)));
        }
        if n.chance(0.3) {
            self.tissue.push(format!("growth = {}", written(n.between(1.0, 1.6))));
        }
        if n.chance(0.3) {
            self.tissue.push(format!("fine_radius_mm = {}", written(n.between(1.5, 3.0))));
        }
    }

    /// Sides that are not held as a whole.
    fn other_faces(&mut self, n: &mut Numbers) {
        if n.chance(0.25) {
            for key in ["x_min", "x_max", "y_min", "y_max"] {
                if n.chance(0.5) {
                    self.faces.push((key, n.pick(&["\"free\"", "\"roller\""]).into(), 0.0));
                }
            }
        }
    }

    /// Tip forces; returns the puncture force [N].
    fn puncture(&mut self, n: &mut Numbers, tame: bool, free: bool, diameter: f64, soft: &Drawn) -> f64 {
        // `free_motion` left a word for this table.
        let path = std::mem::take(&mut self.tables);
        let mut table = String::new();
        let area = std::f64::consts::PI * (0.5e-3 * diameter).powi(2);
        let pressure = if tame { n.between(1.0, 6.5) } else { n.log(0.5, 60.0) };
        let bears = if tame { 2.8 * soft.bulk } else { f64::INFINITY };
        let force = ((pressure * soft.young).min(bears) * area).clamp(0.005, 20.0);
        let cutting = force * if tame { n.between(0.3, 0.9) } else { n.between(0.2, 1.1) };
        if tame || n.chance(0.9) {
            writeln!(table, "puncture_force_n = {}\ncutting_force_n = {}", written(force), written(cutting))
                .expect("text grows");
        }
        if n.chance(0.12) {
            writeln!(
                table,
                "rate_exponent = {}\nreference_speed_mm_s = {}",
                written(n.between(0.05, 0.4)),
                written(n.log(0.5, 20.0))
            )
            .expect("text grows");
        }
        if !tame && n.chance(0.3) {
            match n.below(6) {
                0 => writeln!(table, "transition_length_mm = {}", written(n.between(0.2, 2.0))),
                1 => writeln!(table, "tip_stiffness_n_mm = {}", written(n.log(0.5, 10.0))),
                2 => writeln!(table, "residual_stiffness = {}", written(n.log(0.002, 0.5))),
                3 => writeln!(table, "contact_stiffness_factor = {}", written(n.log(0.5, 8.0))),
                4 => writeln!(table, "contact_damping = {}", written(n.between(0.0, 1.0))),
                _ => writeln!(table, "entry_fade_mm = {}", written(n.log(0.3, 5.0))),
            }
            .expect("text grows");
        }
        if free && !path.is_empty() {
            table += &path;
        }
        if !table.is_empty() {
            write!(self.tables, "[puncture]\n{table}\n").expect("text grows");
        }
        force
    }

    /// Faces that separate, with planes across z at these heights [mm].
    fn cohesive(&mut self, n: &mut Numbers, tame: bool, soft: &Drawn, planes: &[f64], cut: bool) {
        self.effects.push("cohesive");
        let strength = soft.young * if tame { n.between(0.3, 2.5) } else { n.log(0.05, 10.0) };
        let factor = if n.chance(0.7) { 20.0 } else { n.log(5.0, 60.0) };
        // Opening at which the bond begins to fail [m], and the energy that ends it at a later one.
        let onset = strength / (factor * soft.young / (self.cell * 1e-3));
        let later = if tame { n.between(2.5, 20.0) } else { n.log(0.5, 60.0) };
        let energy = 0.5 * strength * onset * later;
        let mut table = format!("strength_kpa = {}\nenergy_j_m2 = {}\n", written(strength * 1e-3), written(energy));
        if factor != 20.0 {
            writeln!(table, "penalty_factor = {}", written(factor)).expect("text grows");
        }
        if n.chance(0.25) {
            let more = n.between(1.0, 2.0);
            writeln!(table, "shear_strength_kpa = {}", written(strength * 1e-3 * more)).expect("text grows");
            writeln!(table, "shear_energy_j_m2 = {}", written(energy * more * more)).expect("text grows");
        }
        let mut text = format!("[cohesive]\n{table}\n");
        let mut planes = planes.to_vec();
        if cut && n.chance(0.2) {
            planes.push(-self.size[2] * n.between(0.3, 0.7));
        }
        for at in planes {
            let driven = if cut && n.chance(0.5) { "tip_driven = true\n" } else { "" };
            write!(text, "[[cohesive.plane]]\naxis = \"z\"\nat_mm = {}\n{driven}\n", written(at)).expect("text grows");
        }
        self.tables += &text;
    }

    fn adhesion(&mut self, n: &mut Numbers, force: f64) {
        self.effects.push("adhesion");
        let held = force * n.between(0.1, 0.6);
        let kinetic = held * n.between(0.1, 0.6);
        let stiffness = n.between(0.5, 3.0);
        let distance = ((held - kinetic) / stiffness * n.between(1.2, 4.0)).max(0.1);
        write!(
            self.tables,
            "[adhesion]\nstatic_force_n = {}\nkinetic_force_n = {}\nstiffness_n_mm = {}\nsliding_distance_mm = {}\n\n",
            written(held),
            written(kinetic),
            written(stiffness),
            written(distance)
        )
        .expect("text grows");
    }

    fn friction(&mut self, n: &mut Numbers, probability: f64) {
        if !n.chance(probability) {
            return;
        }
        self.effects.push("friction");
        if n.chance(0.8) {
            let fade =
                if n.chance(0.15) { format!("fade_length_mm = {}\n", written(n.between(0.0, 5.0))) } else { "".into() };
            write!(
                self.tables,
                "[friction]\ncoefficient = {}\n{fade}\n",
                written(n.pick(&[0.0, 0.05, 0.1, 0.2, 0.3, 0.5]))
            )
            .expect("text grows");
        }
    }

    /// Gravity, plasticity, damage, fibres, viscosity.
    fn bulk_effects(&mut self, n: &mut Numbers, tame: bool, soft: &Drawn) {
        if n.chance(0.25) {
            self.effects.push("gravity");
            if n.chance(0.4) {
                let most = if tame { 9.81 } else { 60.0 };
                let vector = [n.between(-0.5, 0.5) * most, n.between(-0.5, 0.5) * most, -most * n.between(0.0, 0.8)];
                write!(self.tables, "[gravity]\nacceleration_m_s2 = {}\n\n", list(&vector)).expect("text grows");
            }
        }
        if n.chance(0.25) {
            self.effects.push("plasticity");
            if n.chance(0.7) {
                let stress = soft.young * if tame { n.between(0.15, 0.8) } else { n.log(0.02, 2.0) };
                let hardening = soft.young * if tame { n.between(0.5, 5.0) } else { n.between(0.0, 6.0) };
                write!(
                    self.tables,
                    "[plasticity]\nyield_stress_kpa = {}\nhardening_kpa = {}\n\n",
                    written(stress * 1e-3),
                    written(hardening * 1e-3)
                )
                .expect("text grows");
            }
            if n.chance(0.4) {
                self.effects.push("damage");
                self.damage = Some(if tame { n.between(1.3, 4.0) } else { n.log(0.8, 10.0) });
            }
        }
        if n.chance(0.2) {
            self.effects.push("fibres");
            let towards = [n.between(-1.0, 1.0), n.between(-1.0, 1.0), n.between(-1.0, 1.0)];
            let mut table = format!("direction = {}\n", list(&towards));
            if n.chance(0.6) {
                let (k1, k2) = match tame {
                    true => (n.between(0.1, 1.0), n.between(0.02, 1.0)),
                    false => (n.log(0.1, 10.0), n.log(0.02, 20.0)),
                };
                writeln!(table, "k1_kpa = {}\nk2 = {}", written(k1 * soft.shear * 1e-3), written(k2)).expect("grows");
            }
            write!(self.tables, "[fibres]\n{table}\n").expect("text grows");
        }
        if n.chance(0.2) {
            self.effects.push("viscoelastic");
            if n.chance(0.7) {
                let count = 1 + n.below(3);
                let g: Vec<f64> = (0..count).map(|_| n.between(0.05, 0.25)).collect();
                let tau: Vec<f64> = (0..count).map(|_| n.log(0.01, 20.0)).collect();
                write!(self.tables, "[viscoelastic]\ng = {}\ntau_s = {}\n\n", list(&g), list(&tau)).expect("grows");
            }
        }
    }

    fn targets(&mut self, n: &mut Numbers) {
        // They act on the block only.
        if self.mesh_cells.is_some() {
            return;
        }
        let count = if n.chance(0.3) { 1 + n.below(3) } else { 0 };
        for _ in 0..count {
            let position = [
                self.size[0] * n.between(-0.3, 0.3),
                self.size[1] * n.between(-0.3, 0.3),
                -self.size[2] * n.between(0.2, 0.9),
            ];
            write!(self.tables, "[[target]]\nposition_mm = {}\n\n", list(&position)).expect("text grows");
        }
    }

    fn solver_keys(&mut self, n: &mut Numbers, tame: bool) {
        if n.chance(0.3) {
            let safety = if tame { n.between(0.4, 0.85) } else { n.between(0.3, 1.0) };
            self.solver.push(format!("safety = {}", written(safety)));
        }
        if n.chance(0.3) {
            let damping = if tame { n.pick(&[0.0, 5.0, 20.0, 50.0]) } else { n.pick(&[0.0, 1.0, 100.0, 1000.0]) };
            self.solver.push(format!("mass_damping_per_s = {}", written(damping)));
        }
        if n.chance(0.1) {
            self.solver.push(format!("hourglass_stiffness = {}", written(n.log(0.05, 0.5))));
        }
        if n.chance(0.08) {
            self.own_step = Some(if tame { n.between(0.4, 0.85) } else { n.between(0.5, 1.15) });
        }
    }

    /// Settles pace, cells, frame rate, own step and failure displacement on the scene as the reader has it. A scene that is
    /// refused stays as it is.
    fn fit(&mut self, path: &Path) {
        self.frame_rate = 1000.0;
        for _ in 0..FITTINGS {
            let Ok(scene) = Scene::parse(path, &self.text(), &[]) else { return };
            let mesh = Mesh::of_scene(&scene);
            if mesh.cell_count() > MOST_CELLS && self.mesh_cells.is_none() {
                self.cell *= 1.08;
                continue;
            }
            if let (Some(part), true) = (self.damage, self.failure == 100.0) {
                self.failure = 1e3 * part * least_failure(&scene);
                continue;
            }
            let model = Model::new(scene, mesh);
            let stable = wave_speed_bound(&model);
            self.frame_rate = (self.frames / model.duration()).clamp(0.5, 5e4);
            if let (Some(part), None) = (self.own_step, self.time_step) {
                self.time_step = Some(part * stable * 1e6);
                continue;
            }
            // With the wanted frames, of which each is a whole number of steps.
            let steps = model.duration() / choose_step(&model, stable).0;
            let cost = steps * model.mesh.cell_count() as f64;
            if cost <= MOST_CELL_STEPS {
                return;
            }
            match self.scaling {
                // Its factor would undo every change of pace.
                Some(Scaling::Auto) => {
                    let factor = model.mass_scaling() * (1.2 * cost / MOST_CELL_STEPS).powi(2);
                    self.scaling = Some(Scaling::Factor(factor.min(1e8)));
                }
                _ => {
                    let wanted = self.pace * 1.1 * cost / MOST_CELL_STEPS;
                    self.pace = wanted.min(self.most_pace);
                    if wanted > self.most_pace {
                        self.shorten(self.most_pace / wanted);
                    }
                }
            }
            self.time_step = None;
        }
    }

    /// Shortens the way of the tool to this part of it; a millimetre stays.
    fn shorten(&mut self, part: f64) {
        let short = |depth: &mut f64| *depth = if *depth > 0.0 { (*depth * part).max(1.0) } else { *depth };
        for phase in &mut self.phases {
            match phase {
                Phase::Insert { depth, .. } | Phase::Withdraw { depth, .. } => short(depth),
                Phase::Hold { duration } => *duration *= part,
                _ => {}
            }
        }
        // A way back ends above where it began.
        let mut at = 0.0;
        for phase in &mut self.phases {
            match phase {
                Phase::Insert { depth, .. } => {
                    *depth = depth.max(at + 0.3);
                    at = *depth;
                }
                Phase::Withdraw { depth, .. } => {
                    *depth = depth.min(at - 0.3);
                    at = *depth;
                }
                _ => {}
            }
        }
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

/// Least failure displacement for which no cell of the fine zone snaps back, `sigma h/E` of the worst material [m].
fn least_failure(scene: &Scene) -> f64 {
    let worst = |material: &crate::effects::TissueMaterial| {
        let flow = material.plasticity.or(scene.effects.plasticity).unwrap_or_default();
        let onset = material.damage.or(scene.effects.damage).unwrap_or_default().onset;
        (flow.yield_stress + flow.hardening * onset) / material.law.youngs_modulus()
    };
    let regions = scene.regions.iter().map(|region| worst(&region.material));
    scene.tissue.cell_size * regions.fold(worst(&scene.material), f64::max)
}

/// A material of any kind, stated in any way.
fn material(n: &mut Numbers, tame: bool) -> Drawn {
    let all = presets::tissues();
    if n.chance(0.4) {
        let preset = &all[n.below(all.len())];
        if !(tame && preset.law.poisson_ratio() > 0.499) {
            return drawn(vec![format!("preset = \"{}\"", preset.name)], preset.law, preset.density);
        }
    }
    let shear = if tame { n.log(1.5e3, 50e3) } else { n.log(0.3e3, 200e3) };
    let nu = if tame { n.between(0.3, 0.49) } else { n.between(0.0, 0.498) };
    let kpa = |x: f64| written(x * 1e-3);
    let mut lines = Vec::new();
    match n.below(6) {
        0 => lines.push(format!("law = \"neo_hookean\"\nc10_kpa = {}", kpa(0.5 * shear))),
        1 => {
            let share = if tame { n.unit() } else { n.between(0.0, 1.4) };
            if n.chance(0.5) {
                lines.push("law = \"mooney_rivlin\"".into());
            }
            lines.push(format!(
                "c10_kpa = {}\nc01_kpa = {}",
                kpa(0.5 * share * shear),
                kpa(0.5 * (1.0 - share) * shear)
            ));
        }
        2 => {
            let (second, third) = match tame {
                true => (n.between(0.0, 1.5), n.between(0.0, 1.0)),
                false => (n.between(-0.3, 4.0), n.between(-0.1, 4.0)),
            };
            let c10 = 0.5 * shear;
            lines.push(format!(
                "law = \"yeoh\"\nc10_kpa = {}\nc20_kpa = {}\nc30_kpa = {}",
                kpa(c10),
                kpa(c10 * second),
                kpa(c10 * third)
            ));
        }
        3 => {
            let alpha = if tame { n.pick(&[1.3, 2.0, 3.0, 5.0, 8.0, -2.0, -4.0]) } else { n.between(-14.0, 20.0) };
            lines.push(format!("law = \"ogden\"\nmu_kpa = {}\nalpha = {}", kpa(shear), written(alpha)));
        }
        4 => {
            let b = if tame { n.between(0.3, 7.0) } else { n.between(-1.0, 20.0) };
            lines.push(format!("law = \"demiray\"\nmu_kpa = {}\nb = {}", kpa(shear), written(b)));
        }
        _ => {
            let young = 2.0 * shear * (1.0 + nu);
            match n.below(3) {
                0 => lines.push("law = \"neo_hookean\"".into()),
                1 => lines.push(format!("c10_share = {}", written(n.unit()))),
                _ => {}
            }
            lines.push(format!("youngs_modulus_kpa = {}\npoisson_ratio = {}", kpa(young), written(nu)));
        }
    }
    let bulk = presets::bulk_modulus_from_poisson(shear, nu);
    if !lines.last().is_some_and(|l| l.starts_with("youngs")) {
        match n.below(3) {
            0 => lines.push(format!("poisson_ratio = {}", written(nu))),
            1 => lines.push(format!("bulk_modulus_kpa = {}", kpa(bulk))),
            _ => lines.push(format!("d_per_mpa = {}", written(2e6 / bulk))),
        }
    }
    let mut density = 1060.0;
    if n.chance(0.2) {
        density = n.between(900.0, 1200.0).round();
        lines.push(format!("density_kg_m3 = {}", written(density)));
    }
    if !tame && n.chance(0.5) {
        lines.push("allow_limited = true".into());
    }
    let lines = lines.iter().flat_map(|l| l.lines().map(String::from).collect::<Vec<_>>()).collect();
    drawn(lines, ElasticLaw::mooney_rivlin(0.5 * shear, 0.0, bulk), density)
}

fn drawn(lines: Vec<String>, law: ElasticLaw, density: f64) -> Drawn {
    Drawn { lines, shear: law.shear_modulus(), young: law.youngs_modulus(), bulk: law.bulk_modulus, density }
}

/// A block of tetrahedra, six in each of `cells`, its inner nodes moved by up to `jitter` of a cell, as text of Gmsh 2.2.
fn tetrahedra(n: &mut Numbers, size: [f64; 3], cells: [usize; 3], jitter: f64) -> String {
    let [nx, ny, nz] = cells.map(|count| count + 1);
    let node = |i: usize, j: usize, k: usize| 1 + i + nx * (j + ny * k);
    let mut text = format!(
        "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$PhysicalNames\n1\n3 1 \"tissue\"\n$EndPhysicalNames\n$Nodes\n{}\n",
        nx * ny * nz
    );
    for k in 0..nz {
        for j in 0..ny {
            for i in 0..nx {
                let at: [f64; 3] = std::array::from_fn(|axis| {
                    let (index, count) = ([i, j, k][axis], cells[axis]);
                    let inner = index > 0 && index < count;
                    let moved = if inner { jitter * n.between(-1.0, 1.0) } else { 0.0 };
                    let low = if axis == 2 { -size[2] } else { -0.5 * size[axis] };
                    low + size[axis] * (index as f64 + moved) / count as f64
                });
                writeln!(text, "{} {} {} {}", node(i, j, k), written(at[0]), written(at[1]), written(at[2]))
                    .expect("text grows");
            }
        }
    }
    writeln!(text, "$EndNodes\n$Elements\n{}", 6 * cells.iter().product::<usize>()).expect("text grows");
    // The six orders in which a path goes along the edges from one corner to the opposite one.
    let orders = [[0, 1, 2], [0, 2, 1], [1, 0, 2], [1, 2, 0], [2, 0, 1], [2, 1, 0]];
    let mut element = 0;
    for k in 0..cells[2] {
        for j in 0..cells[1] {
            for i in 0..cells[0] {
                for order in orders {
                    let mut at = [i, j, k];
                    let mut corners = vec![node(i, j, k)];
                    for axis in order {
                        at[axis] += 1;
                        corners.push(node(at[0], at[1], at[2]));
                    }
                    // Odd orders are turned.
                    if matches!(order, [0, 2, 1] | [1, 0, 2] | [2, 1, 0]) {
                        corners.swap(2, 3);
                    }
                    element += 1;
                    let [a, b, c, d] = corners[..] else { unreachable!("a path has four corners") };
                    writeln!(text, "{element} 4 2 1 1 {a} {b} {c} {d}").expect("text grows");
                }
            }
        }
    }
    text += "$EndElements\n";
    text
}
