//! Command line of Stylet.

use std::path::PathBuf;
use std::process::ExitCode;
use std::sync::atomic::AtomicBool;
use std::time::Instant;

use clap::{Args, CommandFactory, Parser, Subcommand};
use stylet::commands::advise::AdviseOptions;
use stylet::commands::compare_adapters::CompareOptions;
use stylet::commands::fit::{FitOptions, Volumetric};
use stylet::commands::prepare::{Part, PrepareOptions};
use stylet::commands::report::{ReportOptions, ReportOutcome};
use stylet::commands::study::{StudyOptions, StudyOutcome};
use stylet::commands::{self, bench::BenchOptions, run::RunOptions};
use stylet::ending;
use stylet::error::{Error, Result, brief};
use stylet::output::checkpoint::RunCheckpoint;
use stylet::scene::Scene;
use stylet::simulation::EngineChoice;
use stylet::{eprintln, println, terminal};

/// Scene of the main job.
const DEFAULT_SCENE: &str = "scenes/muscle_biopsy.toml";

/// A needle goes into soft tissue: explicit tissue simulation on the GPU, from a scene file to forces and pictures.
#[derive(Parser)]
#[command(version, about, args_conflicts_with_subcommands = true)]
struct Cli {
    #[command(subcommand)]
    command: Option<Command>,
    #[command(flatten)]
    run: RunArgs,
}

#[derive(Subcommand)]
enum Command {
    /// Simulate a scene and write forces, energies, fields and pictures
    Run(RunArgs),
    /// Open a window: lead the needle by hand, or watch, while the tissue is solved (build with --features window)
    View(ViewArgs),
    /// Compute a recorded session again: the same forces, without a window
    Replay(ReplayArgs),
    /// Check a scene and tell what it means; a trial of its first steps, a second at most, predicts the time of a run
    Check(CheckArgs),
    /// Stretch and shear a homogeneous sample of a material: stresses as a table, JSON, CSV or figure
    Material(Box<commands::material::MaterialArgs>),
    /// Measure this machine against the performance goals
    Bench(BenchArgs),
    /// Fit the elastic laws to measured curves of stress against stretch
    Fit(FitArgs),
    /// Run the scenes of a publication and put its numbers beside ours, as one HTML page
    Report(ReportArgs),
    /// Run the hard cases of scenes/hard: which survive, which are caught, which are refused
    Stability(commands::stability::StabilityArgs),
    /// Run a scene over mesh size, mass scaling, step, engine and effects: what accuracy costs, as one HTML page
    Study(StudyArgs),
    /// Propose settings with which a scene keeps real time on this machine
    Advise(AdviseArgs),
    /// Have the driver compile a scene and the switches of its effects, so that no window waits for them
    Prepare(PrepareArgs),
    /// List the GPU adapters
    Adapters,
    /// Run a scene on every adapter and on the CPU engine, and compare forces, displacements and energies
    CompareAdapters(CompareArgs),
    /// Print the JSON schema of scene files
    Schema,
    /// One step of the bench block: milliseconds since the start of the program (called by `bench`)
    #[command(hide = true)]
    FirstStep {
        #[arg(long, default_value = "auto")]
        engine: EngineChoice,
    },
}

#[derive(Args)]
struct SceneArgs {
    /// Scene file
    #[arg(default_value = DEFAULT_SCENE)]
    scene: PathBuf,
    /// Override a key of the scene, e.g. --set tissue.cell_size_mm=0.8
    #[arg(long = "set", value_name = "KEY=VALUE")]
    overrides: Vec<String>,
    /// auto, gpu or cpu; WGPU_BACKEND and WGPU_ADAPTER_NAME choose the adapter
    #[arg(long, default_value = "auto")]
    engine: EngineChoice,
}

