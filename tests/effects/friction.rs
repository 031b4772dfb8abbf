//! Friction: sliding block, incline, Coulomb's bound, dissipation, and mu = 0.
//!
//! The tool cannot move sideways, but tissue can: a free block is pulled against a resting flat punch by gravity.

use std::sync::Arc;

use glam::DVec3;
use stylet::effects::{friction, gravity, indentation, puncture};
use stylet::model::Model;
use stylet::scene::{NeedleShape, Phase, Scene, Tool};
use stylet::solver::engine::{Engine, FrameSums};

use crate::common::*;

const DT: f64 = 1e-5;
const G: f64 = 9.81;

/// A free block of 6 x 6 x 2 mm under a large flat punch, pulled against it by `acceleration`.
fn block_under_punch(acceleration: DVec3, mu: f64) -> Arc<Model> {
    let mut scene = block([6.0, 6.0, 2.0], 1.0);
    scene.effects.gravity = Some(gravity::Params { acceleration });
    scene.effects.indentation = Some(indentation::Params::default());
    scene.effects.friction = Some(friction::Params { coefficient: mu, ..Default::default() });
    with_tool(
        &mut scene,
        Tool::FlatPunch { radius: 10e-3, bonded: false },
        DVec3::NEG_Z,
        vec![Phase::Hold { duration: 10.0 }],
    );
    // Uniform cells whatever the tool.
    let mesh = stylet::mesh::BlockMesh::for_tissue(&scene.tissue, None);
    Arc::new(Model::new(scene, mesh))
}

/// Starts in balance with the punch at the speed `v0` along x.
fn start(engine: &mut dyn Engine, model: &Model, weight: f64, v0: f64) {
    let mut state = engine.read_state().unwrap();
    let rise = weight / (model.tool_contact_stiffness() * model.contact_nodes.len() as f64);
    state.displacement.fill(DVec3::new(0.0, 0.0, rise));
    state.velocity.fill(DVec3::new(v0, 0.0, 0.0));
    engine.write_state(&state).unwrap();
}

/// Mean over the nodal masses.
fn mean(model: &Model, values: &[DVec3]) -> DVec3 {
    let sum: DVec3 = values.iter().zip(&model.node_mass).map(|(v, m)| *v * *m).sum();
    sum / model.node_mass.iter().sum::<f64>()
}

/// `|F_t| <= mu N` and dissipation >= 0 in one frame.
fn check_coulomb(name: &str, sums: &FrameSums, mu: f64) {
    let sideways = DVec3::new(sums.impulse.x, sums.impulse.y, 0.0).length();
    // The normal of the flat punch is the direction, so "spreading" is the sum of all normal impulses.
    assert!(sideways <= mu * sums.spreading_impulse * (1.0 + 1e-5), "{name}: {sideways:e} of {:e}", sums.spreading_impulse);
    assert!(sums.friction_dissipation >= -1e-6 * sideways * 1e-3, "{name}: {:e}", sums.friction_dissipation);
}

#[test]
fn a_sliding_block_stops_where_coulomb_says() {
    let file = reference("12_friction.json");
    for row in file["block_stop"].as_array().unwrap() {
        let (mu, v0) = (number(&row["mu"]), number(&row["v0_m_s"]));
        if v0 > 0.5 {
            continue; // 0.17 m and more: beyond the +-31 mm of a displacement.
        }
        if v0 < 0.05 {
            // Sliding by 17 to 51 um: the block's own shear (a H^2 / 2 c_s^2 = 1 um) is not small beside it.
            continue;
        }
        let model = block_under_punch(DVec3::new(0.0, 0.0, G), mu);
        let mass: f64 = model.node_mass.iter().sum();
        let stop = number(&row["stop_time_s"]);
        for (name, mut engine) in engines(&model, DT, 2000) {
            start(engine.as_mut(), &model, mass * G, v0);
            let (mut step, mut lost) = (0, 0.0);
            // Half way: constant deceleration mu g.
            let half = (0.5 * stop / DT).round() as usize;
            let run = |engine: &mut dyn Engine, step: &mut u64, lost: &mut f64, mut steps: usize| {
                while steps > 0 {
                    let now = steps.min(500);
                    let sums = advance(engine, &model, DT, step, now);
                    check_coulomb(name, &sums, mu);
                    *lost += sums.friction_dissipation;
                    steps -= now;
                }
            };
            run(engine.as_mut(), &mut step, &mut lost, half);
            let speed = mean(&model, &engine.read_state().unwrap().velocity).x;
            close(&format!("{name}, mu {mu}, v0 {v0}: speed at half the time"), speed, 0.5 * v0, 2e-3);
            run(engine.as_mut(), &mut step, &mut lost, half + 500);
            let state = engine.read_state().unwrap();
            close(
                &format!("{name}, mu {mu}, v0 {v0}: way"),
                mean(&model, &state.displacement).x,
                number(&row["stop_distance_m"]),
                2e-3,
            );
            close(&format!("{name}: dissipated"), lost / mass, number(&row["dissipated_J_per_kg"]), 5e-3);
            at_most("speed left", mean(&model, &state.velocity).x.abs() / v0, 0.02);
        }
    }
}

