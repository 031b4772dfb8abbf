//! Results of the suite: a table of 80 columns, JSON, and the list of the cases.

use std::fmt::Write;

use serde::{Serialize, Serializer};

use super::trace::{End, Trace};
use super::{Balance, CASES, Case, Cure, Expected, Options, Part};
use crate::engine::EngineInfo;
use crate::simulation::EngineChoice;
use crate::verdict::Quantity;

/// Columns of a terminal.
const WIDTH: usize = 80;

/// What came out of a case.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Verdict {
    /// Survived, as it should.
    Holds,
    /// Stopped by a guard, as it should.
    Caught,
    /// Refused before the first step, as it should.
    Refused,
    Fails,
}

impl Verdict {
    fn word(self) -> &'static str {
        match self {
            Verdict::Holds => "holds",
            Verdict::Caught => "caught",
            Verdict::Refused => "refused",
            Verdict::Fails => "FAILS",
        }
    }
}

/// One run of a case.
#[derive(Debug, Clone, Serialize)]
pub struct RunReport {
    /// Which of several; empty where there is one only.
    pub label: &'static str,
    pub expected: String,
    pub verdict: Verdict,
    /// Why it fails.
    pub problem: Option<String>,
    /// Of the guard or the refusal.
    pub message: Option<String>,
    /// [us]
    pub step_us: Option<f64>,
    pub steps: u64,
    /// Largest part of the energy that was lost or created; `null`: no number.
    pub imbalance: Option<f64>,
    /// Smallest J of all frames, at the centres of cells and at their corners.
    pub smallest_j: Option<f64>,
    pub smallest_corner_j: Option<f64>,
    /// Largest nodal speed at the end of a frame over the speed of the fastest P wave at the scaled density.
    pub speed_over_wave_speed: Option<f64>,
    pub clamped_nodes: u64,
    /// In the last frame.
    pub inverted_cells_at_end: u64,
    /// What cures took beyond the bound of [`crate::verdict`]: energy that is booked is in balance, and gone all the same.
    pub doubt: Option<String>,
    /// The number that this run must give, and what it is.
    pub answer: Option<f64>,
    pub answer_is: Option<&'static str>,
    /// [s]
    pub wall_s: f64,
    /// True where the figures say something: it should survive, and has made a frame.
    #[serde(skip)]
    counts: bool,
}

impl RunReport {
    pub(super) fn new(part: &Part) -> Self {
        RunReport {
            label: part.label,
            expected: part.expected.words(),
            verdict: Verdict::Fails,
            problem: None,
            message: None,
            step_us: None,
            steps: 0,
            imbalance: None,
            smallest_j: None,
            smallest_corner_j: None,
            speed_over_wave_speed: None,
            clamped_nodes: 0,
            inverted_cells_at_end: 0,
            doubt: None,
            answer: None,
            answer_is: part.answer.map(|a| a.what),
            wall_s: 0.0,
            counts: false,
        }
    }

    /// Figures of a run with steps of `dt` [s] in tissue whose fastest wave has the speed `wave` [m/s].
    pub(super) fn take(&mut self, trace: &Trace, balance: Balance, dt: f64, wave: f64) {
        self.step_us = Some(dt * 1e6);
        let Some(last) = trace.records.last() else { return };
        let smallest = |of: fn(&crate::observables::Health) -> f64| {
            trace.records.iter().map(|r| of(&r.health)).fold(f64::INFINITY, f64::min)
        };
        let speed = trace.records.iter().map(|r| r.health.max_speed).fold(0.0, f64::max);
        self.steps = last.step;
        self.imbalance = Some(trace.imbalance(balance));
        self.smallest_j = Some(smallest(|h| h.min_j));
        self.smallest_corner_j = Some(smallest(|h| h.min_corner_j));
        self.speed_over_wave_speed = Some(speed / wave);
        self.clamped_nodes = trace.records.iter().map(|r| u64::from(r.health.clamped_nodes)).sum();
        self.inverted_cells_at_end = last.health.inverted_cells.into();
        let cured = last.verdict.doubts.iter().find(|d| d.quantity == Quantity::CuredEnergy);
        self.doubt = cured.map(|d| d.sentence());
        self.counts = true;
    }

