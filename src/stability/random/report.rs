//! What came out of random scenes: a line per scene, rates per class, and whether all of it may be.

use std::fmt::Write as _;

use serde::Serialize;

use super::generator::RandomScene;
use super::runner::{End, Outcome, apart};
use super::{MOST_APART, OK_PART, SENSITIVE};

/// One scene on all engines.
#[derive(Debug, Clone, Serialize)]
pub struct SceneReport {
    pub seed: u64,
    pub index: u64,
    /// One per engine.
    pub outcomes: Vec<Outcome>,
    /// Largest difference of the forces of the first two engines over the largest force.
    pub apart: Option<f64>,
    /// The same of the CPU engine and itself, with bulk moduli that differ by one rounding of f32; known where the engines are apart.
    pub own: Option<f64>,
    /// True where the scene holds a deliberate mistake.
    pub mistaken: bool,
}

impl SceneReport {
    pub(super) fn new(scene: &RandomScene, outcomes: Vec<Outcome>) -> Self {
        let apart = match &outcomes[..] {
            [found, reference, ..] => apart(found, reference),
            _ => None,
        };
        SceneReport {
            seed: scene.seed,
            index: scene.index,
            outcomes,
            apart,
            own: None,
            mistaken: scene.mistake.is_some(),
        }
    }

    /// True for a scene within what a user would do, as it came to run. A refused one counts among the others: none of its numbers
    /// are known.
    pub fn reasonable(&self) -> bool {
        !self.mistaken && self.outcomes.iter().all(|o| o.reasonable() && o.end != End::Refused)
    }

    /// True where it ended ok on all engines, and these agree.
    pub fn is_plain(&self) -> bool {
        self.outcomes.iter().all(|o| o.end == End::Ok) && !self.engines_disagree()
    }

    /// True where the engines give different forces in a reasonable scene.
    pub fn engines_disagree(&self) -> bool {
        self.reasonable()
            && self.outcomes.iter().all(|o| o.end == End::Ok)
            && self.apart.is_some_and(|part| part.is_nan() || part > MOST_APART)
            && !self.is_sensitive()
    }

    /// True where the CPU engine cannot follow itself either.
    pub fn is_sensitive(&self) -> bool {
        self.own.is_some_and(|part| part > SENSITIVE)
    }

    /// True where an engine ended as none may.
    pub fn is_forbidden(&self) -> bool {
        self.outcomes.iter().any(|o| !o.end.allowed())
    }

    /// Head of the kept file.
    pub(super) fn head(&self) -> String {
        let refused = self
            .outcomes
            .iter()
            .any(|o| o.end == End::Refused)
            .then(|| "refused before its numbers were known".to_string());
        let why = self.outcomes.iter().find(|o| !o.beyond.is_empty()).map(|o| o.beyond.join("; ")).or(refused);
        let mut text = match (self.mistaken, why) {
            (true, _) => format!(
                "# random scene, seed {}, index {}; reasonable: no (a deliberate mistake)\n",
                self.seed, self.index
            ),
            (_, Some(why)) => {
                format!("# random scene, seed {}, index {}; reasonable: no ({why})\n", self.seed, self.index)
            }
            _ => format!("# random scene, seed {}, index {}; reasonable: yes\n", self.seed, self.index),
        };
        for o in &self.outcomes {
            let said = o.reason.lines().map(str::trim).filter(|l| !l.is_empty()).collect::<Vec<_>>().join(" | ");
            writeln!(
                text,
                "# {}: {}, largest imbalance {:.2} % in frame {}; {said}",
                o.engine,
                o.end.word(),
                100.0 * o.imbalance,
                o.imbalance_frame
            )
            .expect("text grows");
        }
        if let Some(apart) = self.apart {
            writeln!(text, "# the engines differ by {:.3} % of the peak force", 100.0 * apart).expect("text grows");
        }
        text
    }

    /// A line for the terminal.
    pub fn line(&self) -> String {
        let sort = match (self.mistaken, self.reasonable()) {
            (true, _) => "mistaken",
            (_, true) => "reasonable",
            _ => "wild",
        };
        let mut text = format!("{:>5} {sort:10}", self.index);
        for o in &self.outcomes {
            write!(text, " {} {}", o.engine, o.end.word()).expect("text grows");
            if o.cells > 0 {
                write!(
                    text,
                    " ({} cells, {} steps, {:.1} s, energy {:+.2} %)",
                    o.cells,
                    o.steps,
                    o.wall_s,
                    100.0 * o.imbalance
                )
                .expect("text grows");
            }
            let first = o.reason.lines().find(|l| !l.trim().is_empty()).unwrap_or("");
            if o.end != End::Ok {
                write!(text, ": {}", first.trim().chars().take(150).collect::<String>()).expect("text grows");
            }
        }
        if let Some(apart) = self.apart {
            write!(text, "; forces apart {:.3} %", 100.0 * apart).expect("text grows");
        }
        if let Some(own) = self.own {
            write!(text, " (the CPU engine from itself after one rounding of f32: {:.4} %)", 100.0 * own)
                .expect("text grows");
        }
        text
    }
}

