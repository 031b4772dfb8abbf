//! What a study means for somebody who wants a frame rate or an accuracy.

use super::Settings;
use crate::units::{three_decimals, trimmed};

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

/// Candidates whose error is known. On the mesh of the reference only the part of mass scaling and step is: what that mesh itself is
/// wrong by would take a finer one to tell.
fn known(candidates: &[Candidate]) -> impl Iterator<Item = &Candidate> {
    candidates.iter().filter(|c| c.error.is_finite() && !c.same_mesh)
}

/// The fastest of some candidates.
fn fastest<'a>(candidates: impl Iterator<Item = &'a Candidate>) -> Option<&'a Candidate> {
    candidates.max_by(|a, b| a.real_time_factor.total_cmp(&b.real_time_factor))
}

/// The most accurate candidate that keeps real time, of those whose error is known.
pub fn best_in_real_time(candidates: &[Candidate]) -> Option<&Candidate> {
    known(candidates).filter(|c| c.real_time_factor >= 1.0).min_by(|a, b| a.error.total_cmp(&b.error))
}

/// The fastest candidate that is as accurate as `error`, of those whose error is known.
pub fn fastest_within(candidates: &[Candidate], error: f64) -> Option<&Candidate> {
    fastest(known(candidates).filter(|c| c.error <= error))
}

/// What to choose on an adapter, for real time and for 1 % error. No mesh is recommended for an accuracy that it was measured
/// against itself.
pub fn sentences(adapter: &str, candidates: &[Candidate]) -> Vec<String> {
    let percent = |error: f64| format!("{} %", three_decimals(100.0 * error));
    let accuracy = format!("{} %", trimmed(100.0 * ACCURATE));
    let finished: Vec<Candidate> = candidates.iter().filter(|c| c.error.is_finite()).cloned().collect();
    if finished.is_empty() {
        return vec![format!("No finished run of this study on {adapter} can be compared with the reference.")];
    }
    let mut sentences = Vec::new();
    match (best_in_real_time(&finished), fastest(finished.iter())) {
        (Some(choice), _) => sentences.push(format!(
            "For real time on {adapter} choose {}: error of the force curve {}, {} times real time.",
            choice.settings.describe(),
            percent(choice.error),
            three_decimals(choice.real_time_factor),
        )),
        // Fast enough is only the mesh that has nothing to be compared with.
        (None, Some(fastest)) if fastest.real_time_factor >= 1.0 => sentences.push(format!(
            "Real time on {adapter}: {}, {} times real time. It is the mesh of the reference, so the error of the mesh is not known; \
             mass scaling and step alone change the force curve by {}.",
            fastest.settings.describe(),
            three_decimals(fastest.real_time_factor),
            percent(fastest.error)
        )),
        (None, Some(fastest)) => sentences.push(format!(
            "No setting of this study is real time on {adapter}; the fastest, {}, is {}{}.",
            fastest.settings.describe(),
            speed(fastest.real_time_factor),
            if fastest.same_mesh {
                String::new()
            } else {
                format!(", with an error of the force curve of {}", percent(fastest.error))
            }
        )),
        (None, None) => {}
    }
    if let Some(choice) = fastest_within(&finished, ACCURATE) {
        sentences.push(format!(
            "For {accuracy} error choose {}: error {}, {}.",
            choice.settings.describe(),
            percent(choice.error),
            speed(choice.real_time_factor),
        ));
        return sentences;
    }
    sentences.push(match known(&finished).min_by(|a, b| a.error.total_cmp(&b.error)) {
        Some(best) => format!(
            "No setting of this study on a mesh coarser than that of the reference comes within {accuracy} of it; the closest, {}, has an \
             error of {} and is {}.",
            best.settings.describe(),
            percent(best.error),
            speed(best.real_time_factor),
        ),
        None => format!("No run of this study on {adapter} has another mesh than the reference, so no error of a mesh is known."),
    });
    // What is known of the reference's mesh is said, but it is no recommendation.
    if let Some(own) = fastest(finished.iter().filter(|c| c.same_mesh && c.error <= ACCURATE)) {
        sentences.push(format!(
            "On the mesh of the reference itself {} changes the force curve by {} and is {}; how far that mesh is from a finer one \
             this study cannot say. For a mesh that is known to be within {accuracy} give it a larger --budget.",
            own.settings.describe(),
            percent(own.error),
            speed(own.real_time_factor)
        ));
    }
    sentences
}

/// A real-time factor in words.
pub fn speed(factor: f64) -> String {
    if factor >= 1.0 {
        format!("{} times real time", three_decimals(factor))
    } else {
        format!("{} times slower than real time", three_decimals(1.0 / factor))
    }
}
