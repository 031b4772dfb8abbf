//! Sudden drops of the force, and the ripple of the mesh.

use plotters::style::WHITE;

use super::{Report, inline, speed_of};
use crate::Result;
use crate::output::chart::{Curve, FINER, INWARD, OUTWARD};
use crate::output::curve::{DROP_FRACTION, DROP_TRAVEL, ForceDrop, sudden_drops};
use crate::output::page::{escape, figure, numbers, table, words};
use crate::output::plot::{Mark, Plot, legend_dot, legend_line, legend_row};
use crate::output::report::CaseResults;

/// Smallest fall of the force that is listed beside the drops.
const RIPPLE: f64 = 0.01;
/// Difference between the spacing of falls and the edge of the cells below which they are the ripple of the mesh.
const SAME_PERIOD: f64 = 0.15;

impl Report {
    pub(super) fn drops(&self) -> Result<String> {
        let speeds = self.speeds();
        let Some(first) = speeds.first() else {
            return Ok(String::new());
        };
        let falls = format!("falls of {:.0} to {:.0} %", 100.0 * RIPPLE, 100.0 * DROP_FRACTION);
        let mut text = drop_chart(first, &falls)?;
        let mut rows = Vec::new();
        let mut mesh_ripple = true;
        for case in &speeds {
            let curve = case.curve("axial_force_n");
            let (drops, small) = (sudden_drops(&curve, DROP_FRACTION), ripple(&curve));
            let cell = case.scene.tissue.cell_size;
            let spacing = spacing(&small);
            mesh_ripple &= spacing.is_none_or(|s| (s / cell - 1.0).abs() < SAME_PERIOD);
            let list: Vec<String> = drops
                .iter()
                .map(|d| format!("{:.3} to {:.3} N at {:.2} mm", d.force, d.force_after, d.depth * 1e3))
                .collect();
            rows.push(vec![
                speed_of(case),
                drops.len().to_string(),
                if list.is_empty() { "-".into() } else { list.join("; ") },
                small.len().to_string(),
                spacing.map_or("-".into(), |s| format!("{:.2}", s * 1e3)),
                format!("{:.2}", cell * 1e3),
            ]);
        }
        text += &table(
            "",
            "Falls of the axial force within 0.5 mm of travel, on the way in.",
            &[
                words("speed"),
                numbers(&format!("drops of {:.0} % or more", 100.0 * DROP_FRACTION)),
                words("where"),
                numbers(&falls),
                numbers("their spacing (median), mm"),
                numbers("cells, mm"),
            ],
            &rows,
        );
        if !sudden_drops(&first.curve("axial_force_n"), DROP_FRACTION).is_empty() {
            text += "<p>The first drop is the paper's point X: the tip breaks through the surface, and the force \
                     falls.</p>\n";
        }
        text += "<p>The paper sees several drops more and ascribes them to tissue that sticks to the tip and comes off (a \
                 \"built-up edge\"); it expects two drops in a homogeneous body, one where the tip enters and one where it \
                 leaves. The body here is homogeneous, and the needle does not leave it.</p>\n";
        if mesh_ripple {
            text += "<p>The small falls come about once per cell: they are the ripple of the mesh and must not be read as the paper's drops.</p>\n";
        } else {
            text += "<p>The small falls do not have the spacing of the cells.</p>\n";
        }
        Ok(text)
    }
}

/// Force against depth with its drops; `falls` says what the small ones are.
fn drop_chart(case: &CaseResults, falls: &str) -> Result<String> {
    let curve = case.curve("axial_force_n");
    let drops = sudden_drops(&curve, DROP_FRACTION);
    let mut plot = Plot { x_label: "depth of the tip [mm]", y_label: "force on the tissue [N]", ..Default::default() };
    let points = curve.iter().map(|(d, f)| (d * 1e3, *f)).collect();
    plot.curves.push(Curve { label: "", colour: INWARD, width: 3 * FINER, dash: None, points });
    for (number, drop) in drops.iter().enumerate() {
        plot.marks.push(Mark {
            at: (drop.depth * 1e3, drop.force),
            colour: OUTWARD,
            text: Some(format!("{}: {:.2} N", number + 1, drop.force)),
        });
    }
    for fall in ripple(&curve) {
        plot.marks.push(Mark { at: (fall.depth * 1e3, fall.force), colour: WHITE, text: None });
    }
    let legend = [
        legend_line(INWARD, 3.0, None, "axial force"),
        legend_dot(
            OUTWARD,
            &format!("drop of at least {:.0} % within {} mm", 100.0 * DROP_FRACTION, DROP_TRAVEL * 1e3),
        ),
        legend_dot(WHITE, falls),
    ];
    let chart = inline(&plot, "Axial force against depth with its drops")?;
    let title = escape(&case.scene.title);
    Ok(figure(&chart, &format!("{}{title}", legend_row(&legend))))
}

/// Falls of the force that are no drops.
fn ripple(curve: &[(f64, f64)]) -> Vec<ForceDrop> {
    sudden_drops(curve, RIPPLE).into_iter().filter(|fall| fall.fraction() < DROP_FRACTION).collect()
}

/// Median distance of neighbouring falls [m]; a mean would hang on a single one that stays below the threshold.
fn spacing(falls: &[ForceDrop]) -> Option<f64> {
    let mut distances: Vec<f64> = falls.windows(2).map(|pair| pair[1].depth - pair[0].depth).collect();
    distances.sort_by(f64::total_cmp);
    distances.get(distances.len() / 2).copied()
}
