//! An effect of this program's own: muscle that contracts along its fibres. No file of the library knows it.
//!
//! ```text
//! W = T/2 (|F n|^2 - 1),   P = T F n (x) n,   dT/dt = (T_end - T)/tau      [J/m^3, Pa]
//! ```
//! A block that is held at one end shortens; its lateral faces are free.
//!
//! `cargo run --release --example own_effect`

use glam::{DMat3, DVec3};
use stylet::effects::own::{Law, Memory, Number, OwnEffect, Point};
use stylet::effects::{Effect, Kind};
use stylet::scene::FaceCondition;
use stylet::{EngineChoice, Scene, Simulation, TissueMaterial};

static CONTRACTION: OwnEffect = OwnEffect {
    effect: Effect {
        key: "contraction",
        kind: Kind::Constitutive,
        needs: &[],
        define: "CONTRACTION",
        summary: "active stress along x",
        source: "this example",
        cost: "32 B per cell",
        parameters: &[],
    },
    column: "contraction_j",
    numbers: &[
        Number { key: "tension_kpa", unit: 1e3, default: 2.0, range: [0.0, 100.0], text: "active stress in the end" },
        Number { key: "time_s", unit: 1.0, default: 0.1, range: [1e-3, 10.0], text: "time in which it rises" },
    ],
    law: Law { advance, stress, energy, tangent: |_, memory| memory[0] },
    shader: "
fn contraction_advance(point: OwnPoint, memory: ptr<function, vec4<f32>>) -> f32 {
    let rise = (point.numbers[0].x - (*memory).x) * min(point.dt / point.numbers[0].y, 1.0);
    (*memory).x += rise;
    return 0.5 * rise * stretch_along_x(point);
}
// |F n|^2 - 1.
fn stretch_along_x(point: OwnPoint) -> f32 {
    let h = point.H[0];
    return 2.0 * h.x + dot(h, h);
}
fn contraction_stress(point: OwnPoint, memory: vec4<f32>) -> mat3x3<f32> {
    let f = point.H[0] + vec3<f32>(1.0, 0.0, 0.0);
    return mat3x3<f32>(memory.x * f, vec3<f32>(0.0), vec3<f32>(0.0));
}
fn contraction_energy(point: OwnPoint, memory: vec4<f32>) -> f32 {
    return 0.5 * memory.x * stretch_along_x(point);
}
fn contraction_tangent(point: OwnPoint, memory: vec4<f32>) -> f32 {
    return memory.x;
}
",
};

/// |F n|^2 - 1.
fn stretch(point: &Point) -> f64 {
    let h = point.h.x_axis;
    2.0 * h.x + h.length_squared()
}

fn advance(point: &Point, memory: &mut Memory) -> f64 {
    let rise = (point.numbers[0] - memory[0]) * (point.dt / point.numbers[1]).min(1.0);
    memory[0] += rise;
    0.5 * rise * stretch(point)
}

fn stress(point: &Point, memory: &Memory) -> DMat3 {
    DMat3::from_cols((point.h.x_axis + DVec3::X) * memory[0], DVec3::ZERO, DVec3::ZERO)
}

fn energy(point: &Point, memory: &Memory) -> f64 {
    0.5 * memory[0] * stretch(point)
}

fn main() -> stylet::Result<()> {
    let material = TissueMaterial::preset("across-fibre").expect("a preset of the library");
    let mut scene =
        Scene::block([20e-3, 8e-3, 8e-3], 2e-3, material).lasting(1.0).with_own(&CONTRACTION, &[("tension_kpa", 3e3)]);
    scene.faces = Default::default();
    scene.faces[0] = FaceCondition { fixed: [true; 3], ..Default::default() };
    scene.effects.mass_scaling = Some(stylet::effects::mass_scaling::Params { factor: 1000.0 });
    scene.solver.mass_damping = 20.0;
    let mut simulation = Simulation::new(scene, EngineChoice::Auto)?;
    let mut energy = Default::default();
    while let Some(frame) = simulation.next_frame()? {
        energy = frame.energy;
    }
    let state = simulation.engine().read_state()?;
    let shortening = state.displacement.iter().map(|u| -u.x).fold(0.0, f64::max);
    // The energy T/2 (|F n|^2 - 1) of a fibre falls below zero as it shortens: what is stored in all is less than nothing.
    println!("the block shortens by {:.2} mm of 20", shortening * 1e3);
    println!(
        "supplied {:.4} mJ, accounted for {:.4} mJ",
        energy.own[0] * 1e3,
        (energy.own[0] + energy.accounted()) * 1e3
    );
    Ok(())
}
