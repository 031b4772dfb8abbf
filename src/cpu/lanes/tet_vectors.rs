//! Groups of tetrahedra one after the other, in vectors of slots: displacement gradient and change of volume, then stress, forces and
//! bounds.

// Adapters of iterators are not inlined into functions for a vector unit: each operation becomes a call.
#![allow(clippy::needless_range_loop)]

use glam::DVec3;
use pulp::{Simd, WithSimd};

use super::corners::GRADIENT;
use super::number::Lanes;
use super::points::{Around, Points, VectorPoints};
use super::tets::{NO_CELL, Place, SHAPE, TetShapes};
use super::{LaneMaterial, WIDEST};
use crate::engine::elements::{CellInput, CellShape, Elements};
use crate::material::kinematics::jacobian_minus_one;
use crate::material::regular::LEAST_J;
use crate::material::regular::{LawInLanes, Regular, dot};
use crate::material_point::Volumetric;
use crate::mesh::Mesh;
use crate::model::Model;
use crate::number::{Number, Tensor};

/// Where numbers of [`TetShapes::constants`] stand.
const LENGTH: usize = 9;
const VOLUME: usize = 13;

/// What the first stage reads.
pub(super) struct Deformed<'a> {
    pub shapes: &'a TetShapes,
    pub places: &'a [Place],
    pub displacement: &'a [DVec3],
    pub mesh: &'a Mesh,
}

impl Deformed<'_> {
    /// H and `V_e/4 (J_e - 1)` of the groups from `first` on.
    pub fn compute(&self, first: usize, gradients: &mut [f32], changes: &mut [f32]) {
        self.shapes.arch.dispatch(DeformedGroups { input: self, first, gradients, changes });
    }

    /// The changes of volume of slots, one by one in f64.
    #[cold]
    fn one_by_one(&self, first: usize, changes: &mut [f32]) {
        for (cell, change) in self.shapes.cells[first..].iter().zip(changes).filter(|(cell, _)| **cell != NO_CELL) {
            let shape = CellShape::new(self.mesh, *cell as usize);
            let dj = jacobian_minus_one(shape.displacement_gradient(&shape.gather(self.displacement)));
            *change = (0.25 * shape.volume * dj) as f32;
        }
    }
}

struct DeformedGroups<'a> {
    input: &'a Deformed<'a>,
    first: usize,
    gradients: &'a mut [f32],
    changes: &'a mut [f32],
}

impl WithSimd for DeformedGroups<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let DeformedGroups { input, first, gradients, changes } = self;
        let mut edges = [0.0f32; GRADIENT * WIDEST];
        for group in 0..changes.len() / WIDEST {
            let first = (first + group) * WIDEST;
            let gradients = &mut gradients[group * GRADIENT * WIDEST..][..GRADIENT * WIDEST];
            let changes = &mut changes[group * WIDEST..][..WIDEST];
            gather_edges(input.places, &input.shapes.corners[first..first + WIDEST], &mut edges);
            let constants = &input.shapes.constants[first * SHAPE..][..SHAPE * WIDEST];
            let mut i = 0;
            while i < WIDEST {
                if !deform(simd, constants, &edges, i, gradients, changes) {
                    input.one_by_one(first + i, &mut changes[i..i + Lanes::<S>::COUNT]);
                }
                i += Lanes::<S>::COUNT;
            }
        }
    }
}

/// Displacement of the last three corners from the first, by corner and axis.
#[inline(always)]
fn gather_edges(places: &[Place], corners: &[[u32; 4]], edges: &mut [f32; GRADIENT * WIDEST]) {
    for i in 0..WIDEST {
        let nodes = corners[i];
        let origin = places[nodes[0] as usize].0;
        for corner in 0..3 {
            let place = places[nodes[corner + 1] as usize].0;
            for axis in 0..3 {
                edges[(3 * corner + axis) * WIDEST + i] = (place[axis] - origin[axis]) as f32;
            }
        }
    }
}

