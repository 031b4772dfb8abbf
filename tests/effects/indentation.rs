//! Indentation: Hertz's sphere, bonded punch, energy.

use std::sync::Arc;

use glam::DVec3;
use stylet::effects::indentation;
use stylet::engine::stable_dt::wave_speed_bound;
use stylet::mesh::TetMesh;
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

/// Axial force at the end; the energy gap over the work is small, and the part of the force across the axis at most `sideways`.
fn force_at_rest(model: &Arc<Model>, sideways: f64) -> Vec<(&'static str, f64)> {
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
            sideways,
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
    let found = force_at_rest(&model, 0.02);
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
    for (name, force) in force_at_rest(&model, 0.02) {
        println!("{name}: {force:.5e} N, {:.3} of the half-space", force / half_space);
        // The effective radius is uncertain by half a cell (1/6), the layer adds about 20 %.
        assert!((0.85..1.45).contains(&(force / half_space)), "{name}: {force}");
    }
}

/// The same block with every hexahedron cut into six tetrahedra, which lie to one side: the force too, a little.
#[test]
fn tetrahedra_are_pressed_like_hexahedra_of_the_same_edge() {
    for (what, tool, depth) in [
        ("sphere", Tool::Sphere { radius: 5e-3 }, 0.8e-3),
        ("punch", Tool::FlatPunch { radius: 3e-3, bonded: false }, 0.3e-3),
        ("bonded punch", Tool::FlatPunch { radius: 3e-3, bonded: true }, 0.3e-3),
    ] {
        let bonded = matches!(tool, Tool::FlatPunch { bonded: true, .. });
        let hexahedra = press([16.0, 16.0, 10.0], 1.0, tool, depth);
        let cut = Arc::new(TetMesh::from_block(hexahedra.mesh.block()));
        let tetrahedra = Arc::new(Model::new(hexahedra.scene.clone(), cut));
        assert!(tetrahedra.contact_nodes.len() > 40 && tetrahedra.contact_nodes.is_sorted_by_key(|c| c.node));
        let expected = force_at_rest(&hexahedra, 0.02)[0].1;
        let found = force_at_rest(&tetrahedra, 0.1);
        for (name, force) in &found {
            println!("{what}, {name}: hexahedra {expected:.5e} N, tetrahedra {force:.5e} N, {:.3}", force / expected);
            // Single nodes of hexahedra, which alone stick to a punch, give way more than those of tetrahedra.
            close(
                &format!("{what}, {name}: tetrahedra over hexahedra"),
                *force,
                expected,
                if bonded { 0.25 } else { 0.1 },
            );
            close(&format!("{what}, {name} over the first engine"), *force, found[0].1, 1e-3);
        }
    }
}

/// A mesh that lies on its side is pressed from its side.
#[test]
fn a_mesh_is_pressed_from_any_side() {
    let upright = press([12.0, 12.0, 8.0], 1.0, Tool::Sphere { radius: 5e-3 }, 0.6e-3);
    let cut = TetMesh::from_block(upright.mesh.block());
    let mut lying = cut.clone();
    // z becomes x.
    lying.positions.iter_mut().for_each(|x| *x = DVec3::new(x.z, x.x, x.y));
    let mut scene = upright.scene.clone();
    scene.motion.direction = DVec3::NEG_X;
    scene.faces.swap(0, 4);
    let [upright, lying] = [(upright.scene.clone(), cut), (scene, lying)].map(|(scene, mesh)| {
        let model = Arc::new(Model::new(scene, Arc::new(mesh)));
        let dt = 0.8 * wave_speed_bound(&model);
        let steps = (model.duration() / dt) as usize;
        let mut engine = stylet::cpu::CpuEngine::new(model.clone(), dt);
        advance(&mut engine, &model, dt, &mut 0, steps).impulse
    });
    assert!(upright.z < 0.0 && lying.x < 0.0);
    close("lying over upright", lying.x, upright.z, 1e-6);
}
