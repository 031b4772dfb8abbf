//! What is constant during a run: mesh, masses, loads, and what the chosen effects prepare once.

use std::collections::{HashMap, HashSet};

use glam::DVec3;

use crate::effects::{EffectSet, cohesive, indentation, puncture};
use crate::material_point::Material;
use crate::mesh::block::SLIT_HALF_WIDTH;
use crate::mesh::{BlockMesh, Bore, Mesh, TissuePoint};
use crate::needle::free_path::FreeTip;
use crate::needle::gap::Profile;
use crate::needle::slit::{NodeFaces, REFERENCE_EDGE};
use crate::needle::{Kinematics, PlannedPath, lateral_axes};
use crate::scene::motion::Placement;
use crate::scene::{Cutting, Face, FaceCondition, NeedleShape, RegionShape, Scene, TissueMaterial, Tool};
use crate::separation::{Cut, FacePair, Separation};

/// A node that the tool may touch.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ContactNode {
    pub node: u32,
    /// Rest distance r0 from the planned axis [m].
    pub rest_radius: f64,
    /// Rest coordinate s0 along the path, measured from the surface [m].
    pub rest_axial: f64,
    /// True for nodes that the needle pushes: the ring a0 < r0 < ring radius, or the copies of a surface that separates; the
    /// others only carry tip springs.
    pub pushed: bool,
    pub surface: ContactSurface,
    /// On a slit or under an indenter: the faces around the node, at whose points the tool touches.
    pub faces: Option<NodeFaces>,
    /// What the node stands for in contact: a quarter of the areas of those faces [m^2], without faces its rest volume [m^3].
    pub share: f64,
}

impl ContactNode {
    /// A node that carries tip springs and no more.
    fn carrier(node: usize, rest_radius: f64, rest_axial: f64, share: f64) -> Self {
        ContactNode {
            node: node as u32,
            rest_radius,
            rest_axial,
            pushed: false,
            surface: ContactSurface::OpenedPath,
            faces: None,
            share,
        }
    }
}

/// A corner of faces of a slit.
struct SlitNode {
    node: u32,
    side: DVec3,
    /// Nodes around and faces that are there, as in [`NodeFaces`].
    ring: Vec<u32>,
    present: u32,
}

/// Against what part of the needle a node is held.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum ContactSurface {
    /// The volume-preserving wall of the opened path.
    OpenedPath,
    /// The face of a slit, pushed to its own side (unit vector across the slit).
    Slit {
        side: DVec3,
    },
    /// The outer wall of a hollow needle, and its bore.
    OuterWall,
    Bore,
}

/// A cell that the opened path passes through.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PathCell {
    pub cell: u32,
    /// Part of the stiffness that is left once the tip has passed, from the fraction phi of the volume within a0 of the axis.
    pub left: f64,
    /// Smallest and largest s0 of that part [m].
    pub axial_start: f64,
    pub axial_end: f64,
}

/// A material line parallel to the path, on which one tip spring is anchored.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TipAnchor {
    /// Point where the line enters the top face [m].
    pub surface: DVec3,
    /// Axial coordinate of that point relative to the entry point [m]; 0 for a perpendicular entry.
    pub axial_offset: f64,
}

/// A stretch of the path through one material.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PathSegment {
    /// Material coordinate at which it begins [m].
    pub start: f64,
    pub cutting: Cutting,
    /// Length over which the threshold falls from F_pun to F_cut [m].
    pub transition_length: f64,
    /// A layer with a puncture energy of its own.
    pub membrane: bool,
}

/// Most materials of one scene; the last index is that of the last region.
pub const LARGEST_MATERIAL_COUNT: usize = 16;

/// Most stretches of one path.
pub const LARGEST_SEGMENT_COUNT: usize = 16;

impl PuncturePlan {
    /// Contact stiffness per area at the points of a slit, kappa [Pa/m].
    pub fn face_stiffness(&self) -> f64 {
        self.contact_stiffness / REFERENCE_EDGE.powi(2)
    }

    /// Contact stiffness of a node in the ring around the opened path, of full weight where `weight` is 1 [N/m].
    pub fn ring_stiffness(&self, contact: &ContactNode, weight: f64) -> f64 {
        self.ring_stiffness_per_volume * contact.share * weight
    }

    /// Tip force at which the tip advances at the coordinate a [N]: from F_pun of the material that it enters down to
    /// F_cut over the transition length; over the last transition length before the bottom it fades to nothing, since a spring
    /// that ended at once would throw the tissue back.
    pub fn threshold(&self, a: f64) -> f64 {
        let PathSegment { start, cutting, transition_length, .. } = self.segment(a);
        let entry = (1.0 - (a - start) / transition_length).max(0.0);
        let left = ((self.exit - a) / self.params.transition_length).clamp(0.0, 1.0);
        (cutting.cutting_force + (cutting.puncture_force - cutting.cutting_force) * entry) * left
    }

