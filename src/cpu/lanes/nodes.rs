//! The step of the nodes of cells in lanes, line by line.
//!
//! Most nodes are free, carry no load and stay below the limits. Their step is
//! `v+ = (a v + kick) c, u+ = u + dt v+` with `kick = f dt/m`: one loop over the components of a line. All others of the line take the step
//! of the f64 engine afterwards. Copies that are tied have the force and the mass of all of them, summed in one order, so that they stay
//! together to the last bit.

use glam::DVec3;
use pulp::{Arch, Simd, WithSimd};

use super::WIDEST;
use crate::cpu::integrate_nodes::{NodeStep, NodeSums};
use crate::cpu::team::Team;
use crate::effects::mass_scaling::{MOST_RAISED, RAISED_STEP_RATIO, change_of_mass};
use crate::engine::WATCHED_STEP_RATIO;
use crate::engine::elements::CellForces;
use crate::model::{HELD, Model};
use crate::separation::NO_TIE;

/// f32 per node: force of every axis, and the bound.
pub(super) const NODE: usize = 4;

/// Force (-f_int) [N] and stiffness bound [N/m] of every node, in lines of nodes: a row of every number per line.
pub(super) struct NodeLines {
    /// Nodes of a line (fewer in the last, where they do not fill it), and f32 of a row.
    width: usize,
    stride: usize,
    pub numbers: Vec<f32>,
    /// Groups of tied copies in compressed rows, in the order of the model.
    tie_starts: Vec<u32>,
    copies: Vec<TiedCopy>,
}

/// One of the copies of a node that move as one.
#[derive(Debug, Clone, Copy)]
struct TiedCopy {
    node: u32,
    /// Where its first number stands.
    first: u32,
}

impl NodeLines {
    pub fn new(model: &Model, width: usize, stride: usize) -> Self {
        let lines = model.mesh.node_count().div_ceil(width);
        let mut lines = NodeLines {
            width,
            stride,
            numbers: vec![0.0; lines * NODE * stride],
            tie_starts: vec![0],
            copies: Vec::new(),
        };
        for tie in &model.separation.ties {
            let copy = |node: &u32| TiedCopy { node: *node, first: lines.first_number(*node as usize) as u32 };
            let copies: Vec<_> = tie.iter().map(copy).collect();
            lines.copies.extend(copies);
            lines.tie_starts.push(lines.copies.len() as u32);
        }
        lines
    }

    pub fn bytes(&self) -> usize {
        size_of_val(self.numbers.as_slice())
            + size_of_val(self.tie_starts.as_slice())
            + size_of_val(self.copies.as_slice())
    }

    /// f32 of a row.
    pub fn stride(&self) -> usize {
        self.stride
    }

    /// Where the first number of a node stands; the next follow a row later each.
    pub fn first_number(&self, node: usize) -> usize {
        node / self.width * NODE * self.stride + node % self.width
    }

    /// Force on a node (-f_int) [N] and its stiffness bound [N/m].
    pub fn at(&self, node: usize) -> (DVec3, f64) {
        self.from(self.first_number(node))
    }

    /// The same, where the first number of the node stands.
    #[inline(always)]
    fn from(&self, first: usize) -> (DVec3, f64) {
        let value = |number: usize| f64::from(self.numbers[first + number * self.stride]);
        (DVec3::new(value(0), value(1), value(2)), value(3))
    }

    /// What acts on the copies of a group: force [N], bound [N/m] and mass [kg] of all.
    #[inline(always)]
    fn of_tie(&self, step: &NodeStep, tie: usize) -> (DVec3, f64, f64) {
        let copies = &self.copies[self.tie_starts[tie] as usize..self.tie_starts[tie + 1] as usize];
        let (mut force, mut bound, mut mass) = (DVec3::ZERO, 0.0, 0.0);
        for copy in copies {
            let (of_cells, bound_of_cells) = self.from(copy.first as usize);
            let node = copy.node as usize;
            let added = step.added.at(node);
            force += of_cells + added.0;
            bound += bound_of_cells + added.1;
            mass += step.model.node_mass[node];
        }
        (force, bound, mass)
    }

