//! Command line of Stylet: the commands, and which of them was asked for.

use std::process::ExitCode;
use std::time::Instant;

use clap::{CommandFactory, Parser, Subcommand};
use stylet::commands::advise::{self, AdviseArgs};
use stylet::commands::bench::{self, BenchArgs};
use stylet::commands::check::{self, CheckArgs};
use stylet::commands::class::{self, ClassArgs};
use stylet::commands::compare_adapters::{self, CompareArgs};
use stylet::commands::fit_args::{self, FitArgs};
use stylet::commands::import::{self, ImportArgs};
use stylet::commands::material::{MaterialArgs, material};
use stylet::commands::prepare::{self, PrepareArgs};
use stylet::commands::replay::{self, ReplayArgs};
use stylet::commands::report::{self, ReportArgs};
use stylet::commands::run::{self, RunArgs};
use stylet::commands::stability::{StabilityArgs, stability};
use stylet::commands::study::{self, StudyArgs};
use stylet::commands::view::{self, ViewArgs};
use stylet::commands::{adapters, bench_effects, bench_roofline, bench_stages, schema, until_ended};
use stylet::error::{Error, Result, brief};
use stylet::simulation::EngineChoice;
use stylet::{ending, eprintln, println, terminal};

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
    /// Tell what a label map, a surface or a mesh holds and what a needle would cross; write a scene from it, and run it
    Import(ImportArgs),
    /// Compute a recorded session again: the same forces, without a window
    Replay(ReplayArgs),
    /// Check a scene and tell what it means; a trial of its first steps, a second at most, predicts the time of a run
    Check(CheckArgs),
    /// Stretch and shear a homogeneous sample of a material: stresses as a table, JSON, CSV or figure
    Material(Box<MaterialArgs>),
    /// Measure this machine against the performance goals
    Bench(BenchArgs),
    /// Fit the elastic laws to measured curves of stress against stretch
    Fit(FitArgs),
    /// Put the numbers of a publication beside ours, or published needle forces beside the theory, as one HTML page
    Report(ReportArgs),
    /// What all trainees of a history folder did: a table, CSV, xAPI statements, pages to print
    Class(ClassArgs),
    /// Run the hard cases of scenes/hard: which survive, which are caught, which are refused
    Stability(StabilityArgs),
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

/// Does what was asked for; the exit code.
fn dispatch(cli: Cli, start: Instant) -> Result<u8> {
    // Who calls the program without a word wants to see it, where it can be seen.
    if std::env::args_os().len() == 1
        && let Some(text) = start_screen(start)?
    {
        println!("{text}");
        return Ok(view::window_ended());
    }
    let text = match cli.command.unwrap_or(Command::Run(cli.run)) {
        Command::Run(args) => return run::execute(&args, start),
        Command::View(args) => return view::execute(&args, |args| open_window(args, start)),
        Command::Import(args) => return import::execute(&args, start),
        Command::Replay(args) => return replay::execute(&args),
        Command::Check(args) => return check::execute(&args),
        Command::Bench(args) if args.effects => return bench_effects::execute(&args),
        Command::Bench(args) if args.stages => return bench_stages::execute(&args),
        Command::Bench(args) if args.roofline => return bench_roofline::execute(&args),
        Command::Bench(args) => return bench::execute(&args),
        Command::Fit(args) => return fit_args::execute(args),
        Command::Report(args) => return report::execute(&args),
        Command::Class(args) => return class::execute(&args),
        Command::Study(args) => return study::execute(&args),
        Command::Advise(args) => return advise::execute(&args),
        Command::Prepare(args) => return prepare::execute(&args),
        Command::CompareAdapters(args) => return compare_adapters::execute(&args),
        Command::Stability(args) => {
            let (text, code) = stability(&args, until_ended())?;
            println!("{text}");
            return Ok(code);
        }
        Command::Material(args) => {
            ending::watch();
            material(&args)?.trim_end().to_string()
        }
        Command::Adapters => adapters()?.trim_end().to_string(),
        Command::Schema => schema()?,
        Command::FirstStep { engine } => bench::first_step(engine, start)?,
    };
    println!("{text}");
    Ok(0)
}

/// Opens the window; how it went, once it is closed.
#[cfg(feature = "window")]
fn open_window(args: &ViewArgs, start: Instant) -> Result<String> {
    stylet::window::view(args, start)?.text()
}

/// Opens the window at its start screen where there is a display, and returns how it went; `None` where there is none.
#[cfg(feature = "window")]
fn start_screen(start: Instant) -> Result<Option<String>> {
    // Elsewhere every desktop has a display.
    let named = |name: &str| std::env::var_os(name).is_some_and(|value| !value.is_empty());
    if cfg!(all(unix, not(target_os = "macos"))) && !named("DISPLAY") && !named("WAYLAND_DISPLAY") {
        return Ok(None);
    }
    ending::watch();
    stylet::window::view_where_possible(&ViewArgs::start_screen(), start)?.map(|outcome| outcome.text()).transpose()
}

#[cfg(not(feature = "window"))]
fn start_screen(_: Instant) -> Result<Option<String>> {
    Ok(None)
}

#[cfg(not(feature = "window"))]
fn open_window(_: &ViewArgs, _: Instant) -> Result<String> {
    Err(view::no_window())
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
