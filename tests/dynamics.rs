//! Motion in time: waves, periods, energy, driven faces, stable step, and the compression of a cube.

use crate::common;

use std::f64::consts::{PI, TAU};
use std::sync::Arc;

use glam::{DMat3, DVec3};
use stylet::cpu::CpuEngine;
use stylet::effects::{TissueMaterial, mass_scaling};
use stylet::engine::stable_dt::{
    largest_frequency, largest_frequency_of, power_iteration, stiffness_bounds, wave_speed_bound,
};
use stylet::engine::{Engine, FrameSums, StepInput};
use stylet::material::{Demiray, ElasticLaw, Isochoric, MooneyRivlin, NeoHookean};
use stylet::model::Model;
use stylet::scene::{FaceDrive, Scene};
use stylet::simulation::Simulation;

use common::*;

const HEIGHT: f64 = 20e-3;
const CELLS: usize = 40;

/// A column of 1 x 1 x 40 cells, base held, of whose components only `free` moves.
fn column(free: usize) -> Scene {
    let mut scene = block([0.5, 0.5, HEIGHT * 1e3], HEIGHT * 1e3 / CELLS as f64);
    let fixed: [bool; 3] = std::array::from_fn(|a| a != free);
    for face in &mut scene.faces[..4] {
        face.fixed = fixed;
    }
    scene.faces[5].fixed = fixed;
    scene.faces[4] = held(true, true, true);
    scene
}

/// Mean of one displacement component on the plane k.
fn plane(model: &Model, u: &[DVec3], k: usize, axis: usize) -> f64 {
    let [nx, ny, _] = model.mesh.block().nodes();
    u[k * nx * ny..(k + 1) * nx * ny].iter().map(|u| u[axis]).sum::<f64>() / (nx * ny) as f64
}

/// Angular frequency of the first mode, from the crossings of zero of its amplitude over `periods` periods.
fn frequency(
    engine: &mut dyn Engine,
    model: &Model,
    axis: usize,
    amplitude: f64,
    dt: f64,
    expected: f64,
    periods: f64,
) -> f64 {
    let shape = |z: f64| (0.5 * PI * (z + HEIGHT) / HEIGHT).sin();
    displaced(engine, model, |x| {
        let mut u = DVec3::ZERO;
        u[axis] = amplitude * shape(x.z);
        u
    });
    // A reading every 40th of a period, linear in between: the zero crossings of a sine are straight.
    let every = (TAU / expected / dt / 40.0).round() as usize;
    let count = (periods * TAU / expected / dt) as usize / every;
    let (mut step, mut last, mut crossings) = (0, f64::NAN, Vec::new());
    for _ in 0..count {
        advance(engine, model, dt, &mut step, every);
        let state = engine.read_state().unwrap();
        let lines = &model.mesh.block().lines[2];
        let now: f64 = (0..=CELLS)
            .map(|k| {
                let weight = if k == CELLS { 0.5 } else { 1.0 };
                weight * shape(lines[k]) * plane(model, &state.displacement, k, axis)
            })
            .sum();
        if last * now < 0.0 {
            crossings.push((step as f64 - every as f64 * now / (now - last)) * dt);
        }
        last = now;
    }
    let n = crossings.len() - 1;
    PI * n as f64 / (crossings[n] - crossings[0])
}

