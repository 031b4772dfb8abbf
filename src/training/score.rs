//! The score of an attempt: figures beside those of a reference attempt, goals, trust; as CSV, TSV, JSON and text.

use serde::{Deserialize, Serialize};

use super::body::SceneBody;
use super::kinematic::{KinematicFigures, Plan, Sample};
use super::physical::{PhysicalFigures, Trust};
use super::task::{self, GoalResult};
use super::texts::{self, Better};
use crate::observables::FrameRecord;
use crate::output::OutputFolder;
use crate::scene::Scene;
use crate::units::number;
use crate::whole_file;
use crate::{Error, Result};

/// One figure.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Row {
    /// Stays the same in every version; with a dot and a name behind it for a layer or target.
    pub key: String,
    pub label: String,
    /// Unit of the numbers; empty for counts.
    pub unit: String,
    /// `None` where the run does not hold it, or holds it but is not scored.
    pub value: Option<f64>,
    /// That of the reference attempt.
    pub reference: Option<f64>,
    pub better: Better,
}

/// Everything that is known about one attempt.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Score {
    /// Name of the scene.
    pub scene: String,
    /// Name of its task; `None` for a scene without one.
    pub task: Option<String>,
    pub rows: Vec<Row>,
    /// In the order of the task.
    pub goals: Vec<GoalResult>,
    pub trust: Trust,
}

/// Columns of the CSV and TSV forms. `section` is `figure`, `goal` or `trust`.
pub const COLUMNS: [&str; 10] =
    ["section", "key", "label", "unit", "value", "reference", "better", "least", "most", "met"];

/// Width of the text form [characters].
pub const TEXT_WIDTH: usize = 78;

/// Figures of how the needle moved; they hold whatever the tissue did.
fn kinematic_rows(k: &KinematicFigures) -> Vec<(String, Option<f64>)> {
    let some = |key: &str, value: f64| (key.to_string(), Some(value));
    vec![
        some("elapsed_time", k.elapsed_time),
        some("path_length", k.path_length),
        some("path_in_tissue", k.path_in_tissue),
        some("time_in_tissue", k.time_in_tissue),
        some("swept_area", k.swept_area),
        some("punctures", f64::from(k.punctures)),
        ("path_inefficiency".into(), k.path_inefficiency),
        some("motion_smoothness", k.motion_smoothness),
        some("translational_motions", f64::from(k.translational_motions)),
        some("rotational_actions", f64::from(k.rotational_actions)),
        some("depth_perception", k.depth_perception),
        some("passes", f64::from(k.passes)),
        some("redirections", f64::from(k.redirections)),
        ("entry_error".into(), k.entry_error),
        ("entry_angle_error".into(), k.entry_angle_error),
    ]
}

/// Figures of what the tissue felt.
fn physical_rows(p: &PhysicalFigures) -> Vec<(String, Option<f64>)> {
    let mut rows = vec![
        ("overshoot".into(), p.overshoot()),
        ("peak_axial_force".into(), Some(p.peak_axial_force)),
        ("peak_bone_force".into(), (p.peak_bone_force > 0.0).then_some(p.peak_bone_force)),
        ("mean_axial_force".into(), p.mean_axial_force),
        ("largest_force_rate".into(), p.largest_force_rate),
        ("peak_lateral_force".into(), Some(p.peak_lateral_force)),
        ("impulse".into(), Some(p.impulse)),
        ("injury_energy".into(), Some(p.injury)),
        ("dissipated_energy".into(), Some(p.dissipated)),
        ("deepest_cut".into(), Some(p.deepest_cut)),
        ("separated_area".into(), p.separated_area),
        ("largest_damage".into(), p.largest_damage),
        ("core_mass".into(), p.core.map(|core| core.mass)),
        ("core_length".into(), p.core.map(|core| core.rest_length)),
    ];
    // A single layer has the figures of the whole.
    if p.layers.len() > 1 {
        for layer in &p.layers {
            rows.push((format!("injury_energy.{}", layer.layer), Some(layer.injury)));
            rows.push((format!("dissipated_energy.{}", layer.layer), Some(layer.dissipated)));
            rows.push((format!("layer_force.{}", layer.layer), Some(layer.peak_force)));
        }
    }
    for target in &p.targets {
        rows.push((format!("target_distance.{}", target.name), target.tip_distance_at_end_m));
        rows.push((format!("target_displacement.{}", target.name), Some(target.largest_displacement_m)));
    }
    rows
}

/// Rows with their texts, in the order of [`texts::FIGURES`]; figures in SI, `None` where they are not scored.
fn with_texts(figures: Vec<(String, Option<f64>)>) -> Vec<Row> {
    let mut rows = Vec::with_capacity(figures.len());
    for text in &texts::FIGURES {
        let whole = |key: &str| if text.key.ends_with('.') { key.starts_with(text.key) } else { key == text.key };
        for (key, value) in figures.iter().filter(|(key, _)| whole(key)) {
            let label = match key.strip_prefix(text.key).filter(|name| !name.is_empty()) {
                Some(name) => format!("{}: {name}", text.label),
                None => text.label.to_string(),
            };
            rows.push(Row {
                key: key.clone(),
                label,
                unit: text.unit.name.into(),
                // An empty sum is -0.
                value: value.map(|v| text.unit.show(v) + 0.0).filter(|v| v.is_finite()),
                reference: None,
                better: text.better,
            });
        }
    }
    rows
}

