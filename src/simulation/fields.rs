//! Fields of the tissue at one moment, in f64.

use glam::{DMat3, DVec3};

use super::Simulation;
use crate::cpu::CpuEngine;
use crate::engine::State;
use crate::engine::elements::{CellShape, CellStates, Elements, Grown};
use crate::error::Result;
use crate::gpu::structs::DrawnNeedle;
use crate::material::von_mises;
use crate::material_point::PointState;
use crate::mesh::Mesh;
use crate::model::Model;
use crate::needle::centre_line::CentreLine;
use crate::needle::{Kinematics, ToolPose, swing};
use crate::observables::{FieldSnapshot, FrameRecord, OpenedCell, OpenedPath, cells_in_needle};

impl Simulation {
    /// Fields of the present state; call it right after a frame registered with [`Simulation::stop_after`].
    pub fn snapshot(&mut self, record: &FrameRecord) -> Result<FieldSnapshot> {
        let state = self.engine.read_state()?;
        let line = self.needle.as_ref().map(|needle| needle.centre_line());
        let pose = self.kinematics.as_ref().map(|kinematics| pose_of(kinematics, record));
        let mut fields = snapshot(&self.model, self.kinematics.as_ref(), record, state.clone(), line);
        if let Some(pose) = pose {
            let sections = CpuEngine::opened_sections(&self.model, &state, &pose, line.as_ref());
            let path = OpenedPath::new(&self.model, &state, (pose.direction, sections), &fields.von_mises);
            if let Some(path) = path {
                open(&self.model, path, &mut fields);
            }
        }
        Ok(fields)
    }
}

impl Simulation {
    /// Where a needle has opened its path, for those who draw tissue as it is seen; nothing is open around any other. The fields that a
    /// device draws know it from here on.
    pub fn show_needle(&self, record: Option<&FrameRecord>) -> DrawnNeedle {
        let drawn = || {
            let record = record.filter(|record| record.tip_coordinate > 0.0)?;
            let (plan, opening) = (self.model.puncture.as_ref()?, self.model.opening()?);
            let pose = pose_of(self.kinematics.as_ref()?, record);
            let cut = opening.stations.iter().filter(|station| (0.0..record.tip_coordinate).contains(&station.depth));
            let opened = cut.map(|station| station.opened(opening.shaft)).collect::<Vec<_>>();
            let vector = |v: DVec3, w: f64| [v.x as f32, v.y as f32, v.z as f32, w as f32];
            let mean = opened.iter().sum::<f64>() / opened.len().max(1) as f64;
            let line = self.centre_line();
            let (low, high) = self.model.mesh.bounds();
            Some(DrawnNeedle {
                tip: vector(pose.tip, opening.shaft),
                direction: vector(pose.direction, opening.tip_length),
                opened: [mean as f32, line.map_or(0.0, |line| 1.0 / line.spacing) as f32, 0.0, 0.0],
                bevel: vector(swing(plan.reference, pose.direction, plan.profile.shift), 0.0),
                middle: vector(0.5 * (low + high), 0.0),
                bend: line.map_or_else(Default::default, |line| line.offset.map(|offset| vector(offset, 0.0))),
            })
        };
        let needle = drawn().unwrap_or_default();
        if let Some(engine) = self.on_device()
            && let Some(memory) = engine.memory("drawn_needle")
        {
            memory.write(&engine.gpu().queue, bytemuck::bytes_of(&needle));
        }
        needle
    }
}

/// Where the needle is; the tip of a bent one stays behind.
fn pose_of(kinematics: &Kinematics, record: &FrameRecord) -> ToolPose {
    let pose = kinematics.pose(record.time);
    ToolPose { tip: pose.tip - pose.direction * record.needle.retreat, ..pose }
}

