//! `study.html`: what accuracy costs, on one page.

use plotters::style::{BLACK, RGBColor};

use super::advice::{self, ACCURATE};
use super::analysis::{Analysis, Row, convergence_in_words};
use super::metrics::Errors;
use super::plan::{LeftOut, Role};
use super::{Engine, Settings, pareto};
use crate::error::{Error, Result};
use crate::output::chart::{Curve, FINER, GREEN, INWARD, ORANGE, OUTWARD, PINK};
use crate::output::log_plot::{LogPlot, Point, Shape};
use crate::output::page::{document, escape, figure, numbers, table, words};
use crate::output::plot::{Plot, legend_dot, legend_line, legend_row};
use crate::units::{three_decimals, trimmed};

/// Colour of a point by the reason of its run.
const ROLES: [(Role, RGBColor, &str); 6] = [
    (Role::Base, BLACK, "base"),
    (Role::Mesh, INWARD, "mesh size"),
    (Role::Mass, OUTWARD, "mass scaling"),
    (Role::Step, GREEN, "step"),
    (Role::Engine, PINK, "engine"),
    (Role::Grid, ORANGE, "mesh and mass scaling together"),
];
const LIGHT_BLUE: RGBColor = RGBColor(86, 180, 233);
const GREY: RGBColor = RGBColor(128, 128, 128);
const EFFECT_COLOURS: [RGBColor; 6] = [OUTWARD, GREEN, PINK, ORANGE, LIGHT_BLUE, GREY];
/// Label of the axis of most charts.
const FORCE_CURVE: &str = "error of the force curve [%]";

/// The whole page; `command` makes it again, `written` is the moment of its last run in words.
pub fn page(analysis: &Analysis, command: &str, written: &str) -> Result<String> {
    let page = Page { a: analysis };
    let sections = [
        ("time", "Error of the force curve against its price", page.price()?),
        ("errors", "Other errors against wall time", page.other_errors()?),
        ("mesh", "Mesh size: order of convergence", page.convergence()?),
        ("axes", "One axis at a time", page.axes()),
        ("curves", "Force against depth", page.curves()?),
        ("effects", "What every effect costs and changes", page.effects()?),
        ("method", "How it was measured", page.method()),
        ("left", "What was left out", page.left_out()),
        ("runs", "All runs", page.runs()),
    ];
    let title = format!("What accuracy costs: {}", analysis.plan.title);
    let mut body = format!("<header>\n<h1>{}</h1>\n{}</header>\n<nav>\n", escape(&title), page.head(written));
    for (id, title, _) in &sections {
        body += &format!("<a href=\"#{id}\">{}</a>\n", escape(title));
    }
    body += "</nav>\n<main>\n";
    for (id, title, content) in &sections {
        body += &format!("<section id=\"{id}\">\n<h2>{}</h2>\n{content}</section>\n", escape(title));
    }
    body += &format!(
        "</main>\n<footer><p class=\"soft\">Made again by <code>{}</code>; finished runs of an unchanged scene are \
         reused.</p></footer>\n",
        escape(command)
    );
    Ok(document(&title, &body))
}

struct Page<'a> {
    a: &'a Analysis,
}

/// A run that a chart names: run, label, colour, width of its line, and dash and gap where it is dashed [px].
type Wanted<R, L> = (R, L, RGBColor, u32, Option<(u32, u32)>);

