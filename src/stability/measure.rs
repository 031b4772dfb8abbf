//! Answers that single cases must give.

use super::Trace;
use crate::Result;
use crate::error::Error;
use crate::scene::Face;
use crate::simulation::{EngineChoice, Simulation};

/// Largest displacement of a node [nm]: zero of a body at rest.
pub fn largest_displacement(simulation: &mut Simulation, _: &Trace) -> Result<f64> {
    let state = simulation.engine().read_state()?;
    Ok(1e9 * state.displacement.iter().map(|u| u.length()).fold(0.0, f64::max))
}

/// Force on the top face over shear modulus and area, mean over the last tenth of the frames.
pub fn top_force(simulation: &mut Simulation, trace: &Trace) -> Result<f64> {
    let tenth = (trace.records.len() / 10).max(1);
    let last = &trace.records[trace.records.len() - tenth..];
    let force = last.iter().map(|r| r.reactions[Face::ZMax as usize].z).sum::<f64>() / tenth as f64;
    let scene = &simulation.model.scene;
    Ok(-force / (scene.material.law.shear_modulus() * scene.tissue.size.x * scene.tissue.size.y))
}

/// Number of frames whose records differ in any bit from those of the same run without an interruption.
pub fn unlike_frames(simulation: &mut Simulation, trace: &Trace) -> Result<f64> {
    let engine: EngineChoice =
        simulation.engine().info().engine.parse().map_err(|e: String| Error::input(e, "report this as a defect"))?;
    let (scene, mesh) = (simulation.model.scene.clone(), simulation.model.mesh.clone());
    let mut whole = Simulation::with_mesh(scene, mesh, engine)?;
    let (mut frames, mut unlike) = (0, 0);
    while let Some(record) = whole.next_frame()? {
        unlike += usize::from(trace.records.get(frames) != Some(&record));
        frames += 1;
    }
    Ok((unlike + trace.records.len().saturating_sub(frames)) as f64)
}

/// Mean axial force over the last half millimetre of the way in [N].
pub fn force_at_depth(_: &mut Simulation, trace: &Trace) -> Result<f64> {
    let deepest = trace.records.iter().map(|r| r.depth).fold(0.0, f64::max);
    let last: Vec<f64> = trace.records.iter().filter(|r| r.depth > deepest - 5e-4).map(|r| r.force.axial).collect();
    Ok(last.iter().sum::<f64>() / last.len().max(1) as f64)
}

/// Smallest equivalent plastic strain of all cells.
pub fn smallest_plastic_strain(simulation: &mut Simulation, _: &Trace) -> Result<f64> {
    let state = simulation.engine().read_state()?;
    Ok(state.points.iter().map(|p| p.plastic.alpha).fold(f64::INFINITY, f64::min))
}

/// Smallest damage of all cells.
pub fn smallest_damage(simulation: &mut Simulation, _: &Trace) -> Result<f64> {
    let state = simulation.engine().read_state()?;
    let model = &simulation.model;
    let damage = |(cell, point)| model.material(cell).degradation(point, model.mesh.cell_volume(cell).cbrt());
    Ok(state.points.iter().enumerate().map(damage).fold(f64::INFINITY, f64::min))
}

/// Torn area [mm^2].
pub fn torn_area(_: &mut Simulation, trace: &Trace) -> Result<f64> {
    Ok(trace.records.last().map_or(0.0, |r| r.health.torn_area) * 1e6)
}

/// Work of the last cycle of the driven top face over that of the cycle half-way.
pub fn last_breath(simulation: &mut Simulation, trace: &Trace) -> Result<f64> {
    let Some(drive) = simulation.model.scene.faces[Face::ZMax as usize].drive else { return Ok(f64::NAN) };
    let work_at = |time: f64| {
        let after = trace.records.partition_point(|r| r.time < time * (1.0 - 1e-9));
        trace.records.get(after).or(trace.records.last()).map_or(f64::NAN, |r| r.energy.external)
    };
    let work_of = |cycle: u32| {
        let begin = 2.0 * drive.duration * f64::from(cycle);
        work_at(begin + 2.0 * drive.duration) - work_at(begin)
    };
    Ok(work_of(drive.cycles - 1) / work_of(drive.cycles / 2))
}