#[derive(Args)]
struct RunArgs {
    #[command(flatten)]
    scene: SceneArgs,
    /// Folder of the results [default: the next out/<scene>/001, 002, ...]
    #[arg(long)]
    out: Option<PathBuf>,
    /// Replace the results that the folder holds
    #[arg(long)]
    force: bool,
    /// Seconds of wall time between two checkpoints; 0: only where the run is stopped
    #[arg(long, value_name = "SECONDS", default_value_t = 30.0)]
    checkpoint: f64,
    /// A doubtful run exits with 3, as one that is stopped
    #[arg(long)]
    strict: bool,
    /// Print by which bounds a run is ok, doubtful or stopped
    #[arg(long)]
    explain: bool,
    /// Go on with the run in this folder, which was stopped; scene and overrides are those of the run
    #[arg(long, value_name = "FOLDER", conflicts_with_all = ["out", "force", "overrides"])]
    resume: Option<PathBuf>,
}

#[derive(Args)]
struct CheckArgs {
    #[command(flatten)]
    scene: SceneArgs,
}

#[derive(Args)]
struct ViewArgs {
    /// Scene file
    #[arg(default_value = DEFAULT_SCENE)]
    scene: PathBuf,
    /// Override a key of the scene, e.g. --set tissue.cell_size_mm=0.8
    #[arg(long = "set", value_name = "KEY=VALUE")]
    overrides: Vec<String>,
    /// The motion of the scene leads the needle, from the start on
    #[arg(long)]
    script: bool,
    /// A recorded session leads the needle; scene and overrides are those of the session
    #[arg(long, value_name = "FILE", conflicts_with_all = ["script", "overrides"])]
    session: Option<PathBuf>,
    /// Folder of force.csv, energy.csv and session.json [default: nothing is written]
    #[arg(long)]
    out: Option<PathBuf>,
    /// Replace the results that the folder holds
    #[arg(long)]
    force: bool,
    /// Folder of a run whose force curve lies behind the live one
    #[arg(long, value_name = "FOLDER")]
    reference: Option<PathBuf>,
    /// Keep the scores of this trainee's attempts, and show the progress
    #[arg(long, value_name = "NAME")]
    trainee: Option<String>,
    /// Folder of the trainees' attempts
    #[arg(long, value_name = "FOLDER", default_value = "history")]
    history: PathBuf,
    /// Take the shaders from this folder, and again whenever they change
    #[arg(long, value_name = "FOLDER")]
    shaders: Option<PathBuf>,
    /// Size of the window in points
    #[arg(long, value_names = ["WIDTH", "HEIGHT"], num_args = 2)]
    size: Option<Vec<u32>>,
    /// Show an ultrasound-like slice from the start on
    #[arg(long)]
    ultrasound: bool,
    /// Simulated time over wall time that is aimed at: less than 1 is slow motion
    #[arg(long = "speed-factor", alias = "pace", value_name = "FACTOR", default_value_t = 1.0)]
    pace: f64,
    /// Start at once and close after so many pictures
    #[arg(long)]
    frames: Option<u64>,
    /// Write the last picture to this PNG file
    #[arg(long, value_name = "FILE")]
    screenshot: Option<PathBuf>,
    /// Show needle and forces to other programs over OpenIGTLink, on this machine at port 18944
    #[arg(long)]
    link: bool,
    /// Another port; 0: a free one, which is printed
    #[arg(long, value_name = "PORT", requires = "link")]
    link_port: Option<u16>,
    /// Listen at this address; every other than 127.0.0.1 opens the simulation to the network
    #[arg(long, value_name = "ADDRESS", requires = "link")]
    link_address: Option<std::net::IpAddr>,
    /// Programs over OpenIGTLink may lead the needle
    #[arg(long, requires = "link")]
    allow_control: bool,
    /// Write the forces that a haptic device would get, 1000 a second, to this CSV file
    #[arg(long, value_name = "FILE")]
    haptic_log: Option<PathBuf>,
}

#[derive(Args)]
struct ReplayArgs {
    /// A session.json that `stylet view` has written
    session: PathBuf,
    /// gpu or cpu; auto: the kind of engine that recorded it
    #[arg(long, default_value = "auto")]
    engine: EngineChoice,
    /// Folder of the results [default: the next out/<scene>/001, 002, ...]
    #[arg(long)]
    out: Option<PathBuf>,
    /// Replace the results that the folder holds
    #[arg(long)]
    force: bool,
}

