//! A task of a teacher's own: the scene of another task with another way, target, limits and places to stay away from. All else of the
//! scene stays, with its comments.

use std::path::{Path, PathBuf};

use toml_edit::{Array, ArrayOfTables, DocumentMut, Item, Table, value};

use super::scene_words;
use crate::reading;
use crate::scene::{Goal, Obstacle, Scene};
use crate::whole_file;
use crate::{Error, Result};

/// What must be reached.
#[derive(Debug, Clone, PartialEq)]
pub enum Aim {
    /// A point of the block, or of the patient in RAS [mm], within a tolerance [mm].
    Target { name: String, at: [f64; 3], tolerance: f64 },
    /// A depth below the top face, from and to [mm].
    Depth { name: String, from: f64, to: f64 },
}

/// Where and how the reference attempt goes in.
#[derive(Debug, Clone, PartialEq)]
pub enum Way {
    /// Into a block: entry on the top face [mm], angle to the vertical and heading [deg], depth along the needle [mm].
    Block { entry: [f64; 2], angle: f64, heading: f64, depth: f64 },
    /// Into a patient: from one point to the other, RAS [mm].
    Patient { entry: [f64; 3], target: [f64; 3] },
}

/// A region to stay away from.
#[derive(Debug, Clone, PartialEq)]
pub struct Avoided {
    pub region: String,
    /// [mm]
    pub clearance: f64,
    /// Among the goals.
    pub weight: f64,
}

/// A goal that the form does not change: a bound of a figure, a core, a shape to stay away from, a second target.
#[derive(Debug, Clone, PartialEq)]
pub struct Kept {
    pub goal: Goal,
    /// It is one of the own task too.
    pub on: bool,
    /// As it is written.
    table: String,
}

/// The form as it is filled in.
#[derive(Debug, Clone, PartialEq)]
pub struct OwnTask {
    /// Scene that it is made from.
    pub base: PathBuf,
    pub name: String,
    pub briefing: String,
    pub way: Way,
    pub aim: Aim,
    /// Weight of the aim among the goals.
    pub weight: f64,
    /// [s]; `None`: no limit.
    pub time_limit: Option<f64>,
    /// Of the axial force [N]; `None`: no limit.
    pub force_limit: Option<f64>,
    /// Regions to stay away from.
    pub avoid: Vec<Avoided>,
    /// The other goals of the scene that it is made from.
    pub kept: Vec<Kept>,
    /// Number of the target in the scene that it is made from whose place the aim takes.
    replaced: Option<usize>,
    /// Names of the regions of the scene, to choose from.
    pub regions: Vec<String>,
}

