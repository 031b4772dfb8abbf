//! The paper [Lv2022] beside runs of this program: its cases, its numbers and the page.

use plotters::style::{BLACK, RGBColor, WHITE};

use super::CaseResults;
use crate::needle::{NeedleShape, TipShape, Tool};
use crate::observables::{ForcePart, ForceParts};
use crate::output::chart::{Curve, FINER, GREEN, INWARD, OUTWARD, rgb};
use crate::output::curve::{DROP_FRACTION, DROP_TRAVEL, ForceDrop, sudden_drops};
use crate::output::page::{document, escape, figure, numbers, picture, table, words};
use crate::output::plot::{Area, Mark, Plot, legend_dot, legend_line, legend_row, legend_swatch};
use crate::output::summary::Status;
use crate::scene::Scene;
use crate::units::trimmed;
use crate::{Error, Result};

/// Folder of the scenes in the repository.
pub const SCENES: &str = "scenes/lv2022";

/// What a run is for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Role {
    /// A solid needle at one of the paper's speeds.
    Speed,
    /// The hollow biopsy needle of Fig. 9.
    Hollow,
}

/// One scene of the report.
#[derive(Debug, Clone, Copy)]
pub struct Case {
    /// File stem in the folder of the scenes, and folder of its results.
    pub name: &'static str,
    pub role: Role,
    /// A report without its scene is complete.
    pub optional: bool,
    /// What a quick look changes; `None`: it leaves the case out.
    pub quick: Option<&'static [&'static str]>,
}

/// Coarse cells: ten times fewer cell steps.
const COARSE: Option<&[&str]> = Some(&["tissue.cell_size_mm=1.2"]);

/// All scenes of the report, in the order in which they run and stand on the page.
pub const CASES: [Case; 4] = [
    Case { name: "speed_2", role: Role::Speed, optional: false, quick: COARSE },
    Case { name: "speed_5", role: Role::Speed, optional: false, quick: COARSE },
    Case { name: "speed_10", role: Role::Speed, optional: false, quick: COARSE },
    Case { name: "hollow", role: Role::Hollow, optional: true, quick: None },
];

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

/// Depths of Fig. 11 [m].
const SPEED_PICTURES: [f64; 4] = [3e-3, 6e-3, 9e-3, 12e-3];
/// Stages of Fig. 9 and the depths at which they are drawn here [m].
const STAGES: [(f64, &str); 3] = [(0.5e-3, "first contact"), (3e-3, "tip inside the tissue"), (5e-3, "needle inside")];
/// Smallest fall of the force that is listed beside the drops.
const RIPPLE: f64 = 0.01;
/// Difference between the spacing of falls and the edge of the cells below which they are the ripple of the mesh.
const SAME_PERIOD: f64 = 0.15;

/// Bounds of a healthy run: energy imbalance, kinetic and hourglass over internal energy (medians).
const HEALTHY: [f64; 3] = [0.02, 0.05, 0.05];

const SPEED_COLOURS: [RGBColor; 3] = [INWARD, OUTWARD, GREEN];

/// Everything that the page tells.
#[derive(Debug, Clone)]
pub struct Report {
    /// Finished and failed runs, in the order of [`CASES`].
    pub cases: Vec<(Case, CaseResults)>,
    /// `key=value` texts that changed the scenes.
    pub overrides: Vec<String>,
    pub quick: bool,
    /// Command that makes this page.
    pub command: String,
    /// Moment at which the page was written, in words.
    pub written: String,
}

impl Report {
    /// The whole page.
    pub fn page(&self) -> Result<String> {
        let sections = [
            ("maximum", "Maximum force", self.maximum_force()),
            ("curves", "Force against depth", self.curves()?),
            ("parts", "What the force consists of", self.parts()?),
            ("drops", "Sudden drops of the force (Fig. 10)", self.drops()?),
            ("stages", "Three stages of the puncture (Fig. 9)", self.stages()),
            ("speeds", "Stress at four depths and three speeds (Fig. 11)", self.speed_pictures()),
            ("hollow", "The hollow needle", self.hollow()?),
            ("health", "Energies and health of the runs", self.health()),
            ("unknown", "What the paper leaves open, and what is assumed here", self.unknown()),
            ("missing", "What this model does not show", self.missing()),
            ("figures", "All figures of every run", self.figures()),
        ];
        let mut body =
            format!("<header>\n<h1>{}</h1>\n{}</header>\n<nav>\n", "Lv et al. 2022 beside Stylet", self.done());
        for (id, title, _) in &sections {
            body += &format!("<a href=\"#{id}\">{}</a>\n", escape(title));
        }
        body += "</nav>\n<main>\n";
        for (id, title, content) in &sections {
            body += &format!("<section id=\"{id}\">\n<h2>{}</h2>\n{content}</section>\n", escape(title));
        }
        body += &format!(
            "</main>\n<footer><p class=\"soft\">Made again by <code>{}</code>; runs of unchanged scenes are \
             reused.</p></footer>\n",
            escape(&self.command)
        );
        Ok(document("Lv et al. 2022 beside Stylet", &body))
    }

