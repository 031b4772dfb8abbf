//! Files that were damaged at random: a clear message or a sane run, never a panic, a hang or a greedy allocation. Scenes go on to
//! their mesh and first frames, every other reader of `stylet::untrusted` as far as the fuzz targets in `fuzz/` go, whose bodies
//! are the same. `FUZZ_CASES` sets the number of scenes (default 10,000); each reader gets a quarter as many files. More on meshes: tests/mesh_import/damage.rs.

use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use stylet::error::Error;
use stylet::mesh::BlockMesh;
use stylet::output::checkpoint::RunCheckpoint;
use stylet::scene::Scene;
use stylet::simulation::{EngineChoice, Simulation};
use stylet::study::plan::{Basis, Costs, Plan, choose};
use stylet::study::store::RunRecord;
use stylet::study::{Axis, Engine, MeshSize, Settings};
use stylet::untrusted::{READERS, Reader};

/// Longest time for reading one scene and laying its mesh.
const PATIENCE: Duration = Duration::from_secs(10);

/// Most memory that all of it may take [bytes].
const MEMORY: u64 = 3 << 30;

/// Scenes with at most this many cells are run for a few frames.
const FEW_CELLS: usize = 2500;

thread_local! {
    /// Memory that this thread has taken and not given back, and the most of it since the last reset [B].
    static TAKEN: Cell<isize> = const { Cell::new(0) };
    static MOST: Cell<isize> = const { Cell::new(0) };
}

/// The allocator of the system, which counts what each thread takes.
struct Counting;

fn count(bytes: isize) {
    // A thread that ends has no counters any more.
    let _ = TAKEN.try_with(|taken| {
        taken.set(taken.get() + bytes);
        MOST.try_with(|most| most.set(most.get().max(taken.get())))
    });
}

// SAFETY: every call goes to the allocator of the system unchanged.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        count(layout.size() as isize);
        unsafe { System.alloc(layout) }
    }

    unsafe fn alloc_zeroed(&self, layout: Layout) -> *mut u8 {
        count(layout.size() as isize);
        unsafe { System.alloc_zeroed(layout) }
    }

    unsafe fn dealloc(&self, block: *mut u8, layout: Layout) {
        count(-(layout.size() as isize));
        unsafe { System.dealloc(block, layout) }
    }

    unsafe fn realloc(&self, block: *mut u8, layout: Layout, size: usize) -> *mut u8 {
        // Both blocks are there while it is copied.
        count(size as isize);
        count(-(layout.size() as isize));
        unsafe { System.realloc(block, layout, size) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

/// What `work` gives, and the most memory that this thread took meanwhile [B].
fn measured<T>(work: impl FnOnce() -> T) -> (T, usize) {
    let before = TAKEN.get();
    MOST.set(before);
    let done = work();
    (done, (MOST.get() - before).max(0) as usize)
}

/// Number of cases.
fn cases() -> u64 {
    std::env::var("FUZZ_CASES").ok().and_then(|v| v.parse().ok()).unwrap_or(10_000)
}

fn repository() -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR"))
}

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
    assert!(text.len() < 8_000, "{case}: {} bytes of message", text.len());
}

