//! Material points of a block in lanes: flow, fibres, relaxation and damage, in the order of `src/material_point.rs`. What the points remember
//! lies in rows of f32 while a frame is computed; between frames it is in the points of the state.

// Adapters of iterators are not inlined into functions for a vector unit: each operation becomes a call.
#![allow(clippy::needless_range_loop)]

use glam::{DMat3, DVec3};
use pulp::Simd;

use super::number::Lanes;
use crate::effects::damage::DamageInLanes;
use crate::effects::fibres::FibresInLanes;
use crate::effects::plasticity::in_lanes::{Flowing, Yield, composed, return_mapping};
use crate::effects::viscoelastic::{LARGEST_TERM_COUNT, held_by_strain, second_piola_kirchhoff, take_out};
use crate::material::regular::{LawAnswer, LawInLanes, Regular};
use crate::material_point::{Material, PointState};
use crate::number::{Number, Tensor};

/// f32 per cell: G - I by columns and alpha.
const PLASTIC: usize = 10;
/// f32 per cell and symmetric tensor.
const SYMMETRIC: usize = 6;
/// f32 per cell of what a frame has booked, per rest volume: dissipated by flow and by degradation, sum E:dq [J/m^3], failed returns.
const BOOKED: usize = 4;
/// A yield stress and an onset of damage beyond everything.
const NEVER: f32 = 1e30;

/// Constants of a material, as a vector needs them: those of effects that it lacks do nothing.
#[derive(Debug, Clone, Copy)]
struct Constants {
    yielding: [f32; 3],
    fibres: [f32; 5],
    damage: [f32; 4],
    ratios: [f32; LARGEST_TERM_COUNT],
    /// 1/(4 mu0 g) [1/Pa].
    compliances: [f32; LARGEST_TERM_COUNT],
}

impl Constants {
    fn of(material: &Material) -> Self {
        let (mut ratios, mut compliances) = ([0.0; LARGEST_TERM_COUNT], [0.0; LARGEST_TERM_COUNT]);
        for (n, term) in material.viscoelastic.iter().flat_map(|v| &v.terms).enumerate() {
            ratios[n] = term.ratio as f32;
            compliances[n] = (0.25 / (material.law.shear_modulus() * term.ratio.max(1e-12))) as f32;
        }
        let shear_modulus = material.law.shear_modulus() as f32;
        Constants {
            yielding: match &material.plasticity {
                Some(p) => [p.yield_stress as f32, p.hardening as f32, shear_modulus],
                None => [NEVER, 0.0, shear_modulus],
            },
            fibres: match &material.fibres {
                Some(f) => {
                    let DVec3 { x, y, z } = f.direction;
                    [x, y, z, f.k1, f.k2].map(|value| value as f32)
                }
                None => [1.0, 0.0, 0.0, 0.0, 1.0],
            },
            damage: match &material.damage {
                Some(d) => {
                    let at_largest = if d.deletion { 1.0 } else { d.largest };
                    [d.onset, 1.0 / d.failure_displacement, d.largest, at_largest].map(|value| value as f32)
                }
                None => [NEVER, 0.0, 1.0, 1.0],
            },
            ratios,
            compliances,
        }
    }
}

/// What the materials of a model need of a point beside the elastic law.
pub(super) struct Points {
    constants: Vec<Constants>,
    has_plasticity: bool,
    has_fibres: bool,
    has_damage: bool,
    /// Most Prony terms of a material.
    terms: usize,
    /// f32 of a row of one number.
    stride: usize,
    /// `1 - e^-x` of every term of every material that is due in the step at hand, zero of the others.
    decays: Vec<[f32; LARGEST_TERM_COUNT]>,
    /// Whether histories are brought forward.
    advances: bool,
}

/// Numbers of a row of points.
pub(super) type PointRow<'a> = &'a mut [f32];

impl Points {
    /// `None` where all materials are elastic.
    pub fn new(materials: &[Material], stride: usize) -> Option<Self> {
        let any = |has: fn(&Material) -> bool| materials.iter().any(has);
        let has_fibres = any(|m| m.fibres.is_some());
        if !has_fibres && !any(Material::has_history) {
            return None;
        }
        Some(Points {
            constants: materials.iter().map(Constants::of).collect(),
            has_plasticity: any(|m| m.plasticity.is_some()),
            has_fibres,
            has_damage: any(|m| m.damage.is_some()),
            terms: materials.iter().flat_map(|m| &m.viscoelastic).map(|v| v.terms.len()).max().unwrap_or(0),
            stride,
            decays: vec![[0.0; LARGEST_TERM_COUNT]; materials.len()],
            advances: false,
        })
    }