#[test]
fn columns_swing_with_the_discrete_frequency() {
    let file = reference("11_waves_dynamics.json");
    for (wave, axis, amplitude, dt, periods) in [("P", 2, 1e-6, 1.2e-5, 6.0), ("S", 0, 1e-5, 1e-5, 3.0)] {
        let chain = &file[format!("{wave}_chain")];
        let omega = number(&chain["omega_1_discrete_rad_s"]);
        // In the S column the width can swing as well, so that its step is that of a P wave over one cell.
        assert!(dt < number(&file["P_chain"]["dt_crit_s"]));
        for factor in [1.0, 100.0] {
            let mut scene = column(axis);
            if factor != 1.0 {
                scene.effects.mass_scaling = Some(mass_scaling::Params { factor });
            }
            let model = model(scene);
            // Close to the step of the P chain the selective part of mass scaling would raise masses, as its bound counts
            // the stiffness of all components, held or not.
            let dt = if factor == 1.0 { dt } else { dt.min(1e-5) * f64::sqrt(factor) };
            let expected = omega / f64::sqrt(factor);
            for (name, mut engine) in engines(&model, dt, 4000) {
                let found = frequency(engine.as_mut(), &model, axis, amplitude, dt, expected, periods);
                close(&format!("{name}, {wave} column, S = {factor}: omega"), found, expected, 1e-3);
            }
        }
    }
}

#[test]
fn a_front_travels_with_the_wave_speed() {
    let file = reference("11_waves_dynamics.json");
    let step_load = &file["step_traction_P_column"];
    let mut scene = column(2);
    scene.faces[5].traction = Some(DVec3::new(0.0, 0.0, number(&step_load["traction_Pa"])));
    let model = model(scene);
    // Close to the largest step the leapfrog has hardly any dispersion, so that the front stays sharp.
    let dt = 0.97 * number(&file["P_chain"]["dt_crit_s"]);
    for (name, mut engine) in engines(&model, dt, 10) {
        let mut step = 0;
        let speed = number(&step_load["end_velocity_m_s"]);
        let planes = [30, 10];
        let (mut arrival, mut peak, mut plateau, mut readings) = ([None; 2], (0.0, 0.0), 0.0, 0);
        let mut last = [0.0; 2];
        while (step as f64) * dt < 2.5e-3 {
            advance(engine.as_mut(), &model, dt, &mut step, 1);
            let state = engine.read_state().unwrap();
            let time = step as f64 * dt;
            for (i, k) in planes.into_iter().enumerate() {
                let v = plane(&model, &state.velocity, k, 2);
                if arrival[i].is_none() && v > 0.5 * speed {
                    arrival[i] = Some(time - dt * (v - 0.5 * speed) / (v - last[i]));
                }
                last[i] = v;
            }
            let top = plane(&model, &state.displacement, CELLS, 2);
            if top > peak.0 {
                peak = (top, time);
            }
            if time > 0.2e-3 && time < 1.7e-3 {
                plateau += plane(&model, &state.velocity, CELLS, 2);
                readings += 1;
            }
        }
        let way = model.mesh.block().lines[2][planes[0]] - model.mesh.block().lines[2][planes[1]];
        let found = way / (arrival[1].unwrap() - arrival[0].unwrap());
        // The front is a step or two wide on a way of twenty cells.
        close(&format!("{name}, front speed"), found, number(&file["c_p_m_s"]), 0.01);
        close(&format!("{name}, speed behind the front"), plateau / readings as f64, speed, 0.01);
        close(&format!("{name}, peak of the end"), peak.0, number(&step_load["end_displacement_peak_m"]), 0.02);
        close(&format!("{name}, time of the peak"), peak.1, number(&step_load["peak_time_s"]), 0.02);
    }
}

