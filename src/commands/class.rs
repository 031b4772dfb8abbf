//! `stylet class`: what all trainees of a history folder did, for those who teach.

use std::path::PathBuf;

use clap::Args;

use crate::error::{Error, Result};
use crate::training::class::Class;
use crate::training::history::{self, Attempt};
use crate::training::{notes, report, xapi};
use crate::{whole_file, words};

#[derive(Debug, Clone, Default, Args)]
pub struct ClassArgs {
    /// Folder of the attempts, one folder per trainee
    #[arg(default_value = history::FOLDER)]
    pub folder: PathBuf,
    /// Write the table as CSV
    #[arg(long, value_name = "FILE")]
    pub csv: Option<PathBuf>,
    /// Write all attempts as xAPI statements (JSON), for a learning record store
    #[arg(long, value_name = "FILE")]
    pub xapi: Option<PathBuf>,
    /// Home page of the accounts in the statements
    #[arg(long, value_name = "URL", default_value = xapi::HOME_PAGE)]
    pub home_page: String,
    /// Write a page to print: of --trainee, of --attempt, or of the two of --compare
    #[arg(long, value_name = "FILE")]
    pub report: Option<PathBuf>,
    /// Whom the page is about
    #[arg(long, value_name = "NAME", requires = "report")]
    pub trainee: Option<String>,
    /// File of the attempt that the page is about
    #[arg(long, value_name = "FILE", requires = "report", conflicts_with = "trainee")]
    pub attempt: Option<PathBuf>,
    /// Two files of attempts, side by side
    #[arg(long, num_args = 2, value_names = ["A", "B"], conflicts_with_all = ["trainee", "attempt"])]
    pub compare: Option<Vec<PathBuf>>,
    /// Language of the page: en or de
    #[arg(long, value_name = "CODE", default_value = "en")]
    pub language: String,
}

/// The command: prints the table, or two attempts, and writes what is asked for.
///
/// # Errors
/// `Error::Input` for a folder, trainee, attempt or language that is not there; `Error::File` for a file that cannot be written. Files of
/// the history that cannot be read are told, and hold up nothing.
pub fn execute(args: &ClassArgs) -> Result<u8> {
    if !words::choose(&args.language) {
        let codes: Vec<&str> = words::LANGUAGES.iter().map(|language| language.code).collect();
        return Err(Error::input(
            format!("there are no texts in `{}`", args.language),
            format!("write one of: {}", codes.join(", ")),
        ));
    }
    if let Some([first, second]) = args.compare.as_deref() {
        let [first, second] = [history::read(first)?, history::read(second)?];
        println!("{}", report::two_as_text(&first, &second).trim_end());
        if let Some(path) = &args.report {
            whole_file::write(path, report::of_two(&first, &second).as_bytes())?;
        }
        if args.csv.is_none() && args.xapi.is_none() {
            return Ok(0);
        }
    }
    let class = Class::read(&args.folder)?;
    for error in &class.broken {
        eprintln!("warning: {error}");
    }
    if args.compare.is_none() {
        println!("{}", class.text().trim_end());
    }
    if let Some(path) = &args.csv {
        whole_file::write(path, &class.csv()?)?;
    }
    if let Some(path) = &args.xapi {
        whole_file::write(path, xapi::statements(class.attempts(), &args.home_page)?.as_bytes())?;
    }
    if let (Some(path), None) = (&args.report, &args.compare) {
        whole_file::write(path, page(args, &class)?.as_bytes())?;
    }
    Ok(0)
}

/// The page to print.
fn page(args: &ClassArgs, class: &Class) -> Result<String> {
    if let Some(file) = &args.attempt {
        let attempt: Attempt = history::read(file)?;
        let notes = notes::read_file(&file.with_extension(notes::ENDING))?;
        return Ok(report::of_attempt(&attempt, &notes));
    }
    match &args.trainee {
        Some(trainee) => report::of_trainee(trainee, &class.of(trainee)?),
        None => Err(Error::input(
            "it is not said whom the page is about",
            "add --trainee NAME, --attempt FILE or --compare A B",
        )),
    }
}
