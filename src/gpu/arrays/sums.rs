//! What a frame tells: partial sums of the measuring stages, added in f64.

use glam::DVec3;

use super::super::structs::{CellSums, ContactSums, NodeSums, SeparationSums, TipState};
use super::{Array, Sums, read_all, vector, zeros};

/// Partial sums per face of `measure_faces`.
pub const FACE_PARTS: usize = 64;

/// Partial sums of `measure_separation`.
pub const SEPARATION_PARTS: usize = 64;

/// Partial sums of `measure_contact`.
pub const CONTACT_PARTS: usize = 64;

pub(super) const ARRAYS: &[Array] = &[
    Array::result("cell_sums", |s| zeros(s.grain.measured_sums().into(), size_of::<CellSums>()), add_cells),
    Array::result("node_sums", |s| zeros(s.grain.measured_sums().into(), size_of::<NodeSums>()), add_nodes),
    Array::result("contact_totals", |_| zeros(CONTACT_PARTS as u64, size_of::<ContactSums>()), add_contact),
    Array::result(
        "face_sums",
        |_| zeros(6 * FACE_PARTS as u64, 16),
        |bytes, out| {
            for (index, s) in read_all::<[f32; 4]>(bytes).enumerate() {
                out.sums.reactions[index / FACE_PARTS] += vector(s);
                out.sums.face_moments[index / FACE_PARTS] += f64::from(s[3]);
            }
        },
    ),
    Array::result(
        "separation_sums",
        |_| zeros(SEPARATION_PARTS as u64, size_of::<SeparationSums>()),
        |bytes, out| {
            for s in read_all::<SeparationSums>(bytes) {
                out.sums.energy.cohesive += f64::from(s.dissipation);
                out.sums.energy.cohesive_stored += f64::from(s.stored);
                out.sums.health.torn_area += f64::from(s.torn_area);
            }
        },
    ),
    Array::result(
        "needle_loads",
        |_| zeros(CONTACT_PARTS as u64, 16),
        |bytes, out| {
            for (load, s) in out.sums.needle_loads.iter_mut().zip(read_all(bytes)) {
                *load = vector(s);
            }
        },
    ),
    Array::result("tip_result", |_| zeros(1, size_of::<TipState>()), add_tip),
];

fn add_cells(bytes: &[u8], out: &mut Sums) {
    let sums = &mut out.sums;
    for s in read_all::<CellSums>(bytes) {
        sums.energy.elastic += f64::from(s.elastic);
        sums.energy.hourglass += f64::from(s.hourglass);
        sums.health.min_j = sums.health.min_j.min(f64::from(s.min_jacobian));
        sums.health.min_corner_j = sums.health.min_corner_j.min(f64::from(s.min_corner_jacobian));
        sums.health.inverted_cells += s.inverted_cells;
        sums.health.folded_cells += s.folded_cells;
        sums.health.not_finite |= s.overstretched_cells > 0;
        sums.energy.plastic += f64::from(s.flow);
        sums.energy.damage += f64::from(s.degradation);
        sums.energy.viscous += f64::from(s.relaxation);
        sums.health.largest_damage = sums.health.largest_damage.max(1.0 - f64::from(s.least_intact));
        sums.health.deleted_cells += s.deleted_cells;
        sums.health.return_failures += s.failures as u32;
        if s.inverted_cells > 0 {
            sums.health.inverted_cell.get_or_insert(s.inverted_cell);
        }
    }
}

fn add_nodes(bytes: &[u8], out: &mut Sums) {
    let sums = &mut out.sums;
    for s in read_all::<NodeSums>(bytes) {
        sums.energy.kinetic += f64::from(s.kinetic);
        sums.energy.half_step += out.has_steps * f64::from(s.half_step);
        sums.energy.damping += f64::from(s.damping);
        sums.load_work += f64::from(s.work);
        out.moment += DVec3::new(s.moment_x.into(), s.moment_y.into(), s.moment_z.into());
        sums.health.max_speed = sums.health.max_speed.max(f64::from(s.max_speed));
        sums.health.raised_mass += s.raised_mass;
        sums.health.clamped_nodes += s.clamped_nodes;
        sums.energy.raised_mass += f64::from(s.raised_energy);
        sums.energy.speed_limit += f64::from(s.clamped_energy);
        sums.step_ratio = sums.step_ratio.max(f64::from(s.step_ratio));
        sums.health.not_finite |= s.out_of_range > 0;
    }
}

fn add_contact(bytes: &[u8], out: &mut Sums) {
    let sums = &mut out.sums;
    for s in read_all::<ContactSums>(bytes) {
        sums.impulse += vector(s.impulse);
        // What the tool does until the middle of the last step goes into the springs of contact.
        sums.energy.half_step += out.has_steps * 0.5 * f64::from(s.impulse[3]);
        sums.angular_impulse += vector(s.angular_impulse);
        let [cutting, spreading, sliding, shaft] = s.parts.map(f64::from);
        sums.cutting_impulse += cutting;
        sums.spreading_impulse += spreading;
        sums.friction_impulse += sliding;
        sums.shaft_impulse += shaft;
        let [work, sliding, damping, stored] = s.energies.map(f64::from);
        sums.tool_work += work;
        sums.energy.friction += sliding;
        sums.energy.contact_damping += damping;
        sums.energy.contact_stored += stored;
    }
}

fn add_tip(bytes: &[u8], out: &mut Sums) {
    let sums = &mut out.sums;
    for s in read_all::<TipState>(bytes) {
        sums.tip_coordinate = f64::from(s.coordinate);
        sums.energy.tip += f64::from(s.dissipation);
        sums.energy.advance_cap = f64::from(s.cap_dissipation);
        sums.energy.softening = f64::from(s.softening);
        sums.energy.contact_stored += f64::from(s.spring_energy);
        sums.membrane_impulse = f64::from(s.membrane_impulse);
        sums.adhesion_impulse = f64::from(s.bond_impulse);
        sums.energy.adhesion = f64::from(s.bond_dissipation);
        // The contact nodes have booked the whole force of the anchors.
        sums.cutting_impulse -= sums.membrane_impulse + sums.adhesion_impulse;
    }
}