#[derive(Args)]
struct CompareArgs {
    /// Scene file
    #[arg(default_value = DEFAULT_SCENE)]
    scene: PathBuf,
    /// Override a key of the scene, e.g. --set tissue.cell_size_mm=0.8
    #[arg(long = "set", value_name = "KEY=VALUE")]
    overrides: Vec<String>,
    /// Print JSON instead of a table
    #[arg(long)]
    json: bool,
}

#[derive(Args)]
struct BenchArgs {
    /// auto, gpu or cpu
    #[arg(long, default_value = "auto")]
    engine: EngineChoice,
    /// Print JSON instead of a table
    #[arg(long)]
    json: bool,
    /// Measure what every effect costs instead
    #[arg(long)]
    effects: bool,
    /// Largest number of cells
    #[arg(long, default_value_t = 500_000)]
    max_cells: usize,
}

#[derive(Args)]
struct FitArgs {
    /// CSV files; columns `stretch`, `strain`, `strain_percent` or `shear`, a stress with its unit such as
    /// `nominal_stress_kpa` or `cauchy_stress_pa`, and optionally `mode` (tension, compression, uniaxial, equibiaxial,
    /// planar, shear) and `weight`
    #[arg(required = true)]
    files: Vec<PathBuf>,
    /// Poisson's ratio of the preset; the curves do not tell it
    #[arg(long, default_value_t = 0.49, conflicts_with = "bulk_modulus_kpa")]
    poisson_ratio: f64,
    /// Bulk modulus of the preset instead of Poisson's ratio
    #[arg(long)]
    bulk_modulus_kpa: Option<f64>,
    /// Density of the preset
    #[arg(long, default_value_t = 1060.0)]
    density_kg_m3: f64,
    /// Print a preset of this name for a library of materials
    #[arg(long, value_name = "NAME")]
    preset: Option<String>,
    /// Law of the preset [default: the best stable one]
    #[arg(long, requires = "preset")]
    law: Option<String>,
    /// Folder for the chart fit.svg, the table fit.csv and the preset
    #[arg(long)]
    out: Option<PathBuf>,
    /// Replace the files that the folder holds
    #[arg(long)]
    force: bool,
    /// Print JSON instead of tables
    #[arg(long)]
    json: bool,
}

#[derive(Args)]
struct ReportArgs {
    /// Which report: lv2022
    name: String,
    /// Folder of the runs and of the page [default: out/report_<NAME>, with --quick out/report_<NAME>_quick]
    #[arg(long)]
    out: Option<PathBuf>,
    /// auto, gpu or cpu; WGPU_BACKEND and WGPU_ADAPTER_NAME choose the adapter
    #[arg(long, default_value = "auto")]
    engine: EngineChoice,
    /// Coarse cells: a look at the page within seconds, no result
    #[arg(long)]
    quick: bool,
    /// Override a key of all scenes; the page says so
    #[arg(long = "set", value_name = "KEY=VALUE")]
    overrides: Vec<String>,
    /// Folder of the scenes [default: scenes/<NAME>]
    #[arg(long)]
    scenes: Option<PathBuf>,
    /// Compute everything again, and replace what the folder holds
    #[arg(long)]
    force: bool,
}

#[derive(Args)]
struct StudyArgs {
    #[command(flatten)]
    scene: SceneArgs,
    /// What is varied, separated by commas: mesh, mass, step, engine, effects [default: all]
    #[arg(long, value_name = "LIST")]
    axes: Option<String>,
    /// Time that the study may take; it chooses mesh sizes and reference
    #[arg(long, value_name = "MINUTES", default_value_t = 20.0)]
    budget: f64,
    /// Folder of the runs and of the page [default: out/study_<scene>]
    #[arg(long)]
    out: Option<PathBuf>,
    /// Finest cell edge that may be planned [mm]
    #[arg(long, value_name = "MM")]
    finest: Option<f64>,
    /// Run only part K of N, for another machine or job; join the parts with --merge
    #[arg(long, value_name = "K/N")]
    shard: Option<String>,
    /// Join the parts in these folders and write the page into --out
    #[arg(long, value_name = "DIR", num_args = 1.., conflicts_with = "shard")]
    merge: Vec<PathBuf>,
    /// Compute everything again, and replace the study that the folder holds
    #[arg(long)]
    force: bool,
}