impl Page<'_> {
    fn head(&self, written: &str) -> String {
        let (a, plan) = (self.a, &self.a.plan);
        let mut text = String::new();
        for sentence in &a.sentences {
            text += &format!("<p><strong>{}</strong></p>\n", escape(sentence));
        }
        text += &format!(
            "<p>One scene, run with different settings one after the other. Every error is a difference from the reference, \
             the best run that {} minutes allow; what the reference itself is off is not in it (see <a href=\"#mesh\">mesh \
             size</a>).</p>\n",
            trimmed(plan.budget_s / 60.0)
        );
        if !a.missing.is_empty() {
            text += &format!(
                "<p class=\"notice\">{} of {} planned runs are not there: see <a href=\"#left\">what was left out</a>.</p>\n",
                a.missing.len(),
                plan.runs.len()
            );
        }
        for unfit in &plan.unfit {
            text += &format!(
                "<p class=\"notice\">No reference: {}. {}. The reference is the finest mesh below that is fit.</p>\n",
                escape(&unfit.what),
                escape(&unfit.reason)
            );
        }
        if let Some(why) = a.reference().and_then(|row| row.run.unfit()) {
            text += &format!(
                "<p class=\"notice\">The reference is not fit to be one: {}. No error on this page can be trusted; make the \
                 study again with <code>--finest</code> and a coarser mesh.</p>\n",
                escape(&why)
            );
        }
        let clamped = a.reference().map_or(0, |row| row.run.clamped_nodes);
        if clamped > 0 {
            text += &format!(
                "<p class=\"notice\">In the reference {clamped} node steps had their speed clamped; its force around the \
                 puncture is less certain than the rest.</p>\n"
            );
        }
        let mut rows: Vec<(&str, String)> = vec![("scene", format!("{}: {}", plan.scene, plan.title))];
        if !plan.overrides.is_empty() {
            rows.push(("changed with --set", plan.overrides.join(", ")));
        }
        if !plan.changes.is_empty() {
            rows.push(("for the study", plan.changes.join(" ")));
        }
        if let Some(row) = a.reference() {
            rows.push(("reference", described(row)));
        }
        if let Some(row) = a.base() {
            rows.push(("base (the scene as it is)", described(row)));
        }
        rows.push(("runs", format!("{} finished", a.rows.len())));
        rows.push(("adapters", a.origins().join("; ")));
        rows.push(("Stylet", plan.version.clone()));
        rows.push(("last run finished", written.into()));
        let wall: f64 = a.rows.iter().map(|row| row.run.wall_s + row.run.setup_s).sum();
        rows.push(("time of all runs", format!("{:.1} of {} minutes", wall / 60.0, trimmed(plan.budget_s / 60.0))));
        let rows: Vec<Vec<String>> =
            rows.into_iter().map(|(what, value)| vec![what.to_string(), escape(&value)]).collect();
        text + &table("", "", &[words("what"), words("value")], &rows)
    }

    fn choices(&self) -> impl Iterator<Item = &Row> {
        self.a.rows.iter().filter(|row| row.is_choice())
    }

    /// One scatter: what runs cost against what they err, with the front; and how many have no error at all. `named` writes the
    /// settings beside the front.
    fn scatter(
        &self,
        labels: (&'static str, &'static str),
        cost: impl Fn(&Row) -> Option<f64>,
        error: impl Fn(&Row) -> Option<f64>,
        more_is_better: bool,
        named: bool,
    ) -> Result<(String, usize)> {
        let mut plot = LogPlot { x_label: labels.0, y_label: labels.1, ..Default::default() };
        let rows: Vec<(&Row, f64, f64)> =
            self.choices().filter_map(|row| Some((row, cost(row)?, 100.0 * error(row)?))).collect();
        let zeros = rows.iter().filter(|(_, _, e)| *e <= 0.0).count();
        let rows: Vec<_> = rows.into_iter().filter(|(_, c, e)| *c > 0.0 && *e > 0.0).collect();
        let price = |cost: f64| if more_is_better { -cost } else { cost };
        let front = pareto::front(&rows.iter().map(|(_, c, e)| (price(*c), *e)).collect::<Vec<_>>());
        let mut line: Vec<(f64, f64)> =
            rows.iter().zip(&front).filter(|(_, on)| **on).map(|((_, c, e), _)| (*c, *e)).collect();
        line.sort_by(|a, b| a.0.total_cmp(&b.0));
        plot.lines.push(Curve { label: "", colour: GREY, width: 2 * FINER, dash: None, points: line });
        for ((row, cost, error), on) in rows.iter().zip(&front) {
            let colour = ROLES.iter().find(|(role, ..)| *role == row.role).map_or(GREY, |(_, colour, _)| *colour);
            let text = (named && *on).then(|| short(&row.settings));
            plot.points.push(Point { at: (*cost, *error), colour, shape: shape(&row.settings), strong: *on, text });
        }
        if more_is_better {
            plot.guide = Some(1.0);
        }
        let description = format!("{} against {}, logarithmic axes", labels.1, labels.0);
        Ok((drawn(plot.inline(&description))?, zeros))
    }

    fn legend(&self) -> String {
        let present = ROLES.iter().filter(|(role, ..)| self.choices().any(|row| row.role == *role));
        let mut entries: Vec<String> = present.map(|(_, colour, name)| legend_dot(*colour, name)).collect();
        entries.push(legend_line(GREY, 2.0, None, "Pareto front"));
        legend_row(&entries)
    }

    fn price(&self) -> Result<String> {
        let error = |row: &Row| row.errors.force_curve;
        let mut text = format!("{}<div class=\"charts\">\n", self.legend());
        let panels = [
            self.scatter(("wall time of the run [s]", FORCE_CURVE), |row| Some(row.run.wall_s), error, false, true)?,
            self.scatter(
                ("real-time factor [simulated s per s]", FORCE_CURVE),
                |row| Some(row.run.real_time_factor()),
                error,
                true,
                false,
            )?,
            self.scatter(
                ("processor time [ns per cell-step]", FORCE_CURVE),
                |row| row.run.cpu_ns_per_cell_step(),
                error,
                false,
                false,
            )?,
        ];
        let captions = [
            "Relative L2 norm over depth of the difference of the axial force, against wall time. Names: cell edge in mm, \
             factor of mass scaling.",
            "The same against the real-time factor; right of the dashed line a run keeps real time.",
            "The same against processor time of all threads per cell and step: what a step costs, whatever its size.",
        ];
        for ((chart, _), caption) in panels.iter().zip(captions) {
            text += &figure(chart, caption);
        }
        text += "</div>\n<p class=\"soft\">Large points are on the Pareto front: no other run is both cheaper and closer. \
                 Circles: GPU engine. Squares: CPU engine. A run on the mesh of the reference has no error of the mesh in its own. The \
                 repetition of the base and runs with effects switched on or off are not in these charts.</p>\n";
        Ok(text)
    }

    fn other_errors(&self) -> Result<String> {
        type Of = fn(&Row) -> Option<f64>;
        let panels: [(&'static str, &str, Of); 5] = [
            ("error of the puncture force [%]", "Force of the puncture peak.", |r| r.errors.puncture_force),
            ("error of the puncture depth [%]", "Depth of the puncture peak.", |r| r.errors.puncture_depth),
            ("error at the deepest point [%]", "Axial force at the deepest point.", |r| r.errors.deepest_force),
            (
                "error of the displacement [%]",
                "Displacement field at the deepest point: relative L2 norm over fixed points of a 9 x 9 x 9 grid away from the \
                 path.",
                |r| r.errors.displacement,
            ),
            (
                "energy imbalance [% of the work]",
                "Energy that is not accounted for, largest of all frames; no comparison with the reference.",
                |r| r.run.energy_imbalance,
            ),
        ];
        let mut text = format!("{}<div class=\"charts\">\n", self.legend());
        let mut none = Vec::new();
        for (label, caption, of) in panels {
            if !self.choices().any(|row| of(row).is_some()) {
                none.push(label.split(" [").next().unwrap_or(label));
                continue;
            }
            let (chart, zeros) =
                self.scatter(("wall time of the run [s]", label), |r| Some(r.run.wall_s), of, false, false)?;
            let zeros = match zeros {
                0 => String::new(),
                n => format!(" {n} runs have no error at all and no place on this axis."),
            };
            text += &figure(&chart, &format!("{caption}{zeros}"));
        }
        text += "</div>\n";
        if !none.is_empty() {
            text += &format!("<p class=\"soft\">Not in this scene: {}.</p>\n", escape(&none.join(", ")));
        }
        Ok(text)
    }

    fn convergence(&self) -> Result<String> {
        let mut text = String::new();
        for sentence in convergence_in_words(&self.a.orders) {
            text += &format!("<p>{}</p>\n", escape(&sentence));
        }
        let drawn_orders: Vec<_> = self.a.orders.iter().filter(|o| o.errors.len() > 1).collect();
        if drawn_orders.is_empty() {
            return Ok(text);
        }
        let mut plot =
            LogPlot { x_label: "edge of the cells around the path [mm]", y_label: "error [%]", ..Default::default() };
        let mut legend = Vec::new();
        let colours = [INWARD, OUTWARD, GREEN, PINK, ORANGE];
        for (order, colour) in drawn_orders.iter().zip(colours) {
            let points: Vec<(f64, f64)> =
                order.errors.iter().filter(|(_, e)| *e > 0.0).map(|(h, e)| (*h, 100.0 * e)).collect();
            plot.points.extend(points.iter().map(|at| Point {
                at: *at,
                colour,
                shape: Shape::Circle,
                strong: false,
                text: None,
            }));
            let slope = match order.fit.filter(|_| points.len() > 1) {
                Some(fit) => {
                    let ends = [points[0].0, points[points.len() - 1].0];
                    let line = ends.map(|h| (h, 100.0 * fit.error_at_1mm * h.powf(fit.order)));
                    let dash = (!fit.converges()).then_some((4, 4));
                    plot.lines.push(Curve { label: "", colour, width: 2 * FINER, dash, points: line.into() });
                    format!(": slope {:.2}, R2 {:.2}", fit.order, fit.r2)
                }
                None => String::new(),
            };
            legend.push(legend_dot(colour, &format!("{}{slope}", order.what)));
        }
        let chart = drawn(plot.inline("Errors against the edge of the cells, logarithmic axes"))?;
        let caption = format!(
            "{}Errors against the reference on meshes coarser than its own, with least-squares lines; dashed where the data \
             show no convergence (slope below 0.5 or R2 below 0.8).",
            legend_row(&legend)
        );
        Ok(text + &figure(&chart, &caption))
    }

    fn axes(&self) -> String {
        let mut text = String::new();
        let axes = [
            (Role::Mesh, "Mesh size", "cells, mm"),
            (Role::Mass, "Mass scaling", "factor"),
            (Role::Step, "Step safety", "part of the stable step"),
            (Role::Engine, "Engine and precision", "engine"),
        ];
        for (role, caption, head) in axes {
            let mut rows: Vec<&Row> = self.a.of(Role::Base).chain(self.a.of(role)).collect();
            if rows.len() < 2 {
                continue;
            }
            let value = |s: &Settings| match role {
                Role::Mesh => s.cell_size_mm,
                Role::Mass => s.mass_scaling,
                Role::Step => s.safety,
                _ => s.engine as usize as f64,
            };
            rows.sort_by(|a, b| value(&a.settings).total_cmp(&value(&b.settings)));
            let cells = rows.iter().map(|row| {
                let name = match role {
                    Role::Engine => row.settings.engine.describe().to_string(),
                    _ => trimmed(value(&row.settings)),
                };
                let name = if row.role == Role::Base { format!("{name} (base)") } else { name };
                let run = &row.run;
                vec![
                    escape(&name),
                    run.cells.to_string(),
                    format!("{:.0}", run.dt_s * 1e6),
                    format!("{:.1}", run.wall_s),
                    three_decimals(run.real_time_factor()),
                    percent(row.errors.force_curve),
                    percent(row.errors.puncture_force),
                    percent(row.errors.deepest_force),
                    percent(row.errors.displacement),
                    percent(run.energy_imbalance),
                    percent(row.change),
                    clamped(row),
                ]
            });
            let columns = [
                words(head),
                numbers("cells"),
                numbers("step, us"),
                numbers("wall time, s"),
                numbers("real-time factor"),
                numbers("force curve, %"),
                numbers("puncture force, %"),
                numbers("deepest force, %"),
                numbers("displacement, %"),
                numbers("energy imbalance, %"),
                numbers("force curve against the base, %"),
                numbers("clamped, inverted"),
            ];
            text += &table("", caption, &columns, &cells.collect::<Vec<_>>());
        }
        if text.is_empty() {
            return "<p>No axis was varied alone.</p>\n".into();
        }
        text + "<p class=\"soft\">Errors are against the reference; the last but one column is the difference from the base, which \
                shows what an axis does alone. Clamped: node steps at the speed limit; inverted: most cells in one frame.</p>\n"
    }

    fn curves(&self) -> Result<String> {
        let candidates = self.a.candidates();
        let find = |settings: &Settings| self.a.rows.iter().find(|row| row.is_choice() && row.settings == *settings);
        let fast = advice::best_in_real_time(&candidates).and_then(|c| find(&c.settings));
        let good = advice::fastest_within(&candidates, ACCURATE).and_then(|c| find(&c.settings));
        let coarse = self.choices().max_by(|a, b| {
            let error = |row: &Row| row.errors.force_curve.unwrap_or(0.0);
            error(a).total_cmp(&error(b))
        });
        let wanted: [Wanted<Option<&Row>, &str>; 5] = [
            (self.a.reference(), "reference", BLACK, 3, None),
            (self.a.base(), "base", INWARD, 2, None),
            (fast, "real time", GREEN, 2, Some((7, 3))),
            (good, "fastest within 1 %", PINK, 2, Some((3, 3))),
            (coarse, "farthest", ORANGE, 2, Some((2, 3))),
        ];
        let mut shown: Vec<Wanted<&Row, String>> = Vec::new();
        for (row, name, colour, width, dash) in wanted {
            let Some(row) = row else { continue };
            match shown.iter_mut().find(|(other, ..)| other.run.id == row.run.id) {
                Some((_, known, ..)) => *known = format!("{name} and {known}"),
                None => shown.push((row, format!("{name}: {}", short(&row.settings)), colour, width, dash)),
            }
        }
        let mut plot =
            Plot { x_label: "depth of the tip [mm]", y_label: "force on the tissue [N]", ..Default::default() };
        let mut legend = Vec::new();
        for (row, name, colour, width, dash) in shown {
            let points = row.run.curve().into_iter().map(|(d, f)| (d * 1e3, f)).collect();
            plot.curves.push(Curve { label: "", colour, width: width * FINER, dash, points });
            legend.push(legend_line(colour, f64::from(width), dash, &name));
        }
        let chart = drawn(plot.inline("Axial force against depth"))?;
        Ok(figure(
            &chart,
            &format!(
                "{}Axial force on the way in. Names: cell edge in mm, factor of mass scaling.",
                legend_row(&legend)
            ),
        ))
    }

    fn effects(&self) -> Result<String> {
        if self.a.effects.is_empty() {
            return Ok(format!("<p>No effect was switched on or off.</p>\n{}", listed(&self.a.plan.skipped)));
        }
        let newtons = |[variant, base]: [Option<f64>; 2]| match (variant, base) {
            (Some(v), Some(b)) => format!("{v:.3} ({:+.1} %)", 100.0 * (v / b - 1.0)),
            (Some(v), None) => format!("{v:.3}"),
            _ => "-".into(),
        };
        let rows: Vec<Vec<String>> = self
            .a
            .effects
            .iter()
            .map(|e| {
                let ratio = |r: f64| format!("{r:.2}");
                vec![
                    format!(
                        "{}<code>{}</code>",
                        if e.added { "with " } else { "without " },
                        e.keys.join("</code> and <code>")
                    ),
                    e.time_ratio.map_or("-".into(), ratio),
                    ratio(e.wall_ratio),
                    format!("{:.0}", e.bytes_per_cell),
                    percent(e.force_curve),
                    newtons(e.puncture_n),
                    newtons(e.deepest_n),
                    e.failure.as_deref().map_or("ok".into(), |why| {
                        format!("failed: {}", escape(super::subject::first_line(why).as_str()))
                    }),
                ]
            })
            .collect();
        let columns = [
            words("the base"),
            numbers("time per cell-step, with / without"),
            numbers("wall time of the run, with / without"),
            numbers("bytes per cell that it takes"),
            numbers("change of the force curve, %"),
            numbers("puncture, N"),
            numbers("deepest, N"),
            words("run"),
        ];
        let mut text = table(
            "",
            "The base with one effect less or more; all else is as in the base, an effect more has the parameters of the \
             material or the defaults. In brackets: against the base.",
            &columns,
            &rows,
        );
        let mut plot =
            Plot { x_label: "depth of the tip [mm]", y_label: "force on the tissue [N]", ..Default::default() };
        let mut legend = vec![legend_line(BLACK, 3.0, None, "base")];
        let mut curve = |row: &Row, colour, width: u32, dash| {
            let points = row.run.curve().into_iter().map(|(d, f)| (d * 1e3, f)).collect();
            plot.curves.push(Curve { label: "", colour, width: width * FINER, dash, points });
        };
        if let Some(base) = self.a.base() {
            curve(base, BLACK, 3, None);
        }
        let changed = self.a.of(Role::Effects).zip(&self.a.effects).filter(|(row, _)| row.run.failure.is_none());
        let dashes = [Some((7, 3)), Some((3, 3)), None, Some((10, 3)), Some((2, 3)), Some((5, 2))];
        for (n, (row, effect)) in changed.enumerate() {
            let (colour, dash) = (EFFECT_COLOURS[n % 6], dashes[(n + n / 6) % 6]);
            curve(row, colour, 2, dash);
            let word = if effect.added { "with" } else { "without" };
            legend.push(legend_line(colour, 2.0, dash, &format!("{word} {}", effect.keys.join(" and "))));
        }
        let chart = drawn(plot.inline("Axial force against depth with one effect less or more"))?;
        text += &figure(&chart, &format!("{}Axial force on the way in.", legend_row(&legend)));
        if !self.a.plan.skipped.is_empty() {
            text += "<p>Not switched:</p>\n";
            text += &listed(&self.a.plan.skipped);
        }
        Ok(text)
    }

    fn method(&self) -> String {
        let (a, plan) = (self.a, &self.a.plan);
        let mut items = vec![
            "Runs go one after the other in one program; wall and processor time are those of all frames after the first, \
             which is one step and compiles the shaders. Pictures and files are not written."
                .to_string(),
            "A force error is the L2 norm over depth of the difference from the reference, over that of the reference, on the \
             way in. The force is a mean over each frame; it ripples with the period of the cells, and the ripple counts."
                .to_string(),
        ];
        items.push(match a.scatter {
            Some(s) => format!(
                "The base was run twice: {:.1} and {:.1} s, a ratio of {:.2}; differences of times below that mean nothing. Its \
                 forces differ by {}.",
                s.first_wall_s,
                s.second_wall_s,
                s.ratio(),
                s.force_curve.map_or("an unknown part".into(), |e| if e == 0.0 { "nothing".into() } else { format!("{} %", three_decimals(100.0 * e)) })
            ),
            None => "The base was run once, so the scatter of the times is not known.".into(),
        });
        let costs: Vec<String> = plan
            .costs
            .engines
            .iter()
            .map(|(engine, c)| {
                format!(
                    "{} {:.0} us per step and {:.0} ns per cell-step",
                    engine.key(),
                    c.step_s * 1e6,
                    c.cell_step_s * 1e9
                )
            })
            .collect();
        items.push(format!(
            "Mesh sizes and reference were chosen by {} costs ({}) for {} minutes.",
            if plan.costs.measured { "measured" } else { "assumed" },
            costs.join(", "),
            trimmed(plan.budget_s / 60.0)
        ));
        let predicted: f64 =
            a.rows.iter().filter_map(|row| plan.runs.iter().find(|p| p.id == row.run.id)).map(|p| p.predicted_s).sum();
        let wall: f64 = a.rows.iter().map(|row| row.run.wall_s + row.run.setup_s).sum();
        items.push(format!("The finished runs took {:.2} times as long as predicted.", wall / predicted.max(1e-9)));
        let mut parts: Vec<&str> = a.rows.iter().filter_map(|row| row.run.part.as_deref()).collect();
        parts.sort_unstable();
        parts.dedup();
        if !parts.is_empty() {
            items.push(format!(
                "The runs were made in parts ({}), perhaps on different machines or beside one another: times compare within a \
                 part only.",
                parts.join(", ")
            ));
        }
        let list: String = items.iter().map(|item| format!("<li>{}</li>\n", escape(item))).collect();
        format!("<ul>\n{list}</ul>\n")
    }

    fn left_out(&self) -> String {
        let plan = &self.a.plan;
        let spare = plan.spare.iter().map(|run| LeftOut {
            what: plan.describe(run),
            reason: format!("the budget: it would take about {:.0} s", run.predicted_s.max(1.0)),
        });
        let unfit = self.a.rows.iter().filter(|row| row.role != Role::Reference).filter_map(|row| {
            let reason = format!("run, but no choice: {}", row.run.unfit()?);
            Some(LeftOut { what: format!("{}: {}", row.role.key(), row.settings.describe()), reason })
        });
        let all: Vec<LeftOut> =
            unfit.chain(plan.left_out.iter().chain(&self.a.missing).cloned()).chain(spare).collect();
        if all.is_empty() {
            return "<p>Nothing.</p>\n".into();
        }
        listed(&all)
    }

    fn runs(&self) -> String {
        let rows: Vec<Vec<String>> = self
            .a
            .rows
            .iter()
            .map(|row| {
                let (s, r): (&Settings, _) = (&row.settings, &row.run);
                let e: &Errors = &row.errors;
                vec![
                    row.role.key().into(),
                    trimmed(s.cell_size_mm),
                    trimmed(s.mass_scaling),
                    trimmed(s.safety),
                    s.engine.describe().into(),
                    escape(&beside(s, &self.a.plan.base)),
                    r.cells.to_string(),
                    r.steps.to_string(),
                    format!("{:.2}", r.wall_s),
                    three_decimals(r.real_time_factor()),
                    r.cpu_ns_per_cell_step().map_or("-".into(), |ns| format!("{ns:.0}")),
                    percent(e.force_curve),
                    percent(e.puncture_force),
                    percent(e.puncture_depth),
                    percent(e.deepest_force),
                    percent(e.displacement),
                    percent(r.energy_imbalance),
                    clamped(row),
                    r.unfit().map_or("ok".into(), |why| escape(&why)),
                ]
            })
            .collect();
        let columns = [
            words("role"),
            numbers("cells, mm"),
            numbers("mass scaling"),
            numbers("safety"),
            words("engine"),
            words("effects beside the base"),
            numbers("cells"),
            numbers("steps"),
            numbers("wall, s"),
            numbers("real-time factor"),
            numbers("cpu-ns per cell-step"),
            numbers("force curve, %"),
            numbers("puncture force, %"),
            numbers("puncture depth, %"),
            numbers("deepest force, %"),
            numbers("displacement, %"),
            numbers("energy imbalance, %"),
            numbers("clamped, inverted"),
            words("status"),
        ];
        table("raw", "Errors against the reference. The same is in study.csv and study.json.", &columns, &rows)
    }
}

