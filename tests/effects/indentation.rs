//! Indentation: Hertz's sphere, bonded punch, energy.

use std::sync::Arc;

use glam::DVec3;
use stylet::effects::indentation;
use stylet::engine::stable_dt::wave_speed_bound;
use stylet::model::Model;
use stylet::needle::{Phase, Tool};
use stylet::scene::Scene;

use crate::common::*;

/// A tool pressed by `depth` into a block [mm], then held until everything rests.
fn press(size: [f64; 3], cell: f64, tool: Tool, depth: f64) -> Arc<Model> {
    let mut scene: Scene = block(size, cell);
    scene.faces[4] = held(true, true, true);
    scene.effects.indentation = Some(indentation::Params::default());
    // Near critical for the shear of the whole block: omega = pi c_s / 2H.
    let height = size[2] * 1e-3;
    let omega = 0.5 * std::f64::consts::PI * (MATERIAL_A.shear_modulus() / DENSITY).sqrt() / height;
    scene.solver.mass_damping = omega;
    let time = 4.0 / omega;
    scene.tissue.growth = 1.4;
    with_tool(
        &mut scene,
        tool,
        DVec3::NEG_Z,
        vec![Phase::Insert { speed: depth / time, depth }, Phase::Hold { duration: 2.0 * time }],
    );
    model(scene)
}

/// Axial force at the end and the largest energy gap over the work.
fn force_at_rest(model: &Arc<Model>) -> Vec<(&'static str, f64)> {
    let dt = 0.8 * wave_speed_bound(model);
    let frames = 20;
    let steps = (model.duration() / dt) as usize / frames;
    println!("{} cells, {} steps", model.mesh.cell_count(), steps * frames);
    let mut found = Vec::new();
    for (name, mut engine) in engines(model, dt, steps) {
        let mut step = 0;
        let (mut work, mut damped) = (0.0, 0.0);
        let mut sums = Default::default();
        for _ in 0..frames {
            sums = advance(engine.as_mut(), model, dt, &mut step, steps);
            work += sums.tool_work;
            damped += sums.energy.damping + sums.energy.contact_damping;
        }
        assert!(sums.energy.kinetic < 1e-4 * sums.energy.elastic, "{name}: not at rest");
        let audit = sums.energy.elastic
            + sums.energy.hourglass
            + sums.energy.kinetic
            + sums.energy.half_step
            + sums.energy.contact_stored
            + damped;
        at_most(&format!("{name}, energy gap over the work"), (work - audit).abs() / work, 0.02);
        let force = sums.impulse.z / (steps as f64 * dt);
        at_most(
            &format!("{name}, sideways over axial impulse"),
            sums.impulse.x.hypot(sums.impulse.y) / sums.impulse.z.abs(),
            0.02,
        );
        found.push((name, -force));
    }
    found
}

#[test]
fn a_sphere_presses_as_hertz_says() {
    let (radius, depth) = (8e-3, 0.5e-3);
    let height = 20e-3;
    let model = press([32.0, 32.0, height * 1e3], 0.8, Tool::Sphere { radius }, depth);
    let nu = MATERIAL_A.poisson_ratio();
    let modulus = MATERIAL_A.youngs_modulus() / (1.0 - nu * nu);
    let hertz = 4.0 / 3.0 * modulus * radius.sqrt() * depth.powf(1.5);
    // A bonded layer of finite thickness is stiffer than a half-space: Dimitriadis 2002 gives for nu = 1/2, with
    // chi = sqrt(R d)/h, the factor 1 + 1.133 chi + 1.283 chi^2 + 0.769 chi^3 + 0.0975 chi^4. The block is also finite
    // sideways, which softens it.
    let chi = (radius * depth).sqrt() / height;
    let layer = 1.0 + chi * (1.133 + chi * (1.283 + chi * (0.769 + chi * 0.0975)));
    let found = force_at_rest(&model);
    for (name, force) in &found {
        println!(
            "{name}: {force:.5e} N, {:.3} of the half-space, {:.3} of the layer",
            force / hertz,
            force / (hertz * layer)
        );
        // Two cells per contact radius resolve a Hertz pressure to about 10 %.
        close(&format!("{name}, Hertz on a layer"), *force, hertz * layer, 0.1);
    }
    if let [(_, cpu), (_, gpu)] = found[..] {
        close("GPU over CPU", gpu, cpu, 1e-3);
    }
}

#[test]
fn a_bonded_punch_presses_as_the_closed_form_says() {
    let (radius, depth) = (3e-3, 0.2e-3);
    let model = press([24.0, 24.0, 16.0], 1.0, Tool::FlatPunch { radius, bonded: true }, depth);
    let nu = MATERIAL_A.poisson_ratio();
    let half_space = 2.0 * MATERIAL_A.youngs_modulus() / (1.0 - nu * nu) * radius * depth;
    for (name, force) in force_at_rest(&model) {
        println!("{name}: {force:.5e} N, {:.3} of the half-space", force / half_space);
        // The effective radius is uncertain by half a cell (1/6), the layer adds about 20 %.
        assert!((0.85..1.45).contains(&(force / half_space)), "{name}: {force}");
    }
}
