//! Which figures tell levels of skill apart: a table per task, from the attempts of synthetic trainees.

use std::sync::LazyLock;

use serde::{Deserialize, Serialize};

use super::skill::Level;
use super::skill_run::Outcome;
use super::statistics::{Auc, auc, median, rank_correlation};
use super::texts::Better;
use super::texts::{FIGURES, FigureText};

/// The evidence of the repository, which is built in.
pub const FILE: &str = "assets/training/evidence.toml";

/// Key figures of a task, at most.
pub const KEY_FIGURES: usize = 3;

/// Rank correlation beyond which two figures say the same.
pub const MOST_ALIKE: f64 = 0.9;

/// Part of the attempts of a level that must hold a figure.
pub const LEAST_HELD: f64 = 0.8;

/// All tasks, as the file has them.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Evidence {
    #[serde(default)]
    pub task: Vec<TaskEvidence>,
}

/// One task.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TaskEvidence {
    /// Name of the scene and what was changed in it.
    pub scene: String,
    #[serde(default)]
    pub overrides: Vec<String>,
    /// Name of the task.
    pub task: String,
    /// Program version and seed of the attempts.
    pub version: String,
    pub seed: u64,
    /// In the order of [`Level::ALL`]: attempts, those that passed, those that the guard stopped, those that the verdict refused.
    pub attempts: [u64; 3],
    pub passed: [u64; 3],
    pub stopped: [u64; 3],
    pub refused: [u64; 3],
    /// Median simulated time of an attempt [s], and simulated over wall time of all.
    pub median_time: f64,
    pub real_time_factor: f64,
    /// Part of the frames in which the hand was faster than the tissue follows.
    pub limited: f64,
    /// The figures that tell the levels apart best and do not say the same.
    pub key_figures: Vec<String>,
    pub figure: Vec<FigureEvidence>,
}

/// One figure.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FigureEvidence {
    pub key: String,
    pub unit: String,
    /// In the order of [`Level::ALL`].
    pub medians: [f64; 3],
    /// Probability that the less skilled has the worse value.
    pub novice_expert: Auc,
    pub novice_intermediate: Auc,
    pub intermediate_expert: Auc,
}

/// What an interval says.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Finding {
    TellsApart,
    Open,
    /// The less skilled has the better value.
    Reversed,
}

impl Finding {
    pub fn of(auc: &Auc) -> Finding {
        match auc {
            Auc { low, .. } if *low > 0.5 => Finding::TellsApart,
            Auc { high, .. } if *high < 0.5 => Finding::Reversed,
            _ => Finding::Open,
        }
    }

    pub fn words(self) -> &'static str {
        match self {
            Finding::TellsApart => "yes",
            Finding::Open => "no",
            Finding::Reversed => "the other way round",
        }
    }
}

/// The evidence of the repository.
pub fn built_in() -> &'static Evidence {
    static EVIDENCE: LazyLock<Evidence> = LazyLock::new(|| {
        toml::from_str(include_str!("../../assets/training/evidence.toml"))
            .unwrap_or_else(|text| panic!("{FILE} is part of the program and tested:\n{text}"))
    });
    &EVIDENCE
}

/// What was run.
#[derive(Debug, Clone, Copy)]
pub struct Subject<'a> {
    pub scene: &'a str,
    pub overrides: &'a [String],
    pub task: &'a str,
    pub seed: u64,
}

/// The text of a figure, also of one of a layer or target.
pub fn text_of(key: &str) -> Option<&'static FigureText> {
    FIGURES.iter().find(|f| f.key == key || (f.key.ends_with('.') && key.starts_with(f.key)))
}

impl TaskEvidence {
    /// What the attempts say.
    pub fn of(subject: Subject, outcomes: &[Outcome]) -> TaskEvidence {
        let count = |that: &dyn Fn(&Outcome) -> bool| {
            Level::ALL.map(|level| outcomes.iter().filter(|o| o.level == level && that(o)).count() as u64)
        };
        let sum = |of: &dyn Fn(&Outcome) -> f64| outcomes.iter().map(of).sum::<f64>();
        let mut keys: Vec<&str> = Vec::new();
        for (key, _) in outcomes.iter().filter(|o| o.is_scored()).flat_map(|o| &o.figures) {
            if !keys.contains(&key.as_str()) {
                keys.push(key);
            }
        }
        let figure: Vec<FigureEvidence> = keys.iter().filter_map(|key| FigureEvidence::of(key, outcomes)).collect();
        TaskEvidence {
            scene: subject.scene.into(),
            overrides: subject.overrides.to_vec(),
            task: subject.task.into(),
            version: env!("CARGO_PKG_VERSION").into(),
            seed: subject.seed,
            attempts: count(&|_| true),
            passed: count(&|o| o.passed == Some(true)),
            stopped: count(&|o| o.stopped.is_some()),
            refused: count(&|o| o.stopped.is_none() && !o.is_scored()),
            median_time: rounded(median(&outcomes.iter().map(|o| o.simulated).collect::<Vec<_>>()).unwrap_or(0.0)),
            real_time_factor: rounded(sum(&|o| o.simulated) / sum(&|o| o.wall).max(1e-9)),
            limited: rounded(sum(&|o| o.limited_frames as f64) / sum(&|o| o.frames as f64).max(1.0)),
            key_figures: key_figures(&figure, outcomes),
            figure,
        }
    }

    /// Attempts that guard or verdict did not let through.
    pub fn lost(&self) -> u64 {
        self.stopped.iter().chain(&self.refused).sum()
    }
}

/// Four digits: what is committed does not change with the last bit of a machine.
fn rounded(x: f64) -> f64 {
    format!("{x:.3e}").parse().unwrap_or(x)
}

