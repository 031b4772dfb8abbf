//! The band around the force: what it writes, that it changes nothing, that finer runs lie in it, and cells chosen for a wanted error.

use std::path::Path;
use std::sync::atomic::AtomicBool;
use std::time::Instant;

use stylet::Result;
use stylet::commands::SceneArgs;
use stylet::commands::run::{RunArgs, RunOutcome, execute, run};
use stylet::observables::FrameRecord;
use stylet::output::curve::interpolated;
use stylet::output::folder::{FORCE_CHART, FORCE_TABLE};
use stylet::scene::Scene;
use stylet::simulation::companion::{Companion, WIDER};
use stylet::simulation::{EngineChoice, Simulation};
use stylet::study::metrics::mean_error;
use stylet::study::precision::{choose, parse};
use stylet::study::subject::Subject;
use stylet::study::{Settings, runner};

/// A sphere on a soft block: half a second of work, and its force converges.
const SPHERE: &str = "scenes/validation/sphere_indentation.toml";
/// Half the depth, wide cells and heavier tissue.
const SMALL: [&str; 4] = [
    "tissue.cell_size_mm=1.6",
    "motion.phase=[{kind = \"insert\", speed_mm_s = 5, depth_mm = 1}]",
    "effects=[\"indentation\", \"mass_scaling\"]",
    "solver.mass_scaling=50",
];

fn args(scene: &str, overrides: &[&str]) -> RunArgs {
    let overrides = overrides.iter().map(|o| o.to_string()).collect();
    RunArgs { scene: SceneArgs { file: scene.into(), overrides }, engine: EngineChoice::Cpu, ..RunArgs::default() }
}

fn run_into(out: &Path, args: RunArgs) -> Result<RunOutcome> {
    let args = RunArgs { out: Some(out.to_path_buf()), ..args };
    run(args.scene.load()?, &args, None, Instant::now(), &AtomicBool::new(false))
}

/// Column of `force.csv`; `None` where a field is empty.
fn column(folder: &Path, name: &str) -> Vec<Option<f64>> {
    let mut reader = csv::Reader::from_path(folder.join(FORCE_TABLE)).unwrap();
    let place = reader.headers().unwrap().iter().position(|head| head == name).unwrap();
    reader.records().map(|row| row.unwrap()[place].parse().ok()).collect()
}

#[test]
fn the_band_is_written_and_changes_no_force() {
    let base = tempfile::tempdir().unwrap();
    let (with, without) = (base.path().join("with"), base.path().join("without"));
    let outcome = run_into(&with, RunArgs { error_bar: true, ..args(SPHERE, &SMALL) }).unwrap();
    run_into(&without, args(SPHERE, &SMALL)).unwrap();
    assert_eq!(column(&with, "axial_force_n"), column(&without, "axial_force_n"));
    let heads = std::fs::read_to_string(without.join(FORCE_TABLE)).unwrap();
    assert!(!heads.contains("force_error_n"), "no empty column without a companion");
    let errors = column(&with, "force_error_n");
    assert!(errors.len() > 10 && errors.iter().all(|e| e.is_some_and(|e| e >= 0.0)), "{errors:?}");
    let band = outcome.summary.error_bar.unwrap();
    assert_eq!((band.companion_cell_mm, band.order, band.order_observed), (3.2, 1.0, false));
    assert!(band.mean_error.unwrap() > 0.0 && band.companion_cells > 0 && band.companion_wall_s > 0.0);
    let (of_summary, of_table) = (band.force_error_at_max_depth_n.unwrap(), errors[errors.len() - 1].unwrap());
    assert!((of_summary / of_table - 1.0).abs() < 1e-8, "{of_summary} {of_table}");
    let chart = |folder: &Path| std::fs::read_to_string(folder.join(FORCE_CHART)).unwrap();
    assert!(chart(&with).contains("error of the cells") && chart(&with).contains("<polygon"));
    assert!(!chart(&without).contains("error of the cells"));
}