    /// Compares the end with the expectation.
    pub(super) fn judge(&mut self, part: &Part, end: End) {
        self.counts &= matches!(part.expected, Expected::Survives { .. });
        let (word, message) = match end {
            End::Survived => ("goes on to its end", None),
            End::Stopped(text) => ("is stopped", Some(text)),
            End::Refused(text) => ("is refused", Some(text)),
        };
        let says = |text: &str| message.as_ref().is_some_and(|m| m.contains(text));
        let problem = match part.expected {
            Expected::Survives { imbalance } if message.is_none() => self.unsound(part, imbalance),
            Expected::Caught(text) if word == "is stopped" && says(text) => None,
            Expected::Refused(text) if word == "is refused" && says(text) => None,
            _ => Some(match message.as_deref().and_then(gist) {
                Some(gist) => format!("{word}: {gist}"),
                None => word.to_string(),
            }),
        };
        self.verdict = match part.expected {
            _ if problem.is_some() => Verdict::Fails,
            Expected::Survives { .. } => Verdict::Holds,
            Expected::Caught(_) => Verdict::Caught,
            Expected::Refused(_) => Verdict::Refused,
        };
        self.message = message;
        self.problem = problem;
    }

    /// What is wrong with a run that went to its end.
    fn unsound(&self, part: &Part, bound: f64) -> Option<String> {
        let mut problems = Vec::new();
        let imbalance = self.imbalance.unwrap_or(f64::NAN);
        // Not a number is no balance either.
        if imbalance.is_nan() || imbalance > bound {
            problems.push(format!("energy off by {}, allowed {}", percent(imbalance), percent(bound)));
        }
        if self.inverted_cells_at_end > 0 {
            problems.push(format!("{} cells inverted at the end", self.inverted_cells_at_end));
        }
        if let Some(doubt) = &self.doubt {
            problems.push(format!("doubtful: {doubt}"));
        }
        if let (Some(wanted), Some(value)) = (part.answer, self.answer)
            && !(wanted.at_least..=wanted.at_most).contains(&value)
        {
            problems.push(format!("{} {}, {}", wanted.what, brief(value), range(wanted.at_least, wanted.at_most)));
        }
        (!problems.is_empty()).then(|| problems.join("; "))
    }
}

impl Expected {
    /// As a phrase.
    fn words(&self) -> String {
        match self {
            Expected::Survives { imbalance } => {
                format!("survives, energy within {}, nothing inverted at the end", percent(*imbalance))
            }
            Expected::Caught(text) => format!("stopped: \"{text}\""),
            Expected::Refused(text) => format!("refused: \"{text}\""),
        }
    }
}

/// A number with four digits.
fn brief(value: f64) -> String {
    let size = value.abs();
    if size > 0.0 && !(1e-3..1e4).contains(&size) { format!("{value:.3e}") } else { format!("{value:.4}") }
}

/// A range in words; bounds that are no bounds are left out.
fn range(low: f64, high: f64) -> String {
    match (low.is_finite(), high.is_finite()) {
        (true, true) if low == high => format!("must be {low}"),
        (true, true) => format!("must be {low} to {high}"),
        (true, false) => format!("at least {low}"),
        _ => format!("at most {high}"),
    }
}

/// First sentence of a message, without the frame in which it came.
fn gist(message: &str) -> Option<&str> {
    let line = message.lines().find(|line| !line.trim().is_empty())?;
    Some(line.split_once("): ").map_or(line, |(_, rest)| rest))
}

