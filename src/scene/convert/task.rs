//! The task of a trainee: every goal with the keys of its kind, and only those.

use glam::DVec3;

use super::super::file::{CylinderTable, GoalKind, GoalTable, SceneFile, SphereShapeTable, TaskTable};
use super::super::{Goal, LARGEST_FORCE_LIMIT, Obstacle, TASK_FIGURES, Target, Task};
use super::{Check, MM, Within};
use crate::needle::Tool;
use crate::units;

/// Most goals of a task: more cannot be kept in mind with a needle in the hand.
const LARGEST_GOAL_COUNT: usize = 16;

/// Longest name [characters]: it is a part of the names of files.
const LONGEST_NAME: usize = 80;

const MILLIGRAM: f64 = units::MILLIGRAM.si;
const MM3: f64 = units::CUBIC_MILLIMETRE.si;

/// Keys that a goal may have beside its kind.
fn keys(kind: GoalKind) -> &'static [&'static str] {
    match kind {
        GoalKind::HitTarget => &["target", "tolerance_mm"],
        GoalKind::Avoid => &["name", "sphere_mm", "cylinder_mm", "region", "clearance_mm"],
        GoalKind::StopInLayer => &["name", "region", "depth_mm"],
        GoalKind::Core => &["mass_mg", "volume_mm3"],
        GoalKind::Figure => &["figure", "most"],
    }
}

/// Keys that are written.
fn written(table: &GoalTable) -> Vec<&'static str> {
    [
        ("name", table.name.is_some()),
        ("target", table.target.is_some()),
        ("tolerance_mm", table.tolerance_mm.is_some()),
        ("sphere_mm", table.sphere_mm.is_some()),
        ("cylinder_mm", table.cylinder_mm.is_some()),
        ("clearance_mm", table.clearance_mm.is_some()),
        ("region", table.region.is_some()),
        ("depth_mm", table.depth_mm.is_some()),
        ("mass_mg", table.mass_mg.is_some()),
        ("volume_mm3", table.volume_mm3.is_some()),
        ("figure", table.figure.is_some()),
        ("most", table.most.is_some()),
    ]
    .into_iter()
    .filter_map(|(key, on)| on.then_some(key))
    .collect()
}

