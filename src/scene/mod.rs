//! A scene in SI units, as every later step of the program sees it.
//!
//! `file` holds the TOML form (units in the key names), `presets` and `needles` the library of materials and needles;
//! [`Scene::load`] reads, checks and converts. Nothing after this module knows about millimetres.

#![warn(missing_docs)]

mod block;
pub mod builder;
mod convert;
pub(crate) mod document;
pub mod edit;
#[allow(missing_docs)]
pub mod file;
mod loading;
#[allow(missing_docs)]
pub mod needles;
pub mod presets;
#[allow(missing_docs)]
pub mod task;
#[allow(missing_docs)]
pub mod tissue_preset;
mod wider_cells;
mod words;

use std::path::{Path, PathBuf};
use std::sync::Arc;

use glam::DVec3;

pub use document::closest;
pub use file::OnTrouble;
pub use task::{Goal, LARGEST_FORCE_LIMIT, Obstacle, TASK_FIGURES, Task, TaskFigure};

use crate::anatomy::Case;
use crate::effects::own::OwnEffect;
use crate::effects::{EffectSet, Numbers, TissueMaterial};
use crate::mesh::{TetMesh, Tissue};
use crate::needle::{Motion, NeedleShape, Tool};
use crate::{Error, Result};

/// Most steps of a frame: input and commands of a step take about 3 kB, and three frames may be under way.
pub const MOST_STEPS_PER_FRAME: u64 = 50_000;

/// Upper estimate of the memory of a frame's record, and of a target's in it [B].
pub const RECORD_BYTES: usize = 1024;
/// Upper estimate of what a target adds to a record [B].
pub const RECORD_BYTES_PER_TARGET: usize = 128;

/// One simulation: what is there, what moves, what is simulated and what is written.
#[derive(Debug, Clone)]
pub struct Scene {
    /// Short name: file stem, used for the output folder.
    pub name: String,
    /// One line for pictures and reports.
    pub title: String,
    /// File that the scene was read from.
    pub path: PathBuf,
    /// Size and cells of the block; on a mesh of tetrahedra the box around it.
    pub tissue: Tissue,
    /// Material outside all regions.
    pub material: TissueMaterial,
    /// Parts of another material; where two overlap, the later one counts.
    pub regions: Vec<Region>,
    /// Tetrahedra instead of the structured block.
    pub mesh: Option<Arc<TetMesh>>,
    /// The label map that the block lies in.
    pub case: Option<Arc<Case>>,
    /// Node sets of the tetrahedral mesh whose displacement components are held at zero.
    pub supports: Vec<Support>,
    /// Loads on sets of the tetrahedral mesh.
    pub loads: Vec<SetLoad>,
    /// Distance from the path beyond which skin is held [m]; `None`: nowhere.
    pub skin_free: Option<f64>,
    /// Conditions on the six faces, indexed by [`Face`].
    pub faces: [FaceCondition; 6],
    /// What touches or pierces the tissue.
    pub tool: Option<Tool>,
    /// Motion of the tool; empty exactly when there is no tool.
    pub motion: Motion,
    /// What acts beside the elasticity of the tissue.
    pub effects: EffectSet,
    /// How it is integrated over time.
    pub solver: SolverSettings,
    /// Pictures and field files.
    pub outputs: Outputs,
    /// Points of the tissue that the insertion wants to reach.
    pub targets: Vec<Target>,
    /// What a trainee is asked to do.
    pub task: Option<Task>,
    /// Things that the user should know and that are no errors, one sentence each.
    pub notices: Vec<String>,
}

impl Scene {
    /// Reads, checks and converts a scene file. `overrides` are `key=value` texts (`motion.phase.0.speed_mm_s=5`) that
    /// replace values of the file. Every error is an [`Error::Scene`] with file, line, excerpt and way out.
    ///
    /// # Errors
    /// `Error::Scene` where the file cannot be read, or it or an override is wrong.
    pub fn load(path: &Path, overrides: &[String]) -> Result<Scene> {
        Self::load_with(path, overrides, &[])
    }

