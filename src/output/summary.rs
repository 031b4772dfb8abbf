//! `summary.json`: one run in numbers, for people and for scripts that compare runs.

use std::path::Path;

use serde::{Deserialize, Deserializer, Serialize};

use super::curve::{CurveFigures, MajorDrop, frames_on_the_way_in, major_drops};
use super::sample::{DrivenFace, SamplePoint};
use super::target::TargetFigures;
use crate::observables::FrameRecord;
use crate::observables::quantity::{ENERGY, find};
use crate::reading;
use crate::verdict::Doubt;
use crate::whole_file;
use crate::{Error, Result};

/// Internal energy below this fraction of its largest value says nothing about hourglassing: the ratio of two numbers
/// near zero.
const TELLING_ENERGY: f64 = 0.01;

/// How a run ended.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(into = "String", from = "String")]
pub enum Status {
    #[default]
    Ok,
    /// It ended, but its numbers are to be doubted, and why: the verdict of [`crate::verdict`] in words.
    Doubtful(String),
    /// Stopped by the user; the results up to there are complete.
    Interrupted,
    /// Why the run stopped.
    Failed(String),
}

impl From<Status> for String {
    fn from(status: Status) -> Self {
        match status {
            Status::Ok => "ok".into(),
            Status::Doubtful(why) => format!("doubtful: {why}"),
            Status::Interrupted => "interrupted".into(),
            Status::Failed(why) => format!("stopped: {why}"),
        }
    }
}

impl From<String> for Status {
    fn from(text: String) -> Self {
        match text.as_str() {
            "ok" => Status::Ok,
            "interrupted" => Status::Interrupted,
            other => match (other.strip_prefix("doubtful: "), other.strip_prefix("stopped: ")) {
                (Some(why), _) => Status::Doubtful(why.into()),
                (_, Some(why)) => Status::Failed(why.into()),
                _ => Status::Failed(other.into()),
            },
        }
    }
}

/// The keys of `summary.json`, with their unit in the name. `null` stands for "the run does not hold this number".
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct Summary {
    pub status: Status,
    pub scene: String,
    /// Program version that made the results.
    pub version: String,
    /// `gpu` or `cpu`.
    pub engine: String,
    /// Name of the adapter; empty on the engine `cpu`.
    pub adapter: String,
    pub driver: String,
    /// Keys of the effects that were on, in their order.
    pub effects: Vec<String>,
    pub cells: u64,
    pub nodes: u64,
    /// Time step that was used [s].
    pub dt_s: f64,
    /// Largest stable time step [s].
    pub stable_dt_s: f64,
    /// Factor on the density; 1 = none.
    pub mass_scaling: f64,
    pub steps: u64,
    pub simulated_s: f64,
    /// Wall time of the steps, without start-up [s].
    pub wall_s: f64,
    /// Simulated time over wall time.
    pub real_time_factor: f64,
    pub cell_steps_per_s: f64,
    /// Processor time of all threads per cell and step [ns].
    pub cpu_ns_per_cell_step: Option<f64>,
    /// From program start to the end of the first step [ms].
    pub first_step_ms: Option<f64>,
    /// Largest memory of the process [byte].
    pub host_peak_bytes: Option<u64>,
    /// Memory of all buffers on the device [byte].
    pub device_bytes: Option<u64>,

    /// Largest axial force on the way in [N].
    pub peak_force_n: Option<f64>,
    pub puncture_force_n: Option<f64>,
    pub puncture_depth_m: Option<f64>,
    pub force_after_puncture_n: Option<f64>,
    pub force_at_max_depth_n: Option<f64>,
    pub max_depth_m: Option<f64>,
    pub slope_after_puncture_n_per_m: Option<f64>,
    /// Coefficient of determination of the straight line from 5 mm to the deepest point.
    pub linear_fit_r2: Option<f64>,
    /// Major drops of the force on the way in, in order.
    #[serde(default)]
    pub drops: Vec<MajorDrop>,

    /// Driven face with the largest nominal stress, that stress (tension positive) and the stretch at which it came.
    pub face: Option<String>,
    pub peak_nominal_stress_pa: Option<f64>,
    pub stretch_at_peak: Option<f64>,

    /// Core in the bore of a hollow needle at the end: length and rest length [m], mass [kg], axial strain; and its rest length
    /// over the length that was cut.
    pub core_length_m: Option<f64>,
    pub core_rest_length_m: Option<f64>,
    pub core_mass_kg: Option<f64>,
    pub core_strain: Option<f64>,
    pub core_yield: Option<f64>,

    /// Targets of the scene on the way in; absent where it has none.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub targets: Vec<TargetFigures>,

    /// What makes the run doubtful: quantity, largest value, bound, frame and time where it began, place.
    #[serde(default)]
    pub doubts: Vec<Doubt>,
    /// Largest part of the work so far that was lost or created without a cause, see [`crate::verdict`]; `null` if it is NaN.
    #[serde(deserialize_with = "null_is_nan")]
    pub energy_imbalance: f64,
    /// Taken by raised masses, by the speed limit and by the cap on the tip's advance [J].
    #[serde(default)]
    pub raised_mass_j: f64,
    #[serde(default)]
    pub speed_limit_j: f64,
    #[serde(default)]
    pub advance_cap_j: f64,
    /// Medians over the way in.
    #[serde(deserialize_with = "null_is_nan")]
    pub kinetic_to_internal: f64,
    #[serde(deserialize_with = "null_is_nan")]
    pub hourglass_to_internal: f64,
    /// Largest value among frames that store at least 1 % of the largest internal energy.
    #[serde(deserialize_with = "null_is_nan")]
    pub hourglass_to_internal_max: f64,
    /// Nodes whose speed was clamped, summed over all steps.
    pub clamped_nodes: u64,
    /// Most cells whose centre lay in the wall of the needle, over the moments of pictures and fields.
    #[serde(default)]
    pub cells_in_needle: Option<u64>,
    /// Area of the cohesive faces that parted [m^2]; only where some did.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub torn_area_m2: Option<f64>,
    /// How often trouble made the run halve its time step; `dt_s` is the last one.
    #[serde(default)]
    pub halvings: u32,
    /// Most inverted cells in one frame.
    pub inverted_cells: u64,
    /// Share of all node steps in which selective mass scaling raised the mass of a node.
    pub raised_mass_share: f64,
    /// Cell steps whose return mapping did not meet the yield condition.
    pub return_failures: u64,
    /// What a companion run with wider cells told; absent without one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub error_bar: Option<Band>,
}

