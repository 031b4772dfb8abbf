//! What is constant during a run: mesh, masses, loads, and what the chosen effects prepare once, one file for each of them.

pub mod composition;
mod contact;
mod free_path;
mod indentation;
pub mod loads;
pub mod opening;
mod opening_places;
mod puncture;
pub mod rigid;
mod slit;
mod supports;
mod tet_puncture;

use glam::DVec3;

pub use composition::Composition;
pub use contact::{ContactNode, ContactSurface};
pub use free_path::{FreePlan, Skin};
pub use opening_places::NearTets;
pub use puncture::{
    ANCHOR_COUNT, LARGEST_ANCHOR_COUNT, LARGEST_SEGMENT_COUNT, PathCell, PathSegment, PuncturePlan, TipAnchor,
};

use crate::effects::puncture::SchemeWord;
use crate::effects::{EffectSet, cohesive};
use crate::material_point::Material;
use crate::mesh::tets::SIDE_TOLERANCE;
use crate::mesh::{Mesh, TissuePoint};
use crate::needle::path_line::PathLine;
use crate::needle::{Kinematics, PlannedPath};
use crate::scene::{Face, FaceCondition, Scene};
use crate::separation::Separation;

/// Most materials of a model: those of the scene and mixtures of them.
pub const LARGEST_MATERIAL_COUNT: usize = 256;

/// Bits of [`Model::node_flags`] of held or driven components.
pub const HELD: u32 = 7;

/// Largest way of a node in one step, part of the smallest edge. With 0.05 tissue that snaps off a needle loses twice the energy
/// (`free_hand/reinsertion.toml` with the ring, in its usual step: 8.5 against 3.7 %); with 0.25 squeezed cells outrun the masses that
/// are raised for them, and a block that is let go from 0.4 of its height triples its energy.
const SPEED_PER_STEP: f64 = 0.1;

/// A path that is laid while the needle comes.
#[derive(Debug, Clone)]
pub struct LaidPath {
    pub line: PathLine,
    pub skin: Skin,
}

/// Everything constant.
#[derive(Debug, Clone)]
pub struct Model {
    pub scene: Scene,
    pub mesh: Mesh,
    /// Materials with the effects that are on: the scene's own, one per region, then mixtures.
    pub materials: Vec<Material>,
    /// Index into `materials` per cell; empty where there is one material only.
    pub cell_material: Vec<u8>,
    /// What cells are made of, and which of them hold nothing.
    pub composition: Composition,
    /// Per node: bits 0..2 held or driven components x, y, z; bits 3..8 the faces that it lies on.
    pub node_flags: Vec<u32>,
    /// True where a region does not deform.
    pub has_rigid: bool,
    pub effects: EffectSet,
    pub kinematics: Option<Kinematics>,
    /// Nodal mass including the uniform mass scaling [kg].
    pub node_mass: Vec<f64>,
    /// Nodal dead load at full ramp [N]; empty without loads.
    pub node_load: Vec<DVec3>,
    /// Time over which the loads grow [s].
    pub load_ramp: f64,
    /// The path that is laid while the needle comes: a free path in the scheme `opening`.
    pub laid: Option<LaidPath>,
    pub puncture: Option<PuncturePlan>,
    pub indentation: Option<crate::effects::indentation::Plan>,
    /// Faces that may separate, and copies that are tied.
    pub separation: Separation,
    /// Their law; `None` without the effect.
    pub cohesion: Option<cohesive::Law>,
    /// Nodes that a tool may touch, ascending in the node index; empty without contact.
    pub contact_nodes: Vec<ContactNode>,
    /// Where the targets of the scene lie in the mesh.
    pub targets: Vec<TissuePoint>,
}

