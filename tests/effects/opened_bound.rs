//! The bound of the stiffness at every node, by which masses are raised, against the stiffness that an opened path has: mode by mode.

use std::path::Path;

use stylet::cpu::CpuEngine;
use stylet::engine::stable_dt::largest_frequency_of;
use stylet::engine::{Engine, StepInput};
use stylet::{EngineChoice, Scene, Simulation};

use crate::common::at_most;

/// A needle in a block of tissue that is as tough as liver under needles.
fn insertion(gauge: &str, material: &str) -> Scene {
    let text = format!(
        r#"
effects = ["puncture", "friction", "mass_scaling"]
[tissue]
size_mm = [20.0, 20.0, 16.0]
cell_size_mm = 1.0
growth = 1.45
[material]
{material}
toughness_j_m2 = 164.0
[needle]
gauge = "{gauge}"
tip_half_angle_deg = 18.0
[motion]
entry_mm = [0.0, 0.0]
[[motion.phase]]
kind = "insert"
speed_mm_s = 5.0
depth_mm = 8.0
[friction]
coefficient = 0.2
"#
    );
    Scene::parse(Path::new("bound.toml"), &text, &[]).unwrap()
}

/// Largest `v.K v / v.B v` of all displacements v of the nodes, with the stiffness K of all that acts and the bounds B, at depths [mm] from
/// `from` on, a quarter of a millimetre apart: masses are raised so that a step carries `B`, so a mode above 1/0.81 is not carried.
fn stiffness_over_bound(scene: Scene, from: f64) -> f64 {
    let mut simulation = Simulation::new(scene, EngineChoice::Cpu).unwrap();
    let (mut next, mut worst) = (from, 0.0f64);
    while let Some(frame) = simulation.next_frame().unwrap() {
        if frame.depth * 1e3 < next {
            continue;
        }
        next += 0.25;
        let (model, dt) = (simulation.model.clone(), simulation.dt());
        let mut state = simulation.engine().read_state().unwrap();
        let mut engine = CpuEngine::new(model.clone(), dt);
        engine.write_state(&state).unwrap();
        let input = StepInput::at(&model, frame.time, dt);
        let (_, bounds) = engine.forces_and_bounds(&input);
        let base = state.displacement.clone();
        let mut forces = |u: &[glam::DVec3]| {
            state.displacement = u.to_vec();
            engine.write_state(&state).unwrap();
            engine.forces_and_bounds(&input).0
        };
        worst = worst.max(largest_frequency_of(&model, &base, &bounds, &mut forces).powi(2));
    }
    worst
}

/// Where the wall of a narrow hole is stretched hundreds of times the tilt of a section beside the tip was as stiff as twice the bound, so
/// that runs made up to four times their work: det F had that tilt in it, a hundredfold.
#[test]
fn the_bound_knows_an_opened_path() {
    let liver = "law = \"neo_hookean\"\nyoungs_modulus_kpa = 5.0\npoisson_ratio = 0.45";
    for (gauge, material) in [("22G", liver), ("25G", liver), ("16G", "preset = \"across-fibre\"")] {
        at_most(
            &format!("{gauge}: stiffness over its bound"),
            stiffness_over_bound(insertion(gauge, material), 0.5),
            1.0,
        );
    }
}
