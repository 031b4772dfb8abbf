//! The paper [Lv2022] beside runs of this program: its cases, its numbers and the page.

mod drops;
mod force;
mod health;
mod hollow;
mod stages;
mod unknown;

use super::CaseResults;
use super::words::{and, plain};
use crate::effects::puncture::SchemeWord;
use crate::output::page::{document, escape, table, words};
use crate::output::plot::Plot;
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

/// `2 mm/s`, never broken between number and unit.
fn speed_of(case: &CaseResults) -> String {
    format!("{}\u{a0}mm/s", trimmed(case.speed()))
}

/// True where no law of the scene depends on a rate.
/// True where the tip forces follow from the tissue: the scheme `opening`, in which nothing is calibrated.
fn predicts(scene: &Scene) -> bool {
    scene.effects.puncture.is_some_and(|p| p.scheme == SchemeWord::Opening && !p.puncture_stated && !p.cutting_stated)
}

fn rate_free(scene: &Scene) -> bool {
    let effects = &scene.effects;
    effects.viscoelastic.is_none() && effects.puncture.is_none_or(|p| p.rate_exponent == 0.0)
}
