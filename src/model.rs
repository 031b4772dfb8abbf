//! What is constant during a run: mesh, masses, loads, and what the chosen effects prepare once.

use glam::DVec3;

use crate::effects::{EffectSet, puncture};
use crate::mesh::BlockMesh;
use crate::needle::{Kinematics, PlannedPath, lateral_axes};
use crate::scene::{Face, FaceCondition, NeedleShape, Scene, Tool};

/// A node that the tool may touch.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ContactNode {
    pub node: u32,
    /// Rest distance r0 from the planned axis [m].
    pub rest_radius: f64,
    /// Rest coordinate s0 along the path, measured from the surface [m].
    pub rest_axial: f64,
    /// True for the ring a0 < r0 < ring radius that the shaft pushes; the other nodes only carry tip springs.
    pub pushed: bool,
}

/// A cell that the opened path passes through.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PathCell {
    pub cell: u32,
    /// Fraction phi of the cell's volume within a0 of the axis.
    pub fraction: f64,
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

/// What the effect `puncture` prepares.
#[derive(Debug, Clone)]
pub struct PuncturePlan {
    pub params: puncture::Params,
    pub needle: NeedleShape,
    pub path: PlannedPath,
    pub anchors: Vec<TipAnchor>,
    pub cells: Vec<PathCell>,
    /// Contact stiffness k [N/m].
    pub contact_stiffness: f64,
}

/// Everything constant.
#[derive(Debug, Clone)]
pub struct Model {
    pub scene: Scene,
    pub mesh: BlockMesh,
    pub effects: EffectSet,
    pub kinematics: Option<Kinematics>,
    /// Nodal mass including the uniform mass scaling [kg].
    pub node_mass: Vec<f64>,
    /// Nodal dead load at full ramp [N]; empty without tractions.
    pub node_load: Vec<DVec3>,
    /// Time over which the loads grow [s].
    pub load_ramp: f64,
    pub puncture: Option<PuncturePlan>,
    /// Nodes that a tool may touch, ascending in the node index; empty without contact.
    pub contact_nodes: Vec<ContactNode>,
}

/// Reference length of the contact stiffness [m].
const CONTACT_LENGTH: f64 = 0.6e-3;

/// Number of tip springs: one on the axis, 6 at R/2, 12 at R.
pub const ANCHOR_COUNT: usize = 19;

