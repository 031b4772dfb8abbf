//! The tip on a surface that it has not entered: force over depth, beyond what cells resolve.
//!
//! A pointed tip touches a surface over less than a cell for most of its way. The tissue carries its force as a load that is even over a disc
//! of rest radius [`DISC`] R, which cells do resolve; the tip is deeper than the mean of that disc, by a dimple of the depth
//! ```text
//! u(Q) = d(Q) - d_disc(Q) - Q/k_tip                                                        [m]
//! ```
//! with the depth d of the tip and the mean sinking d_disc of the disc, both under the force Q on a half space at rest (large strain,
//! src/penetration/surface.rs; at small strain Sneddon and Love). Where the tip has cut its way to the material coordinate a the dimple
//! shifts it, and the opened path with it, by `p(a) U` only, and by nothing from a = l on. With the gap G between the tip and the disc at a,
//! the distance b_j of the sections of the path behind the tip, and S, the force that spreads them:
//! ```text
//! E = k_tip/2 (G - p U)^2 + V(U) + E_opening(b_j - p U),   V = int Q du                       [J]
//! F = k_tip (G - p U),   V'(U) = Q = p (F + S)                                             [N]
//! ```
//! The second says that the dimple is in equilibrium with the whole force of the tip. An advance of the tip shortens the spring by
//! `lambda da + p' U da` and moves the sections by `p' U da`.
//!
//! S is known from the step before, where the path was shifted by s_0, and falls as the path is shifted on, by K per length at most:
//! `S = S_0 - K (p U - s_0)` ([`Spreading`]). Taken as it was, it swings from step to step where `K p^2` is more than
//! `V'' + k_tip p^2` (fibres that stiffen), and the energy with it.
//! u is linear in the root of Q between the [`KNOTS`] of a table, since the force of a cone grows like the square of the depth.

use serde::{Deserialize, Serialize};

/// Rest radius of the disc, in needle radii: a smaller one is not resolved by cells of 1 mm, and sinks without bound where F reaches the
/// shear modulus times its area.
pub const DISC: f64 = 3.0;

/// Rows of the table.
pub const KNOTS: usize = 26;

/// The length l over which a crack lets the surface around the tip close, in u at the puncture. Under an even load the surface of tissue
/// that keeps its volume moves with what is right below it, so that p begins flat: `p = (1 - (a/l)^2)^2`. With 1.5 the force grew by 12 %
/// while the crack ran, if p was a straight line; with the square 1.5 to 3 give the same puncture and drop.
const CLOSING: f64 = 2.0;

/// A row of the table.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Knot {
    /// Root of the force [N^(1/2)].
    pub root: f64,
    /// u there [m], and its slope up to the next row [m/N^(1/2)].
    pub depth: f64,
    pub slope: f64,
    /// V there [J].
    pub stored: f64,
}

/// The tip on the surface at one moment.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct Touch {
    /// F [N].
    pub force: f64,
    /// U [m].
    pub dimple: f64,
    /// By how much the disc moves along the needle per length of its path, d(x.t)/da.
    pub stretch: f64,
}

/// What spreads the opened path, as the step before has left it.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Spreading {
    /// S_0 [N].
    pub force: f64,
    /// K [N/m].
    pub stiffness: f64,
    /// s_0 [m].
    pub shift: f64,
}

impl Spreading {
    /// The force that it would have if it were not shifted [N].
    fn unshifted(&self) -> f64 {
        self.force + self.stiffness * self.shift
    }
}

/// The law of one surface and tip.
#[derive(Debug, Clone, PartialEq)]
pub struct TipContact {
    /// k_tip [N/m].
    pub stiffness: f64,
    /// l [m].
    pub length: f64,
    /// Ascending; the last row goes on beyond itself.
    pub knots: [Knot; KNOTS],
}

impl TipContact {
    /// The law from u(F) [m], which must not fall, in rows of even roots up to the force `most` [N].
    pub fn new(stiffness: f64, puncture_force: f64, most: f64, depth: impl Fn(f64) -> f64) -> Self {
        let mut knots = [Knot::default(); KNOTS];
        let step = most.sqrt() / (KNOTS - 1) as f64;
        for i in 1..KNOTS {
            let last = knots[i - 1];
            let root = i as f64 * step;
            let here = (depth(root * root) - root * root / stiffness).max(last.depth);
            let slope = (here - last.depth) / step;
            knots[i - 1].slope = slope;
            knots[i] = Knot { root, depth: here, slope, stored: last.stored + slope * cubes(last.root, root) };
        }
        let mut law = TipContact { stiffness, length: 0.0, knots };
        law.length = CLOSING * law.depth(puncture_force);
        law
    }