#[derive(Args)]
struct AdviseArgs {
    #[command(flatten)]
    scene: SceneArgs,
    /// Ask for settings that keep real time
    #[arg(long)]
    real_time: bool,
    /// Frames per second
    #[arg(long, default_value_t = 60.0)]
    rate: f64,
    /// Folder of a study of the scene [default: out/study_<scene>, if it is there]
    #[arg(long)]
    study: Option<PathBuf>,
}

#[derive(Args)]
struct PrepareArgs {
    /// Scene file
    #[arg(default_value = DEFAULT_SCENE)]
    scene: PathBuf,
    /// Override a key of the scene, e.g. --set tissue.cell_size_mm=0.8
    #[arg(long = "set", value_name = "KEY=VALUE")]
    overrides: Vec<String>,
    /// Only as a hand leads the needle [default: hand and script]
    #[arg(long, conflicts_with = "script")]
    hand: bool,
    /// Only as the script leads the needle
    #[arg(long)]
    script: bool,
    /// Only this scene, without the switches of its effects
    #[arg(long)]
    only: bool,
    /// Only the switches, at the side of a window that runs the scene
    #[arg(long, hide = true, conflicts_with = "only")]
    beside: bool,
}

/// Prints to standard output.
fn print(text: &str) {
    println!("{text}");
}

/// Becomes true when a user or a scheduler asks for the end; what is finished by then stays.
fn until_ended() -> &'static AtomicBool {
    let asked = ending::watch();
    ending::begin();
    asked
}

/// Exit code of what was done; where a user or a scheduler has ended it, `kept` is said.
fn ended(kept: &str) -> u8 {
    if !ending::is_asked() {
        return 0;
    }
    eprintln!("ended by {}: {kept}", ending::reason());
    ending::exit_code()
}

fn report(args: ReportArgs) -> Result<u8> {
    let options = ReportOptions {
        name: args.name,
        engine: args.engine,
        out: args.out,
        scenes: args.scenes,
        quick: args.quick,
        overrides: args.overrides,
        force: args.force,
    };
    match commands::report::report(&options, until_ended())? {
        ReportOutcome::Page { path, failed } => {
            print(&path.display().to_string());
            if failed > 0 {
                eprintln!("error: {failed} of the runs failed; the page says why");
            }
            Ok(if failed > 0 { commands::run::EXIT_DIVERGED } else { 0 })
        }
        ReportOutcome::Interrupted { done, of } => {
            eprintln!(
                "ended by {}: {done} of {of} runs are finished and stay; the same command goes on from there",
                ending::reason()
            );
            Ok(ending::exit_code())
        }
    }
}

fn study(args: StudyArgs) -> Result<u8> {
    let outcome = if args.merge.is_empty() {
        let options = StudyOptions {
            scene: args.scene.scene,
            overrides: args.scene.overrides,
            engine: args.scene.engine,
            axes: args.axes,
            budget: args.budget,
            finest: args.finest,
            out: args.out,
            shard: args.shard,
            force: args.force,
        };
        commands::study::study(&options, until_ended())?
    } else {
        commands::study::merge(&args.merge, args.out.as_ref(), args.force)?
    };
    match outcome {
        StudyOutcome::Page { path, sentences, missing } => {
            for sentence in sentences {
                eprintln!("{sentence}");
            }
            if missing > 0 {
                eprintln!("note: {missing} planned runs are not there; the page lists them");
            }
            print(&path.display().to_string());
            Ok(0)
        }
        StudyOutcome::Part { part, folder, runs, of } => {
            eprintln!(
                "part {part}: {runs} of the {of} runs are here; join all parts with: stylet study --merge DIR... --out DIR"
            );
            print(&folder.display().to_string());
            Ok(0)
        }
        StudyOutcome::Interrupted { done, of } => {
            eprintln!(
                "ended by {}: {done} of {of} runs are finished and stay; the same command goes on from there",
                ending::reason()
            );
            Ok(ending::exit_code())
        }
    }
}

fn advise(args: AdviseArgs) -> Result<String> {
    if !args.real_time {
        return Err(Error::input("advise needs to know what for", "ask for real time with --real-time"));
    }
    commands::advise::advise(&AdviseOptions {
        scene: args.scene.scene,
        overrides: args.scene.overrides,
        engine: args.scene.engine,
        rate: args.rate,
        study: args.study,
    })
}