/// Reaction of the moved top face at rest [N].
fn compressed_cube(hourglass: (f64, f64)) -> Vec<(&'static str, f64)> {
    let mut scene = block([20.0, 20.0, 20.0], 2.0);
    scene.solver.hourglass_stiffness = hourglass.0;
    scene.solver.hourglass_quartic = hourglass.1;
    scene.faces[4] = held(true, true, true);
    scene.faces[5] = held(true, true, true);
    let factor = 4.0;
    // First shear period of the scaled cube 64 ms: pressed over 100 ms, then at rest in 120 ms of strong damping.
    scene.faces[5].drive =
        Some(FaceDrive { displacement: DVec3::new(0.0, 0.0, -6e-3), rotation: 0.0, duration: 0.1, cycles: 0 });
    scene.solver.mass_damping = 150.0;
    scene.effects.mass_scaling = Some(mass_scaling::Params { factor });
    let model = model(scene);
    let dt = 0.7 * wave_speed_bound(&model);
    let frames = 20;
    let steps = (0.22 / dt) as usize / frames;
    println!("{} steps of {:.1} us", steps * frames, dt * 1e6);
    let mut found = Vec::new();
    for (name, mut engine) in engines(&model, dt, steps) {
        let mut step = 0;
        let mut sums = FrameSums::default();
        let (mut work, mut damped) = (0.0, 0.0);
        for _ in 0..frames {
            sums = advance(engine.as_mut(), &model, dt, &mut step, steps);
            work += sums.load_work;
            damped += sums.energy.damping;
        }
        assert!(sums.energy.kinetic < 1e-5 * sums.energy.elastic, "{name}: not at rest");
        // The linear hourglass law folds the eight corner cells, the quartic one must not.
        println!(
            "{name}: {} folded cells, smallest corner J {:.3}",
            sums.health.inverted_cells, sums.health.min_corner_j
        );
        assert!(hourglass.1 == 0.0 || sums.health.inverted_cells == 0, "{name}");
        at_most(
            &format!("{name}, energy gap"),
            ((work - damped - sums.energy.elastic - sums.energy.hourglass) / work).abs(),
            0.01,
        );
        println!("{name}: hourglass energy {:.2} % of elastic", 100.0 * sums.energy.hourglass / sums.energy.elastic);
        let forces = engine.internal_forces().unwrap();
        let top = model.mesh.block().nodes()[2] - 1;
        let on_top = forces.iter().enumerate().filter(|(n, _)| model.mesh.block().node_coordinates(*n)[2] == top);
        found.push((name, -on_top.map(|(_, f)| f.z).sum::<f64>()));
    }
    found
}

#[test]
fn a_cube_compressed_by_thirty_percent_answers_like_the_converged_one() {
    // Converged: 4.65 +- 0.1 N (reference 02, quadratic elements). One-point hexahedra on 10 cells a side with the
    // linear hourglass law gave 4.51 N in an independent program.
    let series = reference("02_block_fem.json");
    let finest = series["cases"]["compress"]["series"].as_array().unwrap().iter().filter(|s| s["element"] == "q2q1");
    let converged = finest.map(|s| -number(&s["Rz_N"])).fold(f64::INFINITY, f64::min);
    println!("finest quadratic mesh: {converged} N");
    for (what, hourglass) in [("linear", (0.1, 0.0)), ("default", HOURGLASS)] {
        for (name, force) in compressed_cube(hourglass) {
            println!("{what} hourglass law, {name}: {force:.4} N");
            if what == "linear" {
                close("against the independent program", force, 4.51, 0.005);
            }
            close(&format!("{what} hourglass law, {name}"), force, 4.65, 0.05);
        }
    }
}

/// Mean total energy over a window of frames, in the middle of their last steps.
fn window(engine: &mut dyn Engine, model: &Model, dt: f64, step: &mut u64, frames: usize, steps: usize) -> f64 {
    let mut total = 0.0;
    for _ in 0..frames {
        let here = advance(engine, model, dt, step, steps);
        total += here.energy.elastic + here.energy.hourglass + here.energy.kinetic + here.energy.half_step;
    }
    total / frames as f64
}

/// Relative change of the mean energy of a freely swinging block over `steps` steps.
fn energy_drift(engine: &mut dyn Engine, model: &Model, dt: f64, steps: usize) -> f64 {
    displaced(engine, model, |x| {
        let z = (x.z + 4e-3) / 4e-3;
        DVec3::new(2e-4 * z * z, -1e-4 * z, 1.5e-4 * (2e2 * x.x * z).sin())
    });
    let mut step = 0;
    // Steps that share no factor with the periods, so that a window sees all phases.
    let first = window(engine, model, dt, &mut step, 100, 37);
    let frames = (steps - 7400) / 1000;
    for _ in 0..frames {
        advance(engine, model, dt, &mut step, 1000);
    }
    let last = window(engine, model, dt, &mut step, 100, 37);
    println!("{step} steps, energy {first:.6e} -> {last:.6e} J");
    (last / first - 1.0).abs()
}

