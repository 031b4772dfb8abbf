//! One material point with all constitutive effects, in f64 and in the order of the element stage.
//!
//! ```text
//! plasticity    Fe = F G, flow until the yield condition holds      first: all others see the elastic part it leaves
//! elastic law   P_iso(Fe) G^T + p cof F                             the volumetric part sees F: det G = 1
//! fibres        + P_f(F)                                            intact fibres bridge a matrix that flows
//! viscoelastic  - F sum q_i, driven by F^-1 (P_iso + P_f)           relaxes what matrix and fibres hold together
//! damage        (1 - d) times the sum                               last: what has failed carries nothing of it
//! ```
//! Effects that a program brings along add their stress to the sum; their memory is brought forward after all others.
//! The path of the effect `puncture` multiplies the result once more, in the element stage.

use glam::DMat3;
use serde::{Deserialize, Serialize};

use crate::effects::{EffectSet, TissueMaterial, damage, fibres, own, plasticity, viscoelastic};
use crate::material::kinematics::{cofactor, double_dot, jacobian_minus_one, norm_squared};
use crate::material::{Continuation, ElasticLaw, TangentBound};

/// Constants of one material with the effects that are on.
#[derive(Debug, Clone, PartialEq)]
pub struct Material {
    pub law: ElasticLaw,
    /// Density without mass scaling [kg/m^3].
    pub density: f64,
    pub plasticity: Option<plasticity::Params>,
    pub fibres: Option<fibres::Params>,
    pub viscoelastic: Option<viscoelastic::Params>,
    pub damage: Option<damage::Params>,
    /// Effects that the program brings along.
    pub own: Vec<own::Chosen>,
}

/// History of one material point. Energies are per rest volume and since t = 0 [J/m^3].
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct PointState {
    pub plastic: plasticity::State,
    /// q_i [Pa], one symmetric tensor per Prony term; empty: all zero.
    pub viscous: Vec<DMat3>,
    /// Dissipated by plastic flow and by damage.
    pub plastic_dissipation: f64,
    pub damage_dissipation: f64,
    /// sum E:dq, weighted with the stiffness that was left.
    pub viscous_work: f64,
    /// One entry per own effect; empty: all at rest.
    pub own: Vec<own::State>,
}

/// Volumetric answer. A hexahedron has its own J; tetrahedra share averaged nodal values.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Volumetric {
    /// Pressure-like stress p [Pa] of `P = ... + p cof F`, with all that damage and path left of it.
    pub stress: f64,
    /// Energy U of the undamaged point [J/m^3].
    pub energy: f64,
}

/// What surrounds a point in one step.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Surroundings {
    /// Edge of the cell, V^(1/3) [m].
    pub length: f64,
    /// Time step [s] and number of the step.
    pub dt: f64,
    pub step: u64,
    /// Stiffness that the opened path left, 0..1.
    pub remaining: f64,
    /// Other energy that damage takes along: hourglass energy per volume [J/m^3].
    pub other_energy: f64,
}

/// Energies per rest volume [J/m^3].
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct PointEnergy {
    /// Stored: elastic, fibres, volumetric, and what the Prony terms hold.
    pub stored: f64,
    /// `Xi`, the part of the viscous work that is stored.
    pub viscous_stored: f64,
}

impl Material {
    /// A material without effects. `density` [kg/m^3].
    pub fn elastic(law: ElasticLaw, density: f64) -> Self {
        Material { law, density, plasticity: None, fibres: None, viscoelastic: None, damage: None, own: Vec::new() }
    }

    /// A material of a scene with the effects that are on; what it does not state itself comes from the scene's tables.
    pub fn of(tissue: &TissueMaterial, effects: &EffectSet) -> Self {
        let (own, common) = (tissue, effects);
        let stated = |scene: &own::Chosen| own.own.iter().find(|o| o.effect == scene.effect).unwrap_or(scene).clone();
        Material {
            plasticity: common.plasticity.map(|p| own.plasticity.unwrap_or(p)),
            fibres: common.fibres.map(|p| own.fibres.unwrap_or(p)),
            viscoelastic: common.viscoelastic.clone().map(|p| own.viscoelastic.clone().unwrap_or(p)),
            damage: common.damage.map(|p| own.damage.unwrap_or(p)),
            own: common.own.iter().map(stated).collect(),
            ..Self::elastic(tissue.law, tissue.density)
        }
    }

    /// K/2 (J - 1)^2 of a point that keeps the part `intact` of its stiffness, and its derivative.
    pub fn volumetric(&self, h: DMat3, intact: f64) -> Volumetric {
        let dj = jacobian_minus_one(h);
        Volumetric { stress: intact * self.law.bulk_modulus * dj, energy: 0.5 * self.law.bulk_modulus * dj * dj }
    }