    /// True where the scenes ran as they are: otherwise no figure is judged against the paper.
    fn compares(&self) -> bool {
        !self.quick && self.overrides.is_empty()
    }

    fn of(&self, role: Role) -> impl Iterator<Item = &CaseResults> {
        self.cases.iter().filter(move |(case, _)| case.role == role).map(|(_, results)| results)
    }

    /// The runs at the paper's speeds.
    fn speeds(&self) -> Vec<&CaseResults> {
        self.of(Role::Speed).collect()
    }

    /// What was done, with which adapter, version and date.
    fn done(&self) -> String {
        let speeds = self.speeds();
        let mut text = String::from(
            "<p>Lv, Song, Gao, Liu, Wan and Jiang, <cite>Three-dimensional modeling and simulation of muscle tissue \
             puncture process</cite> (doi 10.1186/s10033-022-00719-y), push a needle into muscle at three speeds, in a \
             simulation and in an experiment. This page puts runs of Stylet beside the numbers that they print.</p>\n",
        );
        if !self.compares() {
            let changes: Vec<String> = self.overrides.iter().map(|o| format!("<code>{}</code>", escape(o))).collect();
            text += &format!(
                "<p class=\"notice\">{} Changed in the scenes: {}. These figures are not those of the scenes and are no \
                 comparison with the paper.</p>\n",
                if self.quick { "A quick look on coarse cells." } else { "Not the scenes as they are." },
                changes.join(", ")
            );
        }
        let failed: Vec<String> = self
            .cases
            .iter()
            .filter_map(|(_, c)| match &c.summary.status {
                Status::Failed(why) => Some(format!("{}: {}", escape(&c.name), escape(why))),
                _ => None,
            })
            .collect();
        if !failed.is_empty() {
            text += &format!(
                "<p class=\"notice\">Not all runs came to their end; what is shown of them ends early. {}</p>\n",
                failed.join("; ")
            );
        }
        let same = |value: &dyn Fn(&CaseResults) -> String| {
            let mut values: Vec<String> = Vec::new();
            for (_, case) in &self.cases {
                let value = value(case);
                if !values.contains(&value) {
                    values.push(value);
                }
            }
            escape(&values.join("; "))
        };
        let wall: f64 = self.cases.iter().map(|(_, c)| c.summary.wall_s).sum();
        let list: Vec<String> = speeds.iter().map(|c| trimmed(c.speed())).collect();
        let hollow = if self.of(Role::Hollow).next().is_some() { "; a hollow needle" } else { "" };
        let rows = [
            (
                "runs",
                format!(
                    "{} insertions at {} mm/s, the same constants in all of them{hollow}",
                    speeds.len(),
                    and(&list)
                ),
            ),
            ("engine", same(&|c| c.summary.engine.clone())),
            (
                "adapter",
                same(&|c| if c.summary.adapter.is_empty() { "processor".into() } else { c.summary.adapter.clone() }),
            ),
            ("driver", same(&|c| if c.summary.driver.is_empty() { "none".into() } else { c.summary.driver.clone() })),
            ("Stylet", same(&|c| c.summary.version.clone())),
            (
                "cells",
                same(&|c| {
                    format!("{}, edge at the path {} mm", c.summary.cells, trimmed(c.scene.tissue.cell_size * 1e3))
                }),
            ),
            ("runs finished", same(&|c| c.finished.clone())),
            ("page written", escape(&self.written)),
            ("time of all steps", format!("{wall:.1} s")),
        ];
        text +=
            &table("", "", &[words("what"), words("value")], &rows.map(|(what, value)| vec![what.to_string(), value]));
        text
    }