fn swinging_block(cells: [f64; 3]) -> Arc<Model> {
    let mut scene = block(cells, 1.0);
    scene.faces[4] = held(true, true, true);
    model(scene)
}

#[test]
fn free_vibration_keeps_its_energy_in_f64() {
    let model = swinging_block([2.0, 2.0, 4.0]);
    let dt = 0.6 * wave_speed_bound(&model);
    let mut cpu = CpuEngine::new(model.clone(), dt);
    at_most("cpu, energy drift over 1e5 steps", energy_drift(&mut cpu, &model, dt, 100_000), 1e-3);
}

#[test]
fn free_vibration_keeps_its_energy_on_the_gpu() {
    let model = swinging_block([3.0, 3.0, 4.0]);
    let dt = 0.6 * wave_speed_bound(&model);
    let Some(mut gpu) = gpu_engine(&model, dt, 1000) else {
        return;
    };
    at_most("gpu, energy drift over 1e5 steps", energy_drift(&mut gpu, &model, dt, 100_000), 1e-2);
}

#[test]
fn a_slow_boundary_is_followed_exactly() {
    // 0.1 mm/s in steps of 10 us: 1 nm or 68.7 units of the fixed point per step.
    let mut scene = block([2.0, 2.0, 2.0], 1.0);
    scene.faces[4] = held(true, true, true);
    scene.faces[5] = held(true, true, true);
    scene.faces[5].drive =
        Some(FaceDrive { displacement: DVec3::new(0.37e-4, 0.0, -1e-4), rotation: 0.01, duration: 1.0, cycles: 0 });
    let model = model(scene);
    let dt = 1e-5;
    let top = model.mesh.block().nodes()[2] - 1;
    for (name, mut engine) in engines(&model, dt, 1000) {
        let (mut step, mut worst, mut relative): (u64, f64, f64) = (0, 0.0, 0.0);
        for _ in 0..10 {
            relative = 0.0;
            advance(engine.as_mut(), &model, dt, &mut step, 1000);
            let state = engine.read_state().unwrap();
            let part = step as f64 * dt;
            let angle = 0.01 * part;
            for node in (0..model.mesh.node_count()).filter(|n| model.mesh.block().node_coordinates(*n)[2] == top) {
                let x = model.mesh.rest_position(node);
                let turned =
                    DVec3::new(x.x * angle.cos() - x.y * angle.sin(), x.x * angle.sin() + x.y * angle.cos(), x.z);
                let expected = turned - x + DVec3::new(0.37e-4, 0.0, -1e-4) * part;
                let error = (state.displacement[node] - expected).length();
                worst = worst.max(error);
                relative = relative.max(error / expected.length());
            }
        }
        // At any time a few units of the fixed point (14.6 pm), so that nothing adds up.
        at_most(&format!("{name}, driven face off its path [m]"), worst, 1e-10);
        at_most(&format!("{name}, driven face off its path after 1e4 steps"), relative, 1e-5);
    }
}