    /// What the next step does: it advances histories by `dt` [s] as the step of this number, or (`None`) only looks.
    pub fn prepare(&mut self, materials: &[Material], advance: Option<(f64, u64)>) {
        self.advances = advance.is_some();
        for (decays, material) in self.decays.iter_mut().zip(materials) {
            *decays = [0.0; LARGEST_TERM_COUNT];
            let Some((dt, step)) = advance else { continue };
            for (decay, term) in decays.iter_mut().zip(material.viscoelastic.iter().flat_map(|v| &v.terms)) {
                *decay = if term.is_due(step, dt) { term.decay(dt) as f32 } else { 0.0 };
            }
        }
    }

    /// f32 of a row of points; zero where nothing is remembered.
    pub fn row_length(&self) -> usize {
        self.numbers() * self.stride
    }

    fn numbers(&self) -> usize {
        let plastic = if self.has_plasticity { PLASTIC } else { 0 };
        let viscous = if self.terms > 0 { SYMMETRIC * (1 + self.terms) } else { 0 };
        if plastic + viscous == 0 { 0 } else { plastic + viscous + BOOKED }
    }

    /// First number of the sum of q_i, followed by the terms.
    fn viscous(&self) -> usize {
        if self.has_plasticity { PLASTIC } else { 0 }
    }

    /// First number of what was booked.
    fn booked(&self) -> usize {
        self.numbers() - BOOKED
    }

    /// Takes in the points of a row of cells.
    pub fn take(&self, points: &[PointState], row: PointRow) {
        row.fill(0.0);
        for (i, point) in points.iter().enumerate() {
            self.set(point, i, row);
        }
    }

    /// Gives the points of a row of cells what they have become, and how many returns failed in this frame.
    pub fn give(&self, row: PointRow, points: &mut [PointState]) -> u32 {
        points.iter_mut().enumerate().map(|(i, point)| self.give_one(row, i, point)).sum()
    }

    /// The same of the point in the place `i` of a row.
    pub fn give_one(&self, row: PointRow, i: usize, point: &mut PointState) -> u32 {
        self.get(row, i, point);
        let mut booked = [0.0; BOOKED];
        for (number, value) in booked.iter_mut().enumerate() {
            *value = f64::from(std::mem::take(&mut row[(self.booked() + number) * self.stride + i]));
        }
        point.plastic_dissipation += booked[0];
        point.damage_dissipation += booked[1];
        point.viscous_work += booked[2];
        booked[3] as u32
    }

    /// One point in f64, without what was booked before.
    pub fn point(&self, row: &[f32], i: usize) -> PointState {
        let mut point = PointState::default();
        self.get(row, i, &mut point);
        point
    }

    /// Takes it in again, with what it has booked since [`Points::point`], and whether its return was met.
    pub fn put_back(&self, point: &PointState, met: bool, i: usize, row: PointRow) {
        if self.numbers() == 0 {
            return;
        }
        self.set(point, i, row);
        let failed = if met { 0.0 } else { 1.0 };
        let booked = [point.plastic_dissipation, point.damage_dissipation, point.viscous_work, failed];
        for (number, value) in booked.into_iter().enumerate() {
            row[(self.booked() + number) * self.stride + i] += value as f32;
        }
    }

    fn get(&self, row: &[f32], i: usize, point: &mut PointState) {
        let value = |number: usize| f64::from(row[number * self.stride + i]);
        if self.has_plasticity {
            point.plastic.inverse_flow = DMat3::from_cols_array(&std::array::from_fn(value));
            point.plastic.alpha = value(PLASTIC - 1);
        }
        if self.terms > 0 {
            point.viscous.resize(self.terms, DMat3::ZERO);
            for (term, q) in point.viscous.iter_mut().enumerate() {
                let first = self.viscous() + SYMMETRIC * (1 + term);
                let [xx, yy, zz, yz, zx, xy] = std::array::from_fn(|n| value(first + n));
                *q = DMat3::from_cols_array(&[xx, xy, zx, xy, yy, yz, zx, yz, zz]);
            }
        }
    }

