//! Printed reports in the language of the window: a trainee, one attempt, or two attempts side by side, each as one HTML page that a
//! browser prints or saves as PDF.

use super::class::{Standing, Trend, goals_met, iso_8601, key_figures};
use super::history::Attempt;
use super::notes::Note;
use super::scene_words;
use super::score::{Row, Score};
use super::skill_evidence::text_of;
use super::task::GoalResult;
use super::texts::{Better, short};
use crate::output::chart::{Curve, FINER, INWARD};
use crate::output::page::{Column, document_in, escape, figure, numbers, table, words};
use crate::output::plot::{Mark, Plot};
use crate::words::{language, say, say_of, say_with};
use crate::{Error, Result};

/// Which of two values is better.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Side {
    First,
    Second,
    /// Equal, unknown, or neither better nor worse.
    Neither,
}

/// One figure of two attempts.
#[derive(Debug, Clone, PartialEq)]
pub struct Pair {
    pub key: String,
    pub label: String,
    pub unit: String,
    pub values: [Option<f64>; 2],
    pub better: Side,
}

/// The name of a figure in the present language.
pub fn label_of(row: &Row) -> String {
    let (base, name) = match row.key.split_once('.') {
        Some((base, name)) => (base, Some(name)),
        None => (row.key.as_str(), None),
    };
    match (say_of(&format!("figure-{base}")), name) {
        (Some(text), None) => text.to_string(),
        (Some(text), Some(name)) => format!("{text}: {name}"),
        (None, _) => row.label.clone(),
    }
}

/// The figures that either attempt holds, in the order of the first.
pub fn pairs(first: &Score, second: &Score) -> Vec<Pair> {
    let only_second = second.rows.iter().filter(|row| first.rows.iter().all(|r| r.key != row.key));
    let all = first.rows.iter().chain(only_second);
    all.map(|row| {
        let values = [first.value(&row.key), second.value(&row.key)];
        let better = match (values, row.better) {
            ([Some(a), Some(b)], Better::Lower) if a != b => {
                if a < b {
                    Side::First
                } else {
                    Side::Second
                }
            }
            ([Some(a), Some(b)], Better::Higher) if a != b => {
                if a > b {
                    Side::First
                } else {
                    Side::Second
                }
            }
            _ => Side::Neither,
        };
        Pair { key: row.key.clone(), label: label_of(row), unit: row.unit.clone(), values, better }
    })
    .collect()
}

/// The verdict in one sentence.
pub fn verdict(score: &Score) -> String {
    match score.passed() {
        Some(true) => say("report-passed").into(),
        Some(false) => {
            let missed: Vec<&str> =
                score.goals.iter().filter(|g| g.met == Some(false)).map(|g| g.text.as_str()).collect();
            say_with("report-failed", &[("goals", missed.join("; ").into())])
        }
        None if score.trust.reasons.is_empty() => say("report-no-goals").into(),
        None => say_with("report-not-scored", &[("reasons", score.trust.reasons.join("; ").into())]),
    }
}

/// `2022-03-01 14:05` from seconds since 1970, UTC.
pub fn day(seconds: u64) -> String {
    iso_8601(seconds)[..16].replace('T', " ")
}

/// A trend in the present language.
pub fn trend_in_words(trend: Trend) -> &'static str {
    match trend {
        Trend::Better => say("trend-better"),
        Trend::Worse => say("trend-worse"),
        Trend::Same => say("trend-same"),
        Trend::Unknown => say("trend-unknown"),
    }
}

/// Everything about one trainee.
///
/// # Errors
/// `Error::Input` where a chart cannot be drawn, which is a defect.
pub fn of_trainee(trainee: &str, standings: &[&Standing]) -> Result<String> {
    let title = say_with("report-of-trainee", &[("trainee", trainee.into())]);
    let mut body = format!("<h1>{}</h1>\n", escape(&title));
    for standing in standings {
        body += &format!("<section><h2>{}</h2>\n", escape(scene_words::task(&standing.task)));
        body += &format!(
            "<p>{}</p>\n",
            escape(&say_with(
                "report-counts",
                &[("attempts", standing.attempts.len().into()), ("passed", standing.passed().into())]
            ))
        );
        let keys = standing.key_figures();
        let row_of = |key: &str| standing.last().and_then(|a| a.score.rows.iter().find(|row| row.key == key));
        let mut columns = vec![numbers(say("report-attempt")), words(say("report-when")), words(say("report-goals"))];
        columns.extend(keys.iter().filter_map(|key| row_of(key)).map(|row| numbers(&with_unit(row))));
        let rows: Vec<Vec<String>> = standing.attempts.iter().map(|attempt| attempt_cells(attempt, &keys)).collect();
        body += &table("", "", &columns, &rows);
        let mut charts = String::new();
        for row in keys.iter().filter_map(|key| row_of(key)) {
            if let Some(chart) = chart(standing, row)? {
                let caption = format!("{}: {}", escape(&label_of(row)), trend_in_words(standing.trend(&row.key)));
                charts += &figure(&chart, &caption);
            }
        }
        if !charts.is_empty() {
            body += &format!("<div class=\"charts\">{charts}</div>\n");
        }
        body += "</section>\n";
    }
    Ok(document_in(language().code, &title, &body))
}

