//! Parts of the pages in `docs/` that follow from the program's own tables: effects, scene keys, bounds, stages, columns.
//!
//! A part stands between two comments of its page, `<!-- generated: NAME -->` and `<!-- end: NAME -->`; what is written by hand stands
//! beside it. `tests/docs.rs` compares the pages with [`parts`]; `UPDATE_DOCS=1 cargo test --test files docs` writes them anew.

use std::collections::BTreeMap;
use std::path::Path;

use serde_json::Value;

use crate::effects::parameter::Parameter;
use crate::effects::{EFFECTS, Effect, SELF_CONTAINED, own};
use crate::engine::Stage;
use crate::material::{LAWS, Law};
use crate::observables::ForceParts;
use crate::observables::quantity::{self, CORE, ENERGY, FORCE, Quantity};
use crate::output::folder::{CORE_TABLE, ENERGY_TABLE, FORCE_TABLE, SAMPLE_TABLE, TARGET_TABLE};
use crate::output::sample::SAMPLE;
use crate::output::target::TARGETS;
use crate::predictions::rows::triple;
use crate::predictions::{self, Row, Totals};
use crate::scene::file::SceneFile;
use crate::training::skill::{HABITS, Habit};
use crate::training::skill_evidence::{self, FigureEvidence, Finding, TaskEvidence};
use crate::training::skill_page::auc_in_words;
use crate::units::{four_digits, three_digits};
use crate::verdict::{BOUNDS, Bound};
use crate::{Error, Result};

/// One generated part of a page.
#[derive(Debug, Clone, PartialEq)]
pub struct Part {
    /// File below `docs/`.
    pub page: String,
    /// Name in the two comments around it, once per page.
    pub name: &'static str,
    /// Markdown, with a line end behind the last line.
    pub text: String,
}

impl Part {
    fn new(page: impl Into<String>, name: &'static str, text: String) -> Self {
        Part { page: page.into(), name, text }
    }
}

/// All generated parts; `root` is the folder of the repository, whose sources hold the equations.
///
/// # Errors
/// `Error::File` where the source of an effect cannot be read.
pub fn parts(root: &Path) -> Result<Vec<Part>> {
    let mut parts = vec![
        Part::new("effects/index.md", "effects", effect_table()),
        Part::new("scenes.md", "keys", scene_keys()),
        Part::new("verdict.md", "bounds", bound_table()),
        Part::new("stages.md", "stages", stage_tables()),
        Part::new("files.md", "columns", columns()),
        Part::new("laws.md", "laws", law_table()),
        Part::new("predictions.md", "result", prediction_totals()),
        Part::new("predictions.md", "table", prediction_table()),
        Part::new("skills.md", "habits", habit_table()),
        Part::new("skills.md", "tasks", skill_tasks()),
        Part::new("skills.md", "figures", skill_figures()),
    ];
    for (file, rows) in run_tables() {
        parts.push(Part::new("files.md", file, meanings(rows)));
    }
    for effect in &EFFECTS {
        let page = format!("effects/{}.md", effect.key);
        parts.push(Part::new(&page, "head", head(effect)));
        parts.push(Part::new(&page, "law", law(root, effect)?));
        parts.push(Part::new(&page, "numbers", numbers(effect)));
    }
    Ok(parts)
}

/// The comments around the part of this name.
pub fn marks(name: &str) -> (String, String) {
    (format!("<!-- generated: {name} -->"), format!("<!-- end: {name} -->"))
}

/// The page with this text as its part of this name; `None` where the two comments are not there, in this order.
pub fn renewed(page: &str, name: &str, text: &str) -> Option<String> {
    let (begin, end) = marks(name);
    let (before, rest) = page.split_once(&begin)?;
    let (_, after) = rest.split_once(&end)?;
    Some(format!("{before}{begin}\n\n{text}\n{end}{after}"))
}