#[test]
fn damaged_scenes_load_or_say_why() {
    let cases = cases();
    let mut paths = Vec::new();
    scenes(&repository().join("scenes"), &mut paths);
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
    let path = repository().join("scenes/muscle_biopsy.toml");
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

/// Sample files of every reader, whole ones.
fn seeds(reader: &Reader, checkpoint: &(Vec<u8>, Vec<u8>)) -> Vec<Vec<u8>> {
    let files = |folder: &str, extension: &str| -> Vec<Vec<u8>> {
        let entries = std::fs::read_dir(repository().join(folder)).unwrap().map(|e| e.unwrap().path());
        let mut paths: Vec<PathBuf> = entries.filter(|p| p.extension().is_some_and(|e| e == extension)).collect();
        paths.sort();
        paths.iter().map(|p| std::fs::read(p).unwrap()).collect()
    };
    let volumes =
        |ends: &[&str]| -> Vec<Vec<u8>> { ends.iter().flat_map(|end| files("tests/anatomy/files", end)).collect() };
    let settings = Settings {
        cell_size_mm: 0.6,
        mass_scaling: 4000.0,
        safety: 0.8,
        engine: Engine::Gpu,
        effects: ["mass_scaling", "puncture"].map(String::from).to_vec(),
        repetition: 0,
    };
    match reader.name {
        "scene" => ["scenes", "scenes/hard", "scenes/effects", "scenes/training"]
            .iter()
            .flat_map(|f| files(f, "toml"))
            .collect(),
        "overrides" => vec![
            b"tissue.cell_size_mm=0.8\nneedle.gauge=18G\nmotion.phase.0.depth_mm=5".to_vec(),
            b"outputs.pictures_at_depth_mm=[1.0, 2.0]\nsolver.frame_rate_hz=30".to_vec(),
            b"effects=[\"puncture\"]\nmotion.phase.3={kind=\"hold\",duration_s=1}".to_vec(),
        ],
        "materials" => vec![std::fs::read(repository().join("assets/materials.toml")).unwrap()],
        "predictions" => vec![std::fs::read(repository().join("assets/predictions.toml")).unwrap()],
        "gmsh" => files("tests/meshes", "msh"),
        "vtk" => files("tests/meshes", "vtk"),
        "vtu" => files("tests/meshes", "vtu"),
        "abaqus" => files("tests/meshes", "inp"),
        "surface" => ["stl", "obj", "ply", "vtp"].iter().flat_map(|e| files("tests/anatomy/files", e)).collect(),
        "checkpoint" => vec![checkpoint.0.clone()],
        "checkpoint_message" => vec![checkpoint.1.clone()],
        "curves" => files("assets/curves", "csv"),
        "run_table" => vec![
            b"time_s,depth_m,phase,axial_force_n\n0.1,0.001,0,0.2\n0.2,0.002,0,0.4\n0.3,0.0015,1,-0.1\n".to_vec(),
            b"depth_m,axial_force_n\n1e-3,\n2e-3,0.5\n".to_vec(),
        ],
        "study_plan" => {
            let basis = Basis { base: &settings, duration_s: 6.0, frame_rate: 60.0, has_block: true, variants: &[] };
            let mut size = |edge: f64| Ok(MeshSize { cells: (7000.0 / edge) as u64, unit_step_s: 8e-6 * edge });
            let choice = choose(&basis, &Axis::ALL, 600.0, &Costs::assumed(), &mut size).unwrap();
            let plan = Plan {
                scene: "s".into(),
                title: "t".into(),
                scene_hash: "0".into(),
                overrides: vec!["a=1".into()],
                version: "1".into(),
                axes: Axis::ALL.to_vec(),
                budget_s: 600.0,
                base: settings.clone(),
                costs: Costs::assumed(),
                runs: choice.runs,
                spare: choice.spare,
                left_out: choice.left_out,
                asked_finest_mm: 0.0,
                finest_mm: 0.0,
                unfit: Vec::new(),
                given_up: Vec::new(),
                skipped: Vec::new(),
                changes: Vec::new(),
            };
            vec![serde_json::to_vec_pretty(&plan).unwrap()]
        }
        "study_run" => {
            let run = RunRecord {
                settings: Some(settings),
                cells: 10,
                steps: 20,
                cpu_s: Some(1.0),
                depth_m: vec![0.0, 1e-3],
                force_n: vec![0.0, 0.5],
                displacement_m: vec![[0.0, 1e-6, 0.0]; 3],
                ..Default::default()
            };
            vec![serde_json::to_vec_pretty(&run).unwrap()]
        }
        "attempt" => {
            let scene = Scene::load(&repository().join("scenes/training/hit_target.toml"), &[]).unwrap();
            let records = vec![stylet::observables::FrameRecord { time: 0.5, ..Default::default() }; 2];
            let samples = stylet::training::scripted_samples(&scene, &records);
            let score = stylet::training::Score::of(&scene, &samples, &records, None).unwrap();
            let folder = tempfile::tempdir().unwrap();
            let (_, path) = stylet::training::History::new(folder.path()).add("a trainee", &score).unwrap();
            vec![std::fs::read(path).unwrap()]
        }
        "notes" => {
            let note = |time: f64, text: &str| stylet::training::notes::Note { time, author: "a teacher".into(), text: text.into() };
            let notes = [note(0.5, "hold still"), note(3.25, "too \"fast\"")];
            vec![serde_json::to_vec_pretty(&serde_json::json!({ "version": 1, "notes": notes })).unwrap()]
        }
        "trainee" => vec![b"version = 1\nname = \"Ada \\\"the first\\\"\"\nhidden = true\n".to_vec()],
        "session" => {
            let scene = Scene::load(&repository().join("scenes/muscle_biopsy.toml"), &[]).unwrap();
            let mut session = stylet::session::Session::new(&scene, &["solver.safety=0.4".into()], &Default::default());
            let motion = &scene.motion;
            session.poses = (0..20)
                .map(|n| stylet::needle::motion::HandPose {
                    entry: motion.entry,
                    direction: motion.direction,
                    depth: 1e-4 * f64::from(n),
                })
                .collect();
            vec![serde_json::to_vec(&session).unwrap()]
        }
        "nrrd" => volumes(&["nrrd"]),
        "nifti" => volumes(&["nii", "gz"]),
        "metaimage" => volumes(&["mha"]),
        "markups" => vec![
            b"# Markups fiducial file version = 4.11\n# CoordinateSystem = LPS\n# columns = id,x,y,z,label,desc\n\
              1,10.5,-2,30,\"entry, left\",\n2,11,-2.5,1e1,target,\n"
                .to_vec(),
            b"{\"markups\": [{\"type\": \"Fiducial\", \"coordinateSystem\": \"LPS\", \"coordinateUnits\": \"mm\", \"controlPoints\": [\
              {\"id\": \"1\", \"label\": \"entry\", \"position\": [1.5, -2.0, 3.0], \"positionStatus\": \"defined\"}, \
              {\"id\": \"2\", \"label\": \"target\", \"position\": [4, 5, 6]}]}]}"
                .to_vec(),
        ],
        #[cfg(feature = "cli")]
        "label_names" => vec![
            b"# colours\n1 spleen 157 108 162 255\n2 rib left 4 253 232 158 255\n".to_vec(),
            b"1 255 0 0 1 1 1 \"spleen\"\n".to_vec(),
            b"{\"labels\": {\"background\": 0, \"spleen\": 1, \"rib left 4\": 2}}".to_vec(),
        ],
        #[cfg(feature = "link")]
        "link" | "link_message" => {
            use stylet::link::message::{Content, Kind, NEWTON, Sensor, Status, Transform, Verb};
            let transform =
                Transform { rotation: glam::DMat3::IDENTITY, translation: glam::DVec3::new(1.0, -2.0, -30.0) };
            let status = Status { code: 1, subcode: 0, name: "running".into(), text: "a text".into() };
            let contents = [
                Content::Transform(transform),
                Content::Position(transform.translation, glam::DQuat::IDENTITY),
                Content::Status(status),
                Content::Sensor(Sensor { unit: NEWTON, values: vec![0.5, -0.25] }),
                Content::Text("0.5 N".into()),
                Content::Request(Verb::Start, Kind::Sensor),
                Content::Answer(Kind::Sensor, true),
            ];
            let messages = contents.map(|content| content.encode("device", 1 << 62));
            // A TRANSFORM with the header of version 2: extended header before the content, empty metadata behind it.
            let mut body = vec![0, 12, 0, 2, 0, 0, 0, 0, 0, 0, 0, 1];
            body.extend(&messages[0][58..]);
            body.extend([0, 0]);
            let mut second = messages[0][..58].to_vec();
            second[1] = 2;
            second[42..50].copy_from_slice(&(body.len() as u64).to_be_bytes());
            second[50..58].copy_from_slice(&stylet::link::crc::crc64(&body).to_be_bytes());
            second.extend(body);
            vec![messages.concat(), second]
        }
        other => panic!("no sample for the reader {other}"),
    }
}

/// Changes bytes at one to four places, as `damage` does text: single bytes, pieces, numbers of two, four and eight bytes.
fn damage_bytes(whole: &[u8], other: &[u8], random: &mut Random) -> Vec<u8> {
    let mut bytes = whole.to_vec();
    for _ in 0..1 + random.below(4) {
        if bytes.is_empty() {
            return bytes;
        }
        // Counts and kinds stand at the beginning.
        let reach = if random.below(2) == 0 { bytes.len().min(600) } else { bytes.len() };
        let at = random.below(reach);
        match random.below(7) {
            0 => bytes[at] = random.next() as u8,
            1 => bytes[at] ^= 1 << random.below(8),
            2 => bytes.truncate(at),
            3 => drop(bytes.drain(at..(at + 1 + random.below(40)).min(bytes.len()))),
            4 => {
                let source = if random.below(2) == 0 { whole } else { other };
                let from = random.below(source.len());
                let piece = source[from..(from + 1 + random.below(300)).min(source.len())].to_vec();
                bytes.splice(at..at, piece);
            }
            5 => {
                let value = *random.of(&[0, 1, 0x7f, 0xff, 0x7fff_ffff, 0xffff_ffff, 1 << 40, u64::MAX >> 1, u64::MAX]);
                let width = *random.of(&[2, 4, 8]);
                let word = if random.below(2) == 0 { value.to_le_bytes() } else { value.rotate_left(32).to_be_bytes() };
                for (slot, byte) in bytes[at..].iter_mut().zip(&word[..width]) {
                    *slot = *byte;
                }
            }
            _ => {
                // A number in text becomes another one.
                let number = |b: &u8| b.is_ascii_digit() || *b == b'.' || *b == b'-';
                let Some(from) = bytes[at..].iter().position(number).map(|n| at + n) else { continue };
                let to = bytes[from..].iter().position(|b| !number(b)).map_or(bytes.len(), |n| from + n);
                bytes.splice(from..to, random.of(&VALUES).bytes());
            }
        }
    }
    bytes
}

/// The file of a checkpoint after one frame, and the message in it.
fn sample_checkpoint() -> (Vec<u8>, Vec<u8>) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("checkpoint.stylet");
    let whole = first_checkpoint();
    whole.write(&path).unwrap();
    (std::fs::read(&path).unwrap(), postcard::to_allocvec(&whole).unwrap())
}