    /// Adds forces of a cell (with the sign of f_int) and its bounds.
    pub fn add(&mut self, nodes: &[usize], forces: &CellForces) {
        for (corner, node) in nodes.iter().enumerate() {
            let first = self.first_number(*node);
            for axis in 0..3 {
                self.numbers[first + axis * self.stride] -= forces.force[corner][axis] as f32;
            }
            self.numbers[first + 3 * self.stride] += forces.bound[corner] as f32;
        }
    }

    /// Moves all nodes: displacement, velocity and mass over that at rest; sums of the lines, in their order: those of parts would hang on the size of the team.
    /// `places`: what cells read of the displacement of every line, and what brings it up to date.
    pub fn integrate<P: Send>(
        &self,
        arch: Arch,
        team: &Team,
        step: &NodeStep,
        (displacement, velocity, inertia): Moved,
        (mut places, keep): (Vec<&mut [P]>, impl Fn(&mut [P], &[DVec3]) + Sync),
    ) -> Vec<NodeSums> {
        let (width, stride) = (self.width, self.stride);
        // Copies that are tied stand in other lines.
        let any = |node: usize| self.at(node);
        let is_plain = step.model.node_load.is_empty();
        let part = team.part(places.len());
        let moved = displacement.chunks_mut(part * width).zip(velocity.chunks_mut(part * width));
        let nodes = moved.zip(inertia.chunks_mut(part * width));
        let lines = places.chunks_mut(part).zip(self.numbers.chunks(part * NODE * stride));
        let items: Vec<_> = nodes.zip(lines).collect();
        let of_parts = team.map(items, |number, (((u, v), inertia), (places, numbers))| {
            let mut scratch = Scratch::new(width);
            let mut all = Vec::with_capacity(places.len());
            let lines = places.iter_mut().zip(numbers.chunks_exact(NODE * stride));
            let moved = u.chunks_mut(width).zip(v.chunks_mut(width)).zip(inertia.chunks_mut(width));
            for (i, ((places, numbers), ((u, v), inertia))) in lines.zip(moved).enumerate() {
                let first = (number * part + i) * width;
                let line = NodeLine { all: self, numbers };
                let mut sums = NodeSums::default();
                if is_plain {
                    arch.dispatch(PlainLine {
                        step,
                        first,
                        line,
                        moved: (u, v, inertia),
                        scratch: &mut scratch,
                        sums: &mut sums,
                    });
                } else {
                    scratch.others.clear();
                    scratch.others.extend((0..u.len()).map(|i| (i, u[i], v[i])));
                }
                for (i, old_u, old_v) in scratch.others.drain(..) {
                    (u[i], v[i]) = (old_u, old_v);
                    sums.add(&step.advance(first + i, any, (&mut u[i], &mut v[i], &mut inertia[i])));
                }
                keep(places, u);
                all.push(sums);
            }
            all
        });
        of_parts.into_iter().flatten().collect()
    }
}

/// The numbers of one line.
#[derive(Clone, Copy)]
struct NodeLine<'a> {
    all: &'a NodeLines,
    numbers: &'a [f32],
}

impl<'a> NodeLine<'a> {
    /// Forces of the cells on its nodes (-f_int) [N], by axis, and their stiffness bounds [N/m].
    #[inline(always)]
    fn rows(&self, count: usize) -> [&'a [f32]; NODE] {
        let mut rows = [&self.numbers[..count]; NODE];
        for (number, row) in rows.iter_mut().enumerate() {
            *row = &self.numbers[number * self.all.stride..][..count];
        }
        rows
    }
}

/// What a step changes of nodes: displacement and velocity [m, m/s], mass over that at rest.
pub type Moved<'a> = (&'a mut [DVec3], &'a mut [DVec3], &'a mut [f32]);

