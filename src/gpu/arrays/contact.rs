//! The touch of a tool: nodes that it may meet, what they remember, and the numbers of the effects that act there.

use bytemuck::Zeroable;
use glam::DVec3;

use super::super::structs::{CentreLine, ContactNode, ContactRecord, IndentationParams};
use super::{Array, Life, Place, bytes_of, read_all, to_bytes, vec4, vector, zeros};
use crate::effects::parameters::ShaderNumbers;
use crate::engine::ContactState;
use crate::gpu::layout::Layout;
use crate::mesh::Mesh;
use crate::model::{ContactSurface, Model};
use crate::needle::Tool;

pub(super) const ARRAYS: &[Array] = &[
    Array::constant("adhesion", |s| bytes_of(&s.model.effects.adhesion.unwrap_or_default().packed())),
    Array::constant("friction", |s| bytes_of(&s.model.effects.friction.unwrap_or_default().packed())),
    Array::new("centre_line", Life::Input, |_| zeros(1, size_of::<CentreLine>())),
    Array::constant("indentation", |s| bytes_of(&[indentation_params(s.model)])),
    Array::constant("contact_nodes", |s| bytes_of(&contact_nodes(s.model, s.layout))).at(Place::Sampled(4)),
    Array::state("contact_records", |s| zeros(s.model.contact_nodes.len().max(1) as u64, size_of::<ContactRecord>()))
        .at(Place::Texels)
        .exchanged(
            |bytes, _, state| state.contact = read_all(bytes).map(contact_state).collect(),
            |_, state| to_bytes(&state.contact.iter().map(contact_record).collect::<Vec<_>>()),
        ),
];

fn contact_state(m: ContactRecord) -> ContactState {
    let [overlap, axial_on, touching, on_shaft] = m.touch;
    let [passed, rest_radius, damping_y, damping_z] = m.path;
    ContactState {
        stick: vector(m.stick),
        overlap: overlap.into(),
        axial_on: axial_on.into(),
        touching: touching != 0.0,
        on_shaft: on_shaft != 0.0,
        rest_radius: rest_radius.into(),
        passed: passed != 0.0,
        damping: DVec3::new(m.stick[3].into(), damping_y.into(), damping_z.into()),
        stored: m.energies[3].into(),
    }
}

fn contact_record(c: &ContactState) -> ContactRecord {
    let one = |yes: bool| if yes { 1.0 } else { 0.0 };
    ContactRecord {
        stick: [c.stick.x as f32, c.stick.y as f32, c.stick.z as f32, c.damping.x as f32],
        touch: [c.overlap as f32, c.axial_on as f32, one(c.touching), one(c.on_shaft)],
        energies: [0.0, 0.0, 0.0, c.stored as f32],
        path: [one(c.passed), c.rest_radius as f32, c.damping.y as f32, c.damping.z as f32],
        ..Zeroable::zeroed()
    }
}

fn indentation_params(model: &Model) -> IndentationParams {
    let (radius, flat, bonded) = match model.scene.tool {
        Some(Tool::Sphere { radius }) => (radius, false, false),
        Some(Tool::FlatPunch { radius, bonded }) => (radius, true, bonded),
        _ => (0.0, false, false),
    };
    IndentationParams {
        radius: radius as f32,
        face_stiffness: model.indentation.map_or(0.0, |p| p.face_stiffness) as f32,
        face_damping: model.indentation.map_or(0.0, |p| p.face_damping) as f32,
        flat: flat.into(),
        bonded: bonded.into(),
        entry: [model.scene.motion.entry.x as f32, model.scene.motion.entry.y as f32],
        ..Zeroable::zeroed()
    }
}

fn contact_nodes(model: &Model, layout: &Layout) -> Vec<ContactNode> {
    // Grid coordinates of a node of a block, and the slot of `corner_force` that is its own.
    let place = |node: usize| match (&model.mesh, layout) {
        (Mesh::Block(block), Layout::Strips(strips)) => {
            let at = block.node_coordinates(node);
            (at.map(|i| i as u32), strips.owned_slot(at, block.cells()))
        }
        _ => ([0; 3], 4 * layout.fours().first[node]),
    };
    let mut nodes: Vec<ContactNode> = model
        .contact_nodes
        .iter()
        .map(|c| {
            let node = c.node as usize;
            let ([i, j, k], slot) = place(node);
            let [ring_low, ring_high] = match c.faces {
                Some(faces) => [0, 4].map(|at| std::array::from_fn(|p| faces.ring[at + p])),
                None => [[0; 4]; 2],
            };
            ContactNode {
                rest: vec4(c.place(&model.mesh)),
                grid: [i, j, k, 0],
                surface: match c.surface {
                    ContactSurface::OpenedPath => [0.0; 4],
                    ContactSurface::Slit { side } => vec4(side),
                    ContactSurface::OuterWall => [0.0, 0.0, 0.0, 1.0],
                    ContactSurface::Bore => [0.0, 0.0, 0.0, -1.0],
                },
                numbers: [c.node, slot, c.pushed.into(), c.faces.map_or(0, |f| f.present)],
                sizes: [c.rest_radius, c.rest_axial, model.node_mass[node], c.share].map(|x| x as f32),
                ring_low,
                ring_high,
            }
        })
        .collect();
    nodes.resize(nodes.len().max(1), ContactNode::zeroed());
    nodes
}