#[test]
fn a_twisted_cube_is_the_same_on_both_engines() {
    let mut scene = block([8.0, 8.0, 8.0], 2.0);
    scene.faces[4] = held(true, true, true);
    scene.faces[5] = held(true, true, true);
    scene.faces[5].drive = Some(FaceDrive { displacement: DVec3::ZERO, rotation: 1.2, duration: 0.02, cycles: 0 });
    scene.solver.mass_damping = 200.0;
    let model = model(scene);
    let dt = 0.6 * wave_speed_bound(&model);
    let mut answers = Vec::new();
    let top = model.mesh.block().nodes()[2] - 1;
    for (name, mut engine) in engines(&model, dt, 400) {
        let (mut step, mut work) = (0, 0.0);
        let mut sums = FrameSums::default();
        while (step as f64) * dt < 0.04 {
            sums = advance(engine.as_mut(), &model, dt, &mut step, 100);
            work += sums.load_work;
        }
        let state = engine.read_state().unwrap();
        for node in (0..model.mesh.node_count()).filter(|n| model.mesh.block().node_coordinates(*n)[2] == top) {
            let x = model.mesh.rest_position(node);
            let (sin, cos) = 1.2f64.sin_cos();
            let expected = DVec3::new(x.x * cos - x.y * sin - x.x, x.x * sin + x.y * cos - x.y, 0.0);
            at_most(&format!("{name}, way of a top node"), (state.displacement[node] - expected).length() / 8e-3, 1e-6);
        }
        let forces = engine.internal_forces().unwrap();
        let torque: f64 = forces
            .iter()
            .enumerate()
            .filter(|(n, _)| model.mesh.block().node_coordinates(*n)[2] == top)
            .map(|(n, f)| (model.mesh.rest_position(n) + state.displacement[n]).cross(*f).z)
            .sum();
        println!("{name}: torque {torque:.6e} N m, work {work:.6e} J, elastic {:.6e} J", sums.energy.elastic);
        assert!(torque > 0.0 && work > 0.0, "{name}");
        // The forces of the last step belong to the displacements before it.
        close(&format!("{name}, moment of the top over the sum of its nodes"), sums.face_moments[5], torque, 2e-3);
        close(&format!("{name}, moment of the bottom over that of the top"), -sums.face_moments[4], torque, 5e-2);
        answers.push((state.displacement, torque, work));
    }
    if let [cpu, gpu] = &answers[..] {
        at_most("displacement, GPU against CPU", relative_difference(&gpu.0, &cpu.0), 1e-4);
        close("torque, GPU over CPU", gpu.1, cpu.1, 1e-3);
        close("work, GPU over CPU", gpu.2, cpu.2, 1e-3);
    }
}

#[test]
fn the_limit_from_power_iteration_divides_stable_from_unstable() {
    let model = model(block([4.0, 4.0, 4.0], 1.0));
    let (bound, limit) = (wave_speed_bound(&model), power_iteration(&model));
    println!("bound {:.3} us, power iteration {:.3} us", bound * 1e6, limit * 1e6);
    assert!(bound <= limit);
    for (factor, bounded) in [(0.95, true), (1.1, false)] {
        let dt = factor * limit;
        for (name, mut engine) in engines(&model, dt, 3000) {
            let mut random = Random(70);
            let mut state = engine.read_state().unwrap();
            state.displacement.iter_mut().for_each(|u| *u = random.vector() * 1e-8);
            engine.write_state(&state).unwrap();
            let start = advance(engine.as_mut(), &model, dt, &mut 0, 1);
            let end = advance(engine.as_mut(), &model, dt, &mut 1, 3000);
            let growth = (end.energy.elastic + end.energy.kinetic) / (start.energy.elastic + start.energy.kinetic);
            println!("{name}, {factor} of the limit: energy times {growth:.2e}, {} clamped", end.health.clamped_nodes);
            // At 0.95 of the limit the leapfrog conserves an energy that is within 1 / (1 - 0.95^2) of this one.
            assert_eq!(growth < 20.0 && end.health.clamped_nodes == 0, bounded, "{name}, {factor}");
        }
    }
}

