//! Attempts as statements of the Experience API, for a learning record store: one per attempt, by the data rules of xAPI 1.0.3
//! (github.com/adlnet/xAPI-Spec, xAPI-Data.md).
//!
//! ```text
//! actor     account of the trainee's name on a home page that the caller names
//! verb      passed, failed; attempted where the attempt is not scored
//! object    the task, an activity of the type simulation
//! result    weights of the goals met and of all (raw, max), their share (scaled), success, completion, simulated duration, figures as an extension
//! ```

use serde_json::{Value, json};

use super::class::iso_8601;
use super::history::{Attempt, file_name};
use crate::hash::fnv1a;
use crate::{Error, Result};

/// Version of the specification that the statements keep to.
pub const VERSION: &str = "1.0.3";

/// Home page of the accounts where nothing is said; a name that never leads anywhere (RFC 2606).
pub const HOME_PAGE: &str = "https://stylet.invalid/history";

const VERBS: &str = "http://adlnet.gov/expapi/verbs/";
const SIMULATION: &str = "http://adlnet.gov/expapi/activities/simulation";

/// All attempts as one JSON list, as a store takes it.
///
/// # Errors
/// `Error::Input` for a home page that is no address.
pub fn statements<'a>(attempts: impl IntoIterator<Item = &'a Attempt>, home_page: &str) -> Result<String> {
    let home = home_page.trim_end_matches('/');
    let host = home.strip_prefix("https://").or_else(|| home.strip_prefix("http://"));
    if host
        .is_none_or(|host| host.is_empty() || host.contains(|c: char| c.is_whitespace() || "<>\"{}|\\^`".contains(c)))
    {
        return Err(Error::input(
            format!("`{home_page}` is no address of a home page"),
            "write one such as https://school.example/stylet: it tells the accounts of one school from those of another",
        ));
    }
    let list: Vec<Value> = attempts.into_iter().map(|attempt| statement(attempt, home)).collect();
    let text =
        serde_json::to_string_pretty(&list).map_err(|e| Error::input(e.to_string(), "report this as a defect"))?;
    Ok(text + "\n")
}

/// One attempt.
pub fn statement(attempt: &Attempt, home: &str) -> Value {
    let verb = match attempt.score.passed() {
        Some(true) => "passed",
        Some(false) => "failed",
        None => "attempted",
    };
    let mut statement = json!({
        "id": id(attempt),
        "actor": {
            "objectType": "Agent",
            "name": attempt.trainee,
            "account": { "homePage": home, "name": attempt.trainee },
        },
        "verb": { "id": format!("{VERBS}{verb}"), "display": { "en-US": verb } },
        "object": {
            "objectType": "Activity",
            "id": format!("{home}/tasks/{}", file_name(&attempt.task)),
            "definition": { "type": SIMULATION, "name": { "en-US": attempt.task } },
        },
        "result": result(attempt, home),
        "context": { "platform": concat!("Stylet ", env!("CARGO_PKG_VERSION")) },
        "timestamp": iso_8601(attempt.finished),
        "version": VERSION,
    });
    if attempt.score.passed().is_none()
        && let Some(reason) = attempt.score.trust.reasons.first()
    {
        statement["result"]["response"] = json!(reason);
    }
    statement
}

fn result(attempt: &Attempt, home: &str) -> Value {
    let figures = attempt.score.rows.iter().filter_map(|row| Some((row.key.clone(), json!(row.value?))));
    let figures: serde_json::Map<String, Value> = figures.collect();
    let mut result = json!({
        "completion": attempt.score.passed().is_some(),
        "extensions": { (format!("{home}/figures")): figures },
    });
    if let Some(passed) = attempt.score.passed() {
        result["success"] = json!(passed);
    }
    if let Some(share) = attempt.score.share() {
        let all: f64 = attempt.score.goals.iter().map(|goal| goal.weight).sum();
        result["score"] = json!({ "scaled": share, "raw": share * all, "min": 0, "max": all });
    }
    if let Some(time) = attempt.score.value("elapsed_time").filter(|time| *time >= 0.0) {
        // A store may cut what is finer than a hundredth of a second.
        result["duration"] = json!(format!("PT{time:.2}S"));
    }
    result
}

/// The same attempt has the same identifier every time, so that a store takes it once: in the form of a UUID of a name (RFC 4122), with
/// the hash of this program in the place of SHA-1.
fn id(attempt: &Attempt) -> String {
    let of = |salt: &str| {
        fnv1a(&[salt, &attempt.trainee, &attempt.task, &attempt.number.to_string(), &attempt.finished.to_string()])
    };
    let digits = of("stylet") + &of("attempt");
    format!("{}-{}-5{}-a{}-{}", &digits[..8], &digits[8..12], &digits[13..16], &digits[17..20], &digits[20..])
}
