//! Needles, spheres and punches, and how they move.

use std::fmt::Write as _;

use super::super::numbers::{Numbers, list, written};
use super::{Draft, Drawn, Phase, Scaling};
use crate::scene::needles;

/// Part of the shear wave speed, and speed [mm/s], that a tool of a tame scene keeps below.
const TAME_MACH: f64 = 0.09;
const TAME_SPEED: f64 = 150.0;

impl Draft {
    /// A needle goes into a block.
    pub(super) fn needle(&mut self, n: &mut Numbers, tame: bool) {
        let gauges: Vec<&needles::NeedlePreset> = needles::needles().iter().collect();
        let gauge = gauges[n.below(if tame { 7 } else { gauges.len() })];
        let by_gauge = n.chance(0.7);
        let diameter = if by_gauge { gauge.outer_diameter * 1e3 } else { n.between(0.8, 2.2) };
        let fine = if tame { n.between(0.35, 0.7) } else { n.log(0.45, 1.8) };
        self.cell = (fine * diameter).clamp(0.4, 1.3);
        let h = self.cell;
        let radius = 0.5 * diameter;
        let free = n.chance(0.18);
        let hollow = !free && n.chance(0.12);
        let slit = !free && !hollow && n.chance(0.15);
        let upright = hollow || n.chance(0.45);
        let angle: f64 = match upright {
            true => 0.0,
            false if tame => n.between(3.0, 50.0).round(),
            false => n.between(3.0, 78.0).round(),
        };
        let azimuth = if slit { 90.0 * n.below(4) as f64 } else { n.between(0.0, 359.0).round() };
        let wide = |n: &mut Numbers| (h * n.between(11.0, 16.0)).max(2.0 * radius + 7.0 + 2.0 * h);
        self.size = [wide(n), wide(n), (h * n.between(9.0, 13.0)).max(6.0)];
        let entry = [n.between(-1.5, 1.5), n.between(-1.5, 1.5)].map(|x| if n.chance(0.3) { 0.0 } else { x });
        let soft = self.tissue_keys(n, tame);
        self.axis_keys(n);
        // How deep the path may go.
        let (sin, cos) = angle.to_radians().sin_cos();
        let (heading_y, heading_x) = azimuth.to_radians().sin_cos();
        let keep = if tame { 2.0 * h } else { 1.02 };
        let sideways = [(heading_x, 0), (heading_y, 1)]
            .map(|(part, axis)| {
                let room = 0.5 * self.size[axis] - radius - keep.max(1.05) - entry[axis] * part.signum();
                room / (sin * part.abs()).max(1e-9)
            })
            .into_iter()
            .fold(f64::INFINITY, f64::min);
        let deepest = ((self.size[2] - keep.max(1.05)) / cos).min(sideways).max(1.0);
        let through = !tame && !slit && !hollow && !free && angle == 0.0 && n.chance(0.15);
        let depth = match through {
            true => self.size[2] + n.between(1.0, 3.0),
            false => deepest * n.between(0.4, 0.95),
        };
        if through {
            self.faces.push(("z_min", "\"free\"".into(), 0.0));
        } else {
            self.other_faces(n);
        }
        self.effects.push("puncture");
        let mut tool = needle_keys(n, by_gauge.then_some(gauge), diameter, hollow);
        let flexible = !free && !hollow && n.chance(0.14);
        if n.chance(0.2) {
            writeln!(tool, "material = \"{}\"", n.pick(&["steel-304", "nitinol", "tungsten-carbide"])).expect("grows");
        }
        self.body += &tool;
        self.body.push('\n');
        // The motion.
        if entry != [0.0, 0.0] {
            self.motion.push(format!("entry_mm = {}", list(&entry)));
        }
        if angle > 0.0 {
            if !slit && n.chance(0.2) {
                self.motion.push(format!("direction = {}", list(&[sin * heading_x, sin * heading_y, -cos])));
            } else {
                self.motion.push(format!("angle_deg = {}\nazimuth_deg = {}", written(angle), written(azimuth)));
            }
        }
        let speed = self.speed(n, tame, &soft);
        self.insertion(n, speed, depth, deepest);
        if free {
            self.free_motion(n, speed, depth, [entry[0], entry[1], angle, azimuth], tame);
        }
        if !flexible && n.chance(0.05) {
            let amplitude = n.between(0.02, 0.2);
            self.vibration = Some((amplitude, speed / amplitude * n.between(0.05, 0.3)));
        }
        let force = self.puncture(n, tame, free, diameter, &soft);
        if hollow || slit {
            self.cohesive(n, tame, &soft, &[], true);
        }
        if !free && n.chance(0.15) {
            self.adhesion(n, force);
        }
        if flexible {
            self.effects.push("flexible_needle");
            let length = if tame { n.between(25.0, 90.0) } else { n.between(15.0, 150.0) }.max(depth + 5.0);
            write!(self.tables, "[flexible_needle]\nfree_length_mm = {}\n\n", written(length)).expect("text grows");
        }
        self.friction(n, 0.6);
        self.bulk_effects(n, tame, &soft);
        self.targets(n);
    }