/// The step that a run takes lies below the limit however the block is held; thin and small blocks with open edges, where
/// the motions of several axes fall together, are the hard ones.
#[test]
fn the_step_bound_holds_for_every_support() {
    let mut tightest: f64 = 0.0;
    let raising = Some(mass_scaling::Params { factor: 1.0 });
    for cells in [[1, 1, 1], [2, 2, 2], [4, 4, 4], [8, 8, 8], [1, 1, 8], [2, 2, 8], [1, 4, 8], [8, 8, 2], [6, 6, 1]] {
        for support in ["none", "bottom", "all but top", "rollers at three faces", "rollers at the sides", "two sides"]
        {
            let mut scene = block(cells.map(|n| n as f64), 1.0);
            scene.effects.mass_scaling = raising;
            for (face, condition) in scene.faces.iter_mut().enumerate() {
                let roller: [bool; 3] = std::array::from_fn(|a| a == face / 2);
                condition.fixed = match support {
                    "bottom" if face == 4 => [true; 3],
                    "all but top" if face != 5 => [true; 3],
                    "rollers at three faces" if face % 2 == 0 => roller,
                    "rollers at the sides" if face < 4 => roller,
                    "two sides" if face < 2 => [true; 3],
                    _ => [false; 3],
                };
            }
            let graded = Arc::new(Model::new(scene.clone(), graded_mesh(cells)));
            for (mesh, model) in [("even", model(scene)), ("graded", graded)] {
                let (bound, limit) = (wave_speed_bound(&model), power_iteration(&model));
                tightest = tightest.max(bound / limit);
                assert!(
                    bound <= 1.001 * limit,
                    "{cells:?}, {mesh}, {support}: {bound:.3e} s above the limit {limit:.3e} s"
                );
            }
        }
    }
    println!("bound over limit: {tightest:.3} at most");
    // Coarse bounds hold, too: one that is three times too short would cost three times the steps.
    assert!(tightest > 0.9, "{tightest}");
}

/// A law with the bulk modulus of this Poisson's ratio.
fn law(isochoric: Isochoric, nu: f64) -> ElasticLaw {
    ElasticLaw { isochoric, bulk_modulus: 2.0 * isochoric.shear_modulus() * (1.0 + nu) / (3.0 * (1.0 - 2.0 * nu)) }
}

/// Squeezed, stretched and sheared cells are stiffer than at rest: the bound of their nodes must follow, since the mass of a
/// step is raised by it.
#[test]
fn the_stiffness_bound_follows_the_deformation() {
    let shear = DMat3::from_cols(DVec3::X, DVec3::new(0.8, 1.0, 0.0), DVec3::Z);
    let turn = DMat3::from_rotation_x(0.7) * DMat3::from_rotation_z(1.1);
    let squeeze = |l: f64, side: f64| DMat3::from_diagonal(DVec3::new(side, side, l));
    let states = [
        ("rest", DMat3::IDENTITY),
        ("turned", turn),
        ("half", squeeze(0.5, 2.0f64.sqrt())),
        ("half, sides held", squeeze(0.5, 1.0)),
        ("a quarter, turned", turn * squeeze(0.25, 2.0)),
        ("twice", squeeze(2.0, 0.5f64.sqrt())),
        ("sheared", shear),
        ("sheared and squeezed", squeeze(0.6, 1.2) * shear),
        ("compressed", squeeze(0.8, 0.8)),
    ];
    let laws = [
        ("reference", MATERIAL_A),
        ("nu 0.45, all c01", law(Isochoric::MooneyRivlin(MooneyRivlin { c10: 0.0, c01: 3300.0 }), 0.45)),
        ("nu 0.3", law(Isochoric::NeoHookean(NeoHookean { c10: 3300.0 }), 0.3)),
        ("nu 0.49, Demiray", law(Isochoric::Demiray(Demiray { mu: 6600.0, b: 2.0 }), 0.49)),
    ];
    for (name, elastic) in laws {
        let mut scene = block([6.0, 6.0, 6.0], 1.0);
        scene.material = TissueMaterial::new(name, "test", elastic, DENSITY);
        scene.effects.mass_scaling = Some(mass_scaling::Params { factor: 1.0 });
        let held_block = {
            let mut scene = scene.clone();
            scene.faces.iter_mut().for_each(|f| f.fixed = [true; 3]);
            model(scene)
        };
        let model = model(scene);
        for (state, f) in states {
            for (rough, model) in [(0.0, &model), (0.0, &held_block), (0.05, &held_block)] {
                let mut random = Random(41);
                let displacement =
                    |n| (f - DMat3::IDENTITY) * model.mesh.rest_position(n) + random.vector() * (rough * 1e-3);
                let u: Vec<DVec3> = (0..model.mesh.node_count()).map(displacement).collect();
                let bound =
                    stiffness_bounds(model, &u).iter().zip(&model.node_mass).map(|(k, m)| k / m).fold(0.0, f64::max);
                let ratio = (largest_frequency(model, &u, &model.node_mass).powi(2) / bound).sqrt();
                println!("{name}, {state}, rough by {rough} of an edge: frequency over its bound {ratio:.3}");
                // Masses are raised at 0.9 of the bound.
                assert!(ratio < 1.0 / 0.9, "{name}, {state}, {rough}: {ratio}");
            }
        }
    }
}