    /// The same for a program that brings effects along: the list `effects` may name them, and each has a table of its numbers.
    ///
    /// # Errors
    /// As [`Scene::load`].
    pub fn load_with(path: &Path, overrides: &[String], own: &[&'static OwnEffect]) -> Result<Scene> {
        convert::load(path, overrides, own).map_err(Error::Scene)
    }

    /// The same with the text of the file in memory; `path` stands for it in messages, and files that it names start from there.
    ///
    /// # Errors
    /// As [`Scene::load`].
    pub fn parse(path: &Path, source: &str, overrides: &[String]) -> Result<Scene> {
        Self::parse_with(path, source, overrides, &[])
    }

    /// The same with effects that the program brings along.
    ///
    /// # Errors
    /// As [`Scene::load`].
    pub fn parse_with(path: &Path, source: &str, overrides: &[String], own: &[&'static OwnEffect]) -> Result<Scene> {
        convert::parse(path, source, overrides, own).map_err(Error::Scene)
    }

    /// The needle, if the tool is one.
    pub fn needle(&self) -> Option<&NeedleShape> {
        match &self.tool {
            Some(Tool::Needle(needle)) => Some(needle),
            _ => None,
        }
    }

    /// True where the path of the needle is found while the tip moves, false where it is planned: the one place that decides.
    pub fn has_free_path(&self) -> bool {
        self.effects.puncture.is_some_and(|p| p.always_free) || self.motion.is_free()
    }

    /// True where the tissue separates around a hollow needle.
    pub fn has_bore(&self) -> bool {
        self.effects.cohesive.is_some() && self.needle().is_some_and(|n| n.bore.is_some())
    }

    /// Axis of the normal of the plane that a solid needle slits: 0 where the direction has no x, 1 where it has no y.
    pub fn slit_axis(&self) -> Option<usize> {
        let solid = self.needle().is_some_and(|n| n.bore.is_none());
        if self.effects.cohesive.is_none() || !solid || self.has_free_path() {
            return None;
        }
        (0..2).find(|a| self.motion.direction[*a].abs() < 1e-9)
    }

    /// The same for a hand: with room beyond the phases, and everywhere where the path is free.
    pub fn for_hand(mut self) -> Scene {
        // How far a path may go on in a mesh is not looked at here.
        if self.mesh.is_none() {
            self.motion = self.motion.with_room(self.tissue.size.z);
        }
        let free = self.has_free_path();
        if let Some(puncture) = &mut self.effects.puncture {
            puncture.anywhere = free;
        }
        self
    }

    /// Index of the region at a point, the last that holds it; `None`: the tissue's own material.
    pub fn region_at(&self, x: DVec3) -> Option<usize> {
        let of_mesh = self.regions.iter().any(|region| matches!(region.shape, RegionShape::MeshTag(_)));
        let mesh = self.mesh.as_ref().filter(|_| of_mesh);
        let tag = mesh.and_then(|mesh| Some(&mesh.regions[mesh.tags[mesh.locate(x)?.0] as usize]));
        self.region_in(x, tag.map(String::as_str))
    }

    /// The same where the region of the mesh file is known in which the point lies.
    pub fn region_in(&self, x: DVec3, mesh_tag: Option<&str>) -> Option<usize> {
        self.regions.iter().rposition(|region| match &region.shape {
            RegionShape::MeshTag(tag) => mesh_tag == Some(tag),
            shape => shape.contains(x),
        })
    }

    /// The material at a point.
    pub fn material_at(&self, x: DVec3) -> &TissueMaterial {
        self.region_at(x).map_or(&self.material, |index| &self.regions[index].material)
    }

    /// Where the parameters of effects find their present values.
    pub fn numbers(&self) -> Numbers<'_> {
        Numbers { effects: &self.effects, material: &self.material }
    }

    /// JSON schema of the scene file, for editors and for the `schema` command.
    pub fn schema() -> serde_json::Value {
        schemars::schema_for!(file::SceneFile).to_value()
    }
}

/// A part of the tissue with a material of its own.
#[derive(Debug, Clone)]
pub struct Region {
    /// Name for messages and outputs, e.g. `skin`.
    pub name: String,
    /// Where it lies.
    pub shape: RegionShape,
    /// What it is made of.
    pub material: TissueMaterial,
}

/// Where a region lies [m], in the coordinates of the scene. A cell belongs to it when its centre does.
#[derive(Debug, Clone, PartialEq)]
pub enum RegionShape {
    /// Depths below the top face, `top <= -z < bottom`.
    Layer {
        /// Smallest depth [m], inside.
        top: f64,
        /// Largest depth [m], outside.
        bottom: f64,
    },
    /// Axis-parallel box.
    Box {
        /// Corner of the smallest coordinates [m].
        low: DVec3,
        /// Corner of the largest coordinates [m].
        high: DVec3,
    },
    /// Ball about a point.
    Sphere {
        /// Midpoint [m].
        centre: DVec3,
        /// Largest distance from the midpoint [m].
        radius: f64,
    },
    /// Cylinder between two points of its axis.
    Cylinder {
        /// Axis point in one end face [m].
        from: DVec3,
        /// Axis point in the other end face [m].
        to: DVec3,
        /// Largest distance from the axis [m].
        radius: f64,
    },
    /// Cells of a tetrahedral mesh that carry this region name.
    MeshTag(String),
    /// What has one of these labels in a label map.
    Labels {
        /// Ascending.
        labels: Vec<u16>,
        /// The label map in the scene.
        case: Arc<Case>,
    },
}

impl RegionShape {
    /// Heights of the two faces of a layer [m]; `None` for other shapes.
    pub fn layer_faces(&self) -> Option<[f64; 2]> {
        match self {
            RegionShape::Layer { top, bottom } => Some([-top, -bottom]),
            _ => None,
        }
    }

