//! How a trainee stands: attempts at every task, how many were passed, how the last ones went.

use crate::training::history::{Attempt, History};

/// Attempts whose results are shown one by one.
const LAST: usize = 8;

/// The attempts of a trainee at one task.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Standing {
    pub attempts: usize,
    pub passed: usize,
    /// Shortest time of those that were passed [s].
    pub best: Option<f64>,
    /// Whether each of the last ones was passed, the newest at the end; `None`: it is not scored.
    pub last: Vec<Option<bool>>,
}

impl Standing {
    /// Of the attempts at one task, in their order.
    fn of<'a>(attempts: impl Iterator<Item = &'a Attempt>) -> Self {
        let mut standing = Standing::default();
        for attempt in attempts {
            let passed = attempt.score.passed();
            standing.attempts += 1;
            standing.last.push(passed);
            if passed == Some(true) {
                standing.passed += 1;
                let time = attempt.score.value("elapsed_time");
                standing.best = [standing.best, time].into_iter().flatten().reduce(f64::min);
            }
        }
        standing.last.drain(..standing.last.len().saturating_sub(LAST));
        standing
    }
}

/// All attempts of a trainee, as far as they can be read.
#[derive(Debug, Default)]
pub struct Progress {
    attempts: Vec<Attempt>,
    /// What cannot be read, for people.
    pub broken: Vec<String>,
}

impl Progress {
    pub fn of(history: &History, trainee: Option<&str>) -> Self {
        let Some(trainee) = trainee else { return Progress::default() };
        match history.attempts(trainee) {
            Ok(found) => {
                Progress { attempts: found.attempts, broken: found.broken.iter().map(ToString::to_string).collect() }
            }
            Err(error) => Progress { attempts: Vec::new(), broken: vec![error.to_string()] },
        }
    }

    /// Of one task, by its name in the scene file.
    pub fn standing(&self, task: &str) -> Standing {
        Standing::of(self.attempts.iter().filter(|attempt| attempt.task == task))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::training::score::Score;
    use crate::training::task::GoalResult;
    use crate::training::texts::Better;
    use crate::training::{Row, Trust};

    fn score(met: Option<bool>, time: f64) -> Score {
        let row = Row {
            key: "elapsed_time".into(),
            label: String::new(),
            unit: "s".into(),
            value: Some(time),
            reference: None,
            better: Better::Lower,
        };
        let goal = GoalResult {
            key: "avoid".into(),
            text: String::new(),
            unit: "mm".into(),
            measured: None,
            least: None,
            most: None,
            met,
            weight: 1.0,
        };
        Score { scene: "s".into(), task: Some("t".into()), rows: vec![row], goals: vec![goal], trust: Trust::default() }
    }

    #[test]
    fn the_best_time_is_that_of_a_passed_attempt() {
        let folder = tempfile::tempdir().unwrap();
        let history = History::new(folder.path());
        for (met, time) in [(Some(false), 3.0), (Some(true), 20.0), (None, 1.0), (Some(true), 12.5)] {
            history.add("ada", &score(met, time)).unwrap();
        }
        let standing = Progress::of(&history, Some("ada")).standing("t");
        assert_eq!((standing.attempts, standing.passed, standing.best), (4, 2, Some(12.5)));
        assert_eq!(standing.last, [Some(false), Some(true), None, Some(true)]);
        assert_eq!(Progress::of(&history, Some("ada")).standing("other"), Standing::default());
        for n in 0..10 {
            history.add("ada", &score(Some(n == 9), 30.0)).unwrap();
        }
        let standing = Progress::of(&history, Some("ada")).standing("t");
        assert_eq!((standing.last.len(), standing.last.last()), (LAST, Some(&Some(true))));
        assert_eq!(standing.best, Some(12.5));
    }
}