#[test]
fn every_reader_keeps_its_promises() {
    let checkpoint = sample_checkpoint();
    let each = cases().div_ceil(4);
    for (number, reader) in READERS.iter().enumerate() {
        let (begin, seeds) = (Instant::now(), seeds(reader, &checkpoint));
        let mut random = Random(0x5717_1e57 + number as u64);
        let (mut most, mut taken, mut slowest) = (0.0_f64, 0, Duration::ZERO);
        for (n, seed) in seeds.iter().enumerate() {
            let (meant, bytes) = measured(|| reader.survives(seed));
            // A scene may name a mesh beside itself, which is not there.
            assert!(meant || reader.name == "scene", "{}: whole sample {n} is refused", reader.name);
            assert!(bytes <= reader.memory(seed.len()), "{}: {bytes} B for sample {n}", reader.name);
        }
        for case in 0..each {
            let (whole, other) = (random.of(&seeds).clone(), random.of(&seeds).clone());
            let bytes = damage_bytes(&whole, &other, &mut random);
            let start = Instant::now();
            let outcome = catch_unwind(|| measured(|| reader.survives(&bytes)));
            let Ok((meant, memory)) = outcome else {
                panic!(
                    "{}, case {case}: panic for {}",
                    reader.name,
                    String::from_utf8_lossy(&bytes[..bytes.len().min(4000)])
                );
            };
            taken += u64::from(meant);
            slowest = slowest.max(start.elapsed());
            assert!(slowest < PATIENCE, "{}, case {case}: {:.1} s", reader.name, slowest.as_secs_f64());
            let bound = reader.memory(bytes.len());
            assert!(memory <= bound, "{}, case {case}: {memory} B of {bound} B for {} B", reader.name, bytes.len());
            most = most.max(memory as f64 / bound as f64);
        }
        println!(
            "{}: {each} cases of {} samples, {taken} taken, at most {:.0} % of the memory bound, slowest {:.0} ms, {:.1} s",
            reader.name,
            seeds.len(),
            100.0 * most,
            slowest.as_secs_f64() * 1e3,
            begin.elapsed().as_secs_f64()
        );
        assert!(taken < each, "{}: no damage is ever found", reader.name);
    }
}

