//! Elastic laws, one file each, and the verdict on their constants.

pub mod mooney_rivlin;

pub use mooney_rivlin::MooneyRivlin;

use mooney_rivlin::Verdict;

/// A number for a message: four significant digits, no trailing zeros.
pub fn four_digits(value: f64) -> f64 {
    format!("{value:.3e}").parse().unwrap_or(value)
}

/// The verdict on a tissue law in one or two sentences, with the moduli at rest.
pub fn describe_verdict(law: &MooneyRivlin) -> String {
    let kpa = |value: f64| four_digits(value * 1e-3);
    let constants = format!("c10 {} kPa, c01 {} kPa", kpa(law.c10), kpa(law.c01));
    let moduli = format!(
        "E {} kPa, nu {}, K {} kPa at rest",
        kpa(law.youngs_modulus()),
        four_digits(law.poisson_ratio()),
        kpa(law.bulk_modulus)
    );
    let limited = |side: &str, limit: f64| {
        format!("stable only while every principal stretch stays {side} {} ({constants}; {moduli})", four_digits(limit))
    };
    match law.verdict() {
        Verdict::Stable => format!("stable for every deformation ({constants}; {moduli})"),
        Verdict::StableBelow(limit) => limited("below", limit),
        Verdict::StableAbove(limit) => limited("above", limit),
        Verdict::Unstable if law.bulk_modulus <= 0.0 => {
            format!("unstable at rest: bulk modulus {} kPa is not positive ({constants})", kpa(law.bulk_modulus))
        }
        Verdict::Unstable => format!(
            "unstable at rest: c10 + c01 = {} kPa, shear modulus {} kPa is not positive ({constants})",
            kpa(law.c10 + law.c01),
            kpa(law.shear_modulus())
        ),
    }
}

/// Time in which a ripple of half wavelength `length` [m] grows by the factor e in an unstable tissue at rest [s]:
/// `length/pi * sqrt(rho / |mu0|)`; `None` where the shear modulus is not negative.
pub fn ripple_growth_time(law: &MooneyRivlin, density: f64, length: f64) -> Option<f64> {
    let shear = law.shear_modulus();
    (shear < 0.0).then(|| length / std::f64::consts::PI * (density / -shear).sqrt())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn law(c10: f64, c01: f64) -> MooneyRivlin {
        MooneyRivlin { c10: c10 * 1e3, c01: c01 * 1e3, bulk_modulus: 5.0e5 }
    }

    #[test]
    fn the_verdict_names_constants_and_limit() {
        assert!(describe_verdict(&law(2.3, 1.0)).starts_with("stable for every deformation (c10 2.3 kPa"));
        assert!(describe_verdict(&law(2.0, -1.0)).contains("below 1.414 "));
        assert!(describe_verdict(&law(-1.0, 4.0)).contains("above 0.5 "));
        assert!(describe_verdict(&law(4.75, -4.91)).contains("c10 + c01 = -0.16 kPa, shear modulus -0.32 kPa"));
    }

    #[test]
    fn the_printed_constants_grow_in_half_a_millisecond() {
        // An independent computation gives 0.46 ms for 0.8 mm, 1060 kg/m^3.
        let time = ripple_growth_time(&law(4.75, -4.91), 1060.0, 0.8e-3).unwrap();
        assert!((time - 0.46e-3).abs() < 0.01e-3);
        assert_eq!(ripple_growth_time(&law(2.3, 1.0), 1060.0, 0.8e-3), None);
    }
}