/// Arrays of a line, with room for a vector behind it: per component kick, new velocity, mass, raised part of it and weight, these the share
/// of a tied copy; nodes that are not plain, as they were.
struct Scratch {
    kick: Vec<f64>,
    new: Vec<f64>,
    mass: Vec<f64>,
    raised: Vec<f64>,
    weight: Vec<f64>,
    /// What is added at nodes where nothing is.
    no_force: Vec<DVec3>,
    no_bound: Vec<f64>,
    others: Vec<(usize, DVec3, DVec3)>,
    /// Nodes whose mass is another than before: over that at rest, and that at rest [kg].
    changed: Vec<(usize, f32, f64)>,
}

impl Scratch {
    fn new(width: usize) -> Self {
        let zeros = vec![0.0; 3 * width + WIDEST];
        Scratch {
            kick: zeros.clone(),
            new: zeros.clone(),
            mass: zeros.clone(),
            raised: zeros.clone(),
            weight: zeros,
            no_force: vec![DVec3::ZERO; width],
            no_bound: vec![0.0; width],
            others: Vec::new(),
            changed: Vec::new(),
        }
    }
}

#[inline(always)]
fn load<S: Simd>(values: &[f64], at: usize) -> S::f64s {
    bytemuck::pod_read_unaligned(bytemuck::cast_slice(&values[at..at + S::F64_LANES]))
}

struct PlainLine<'a, 'b> {
    step: &'a NodeStep<'b>,
    first: usize,
    line: NodeLine<'a>,
    moved: Moved<'a>,
    scratch: &'a mut Scratch,
    sums: &'a mut NodeSums,
}