impl Model {
    /// Prepares a scene. The mesh is built from the scene by `BlockMesh::for_scene`.
    pub fn new(scene: Scene, mesh: impl Into<Mesh>) -> Self {
        let mut mesh = mesh.into();
        let scaling = scene.effects.mass_scaling.map_or(1.0, |m| m.factor);
        let mut materials: Vec<Material> = std::iter::once(&scene.material)
            .chain(scene.regions.iter().map(|r| &r.material))
            .map(|m| Material::of(m, &scene.effects))
            .collect();
        let mut composition = Composition::new(&scene, &mesh, &materials);
        composition.hold(supports::held_skin(&scene, &mesh, &composition), &mesh, &materials);
        materials.append(&mut composition.mixtures);
        let cell_material = std::mem::take(&mut composition.cell_material);
        if let Mesh::Block(block) = &mut mesh {
            block.empty.clone_from(&composition.empty);
        }
        let mut node_mass = nodal_masses(&mesh, &materials, &cell_material, scaling);
        // Nodes without tissue stand still, whatever they weigh.
        node_mass
            .iter_mut()
            .zip(&composition.held)
            .filter(|(m, held)| **held && **m == 0.0)
            .for_each(|(m, _)| *m = 1.0);
        let (node_load, load_ramp) = loads::nodal_loads(&scene, &mesh);
        let targets = scene.targets.iter().map(|target| TissuePoint::in_mesh(&mesh, target.position)).collect();
        let kinematics = (!scene.motion.phases.is_empty())
            .then(|| Kinematics::new(&scene.motion).no_deeper_than(rigid::deepest(&scene)));
        let is_laid = scene.has_free_path() && scene.effects.puncture.is_some_and(|p| p.scheme == SchemeWord::Opening);
        let mut model = Model {
            laid: None,
            effects: scene.effects.clone(),
            node_flags: node_flags(&scene, &mesh, &composition),
            materials,
            cell_material,
            composition,
            has_rigid: scene.regions.iter().any(|region| region.material.rigid),
            node_mass,
            node_load,
            load_ramp,
            kinematics,
            puncture: None,
            indentation: None,
            separation: Separation::default(),
            cohesion: None,
            contact_nodes: Vec::new(),
            targets,
            scene,
            mesh,
        };
        if is_laid && let Some(block) = model.mesh.as_block() {
            let line = PathLine::straight(model.scene.motion.entry, model.scene.motion.direction);
            model.laid = Some(LaidPath { line, skin: model.skin_over([0; 3], block.cells()) });
        }
        model.plan_separation();
        model.plan_puncture();
        model.plan_indentation();
        model
    }

    /// Uniform mass scaling S.
    pub fn mass_scaling(&self) -> f64 {
        self.effects.mass_scaling.map_or(1.0, |m| m.factor)
    }

    /// Density including mass scaling [kg/m^3].
    pub fn scaled_density(&self) -> f64 {
        self.scene.material.density * self.mass_scaling()
    }

    /// P-wave speed at the scaled density [m/s].
    pub fn scaled_wave_speed(&self) -> f64 {
        (self.scene.material.law.p_wave_modulus() / self.scaled_density()).sqrt()
    }

    /// Index into `materials` of a cell.
    pub fn material_index(&self, cell: usize) -> usize {
        self.cell_material.get(cell).map_or(0, |m| usize::from(*m))
    }

    /// What fills most of a cell, 0: the scene's own material, else that of region `index - 1`; a mixture has no region of its own.
    pub fn region_index(&self, cell: usize) -> usize {
        self.composition.main.get(cell).map_or(0, |m| usize::from(*m))
    }

    /// Material of a cell.
    pub fn material(&self, cell: usize) -> &Material {
        &self.materials[self.material_index(cell)]
    }

    /// Rest volume of the tissue around a node, an eighth of every hexahedron or a quarter of every tetrahedron [m^3]; of all nodes
    /// of tetrahedra at once: [`Model::node_volumes`].
    pub fn node_volume(&self, node: usize) -> f64 {
        let block = match &self.mesh {
            Mesh::Block(block) => block,
            Mesh::Tets(tets) => return tets.node_volumes()[node],
        };
        if block.empty.is_empty() {
            return block.node_volume(node);
        }
        // As much as it weighs, in the density of its cells where they are whole.
        let at = block.node_coordinates(node);
        let around = |a: usize| at[a].saturating_sub(1)..(at[a] + 1).min(block.cells()[a]);
        let cells =
            around(2).flat_map(|k| around(1).map(move |j| (j, k))).flat_map(|(j, k)| around(0).map(move |i| (i, j, k)));
        let eighth = |(i, j, k)| {
            let cell = block.cell_index(i, j, k);
            0.125 * self.composition.fill(cell) * block.cell_size(cell).element_product()
        };
        cells.map(eighth).sum()
    }

    /// Rest volumes of the tissue around the nodes [m^3].
    pub fn node_volumes(&self) -> Vec<f64> {
        match &self.mesh {
            Mesh::Block(block) => (0..block.node_count()).map(|node| self.node_volume(node)).collect(),
            Mesh::Tets(tets) => tets.node_volumes(),
        }
    }

    /// True where cells remember something.
    pub fn has_history(&self) -> bool {
        self.effects.plasticity.is_some() || self.effects.viscoelastic.is_some() || !self.effects.own.is_empty()
    }

    /// Largest number of Prony terms of a material.
    pub fn prony_term_count(&self) -> usize {
        self.materials.iter().filter_map(|m| m.viscoelastic.as_ref()).map(|v| v.terms.len()).max().unwrap_or(0)
    }

