//! Numbers as tables show them.

/// Nine significant digits, trailing zeros left away; an exponent where the plain form would be long.
pub fn number(value: f64) -> String {
    if value == 0.0 || !value.is_finite() {
        return if value == 0.0 { "0".into() } else { value.to_string() };
    }
    let rounded: f64 = format!("{value:.8e}").parse().expect("a number that was just formatted can be parsed");
    if (1e-4..1e9).contains(&rounded.abs()) { format!("{rounded}") } else { format!("{rounded:e}") }
}