#[test]
fn a_block_on_an_incline_sticks_or_slides() {
    let file = reference("12_friction.json");
    for row in file["incline"].as_array().unwrap() {
        let (mu, theta) = (number(&row["mu"]), number(&row["theta_deg"]).to_radians());
        let model = block_under_punch(DVec3::new(theta.sin(), 0.0, theta.cos()) * G, mu);
        let mass: f64 = model.node_mass.iter().sum();
        for (name, mut engine) in engines(&model, DT, 1000) {
            start(engine.as_mut(), &model, mass * G * theta.cos(), 0.0);
            let mut step = 0;
            let mut positions = Vec::new();
            for _ in 0..8 {
                let sums = advance(engine.as_mut(), &model, DT, &mut step, 500);
                check_coulomb(name, &sums, mu);
                positions.push(mean(&model, &engine.read_state().unwrap().displacement).x);
            }
            let way = positions[7] - positions[3];
            let slip = engine.read_state().unwrap();
            let top = model.contact_nodes.iter().map(|c| slip.displacement[c.node as usize].x);
            let top = top.fold(0.0, |a: f64, b| a.max(b.abs()));
            println!("{name}, {}: way {way:.3e} m, top face {top:.3e} m", row["theta_deg"]);
            if row["sticks"] == true {
                // Only the springs of the stick memory give way: mu N / k_t per node.
                let spring = mu * mass * G / (0.5 * model.tool_contact_stiffness() * model.contact_nodes.len() as f64);
                assert!(top < 4.0 * spring, "{name} {}: the top face moved by {top:e} m, springs by {spring:e}", row["theta_deg"]);
            } else {
                let speed_gain = |a: usize, b: usize| (positions[b] - positions[a]) / ((b - a) as f64 * 500.0 * DT);
                let found = (speed_gain(5, 7) - speed_gain(1, 3)) / (4.0 * 500.0 * DT);
                close(&format!("{name}, {} degrees: acceleration", row["theta_deg"]), found, number(&row["accel_m_s2"]), 0.02);
            }
        }
    }
}

/// A coarse insertion to 2 mm and back by 1 mm.
fn insertion(mu: Option<f64>) -> Scene {
    let mut scene = block([12.0, 12.0, 8.0], 1.0);
    scene.faces[4] = held(true, true, true);
    scene.effects.puncture = Some(puncture::Params { puncture_force: 0.05, cutting_force: 0.03, ..Default::default() });
    scene.effects.mass_scaling = Some(stylet::effects::mass_scaling::Params { factor: 100.0 });
    scene.effects.friction = mu.map(|coefficient| friction::Params { coefficient, ..Default::default() });
    scene.solver.mass_damping = 40.0;
    with_tool(
        &mut scene,
        Tool::Needle(NeedleShape { name: "test".into(), radius: 1e-3, tip_length: 1.5e-3, material: "steel".into() }),
        DVec3::NEG_Z,
        vec![Phase::Insert { speed: 20e-3, depth: 5e-3 }, Phase::Withdraw { speed: 20e-3, depth: 3e-3 }],
    );
    scene
}

/// Sums of all frames of an insertion.
fn frames(engine: &mut dyn Engine, model: &Model, dt: f64) -> Vec<FrameSums> {
    let steps = (model.duration() / dt) as usize;
    let mut step = 0;
    (0..steps / 50).map(|_| advance(engine, model, dt, &mut step, 50)).collect()
}

#[test]
fn a_coefficient_of_zero_is_no_friction_to_the_last_bit() {
    let (with, without) = (model(insertion(Some(0.0))), model(insertion(None)));
    let dt = 8e-5;
    let (Some(mut a), Some(mut b)) = (gpu_engine(&with, dt, 50), gpu_engine(&without, dt, 50)) else { return };
    let (fa, fb) = (frames(&mut a, &with, dt), frames(&mut b, &without, dt));
    assert!(fa.last().unwrap().tip_coordinate > 1e-3, "the needle went in");
    assert_eq!(fa, fb);
    let (sa, sb) = (a.read_state().unwrap(), b.read_state().unwrap());
    assert_eq!(sa.displacement, sb.displacement);
    assert_eq!(sa.velocity, sb.velocity);
}

#[test]
fn shaft_friction_opposes_the_motion_and_only_dissipates() {
    let model = model(insertion(Some(0.3)));
    let dt = 8e-5;
    let mut last = Vec::new();
    for (name, mut engine) in engines(&model, dt, 50) {
        let frames = frames(engine.as_mut(), &model, dt);
        let scale: f64 = frames.iter().map(|f| f.friction_dissipation).sum();
        assert!(scale > 0.0, "{name}");
        let least = frames.iter().map(|f| f.friction_dissipation).fold(0.0, f64::min);
        assert!(least >= -1e-9 * scale, "{name}: {least:e} of {scale:e}");
        // On the way in the tissue is dragged along, after the stick springs have turned it is dragged back.
        let way_in = frames.iter().map(|f| f.friction_impulse).fold(0.0, f64::max);
        let way_out = frames.iter().map(|f| f.friction_impulse).fold(0.0, f64::min);
        let end = frames.last().unwrap().friction_impulse;
        println!("{name}: dissipated {scale:.3e} J, impulse in {way_in:.2e}, out {way_out:.2e} N s");
        assert!(way_in > 0.0 && end < 0.0, "{name}");
        last.push((scale, way_in, way_out));
    }
    if let [cpu, gpu] = last[..] {
        close("friction work, GPU over CPU", gpu.0, cpu.0, 0.02);
        close("largest friction on the way out, GPU over CPU", gpu.2, cpu.2, 0.02);
    }
}
