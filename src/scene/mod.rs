//! A scene in SI units, as every later step of the program sees it.
//!
//! `file` holds the TOML form (units in the key names), `presets` the material and needle library;
//! [`Scene::load`] reads, checks and converts. Nothing after this module knows about millimetres.

mod convert;
pub(crate) mod document;
pub mod edit;
pub mod file;
pub mod motion;
pub mod presets;
pub mod task;
mod words;

use std::path::{Path, PathBuf};
use std::sync::Arc;

use glam::DVec3;

pub use document::closest;
pub use file::OnTrouble;
pub use motion::{Motion, Phase, Vibration};
pub use task::{Goal, Obstacle, Task};

use crate::effects::{self, EffectSet};
use crate::material::ElasticLaw;
use crate::mesh::tets::TetMesh;
use crate::{Error, Result};

/// Most steps of a frame: input and commands of a step take about 3 kB, and three frames may be under way.
pub const MOST_STEPS_PER_FRAME: u64 = 50_000;

/// Upper estimate of the memory of a frame's record, and of a target's in it [B].
pub const RECORD_BYTES: usize = 1024;
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
    pub tissue: Tissue,
    /// Material outside all regions.
    pub material: TissueMaterial,
    /// Parts of another material; where two overlap, the later one counts.
    pub regions: Vec<Region>,
    /// Tetrahedra instead of the structured block.
    pub mesh: Option<Arc<TetMesh>>,
    /// Node sets of the tetrahedral mesh whose displacement components are held at zero.
    pub supports: Vec<Support>,
    /// Conditions on the six faces, indexed by [`Face`].
    pub faces: [FaceCondition; 6],
    pub tool: Option<Tool>,
    /// Motion of the tool; empty exactly when there is no tool.
    pub motion: Motion,
    pub effects: EffectSet,
    pub solver: SolverSettings,
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
    pub fn load(path: &Path, overrides: &[String]) -> Result<Scene> {
        convert::load(path, overrides).map_err(Error::Scene)
    }

    /// The same with the text of the file in memory; `path` stands for it in messages, and files that it names start from there.
    pub fn parse(path: &Path, source: &str, overrides: &[String]) -> Result<Scene> {
        convert::parse(path, source, overrides).map_err(Error::Scene)
    }

    /// The needle, if the tool is one.
    pub fn needle(&self) -> Option<&NeedleShape> {
        match &self.tool {
            Some(Tool::Needle(needle)) => Some(needle),
            _ => None,
        }
    }

    /// True where the tissue separates around a hollow needle.
    pub fn has_bore(&self) -> bool {
        self.effects.cohesive.is_some() && self.needle().is_some_and(|n| n.bore.is_some())
    }

    /// Axis of the normal of the plane that a solid needle slits: 0 where the direction has no x, 1 where it has no y.
    pub fn slit_axis(&self) -> Option<usize> {
        let solid = self.needle().is_some_and(|n| n.bore.is_none());
        if self.effects.cohesive.is_none() || !solid || crate::model::has_free_path(self) {
            return None;
        }
        (0..2).find(|a| self.motion.direction[*a].abs() < 1e-9)
    }

    /// The same for a hand: with room beyond the phases, and everywhere where the path is free.
    pub fn for_hand(mut self) -> Scene {
        self.motion = self.motion.with_room(self.tissue.size.z);
        let free = crate::model::has_free_path(&self);
        if let Some(puncture) = &mut self.effects.puncture {
            puncture.anywhere = free;
        }
        self
    }

    /// JSON schema of the scene file, for editors and for the `schema` command.
    pub fn schema() -> serde_json::Value {
        schemars::schema_for!(file::SceneFile).to_value()
    }
}

/// The tissue block: `-size.x/2..size.x/2`, `-size.y/2..size.y/2`, `-size.z..0` [m]; the top face is z = 0.
#[derive(Debug, Clone, PartialEq)]
pub struct Tissue {
    /// Edge lengths of the block [m].
    pub size: DVec3,
    /// Cell edge in the fine zone around the planned path [m].
    pub cell_size: f64,
    /// Half width of the fine zone around the path [m].
    pub fine_radius: f64,
    /// Ratio of neighbouring cell edges outside the fine zone, >= 1.
    pub growth: f64,
    /// Where the entry point lies between two grid lines, as a fraction of the cell (x, y); [0.0, 0.0] puts the axis
    /// on grid lines, [0.5, 0.5] on cell centres.
    pub axis_offset_cells: [f64; 2],
}

/// Material of the tissue with its origin.
#[derive(Debug, Clone)]
pub struct TissueMaterial {
    /// Preset name, or `constants`.
    pub name: String,
    /// Where the constants come from, one line.
    pub source: String,
    pub law: ElasticLaw,
    /// Density [kg/m^3].
    pub density: f64,
    /// Parameters of this material's own; `None`: those of the scene's table, if the effect is on.
    pub plasticity: Option<effects::plasticity::Params>,
    pub fibres: Option<effects::fibres::Params>,
    pub viscoelastic: Option<effects::viscoelastic::Params>,
    pub damage: Option<effects::damage::Params>,
    /// Tip forces in this material; `None`: those of the scene's puncture table.
    pub cutting: Option<Cutting>,
    /// A membrane: energy that puncturing this layer takes beyond cutting through it [J].
    pub membrane_energy: Option<f64>,
}