impl Score {
    /// Scores the trajectory and the records of one run of `scene`. A figure that no run of the scene holds (core without a
    /// bore, ...) has no row. Where the run is outside its gates, what depends on the tissue has no value and no goal is judged.
    ///
    /// # Errors
    /// `Error::Input` where a sample is wrong or there are none.
    pub fn of(scene: &Scene, samples: &[Sample], records: &[FrameRecord], reference: Option<&Score>) -> Result<Score> {
        if samples.is_empty() {
            return Err(Error::input(texts::NO_SAMPLES, texts::NO_SAMPLES_WAY_OUT));
        }
        let body = SceneBody::of(scene);
        let kinematic = KinematicFigures::of(samples, &body, Some(&Plan::of(&scene.motion)))?;
        let physical = PhysicalFigures::of(scene, samples, records);
        let trust = Trust::of(records);
        let mut rows = kinematic_rows(&kinematic);
        for (key, value) in physical_rows(&physical) {
            if value.is_some() || !texts::figure_of(&key).is_some_and(|text| text.optional) {
                rows.push((key, value));
            }
        }
        let goals = match &scene.task {
            Some(task) => task::judge(task, scene, samples, &kinematic, &physical, &rows),
            None => Vec::new(),
        };
        let mut score = Score {
            scene: scene.name.clone(),
            task: scene.task.as_ref().map(|task| task.name.clone()),
            rows: with_texts(rows),
            goals,
            trust,
        };
        if !score.trust.is_good() {
            score.take_back();
        }
        if let Some(reference) = reference {
            score.compare_with(reference);
        }
        Ok(score)
    }

    /// Marks the run as one that is not scored, for a reason that its records do not tell, e.g. that it stopped early.
    pub fn fail(&mut self, reason: impl Into<String>) {
        self.trust.reasons.push(reason.into());
        self.take_back();
    }

    /// Takes back what depends on the tissue, and every verdict.
    fn take_back(&mut self) {
        let kinematic = kinematic_rows(&KinematicFigures::default());
        let rows = self.rows.iter_mut();
        rows.filter(|row| kinematic.iter().all(|(key, _)| *key != row.key)).for_each(|row| row.value = None);
        self.goals.iter_mut().for_each(|goal| (goal.measured, goal.met) = (None, None));
    }

    /// Puts the values of another attempt beside its own.
    pub fn compare_with(&mut self, reference: &Score) {
        for row in &mut self.rows {
            row.reference = reference.value(&row.key);
        }
    }

    /// The value of a figure, in the unit of its row.
    pub fn value(&self, key: &str) -> Option<f64> {
        self.rows.iter().find(|row| row.key == key)?.value
    }

    /// Whether every goal is met; `None` without a goal, or where the run is not scored.
    pub fn passed(&self) -> Option<bool> {
        let met: Option<Vec<bool>> = self.goals.iter().map(|goal| goal.met).collect();
        met.filter(|met| !met.is_empty() && self.trust.is_good()).map(|met| met.into_iter().all(|m| m))
    }

    /// Weight of the goals that are met over that of all, 0 to 1; `None` without a goal, or where the run is not scored. Who passes has 1.
    pub fn share(&self) -> Option<f64> {
        self.passed()?;
        let weight = |met: bool| -> f64 {
            self.goals.iter().filter(|goal| !met || goal.met == Some(true)).map(|goal| goal.weight).sum()
        };
        Some(weight(true) / weight(false))
    }

    /// Writes `score.json`, `score.csv` and `score.tsv` into the folder of an attempt.
    ///
    /// # Errors
    /// `Error::File`.
    pub fn write(&self, folder: &OutputFolder) -> Result<()> {
        for (name, text) in [("score.json", self.json()), ("score.csv", self.csv()), ("score.tsv", self.tsv())] {
            whole_file::write(&folder.file(name), text.as_bytes())?;
        }
        Ok(())
    }

    /// The table with a comma between the columns.
    pub fn csv(&self) -> String {
        self.separated(b',')
    }

    /// The table with a tab between the columns.
    pub fn tsv(&self) -> String {
        self.separated(b'\t')
    }

