//! `stylet check`: what a scene means, before it runs.

use std::fmt::Write;
use std::time::Instant;

use crate::error::Result;
use crate::material::{describe_constants, describe_verdict};
use crate::mesh::Mesh;
use crate::scene::{Face, Scene, Tool};
use crate::solver::simulation::{EngineChoice, Simulation, tool_mach};
use crate::solver::stable_dt::power_iteration;

/// Wall time that the trial of the prediction may take [s].
const TRIAL: f64 = 0.5;

/// Validates a scene (loading it did) and tells moduli, waves, stability, steps, effects and the predicted time.
pub fn check(scene: Scene, engine: EngineChoice) -> Result<String> {
    let mut out = String::new();
    // Writing to a String cannot fail.
    let mut line = |text: String| {
        let _ = writeln!(out, "{text}");
    };
    let mut simulation = Simulation::new(scene, engine)?;
    let model = simulation.model.clone();
    let scene = &model.scene;
    let law = scene.material.law;
    line(format!("scene        {} ({})", scene.name, scene.path.display()));
    line(format!("             {}", scene.title));
    let size = scene.tissue.size * 1e3;
    let kind = match &model.mesh {
        Mesh::Block(block) => {
            let [nx, ny, nz] = block.cells();
            format!("{nx} x {ny} x {nz} = ")
        }
        Mesh::Tets(_) => "tetrahedra, ".into(),
    };
    line(format!(
        "tissue       {} x {} x {} mm, {kind}{} cells, {} nodes, smallest edge {:.3} mm",
        size.x,
        size.y,
        size.z,
        model.mesh.cell_count(),
        model.mesh.node_count(),
        model.mesh.smallest_edge() * 1e3
    ));
    line(format!("material     {}: {}", scene.material.name, scene.material.source));
    line(format!(
        "             {}: {}, density {} kg/m^3",
        law.isochoric.key(),
        describe_constants(&law),
        scene.material.density
    ));
    line(format!(
        "             shear modulus {:.3} kPa, bulk modulus {:.1} kPa, E {:.2} kPa, nu {:.4}",
        law.shear_modulus() / 1e3,
        law.bulk_modulus / 1e3,
        law.youngs_modulus() / 1e3,
        law.poisson_ratio()
    ));
    let wave = |modulus: f64| (modulus / scene.material.density).sqrt();
    line(format!(
        "             wave speeds: P {:.2} m/s, S {:.2} m/s (at true density)",
        wave(law.p_wave_modulus()),
        wave(law.shear_modulus())
    ));
    line(format!("stability    {}", describe_verdict(&law)));
    let held: Vec<String> = Face::ALL
        .into_iter()
        .map(|f| {
            let c = &scene.faces[f as usize];
            let fixed: String =
                ["x", "y", "z"].into_iter().zip(c.fixed).filter(|(_, on)| *on).map(|(n, _)| n).collect();
            let moved = if c.drive.is_some() { " moved" } else { "" };
            let loaded = if c.traction.is_some() { " loaded" } else { "" };
            let held = if fixed.is_empty() { "free".into() } else { format!("{fixed} held") };
            format!("{} {held}{moved}{loaded}", f.key())
        })
        .collect();
    line(format!("boundaries   {}", held.join(", ")));
    if let Some(tool) = &scene.tool {
        line(format!("tool         {}", describe_tool(tool)));
    }
    if let Some(k) = &model.kinematics {
        line(format!(
            "motion       {} phases, {:.3} s, to {:.2} mm, at most {:.2} mm/s",
            scene.motion.phases.len(),
            k.duration(),
            scene.motion.deepest() * 1e3,
            scene.motion.largest_speed() * 1e3
        ));
        let mach = tool_mach(&model).unwrap_or(0.0);
        line(format!("             tool speed over scaled shear wave speed {mach:.4}"));
    }
    line(format!("effects      {}", if scene.effects.keys().is_empty() { "none" } else { "only these run:" }));
    for effect in scene.effects.active() {
        line(format!("  {:<13}{}; cost: {}", effect.key, effect.summary, effect.cost));
    }
    line(format!("mass scaling {}", model.mass_scaling()));
    line(format!(
        "stable step  {:.3} us (wave-speed bound; power iteration {:.3} us)",
        simulation.stable_dt * 1e6,
        power_iteration(&model) * 1e6
    ));
    line(format!(
        "step         {:.3} us{}, {} steps, {} frames, {:.3} s simulated",
        simulation.dt * 1e6,
        if scene.solver.time_step.is_some() { " (the scene's own)" } else { "" },
        simulation.total_steps(),
        simulation.frame_count(),
        simulation.duration()
    ));
    let info = simulation.engine().info().clone();
    line(format!("engine       {} on {} ({})", info.engine, info.adapter, info.driver));
    line(format!(
        "device       {:.2} MB, {:.0} B per cell",
        info.device_bytes as f64 / 1e6,
        info.device_bytes as f64 / model.mesh.cell_count() as f64
    ));
    match predicted_seconds(&mut simulation)? {
        Some(seconds) => line(format!(
            "prediction   {seconds:.1} s of wall time on this adapter, real-time factor {:.2} (from a trial of {TRIAL} s)",
            simulation.duration() / seconds
        )),
        None => line("prediction   shorter than the trial".into()),
    }
    for notice in scene.notices.iter().chain(&simulation.notices) {
        line(format!("note         {notice}"));
    }
    line("ok".into());
    Ok(out.trim_end().into())
}

fn describe_tool(tool: &Tool) -> String {
    match tool {
        Tool::Needle(n) => format!(
            "needle {}: diameter {:.3} mm, cone {:.3} mm (half angle {:.1} deg), {}",
            n.name,
            2e3 * n.radius,
            1e3 * n.tip_length,
            (n.radius / n.tip_length).atan().to_degrees(),
            n.material
        ),
        Tool::Sphere { radius } => format!("sphere of radius {:.3} mm", radius * 1e3),
        Tool::FlatPunch { radius, bonded } => {
            format!("flat punch of radius {:.3} mm{}", radius * 1e3, if *bonded { ", bonded" } else { "" })
        }
    }
}

/// Wall time of the whole run, extrapolated from its first frames [s].
fn predicted_seconds(simulation: &mut Simulation) -> Result<Option<f64>> {
    // The first frames compile shaders and fill caches.
    let mut last = 0;
    for _ in 0..3 {
        match simulation.next_frame()? {
            Some(record) => last = record.step,
            None => return Ok(None),
        }
    }
    let (begin, first) = (Instant::now(), last);
    while begin.elapsed().as_secs_f64() < TRIAL {
        match simulation.next_frame()? {
            Some(record) => last = record.step,
            None => return Ok(None),
        }
    }
    let steps = last - first;
    Ok(Some(begin.elapsed().as_secs_f64() / steps as f64 * simulation.total_steps() as f64))
}
