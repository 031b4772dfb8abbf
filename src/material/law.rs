//! The table of elastic laws: what the program knows about a law beside its formulas.
//!
//! Each file of a law holds its entry `LAW`; the line of the law in `laws!` (`src/material/mod.rs`) makes of it a variant of
//! [`Isochoric`](super::Isochoric), a word of scenes and the command line, and a place in [`LAWS`](super::LAWS), which is its number in
//! the shaders. A law of the invariants implements [`InvariantLaw`](super::InvariantLaw), one of the principal stretches [`IsochoricLaw`].

use glam::DMat3;

use super::regular::{Exponential, Polynomial};
use super::stretches::Powers;
use super::{Continuation, Isochoric, LAWS, Mode, TangentBound};

/// Most constants of a law: the lanes of `Material.constants` in the shaders.
pub const MOST_CONSTANTS: usize = 4;

/// Constants of a law in the order of its table, in SI units; zeros behind them.
pub type Constants = [f64; MOST_CONSTANTS];

/// What the program knows about a law.
#[derive(Debug, Clone, Copy)]
pub struct Law {
    /// Word in scenes and on the command line, and stem of both its files.
    pub key: &'static str,
    /// Name in charts.
    pub name: &'static str,
    /// W_iso, with `e = I1bar - 3`.
    pub energy: &'static str,
    /// Key of its source in `docs/references.md`.
    pub source: &'static str,
    /// What its file of the shaders provides.
    pub form: Form,
    /// At most [`MOST_CONSTANTS`]. The first is a stress, to which the shear modulus at rest is proportional.
    pub constants: &'static [Constant],
    /// Where it is stable for every deformation.
    pub stable: &'static str,
    /// The same as a way out of a refusal.
    pub way_out: &'static str,
    /// The law with these constants.
    pub build: fn(Constants) -> Isochoric,
    /// Stable constants of the size of soft tissue [SI], for tests of every law.
    pub example: Constants,
    /// How a fit finds its constants.
    pub search: Search,
    /// In charts: colours that people with colour-blindness tell apart (Okabe and Ito 2008).
    pub colour: [u8; 3],
}

/// What a law is a function of, and so the functions that its file of the shaders provides.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Form {
    /// `I1bar`, `I2bar`: `<key>_slopes(c, i1)`, `<key>_energy(c, i1, i2)`.
    Invariants,
    /// Principal stretches: `<key>_stress(c, H)`, `<key>_energy(c, H, dj)`.
    Stretches,
}

/// One constant of a law.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Constant {
    /// Key in a scene; with its unit, if it has one.
    pub key: &'static str,
    /// SI units in one unit of the key.
    pub si: f64,
    /// What it is, where its letter does not say it; empty else.
    pub what: &'static str,
    /// Largest size that a scene may write, in units of the key.
    pub largest: f64,
    /// True where the command line may leave it away for 0.
    pub or_zero: bool,
}

impl Constant {
    /// A stress in kPa.
    pub const fn stress(key: &'static str, what: &'static str) -> Self {
        Constant { key, si: 1e3, what, largest: 1e6, or_zero: false }
    }

    /// A number without a unit.
    pub const fn number(key: &'static str, what: &'static str, largest: f64) -> Self {
        Constant { key, si: 1.0, what, largest, or_zero: false }
    }

    pub const fn or_zero(self) -> Self {
        Constant { or_zero: true, ..self }
    }

    /// True for a stress, false for a number without a unit.
    pub fn is_stress(&self) -> bool {
        self.si != 1.0
    }

    /// A value in SI units in those of the key.
    pub fn shown(&self, value: f64) -> f64 {
        value * (1.0 / self.si)
    }
}

/// How a fit finds the constants of a law.
#[derive(Debug, Clone, Copy)]
pub enum Search {
    /// It is linear in all of them, and stable where none is negative.
    Linear,
    /// It is `mu f(exponent)` with two constants: exponents from which the search starts, between two of which the error has at
    /// most one valley in all cases tried; and those at the edge of stability.
    Exponent { starts: &'static [f64], edges: &'static [f64] },
}

impl Law {
    /// The law with the constants that `value` tells for their keys, in the units of those.
    pub fn with(&self, value: impl Fn(&'static str) -> f64) -> Isochoric {
        let mut constants = [0.0; MOST_CONSTANTS];
        for (si, constant) in constants.iter_mut().zip(self.constants) {
            *si = value(constant.key) * constant.si;
        }
        (self.build)(constants)
    }

    /// Keys of its constants.
    pub fn keys(&self) -> Vec<&'static str> {
        self.constants.iter().map(|constant| constant.key).collect()
    }

    /// Shear modulus at rest over its first constant.
    pub fn shear_of_first(&self) -> f64 {
        let mut constants = [0.0; MOST_CONSTANTS];
        constants[0] = 1.0;
        (self.build)(constants).shear_modulus()
    }
}

/// The constants of all laws, each key once, in the order of the table.
pub fn constants() -> Vec<&'static Constant> {
    let mut all: Vec<&Constant> = Vec::new();
    for constant in LAWS.iter().flat_map(|law| law.constants) {
        if !all.iter().any(|known| known.key == constant.key) {
            all.push(constant);
        }
    }
    all
}

/// The laws that have a constant of this key.
pub fn owners(key: &str) -> impl Iterator<Item = &'static Law> {
    LAWS.iter().filter(move |law| law.constants.iter().any(|constant| constant.key == key))
}

