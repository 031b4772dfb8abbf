//! The tissue: material, regions, grid, faces, targets; and the solver.

use std::fmt::Write as _;

use super::super::numbers::{Numbers, list, written};
use super::{Draft, Drawn};
use crate::material::ElasticLaw;
use crate::scene::presets;

impl Draft {
    /// Material, regions and the block; the softest material.
    pub(super) fn tissue_keys(&mut self, n: &mut Numbers, tame: bool) -> Drawn {
        let own = material(n, tame);
        self.body = format!("[material]\n{}\n\n", own.lines.join("\n"));
        let mut soft = Drawn { lines: Vec::new(), ..own };
        let [lx, ly, lz] = self.size;
        let count = if n.chance(0.4) { 1 + n.below(3) } else { 0 };
        for index in 0..count {
            let other = material(n, tame);
            if tame && !(1.0 / 25.0..25.0).contains(&(other.young / own.young)) {
                continue;
            }
            let lines: Vec<&String> = other.lines.iter().filter(|l| !l.starts_with("allow")).collect();
            let table = lines.iter().map(|l| l.as_str()).collect::<Vec<_>>().join(", ");
            let h = self.cell;
            let shape = match n.below(4) {
                0 | 1 if index == 0 => {
                    let thick = h * n.between(1.0, 3.0);
                    let top = if n.chance(0.7) { 0.0 } else { h * n.between(1.0, 3.0) };
                    format!("layer_mm = {}", list(&[top, (top + thick).min(lz)]))
                }
                // Each within the block.
                2 => format!(
                    "sphere_mm = {{ centre = {}, radius = {} }}",
                    list(&[n.between(-2.5, 2.5), n.between(-2.5, 2.5), -lz * n.between(0.25, 0.75)]),
                    written(h * n.between(1.3, 3.0))
                ),
                3 => {
                    let (x, z) = (n.between(-3.0, 3.0), -lz * n.between(0.3, 0.8));
                    format!(
                        "cylinder_mm = {{ from = {}, to = {}, radius = {} }}",
                        list(&[x, -ly, z]),
                        list(&[x, ly, z]),
                        written(h * n.between(1.2, 2.0))
                    )
                }
                _ => format!(
                    "box_mm = {{ low = {}, high = {} }}",
                    list(&[-0.3 * lx, -0.5 * ly, -0.9 * lz]),
                    list(&[0.3 * lx, 0.2 * ly, -0.5 * lz])
                ),
            };
            let membrane = if shape.starts_with("layer") && n.chance(0.4) {
                match n.chance(0.5) {
                    true => format!("membrane = {{ puncture_energy_mj = {} }}\n", written(n.log(0.02, 0.3))),
                    false => format!("membrane = {{ toughness_j_m2 = {} }}\n", written(n.log(20.0, 200.0))),
                }
            } else {
                String::new()
            };
            write!(self.body, "[[region]]\nname = \"part {index}\"\n{shape}\nmaterial = {{ {table} }}\n{membrane}\n")
                .expect("text grows");
            if other.shear < soft.shear {
                soft = Drawn { lines: Vec::new(), ..other };
            }
        }
        soft
    }

    /// How the grid lies.
    pub(super) fn axis_keys(&mut self, n: &mut Numbers) {
        if n.chance(0.4) {
            let offset = [n.unit(), n.unit()].map(|x| if n.chance(0.3) { n.pick(&[0.0, 0.5, 1.0]) } else { x });
            self.tissue.push(format!("axis_offset_cells = {}", list(&offset)));
        }
        if n.chance(0.3) {
            self.tissue.push(format!("growth = {}", written(n.between(1.0, 1.6))));
        }
        if n.chance(0.3) {
            self.tissue.push(format!("fine_radius_mm = {}", written(n.between(1.5, 3.0))));
        }
    }

    /// Sides that are not held as a whole.
    pub(super) fn other_faces(&mut self, n: &mut Numbers) {
        if n.chance(0.25) {
            for key in ["x_min", "x_max", "y_min", "y_max"] {
                if n.chance(0.5) {
                    self.faces.push((key, n.pick(&["\"free\"", "\"roller\""]).into(), 0.0));
                }
            }
        }
    }

    pub(super) fn targets(&mut self, n: &mut Numbers) {
        // They act on the block only.
        if self.mesh_cells.is_some() {
            return;
        }
        let count = if n.chance(0.3) { 1 + n.below(3) } else { 0 };
        for _ in 0..count {
            let position = [
                self.size[0] * n.between(-0.3, 0.3),
                self.size[1] * n.between(-0.3, 0.3),
                -self.size[2] * n.between(0.2, 0.9),
            ];
            write!(self.tables, "[[target]]\nposition_mm = {}\n\n", list(&position)).expect("text grows");
        }
    }

