//! What several test targets share: scenes in code, both engines, reference files, comparisons.
#![allow(dead_code)] // Every target uses its own part.

use std::path::Path;
use std::sync::{Arc, OnceLock};

use glam::{DMat3, DVec3};
use serde_json::Value;
use stylet::cpu::{CpuEngine, unknown_to_lanes};
use stylet::effects::TissueMaterial;
use stylet::engine::{Engine, FramePlan, FrameSums, State, StepInput};
use stylet::gpu::{Gpu, GpuEngine};
use stylet::material::ElasticLaw;
use stylet::mesh::BlockMesh;
use stylet::model::Model;
use stylet::needle::{Motion, Phase, Tool};
use stylet::scene::{Face, FaceCondition, FaceDrive, Scene, SolverSettings};

/// Material A of the reference files.
pub const MATERIAL_A: ElasticLaw = ElasticLaw::mooney_rivlin(2300.0, 1000.0, 5.0e5);
/// Material N of the reference files.
pub const MATERIAL_N: ElasticLaw = ElasticLaw::mooney_rivlin(3300.0, 0.0, 5.0e5);
/// Density of the reference files [kg/m^3].
pub const DENSITY: f64 = 1060.0;
/// Default hourglass constants of a scene without and with the effect `puncture`.
pub const HOURGLASS: (f64, f64) = (0.1, 1000.0);
pub const HOURGLASS_PUNCTURE: (f64, f64) = (0.1, 15_000.0);

/// The adapter of this machine, opened once; `None` (and a line on stdout) where there is none.
///
/// Panics with `REQUIRE_GPU=1` where there is none.
pub fn gpu() -> Option<Gpu> {
    static GPU: OnceLock<Option<Gpu>> = OnceLock::new();
    GPU.get_or_init(|| match Gpu::open() {
        Ok(gpu) => {
            let info = &gpu.info;
            println!("adapter: {}, driver {} {}", info.name, info.driver, info.driver_info);
            Some(gpu)
        }
        Err(error) if std::env::var("REQUIRE_GPU").is_ok_and(|v| v == "1") => {
            panic!("REQUIRE_GPU=1, but {error}")
        }
        Err(error) => {
            println!("skipped: no adapter ({error})");
            None
        }
    })
    .clone()
}