    /// False where an axis-parallel box lies inside as a whole, or outside. True may be said of a box that only comes near the face; a
    /// label map is not looked at: its boxes are always cut, and a mesh tag cuts none.
    pub fn may_cut(&self, low: DVec3, high: DVec3) -> bool {
        let (centre, half) = (0.5 * (low + high), 0.5 * (high - low));
        let reach = half.length();
        match self {
            RegionShape::Layer { top, bottom } => [-top, -bottom].iter().any(|face| (centre.z - face).abs() <= half.z),
            RegionShape::Box { low: from, high: to } => {
                let overlaps = low.cmple(*to).all() && high.cmpge(*from).all();
                overlaps && !(low.cmpge(*from).all() && high.cmple(*to).all())
            }
            RegionShape::Sphere { centre: middle, radius } => (centre.distance(*middle) - radius).abs() <= reach,
            RegionShape::Cylinder { from, to, radius } => {
                let axis = *to - *from;
                let along = (centre - *from).dot(axis) / axis.length();
                let across = (centre - *from - axis * (along / axis.length())).length();
                let outside = along < -reach || along > axis.length() + reach || across > radius + reach;
                let inside = along > reach && along < axis.length() - reach && across < radius - reach;
                !outside && !inside
            }
            RegionShape::MeshTag(_) => false,
            RegionShape::Labels { .. } => true,
        }
    }

    /// True where the point lies inside; a mesh tag has no shape.
    pub fn contains(&self, x: DVec3) -> bool {
        match self {
            RegionShape::Layer { top, bottom } => -x.z >= *top && -x.z < *bottom,
            RegionShape::Box { low, high } => x.cmpge(*low).all() && x.cmple(*high).all(),
            RegionShape::Sphere { centre, radius } => x.distance(*centre) <= *radius,
            RegionShape::Cylinder { from, to, radius } => {
                let axis = *to - *from;
                let along = (x - *from).dot(axis) / axis.length_squared();
                (0.0..=1.0).contains(&along) && (x - *from - axis * along).length() <= *radius
            }
            RegionShape::MeshTag(_) => false,
            RegionShape::Labels { labels, case } => labels.binary_search(&case.label_at(x)).is_ok(),
        }
    }
}

/// Points per axis at which a cell is sampled that the face of a region may cut.
pub const CELL_SAMPLES: usize = 6;

/// A lattice of `per_axis`^3 points in an axis-parallel box, each in the middle of its part.
pub fn sample_points(low: DVec3, size: DVec3, per_axis: usize) -> impl Iterator<Item = DVec3> {
    let part = move |i: usize| (i as f64 + 0.5) / per_axis as f64;
    (0..per_axis.pow(3)).map(move |point| {
        let [i, j, k] = [point % per_axis, point / per_axis % per_axis, point / per_axis.pow(2)];
        low + DVec3::new(part(i), part(j), part(k)) * size
    })
}

/// A material point of the tissue that the insertion wants to reach; it moves with the tissue.
#[derive(Debug, Clone, PartialEq)]
pub struct Target {
    /// Name for outputs, e.g. `lesion`; no other target has it.
    pub name: String,
    /// Where it lies at rest, inside the tissue [m].
    pub position: DVec3,
    /// The tip hits it when it comes no farther away than this [m].
    pub radius: f64,
}

/// A named node set that is held.
#[derive(Debug, Clone, PartialEq)]
pub struct Support {
    /// Name in the mesh file.
    pub set: String,
    /// Components held at zero: x, y, z.
    pub fixed: [bool; 3],
}

/// A dead load on a part of the surface of the mesh.
#[derive(Debug, Clone, PartialEq)]
pub struct SetLoad {
    /// Name of the set in the mesh file; `None`: the whole surface.
    pub set: Option<String>,
    /// What acts.
    pub kind: LoadKind,
    /// Time over which it grows [s]; 0: at once.
    pub ramp: f64,
}

/// What acts on a surface, per rest area.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum LoadKind {
    /// A force in a fixed direction [Pa].
    Traction(DVec3),
    /// Against the outward normal at rest [Pa].
    Pressure(f64),
}