/// The counter counts: a bound that is too small would be noticed.
#[test]
fn memory_is_measured() {
    let (block, bytes) = measured(|| vec![1_u8; 1 << 20]);
    assert!((1 << 20..(1 << 20) + 4096).contains(&bytes), "{bytes}");
    let ((), bytes) = measured(|| drop(block));
    assert_eq!(bytes, 0);
    // A vector that grows is there twice.
    let (_, bytes) = measured(|| {
        let mut block = vec![0_u8; 1 << 20];
        block.reserve_exact(1 << 20);
    });
    assert!(bytes >= 3 << 20, "{bytes}");
}

/// Files whose few bytes ask for much: sets that name everything again and again, and streams that unpack to a thousandfold.
#[test]
fn short_files_cannot_ask_for_much() {
    let named = |name: &str| Reader::named(name).unwrap();
    let mut inp = String::from("*NODE\n");
    for n in 1..=2000 {
        inp += &format!("{n}, {}, {}, {}\n", n % 10, n / 10 % 10, n / 100);
    }
    inp += "*ELEMENT, TYPE=C3D4\n1, 1, 2, 11, 101\n";
    for n in 0..2000 {
        inp += &format!("*NSET, NSET=s{n}, GENERATE\n1, 2000, 1\n");
    }
    let mut msh = String::from("$MeshFormat\n4.1 0 8\n$EndMeshFormat\n$Entities\n0 0 1 0\n1 0 0 0 1 1 1 3000 ");
    msh += &(1..=3000).map(|n| format!("{n} ")).collect::<String>();
    msh += "0\n$EndEntities\n$Nodes\n1 3 1 3\n2 1 0 3\n1\n2\n3\n0 0 0\n1 0 0\n0 1 0\n$EndNodes\n$Elements\n1 3000 1 3000\n2 1 2 3000\n";
    msh += &(1..=3000).map(|n| format!("{n} 1 2 3\n")).collect::<String>();
    msh += "$EndElements\n";
    for (name, text) in [("abaqus", inp), ("gmsh", msh)] {
        let (meant, bytes) = measured(|| named(name).survives(text.as_bytes()));
        assert!(!meant && bytes <= named(name).memory(text.len()), "{name}: {bytes} B for {} B", text.len());
    }
    // The finest cells in the largest block: refused, and the lines of its grid are all that was ever there.
    let text = std::fs::read_to_string(repository().join("scenes/effects/gravity.toml")).unwrap();
    let mut lines: Vec<&str> = text.lines().collect();
    for line in &mut lines {
        match line.split('=').next().unwrap().trim() {
            "size_mm" => *line = "size_mm = [1000.0, 1000.0, 1000.0]",
            "cell_size_mm" => *line = "cell_size_mm = 0.001",
            _ => {}
        }
    }
    let text = lines.join("\n");
    let (meant, bytes) = measured(|| named("scene").survives(text.as_bytes()));
    assert!(!meant && bytes > 20 << 20 && bytes <= named("scene").memory(text.len()), "{bytes} B");
    let mut bomb = b"stylet checkpoint 6\n".to_vec();
    let mut encoder = flate2::write::ZlibEncoder::new(&mut bomb, flate2::Compression::best());
    std::io::Write::write_all(&mut encoder, &vec![0xff; 64 << 20]).unwrap();
    encoder.finish().unwrap();
    let (meant, bytes) = measured(|| named("checkpoint").survives(&bomb));
    assert!(!meant && bytes <= named("checkpoint").memory(bomb.len()), "{bytes} B for {} B", bomb.len());
    // A volume whose stream goes on behind what its header promises is given up there.
    let head = "NRRD0004\ntype: uchar\ndimension: 3\nspace: LPS\nsizes: 10 10 10\nspace directions: (1,0,0) (0,1,0) (0,0,1)\n\
                space origin: (0,0,0)\nencoding: gzip\n\n";
    let mut encoder = flate2::write::GzEncoder::new(head.as_bytes().to_vec(), flate2::Compression::best());
    std::io::Write::write_all(&mut encoder, &vec![0; 64 << 20]).unwrap();
    let bomb = encoder.finish().unwrap();
    let (meant, bytes) = measured(|| named("nrrd").survives(&bomb));
    assert!(!meant && bytes < 1 << 20, "{bytes} B for {} B", bomb.len());
}

