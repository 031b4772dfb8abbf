//! A host program that has a wgpu device of its own: the engine runs on it, between the host's submissions.
//!
//! `cargo run --release --example shared_device`

use stylet::{Gpu, Scene, Simulation, TissueMaterial};

fn main() -> stylet::Result<()> {
    let instance = wgpu::Instance::default();
    let adapter = pollster::block_on(instance.request_adapter(&Default::default()))
        .map_err(|error| stylet::Error::input(error.to_string(), "install a Vulkan driver"))?;
    let (device, queue) = pollster::block_on(adapter.request_device(&Default::default()))
        .map_err(|error| stylet::Error::Device(error.to_string()))?;
    let info = adapter.get_info();
    println!("host and engine share {}", info.name);

    let material = TissueMaterial::preset("across-fibre").expect("a preset of the library");
    let mut scene = Scene::block([8e-3, 8e-3, 8e-3], 1e-3, material).lasting(0.2);
    scene.effects.gravity = Some(stylet::effects::gravity::Params { acceleration: [0.0, 0.0, -9.81].into() });
    scene.effects.mass_scaling = Some(stylet::effects::mass_scaling::Params { factor: 100.0 });
    let gpu = Gpu::shared(device.clone(), queue.clone(), info);
    let mut simulation = Simulation::on(scene, Some(gpu))?;

    // What the host does on its queue in every frame: here it fills a buffer of its own.
    let buffer = device.create_buffer(&wgpu::BufferDescriptor {
        label: Some("of the host"),
        size: 256,
        usage: wgpu::BufferUsages::COPY_DST,
        mapped_at_creation: false,
    });
    let mut sinking = 0.0;
    while let Some(frame) = simulation.next_frame()? {
        let mut encoder = device.create_command_encoder(&Default::default());
        encoder.clear_buffer(&buffer, 0, None);
        queue.submit([encoder.finish()]);
        sinking = frame.energy.external;
    }
    println!("gravity has done {:.3} uJ", sinking * 1e6);
    Ok(())
}
