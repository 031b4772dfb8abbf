//! Cells in lanes of f32: one vector computes as many cells as the processor has lanes, of a structured block (`block`, `rows`) or of
//! tetrahedra (`tets`, `tet_vectors`). Laws: `material/regular.rs` and `material/stretches.rs`. No sum hangs on the number of threads.
//!
//! A vector in which a cell has left the range of `material/regular.rs` is computed cell by cell in f64.

mod block;
mod corners;
mod measure;
mod nodes;
mod number;
pub(super) mod opening;
mod points;
mod rows;
mod shapes;
mod tet_vectors;
mod tets;

use glam::DVec3;

use self::block::LaneBlock;
use self::nodes::{Moved, NodeLines};
use self::opening::OpeningInLanes;
use self::tets::LaneTets;
use super::integrate_nodes::{NodeStep, NodeSums};
use super::team::Team;
use crate::effects::TissueMaterial;
use crate::engine::elements::{CellForces, CellMeasure, CellStates, Elements};
use crate::material::Isochoric;
use crate::material::law::IsochoricLaw;
use crate::material::regular::{Exponential, Polynomial};
use crate::material::stretches::Powers;
use crate::material_point::{Material, PointState};
use crate::mesh::Mesh;
use crate::model::Model;
use crate::needle::opening::{OpeningMap, Station};
use crate::scene::Scene;

/// Most values of a vector.
const WIDEST: usize = 16;

/// Constants of a material, as a vector needs them.
#[derive(Debug, Clone, Copy)]
struct LaneMaterial {
    /// Its polynomial part, its exponential and its powers of the stretches: one of them is all of it.
    law: Polynomial,
    exponential: Option<Exponential<f64>>,
    powers: Option<Powers<f64>>,
    has_fibres: bool,
    bulk_modulus: f64,
    /// kappa 3.11 mu0 [Pa].
    hourglass: f64,
}

impl LaneMaterial {
    /// Its law, where it is a polynomial and nothing else.
    fn polynomial(&self) -> Option<Polynomial> {
        (self.powers.is_none() && self.exponential.is_none() && !self.has_fibres).then_some(self.law)
    }
}

/// An opened path: its map and its sections.
pub(super) type Opened<'a> = (&'a OpeningMap, &'a [Station]);

/// The cells of a model in lanes.
pub(super) enum LaneCells {
    Block(LaneBlock),
    Tets(LaneTets),
}

impl LaneCells {
    /// # Errors
    /// What the lanes do not know of the model.
    pub fn new(model: &Model, elements: &Elements) -> Result<Self, String> {
        match &model.mesh {
            Mesh::Block(block) => LaneBlock::new(model, block, elements).map(LaneCells::Block),
            Mesh::Tets(mesh) => LaneTets::new(model, mesh, elements).map(LaneCells::Tets),
        }
    }

    /// The threads that its stages share.
    pub fn team(&self) -> &Team {
        match self {
            LaneCells::Block(cells) => cells.team(),
            LaneCells::Tets(cells) => cells.team(),
        }
    }

