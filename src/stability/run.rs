//! Runs one case and judges what came out.

use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Instant;

use super::report::{CaseReport, RunReport};
use super::trace::{End, Trace};
use super::{Case, Cure, Expected, Interruption, Options, Part};
use crate::engine::elements::{CellStates, Elements};
use crate::engine::{EngineInfo, State};
use crate::mesh::{BlockMesh, Mesh};
use crate::model::Model;
use crate::scene::Scene;
use crate::simulation::{EngineChoice, Simulation};
use crate::{Error, Result};

/// Runs a case; `None`: interrupted. The engine tells of itself where one was made.
pub(super) fn case(
    case: &Case,
    options: &Options,
    folder: &Path,
    engine: EngineChoice,
    interrupted: &AtomicBool,
) -> Result<Option<(CaseReport, Option<EngineInfo>)>> {
    let (mut runs, mut info) = (Vec::new(), None);
    for part in case.parts {
        // Without its cure only what should survive can fail.
        if options.without_cure && !matches!(part.expected, Expected::Survives { .. }) {
            continue;
        }
        match self::part(case, part, options, folder, engine, interrupted)? {
            Some((run, made)) => {
                runs.push(run);
                info = made.or(info);
            }
            None => return Ok(None),
        }
    }
    Ok(Some((CaseReport::new(case, runs), info)))
}

/// Runs one part; `None`: interrupted.
fn part(
    case: &Case,
    part: &Part,
    options: &Options,
    folder: &Path,
    engine: EngineChoice,
    interrupted: &AtomicBool,
) -> Result<Option<(RunReport, Option<EngineInfo>)>> {
    let begin = Instant::now();
    let short = if options.short { case.short } else { &[] };
    let cure = match case.cure {
        Cure::Switch { overrides, .. } if options.without_cure => overrides,
        _ => &[],
    };
    let overrides: Vec<String> = [short, part.overrides, cure].concat().iter().map(|text| text.to_string()).collect();
    let mut report = RunReport::new(part);
    let scene = match Scene::load(&folder.join(case.scene), &overrides) {
        Ok(scene) => scene,
        Err(Error::Scene(text)) => {
            report.judge(part, End::Refused(text));
            return Ok(Some((report, None)));
        }
        Err(error) => return Err(error),
    };
    let (mut simulation, start_energy) = prepared(scene.clone(), part, engine)?;
    let mut trace = Trace { records: Vec::new(), start_energy };
    let mut stopped_at = None;
    let mut unnoticed = None;
    if let Some(interruption) = part.interruption {
        let fresh = || prepared(scene.clone(), part, engine).map(|(simulation, _)| simulation);
        unnoticed = interrupt(&mut simulation, &mut trace, interruption, fresh)?;
    }
    let end = loop {
        if let Some(text) = unnoticed.take() {
            break End::Stopped(text);
        }
        if interrupted.load(Ordering::Relaxed) {
            return Ok(None);
        }
        match simulation.next_frame() {
            Ok(Some(record)) => trace.records.push(record),
            Ok(None) => break End::Survived,
            Err(Error::Ended(_)) => return Ok(None),
            Err(error) => {
                let Error::Diverged { step, .. } = error else { return Err(error) };
                stopped_at = Some(step);
                break End::Stopped(error.to_string());
            }
        }
    };
    report.take(&trace, part.balance, simulation.dt(), fastest_wave(&simulation.model));
    report.steps = stopped_at.unwrap_or(report.steps);
    if let (End::Survived, Some(answer)) = (&end, part.answer) {
        report.answer = Some((answer.of)(&mut simulation, &trace)?);
    }
    report.wall_s = begin.elapsed().as_secs_f64();
    report.judge(part, end);
    Ok(Some((report, Some(simulation.engine().info().clone()))))
}

/// Runs a third of the frames, keeps a checkpoint as bytes, interrupts the simulation and puts one in its place that goes on from
/// the checkpoint. What should have been noticed and was not, as text.
fn interrupt(
    simulation: &mut Simulation,
    trace: &mut Trace,
    interruption: Interruption,
    fresh: impl Fn() -> Result<Simulation>,
) -> Result<Option<String>> {
    let kept = simulation.frame_count() / 3;
    simulation.stop_after(kept);
    while let Some(record) = simulation.next_frame()? {
        trace.records.push(record);
        if trace.records.len() as u64 > kept {
            break;
        }
    }
    let broken = |error: postcard::Error| Error::Device(format!("a checkpoint could not be kept: {error}"));
    let bytes = postcard::to_allocvec(&simulation.checkpoint()?).map_err(broken)?;
    if interruption == Interruption::DeviceLost && simulation.engine().info().engine == "gpu" {
        simulation.next_frame()?;
        simulation.engine().lose_device();
        match simulation.next_frame() {
            Err(Error::Device(_)) => {}
            Err(error) => return Ok(Some(format!("the lost device was told as: {error}"))),
            Ok(_) => return Ok(Some("the device was lost and nothing told it".into())),
        }
    }
    *simulation = fresh()?;
    simulation.resume(&postcard::from_bytes(&bytes).map_err(broken)?)?;
    Ok(None)
}

/// The simulation before its first step, and the energy of the state that it starts from [J].
fn prepared(mut scene: Scene, part: &Part, engine: EngineChoice) -> Result<(Simulation, f64)> {
    let mesh = match (part.setup.mesh, &scene.mesh) {
        (Some(mesh), _) => mesh(&scene),
        (None, Some(tets)) => Mesh::Tets(tets.clone()),
        (None, None) => Mesh::Block(BlockMesh::for_scene(&scene)),
    };
    if let Some(change) = part.setup.scene {
        change(&mut scene, &mesh);
    }
    let mut simulation = Simulation::with_mesh(scene, mesh, engine)?;
    let Some(change) = part.setup.state else { return Ok((simulation, 0.0)) };
    let mut state = simulation.engine().read_state()?;
    change(&simulation.model, &mut state);
    simulation.engine().write_state(&state)?;
    // As the engine keeps it.
    let state = simulation.engine().read_state()?;
    let energy = energy(&simulation.model, &state);
    Ok((simulation, energy))
}

/// Elastic, hourglass and kinetic energy of a state [J], in f64.
fn energy(model: &Model, state: &State) -> f64 {
    let elements = Elements::new(model);
    let states = CellStates { points: &state.points, stiffness: &state.stiffness };
    let averaged = elements.averaged_volumetrics(model, &state.displacement, states, &[]);
    let cell = |cell: usize| {
        let volumetric = averaged.as_ref().map(|a| a[cell]);
        let measure = elements.measure(model, cell, &state.displacement, volumetric, states);
        measure.elastic + measure.hourglass
    };
    let stored: f64 = (0..model.mesh.cell_count()).map(cell).sum();
    let kinetic: f64 = state.velocity.iter().zip(&model.node_mass).map(|(v, m)| 0.5 * m * v.length_squared()).sum();
    stored + kinetic
}

/// Fastest P wave of all materials at the scaled density [m/s].
fn fastest_wave(model: &Model) -> f64 {
    let speed = |m: &crate::material_point::Material| (m.law.p_wave_modulus() / m.density).sqrt();
    model.materials.iter().map(speed).fold(0.0, f64::max) / model.mass_scaling().sqrt()
}
