//! The evidence of a task as one HTML page and as a CSV table of its attempts.

use super::skill::{HABITS, Level};
use super::skill_evidence::{FigureEvidence, Finding, TaskEvidence, text_of};
use super::skill_run::Outcome;
use super::statistics::Auc;
use super::texts::FIGURES;
use crate::output::page::{document, escape, numbers, table, words};
use crate::units::short;
use crate::{Error, Result};

/// Width and height of the drawing of an interval [px].
const BAR: [f64; 2] = [120.0, 14.0];
/// Radius of the mark at the value [px].
const MARK: f64 = 4.0;

/// One row per attempt: who, how it ended, all figures that any attempt holds.
///
/// # Errors
/// `Error::Input` where the table cannot be written, which is a defect.
pub fn csv(outcomes: &[Outcome]) -> Result<Vec<u8>> {
    let mut keys: Vec<&str> = Vec::new();
    for (key, _) in outcomes.iter().flat_map(|o| &o.figures) {
        if !keys.contains(&key.as_str()) {
            keys.push(key);
        }
    }
    let place =
        |key: &str| FIGURES.iter().position(|f| f.key == key || (f.key.ends_with('.') && key.starts_with(f.key)));
    keys.sort_by_key(|key| place(key));
    let mut writer = csv::Writer::from_writer(Vec::new());
    let defect = |reason: csv::Error| Error::input(reason.to_string(), "report this as a defect");
    let head = ["level", "index", "passed", "stopped", "reasons", "simulated_s", "wall_s", "limited_frames", "frames"];
    writer.write_record(head.iter().copied().chain(keys.iter().copied())).map_err(defect)?;
    for o in outcomes {
        let fixed = [
            o.level.key().to_string(),
            o.index.to_string(),
            o.passed.map_or(String::new(), |passed| u8::from(passed).to_string()),
            o.stopped.clone().unwrap_or_default(),
            o.reasons.join("; "),
            format!("{:.4}", o.simulated),
            format!("{:.3}", o.wall),
            o.limited_frames.to_string(),
            o.frames.to_string(),
        ];
        let figures = keys.iter().map(|key| o.value(key).map_or(String::new(), |value| value.to_string()));
        writer.write_record(fixed.into_iter().chain(figures)).map_err(defect)?;
    }
    writer.into_inner().map_err(|reason| Error::input(reason.to_string(), "report this as a defect"))
}

/// `0.91 (0.85 to 0.95)`.
pub fn auc_in_words(auc: &Auc) -> String {
    format!("{:.2} ({:.2} to {:.2})", auc.value, auc.low, auc.high)
}

/// An interval on the line from 0 to 1, with 1/2 marked.
fn bar(auc: &Auc) -> String {
    let [width, height] = BAR;
    // Room for the mark at both ends.
    let x = |value: f64| format!("{:.1}", MARK + value * (width - 2.0 * MARK));
    let middle = 0.5 * height;
    format!(
        "<svg viewBox=\"0 0 {width} {height}\" width=\"{width}\" height=\"{height}\" role=\"img\" aria-label=\"{}\">\
         <line x1=\"0\" y1=\"{middle}\" x2=\"{width}\" y2=\"{middle}\" stroke=\"currentColor\" stroke-opacity=\"0.25\"/>\
         <line x1=\"{half}\" y1=\"0\" x2=\"{half}\" y2=\"{height}\" stroke=\"currentColor\" stroke-opacity=\"0.5\"/>\
         <line x1=\"{}\" y1=\"{middle}\" x2=\"{}\" y2=\"{middle}\" stroke=\"#0072b2\" stroke-width=\"4\"/>\
         <circle cx=\"{}\" cy=\"{middle}\" r=\"{MARK}\" fill=\"#d55e00\"/></svg>",
        auc_in_words(auc),
        x(auc.low),
        x(auc.high),
        x(auc.value),
        half = 0.5 * width,
    )
}

/// The label of a figure, with its layer or target.
pub fn label(key: &str) -> String {
    match text_of(key) {
        Some(text) if text.key.ends_with('.') => format!("{}: {}", text.label, &key[text.key.len()..]),
        Some(text) => text.label.into(),
        None => key.into(),
    }
}