impl TissueMaterial {
    /// A material without parameters of its own for the effects. `density` [kg/m^3].
    pub fn new(name: impl Into<String>, source: impl Into<String>, law: ElasticLaw, density: f64) -> Self {
        TissueMaterial {
            name: name.into(),
            source: source.into(),
            law,
            density,
            plasticity: None,
            fibres: None,
            viscoelastic: None,
            damage: None,
            cutting: None,
            membrane_energy: None,
        }
    }
}

/// Tip forces of one material [N].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Cutting {
    /// Force at which the tip enters the material, F_pun.
    pub puncture_force: f64,
    /// Force of steady cutting, F_cut = G_c w.
    pub cutting_force: f64,
}

/// A part of the tissue with a material of its own.
#[derive(Debug, Clone)]
pub struct Region {
    /// Name for messages and outputs, e.g. `skin`.
    pub name: String,
    pub shape: RegionShape,
    pub material: TissueMaterial,
}

/// Where a region lies [m], in the coordinates of the scene. A cell belongs to it when its centre does.
#[derive(Debug, Clone, PartialEq)]
pub enum RegionShape {
    /// Depths below the top face, `top <= -z < bottom`.
    Layer {
        top: f64,
        bottom: f64,
    },
    /// Axis-parallel box.
    Box {
        low: DVec3,
        high: DVec3,
    },
    Sphere {
        centre: DVec3,
        radius: f64,
    },
    /// Cylinder between two points of its axis.
    Cylinder {
        from: DVec3,
        to: DVec3,
        radius: f64,
    },
    /// Cells of a tetrahedral mesh that carry this region name.
    MeshTag(String),
}

impl RegionShape {
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
        }
    }
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
    pub set: String,
    /// Components held at zero: x, y, z.
    pub fixed: [bool; 3],
}

/// The six faces of the block. The discriminant is the index into [`Scene::faces`].
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(usize)]
pub enum Face {
    XMin = 0,
    XMax = 1,
    YMin = 2,
    YMax = 3,
    /// Bottom, z = -size.z.
    ZMin = 4,
    /// Top, z = 0.
    ZMax = 5,
}

impl Face {
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

/// A rigid tool.
#[derive(Debug, Clone, PartialEq)]
pub enum Tool {
    Needle(NeedleShape),
    /// Sphere of the given radius [m].
    Sphere {
        radius: f64,
    },
    /// Flat cylindrical punch of the given radius [m]; `bonded` sticks to the tissue where it touches first.
    FlatPunch {
        radius: f64,
        bonded: bool,
    },
}

/// A needle, solid to the tissue: a cylinder with a straight or oblique conical tip.
#[derive(Debug, Clone, PartialEq)]
pub struct NeedleShape {
    /// What the user calls it, e.g. `16G`.
    pub name: String,
    /// Shaft radius R [m].
    pub radius: f64,
    /// Length of the tip, Lc of the cone, 2R/tan(beta) of a bevel [m].
    pub tip_length: f64,
    /// Shape of the tip.
    pub tip: TipShape,
    /// What makes it hollow.
    pub bore: Option<BoreShape>,
    /// Name of the needle material.
    pub material: String,
    /// Young's modulus [Pa] and density [kg/m^3] of the material, and diameter of the bore [m] (0: solid): how a flexible
    /// needle bends.
    pub youngs_modulus: f64,
    pub density: f64,
    pub inner_diameter: f64,
    /// Length from the tip to the hub [m]; with the density it gives the mass.
    pub length: f64,
}

/// The inside of a hollow needle.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BoreShape {
    /// Radius of the bore [m].
    pub radius: f64,
    /// Radius of the cutting edge, between bore and outer radius [m].
    pub edge: f64,
    /// Friction coefficient of the bore (dimensionless).
    pub friction: f64,
}

/// Shape of the tip of a needle.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub enum TipShape {
    /// Circular cone, apex on the axis.
    #[default]
    Cone,
    /// Bevel: an oblique circular cone with its apex on the rim, so that one side runs on along the shaft and the other
    /// stands at the bevel angle to it.
    Bevel {
        /// Heading of the apex seen from the axis [rad], from the first lateral axis of the direction to the second
        /// (`needle::lateral_axes`); for a vertical needle 0 is +x.
        heading: f64,
    },
}

impl NeedleShape {
    /// Growth of the section's radius per length of the tip; half of that of the flank of a bevel.
    pub fn tip_slope(&self) -> f64 {
        self.radius / self.tip_length
    }

    /// Mass of a solid cylinder [kg]; the missing part of the tip does not count.
    pub fn mass(&self) -> f64 {
        std::f64::consts::PI * self.radius.powi(2) * self.length * self.density
    }

    /// A needle with a conical tip, of steel, 100 mm long. Lengths in m.
    pub fn cone(name: &str, radius: f64, tip_length: f64) -> Self {
        NeedleShape {
            name: name.into(),
            radius,
            tip_length,
            tip: TipShape::Cone,
            bore: None,
            material: "steel-304".into(),
            youngs_modulus: 193e9,
            density: 7900.0,
            inner_diameter: 0.0,
            length: 0.1,
        }
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
    pub fields_at_time: Vec<f64>,
    /// Width of a picture in pixels.
    pub picture_width: u32,
    /// Upper end of the colour bar [Pa]; `None`: the largest value in the picture, rounded up.
    pub stress_scale: Option<f64>,
}