    /// Takes in the point in the place `i` of a row.
    pub fn set(&self, point: &PointState, i: usize, row: PointRow) {
        let mut put = |number: usize, value: f64| row[number * self.stride + i] = value as f32;
        if self.has_plasticity {
            let flow = point.plastic.inverse_flow.to_cols_array();
            flow.into_iter().enumerate().for_each(|(number, value)| put(number, value));
            put(PLASTIC - 1, point.plastic.alpha);
        }
        if self.terms > 0 {
            let mut sum = [0.0; SYMMETRIC];
            for (term, q) in point.viscous.iter().enumerate() {
                let entries = [q.x_axis.x, q.y_axis.y, q.z_axis.z, q.y_axis.z, q.z_axis.x, q.x_axis.y];
                for (number, value) in entries.into_iter().enumerate() {
                    put(self.viscous() + SYMMETRIC * (1 + term) + number, value);
                    sum[number] += value;
                }
            }
            sum.into_iter().enumerate().for_each(|(number, value)| put(self.viscous() + number, value));
        }
    }
}

/// The points of a vector.
pub(super) struct VectorPoints<'a, 'b, S: Simd> {
    points: &'a Points,
    row: &'b mut [f32],
    i: usize,
    yielding: Yield<Lanes<S>>,
    fibres: FibresInLanes<Lanes<S>>,
    damage: DamageInLanes<Lanes<S>>,
    /// Material of every lane.
    kinds: [usize; super::WIDEST],
    is_uniform: bool,
}

/// Stress of the points, without pressure, and what goes with it.
pub(super) struct PointAnswer<S: Simd> {
    /// [Pa]
    pub stress: Tensor<Lanes<S>>,
    /// Bounds of the tangent, straight and turned [Pa].
    pub tangent: [Lanes<S>; 2],
    /// Part of the stiffness that is left.
    pub intact: Lanes<S>,
}

/// Energies of the points per rest volume, and what is left of them.
pub(super) struct PointEnergy<S: Simd> {
    /// Stored, with what the Prony terms hold, and that alone [J/m^3].
    pub stored: Lanes<S>,
    pub held: Lanes<S>,
    /// d, and the part of the stiffness that is left.
    pub damage: Lanes<S>,
    pub intact: Lanes<S>,
}

/// What surrounds the points of a vector.
pub(super) struct Around<S: Simd> {
    /// Edges of the cells [m], and the stiffness that a path left of them.
    pub length: Lanes<S>,
    pub kept: Lanes<S>,
    /// Hourglass energy per volume [J/m^3].
    pub other_energy: Lanes<S>,
    pub bulk_modulus: Lanes<S>,
}

impl<'a, 'b, S: Simd> VectorPoints<'a, 'b, S> {
    /// Those of the cells from `i` on of a row; `kind`: material of the cell at a place in the row, of `count` cells.
    #[inline(always)]
    pub fn new(
        simd: S,
        points: &'a Points,
        row: &'b mut [f32],
        (i, count): (usize, usize),
        is_uniform: bool,
        kind: impl Fn(usize) -> usize,
    ) -> Self {
        let mut kinds = [kind(i); super::WIDEST];
        if !is_uniform {
            for lane in 0..Lanes::<S>::COUNT.min(count - i) {
                kinds[lane] = kind(i + lane);
            }
        }
        let first = points.constants[kinds[0]];
        let mut yielding = [Lanes::splat(simd, 0.0); 3];
        let mut fibres = [Lanes::splat(simd, 0.0); 5];
        let mut damage = [Lanes::splat(simd, 0.0); 4];
        for n in 0..3 {
            yielding[n] = Lanes::splat(simd, first.yielding[n]);
        }
        for n in 0..5 {
            fibres[n] = Lanes::splat(simd, first.fibres[n]);
        }
        for n in 0..4 {
            damage[n] = Lanes::splat(simd, first.damage[n]);
        }
        if !is_uniform {
            let mut values = [0.0f32; super::WIDEST];
            for n in 0..12 {
                for lane in 0..super::WIDEST {
                    let of = &points.constants[kinds[lane]];
                    values[lane] = match n {
                        0..3 => of.yielding[n],
                        3..8 => of.fibres[n - 3],
                        _ => of.damage[n - 8],
                    };
                }
                let lanes = Lanes::load(simd, &values, 0);
                match n {
                    0..3 => yielding[n] = lanes,
                    3..8 => fibres[n - 3] = lanes,
                    _ => damage[n - 8] = lanes,
                }
            }
        }
        VectorPoints {
            points,
            row,
            i,
            yielding: Yield { stress: yielding[0], hardening: yielding[1], shear_modulus: yielding[2] },
            fibres: FibresInLanes { direction: [fibres[0], fibres[1], fibres[2]], k1: fibres[3], k2: fibres[4] },
            damage: DamageInLanes {
                onset: damage[0],
                inverse_displacement: damage[1],
                largest: damage[2],
                at_largest: damage[3],
            },
            kinds,
            is_uniform,
        }
    }

