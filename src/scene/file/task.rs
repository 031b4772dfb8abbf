//! The task of a trainee as it is written.

use schemars::JsonSchema;
use serde::Deserialize;

use super::{CylinderTable, SphereShapeTable};

/// What a trainee is asked to do with the needle of the scene. The motion of the scene is the reference attempt.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct TaskTable {
    /// Short name, e.g. "hit a lesion"; attempts are kept under it.
    pub name: String,
    /// What the trainee reads before the start.
    pub briefing: String,
    /// The attempt must not take longer than this [s]; default: no limit.
    pub time_limit_s: Option<f64>,
    /// The axial force on the needle must not exceed this [N]; default: that is no goal, and a force above 10 N is an event.
    pub force_limit_n: Option<f64>,
    /// What must be reached, at least one, at most 16.
    #[serde(default)]
    pub goal: Vec<GoalTable>,
}

/// One goal: its kind, and the keys of that kind.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct GoalTable {
    pub kind: GoalKind,
    /// Its weight in the share of the score, beside 1 of the time limit and of the force limit; all goals must be met to pass; default 1.
    pub weight: Option<f64>,
    /// Name for messages; for avoid and stop_in_layer; default: that of the kind or the region.
    pub name: Option<String>,
    /// Name of a [[target]]; for hit_target; default: the first.
    pub target: Option<String>,
    /// Largest distance from tip to target at the end of the way in [mm]; for hit_target; default: its radius_mm.
    pub tolerance_mm: Option<f64>,
    /// A sphere that the needle stays away from [mm]; for avoid.
    pub sphere_mm: Option<SphereShapeTable>,
    /// A cylinder that the needle stays away from [mm]; for avoid.
    pub cylinder_mm: Option<CylinderTable>,
    /// Least distance between the outside of the needle and that of the obstacle [mm]; for avoid; default 0.
    pub clearance_mm: Option<f64>,
    /// Name of a [[region]]: with `layer_mm` and in which the tip stops, for stop_in_layer; that the needle stays away from, for avoid.
    pub region: Option<String>,
    /// The same as depths of its top and bottom below z = 0 [mm].
    pub depth_mm: Option<[f64; 2]>,
    /// Least mass of the core in the bore at the end [mg]; for core.
    pub mass_mg: Option<f64>,
    /// The same as a volume at rest [mm^3].
    pub volume_mm3: Option<f64>,
    /// Key of a figure of the score, e.g. "passes", "overshoot", "entry_angle_error"; for figure.
    pub figure: Option<String>,
    /// What it may be at most, in the unit of the score; for figure.
    pub most: Option<f64>,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum GoalKind {
    HitTarget,
    Avoid,
    StopInLayer,
    Core,
    Figure,
}