/// The isochoric part of a law in f64; laws of the invariants have it from [`InvariantLaw`](super::InvariantLaw).
pub trait IsochoricLaw {
    /// W_iso for H = F - I [J/m^3].
    fn isochoric_energy(&self, h: DMat3) -> f64;
    /// P_iso for H = F - I [Pa].
    fn isochoric_stress(&self, h: DMat3) -> DMat3;
    /// Bound of the isochoric tangent modulus for H = F - I, beside this bulk modulus [Pa].
    fn tangent_bound(&self, h: DMat3, bulk_modulus: f64) -> TangentBound;
    /// Where it is continued, for H = F - I.
    fn continuation(&self, h: DMat3) -> Option<Continuation>;
    /// Its constants where it is a polynomial of the invariants.
    fn polynomial(&self) -> Option<Polynomial> {
        None
    }
    /// Its constants where it is an exponential of `I1bar`.
    fn exponential(&self) -> Option<Exponential<f64>> {
        None
    }
    /// Its constants where it is a sum of powers of the stretches.
    fn powers(&self) -> Option<Powers<f64>> {
        None
    }
    /// Nominal stress of an incompressible sample at the stretch, or amount of shear, `x` [Pa].
    fn nominal_stress(&self, mode: Mode, x: f64) -> f64;
}

/// Makes of one line per law the enums of laws and their table, in this order.
macro_rules! laws {
    ($($stem:ident::$Law:ident),+ $(,)?) => {
        $(pub use $stem::$Law;)+

        /// The isochoric part of a law.
        #[derive(Debug, Clone, Copy, PartialEq)]
        pub enum Isochoric {
            $($Law($Law)),+
        }

        /// Names of the elastic laws.
        #[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Deserialize, schemars::JsonSchema)]
        #[serde(rename_all = "snake_case")]
        pub enum LawWord {
            $($Law),+
        }

        impl LawWord {
            /// All names, in the order of [`LAWS`].
            pub const ALL: [LawWord; [$(LawWord::$Law),+].len()] = [$(LawWord::$Law),+];
        }

        /// All elastic laws. The place of a law is its number in the shaders.
        pub static LAWS: [Law; LawWord::ALL.len()] = [$($stem::LAW),+];

        impl Isochoric {
            /// The name of the law.
            pub fn word(&self) -> LawWord {
                match self {
                    $(Isochoric::$Law(_) => LawWord::$Law),+
                }
            }

            /// Its constants in SI units.
            pub fn values(&self) -> Constants {
                match self {
                    $(Isochoric::$Law(l) => l.values()),+
                }
            }

            /// Ground-state shear modulus mu0 [Pa].
            pub fn shear_modulus(&self) -> f64 {
                match self {
                    $(Isochoric::$Law(l) => l.shear_modulus()),+
                }
            }

            pub fn verdict(&self) -> Verdict {
                match self {
                    $(Isochoric::$Law(l) => l.verdict()),+
                }
            }
        }

        // By `match`, not by a pointer: these are the innermost calls of the f64 engine.
        impl IsochoricLaw for Isochoric {
            fn isochoric_energy(&self, h: DMat3) -> f64 {
                match self {
                    $(Isochoric::$Law(l) => l.isochoric_energy(h)),+
                }
            }

            fn isochoric_stress(&self, h: DMat3) -> DMat3 {
                match self {
                    $(Isochoric::$Law(l) => l.isochoric_stress(h)),+
                }
            }

            fn tangent_bound(&self, h: DMat3, bulk_modulus: f64) -> TangentBound {
                match self {
                    $(Isochoric::$Law(l) => l.tangent_bound(h, bulk_modulus)),+
                }
            }

            fn continuation(&self, h: DMat3) -> Option<Continuation> {
                match self {
                    $(Isochoric::$Law(l) => l.continuation(h)),+
                }
            }

            fn polynomial(&self) -> Option<Polynomial> {
                match self {
                    $(Isochoric::$Law(l) => IsochoricLaw::polynomial(l)),+
                }
            }

            fn exponential(&self) -> Option<Exponential<f64>> {
                match self {
                    $(Isochoric::$Law(l) => IsochoricLaw::exponential(l)),+
                }
            }

            fn powers(&self) -> Option<Powers<f64>> {
                match self {
                    $(Isochoric::$Law(l) => IsochoricLaw::powers(l)),+
                }
            }

            fn nominal_stress(&self, mode: Mode, x: f64) -> f64 {
                match self {
                    $(Isochoric::$Law(l) => l.nominal_stress(mode, x)),+
                }
            }
        }
    };
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::material::Verdict;

    #[test]
    fn the_table_agrees_with_itself_and_with_the_code_of_every_law() {
        for (number, law) in LAWS.iter().enumerate() {
            let key = law.key;
            assert_eq!(LAWS.iter().position(|other| other.key == key), Some(number), "{key} stands there twice");
            let built = (law.build)(law.example);
            assert_eq!(built.key(), key);
            assert_eq!(built.values(), law.example, "{key}");
            assert_eq!(built.verdict(), Verdict::Stable, "{key}");
            assert!((1..=MOST_CONSTANTS).contains(&law.constants.len()), "{key}");
            assert!(law.example[law.constants.len()..].iter().all(|c| *c == 0.0), "{key}");
            let difference = law.shear_of_first() * law.example[0] / built.shear_modulus() - 1.0;
            // The Mooney-Rivlin law has a second constant that is a stress at rest.
            assert!(
                difference.abs() < 1e-12 || key == "mooney_rivlin",
                "{key}: the first constant is no modulus at rest"
            );
            for constant in law.constants {
                let known = constants().into_iter().find(|c| c.key == constant.key).unwrap();
                assert_eq!(Constant { or_zero: false, ..*constant }, Constant { or_zero: false, ..*known }, "{key}");
            }
        }
    }
}