    fn separated(&self, delimiter: u8) -> String {
        let mut writer = csv::WriterBuilder::new().delimiter(delimiter).from_writer(Vec::new());
        let known = |value: Option<f64>| value.map_or(String::new(), number);
        let yes_or_no = |met: Option<bool>| met.map_or(String::new(), |m| u8::from(m).to_string());
        let mut lines: Vec<[String; COLUMNS.len()]> = vec![COLUMNS.map(String::from)];
        for row in &self.rows {
            let (better, empty) = (row.better.word().to_string(), String::new());
            let (value, reference) = (known(row.value), known(row.reference));
            let names = ["figure".into(), row.key.clone(), row.label.clone(), row.unit.clone()];
            let [section, key, label, unit] = names;
            lines.push([section, key, label, unit, value, reference, better, empty.clone(), empty.clone(), empty]);
        }
        for goal in &self.goals {
            let bounds = [known(goal.least), known(goal.most)];
            let [least, most] = bounds;
            let names = ["goal".into(), goal.key.clone(), goal.text.clone(), goal.unit.clone()];
            let [section, key, label, unit] = names;
            let (value, empty) = (known(goal.measured), String::new());
            lines.push([section, key, label, unit, value, empty.clone(), empty, least, most, yes_or_no(goal.met)]);
        }
        let none = String::new;
        for (key, label, value) in self.trust_lines() {
            let names = ["trust".into(), key.into(), label.into()];
            let [section, key, label] = names;
            let value = known(value);
            lines.push([section, key, label, none(), value, none(), none(), none(), none(), none()]);
        }
        let reasons = self.trust.reasons.join("; ");
        let verdict = yes_or_no(Some(self.trust.is_good()));
        let label = if self.trust.is_good() { texts::SCORED.into() } else { reasons };
        let names = ["trust".into(), "scored".into(), label];
        let [section, key, label] = names;
        lines.push([section, key, label, none(), none(), none(), none(), none(), none(), verdict]);
        for line in &lines {
            writer.write_record(line).expect("a vector takes every record of one length");
        }
        let bytes = writer.into_inner().expect("a vector is flushed");
        String::from_utf8(bytes).expect("records are made of text")
    }

    fn trust_lines(&self) -> [(&'static str, &'static str, Option<f64>); 4] {
        let trust = &self.trust;
        [
            ("energy_imbalance", texts::ENERGY_IMBALANCE, trust.energy_imbalance),
            ("kinetic_to_internal", texts::KINETIC_TO_INTERNAL, trust.kinetic_to_internal),
            ("hourglass_to_internal", texts::HOURGLASS_TO_INTERNAL, trust.hourglass_to_internal),
            ("clamped_nodes", texts::CLAMPED_NODES, Some(trust.clamped_nodes as f64)),
        ]
    }

    /// JSON, for programs and for the history.
    pub fn json(&self) -> String {
        serde_json::to_string_pretty(self).expect("a score has text keys only") + "\n"
    }

    /// A table for the terminal, at most [`TEXT_WIDTH`] wide.
    pub fn text(&self) -> String {
        // Widths of the columns with a blank between them: 36 + 7 + 11 + 11 + 6 + 4 = 75.
        let line = |label: &str, unit: &str, value: &str, reference: &str, better: &str| {
            let text = format!(
                "{:<36} {:<7} {:>11} {:>11} {:<6}",
                cut(label, 36),
                cut(unit, 7),
                cut(value, 11),
                cut(reference, 11),
                cut(better, 6)
            );
            text.trim_end().to_string() + "\n"
        };
        let known = |value: Option<f64>| value.map_or("-".into(), texts::short);
        let mut text = cut(&format!("{}: {}", self.scene, self.task.as_deref().unwrap_or(texts::NO_TASK)), TEXT_WIDTH);
        text.push('\n');
        match self.passed() {
            Some(true) => text += &format!("{}\n", texts::PASSED),
            Some(false) => text += &format!("{}\n", texts::FAILED),
            None => {}
        }
        if !self.goals.is_empty() {
            text += &format!("\n{}\n", texts::GOALS);
        }
        for goal in &self.goals {
            let verdict = match goal.met {
                Some(true) => texts::MET,
                Some(false) => texts::MISSED,
                None => texts::NOT_JUDGED,
            };
            let measured = goal
                .measured
                .map_or(String::new(), |m| format!("{} {} {}, ", texts::MEASURED, texts::short(m), goal.unit));
            let bounds = texts::bounds(goal.least, goal.most, &goal.unit);
            text += &cut(&format!("  {verdict:<10} {}: {measured}{bounds}", cut(&goal.text, 28)), TEXT_WIDTH);
            text.push('\n');
        }
        if let Some(share) = self.share() {
            text += &format!("  {}\n", texts::share(share));
        }
        let [label, unit, value, reference, better] = texts::HEADINGS;
        text.push('\n');
        text += &line(label, unit, value, reference, better);
        for row in &self.rows {
            text += &line(&row.label, &row.unit, &known(row.value), &known(row.reference), row.better.word());
        }
        text += &format!("\n{}\n", texts::TRUST);
        let percent = |value: Option<f64>| value.map_or("-".into(), |v| format!("{:.2} %", 100.0 * v));
        for (key, label, value) in self.trust_lines() {
            let value = if key == "clamped_nodes" { known(value) } else { percent(value) };
            text += &format!("  {label:<28} {value}\n");
        }
        for reason in &self.trust.reasons {
            text += &cut(&format!("  {} {reason}", texts::NOT_SCORED), TEXT_WIDTH);
            text.push('\n');
        }
        text
    }
}

/// At most `width` characters of a text; a tilde stands for the rest.
fn cut(text: &str, width: usize) -> String {
    if text.chars().count() <= width {
        return text.into();
    }
    text.chars().take(width - 1).chain(['~']).collect()
}
