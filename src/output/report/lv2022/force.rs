//! The force: its maximum, its curve, its parts.

use plotters::style::{BLACK, RGBColor};

use super::{Report, inline, predicts, speed_of};
use crate::Result;
use crate::observables::{ForcePart, ForceParts};
use crate::output::chart::{Curve, FINER, GREEN, INWARD, OUTWARD, rgb};
use crate::output::curve::interpolated;
use crate::output::page::{escape, figure, numbers, table, words};
use crate::output::plot::{Area, Plot, legend_line, legend_row, legend_swatch};
use crate::output::report::CaseResults;
use crate::output::report::words::{bounds, percent_off};
use crate::output::summary::Status;

/// Maximum forces that section 4.3 prints [N] at a speed [mm/s].
struct PaperForce {
    speed: f64,
    simulated: f64,
    measured: f64,
}

const PAPER_FORCES: [PaperForce; 3] = [
    PaperForce { speed: 2.0, simulated: 1.28, measured: 1.35 },
    PaperForce { speed: 5.0, simulated: 1.21, measured: 1.33 },
    PaperForce { speed: 10.0, simulated: 1.36, measured: 1.36 },
];

/// Difference from the measured maximum that counts as met.
const MET: f64 = 0.10;

const SPEED_COLOURS: [RGBColor; 3] = [INWARD, OUTWARD, GREEN];

impl Report {
    /// Maximum force of a run beside the paper's.
    pub(super) fn maximum_force(&self) -> String {
        let mut rows = Vec::new();
        let mut ours = Vec::new();
        let (mut met, mut compared) = (0, 0);
        for case in self.speeds() {
            let paper = PAPER_FORCES.iter().find(|p| (p.speed - case.speed()).abs() < 1e-6 * p.speed);
            let speed = speed_of(case);
            let (Some(paper), Some(force)) = (paper, case.summary.peak_force_n) else {
                rows.push(vec![speed, "-".into(), "-".into(), "-".into(), "-".into(), "-".into(), "no result".into()]);
                continue;
            };
            let off = |reference: f64| force / reference - 1.0;
            compared += 1;
            ours.push(force);
            let verdict = if case.summary.status != Status::Ok {
                "<span class=\"bad\">the run ended early</span>".to_string()
            } else if !self.compares() {
                "not judged".to_string()
            } else if off(paper.measured).abs() <= MET {
                met += 1;
                format!("<span class=\"good\">within {:.0} % of the measured</span>", 100.0 * MET)
            } else {
                format!("<span class=\"bad\">not within {:.0} % of the measured</span>", 100.0 * MET)
            };
            rows.push(vec![
                speed,
                format!("{force:.3}"),
                format!("{:.2}", paper.measured),
                percent_off(off(paper.measured)),
                format!("{:.2}", paper.simulated),
                percent_off(off(paper.simulated)),
                verdict,
            ]);
        }
        let mut text = table(
            "",
            "Largest axial force on the way in to 12 mm. A difference is ours over theirs.",
            &[
                words("speed"),
                numbers("Stylet, N"),
                numbers("measured, N"),
                numbers("difference"),
                numbers("paper's simulation, N"),
                numbers("difference"),
                words("verdict"),
            ],
            &rows,
        );
        let spread = |values: &[f64]| {
            let (low, high) = bounds(values);
            high / low - 1.0
        };
        text += &match self.compares() {
            true => format!("<p>{met} of {} within {:.0} % of the measured force.", PAPER_FORCES.len(), 100.0 * MET),
            false => {
                "<p>Not judged: these are not the scenes as they are; the differences only show what the change does."
                    .into()
            }
        };
        if compared >= 2 {
            let simulated: Vec<f64> = PAPER_FORCES.iter().map(|p| p.simulated).collect();
            let measured: Vec<f64> = PAPER_FORCES.iter().map(|p| p.measured).collect();
            let (low, high) = bounds(&simulated);
            text += &format!(
                " From the smallest to the largest of the three speeds our maximum changes by {:.1} %, the measured one by \
                 {:.1} % and that of the paper's simulation by {:.1} %. Neither row of the paper rises or falls steadily \
                 with speed, so it is no speed law that could be followed; a model without rate effect, the same at all \
                 speeds, stays at least {:.1} % away from one of the simulated values.",
                100.0 * spread(&ours),
                100.0 * spread(&measured),
                100.0 * spread(&simulated),
                100.0 * (high - low) / (high + low)
            );
        }
        text += "</p>\n<p>What this comparison is worth: ";
        text += if self.speeds().iter().all(|case| predicts(&case.scene)) {
            "no number of these scenes was chosen for the force. It follows from the elastic constants, from the toughness of \
             the tissue, which nobody has measured for this muscle and which is taken from bovine liver under needles, from \
             the paper's coefficient of friction, and from a needle of which the paper prints no dimension. With 76 to \
             550 J/m^2 the theory has 0.95 to 1.84 N at 12 mm."
        } else {
            "tip forces, softened radius, ring radius and contact stiffness are calibrated, with the paper's 1.2 to 1.4 N as \
             the target; the stiffness of the tissue is not. That the force lies near the paper's is therefore no prediction."
        };
        text + " The scenes of the three speeds share all constants, so nothing is fitted per speed.</p>\n"
    }

