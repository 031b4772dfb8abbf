//! Experiments as they are written: TOML with the unit in each key, read like a scene, every problem with file, line, key and way out.

use std::path::Path;

use schemars::JsonSchema;
use serde::Deserialize;

use super::{Experiment, FILE, Gap, Input, Origin, Quantity, Tip, Variable};
use crate::reading;
use crate::scene::document::{Document, Problems};
use crate::within::Within;
use crate::{Error, Result};

/// Most experiments of a file: each may ask for a law of its own at many corners.
const MOST: usize = 200;

/// Longest text of a key [byte].
const LONGEST_TEXT: usize = 1000;

/// Largest measured number, in any of the units.
const LARGEST: f64 = 1e6;

#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct PredictionsFile {
    #[serde(default)]
    experiment: Vec<Table>,
}

/// One experiment.
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct Table {
    id: String,
    authors: String,
    year: u16,
    #[serde(default)]
    title: String,
    #[serde(default)]
    doi: String,
    tissue: String,
    needle: String,
    quantity: Quantity,
    measured: Number,
    tip: Tip,
    radius_mm: Number,
    half_angle_deg: Option<Number>,
    depth_mm: Option<Number>,
    shear_modulus_kpa: Option<Number>,
    youngs_modulus_kpa: Option<Number>,
    ogden_alpha: Option<Number>,
    toughness_j_m2: Number,
    tear_stretch: Option<Number>,
    friction: Option<Number>,
    #[serde(default)]
    uncovered: Vec<Gap>,
    #[serde(default)]
    note: String,
}

/// A number with its range and where it comes from.
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct Number {
    values: [f64; 3],
    from: Origin,
    source: String,
    over: Option<Over>,
}

/// The width over which a toughness counts.
#[derive(Deserialize, JsonSchema, Clone, Copy, PartialEq, Eq)]
enum Over {
    /// The slit: J_c.
    #[serde(rename = "2a")]
    Slit,
    /// The needle: a lower bound of J_c, since no slit is wider than the needle needs.
    #[serde(rename = "2R")]
    Needle,
}

/// The experiments of a file; without one those that are built in.
///
/// # Errors
/// `Error::Input` where the file cannot be read, `Error::Scene` with all its problems.
pub fn load(path: Option<&Path>) -> Result<Vec<Experiment>> {
    let Some(path) = path else { return Ok(super::built_in().to_vec()) };
    let way_out = format!("give a file such as {FILE} with --data; without it the built-in one is taken");
    let source = reading::text(path, reading::most::SCENE).map_err(|unread| unread.of(path, &way_out))?;
    parse(path, &source).map_err(Error::Scene)
}

/// Reads and checks experiments; `path` stands for the file in messages.
///
/// # Errors
/// The rendered text of all problems.
pub fn parse(path: &Path, source: &str) -> std::result::Result<Vec<Experiment>, String> {
    let document = Document::parse(path, source, &[])?;
    let mut check = Check { problems: Problems::new(&document) };
    for place in document.non_finite_numbers() {
        let message = format!("`{place}` is not a finite number");
        check.problems.report(&place, message, "NaN, infinite or too large", "write a finite number");
    }
    check.problems.check()?;
    let file: PredictionsFile = document.deserialize()?;
    match file.experiment.len() {
        0 => check.problems.report("", "the file holds no experiment", "empty", "add [[experiment]] with id, authors"),
        count if count > MOST => {
            let message = format!("{count} experiments; at most {MOST} are taken");
            check.problems.report("experiment.0", message, "too many", "split the file");
        }
        _ => {}
    }
    check.problems.check()?;
    let mut experiments: Vec<Experiment> = Vec::new();
    for (index, table) in file.experiment.into_iter().enumerate() {
        let at = format!("experiment.{index}");
        let experiment = check.experiment(&at, table);
        if experiments.iter().any(|e| e.id == experiment.id) {
            let message = format!("the id \"{}\" is taken", experiment.id);
            check.problems.report(&format!("{at}.id"), message, "not its own", "write an id that no other has");
        }
        experiments.push(experiment);
    }
    check.problems.check()?;
    Ok(experiments)
}

struct Check<'a> {
    problems: Problems<'a>,
}