/// All scenes of a call.
#[derive(Debug, Clone, Serialize)]
pub struct RandomReport {
    pub seed: u64,
    pub scenes: Vec<SceneReport>,
    pub interrupted: bool,
}

impl RandomReport {
    pub(super) fn new(seed: u64) -> Self {
        RandomReport { seed, scenes: Vec::new(), interrupted: false }
    }

    /// Reasonable scenes, and those of them that ended other than ok.
    pub fn reasonable(&self) -> (usize, usize) {
        let all = || self.scenes.iter().filter(|s| s.reasonable());
        (all().count(), all().filter(|s| s.outcomes.iter().any(|o| o.end != End::Ok)).count())
    }

    /// What must not be, one line each.
    pub fn problems(&self) -> Vec<String> {
        let mut problems = Vec::new();
        for scene in &self.scenes {
            if scene.is_forbidden() || scene.engines_disagree() {
                problems.push(scene.line());
            }
        }
        problems
    }

    /// A rate of reasonable scenes below the one that is wanted. No failure of these scenes: each said what it was.
    pub fn shortfall(&self) -> Option<String> {
        let (all, others) = self.reasonable();
        // One scene may always miss: of forty a fiftieth is none.
        let may = ((1.0 - OK_PART) * all as f64 + 1e-9).floor().max(1.0);
        (others as f64 > may)
            .then(|| format!("{others} of {all} reasonable scenes ended other than ok, wanted are at most {may}"))
    }

    /// Rates per class, as a table.
    pub fn table(&self) -> String {
        let engines: Vec<&str> =
            self.scenes.first().map_or(Vec::new(), |s| s.outcomes.iter().map(|o| o.engine).collect());
        let mut text = format!("{} random scenes of seed {}\n", self.scenes.len(), self.seed);
        writeln!(text, "{:18} {:>12} {:>12} {:>12}", "end", "reasonable", "wild", "mistaken").expect("text grows");
        for (slot, engine) in engines.iter().enumerate() {
            let count = |end: End, of: &dyn Fn(&SceneReport) -> bool| {
                self.scenes.iter().filter(|s| of(s) && s.outcomes[slot].end == end).count()
            };
            writeln!(text, "{engine}").expect("text grows");
            let sorts: [&dyn Fn(&SceneReport) -> bool; 3] =
                [&|s| s.reasonable(), &|s| !s.mistaken && !s.reasonable(), &|s| s.mistaken];
            let totals = sorts.map(|of| self.scenes.iter().filter(|s| of(s)).count());
            for end in End::ALL {
                let counts = [count(end, sorts[0]), count(end, sorts[1]), count(end, sorts[2])];
                if counts == [0; 3] {
                    continue;
                }
                let cell = |i: usize| match totals[i] {
                    0 => "-".to_string(),
                    total => format!("{} ({:.0} %)", counts[i], 100.0 * counts[i] as f64 / total as f64),
                };
                writeln!(text, "  {:16} {:>12} {:>12} {:>12}", end.word(), cell(0), cell(1), cell(2))
                    .expect("text grows");
            }
        }
        let compared = self.scenes.iter().filter(|s| s.reasonable() && !s.is_sensitive()).filter_map(|s| s.apart);
        let (count, worst) = compared.fold((0, 0.0_f64), |(n, worst), x| (n + 1, worst.max(x)));
        let sensitive: Vec<u64> = self.scenes.iter().filter(|s| s.is_sensitive()).map(|s| s.index).collect();
        if !sensitive.is_empty() {
            writeln!(
                text,
                "not compared, since the CPU engine does not follow itself after one rounding of f32 either: {sensitive:?}"
            )
            .expect("text grows");
        }
        if count > 0 {
            writeln!(
                text,
                "engines: forces apart by at most {:.3} % of the peak in {count} reasonable scenes",
                100.0 * worst
            )
            .expect("text grows");
        }
        let (all, others) = self.reasonable();
        if all > 0 {
            let part = 100.0 * (all - others) as f64 / all as f64;
            writeln!(text, "reasonable scenes that end ok: {part:.1} % of {all}").expect("text grows");
        }
        for problem in self.problems() {
            writeln!(text, "FAILS: {problem}").expect("text grows");
        }
        if let Some(shortfall) = self.shortfall() {
            writeln!(text, "{shortfall}").expect("text grows");
        }
        text
    }
}