/// A table: its heads, and its rows.
fn table<const N: usize>(heads: [&str; N], rows: impl IntoIterator<Item = [String; N]>) -> String {
    let line = |cells: &[String]| format!("| {} |\n", cells.join(" | "));
    let mut text = line(&heads.map(String::from));
    text += &format!("|{}\n", "---|".repeat(N));
    rows.into_iter().for_each(|row| text += &line(&row.map(|cell| cell.replace('|', "\\|"))));
    text
}

fn code(word: &str) -> String {
    format!("`{word}`")
}

fn effect_table() -> String {
    let row = |effect: &Effect| {
        let key = format!("[`{0}`]({0}.md)", effect.key);
        [key, effect.summary.into(), effect.source.into(), effect.cost.into()]
    };
    table(["effect", "what", "source", "cost"], EFFECTS.iter().map(row))
}

fn law_table() -> String {
    let row = |law: &Law| {
        let constants = law.constants.iter().map(|constant| code(constant.key)).collect::<Vec<_>>().join(", ");
        [code(law.key), format!("`{}` [{}]", law.energy, law.source), constants, law.stable.into()]
    };
    table(["`law`", "`W_iso`", "constants in a scene", "stable for every deformation where"], LAWS.iter().map(row))
}

fn prediction_totals() -> String {
    let rows = predictions::rows(predictions::built_in());
    Totals::of(&rows).sentences().iter().map(|sentence| format!("- {sentence}\n")).collect()
}

fn prediction_table() -> String {
    let rows = predictions::rows(predictions::built_in());
    let row = |row: &Row| {
        let e = row.experiment;
        [
            e.id.clone(),
            format!("{} [{}]", e.quantity.name(), e.quantity.unit().0),
            row.band_in_words(),
            triple(e.measured.values),
            row.ratio().map_or("-".into(), three_digits),
            row.verdict(),
        ]
    };
    let heads =
        ["experiment", "quantity", "predicted: low, best, high", "measured", "best / measured", "measured lies"];
    table(heads, rows.iter().map(row))
}

fn habit_table() -> String {
    let row = |habit: &&Habit| {
        let [novice, intermediate, expert] = habit.of.map(|value| format!("{value}"));
        let what = if habit.unit.is_empty() { habit.text.into() } else { format!("{} [{}]", habit.text, habit.unit) };
        [what, novice, intermediate, expert, habit.source.into()]
    };
    table(["habit", "novice", "intermediate", "expert", "source"], HABITS.iter().map(row))
}

/// How the attempts of every task ended, and its key figures.
fn skill_tasks() -> String {
    let row = |task: &TaskEvidence| {
        let three = |counts: &[u64; 3]| counts.map(|n| n.to_string()).join(", ");
        [
            code(&task.scene),
            if task.overrides.is_empty() { "-".into() } else { code(&task.overrides.join(" ")) },
            three(&task.attempts),
            three(&task.passed),
            three(&task.stopped),
            three(&task.refused),
            task.key_figures.iter().map(|key| code(key)).collect::<Vec<_>>().join(", "),
        ]
    };
    let heads =
        ["task", "changed", "attempts", "passed", "stopped by the guard", "refused by the verdict", "key figures"];
    table(heads, skill_evidence::built_in().task.iter().map(row))
}

/// The figures of every task, the best first.
fn skill_figures() -> String {
    let one = |task: &TaskEvidence| {
        let mut figures: Vec<&FigureEvidence> = task.figure.iter().collect();
        figures.sort_by(|a, b| b.novice_expert.value.total_cmp(&a.novice_expert.value));
        let row = |f: &FigureEvidence| {
            let [novice, intermediate, expert] = f.medians.map(three_digits);
            let auc = auc_in_words(&f.novice_expert);
            let others =
                [&f.novice_intermediate, &f.intermediate_expert].map(|auc| format!("{:.2}", auc.value)).join(", ");
            let unit = if f.unit.is_empty() { "-" } else { &f.unit };
            let finding = Finding::of(&f.novice_expert).words();
            [code(&f.key), unit.into(), format!("{novice}, {intermediate}, {expert}"), auc, finding.into(), others]
        };
        let heads = [
            "figure",
            "unit",
            "median: novice, intermediate, expert",
            "AUC novice and expert (95 %)",
            "tells apart",
            "AUC of neighbours",
        ];
        format!("### {}\n\n{}", task.task, table(heads, figures.into_iter().map(row)))
    };
    skill_evidence::built_in().task.iter().map(one).collect::<Vec<_>>().join("\n")
}

