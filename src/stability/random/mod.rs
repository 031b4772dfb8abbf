//! Random scenes: what the program does with scenes that nobody thought of.
//!
//! A scene is drawn from the whole schema by a seed and an index, written as text and read by the reader of scene files, so that
//! refusals are those of a user. One in twenty-five holds a deliberate mistake. Needles (solid, bevelled, hollow, flexible; straight, oblique, free,
//! vibrating; paths softened or opened; in, hold, out, in again), spheres and punches, driven and loaded faces, tetrahedra; all laws and presets, regions, membranes,
//! all effects.
//!
//! Size: at most [`MOST_CELLS`] cells and [`MOST_CELL_STEPS`] steps times cells: 0.3 to 3 s of CPU time. Pace and cells follow that bound:
//! a scene that would take longer moves faster.
//!
//! A scene may end *ok*, *doubtful*, *refused* or *stopped*, each with its reason, a refusal with a way out. Nothing else counts: no panic, no hang, and
//! no run that says ok while its energy, measured here on its own, is out of balance by more than [`MOST_IMBALANCE`].
//!
//! | reasonable is | bound |
//! |---|---|
//! | speed | a tool 0.06 of the shear wave speed of the softest material at its scaled density, and 0.2 m/s; five passages of that wave while a face moves or a load grows (what a scene is told before it runs) |
//! | materials | stable laws; nu 0 to 0.499; moduli within 1 : 30; Ogden 1 <= abs(alpha) <= 10, Demiray b <= 10, Yeoh c20, c30 <= 3 c10 |
//! | cells | at most 0.7 needle diameters (what a scene is told before it runs), an indenter 1.5 cells in radius, a sample 3 across, a region 1 |
//! | tip forces | puncture force over the section of the needle 0.5 to 7 E and up to 3 K (what a scene is told before it runs), cutting below it; a membrane up to 2 mm times it |
//! | opened path | toughness 0.5 to 20 times shear modulus and radius of the needle |
//! | path | radius and 2 cells from the sides, 2 cells from the bottom; turns up to 10 degrees in the tissue; at most 4 phases |
//! | flexible needle | punctures below half of its buckling load |
//! | tip numbers | tip springs 0.3 to 10 N/mm, contact stiffness 0.5 to 5, damping to 0.6, softening and fade near their defaults |
//! | indentation | 0.85 radii and a quarter of the height |
//! | faces | pressed by 0.35, pulled or sheared by 0.5, turned by 90 degrees, loaded by 0.3 E, bent by a load to a strain of 0.3, pressed by half of the buckling load where the sides are free, not at once; by half a cell against a face that holds their common edge (what a scene is told before it runs) |
//! | gravity | 10 m/s^2 and a tenth of E |
//! | plasticity, fibres | yields above 0.1 E, hardens below 20 E; k1 up to 5 mu, k2 up to 3 |
//! | bond | fails at twice its onset or later, strength 0.05 to 6 E, and above the dead load that hangs on it |
//! | solver | safety 0.3 to 0.9, an own step up to 0.9 of the stable one, damping up to 200/s, hourglass stiffness 0.03 to 1 |

mod generator;
pub mod numbers;
mod reasonable;
mod report;
mod runner;

use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};

use crate::gpu::Gpu;
use crate::simulation::EngineChoice;
use crate::{Error, Result};

pub use generator::RandomScene;
pub use report::{RandomReport, SceneReport};
pub use runner::{End, Outcome, apart};

/// Most cells of a block, and most steps times cells of a run.
pub const MOST_CELLS: usize = 3000;
pub const MOST_CELL_STEPS: f64 = 2.5e6;

/// Part of the energy that may be missing in a run that says ok.
pub const MOST_IMBALANCE: f64 = 0.02;

/// Part of the reasonable scenes that must end ok; one scene may always miss it.
pub const OK_PART: f64 = 0.98;

/// Part of the peak force by which the engines may differ in a reasonable scene that both end ok.
pub const MOST_APART: f64 = 0.005;

