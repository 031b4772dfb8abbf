//! Samples without a tool: blocks, and meshes of tetrahedra.

use std::fmt::Write as _;

use super::super::numbers::{Numbers, list, written};
use super::{Draft, Drawn, Scaling};

impl Draft {
    /// A block or a mesh without a tool: faces move or are loaded.
    pub(super) fn sample(&mut self, n: &mut Numbers, tame: bool) {
        self.cell = n.between(0.5, 1.0);
        let h = self.cell;
        let counts = [5 + n.below(6), 5 + n.below(6), 5 + n.below(7)];
        self.size = counts.map(|count| count as f64 * h);
        if n.chance(0.3) {
            self.mesh_cells = Some(counts.map(|count| count.min(7)));
        }
        let soft = self.tissue_keys(n, tame);
        let height = self.size[2];
        let wave = (soft.shear / soft.density).sqrt() * 1e3;
        // Time that a shear wave takes through the block, several times.
        let transits = if tame { n.log(15.0, 80.0) } else { n.log(2.0, 40.0) };
        let mut time = transits * height / wave;
        let scaling = match n.unit() {
            x if x < 0.4 => Scaling::Absent,
            x if x < 0.7 => Scaling::Auto,
            _ => Scaling::Factor(n.log(1.0, 1e6)),
        };
        if scaling != Scaling::Absent {
            self.effects.push("mass_scaling");
        }
        if let Scaling::Factor(factor) = scaling {
            time *= factor.sqrt();
        }
        if scaling == Scaling::Auto {
            // Any time will do: the factor follows the speed.
            time = n.log(0.05, 2.0);
        }
        self.scaling = Some(scaling);
        let sides = n.pick(&["free", "free", "free", "roller", "fixed"]);
        let block = self.mesh_cells.is_none();
        for key in ["x_min", "x_max", "y_min", "y_max"] {
            if sides != "fixed" || key == "x_min" {
                self.faces.push((key, format!("\"{sides}\""), 0.0));
            } else {
                self.faces.push((key, "\"free\"".into(), 0.0));
            }
        }
        self.faces.push(("z_min", "\"fixed\"".into(), 0.0));
        let twist_free = sides == "free";
        let most = if tame { 0.3 } else { 0.7 };
        let strain = n.between(0.03, most);
        let line = moved_face(n, (block, twist_free), strain, height, &soft);
        let cycles = if line.contains("cycles") { 4.0 } else { 1.0 };
        self.faces.push(("z_max", line, time));
        self.duration = Some(time * cycles * n.between(1.0, 1.4));
        if block && n.chance(0.25) {
            let at = -h * (1 + n.below(counts[2] - 1)) as f64;
            self.cohesive(n, tame, &soft, &[at], false);
        }
        self.bulk_effects(n, tame, &soft);
        self.targets(n);
    }
}

/// How the upper face of a sample of this height [mm] moves or is loaded; `{}` stands where a time belongs.
fn moved_face(n: &mut Numbers, (block, twist_free): (bool, bool), strain: f64, height: f64, soft: &Drawn) -> String {
    match n.below(8) {
        0 => format!(
            "{{ fixed = [\"x\", \"y\", \"z\"], displacement_mm = {}, duration_s = {{}} }}",
            list(&[0.0, 0.0, -strain * height])
        ),
        1 => format!(
            "{{ fixed = [\"z\"], displacement_mm = {}, duration_s = {{}}{} }}",
            list(&[0.0, 0.0, 1.3 * strain * height]),
            if n.chance(0.3) { ", cycles = 2" } else { "" }
        ),
        2 | 4 if twist_free => format!(
            "{{ fixed = [\"x\", \"y\", \"z\"], rotation_deg = {}, duration_s = {{}} }}",
            written(strain * 200.0)
        ),
        3 | 5 if block => {
            let pull = n.between(-0.2, 0.25) * soft.young * 1e-3;
            let across = n.between(-0.05, 0.05) * soft.young * 1e-3;
            format!("{{ traction_kpa = {}, traction_ramp_s = {{}} }}", list(&[across, 0.0, pull]))
        }
        _ if twist_free => format!(
            "{{ fixed = [\"x\", \"y\", \"z\"], displacement_mm = {}, duration_s = {{}} }}",
            list(&[strain * height, 0.3 * strain * height, 0.0])
        ),
        _ => format!(
            "{{ fixed = [\"z\"], displacement_mm = {}, duration_s = {{}} }}",
            list(&[0.0, 0.0, -0.7 * strain * height])
        ),
    }
}

/// A block of tetrahedra, six in each of `cells`, its inner nodes moved by up to `jitter` of a cell, as text of Gmsh 2.2.
pub(super) fn tetrahedra(n: &mut Numbers, size: [f64; 3], cells: [usize; 3], jitter: f64) -> String {
    let [nx, ny, nz] = cells.map(|count| count + 1);
    let node = |i: usize, j: usize, k: usize| 1 + i + nx * (j + ny * k);
    let mut text = format!(
        "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$PhysicalNames\n1\n3 1 \"tissue\"\n$EndPhysicalNames\n$Nodes\n{}\n",
        nx * ny * nz
    );
    for k in 0..nz {
        for j in 0..ny {
            for i in 0..nx {
                let at: [f64; 3] = std::array::from_fn(|axis| {
                    let (index, count) = ([i, j, k][axis], cells[axis]);
                    let inner = index > 0 && index < count;
                    let moved = if inner { jitter * n.between(-1.0, 1.0) } else { 0.0 };
                    let low = if axis == 2 { -size[2] } else { -0.5 * size[axis] };
                    low + size[axis] * (index as f64 + moved) / count as f64
                });
                writeln!(text, "{} {} {} {}", node(i, j, k), written(at[0]), written(at[1]), written(at[2]))
                    .expect("text grows");
            }
        }
    }
    writeln!(text, "$EndNodes\n$Elements\n{}", 6 * cells.iter().product::<usize>()).expect("text grows");
    // The six orders in which a path goes along the edges from one corner to the opposite one.
    let orders = [[0, 1, 2], [0, 2, 1], [1, 0, 2], [1, 2, 0], [2, 0, 1], [2, 1, 0]];
    let mut element = 0;
    for k in 0..cells[2] {
        for j in 0..cells[1] {
            for i in 0..cells[0] {
                for order in orders {
                    let mut at = [i, j, k];
                    let mut corners = vec![node(i, j, k)];
                    for axis in order {
                        at[axis] += 1;
                        corners.push(node(at[0], at[1], at[2]));
                    }
                    // Odd orders are turned.
                    if matches!(order, [0, 2, 1] | [1, 0, 2] | [2, 1, 0]) {
                        corners.swap(2, 3);
                    }
                    element += 1;
                    let [a, b, c, d] = corners[..] else { unreachable!("a path has four corners") };
                    writeln!(text, "{element} 4 2 1 1 {a} {b} {c} {d}").expect("text grows");
                }
            }
        }
    }
    text += "$EndElements\n";
    text
}