/// H and the change of volume of one vector; false where the latter has left the range of these forms.
#[inline(always)]
fn deform<S: Simd>(
    simd: S,
    constants: &[f32],
    edges: &[f32],
    i: usize,
    gradients: &mut [f32],
    changes: &mut [f32],
) -> bool {
    let mut h = [[Lanes::splat(simd, 0.0); 3]; 3];
    for b in 0..3 {
        for axis in 0..3 {
            for corner in 0..3 {
                let edge = Lanes::load(simd, edges, (3 * corner + axis) * WIDEST + i);
                let gradient = Lanes::load(simd, constants, (3 * corner + b) * WIDEST + i);
                h[b][axis] = if corner == 0 { edge * gradient } else { edge.mul_add(gradient, h[b][axis]) };
            }
            h[b][axis].store(gradients, (3 * b + axis) * WIDEST + i);
        }
    }
    let Some(state) = Regular::new(h) else { return false };
    let share = Lanes::load(simd, constants, VOLUME * WIDEST + i) * Lanes::splat(simd, 0.25);
    (share * state.dj).store(changes, i);
    true
}

/// What the stage of the forces reads.
pub(super) struct Forces<'a> {
    pub shapes: &'a TetShapes,
    pub gradients: &'a [f32],
    pub pressures: &'a [f32],
    pub model: &'a Model,
    pub elements: &'a Elements,
    pub displacement: &'a [DVec3],
    /// What material points need beside the elastic law; `None`: nothing.
    pub points: Option<&'a Points>,
    /// Step [s] and number of the step that histories are brought forward to; `None`: they stay.
    pub advance: Option<(f64, u64)>,
}

impl Forces<'_> {
    /// Forces and bounds on the corners of the groups from `first` on; `histories`: what their points remember.
    pub fn compute(&self, first: usize, forces: &mut [[f32; 4]], histories: &mut [f32]) {
        self.shapes.arch.dispatch(ForcedGroups { input: self, first, forces, histories });
    }

    /// The same of the slots from `i` on in the group that begins with `first`, one by one in f64, with these means of the pressures at their
    /// corners.
    #[cold]
    fn one_by_one(&self, (first, i): (usize, usize), means: &[f32], forces: &mut [[f32; 4]], history: &mut [f32]) {
        let cells = self.shapes.cells[first + i..].iter().zip(&self.shapes.remaining[first + i..]);
        let slots = (i..).zip(cells.zip(means).zip(forces.chunks_exact_mut(4)));
        for (i, (((cell, remaining), mean), forces)) in slots.filter(|(_, (((cell, _), _), _))| **cell != NO_CELL) {
            let remaining = f64::from(*remaining);
            let cell = *cell as usize;
            let shape = CellShape::new(&self.model.mesh, cell);
            let dj = jacobian_minus_one(shape.displacement_gradient(&shape.gather(self.displacement)));
            let flat = (1.0 + dj - self.elements.flat_below()).min(0.0);
            let stress = f64::from(*mean) + remaining * self.model.material(cell).law.bulk_modulus * flat;
            // The energy serves damage, which lanes do not know here.
            let averaged = Some(Volumetric { stress, energy: 0.0 });
            let mut point = self.points.map(|points| points.point(history, i));
            let input = CellInput { averaged, remaining, point: point.as_mut(), advance: self.advance };
            let (of_cell, met) = self.elements.corner_forces(self.model, cell, self.displacement, input);
            if let (Some(points), Some(point), true) = (self.points, &point, self.advance.is_some()) {
                points.put_back(point, met, i, history);
            }
            for (corner, numbers) in forces.iter_mut().enumerate() {
                let [x, y, z] = of_cell.force[corner].as_vec3().to_array();
                *numbers = [x, y, z, of_cell.bound[corner] as f32];
            }
        }
    }
}

struct ForcedGroups<'a> {
    input: &'a Forces<'a>,
    first: usize,
    forces: &'a mut [[f32; 4]],
    histories: &'a mut [f32],
}

