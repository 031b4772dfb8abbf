//! Published needle experiments: what was measured, what is known of tissue and needle, and what the theory of [`crate::penetration`]
//! says of them with nothing calibrated.
//!
//! [`file`] reads the experiments from TOML and checks them, [`theory`] evaluates one of them at its best inputs and at all corners of their
//! ranges, [`rows`] puts measurements beside and counts. The page is `src/output/report/predictions`.

#![warn(missing_docs)]

pub mod file;
pub mod rows;
pub mod theory;

use std::sync::LazyLock;

use schemars::JsonSchema;
use serde::Deserialize;

pub use rows::{Row, Totals, rows};
pub use theory::Prediction;

/// Where the experiments of the repository stand.
pub const FILE: &str = "assets/predictions.toml";

/// The experiments of the repository, which are built in.
pub fn built_in() -> &'static [Experiment] {
    static EXPERIMENTS: LazyLock<Vec<Experiment>> = LazyLock::new(|| {
        file::parse(std::path::Path::new(FILE), include_str!("../../assets/predictions.toml"))
            .unwrap_or_else(|text| panic!("{FILE} is part of the program and tested:\n{text}"))
    });
    &EXPERIMENTS
}

/// One experiment.
#[derive(Debug, Clone, PartialEq)]
pub struct Experiment {
    /// Short name, its own in the file.
    pub id: String,
    /// Authors of the experiment.
    pub authors: String,
    /// Year of publication.
    pub year: u16,
    /// Title, where there is no DOI; else empty.
    pub title: String,
    /// DOI, without `https://doi.org/`; empty where it is not known.
    pub doi: String,
    /// What was pierced.
    pub tissue: String,
    /// The needle in words.
    pub needle: String,
    /// What was measured.
    pub quantity: Quantity,
    /// The measured value with its scatter [unit of the quantity].
    pub measured: Input,
    /// Form of the tip.
    pub tip: Tip,
    /// What the theory needs, in the order of [`Variable::ALL`] [SI]; `None`: not written.
    pub inputs: [Option<Input>; Variable::COUNT],
    /// What the theory does not cover here.
    pub uncovered: Vec<Gap>,
    /// What is to be said of the result.
    pub note: String,
}

impl Experiment {
    /// An input, where it is written.
    pub fn input(&self, variable: Variable) -> Option<&Input> {
        self.inputs[variable as usize].as_ref()
    }

    /// Inputs that are written, with their names.
    pub fn written(&self) -> impl Iterator<Item = (Variable, &Input)> {
        Variable::ALL.into_iter().filter_map(|variable| Some((variable, self.input(variable)?)))
    }

    /// Whether the row counts: nothing in it is without a source that somebody has read.
    pub fn counts(&self) -> bool {
        let read = |input: &Input| input.origin != Origin::Unverified;
        read(&self.measured) && self.written().all(|(_, input)| read(input))
    }

    /// Whether no input is assumed: what it follows from has a source, if another one than the measurement.
    pub fn is_sourced(&self) -> bool {
        self.counts() && self.written().all(|(_, input)| input.origin != Origin::Assumed)
    }
}

/// A number with its range and its origin.
#[derive(Debug, Clone, PartialEq)]
pub struct Input {
    /// Low, best, high.
    pub values: [f64; 3],
    /// Where it comes from.
    pub origin: Origin,
    /// The same in words.
    pub source: String,
}

impl Input {
    /// Whether it has a range.
    pub fn varies(&self) -> bool {
        self.values[0] < self.values[2]
    }
}

/// Where a number comes from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Origin {
    /// Read in the text of the experiment itself.
    Source,
    /// Read in another text that cites it.
    Cited,
    /// Of the same kind of tissue, read in the text of somebody else.
    Borrowed,
    /// No text was at hand: a wide range.
    Assumed,
    /// Not read by anybody here.
    Unverified,
}

impl Origin {
    /// The word of the file.
    pub fn word(self) -> &'static str {
        match self {
            Origin::Source => "source",
            Origin::Cited => "cited",
            Origin::Borrowed => "borrowed",
            Origin::Assumed => "assumed",
            Origin::Unverified => "unverified",
        }
    }
}

/// What was measured.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Quantity {
    /// Force at a depth of the tip, or the largest up to it [N].
    ForceAtDepth,
    /// Steady force of the tip alone [N].
    TipForce,
    /// Force at which the surface gives way [N].
    PunctureForce,
    /// Growth of the force with depth [N/mm].
    Slope,
    /// Pressure of the tissue on the shaft [kPa].
    WallPressure,
    /// Steady force of the tip over the section of the needle [kPa].
    SectionPressure,
    /// Length 2a of the slit at rest [mm].
    SlitLength,
    /// Difference of two insertions into one hole, over the diameter 2R [J/m^2].
    DoubleInsertion,
}