    /// The row that a force [N] belongs to.
    fn row(&self, root: f64) -> &Knot {
        &self.knots[self.knots.partition_point(|k| k.root <= root).max(1) - 1]
    }

    /// u(F) [m].
    pub fn depth(&self, force: f64) -> f64 {
        let root = force.sqrt();
        let row = self.row(root);
        row.depth + row.slope * (root - row.root)
    }

    /// V(U) [J].
    fn held(&self, dimple: f64) -> f64 {
        let row = &self.knots[self.knots.partition_point(|k| k.depth <= dimple).max(1) - 1];
        let root = if row.slope > 0.0 { row.root + (dimple - row.depth) / row.slope } else { row.root };
        row.stored + row.slope * cubes(row.root, root)
    }

    /// p at the material coordinate `a` [m].
    pub fn part(&self, a: f64) -> f64 {
        let x = (a.max(0.0) / self.length).min(1.0);
        (1.0 - x * x).powi(2)
    }

    /// `-p'` at the material coordinate `a` [1/m].
    pub fn closing(&self, a: f64) -> f64 {
        let x = (a / self.length).clamp(0.0, 1.0);
        4.0 * x * (1.0 - x * x) / self.length
    }

    /// The tip with the gap `gap` [m] where the dimple shifts it by the part p.
    pub fn touch(&self, gap: f64, part: f64, spreading: &Spreading) -> Touch {
        // Q = p (k G + S_0 + K s_0) - p^2 (k + K) u(Q).
        let stiffness = self.stiffness + spreading.stiffness;
        let pressed = self.pressed(part * (self.stiffness * gap + spreading.unshifted()), part * part, stiffness);
        let dimple = self.depth(pressed.max(self.loaded(0.0, part, spreading)));
        Touch { force: self.stiffness * (gap - part * dimple).max(0.0), dimple, ..Touch::default() }
    }

    /// Q under the force F of the tip, which the dimple shifts by the part p [N].
    fn loaded(&self, force: f64, part: f64, spreading: &Spreading) -> f64 {
        self.pressed(part * (force + spreading.unshifted()), part * part, spreading.stiffness)
    }

    /// Q with `Q + by stiffness u(Q) = load` [N].
    fn pressed(&self, load: f64, by: f64, stiffness: f64) -> f64 {
        if load <= 0.0 {
            return 0.0;
        }
        let by = by * stiffness;
        let begins = |k: &Knot| k.root * k.root + by * k.depth <= load;
        let row = &self.knots[self.knots.partition_point(begins).max(1) - 1];
        let slope = by * row.slope;
        let rest = load - by * (row.depth - row.slope * row.root);
        let root = 2.0 * rest / (slope + (slope * slope + 4.0 * rest).sqrt());
        root * root
    }

    /// G at which the tip force is F [m].
    fn gap(&self, force: f64, part: f64, spreading: &Spreading) -> f64 {
        force / self.stiffness + part * self.depth(self.loaded(force, part, spreading))
    }

    /// What tip spring and dimple hold [J].
    pub fn stored(&self, touch: Touch) -> f64 {
        0.5 * touch.force * touch.force / self.stiffness + self.held(touch.dimple)
    }

    /// What a step dissipates in which the gap grew by `way` [m] before the advance that ends it, the touch went from `old` to `new`, and the
    /// dimple moved the opened path by `shift` [m] against the force `spreading` [N]: mean force of both times the way, as the leapfrog
    /// works, less what is held now [J]. The new force works where the tip has come to: tissue that is longer there by `stretched` [m] than
    /// it was has made less of the way.
    pub fn dissipated(
        &self,
        (old, new): (Touch, Touch),
        (way, stretched): (f64, f64),
        shift: f64,
        spreading: f64,
    ) -> f64 {
        0.5 * (old.force * way + new.force * (way - stretched)) + spreading * shift
            - (self.stored(new) - self.stored(old))
    }

    /// By how much the gap of the tip with the part p is longer under the force F than under the threshold F_c [N]: what an advance has to
    /// shorten it by [m].
    pub fn excess(&self, force: f64, threshold: f64, part: f64, spreading: &Spreading) -> f64 {
        self.gap(force, part, spreading) - self.gap(threshold, part, spreading)
    }
}

/// Integral of q^2 from `a` to `b`.
fn cubes(a: f64, b: f64) -> f64 {
    (b * b * b - a * a * a) / 3.0
}