    pub(super) fn curves(&self) -> Result<String> {
        let speeds = self.speeds();
        let styles = [(5, None), (3, Some((9, 5))), (2, Some((2, 3)))];
        let mut plot =
            Plot { x_label: "depth of the tip [mm]", y_label: "force on the tissue [N]", ..Default::default() };
        let deepest = speeds.iter().flat_map(|c| c.curve("axial_force_n")).map(|p| p.0).fold(0.0, f64::max) * 1e3;
        let all: Vec<f64> = PAPER_FORCES.iter().flat_map(|p| [p.simulated, p.measured]).collect();
        let (low, high) = bounds(&all);
        let grey = RGBColor(128, 128, 128);
        plot.areas.push(Area {
            label: "maxima of the paper",
            colour: grey,
            opacity: 0.25,
            corners: vec![(0.0, low), (deepest, low), (deepest, high), (0.0, high)],
        });
        let mut legend = vec![legend_swatch(grey, 0.35, &format!("the paper's six maxima, {low:.2} to {high:.2} N"))];
        for ((case, colour), (width, dash)) in speeds.iter().zip(SPEED_COLOURS).zip(styles) {
            let points = case.curve("axial_force_n").into_iter().map(|(d, f)| (d * 1e3, f)).collect();
            plot.curves.push(Curve { label: "", colour, width: width * FINER, dash, points });
            legend.push(legend_line(colour, f64::from(width), dash, &speed_of(case)));
        }
        let mut caption = legend_row(&legend);
        if let Some(case) = speeds.first() {
            let travel = case.speed() / case.scene.solver.frame_rate;
            caption +=
                &format!("Axial force on the tissue on the way in (Fig. 12), means over {travel:.3} mm of travel. ");
        }
        if let Some(difference) = largest_difference(&speeds) {
            caption += &format!(
                "Between the speeds the force differs by at most {difference:.3} N at the same depth{}.",
                if difference < 0.05 { ": the lines lie almost on one another" } else { "" }
            );
        }
        let chart = inline(&plot, "Axial force against depth at the three speeds")?;
        Ok(figure(&chart, &caption))
    }

    pub(super) fn parts(&self) -> Result<String> {
        let stacks: Vec<_> = self.cases.iter().map(|(_, case)| (case, case.stack())).collect();
        let acting: Vec<(usize, &ForcePart)> = ForceParts::PARTS
            .iter()
            .enumerate()
            .filter(|(part, _)| stacks.iter().any(|(_, stack)| stack.acting()[*part]))
            .collect();
        let mut columns = vec![words("run"), numbers("depth, mm"), numbers("axial force, N")];
        columns.extend(acting.iter().map(|(_, part)| numbers(&format!("{}, N", part.name))));
        let mut text = String::from("<div class=\"charts\">\n");
        let mut rows = Vec::new();
        for (case, stack) in &stacks {
            let chart = inline(&stack.plot(), &format!("Parts of the force against depth, {}", case.name))?;
            let mut legend = vec![legend_line(BLACK, 2.5, None, "axial force, their sum")];
            let here = acting.iter().rev().filter(|(index, _)| stack.acting()[*index]);
            legend.extend(here.map(|(_, part)| legend_swatch(rgb(part.colour), 0.8, part.name)));
            text += &figure(&chart, &format!("{}{}", legend_row(&legend), escape(&case.scene.title)));
            let largest = (0..stack.total.len()).max_by(|&a, &b| stack.total[a].total_cmp(&stack.total[b]));
            if let Some(row) = largest {
                let total = stack.total[row];
                let mut cells = vec![escape(&case.name), format!("{:.2}", stack.abscissa[row]), format!("{total:.3}")];
                cells.extend(acting.iter().map(|(index, _)| {
                    let value = stack.parts[*index][row];
                    let share = if total != 0.0 { 100.0 * value / total } else { 0.0 };
                    // Adding zero turns a rounded -0 into 0.
                    format!("{:.3} ({:.0} %)", (value * 1e3).round() * 1e-3 + 0.0, share.round() + 0.0)
                }));
                rows.push(cells);
            }
        }
        text += "</div>\n";
        Ok(text
            + &table(
                "",
                "Parts of the largest force of every run; parts that act in none are left out.",
                &columns,
                &rows,
            ))
    }
}

/// Largest difference of the axial force between two runs at one depth [N].
pub(super) fn largest_difference(cases: &[&CaseResults]) -> Option<f64> {
    let (first, others) = cases.split_first()?;
    let curve = first.curve("axial_force_n");
    let mut largest: Option<f64> = None;
    let differences = others.iter().flat_map(|case| {
        let other = case.curve("axial_force_n");
        curve
            .iter()
            .filter_map(move |(depth, force)| Some((force - interpolated(&other, *depth)?).abs()))
            .collect::<Vec<_>>()
    });
    for difference in differences {
        largest = Some(largest.map_or(difference, |l| l.max(difference)));
    }
    largest
}
