//! Which code, stages and threads a model needs.

use std::collections::BTreeSet;

use super::arrays::{
    CONTACT_PARTS, FACE_PARTS, SEPARATION_PARTS, busy_nodes, free_cell_count, opening_counts, section_counts,
};
use super::compose::Defines;
use super::grain::Grain;
use super::kernel::MeshNumbers;
use super::layout::Layout;
use crate::effects::own::OwnEffect;
use crate::effects::{Effect, EffectSet};
use crate::engine::Stage;
use crate::material::law::Form;
use crate::material::{LAWS, Law};
use crate::model::{ContactSurface, Model};

/// What decides which code a shader contains, beside the effects.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Features {
    pub loaded_faces: bool,
    pub driven_faces: bool,
    /// Several materials.
    pub regions: bool,
    /// Cells that hold no tissue.
    pub empty_cells: bool,
    /// Tetrahedra instead of the block.
    pub tetrahedra: bool,
    /// The tissue separates around a hollow needle, or on a slit before a solid one.
    pub bore: bool,
    pub slit: bool,
    /// The path of the needle is found while the tip moves.
    pub free_path: bool,
    /// The tissue beside the path is carried by points.
    pub opening: bool,
    /// That path is laid while the needle comes.
    pub laid: bool,
    /// A window draws the fields.
    pub drawn: bool,
    /// The adapter has more lanes than short stages have threads: those get more, see [`Grain`].
    pub wide: bool,
    /// Keys of the elastic laws that occur.
    pub laws: BTreeSet<&'static str>,
}

impl Features {
    pub fn of(model: &Model) -> Self {
        Features {
            loaded_faces: !model.node_load.is_empty(),
            driven_faces: model.has_driven_faces(),
            regions: !model.cell_material.is_empty(),
            empty_cells: model.mesh.as_block().is_some_and(|block| !block.empty.is_empty()),
            tetrahedra: model.mesh.as_tets().is_some(),
            bore: model.has_surface(|s| matches!(s, ContactSurface::OuterWall | ContactSurface::Bore)),
            slit: model.has_surface(|s| matches!(s, ContactSurface::Slit { .. })),
            free_path: model.puncture.as_ref().is_some_and(|p| p.free.is_some()),
            laid: model.laid.is_some(),
            opening: model.opening().is_some(),
            drawn: false,
            wide: false,
            laws: model.materials.iter().map(|m| m.law.isochoric.key()).collect(),
        }
    }
}

/// Names that are defined for the shaders.
pub fn defines(effects: &EffectSet, features: &Features) -> Defines {
    // A flexible needle acts by the contact of `puncture`, on a planned path.
    let bends = effects.puncture.is_some() && !features.free_path;
    let works = |e: &&Effect| !(features.tetrahedra && e.needs_block()) && (e.key != "flexible_needle" || bends);
    let mut defines: BTreeSet<&'static str> = effects.active().filter(works).map(|e| e.define).collect();
    let own: Vec<&'static OwnEffect> = effects.own.iter().map(|chosen| chosen.effect).collect();
    let mut define = |name: &'static str, wanted: bool| {
        if wanted {
            defines.insert(name);
        }
    };
    let (loaded, driven) = (features.loaded_faces, features.driven_faces);
    define("LOADED_FACES", loaded);
    define("DRIVEN_FACES", driven);
    define("STEP_INPUT", loaded || driven);
    define("NODE_WORK", loaded || driven);
    define("REGIONS", features.regions);
    define("EMPTY_CELLS", features.empty_cells);
    define("TETRAHEDRA", features.tetrahedra);
    let separates = !features.tetrahedra && effects.cohesive.is_some() && effects.puncture.is_some();
    // Grid lines are doubled where faces may separate: copies that stay together move as one.
    define("TIED", !features.tetrahedra && effects.cohesive.is_some());
    define("INNER_BOUND", !features.tetrahedra && effects.bounds_inner_cells());
    define("BORE", features.bore && separates);
    define("SLIT", features.slit && separates);
    // The path is laid while the needle comes, which may turn against it.
    define("LAID", features.laid && effects.puncture.is_some() && !features.tetrahedra);
    define("TURNS", (features.free_path || features.laid) && effects.puncture.is_some() && !features.tetrahedra);
    define("FREE_PATH", features.free_path && effects.puncture.is_some() && !features.tetrahedra);
    define("WIDE", features.wide);
    define("OPENING", features.opening && effects.puncture.is_some());
    // The bulk stiffness of a cell is not that of all others.
    let weakens = effects.damage.is_some() || effects.puncture.is_some();
    define("VARYING_STIFFNESS", features.tetrahedra && (features.regions || weakens));
    define("HISTORY", effects.plasticity.is_some() || effects.viscoelastic.is_some() || effects.damage.is_some());
    define("EARLY_FLATNESS", features.tetrahedra && effects.puncture.is_some());
    // Its key chooses a law: `#for law`.
    for law in &LAWS {
        define(law.key, features.laws.contains(law.key));
    }
    let of_invariants = |law: &Law| law.form == Form::Invariants && features.laws.contains(law.key);
    define("INVARIANT_LAWS", LAWS.iter().any(of_invariants));
    define("SEVERAL_LAWS", features.laws.len() > 1);
    define("OWN", !own.is_empty());
    Defines { names: defines, own }
}

