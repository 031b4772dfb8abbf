//! Numbers and lists as a report writes them.

/// `2, 5 and 10`.
pub fn and(items: &[String]) -> String {
    match items {
        [] => String::new(),
        [one] => one.clone(),
        [most @ .., last] => format!("{} and {last}", most.join(", ")),
    }
}

/// A fraction in percent, with its sign; never -0.0.
pub fn percent_off(fraction: f64) -> String {
    let text = format!("{:+.1}", 100.0 * fraction);
    format!("{} %", if matches!(text.as_str(), "-0.0" | "+0.0") { "0.0" } else { &text })
}

/// A value of the summary as its file has it.
pub fn plain(value: &serde_json::Value) -> String {
    match value {
        serde_json::Value::Null => "-".into(),
        serde_json::Value::String(text) => text.clone(),
        serde_json::Value::Array(items) => items.iter().map(plain).collect::<Vec<_>>().join(", "),
        other => other.to_string(),
    }
}

/// Smallest and largest value.
pub fn bounds(values: &[f64]) -> (f64, f64) {
    values.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), &v| (low.min(v), high.max(v)))
}
