//! The laws of the effects at one material point, in f64, against closed forms and energy balances.

mod combination;
mod damage;
mod fibres;
mod plasticity;
mod sample;
mod viscoelastic;

use std::path::Path;

use glam::{DMat3, DVec3};
use serde_json::Value;
use stylet::material::ElasticLaw;
use stylet::material_point::{Material, PointState, Surroundings};

/// Material A of the reference files.
const MATERIAL_A: ElasticLaw = ElasticLaw::mooney_rivlin(2300.0, 1000.0, 5.0e5);
/// The preset `across-fibre`, to which the defaults of the effects belong.
const ACROSS_FIBRE: ElasticLaw = ElasticLaw::mooney_rivlin(9520.0, 4140.0, 5.0e5);
/// Axes that are free in a uniaxial test along x.
const LATERAL: [usize; 2] = [1, 2];

/// A material without effects.
fn elastic(law: ElasticLaw) -> Material {
    Material::elastic(law, 1060.0)
}

/// H of a stretch along x; the lateral stretches are found.
fn stretched(stretch: f64) -> DMat3 {
    DMat3::from_diagonal(DVec3::new(stretch - 1.0, 0.0, 0.0))
}

/// H of simple shear.
fn sheared(amount: f64) -> DMat3 {
    DMat3::from_cols(DVec3::ZERO, DVec3::new(amount, 0.0, 0.0), DVec3::ZERO)
}

fn around(dt: f64, step: u64) -> Surroundings {
    Surroundings { length: 1e-3, dt, step, remaining: 1.0, other_energy: 0.0 }
}

/// Stress of an undamaged point.
fn stress(material: &Material, h: DMat3, state: &PointState) -> DMat3 {
    material.stress(h, material.volumetric(h, 1.0), 1.0, state)
}

fn reference(file: &str) -> Value {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/references").join(file);
    serde_json::from_str(&std::fs::read_to_string(path).unwrap()).unwrap()
}

fn numbers(value: &Value) -> Vec<f64> {
    value.as_array().unwrap().iter().map(|v| v.as_f64().unwrap()).collect()
}

fn number(value: &Value, key: &str) -> f64 {
    value[key].as_f64().unwrap()
}

fn matrix(value: &Value) -> DMat3 {
    let rows: Vec<DVec3> = value.as_array().unwrap().iter().map(|row| DVec3::from_slice(&numbers(row))).collect();
    DMat3::from_cols(rows[0], rows[1], rows[2]).transpose()
}

fn largest(a: DMat3) -> f64 {
    a.to_cols_array().iter().fold(0.0, |m: f64, v| m.max(v.abs()))
}

/// Uniform numbers (splitmix64).
struct Random(u64);

impl Random {
    /// In -1..1.
    fn signed(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^= z >> 31;
        (z >> 11) as f64 / (1u64 << 52) as f64 - 1.0
    }

    fn vector(&mut self) -> DVec3 {
        DVec3::new(self.signed(), self.signed(), self.signed())
    }

    fn tensor(&mut self) -> DMat3 {
        DMat3::from_cols(self.vector(), self.vector(), self.vector())
    }

    fn rotation(&mut self) -> DMat3 {
        DMat3::from_axis_angle(self.vector().normalize(), 3.0 * self.signed())
    }
}
