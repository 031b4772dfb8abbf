//! Every word of this module that a trainee reads: labels of the figures, sentences about goals and trust. To translate the
//! training, translate this file.

use serde::{Deserialize, Serialize};

pub use crate::units::short;
use crate::units::{self, Unit};

/// Which way a figure gets better.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Better {
    Lower,
    Higher,
    /// It says nothing about skill by itself.
    None,
}

impl Better {
    pub fn word(self) -> &'static str {
        match self {
            Better::Lower => "lower",
            Better::Higher => "higher",
            Better::None => "-",
        }
    }
}

/// How one figure is shown.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FigureText {
    /// Stays the same in every language and version.
    pub key: &'static str,
    pub label: &'static str,
    pub unit: Unit,
    pub better: Better,
    /// Has no row where no run of the scene holds it.
    pub optional: bool,
}

const fn figure(key: &'static str, label: &'static str, unit: Unit, better: Better) -> FigureText {
    FigureText { key, label, unit, better, optional: false }
}

/// One that needs a bore, faces that part, or damage in the scene.
const fn optional(key: &'static str, label: &'static str, unit: Unit, better: Better) -> FigureText {
    FigureText { optional: true, ..figure(key, label, unit, better) }
}

/// All figures, in the order in which they are shown. A key that ends in a dot stands for one row per layer or target,
/// whose name is put behind key and label.
pub const FIGURES: [FigureText; 34] = [
    figure("overshoot", "Overshoot behind the last layer", units::MILLIMETRE, Better::Lower),
    figure("passes", "Passes through the surface", units::ONE, Better::Lower),
    figure("redirections", "Redirections inside tissue", units::ONE, Better::Lower),
    figure("target_distance.", "Tip to target", units::MILLIMETRE, Better::Lower),
    figure("target_displacement.", "Target pushed by", units::MILLIMETRE, Better::Lower),
    figure("entry_error", "Entry point off the plan", units::MILLIMETRE, Better::Lower),
    figure("entry_angle_error", "Entry angle off the plan", units::DEGREE, Better::Lower),
    optional("core_mass", "Core in the bore", units::MILLIGRAM, Better::Higher),
    optional("core_length", "Core length at rest", units::MILLIMETRE, Better::Higher),
    figure("peak_axial_force", "Largest axial force", units::NEWTON, Better::Lower),
    optional("peak_bone_force", "Largest force on bone", units::NEWTON, Better::Lower),
    figure("mean_axial_force", "Mean axial force in tissue", units::NEWTON, Better::Lower),
    figure("largest_force_rate", "Fastest rise of force (0.1 s)", units::NEWTON_PER_SECOND, Better::Lower),
    figure("peak_lateral_force", "Largest lateral force", units::NEWTON, Better::Lower),
    figure("impulse", "Force over time", units::NEWTON_SECOND, Better::Lower),
    figure("injury_energy", "Injury energy", units::MILLIJOULE, Better::Lower),
    figure("injury_energy.", "Injury energy", units::MILLIJOULE, Better::Lower),
    figure("dissipated_energy", "Dissipated energy", units::MILLIJOULE, Better::Lower),
    figure("dissipated_energy.", "Dissipated", units::MILLIJOULE, Better::Lower),
    figure("layer_force.", "Largest force", units::NEWTON, Better::Lower),
    optional("separated_area", "Separated area", units::SQUARE_MILLIMETRE, Better::Lower),
    optional("largest_damage", "Largest damage", units::ONE, Better::Lower),
    figure("deepest_cut", "Deepest cut in the material", units::MILLIMETRE, Better::None),
    figure("motion_smoothness", "Jerk (motion smoothness)", units::SMOOTHNESS, Better::Lower),
    figure("translational_motions", "Translational motions", units::ONE, Better::Lower),
    figure("rotational_actions", "Rotational actions", units::ONE, Better::Lower),
    figure("punctures", "Tissue punctures (+-5 mm)", units::ONE, Better::Lower),
    figure("swept_area", "Swept area (potential damage)", units::SQUARE_MILLIMETRE, Better::Lower),
    figure("path_inefficiency", "Path inefficiency", units::PERCENT, Better::Lower),
    figure("depth_perception", "Travel along the needle", units::MILLIMETRE, Better::Lower),
    figure("path_length", "Path length", units::MILLIMETRE, Better::Lower),
    figure("path_in_tissue", "Path in tissue", units::MILLIMETRE, Better::Lower),
    figure("time_in_tissue", "Time in tissue", units::SECOND, Better::Lower),
    figure("elapsed_time", "Elapsed time", units::SECOND, Better::Lower),
];

/// The text of a key.
pub fn figure_of(key: &str) -> Option<&'static FigureText> {
    FIGURES.iter().find(|f| f.key == key)
}

/// What lies outside all regions.
pub const OWN_MATERIAL: &str = "tissue";