    /// Speed [mm/s] and mass scaling of a needle or indenter, by the part of the shear wave speed at which it moves.
    pub(super) fn speed(&mut self, n: &mut Numbers, tame: bool, soft: &Drawn) -> f64 {
        let wave = (soft.shear / soft.density).sqrt() * 1e3;
        let part = if tame { n.log(0.01, 0.07) } else { n.log(0.02, 0.5) };
        if tame {
            self.most_pace = TAME_MACH / part;
        }
        if n.chance(0.25) {
            self.scaling = Some(Scaling::Absent);
            let speed = if tame { (part * wave).min(TAME_SPEED) } else { part * wave };
            if tame {
                self.most_pace = (TAME_MACH * wave).min(TAME_SPEED) / speed;
            }
            return speed;
        }
        let speed = n.pick(&[0.5, 1.0, 2.0, 5.0, 10.0, 20.0, 50.0]);
        self.effects.push("mass_scaling");
        self.scaling = Some(match n.unit() {
            x if x < 0.3 => Scaling::Auto,
            _ => Scaling::Factor((part * wave / speed).powi(2).clamp(1.0, 1e8)),
        });
        speed
    }

    /// In, and what may follow.
    fn insertion(&mut self, n: &mut Numbers, speed: f64, depth: f64, deepest: f64) {
        self.phases.push(Phase::Insert { speed, depth });
        let while_in = depth / speed;
        if n.chance(0.35) {
            self.phases.push(Phase::Hold { duration: while_in * n.between(0.1, 0.5) });
        }
        if !n.chance(0.4) {
            return;
        }
        let out = n.pick(&[-1.0, 0.0, 0.3, 0.6]);
        let to = if out > 0.0 { out * depth } else { 2.0 * out };
        self.phases.push(Phase::Withdraw { speed, depth: to });
        if n.chance(0.5) {
            let again = (depth * n.between(0.7, 1.2)).min(deepest).max(to + 0.5);
            self.phases.push(Phase::Insert { speed, depth: again });
        }
    }

    /// A motion that leaves its line, or the word that frees the path.
    fn free_motion(&mut self, n: &mut Numbers, speed: f64, depth: f64, from: [f64; 4], tame: bool) {
        let [x, y, angle, azimuth] = from;
        let (sin, cos) = angle.to_radians().sin_cos();
        let (sy, sx) = azimuth.to_radians().sin_cos();
        match n.below(4) {
            0 => self.tables += "path = \"free\"\n",
            1 => {
                self.phases.truncate(1);
                let by = if tame { n.between(0.3, 1.0) } else { n.between(0.5, 3.0) };
                let heading = n.between(0.0, std::f64::consts::TAU);
                let tip = [x + depth * sin * sx, y + depth * sin * sy, -depth * cos];
                let to = [tip[0] + by * heading.cos(), tip[1] + by * heading.sin(), tip[2] + n.between(0.0, 1.0)];
                self.phases.push(Phase::Move { speed, to });
            }
            2 => {
                self.phases.truncate(1);
                let more = if tame { n.between(2.0, 8.0) } else { n.between(5.0, 25.0) };
                let rate = more / (depth / speed * n.between(0.3, 1.0));
                let leaning = if angle + more < 79.0 { angle + more } else { angle - more };
                self.phases.push(Phase::Turn { rate, angle: leaning, azimuth });
            }
            _ => {
                self.phases.truncate(1);
                self.phases.push(Phase::Withdraw { speed, depth: -2.0 });
                let entry = [-x - 0.5, y * 0.5];
                self.phases.push(Phase::Reposition { entry, angle: 0.0, azimuth: 0.0 });
                self.phases.push(Phase::Insert { speed, depth: (depth * cos * 0.7).max(1.0) });
            }
        }
    }

