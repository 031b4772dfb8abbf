//! `stylet import`: what a file of a patient holds, what a needle would cross in it, and a scene that runs from it.
//!
//! `file -> content (what it is, as text) -> label map -> crossings, pictures, scene`. Surfaces and meshes become a label map first,
//! since a needle goes into a block that is cut out of one.

mod content;
mod line;
mod materials;
pub(crate) mod names;
mod picture;
mod placed;
mod scene;
mod text;
mod voxels;

use std::path::{Path, PathBuf};
use std::time::Instant;

use clap::Args;

use self::content::Content;
use self::line::Line;
use super::SceneArgs;
use super::run::{self, RunArgs};
use crate::error::{Error, Result};
use crate::mesh::Placement;
use crate::mesh::import::LengthUnit;
use crate::scene::{closest, needles};
use crate::simulation::EngineChoice;

#[derive(Debug, Clone, Default, Args)]
pub struct ImportArgs {
    /// Label map (NRRD, NIfTI, MetaImage), closed surfaces (STL, OBJ, PLY, VTK, VTP) or tetrahedra (Gmsh, VTK, VTU, Abaqus)
    pub file: PathBuf,
    /// Where the needle enters the skin, in the patient [RAS mm]
    #[arg(long, value_name = "X,Y,Z", allow_hyphen_values = true, requires = "target", conflicts_with = "markups")]
    pub entry: Option<String>,
    /// Where its tip is to come [RAS mm]
    #[arg(long, value_name = "X,Y,Z", allow_hyphen_values = true, requires = "entry", conflicts_with = "markups")]
    pub target: Option<String>,
    /// Entry and target as the first two points of a file of 3D Slicer (.mrk.json, .fcsv)
    #[arg(long, value_name = "FILE")]
    pub markups: Option<PathBuf>,
    /// Names of the labels, a line each: a number and a name (colour table of 3D Slicer, FreeSurfer, ITK-SNAP, or JSON)
    #[arg(long, value_name = "FILE")]
    pub names: Option<PathBuf>,
    /// Unit of length of a surface or a mesh: m, cm, mm, um or inch
    #[arg(long, default_value = "mm")]
    pub unit: String,
    /// Factor on all coordinates of the file, about their origin [default: 1]
    #[arg(long, value_name = "FACTOR", allow_hyphen_values = true)]
    pub scale: Option<f64>,
    /// Axis through the origin that it is turned about then, with --angle
    #[arg(long, value_name = "X,Y,Z", allow_hyphen_values = true)]
    pub axis: Option<String>,
    /// Angle of that turn, right-handed [deg]
    #[arg(long, value_name = "DEG", allow_hyphen_values = true)]
    pub angle: Option<f64>,
    /// Way that it is moved at last [mm]; entry and target are places behind all that
    #[arg(long, value_name = "X,Y,Z", allow_hyphen_values = true)]
    pub translation: Option<String>,
    /// Edge of the voxels that surfaces and meshes become [mm] [default: 1/200 of their size, 0.3 to 2]
    #[arg(long, value_name = "MM")]
    pub voxel: Option<f64>,
    /// Needle of the scene
    #[arg(long, default_value = "18G")]
    pub gauge: String,
    /// Write a scene in which the needle goes along the line
    #[arg(long, value_name = "FILE")]
    pub scene: Option<PathBuf>,
    /// Write the scene and run it
    #[arg(long)]
    pub run: bool,
    /// Draw three slices through the line, or through the middle, into this folder
    #[arg(long, value_name = "FOLDER")]
    pub picture: Option<PathBuf>,
    /// Folder of the results of --run [default: the next out/<scene>/001, 002, ...]
    #[arg(long, requires = "run")]
    pub out: Option<PathBuf>,
    /// Engine of --run: auto, gpu, cpu or cpu64
    #[arg(long, default_value = "auto")]
    pub engine: EngineChoice,
    /// Replace a scene that is there, and the results that the folder holds
    #[arg(long)]
    pub force: bool,
}

