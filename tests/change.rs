//! A scene that is changed while it runs: sliders and effects.

use std::path::Path;
use std::time::Instant;

use stylet::effects::parameter::with_overrides;
use stylet::engine::State;
use stylet::needle::motion::HandPose;
use stylet::observables::FrameRecord;
use stylet::scene::Scene;
use stylet::simulation::change::Reach;
use stylet::simulation::{Purpose, Simulation};

use crate::common;

fn scene(overrides: &[&str]) -> Scene {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/training/hit_target.toml");
    let coarse = [
        "damage.failure_displacement_mm=0.6",
        // Its own path is opened, and free: not all effects that are switched go with either.
        "puncture.scheme=\"ring\"",
        "puncture.puncture_force_n=0.6",
        "puncture.cutting_force_n=0.3",
        "puncture.path=\"auto\"",
        "tissue.cell_size_mm=1.0",
        "tissue.size_mm=[14, 14, 12]",
        "target.0.position_mm=[0, 0, -6]",
    ];
    let all: Vec<String> = coarse.iter().chain(overrides).map(|s| s.to_string()).collect();
    let all = with_overrides(&[], &all);
    Scene::load(&path, &with_overrides(&all, &["motion.phase.0.depth_mm=6".into()])).unwrap_or_else(|e| panic!("{e}"))
}

const LED: Purpose = Purpose { led: true, drawn: false, lanes: false };

/// A simulation that a hand leads, on the adapter or in f64.
fn led(scene: Scene, gpu: bool) -> Option<Simulation> {
    let device = if gpu { Some(common::gpu()?) } else { None };
    Some(Simulation::for_purpose(scene, device, LED).unwrap_or_else(|e| panic!("{e}")))
}

/// Leads the needle on at 4 mm/s for some frames.
fn advance(simulation: &mut Simulation, frames: usize) -> Vec<FrameRecord> {
    (0..frames)
        .map(|_| {
            let now = simulation.hand().expect("a hand leads");
            simulation.lead(&HandPose { depth: now.depth + 4e-3 / 60.0, ..now });
            simulation.next_frame().unwrap_or_else(|e| panic!("{e}")).expect("a frame was led")
        })
        .collect()
}

fn engines() -> Vec<bool> {
    if common::gpu().is_some() { vec![false, true] } else { vec![false] }
}

/// A number that changes shows in the force of the next frame, nothing jumps that it does not touch, and the energy balance goes on.
#[test]
fn a_slider_shows_in_the_next_frame() {
    for gpu in engines() {
        let Some(mut changed) = led(scene(&[]), gpu) else { continue };
        let Some(mut plain) = led(scene(&[]), gpu) else { continue };
        let before = advance(&mut changed, 60);
        assert_eq!(before, advance(&mut plain, 60), "the same inputs give the same frames");
        let change = changed.plan_change(scene(&["friction.coefficient=0.9"])).unwrap_or_else(|e| panic!("{e}"));
        assert_eq!(change.reach, Reach::Constants);
        let begin = Instant::now();
        assert!(changed.retune(&change).unwrap_or_else(|e| panic!("{e}")), "constants fit the buffers");
        println!("gpu {gpu}: the change took {:.1} ms", begin.elapsed().as_secs_f64() * 1e3);
        let (after, as_before) = (advance(&mut changed, 40), advance(&mut plain, 40));
        let friction = |r: &FrameRecord| r.force.friction;
        println!(
            "friction {:.4} N, then {:.4} N against {:.4} N",
            friction(&before[59]),
            friction(&after[0]),
            friction(&as_before[0])
        );
        assert!(friction(&after[0]) != friction(&as_before[0]), "the first frame has it");
        assert!(
            friction(&after[39]) > 1.5 * friction(&as_before[39]),
            "{} {}",
            friction(&after[39]),
            friction(&as_before[39])
        );
        let imbalance = after[39].energy.imbalance().abs();
        assert!(imbalance < 0.02, "imbalance {imbalance}");
        // The tip law does not know friction.
        assert!((after[0].force.cutting - as_before[0].force.cutting).abs() < 0.02 * as_before[0].force.cutting.abs());
        assert_eq!(after[0].time, as_before[0].time);
    }
}

/// The same number set to what it is changes no bit.
#[test]
fn a_change_to_the_same_is_none() {
    for gpu in engines() {
        let Some(mut changed) = led(scene(&[]), gpu) else { continue };
        let Some(mut plain) = led(scene(&[]), gpu) else { continue };
        advance(&mut changed, 20);
        advance(&mut plain, 20);
        assert!(changed.change(scene(&[])).unwrap_or_else(|e| panic!("{e}")));
        assert_eq!(advance(&mut changed, 20), advance(&mut plain, 20));
        // Another engine with the same state goes on in the same way.
        let change = changed.plan_change(scene(&[])).unwrap_or_else(|e| panic!("{e}"));
        let engine = change.engine().unwrap_or_else(|e| panic!("{e}"));
        changed.adopt(&change, engine).unwrap_or_else(|e| panic!("{e}"));
        assert_eq!(advance(&mut changed, 20), advance(&mut plain, 20));
    }
}