impl Quantity {
    /// In words.
    pub fn name(self) -> &'static str {
        match self {
            Quantity::ForceAtDepth => "force at depth",
            Quantity::TipForce => "steady tip force",
            Quantity::PunctureForce => "puncture force",
            Quantity::Slope => "slope of the force",
            Quantity::WallPressure => "pressure on the shaft",
            Quantity::SectionPressure => "tip force over section",
            Quantity::SlitLength => "length of the slit",
            Quantity::DoubleInsertion => "difference of two insertions over 2R",
        }
    }

    /// Unit, and its size in SI.
    pub fn unit(self) -> (&'static str, f64) {
        match self {
            Quantity::ForceAtDepth | Quantity::TipForce | Quantity::PunctureForce => ("N", 1.0),
            Quantity::Slope => ("N/mm", 1e3),
            Quantity::WallPressure | Quantity::SectionPressure => ("kPa", 1e3),
            Quantity::SlitLength => ("mm", 1e-3),
            Quantity::DoubleInsertion => ("J/m^2", 1.0),
        }
    }

    /// The formula in words.
    pub fn formula(self) -> &'static str {
        match self {
            Quantity::ForceAtDepth => "F_tip + mu_f N (depth - length of the tip)",
            Quantity::TipForce => "F_tip = min over a of [U(a, R) + 2 a J_c]",
            Quantity::PunctureForce => "(n + 1) F_tip, n = 2 for a cone or a bevel, 1 for a flat end",
            Quantity::Slope => "mu_f N",
            Quantity::WallPressure => "N / (2 pi R)",
            Quantity::SectionPressure => "F_tip / (pi R^2)",
            Quantity::SlitLength => "2 a",
            Quantity::DoubleInsertion => "2 a J_c / (2 R): only the first insertion cuts",
        }
    }
}

/// Form of the tip.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Tip {
    /// A solid cone: a slit.
    Cone,
    /// A bevel, solid or hollow: a slit.
    Bevel,
    /// A flat or hollow end that is not sharp: a ring.
    Blunt,
}

/// An input of the theory.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Variable {
    /// Outer radius R [m].
    Radius,
    /// Half angle of a cone, or angle between a bevel and the axis [rad].
    HalfAngle,
    /// Depth of the tip [m].
    Depth,
    /// Shear modulus at rest [Pa].
    ShearModulus,
    /// Exponent of Ogden's law with one term; without it the law is neo-Hooke.
    OgdenAlpha,
    /// Toughness J_c of a slit of width 2a [J/m^2].
    Toughness,
    /// Stretch at which the tissue tears.
    TearStretch,
    /// Coefficient of friction on the shaft.
    Friction,
}

impl Variable {
    /// How many there are.
    pub const COUNT: usize = 8;

    /// All of them.
    pub const ALL: [Variable; Variable::COUNT] = [
        Variable::Radius,
        Variable::HalfAngle,
        Variable::Depth,
        Variable::ShearModulus,
        Variable::OgdenAlpha,
        Variable::Toughness,
        Variable::TearStretch,
        Variable::Friction,
    ];

    /// In words.
    pub fn name(self) -> &'static str {
        match self {
            Variable::Radius => "radius",
            Variable::HalfAngle => "half angle of the tip",
            Variable::Depth => "depth",
            Variable::ShearModulus => "shear modulus",
            Variable::OgdenAlpha => "Ogden's alpha",
            Variable::Toughness => "toughness",
            Variable::TearStretch => "tear stretch",
            Variable::Friction => "friction",
        }
    }

    /// Unit for people, and its size in SI.
    pub fn unit(self) -> (&'static str, f64) {
        match self {
            Variable::Radius | Variable::Depth => ("mm", 1e-3),
            Variable::HalfAngle => ("degrees", std::f64::consts::PI / 180.0),
            Variable::ShearModulus => ("kPa", 1e3),
            Variable::Toughness => ("J/m^2", 1.0),
            Variable::OgdenAlpha | Variable::TearStretch | Variable::Friction => ("", 1.0),
        }
    }
}

/// What the theory does not cover in an experiment.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Gap {
    /// Speed: the theory has one number for all of them.
    Rate,
    /// Tissue that tears before the wall of the slit is stretched that far.
    Tear,
    /// Permanent flow beside the needle.
    Plastic,
    /// A gel whose water leaves the loaded zone.
    GelBleeds,
    /// Tissue inside a hollow needle.
    HollowCore,
    /// No toughness of this tissue under needles is known.
    UnknownToughness,
    /// Toughness over the diameter, taken for that over the slit.
    #[serde(rename = "toughness_over_2r")]
    ToughnessOver2R,
    /// Stiffening with stretch that is not known as a number.
    Stiffening,
    /// Several tissues on the path.
    Layers,
    /// A skin on the sample, or none: not clear.
    Skin,
}

impl Gap {
    /// In words.
    pub fn words(self) -> &'static str {
        match self {
            Gap::Rate => "speed",
            Gap::Tear => "tissue that tears before",
            Gap::Plastic => "permanent flow",
            Gap::GelBleeds => "a gel that bleeds and relaxes",
            Gap::HollowCore => "the core of a hollow needle",
            Gap::UnknownToughness => "toughness under needles not known",
            Gap::ToughnessOver2R => "toughness over 2R taken for that over 2a: too small",
            Gap::Stiffening => "stiffening with stretch",
            Gap::Layers => "layers",
            Gap::Skin => "perhaps a skin on the sample",
        }
    }
}
