//! The hollow needle and its core.

use super::stages::picture_or_gap;
use super::{Report, Role, inline};
use crate::Result;
use crate::needle::{NeedleShape, Tool};
use crate::output::chart::{Curve, FINER, INWARD, OUTWARD};
use crate::output::page::{escape, figure, numbers, table, words};
use crate::output::plot::{Plot, legend_line, legend_row};
use crate::output::summary::Status;
use crate::units::trimmed;

impl Report {
    pub(super) fn hollow(&self) -> Result<String> {
        let mut text = String::new();
        for case in self.of(Role::Hollow) {
            text += &format!("<p>{}", escape(&case.scene.title));
            if let Some(Tool::Needle(NeedleShape { name, radius, bore: Some(bore), .. })) = &case.scene.tool {
                text += &format!(
                    ": {} with an outer diameter of {:.3} mm, a bore of {:.3} mm and a cutting edge of {:.3} mm in \
                     diameter; friction {} in the bore",
                    escape(name),
                    2e3 * radius,
                    2e3 * bore.radius,
                    2e3 * bore.edge,
                    trimmed(bore.friction)
                );
            }
            text += ".</p>\n";
            let s = &case.summary;
            if let Status::Failed(why) = &s.status {
                text += &format!("<p class=\"notice\">This run ended early: {}</p>\n", escape(why));
            }
            let core = [
                ("length in the bore, mm", s.core_length_m.map(|v| format!("{:.2}", v * 1e3))),
                ("length of the same tissue at rest, mm", s.core_rest_length_m.map(|v| format!("{:.2}", v * 1e3))),
                ("strain along the needle, %", s.core_strain.map(|v| format!("{:.1}", v * 100.0))),
                ("mass, mg", s.core_mass_kg.map(|v| format!("{:.2}", v * 1e6))),
                (
                    "yield: length at rest over the length that was cut, %",
                    s.core_yield.map(|v| format!("{:.1}", v * 100.0)),
                ),
            ];
            let rows: Vec<Vec<String>> =
                core.into_iter().filter_map(|(what, value)| Some(vec![what.to_string(), value?])).collect();
            if rows.is_empty() {
                text += "<p>The run tells nothing about a core.</p>\n";
            } else {
                text += &table(
                    "",
                    "The core in the bore at the end of the run.",
                    &[words("core"), numbers("value")],
                    &rows,
                );
            }
            if let Some(core) = &case.core {
                let lines = [
                    ("length_m", INWARD, None, "length in the bore"),
                    ("rest_length_m", OUTWARD, Some((7, 4)), "at rest"),
                ];
                let mut plot =
                    Plot { x_label: "depth of the tip [mm]", y_label: "length of the core [mm]", ..Default::default() };
                for (column, colour, dash, _) in lines {
                    let points = core.curve(column).into_iter().map(|(d, l)| (d * 1e3, l * 1e3)).collect();
                    plot.curves.push(Curve { label: "", colour, width: 3 * FINER, dash, points });
                }
                let legend = lines.map(|(_, colour, dash, name)| legend_line(colour, 3.0, dash, name));
                let chart = inline(&plot, "Length of the core against depth")?;
                text += &figure(&chart, &format!("{}Length of the core on the way in.", legend_row(&legend)));
            }
            if !case.scene.outputs.pictures_at.is_empty() {
                text +=
                    "<div class=\"scroll\"><div class=\"pictures\" style=\"grid-template-columns: repeat(4, 1fr)\">\n";
                for &depth in &case.scene.outputs.pictures_at {
                    text += &picture_or_gap(case, depth, &format!("{} mm", trimmed(depth * 1e3)));
                }
                text += "</div></div>\n";
            }
        }
        if text.is_empty() {
            text += "<p>The biopsy needle of Fig. 9 is hollow and takes a core of tissue with it. This report has no run of \
                     a hollow needle: all its needles are solid.</p>\n";
        }
        Ok(text)
    }
}