/// A damaged checkpoint that can be read all the same does not bring down the run that goes on from it.
#[test]
fn damaged_checkpoints_are_resumed_or_refused() {
    let whole = postcard::to_allocvec(&first_checkpoint()).unwrap();
    let scene = || Scene::load(&repository().join("scenes/effects/gravity.toml"), &[]).unwrap();
    let mut random = Random(31);
    let (mut read, mut resumed) = (0, 0);
    for case in 0..2000 {
        let bytes = damage_bytes(&whole, &whole, &mut random);
        let Ok(found) = RunCheckpoint::from_message(Path::new("checkpoint.stylet"), &bytes) else { continue };
        read += 1;
        if read > 40 {
            break;
        }
        let outcome = catch_unwind(AssertUnwindSafe(|| {
            let mut simulation = Simulation::new(scene(), EngineChoice::Cpu).unwrap();
            match simulation.resume(&found.simulation) {
                Err(error) => {
                    assert_clear(&error, &format!("case {case}"));
                    false
                }
                Ok(()) => {
                    if let Err(error) = simulation.next_frame() {
                        assert_clear(&error, &format!("case {case}"));
                    }
                    true
                }
            }
        }));
        resumed += usize::from(outcome.unwrap_or_else(|_| panic!("case {case}: panic")));
    }
    println!("{read} damaged checkpoints read, {resumed} resumed");
    assert!(read > 10, "{read}");
}

