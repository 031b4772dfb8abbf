//! Damage: shear failure that degrades all stress, driven by the plastic displacement.
//!
//! ```text
//! P = (1 - d) P_undamaged,  d = min(u_pl/u_f, d_max),  u_pl = L_e (alpha - alpha_0)
//! dissipated by the flow after onset: (2 d_max - d_max^2) G_f per area,  G_f = sigma u_f/2      [J/m^2]
//! ```
//! `L_e = V^(1/3)`: edge of the cell; `alpha`: equivalent plastic strain of the effect `plasticity`, which this one needs;
//! the yield condition sees the undamaged stress. A cell at d_max may be deleted (d = 1); its mass stays. What the elastic
//! energy loses, `W dd`, is booked as damage. The hourglass force degrades with the stress. Driven by the plastic
//! displacement the dissipation does not depend on the mesh; the secant law with the same cap would.
//! Range of validity: one cell never snaps back, since the undamaged stress drives the flow; a bar of n cells does where
//! the failing one softens more steeply than the others unload, without hardening for `(n - 1) L_e > E u_f/sigma`.
//! Source: Hillerborg 1976, Lubliner et al. 1989; [Lv2022] Eq. 12-14 with the kinematics of Eq. 8.

use super::parameters::parameters;
use super::{Effect, Kind};
use crate::number::Number;
use crate::units::{MILLIMETRE, ONE};
use crate::within::Within::{Between, NotNegative, Positive};

/// The entry of this effect in [`super::EFFECTS`].
pub const EFFECT: Effect = Effect {
    key: "damage",
    kind: Kind::Constitutive,
    needs: &["plasticity"],
    define: "DAMAGE",
    summary: "failure by plastic displacement, regularised by the cell size; needs plasticity",
    source: "Lubliner1989; Lv2022 Eq. 12-14",
    cost: "no state of its own",
    parameters: PARAMETERS,
};

parameters! {
    /// Parameters of the effect `damage`, which needs `plasticity`.
    pub struct DamageTable;
    /// Parameters in SI units. The default is muscle, with the law `across-fibre` and the default of plasticity: damage begins where a
    /// sample pulled across the fibres carries 26.0 kPa (nominal, at a stretch of 1.68), and from there on the stress falls along the
    /// fibres too, if the cell is 1 mm or larger: the fibres stiffen, and u_f has to outrun them.
    #[derive(Debug, Clone, Copy, PartialEq)]
    pub struct Params;
    "damage": numbers => {
        numbers.effects.damage.as_ref().map(|common| numbers.material.damage.as_ref().unwrap_or(common))
    };

    /// Equivalent plastic strain at which damage begins; default 0.0652.
    onset: ONE, NotNegative(10.0) =>
    /// Equivalent plastic strain at which damage begins, alpha_0.
    onset = 0.0652, slider("plastic strain at onset", [0.0, 1.0], "Lv2022, tension tests");

    /// Plastic displacement at which nothing would be left [mm]; default 0.07, for cells of 1 mm.
    failure_displacement_mm: MILLIMETRE, Positive(1e3) =>
    /// Plastic displacement at which d would be 1, u_f [m].
    failure_displacement = 7.0e-5, slider("failure displacement", [0.005, 2.0], "Lv2022, tension tests").logarithmic();

    /// Energy per area from onset to failure, instead of the displacement [J/m^2].
    key fracture_energy_j_m2: Option<f64>;

    /// Largest damage, below 1; default 0.95.
    d_max: ONE, Between(0.0, 1.0) =>
    /// Largest degradation d_max, 0..1.
    largest = 0.95, slider("largest damage", [0.05, 0.999], "keeps a cell in shape");

    /// Delete a cell that has reached d_max; default false.
    key deletion: Option<bool>;
    /// Delete a cell that has reached d_max.
    field deletion: bool = false;

    /// Accept cells that are too large for the failure displacement: their softening branch snaps back, the break is
    /// dynamic. Default false: such a scene is refused. Read from the scene and from regions, not from presets.
    key allow_brittle: Option<bool>;
}

impl Params {
    /// d for the plastic strain `alpha` of a cell of edge `length` [m].
    pub fn degradation(&self, alpha: f64, length: f64) -> f64 {
        let d = ((alpha - self.onset) * length / self.failure_displacement).max(0.0);
        if d < self.largest {
            d
        } else if self.deletion {
            1.0
        } else {
            self.largest
        }
    }

    /// Energy that the flow dissipates per area from onset to d_max at a constant flow stress [J/m^2].
    pub fn dissipation_per_area(&self, flow_stress: f64) -> f64 {
        let d = self.largest;
        (2.0 * d - d * d) * 0.5 * flow_stress * self.failure_displacement
    }
}

/// Constants per lane, for any [`Number`]; a lane without damage has an onset beyond all strains.
#[derive(Debug, Clone, Copy)]
pub struct DamageInLanes<N> {
    /// alpha_0.
    pub onset: N,
    /// 1/u_f [1/m].
    pub inverse_displacement: N,
    /// d_max.
    pub largest: N,
    /// d of a cell that has reached `largest`: the same, or 1 where it is deleted.
    pub at_largest: N,
}

impl<N: Number> DamageInLanes<N> {
    /// d for the plastic strain `alpha` of a cell of edge `length` [m].
    #[inline(always)]
    pub fn degradation(&self, alpha: N, length: N) -> N {
        let d = ((alpha - self.onset) * length * self.inverse_displacement).larger(alpha.of(0.0));
        d.choose(self.largest, d, self.at_largest)
    }
}