fn head(effect: &Effect) -> String {
    let key = effect.key;
    let rows = [
        ["what".into(), effect.summary.into()],
        ["source".into(), effect.source.into()],
        ["cost".into(), effect.cost.into()],
        ["code".into(), format!("`src/effects/{key}.rs`, `shaders/effects/{key}.wgsl`")],
        ["tests".into(), format!("`tests/effects/{key}.rs`")],
        ["smallest scene".into(), format!("`scenes/effects/{key}.toml`")],
    ];
    table(["key", &code(key)], rows)
}

/// The numbers of an effect that have a slider; where it is complete by itself, all that a scene may write.
fn numbers(effect: &Effect) -> String {
    let row = |p: &Parameter| {
        let [from, to] = p.range.map(number);
        let by = if p.logarithmic { "factors" } else { "amounts" };
        [code(p.key), p.name.into(), p.unit.into(), format!("{from} to {to}"), by.into(), p.source.into()]
    };
    let heads = ["key in a scene", "what", "unit", "slider", "moves by", "the usual value comes from"];
    let sliders = table(heads, effect.parameters.iter().map(row));
    let Some(own) = SELF_CONTAINED.iter().find(|own| own.effect.key == effect.key) else { return sliders };
    let row = |n: &own::Number| {
        let [low, high] = n.range.map(number);
        [code(&format!("{}.{}", effect.key, n.key)), n.text.into(), number(n.default), format!("{low} to {high}")]
    };
    let numbers = table(["key in a scene", "what", "default", "accepted"], own.numbers.iter().map(row));
    if effect.parameters.is_empty() { numbers } else { format!("{numbers}\n{sliders}") }
}

/// The head of the source of an effect: its equations, assumptions and range.
fn law(root: &Path, effect: &Effect) -> Result<String> {
    let path = root.join(format!("src/effects/{}.rs", effect.key));
    let source = std::fs::read_to_string(&path).map_err(|source| Error::file(&path, source))?;
    let head = source.lines().map_while(|line| line.strip_prefix("//!"));
    Ok(head.map(|line| format!("{}\n", line.strip_prefix(' ').unwrap_or(line))).collect())
}

/// A number as people write it: an exponent where there are many zeros.
fn number(value: f64) -> String {
    if value.abs() >= 1e6 { format!("{value:e}") } else { format!("{value}") }
}

fn bound_table() -> String {
    let row = |bound: &Bound| {
        let percent = |value: f64| format!("{} %", four_digits(100.0 * value));
        let ok = match bound.stop {
            Some((0.0, _)) => "-".into(),
            _ if bound.ok == 0.0 => "none".into(),
            _ => bound.show(bound.ok),
        };
        let stop = match bound.stop {
            Some((0.0, _)) => "at once".into(),
            Some((value, 1)) => format!("beyond {}", percent(value)),
            Some((value, frames)) => format!("beyond {} in {frames} frames on end", percent(value)),
            None => "never".into(),
        };
        [code(bound.key), bound.text.into(), ok, stop, bound.reason.into()]
    };
    table(["quantity", "what", "ok up to", "stops", "why"], BOUNDS.iter().map(row))
}