/// Largest frequency over its bound of everything that acts on the nodes in a step at `time` with the tissue at rest and the tip at the
/// material coordinate `coordinate`: with the masses of the step where they are raised, and over that of the stable step where they are not.
fn frequency_over_bound(name: &str, model: &Arc<Model>, time: f64, coordinate: f64) -> f64 {
    let dt = wave_speed_bound(model);
    let mut engine = CpuEngine::new(model.clone(), dt);
    let mut state = engine.read_state().unwrap();
    state.tip_coordinate = coordinate;
    engine.write_state(&state).unwrap();
    let input = StepInput::at(model, time, dt);
    let (_, bounds) = engine.forces_and_bounds(&input);
    let mut mass = model.node_mass.clone();
    for tie in &model.separation.ties {
        let sum = tie.iter().map(|n| mass[*n as usize]).sum();
        tie.iter().for_each(|n| mass[*n as usize] = sum);
    }
    let base = state.displacement.clone();
    let omega = largest_frequency_of(model, &base, &mass, &mut |u| {
        state.displacement = u.to_vec();
        engine.write_state(&state).unwrap();
        engine.forces_and_bounds(&input).0
    });
    // What the engine finds in the state, and what the step has room for from the start.
    let found = bounds.iter().zip(&mass).map(|(k, m)| k / m).fold(0.0, f64::max).sqrt();
    let planned = 2.0 / dt;
    let ratio = match model.effects.mass_scaling {
        Some(_) => omega / found,
        None => omega / planned,
    };
    println!("{name}: omega {omega:.4e}, bound of the state {found:.4e}, of the step {planned:.4e}: {ratio:.3}");
    ratio
}