/// The scene `gravity` on the CPU engine after its first frame.
fn first_checkpoint() -> RunCheckpoint {
    let scene = repository().join("scenes/effects/gravity.toml");
    let mut simulation = Simulation::new(Scene::load(&scene, &[]).unwrap(), EngineChoice::Cpu).unwrap();
    simulation.stop_after(0);
    let records = vec![simulation.next_frame().unwrap().unwrap()];
    RunCheckpoint {
        version: env!("CARGO_PKG_VERSION").into(),
        scene,
        overrides: Vec::new(),
        fingerprint: 1,
        adapter: "none".into(),
        records,
        error_bar: None,
        cells_in_needle: None,
        fields: Vec::new(),
        wall: 0.0,
        cpu: None,
        simulation: simulation.checkpoint().unwrap(),
    }
}

#[test]
fn damaged_checkpoints_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let whole = first_checkpoint();
    let path = folder.path().join("checkpoint.stylet");
    whole.write(&path).unwrap();
    assert!(RunCheckpoint::read(&path).is_ok());
    let whole_bytes = std::fs::read(&path).unwrap();
    let bytes = whole_bytes.clone();
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
            // A flipped bit that changes nothing, such as the level in the header, or a distance in a row of zeros: the same to the last bit.
            Ok(found) => {
                let again = folder.path().join("again.stylet");
                found.write(&again).unwrap();
                assert!(std::fs::read(&again).unwrap() == whole_bytes, "another content was read");
            }
        }
    }
    assert!(refused > 450, "{refused} of 500");
}
