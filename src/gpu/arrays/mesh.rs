//! Nodes, cells and the step: what every scene has.

use bytemuck::Zeroable;
use glam::DVec3;

use super::super::structs::{
    CellEdge, CentreLine, DriveStep, GravityParams, MeshNode, Params, StepInput, Tetrahedron, TiedNode,
};
use super::{Array, Life, Place, bytes_of, read_all, to_bytes, vec4, vector, zeros};
use crate::engine::elements::PrismBase;
use crate::gpu::layout::Layout;
use crate::mesh::BlockMesh;
use crate::model::Model;

/// One fixed-point unit of displacement, 2^-36 m.
pub const DISPLACEMENT_UNIT: f64 = 1.0 / (1u64 << 36) as f64;

/// Name of the uniform that changes from step to step and is bound with a dynamic offset.
pub const STEP_INPUT: &str = "step_input";

/// Bytes from the input of one step to that of the next: the default limits let a device ask for offsets in multiples of 256.
pub const STEP_STRIDE: usize = size_of::<StepInput>().next_multiple_of(256);

pub(super) const ARRAYS: &[Array] = &[
    Array::constant("params", |s| bytes_of(&[params(s.model, s.dt)])),
    Array::new(STEP_INPUT, Life::Input, |s| zeros(s.max_steps.max(1) as u64, STEP_STRIDE)),
    Array::constant("gravity", |s| {
        let g = s.model.effects.gravity.map_or(DVec3::ZERO, |g| g.acceleration);
        bytes_of(&[GravityParams { acceleration: vec4(g / s.model.mass_scaling()) }])
    }),
    Array::constant("cell_edges", |s| bytes_of(&cell_edges(s.model))).at(Place::Sampled(4)),
    Array::constant("node_mass", |s| bytes_of(&s.model.node_mass.iter().map(|m| *m as f32).collect::<Vec<_>>()))
        .at(Place::Sampled(1)),
    Array::constant("node_load", |s| bytes_of(&s.model.node_load.iter().map(|f| vec4(*f)).collect::<Vec<_>>())),
    Array::constant("grid_lines", |s| {
        bytes_of(&s.model.mesh.block().lines.iter().flatten().map(|x| *x as f32).collect::<Vec<_>>())
    })
    .at(Place::Sampled(1)),
    Array::constant("busy_nodes", |s| bytes_of(&busy_nodes(s.model).concat())).at(Place::Sampled(1)),
    Array::constant("tied_nodes", |s| bytes_of(&tied_nodes(s.model))).at(Place::Sampled(4)),
    Array::constant("tetrahedra", |s| bytes_of(&tetrahedra(s.model, s.layout))).at(Place::Sampled(4)),
    Array::constant("mesh_nodes", |s| bytes_of(&mesh_nodes(s.model, s.layout))).at(Place::Sampled(4)),
    Array::constant("node_cells", |s| bytes_of(&s.layout.fours().cells)).at(Place::Sampled(4)),
    Array::state("node_displacement", |s| zeros(s.nodes(), 16)).at(Place::Texels).exchanged(
        |bytes, _, state| {
            state.displacement = read_all(bytes).map(displacement).collect();
            // 0 before the first step.
            state.inertia = read_all::<[f32; 4]>(bytes).map(|u| u[3].max(1.0)).collect();
        },
        |_, state| {
            let fixed = |x: f64| (x / DISPLACEMENT_UNIT).round() as i32;
            let bits = |inertia: &f32| inertia.to_bits() as i32;
            let nodes = state.displacement.iter().zip(&state.inertia);
            let u = nodes.map(|(u, inertia)| [fixed(u.x), fixed(u.y), fixed(u.z), bits(inertia)]);
            to_bytes(&u.collect::<Vec<[i32; 4]>>())
        },
    ),
    Array::state("node_velocity", |s| zeros(s.nodes(), 16)).at(Place::Texels).exchanged(
        |bytes, _, state| state.velocity = read_all(bytes).map(vector).collect(),
        |_, state| to_bytes(&state.velocity.iter().map(|v| vec4(*v)).collect::<Vec<_>>()),
    ),
    Array::state("corner_force", |s| zeros(s.layout.slot_count(), 16)).at(Place::Texels),
    Array::state("node_cures", |s| zeros(s.nodes(), 16)),
    Array::state("node_work", |s| zeros(s.nodes(), 4)),
    Array::state("cell_dilatation", |s| zeros(s.cells() + 1, 4)),
    Array::state("cell_bulk_stiffness", |s| zeros(s.cells() + 1, 4)),
    Array::state("pressed_nodes", |s| zeros(s.nodes(), 16)),
    Array::state("node_dilatation", |s| zeros(s.nodes(), 4)),
];

/// Groups of 64 nodes among which one moves: the place of each, and a bit per node that stands still.
pub fn busy_nodes(model: &Model) -> Vec<[u32; 3]> {
    let count = model.mesh.node_count();
    let stands = |node: usize| model.composition.held.get(node).is_some_and(|held| *held);
    let group = |group: usize| {
        let mut words = [group as u32, 0, 0];
        for lane in (0..64).filter(|lane| group * 64 + lane >= count || stands(group * 64 + lane)) {
            words[1 + lane / 32] |= 1 << (lane % 32);
        }
        words
    };
    (0..count.div_ceil(64)).map(group).filter(|words| words[1..] != [u32::MAX; 2]).collect()
}

/// Edges of the cells along the axes, and of columns that are no boxes.
fn cell_edges(model: &Model) -> Vec<CellEdge> {
    let block = model.mesh.block();
    let mut edges: Vec<CellEdge> = block
        .lines
        .iter()
        .flat_map(|l| l.windows(2).map(|w| w[1] - w[0]))
        .map(|d| CellEdge {
            length: d as f32,
            cube_root: d.cbrt() as f32,
            // A gap between two copies of a line carries nothing.
            quarter_inverse: if d > 0.0 { (0.25 / d) as f32 } else { 0.0 },
            _pad: 0.0,
        })
        .collect();
    if block.bore.is_some() {
        edges.extend(bent_columns(block));
    }
    edges
}

