//! The ultrasound slice on a device: where it is black and bright, how its speckle is distributed, and that it moves with the tissue.
#![cfg(feature = "window")]

use crate::common;

use common::*;
use glam::DVec3;
use stylet::gpu::{Gpu, GpuEngine};
use stylet::needle::{NeedleShape, Tool};
use stylet::scene::{Scene, Target};
use stylet::window::parts::Parts;
use stylet::window::probe::{ATTENUATION, Probe, ProbePlane};
use stylet::window::tool_shape::ToolPlace;
use stylet::window::ultrasound::{DYNAMIC_RANGE, SIZE, Ultrasound, Window};

const WIDTH: usize = SIZE[0] as usize;
const HEIGHT: usize = SIZE[1] as usize;

/// A block of 20 x 20 x 16 mm, its engine at rest, and its slice.
struct Bench {
    gpu: Gpu,
    model: std::sync::Arc<stylet::model::Model>,
    engine: GpuEngine,
    ultrasound: Ultrasound,
    probe: Probe,
}

impl Bench {
    fn new(change: impl Fn(&mut Scene)) -> Option<Self> {
        let gpu = gpu()?;
        let mut scene = block([20.0, 20.0, 16.0], 2.0);
        scene.tissue.cell_size = 2e-3;
        with_tool(&mut scene, Tool::Needle(NeedleShape::cone("16G", 0.825e-3, 2.5e-3)), DVec3::NEG_Z, Vec::new());
        change(&mut scene);
        let model = model(scene);
        let engine = GpuEngine::new(model.clone(), gpu.clone(), 1e-5, 4).unwrap();
        let ultrasound = Ultrasound::new(&gpu, &engine, &model.mesh, &model.scene).unwrap();
        Some(Bench { gpu, model, engine, ultrasound, probe: Probe { on: true, ..Default::default() } })
    }

    fn move_tissue(&mut self, u: impl Fn(DVec3) -> DVec3) {
        displaced(&mut self.engine, &self.model, u);
    }

    /// Grey 0..1 of every pixel, row by row.
    fn picture(&mut self, place: Option<ToolPlace>) -> Vec<f64> {
        let mut encoder = self.gpu.device.create_command_encoder(&Default::default());
        let needle = self.model.scene.needle().zip(place.as_ref());
        self.ultrasound.draw(&self.gpu, &mut encoder, &self.model.mesh, &self.probe, needle);
        let texture = &self.ultrasound.texture;
        let buffer = self.gpu.device.create_buffer(&wgpu::BufferDescriptor {
            label: None,
            size: (4 * WIDTH * HEIGHT) as u64,
            usage: wgpu::BufferUsages::COPY_DST | wgpu::BufferUsages::COPY_SRC,
            mapped_at_creation: false,
        });
        let layout = wgpu::TexelCopyBufferLayout { offset: 0, bytes_per_row: Some(4 * SIZE[0]), rows_per_image: None };
        encoder.copy_texture_to_buffer(
            texture.as_image_copy(),
            wgpu::TexelCopyBufferInfo { buffer: &buffer, layout },
            texture.size(),
        );
        self.gpu.queue.submit([encoder.finish()]);
        let bytes = self.gpu.read_back(&buffer).unwrap();
        self.gpu.check().unwrap();
        bytes.chunks_exact(4).map(|p| f64::from(p[0]) / 255.0).collect()
    }

    /// Pixel at a place of the picture: lateral and depth [m].
    fn pixel(&self, x: f64, y: f64) -> [usize; 2] {
        let scene = &self.model.scene;
        let plane = ProbePlane::new(&scene.motion, &self.probe, scene.tissue.cell_size);
        let window = Window::of(&plane, self.model.mesh.bounds());
        let part = (glam::DVec2::new(x, y) - window.corner) / window.size;
        [(part.x * WIDTH as f64) as usize, (part.y * HEIGHT as f64) as usize]
    }