impl Check<'_> {
    fn experiment(&mut self, at: &str, table: Table) -> Experiment {
        self.texts(at, &table);
        let key = |name: &str| format!("{at}.{name}");
        let mut inputs = [const { None }; Variable::COUNT];
        let plain = [
            (Variable::Radius, "radius_mm", Some(table.radius_mm), Within::Between(1e-3, 50.0)),
            (Variable::HalfAngle, "half_angle_deg", table.half_angle_deg, Within::Between(1.0, 89.0)),
            (Variable::Depth, "depth_mm", table.depth_mm, Within::Positive(1e3)),
            (Variable::OgdenAlpha, "ogden_alpha", table.ogden_alpha, Within::Between(1.0, 30.0)),
            (Variable::TearStretch, "tear_stretch", table.tear_stretch, Within::Between(1.001, 100.0)),
            (Variable::Friction, "friction", table.friction, Within::NotNegative(10.0)),
        ];
        for (variable, name, number, within) in plain {
            inputs[variable as usize] = number.map(|n| self.number(&key(name), n, within, variable.unit().1, false));
        }
        let stress = Within::Between(1e-4, 1e6);
        let modulus = match (table.shear_modulus_kpa, table.youngs_modulus_kpa) {
            (Some(mu), None) => Some(self.number(&key("shear_modulus_kpa"), mu, stress, 1e3, false)),
            // Without change of volume E = 3 mu.
            (None, Some(e)) => Some(self.number(&key("youngs_modulus_kpa"), e, stress, 1e3 / 3.0, false)),
            (both, _) => {
                let message = match both {
                    Some(_) => "both shear_modulus_kpa and youngs_modulus_kpa are written",
                    None => "neither shear_modulus_kpa nor youngs_modulus_kpa is written",
                };
                self.problems.report(at, message, "one modulus is needed", "write one of the two");
                None
            }
        };
        inputs[Variable::ShearModulus as usize] = modulus;
        let mut uncovered = table.uncovered;
        let over_needle = table.toughness_j_m2.over == Some(Over::Needle);
        let toughness =
            self.number(&key("toughness_j_m2"), table.toughness_j_m2, Within::Between(1e-3, 1e6), 1.0, true);
        inputs[Variable::Toughness as usize] = Some(toughness);
        if over_needle && !uncovered.contains(&Gap::ToughnessOver2R) {
            uncovered.push(Gap::ToughnessOver2R);
        }
        let needed: &[(Variable, &str)] = match table.quantity {
            Quantity::ForceAtDepth => &[(Variable::Depth, "depth_mm"), (Variable::Friction, "friction")],
            Quantity::Slope => &[(Variable::Friction, "friction")],
            _ => &[],
        };
        for (_, name) in needed.iter().filter(|(variable, _)| inputs[*variable as usize].is_none()) {
            let message = format!("`{name}` is missing for the quantity {}", table.quantity.name());
            self.problems.report(at, message, "not written", format!("add `{name}`"));
        }
        let measured = self.number(&key("measured"), table.measured, Within::Positive(LARGEST), 1.0, false);
        if !matches!(measured.origin, Origin::Source | Origin::Cited | Origin::Unverified) {
            let message = format!("what was measured cannot be {}", measured.origin.word());
            let way_out = "write source, cited or unverified: a measurement is read, or it does not count";
            self.problems.report(&key("measured.from"), message, "no measurement", way_out);
        }
        Experiment {
            id: table.id,
            authors: table.authors,
            year: table.year,
            title: table.title,
            doi: table.doi,
            tissue: table.tissue,
            needle: table.needle,
            quantity: table.quantity,
            measured,
            tip: table.tip,
            inputs,
            uncovered,
            note: table.note,
        }
    }

    /// A number in SI, after its range, its order and its origin.
    fn number(&mut self, at: &str, number: Number, within: Within, unit: f64, is_toughness: bool) -> Input {
        let Number { values, from, source, over } = number;
        let place = format!("{at}.values");
        if let Some(value) = values.iter().find(|value| !within.holds(**value)) {
            let range = within.words();
            let way_out = format!("write numbers {range}; the unit is the end of the key");
            self.problems.report(&place, format!("`{at}` has {value}"), format!("must be {range}"), way_out);
        } else if !(values[0] <= values[1] && values[1] <= values[2]) {
            let way_out = "write [low, best, high], three times the same where there is no range";
            self.problems.report(&place, format!("`{at}` is not in order"), "not low, best, high", way_out);
        }
        if over.is_some() && !is_toughness {
            let message = format!("`{at}` is no toughness");
            self.problems.report(&format!("{at}.over"), message, "of toughness_j_m2 only", "remove `over`");
        }
        self.text(&format!("{at}.source"), &source, true);
        Input { values: values.map(|value| value * unit), origin: from, source }
    }

    fn texts(&mut self, at: &str, table: &Table) {
        let key = |name: &str| format!("{at}.{name}");
        for (name, text) in [("authors", &table.authors), ("tissue", &table.tissue), ("needle", &table.needle)] {
            self.text(&key(name), text, true);
        }
        for (name, text) in [("title", &table.title), ("doi", &table.doi), ("note", &table.note)] {
            self.text(&key(name), text, false);
        }
        let plain = |c: char| c.is_ascii_lowercase() || c.is_ascii_digit() || c == '-';
        if table.id.is_empty() || table.id.len() > 40 || !table.id.chars().all(plain) {
            let message = format!("the id \"{}\" is no short name", table.id);
            self.problems.report(&key("id"), message, "no id", "write small letters, digits and -, 40 at most");
        }
        if table.doi.is_empty() && table.title.is_empty() {
            self.problems.report(at, "neither doi nor title is written", "no source", "write one of the two");
        }
        if !(1800..=2200).contains(&table.year) {
            let message = format!("the year is {}", table.year);
            self.problems.report(&key("year"), message, "no year of a publication", "write four digits");
        }
    }

    fn text(&mut self, at: &str, text: &str, needed: bool) {
        if needed && text.trim().is_empty() {
            self.problems.report(at, format!("`{at}` is empty"), "empty", "write where it comes from, or what it is");
        }
        if text.len() > LONGEST_TEXT {
            let message = format!("`{at}` has {} bytes", text.len());
            self.problems.report(at, message, "too long", format!("write at most {LONGEST_TEXT} bytes"));
        }
    }
}