fn params(model: &Model, dt: f64) -> Params {
    let solver = &model.scene.solver;
    Params {
        quartic: solver.hourglass_quartic as f32,
        dt: dt as f32,
        mass_damping: solver.mass_damping as f32,
        speed_limit: model.speed_limit(dt) as f32,
    }
}

/// Cells at rest with the slots of their forces.
fn tetrahedra(model: &Model, layout: &Layout) -> Vec<Tetrahedron> {
    let Some(mesh) = model.mesh.as_tets() else { return Vec::new() };
    let with = |v: DVec3, w: f64| [v.x as f32, v.y as f32, v.z as f32, w as f32];
    (0..mesh.tets.len())
        .map(|cell| {
            let [_, b, c, d] = mesh.gradients(cell);
            let volume = mesh.volume(cell);
            Tetrahedron {
                nodes: mesh.tets[cell],
                slots: layout.fours().slots[cell],
                gradient_b_and_volume: with(b, volume),
                gradient_c_and_edge: with(c, volume.cbrt()),
                gradient_d_and_material: with(d, model.material_index(cell) as f64),
            }
        })
        .collect()
}

fn mesh_nodes(model: &Model, layout: &Layout) -> Vec<MeshNode> {
    let Some(mesh) = model.mesh.as_tets() else { return Vec::new() };
    let volume = mesh.node_volumes();
    let (low, high) = mesh.bounds();
    let first = &layout.fours().first;
    (0..mesh.positions.len())
        .map(|node| MeshNode {
            arm: vec4(mesh.positions[node] - 0.5 * (low + high)),
            first_four: first[node],
            end_four: first[node + 1],
            flags: model.node_flags[node],
            inverse_volume: (1.0 / volume[node]) as f32,
        })
        .collect()
}

/// Two vectors per column, in the layout that `shared/bent_column` reads.
fn bent_columns(block: &BlockMesh) -> Vec<CellEdge> {
    let [nx, ny, _] = block.cells();
    let vector = |v: [f64; 4]| {
        let [length, cube_root, quarter_inverse, _pad] = v.map(|v| v as f32);
        CellEdge { length, cube_root, quarter_inverse, _pad }
    };
    (0..nx * ny)
        .flat_map(|cell| {
            let base = PrismBase::new(block, cell);
            let [xi, eta] = base.gradients;
            [vector([xi.x, xi.y, eta.x, eta.y]), vector([base.taper.x, base.taper.y, base.area, base.area.cbrt()])]
        })
        .collect()
}

fn tied_nodes(model: &Model) -> Vec<TiedNode> {
    (0..model.mesh.node_count())
        .map(|node| {
            let mut copies = [u32::MAX; 4];
            let own = [node as u32];
            let tied = model.separation.tied(node).unwrap_or(&own);
            copies.iter_mut().zip(tied).for_each(|(place, copy)| *place = *copy);
            let whole: f64 = tied.iter().map(|n| model.node_mass[*n as usize]).sum();
            TiedNode { copies, mass: model.node_mass[node] as f32, whole_mass: whole as f32, ..Zeroable::zeroed() }
        })
        .collect()
}

/// A displacement in fixed point [m].
pub fn displacement(u: [i32; 4]) -> DVec3 {
    DVec3::new(u[0].into(), u[1].into(), u[2].into()) * DISPLACEMENT_UNIT
}

/// The input of step `number` in the layout of the shader. `origin`: where the piece of a laid path ahead of the tip begins to count [m].
pub fn step_input(input: &crate::engine::StepInput, number: u64, dt: f64, origin: Option<DVec3>) -> StepInput {
    // Multiples of the golden ratio: any run of steps sees all offsets alike, so rounding errors cancel.
    const GOLDEN: f64 = 0.618_033_988_749_895;
    let mut out = StepInput {
        load_factor: input.load_factor as f32,
        step: input.step as u32,
        // Below 1 in f32 too, so that a face at rest stays at rest.
        rounding: ((number as f64 * GOLDEN).fract() as f32).min(0.999_999),
        ..StepInput::zeroed()
    };
    if let Some(pose) = input.pose {
        let with = |v: DVec3, w: f64| [v.x as f32, v.y as f32, v.z as f32, w as f32];
        let spin = pose.angular_velocity;
        out.tip = with(pose.tip, spin.x);
        out.velocity = with(pose.velocity, spin.y);
        out.direction = with(pose.direction, spin.z);
        out.velocity_ahead = vec4(pose.velocity_ahead);
        out.angular_velocity_ahead = vec4(pose.angular_velocity_ahead);
        out.depth = origin.map_or(pose.depth, |origin| (pose.tip - origin).dot(pose.direction)) as f32;
    }
    for (out, drive) in out.drives.iter_mut().zip(&input.drives) {
        *out = DriveStep {
            translation_rate: vec4(drive.translation / dt),
            cosine_rate: (drive.cosine / dt) as f32,
            sine_rate: (drive.sine / dt) as f32,
            _pad0: 0.0,
            _pad1: 0.0,
        };
    }
    out
}

/// The centre-line of a frame in the layout of the shader.
pub fn centre_line(line: &crate::needle::centre_line::CentreLine) -> CentreLine {
    CentreLine {
        per_length: (1.0 / line.spacing) as f32,
        first_step: line.first_step as u32,
        offset: line.offset.map(vec4),
        rate: line.rate.map(vec4),
        ..Zeroable::zeroed()
    }
}