/// A built-in file under the path where it shall lie.
type BuiltIn = (PathBuf, &'static [u8]);

/// Four decimals: a tenth of a micrometre.
fn shown(x: f64) -> f64 {
    (x * 1e4).round() / 1e4 + 0.0
}

impl OwnTask {
    /// The form filled in with the task of a scene.
    ///
    /// # Errors
    /// Those of [`Scene::load`]; `Error::Input` for a scene without a needle.
    pub fn from_scene(path: &Path) -> Result<OwnTask> {
        let scene = Scene::load(path, &[])?;
        if scene.needle().is_none() || scene.motion.phases.is_empty() {
            return Err(Error::input(
                format!("{}: there is no needle to lead", path.display()),
                "take a scene with a needle, such as those of scenes/training and scenes/anatomy",
            ));
        }
        let document = read(path)?;
        let motion = document.get("motion");
        let point = |key: &str| motion.and_then(|m| m.get(key)).and_then(numbers::<3>);
        let down = -scene.motion.direction;
        let way = match (point("entry_ras_mm"), point("target_ras_mm")) {
            (Some(entry), Some(target)) => Way::Patient { entry, target },
            _ => Way::Block {
                entry: [scene.motion.entry.x, scene.motion.entry.y].map(|x| shown(1e3 * x)),
                angle: shown(down.z.clamp(-1.0, 1.0).acos().to_degrees()),
                heading: shown((-down.y).atan2(-down.x).to_degrees()),
                depth: shown(1e3 * scene.motion.deepest()),
            },
        };
        let task = scene.task.as_ref();
        let goals = task.map_or(&[][..], |task| &task.goals);
        let target = document.get("target").and_then(|t| t.as_array_of_tables()).and_then(|t| t.get(0));
        let ras = target.and_then(|t| t.get("position_ras_mm")).and_then(numbers::<3>);
        let hit = |goal: &Goal| match goal {
            Goal::HitTarget { target, tolerance } => scene.targets.get(*target).map(|target| Aim::Target {
                name: target.name.clone(),
                at: ras.unwrap_or_else(|| target.position.to_array().map(|x| shown(1e3 * x))),
                tolerance: shown(1e3 * tolerance),
            }),
            Goal::StopInLayer { name, from, to } => {
                Some(Aim::Depth { name: name.clone(), from: shown(1e3 * from), to: shown(1e3 * to) })
            }
            _ => None,
        };
        let end = scene.motion.deepest_point();
        let aim = goals.iter().find_map(hit).unwrap_or_else(|| Aim::Target {
            name: "target".into(),
            at: end.to_array().map(|x| shown(1e3 * x)),
            tolerance: 1.0,
        });
        let aimed = goals.iter().position(|goal| hit(goal).is_some());
        let replaced = aimed.and_then(|n| match goals[n] {
            Goal::HitTarget { target, .. } => Some(target),
            _ => None,
        });
        let weight = |n: usize| task.and_then(|task| task.weights.get(n)).copied().unwrap_or(1.0);
        let written = document.get("task").and_then(|t| t.get("goal")).and_then(Item::as_array_of_tables);
        let (mut avoid, mut kept) = (Vec::new(), Vec::new());
        for (n, goal) in goals.iter().enumerate().filter(|(n, _)| Some(*n) != aimed) {
            if let Goal::Avoid { obstacle: Obstacle::Region(index), clearance, .. } = goal
                && let Some(region) = scene.regions.get(*index)
            {
                avoid.push(Avoided {
                    region: region.name.clone(),
                    clearance: shown(1e3 * clearance),
                    weight: weight(n),
                });
            } else if let Some(table) = written.and_then(|all| all.get(n)) {
                kept.push(Kept { goal: goal.clone(), on: true, table: table.to_string() });
            }
        }
        Ok(OwnTask {
            base: path.to_path_buf(),
            name: task.map_or_else(|| scene.title.clone(), |task| task.name.clone()),
            // In the language in which the teacher works.
            briefing: task.map_or_else(String::new, |task| scene_words::briefing(task.briefing.trim()).into()),
            way,
            aim,
            weight: aimed.map_or(1.0, weight),
            time_limit: task.and_then(|task| task.time_limit),
            force_limit: task.and_then(|task| task.force_limit),
            avoid,
            kept,
            replaced,
            regions: scene.regions.iter().map(|region| region.name.clone()).collect(),
        })
    }

    /// The scene of the task as text for a file of this name, and the built-in files that must lie beside it.
    fn written(&self, file: &Path) -> Result<(String, Vec<BuiltIn>)> {
        let mut document = read(&self.base)?;
        let mut beside = Vec::new();
        document["title"] = value(&self.name);
        self.write_way(&mut document);
        self.write_aim(&mut document);
        for [table, key] in [["tissue", "labels"], ["tissue", "mesh"]] {
            let named = document.get(table).and_then(|t| t.get(key)).and_then(Item::as_str);
            let Some(there) = named.map(|name| plain(&self.base.with_file_name(name))) else { continue };
            let path = match reading::built_in(&there).filter(|_| reading::is_built_in(&there)) {
                // It is found from here by a name that says nothing elsewhere.
                Some((_, bytes)) => {
                    let name = PathBuf::from(there.file_name().unwrap_or_default());
                    beside.push((file.with_file_name(&name), bytes));
                    name
                }
                None => reading::from_everywhere(&there),
            };
            document[table][key] = value(path.display().to_string());
        }
        Ok((document.to_string(), beside))
    }

    /// Writes the scene, once it is one that `stylet check` takes. A file that is there is never replaced.
    ///
    /// # Errors
    /// `Error::Input` where the scene that it is made from cannot be read, and for a name that is taken; those of the scene that came out;
    /// `Error::File` where a file cannot be written.
    pub fn save(&self, file: &Path) -> Result<()> {
        if file.extension().is_none_or(|ending| ending != "toml") {
            return Err(Error::input(format!("{}: a scene ends in .toml", file.display()), "name it so"));
        }
        if file.exists() {
            return Err(Error::input(format!("{} is there already", file.display()), "give another name"));
        }
        let (text, beside) = self.written(file)?;
        if let Some(folder) = file.parent().filter(|folder| !folder.as_os_str().is_empty()) {
            std::fs::create_dir_all(folder).map_err(|source| Error::file(folder, source))?;
        }
        for (path, bytes) in beside.iter().filter(|(path, _)| !path.exists()) {
            whole_file::write(path, bytes)?;
        }
        Scene::parse(file, &text, &[])?;
        whole_file::write(file, text.as_bytes())
    }

    fn write_way(&self, document: &mut DocumentMut) {
        let motion = &mut document["motion"];
        match &self.way {
            Way::Block { entry, angle, heading, depth } => {
                if let Some(motion) = motion.as_table_like_mut() {
                    motion.remove("direction");
                }
                motion["entry_mm"] = list(entry);
                motion["angle_deg"] = value(*angle);
                motion["azimuth_deg"] = value(*heading);
                let phases = motion.get_mut("phase").and_then(Item::as_array_of_tables_mut);
                let insert = phases.and_then(|phases| {
                    phases.iter_mut().filter(|phase| phase.get("kind").and_then(Item::as_str) == Some("insert")).last()
                });
                if let Some(insert) = insert {
                    insert["depth_mm"] = value(*depth);
                }
                if let Some(outputs) = document.get_mut("outputs").and_then(Item::as_table_like_mut) {
                    // Depths of pictures are those of the way that was.
                    outputs.remove("pictures_at_depth_mm");
                }
            }
            Way::Patient { entry, target } => {
                motion["entry_ras_mm"] = list(entry);
                motion["target_ras_mm"] = list(target);
            }
        }
    }

    fn write_aim(&self, document: &mut DocumentMut) {
        let mut goals = ArrayOfTables::new();
        let mut goal = Table::new();
        match &self.aim {
            Aim::Target { name, at, tolerance } => {
                let key = if matches!(self.way, Way::Patient { .. }) { "position_ras_mm" } else { "position_mm" };
                let mut target = Table::new();
                target["name"] = value(name);
                target[key] = list(at);
                target["radius_mm"] = value(*tolerance);
                // Other targets stay: a goal that is kept may be about one.
                let mut targets = ArrayOfTables::new();
                targets.push(target);
                let before = document.get("target").and_then(Item::as_array_of_tables);
                let others = before.into_iter().flatten().enumerate().filter(|(n, _)| Some(*n) != self.replaced);
                others.for_each(|(_, other)| targets.push(other.clone()));
                document["target"] = Item::ArrayOfTables(targets);
                goal["kind"] = value("hit_target");
                goal["target"] = value(name);
                goal["tolerance_mm"] = value(*tolerance);
            }
            Aim::Depth { name, from, to } => {
                goal["kind"] = value("stop_in_layer");
                goal["name"] = value(name);
                goal["depth_mm"] = list(&[*from, *to]);
            }
        }
        weigh(&mut goal, self.weight);
        goals.push(goal);
        for Avoided { region, clearance, weight } in &self.avoid {
            let mut goal = Table::new();
            goal["kind"] = value("avoid");
            goal["region"] = value(region);
            goal["clearance_mm"] = value(*clearance);
            weigh(&mut goal, *weight);
            goals.push(goal);
        }
        for kept in self.kept.iter().filter(|kept| kept.on) {
            let table = kept.table.parse::<DocumentMut>().expect("it was written by the same library");
            let mut goal = Table::new();
            table.iter().for_each(|(key, item)| _ = goal.insert(key, item.clone()));
            goals.push(goal);
        }
        let mut task = Table::new();
        task["name"] = value(&self.name);
        task["briefing"] = value(&self.briefing);
        if let Some(limit) = self.time_limit {
            task["time_limit_s"] = value(limit);
        }
        if let Some(limit) = self.force_limit {
            task["force_limit_n"] = value(limit);
        }
        task.insert("goal", Item::ArrayOfTables(goals));
        document["task"] = Item::Table(task);
    }
}

/// The weight of a goal, where it is not that which a goal has anyway.
fn weigh(goal: &mut Table, weight: f64) {
    if weight != 1.0 {
        goal["weight"] = value(weight);
    }
}

fn read(path: &Path) -> Result<DocumentMut> {
    let text = reading::text(path, reading::most::SCENE).map_err(|unread| {
        unread.of(path, "name a scene file; the built-in ones are found by scenes/training/... too")
    })?;
    text.parse().map_err(|reason: toml_edit::TomlError| {
        Error::input(format!("{}: {reason}", path.display()), "mend the scene; `stylet check` tells more")
    })
}

fn numbers<const N: usize>(item: &Item) -> Option<[f64; N]> {
    let array = item.as_array()?;
    let number = |v: &toml_edit::Value| v.as_float().or_else(|| v.as_integer().map(|n| n as f64));
    let all: Vec<f64> = array.iter().filter_map(number).collect();
    all.try_into().ok()
}

fn list(numbers: &[f64]) -> Item {
    value(numbers.iter().copied().collect::<Array>())
}

/// A path without its `..`, where a folder stands before them: built-in files are known by such names.
fn plain(path: &Path) -> PathBuf {
    let mut plain = PathBuf::new();
    for part in path.components() {
        match part {
            std::path::Component::ParentDir if plain.file_name().is_some() => _ = plain.pop(),
            part => plain.push(part),
        }
    }
    plain
}