    /// Pixels of a rectangle [m], row by row.
    fn cut_out(&self, picture: &[f64], from: [f64; 2], to: [f64; 2]) -> Vec<f64> {
        let ([left, top], [right, bottom]) = (self.pixel(from[0], from[1]), self.pixel(to[0], to[1]));
        (top..bottom).flat_map(|y| picture[y * WIDTH + left..y * WIDTH + right].iter().copied()).collect()
    }
}

fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len() as f64
}

/// Correlation of two lists.
fn correlation(a: &[f64], b: &[f64]) -> f64 {
    let (ma, mb) = (mean(a), mean(b));
    let with = |a: &[f64], ma: f64, b: &[f64], mb: f64| a.iter().zip(b).map(|(x, y)| (x - ma) * (y - mb)).sum::<f64>();
    with(a, ma, b, mb) / (with(a, ma, a, ma) * with(b, mb, b, mb)).sqrt()
}

/// A fully developed speckle has an envelope whose mean is 1.91 times its deviation, sqrt(pi / (4 - pi)) [Burckhardt1978].
#[test]
fn the_envelope_is_rayleigh_distributed() {
    let Some(mut bench) = Bench::new(|_| {}) else { return };
    let picture = bench.picture(None);
    let tissue = bench.cut_out(&picture, [-9e-3, 1e-3], [9e-3, 15e-3]);
    assert!(tissue.iter().all(|grey| *grey < 1.0));
    let envelope: Vec<f64> = tissue.iter().map(|grey| 10f64.powf((grey - 1.0) * DYNAMIC_RANGE / 20.0)).collect();
    let m = mean(&envelope);
    let deviation = (envelope.iter().map(|a| (a - m).powi(2)).sum::<f64>() / envelope.len() as f64).sqrt();
    // 70 x 40 speckle cells: the ratio of a true Rayleigh sample of that size scatters by 2 %.
    close("mean over deviation", m / deviation, (std::f64::consts::PI / (4.0 - std::f64::consts::PI)).sqrt(), 0.06);
    // Outside the tissue there is nothing.
    assert_eq!(picture[0], 0.0);
    let above = bench.cut_out(&picture, [-9e-3, -1.4e-3], [9e-3, -0.6e-3]);
    assert!(above.iter().all(|grey| *grey == 0.0));
}

#[test]
fn the_needle_is_bright_and_fades_beside_the_slice() {
    let Some(mut bench) = Bench::new(|_| {}) else { return };
    let place = |y: f64| Some(ToolPlace::straight(DVec3::new(0.0, y, -8e-3), DVec3::NEG_Z));
    let bare = bench.picture(None);
    let mut needle = |y: f64| {
        let picture = bench.picture(place(y));
        let on = mean(&bench.cut_out(&picture, [-0.7e-3, 1e-3], [0.7e-3, 5e-3]));
        let under = mean(&bench.cut_out(&picture, [-0.6e-3, 9.5e-3], [0.6e-3, 15e-3]));
        (on, under, picture)
    };
    let ((on, under, picture), (aside, _, _), (gone, light, _)) = (needle(0.0), needle(1.6e-3), needle(6e-3));
    let without = |from, to| mean(&bench.cut_out(&bare, from, to));
    let tissue = without([-0.7e-3, 1e-3], [0.7e-3, 5e-3]);
    let below = without([-0.6e-3, 9.5e-3], [0.6e-3, 15e-3]);
    println!(
        "needle {on:.2}, aside {aside:.2}, gone {gone:.2}, tissue {tissue:.2}; shadow {under:.2}, tissue {below:.2}"
    );
    // Its walls stand out more than what is between them.
    for side in [-0.825e-3, 0.825e-3] {
        let wall = mean(&bench.cut_out(&picture, [side - 0.08e-3, 1e-3], [side + 0.08e-3, 5e-3]));
        assert!(wall > tissue + 0.25, "wall {wall:.2}");
    }
    assert!(on > tissue + 0.08 && aside > tissue + 0.02 && aside < on - 0.02);
    assert!((gone - tissue).abs() < 1e-6 && (light - below).abs() < 1e-6);
    assert!(under < below - 0.15);
    // Away from it the picture is what it was.
    let [left, bare_left] = [&picture, &bare].map(|p| bench.cut_out(p, [-9e-3, 1e-3], [-3e-3, 15e-3]));
    assert_eq!(left, bare_left);
}