/// The band around the force, from a companion run with wider cells.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct Band {
    pub companion_cell_mm: f64,
    pub companion_cells: u64,
    /// Wall time of the companion [s]; it is no part of that of the run.
    pub companion_wall_s: f64,
    /// Order of the error in the cell edge, and whether a study has observed it; else it is assumed.
    pub order: f64,
    pub order_observed: bool,
    /// Why the companion's numbers, and the band with them, are to be doubted.
    pub companion_doubt: Option<String>,
    /// Mean difference of the two runs on the way in, times the factor of the band, over the mean force.
    pub mean_error: Option<f64>,
    /// Half-width of the band at the deepest point on the way in [N].
    pub force_error_at_max_depth_n: Option<f64>,
    /// The same of the depth of the puncture [m]; `null` where one of the two runs has none.
    pub puncture_depth_error_m: Option<f64>,
}

/// JSON has no NaN; it is written as `null`.
fn null_is_nan<'de, D: Deserializer<'de>>(deserializer: D) -> std::result::Result<f64, D::Error> {
    Ok(Option::<f64>::deserialize(deserializer)?.unwrap_or(f64::NAN))
}

impl Summary {
    /// Fills in everything that the frames tell: figures of the curve, energies, health.
    pub fn take_frames(&mut self, records: &[FrameRecord]) {
        let figures = CurveFigures::from_records(records);
        self.peak_force_n = figures.peak_force;
        self.puncture_force_n = figures.puncture_force;
        self.puncture_depth_m = figures.puncture_depth;
        self.force_after_puncture_n = figures.force_after_puncture;
        self.force_at_max_depth_n = figures.force_at_max_depth;
        self.max_depth_m = figures.max_depth;
        self.slope_after_puncture_n_per_m = figures.slope_after_puncture;
        self.linear_fit_r2 = figures.r2;
        if let Some((last, core)) = records.last().and_then(|r| Some((r, r.core?))) {
            self.core_length_m = Some(core.length);
            self.core_rest_length_m = Some(core.rest_length);
            self.core_mass_kg = Some(core.mass);
            self.core_strain = Some(core.strain());
            self.core_yield = (last.tip_coordinate > 0.0).then(|| core.rest_length / last.tip_coordinate);
        }
        self.drops = major_drops(records);

        if let Some(last) = records.last() {
            self.doubts = last.verdict.doubts.clone();
            self.energy_imbalance = last.verdict.worst_imbalance;
        }
        let total = |column: &str| find(&ENERGY, column).over(records).unwrap_or(0.0);
        self.raised_mass_j = total("raised_mass_j");
        self.speed_limit_j = total("speed_limit_j");
        self.advance_cap_j = total("advance_cap_j");
        // A scene without a moving tool has no way in: every frame counts.
        let mut inward: Vec<&FrameRecord> = frames_on_the_way_in(records).collect();
        if inward.len() < 2 {
            inward = records.iter().collect();
        }
        self.kinetic_to_internal = median(inward.iter().map(|r| r.energy.kinetic_to_internal()));
        self.hourglass_to_internal = median(inward.iter().map(|r| r.energy.hourglass_to_internal()));
        let internal = |r: &FrameRecord| r.energy.internal();
        let telling = TELLING_ENERGY * records.iter().map(internal).fold(0.0, f64::max);
        self.hourglass_to_internal_max =
            largest(records.iter().filter(|r| internal(r) >= telling).map(|r| r.energy.hourglass_to_internal()));
        self.clamped_nodes = total("clamped_nodes") as u64;
        let node_steps = self.nodes * records.last().map_or(0, |r| r.step);
        self.raised_mass_share = if node_steps > 0 { total("raised_mass") / node_steps as f64 } else { 0.0 };
        self.return_failures = total("return_failures") as u64;
        self.torn_area_m2 = Some(total("torn_area_m2")).filter(|area| *area > 0.0);
        self.inverted_cells = total("inverted_cells") as u64;
    }

