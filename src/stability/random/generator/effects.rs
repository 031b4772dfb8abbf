//! Tables of effects.

use std::fmt::Write as _;

use super::super::numbers::{Numbers, list, written};
use super::{Draft, Drawn};
use crate::effects::SELF_CONTAINED;

impl Draft {
    /// Tip forces; returns the puncture force [N].
    pub(super) fn puncture(&mut self, n: &mut Numbers, tame: bool, free: bool, diameter: f64, soft: &Drawn) -> f64 {
        // `free_motion` left a word for this table.
        let path = std::mem::take(&mut self.tables);
        let mut table = String::new();
        let area = std::f64::consts::PI * (0.5e-3 * diameter).powi(2);
        let pressure = if tame { n.between(1.0, 6.5) } else { n.log(0.5, 60.0) };
        let bears = if tame { 2.8 * soft.bulk } else { f64::INFINITY };
        let force = ((pressure * soft.young).min(bears) * area).clamp(0.005, 20.0);
        let cutting = force * if tame { n.between(0.3, 0.9) } else { n.between(0.2, 1.1) };
        if tame || n.chance(0.9) {
            writeln!(table, "puncture_force_n = {}\ncutting_force_n = {}", written(force), written(cutting))
                .expect("text grows");
        }
        if n.chance(0.12) {
            writeln!(
                table,
                "rate_exponent = {}\nreference_speed_mm_s = {}",
                written(n.between(0.05, 0.4)),
                written(n.log(0.5, 20.0))
            )
            .expect("text grows");
        }
        if !tame && n.chance(0.3) {
            match n.below(6) {
                0 => writeln!(table, "transition_length_mm = {}", written(n.between(0.2, 2.0))),
                1 => writeln!(table, "tip_stiffness_n_mm = {}", written(n.log(0.5, 10.0))),
                2 => writeln!(table, "residual_stiffness = {}", written(n.log(0.002, 0.5))),
                3 => writeln!(table, "contact_stiffness_factor = {}", written(n.log(0.5, 8.0))),
                4 => writeln!(table, "contact_damping = {}", written(n.between(0.0, 1.0))),
                _ => writeln!(table, "entry_fade_mm = {}", written(n.log(0.3, 5.0))),
            }
            .expect("text grows");
        }
        if free && !path.is_empty() {
            table += &path;
        }
        if !table.is_empty() {
            write!(self.tables, "[puncture]\n{table}\n").expect("text grows");
        }
        force
    }

    /// Faces that separate, with planes across z at these heights [mm].
    pub(super) fn cohesive(&mut self, n: &mut Numbers, tame: bool, soft: &Drawn, planes: &[f64], cut: bool) {
        self.effects.push("cohesive");
        let strength = soft.young * if tame { n.between(0.3, 2.5) } else { n.log(0.05, 10.0) };
        let factor = if n.chance(0.7) { 20.0 } else { n.log(5.0, 60.0) };
        // Opening at which the bond begins to fail [m], and the energy that ends it at a later one.
        let onset = strength / (factor * soft.young / (self.cell * 1e-3));
        let later = if tame { n.between(2.5, 20.0) } else { n.log(0.5, 60.0) };
        let energy = 0.5 * strength * onset * later;
        let mut table = format!("strength_kpa = {}\nenergy_j_m2 = {}\n", written(strength * 1e-3), written(energy));
        if factor != 20.0 {
            writeln!(table, "penalty_factor = {}", written(factor)).expect("text grows");
        }
        if n.chance(0.25) {
            let more = n.between(1.0, 2.0);
            writeln!(table, "shear_strength_kpa = {}", written(strength * 1e-3 * more)).expect("text grows");
            writeln!(table, "shear_energy_j_m2 = {}", written(energy * more * more)).expect("text grows");
        }
        let mut text = format!("[cohesive]\n{table}\n");
        let mut planes = planes.to_vec();
        if cut && n.chance(0.2) {
            planes.push(-self.size[2] * n.between(0.3, 0.7));
        }
        for at in planes {
            let driven = if cut && n.chance(0.5) { "tip_driven = true\n" } else { "" };
            write!(text, "[[cohesive.plane]]\naxis = \"z\"\nat_mm = {}\n{driven}\n", written(at)).expect("text grows");
        }
        self.tables += &text;
    }