fn prepare(args: PrepareArgs) -> Result<String> {
    let options = PrepareOptions {
        scene: args.scene,
        overrides: args.overrides,
        led: (args.hand || args.script).then_some(args.hand),
        part: match (args.only, args.beside) {
            (true, _) => Part::Scene,
            (_, true) => Part::Switches,
            _ => Part::All,
        },
    };
    commands::prepare::prepare(&options, print)
}

fn run(args: &RunArgs, start: Instant) -> Result<u8> {
    if args.explain {
        print(stylet::verdict::explain().trim_end());
        return Ok(0);
    }
    if !(args.checkpoint >= 0.0 && args.checkpoint.is_finite()) {
        return Err(Error::input(
            format!("--checkpoint {} is no time", args.checkpoint),
            "write the seconds between two checkpoints, e.g. 30, or 0 for none",
        ));
    }
    let asked = ending::watch();
    let every = (args.checkpoint > 0.0).then_some(args.checkpoint);
    let (scene, options) = match &args.resume {
        Some(folder) => {
            let checkpoint = RunCheckpoint::of_run(folder)?;
            let scene = checkpoint.load_scene()?;
            let engine = match (args.scene.engine, checkpoint.simulation.engine.engine()) {
                (EngineChoice::Auto, "cpu") => EngineChoice::Cpu,
                (EngineChoice::Auto, _) => EngineChoice::Gpu,
                (chosen, _) => chosen,
            };
            let options = RunOptions {
                engine,
                out: Some(folder.clone()),
                force: false,
                checkpoint_every: every,
                overrides: checkpoint.overrides.clone(),
                resume: Some(Box::new(checkpoint)),
            };
            (scene, options)
        }
        None => {
            let scene = Scene::load(&args.scene.scene, &args.scene.overrides)?;
            let options = RunOptions {
                engine: args.scene.engine,
                out: args.out.clone(),
                force: args.force,
                checkpoint_every: every,
                overrides: args.scene.overrides.clone(),
                resume: None,
            };
            (scene, options)
        }
    };
    let outcome = commands::run::run(scene, &options, start, asked);
    let code = commands::run::exit_code(&outcome, args.strict);
    match outcome {
        Ok(outcome) => {
            eprintln!("{}", commands::run::describe(&outcome.summary));
            print(&outcome.folder.display().to_string());
        }
        Err(error) if code == 2 => return Err(error),
        Err(error) => eprintln!("error: {error}"),
    }
    Ok(code)
}

