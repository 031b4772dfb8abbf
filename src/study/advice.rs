//! What a study means for somebody who wants a frame rate or an accuracy.

use super::{Settings, digits, trimmed};

/// Error of the force curve that counts as accurate.
pub const ACCURATE: f64 = 0.01;

/// Settings that were run, with what they gave.
#[derive(Debug, Clone, PartialEq)]
pub struct Candidate {
    pub settings: Settings,
    /// Simulated time over wall time.
    pub real_time_factor: f64,
    /// Relative L2 norm over depth of the error of the force.
    pub error: f64,
    /// True on the mesh of the reference: then its error holds no part of the mesh.
    pub same_mesh: bool,
}

/// The most accurate candidate that keeps real time.
pub fn best_in_real_time(candidates: &[Candidate]) -> Option<&Candidate> {
    let fast = candidates.iter().filter(|c| c.real_time_factor >= 1.0 && c.error.is_finite());
    fast.min_by(|a, b| a.error.total_cmp(&b.error))
}

/// The fastest candidate that is as accurate as `error`.
pub fn fastest_within(candidates: &[Candidate], error: f64) -> Option<&Candidate> {
    let good = candidates.iter().filter(|c| c.error <= error);
    good.max_by(|a, b| a.real_time_factor.total_cmp(&b.real_time_factor))
}

/// What to choose on an adapter, for real time and for 1 % error.
pub fn sentences(adapter: &str, candidates: &[Candidate]) -> Vec<String> {
    let percent = |error: f64| format!("{} %", digits(100.0 * error));
    let accuracy = format!("{} %", trimmed(100.0 * ACCURATE));
    let usable: Vec<Candidate> = candidates.iter().filter(|c| c.error.is_finite()).cloned().collect();
    if usable.is_empty() {
        return vec![format!("No finished run of this study on {adapter} can be compared with the reference.")];
    }
    let fastest = usable.iter().max_by(|a, b| a.real_time_factor.total_cmp(&b.real_time_factor));
    let best = usable.iter().min_by(|a, b| a.error.total_cmp(&b.error));
    let mut sentences = Vec::new();
    match (best_in_real_time(&usable), fastest) {
        (Some(choice), _) => sentences.push(format!(
            "For real time on {adapter} choose {}: error of the force curve {}, {} times real time{}.",
            choice.settings.describe(),
            percent(choice.error),
            digits(choice.real_time_factor),
            remark(choice)
        )),
        (None, Some(fastest)) => sentences.push(format!(
            "No setting of this study is real time on {adapter}; the fastest, {}, is {} times slower than real time, with an \
             error of the force curve of {}.",
            fastest.settings.describe(),
            digits(1.0 / fastest.real_time_factor),
            percent(fastest.error)
        )),
        (None, None) => {}
    }
    match (fastest_within(&usable, ACCURATE), best) {
        (Some(choice), _) => sentences.push(format!(
            "For {accuracy} error choose {}: error {}, {}{}.",
            choice.settings.describe(),
            percent(choice.error),
            speed(choice.real_time_factor),
            remark(choice)
        )),
        (None, Some(best)) => sentences.push(format!(
            "No setting of this study comes within {accuracy} of the reference; the closest, {}, has an error of {} and is {}{}.",
            best.settings.describe(),
            percent(best.error),
            speed(best.real_time_factor),
            remark(best)
        )),
        (None, None) => {}
    }
    sentences
}

/// What the error of a candidate does not hold.
fn remark(candidate: &Candidate) -> &'static str {
    match candidate.same_mesh {
        true => " (on the mesh of the reference, so without the error of that mesh itself)",
        false => "",
    }
}

/// A real-time factor in words.
pub fn speed(factor: f64) -> String {
    if factor >= 1.0 {
        format!("{} times real time", digits(factor))
    } else {
        format!("{} times slower than real time", digits(1.0 / factor))
    }
}