/// `Overshoot behind the last layer [mm]`.
fn with_unit(row: &Row) -> String {
    if row.unit.is_empty() { label_of(row) } else { format!("{} [{}]", label_of(row), row.unit) }
}

fn known(value: Option<f64>) -> String {
    value.map_or("-".into(), short)
}

fn attempt_cells(attempt: &Attempt, keys: &[String]) -> Vec<String> {
    let goals = match (goals_met(attempt), attempt.score.passed()) {
        (Some((met, of)), Some(passed)) => {
            let class = if passed { "good" } else { "bad" };
            let verdict = if passed { say("report-passed-short") } else { say("report-failed-short") };
            format!("<span class=\"{class}\">{verdict}</span> {met}/{of}")
        }
        _ => escape(say("report-not-scored-short")),
    };
    let mut cells = vec![attempt.number.to_string(), day(attempt.finished), goals];
    cells.extend(keys.iter().map(|key| known(attempt.score.value(key))));
    cells
}

/// A figure over the attempts; `None` with fewer than two values.
fn chart(standing: &Standing, row: &Row) -> Result<Option<String>> {
    let points = standing.series(&row.key);
    if points.len() < 2 {
        return Ok(None);
    }
    let text = text_of(&row.key);
    let marks = points.iter().map(|at| Mark { at: *at, colour: INWARD, text: None }).collect();
    let curve = Curve { label: "", colour: INWARD, width: 2 * FINER, dash: None, points };
    let unit = text.map_or("", |text| text.unit.name);
    let plot = Plot { x_label: say("report-attempt"), y_label: unit, areas: Vec::new(), curves: vec![curve], marks };
    let drawn = plot.inline(&label_of(row));
    drawn.map(Some).map_err(|e| Error::input(format!("chart: {e}"), "report this as a defect"))
}

/// Everything about one attempt.
pub fn of_attempt(attempt: &Attempt, notes: &[Note]) -> String {
    let places = [
        ("trainee", attempt.trainee.as_str().into()),
        ("task", scene_words::task(&attempt.task).into()),
        ("number", attempt.number.into()),
    ];
    let title = say_with("report-of-attempt", &places);
    let mut body = format!("<h1>{}</h1>\n<p class=\"soft\">{} UTC</p>\n", escape(&title), day(attempt.finished));
    let class = match attempt.score.passed() {
        Some(true) => "good",
        _ => "bad",
    };
    body += &format!("<p class=\"{class}\">{}</p>\n", escape(&verdict(&attempt.score)));
    body += &format!("<h2>{}</h2>\n{}", say("report-goals"), goal_table(&attempt.score.goals));
    if !notes.is_empty() {
        let rows: Vec<Vec<String>> =
            notes.iter().map(|n| vec![format!("{:.1} s", n.time), escape(&n.author), escape(&n.text)]).collect();
        let columns = [numbers(say("report-moment")), words(say("report-author")), words(say("report-note"))];
        body += &format!("<h2>{}</h2>\n{}", say("report-notes"), table("words", "", &columns, &rows));
    }
    let keys = key_figures(attempt);
    let (first, rest): (Vec<&Row>, Vec<&Row>) = attempt.score.rows.iter().partition(|row| keys.contains(&row.key));
    for (head, rows) in [(say("report-key-figures"), first), (say("report-all-figures"), rest)] {
        body += &format!("<h2>{head}</h2>\n{}", figure_table(&rows));
    }
    document_in(language().code, &title, &body)
}