fn dispatch(cli: Cli, start: Instant) -> Result<u8> {
    match cli.command {
        None => run(&cli.run, start),
        Some(Command::Run(args)) => run(&args, start),
        Some(Command::Check(args)) => {
            ending::watch();
            let scene = Scene::load(&args.scene.scene, &args.scene.overrides)?;
            print(&commands::check::check(scene, args.scene.engine)?);
            Ok(0)
        }
        Some(Command::Material(args)) => {
            ending::watch();
            print(commands::material::material(&args)?.trim_end());
            Ok(0)
        }
        Some(Command::Bench(args)) if args.effects => {
            ending::watch();
            let report = commands::bench_effects::bench_effects(args.engine)?;
            print(&if args.json { report.json() } else { report.table() });
            Ok(0)
        }
        Some(Command::Bench(args)) => {
            ending::watch();
            let options = BenchOptions { engine: args.engine, max_cells: args.max_cells };
            let report = commands::bench::bench(&options)?;
            print(&if args.json { report.json() } else { report.table() });
            Ok(0)
        }
        Some(Command::Fit(args)) => {
            ending::watch();
            let volumetric = match args.bulk_modulus_kpa {
                Some(modulus) => Volumetric::BulkModulus(modulus * 1e3),
                None => Volumetric::PoissonRatio(args.poisson_ratio),
            };
            let report = commands::fit::fit(&FitOptions {
                files: args.files,
                volumetric,
                density: args.density_kg_m3,
                law: args.law,
                preset: args.preset,
                out: args.out,
                force: args.force,
            })?;
            print(&if args.json { report.json() } else { report.text() });
            Ok(0)
        }
        Some(Command::Report(args)) => report(args),
        Some(Command::Stability(args)) => {
            let (text, code) = commands::stability::stability(&args, until_ended())?;
            print(&text);
            Ok(code)
        }
        Some(Command::View(args)) => {
            ending::watch();
            print(&view(args, start)?);
            Ok(ended("the window is closed, what it has recorded is kept"))
        }
        Some(Command::Replay(args)) => {
            until_ended();
            print(&replay(args)?);
            Ok(ended("the tables go on to the last frame that was computed"))
        }
        Some(Command::Study(args)) => study(args),
        Some(Command::Advise(args)) => {
            print(&advise(args)?);
            Ok(0)
        }
        Some(Command::Prepare(args)) => {
            ending::watch();
            print(&prepare(args)?);
            Ok(0)
        }
        Some(Command::FirstStep { engine }) => {
            print(&commands::bench::first_step(engine, start)?);
            Ok(0)
        }
        Some(Command::Adapters) => {
            print(commands::adapters()?.trim_end());
            Ok(0)
        }
        Some(Command::CompareAdapters(args)) => {
            ending::watch();
            let options = CompareOptions { scene: args.scene, overrides: args.overrides };
            let table = commands::compare_adapters::compare_adapters(&options)?;
            print(if args.json { table.json() } else { table.table() }.trim_end());
            Ok(u8::from(table.is_broken()))
        }
        Some(Command::Schema) => {
            let text = serde_json::to_string_pretty(&Scene::schema());
            print(&text.map_err(|e| Error::input(e.to_string(), "report this as a defect"))?);
            Ok(0)
        }
    }
}

#[cfg(feature = "window")]
fn view(args: ViewArgs, start: Instant) -> Result<String> {
    let options = stylet::window::ViewOptions {
        scene: args.scene,
        overrides: args.overrides,
        script: args.script,
        session: args.session.map(|path| commands::replay::session_file(&path)),
        out: args.out,
        force: args.force,
        ultrasound: args.ultrasound,
        pace: args.pace,
        frames: args.frames,
        screenshot: args.screenshot,
        reference: args.reference,
        trainee: args.trainee,
        history: args.history,
        shaders: args.shaders,
        size: args.size.and_then(|size| Some([*size.first()?, *size.get(1)?])),
        link: args.link.then_some(stylet::window::LinkChoice {
            address: args.link_address,
            port: args.link_port,
            allow_control: args.allow_control,
        }),
        haptic_log: args.haptic_log,
    };
    let seen = stylet::window::view(&options, start)?;
    if let Some(reason) = seen.stopped {
        return Err(Error::Device(reason));
    }
    let latency = seen.latency;
    let felt = match latency.count {
        0 => "no input".to_string(),
        n => format!(
            "{n} inputs: force after {} frame(s) of tissue at most, {:.0} ms in the mean, {:.0} ms at most",
            latency.most_frames,
            latency.mean * 1e3,
            latency.longest * 1e3
        ),
    };
    let haptic = seen.haptic.map_or(String::new(), |timing| format!("\nhaptic: {}", timing.text()));
    let switches = match seen.switches.iter().map(|pace| pace.halted).max() {
        None => String::new(),
        Some(halted) => {
            let whole: Vec<String> = seen.switches.iter().map(|pace| pace.whole.as_millis().to_string()).collect();
            format!(
                "\neffects switched in {} ms; frames halted for {} ms at most",
                whole.join(", "),
                halted.as_millis()
            )
        }
    };
    Ok(format!(
        "{} pictures, {:.1} a second, at most {:.0} ms apart; first one after {:.2} s\n{} frames of tissue, {:.2} of real time with the window open (tissue alone: \
         {:.2}); {:.3} N at {:.2} mm\n{felt}{switches}{haptic}",
        seen.pictures,
        seen.frames_per_second,
        1e3 * seen.longest_pause,
        seen.first_picture,
        seen.frames,
        seen.achieved,
        seen.real_time_factor,
        seen.force,
        seen.depth * 1e3
    ))
}