/// A case with all its runs.
#[derive(Debug, Clone, Serialize)]
pub struct CaseReport {
    pub name: &'static str,
    pub hard: &'static str,
    pub scene: &'static str,
    /// What was taken away, or could not be.
    pub cure: &'static str,
    pub verdict: Verdict,
    /// Why it fails.
    pub problems: Vec<String>,
    pub steps: u64,
    /// The worst of all runs that should survive; `null` where there is none.
    pub imbalance: Option<f64>,
    pub smallest_j: Option<f64>,
    pub speed_over_wave_speed: Option<f64>,
    pub clamped_nodes: u64,
    pub wall_s: f64,
    pub runs: Vec<RunReport>,
}

impl CaseReport {
    pub(super) fn new(case: &Case, runs: Vec<RunReport>) -> Self {
        let named = |run: &RunReport, text: &str| match run.label {
            "" => text.to_string(),
            label => format!("{label}: {text}"),
        };
        let mut problems: Vec<String> = runs.iter().filter_map(|run| Some(named(run, run.problem.as_ref()?))).collect();
        let answers: Vec<f64> = runs.iter().filter_map(|run| run.answer).collect();
        if let (Some(allowed), true) = (case.spread, answers.len() > 1) {
            let low = answers.iter().copied().fold(f64::INFINITY, f64::min);
            let high = answers.iter().copied().fold(f64::NEG_INFINITY, f64::max);
            let spread = high / low - 1.0;
            if spread.is_nan() || spread > allowed {
                problems.push(format!("the answers differ by {}, allowed {}", percent(spread), percent(allowed)));
            }
        }
        let counting = || runs.iter().filter(|run| run.counts);
        let worst = |of: fn(&RunReport) -> Option<f64>, sign: f64| {
            counting().filter_map(of).reduce(|a, b| if a.is_nan() || sign * a >= sign * b { a } else { b })
        };
        CaseReport {
            name: case.name,
            hard: case.hard,
            scene: case.scene,
            cure: case.cure.words(),
            verdict: match runs.first() {
                _ if !problems.is_empty() => Verdict::Fails,
                Some(first) => first.verdict,
                None => Verdict::Fails,
            },
            problems,
            steps: runs.iter().map(|run| run.steps).sum(),
            imbalance: worst(|run| run.imbalance, 1.0),
            smallest_j: worst(|run| run.smallest_j, -1.0),
            speed_over_wave_speed: worst(|run| run.speed_over_wave_speed, 1.0),
            clamped_nodes: counting().map(|run| run.clamped_nodes).sum(),
            wall_s: runs.iter().map(|run| run.wall_s).sum(),
            runs,
        }
    }
}

impl Cure {
    /// What is taken away, or what it is.
    fn words(&self) -> &'static str {
        match self {
            Cure::Switch { what, .. } => what,
            Cure::Fixed(what) => what,
        }
    }
}

/// The suite on one engine.
#[derive(Debug, Clone, Serialize)]
pub struct EngineReport {
    /// `gpu`, `cpu`; before an engine was made `auto`.
    pub engine: String,
    pub adapter: String,
    pub driver: String,
    pub interrupted: bool,
    pub cases: Vec<CaseReport>,
    #[serde(skip)]
    short: bool,
    #[serde(skip)]
    without_cure: bool,
}

impl EngineReport {
    pub(super) fn new(engine: EngineChoice, options: &Options) -> Self {
        EngineReport {
            engine: engine.key().into(),
            adapter: String::new(),
            driver: String::new(),
            interrupted: false,
            cases: Vec::new(),
            short: options.short,
            without_cure: options.without_cure,
        }
    }

    pub(super) fn add(&mut self, case: CaseReport, info: Option<EngineInfo>) {
        if let Some(info) = info {
            (self.engine, self.adapter, self.driver) = (info.engine, info.adapter, info.driver);
        }
        self.cases.push(case);
    }