/// What a stage does, and where it exists.
fn stage_text(stage: Stage) -> [&'static str; 2] {
    match stage {
        Stage::PathMeans => [
            "means of the displacement on the sections",
            "`puncture`, scheme opening, hardware (else in `advance_tip`)",
        ],
        Stage::AdvanceTip => {
            ["tip springs, threshold, advance of the tip; sections of an opened path", "`puncture`, planned path"]
        }
        Stage::SoftenPath => {
            ["cells that the tip passes lose stiffness", "`puncture`, planned path; beside `cohesive` with a bore only"]
        }
        Stage::AdvanceFreeTip => ["the tip law on a free path, instead of `advance_tip`", "`puncture`, free path"],
        Stage::SoftenFreePath => [
            "sample points behind the tip are marked, their cells soften, instead of `soften_path`",
            "`puncture`, free path",
        ],
        Stage::MeasureDilatation => ["J and volumetric stiffness of every tetrahedron", "tetrahedra"],
        Stage::OpeningDilatation => [
            "what an opened path adds to the volume of the tetrahedra around it",
            "`puncture`, scheme opening; tetrahedra",
        ],
        Stage::AveragePressure => ["dilatation and pressure of every node from the tetrahedra around it", "tetrahedra"],
        Stage::TetrahedronForces => ["stress and stiffness bound of every tetrahedron", "tetrahedra"],
        Stage::ElementForces => ["stress, hourglass force and stiffness bound of every hexahedron", "block"],
        Stage::CohesiveForces => ["traction and damage of faces that separate", "`cohesive`"],
        Stage::NeedleContact => {
            ["opened path or separated faces against the needle, friction, tip springs", "`puncture`"]
        }
        Stage::OpeningPoints => ["forces of the points beside the path", "`puncture`, scheme opening"],
        Stage::OpeningCells => ["what opening adds to the cells around the path", "`puncture`, scheme opening"],
        Stage::PathSums => {
            ["what acts on the sections", "`puncture`, scheme opening, hardware (else in `opening_reactions`)"]
        }
        Stage::OpeningReactions => ["normal force, friction, reaction on needle and tip", "`puncture`, scheme opening"],
        Stage::OpeningNodes => ["all of it on the nodes", "`puncture`, scheme opening"],
        Stage::MeasureOpening => ["energy of opening and its sums", "`puncture`, scheme opening"],
        Stage::MeasureRelaxation => {
            ["energy beside the path where nothing has relaxed", "`puncture`, scheme opening; `viscoelastic`"]
        }
        Stage::RelaxPath => ["stress beside the path relaxes", "`puncture`, scheme opening; `viscoelastic`"],
        Stage::IndenterContact => ["surface against a sphere or punch", "`indentation`"],
        Stage::IntegrateNodes => ["gather, loads, damping, central difference, prescribed motion", "always"],
        Stage::MeasureCells => ["energies and Jacobians", "always"],
        Stage::MeasureNodes => ["kinetic energy, speeds, counters", "always"],
        Stage::MeasureContact => ["force, torque, work and dissipation of the tool", "`puncture` or `indentation`"],
        Stage::MeasureFaces => ["reactions and moments of the six faces", "driven faces"],
        Stage::MeasureSeparation => ["energies and torn area of faces that separate", "`cohesive`"],
        Stage::CellFields => ["stress, pressure, stretch of every cell", "a window"],
        Stage::NodeFields => ["their means at the nodes", "a window"],
    }
}

fn stage_tables() -> String {
    let titles = ["In every step", "Once per display frame", "Once per picture, where a window draws"];
    let group = |stage: Stage| if stage.draws() { 2 } else { usize::from(stage.once_per_frame()) };
    let mut text = String::new();
    for (index, title) in titles.iter().enumerate() {
        let rows = Stage::ALL.into_iter().enumerate().filter(|(_, stage)| group(*stage) == index);
        let rows = rows.map(|(place, stage)| {
            let [what, exists] = stage_text(stage);
            [(place + 1).to_string(), code(stage.name()), what.into(), exists.into()]
        });
        text += &format!("{}{title}:\n\n", if index == 0 { "" } else { "\n" });
        text += &table(["no.", "stage", "what", "exists with"], rows);
    }
    text
}