impl WithSimd for PlainLine<'_, '_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let PlainLine { step, first, line, moved: (u, v, inertia), scratch, sums } = self;
        let NodeStep { model, dt, gravity, .. } = *step;
        let Scratch { kick, new, mass, raised, weight, no_force, no_bound, others, changed } = scratch;
        let falls = gravity != DVec3::ZERO;
        others.clear();
        changed.clear();
        let count = u.len();
        let masses = &model.node_mass[first..first + count];
        let nothing = (&no_force[..count], &no_bound[..count]);
        let (external, added_bound) = step.added.within(first..first + count).unwrap_or(nothing);
        // Factor of a bound that raises the mass, and largest ratio of bound and mass that is not watched.
        let (raise, watched) = (dt * dt / (4.0 * RAISED_STEP_RATIO), 4.0 * WATCHED_STEP_RATIO / (dt * dt));
        let raise = if model.effects.mass_scaling.is_some() { raise } else { 0.0 };
        let mut more = 0;
        let is_driven = model.has_driven_faces();
        let flags = &model.node_flags[first..first + count];
        let [fx, fy, fz, bounds] = line.rows(count);
        // Nothing of an earlier line stands behind a shorter one.
        kick[3 * count..].fill(0.0);
        mass[3 * count..].fill(0.0);
        raised[3 * count..].fill(0.0);
        let ties = model.separation.tie_of.get(first..first + count).unwrap_or(&[]);
        let numbers = kick.as_chunks_mut::<3>().0[..count]
            .iter_mut()
            .zip(mass.as_chunks_mut::<3>().0)
            .zip(raised.as_chunks_mut::<3>().0);
        for (i, ((kick, mass), raised)) in numbers.enumerate() {
            let (force, bound, own, share) = match ties.get(i) {
                Some(tie) if *tie != NO_TIE => {
                    let (force, bound, all) = line.all.of_tie(step, *tie as usize);
                    (force, bound, all, masses[i] / all)
                }
                _ => {
                    let of_cells = DVec3::new(f64::from(fx[i]), f64::from(fy[i]), f64::from(fz[i]));
                    (of_cells + external[i], f64::from(bounds[i]) + added_bound[i], masses[i], 1.0)
                }
            };
            let all = (bound * raise).max(own).min(MOST_RAISED * own);
            let stands = flags[i] & HELD == HELD && !is_driven && v[i] == DVec3::ZERO;
            if (flags[i] & HELD != 0 && !stands) || bound > watched * all {
                others.push((i, u[i], v[i]));
                (*kick, *mass, *raised) = ([0.0; 3], [0.0; 3], [0.0; 3]);
                continue;
            }
            more += u32::from(all > own);
            if stands {
                (*kick, *mass, *raised) = ([0.0; 3], [0.0; 3], [0.0; 3]);
                continue;
            }
            let now = (all / own) as f32;
            if now != inertia[i] {
                changed.push((i, now, share * own));
            }
            let by = dt / all;
            let force = if falls { force + gravity * own } else { force };
            *kick = [force.x * by, force.y * by, force.z * by];
            (*mass, *raised) = ([share * all; 3], [share * (all - own); 3]);
        }
        if falls {
            // Of what is moved here; what is not has no mass in its place.
            for ((weight, own), mass) in
                weight.as_chunks_mut::<3>().0.iter_mut().zip(masses).zip(mass.as_chunks::<3>().0)
            {
                *weight = if mass[0] > 0.0 { (gravity * *own).to_array() } else { [0.0; 3] };
            }
            weight[3 * count..].fill(0.0);
        }
        let alpha = model.scene.solver.mass_damping;
        let (a, c) = (1.0 - 0.5 * alpha * dt, 1.0 / (1.0 + 0.5 * alpha * dt));
        let old: &mut [f64] = bytemuck::cast_slice_mut(v);
        let places: &mut [f64] = bytemuck::cast_slice_mut(u);
        let lanes = S::F64_LANES;
        new[..old.len()].copy_from_slice(old);
        new[old.len()..].fill(0.0);
        // What a change of the mass takes, as `advance_node` has it.
        let mut taken = 0.0;
        for (i, now, own) in changed.iter() {
            let mut ratio = inertia[*i];
            let slowed = change_of_mass(&mut ratio, f64::from(*now));
            for (v, (kick, mass)) in new[3 * i..][..3].iter_mut().zip(kick[3 * i..].iter().zip(&mass[3 * i..])) {
                let came = *v;
                *v *= slowed;
                taken += 0.5 * (own * (came * came - *v * *v) + mass * kick * (came - *v));
            }
        }
        let zero = simd.splat_f64s(0.0);
        let (mut damped, mut gained, mut fastest, mut fallen) = (zero, zero, zero, zero);
        let (a_s, c_s, half) = (simd.splat_f64s(a), simd.splat_f64s(c), simd.splat_f64s(0.5));
        for at in (0..old.len()).step_by(lanes) {
            let before: S::f64s = load::<S>(new, at);
            let after = simd.mul_f64s(simd.mul_add_f64s(before, a_s, load::<S>(kick, at)), c_s);
            let mid = simd.mul_f64s(half, simd.add_f64s(before, after));
            damped = simd.mul_add_f64s(load::<S>(mass, at), simd.mul_f64s(mid, mid), damped);
            if falls {
                fallen = simd.mul_add_f64s(load::<S>(weight, at), mid, fallen);
            }
            // after^2 - before^2 = 2 mid (after - before)
            let grown = simd.mul_f64s(mid, simd.sub_f64s(after, before));
            gained = simd.mul_add_f64s(load::<S>(raised, at), grown, gained);
            fastest = simd.max_f64s(fastest, simd.max_f64s(after, simd.sub_f64s(zero, after)));
            new[at..at + lanes].copy_from_slice(bytemuck::cast_slice(std::slice::from_ref(&after)));
        }
        let (damped, gained) = (simd.reduce_sum_f64s(damped), simd.reduce_sum_f64s(gained));
        let fastest = simd.reduce_max_f64s(fastest);
        // The limit is one of the whole velocity: what may be beyond it, or is not a number, takes the other way.
        let largest = step.limit / 3f64.sqrt();
        if !(fastest < largest && damped.is_finite()) {
            others.clear();
            others
                .extend((0..count).map(|i| (i, DVec3::from_slice(&places[3 * i..]), DVec3::from_slice(&old[3 * i..]))));
            return;
        }
        sums.raised += more;
        sums.damping += alpha * dt * damped;
        sums.raised_energy += gained + taken;
        for (i, now, _) in changed.iter() {
            inertia[*i] = *now;
        }
        if falls {
            sums.work += dt * simd.reduce_sum_f64s(fallen);
        }
        for ((place, old), new) in places.iter_mut().zip(old).zip(new.iter()) {
            *old = *new;
            *place += *new * dt;
        }
    }
}