impl Check<'_> {
    /// The task in SI. `bored`: the needle takes a core.
    pub(super) fn task(
        &mut self,
        table: &TaskTable,
        file: &SceneFile,
        tool: Option<&Tool>,
        bored: bool,
        targets: &[Target],
    ) -> Task {
        if !matches!(tool, Some(Tool::Needle(_))) {
            self.problems.report(
                "task",
                "a task is done with a needle, and the scene has none",
                "no needle",
                "add [needle] with a [[motion.phase]], or remove [task]",
            );
        }
        self.task_text("task.name", &table.name);
        if table.name.chars().count() > LONGEST_NAME {
            self.problems.report(
                "task.name",
                format!("the name has more than {LONGEST_NAME} characters"),
                "too long",
                "write a short name here and the rest into `briefing`",
            );
        }
        if table.briefing.trim().is_empty() {
            self.problems.report(
                "task.briefing",
                "the briefing is empty",
                "nothing to read",
                "say in a sentence or two what is to be done",
            );
        }
        match table.goal.len() {
            0 => self.problems.report(
                "task",
                "the task has no goal",
                "nothing to reach",
                "add [[task.goal]] with kind = \"hit_target\", \"avoid\", \"stop_in_layer\", \"core\" or \"figure\"",
            ),
            n if n > LARGEST_GOAL_COUNT => self.problems.report(
                &format!("task.goal.{LARGEST_GOAL_COUNT}"),
                format!("the task has {n} goals"),
                "too many",
                format!("keep at most {LARGEST_GOAL_COUNT} goals"),
            ),
            _ => {}
        }
        let time_limit =
            table.time_limit_s.map(|limit| self.number("task.time_limit_s", limit, Within::Positive(3600.0)));
        let force_limit = table
            .force_limit_n
            .map(|limit| self.number("task.force_limit_n", limit, Within::Positive(LARGEST_FORCE_LIMIT)));
        let (mut goals, mut weights) = (Vec::new(), Vec::new());
        for (index, goal) in table.goal.iter().enumerate() {
            let path = format!("task.goal.{index}.weight");
            let weight = goal.weight.map_or(1.0, |weight| self.number(&path, weight, Within::Positive(1000.0)));
            if let Some(goal) = self.goal(index, goal, file, bored, targets) {
                goals.push(goal);
                weights.push(weight);
            }
        }
        Task { name: table.name.clone(), briefing: table.briefing.clone(), time_limit, force_limit, goals, weights }
    }

    /// A name is one line that is not empty.
    fn task_text(&mut self, path: &str, text: &str) {
        if text.trim().is_empty() || text.chars().any(char::is_control) {
            self.problems.report(
                path,
                format!("the name {text:?} is empty or holds a control character"),
                "no name",
                "write one line of letters, digits, spaces and signs",
            );
        }
    }

    /// `None` after a problem that leaves nothing to go on with.
    fn goal(
        &mut self,
        index: usize,
        table: &GoalTable,
        file: &SceneFile,
        bored: bool,
        targets: &[Target],
    ) -> Option<Goal> {
        let at = |key: &str| format!("task.goal.{index}.{key}");
        let known = keys(table.kind);
        for key in written(table) {
            if !known.contains(&key) {
                self.problems.report(
                    &at(key),
                    format!("`{key}` means nothing to a goal of this kind"),
                    "wrong key for the kind",
                    format!("remove it, or use one of: {}", known.join(", ")),
                );
            }
        }
        if let Some(name) = &table.name {
            self.task_text(&at("name"), name);
        }
        match table.kind {
            GoalKind::HitTarget => self.hit_target(&at, table, targets),
            GoalKind::Avoid => self.avoid(&at, table, file, index),
            GoalKind::StopInLayer => self.stop_in_layer(&at, table, file, index),
            GoalKind::Core => self.core(&at, table, bored, index),
            GoalKind::Figure => self.figure(&at, table, index),
        }
    }

    fn hit_target(&mut self, at: &dyn Fn(&str) -> String, table: &GoalTable, targets: &[Target]) -> Option<Goal> {
        let names: Vec<&str> = targets.iter().map(|t| t.name.as_str()).collect();
        let index = match &table.target {
            Some(name) => targets.iter().position(|t| t.name == *name),
            None => (!targets.is_empty()).then_some(0),
        };
        let Some(index) = index else {
            if targets.is_empty() {
                self.problems.report(
                    &at(if table.target.is_some() { "target" } else { "kind" }),
                    "the scene has no target",
                    "nothing to hit",
                    "add [[target]] with position_mm = [0, 0, -9]",
                );
            } else if let Some(name) = &table.target {
                self.unknown_name(&at("target"), "target", name, &names);
            }
            return None;
        };
        let tolerance =
            self.optional(&at("tolerance_mm"), table.tolerance_mm, MM, targets[index].radius, Within::Positive(1000.0));
        Some(Goal::HitTarget { target: index, tolerance })
    }

    fn avoid(
        &mut self,
        at: &dyn Fn(&str) -> String,
        table: &GoalTable,
        file: &SceneFile,
        index: usize,
    ) -> Option<Goal> {
        let clearance = self.optional(&at("clearance_mm"), table.clearance_mm, MM, 0.0, Within::NotNegative(1000.0));
        if let (Some(name), None, None) = (&table.region, table.sphere_mm, table.cylinder_mm) {
            let Some(region) = file.region.iter().position(|region| region.name == *name) else {
                let names: Vec<&str> = file.region.iter().map(|region| region.name.as_str()).collect();
                self.unknown_name(&at("region"), "region", name, &names);
                return None;
            };
            let name = table.name.clone().unwrap_or_else(|| name.clone());
            return Some(Goal::Avoid { name, obstacle: Obstacle::Region(region), clearance });
        }
        let obstacle = match (table.sphere_mm, table.cylinder_mm) {
            (Some(SphereShapeTable { centre, radius }), None) => Obstacle::Sphere {
                centre: self.vector(&at("sphere_mm.centre"), centre, 1000.0) * MM,
                radius: self.number(&at("sphere_mm.radius"), radius, Within::Positive(1000.0)) * MM,
            },
            (None, Some(CylinderTable { from, to, radius })) => {
                let ends = [("from", from), ("to", to)]
                    .map(|(key, x)| self.vector(&at(&format!("cylinder_mm.{key}")), x, 1000.0) * MM);
                if DVec3::distance(ends[0], ends[1]) < 1e-9 {
                    self.problems.report(
                        &at("cylinder_mm"),
                        "both ends of the cylinder are the same point",
                        "no length",
                        "write two points of the axis, or sphere_mm",
                    );
                }
                let radius = self.number(&at("cylinder_mm.radius"), radius, Within::Positive(1000.0)) * MM;
                Obstacle::Cylinder { from: ends[0], to: ends[1], radius }
            }
            (sphere, _) => {
                let (message, place) = match sphere {
                    Some(_) => ("the obstacle has two shapes", at("cylinder_mm")),
                    None if table.region.is_some() => ("the obstacle has two shapes", at("region")),
                    None => ("the obstacle has no shape", format!("task.goal.{index}")),
                };
                self.problems.report(
                    &place,
                    message,
                    "exactly one shape",
                    "write sphere_mm = {centre = [..], radius = 1}, cylinder_mm = {from = [..], to = [..], radius = 1} or region = \"vessel\"",
                );
                return None;
            }
        };
        let name = table.name.clone().unwrap_or_else(|| format!("obstacle {}", index + 1));
        Some(Goal::Avoid { name, obstacle, clearance })
    }

    fn stop_in_layer(
        &mut self,
        at: &dyn Fn(&str) -> String,
        table: &GoalTable,
        file: &SceneFile,
        index: usize,
    ) -> Option<Goal> {
        let (band, default_name) = match (&table.region, table.depth_mm) {
            (Some(region), None) => {
                let layers: Vec<(&str, [f64; 2])> =
                    file.region.iter().filter_map(|r| Some((r.name.as_str(), r.layer_mm?))).collect();
                let Some((name, band)) = layers.iter().find(|(name, _)| name == region) else {
                    let names: Vec<&str> = layers.iter().map(|(name, _)| *name).collect();
                    if names.is_empty() {
                        self.problems.report(
                            &at("region"),
                            "the scene has no region with layer_mm",
                            "unknown name",
                            "write depth_mm = [top, bottom] instead",
                        );
                    } else {
                        self.unknown_name(&at("region"), "layer", region, &names);
                    }
                    return None;
                };
                (*band, (*name).to_string())
            }
            (None, Some(band)) => {
                for (end, value) in band.into_iter().enumerate() {
                    self.number(&at(&format!("depth_mm.{end}")), value, Within::NotNegative(1000.0));
                }
                if band[0] >= band[1] {
                    self.problems.report(
                        &at("depth_mm"),
                        format!("the layer begins at depth {} mm and ends at {} mm", band[0], band[1]),
                        "the first depth must be the smaller one",
                        "write [top, bottom] as depths below z = 0, e.g. depth_mm = [5, 8]",
                    );
                }
                let below = file.tissue.size_mm.is_some_and(|size| band[0] >= size[2]);
                if below {
                    self.problems.report(
                        &at("depth_mm"),
                        format!("the layer begins at {} mm, below the bottom of the tissue", band[0]),
                        "no tissue here",
                        "write depths within tissue.size_mm",
                    );
                }
                (band, format!("layer {}", index + 1))
            }
            (region, _) => {
                let (message, place) = match region {
                    Some(_) => ("`region` and `depth_mm` both say where to stop", at("depth_mm")),
                    None => ("the goal does not say where to stop", format!("task.goal.{index}")),
                };
                self.problems.report(
                    &place,
                    message,
                    "exactly one of the two",
                    "write region = \"name of a layer\" or depth_mm = [top, bottom]",
                );
                return None;
            }
        };
        let name = table.name.clone().unwrap_or(default_name);
        Some(Goal::StopInLayer { name, from: band[0] * MM, to: band[1] * MM })
    }

    fn figure(&mut self, at: &dyn Fn(&str) -> String, table: &GoalTable, index: usize) -> Option<Goal> {
        let names: Vec<&str> = TASK_FIGURES.iter().map(|figure| figure.key).collect();
        let (Some(key), Some(most)) = (&table.figure, table.most) else {
            self.problems.report(
                &format!("task.goal.{index}"),
                "the goal does not say which figure may be how large",
                "figure and most",
                format!("write figure = \"passes\" and most = 1; figures: {}", names.join(", ")),
            );
            return None;
        };
        let Some(figure) = TASK_FIGURES.iter().find(|figure| figure.key == key) else {
            self.unknown_name(&at("figure"), "figure", key, &names);
            return None;
        };
        let most = self.number(&at("most"), most, Within::NotNegative(1e6));
        Some(Goal::Figure { figure, most: figure.unit.read(most) })
    }

    fn core(&mut self, at: &dyn Fn(&str) -> String, table: &GoalTable, bored: bool, index: usize) -> Option<Goal> {
        if !bored {
            self.problems.report(
                &at("kind"),
                "only a hollow needle takes a core",
                "no core in this scene",
                "add needle.bore_diameter_mm and the effects \"puncture\" and \"cohesive\"",
            );
        }
        match (table.mass_mg, table.volume_mm3) {
            (Some(mass), None) => {
                Some(Goal::CoreMass { least: self.number(&at("mass_mg"), mass, Within::Positive(1e6)) * MILLIGRAM })
            }
            (None, Some(volume)) => {
                Some(Goal::CoreVolume { least: self.number(&at("volume_mm3"), volume, Within::Positive(1e6)) * MM3 })
            }
            (mass, _) => {
                let (message, place) = match mass {
                    Some(_) => ("`mass_mg` and `volume_mm3` both say how much", at("volume_mm3")),
                    None => ("the goal does not say how much", format!("task.goal.{index}")),
                };
                self.problems.report(&place, message, "exactly one of the two", "write mass_mg = 5 or volume_mm3 = 5");
                None
            }
        }
    }
}
