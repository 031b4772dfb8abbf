//! Puncture: order of events of the tip law, dissipation, softened path, both engines.

use std::sync::Arc;

use glam::DVec3;
use stylet::effects::{mass_scaling, puncture};
use stylet::material::ElasticLaw;
use stylet::model::Model;
use stylet::scene::{NeedleShape, Phase, Tool};
use stylet::solver::engine::{Engine, FrameSums, State};
use stylet::solver::stable_dt::wave_speed_bound;

use crate::common::*;

/// Step of 20 per frame, at most this depth per frame.
const STEPS: usize = 5;

/// The muscle of the scenes (E 60 kPa, nu 0.45) and a 2 mm needle, cells of 0.9 mm.
fn insertion(depth: f64) -> Arc<Model> {
    let mut scene = block([16.0, 16.0, 10.0], 0.9);
    scene.material.law = ElasticLaw::from_moduli(20_690.0, 200_000.0, 0.7);
    scene.faces[4] = held(true, true, true);
    for face in &mut scene.faces[..4] {
        *face = held(true, true, true);
    }
    let speed = 10e-3;
    let c_s = (scene.material.law.shear_modulus() / DENSITY).sqrt();
    let factor = mass_scaling::auto_factor(speed, c_s);
    scene.effects.mass_scaling = Some(mass_scaling::Params { factor });
    scene.solver.hourglass_quartic = HOURGLASS_PUNCTURE.1;
    scene.effects.puncture = Some(puncture::Params::default());
    scene.solver.mass_damping = 30.0;
    with_tool(
        &mut scene,
        Tool::Needle(NeedleShape::cone("14G", 1e-3, 3e-3)),
        DVec3::NEG_Z,
        vec![Phase::Insert { speed, depth }],
    );
    model(scene)
}

/// Frames of a run and the state after each.
fn run(engine: &mut dyn Engine, model: &Model, dt: f64, states: bool) -> (Vec<FrameSums>, Vec<State>) {
    let mut step = 0;
    let count = (model.duration() / dt) as usize / STEPS;
    let mut all = Vec::new();
    let mut seen = Vec::new();
    for _ in 0..count {
        all.push(advance(engine, model, dt, &mut step, STEPS));
        if states {
            seen.push(engine.read_state().unwrap());
        }
    }
    (all, seen)
}

#[test]
fn the_tip_waits_for_the_puncture_force_and_never_goes_back() {
    let model = insertion(6e-3);
    let p = model.puncture.as_ref().unwrap().params;
    let dt = 0.8 * wave_speed_bound(&model);
    let duration = STEPS as f64 * dt;
    println!("S = {:.0}, dt = {:.1} us, {} cells", model.mass_scaling(), dt * 1e6, model.mesh.cell_count());
    for (name, mut engine) in engines(&model, dt, STEPS) {
        let (frames, states) = run(engine.as_mut(), &model, dt, true);
        let force = |f: &FrameSums| f.cutting_impulse / duration;
        let first = frames.iter().position(|f| f.tip_coordinate > 0.0).expect("the tip goes in");
        let before = frames[..first].iter().map(force).fold(0.0, f64::max);
        println!("{name}: in frame {first} of {}, force before {before:.4} N", frames.len());
        // Within the frame before the threshold the force has almost reached it; it never passes it without an advance.
        assert!(before <= p.puncture_force && before > 0.9 * p.puncture_force, "{name}: {before}");
        for pair in frames.windows(2) {
            assert!(pair[1].tip_coordinate >= pair[0].tip_coordinate, "{name}: the tip went back");
        }
        let scale: f64 = frames.iter().map(|f| f.tip_dissipation).sum();
        for f in &frames {
            assert!(f.tip_dissipation >= -1e-9 * scale, "{name}: {:e}", f.tip_dissipation);
            assert!(f.softening_dissipation >= -1e-9 * scale, "{name}: {:e}", f.softening_dissipation);
            assert_eq!(f.inverted_cells, 0, "{name}");
        }
        // Steady cutting: the tip force is F_cut.
        let steady: Vec<f64> =
            frames.iter().filter(|f| f.tip_coordinate > 3.0 * p.transition_length).map(force).collect();
        assert!(steady.len() > 10, "{name}: {} frames of steady cutting", steady.len());
        let mean = steady.iter().sum::<f64>() / steady.len() as f64;
        close(&format!("{name}, tip force of steady cutting"), mean, p.cutting_force, 0.02);
        // What the tip law takes is about F_cut per length, more over the transition from F_pun.
        let way = frames.last().unwrap().tip_coordinate;
        let law = p.cutting_force * way + 0.5 * (p.puncture_force - p.cutting_force) * p.transition_length;
        close(&format!("{name}, work of the tip law"), scale, law, 0.1);
        // Stiffness: within residual..1, falling only, 1 away from the path.
        let on_path: Vec<usize> = model.puncture.as_ref().unwrap().cells.iter().map(|c| c.cell as usize).collect();
        for pair in states.windows(2) {
            for (cell, (old, new)) in pair[0].stiffness.iter().zip(&pair[1].stiffness).enumerate() {
                assert!(
                    *new >= p.residual_stiffness - 1e-7 && *new <= 1.0 && new <= old,
                    "{name}: cell {cell}: {old} -> {new}"
                );
                assert!(on_path.contains(&cell) || *new == 1.0, "{name}: cell {cell} is off the path");
            }
        }
        assert!(states.last().unwrap().stiffness.iter().any(|s| *s < 0.9), "{name}: nothing softened");
        assert!(states[first - 1].stiffness.iter().all(|s| *s == 1.0), "{name}: softened before the puncture");
    }
}