/// The engines that can run here: f64, the adapter, lanes of f32 where these know the model.
pub fn engines(model: &Arc<Model>, dt: f64, max_steps: usize) -> Vec<(&'static str, Box<dyn Engine>)> {
    let mut engines: Vec<(&'static str, Box<dyn Engine>)> = vec![("cpu", Box::new(CpuEngine::new(model.clone(), dt)))];
    engines.extend(gpu_engine(model, dt, max_steps).map(|e| ("gpu", Box::new(e) as Box<dyn Engine>)));
    // Elsewhere it is the f64 engine once more.
    if unknown_to_lanes(&model.scene).is_none() {
        engines.push(("lanes", Box::new(CpuEngine::in_lanes(model.clone(), dt))));
    }
    engines
}

/// How far apart an effect that changes nothing may leave a run of this engine: f64 not at all. Shaders with and without it are two programs,
/// which a software driver leaves `of_shaders` apart; a hardware driver fuses products and sums in each as it likes (H100: 1.2e-5 after 5000
/// steps), and lanes sum up in another order (1.6e-5 of a small force).
pub fn neutral(engine: &str, of_shaders: f64) -> f64 {
    match engine {
        "cpu" => 1e-12,
        "gpu" if gpu().is_some_and(|gpu| gpu.is_software()) => of_shaders,
        _ => 3e-5,
    }
}

pub fn gpu_engine(model: &Arc<Model>, dt: f64, max_steps: usize) -> Option<GpuEngine> {
    gpu().map(|gpu| GpuEngine::new(model.clone(), gpu, dt, max_steps).unwrap())
}

/// A block of material A without effects, tool or support; edge lengths and cell edge in mm.
pub fn block(size_mm: [f64; 3], cell_mm: f64) -> Scene {
    let material = TissueMaterial::new("A", "reference files", MATERIAL_A, DENSITY);
    let mut scene = Scene::block(DVec3::from(size_mm) * 1e-3, cell_mm * 1e-3, material).lasting(1.0);
    scene.faces = Default::default();
    scene.solver = SolverSettings {
        mass_damping: 0.0,
        hourglass_stiffness: HOURGLASS.0,
        hourglass_quartic: HOURGLASS.1,
        frame_rate: 30.0,
        ..scene.solver
    };
    scene
}

/// Gives a scene a tool that enters at the middle of the top face.
pub fn with_tool(scene: &mut Scene, tool: Tool, direction: DVec3, phases: Vec<Phase>) {
    scene.tool = Some(tool);
    scene.motion = Motion { entry: DVec3::ZERO, direction: direction.normalize(), phases, vibration: None };
}

/// A face whose listed components are held.
pub fn held(x: bool, y: bool, z: bool) -> FaceCondition {
    FaceCondition { fixed: [x, y, z], ..Default::default() }
}

pub fn model(scene: Scene) -> Arc<Model> {
    let mesh = BlockMesh::for_scene(&scene);
    Arc::new(Model::new(scene, mesh))
}

/// A block with cell edges between 0.7 and 1.5 mm that repeat nowhere.
pub fn graded_mesh(cells: [usize; 3]) -> BlockMesh {
    let lines = |axis: usize| {
        let mut x = 0.0;
        let mut lines: Vec<f64> = (0..=cells[axis])
            .map(|i| {
                let at = x;
                x += 1e-3 * (0.7 + 0.8 * ((i * 7 + axis * 3) % 11) as f64 / 10.0);
                at
            })
            .collect();
        // The block stands where a scene would put it: centred, top face at z = 0.
        let shift = if axis == 2 { lines[cells[axis]] } else { 0.5 * lines[cells[axis]] };
        lines.iter_mut().for_each(|l| *l -= shift);
        lines
    };
    BlockMesh::new([lines(0), lines(1), lines(2)])
}

/// Advances an engine by `steps` steps in one frame; `step` counts the steps since t = 0.
pub fn advance(engine: &mut dyn Engine, model: &Model, dt: f64, step: &mut u64, steps: usize) -> FrameSums {
    let plan = FramePlan {
        frame: *step,
        first_step: *step,
        steps: (0..steps as u64).map(|s| StepInput::at(model, (*step + s) as f64 * dt, dt)).collect(),
        centre_line: None,
    };
    *step += steps as u64;
    engine.start_frame(&plan).unwrap();
    let sums = engine.collect(true).unwrap().expect("a finished frame");
    assert!(!sums.health.not_finite, "state out of range after step {step}");
    sums
}

/// A state at rest with the displacement `u(X)`.
pub fn displaced(engine: &mut dyn Engine, model: &Model, u: impl Fn(DVec3) -> DVec3) -> State {
    let mut state = engine.read_state().unwrap();
    for (node, value) in state.displacement.iter_mut().enumerate() {
        *value = u(model.mesh.rest_position(node));
    }
    engine.write_state(&state).unwrap();
    state
}

/// A parsed file of tests/references.
pub fn reference(name: &str) -> Value {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/references").join(name);
    let text = std::fs::read_to_string(&path).unwrap_or_else(|e| panic!("{}: {e}", path.display()));
    serde_json::from_str(&text).unwrap()
}

/// A number of a reference file.
pub fn number(value: &Value) -> f64 {
    value.as_f64().unwrap_or_else(|| panic!("{value} is no number"))
}

pub fn vector(value: &Value) -> DVec3 {
    DVec3::from(std::array::from_fn(|a| number(&value[a])))
}

/// A row-major list of lists.
pub fn tensor(value: &Value) -> DMat3 {
    DMat3::from_cols(vector(&value[0]), vector(&value[1]), vector(&value[2])).transpose()
}

/// `a (x) b`.
pub fn outer(a: DVec3, b: DVec3) -> DMat3 {
    DMat3::from_cols(a * b.x, a * b.y, a * b.z)
}

/// Largest absolute entry.
pub fn largest_entry(m: DMat3) -> f64 {
    m.to_cols_array().iter().fold(0.0, |l, x| l.max(x.abs()))
}

pub fn largest(vectors: &[DVec3]) -> f64 {
    vectors.iter().map(|v| v.length()).fold(0.0, f64::max)
}

/// Largest difference over the largest vector of `expected`.
pub fn relative_difference(found: &[DVec3], expected: &[DVec3]) -> f64 {
    assert_eq!(found.len(), expected.len());
    let difference = found.iter().zip(expected).map(|(a, b)| (*a - *b).length()).fold(0.0, f64::max);
    difference / largest(expected)
}

/// Asserts `|found/expected - 1| <= tolerance`; prints what was measured.
pub fn close(what: &str, found: f64, expected: f64, tolerance: f64) {
    let error = (found / expected - 1.0).abs();
    println!("{what}: {found:.8e}, expected {expected:.8e}, off by {error:.2e} (allowed {tolerance:.0e})");
    assert!(error <= tolerance, "{what}: {found:e} instead of {expected:e}, off by {error:.2e} > {tolerance:e}");
}

/// Asserts `value <= bound`; prints what was measured.
pub fn at_most(what: &str, value: f64, bound: f64) {
    println!("{what}: {value:.2e} (allowed {bound:.0e})");
    assert!(value <= bound, "{what}: {value:.3e} > {bound:e}");
}

/// Repeatable random numbers (splitmix64).
pub struct Random(pub u64);

impl Random {
    /// Uniform in -1..1.
    pub fn signed(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^= z >> 31;
        (z >> 11) as f64 / (1u64 << 52) as f64 - 1.0
    }

    pub fn vector(&mut self) -> DVec3 {
        DVec3::new(self.signed(), self.signed(), self.signed())
    }

    pub fn tensor(&mut self) -> DMat3 {
        DMat3::from_cols(self.vector(), self.vector(), self.vector())
    }
}

/// A specimen pulled along z with free sides: planes of symmetry at x_min, y_min and z_min, z_max driven to the nominal
/// strain `strain` in `duration` [s].
pub fn pulled(size_mm: [f64; 3], cell_mm: f64, strain: f64, duration: f64) -> Scene {
    let mut scene = block(size_mm, cell_mm);
    // Between ends that slide, cells under 30 % compression buckle into hourglass modes with the default of 0.1.
    scene.solver.hourglass_stiffness = 1.0;
    scene.faces[Face::XMin as usize] = held(true, false, false);
    scene.faces[Face::YMin as usize] = held(false, true, false);
    scene.faces[Face::ZMin as usize] = held(false, false, true);
    scene.faces[Face::ZMax as usize] = FaceCondition {
        drive: Some(FaceDrive {
            displacement: DVec3::Z * (strain * scene.tissue.size.z),
            rotation: 0.0,
            duration,
            cycles: 0,
        }),
        ..held(false, false, true)
    };
    scene
}

/// One frame of a pulled specimen.
#[derive(Debug, Clone, Default)]
pub struct Sample {
    pub time: f64,
    /// Stretch along z and nominal stress on z_max [Pa].
    pub stretch: f64,
    pub nominal: f64,
    /// Stretches along x and y.
    pub lateral: [f64; 2],
    /// Largest equivalent plastic strain and damage of all cells.
    pub alpha: f64,
    pub damage: f64,
    pub sums: FrameSums,
    /// Totals since t = 0 [J].
    pub work: f64,
    pub plastic: f64,
    pub degradation: f64,
    pub damping: f64,
}

/// Runs a pulled specimen for `duration` [s] in `frames` frames of at least `steps` steps that keep 0.8 of the stable step.
pub fn pull(engine: &mut dyn Engine, model: &Model, dt: f64, frames: usize, steps: usize) -> Vec<Sample> {
    let size = model.scene.tissue.size;
    let corner = (0..model.mesh.node_count())
        .find(|n| {
            let x = model.mesh.rest_position(*n);
            (x - DVec3::new(0.5 * size.x, 0.5 * size.y, 0.0)).length() < 1e-9
        })
        .expect("the corner at x_max, y_max, z_max");
    let mut samples = vec![Sample { stretch: 1.0, lateral: [1.0; 2], ..Default::default() }];
    let mut step = 0;
    for _ in 0..frames {
        let sums = advance(engine, model, dt, &mut step, steps);
        let state = engine.read_state().unwrap();
        let last = samples.last().unwrap();
        let u = state.displacement[corner];
        samples.push(Sample {
            time: step as f64 * dt,
            stretch: 1.0 + u.z / size.z,
            nominal: sums.reactions[Face::ZMax as usize].z / (size.x * size.y),
            lateral: [1.0 + u.x / size.x, 1.0 + u.y / size.y],
            alpha: state.points.iter().map(|p| p.plastic.alpha).fold(0.0, f64::max),
            damage: sums.health.largest_damage,
            work: last.work + sums.load_work,
            plastic: last.plastic + sums.energy.plastic,
            degradation: last.degradation + sums.energy.damage,
            damping: last.damping + sums.energy.damping,
            sums,
        });
    }
    samples
}

/// Values of `of` where `at` first reaches `x`, by linear interpolation.
pub fn interpolated(samples: &[Sample], at: impl Fn(&Sample) -> f64, x: f64, of: impl Fn(&Sample) -> f64) -> f64 {
    let pair = samples.windows(2).find(|w| (at(&w[0]) - x) * (at(&w[1]) - x) <= 0.0 && at(&w[0]) != at(&w[1]));
    let pair = pair.unwrap_or_else(|| panic!("{x} is not reached: {} at the end", at(samples.last().unwrap())));
    let t = (x - at(&pair[0])) / (at(&pair[1]) - at(&pair[0]));
    of(&pair[0]) + t * (of(&pair[1]) - of(&pair[0]))
}