    #[inline(always)]
    fn load(&self, simd: S, number: usize) -> Lanes<S> {
        Lanes::load(simd, self.row, number * self.points.stride + self.i)
    }

    #[inline(always)]
    fn store(&mut self, number: usize, value: Lanes<S>) {
        value.store(self.row, number * self.points.stride + self.i);
    }

    /// A constant of every material in the lanes of these.
    #[inline(always)]
    fn of_materials(&self, simd: S, value: impl Fn(usize) -> f32) -> Lanes<S> {
        if self.is_uniform {
            return Lanes::splat(simd, value(self.kinds[0]));
        }
        let mut values = [0.0f32; super::WIDEST];
        for lane in 0..super::WIDEST {
            values[lane] = value(self.kinds[lane]);
        }
        Lanes::load(simd, &values, 0)
    }

    /// Energies of the points in the state of H, of a path that left `kept` of their stiffness; `None` where a lane has left the range of these
    /// forms.
    #[inline(always)]
    pub fn energy(
        &self,
        simd: S,
        law: &LawInLanes<Lanes<S>>,
        state: &Regular<Lanes<S>>,
        around: &Around<S>,
    ) -> Option<PointEnergy<S>> {
        let points = self.points;
        let zero = Lanes::splat(simd, 0.0);
        let one = Lanes::splat(simd, 1.0);
        let (h, twice_strain) = state.strain();
        let (mut elastic, mut alpha) = (*state, zero);
        if points.has_plasticity {
            let mut g = [[zero; 3]; 3];
            for a in 0..3 {
                for b in 0..3 {
                    g[a][b] = self.load(simd, 3 * a + b);
                }
            }
            alpha = self.load(simd, PLASTIC - 1);
            elastic = Regular::new(composed(h, &g))?;
        }
        let half = Lanes::splat(simd, 0.5);
        let mut stored = law.energy(&elastic, zero)? + half * around.bulk_modulus * state.dj * state.dj;
        if points.has_fibres {
            let mut unused = [[zero; 3]; 3];
            let [_, energy] = self.fibres.add(state, &state.cofactor(), &mut unused)?;
            stored = stored + energy;
        }
        let mut held = zero;
        if points.terms > 0 {
            let mut sum = [zero; SYMMETRIC];
            for n in 0..SYMMETRIC {
                sum[n] = self.load(simd, points.viscous() + n);
            }
            stored = stored - held_by_strain(&sum, twice_strain);
            for term in 0..points.terms {
                let compliance = self.of_materials(simd, |kind| points.constants[kind].compliances[term]);
                let mut squares = zero;
                for n in 0..SYMMETRIC {
                    let q = self.load(simd, points.viscous() + SYMMETRIC * (1 + term) + n);
                    let twice = if n < 3 { q } else { q + q };
                    squares = q.mul_add(twice, squares);
                }
                held = held + compliance * squares;
            }
        }
        let damage = match points.has_damage {
            true => self.damage.degradation(alpha, around.length),
            false => zero,
        };
        let intact = around.kept * (one - damage);
        Some(PointEnergy { stored: intact * (stored + held), held: intact * held, damage, intact })
    }