/// Relative change of the bulk moduli that no force should feel: one rounding of f32. A scene whose forces on the CPU engine move by more
/// than [`SENSITIVE`] of the peak with it multiplies every rounding, as stick-slip does, so that no two engines can follow one another.
pub const NUDGE: f64 = 1.0 / (1 << 23) as f64;
pub const SENSITIVE: f64 = 1000.0 * NUDGE;

/// What is run.
#[derive(Debug, Clone)]
pub struct RandomOptions {
    pub count: u64,
    pub seed: u64,
    /// These scenes only; empty: 0 to `count` - 1.
    pub only: Vec<u64>,
    pub engines: Vec<EngineChoice>,
    /// Folder of the scenes that end other than ok.
    pub keep: Option<PathBuf>,
}

/// A seed that no run before had.
pub fn fresh_seed() -> u64 {
    let since = std::time::SystemTime::now().duration_since(std::time::UNIX_EPOCH).unwrap_or_default();
    // Short enough to be typed.
    (since.as_nanos() as u64 ^ u64::from(std::process::id()) << 20) % 1_000_000_000
}

/// Runs the scenes. `before` is told each one before it starts, `after` what came out; `interrupted` ends the run after the scene under way.
///
/// # Errors
/// `Error::Adapter` where an engine is not to be had, `Error::File` where a folder cannot be written.
pub fn run(
    options: &RandomOptions,
    before: &mut dyn FnMut(u64),
    after: &mut dyn FnMut(&SceneReport),
    interrupted: &AtomicBool,
) -> Result<RandomReport> {
    let devices = devices(&options.engines)?;
    let own = std::env::temp_dir().join(format!("stylet-random-{}", std::process::id()));
    let folder = options.keep.clone().unwrap_or_else(|| own.clone());
    std::fs::create_dir_all(&folder).map_err(|source| Error::file(&folder, source))?;
    let indices = if options.only.is_empty() { (0..options.count).collect() } else { options.only.clone() };
    let mut report = RandomReport::new(options.seed);
    for index in indices {
        if interrupted.load(Ordering::Relaxed) {
            report.interrupted = true;
            break;
        }
        before(index);
        let scene = scene(options, index, &folder, &devices)?;
        after(&scene);
        report.scenes.push(scene);
    }
    if options.keep.is_none() {
        drop(std::fs::remove_dir_all(&own));
    }
    Ok(report)
}

/// The devices of the engines, opened once; `None`: the CPU engine.
fn devices(engines: &[EngineChoice]) -> Result<Vec<Option<Gpu>>> {
    let open = |engine: &EngineChoice| match engine {
        EngineChoice::Cpu | EngineChoice::Cpu64 => Ok(None),
        EngineChoice::Gpu => Gpu::open().map(Some),
        EngineChoice::Auto => Ok(Gpu::open().ok()),
    };
    engines.iter().map(open).collect()
}

/// Makes and runs one scene; its file stays where it ends other than ok, or takes the program with it.
fn scene(options: &RandomOptions, index: u64, folder: &Path, devices: &[Option<Gpu>]) -> Result<SceneReport> {
    let scene = RandomScene::make(options.seed, index, folder)?;
    let path = scene.path(folder);
    let file = |text: String| std::fs::write(&path, text).map_err(|source| Error::file(&path, source));
    file(format!("# random scene, seed {}, index {index}; under way\n{}", options.seed, scene.text))?;
    let outcomes: Vec<Outcome> =
        devices.iter().map(|device| runner::run(&scene, folder, device.clone(), 0.0)).collect();
    let mut report = SceneReport::new(&scene, outcomes);
    if report.engines_disagree() {
        let [reference, nudged] = [0.0, NUDGE].map(|nudge| runner::run(&scene, folder, None, nudge));
        report.own = apart(&nudged, &reference);
    }
    if report.is_plain() {
        let mesh = scene.mesh.as_ref().map(|(name, _)| folder.join(name));
        for path in std::iter::once(path.clone()).chain(mesh) {
            std::fs::remove_file(&path).map_err(|source| Error::file(&path, source))?;
        }
    } else {
        file(format!("{}{}", report.head(), scene.text))?;
    }
    Ok(report)
}