impl WithSimd for ForcedGroups<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let ForcedGroups { input, first, forces, histories } = self;
        let Forces { shapes, gradients, pressures, .. } = *input;
        let mut means = [0.0f32; WIDEST];
        let mut rows = [0.0f32; 16 * WIDEST];
        let groups = forces.as_chunks_mut::<{ 4 * WIDEST }>().0;
        for group in 0..groups.len() {
            let forces = &mut groups[group];
            let kind = shapes.group_material[first + group] as usize;
            let material = &shapes.materials[kind];
            let length = input.points.map_or(0, Points::row_length);
            let history = &mut histories[group * length..(group + 1) * length];
            let first = (first + group) * WIDEST;
            let corners = &shapes.corners[first..first + WIDEST];
            for i in 0..WIDEST {
                let [a, b, c, d] = corners[i];
                let low = pressures[a as usize] + pressures[b as usize];
                means[i] = 0.25 * (low + (pressures[c as usize] + pressures[d as usize]));
            }
            let of_group = Group {
                constants: &shapes.constants[first * SHAPE..][..SHAPE * WIDEST],
                gradients: &gradients[first * GRADIENT..][..GRADIENT * WIDEST],
                means: &means,
                remaining: &shapes.remaining[first..first + WIDEST],
                flat_below: input.elements.flat_below(),
                weakened: shapes.weakened && shapes.remaining[first..first + WIDEST].iter().any(|left| *left != 1.0),
            };
            let mut exact = [false; WIDEST];
            let mut i = 0;
            while i < WIDEST {
                exact[i] = !match input.points {
                    None => lane_forces::<S, false>(simd, material, &of_group, i, None, &mut rows),
                    Some(points) => {
                        let points = VectorPoints::new(simd, points, history, (i, WIDEST), true, |_| kind);
                        lane_forces::<S, true>(simd, material, &of_group, i, Some(points), &mut rows)
                    }
                };
                i += Lanes::<S>::COUNT;
            }
            transpose(&rows, forces);
            for i in 0..WIDEST {
                if exact[i] {
                    let end = i + Lanes::<S>::COUNT;
                    input.one_by_one((first, i), &means[i..end], &mut forces[4 * i..4 * end], history);
                }
            }
        }
    }
}

struct Group<'a> {
    constants: &'a [f32],
    gradients: &'a [f32],
    means: &'a [f32],
    /// Part of its stiffness that a path has left, of every slot, and whether it has taken any.
    remaining: &'a [f32],
    weakened: bool,
    /// J below which a cell has a pressure of its own.
    flat_below: f64,
}

/// From rows of slots by corner and number to numbers by slot and corner. (Shuffles of four by four came out no faster.)
#[inline(always)]
fn transpose(rows: &[f32; 16 * WIDEST], forces: &mut [[f32; 4]; 4 * WIDEST]) {
    for i in 0..WIDEST {
        for corner in 0..4 {
            for number in 0..4 {
                forces[4 * i + corner][number] = rows[(4 * corner + number) * WIDEST + i];
            }
        }
    }
}

