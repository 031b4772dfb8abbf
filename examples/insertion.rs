//! A needle goes 6 mm into a block of muscle: the force on it, depth by depth.
//!
//! `cargo run --release --example insertion`

use glam::DVec3;
use stylet::effects::friction;
use stylet::needle::{NeedleShape, Phase, Tool};
use stylet::{EngineChoice, Scene, Simulation, TissueMaterial};

fn main() -> stylet::Result<()> {
    let material = TissueMaterial::preset("lv2022-refit").expect("a preset of the library");
    let needle = Tool::Needle(NeedleShape::cone("16G", 0.8255e-3, 2.5e-3));
    let phases = vec![Phase::Insert { speed: 5e-3, depth: 6e-3 }];
    let mut scene = Scene::block([16e-3, 16e-3, 12e-3], 1e-3, material).with_tool(
        needle,
        DVec3::new(0.2e-3, 0.3e-3, 0.0),
        DVec3::NEG_Z,
        phases,
    );
    scene.effects.mass_scaling = Some(stylet::effects::mass_scaling::Params { factor: 4000.0 });
    scene.effects.friction = Some(friction::Params::default());
    let mut simulation = Simulation::new(scene, EngineChoice::Auto)?;
    let mut next = 0.0;
    while let Some(frame) = simulation.next_frame()? {
        if frame.depth >= next {
            println!("{:5.2} mm  {:.3} N", frame.depth * 1e3, frame.force.axial);
            next += 0.5e-3;
        }
    }
    match simulation.verdict().sentence() {
        None => println!("ok"),
        Some(doubts) => println!("doubtful: {doubts}"),
    }
    Ok(())
}