    /// What carries tissue beside an opened path, and its numbers of the nodes; `None`: there is none, or f64 does it.
    pub fn opening(&mut self) -> Option<OpeningInLanes<'_>> {
        match self {
            LaneCells::Block(cells) => cells.opening(),
            LaneCells::Tets(cells) => cells.opening(),
        }
    }

    /// Bytes of its arrays.
    pub fn bytes(&self) -> usize {
        match self {
            LaneCells::Block(cells) => cells.bytes(),
            LaneCells::Tets(cells) => cells.bytes(),
        }
    }

    /// Forces and bounds of all cells at the nodes, for this displacement (tetrahedra grow beside an opened path) and the stiffness that a path
    /// left (empty: all of it). `advance`: step [s] and number of the step that histories are brought forward to; `None`: they stay.
    pub fn compute(
        &mut self,
        model: &Model,
        elements: &Elements,
        (displacement, opened): (&[DVec3], Option<Opened>),
        stiffness: &[f64],
        advance: Option<(f64, u64)>,
    ) {
        match self {
            LaneCells::Block(cells) => cells.compute(model, elements, displacement, stiffness, advance),
            LaneCells::Tets(cells) => cells.compute(model, elements, (displacement, opened), stiffness, advance),
        }
    }

    /// Averaged pressure of a tetrahedron in the last forces [Pa]; none of hexahedra, which have their own.
    pub fn averaged_pressure(&self, nodes: &[usize]) -> f64 {
        match self {
            LaneCells::Block(_) => 0.0,
            LaneCells::Tets(cells) => cells.averaged_pressure(nodes),
        }
    }

    /// Takes in what the material points remember.
    pub fn take_points(&mut self, points: &[PointState]) {
        match self {
            LaneCells::Block(cells) => cells.take_points(points),
            LaneCells::Tets(cells) => cells.take_points(points),
        }
    }

    /// Gives the material points what they have become and booked since; how many returns failed.
    pub fn give_points(&mut self, points: &mut [PointState]) -> u32 {
        match self {
            LaneCells::Block(cells) => cells.give_points(points),
            LaneCells::Tets(cells) => cells.give_points(points),
        }
    }

    /// Energies and Jacobians of all cells in the state of the last forces; `None`: these lanes leave that to f64.
    pub fn measure(
        &mut self,
        model: &Model,
        elements: &Elements,
        displacement: &[DVec3],
        states: CellStates,
    ) -> Option<Vec<CellMeasure>> {
        match self {
            LaneCells::Block(cells) => Some(cells.measure(model, elements, displacement, states)),
            LaneCells::Tets(_) => None,
        }
    }

    /// Takes in a displacement that the last step did not make.
    pub fn take(&mut self, displacement: &[DVec3]) {
        match self {
            LaneCells::Block(cells) => cells.take(displacement),
            LaneCells::Tets(cells) => cells.take(displacement),
        }
    }

    /// Moves all nodes, displacement and velocity; sums of their lines, in order.
    pub(super) fn integrate(&mut self, step: &NodeStep, moved: Moved) -> Vec<NodeSums> {
        match self {
            LaneCells::Block(cells) => cells.integrate(step, moved),
            LaneCells::Tets(cells) => cells.integrate(step, moved),
        }
    }

    /// Force on a node (-f_int) [N] and its stiffness bound [N/m].
    pub fn at(&self, node: usize) -> (DVec3, f64) {
        self.nodes().at(node)
    }

    fn nodes(&self) -> &NodeLines {
        match self {
            LaneCells::Block(cells) => cells.nodes(),
            LaneCells::Tets(cells) => cells.nodes(),
        }
    }

    /// Adds forces of a cell (with the sign of f_int) and its bounds.
    pub fn add(&mut self, nodes: &[usize], forces: &CellForces) {
        match self {
            LaneCells::Block(cells) => cells.nodes_mut().add(nodes, forces),
            LaneCells::Tets(cells) => cells.nodes_mut().add(nodes, forces),
        }
    }
}

/// Values of a vector of this processor.
pub fn width() -> usize {
    struct Width;
    impl pulp::WithSimd for Width {
        type Output = usize;

        fn with_simd<S: pulp::Simd>(self, _: S) -> usize {
            S::F32_LANES
        }
    }
    pulp::Arch::new().dispatch(Width)
}

/// What lanes do not know of a scene; `None`: they know it.
pub fn unknown_to_lanes(scene: &Scene) -> Option<String> {
    let mut tissues = std::iter::once(&scene.material).chain(scene.regions.iter().map(|region| &region.material));
    let known = |tissue: &TissueMaterial| {
        let material = Material::of(tissue, &scene.effects);
        known_effects(&material, scene.mesh.is_some()).and_then(|()| known_law(&material.law.isochoric))
    };
    tissues.try_for_each(known).err()
}

fn materials_of(model: &Model, elements: &Elements) -> Result<Vec<LaneMaterial>, String> {
    let material = |(index, m): (usize, &Material)| {
        known_effects(m, model.mesh.as_tets().is_some())?;
        let law = &m.law.isochoric;
        known_law(law)?;
        Ok(LaneMaterial {
            law: law.polynomial().unwrap_or_default(),
            exponential: law.exponential(),
            powers: law.powers(),
            has_fibres: m.fibres.is_some(),
            bulk_modulus: m.law.bulk_modulus,
            hourglass: elements.hourglass_of(index),
        })
    };
    model.materials.iter().enumerate().map(material).collect()
}

/// What lanes know in a block and not in tetrahedra, and effects that they know nowhere.
fn known_effects(material: &Material, of_tetrahedra: bool) -> Result<(), String> {
    // By all of its fields: a new one does not compile before it stands here or in `points`.
    let Material { law: _, density: _, plasticity: _, fibres: _, viscoelastic: _, damage, own } = material;
    let effects =
        [(of_tetrahedra && damage.is_some(), "damage in tetrahedra"), (!own.is_empty(), "effects of a program's own")];
    match effects.into_iter().find(|(is_on, _)| *is_on) {
        Some((_, name)) => Err(name.into()),
        None => Ok(()),
    }
}

fn known_law(law: &Isochoric) -> Result<(), String> {
    match law.polynomial().is_some() || law.exponential().is_some() || law.powers().is_some() {
        true => Ok(()),
        false => Err(format!("the law {}", law.key())),
    }
}

/// Threads that so many cells are worth: a stage of a few hundred cells is done before another thread has joined.
fn threads_for(cells: usize) -> usize {
    const CELLS_PER_THREAD: usize = 800;
    rayon::current_num_threads().min(cells / CELLS_PER_THREAD).max(1)
}