/// Mass and stiffness change the stable step: the frames stay where they are, and the balance goes on.
#[test]
fn another_step_keeps_the_frames() {
    for gpu in engines() {
        let Some(mut simulation) = led(scene(&[]), gpu) else { continue };
        let before = advance(&mut simulation, 50);
        let dt = simulation.dt();
        for (factor, shorter) in [("1000", true), ("9000", false)] {
            let change = simulation.plan_change(scene(&[&format!("solver.mass_scaling={factor}")]));
            let change = change.unwrap_or_else(|e| panic!("{e}"));
            assert_eq!(change.reach, Reach::Constants);
            if !simulation.retune(&change).unwrap_or_else(|e| panic!("{e}")) {
                panic!("there is room for four times the steps");
            }
            assert!((simulation.dt() < dt) == shorter, "{} {dt}", simulation.dt());
            let after = advance(&mut simulation, 30);
            let spacing = after[1].time - after[0].time;
            assert!((spacing - 1.0 / 60.0).abs() < 1e-9, "{spacing}");
            let imbalance = after[29].energy.imbalance().abs();
            println!("gpu {gpu}, S {factor}: imbalance {imbalance:.5}, {:.4} N", after[29].force.axial);
            assert!(imbalance < 0.02, "imbalance {imbalance}");
            assert!(after[29].force.axial > 0.3 * before[49].force.axial);
        }
    }
}

/// Every effect that keeps mesh and contact can be switched on and off in the middle of an insertion.
#[test]
fn effects_are_switched_in_the_middle() {
    const BASE: &str = r#""puncture", "friction", "mass_scaling""#;
    let base = format!("effects=[{BASE}]");
    for gpu in engines() {
        for more in [
            r#", "gravity""#,
            r#", "fibres""#,
            r#", "viscoelastic""#,
            r#", "plasticity""#,
            r#", "plasticity", "damage""#,
            r#", "adhesion""#,
        ] {
            let Some(mut simulation) = led(scene(&[&base]), gpu) else { continue };
            let last = advance(&mut simulation, 45)[44].clone();
            let with = format!("effects=[{BASE}{more}]");
            assert_eq!(simulation.plan_change(scene(&[&with])).map(|c| c.reach).ok(), Some(Reach::Kernels));
            assert!(simulation.change(scene(&[&with])).unwrap_or_else(|e| panic!("{e}")));
            let on = advance(&mut simulation, 25);
            assert!(simulation.change(scene(&[&base])).unwrap_or_else(|e| panic!("{e}")));
            let off = advance(&mut simulation, 25);
            let worst = on.iter().chain(&off).map(|r| r.energy.imbalance().abs()).fold(0.0, f64::max);
            let end = off[24].force.axial;
            println!(
                "gpu {gpu}{more}: {:.4} N, on {:.4} N, off {end:.4} N, imbalance {worst:.4}",
                last.force.axial, on[24].force.axial
            );
            assert!(worst < 0.03, "{more}: imbalance {worst}");
            assert!(on.iter().chain(&off).all(|r| r.health.inverted_cells == 0 && r.force.axial.is_finite()));
        }
    }
}

/// Another mesh, another path, another contact: the run has to begin anew, and goes on unchanged until then.
#[test]
fn what_reaches_too_far_is_told() {
    let Some(mut simulation) = led(scene(&[]), false) else { return };
    advance(&mut simulation, 3);
    for text in
        ["tissue.cell_size_mm=0.9", "motion.entry_mm=[1, 0]", r#"effects=["mass_scaling"]"#, "needle.gauge=\"18G\""]
    {
        let change = simulation.plan_change(scene(&[text])).unwrap_or_else(|e| panic!("{e}"));
        assert_eq!(change.reach, Reach::Start, "{text}");
        assert!(!simulation.change(scene(&[text])).unwrap_or_else(|e| panic!("{e}")), "{text}");
    }
    advance(&mut simulation, 3);
}

/// A ring of other nodes: memory is kept by node, the rest begins anew.
#[test]
fn another_ring_takes_over_the_nodes_that_it_shares() {
    for gpu in engines() {
        let Some(mut simulation) = led(scene(&[]), gpu) else { continue };
        advance(&mut simulation, 50);
        let touching = |s: &State| s.contact.iter().filter(|c| c.touching).count();
        let before = touching(&simulation.engine().read_state().unwrap_or_else(|e| panic!("{e}")));
        let wider = scene(&["puncture.ring_radius_mm=2.6"]);
        assert_eq!(simulation.plan_change(wider.clone()).map(|c| c.reach).ok(), Some(Reach::Constants));
        assert!(simulation.change(wider).unwrap_or_else(|e| panic!("{e}")));
        let after = touching(&simulation.engine().read_state().unwrap_or_else(|e| panic!("{e}")));
        assert!(after >= before && before > 0, "{before} {after}");
        let records = advance(&mut simulation, 20);
        assert!(records[19].energy.imbalance().abs() < 0.05, "{}", records[19].energy.imbalance());
    }
}
