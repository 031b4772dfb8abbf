//! What a run says of itself on the terminal.

use crate::error::{Error, Result};
use crate::output::{Status, Summary};
use crate::simulation::trial::Trial;

/// Short report for the terminal: what the run found.
pub fn describe(summary: &Summary) -> String {
    let newton = |v: Option<f64>| v.map_or("-".into(), |v| format!("{v:.3} N"));
    let mm = |v: Option<f64>| v.map_or("-".into(), |v| format!("{:.2} mm", v * 1e3));
    let mut text = String::new();
    if let Status::Doubtful(why) = &summary.status {
        text += &format!("DOUBTFUL: {why}\n");
    }
    text += &format!(
        "{} cells, {} steps of {:.1} us (mass scaling {}), {:.2} s simulated in {:.2} s: real-time factor {:.2}\n",
        summary.cells,
        summary.steps,
        summary.dt_s * 1e6,
        crate::units::four_digits(summary.mass_scaling),
        summary.simulated_s,
        summary.wall_s,
        summary.real_time_factor
    );
    let band = summary.error_bar.as_ref();
    if let (Some(peak), Some(depth)) = (summary.puncture_force_n, summary.puncture_depth_m) {
        let after = newton(summary.force_after_puncture_n);
        let error = band.map_or(String::new(), |b| match b.puncture_depth_error_m {
            Some(error) => format!(" +- {:.2}", error * 1e3),
            None => " (the companion has no puncture)".into(),
        });
        text += &format!("puncture: {peak:.3} N at {:.2}{error} mm, then {after}\n", depth * 1e3);
    }
    if summary.peak_force_n.is_some_and(|f| f != 0.0) {
        text += &format!(
            "force: {}{} at {}; largest {}\n",
            newton(summary.force_at_max_depth_n),
            band.and_then(|b| b.force_error_at_max_depth_n).map_or(String::new(), |e| format!(" +- {e:.3} N")),
            mm(summary.max_depth_m),
            newton(summary.peak_force_n),
        );
    }
    if let (Some(face), Some(stress), Some(stretch)) =
        (&summary.face, summary.peak_nominal_stress_pa, summary.stretch_at_peak)
    {
        text += &format!(
            "sample: largest nominal stress {:.2} kPa at a stretch of {stretch:.3} on {face}\n",
            stress * 1e-3
        );
    }
    if let (Some(length), Some(rest), Some(mass)) =
        (summary.core_length_m, summary.core_rest_length_m, summary.core_mass_kg)
    {
        text += &format!(
            "core: {:.2} mm in the bore, {:.2} mm at rest ({:.0} % strain), {:.2} mg\n",
            length * 1e3,
            rest * 1e3,
            100.0 * summary.core_strain.unwrap_or(0.0),
            mass * 1e6
        );
    }
    text += &describe_targets(summary);
    if let Some(band) = band {
        text += &format!(
            "error bar: {} of the force, mean over the way in; companion: {} cells of {:.3} mm, {:.2} s, {:.0} % of the run's \
             own time\n",
            band.mean_error.map_or("-".into(), |e| format!("{:.1} %", 100.0 * e)),
            band.companion_cells,
            band.companion_cell_mm,
            band.companion_wall_s,
            100.0 * band.companion_wall_s / summary.wall_s.max(1e-9)
        );
    }
    if let Some(doubt) = band.and_then(|band| band.companion_doubt.as_ref()) {
        text += &format!("error bar: the companion is doubtful, and the band with it: {doubt}\n");
    }
    if let Some(count) = summary.cells_in_needle {
        text += &format!(
            "needle: {count} cells of tissue within its wall at most, over the times of pictures and fields\n"
        );
    }
    if let Some(area) = summary.torn_area_m2 {
        text += &format!("torn: {:.1} mm2 of the faces that may part\n", area * 1e6);
    }
    text += &format!(
        "energy: imbalance {:.2} % of the work so far at most, kinetic/internal {:.3} %, hourglass/internal {:.1} % (largest \
         {:.1} %); {} clamped nodes, {} inverted cells",
        100.0 * summary.energy_imbalance,
        100.0 * summary.kinetic_to_internal,
        100.0 * summary.hourglass_to_internal,
        100.0 * summary.hourglass_to_internal_max,
        summary.clamped_nodes,
        summary.inverted_cells
    );
    text
}

/// One line per target.
fn describe_targets(summary: &Summary) -> String {
    let mut text = String::new();
    for target in &summary.targets {
        text += &format!(
            "target {}: moves by {:.3} mm at most on the way in, at {:.2} mm",
            target.name,
            target.largest_displacement_m * 1e3,
            target.largest_displacement_depth_m * 1e3
        );
        if let (Some(smallest), Some(depth), Some(end), Some(hit)) = (
            target.smallest_tip_distance_m,
            target.smallest_tip_distance_depth_m,
            target.tip_distance_at_end_m,
            target.hit,
        ) {
            text += &format!(
                "; the tip comes to {:.3} mm at {:.2} mm, {:.3} mm at the end: {}",
                smallest * 1e3,
                depth * 1e3,
                end * 1e3,
                if hit { "hit" } else { "missed" }
            );
        }
        text.push('\n');
    }
    text
}

/// What came of the cures that were tried; one is named as a way out only where it was one.
pub fn tried_in_words(tried: Result<Trial>) -> String {
    let trial = match tried {
        Ok(trial) => trial,
        Err(error) => return format!("nothing, the run could not be repeated ({error})"),
    };
    let without = trial
        .without
        .map_or("where the run is stopped without it".into(), |x| format!("instead of {:.2} %", 100.0 * x));
    if let Some((cure, with)) = trial.best() {
        return format!(
            "{} from shortly before goes on to frame {} and gains {:.2} % imbalance, {without}; way out: {}",
            cure.name,
            trial.last,
            100.0 * with,
            cure.line
        );
    }
    let tried: Vec<String> = trial
        .with
        .iter()
        .map(|(cure, end)| match end {
            Ok(with) => format!("{}: {:.2} % imbalance gained, {without}", cure.name, 100.0 * with),
            Err(_) => format!("{}: stopped as well", cure.name),
        })
        .collect();
    format!("{}; none of them is a way out", tried.join(", "))
}

/// The first line of an error: what is wrong, without the way out.
pub fn reason_of(error: &Error) -> String {
    error.to_string().lines().next().unwrap_or_default().to_string()
}