/// The command; its exit code.
///
/// # Errors
/// Of what was asked for and of the file; those of a run where one was asked for.
pub fn execute(args: &ImportArgs, start: Instant) -> Result<u8> {
    check_gauge(&args.gauge)?;
    let unit: LengthUnit = args.unit.parse()?;
    let placement = placed::asked(args)?;
    let voxel = args.voxel.map(checked_voxel).transpose()?;
    let line = Line::asked(args.entry.as_deref(), args.target.as_deref(), args.markups.as_deref())?;
    let wants_scene = args.run || args.scene.is_some();
    if wants_scene && line.is_none() {
        return Err(Error::input(
            "a scene needs the line of the needle",
            "add --entry X,Y,Z and --target X,Y,Z in RAS mm, or --markups FILE of 3D Slicer",
        ));
    }
    let scene_file = wants_scene.then(|| scene_file(args)).transpose()?;
    let names = args.names.as_deref().map(names::read).transpose()?;
    let content = Content::read(&args.file, unit, &placement, names)?;
    crate::println!("{}", content.text().trim_end());
    if line.is_none() && args.picture.is_none() {
        return Ok(0);
    }
    let labels = content.labels(voxel)?;
    if !labels.notices.is_empty() {
        crate::println!("{}", text::list("as a label map:", &labels.notices).trim_end());
    }
    let course = line.map(|line| line.course(&labels.map, &args.file)).transpose()?;
    if let Some(course) = &course {
        crate::println!("{}", course.text().trim_end());
    }
    if let Some(folder) = &args.picture {
        for path in picture::draw(folder, &labels.map, course.as_ref())? {
            crate::println!("picture: {}", path.display());
        }
    }
    let (Some(course), Some(path)) = (course, scene_file) else { return Ok(0) };
    scene::write(&path, &args.file, &labels, &course, &args.gauge, args.force || args.scene.is_none())?;
    crate::println!("scene: {}", path.display());
    if !args.run {
        crate::println!("run it with: stylet run {}", path.display());
        return Ok(0);
    }
    let run = RunArgs {
        scene: SceneArgs { file: path, overrides: Vec::new() },
        engine: args.engine,
        out: args.out.clone(),
        force: args.force,
        checkpoint: 30.0,
        ..RunArgs::default()
    };
    run::execute(&run, start)
}

/// What a file of a patient holds, in lines for people.
///
/// # Errors
/// Where it cannot be read or is of no kind that is read here.
pub fn told(file: &Path) -> Result<String> {
    Ok(Content::read(file, "mm".parse()?, &Placement::NONE, None)?.text())
}

fn check_gauge(gauge: &str) -> Result<()> {
    if needles::needle(gauge).is_some() {
        return Ok(());
    }
    let all: Vec<&str> = needles::needles().iter().map(|needle| needle.gauge.as_str()).collect();
    let near = closest(gauge, all.iter().copied()).map_or(String::new(), |near| format!("did you mean {near}? "));
    Err(Error::input(format!("there is no needle of gauge `{gauge}`"), format!("{near}there are: {}", all.join(", "))))
}

fn checked_voxel(mm: f64) -> Result<f64> {
    match (0.05..=20.0).contains(&mm) {
        true => Ok(mm * 1e-3),
        false => Err(Error::input(format!("--voxel {mm} is no edge of a voxel"), "write 0.05 to 20 mm, e.g. 1")),
    }
}

/// Where the scene goes: as named, else beside the folder of the results.
fn scene_file(args: &ImportArgs) -> Result<PathBuf> {
    if let Some(path) = &args.scene {
        if path.extension().is_none_or(|e| !e.eq_ignore_ascii_case("toml")) {
            return Err(Error::input(
                format!("{}: a scene is a .toml file", path.display()),
                "write --scene NAME.toml",
            ));
        }
        if path.exists() && !args.force {
            return Err(Error::input(
                format!("{} exists", path.display()),
                "give another name with --scene, or replace it with --force",
            ));
        }
        return Ok(path.clone());
    }
    let stem = scene::stem(&args.file);
    let Some(out) = &args.out else { return Ok(free_name(&Path::new("out").join(format!("{stem}.toml")))) };
    let path = out.with_file_name(format!("{}.toml", scene::stem(out)));
    if path.exists() && !args.force {
        return Err(Error::input(
            format!("{} exists, and the scene of this run would take its place", path.display()),
            "give another folder with --out, or replace both with --force",
        ));
    }
    Ok(path)
}

/// The path, or one with a number where a file is there already: a run that was stopped still needs its scene.
fn free_name(path: &Path) -> PathBuf {
    let stem = path.file_stem().unwrap_or_default().to_string_lossy();
    let numbered = (2..).map(|number| path.with_file_name(format!("{stem}_{number}.toml")));
    std::iter::once(path.to_path_buf())
        .chain(numbered)
        .find(|path| !path.exists())
        .unwrap_or_else(|| path.to_path_buf())
}