    /// Stress in the state of H, with histories brought forward as [`Points::prepare`] said; `None` where a lane has left the range of these
    /// forms: then nothing has changed.
    #[inline(always)]
    pub fn answer(
        &mut self,
        simd: S,
        law: &LawInLanes<Lanes<S>>,
        state: &Regular<Lanes<S>>,
        around: &Around<S>,
    ) -> Option<PointAnswer<S>> {
        let points = self.points;
        let zero = Lanes::splat(simd, 0.0);
        let one = Lanes::splat(simd, 1.0);
        let (h, twice_strain) = state.strain();
        let mut flow = Flowing { inverse_flow: [[zero; 3]; 3], alpha: zero, dissipation: zero, failed: zero };
        let mut before = zero;
        let LawAnswer { state: elastic, mut stress, slopes, of_powers } = match points.has_plasticity {
            true => {
                for a in 0..3 {
                    for b in 0..3 {
                        flow.inverse_flow[a][b] = self.load(simd, 3 * a + b);
                    }
                }
                flow.alpha = self.load(simd, PLASTIC - 1);
                before = flow.alpha;
                return_mapping(law, &self.yielding, h, &mut flow, points.advances)?
            }
            false => law.answer(h)?,
        };
        let cof = state.cofactor();
        let [mut straight, turned] = elastic.tangent_bound(&slopes, around.bulk_modulus);
        straight = straight + of_powers;
        let mut of_fibres = zero;
        if points.has_fibres {
            let [tangent, energy] = self.fibres.add(state, &cof, &mut stress)?;
            straight = straight + tangent;
            of_fibres = energy;
        }
        let mut intact = around.kept;
        let mut degraded = [zero; 2];
        if points.has_damage {
            degraded =
                [self.damage.degradation(before, around.length), self.damage.degradation(flow.alpha, around.length)];
            intact = intact * (one - degraded[1]);
        }
        let mut work = zero;
        let mut sum = [zero; SYMMETRIC];
        let mut terms = [[zero; SYMMETRIC]; LARGEST_TERM_COUNT];
        let mut is_due = [false; LARGEST_TERM_COUNT];
        if points.terms > 0 {
            let viscous = points.viscous();
            for n in 0..SYMMETRIC {
                sum[n] = self.load(simd, viscous + n);
            }
            let mut second = None;
            for term in 0..points.terms {
                let decay = self.of_materials(simd, |kind| points.decays[kind][term]);
                if decay.is_within(0.0, 0.0) {
                    continue;
                }
                is_due[term] = true;
                let s = match second {
                    Some(s) => s,
                    None => second_piola_kirchhoff(state, &cof, &stress),
                };
                second = Some(s);
                let ratio = self.of_materials(simd, |kind| points.constants[kind].ratios[term]);
                let mut change = [zero; SYMMETRIC];
                for n in 0..SYMMETRIC {
                    let q = self.load(simd, viscous + SYMMETRIC * (1 + term) + n);
                    change[n] = (s[n] * ratio - q) * decay;
                    terms[term][n] = q + change[n];
                    sum[n] = sum[n] + change[n];
                }
                work = work + held_by_strain(&change, twice_strain);
            }
            take_out(&sum, h, &mut stress);
        }
        let mut lost = zero;
        let grown = degraded[1] - degraded[0];
        if points.has_damage && !grown.is_within(0.0, 0.0) {
            let half = Lanes::splat(simd, 0.5);
            let volumetric = half * around.bulk_modulus * state.dj * state.dj;
            let energy = law.energy(&elastic, zero)? + volumetric + of_fibres - held_by_strain(&sum, twice_strain);
            lost = around.kept * grown * (energy + around.other_energy);
        }
        // Nothing is written before this line.
        let flowed = points.has_plasticity && !flow.dissipation.is_within(0.0, 0.0);
        if flowed || !flow.failed.is_within(0.0, 0.0) {
            for a in 0..3 {
                for b in 0..3 {
                    self.store(3 * a + b, flow.inverse_flow[a][b]);
                }
            }
            self.store(PLASTIC - 1, flow.alpha);
            let booked = points.booked();
            let dissipated = around.kept * (one - degraded[0]) * flow.dissipation;
            for (number, value) in [(0, dissipated), (1, lost), (3, flow.failed)] {
                let sum = self.load(simd, booked + number) + value;
                self.store(booked + number, sum);
            }
        }
        let mut relaxed = false;
        for term in 0..points.terms {
            if is_due[term] {
                relaxed = true;
                for n in 0..SYMMETRIC {
                    self.store(points.viscous() + SYMMETRIC * (1 + term) + n, terms[term][n]);
                }
            }
        }
        if relaxed {
            for n in 0..SYMMETRIC {
                self.store(points.viscous() + n, sum[n]);
            }
            let booked = points.booked() + 2;
            let sum = self.load(simd, booked) + intact * work;
            self.store(booked, sum);
        }
        Some(PointAnswer { stress, tangent: [straight, turned], intact })
    }
}