    /// The stretch of the path at the coordinate a [m].
    pub fn segment(&self, a: f64) -> PathSegment {
        self.segments[self.segments.partition_point(|s| s.start <= a).max(1) - 1]
    }
}

/// What the effect `puncture` prepares.
#[derive(Debug, Clone)]
pub struct PuncturePlan {
    /// At least one, ascending.
    pub segments: Vec<PathSegment>,
    pub params: puncture::Params,
    pub needle: NeedleShape,
    /// Its outer surface in the frame of the tip.
    pub profile: Profile,
    pub path: PlannedPath,
    pub anchors: Vec<TipAnchor>,
    /// Material coordinate at which the path leaves the block through the bottom [m].
    pub exit: f64,
    pub cells: Vec<PathCell>,
    /// Contact stiffness k of a face that separates [N/m].
    pub contact_stiffness: f64,
    /// Contact stiffness of the ring around the opened path, per rest volume [N/m^4].
    pub ring_stiffness_per_volume: f64,
    /// Time constant of the damping at the points of a slit: damping over stiffness [s].
    pub face_damping: f64,
    /// The path is not planned but found while the tip moves.
    pub free: Option<FreePlan>,
}

/// What a free path needs instead of a planned one.
#[derive(Debug, Clone, PartialEq)]
pub struct FreePlan {
    /// Box of the cells that the tip may open: first cell and number of cells along each axis.
    pub low: [usize; 3],
    pub count: [usize; 3],
    /// Tip forces of each material.
    pub cuttings: Vec<Cutting>,
}

impl FreePlan {
    pub fn cell_count(&self) -> usize {
        self.count.iter().product()
    }

    /// Grid coordinates of the cell number `index` of the box.
    pub fn cell(&self, index: usize) -> [usize; 3] {
        let [nx, ny, _] = self.count;
        let part = [index % nx, index / nx % ny, index / (nx * ny)];
        std::array::from_fn(|a| self.low[a] + part[a])
    }

    /// Number of a cell in the box; `None` outside it.
    pub fn index(&self, cell: [usize; 3]) -> Option<usize> {
        let inside = (0..3).all(|a| (self.low[a]..self.low[a] + self.count[a]).contains(&cell[a]));
        let [i, j, k]: [usize; 3] = std::array::from_fn(|a| cell[a].wrapping_sub(self.low[a]));
        inside.then(|| (k * self.count[1] + j) * self.count[0] + i)
    }
}

/// True where the path of the needle is found while the tip moves, false where it is planned: the one place that decides.
pub fn has_free_path(scene: &Scene) -> bool {
    scene.effects.puncture.is_some_and(|p| p.always_free) || scene.motion.is_free()
}

/// Largest way of a node in one step, part of the smallest edge. With 0.05 tissue that snaps off a needle loses twice the energy
/// (`free_hand/reinsertion.toml` in its usual step: 8.5 against 3.7 %); with 0.25 squeezed cells outrun the masses that are raised for
/// them, and a block that is let go from 0.4 of its height triples its energy.
const SPEED_PER_STEP: f64 = 0.1;

/// Room around the planned motion for the nodes and cells of a free path: tissue moves before the tip comes [m].
const FREE_PATH_ROOM: f64 = 1.0e-3;

/// Everything constant.
#[derive(Debug, Clone)]
pub struct Model {
    pub scene: Scene,
    pub mesh: Mesh,
    /// Materials with the effects that are on: the scene's own, then one per region.
    pub materials: Vec<Material>,
    /// Index into `materials` per cell; empty where there is one material only.
    pub cell_material: Vec<u8>,
    /// Per node: bits 0..2 held or driven components x, y, z; bits 3..8 the faces that it lies on.
    pub node_flags: Vec<u32>,
    pub effects: EffectSet,
    pub kinematics: Option<Kinematics>,
    /// Nodal mass including the uniform mass scaling [kg].
    pub node_mass: Vec<f64>,
    /// Nodal dead load at full ramp [N]; empty without tractions.
    pub node_load: Vec<DVec3>,
    /// Time over which the loads grow [s].
    pub load_ramp: f64,
    pub puncture: Option<PuncturePlan>,
    pub indentation: Option<indentation::Plan>,
    /// Faces that may separate, and copies that are tied.
    pub separation: Separation,
    /// Their law; `None` without the effect.
    pub cohesion: Option<cohesive::Law>,
    /// Nodes that a tool may touch, ascending in the node index; empty without contact.
    pub contact_nodes: Vec<ContactNode>,
    /// Where the targets of the scene lie in the block.
    pub targets: Vec<TissuePoint>,
}

/// Number of tip springs of a solid needle on a path without a slit: one on the axis, 6 at R/2, 12 at R.
pub const ANCHOR_COUNT: usize = 19;

/// Most tip springs: those of a cutting ring.
pub const LARGEST_ANCHOR_COUNT: usize = 24;