    /// Names of the cases that did not come out as they must: that fail, or without their cure do not.
    pub fn surprises(&self) -> Vec<&'static str> {
        let failed = |case: &&CaseReport| (case.verdict == Verdict::Fails) != self.without_cure;
        self.cases.iter().filter(failed).map(|case| case.name).collect()
    }

    /// As text of 80 columns.
    pub fn table(&self) -> String {
        let form = if self.short { "short form" } else { "full form" };
        let cure = if self.without_cure { ", without the cure: every case must fail" } else { "" };
        let mut out = format!("stability, {form}{cure}\n");
        // What runs it is known from the first case on.
        let place = match self.adapter.as_str() {
            "" => "nothing was run".to_string(),
            adapter => format!("{} engine on {adapter}, {}", self.engine, self.driver),
        };
        out += &wrapped(&place, "", "  ");
        out.push('\n');
        let what = if self.without_cure { "without" } else { "what is hard" };
        let mut row = |cells: [&str; 8]| {
            let [name, what, steps, imbalance, j, speed, clamped, verdict] = cells;
            let line =
                format!("{name:<13} {what:<22} {steps:>6} {imbalance:>7} {j:>6} {speed:>5} {clamped:>6} {verdict:<7}");
            let _ = writeln!(out, "{}", line.trim_end());
        };
        row(["case", what, "steps", "energy", "J", "v/c", "clamp", "verdict"]);
        for case in &self.cases {
            let number = |value: Option<f64>, text: fn(f64) -> String| value.map_or("-".into(), text);
            row([
                case.name,
                if self.without_cure { case.cure } else { case.hard },
                &count(case.steps),
                &number(case.imbalance, percent),
                &number(case.smallest_j, |j| format!("{j:.2}")),
                &number(case.speed_over_wave_speed, |v| format!("{v:.3}")),
                &count(case.clamped_nodes),
                case.verdict.word(),
            ]);
        }
        out += "\nsteps: of all runs. energy: largest part lost or created. J: smallest at a cell\n\
                centre. v/c: largest nodal speed over that of the fastest wave. clamp: node\n\
                steps at the speed limit. The worst of all runs that should survive.\n";
        let failed: Vec<&CaseReport> = self.cases.iter().filter(|case| case.verdict == Verdict::Fails).collect();
        if !failed.is_empty() {
            out.push('\n');
        }
        for case in &failed {
            for problem in &case.problems {
                out += &wrapped(problem, &format!("{}: ", case.name), "  ");
            }
        }
        let of = |verdict: Verdict| self.cases.iter().filter(|case| case.verdict == verdict).count();
        let _ = write!(
            out,
            "\n{} cases: {} hold, {} caught, {} refused, {} fail; {:.0} s",
            self.cases.len(),
            of(Verdict::Holds),
            of(Verdict::Caught),
            of(Verdict::Refused),
            failed.len(),
            // The sum of nothing is -0.
            self.cases.iter().map(|case| case.wall_s).sum::<f64>().abs()
        );
        if self.interrupted {
            out += "; interrupted";
        }
        out
    }
}

/// The suite on all engines that were asked for.
#[derive(Debug, Clone, Serialize)]
pub struct Suite {
    #[serde(serialize_with = "form")]
    pub short: bool,
    pub without_cure: bool,
    /// True where every case came out as it must.
    pub as_expected: bool,
    pub engines: Vec<EngineReport>,
}

/// `short` or `full`.
fn form<S: Serializer>(short: &bool, serializer: S) -> Result<S::Ok, S::Error> {
    serializer.serialize_str(if *short { "short" } else { "full" })
}

impl Suite {
    pub fn new(options: &Options, engines: Vec<EngineReport>) -> Self {
        Suite {
            short: options.short,
            without_cure: options.without_cure,
            as_expected: engines.iter().all(|e| e.surprises().is_empty()),
            engines,
        }
    }

    pub fn json(&self) -> String {
        serde_json::to_string_pretty(self).unwrap_or_else(|e| format!("{{\"error\": \"{e}\"}}"))
    }

    pub fn table(&self) -> String {
        self.engines.iter().map(EngineReport::table).collect::<Vec<_>>().join("\n\n")
    }
}