#[test]
fn both_engines_see_the_same_first_millimetres() {
    let model = insertion(5e-3);
    let dt = 0.8 * wave_speed_bound(&model);
    let duration = STEPS as f64 * dt;
    let runs: Vec<Vec<FrameSums>> =
        engines(&model, dt, STEPS).into_iter().map(|(_, mut e)| run(e.as_mut(), &model, dt, false).0).collect();
    let [cpu, gpu] = &runs[..] else { return };
    let force = |f: &FrameSums| -f.impulse.z / duration;
    let largest = cpu.iter().map(force).fold(0.0, f64::max);
    let (mut worst, mut worst_tip): (f64, f64) = (0.0, 0.0);
    for (a, b) in cpu.iter().zip(gpu) {
        worst = worst.max((force(a) - force(b)).abs() / largest);
        worst_tip = worst_tip.max((a.tip_coordinate - b.tip_coordinate).abs());
    }
    println!("largest force {largest:.3} N, tip coordinates differ by at most {worst_tip:.1e} m");
    at_most("difference of the forces over the largest", worst, 0.02);
    for (what, pick) in [
        ("tool work", (|f: &FrameSums| f.tool_work) as fn(&FrameSums) -> f64),
        ("tip dissipation", |f| f.tip_dissipation),
        ("softening dissipation", |f| f.softening_dissipation),
    ] {
        let total = |run: &[FrameSums]| run.iter().map(pick).sum::<f64>();
        close(what, total(gpu), total(cpu), 0.02);
    }
}

#[test]
fn the_energy_account_of_an_insertion_closes() {
    let model = insertion(5e-3);
    let dt = 0.8 * wave_speed_bound(&model);
    for (name, mut engine) in engines(&model, dt, STEPS) {
        let (frames, _) = run(engine.as_mut(), &model, dt, false);
        let work: f64 = frames.iter().map(|f| f.tool_work + f.load_work).sum();
        let lost: f64 = frames
            .iter()
            .map(|f| {
                f.damping_dissipation
                    + f.contact_dissipation
                    + f.tip_dissipation
                    + f.softening_dissipation
                    + f.friction_dissipation
            })
            .sum();
        let end = frames.last().unwrap();
        let gap = (work - lost - end.elastic - end.hourglass - end.kinetic - end.contact_energy) / work;
        println!("{name}: work {work:.3e} J, gap {gap:.4}");
        at_most(&format!("{name}, energy gap over the work"), gap.abs(), 0.02);
    }
}
