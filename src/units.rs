//! Units that people see, and numbers as people read them. Inside, everything is SI.

use std::f64::consts::PI;

/// A unit for tables, texts and sliders.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Unit {
    /// As it is written; empty for a pure number or a count.
    pub name: &'static str,
    /// How much SI one of it is.
    pub si: f64,
    /// How many of it make one of SI; not `1 / si` in the last bit.
    pub per_si: f64,
}

const fn unit(name: &'static str, si: f64, per_si: f64) -> Unit {
    Unit { name, si, per_si }
}

const fn si(name: &'static str) -> Unit {
    unit(name, 1.0, 1.0)
}

/// A pure number.
pub const ONE: Unit = si("");
/// A part of critical damping.
pub const OF_CRITICAL: Unit = si("of critical");
pub const PERCENT: Unit = unit("%", 0.01, 100.0);

pub const SECOND: Unit = si("s");
pub const METRE: Unit = si("m");
pub const SQUARE_METRE: Unit = si("m^2");
pub const RADIAN: Unit = si("rad");
pub const METRE_PER_SECOND: Unit = si("m/s");
pub const NEWTON: Unit = si("N");
pub const NEWTON_METRE: Unit = si("N m");
pub const NEWTON_SECOND: Unit = si("N s");
pub const NEWTON_PER_SECOND: Unit = si("N/s");
pub const JOULE: Unit = si("J");
pub const KILOGRAM: Unit = si("kg");
pub const PASCAL: Unit = si("Pa");

pub const JOULE_PER_SQUARE_METRE: Unit = si("J/m^2");
pub const PASCAL_PER_METRE: Unit = si("Pa/m");

pub const KILOPASCAL: Unit = unit("kPa", 1e3, 1e-3);
pub const MEGAPASCAL: Unit = unit("MPa", 1e6, 1e-6);
pub const MILLIMETRE: Unit = unit("mm", 1e-3, 1e3);
pub const MILLIMETRE_PER_SECOND: Unit = unit("mm/s", 1e-3, 1e3);
pub const NEWTON_PER_MILLIMETRE: Unit = unit("N/mm", 1e3, 1e-3);
pub const SQUARE_MILLIMETRE: Unit = unit("mm2", 1e-6, 1e6);
pub const CUBIC_MILLIMETRE: Unit = unit("mm3", 1e-9, 1e9);
pub const MILLIJOULE: Unit = unit("mJ", 1e-3, 1e3);
pub const MILLIGRAM: Unit = unit("mg", 1e-6, 1e6);
pub const DEGREE: Unit = unit("deg", PI / 180.0, 180.0 / PI);
/// Of the root of a jerk squared, summed over time.
pub const SMOOTHNESS: Unit = unit("mm/s2.5", 1e-3, 1e3);

impl Unit {
    /// A value in SI in this unit.
    pub const fn show(&self, value: f64) -> f64 {
        value * self.per_si
    }

    /// A value in this unit in SI.
    pub const fn read(&self, value: f64) -> f64 {
        value * self.si
    }

    /// The name, or a dash where there is none.
    pub const fn word(&self) -> &'static str {
        if self.name.is_empty() { "-" } else { self.name }
    }
}

/// Year, month, day, hour, minute and second of a moment in seconds since 1970-01-01, UTC.
pub fn calendar(seconds: u64) -> [u64; 6] {
    let (days, rest) = (seconds / 86_400, seconds % 86_400);
    // Years that begin on 1 March end with the leap day; 719468 days lie between 0000-03-01 and 1970-01-01.
    let days = days + 719_468;
    let (era, day_of_era) = (days / 146_097, days % 146_097);
    let year = (day_of_era - day_of_era / 1460 + day_of_era / 36_524 - day_of_era / 146_096) / 365;
    let day_of_year = day_of_era - (365 * year + year / 4 - year / 100);
    let month_from_march = (5 * day_of_year + 2) / 153;
    let day = day_of_year - (153 * month_from_march + 2) / 5 + 1;
    let month = if month_from_march < 10 { month_from_march + 3 } else { month_from_march - 9 };
    let year = year + 400 * era + u64::from(month <= 2);
    [year, month, day, rest / 3600, rest / 60 % 60, rest % 60]
}

/// Rounded to so many significant digits.
pub fn significant(value: f64, digits: usize) -> f64 {
    format!("{value:.*e}", digits - 1).parse().unwrap_or(value)
}

/// Rounded to four significant digits.
pub fn four_digits(value: f64) -> f64 {
    significant(value, 4)
}

/// Rounded to so many decimals.
pub fn rounded(value: f64, decimals: i32) -> f64 {
    let scale = 10f64.powi(decimals);
    (value * scale).round() / scale
}