/// The tables of a run: name, and what stands in its columns.
fn run_tables() -> [(&'static str, Vec<[String; 4]>); 5] {
    [
        (FORCE_TABLE, described(&FORCE)),
        (ENERGY_TABLE, described(&ENERGY)),
        (SAMPLE_TABLE, described(&SAMPLE)),
        (TARGET_TABLE, described(&TARGETS)),
        (CORE_TABLE, described(&CORE)),
    ]
}

/// Column, unit, meaning and how the frames become a run, of every entry.
fn described<T>(table: &[Quantity<T>]) -> Vec<[String; 4]> {
    let row = |q: &Quantity<T>| [q.column.into(), q.unit.word().into(), q.meaning.into(), q.fold.word().into()];
    table.iter().map(row).collect()
}

fn columns() -> String {
    let list = |(file, rows): (&str, Vec<[String; 4]>)| {
        let names: Vec<String> = rows.iter().map(|[column, ..]| code(column)).collect();
        [code(file), names.join(", ")]
    };
    let mut text = table(["file", "columns, in this order"], run_tables().map(list));
    text += "\nParts of the axial force, from the bottom of the stack in `force_parts.svg` to its top:\n\n";
    text + &table(
        ["part", "column of `force.csv`"],
        ForceParts::PARTS.iter().map(|part| [part.name.into(), code(part.column)]),
    )
}

/// What the columns of one table mean.
fn meanings(rows: Vec<[String; 4]>) -> String {
    let row = |[column, unit, meaning, fold]: [String; 4]| [code(&column), unit, meaning, fold];
    table(["column", "unit", "meaning", "of a run"], rows.into_iter().map(row))
}

/// Names of all columns of the tables of a run.
pub fn all_columns() -> Vec<&'static str> {
    let frames = [&FORCE, &ENERGY, &CORE].into_iter().flat_map(|table| quantity::columns(table));
    frames.chain(quantity::columns(&SAMPLE)).chain(quantity::columns(&TARGETS)).collect()
}

/// Every table of a scene file with its keys, from the schema that `stylet schema` prints.
fn scene_keys() -> String {
    let schema = schemars::schema_for!(SceneFile).to_value();
    let keys = SceneKeys { definitions: &schema["$defs"] };
    let mut places = BTreeMap::new();
    keys.collect(&schema, "", &mut places);
    // The place at the top comes first.
    places.values_mut().for_each(|places: &mut Vec<String>| places.sort_by_key(|place| place.matches('.').count()));
    let mut text = format!("### Top level\n\n{}", keys.keys(&schema, &[]));
    // Sorted by the first of the places where a table may stand.
    let mut sorted: Vec<(&String, &Vec<String>)> = places.iter().collect();
    sorted.sort_by_key(|(_, places)| bare(&places[0]));
    for (name, places) in sorted {
        let (first, others) = (&places[0], &places[1..]);
        let table = &keys.definitions[name.as_str()];
        text += &format!("\n### `{first}`\n\n");
        if let Some(description) = description(table) {
            text += &format!("{description}\n\n");
        }
        text += &keys.keys(table, others);
    }
    text
}

/// Path of a table without its brackets.
fn bare(place: &str) -> String {
    place.trim_matches(['[', ']']).to_string()
}

fn description(schema: &Value) -> Option<String> {
    schema["description"].as_str().map(|text| text.split_whitespace().collect::<Vec<_>>().join(" "))
}

struct SceneKeys<'a> {
    definitions: &'a Value,
}