    /// Maximum force of a run beside the paper's.
    fn maximum_force(&self) -> String {
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
        text + "</p>\n<p>What this agreement is worth: tip forces, softened radius, ring radius and contact stiffness are \
                calibrated, with the paper's 1.2 to 1.4 N as the target; the stiffness of the tissue is not. That the \
                force lies near the paper's is therefore no prediction. The scenes of the three speeds share all \
                constants, so nothing is fitted per speed.</p>\n"
    }

    fn curves(&self) -> Result<String> {
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

    fn parts(&self) -> Result<String> {
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

    fn drops(&self) -> Result<String> {
        let speeds = self.speeds();
        let Some(first) = speeds.first() else {
            return Ok(String::new());
        };
        let curve = first.curve("axial_force_n");
        let drops = sudden_drops(&curve, DROP_FRACTION);
        let mut plot =
            Plot { x_label: "depth of the tip [mm]", y_label: "force on the tissue [N]", ..Default::default() };
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
        let falls = format!("falls of {:.0} to {:.0} %", 100.0 * RIPPLE, 100.0 * DROP_FRACTION);
        let legend = [
            legend_line(INWARD, 3.0, None, "axial force"),
            legend_dot(
                OUTWARD,
                &format!("drop of at least {:.0} % within {} mm", 100.0 * DROP_FRACTION, DROP_TRAVEL * 1e3),
            ),
            legend_dot(WHITE, &falls),
        ];
        let chart = inline(&plot, "Axial force against depth with its drops")?;
        let title = escape(&first.scene.title);
        let mut text = figure(&chart, &format!("{}{title}", legend_row(&legend)));

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
        if !drops.is_empty() {
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

    fn stages(&self) -> String {
        let Some(case) = self.speeds().first().copied() else {
            return String::new();
        };
        let mut text = String::from(
            "<div class=\"scroll\"><div class=\"pictures\" style=\"grid-template-columns: repeat(3, 1fr)\">\n",
        );
        for (depth, name) in STAGES {
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

    fn speed_pictures(&self) -> String {
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

    fn hollow(&self) -> Result<String> {
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

    fn health(&self) -> String {
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

    fn unknown(&self) -> String {
        let Some(case) = self.speeds().first().copied() else {
            return String::new();
        };
        let scene = &case.scene;
        let effects = &scene.effects;
        let mut rows = Vec::new();
        let mut row = |what: &str, paper: &str, here: String| {
            rows.push(vec![escape(what), escape(paper), escape(&here)]);
        };
        if let Some(Tool::Needle(needle)) = &scene.tool {
            row(
                "needle",
                "diameter and wall not printed; drawn hollow",
                format!("{}, diameter {:.3} mm, solid", needle.name, 2e3 * needle.radius),
            );
            let tip = match needle.tip {
                TipShape::Cone => {
                    format!("cone with a half angle of {:.1} deg", needle.tip_slope().atan().to_degrees())
                }
                TipShape::Bevel { .. } => format!("bevel of {} mm", trimmed(needle.tip_length * 1e3)),
            };
            row("tip", "shape not printed", tip);
        }
        row(
            "material of the needle",
            "E 640000 MPa, 1.48e-8 g/mm^3 (lighter than air), nu 0.22",
            "rigid: none of the three is used".into(),
        );
        let size = scene.tissue.size * 1e3;
        row(
            "block of tissue",
            "size not printed; \"fixed coupling\"",
            format!("{} x {} x {} mm; {}", trimmed(size.x), trimmed(size.y), trimmed(size.z), held(scene)),
        );
        let law = &scene.material.law;
        row(
            "elastic constants",
            "Table 1: C10 4.75, C01 -4.91, no unit. Their sum is negative: the tissue at rest is unstable in any unit",
            format!(
                "preset {}: {}, E {:.1} kPa, nu {:.3}; {}",
                scene.material.name,
                crate::material::describe_constants(law),
                law.youngs_modulus() * 1e-3,
                law.poisson_ratio(),
                scene.material.source
            ),
        );
        row(
            "strains at yield and at failure",
            "only drawn (Fig. 2); printed are the strengths, 85 kPa along and 26 kPa across the fibres",
            match (effects.plasticity.is_some(), effects.damage.is_some()) {
                (false, false) => "not used: no plastic flow and no damage of the bulk in these runs".into(),
                _ => "from the preset; the strains are assumed".into(),
            },
        );
        row(
            "failure displacement",
            "4e-6, no unit; as m or mm it dissipates almost nothing",
            match effects.damage {
                None => "not used".into(),
                Some(_) => "of the effect damage".into(),
            },
        );
        if let (Some(p), Some(Tool::Needle(needle))) = (&effects.puncture, &scene.tool) {
            row(
                "separation law",
                "\"bilinear cohesion model\" without strength, stiffness or energy",
                format!(
                    "the tip needs {} N to open the surface and {} N to cut on ({:.0} J/m^2 over the diameter), falling \
                     over {} mm; cells within {} mm of its path keep {} % of their stiffness",
                    trimmed(p.puncture_force),
                    trimmed(p.cutting_force),
                    p.cutting_force / (2.0 * needle.radius),
                    trimmed(p.transition_length * 1e3),
                    trimmed(p.softened_radius * 1e3),
                    trimmed(p.residual_stiffness * 100.0)
                ),
            );
        }
        row("density of the tissue", "not printed", format!("{} kg/m^3", trimmed(scene.material.density)));
        row(
            "stress relaxation",
            "said to be measured; no number printed",
            if effects.viscoelastic.is_some() { "Prony series of the scene" } else { "none" }.into(),
        );
        let scalings: Vec<String> = self.speeds().iter().map(|c| format!("{:.0}", c.summary.mass_scaling)).collect();
        row("time step and mass scaling", "not printed", format!("mass scaling {}", and(&scalings)));
        row("number of experiments behind Fig. 12, their scatter", "not printed", "one run per speed".into());
        let friction = effects.friction.map_or("no friction".into(), |f| {
            format!("friction {} on the shaft, none on the tip", trimmed(f.coefficient))
        });
        table("words", "", &[words("what"), words("the paper"), words("here")], &rows)
            + &format!(
                "<p>As in the paper: the three speeds, the depths, insertion straight down, {}.</p>\n",
                escape(&friction)
            )
    }

    fn missing(&self) -> String {
        let speeds = self.speeds();
        let Some(case) = speeds.first() else {
            return String::new();
        };
        let on = |key: &str| case.summary.effects.iter().any(|e| e == key);
        let mut items = Vec::new();
        if rate_free(&case.scene) {
            let measured = largest_difference(&speeds).map_or(String::new(), |d| {
                format!(" The force at one depth differs by at most {d:.3} N between them.")
            });
            items.push(format!(
                "A rate effect. No law of these scenes contains a rate; what differs between the speeds is the little \
                 inertia and damping that is left.{measured}"
            ));
        }
        if !on("adhesion") {
            items.push(
                "The paper's many drops. Nothing sticks to the tip here, so no \"built-up edge\" grows and breaks off, and \
                 their number cannot rise with speed."
                    .into(),
            );
        }
        let materials = std::iter::once(&case.scene.material).chain(case.scene.regions.iter().map(|r| &r.material));
        if materials.into_iter().all(|material| material.membrane_energy.is_none()) {
            items.push(
                "An outer membrane (\"biological valve\"). The larger force that opens the surface stands for it."
                    .into(),
            );
        }
        items.push(
            "Separated faces. The opened path is softened cells and a ring of nodes that the needle pushes aside; a gap \
             between tissue and needle that widens with speed (Fig. 11) cannot appear."
                .into(),
        );
        if !on("flexible_needle") {
            items.push(
                "A flexible needle, its weight and the vibration of the platform, by which the paper explains its region Z."
                    .into(),
            );
        }
        if self.of(Role::Hollow).next().is_none() {
            items.push("The hollow needle, its core and the biopsy itself.".into());
        }
        let list: String = items.iter().map(|item| format!("<li>{}</li>\n", escape(item))).collect();
        format!("<ul>\n{list}</ul>\n")
    }

    /// Every number of every summary file as it stands there.
    fn figures(&self) -> String {
        let mut keys: Vec<&str> = Vec::new();
        for (_, case) in &self.cases {
            for (key, _) in &case.figures {
                if !keys.contains(&key.as_str()) {
                    keys.push(key);
                }
            }
        }
        let mut columns = vec![words("figure, unit at the end")];
        columns.extend(self.cases.iter().map(|(_, case)| words(&case.name)));
        let rows: Vec<Vec<String>> = keys
            .iter()
            .map(|key| {
                let values = self.cases.iter().map(|(_, case)| {
                    let value = case.figures.iter().find(|(k, _)| k == key);
                    value.map_or(String::new(), |(_, value)| escape(&plain(value)))
                });
                std::iter::once(escape(key)).chain(values).collect()
            })
            .collect();
        table("raw", "As in summary.json; a dash stands for \"the run does not hold this number\".", &columns, &rows)
    }
}

fn inline(plot: &Plot, description: &str) -> Result<String> {
    plot.inline(description).map_err(|reason| Error::File {
        path: "lv2022.html".into(),
        source: std::io::Error::other(format!("chart: {reason}")),
    })
}

fn picture_or_gap(case: &CaseResults, depth: f64, caption: &str) -> String {
    let description = format!("von Mises stress, {} at {} mm", case.name, trimmed(depth * 1e3));
    match case.picture(depth) {
        Some(png) => figure(&picture(&png, &description), &escape(caption)),
        None => figure("", &escape(&format!("{} mm: not reached by this run", trimmed(depth * 1e3)))),
    }
}

/// `2 mm/s`, never broken between number and unit.
fn speed_of(case: &CaseResults) -> String {
    format!("{}\u{a0}mm/s", trimmed(case.speed()))
}

/// True where no law of the scene depends on a rate.
fn rate_free(scene: &Scene) -> bool {
    let effects = &scene.effects;
    effects.viscoelastic.is_none() && effects.puncture.is_none_or(|p| p.rate_exponent == 0.0)
}

/// What holds the block, in words.
fn held(scene: &Scene) -> String {
    let held: Vec<&str> = scene
        .faces
        .iter()
        .zip(crate::scene::Face::ALL)
        .filter(|(condition, _)| condition.fixed == [true; 3])
        .map(|(_, face)| face.key())
        .collect();
    match held[..] {
        ["x_min", "x_max", "y_min", "y_max", "z_min"] => "sides and bottom held, top free".into(),
        [] => "no face held".into(),
        _ => format!("held: {}", held.join(", ")),
    }
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

/// Axial force of the frame nearest to a depth [m] on the way in, if the run came that far.
fn force_at(case: &CaseResults, depth: f64) -> Option<f64> {
    let curve = case.curve("axial_force_n");
    let step = curve.windows(2).map(|pair| pair[1].0 - pair[0].0).fold(0.0, f64::max);
    let nearest = curve.iter().min_by(|a, b| (a.0 - depth).abs().total_cmp(&(b.0 - depth).abs()))?;
    ((nearest.0 - depth).abs() <= step).then_some(nearest.1)
}

/// Largest difference of the axial force between two runs at one depth [N].
fn largest_difference(cases: &[&CaseResults]) -> Option<f64> {
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

fn interpolated(curve: &[(f64, f64)], x: f64) -> Option<f64> {
    let after = curve.partition_point(|p| p.0 < x);
    let (b, a) = (curve.get(after)?, after.checked_sub(1).map_or(curve[after], |i| curve[i]));
    let part = if b.0 > a.0 { (x - a.0) / (b.0 - a.0) } else { 0.0 };
    (x >= curve[0].0).then_some(a.1 + part * (b.1 - a.1))
}

/// Smallest and largest value.
fn bounds(values: &[f64]) -> (f64, f64) {
    values.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), &v| (low.min(v), high.max(v)))
}

fn percent_off(fraction: f64) -> String {
    let text = format!("{:+.1}", 100.0 * fraction);
    format!("{} %", if matches!(text.as_str(), "-0.0" | "+0.0") { "0.0" } else { &text })
}

/// `2, 5 and 10`.
fn and(items: &[String]) -> String {
    match items {
        [] => String::new(),
        [one] => one.clone(),
        [most @ .., last] => format!("{} and {last}", most.join(", ")),
    }
}

/// A value of the summary as its file has it.
fn plain(value: &serde_json::Value) -> String {
    match value {
        serde_json::Value::Null => "-".into(),
        serde_json::Value::String(text) => text.clone(),
        serde_json::Value::Array(items) => items.iter().map(plain).collect::<Vec<_>>().join(", "),
        other => other.to_string(),
    }
}