#[cfg(not(feature = "window"))]
fn view(_: ViewArgs, _: Instant) -> Result<String> {
    Err(Error::input(
        "this stylet was built without its window",
        "build it with the window: cargo run --release --features window -- view",
    ))
}

fn replay(args: ReplayArgs) -> Result<String> {
    let options = commands::replay::ReplayOptions {
        session: commands::replay::session_file(&args.session),
        engine: args.engine,
        out: args.out,
        force: args.force,
    };
    let done = commands::replay::replay(&options)?;
    let same = match done.same_place {
        true => "the same bit for bit as recorded".to_string(),
        false => format!("recorded by {}, so within what adapters differ by", done.recorded_by),
    };
    let doubt = done.doubt.map_or(String::new(), |why| format!("DOUBTFUL: {why}\n"));
    Ok(format!(
        "{doubt}{} frames, {:.2} s simulated in {:.2} s by {}: {same}\nlargest force {:.3} N; energy imbalance {:.2} %\n{}",
        done.frames,
        done.simulated,
        done.wall,
        done.adapter,
        done.largest_force,
        100.0 * done.imbalance,
        done.folder.display()
    ))
}

/// The refusal of a first word that is neither a subcommand nor a file, as `stylet chek` has it: a scene may stand in the place of a
/// subcommand, so the reader of arguments takes one for the other.
fn misspelt_subcommand() -> Option<Error> {
    let word = std::env::args_os().nth(1)?.into_string().ok()?;
    let names: Vec<String> =
        Cli::command().get_subcommands().filter(|c| !c.is_hide_set()).map(|c| c.get_name().into()).collect();
    let is_path = word.starts_with('-') || word.contains(['.', '/', '\\']) || std::path::Path::new(&word).exists();
    if is_path || names.contains(&word) || word == "help" || Cli::command().find_subcommand(&word).is_some() {
        return None;
    }
    let list = names.join(", ");
    let way_out = match stylet::scene::closest(&word, names.iter().map(String::as_str)) {
        Some(near) => {
            format!("did you mean stylet {near}? There are: {list}; or give the path of a scene file (.toml)")
        }
        None => format!("use one of: {list}; or give the path of a scene file (.toml)"),
    };
    Some(Error::input(format!("there is no subcommand and no scene file called {word}"), way_out))
}

/// Help, the version, or the refusal of a call.
fn wrong_call(reason: &clap::Error) -> ExitCode {
    /// What somebody gave is longer than that, not what the program says of it [B].
    const LONG: usize = 3000;
    if !reason.use_stderr() {
        terminal::tell_of_lost(reason.print());
        return ExitCode::from(u8::from(terminal::output_is_lost()));
    }
    let text = reason.render().to_string();
    match text.len() > LONG || terminal::plain(&text) != text {
        true => eprintln!("{}", brief(&text).trim_end()),
        // In colours where the terminal has them.
        false => drop(reason.print()),
    }
    ExitCode::from(2)
}

fn main() -> ExitCode {
    let start = Instant::now();
    if std::env::var_os("NODEVICE_SELECT").is_none() {
        // Mesa's device-select layer writes noise about XDG_RUNTIME_DIR on machines without a desktop.
        // SAFETY: no other thread exists yet.
        unsafe { std::env::set_var("NODEVICE_SELECT", "1") };
    }
    ending::survive_file_size_limit();
    env_logger::Builder::from_env(env_logger::Env::default().default_filter_or("error,wgpu_hal=off")).init();
    if let Some(error) = misspelt_subcommand() {
        eprintln!("error: {error}");
        return ExitCode::from(error.exit_code());
    }
    let cli = match Cli::try_parse() {
        Ok(cli) => cli,
        Err(reason) => return wrong_call(&reason),
    };
    let code = match dispatch(cli, start) {
        Ok(0) if terminal::output_is_lost() => 1,
        Ok(code) => code,
        Err(error) => {
            match &error {
                // Already rendered, with its own `error:` before every problem.
                Error::Scene(text) => eprintln!("{}", text.trim_end()),
                _ => eprintln!("error: {error}"),
            }
            error.exit_code()
        }
    };
    ending::leave_unfinished_work(code);
    ExitCode::from(code)
}