/// Everything that is stiff counts in the bound: indenters (bonded, too), the wall of a needle, tip springs, slit and bore, faces that may
/// part; with raised masses and without.
#[test]
fn the_bound_knows_contact_springs_and_faces() {
    let indenter = |tool: &str| {
        format!(
            "effects = [\"indentation\"MASS]\n[tissue]\nsize_mm = [6.0, 6.0, 4.0]\ncell_size_mm = 0.5\n[material]\n\
             preset = \"lv2022-refit\"\n{tool}\n[[motion.phase]]\nkind = \"insert\"\nspeed_mm_s = 10.0\ndepth_mm = 0.3\n"
        )
    };
    let needle = |effects: &str, rest: &str| {
        format!(
            "effects = [\"puncture\"{effects}MASS]\n[tissue]\nsize_mm = [12.0, 12.0, 9.0]\ncell_size_mm = 0.8\n[material]\n\
             preset = \"muscle-60kpa\"\n[needle]\ngauge = \"16G\"\n{rest}\n[[motion.phase]]\nkind = \"insert\"\n\
             speed_mm_s = 10.0\ndepth_mm = 4.0\n[puncture]\npuncture_force_n = 0.4\ncutting_force_n = 0.2\n"
        )
    };
    let cone = "tip_half_angle_deg = 18.0";
    let hollow = "bore_diameter_mm = 1.2\ntip_length_mm = 1.0";
    let cohesive = "\n[cohesive]\nstrength_kpa = 20.0\nenergy_j_m2 = 60.0\n";
    let cases = [
        ("sphere", indenter("[sphere]\nradius_mm = 1.0"), 0.0, true),
        ("flat punch", indenter("[flat_punch]\nradius_mm = 1.0\nbonded = false"), 0.0, true),
        ("bonded punch", indenter("[flat_punch]\nradius_mm = 1.0\nbonded = true"), 0.0, true),
        ("needle", needle("", cone), 3e-3, true),
        ("needle before the puncture", needle("", cone), 0.0, true),
        ("slit", needle(", \"cohesive\"", cone) + cohesive, 3e-3, false),
        ("hollow needle", needle(", \"cohesive\"", hollow) + cohesive, 3e-3, false),
    ];
    let mut tightest: f64 = 0.0;
    for (name, text, coordinate, unraised) in cases {
        for mass in [", \"mass_scaling\"", ""] {
            if mass.is_empty() && !unraised {
                continue;
            }
            let mut text = text.replace("MASS", mass);
            if !mass.is_empty() {
                text += "[solver]\nmass_scaling = 1.0\n";
            }
            let folder = tempfile::tempdir().unwrap();
            let path = folder.path().join("scene.toml");
            std::fs::write(&path, text).unwrap();
            let scene = Scene::load(&path, &[]).unwrap_or_else(|e| panic!("{name}: {e}"));
            let model = model(scene);
            let time = if coordinate > 0.0 { 0.33 } else { 0.02 };
            let ratio = frequency_over_bound(&format!("{name}{mass}"), &model, time, coordinate);
            // Masses are raised at 0.9 of the bound; a run takes at most 0.9 of the step.
            assert!(ratio < 1.0 / 0.9, "{name}{mass}: {ratio}");
            tightest = tightest.max(ratio);
        }
    }
    assert!(tightest > 0.5, "the bound is far from what it bounds: {tightest}");
}

/// Without mass scaling nothing raises the mass of a cell that stiffens: later frames take more steps, on both engines the same.
#[test]
fn both_engines_ask_for_the_same_steps_where_tissue_stiffens() {
    let Some(gpu) = gpu() else { return };
    // Stretched by half along two axes.
    let text = "effects = []\n[tissue]\nsize_mm = [4.0, 4.0, 4.0]\ncell_size_mm = 2.0\n[material]\nc10_kpa = 2.3\nc01_kpa = 1.0\n\
        bulk_modulus_kpa = 22.0\n[boundaries]\nx_min = \"roller\"\ny_min = \"roller\"\ny_max = \"free\"\nz_min = \"roller\"\n\
        x_max = { fixed = [\"x\"], displacement_mm = [2.0, 0.0, 0.0], duration_s = 0.5 }\n\
        z_max = { fixed = [\"z\"], displacement_mm = [0.0, 0.0, 2.0], duration_s = 0.5 }\n[solver]\nduration_s = 0.5\n\
        mass_damping_per_s = 150.0\n";
    let steps = |device| {
        let scene = Scene::parse(std::path::Path::new("stiffening.toml"), text, &[]).unwrap();
        let mut run = Simulation::on(scene, device).unwrap();
        let mut steps = Vec::new();
        while let Some(record) = run.next_frame().unwrap() {
            steps.push(record.step);
        }
        steps
    };
    let (cpu, gpu) = (steps(None), steps(Some(gpu)));
    let first = cpu[2] - cpu[1];
    let last = cpu[cpu.len() - 2] - cpu[cpu.len() - 3];
    assert!(last > first, "the tissue does not stiffen: {first} and {last} steps a frame");
    assert_eq!(cpu, gpu);
}