/// Adds what an opened path does to the fields of cells and nodes, which are those of the closed one.
fn open(model: &Model, path: OpenedPath, fields: &mut FieldSnapshot) {
    let cells = path.cells(&fields.displacement, &fields.von_mises);
    if model.mesh.as_tets().is_some() {
        // Nodes average what opening adds to the volume, and neighbours feel it.
        let elements = Elements::new(model);
        let grown: Vec<Grown> = cells.iter().map(|c| Grown { cell: c.cell as u32, by: c.grown }).collect();
        let averaged = |grown: &[Grown]| {
            elements.averaged_volumetrics(model, &fields.displacement, CellStates::default(), grown).unwrap_or_default()
        };
        let (closed, opened) = (averaged(&[]), averaged(&grown));
        for (pressure, (closed, opened)) in fields.pressure.iter_mut().zip(closed.iter().zip(&opened)) {
            *pressure -= opened.stress - closed.stress;
        }
    }
    for OpenedCell { cell, von_mises, grown } in cells {
        fields.von_mises[cell] = von_mises;
        if model.mesh.as_block().is_some() {
            fields.pressure[cell] -= model.material(cell).law.bulk_modulus * fields.jacobian[cell] * grown;
        }
        fields.jacobian[cell] *= 1.0 + grown;
    }
    fields.opened_displacement.clone_from(&path.displacement);
    fields.opened = Some(path);
}

/// H = F - I at the centre of every cell.
pub(super) fn displacement_gradients(mesh: &Mesh, state: &State) -> Vec<DMat3> {
    (0..mesh.cell_count())
        .map(|cell| {
            let shape = CellShape::new(mesh, cell);
            shape.displacement_gradient(&shape.gather(&state.displacement))
        })
        .collect()
}

/// Stresses and Jacobians of the cells of a state, in f64, with a path that is opened by a map as cells have it: closed; `line`: the
/// centre-line of a bent needle then.
pub fn snapshot(
    model: &Model,
    kinematics: Option<&Kinematics>,
    record: &FrameRecord,
    state: State,
    line: Option<CentreLine>,
) -> FieldSnapshot {
    let elements = Elements::new(model);
    let gradients = displacement_gradients(&model.mesh, &state);
    let mut fields = FieldSnapshot {
        frame: record.frame,
        time: record.time,
        depth: record.depth,
        axial_force: record.force.axial,
        centre_line: line,
        ..Default::default()
    };
    let pose = kinematics.map(|k| pose_of(k, record));
    fields.tool_pose = pose.map(|pose| (pose.tip, pose.direction));
    // Where the path is opened by a map, the cells are those of the closed one: no tissue is within the needle.
    let cuts = pose.filter(|_| model.puncture.is_some() && model.opening().is_none());
    fields.cells_in_needle = cuts.map(|pose| cells_in_needle(model, &state, &pose, line.as_ref()));
    let targets = model.scene.targets.iter().zip(&model.targets);
    fields.targets = targets.map(|(target, point)| target.position + point.value(&state.displacement)).collect();
    let states = CellStates { points: &state.points, stiffness: &state.stiffness };
    let averaged = elements.averaged_volumetrics(model, &state.displacement, states, &[]);
    let fresh = PointState::default();
    for (cell, h) in gradients.into_iter().enumerate() {
        let f = DMat3::IDENTITY + h;
        let j = f.determinant();
        let material = model.material(cell);
        let point = states.point(cell).unwrap_or(&fresh);
        let damage = material.degradation(point, model.mesh.cell_volume(cell).cbrt());
        let intact = states.remaining(cell) * (1.0 - damage);
        let volumetric = averaged.as_ref().map_or_else(|| material.volumetric(h, intact), |a| a[cell]);
        // An inverted cell has no Cauchy stress; its J tells.
        let sigma = match j > 0.0 {
            true => material.stress(h, volumetric, intact, point) * f.transpose() * (1.0 / j),
            false => DMat3::ZERO,
        };
        fields.von_mises.push(von_mises(sigma));
        fields.jacobian.push(j);
        fields.pressure.push(-(sigma.x_axis.x + sigma.y_axis.y + sigma.z_axis.z) / 3.0);
        if model.effects.plasticity.is_some() {
            fields.plastic_strain.push(point.plastic.alpha);
        }
        if model.effects.damage.is_some() {
            fields.damage.push(damage);
        }
    }
    if !model.cell_material.is_empty() {
        fields.material = model.composition.main.iter().map(|m| f64::from(*m)).collect();
    }
    fields.displacement = state.displacement;
    fields.stiffness = state.stiffness;
    fields
}
