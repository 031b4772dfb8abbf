//! Mass scaling: S = 1 changes nothing, statics do not see S, the step grows with sqrt(S).

use std::sync::Arc;

use glam::DVec3;
use stylet::effects::mass_scaling;
use stylet::engine::Engine;
use stylet::engine::stable_dt::{power_iteration, wave_speed_bound};
use stylet::model::Model;
use stylet::scene::{FaceDrive, Scene};

use crate::common::*;

fn scaled(mut scene: Scene, factor: f64) -> Arc<Model> {
    scene.effects.mass_scaling = Some(mass_scaling::Params { factor });
    model(scene)
}

fn pressed_block(duration: f64, damping: f64) -> Scene {
    let mut scene = block([4.0, 4.0, 4.0], 1.0);
    scene.faces[4] = held(true, true, true);
    scene.faces[5] = held(true, true, true);
    scene.faces[5].drive =
        Some(FaceDrive { displacement: DVec3::new(0.1e-3, 0.0, -0.4e-3), rotation: 0.0, duration, cycles: 0 });
    scene.solver.mass_damping = damping;
    scene
}

#[test]
fn a_factor_of_one_changes_nothing_at_small_strain() {
    let plain = model(block([4.0, 4.0, 4.0], 1.0));
    let with = scaled(block([4.0, 4.0, 4.0], 1.0), 1.0);
    // Below 0.9 of the bound no nodal mass is raised while cells are hardly strained.
    let dt = 0.8 * wave_speed_bound(&plain);
    let run = |model: &Arc<Model>| {
        engines(model, dt, 300)
            .into_iter()
            .map(|(name, mut engine)| {
                let mut random = Random(60);
                let mut state = engine.read_state().unwrap();
                state.velocity.iter_mut().for_each(|v| *v = random.vector() * 1e-2);
                engine.write_state(&state).unwrap();
                let sums = advance(engine.as_mut(), model, dt, &mut 0, 300);
                assert_eq!(sums.health.raised_mass, 0, "{name}");
                (name, engine.read_state().unwrap())
            })
            .collect::<Vec<_>>()
    };
    for ((name, a), (_, b)) in run(&plain).into_iter().zip(run(&with)) {
        assert_eq!(a, b, "{name}");
    }
}

/// With its velocity, a node that becomes heavier would gain kinetic energy out of nothing.
#[test]
fn a_node_whose_mass_is_raised_keeps_its_kinetic_energy() {
    let model = scaled(block([4.0, 4.0, 4.0], 1.0), 1.0);
    let dt = 2.5 * wave_speed_bound(&model);
    for (name, mut engine) in engines(&model, dt, 300) {
        let mut random = Random(61);
        let mut state = engine.read_state().unwrap();
        state.velocity.iter_mut().for_each(|v| *v = random.vector() * 1e-3);
        engine.write_state(&state).unwrap();
        let kinetic = |masses: &dyn Fn(usize) -> f64, v: &[DVec3]| -> f64 {
            v.iter().enumerate().map(|(n, v)| 0.5 * masses(n) * v.length_squared()).sum()
        };
        let at_rest = |n: usize| model.node_mass[n];
        let before = kinetic(&at_rest, &state.velocity);
        // Nothing is strained yet: no force does any work in the first step.
        let sums = advance(engine.as_mut(), &model, dt, &mut 0, 1);
        let after = engine.read_state().unwrap();
        assert!(after.inertia.iter().all(|ratio| *ratio > 2.0), "{name}");
        let with_raised = kinetic(&|n| model.node_mass[n] * f64::from(after.inertia[n]), &after.velocity);
        at_most(&format!("{name}: kinetic energy"), (with_raised / before - 1.0).abs(), 2e-6);
        let taken = before - kinetic(&at_rest, &after.velocity);
        at_most(&format!("{name}: taken by raised masses"), (sums.energy.raised_mass / taken - 1.0).abs(), 2e-6);
    }
}

/// Force of the driven face at rest [N].
fn static_reaction(engine: &mut dyn Engine, model: &Model, dt: f64, steps: usize) -> DVec3 {
    let mut step = 0;
    let mut sums = Default::default();
    for _ in 0..4 {
        sums = advance(engine, model, dt, &mut step, steps / 4);
    }
    assert!(
        sums.energy.kinetic < 1e-6 * sums.energy.elastic,
        "not at rest: {:e} of {:e}",
        sums.energy.kinetic,
        sums.energy.elastic
    );
    let forces = engine.internal_forces().unwrap();
    let top = model.mesh.block().nodes()[2] - 1;
    let on_top = forces.iter().enumerate().filter(|(n, _)| model.mesh.block().node_coordinates(*n)[2] == top);
    on_top.map(|(_, f)| *f).sum()
}

#[test]
fn the_static_answer_does_not_depend_on_the_factor() {
    let mut found: Vec<(String, DVec3)> = Vec::new();
    for factor in [1.0, 400.0] {
        // The same number of steps per period: everything in time grows with sqrt(S).
        let slow = f64::sqrt(factor);
        let model = scaled(pressed_block(5e-3 * slow, 1500.0 / slow), factor);
        let dt = 0.7 * wave_speed_bound(&model);
        for (name, mut engine) in engines(&model, dt, 1200) {
            let force = static_reaction(engine.as_mut(), &model, dt, 3000);
            found.push((format!("{name}, S = {factor}"), force));
        }
    }
    let expected = found[0].1;
    for (what, force) in &found {
        at_most(
            &format!("{what}: {force:?}, change of the reaction"),
            (*force - expected).length() / expected.length(),
            1e-3,
        );
    }
}

