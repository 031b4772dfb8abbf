//! Scenes, overrides and checkpoints that were damaged at random: a clear message or a sane run, never a panic, a hang or a
//! greedy allocation. `FUZZ_CASES` sets the number of scenes (default 10,000). Meshes: tests/mesh_import/damage.rs.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use stylet::error::Error;
use stylet::mesh::BlockMesh;
use stylet::output::checkpoint::RunCheckpoint;
use stylet::scene::Scene;
use stylet::solver::simulation::{EngineChoice, Simulation};

/// Longest time for reading one scene and laying its mesh.
const PATIENCE: Duration = Duration::from_secs(10);

/// Most memory that all of it may take [bytes].
const MEMORY: u64 = 3 << 30;

/// Scenes with at most this many cells are run for a few frames.
const FEW_CELLS: usize = 2500;

/// xorshift64*: the same cases everywhere.
struct Random(u64);

impl Random {
    fn next(&mut self) -> u64 {
        self.0 ^= self.0 >> 12;
        self.0 ^= self.0 << 25;
        self.0 ^= self.0 >> 27;
        self.0.wrapping_mul(0x2545_f491_4f6c_dd1d) >> 11
    }

    fn below(&mut self, end: usize) -> usize {
        (self.next() % end.max(1) as u64) as usize
    }

    fn of<'a, T>(&mut self, choices: &'a [T]) -> &'a T {
        &choices[self.below(choices.len())]
    }
}

fn scenes(folder: &Path, found: &mut Vec<PathBuf>) {
    let mut entries: Vec<PathBuf> = std::fs::read_dir(folder).unwrap().map(|e| e.unwrap().path()).collect();
    entries.sort();
    for path in entries {
        match path.is_dir() {
            true => scenes(&path, found),
            false if path.extension().is_some_and(|e| e == "toml") => found.push(path),
            false => {}
        }
    }
}

/// Values that people and programs write where a number should be.
const VALUES: [&str; 22] = [
    "0",
    "0.0",
    "-0.0",
    "-1",
    "1e-30",
    "1e-9",
    "1e-3",
    "0.5",
    "2",
    "7.3",
    "1e3",
    "1e6",
    "1e30",
    "1e308",
    "-1e308",
    "inf",
    "-inf",
    "nan",
    "9223372036854775807",
    "\"\"",
    "[]",
    "true",
];

/// Changes the text at one to four places: bytes, lines, numbers, words of another scene.
fn damage(text: &str, other: &str, random: &mut Random) -> Vec<u8> {
    let mut bytes = text.as_bytes().to_vec();
    for _ in 0..1 + random.below(4) {
        if bytes.is_empty() {
            return bytes;
        }
        let at = random.below(bytes.len());
        match random.below(10) {
            0 => bytes[at] = random.next() as u8,
            1 => bytes[at] ^= 1 << random.below(8),
            2 => drop(bytes.remove(at)),
            3 => bytes.truncate(at),
            4 => bytes.insert(at, *random.of(b"0123456789.-+eE[]{}\"=,# \n")),
            5 => {
                // A line again, elsewhere or out of another scene.
                let source = if random.below(2) == 0 { text } else { other };
                let lines: Vec<&str> = source.lines().collect();
                let line = format!("\n{}\n", random.of(&lines));
                let at = bytes[..at].iter().rposition(|b| *b == b'\n').unwrap_or(0);
                bytes.splice(at..at, line.bytes());
            }
            6 => {
                let from = bytes[..at].iter().rposition(|b| *b == b'\n').unwrap_or(0);
                let to = bytes[at..].iter().position(|b| *b == b'\n').map_or(bytes.len(), |n| at + n);
                bytes.drain(from..to);
            }
            // Most of the time a number becomes another one.
            _ => {
                let number = |b: &u8| b.is_ascii_digit() || *b == b'.' || *b == b'-';
                let Some(from) = bytes[at..].iter().position(number).map(|n| at + n) else { continue };
                let to = bytes[from..].iter().position(|b| !number(b)).map_or(bytes.len(), |n| from + n);
                bytes.splice(from..to, random.of(&VALUES).bytes());
            }
        }
    }
    bytes
}

/// A refusal that tells the user what to do.
fn assert_clear(error: &Error, case: &str) {
    let text = error.to_string();
    match error {
        Error::Scene(_) => assert!(text.contains("error") && text.contains("way out"), "{case}\n{text}"),
        Error::Input { .. } | Error::Adapter { .. } => assert!(text.contains("way out"), "{case}\n{text}"),
        _ => assert!(!text.is_empty()),
    }
    assert!(text.len() < 200_000, "{case}: {} bytes of message", text.len());
}