#[test]
fn the_speckle_moves_with_the_tissue() {
    let Some(mut bench) = Bench::new(|_| {}) else { return };
    let rest = bench.picture(None);
    // A whole number of pixels, so that both pictures have their points at the same places of the material.
    let plane = ProbePlane::new(&bench.model.scene.motion, &bench.probe, bench.model.scene.tissue.cell_size);
    let pixel = Window::of(&plane, bench.model.mesh.bounds()).size.x / WIDTH as f64;
    let shift = [16usize, 11];
    bench.move_tissue(|_| DVec3::new(shift[0] as f64 * pixel, 0.0, -(shift[1] as f64) * pixel));
    let moved = bench.picture(None);
    let [left, top] = bench.pixel(-6e-3, 2e-3);
    let part = |picture: &[f64], [dx, dy]: [usize; 2]| -> Vec<f64> {
        let rows = top + dy..top + dy + 140;
        rows.flat_map(|y| picture[y * WIDTH + left + dx..y * WIDTH + left + dx + 160].to_vec()).collect()
    };
    let here = part(&rest, [0, 0]);
    let (with, without) = (correlation(&here, &part(&moved, shift)), correlation(&here, &part(&moved, [0, 0])));
    println!("correlation along with the tissue {with:.3}, in place {without:.3}");
    assert!(with > 0.95 && without.abs() < 0.15);
}

/// A slice two beam widths away shows other speckle, one a hundredth of a beam width away nearly the same.
#[test]
fn the_speckle_changes_as_the_slice_is_moved() {
    let Some(mut bench) = Bench::new(|_| {}) else { return };
    let mut at = |offset: f64| {
        bench.probe.offset = offset;
        let picture = bench.picture(None);
        bench.cut_out(&picture, [-8e-3, 1e-3], [8e-3, 15e-3])
    };
    let [first, near, far] = [0.0, 0.015e-3, 3e-3].map(&mut at);
    let (near, far) = (correlation(&first, &near), correlation(&first, &far));
    println!("correlation near {near:.3}, far {far:.3}");
    assert!(near > 0.9 && far.abs() < 0.15);
}

/// A target is where the tissue has taken it; time gain gives back what attenuation takes.
#[test]
fn targets_follow_the_tissue_and_depth_keeps_its_brightness() {
    let lesion = Target { name: "lesion".into(), position: DVec3::new(3e-3, 0.0, -9e-3), radius: 1.5e-3 };
    let Some(mut bench) = Bench::new(|scene| scene.targets.push(lesion.clone())) else { return };
    let middle = |bench: &Bench, picture: &[f64], x: f64, y: f64| {
        mean(&bench.cut_out(picture, [x - 0.9e-3, y - 0.9e-3], [x + 0.9e-3, y + 0.9e-3]))
    };
    let rest = bench.picture(None);
    assert!(middle(&bench, &rest, 3e-3, 9e-3) < middle(&bench, &rest, -3e-3, 9e-3) - 0.15);
    bench.move_tissue(|_| DVec3::new(-6e-3, 0.0, 0.0));
    let moved = bench.picture(None);
    assert!(middle(&bench, &moved, -3e-3, 9e-3) < middle(&bench, &moved, 3e-3, 9e-3) - 0.15);
    bench.move_tissue(|_| DVec3::ZERO);
    let drop = |bench: &mut Bench, time_gain: f64| {
        bench.probe.time_gain = time_gain;
        let picture = bench.picture(None);
        let row = |y: f64| mean(&bench.cut_out(&picture, [-9e-3, y - 1e-3], [1e-3, y + 1e-3]));
        (row(3e-3) - row(13e-3)) * DYNAMIC_RANGE
    };
    // Means of some 350 speckle cells, each with 5.6 dB of deviation.
    assert!(drop(&mut bench, ATTENUATION).abs() < 1.5);
    // 5 dB/cm less over 10 mm.
    let difference = drop(&mut bench, ATTENUATION - 500.0) - drop(&mut bench, ATTENUATION);
    close("loss over 10 mm, dB", difference, 5.0, 0.1);
}

