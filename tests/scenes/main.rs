//! Headless runs of the scenes against what is known about them. Written for release builds: without optimisation, and
//! without `STYLET_FULL=1`, the comparisons that need the processor engine take a coarser mesh.

use std::path::PathBuf;
use std::sync::OnceLock;

use glam::DVec3;
use stylet::engine::State;
use stylet::gpu::Gpu;
use stylet::observables::FrameRecord;
use stylet::output::{CurveFigures, Summary};
use stylet::scene::{Face, Scene};
use stylet::simulation::{EngineChoice, Simulation};

mod effects;
mod free_hand;
mod muscle_biopsy;
mod samples;
mod slit;
mod tip;
mod validation;

fn load(name: &str, overrides: &[&str]) -> Scene {
    let path = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("scenes").join(name);
    let overrides: Vec<String> = overrides.iter().map(|s| s.to_string()).collect();
    Scene::load(&path, &overrides).unwrap_or_else(|e| panic!("{e}"))
}

/// True where an adapter can be opened; `REQUIRE_GPU=1` turns its absence into a failure.
fn has_gpu() -> bool {
    static FOUND: OnceLock<bool> = OnceLock::new();
    let found = *FOUND.get_or_init(|| match Gpu::open() {
        Ok(gpu) => {
            println!("adapter: {} ({} {})", gpu.info.name, gpu.info.driver, gpu.info.driver_info);
            true
        }
        Err(error) => {
            println!("{error}");
            false
        }
    });
    assert!(found || std::env::var_os("REQUIRE_GPU").is_none_or(|v| v != "1"), "REQUIRE_GPU=1 and no adapter");
    if !found {
        println!("skipped: no GPU adapter");
    }
    found
}

/// The GPU where there is one: the numbers of a scene do not depend on the engine.
fn best_engine() -> EngineChoice {
    if has_gpu() { EngineChoice::Gpu } else { EngineChoice::Cpu }
}

/// True where the full comparisons are run.
fn full() -> bool {
    !cfg!(debug_assertions) || std::env::var_os("STYLET_FULL").is_some_and(|v| v == "1")
}

/// A finished run.
struct Run {
    simulation: Simulation,
    records: Vec<FrameRecord>,
    summary: Summary,
    figures: CurveFigures,
}

fn run(name: &str, overrides: &[&str], engine: EngineChoice) -> Run {
    let begin = std::time::Instant::now();
    let mut simulation = Simulation::new(load(name, overrides), engine).unwrap_or_else(|e| panic!("{name}: {e}"));
    let on = simulation.engine().info().engine.clone();
    assert_eq!(on, if engine == EngineChoice::Cpu { "cpu" } else { "gpu" });
    let mut records = Vec::new();
    while let Some(record) = simulation.next_frame().unwrap_or_else(|e| panic!("{name}: {e}")) {
        records.push(record);
    }
    assert_eq!(records.len() as u64, simulation.frame_count());
    let mut summary = Summary::default();
    summary.take_frames(&records);
    println!(
        "{name} {overrides:?} on {engine:?}: {} cells, {} steps, {:.1} s wall; imbalance {:.3} %, kinetic {:.3} %, \
         hourglass {:.2} %",
        simulation.model.mesh.cell_count(),
        simulation.total_steps(),
        begin.elapsed().as_secs_f64(),
        100.0 * summary.energy_imbalance,
        100.0 * summary.kinetic_to_internal,
        100.0 * summary.hourglass_to_internal
    );
    let figures = CurveFigures::from_records(&records);
    Run { simulation, records, summary, figures }
}

/// Largest residual of a frame over the largest external work of the whole run: a bound on its end, where the verdict has one on
/// every moment.
fn whole_run_imbalance(records: &[FrameRecord]) -> f64 {
    let residual = records.iter().map(|r| (r.energy.external - r.energy.accounted()).abs()).fold(0.0, f64::max);
    residual / records.iter().map(|r| r.energy.external_max).fold(0.0, f64::max)
}

impl Run {
    fn state(&mut self) -> State {
        self.simulation.engine().read_state().unwrap()
    }

    fn last(&self) -> &FrameRecord {
        self.records.last().unwrap()
    }

    /// Signs that hold for every scene that is worth reading a number from.
    fn assert_sound(&self) {
        let s = &self.summary;
        assert!(s.energy_imbalance <= 0.02, "energy imbalance {}", s.energy_imbalance);
        assert_eq!((s.clamped_nodes, s.inverted_cells), (0, 0), "clamped nodes, inverted cells");
    }

    fn force_at_depth(&self) -> f64 {
        self.figures.force_at_max_depth.unwrap()
    }

    /// Nodes of a face.
    fn face(&self, face: Face) -> Vec<usize> {
        let mesh = &self.simulation.model.mesh;
        let plane = if face.is_max() { mesh.block().nodes()[face.axis()] - 1 } else { 0 };
        (0..mesh.node_count()).filter(|&n| mesh.block().node_coordinates(n)[face.axis()] == plane).collect()
    }

    /// Force [N] and moment about the axis x = y = 0 [N m] that the support of a face exerts on the tissue at rest.
    fn reaction(&mut self, face: Face) -> (DVec3, DVec3) {
        let nodes = self.face(face);
        let force = self.simulation.engine().internal_forces().unwrap();
        let state = self.state();
        let mesh = &self.simulation.model.mesh;
        let place = |n: usize| mesh.rest_position(n) + state.displacement[n];
        let sum = nodes.iter().map(|&n| force[n]).sum();
        let moment = nodes.iter().map(|&n| place(n).cross(force[n])).sum();
        (sum, moment)
    }
}

/// `a` lies within `part` of `b`; prints both.
fn assert_near(what: &str, a: f64, b: f64, part: f64) {
    println!("{what}: {a:.6e}, expected {b:.6e} within {:.2} %: {:+.3} %", 100.0 * part, 100.0 * (a / b - 1.0));
    assert!((a - b).abs() <= part * b.abs(), "{what}: {a}, expected {b} within {:.2} %", 100.0 * part);
}
