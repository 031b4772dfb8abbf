//! Effects that are complete by themselves: what acts in a cell and needs the state of no other effect.
//!
//! Such an effect remembers a few numbers per cell, adds a stress of its own to that of the material and says what energy goes with it.
//! It is a value, [`OwnEffect`], with its law in f64 and in WGSL. A program that uses the library hands it in with the scene and changes
//! nothing of the library; the program's own ones stand in [`super::SELF_CONTAINED`]:
//!
//! ```text
//! P = (1 - d) w (P_material(F) + P_own(F, s)) + p cof F        [Pa]
//! s' = advance(F, s, dt), which supplies the work A            [J/m^3]
//! energy balance: what A supplied is stored in W_own(F, s) or has become motion
//! ```
//! with the remembered numbers `s`, the damage d and the stiffness w that a path has left. Own effects come last in a step, in the order
//! in which the scene lists them: they see the whole F, and damage of the same step weakens them.
//! The WGSL text defines four functions with the key in their names, for the effect `swelling`:
//!
//! ```text
//! fn swelling_advance(point: OwnPoint, memory: ptr<function, vec4<f32>>) -> f32
//! fn swelling_stress(point: OwnPoint, memory: vec4<f32>) -> mat3x3<f32>
//! fn swelling_energy(point: OwnPoint, memory: vec4<f32>) -> f32
//! fn swelling_tangent(point: OwnPoint, memory: vec4<f32>) -> f32
//! ```
//! `OwnPoint` is in `shaders/shared/own_effects.wgsl` and has the fields of [`Point`].

#![warn(missing_docs)]

use glam::DMat3;
use serde::{Deserialize, Serialize};

use super::Effect;
use crate::units::four_digits;

/// Most own effects of a scene, and most numbers of each of them.
pub const LARGEST_COUNT: usize = 4;
/// Most numbers of one of them.
pub const LARGEST_NUMBER_COUNT: usize = 8;

/// What an effect remembers of a cell: four numbers, zero at rest.
pub type Memory = [f64; 4];

/// A number of an own effect: a key of the table `[<key of the effect>]` in a scene file, and of that table in a region.
#[derive(Debug, Clone, Copy)]
pub struct Number {
    /// Key in the table; its end tells the unit.
    pub key: &'static str,
    /// What one unit of the key is in SI.
    pub unit: f64,
    /// In the unit of the key.
    pub default: f64,
    /// What is accepted, in the unit of the key.
    pub range: [f64; 2],
    /// What it means, one line.
    pub text: &'static str,
}

/// A material point in a step.
#[derive(Debug, Clone, Copy)]
pub struct Point<'a> {
    /// H = F - I.
    pub h: DMat3,
    /// Values of [`OwnEffect::numbers`] in SI, in their order.
    pub numbers: &'a [f64],
    /// Of the material at rest [Pa].
    pub bulk_modulus: f64,
    /// Of the material at rest [Pa].
    pub shear_modulus: f64,
    /// Time step [s]; zero where nothing is brought forward.
    pub dt: f64,
}

/// The law in f64: the reference that the WGSL is compared with.
#[derive(Debug, Clone, Copy)]
pub struct Law {
    /// Brings the memory from one step to the next; returns the work that this supplies to the tissue at this strain, per rest volume
    /// [J/m^3], negative where it takes some: `W(F, s') - W(F, s)`. It is asked twice in a step, for the way that ends there and for
    /// the one that begins, so that the account is of second order in the step.
    pub advance: fn(&Point, &mut Memory) -> f64,
    /// First Piola-Kirchhoff stress beside that of the material [Pa].
    pub stress: fn(&Point, &Memory) -> DMat3,
    /// Energy whose derivative by F this stress is, per rest volume [J/m^3].
    pub energy: fn(&Point, &Memory) -> f64,
    /// Bound of what it adds to the tangent modulus, for the stable step [Pa].
    pub tangent: fn(&Point, &Memory) -> f64,
}

/// An effect that is complete by itself.
#[derive(Debug, Clone, Copy)]
pub struct OwnEffect {
    /// Its entry: `key` is its word in the list `effects`, its table and the stem of its functions; its kind is
    /// [`super::Kind::Constitutive`].
    pub effect: Effect,
    /// Column of `energy.csv` for what it has supplied [J], e.g. `swelling_j`.
    pub column: &'static str,
    /// Keys of its table; [`Point::numbers`] has their values in this order.
    pub numbers: &'static [Number],
    /// What it does in a cell, in f64.
    pub law: Law,
    /// The functions in WGSL.
    pub shader: &'static str,
}

impl PartialEq for OwnEffect {
    /// The same where the keys are.
    fn eq(&self, other: &Self) -> bool {
        self.effect.key == other.effect.key
    }
}

/// An own effect that is on, with its numbers in SI.
#[derive(Debug, Clone, PartialEq)]
pub struct Chosen {
    /// What acts.
    pub effect: &'static OwnEffect,
    /// In SI, in the order of [`OwnEffect::numbers`].
    pub numbers: Vec<f64>,
}

/// What a cell remembers of one effect.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct State {
    /// Brought forward by [`Law::advance`].
    pub memory: Memory,
    /// Work that was supplied since it was last told, weighted with the stiffness that was left [J/m^3].
    pub supplied: f64,
}

impl Chosen {
    /// Keys and values of all numbers, in the units of the keys.
    pub fn describe(&self) -> String {
        let pairs = self.effect.numbers.iter().zip(&self.numbers);
        let texts = pairs.map(|(number, value)| format!("{} {}", number.key, four_digits(value / number.unit)));
        texts.collect::<Vec<_>>().join(", ")
    }
}

impl OwnEffect {
    /// The effect with its default numbers.
    pub fn chosen(&'static self) -> Chosen {
        Chosen { effect: self, numbers: self.numbers.iter().map(|n| n.default * n.unit).collect() }
    }

    /// What must be mended before the effect can be used; `None`: nothing.
    pub fn flaw(&self) -> Option<String> {
        let key = self.effect.key;
        let is_name = |text: &str| {
            !text.is_empty()
                && text.chars().all(|c| c.is_ascii_lowercase() || c.is_ascii_digit() || c == '_')
                && text.starts_with(|c: char| c.is_ascii_lowercase())
        };
        if !is_name(key) {
            return Some(format!("the key `{key}` of an own effect must be a name of small letters, digits and _"));
        }
        let is_built_in = super::SELF_CONTAINED.contains(&self);
        if !is_built_in && super::EFFECTS.iter().any(|e| e.key == key) {
            return Some(format!("the own effect `{key}` has the key of a built-in one"));
        }
        if self.effect.kind != super::Kind::Constitutive {
            return Some(format!("the own effect `{key}` must be constitutive: it acts in a cell"));
        }
        if self.numbers.len() > LARGEST_NUMBER_COUNT {
            return Some(format!("the own effect `{key}` has more than {LARGEST_NUMBER_COUNT} numbers"));
        }
        ["advance", "stress", "energy", "tangent"]
            .into_iter()
            .map(|word| format!("fn {key}_{word}("))
            .find(|function| !self.shader.contains(function.as_str()))
            .map(|function| format!("the WGSL of the own effect `{key}` lacks `{function}...)`"))
    }
}
