//! Pictures of the stress, at stages of the puncture and at speeds.

use super::{Report, rate_free};
use crate::output::page::{escape, figure, picture};
use crate::output::report::CaseResults;
use crate::units::trimmed;

/// Depths of Fig. 11 [m].
const SPEED_PICTURES: [f64; 4] = [3e-3, 6e-3, 9e-3, 12e-3];
/// Depths at which the stages of Fig. 9 are drawn here [m].
const STAGES: [f64; 3] = [0.5e-3, 3e-3, 5e-3];

impl Report {
    pub(super) fn stages(&self) -> String {
        let Some(case) = self.speeds().first().copied() else {
            return String::new();
        };
        let mut text = String::from(
            "<div class=\"scroll\"><div class=\"pictures\" style=\"grid-template-columns: repeat(3, 1fr)\">\n",
        );
        let broke_through = case.summary.puncture_depth_m.unwrap_or(f64::INFINITY);
        for (number, depth) in STAGES.into_iter().enumerate() {
            let name = match number {
                0 => "first contact",
                _ if depth < broke_through => "before the puncture",
                2 if STAGES[1] > broke_through => "needle inside",
                _ => "tip inside the tissue",
            };
            let force = force_at(case, depth).map_or(String::new(), |f| format!(", {f:.2} N"));
            let caption = format!("{name}: {} mm{force}", trimmed(depth * 1e3));
            text += &picture_or_gap(case, depth, &caption);
        }
        text += "</div></div>\n";
        let puncture = match (case.summary.puncture_depth_m, case.summary.puncture_force_n) {
            (Some(depth), Some(force)) => {
                format!(" The tip breaks through at {:.2} mm and {force:.3} N.", depth * 1e3)
            }
            _ => " The run shows no puncture.".into(),
        };
        text + &format!(
            "<p>Cut through the needle axis at {} mm/s; colour: von Mises stress. The paper prints only the last depth; the \
             two others are chosen here.{puncture}</p>\n",
            trimmed(case.speed())
        )
    }

    pub(super) fn speed_pictures(&self) -> String {
        let speeds = self.speeds();
        let mut text = format!(
            "<div class=\"scroll\"><div class=\"pictures\" style=\"grid-template-columns: repeat({}, 1fr)\">\n",
            speeds.len()
        );
        for case in &speeds {
            text += &format!("<div class=\"head\">{} mm/s</div>\n", trimmed(case.speed()));
        }
        for depth in SPEED_PICTURES {
            for case in &speeds {
                let force = force_at(case, depth).map_or(String::new(), |f| format!(", {f:.2} N"));
                text += &picture_or_gap(case, depth, &format!("{} mm{force}", trimmed(depth * 1e3)));
            }
        }
        text += "</div></div>\n<p>Rows: depth; columns: speed; one colour bar for all. The paper reports that tissue fits the \
                 needle less closely at higher speed";
        if speeds.iter().all(|case| rate_free(&case.scene)) {
            text += "; here the pictures of one row are alike, since no law of the scenes contains a rate";
        }
        text + ".</p>\n"
    }
}

pub(super) fn picture_or_gap(case: &CaseResults, depth: f64, caption: &str) -> String {
    let description = format!("von Mises stress, {} at {} mm", case.name, trimmed(depth * 1e3));
    match case.picture(depth) {
        Some(png) => figure(&picture(&png, &description), &escape(caption)),
        None => figure("", &escape(&format!("{} mm: not reached by this run", trimmed(depth * 1e3)))),
    }
}

/// Axial force of the frame nearest to a depth [m] on the way in, if the run came that far.
fn force_at(case: &CaseResults, depth: f64) -> Option<f64> {
    let curve = case.curve("axial_force_n");
    let step = curve.windows(2).map(|pair| pair[1].0 - pair[0].0).fold(0.0, f64::max);
    let nearest = curve.iter().min_by(|a, b| (a.0 - depth).abs().total_cmp(&(b.0 - depth).abs()))?;
    ((nearest.0 - depth).abs() <= step).then_some(nearest.1)
}