// Headings of the tables.
pub const HEADINGS: [&str; 5] = ["Figure", "Unit", "Value", "Reference", "Better"];
pub const GOALS: &str = "Goals";

/// The share of the goals that were met, by their weights, 0 to 1.
pub fn share(share: f64) -> String {
    format!("Share of the goals by their weights: {:.0} %", 100.0 * share)
}

pub const TRUST: &str = "Trust in the numbers";
pub const MET: &str = "met";
pub const MISSED: &str = "missed";
pub const NOT_JUDGED: &str = "not judged";
pub const PASSED: &str = "Passed: every goal is met.";
pub const FAILED: &str = "Not passed: a goal is missed.";
pub const NOT_SCORED: &str = "Not scored:";
pub const SCORED: &str = "the run kept within its gates";
pub const NO_TASK: &str = "no task";
pub const MEASURED: &str = "measured";

// Trust.
pub const ENERGY_IMBALANCE: &str = "energy imbalance";
pub const KINETIC_TO_INTERNAL: &str = "kinetic/internal energy";
pub const HOURGLASS_TO_INTERNAL: &str = "hourglass/internal energy";
pub const CLAMPED_NODES: &str = "clamped node steps";
pub const NO_FRAMES: &str = "the run holds no frame";
pub const NOT_A_NUMBER: &str = "a force or a displacement is NaN";

/// A ratio beyond its bound, both fractions.
pub fn outside_gate(name: &str, value: Option<f64>, bound: f64) -> String {
    match value {
        Some(value) => format!("{name} {:.1} %, at most {:.1} % can be trusted", 100.0 * value, 100.0 * bound),
        None => format!("{name} is NaN"),
    }
}

pub fn too_many_clamped(count: u64, most: u64) -> String {
    format!("{count} {CLAMPED_NODES}, at most {most} can be trusted")
}

// Goals; lengths in mm.
pub fn hit_target(name: &str) -> String {
    format!("hit {name}")
}

pub fn avoid(name: &str) -> String {
    format!("stay away from {name}")
}

pub fn stop_in_layer(name: &str) -> String {
    format!("stop in {name}")
}

pub fn figure_bound(label: &str) -> String {
    format!("keep in bounds: {label}")
}

pub const CORE: &str = "bring out enough of a core";
pub const FORCE_LIMIT: &str = "keep the force limit";
pub const TIME_LIMIT: &str = "keep the time limit";

/// The bounds of a goal in words.
pub fn bounds(least: Option<f64>, most: Option<f64>, unit: &str) -> String {
    match (least, most) {
        (Some(least), Some(most)) => format!("{} to {} {unit}", short(least), short(most)),
        (Some(least), None) => format!("at least {} {unit}", short(least)),
        (None, Some(most)) => format!("at most {} {unit}", short(most)),
        (None, None) => String::new(),
    }
}

// Wrong input.
pub const NOT_FINITE: &str = "a number is not finite";
pub const TIME_GOES_BACK: &str = "its time lies before that of the sample before";
pub const NO_UNIT_VECTOR: &str = "its direction is no unit vector";
pub const WRONG_SAMPLE_WAY_OUT: &str =
    "record times [s] in order, tips in m and directions of length 1; leave out what a device missed";

pub fn wrong_sample(index: usize, time: f64, reason: &str) -> String {
    format!("sample {index} of the trajectory (t = {time} s) cannot be scored: {reason}")
}

pub const NO_SAMPLES: &str = "the attempt has records but no trajectory";
pub const NO_SAMPLES_WAY_OUT: &str =
    "hand over the samples of the needle; those of a scripted run come from its motion";

// History.
pub const NO_TRAINEE: &str = "the name of the trainee is empty";
pub const NO_TRAINEE_WAY_OUT: &str = "write a name of one letter or more";
pub const NO_TASK_WAY_OUT: &str = "score a scene with a [task], or give the attempt a task of your own";
pub const BROKEN_WAY_OUT: &str = "the file was left as it is; move it away, or restore it from a copy";

pub const LONG_TRAINEE_WAY_OUT: &str = "write a shorter name";

pub fn no_trainee_file(path: &str, reason: &str) -> String {
    format!("{path} does not tell the name of a trainee: {reason}")
}

pub fn long_trainee(most: usize) -> String {
    format!("the name of the trainee has more than {most} characters")
}

pub fn no_attempt(path: &str, reason: &str) -> String {
    format!("{path} is no attempt of this program: {reason}")
}

pub fn too_large(bytes: u64, most: u64) -> String {
    format!("{bytes} bytes, an attempt has at most {most}")
}

pub fn newer(version: u32, known: u32) -> String {
    format!("it has version {version}, this program knows up to {known}")
}

pub fn other_trainee(name: &str) -> String {
    format!("it says that it belongs to `{name}`")
}