    pub(super) fn solver_keys(&mut self, n: &mut Numbers, tame: bool) {
        if n.chance(0.3) {
            let safety = if tame { n.between(0.4, 0.85) } else { n.between(0.3, 1.0) };
            self.solver.push(format!("safety = {}", written(safety)));
        }
        if n.chance(0.3) {
            let damping = if tame { n.pick(&[0.0, 5.0, 20.0, 50.0]) } else { n.pick(&[0.0, 1.0, 100.0, 1000.0]) };
            self.solver.push(format!("mass_damping_per_s = {}", written(damping)));
        }
        if n.chance(0.1) {
            self.solver.push(format!("hourglass_stiffness = {}", written(n.log(0.05, 0.5))));
        }
        if n.chance(0.08) {
            self.own_step = Some(if tame { n.between(0.4, 0.85) } else { n.between(0.5, 1.15) });
        }
    }
}

/// A material of any kind, stated in any way.
fn material(n: &mut Numbers, tame: bool) -> Drawn {
    // Those that are neither stiffer nor softer than the constants below may be.
    let all: Vec<_> = presets::tissues().iter().filter(|p| (0.3e3..=200e3).contains(&p.law.shear_modulus())).collect();
    if n.chance(0.4) {
        let preset = all[n.below(all.len())];
        if !(tame && preset.law.poisson_ratio() > 0.499) {
            return drawn(vec![format!("preset = \"{}\"", preset.name)], preset.law, preset.density);
        }
    }
    let shear = if tame { n.log(1.5e3, 50e3) } else { n.log(0.3e3, 200e3) };
    let nu = if tame { n.between(0.3, 0.49) } else { n.between(0.0, 0.498) };
    let kpa = |x: f64| written(x * 1e-3);
    let mut lines = Vec::new();
    match n.below(6) {
        0 => lines.push(format!("law = \"neo_hookean\"\nc10_kpa = {}", kpa(0.5 * shear))),
        1 => {
            let share = if tame { n.unit() } else { n.between(0.0, 1.4) };
            if n.chance(0.5) {
                lines.push("law = \"mooney_rivlin\"".into());
            }
            lines.push(format!(
                "c10_kpa = {}\nc01_kpa = {}",
                kpa(0.5 * share * shear),
                kpa(0.5 * (1.0 - share) * shear)
            ));
        }
        2 => {
            let (second, third) = match tame {
                true => (n.between(0.0, 1.5), n.between(0.0, 1.0)),
                false => (n.between(-0.3, 4.0), n.between(-0.1, 4.0)),
            };
            let c10 = 0.5 * shear;
            lines.push(format!(
                "law = \"yeoh\"\nc10_kpa = {}\nc20_kpa = {}\nc30_kpa = {}",
                kpa(c10),
                kpa(c10 * second),
                kpa(c10 * third)
            ));
        }
        3 => {
            let alpha = if tame { n.pick(&[1.3, 2.0, 3.0, 5.0, 8.0, -2.0, -4.0]) } else { n.between(-14.0, 20.0) };
            lines.push(format!("law = \"ogden\"\nmu_kpa = {}\nalpha = {}", kpa(shear), written(alpha)));
        }
        4 => {
            let b = if tame { n.between(0.3, 7.0) } else { n.between(-1.0, 20.0) };
            lines.push(format!("law = \"demiray\"\nmu_kpa = {}\nb = {}", kpa(shear), written(b)));
        }
        _ => {
            let young = 2.0 * shear * (1.0 + nu);
            match n.below(3) {
                0 => lines.push("law = \"neo_hookean\"".into()),
                1 => lines.push(format!("c10_share = {}", written(n.unit()))),
                _ => {}
            }
            lines.push(format!("youngs_modulus_kpa = {}\npoisson_ratio = {}", kpa(young), written(nu)));
        }
    }
    let bulk = presets::bulk_modulus_from_poisson(shear, nu);
    if !lines.last().is_some_and(|l| l.starts_with("youngs")) {
        match n.below(3) {
            0 => lines.push(format!("poisson_ratio = {}", written(nu))),
            1 => lines.push(format!("bulk_modulus_kpa = {}", kpa(bulk))),
            _ => lines.push(format!("d_per_mpa = {}", written(2e6 / bulk))),
        }
    }
    let mut density = 1060.0;
    if n.chance(0.2) {
        density = n.between(900.0, 1200.0).round();
        lines.push(format!("density_kg_m3 = {}", written(density)));
    }
    if !tame && n.chance(0.5) {
        lines.push("allow_limited = true".into());
    }
    let lines = lines.iter().flat_map(|l| l.lines().map(String::from).collect::<Vec<_>>()).collect();
    drawn(lines, ElasticLaw::mooney_rivlin(0.5 * shear, 0.0, bulk), density)
}

fn drawn(lines: Vec<String>, law: ElasticLaw, density: f64) -> Drawn {
    Drawn { lines, shear: law.shear_modulus(), young: law.youngs_modulus(), bulk: law.bulk_modulus, density }
}