#[test]
fn damaged_scenes_load_or_say_why() {
    let cases: u64 = std::env::var("FUZZ_CASES").ok().and_then(|v| v.parse().ok()).unwrap_or(10_000);
    let mut paths = Vec::new();
    scenes(&PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("scenes"), &mut paths);
    let texts: Vec<String> = paths.iter().map(|p| std::fs::read_to_string(p).unwrap()).collect();
    assert!(texts.len() > 30);
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("damaged.toml");
    let mut random = Random(0x5717_1e57);
    let (mut read, mut laid, mut run, mut slowest) = (0, 0, 0, Duration::ZERO);
    for case in 0..cases {
        let from = random.below(texts.len());
        let other = random.below(texts.len());
        let bytes = damage(&texts[from], &texts[other], &mut random);
        std::fs::write(&file, &bytes).unwrap();
        let name = || format!("case {case} from {}:\n{}", paths[from].display(), String::from_utf8_lossy(&bytes));
        let begin = Instant::now();
        let outcome = catch_unwind(AssertUnwindSafe(|| match Scene::load(&file, &[]) {
            Err(error) => {
                assert_eq!(error.exit_code(), 2);
                assert_clear(&error, &name());
                None
            }
            Ok(scene) if scene.mesh.is_some() => Some((scene, None)),
            Ok(scene) => {
                let mesh = BlockMesh::for_scene(&scene);
                Some((scene, Some(mesh)))
            }
        }));
        let Ok(loaded) = outcome else { panic!("panic in {}", name()) };
        assert!(begin.elapsed() < PATIENCE, "{:.1} s for {}", begin.elapsed().as_secs_f64(), name());
        slowest = slowest.max(begin.elapsed());
        let Some((scene, mesh)) = loaded else { continue };
        read += 1;
        let Some(mesh) = mesh else { continue };
        assert!(mesh.cell_count() > 0, "{}", name());
        laid += 1;
        // One in twenty is run for three frames, if it is small and its frames are short.
        if mesh.cell_count() > FEW_CELLS || case % 20 != 0 {
            continue;
        }
        let outcome = catch_unwind(AssertUnwindSafe(|| match Simulation::with_mesh(scene, mesh, EngineChoice::Cpu) {
            Err(error) => assert_clear(&error, &name()),
            Ok(mut simulation) => {
                let work = simulation.steps_per_frame() as usize * simulation.model.mesh.cell_count();
                // The frames that are started ahead are simulated too.
                for _ in 0..if work < 4_000_000 { 3 } else { 0 } {
                    match simulation.next_frame() {
                        Ok(Some(record)) => assert!(record.health.not_finite || record.energy.external.is_finite()),
                        Ok(None) => break,
                        Err(error) => {
                            assert_clear(&error, &name());
                            break;
                        }
                    }
                }
            }
        }));
        assert!(outcome.is_ok(), "panic in the run of {}", name());
        run += 1;
    }
    println!(
        "{cases} scenes: {read} read, {laid} laid, {run} run; the slowest took {:.0} ms to read",
        slowest.as_secs_f64() * 1e3
    );
    assert!(read as u64 > cases / 50 && run > 5, "too few survive to tell anything");
    if let Some(peak) = stylet::process::peak_bytes() {
        assert!(peak < MEMORY, "{} MB", peak >> 20);
    }
}

#[test]
fn damaged_overrides_are_refused_or_taken() {
    let path = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("scenes/muscle_biopsy.toml");
    let keys = [
        "tissue.cell_size_mm",
        "motion.phase.0.depth_mm",
        "needle.gauge",
        "effects",
        "puncture",
        "a.b",
        "",
        "=",
        "[x]",
    ];
    let mut random = Random(99);
    for case in 0..1000 {
        let mut text = format!("{}={}", random.of(&keys), random.of(&VALUES)).into_bytes();
        if random.below(2) == 0 && !text.is_empty() {
            let at = random.below(text.len());
            text[at] = *random.of(b"\"'[]{}=., \n\t#x0");
        }
        let text = String::from_utf8(text).unwrap();
        let outcome = catch_unwind(|| match Scene::load(&path, std::slice::from_ref(&text)) {
            Err(error) => assert_clear(&error, &text),
            Ok(scene) => drop(scene),
        });
        assert!(outcome.is_ok(), "case {case}: panic with --set {text:?}");
    }
}

#[test]
fn damaged_checkpoints_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let scene = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("scenes/effects/gravity.toml");
    let mut simulation = Simulation::new(Scene::load(&scene, &[]).unwrap(), EngineChoice::Cpu).unwrap();
    simulation.stop_after(0);
    let records = vec![simulation.next_frame().unwrap().unwrap()];
    let whole = RunCheckpoint {
        version: env!("CARGO_PKG_VERSION").into(),
        scene,
        overrides: Vec::new(),
        fingerprint: 1,
        adapter: "none".into(),
        records,
        cells_in_needle: None,
        fields: Vec::new(),
        wall: 0.0,
        cpu: None,
        simulation: simulation.checkpoint().unwrap(),
    };
    let path = folder.path().join("checkpoint.stylet");
    whole.write(&path).unwrap();
    assert!(RunCheckpoint::read(&path).is_ok());
    let bytes = std::fs::read(&path).unwrap();
    let mut random = Random(7);
    let mut refused = 0;
    for _ in 0..500 {
        let mut bytes = bytes.clone();
        let at = random.below(bytes.len());
        match random.below(3) {
            0 => bytes.truncate(at),
            1 => bytes[at] ^= 1 << random.below(8),
            _ => drop(bytes.drain(at..(at + 1 + random.below(40)).min(bytes.len()))),
        }
        std::fs::write(&path, &bytes).unwrap();
        let outcome = catch_unwind(|| RunCheckpoint::read(&path));
        match outcome.expect("no panic") {
            Err(error) => {
                assert_eq!(error.exit_code(), 2);
                refused += 1;
            }
            // A flipped bit that zlib does not use, such as the level in its header, changes nothing.
            Ok(found) => assert_eq!(found.simulation.frames, 1),
        }
    }
    assert!(refused > 490, "{refused} of 500");
}