#[cfg(test)]
mod tests {
    use super::*;

    fn law() -> TipContact {
        // A cone on a half space, less what a disc sinks.
        TipContact::new(2.0e3, 0.5, 1.0, |f| 3.6e-3 * f.sqrt() - 1.1e-3 * f)
    }

    #[test]
    fn force_and_gap_are_inverse() {
        let law = law();
        for part in [0.0, 0.3, 1.0] {
            for (load, stiffness) in [(0.0, 0.0), (0.01, 0.0), (0.2, 0.0), (0.2, 500.0)] {
                let load = Spreading { force: load, stiffness, shift: 0.3e-3 };
                for force in [1e-5, 0.003, 0.1, 0.57, 0.999, 1.4] {
                    let back = law.touch(law.gap(force, part, &load), part, &load).force;
                    assert!((back / force - 1.0).abs() < 1e-6, "{part} {load:?} {force} {back}");
                }
            }
            assert_eq!(law.touch(-1e-3, part, &Spreading::default()).force, 0.0);
        }
    }

    #[test]
    fn the_force_is_the_derivative_of_the_energy() {
        let law = law();
        for part in [0.0, 0.3, 1.0] {
            for gap in [1e-4, 2e-3, 4e-3] {
                let energy = |g: f64| law.stored(law.touch(g, part, &Spreading::default()));
                let step = 1e-8;
                let difference = (energy(gap + step) - energy(gap - step)) / (2.0 * step);
                let force = law.touch(gap, part, &Spreading::default()).force;
                assert!((difference / force - 1.0).abs() < 1e-4, "{part} {gap}: {difference} {force}");
            }
        }
    }

    #[test]
    fn a_loaded_dimple_gives_its_work_back() {
        let law = law();
        let (gap, part) = (1.5e-3, 0.7);
        let touch = |force: f64| law.touch(gap, part, &Spreading { force, ..Spreading::default() });
        let total = |s: f64| law.stored(touch(s)) - s * part * touch(s).dimple;
        let step = 1e-6;
        let difference = (total(0.1 + step) - total(0.1 - step)) / (2.0 * step);
        assert!((difference / (-part * touch(0.1).dimple) - 1.0).abs() < 1e-4);
    }

    /// The path spreads with a force that falls as it is shifted, by 8e3 N/m: with nothing known of this the dimple swings.
    #[test]
    fn a_stiff_path_and_the_dimple_come_to_rest() {
        let law = law();
        let (gap, part) = (1.0e-3, 0.7);
        let force = |shift: f64| (8.0 - 8e3 * shift).max(0.0);
        let swings = |stiffness: f64| {
            let (mut shift, mut moved) = (0.0, 0.0);
            for _ in 0..200 {
                let spreading = Spreading { force: force(shift), stiffness, shift };
                let next = part * law.touch(gap, part, &spreading).dimple;
                (moved, shift) = ((next - shift).abs(), next);
            }
            (moved, shift)
        };
        assert!(swings(0.0).0 > 0.1e-3, "{:?}", swings(0.0));
        for stiffness in [5e3, 8e3, 20e3] {
            let (moved, shift) = swings(stiffness);
            assert!(moved < 1e-9, "{stiffness}: {moved}");
            // In equilibrium, whatever was taken for K.
            let at_rest =
                Touch { dimple: shift / part, force: law.stiffness * (gap - shift).max(0.0), ..Touch::default() };
            let load = part * (at_rest.force + force(shift));
            assert!((law.depth(load) / at_rest.dimple - 1.0).abs() < 1e-5, "{stiffness}: {at_rest:?}");
        }
    }

    #[test]
    fn closing_is_the_slope_of_the_part() {
        let law = law();
        for a in [0.1, 0.5, 0.9, 1.2].map(|x| x * law.length) {
            let difference = (law.part(a - 1e-8) - law.part(a + 1e-8)) / 2e-8;
            assert!((difference - law.closing(a)).abs() < 1e-3, "{a}: {difference} {}", law.closing(a));
        }
    }

    #[test]
    fn the_force_falls_as_the_crack_runs() {
        let law = law();
        let full = law.gap(0.5, 1.0, &Spreading::default());
        let mut last = 0.5;
        for i in 1..100 {
            let a = 1e-5 * f64::from(i);
            let force = law.touch(full - a, law.part(a), &Spreading::default()).force;
            assert!(force < last, "{a} {force} {last}");
            last = force;
        }
    }
}