impl FigureEvidence {
    /// `None` for a figure that says nothing about skill by itself, or that too few attempts hold.
    fn of(key: &str, outcomes: &[Outcome]) -> Option<FigureEvidence> {
        let text = text_of(key).filter(|text| text.better != Better::None)?;
        let scored = |level: Level| outcomes.iter().filter(move |o| o.level == level && o.is_scored());
        let values = Level::ALL.map(|level| scored(level).filter_map(|o| o.value(key)).collect::<Vec<f64>>());
        let held = |level: Level| values[level as usize].len() as f64 >= LEAST_HELD * scored(level).count() as f64;
        if !Level::ALL.into_iter().all(held) {
            return None;
        }
        let between = |worse: Level, better: Level| {
            let [worse, better] = [&values[worse as usize], &values[better as usize]];
            let found = match text.better {
                Better::Higher => auc(better, worse)?,
                _ => auc(worse, better)?,
            };
            Some(Auc { value: rounded(found.value), low: rounded(found.low), high: rounded(found.high) })
        };
        let [novice, middle, expert] = [median(&values[0])?, median(&values[1])?, median(&values[2])?];
        Some(FigureEvidence {
            key: key.into(),
            unit: text.unit.name.into(),
            medians: [rounded(novice), rounded(middle), rounded(expert)],
            novice_expert: between(Level::Novice, Level::Expert)?,
            novice_intermediate: between(Level::Novice, Level::Intermediate)?,
            intermediate_expert: between(Level::Intermediate, Level::Expert)?,
        })
    }
}

/// The best figures that tell novice and expert apart; one that goes with a better one is left out. Those whose interval reaches into that
/// of the best are as good as it: among them the order of a score decides, which has first what says most of the trade.
fn key_figures(figures: &[FigureEvidence], outcomes: &[Outcome]) -> Vec<String> {
    let mut best: Vec<&FigureEvidence> =
        figures.iter().filter(|f| Finding::of(&f.novice_expert) == Finding::TellsApart).collect();
    let top = best.iter().map(|f| f.novice_expert).max_by(|a, b| a.value.total_cmp(&b.value));
    let behind = |f: &FigureEvidence| top.is_some_and(|top| f.novice_expert.high < top.low);
    let place = |f: &FigureEvidence| FIGURES.iter().position(|text| f.key.starts_with(text.key.trim_end_matches('.')));
    best.sort_by(|a, b| match (behind(a), behind(b)) {
        (false, false) => place(a).cmp(&place(b)),
        (true, true) => b.novice_expert.value.total_cmp(&a.novice_expert.value),
        (a, b) => a.cmp(&b),
    });
    let mut kept: Vec<&str> = Vec::new();
    for figure in best {
        let alike = kept.iter().any(|other| {
            let pair = |o: &Outcome| Some((o.value(&figure.key)?, o.value(other)?));
            let pairs: Vec<(f64, f64)> = outcomes.iter().filter(|o| o.is_scored()).filter_map(pair).collect();
            rank_correlation(&pairs).is_some_and(|r| r.abs() > MOST_ALIKE)
        });
        if !alike && kept.len() < KEY_FIGURES {
            kept.push(&figure.key);
        }
    }
    kept.into_iter().map(String::from).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn outcome(level: Level, index: u64, figures: &[(&str, f64)]) -> Outcome {
        Outcome {
            level,
            index,
            passed: Some(level != Level::Novice),
            stopped: None,
            reasons: Vec::new(),
            limited_frames: 0,
            frames: 10,
            simulated: 4.0,
            wall: 2.0,
            figures: figures.iter().map(|(key, value)| (key.to_string(), *value)).collect(),
        }
    }

    /// `passes` and `overshoot` grow from expert to novice, `path_length` is a copy of `overshoot`, `impulse` says nothing.
    #[test]
    fn key_figures_are_the_best_that_differ() {
        let mut outcomes = Vec::new();
        for (step, level) in [(2.0, Level::Novice), (1.0, Level::Intermediate), (0.0, Level::Expert)] {
            for i in 0..20u64 {
                let x = i as f64;
                outcomes.push(outcome(
                    level,
                    i,
                    &[
                        ("impulse", (i % 5) as f64),
                        ("overshoot", 8.0 * step + x),
                        ("path_length", 3.0 * (8.0 * step + x)),
                        ("passes", 5.0 * step + ((7 * i) % 20) as f64),
                        ("deepest_cut", step),
                    ],
                ));
            }
        }
        outcomes.push(Outcome { stopped: Some("why".into()), ..outcome(Level::Expert, 20, &[("overshoot", 1e9)]) });
        let subject = Subject { scene: "s", overrides: &[], task: "t", seed: 1 };
        let found = TaskEvidence::of(subject, &outcomes);
        assert_eq!(found.key_figures, ["overshoot", "passes"], "a copy and what tells nothing are no key figures");
        assert_eq!((found.attempts, found.passed, found.stopped), ([20, 20, 21], [0, 20, 21], [0, 0, 1]));
        assert_eq!((found.lost(), found.real_time_factor), (1, 2.0));
        let figure = |key: &str| found.figure.iter().find(|f| f.key == key);
        assert!(figure("deepest_cut").is_none(), "it is neither better nor worse");
        assert_eq!(figure("overshoot").unwrap().medians, [25.5, 17.5, 9.5]);
        assert_eq!(Finding::of(&figure("impulse").unwrap().novice_expert), Finding::Open);
        // Of 400 pairs 6 are the other way round and 4 are ties.
        assert!((figure("overshoot").unwrap().novice_expert.value - (1.0 - 8.0 / 400.0)).abs() < 1e-9);
    }
}