/// Forces and bounds of a vector; false where a cell has left the range of these forms. `points`: with `POINTS`, where material points do
/// more than the elastic law.
#[inline(always)]
fn lane_forces<S: Simd, const POINTS: bool>(
    simd: S,
    material: &LaneMaterial,
    group: &Group,
    i: usize,
    points: Option<VectorPoints<S>>,
    rows: &mut [f32],
) -> bool {
    let zero = Lanes::splat(simd, 0.0);
    let mut h = [[zero; 3]; 3];
    let mut gradient = [[zero; 3]; 3];
    for b in 0..3 {
        for axis in 0..3 {
            h[b][axis] = Lanes::load(simd, group.gradients, (3 * b + axis) * WIDEST + i);
            gradient[b][axis] = Lanes::load(simd, group.constants, (3 * b + axis) * WIDEST + i);
        }
    }
    let Some(state) = Regular::new(h) else { return false };
    let volume = Lanes::load(simd, group.constants, VOLUME * WIDEST + i);
    let (mut exponential, mut powers) = (None, None);
    if let Some(of_material) = &material.exponential {
        exponential = Some(of_material.in_lanes(volume));
    }
    if let Some(of_material) = &material.powers {
        powers = Some(of_material.in_lanes(volume));
    }
    let all = LawInLanes { polynomial: material.law.in_lanes(volume), exponential, powers };
    let Some(law) = all.slopes_at(&state) else { return false };
    let mut pressure = Lanes::load(simd, group.means, i);
    // The mean pressure carries over from neighbours that may be intact.
    let law_left = match group.weakened {
        true => law.weakened(Lanes::load(simd, group.remaining, i)),
        false => law,
    };
    if group.flat_below > LEAST_J {
        let flat = (state.dj + volume.of(1.0 - group.flat_below)).smaller(zero);
        let own = volume.of(material.bulk_modulus) * Lanes::load(simd, group.remaining, i);
        pressure = own.mul_add(flat, pressure);
    }
    let bulk = Lanes::splat(simd, material.bulk_modulus as f32);
    let mut p = [[zero; 3]; 3];
    let (mut straight, mut turned) = (zero, zero);
    if POINTS {
        let Some(mut points) = points else { return false };
        let kept = Lanes::load(simd, group.remaining, i);
        let around = Around { length: zero, kept, other_energy: zero, bulk_modulus: bulk };
        let Some(answer) = points.answer(simd, &all, &state, &around) else { return false };
        [straight, turned] = answer.tangent;
        let cof = state.cofactor();
        for b in 0..3 {
            for axis in 0..3 {
                p[b][axis] = cof[b][axis].mul_add(pressure, answer.intact * answer.stress[b][axis]);
            }
        }
    } else {
        p = state.stress(&law_left, pressure);
    }
    let mut of_powers = zero;
    if let Some(powers) = &all.powers
        && !POINTS
    {
        let Some((added, bound)) = state.stress_and_bound_of_powers(powers) else { return false };
        of_powers = bound;
        let left = if group.weakened { Lanes::load(simd, group.remaining, i) } else { Lanes::splat(simd, 1.0) };
        for b in 0..3 {
            for axis in 0..3 {
                p[b][axis] = left.mul_add(added[b][axis], p[b][axis]);
            }
        }
    }
    let force = at_corners(p, gradient);
    for corner in 0..4 {
        for axis in 0..3 {
            (force[corner][axis] * volume).store(rows, (4 * corner + axis) * WIDEST + i);
        }
    }
    if !POINTS {
        [straight, turned] = state.tangent_bound(&law, bulk);
        straight = straight + of_powers;
    }
    let cof = at_corners(state.cofactor(), gradient);
    let (mut turning, mut shearing) = ([zero; 4], [zero; 4]);
    for corner in 0..4 {
        turning[corner] = dot(cof[corner], cof[corner]).root();
        shearing[corner] = Lanes::load(simd, group.constants, (LENGTH + corner) * WIDEST + i);
    }
    let by_turning = volume * (bulk + turned) * (turning[0] + turning[1] + turning[2] + turning[3]);
    let by_shearing = volume * straight * (shearing[0] + shearing[1] + shearing[2] + shearing[3]);
    for corner in 0..4 {
        let bound = by_turning.mul_add(turning[corner], by_shearing * shearing[corner]);
        bound.store(rows, (4 * corner + 3) * WIDEST + i);
    }
    true
}

/// `T B_i` of all corners from the `B_i` of the last three: those of all four have the sum zero.
#[inline(always)]
fn at_corners<N: Number>(tensor: Tensor<N>, gradient: [[N; 3]; 3]) -> [[N; 3]; 4] {
    let [x, y, z] = tensor;
    let mut all = [x; 4];
    for corner in 0..3 {
        let [bx, by, bz] = gradient[corner];
        for axis in 0..3 {
            all[corner + 1][axis] = bx.mul_add(x[axis], by.mul_add(y[axis], bz * z[axis]));
        }
    }
    for axis in 0..3 {
        all[0][axis] = all[1][axis].of(0.0) - (all[1][axis] + all[2][axis] + all[3][axis]);
    }
    all
}