/// The whole page; `lost`: what is to be said of attempts that guard or verdict refused, one line each.
pub fn page(evidence: &TaskEvidence, lost: &[String], command: &str) -> String {
    let mut body = format!("<h1>Skill and scores: {}</h1>\n", escape(&evidence.task));
    body += &format!(
        "<p>{} attempts of synthetic trainees of three levels through the simulator, scene <code>{}</code>{}, seed {}. An \
         AUC is the probability that the less skilled of two trainees has the worse value: 0.5 says nothing, 1 tells every pair \
         apart. This shows which figures answer to the differences that the trainees were given, not how people differ.</p>\n",
        evidence.attempts.iter().sum::<u64>(),
        escape(&evidence.scene),
        match evidence.overrides.is_empty() {
            true => String::new(),
            false => format!(" with <code>{}</code>", escape(&evidence.overrides.join(" "))),
        },
        evidence.seed
    );
    let keys: Vec<String> = evidence.key_figures.iter().map(|key| escape(&label(key))).collect();
    body += &format!("<p><strong>Key figures:</strong> {}.</p>\n", keys.join("; "));
    let columns = [words("level"), numbers("attempts"), numbers("passed"), numbers("stopped"), numbers("refused")];
    let rows: Vec<Vec<String>> = Level::ALL
        .iter()
        .enumerate()
        .map(|(i, level)| {
            let count = |of: &[u64; 3]| of[i].to_string();
            let counts = [&evidence.attempts, &evidence.passed, &evidence.stopped, &evidence.refused].map(count);
            std::iter::once(level.key().to_string()).chain(counts).collect()
        })
        .collect();
    body += &table("", "How the attempts ended", &columns, &rows);
    body += &format!(
        "<p class=\"soft\">Median simulated time {} s; simulated over wall time {}; the hand was faster than the tissue follows \
         in {} % of the frames.</p>\n",
        short(evidence.median_time),
        short(evidence.real_time_factor),
        short(100.0 * evidence.limited)
    );
    if !lost.is_empty() {
        let lines: String = lost.iter().map(|line| format!("<li>{}</li>\n", escape(line))).collect();
        body += &format!("<div class=\"notice\"><p>Attempts that are not scored:</p><ul>\n{lines}</ul></div>\n");
    }
    body += "<h2>Figures</h2>\n";
    let columns = [
        words("figure"),
        words("unit"),
        numbers("novice"),
        numbers("intermediate"),
        numbers("expert"),
        words("novice and expert: AUC, 95 %"),
        words(""),
        words("tells apart"),
        words("novice, intermediate"),
        words("intermediate, expert"),
    ];
    let row = |f: &FigureEvidence| {
        let [novice, middle, expert] = f.medians.map(short);
        vec![
            escape(&label(&f.key)),
            f.unit.clone(),
            novice,
            middle,
            expert,
            auc_in_words(&f.novice_expert),
            bar(&f.novice_expert),
            Finding::of(&f.novice_expert).words().into(),
            auc_in_words(&f.novice_intermediate),
            auc_in_words(&f.intermediate_expert),
        ]
    };
    let mut figures: Vec<_> = evidence.figure.iter().collect();
    figures.sort_by(|a, b| b.novice_expert.value.total_cmp(&a.novice_expert.value));
    body += &table(
        "",
        "Medians, and how well levels are told apart",
        &columns,
        &figures.into_iter().map(row).collect::<Vec<_>>(),
    );
    body += "<h2>What the trainees were given</h2>\n";
    let columns =
        [words("habit"), words("unit"), numbers("novice"), numbers("intermediate"), numbers("expert"), words("source")];
    let rows: Vec<Vec<String>> = HABITS
        .iter()
        .map(|h| {
            let [novice, middle, expert] = h.of.map(short);
            vec![escape(h.text), h.unit.into(), novice, middle, expert, escape(h.source)]
        })
        .collect();
    body += &table("", "", &columns, &rows);
    body += &format!("<p class=\"soft\">Made by <code>{}</code>, stylet {}.</p>\n", escape(command), evidence.version);
    document(&format!("Skill and scores: {}", evidence.task), &body)
}