    /// Degradation d of the point.
    pub fn degradation(&self, state: &PointState, length: f64) -> f64 {
        self.damage.map_or(0.0, |damage| damage.degradation(state.plastic.alpha, length))
    }

    /// What own effects are told, each with what it remembers.
    fn own_points<'a>(
        &'a self,
        h: DMat3,
        dt: f64,
        state: &'a PointState,
    ) -> impl Iterator<Item = (&'static own::OwnEffect, own::Point<'a>, own::Memory)> {
        let memory = |place: usize| state.own.get(place).map_or([0.0; 4], |s| s.memory);
        self.own.iter().enumerate().map(move |(place, chosen)| {
            let (bulk_modulus, shear_modulus) = (self.law.bulk_modulus, self.law.shear_modulus());
            (chosen.effect, own::Point { h, numbers: &chosen.numbers, bulk_modulus, shear_modulus, dt }, memory(place))
        })
    }

    /// Brings what own effects remember to this step, of a point that keeps the part `intact` of its stiffness.
    fn advance_own(&self, h: DMat3, dt: f64, intact: f64, state: &mut PointState) {
        state.own.resize(self.own.len(), own::State::default());
        let (bulk_modulus, shear_modulus) = (self.law.bulk_modulus, self.law.shear_modulus());
        for (chosen, own) in self.own.iter().zip(&mut state.own) {
            let point = own::Point { h, numbers: &chosen.numbers, bulk_modulus, shear_modulus, dt };
            let advance = chosen.effect.law.advance;
            let behind = advance(&point, &mut own.memory);
            // Mean over the strains at both ends of a step: half of the way here, half of the way ahead.
            let ahead = advance(&point, &mut own.memory.clone());
            own.supplied += intact * 0.5 * (behind + ahead);
        }
    }

    /// Isochoric stress of matrix and fibres [Pa].
    fn isochoric_stress(&self, h: DMat3, state: &PointState) -> DMat3 {
        let mut p = match self.plasticity {
            None => self.law.isochoric_stress(h),
            Some(_) => {
                let he = plasticity::elastic_gradient(h, &state.plastic);
                self.law.isochoric_stress(he) * (DMat3::IDENTITY + state.plastic.inverse_flow).transpose()
            }
        };
        if let Some(fibres) = &self.fibres {
            p += fibres.first_piola_kirchhoff(h);
        }
        p
    }

    /// `F^-1 P_iso`; below J = 0.2, where the point is as good as inverted, with J = 0.2.
    fn second_piola_kirchhoff(h: DMat3, p: DMat3) -> DMat3 {
        let f = DMat3::IDENTITY + h;
        let s = cofactor(f).transpose() * p * (1.0 / (1.0 + jacobian_minus_one(h)).max(0.2));
        (s + s.transpose()) * 0.5
    }

    fn viscous_sum(state: &PointState) -> DMat3 {
        state.viscous.iter().fold(DMat3::ZERO, |sum, q| sum + *q)
    }

    /// Brings the history to this step. Returns false where the return mapping failed.
    pub fn advance(&self, h: DMat3, volumetric_energy: f64, around: &Surroundings, state: &mut PointState) -> bool {
        let decay = |term: &viscoelastic::Term| term.is_due(around.step, around.dt).then(|| term.decay(around.dt));
        self.advance_terms(h, volumetric_energy, around, state, &decay)
    }

    /// The same with every Prony term advanced by `around.dt`, for steps of any size and changing size.
    pub fn advance_every_term(
        &self,
        h: DMat3,
        volumetric_energy: f64,
        around: &Surroundings,
        state: &mut PointState,
    ) -> bool {
        let decay = |term: &viscoelastic::Term| Some(-(-around.dt / term.time).exp_m1());
        self.advance_terms(h, volumetric_energy, around, state, &decay)
    }

    /// `decay`: 1 - e^-x of a term that is due.
    fn advance_terms(
        &self,
        h: DMat3,
        volumetric_energy: f64,
        around: &Surroundings,
        state: &mut PointState,
        decay: &dyn Fn(&viscoelastic::Term) -> Option<f64>,
    ) -> bool {
        let before = self.degradation(state, around.length);
        let mut met = true;
        if let Some(params) = &self.plasticity {
            let flow = plasticity::return_mapping(&self.law, params, h, &mut state.plastic);
            state.plastic_dissipation += around.remaining * (1.0 - before) * flow.dissipation;
            met = !flow.failed;
        }
        let intact = around.remaining * (1.0 - self.degradation(state, around.length));
        if let Some(params) = &self.viscoelastic
            && params.terms.iter().any(|t| decay(t).is_some())
        {
            let s = Self::second_piola_kirchhoff(h, self.isochoric_stress(h, state));
            let strain = (h + h.transpose() + h.transpose() * h) * 0.5;
            state.viscous.resize(params.terms.len(), DMat3::ZERO);
            for (term, q) in params.terms.iter().zip(&mut state.viscous) {
                if let Some(decay) = decay(term) {
                    let dq = (s * term.ratio - *q) * decay;
                    *q += dq;
                    state.viscous_work += intact * double_dot(strain, dq);
                }
            }
        }
        let grown = self.degradation(state, around.length) - before;
        if grown > 0.0 {
            let energy = self.free_energy(h, volumetric_energy, state) + around.other_energy;
            state.damage_dissipation += around.remaining * grown * energy;
        }
        if !self.own.is_empty() {
            self.advance_own(h, around.dt, intact, state);
        }
        met
    }

    /// First Piola-Kirchhoff stress [Pa] for H = F - I of a point that keeps the part `intact` of its stiffness.
    pub fn stress(&self, h: DMat3, volumetric: Volumetric, intact: f64, state: &PointState) -> DMat3 {
        let f = DMat3::IDENTITY + h;
        let mut p = self.isochoric_stress(h, state);
        if self.viscoelastic.is_some() {
            p -= f * Self::viscous_sum(state);
        }
        for (effect, point, memory) in self.own_points(h, 0.0, state) {
            p += (effect.law.stress)(&point, &memory);
        }
        p * intact + cofactor(f) * volumetric.stress
    }

    /// `W - q:E` of the undamaged point [J/m^3].
    fn free_energy(&self, h: DMat3, volumetric_energy: f64, state: &PointState) -> f64 {
        let he = match self.plasticity {
            None => h,
            Some(_) => plasticity::elastic_gradient(h, &state.plastic),
        };
        let mut energy = self.law.isochoric_energy(he) + volumetric_energy;
        if let Some(fibres) = &self.fibres {
            energy += fibres.energy_density(h);
        }
        if self.viscoelastic.is_some() {
            let strain = (h + h.transpose() + h.transpose() * h) * 0.5;
            energy -= double_dot(Self::viscous_sum(state), strain);
        }
        for (effect, point, memory) in self.own_points(h, 0.0, state) {
            energy += (effect.law.energy)(&point, &memory);
        }
        energy
    }

    /// Energies of a point that keeps the part `intact` of its stiffness.
    pub fn energy(&self, h: DMat3, volumetric_energy: f64, intact: f64, state: &PointState) -> PointEnergy {
        let held: f64 = match &self.viscoelastic {
            None => 0.0,
            Some(params) => {
                let held = |(t, q): (&viscoelastic::Term, &DMat3)| {
                    norm_squared(*q) / (4.0 * self.law.shear_modulus() * t.ratio.max(1e-12))
                };
                params.terms.iter().zip(&state.viscous).map(held).sum()
            }
        };
        PointEnergy {
            stored: intact * (self.free_energy(h, volumetric_energy, state) + held),
            viscous_stored: intact * held,
        }
    }

    /// Bound of the isochoric tangent modulus for the stable step; flow and relaxation only lower it.
    pub fn tangent_bound(&self, h: DMat3, state: &PointState) -> TangentBound {
        let mut bound = match self.plasticity {
            None => self.law.tangent_bound(h),
            Some(_) => self.law.tangent_bound(plasticity::elastic_gradient(h, &state.plastic)),
        };
        bound.straight += self.fibres.map_or(0.0, |fibres| fibres.tangent_bound(h));
        for (effect, point, memory) in self.own_points(h, 0.0, state) {
            bound.straight += (effect.law.tangent)(&point, &memory);
        }
        bound
    }

    /// Where the elastic law or the fibres follow a continuation; `None` where both are what their equations say.
    pub fn continuation(&self, h: DMat3, state: &PointState) -> Option<Continuation> {
        let he = match self.plasticity {
            None => h,
            Some(_) => plasticity::elastic_gradient(h, &state.plastic),
        };
        let capped = self.fibres.is_some_and(|fibres| fibres.is_capped(h)).then_some(Continuation::Exponent);
        self.law.continuation(he).or(capped)
    }

    /// True where a point of this material remembers something.
    pub fn has_history(&self) -> bool {
        self.plasticity.is_some() || self.viscoelastic.is_some() || !self.own.is_empty()
    }
}