impl Model {
    /// Prepares a scene. The mesh is built from the scene by `BlockMesh::for_scene`.
    pub fn new(scene: Scene, mesh: BlockMesh) -> Self {
        let scaling = scene.effects.mass_scaling.map_or(1.0, |m| m.factor);
        let density = scene.material.density * scaling;
        let node_mass = (0..mesh.node_count()).map(|n| density * mesh.node_volume(n)).collect();
        let (node_load, load_ramp) = nodal_loads(&scene, &mesh);
        let kinematics = (!scene.motion.phases.is_empty()).then(|| Kinematics::new(&scene.motion));
        let mut model = Model {
            effects: scene.effects.clone(),
            node_mass,
            node_load,
            load_ramp,
            kinematics,
            puncture: None,
            contact_nodes: Vec::new(),
            scene,
            mesh,
        };
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

    /// Smallest cell edge [m].
    pub fn smallest_edge(&self) -> f64 {
        let steps = self.mesh.lines.iter().flat_map(|l| l.windows(2).map(|w| w[1] - w[0]));
        steps.fold(f64::INFINITY, f64::min)
    }

    /// Largest nodal speed that is let through: 0.05 of the smallest edge per step [m/s].
    pub fn speed_limit(&self, dt: f64) -> f64 {
        0.05 * self.smallest_edge() / dt
    }

    /// Stiffness of a penalty contact, `factor (K + 4/3 mu) l^2 / h` with the reference length l = 0.6 mm [N/m].
    ///
    /// With a stiffness that grows like h the force at 12 mm scatters by 14 % over 0.8/0.6/0.5 mm, with this one by
    /// 8 %: a finer mesh gets the stiffer contact and penetrates less (measured in the default scene).
    fn contact_stiffness(&self, factor: f64) -> f64 {
        let h = self.scene.tissue.cell_size;
        factor * self.scene.material.law.p_wave_modulus() * CONTACT_LENGTH * CONTACT_LENGTH / h
    }

    fn plan_puncture(&mut self) {
        let (Some(params), Some(Tool::Needle(needle))) = (self.effects.puncture, &self.scene.tool) else {
            return;
        };
        let needle = needle.clone();
        let path = PlannedPath { entry: self.scene.motion.entry, direction: self.scene.motion.direction };
        let deepest = self.scene.motion.deepest();
        let mesh = &self.mesh;
        let cells = path_cells(mesh, &path, params.softened_radius, deepest);
        // Tip springs act on the corners of the cell that an anchor is in: one cell beyond the needle radius.
        let anchor_reach = needle.radius + self.scene.tissue.cell_size * 1.5;
        self.contact_nodes = (0..mesh.node_count())
            .filter_map(|node| {
                let (r0, s0) = path.material_coordinates(mesh.rest_position(node));
                let pushed = r0 > params.softened_radius && r0 < params.ring_radius && s0 < deepest;
                let carries = r0 < anchor_reach && s0 < deepest + 2.0 * self.scene.tissue.cell_size;
                (pushed || carries).then_some(ContactNode {
                    node: node as u32,
                    rest_radius: r0,
                    rest_axial: s0,
                    pushed,
                })
            })
            .collect();
        self.puncture = Some(PuncturePlan {
            anchors: tip_anchors(&path, needle.radius),
            cells,
            contact_stiffness: self.contact_stiffness(params.contact_stiffness_factor),
            params,
            needle,
            path,
        });
    }

    fn plan_indentation(&mut self) {
        let radius = match (self.effects.indentation, &self.scene.tool) {
            (Some(_), Some(Tool::Sphere { radius } | Tool::FlatPunch { radius, .. })) => *radius,
            _ => return,
        };
        let mesh = &self.mesh;
        let entry = self.scene.motion.entry;
        let top = mesh.nodes()[2] - 1;
        self.contact_nodes = (0..mesh.node_count())
            .filter(|&n| mesh.node_coordinates(n)[2] == top)
            .filter_map(|node| {
                let lateral = mesh.rest_position(node) - entry;
                let r0 = lateral.truncate().length();
                (r0 < 1.5 * radius).then_some(ContactNode {
                    node: node as u32,
                    rest_radius: r0,
                    rest_axial: 0.0,
                    pushed: true,
                })
            })
            .collect();
    }

    /// Contact stiffness of the tool [N/m].
    pub fn tool_contact_stiffness(&self) -> f64 {
        match (&self.puncture, self.effects.indentation) {
            (Some(plan), _) => plan.contact_stiffness,
            (None, Some(p)) => self.contact_stiffness(p.stiffness_factor),
            _ => 0.0,
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
        let c = self.mesh.node_coordinates(node);
        let n = self.mesh.nodes();
        let mut fixed = [false; 3];
        for face in Face::ALL {
            let a = face.axis();
            if c[a] == if face.is_max() { n[a] - 1 } else { 0 } {
                for (f, g) in fixed.iter_mut().zip(self.faces()[face as usize].fixed) {
                    *f |= g;
                }
            }
        }
        fixed
    }

    /// True where a face moves by prescription.
    pub fn has_driven_faces(&self) -> bool {
        self.scene.faces.iter().any(|f| f.drive.is_some())
    }

    /// Centre of a face at rest [m].
    pub fn face_centre(&self, face: Face) -> DVec3 {
        let mid = |a: usize| {
            let l = &self.mesh.lines[a];
            0.5 * (l[0] + l[l.len() - 1])
        };
        let mut centre = DVec3::new(mid(0), mid(1), mid(2));
        let lines = &self.mesh.lines[face.axis()];
        centre[face.axis()] = if face.is_max() { lines[lines.len() - 1] } else { lines[0] };
        centre
    }
}

/// Lines on which the tip springs are anchored.
fn tip_anchors(path: &PlannedPath, radius: f64) -> Vec<TipAnchor> {
    let (e1, e2) = lateral_axes(path.direction);
    let ring = |count: usize, r: f64| {
        (0..count).map(move |i| {
            let angle = std::f64::consts::TAU * i as f64 / count as f64;
            (e1 * angle.cos() + e2 * angle.sin()) * r
        })
    };
    let offsets = std::iter::once(DVec3::ZERO).chain(ring(6, 0.5 * radius)).chain(ring(12, radius));
    offsets
        .map(|o| {
            // The line entry + o + t s meets z = 0 at s = -o.z / t.z.
            let axial_offset = -o.z / path.direction.z;
            TipAnchor { surface: path.entry + o + path.direction * axial_offset, axial_offset }
        })
        .collect()
}

/// Cells that lie partly within `radius` of the path, with the volume fraction found from 10^3 sample points.
fn path_cells(mesh: &BlockMesh, path: &PlannedPath, radius: f64, deepest: f64) -> Vec<PathCell> {
    const SAMPLES: usize = 10;
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
                fraction: inside as f64 / SAMPLES.pow(3) as f64,
                axial_start: start,
                axial_end: end,
            })
        })
        .collect()
}

/// Nodal forces of all face tractions at full ramp [N], and the ramp time [s].
fn nodal_loads(scene: &Scene, mesh: &BlockMesh) -> (Vec<DVec3>, f64) {
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