/// What a picture costs; run it with `--ignored --nocapture`.
#[test]
#[ignore = "a measurement"]
fn cost_of_a_picture() {
    let Some(mut bench) = Bench::new(|_| {}) else { return };
    let place = Some(ToolPlace::straight(DVec3::new(0.0, 0.0, -8e-3), DVec3::NEG_Z));
    let mut draw = |count: u32| {
        let begin = std::time::Instant::now();
        for _ in 0..count {
            let mut encoder = bench.gpu.device.create_command_encoder(&Default::default());
            let needle = bench.model.scene.needle().zip(place.as_ref());
            bench.ultrasound.draw(&bench.gpu, &mut encoder, &bench.model.mesh, &bench.probe, needle);
            bench.gpu.queue.submit([encoder.finish()]);
            bench.gpu.device.poll(wgpu::PollType::wait_indefinitely()).unwrap();
        }
        begin.elapsed().as_secs_f64() / f64::from(count)
    };
    draw(5);
    let mut times: Vec<f64> = (0..20).map(|_| draw(1)).collect();
    times.sort_by(f64::total_cmp);
    println!("{:.2} ms, median of 20 pictures; least {:.2} ms", 1e3 * times[10], 1e3 * times[0]);
    // On a machine that others use too the processor's time says more.
    let cpu = stylet::process::cpu_seconds();
    draw(100);
    let cpu = stylet::process::cpu_seconds().zip(cpu).map(|(after, before)| (after - before) * 10.0);
    println!("processor time of a picture [ms]: {cpu:.2?}");
}

/// Below bone there is shadow, and what is fluid is darker than what lies around it.
#[test]
fn parts_of_a_patient_are_heard_with_their_shadow() {
    let path = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("assets/cases/scene.toml");
    let text = "[tissue]\nlabels = \"lumbar.nrrd\"\ncell_size_mm = 3\n[material]\nyoungs_modulus_kpa = 20\npoisson_ratio = 0.45\n\
                [[region]]\nname = \"vertebrae\"\nlabel = [\"bone L3\", \"bone L4\"]\nrigid = true\n\
                [needle]\ngauge = \"18G\"\ntip_length_mm = 4\n[motion]\nentry_ras_mm = [0, 0, 0]\ntarget_ras_mm = [0, 52, 0]\n\
                [[motion.phase]]\nkind = \"insert\"\nspeed_mm_s = 20\n";
    let model = model(Scene::parse(&path, text, &[]).unwrap());
    let parts = Parts::of(&model.scene, &model.mesh).unwrap();
    let anatomy = stylet::render::anatomy::Anatomy::of_scene(&model.scene).unwrap();
    let number = |name: &str| anatomy.parts().iter().position(|part| part.name == name).unwrap();
    assert!(parts.levels[number("cerebrospinal fluid")] > parts.levels[number("dura")] + 20.0);
    let [nx, ny, nz] = parts.size;
    let is_bone = |texel: [u8; 2]| anatomy.parts()[usize::from(texel[0])].name.starts_with("bone");
    let mut below = 0;
    for column in 0..nx * ny {
        let above = |from: usize| (from + 1..nz).filter(|k| is_bone(parts.texels[k * nx * ny + column])).count();
        for k in (0..nz).step_by(7) {
            let texel = parts.texels[k * nx * ny + column];
            assert_eq!(usize::from(texel[1]), above(k).min(255));
            below += usize::from(texel[1] > 0 && !is_bone(texel));
        }
    }
    assert!(below > 100, "{below} texels lie below bone");
}