/// Distance of the tip springs of a cutting ring from its edge, on either side [m].
const CUTTING_RING: f64 = 0.2e-3;

/// How far beyond the needle's sides a slit may tear [m].
const SLIT_MARGIN: f64 = 1.0e-3;

impl Model {
    /// Prepares a scene. The mesh is built from the scene by `BlockMesh::for_scene`.
    pub fn new(scene: Scene, mesh: impl Into<Mesh>) -> Self {
        let mesh = mesh.into();
        let scaling = scene.effects.mass_scaling.map_or(1.0, |m| m.factor);
        let materials: Vec<Material> = std::iter::once(&scene.material)
            .chain(scene.regions.iter().map(|r| &r.material))
            .map(|m| constants(m, &scene.effects))
            .collect();
        let cell_material = if scene.regions.is_empty() { Vec::new() } else { assign_materials(&scene, &mesh) };
        let node_mass = nodal_masses(&mesh, &materials, &cell_material, scaling);
        let (node_load, load_ramp) = nodal_loads(&scene, &mesh);
        let targets = mesh.as_block().map_or(Vec::new(), |block| {
            scene.targets.iter().map(|target| TissuePoint::new(block, target.position)).collect()
        });
        let kinematics = (!scene.motion.phases.is_empty()).then(|| Kinematics::new(&scene.motion));
        let mut model = Model {
            effects: scene.effects.clone(),
            node_flags: node_flags(&scene, &mesh),
            materials,
            cell_material,
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

    /// Material of a cell.
    pub fn material(&self, cell: usize) -> &Material {
        &self.materials[self.material_index(cell)]
    }

    /// True where cells remember something.
    pub fn has_history(&self) -> bool {
        self.effects.plasticity.is_some() || self.effects.viscoelastic.is_some()
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

    /// Stiffness of a penalty contact at a node of a separated face, `factor (K + 4/3 mu) l^2 / h` with the
    /// reference length l = 0.6 mm [N/m]: a finer mesh penetrates less.
    fn contact_stiffness(&self, factor: f64) -> f64 {
        let h = self.scene.tissue.cell_size;
        factor * self.scene.material.law.p_wave_modulus() * REFERENCE_EDGE * REFERENCE_EDGE / h
    }

    /// Contact stiffness of the ring around an opened path per rest volume, `factor (K + 4/3 mu) / l^2`, the same on every
    /// mesh [N/m^4].
    fn ring_stiffness_per_volume(&self, factor: f64) -> f64 {
        factor * self.scene.material.law.p_wave_modulus() / (REFERENCE_EDGE * REFERENCE_EDGE)
    }

    /// The planned path, if the tool is a needle that cuts.
    fn planned_path(&self) -> Option<PlannedPath> {
        let motion = &self.scene.motion;
        let cuts = self.effects.puncture.is_some() && self.scene.needle().is_some() && !has_free_path(&self.scene);
        cuts.then_some(PlannedPath { entry: motion.entry, direction: motion.direction })
    }

    fn plan_separation(&mut self) {
        let (Some(params), Some(mesh)) = (&self.effects.cohesive, self.mesh.as_block()) else { return };
        let h = self.scene.tissue.cell_size;
        let cut = self.planned_path().zip(self.scene.needle()).map(|(path, needle)| Cut {
            path,
            reach: needle.radius + SLIT_MARGIN,
            // The ends of the slit hold, as far as they can.
            driven: 0.99 * SLIT_HALF_WIDTH * needle.radius,
            deepest: self.scene.motion.deepest() + 2.0 * h,
            ring: needle.bore.is_some(),
            wall: [needle.bore.map_or(0.0, |b| b.edge), needle.radius],
        });
        self.separation = Separation::new(mesh, &params.planes, cut.as_ref());
        self.cohesion = Some(cohesive::Law::new(params, self.scene.material.law.youngs_modulus(), h));
    }

    fn plan_puncture(&mut self) {
        let (Some(params), Some(Tool::Needle(needle))) = (self.effects.puncture, &self.scene.tool) else {
            return;
        };
        let needle = needle.clone();
        if has_free_path(&self.scene) {
            self.plan_free_path(params, needle);
            return;
        }
        let path = PlannedPath { entry: self.scene.motion.entry, direction: self.scene.motion.direction };
        let deepest = self.scene.motion.deepest();
        let Some(mesh) = self.mesh.as_block() else { return };
        // Faces that separate need no softened path; the core of a hollow needle is severed cell by cell.
        let cells = match (&self.cohesion, mesh.bore) {
            (Some(_), Some(bore)) => core_cells(mesh, &bore, deepest),
            (Some(_), None) => Vec::new(),
            (None, _) => path_cells(mesh, &path, &params, deepest),
        };
        let exit = self.scene.tissue.size.z / -path.direction.z;
        let surfaces = self.separated_surfaces(&path);
        // Tip springs act on the corners of the cell that an anchor is in: one cell beyond the needle radius.
        let anchor_reach = needle.radius + self.scene.tissue.cell_size * 1.5;
        let cohesive = self.cohesion.is_some();
        self.contact_nodes = (0..mesh.node_count())
            .filter_map(|node| {
                let (r0, s0) = path.material_coordinates(mesh.rest_position(node));
                let surface = surfaces.get(&(node as u32)).copied().unwrap_or(ContactSurface::OpenedPath);
                let in_ring = params.ring_weight(r0) > 0.0;
                let on_slit = matches!(surface, ContactSurface::Slit { .. });
                let on_face = surface != ContactSurface::OpenedPath;
                let pushed = on_slit || s0 < deepest && if cohesive { on_face } else { in_ring };
                let carries = r0 < anchor_reach && s0 < deepest + 2.0 * self.scene.tissue.cell_size;
                let carrier = ContactNode::carrier(node, r0, s0, mesh.node_volume(node));
                (pushed || carries).then_some(ContactNode { pushed, surface, ..carrier })
            })
            .collect();
        self.join_slit_faces();
        // As the nodes of a face would be damped, each with a half of the masses of its cells.
        let h = self.scene.tissue.cell_size;
        let contact_stiffness = self.contact_stiffness(params.contact_stiffness_factor);
        let face_mass = 0.5 * self.scaled_density() * h.powi(3);
        self.puncture = Some(PuncturePlan {
            segments: path_segments(&self.scene, &params, &path, exit),
            exit,
            anchors: tip_anchors(&path, &needle, self.effects.cohesive.is_some()),
            cells,
            contact_stiffness,
            ring_stiffness_per_volume: self.ring_stiffness_per_volume(params.contact_stiffness_factor),
            face_damping: 2.0 * params.contact_damping * (face_mass / contact_stiffness).sqrt(),
            params,
            profile: Profile::new(&needle, path.direction),
            needle,
            path,
            free: None,
        });
    }

    /// Nodes and cells that the needle can reach on a free path, generously; all of them where a hand leads it.
    fn plan_free_path(&mut self, params: puncture::Params, needle: NeedleShape) {
        let Some(mesh) = self.mesh.as_block() else { return };
        let motion = &self.scene.motion;
        // The needle's axis inside the block, again and again along the motion.
        let inside = |p: Placement| {
            let surface = p.tip - p.direction * p.depth;
            (surface, if p.depth > 0.0 { p.tip } else { surface })
        };
        let axes: Vec<(DVec3, DVec3)> =
            motion.samples(0.25e-3).into_iter().filter(|p| p.depth > -FREE_PATH_ROOM).map(inside).collect();
        let near =
            |x: DVec3, reach: f64| params.anywhere || axes.iter().any(|(a, b)| distance_to_segment(x, *a, *b) < reach);
        let h = self.scene.tissue.cell_size;
        let reach = params.ring_radius.max(needle.radius + 1.5 * h) + FREE_PATH_ROOM;
        self.contact_nodes = (0..mesh.node_count())
            .filter(|&node| near(mesh.rest_position(node), reach))
            .map(|node| ContactNode { pushed: true, ..ContactNode::carrier(node, 0.0, 0.0, mesh.node_volume(node)) })
            .collect();
        let opened = (0..mesh.cell_count()).filter(|&cell| {
            let size = mesh.cell_size(cell);
            let centre = mesh.rest_position(mesh.cell_nodes(cell)[0]) + 0.5 * size;
            near(centre, params.softened_radius + FREE_PATH_ROOM + 0.5 * size.length())
        });
        let (mut low, mut high) = ([usize::MAX; 3], [0; 3]);
        for cell in opened {
            let at = mesh.cell_coordinates(cell);
            for a in 0..3 {
                low[a] = low[a].min(at[a]);
                high[a] = high[a].max(at[a] + 1);
            }
        }
        let count = std::array::from_fn(|a| high[a].saturating_sub(low[a]));
        let own = Cutting { puncture_force: params.puncture_force, cutting_force: params.cutting_force };
        let cutting = |m: &TissueMaterial| {
            let mut cutting = m.cutting.unwrap_or(own);
            if let Some(energy) = m.membrane_energy {
                cutting.puncture_force = cutting.cutting_force + 2.0 * energy / params.transition_length;
            }
            cutting
        };
        let cuttings = std::iter::once(&self.scene.material).chain(self.scene.regions.iter().map(|r| &r.material));
        let path = PlannedPath { entry: motion.entry, direction: motion.direction };
        self.puncture = Some(PuncturePlan {
            free: Some(FreePlan { low, count, cuttings: cuttings.map(cutting).collect() }),
            segments: vec![PathSegment {
                start: 0.0,
                cutting: cutting(&self.scene.material),
                transition_length: params.transition_length,
                membrane: false,
            }],
            exit: f64::INFINITY,
            anchors: Vec::new(),
            cells: Vec::new(),
            contact_stiffness: self.contact_stiffness(params.contact_stiffness_factor),
            ring_stiffness_per_volume: self.ring_stiffness_per_volume(params.contact_stiffness_factor),
            face_damping: 0.0,
            profile: Profile::new(&needle, motion.direction),
            params,
            needle,
            path,
        });
    }

    /// What part of the needle the copies of the path's surface face.
    fn separated_surfaces(&self, path: &PlannedPath) -> HashMap<u32, ContactSurface> {
        let hollow = self.scene.has_bore();
        let driven = self.separation.pairs.iter().filter(|p| hollow && !p.on_plane && p.tip_driven.is_some());
        let axis_of = |pair: &FacePair| if pair.axis == 0 { DVec3::X } else { DVec3::Y };
        driven
            .flat_map(|pair| {
                let rest = self.mesh.rest_position(pair.nodes[0] as usize) - path.entry;
                // Of a ring pair the copy on the side of the axis belongs to the core.
                let core = usize::from(rest.dot(axis_of(pair)) < 0.0);
                [0, 1]
                    .map(|n| (pair.nodes[n], if n == core { ContactSurface::Bore } else { ContactSurface::OuterWall }))
            })
            .chain(self.slit_nodes().into_iter().map(|n| (n.node, ContactSurface::Slit { side: n.side })))
            .collect()
    }

    /// Corners of the faces on both sides of a slit that may part.
    fn slit_nodes(&self) -> Vec<SlitNode> {
        let (Some(axis), Some(mesh)) = (self.scene.slit_axis(), self.mesh.as_block()) else { return Vec::new() };
        let (b, c) = ((axis + 1) % 3, (axis + 2) % 3);
        let parts: HashSet<u32> =
            self.separation.pairs.iter().filter(|p| self.on_slit(p)).flat_map(|p| p.nodes).collect();
        let mut layers: Vec<(usize, f64)> = Vec::new();
        for pair in self.separation.pairs.iter().filter(|p| self.on_slit(p)) {
            for (node, sign) in pair.nodes.iter().zip([-1.0, 1.0]) {
                let layer = (mesh.node_coordinates(*node as usize)[axis], sign);
                if !layers.contains(&layer) {
                    layers.push(layer);
                }
            }
        }
        let counts = mesh.nodes();
        let mut nodes = Vec::new();
        for (layer, sign) in layers {
            let node = |m: usize, n: usize| {
                let mut at = [layer; 3];
                (at[b], at[c]) = (m, n);
                mesh.node_index(at[0], at[1], at[2]) as u32
            };
            let mut side = DVec3::ZERO;
            side[axis] = sign;
            for (m, n) in (0..counts[c]).flat_map(|n| (0..counts[b]).map(move |m| (m, n))) {
                let mut present = 0;
                // Neighbours, the node itself where there is none.
                let beside = |k: usize, step: usize, count: usize| match step {
                    0 => k.checked_sub(1),
                    1 => Some(k),
                    _ => Some(k + 1).filter(|k| *k < count),
                };
                let at = |i: usize, j: usize| Some(node(beside(m, i, counts[b])?, beside(n, j, counts[c])?));
                for (i, j) in [(0, 0), (1, 0), (0, 1), (1, 1)] {
                    let corners = [at(1, 1), at(2 * i, 1), at(1, 2 * j), at(2 * i, 2 * j)];
                    let whole: Option<Vec<u32>> = corners.into_iter().collect();
                    if whole.is_some_and(|face| face.iter().any(|node| parts.contains(node))) {
                        present |= 1 << (i + 2 * j);
                    }
                }
                if present != 0 {
                    let places = (0..9).filter(|p| *p != 4).map(|p| at(p % 3, p / 3).unwrap_or(node(m, n)));
                    nodes.push(SlitNode { node: node(m, n), side, ring: places.collect(), present });
                }
            }
        }
        nodes
    }

    /// Tells the contact nodes of a slit their faces.
    fn join_slit_faces(&mut self) {
        let index: HashMap<u32, u32> = (0..).zip(&self.contact_nodes).map(|(i, c)| (c.node, i)).collect();
        for slit in self.slit_nodes() {
            let own = index[&slit.node];
            // Neighbours of faces that are not there may be no contact nodes.
            let ring = std::array::from_fn(|p| index.get(&slit.ring[p]).copied().unwrap_or(own));
            let faces = NodeFaces { ring, present: slit.present };
            let place = |contact: u32| self.mesh.rest_position(self.contact_nodes[contact as usize].node as usize);
            let areas = (0..4).filter(|q| slit.present & (1 << q) != 0).map(|q| {
                let [first, second, _] = faces.corners(q & 1, q >> 1).map(place);
                0.25 * (first - place(own)).cross(second - place(own)).length()
            });
            let area = areas.sum();
            let contact = &mut self.contact_nodes[own as usize];
            (contact.faces, contact.share) = (Some(faces), area);
        }
    }

    /// True where the mesh follows the bore of a hollow needle.
    pub fn has_bore(&self) -> bool {
        self.mesh.as_block().is_some_and(|block| block.bore.is_some())
    }

    /// True where a node is held against a surface of this kind.
    pub fn has_surface(&self, wanted: impl Fn(&ContactSurface) -> bool) -> bool {
        self.contact_nodes.iter().any(|c| wanted(&c.surface))
    }

    /// True for the pairs of the slit, driven or not.
    fn on_slit(&self, pair: &FacePair) -> bool {
        self.scene.slit_axis() == Some(pair.axis) && {
            let off = self.mesh.rest_position(pair.nodes[0] as usize) - self.scene.motion.entry;
            off[pair.axis].abs() < 1e-9
        }
    }

    fn plan_indentation(&mut self) {
        let (radius, params) = match (self.effects.indentation, &self.scene.tool) {
            (Some(params), Some(Tool::Sphere { radius } | Tool::FlatPunch { radius, .. })) => (*radius, params),
            _ => return,
        };
        let Some(mesh) = self.mesh.as_block() else { return };
        let h = self.scene.tissue.cell_size;
        let modulus = self.scene.material.law.p_wave_modulus();
        self.indentation = Some(indentation::Plan::new(&params, modulus, self.scaled_density(), h));
        let entry = self.scene.motion.entry;
        // Tissue is drawn in from the sides as the tool goes down.
        let reach = 1.5 * radius + 0.5 * self.scene.motion.deepest().max(0.0) + h;
        let [nx, ny, nz] = mesh.nodes();
        let near = |i: usize, j: usize| {
            let lateral = mesh.rest_position(mesh.node_index(i, j, nz - 1)) - entry;
            Some(lateral.truncate().length()).filter(|r0| *r0 < reach)
        };
        let mut nodes = Vec::new();
        let mut index = HashMap::new();
        for (i, j) in (0..ny).flat_map(|j| (0..nx).map(move |i| (i, j))) {
            if let Some(r0) = near(i, j) {
                index.insert((i, j), nodes.len() as u32);
                nodes.push((i, j, r0));
            }
        }
        self.contact_nodes = nodes
            .iter()
            .map(|&(i, j, r0)| {
                let own = index[&(i, j)];
                let at = |p: usize, q: usize| index.get(&((i + p).checked_sub(1)?, (j + q).checked_sub(1)?)).copied();
                let places = (0..9).filter(|p| *p != 4).map(|p| at(p % 3, p / 3).unwrap_or(own));
                let mut faces = NodeFaces { ring: [own; 8], present: 0 };
                faces.ring.iter_mut().zip(places).for_each(|(ring, place)| *ring = place);
                let width = |lines: &[f64], n: usize, side: usize| lines[n + side] - lines[n + side - 1];
                let mut area = 0.0;
                for (p, q) in [(0, 0), (1, 0), (0, 1), (1, 1)] {
                    if [at(2 * p, 1), at(1, 2 * q), at(2 * p, 2 * q)].iter().all(Option::is_some) {
                        faces.present |= 1 << (p + 2 * q);
                        area += 0.25 * width(&mesh.lines[0], i, p) * width(&mesh.lines[1], j, q);
                    }
                }
                let node = mesh.node_index(i, j, nz - 1);
                ContactNode { pushed: true, faces: Some(faces), ..ContactNode::carrier(node, r0, 0.0, area) }
            })
            .collect();
    }

    /// Largest part of the tip springs that one node can carry: where the anchors are in the first cells of the path.
    pub fn largest_spring_share(&self) -> f64 {
        let (Some(plan), Some(mesh)) = (&self.puncture, self.mesh.as_block()) else { return 0.0 };
        let anchors = match plan.anchors.is_empty() {
            true => tip_anchors(&plan.path, &plan.needle, false),
            false => plan.anchors.clone(),
        };
        let h = self.scene.tissue.cell_size;
        let mut largest: f64 = 0.0;
        for part in 0..8 {
            let mut shares: HashMap<usize, f64> = HashMap::new();
            for anchor in &anchors {
                let x = anchor.surface + plan.path.direction * (h * f64::from(part) / 4.0);
                let ([i, j, k], at) = mesh.locate(x);
                let weight = |corner: usize, a: usize| if corner >> a & 1 == 1 { at[a] } else { 1.0 - at[a] };
                for corner in 0..8 {
                    let node = mesh.node_index(i + (corner & 1), j + (corner >> 1 & 1), k + (corner >> 2));
                    let share: f64 = (0..3).map(|a| weight(corner, a)).product();
                    *shares.entry(node).or_default() += share / anchors.len() as f64;
                }
            }
            largest = shares.values().fold(largest, |a, b| a.max(*b));
        }
        largest
    }

    /// The tip before the run, where the path is free.
    pub fn free_tip(&self) -> FreeTip {
        let motion = &self.scene.motion;
        match self.puncture.as_ref().filter(|p| p.free.is_some()) {
            Some(_) => FreeTip {
                place: motion.entry,
                along: motion.direction,
                across: lateral_axes(motion.direction).0,
                ..FreeTip::default()
            },
            None => FreeTip::default(),
        }
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

fn distance_to_segment(x: DVec3, a: DVec3, b: DVec3) -> f64 {
    let along = b - a;
    let square = along.length_squared();
    let part = if square > 0.0 { ((x - a).dot(along) / square).clamp(0.0, 1.0) } else { 0.0 };
    x.distance(a + along * part)
}

/// A material with the effects that are on; what it does not state itself comes from the scene's tables.
fn constants(material: &TissueMaterial, effects: &crate::effects::EffectSet) -> Material {
    Material {
        law: material.law,
        density: material.density,
        plasticity: effects.plasticity.map(|p| material.plasticity.unwrap_or(p)),
        fibres: effects.fibres.map(|p| material.fibres.unwrap_or(p)),
        viscoelastic: effects.viscoelastic.clone().map(|p| material.viscoelastic.clone().unwrap_or(p)),
        damage: effects.damage.map(|p| material.damage.unwrap_or(p)),
    }
}

/// Material of every cell: the last region that holds its centre, else the scene's own.
fn assign_materials(scene: &Scene, mesh: &Mesh) -> Vec<u8> {
    let holds = |shape: &RegionShape, cell: usize| match (shape, mesh) {
        (RegionShape::MeshTag(name), Mesh::Tets(tets)) => tets.regions[tets.tags[cell] as usize] == *name,
        _ => shape.contains(mesh.cell_centre(cell)),
    };
    (0..mesh.cell_count())
        .map(|cell| scene.regions.iter().rposition(|r| holds(&r.shape, cell)).map_or(0, |i| i as u8 + 1))
        .collect()
}

/// Lumped masses [kg].
fn nodal_masses(mesh: &Mesh, materials: &[Material], cell_material: &[u8], scaling: f64) -> Vec<f64> {
    let mut mass = vec![0.0; mesh.node_count()];
    for cell in 0..mesh.cell_count() {
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
fn node_flags(scene: &Scene, mesh: &Mesh) -> Vec<u32> {
    let (low, high) = mesh.bounds();
    let near = 1e-6 * (high - low).length();
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
    if let Mesh::Tets(tets) = mesh {
        for support in &scene.supports {
            for node in tets.node_sets.get(&support.set).into_iter().flatten() {
                flags[*node as usize] |= fixed_bits(support.fixed);
            }
        }
    }
    flags
}

/// Stretches of the path with their own tip forces, from the materials that its axis passes through on its way to the
/// bottom at `exit` [m].
fn path_segments(scene: &Scene, params: &puncture::Params, path: &PlannedPath, exit: f64) -> Vec<PathSegment> {
    const STEP: f64 = 2.0e-5;
    let own = Cutting { puncture_force: params.puncture_force, cutting_force: params.cutting_force };
    let mut starts: Vec<(f64, Option<usize>)> = Vec::new();
    for i in 0..(exit / STEP).ceil().max(1.0) as usize {
        // The surface itself belongs to what lies under it.
        let a = i as f64 * STEP;
        let x = path.entry + path.direction * (a + 0.5 * STEP);
        let region = scene.regions.iter().rposition(|r| r.shape.contains(x));
        if starts.last().is_none_or(|(_, last)| *last != region) {
            starts.push((a, region));
        }
    }
    let ends = starts.iter().skip(1).map(|s| s.0).chain([exit]);
    starts
        .iter()
        .zip(ends)
        .take(LARGEST_SEGMENT_COUNT)
        .map(|(&(start, region), end)| {
            let material = region.map_or(&scene.material, |r| &scene.regions[r].material);
            let mut cutting = material.cutting.unwrap_or(own);
            let mut transition_length = params.transition_length;
            if let Some(energy) = material.membrane_energy {
                transition_length = transition_length.min(end - start);
                cutting.puncture_force = cutting.cutting_force + 2.0 * energy / transition_length;
            }
            PathSegment { start, cutting, transition_length, membrane: material.membrane_energy.is_some() }
        })
        .collect()
}

/// Lines on which the tip springs are anchored: one on the axis, 6 at R/2, 12 at R. Before a slit none lies on its plane,
/// where it would pull at one side; a cutting ring has 12 on either side of its edge.
fn tip_anchors(path: &PlannedPath, needle: &NeedleShape, cohesive: bool) -> Vec<TipAnchor> {
    let (e1, e2) = lateral_axes(path.direction);
    let turn = if cohesive { std::f64::consts::TAU / 24.0 } else { 0.0 };
    let ring = |count: usize, r: f64| {
        (0..count).map(move |i| {
            let angle = std::f64::consts::TAU * i as f64 / count as f64 + turn;
            (e1 * angle.cos() + e2 * angle.sin()) * r
        })
    };
    let radius = needle.radius;
    let offsets: Vec<DVec3> = match needle.bore.filter(|_| cohesive) {
        Some(bore) => ring(12, bore.edge - CUTTING_RING).chain(ring(12, bore.edge + CUTTING_RING)).collect(),
        None => {
            let centre = (!cohesive).then_some(DVec3::ZERO);
            centre.into_iter().chain(ring(6, 0.5 * radius)).chain(ring(12, radius)).collect()
        }
    };
    offsets
        .into_iter()
        .map(|o| {
            // The line entry + o + t s meets z = 0 at s = -o.z / t.z.
            let axial_offset = -o.z / path.direction.z;
            TipAnchor { surface: path.entry + o + path.direction * axial_offset, axial_offset }
        })
        .collect()
}

/// Cells that lie partly within a0 of the path, with the volume fraction found from 10^3 sample points.
fn path_cells(mesh: &BlockMesh, path: &PlannedPath, params: &puncture::Params, deepest: f64) -> Vec<PathCell> {
    const SAMPLES: usize = 10;
    let radius = params.softened_radius;
    (0..mesh.cell_count())
        .filter_map(|cell| {
            let size = mesh.cell_size(cell);
            let low = mesh.rest_position(mesh.cell_nodes(cell)[0]);
            let (r_mid, s_mid) = path.material_coordinates(low + 0.5 * size);
            let reach = 0.5 * size.length();
            if r_mid > radius + reach || s_mid > deepest + reach {
                return None;
            }
            let (mut inside, mut start, mut end) = (0usize, f64::INFINITY, f64::NEG_INFINITY);
            for n in 0..SAMPLES.pow(3) {
                let part = |i: usize| (i as f64 + 0.5) / SAMPLES as f64;
                let at = DVec3::new(part(n % SAMPLES), part(n / SAMPLES % SAMPLES), part(n / SAMPLES.pow(2)));
                let (r0, s0) = path.material_coordinates(low + at * size);
                if r0 < radius {
                    inside += 1;
                    start = start.min(s0);
                    end = end.max(s0);
                }
            }
            (inside > 0 && start < deepest).then_some(PathCell {
                cell: cell as u32,
                left: params.stiffness_left(inside as f64 / SAMPLES.pow(3) as f64),
                axial_start: start,
                axial_end: end,
            })
        })
        .collect()
}

/// Cells of the core that a hollow needle can cut out, with the range of s0 of their layer.
fn core_cells(mesh: &BlockMesh, bore: &Bore, deepest: f64) -> Vec<PathCell> {
    let ring = bore.radius * (1.0 + 1e-9);
    (0..mesh.cell_count())
        .filter(|cell| !mesh.is_gap(*cell))
        .filter_map(|cell| {
            let at = mesh.cell_coordinates(cell);
            let inside = (0..2).all(|a| {
                let from_axis = [mesh.lines[a][at[a]], mesh.lines[a][at[a] + 1]].map(|x| (x - bore.centre[a]).abs());
                from_axis[0].max(from_axis[1]) <= ring
            });
            let (start, end) = (-mesh.lines[2][at[2] + 1], -mesh.lines[2][at[2]]);
            (inside && start < deepest).then_some(PathCell {
                cell: cell as u32,
                left: 0.0,
                axial_start: start,
                axial_end: end,
            })
        })
        .collect()
}

/// Nodal forces of all face tractions at full ramp [N], and the ramp time [s].
fn nodal_loads(scene: &Scene, mesh: &Mesh) -> (Vec<DVec3>, f64) {
    let Some(mesh) = mesh.as_block() else { return (Vec::new(), 0.0) };
    let loaded: Vec<Face> = Face::ALL.into_iter().filter(|&f| scene.faces[f as usize].traction.is_some()).collect();
    if loaded.is_empty() {
        return (Vec::new(), 0.0);
    }
    let mut load = vec![DVec3::ZERO; mesh.node_count()];
    let mut ramp: f64 = 0.0;
    for face in loaded {
        let condition = &scene.faces[face as usize];
        let traction = condition.traction.unwrap_or_default();
        ramp = ramp.max(condition.traction_ramp);
        let axis = face.axis();
        let plane = if face.is_max() { mesh.nodes()[axis] - 1 } else { 0 };
        let lines = &mesh.lines[axis];
        let half =
            0.5 * if face.is_max() { lines[lines.len() - 1] - lines[lines.len() - 2] } else { lines[1] - lines[0] };
        for (node, force) in load.iter_mut().enumerate() {
            if mesh.node_coordinates(node)[axis] == plane {
                *force += traction * (mesh.node_volume(node) / half);
            }
        }
    }
    (load, ramp)
}
