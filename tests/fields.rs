//! What a window draws comes from the device: the fields of the cells and nodes against the f64 snapshot of the same state.

use crate::common;

use common::*;
use stylet::gpu::Memory;
use stylet::scene::Scene;
use stylet::simulation::{Purpose, Simulation};

/// Fields of the drawn cells and nodes, (von Mises, pressure, stretch, stiffness left) each.
type Fields = Vec<[f32; 4]>;

/// Runs some frames of a scene, and compares what the device holds for the window with the state in f64.
fn compare(scene: &str, overrides: &[&str], frames: u64) {
    let Some(gpu) = gpu() else { return };
    let file = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join(scene);
    let overrides: Vec<String> = overrides.iter().map(|o| o.to_string()).collect();
    let scene = Scene::load(&file, &overrides).unwrap();
    let purpose = Purpose { led: false, drawn: true, lanes: false };
    let mut simulation = Simulation::for_purpose(scene, Some(gpu.clone()), purpose).unwrap();
    simulation.stop_after(frames);
    let mut record = simulation.next_frame().unwrap().unwrap();
    while record.frame < frames {
        record = simulation.next_frame().unwrap().unwrap();
    }
    let fields = simulation.snapshot(&record).unwrap();
    let engine = simulation.on_device().unwrap();
    let mut encoder = gpu.device.create_command_encoder(&Default::default());
    engine.encode_fields(&mut encoder);
    gpu.queue.submit([encoder.finish()]);
    let read = |name: &str| -> Fields {
        let bytes = gpu.read_back(engine.memory(name).and_then(Memory::buffer).unwrap()).unwrap();
        bytemuck::cast_slice(&bytes).to_vec()
    };
    let (cells, nodes) = (read("drawn_cells"), read("drawn_nodes"));
    let count = simulation.model.mesh.cell_count();
    let largest = fields.von_mises.iter().copied().fold(0.0, f64::max);
    let pressure = fields.pressure.iter().map(|p| p.abs()).fold(0.0, f64::max);
    assert!(largest > 0.0 && pressure > 0.0, "nothing is stressed");
    let mut tissue = 0;
    for (cell, found) in cells.iter().take(count).enumerate() {
        if simulation.model.mesh.cell_volume(cell) == 0.0 {
            assert!(found[3] < 0.0, "a gap is drawn");
            continue;
        }
        tissue += 1;
        let [mises, p, stretch, left] = found.map(f64::from);
        at_most("von Mises", (mises - fields.von_mises[cell]).abs() / largest, 1e-3);
        at_most("pressure", (p - fields.pressure[cell]).abs() / pressure, 1e-3);
        let damage = fields.damage.get(cell).copied().unwrap_or(0.0);
        let kept = fields.stiffness.get(cell).copied().unwrap_or(1.0);
        at_most("stiffness left", (left - kept * (1.0 - damage)).abs(), 1e-4);
        assert!(stretch > 0.99 && stretch < 5.0, "stretch {stretch}");
    }
    assert!(tissue > 0);
    // Means of what is around each node.
    let mut sums = vec![([0.0f64; 4], 0.0f64); simulation.model.mesh.node_count()];
    for cell in (0..count).filter(|cell| cells[*cell][3] >= 0.0) {
        for node in simulation.model.mesh.cell_nodes(cell).iter() {
            sums[*node].1 += 1.0;
            for (sum, value) in sums[*node].0.iter_mut().zip(cells[cell]) {
                *sum += f64::from(value);
            }
        }
    }
    for (found, (sum, around)) in nodes.iter().zip(&sums).filter(|(_, (_, around))| *around > 0.0) {
        at_most("mean", (f64::from(found[0]) - sum[0] / around).abs() / largest, 1e-5);
        at_most("mean", (f64::from(found[2]) - sum[2] / around).abs(), 1e-5);
    }
}

#[test]
fn of_a_needle_in_tissue() {
    compare("scenes/muscle_biopsy.toml", &["tissue.cell_size_mm=1.0", "motion.phase.0.depth_mm=5.0"], 140);
}

/// Beside an opened path nodes are where they are seen, and cells strained as they are there. The window takes the middle of the path for the
/// axis of the needle, where the snapshot knows every section.
#[test]
fn of_an_opened_path() {
    let Some(gpu) = gpu() else { return };
    let file = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/muscle_biopsy.toml");
    let scene = Scene::load(&file, &["tissue.cell_size_mm=0.8".into()]).unwrap();
    let purpose = Purpose { led: false, drawn: true, lanes: false };
    let mut simulation = Simulation::for_purpose(scene, Some(gpu.clone()), purpose).unwrap();
    let frames = 270;
    simulation.stop_after(frames);
    let mut record = simulation.next_frame().unwrap().unwrap();
    while record.frame < frames {
        record = simulation.next_frame().unwrap().unwrap();
    }
    let opened = simulation.snapshot(&record).unwrap().opened.unwrap();
    let read = |record| -> Fields {
        simulation.show_needle(record);
        let engine = simulation.on_device().unwrap();
        let mut encoder = gpu.device.create_command_encoder(&Default::default());
        engine.encode_fields(&mut encoder);
        gpu.queue.submit([encoder.finish()]);
        let bytes = gpu.read_back(engine.memory("drawn_cells").and_then(Memory::buffer).unwrap()).unwrap();
        bytemuck::cast_slice(&bytes).to_vec()
    };
    // Without a needle in it the tissue is drawn with its path closed.
    let (shut, open) = (read(None), read(Some(&record)));
    let largest = opened.coarse().iter().copied().filter(|s| s.is_finite()).fold(0.0, f64::max);
    let (mut moved, mut through, mut worst, mut sum) = (0, 0, 0.0f64, 0.0);
    for ((stress, open), shut) in opened.coarse().iter().zip(&open).zip(&shut) {
        if stress.is_nan() {
            // Beside the tip less than beside the shaft.
            assert!(
                open[0] >= shut[0],
                "{} Pa, {} Pa with the path closed, in a cell that the needle runs through",
                open[0],
                shut[0]
            );
            through += usize::from(f64::from(open[0]) > 0.5 * largest);
            continue;
        }
        let apart = (f64::from(open[0]) - stress).abs() / largest;
        (worst, sum) = (worst.max(apart), sum + apart);
        moved += usize::from((open[0] - shut[0]).abs() > 0.05 * largest as f32);
    }
    at_most("von Mises in one cell", worst, 0.06);
    at_most("von Mises in all", sum / open.len() as f64, 1e-3);
    println!("{moved} cells are strained by the path, {through} hold it");
    assert!(moved > 50 && through > 20, "{moved} cells are strained by the path, {through} hold it");
}

#[test]
fn of_histories() {
    compare("scenes/effects/plasticity.toml", &[], 40);
    compare("scenes/effects/viscoelastic.toml", &[], 20);
    compare("scenes/effects/damage.toml", &[], 40);
    compare("scenes/effects/fibres.toml", &[], 20);
}

#[test]
fn of_separated_faces() {
    compare("scenes/effects/cohesive.toml", &[], 30);
}

#[test]
fn of_tetrahedra() {
    compare("scenes/forearm.toml", &[], 5);
}