#[test]
fn a_run_that_went_back_has_the_same_band() {
    let args = args(SPHERE, &SMALL);
    let scene = args.scene.load().unwrap();
    let wider = [args.scene.overrides.clone(), scene.wider_cells(WIDER).unwrap()].concat();
    let coarser = Scene::load(Path::new(SPHERE), &wider).unwrap();
    let mut main = Simulation::new(scene, EngineChoice::Cpu).unwrap();
    let mut companion = Companion::of(&main, coarser.clone(), None).unwrap();
    let mut records: Vec<FrameRecord> = Vec::new();
    let mut first = Vec::new();
    while let Some(record) = main.next_frame().unwrap() {
        first.push(companion.error_of(&record));
        records.push(record);
    }
    companion.begin_again();
    let again: Vec<Option<f64>> = records.iter().map(|record| companion.error_of(record)).collect();
    assert_eq!(first, again);
    // One that is made in the middle, as by a run that is resumed.
    let mut late = Companion::of(&main, coarser, None).unwrap();
    let resumed: Vec<Option<f64>> = records.iter().map(|record| late.error_of(record)).collect();
    assert_eq!(first, resumed);
}

#[test]
fn a_resumed_run_has_the_band_of_one_that_was_not_stopped() {
    let base = tempfile::tempdir().unwrap();
    let [whole, stopped, added] = ["whole", "stopped", "added"].map(|name| base.path().join(name));
    let with = |error_bar: bool, out: &Path, stop: bool| {
        let out = Some(out.to_path_buf());
        let order = error_bar.then_some(Some(0.7));
        let args = RunArgs { error_bar, order, out, ..args(SPHERE, &SMALL) };
        run(args.scene.load().unwrap(), &args, None, Instant::now(), &AtomicBool::new(stop)).unwrap()
    };
    let rows = |folder: &Path| std::fs::read_to_string(folder.join(FORCE_TABLE)).unwrap();
    with(true, &whole, false);
    with(true, &stopped, true);
    assert!(rows(&stopped).lines().count() < rows(&whole).lines().count());
    let go_on = |folder: &Path, error_bar: bool| {
        let resumed = RunArgs { resume: Some(folder.to_path_buf()), error_bar, ..args(SPHERE, &[]) };
        assert_eq!(execute(&resumed, Instant::now()).unwrap(), 0);
    };
    go_on(&stopped, false);
    assert_eq!(rows(&stopped), rows(&whole));
    // One that began without a band gets it for all of its frames; the order is then the assumed one.
    with(false, &added, true);
    go_on(&added, true);
    assert!(column(&added, "force_error_n").iter().all(Option::is_some));
}

#[test]
fn finer_runs_lie_in_the_band() {
    let base = tempfile::tempdir().unwrap();
    let needle =
        ["motion.phase=[{kind = \"insert\", speed_mm_s = 4, depth_mm = 6}]", "outputs.pictures_at_depth_mm=[]"];
    for (scene, overrides, edge) in [(SPHERE, &SMALL[..], 1.6), ("scenes/training/hit_target.toml", &needle[..], 1.2)] {
        let cells = |factor: f64| format!("tissue.cell_size_mm={}", edge * factor);
        let run_with = |name: &str, factor: f64, error_bar: bool| {
            let cells = cells(factor);
            let all = [overrides, &[cells.as_str()]].concat();
            run_into(&base.path().join(name), RunArgs { error_bar, force: true, ..args(scene, &all) }).unwrap();
        };
        run_with("run", 1.0, true);
        run_with("fine", 0.5, false);
        let numbers = |folder: &str, name: &str| column(&base.path().join(folder), name);
        let curve = |folder: &str| -> Vec<(f64, f64)> {
            let pairs = numbers(folder, "depth_m").into_iter().zip(numbers(folder, "axial_force_n"));
            let mut deepest = f64::NEG_INFINITY;
            let deeper = |(depth, _): &(f64, f64)| {
                let is = *depth > deepest;
                deepest = deepest.max(*depth);
                is
            };
            pairs.filter_map(|(depth, force)| depth.zip(force)).filter(deeper).collect()
        };
        let (run, fine, errors) = (curve("run"), curve("fine"), numbers("run", "force_error_n"));
        let apart: Vec<(f64, f64)> = run
            .iter()
            .zip(errors)
            // The first frame is a single step, in which nothing has moved yet.
            .skip(1)
            .filter_map(|((depth, force), error)| Some(((force - interpolated(&fine, *depth)?).abs(), error?)))
            .collect();
        let inside = apart.iter().filter(|(apart, error)| apart <= error).count();
        println!("{scene}: {inside} of {} rows", apart.len());
        assert!(apart.len() > 10 && inside as f64 >= 0.95 * apart.len() as f64, "{scene}: {apart:?}");
        // A band that holds everything would tell nothing.
        let mean = apart.iter().map(|(_, error)| error).sum::<f64>() / apart.len() as f64;
        assert!(mean < run.iter().map(|(_, force)| force.abs()).fold(0.0, f64::max), "{scene}: {mean}");
    }
}