fn goal_table(goals: &[GoalResult]) -> String {
    let columns = [
        words(say("report-goal")),
        words(say("report-met")),
        numbers(say("report-measured")),
        numbers(say("report-least")),
        numbers(say("report-most")),
        words(say("report-unit")),
    ];
    let row = |goal: &GoalResult| {
        let met = match goal.met {
            Some(true) => format!("<span class=\"good\">{}</span>", say("report-yes")),
            Some(false) => format!("<span class=\"bad\">{}</span>", say("report-no")),
            None => "-".into(),
        };
        vec![escape(&goal.text), met, known(goal.measured), known(goal.least), known(goal.most), escape(&goal.unit)]
    };
    table("", "", &columns, &goals.iter().map(row).collect::<Vec<_>>())
}

fn figure_table(rows: &[&Row]) -> String {
    let columns = [
        words(say("report-figure")),
        numbers(say("report-value")),
        numbers(say("report-reference")),
        words(say("report-unit")),
        words(say("report-aim")),
    ];
    let row = |row: &&Row| {
        let aim = match row.better {
            Better::Lower => say("report-lower"),
            Better::Higher => say("report-higher"),
            Better::None => "-",
        };
        vec![escape(&label_of(row)), known(row.value), known(row.reference), escape(&row.unit), aim.into()]
    };
    table("", "", &columns, &rows.iter().map(row).collect::<Vec<_>>())
}

/// `Ada, attempt 3`.
pub fn name_of(attempt: &Attempt) -> String {
    let places = [("trainee", attempt.trainee.as_str().into()), ("number", attempt.number.into())];
    say_with("report-name", &places)
}

/// Two attempts side by side.
pub fn of_two(first: &Attempt, second: &Attempt) -> String {
    let names = [name_of(first), name_of(second)];
    let title = say_with("report-of-two", &[("first", names[0].as_str().into()), ("second", names[1].as_str().into())]);
    let mut body = format!("<h1>{}</h1>\n", escape(&title));
    if first.task != second.task {
        let [a, b] = [first, second].map(|attempt| scene_words::task(&attempt.task).into());
        let places = [("first", a), ("second", b)];
        body += &format!("<p class=\"notice\">{}</p>\n", escape(&say_with("report-other-task", &places)));
    }
    for (name, attempt) in names.iter().zip([first, second]) {
        body += &format!("<p><strong>{}</strong>: {}</p>\n", escape(name), escape(&verdict(&attempt.score)));
    }
    let heads: Vec<Column> = vec![
        words(say("report-figure")),
        numbers(&names[0]),
        numbers(&names[1]),
        words(say("report-unit")),
        words(say("report-better")),
    ];
    let rows: Vec<Vec<String>> = pairs(&first.score, &second.score)
        .into_iter()
        .map(|pair| {
            let better = match pair.better {
                Side::First => escape(&names[0]),
                Side::Second => escape(&names[1]),
                Side::Neither => "-".into(),
            };
            vec![escape(&pair.label), known(pair.values[0]), known(pair.values[1]), escape(&pair.unit), better]
        })
        .collect();
    body += &table("", "", &heads, &rows);
    document_in(language().code, &title, &body)
}

/// Two attempts side by side for the terminal.
pub fn two_as_text(first: &Attempt, second: &Attempt) -> String {
    let of = |attempt: &Attempt| format!("{} #{}", attempt.trainee, attempt.number);
    let passed = |attempt: &Attempt| match attempt.score.passed() {
        Some(true) => "passed",
        Some(false) => "not passed",
        None => "not scored",
    };
    let line = |label: &str, a: &str, b: &str, unit: &str, better: &str| {
        let text = format!("{label:<44} {a:>14} {b:>14} {unit:<8} {better}");
        text.trim_end().to_string() + "\n"
    };
    let mut text = line("figure", &of(first), &of(second), "unit", "better");
    text += &line("task", &first.task, &second.task, "", "");
    text += &line("verdict", passed(first), passed(second), "", "");
    for pair in pairs(&first.score, &second.score) {
        let better = match pair.better {
            Side::First => of(first),
            Side::Second => of(second),
            Side::Neither => String::new(),
        };
        let row = first.score.rows.iter().chain(&second.score.rows).find(|row| row.key == pair.key);
        let label = row.map_or(pair.key.as_str(), |row| &row.label);
        text += &line(label, &known(pair.values[0]), &known(pair.values[1]), &pair.unit, &better);
    }
    text
}