    pub(super) fn adhesion(&mut self, n: &mut Numbers, force: f64) {
        self.effects.push("adhesion");
        let held = force * n.between(0.1, 0.6);
        let kinetic = held * n.between(0.1, 0.6);
        let stiffness = n.between(0.5, 3.0);
        let distance = ((held - kinetic) / stiffness * n.between(1.2, 4.0)).max(0.1);
        write!(
            self.tables,
            "[adhesion]\nstatic_force_n = {}\nkinetic_force_n = {}\nstiffness_n_mm = {}\nsliding_distance_mm = {}\n\n",
            written(held),
            written(kinetic),
            written(stiffness),
            written(distance)
        )
        .expect("text grows");
    }

    pub(super) fn friction(&mut self, n: &mut Numbers, probability: f64) {
        if !n.chance(probability) {
            return;
        }
        self.effects.push("friction");
        if n.chance(0.8) {
            let fade =
                if n.chance(0.15) { format!("fade_length_mm = {}\n", written(n.between(0.0, 5.0))) } else { "".into() };
            write!(
                self.tables,
                "[friction]\ncoefficient = {}\n{fade}\n",
                written(n.pick(&[0.0, 0.05, 0.1, 0.2, 0.3, 0.5]))
            )
            .expect("text grows");
        }
    }

    /// Gravity, plasticity, damage, fibres, viscosity, and what is complete by itself.
    pub(super) fn bulk_effects(&mut self, n: &mut Numbers, tame: bool, soft: &Drawn) {
        if n.chance(0.25) {
            self.effects.push("gravity");
            if n.chance(0.4) {
                let most = if tame { 9.81 } else { 60.0 };
                let vector = [n.between(-0.5, 0.5) * most, n.between(-0.5, 0.5) * most, -most * n.between(0.0, 0.8)];
                write!(self.tables, "[gravity]\nacceleration_m_s2 = {}\n\n", list(&vector)).expect("text grows");
            }
        }
        if n.chance(0.25) {
            self.effects.push("plasticity");
            if n.chance(0.7) {
                let stress = soft.young * if tame { n.between(0.15, 0.8) } else { n.log(0.02, 2.0) };
                let hardening = soft.young * if tame { n.between(0.5, 5.0) } else { n.between(0.0, 6.0) };
                write!(
                    self.tables,
                    "[plasticity]\nyield_stress_kpa = {}\nhardening_kpa = {}\n\n",
                    written(stress * 1e-3),
                    written(hardening * 1e-3)
                )
                .expect("text grows");
            }
            if n.chance(0.4) {
                self.effects.push("damage");
                self.damage = Some(if tame { n.between(1.3, 4.0) } else { n.log(0.8, 10.0) });
            }
        }
        if n.chance(0.2) {
            self.effects.push("fibres");
            let towards = [n.between(-1.0, 1.0), n.between(-1.0, 1.0), n.between(-1.0, 1.0)];
            let mut table = format!("direction = {}\n", list(&towards));
            if n.chance(0.6) {
                let (k1, k2) = match tame {
                    true => (n.between(0.1, 1.0), n.between(0.02, 1.0)),
                    false => (n.log(0.1, 10.0), n.log(0.02, 20.0)),
                };
                writeln!(table, "k1_kpa = {}\nk2 = {}", written(k1 * soft.shear * 1e-3), written(k2)).expect("grows");
            }
            write!(self.tables, "[fibres]\n{table}\n").expect("text grows");
        }
        if n.chance(0.2) {
            self.effects.push("viscoelastic");
            if n.chance(0.7) {
                let count = 1 + n.below(3);
                let g: Vec<f64> = (0..count).map(|_| n.between(0.05, 0.25)).collect();
                let tau: Vec<f64> = (0..count).map(|_| n.log(0.01, 20.0)).collect();
                write!(self.tables, "[viscoelastic]\ng = {}\ntau_s = {}\n\n", list(&g), list(&tau)).expect("grows");
            }
        }
        for own in SELF_CONTAINED {
            if !n.chance(0.1) {
                continue;
            }
            let key = own.effect.key;
            self.effects.push(key);
            writeln!(self.tables, "[{key}]").expect("text grows");
            for number in own.numbers {
                // A reasonable value is between the default and its half.
                let value = match tame {
                    true => number.default * n.between(0.5, 1.0),
                    false => n.between(number.range[0], number.range[1]),
                };
                writeln!(self.tables, "{} = {}", number.key, written(value)).expect("text grows");
            }
            self.tables.push('\n');
        }
    }
}