/// Nine significant digits, trailing zeros left away; an exponent where the plain form would be long.
pub fn number(value: f64) -> String {
    if value == 0.0 || !value.is_finite() {
        return if value == 0.0 { "0".into() } else { value.to_string() };
    }
    let rounded = significant(value, 9);
    if (1e-4..1e9).contains(&rounded.abs()) { format!("{rounded}") } else { format!("{rounded:e}") }
}

/// So many significant digits, trailing zeros left away; an exponent where the plain form would be long.
pub fn digits(value: f64, count: usize) -> String {
    // Adding zero turns -0 into 0.
    let rounded = significant(value, count) + 0.0;
    if rounded != 0.0 && !(1e-4..1e7).contains(&rounded.abs()) { format!("{rounded:e}") } else { rounded.to_string() }
}

/// Four significant digits, without an exponent where it can do without. Below a millionth of its unit it is rounding.
pub fn short(value: f64) -> String {
    if value.abs() < 1e-6 {
        return "0".into();
    }
    if !value.is_finite() || !(1e-4..1e7).contains(&value.abs()) {
        return format!("{value:.3e}");
    }
    without_zeros(decimals_for(value, 4, usize::MAX))
}

/// At most three significant digits, no trailing zeros, never an exponent.
pub fn three_digits(value: f64) -> String {
    if value == 0.0 || !value.is_finite() {
        return format!("{value}");
    }
    without_zeros(decimals_for(value, 3, 12))
}

/// Three significant digits with their zeros, never an exponent; a dash where it is no number.
pub fn three_decimals(value: f64) -> String {
    if value == 0.0 || !value.is_finite() {
        return if value == 0.0 { "0".into() } else { "-".into() };
    }
    decimals_for(value, 3, 9)
}

/// At most six decimals, no trailing zeros.
pub fn trimmed(value: f64) -> String {
    let text = without_zeros(format!("{value:.6}"));
    if text == "-0" { "0".into() } else { text }
}

/// As many decimals as so many significant digits need, at most `most`; whole numbers are not rounded.
fn decimals_for(value: f64, digits: i32, most: usize) -> String {
    let decimals = (digits - 1 - value.abs().log10().floor() as i32).max(0) as usize;
    format!("{value:.*}", decimals.min(most))
}

/// Without zeros behind the point, and without a point that ends the text.
fn without_zeros(text: String) -> String {
    if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.').into() } else { text }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_have_nine_significant_digits() {
        assert_eq!(number(0.0), "0");
        assert_eq!(number(-0.0), "0");
        assert_eq!(number(1.0 / 3.0), "0.333333333");
        assert_eq!(number(-12345.678912345), "-12345.6789");
        assert_eq!(number(1.234567894e-7), "1.23456789e-7");
        assert_eq!(number(2.5e12), "2.5e12");
        assert_eq!(number(f64::NAN), "NaN");
        assert_eq!(number(f64::INFINITY), "inf");
    }

    #[test]
    fn numbers_for_people() {
        let labels = [0.6, 0.0, 12.34, 2.5, 1000.0, 0.375].map(three_digits);
        assert_eq!(labels, ["0.6", "0", "12.3", "2.5", "1000", "0.375"]);
        let shorts = [0.0, 1.0, 12.3456, 0.00123456, 98765.4, 2e-5, -2e-9, f64::NAN].map(short);
        assert_eq!(shorts, ["0", "1", "12.35", "0.001235", "98765", "2.000e-5", "0", "NaN"]);
        assert_eq!([0.0, 1.5, 12.34, 1234.0, f64::NAN].map(three_decimals), ["0", "1.50", "12.3", "1234", "-"]);
        assert_eq!([0.0, -1e-9, 0.25, 1200.0, f64::NAN].map(trimmed), ["0", "0", "0.25", "1200", "NaN"]);
        assert_eq!([0.0, -0.0, 0.123456, 1e-5, 2e7].map(|x| digits(x, 3)), ["0", "0", "0.123", "1e-5", "2e7"]);
        assert_eq!([four_digits(0.123456), four_digits(123456.0)], [0.1235, 123500.0]);
        assert_eq!([rounded(0.12346, 4), rounded(-1.26, 1)], [0.1235, -1.3]);
    }

    #[test]
    fn units_go_there_and_back() {
        for unit in [ONE, PERCENT, KILOPASCAL, MEGAPASCAL, MILLIMETRE, CUBIC_MILLIMETRE, MILLIGRAM, DEGREE, SMOOTHNESS]
        {
            assert!((unit.read(unit.show(0.3)) - 0.3).abs() < 1e-15, "{unit:?}");
        }
        assert_eq!((MILLIMETRE.show(2e-3), ONE.word()), (2.0, "-"));
    }
}