/// The stages that a set of effects needs, in the order of the step.
pub fn stages(effects: &EffectSet, features: &Features) -> Vec<Stage> {
    let (block, tetrahedra) = (!features.tetrahedra, features.tetrahedra);
    // On tetrahedra the path is planned, and softened.
    let puncture = effects.puncture.is_some();
    let indentation = effects.indentation.is_some();
    let cohesive = block && effects.cohesive.is_some();
    let (free_path, opening) = (block && features.free_path, features.opening);
    let wanted = |stage: &Stage| match stage {
        // Where faces separate no cell is softened, but a core is severed.
        Stage::SoftenPath => puncture && !opening && (!cohesive || features.bore) && !free_path,
        Stage::CohesiveForces | Stage::MeasureSeparation => cohesive,
        Stage::AdvanceTip => puncture && !free_path,
        Stage::AdvanceFreeTip | Stage::SoftenFreePath => puncture && free_path,
        Stage::NeedleContact => puncture,
        Stage::OpeningPoints
        | Stage::OpeningCells
        | Stage::OpeningReactions
        | Stage::OpeningNodes
        | Stage::MeasureOpening => puncture && opening,
        Stage::PathMeans | Stage::PathSums => puncture && opening && features.wide,
        Stage::MeasureRelaxation | Stage::RelaxPath => puncture && opening && effects.viscoelastic.is_some(),
        Stage::IndenterContact => indentation,
        Stage::MeasureContact => puncture || indentation,
        Stage::MeasureDilatation | Stage::AveragePressure | Stage::TetrahedronForces => tetrahedra,
        Stage::OpeningDilatation => tetrahedra && puncture && opening,
        Stage::ElementForces => block,
        Stage::MeasureFaces => features.driven_faces,
        Stage::CellFields | Stage::NodeFields => features.drawn,
        _ => true,
    };
    Stage::ALL.into_iter().filter(wanted).collect()
}

/// Threads of the stage measure_opening: PARTS there.
pub const OPENING_PARTS: u32 = 1024;

/// Threads that a stage needs.
pub fn threads(stage: Stage, model: &Model, layout: &Layout, grain: Grain) -> u32 {
    match stage {
        // One workgroup.
        Stage::AdvanceTip | Stage::AdvanceFreeTip | Stage::OpeningReactions | Stage::RelaxPath => 1,
        Stage::SoftenFreePath => free_cell_count(model),
        Stage::SoftenPath => model.puncture.as_ref().map_or(1, |p| p.cells.len() as u32),
        Stage::CellFields => model.mesh.cell_count() as u32,
        Stage::NodeFields => model.mesh.node_count() as u32,
        Stage::MeasureDilatation | Stage::TetrahedronForces => model.mesh.cell_count() as u32,
        Stage::AveragePressure => model.mesh.node_count() as u32,
        Stage::ElementForces => layout.strips().busy_count(),
        Stage::OpeningPoints => opening_counts(model)[0] * grain.pieces() as u32,
        Stage::OpeningCells | Stage::OpeningDilatation => opening_counts(model)[1],
        Stage::OpeningNodes => opening_counts(model)[2] * grain.pieces() as u32,
        // A workgroup for each of what they sum.
        Stage::PathMeans => 64 * section_counts(model)[0],
        Stage::PathSums => 64 * section_counts(model).iter().sum::<u32>(),
        Stage::MeasureOpening => OPENING_PARTS,
        Stage::MeasureRelaxation => opening_counts(model)[0] + opening_counts(model)[1],
        Stage::NeedleContact | Stage::IndenterContact => model.contact_nodes.len() as u32,
        Stage::IntegrateNodes => 64 * busy_nodes(model).len() as u32,
        Stage::MeasureCells | Stage::MeasureNodes => grain.measure_threads,
        Stage::CohesiveForces => model.separation.pairs.len() as u32,
        Stage::MeasureSeparation => SEPARATION_PARTS as u32,
        Stage::MeasureContact => CONTACT_PARTS as u32,
        Stage::MeasureFaces => 6 * FACE_PARTS as u32,
    }
}

/// What shaders/shared/mesh_numbers.wgsl leaves open.
pub fn mesh_numbers(model: &Model, layout: &Layout, grain: Grain) -> MeshNumbers {
    let mut numbers = MeshNumbers::from([
        ("CELL_COUNT", model.mesh.cell_count() as u32),
        ("NODE_COUNT", model.mesh.node_count() as u32),
        ("MEASURE_THREADS", grain.measure_threads),
        ("CONTACT_COUNT", model.contact_nodes.len().max(1) as u32),
    ]);
    const FIXED: [&str; 6] = ["FIXED_X_MIN", "FIXED_X_MAX", "FIXED_Y_MIN", "FIXED_Y_MAX", "FIXED_Z_MIN", "FIXED_Z_MAX"];
    for (name, face) in FIXED.into_iter().zip(model.faces()) {
        numbers.insert(name, (0..3).map(|a| u32::from(face.fixed[a]) << a).sum());
    }
    if let Layout::Strips(strips) = layout {
        let [x, y, z] = model.mesh.block().cells().map(|c| c as u32);
        numbers.extend([
            ("CELLS_X", x),
            ("CELLS_Y", y),
            ("CELLS_Z", z),
            ("NODES_X", x + 1),
            ("NODES_Y", y + 1),
            ("NODES_Z", z + 1),
            ("COLUMN_COUNT", strips.columns),
            ("STRIP_LAYERS", strips.layers),
            ("STRIP_COUNT", strips.count),
            ("PADDED_COLUMNS", strips.padded_columns),
            ("BUSY_STRIP_COUNT", strips.busy_count()),
            ("BUSY_NODE_COUNT", 64 * busy_nodes(model).len() as u32),
        ]);
    }
    numbers
}