#[test]
fn cells_are_chosen_for_a_wanted_error() {
    let asked = parse("30%").unwrap();
    let overrides = SMALL.map(String::from);
    let subject = Subject::load(Path::new(SPHERE), &overrides, EngineChoice::Cpu).unwrap();
    let never = AtomicBool::new(false);
    let mut tried = 0;
    let choice = choose(&subject, asked, &never, &mut |_| tried += 1).unwrap();
    println!("{}", choice.describe());
    assert!(choice.predicted.iter().sum::<f64>() <= asked, "{choice:?}");
    assert_eq!(tried, choice.runs);
    // Against cells half as wide and lighter tissue.
    let record = |settings: &Settings| {
        let planned = stylet::study::plan::PlannedRun {
            id: "one".into(),
            role: stylet::study::plan::Role::Mesh,
            settings: settings.clone(),
            cells: 0,
            steps: 0,
            predicted_s: 0.0,
        };
        runner::run(&subject, &planned, None, &never, &mut |_| {}).unwrap().unwrap()
    };
    let fine = Settings {
        cell_size_mm: 0.5 * choice.settings.cell_size_mm,
        mass_scaling: (0.25 * choice.settings.mass_scaling).max(1.0),
        ..choice.settings.clone()
    };
    let found = mean_error(&record(&choice.settings).curve(), &record(&fine).curve()).unwrap();
    println!("found {found}");
    assert!(found <= asked, "{found}");
    // What would take days is refused before it is tried, with the edge that it would take.
    let error = choose(&subject, 1e-3, &never, &mut |_| {}).unwrap_err();
    assert_eq!(error.exit_code(), 2);
    assert!(error.to_string().contains("takes cells of"), "{error}");
}

#[test]
fn what_has_no_band_says_why() {
    let base = tempfile::tempdir().unwrap();
    let refused = |scene: &str| {
        let error = run_into(&base.path().join("x"), RunArgs { error_bar: true, ..args(scene, &[]) }).unwrap_err();
        assert_eq!(error.exit_code(), 2);
        assert!(!base.path().join("x").exists(), "nothing is written");
        error.to_string()
    };
    assert!(refused("scenes/samples/cyclic.toml").contains("has no tool"));
    // Cells of 15 mm fit twice into the smallest edge of the block, cells of 30 mm do not.
    let wide = ["tissue.cell_size_mm=15"];
    assert!(args(SPHERE, &wide).scene.load().is_ok());
    let error = run_into(&base.path().join("x"), RunArgs { error_bar: true, ..args(SPHERE, &wide) }).unwrap_err();
    assert!(error.exit_code() == 2 && error.to_string().contains("no companion"), "{error}");
    let mesh = Scene::load(Path::new("scenes/forearm.toml"), &[]).unwrap();
    assert!(mesh.wider_cells(WIDER).unwrap_err().to_string().contains("mesh from a file"));
}
