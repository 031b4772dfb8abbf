//! Energies and health of the runs.

use super::Report;
use crate::output::page::{escape, numbers, table, words};
use crate::output::summary::Status;

/// Bounds of a healthy run: energy imbalance, kinetic and hourglass over internal energy (medians).
const HEALTHY: [f64; 3] = [0.02, 0.05, 0.05];

impl Report {
    pub(super) fn health(&self) -> String {
        let mut rows = Vec::new();
        for (_, case) in &self.cases {
            let s = &case.summary;
            let within = |value: f64, bound: f64| value.is_finite() && value <= bound;
            let good = s.status == Status::Ok
                && within(s.energy_imbalance, HEALTHY[0])
                && within(s.kinetic_to_internal, HEALTHY[1])
                && within(s.hourglass_to_internal, HEALTHY[2])
                && s.clamped_nodes == 0
                && s.inverted_cells == 0;
            rows.push(vec![
                escape(&case.name),
                if good { "<span class=\"good\">yes</span>".into() } else { "<span class=\"bad\">no</span>".into() },
                format!("{:.2}", 100.0 * s.energy_imbalance),
                format!("{:.3}", 100.0 * s.kinetic_to_internal),
                format!("{:.1} ({:.1})", 100.0 * s.hourglass_to_internal, 100.0 * s.hourglass_to_internal_max),
                s.clamped_nodes.to_string(),
                s.inverted_cells.to_string(),
                format!("{:.1}", 100.0 * s.raised_mass_share),
                format!("{:.0}", s.mass_scaling),
                format!("{:.0}", s.dt_s * 1e6),
                s.steps.to_string(),
                format!("{:.1}", s.wall_s),
                format!("{:.2}", s.real_time_factor),
            ]);
        }
        table(
            "",
            "Energy imbalance: largest of all frames, over the external work. Ratios: medians on the way in.",
            &[
                words("run"),
                words("healthy"),
                numbers("energy imbalance, %"),
                numbers("kinetic / internal, %"),
                numbers("hourglass / internal (largest), %"),
                numbers("clamped nodes"),
                numbers("inverted cells"),
                numbers("node steps with raised mass, %"),
                numbers("mass scaling"),
                numbers("step, us"),
                numbers("steps"),
                numbers("time of the steps, s"),
                numbers("real-time factor"),
            ],
            &rows,
        ) + &format!(
            "<p>Healthy: the run came to its end, imbalance at most {:.0} %, kinetic and hourglass energy at most {:.0} % of \
             the internal energy (medians), no node clamped, no cell inverted. Mass scaling is chosen by one rule, the \
             same ratio of needle speed to wave speed at every speed, so that inertia has the same share in all \
             runs.</p>\n",
            100.0 * HEALTHY[0],
            100.0 * HEALTHY[1]
        )
    }
}