/// The six faces of the block. The discriminant is the index into [`Scene::faces`].
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(usize)]
pub enum Face {
    /// x = -size.x/2.
    XMin = 0,
    /// x = size.x/2.
    XMax = 1,
    /// y = -size.y/2.
    YMin = 2,
    /// y = size.y/2.
    YMax = 3,
    /// Bottom, z = -size.z.
    ZMin = 4,
    /// Top, z = 0.
    ZMax = 5,
}

impl Face {
    /// In the order of their indices.
    pub const ALL: [Face; 6] = [Face::XMin, Face::XMax, Face::YMin, Face::YMax, Face::ZMin, Face::ZMax];

    /// Key in the scene file.
    pub fn key(self) -> &'static str {
        ["x_min", "x_max", "y_min", "y_max", "z_min", "z_max"][self as usize]
    }

    /// Axis of the face normal: 0, 1 or 2.
    pub fn axis(self) -> usize {
        self as usize / 2
    }

    /// True for the face at the larger coordinate.
    pub fn is_max(self) -> bool {
        self as usize % 2 == 1
    }
}

/// What holds, moves or loads one face.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct FaceCondition {
    /// Components of the displacement held at zero (or moved by `drive`): x, y, z.
    pub fixed: [bool; 3],
    /// Prescribed motion of the fixed components.
    pub drive: Option<FaceDrive>,
    /// Dead load per rest area [Pa], x, y, z, switched on at t = 0 and growing linearly over `traction_ramp` [s]
    /// (0 = at once).
    pub traction: Option<DVec3>,
    /// Time over which the dead load grows [s]; 0: at once.
    pub traction_ramp: f64,
}

/// Prescribed motion of a face: a translation and a rotation about the outward axis through the face centre, both
/// growing linearly over `duration`, then held or going to and fro.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FaceDrive {
    /// Final displacement [m].
    pub displacement: DVec3,
    /// Final rotation about the coordinate axis of the face normal [rad], right-handed about +axis.
    pub rotation: f64,
    /// Time over which both grow [s].
    pub duration: f64,
    /// Triangles from zero to the full motion and back, each of twice the duration; 0: ramp and hold.
    pub cycles: u32,
}

impl FaceDrive {
    /// Part of the full motion at the time `t` [s], 0..1.
    pub fn part(&self, t: f64) -> f64 {
        if self.duration <= 0.0 {
            return 1.0;
        }
        let halves = t / self.duration;
        if self.cycles == 0 {
            return halves.clamp(0.0, 1.0);
        }
        if halves >= 2.0 * f64::from(self.cycles) {
            return 0.0;
        }
        let within = halves.max(0.0) % 2.0;
        within.min(2.0 - within)
    }
}

/// Numbers of the time integration.
#[derive(Debug, Clone, PartialEq)]
pub struct SolverSettings {
    /// Fraction of the stable step that is used, 0..1.
    pub safety: f64,
    /// The scene's own time step [s]; `None`: computed.
    pub time_step: Option<f64>,
    /// Mass-proportional damping alpha [1/s].
    pub mass_damping: f64,
    /// Hourglass stiffness kappa (dimensionless).
    pub hourglass_stiffness: f64,
    /// Quartic hourglass factor c (dimensionless).
    pub hourglass_quartic: f64,
    /// Display frames per simulated second [1/s]; a frame is one submission.
    pub frame_rate: f64,
    /// Length of a run without a tool [s]; with a tool the phases decide.
    pub duration: Option<f64>,
    /// What to do when the guard finds trouble.
    pub on_trouble: OnTrouble,
}

/// What is written, and when.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Outputs {
    /// Depths on the way in at which a picture is drawn [m], or times [s] in a scene without a tool.
    pub pictures_at: Vec<f64>,
    /// Depths on the way in at which a VTU file is written [m], or times [s] in a scene without a tool.
    pub fields_at: Vec<f64>,
    /// Times of pictures and field files in a scene with a tool on a free path [s].
    pub pictures_at_time: Vec<f64>,
    /// Times of VTU files in a scene with a tool on a free path [s].
    pub fields_at_time: Vec<f64>,
    /// Depths on the way in at which volumes are written for the patient [m], or times [s] in a scene without a tool.
    pub volumes_at: Vec<f64>,
    /// Times of volumes in a scene with a tool on a free path [s].
    pub volumes_at_time: Vec<f64>,
    /// Voxels of the label map from one voxel of these volumes to the next.
    pub volume_stride: usize,
    /// Width of a picture in pixels.
    pub picture_width: u32,
    /// Upper end of the colour bar [Pa]; `None`: the largest value in the picture, rounded up.
    pub stress_scale: Option<f64>,
}
