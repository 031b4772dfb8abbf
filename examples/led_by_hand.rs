//! A hand leads the needle: every frame takes one pose and gives one force, as a loop with a haptic device would.
//!
//! `cargo run --release --example led_by_hand`

use std::path::Path;

use stylet::simulation::Purpose;
use stylet::{Gpu, HandPose, Scene, Simulation};

fn main() -> stylet::Result<()> {
    let overrides = ["tissue.cell_size_mm=1.0".to_string()];
    let scene = Scene::load(Path::new("scenes/muscle_biopsy.toml"), &overrides)?;
    // Without an adapter the f64 engine runs.
    let device = Gpu::open().ok();
    let mut simulation = Simulation::for_purpose(scene, device, Purpose { led: true, drawn: false, lanes: false })?;
    let start = simulation.hand().expect("a hand leads");
    for frame in 0..60 {
        // Half a second towards the tissue, then still.
        let depth = start.depth + 0.05e-3 * f64::from(frame.min(30));
        simulation.lead(&HandPose { depth, ..start });
        while let Some(record) = simulation.next_frame()? {
            if record.frame % 10 == 0 {
                println!("{:.2} s  {:+.2} mm  {:.3} N", record.time, record.depth * 1e3, record.force.axial);
            }
        }
    }
    Ok(())
}