fn described(row: &Row) -> String {
    format!("{}; {} cells, {} steps, {:.1} s", row.settings.describe(), row.run.cells, row.run.steps, row.run.wall_s)
}

/// Cell edge and mass scaling, where a point has room for no more.
fn short(settings: &Settings) -> String {
    let edge = (settings.cell_size_mm * 100.0).round() / 100.0;
    format!("{}, {}", trimmed(edge), trimmed(settings.mass_scaling))
}

fn shape(settings: &Settings) -> Shape {
    if settings.engine == Engine::Gpu { Shape::Circle } else { Shape::Square }
}

fn clamped(row: &Row) -> String {
    format!("{}, {}", row.run.clamped_nodes, row.run.inverted_cells)
}

fn percent(value: Option<f64>) -> String {
    value.map_or("-".into(), |v| three_decimals(100.0 * v))
}

fn beside(settings: &Settings, base: &Settings) -> String {
    let (with, without) = settings.effects_beside(base);
    let signed = |sign: &str, keys: Vec<String>| keys.into_iter().map(|k| format!("{sign}{k}")).collect::<Vec<_>>();
    [signed("+", with), signed("-", without)].concat().join(" ")
}

fn listed(items: &[LeftOut]) -> String {
    let list: String =
        items.iter().map(|item| format!("<li>{}: {}</li>\n", escape(&item.what), escape(&item.reason))).collect();
    format!("<ul>\n{list}</ul>\n")
}

fn drawn(chart: std::result::Result<String, Box<dyn std::error::Error>>) -> Result<String> {
    chart.map_err(|reason| Error::File {
        path: "study.html".into(),
        source: std::io::Error::other(format!("chart: {reason}")),
    })
}
