//! Weight: a column settles as the closed form says, whatever its mass scaling.

use std::sync::Arc;

use glam::DVec3;
use stylet::effects::{gravity, mass_scaling};
use stylet::model::Model;

use crate::common::*;

const HEIGHT: f64 = 20e-3;

/// A column of 10 cells that can only move along z, base held.
fn column(acceleration: f64, factor: f64, damping: f64) -> Arc<Model> {
    let mut scene = block([2.0, 2.0, HEIGHT * 1e3], 2.0);
    for face in &mut scene.faces[..4] {
        *face = held(true, true, false);
    }
    scene.faces[4] = held(true, true, true);
    scene.effects.gravity = Some(gravity::Params { acceleration: DVec3::new(0.0, 0.0, acceleration) });
    if factor != 1.0 {
        scene.effects.mass_scaling = Some(mass_scaling::Params { factor });
    }
    scene.solver.mass_damping = damping;
    model(scene)
}

#[test]
fn a_column_settles_under_its_weight() {
    // rho g H^2 / (2 M) for a linear column of uniform section; the strain of 4e-4 keeps the law linear to 1e-3.
    let g = -9.81;
    let expected = DENSITY * g * HEIGHT * HEIGHT / (2.0 * MATERIAL_A.p_wave_modulus());
    for factor in [1.0, 100.0] {
        // Nearly critical for the first mode, omega = pi c / 2H.
        let omega = 0.5 * std::f64::consts::PI * (MATERIAL_A.p_wave_modulus() / (DENSITY * factor)).sqrt() / HEIGHT;
        let model = column(g, factor, 1.6 * omega);
        let dt = 0.5 * 2e-3 / model.scaled_wave_speed();
        for (name, mut engine) in engines(&model, dt, 600) {
            let sums = advance(engine.as_mut(), &model, dt, &mut 0, 600);
            let state = engine.read_state().unwrap();
            let top = state.displacement.last().unwrap().z;
            // Lumped masses give the exact nodal value of the continuous column.
            close(&format!("{name}, S = {factor}, settlement"), top, expected, 0.01);
            let audit = sums.energy.elastic
                + sums.energy.hourglass
                + sums.energy.kinetic
                + sums.energy.half_step
                + sums.energy.damping;
            close(&format!("{name}, S = {factor}, work of the weight"), sums.load_work, audit, 0.01);
        }
    }
}

#[test]
fn no_acceleration_is_no_gravity() {
    let with = column(0.0, 1.0, 0.0);
    let mut scene = with.scene.clone();
    scene.effects.gravity = None;
    let without = model(scene);
    let dt = 1e-5;
    let run = |model: &Arc<Model>| {
        engines(model, dt, 200)
            .into_iter()
            .map(|(name, mut engine)| {
                let mut random = Random(50);
                let mut state = engine.read_state().unwrap();
                state.velocity.iter_mut().for_each(|v| *v = random.vector() * 1e-2);
                engine.write_state(&state).unwrap();
                advance(engine.as_mut(), model, dt, &mut 0, 200);
                (name, engine.read_state().unwrap())
            })
            .collect::<Vec<_>>()
    };
    for ((name, a), (_, b)) in run(&with).into_iter().zip(run(&without)) {
        assert_eq!(a, b, "{name}");
    }
}

/// Nothing holds the block: in every frame the weight has done what the block has gained in motion, from the first step on, and both
/// engines book the same, whatever the number of steps. (A work of the displacements would run ahead by half a step: 100 % in the
/// first one.)
#[test]
fn in_free_fall_the_work_is_the_kinetic_energy() {
    for factor in [1.0, 100.0] {
        let mut scene = column(-9.81, factor, 0.0).scene.clone();
        scene.faces = Default::default();
        let model = model(scene);
        let dt = 0.5 * 2e-3 / model.scaled_wave_speed();
        for (name, mut engine) in engines(&model, dt, 20) {
            let (mut step, mut work) = (0, 0.0);
            // The first steps are a few hundred units of the displacement in fixed point long.
            let allowed = if name == "gpu" { 2e-3 } else { 1e-9 };
            for steps in [1, 1, 3, 20] {
                let sums = advance(engine.as_mut(), &model, dt, &mut step, steps);
                work += sums.load_work;
                // The true mass falls; the kinetic energy is that of the scaled one, which falls slower.
                close(&format!("{name}, S = {factor}, after {step} steps"), work, sums.energy.kinetic, allowed);
                assert!(
                    sums.energy.elastic < 1e-3 * work,
                    "{name}: {} J in a block that falls freely",
                    sums.energy.elastic
                );
            }
            // What was booked goes on over a stop.
            let image = engine.save().unwrap();
            engine.restore(&image).unwrap();
            let sums = advance(engine.as_mut(), &model, dt, &mut step, 5);
            work += sums.load_work;
            close(&format!("{name}, S = {factor}, after a stop"), work, sums.energy.kinetic, allowed);
        }
    }
}