/// All cases with what they expect and what carries them, in 80 columns.
pub fn list() -> String {
    let mut out = String::new();
    for case in CASES {
        let _ = writeln!(out, "{:<13} {} (scenes/{})", case.name, case.hard, case.scene);
        for part in case.parts {
            let label = if part.label.is_empty() { String::new() } else { format!("{}: ", part.label) };
            let mut text = format!("{label}{}", part.expected.words());
            if let Some(answer) = part.answer.filter(|a| a.at_least.is_finite() || a.at_most.is_finite()) {
                text += &format!("; {} {}", answer.what, range(answer.at_least, answer.at_most));
            }
            out += &wrapped(&text, "  ", "    ");
        }
        if let Some(spread) = case.spread {
            out += &wrapped(&format!("answers within {} of each other", percent(spread)), "  ", "    ");
        }
        match case.cure {
            Cure::Switch { what, overrides } => {
                let set = overrides.iter().map(|text| format!("--set {text}")).collect::<Vec<_>>().join(" ");
                out += &wrapped(&format!("fails without {what}: {set}"), "  ", "    ");
            }
            Cure::Fixed(what) => out += &wrapped(&format!("no key takes away: {what}"), "  ", "    "),
        }
    }
    out.trim_end().into()
}

/// A part in per cent, in at most seven characters.
fn percent(part: f64) -> String {
    match 100.0 * part {
        p if p.is_nan() => "nan".into(),
        p if p > 999.0 => ">999 %".into(),
        p if p >= 100.0 => format!("{p:.0} %"),
        p if p >= 10.0 => format!("{p:.1} %"),
        p => format!("{p:.2} %"),
    }
}

/// A count in at most six characters.
fn count(n: u64) -> String {
    match n {
        0..1_000_000 => n.to_string(),
        1_000_000..9_995_000 => format!("{:.2}M", n as f64 * 1e-6),
        9_995_000..999_500_000 => format!("{:.0}M", n as f64 * 1e-6),
        _ => format!("{:.1e}", n as f64),
    }
}

/// The words of `text` in lines of 80 columns, ended by a newline.
fn wrapped(text: &str, first: &str, rest: &str) -> String {
    let (mut out, mut line) = (String::new(), first.to_string());
    let mut empty = true;
    for word in text.split_whitespace() {
        if !empty && line.chars().count() + 1 + word.chars().count() > WIDTH {
            out += &line;
            out.push('\n');
            line = rest.to_string();
            empty = true;
        }
        if !empty {
            line.push(' ');
        }
        line += word;
        empty = false;
    }
    out + &line + "\n"
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_fit_their_columns() {
        for part in [0.0, 0.0001, 0.5, 0.09999, 0.99999, 5.0, 9.994, 1e9, f64::NAN, f64::INFINITY] {
            assert!(percent(part).len() <= 7, "{}", percent(part));
        }
        for n in [0, 999_999, 1_000_000, 9_994_999, 9_995_000, 99_999_999, 999_499_999, 999_999_999, 99_999_999_999] {
            assert!(count(n).len() <= 6, "{}", count(n));
        }
    }

    #[test]
    fn every_case_fits_the_table() {
        for case in CASES {
            assert!(case.name.len() <= 13 && case.hard.len() <= 22, "{}", case.name);
            if let Cure::Switch { what, .. } = case.cure {
                assert!(what.len() <= 22, "{what}");
            }
            assert!(!case.parts.is_empty());
        }
        assert!(list().lines().all(|line| line.chars().count() <= WIDTH), "{}", list());
    }

    #[test]
    fn long_texts_are_wrapped() {
        let text = wrapped(&"word ".repeat(40), "case: ", "  ");
        assert!(text.lines().count() == 3 && text.lines().all(|line| line.chars().count() <= WIDTH), "{text}");
        assert_eq!(wrapped("a b", "", ""), "a b\n");
    }
}