    /// A sphere or a punch presses on a block.
    pub(super) fn indenter(&mut self, n: &mut Numbers, tame: bool) {
        self.cell = n.between(0.6, 1.0);
        let h = self.cell;
        self.size = [h * n.between(11.0, 15.0), h * n.between(11.0, 15.0), h * n.between(7.0, 11.0)];
        let soft = self.tissue_keys(n, tame);
        self.axis_keys(n);
        self.other_faces(n);
        let radius = h * if tame { n.between(2.5, 5.0) } else { n.between(1.0, 6.0) };
        if n.chance(0.6) {
            write!(self.body, "[sphere]\nradius_mm = {}\n\n", written(radius)).expect("text grows");
        } else {
            let bonded = if n.chance(0.5) { "bonded = true\n" } else { "" };
            write!(self.body, "[flat_punch]\nradius_mm = {}\n{bonded}\n", written(0.6 * radius)).expect("text grows");
        }
        if n.chance(0.95) {
            self.effects.push("indentation");
        }
        let most = (0.5 * radius).min(0.25 * self.size[2]);
        let depth =
            if tame { most * n.between(0.2, 0.9) } else { (most * n.between(0.5, 3.0)).min(0.6 * self.size[2]) };
        let speed = self.speed(n, tame, &soft);
        self.phases.push(Phase::Insert { speed, depth });
        if n.chance(0.4) {
            self.phases.push(Phase::Hold { duration: depth / speed * n.between(0.1, 1.0) });
        }
        if n.chance(0.5) {
            self.phases.push(Phase::Withdraw { speed, depth: n.pick(&[-0.5, 0.0, 0.5 * depth]) });
        }
        if n.chance(0.15) {
            write!(
                self.tables,
                "[indentation]\ncontact_stiffness_factor = {}\ncontact_damping = {}\n\n",
                written(n.log(0.3, 4.0)),
                written(n.between(0.0, 0.8))
            )
            .expect("text grows");
        }
        self.friction(n, 0.4);
        self.bulk_effects(n, tame, &soft);
        self.targets(n);
    }
}

/// Shape of a needle, solid or hollow: of a gauge or of this diameter [mm].
fn needle_keys(n: &mut Numbers, gauge: Option<&needles::NeedlePreset>, diameter: f64, hollow: bool) -> String {
    let mut tool = String::from("[needle]\n");
    match gauge {
        Some(preset) => writeln!(tool, "gauge = \"{}\"", preset.gauge),
        None => writeln!(tool, "outer_diameter_mm = {}", written(diameter)),
    }
    .expect("text grows");
    if hollow {
        writeln!(
            tool,
            "bore_diameter_mm = {}\ntip_length_mm = {}\ncutting_edge = {}\nbore_friction = {}",
            written(diameter * n.between(0.55, 0.8)),
            written(n.between(0.6, 1.6)),
            written(n.pick(&[0.0, 0.25, 0.5, 1.0])),
            written(n.pick(&[0.0, 0.05, 0.1, 0.3]))
        )
    } else {
        match n.below(3) {
            0 => writeln!(tool, "tip_half_angle_deg = {}", written(n.pick(&[10.0, 15.0, 18.0, 25.0, 40.0]))),
            1 => writeln!(tool, "tip_length_mm = {}", written(diameter * n.between(0.8, 3.0))),
            _ => writeln!(
                tool,
                "bevel_angle_deg = {}\nbevel_heading_deg = {}",
                written(n.pick(&[12.0, 20.0, 30.0, 45.0])),
                written(45.0 * n.below(8) as f64)
            ),
        }
    }
    .expect("text grows");
    tool
}
