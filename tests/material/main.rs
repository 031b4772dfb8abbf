//! Elastic laws against their energies and closed forms, their verdicts against the acoustic tensor, and fits.

mod curves;
mod files;
mod fitting;
mod laws;
mod waves;

use glam::{DMat3, DQuat, DVec3};
use stylet::material::{Demiray, Isochoric, LAWS, MooneyRivlin, NeoHookean, Ogden, Yeoh};

pub fn neo_hookean(c10: f64) -> Isochoric {
    Isochoric::NeoHookean(NeoHookean { c10 })
}

pub fn mooney_rivlin(c10: f64, c01: f64) -> Isochoric {
    Isochoric::MooneyRivlin(MooneyRivlin { c10, c01 })
}

pub fn yeoh(c10: f64, c20: f64, c30: f64) -> Isochoric {
    Isochoric::Yeoh(Yeoh { c10, c20, c30 })
}

pub fn ogden(mu: f64, alpha: f64) -> Isochoric {
    Isochoric::Ogden(Ogden { mu, alpha })
}

pub fn demiray(mu: f64, b: f64) -> Isochoric {
    Isochoric::Demiray(Demiray { mu, b })
}

/// Every law of the table with its own example, and more of the size of soft tissue.
pub fn all_laws() -> Vec<Isochoric> {
    let more = [
        mooney_rivlin(2300.0, 1000.0),
        mooney_rivlin(-1000.0, 4000.0),
        yeoh(2000.0, 900.0, 300.0),
        yeoh(2000.0, -300.0, 40.0),
        ogden(6000.0, 4.0),
        ogden(6000.0, -3.0),
        ogden(6000.0, 0.5),
        demiray(1170.0, 6.84),
        demiray(5000.0, 0.5),
    ];
    LAWS.iter().map(|law| (law.build)(law.example)).chain(more).collect()
}

/// A small generator with a fixed sequence (xorshift64*).
pub struct Random(u64);

impl Random {
    pub fn new(seed: u64) -> Self {
        Random(seed.wrapping_mul(0x9e37_79b9_7f4a_7c15) | 1)
    }

    /// Uniform in [low, high).
    pub fn between(&mut self, low: f64, high: f64) -> f64 {
        self.0 ^= self.0 >> 12;
        self.0 ^= self.0 << 25;
        self.0 ^= self.0 >> 27;
        let unit = (self.0.wrapping_mul(0x2545_f491_4f6c_dd1d) >> 11) as f64 / (1_u64 << 53) as f64;
        low + (high - low) * unit
    }

    /// Standard normal.
    pub fn normal(&mut self) -> f64 {
        (-2.0 * (1.0 - self.between(0.0, 1.0)).ln()).sqrt() * self.between(0.0, std::f64::consts::TAU).cos()
    }

    pub fn direction(&mut self) -> DVec3 {
        DVec3::new(self.normal(), self.normal(), self.normal()).normalize()
    }

    pub fn rotation(&mut self) -> DMat3 {
        DMat3::from_quat(DQuat::from_axis_angle(self.direction(), self.between(0.0, std::f64::consts::TAU)))
    }

    /// F with these principal stretches in random directions.
    pub fn with_stretches(&mut self, stretches: [f64; 3]) -> DMat3 {
        self.rotation() * DMat3::from_diagonal(DVec3::from(stretches)) * self.rotation()
    }

    /// Stretches between 0.4 and 2.5 whose product lies in the range.
    pub fn stretches(&mut self, jacobian: (f64, f64)) -> [f64; 3] {
        loop {
            let l: [f64; 3] = std::array::from_fn(|_| self.between(0.4_f64.ln(), 2.5_f64.ln()).exp());
            let scale = (self.between(jacobian.0, jacobian.1) / l.iter().product::<f64>()).cbrt();
            let l = l.map(|l| l * scale);
            if l.iter().all(|l| (0.4..2.5).contains(l)) {
                return l;
            }
        }
    }
}

pub fn largest_entry(a: DMat3) -> f64 {
    a.to_cols_array().iter().map(|v| v.abs()).fold(0.0, f64::max)
}

/// The message of an error that must come.
pub fn refusal<T>(result: stylet::Result<T>) -> String {
    match result {
        Ok(_) => panic!("accepted, but it is wrong"),
        Err(error) => {
            assert_eq!(error.exit_code(), 2, "{error}");
            error.to_string()
        }
    }
}