    /// Fills in the peak of the specimen between the driven faces.
    pub fn take_sample(&mut self, faces: &[DrivenFace], records: &[FrameRecord]) {
        let peaks = faces.iter().filter_map(|f| Some((f, f.peak(records)?)));
        let stress = |p: &SamplePoint| p.nominal_stress.map_or(0.0, f64::abs);
        let largest = peaks.reduce(|a, b| if stress(&b.1) > stress(&a.1) { b } else { a });
        self.face = largest.map(|(face, _)| face.face.key().into()).or(faces.first().map(|f| f.face.key().into()));
        self.peak_nominal_stress_pa = largest.and_then(|(_, point)| point.nominal_stress);
        self.stretch_at_peak = largest.map(|(_, point)| point.stretch);
    }

    /// Writes `summary.json`, whole or not at all.
    pub fn write(&self, path: &Path) -> Result<()> {
        let mut text = serde_json::to_string_pretty(self).map_err(|source| Error::file(path, source.into()))?;
        text.push('\n');
        whole_file::write(path, text.as_bytes())
    }

    /// Reads a summary back.
    pub fn read(path: &Path) -> Result<Self> {
        let text = reading::text(path, reading::most::OWN)
            .map_err(|unread| unread.of(path, "name the summary.json of a run"))?;
        serde_json::from_str(&text).map_err(|reason| {
            Error::input(
                format!("{} is no summary of a run: {reason}", path.display()),
                "give the summary.json that a run of this version wrote",
            )
        })
    }
}

/// Largest value, 0 of none, NaN if any value is NaN (`f64::max` would drop it).
fn largest(values: impl Iterator<Item = f64>) -> f64 {
    values.fold(0.0, |a: f64, b| if a.is_nan() || b.is_nan() { f64::NAN } else { a.max(b) })
}

/// Median, 0 of none, NaN if any value is NaN.
fn median(values: impl Iterator<Item = f64>) -> f64 {
    let mut values: Vec<f64> = values.collect();
    if values.is_empty() {
        return 0.0;
    }
    if values.iter().any(|v| v.is_nan()) {
        return f64::NAN;
    }
    values.sort_by(f64::total_cmp);
    let middle = values.len() / 2;
    if values.len() % 2 == 1 { values[middle] } else { 0.5 * (values[middle - 1] + values[middle]) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn not_a_number_is_not_lost_in_a_maximum() {
        assert!(largest([0.1, f64::NAN, 0.2].into_iter()).is_nan());
        assert_eq!(largest([0.1, 0.3, 0.2].into_iter()), 0.3);
        assert_eq!(largest(std::iter::empty()), 0.0);
    }

    #[test]
    fn medians() {
        assert_eq!(median([3.0, 1.0, 2.0].into_iter()), 2.0);
        assert_eq!(median([4.0, 1.0, 2.0, 3.0].into_iter()), 2.5);
        assert_eq!(median(std::iter::empty()), 0.0);
    }

    #[test]
    fn status_is_one_string() {
        for status in [
            Status::Ok,
            Status::Doubtful("lost".into()),
            Status::Interrupted,
            Status::Failed("an inverted cell".into()),
        ] {
            let text = serde_json::to_string(&status).unwrap();
            assert_eq!(serde_json::from_str::<Status>(&text).unwrap(), status);
        }
        assert_eq!(serde_json::to_string(&Status::Failed("x".into())).unwrap(), "\"stopped: x\"");
        assert_eq!(serde_json::to_string(&Status::Doubtful("x".into())).unwrap(), "\"doubtful: x\"");
    }
}