#[test]
fn the_stable_step_grows_with_the_root_of_the_factor() {
    let one = model(block([4.0, 3.0, 5.0], 1.0));
    for factor in [4.0, 100.0, 40_000.0] {
        let scaled = scaled(block([4.0, 3.0, 5.0], 1.0), factor);
        close("bound", wave_speed_bound(&scaled) / wave_speed_bound(&one), factor.sqrt(), 1e-12);
        close("power iteration", power_iteration(&scaled) / power_iteration(&one), factor.sqrt(), 1e-9);
    }
}

#[test]
fn squeezed_cells_get_the_mass_that_keeps_them_stable() {
    // A cell squeezed to a third is about three times as stiff along the squeeze per length: at 0.95 of the stable
    // step of the rest state it would fly apart, the raised mass keeps it.
    let model = scaled(block([4.0, 4.0, 4.0], 1.0), 100.0);
    let dt = 0.95 * wave_speed_bound(&model);
    for (name, mut engine) in engines(&model, dt, 2000) {
        let mut random = Random(61);
        let mut state = displaced(engine.as_mut(), &model, |x| DVec3::new(0.6 * x.x, 0.6 * x.y, -0.6 * x.z));
        state.displacement.iter_mut().for_each(|u| *u += random.vector() * 1e-6);
        engine.write_state(&state).unwrap();
        let start = advance(engine.as_mut(), &model, dt, &mut 0, 1);
        assert!(start.health.raised_mass > 0, "{name}");
        let end = advance(engine.as_mut(), &model, dt, &mut 1, 2000);
        let (before, after) = (
            start.energy.elastic + start.energy.kinetic + start.energy.hourglass,
            end.energy.elastic + end.energy.kinetic + end.energy.hourglass,
        );
        println!(
            "{name}: energy {before:.3e} -> {after:.3e} J, {} raised masses, {} clamped",
            end.health.raised_mass, end.health.clamped_nodes
        );
        assert!(after < 1.05 * before, "{name}: energy {before:e} -> {after:e}");
    }
}

#[test]
fn auto_keeps_the_needle_slow_against_shear_waves() {
    let c_s = (MATERIAL_A.shear_modulus() / DENSITY).sqrt();
    let at = |tool_speed: f64| mass_scaling::Loading { tool_speed, slowness: None }.auto_factor(c_s);
    let factor = at(10e-3).unwrap();
    close("Mach number", 10e-3 * factor.sqrt() / c_s, mass_scaling::AUTO_MACH, 1e-12);
    assert_eq!((at(10.0), at(0.0)), (Some(1.0), None));
}

#[test]
fn auto_gives_a_shear_wave_eight_passages_while_a_face_moves() {
    let mut scene = pressed_block(0.4, 10.0);
    let c_s = (MATERIAL_A.shear_modulus() / DENSITY).sqrt();
    let factor = |scene: &Scene| mass_scaling::Loading::of(None, &scene.faces, scene.tissue.size).auto_factor(c_s);
    let by_drive = factor(&scene).unwrap();
    close("passages", c_s / by_drive.sqrt() * 0.4 / 4e-3, mass_scaling::AUTO_PASSAGES, 1e-12);
    // A load that grows faster decides; one that comes at once is meant to make waves.
    scene.faces[0].traction = Some(DVec3::X);
    scene.faces[0].traction_ramp = 0.2;
    close("with a ramp", factor(&scene).unwrap(), 0.25 * by_drive, 1e-12);
    scene.faces[0].traction_ramp = 0.0;
    assert_eq!(factor(&scene), Some(by_drive));
}

#[test]
fn the_inertia_of_a_sheared_block_stays_within_its_bound_with_auto() {
    // Held at the bottom, its top drawn sideways by 6 %: 25 % of the internal energy were inertia with a bound on the speed alone.
    let mut scene = block([4.0, 4.0, 4.0], 1.0);
    scene.faces[4] = held(true, true, true);
    scene.faces[5] = held(true, true, true);
    scene.faces[5].drive =
        Some(FaceDrive { displacement: DVec3::new(0.24e-3, 0.0, 0.0), rotation: 0.0, duration: 0.5, cycles: 0 });
    let c_s = (MATERIAL_A.shear_modulus() / DENSITY).sqrt();
    let loading = mass_scaling::Loading::of(None, &scene.faces, scene.tissue.size);
    let model = scaled(scene, loading.auto_factor(c_s).unwrap());
    let dt = 0.8 * wave_speed_bound(&model);
    let steps = (0.5 / dt) as usize;
    for (name, mut engine) in engines(&model, dt, steps) {
        let (mut kinetic, mut internal, mut step) = (0.0, 0.0, 0);
        for _ in 0..20 {
            let sums = advance(engine.as_mut(), &model, dt, &mut step, steps / 20);
            kinetic += sums.energy.kinetic;
            internal += sums.energy.elastic + sums.energy.hourglass;
        }
        at_most(&format!("{name}: inertia"), kinetic / internal, 0.05);
    }
}