    /// Largest nodal speed that is let through: a tenth of the smallest edge per step, of tetrahedra of the smallest
    /// V^(1/3), so that one flat cell does not slow down the whole mesh [m/s].
    pub fn speed_limit(&self, dt: f64) -> f64 {
        let size = match &self.mesh {
            Mesh::Block(_) => self.mesh.smallest_edge(),
            Mesh::Tets(tets) => (0..tets.tets.len()).map(|t| tets.volume(t)).fold(f64::INFINITY, f64::min).cbrt(),
        };
        SPEED_PER_STEP * size / dt
    }

    /// The planned path, if the tool is a needle that cuts.
    fn planned_path(&self) -> Option<PlannedPath> {
        let motion = &self.scene.motion;
        let cuts = self.effects.puncture.is_some() && self.scene.needle().is_some() && !self.scene.has_free_path();
        cuts.then_some(PlannedPath::into_block(motion.entry, motion.direction))
    }

    /// True where the mesh follows the bore of a hollow needle.
    pub fn has_bore(&self) -> bool {
        self.mesh.as_block().is_some_and(|block| block.bore.is_some())
    }

    /// True where a node is held against a surface of this kind.
    pub fn has_surface(&self, wanted: impl Fn(&ContactSurface) -> bool) -> bool {
        self.contact_nodes.iter().any(|c| wanted(&c.surface))
    }

    /// Simulated length of the run [s].
    pub fn duration(&self) -> f64 {
        match &self.kinematics {
            Some(k) => k.duration(),
            None => self.scene.solver.duration.unwrap_or(0.0),
        }
    }

    /// Conditions of the faces.
    pub fn faces(&self) -> &[FaceCondition; 6] {
        &self.scene.faces
    }

    /// Which displacement components of a node are held or driven by a face.
    pub fn fixed_components(&self, node: usize) -> [bool; 3] {
        std::array::from_fn(|a| self.node_flags[node] >> a & 1 == 1)
    }

    /// True where a node lies on a face of the bounding box.
    pub fn lies_on(&self, node: usize, face: Face) -> bool {
        self.node_flags[node] >> (3 + face as usize) & 1 == 1
    }

    /// True where a face moves by prescription.
    pub fn has_driven_faces(&self) -> bool {
        self.scene.faces.iter().any(|f| f.drive.is_some())
    }

    /// Centre of a face at rest [m].
    pub fn face_centre(&self, face: Face) -> DVec3 {
        let (low, high) = self.mesh.bounds();
        let mut centre = 0.5 * (low + high);
        centre[face.axis()] = if face.is_max() { high } else { low }[face.axis()];
        centre
    }
}

/// Lumped masses [kg].
fn nodal_masses(mesh: &Mesh, materials: &[Material], cell_material: &[u8], scaling: f64) -> Vec<f64> {
    let mut mass = vec![0.0; mesh.node_count()];
    for cell in (0..mesh.cell_count()).filter(|cell| !mesh.is_empty(*cell)) {
        let density = materials[cell_material.get(cell).map_or(0, |m| usize::from(*m))].density * scaling;
        let nodes = mesh.cell_nodes(cell);
        let share = density * mesh.cell_volume(cell) / nodes.len() as f64;
        for node in nodes.iter() {
            mass[*node] += share;
        }
    }
    mass
}

/// Held components and faces of every node. A node of a tetrahedral mesh lies on a face where it lies on the bounding
/// box, within a millionth of its diagonal.
fn node_flags(scene: &Scene, mesh: &Mesh, composition: &Composition) -> Vec<u32> {
    let (low, high) = mesh.bounds();
    let near = SIDE_TOLERANCE * (high - low).length();
    let fixed_bits = |fixed: [bool; 3]| (0..3).map(|a| u32::from(fixed[a]) << a).sum::<u32>();
    let mut flags: Vec<u32> = (0..mesh.node_count())
        .map(|node| {
            let x = mesh.rest_position(node);
            let on = |face: &Face| {
                let plane = if face.is_max() { high } else { low }[face.axis()];
                (x[face.axis()] - plane).abs() <= near
            };
            Face::ALL
                .into_iter()
                .filter(on)
                .fold(0, |flags, face| flags | 1 << (3 + face as usize) | fixed_bits(scene.faces[face as usize].fixed))
        })
        .collect();
    for (flags, _) in flags.iter_mut().zip(&composition.held).filter(|(_, held)| **held) {
        *flags |= HELD;
    }
    if let Mesh::Tets(tets) = mesh {
        for support in &scene.supports {
            for node in tets.node_sets.get(&support.set).into_iter().flatten() {
                flags[*node as usize] |= fixed_bits(support.fixed);
            }
        }
    }
    flags
}