impl SceneKeys<'_> {
    /// Name and schema of the definition that a reference means.
    fn definition<'b>(&'b self, schema: &'b Value) -> Option<(&'b str, &'b Value)> {
        let name = schema["$ref"].as_str()?.strip_prefix("#/$defs/")?;
        Some((name, &self.definitions[name]))
    }

    /// Finds where the tables below `path` may stand: `[path]`, or `[[path]]` for as many as wanted.
    fn collect(&self, schema: &Value, path: &str, places: &mut BTreeMap<String, Vec<String>>) {
        for (key, value) in schema["properties"].as_object().into_iter().flatten() {
            let path = if path.is_empty() { key.clone() } else { format!("{path}.{key}") };
            let list = value.get("items").is_some();
            self.tables(if list { &value["items"] } else { value }, &mut |name| {
                let place = if list { format!("[[{path}]]") } else { format!("[{path}]") };
                places.entry(name.into()).or_default().push(place);
                self.collect(&self.definitions[name], &path, places);
            });
        }
    }

    /// Calls `found` with the name of every table that this value may be.
    fn tables(&self, schema: &Value, found: &mut dyn FnMut(&str)) {
        match self.definition(schema) {
            Some((name, table)) if table.get("properties").is_some() => found(name),
            Some((_, other)) => self.tables(other, found),
            None => schema["anyOf"].as_array().into_iter().flatten().for_each(|one| self.tables(one, found)),
        }
    }

    /// The keys of one table, and where else such a table may stand.
    fn keys(&self, table: &Value, others: &[String]) -> String {
        let required: Vec<&str> =
            table["required"].as_array().into_iter().flatten().filter_map(Value::as_str).collect();
        let row = |(key, value): (&String, &Value)| {
            let must = if required.contains(&key.as_str()) { ", required" } else { "" };
            [code(key), self.value(value) + must, description(value).unwrap_or_else(|| self.meaning(value))]
        };
        let rows = table["properties"].as_object().into_iter().flatten().map(row);
        let mut text = self::table(["key", "value", "meaning"], rows);
        if !others.is_empty() {
            let places = others.iter().map(|place| code(place)).collect::<Vec<_>>().join(", ");
            text += &format!("\nThe same keys stand in {places}.\n");
        }
        text
    }

    /// What the definition behind a value without own text says.
    fn meaning(&self, value: &Value) -> String {
        let mut text = String::new();
        self.tables(value, &mut |name| text = description(&self.definitions[name]).unwrap_or_default());
        text
    }

    /// The kind of a value in words.
    fn value(&self, schema: &Value) -> String {
        if let Some((_, meant)) = self.definition(schema) {
            return self.value(meant);
        }
        if let Some(choices) = schema["anyOf"].as_array() {
            let real = choices.iter().filter(|one| one["type"] != "null");
            return real.map(|one| self.value(one)).collect::<Vec<_>>().join(" or ");
        }
        if let Some(words) = schema["enum"].as_array() {
            return words.iter().map(|word| code(&word.to_string())).collect::<Vec<_>>().join(", ");
        }
        let kind = match &schema["type"] {
            Value::Array(kinds) => kinds.iter().find(|kind| **kind != "null").and_then(Value::as_str),
            kind => kind.as_str(),
        };
        match kind {
            Some("object") => "table".into(),
            Some("array") => match (schema["minItems"].as_u64(), self.value(&schema["items"]).as_str()) {
                (Some(count), _) => format!("list of {count} numbers"),
                (_, one @ ("table" | "number" | "text")) => format!("list of {one}s"),
                (_, words) => format!("list of {words}"),
            },
            Some("string") => "text".into(),
            Some("boolean") => "`true` or `false`".into(),
            Some("integer") => "whole number".into(),
            _ => "number".into(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_part_is_renewed_between_its_marks_only() {
        let page = "a\n<!-- generated: x -->\nold\n<!-- end: x -->\nb\n";
        let new = renewed(page, "x", "new\n").unwrap();
        assert_eq!(new, "a\n<!-- generated: x -->\n\nnew\n\n<!-- end: x -->\nb\n");
        assert_eq!(renewed(&new, "x", "new\n").unwrap(), new);
        assert_eq!(renewed(page, "y", "new\n"), None);
        assert_eq!(renewed("<!-- end: x --><!-- generated: x -->", "x", ""), None);
    }

    #[test]
    fn cells_of_a_table_hold_no_borders() {
        assert_eq!(table(["a", "b"], [["x|y".into(), "z".into()]]), "| a | b |\n|---|---|\n| x\\|y | z |\n");
    }

    #[test]
    fn keys_tell_kind_place_and_meaning() {
        let text = scene_keys();
        assert!(text.contains("\n### `[[motion.phase]]`\n"), "{text}");
        assert!(text.contains("| `cell_size_mm` | number | Cell edge around the planned path [mm]. |"), "{text}");
        assert!(text.contains("\nThe same keys stand in `[region.material]`.\n"), "{text}");
        assert!(text.contains("| `size_mm` | list of 3 numbers |"), "{text}");
        assert!(text.contains("| `region` | list of tables |"), "{text}");
    }
}
