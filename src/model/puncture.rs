//! What the effect `puncture` prepares: the planned path, its tip forces, tip springs, cells and contact.

use std::collections::HashMap;

use glam::{DVec2, DVec3};

use super::opening::{OpeningInput, OpeningPlan, OpeningStation};
use super::{ContactNode, ContactSurface, FreePlan, LaidPath, Model, tet_puncture};
use crate::anatomy::Case;
use crate::effects::puncture::{Cutting, SchemeWord, left_before_exit};
use crate::effects::viscoelastic::Term;
use crate::effects::{TissueMaterial, puncture};
use crate::mesh::{BlockMesh, Bore};
use crate::mesh::{Mesh, TetLine};
use crate::needle::gap::Profile;
use crate::needle::opening::Growth;
use crate::needle::path_line::PathLine;
use crate::needle::slit::REFERENCE_EDGE;
use crate::needle::tip_contact::{DISC, TipContact};
use crate::needle::{DISC_RINGS, NeedleShape, PlannedPath, Tool, disc_lines, ring_around, tip_lines};
use crate::penetration::surface::Surface;

/// Most stretches of one path.
pub const LARGEST_SEGMENT_COUNT: usize = 16;

/// Number of tip springs of a solid needle on a path without a slit: one on the axis, 6 at R/2, 12 at R.
pub const ANCHOR_COUNT: usize = 19;

/// Most anchors: those of the scheme `opening`.
pub const LARGEST_ANCHOR_COUNT: usize = 1 + 3 * DISC_RINGS * (DISC_RINGS + 1);

/// Rest radius of the hole over that of the needle in a material of unknown toughness: scene files are refused for it, a program that
/// builds its scene is not.
const UNKNOWN_HOLE: f64 = 0.1;

/// Distance of the tip springs of a cutting ring from its edge, on either side [m].
const CUTTING_RING: f64 = 0.2e-3;

/// How far above or below the entry point the skin may lie beside it [m].
const SKIN_REACH: f64 = 3.0e-3;

/// Step along the path in which its materials are told apart [m].
const SEGMENT_STEP: f64 = 2.0e-5;

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
    /// Point where the line enters the surface [m].
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
    /// Rest radius of the hole that the slit of the tip acts like, in the scheme `opening` [m].
    pub hole: f64,
    /// How the tissue around it changes its volume.
    pub growth: Growth,
    /// Speed of shear waves there, with the scaled mass [m/s].
    pub shear_wave_speed: f64,
    /// Shear modulus and p-wave modulus there [Pa]; `None` in what does not deform.
    pub moduli: Option<[f64; 2]>,
}

/// A way through the tissue.
pub(super) struct Way {
    pub segments: Vec<PathSegment>,
    pub anchors: Vec<TipAnchor>,
    pub lines: Vec<TetLine>,
    /// [m]
    pub exit: f64,
    pub cells: Vec<PathCell>,
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
    /// Direction of the needle to which that belongs: a needle that turns swings out of it.
    pub reference: DVec3,
    pub path: PlannedPath,
    pub anchors: Vec<TipAnchor>,
    /// On tetrahedra the lines of the anchors, each counted from its `surface`; empty for a block.
    pub lines: Vec<TetLine>,
    /// Material coordinate at which the path leaves the tissue, through the bottom of a block [m].
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
    /// The scheme that carries the tissue beside the path by points.
    pub opening: Option<OpeningPlan>,
    /// In that scheme the tip on the surface.
    pub contact: Option<TipContact>,
}

impl PuncturePlan {
    /// Contact stiffness per area at the points of a slit, kappa [Pa/m].
    pub fn face_stiffness(&self) -> f64 {
        self.contact_stiffness / REFERENCE_EDGE.powi(2)
    }

    /// Contact stiffness of a node in the ring around the opened path, of full weight where `weight` is 1 [N/m].
    pub fn ring_stiffness(&self, contact: &ContactNode, weight: f64) -> f64 {
        self.ring_stiffness_per_volume * contact.share * weight
    }

    /// Tip force at which a slow tip advances at the coordinate a [N]: the law of the material that it is in, faded before the
    /// bottom.
    pub fn threshold(&self, a: f64) -> f64 {
        let PathSegment { start, cutting, transition_length, .. } = self.segment(a);
        let left = left_before_exit(self.exit - a, self.params.transition_length);
        cutting.threshold(a - start, transition_length) * left
    }

    /// The stretch of the path at the coordinate a [m].
    pub fn segment(&self, a: f64) -> PathSegment {
        self.segments[self.segments.partition_point(|s| s.start <= a).max(1) - 1]
    }
}

impl Model {
    /// Stiffness of a penalty contact at a node of a separated face, `factor (K + 4/3 mu) l^2 / h` with the
    /// reference length l = 0.6 mm [N/m]: a finer mesh penetrates less.
    pub(super) fn contact_stiffness(&self, factor: f64) -> f64 {
        let h = self.scene.tissue.cell_size;
        factor * self.scene.material.law.p_wave_modulus() * REFERENCE_EDGE * REFERENCE_EDGE / h
    }

    /// Contact stiffness of the ring around an opened path per rest volume, `factor (K + 4/3 mu) / l^2`, the same on every
    /// mesh [N/m^4].
    pub(super) fn ring_stiffness_per_volume(&self, factor: f64) -> f64 {
        factor * self.scene.material.law.p_wave_modulus() / (REFERENCE_EDGE * REFERENCE_EDGE)
    }

    pub(super) fn plan_puncture(&mut self) {
        let (Some(params), Some(Tool::Needle(needle))) = (self.effects.puncture, &self.scene.tool) else {
            return;
        };
        let needle = needle.clone();
        let opening = params.scheme == SchemeWord::Opening;
        if self.scene.has_free_path() && !opening {
            self.plan_free_path(params, needle);
            return;
        }
        if self.mesh.as_tets().is_some() {
            self.plan_puncture_of_tets(params, needle);
            return;
        }
        let line = self.path_line();
        let ahead = line.ahead();
        let mut path = PlannedPath::into_block(ahead.origin, ahead.direction);
        // Where the line has turned the front of the tip is across it.
        let has_turned = line.pieces().len() > 1;
        if has_turned {
            path.normal = -ahead.direction;
        }
        // A hand may lead it as deep as there is tissue.
        let deepest = if params.anywhere { f64::INFINITY } else { self.scene.motion.deepest() };
        let Some(mesh) = self.mesh.as_block() else { return };
        let case = self.scene.case.as_deref();
        // Faces that separate need no softened path; the core of a hollow needle is severed cell by cell.
        let cells = match (&self.cohesion, mesh.bore) {
            (Some(_), Some(bore)) => core_cells(mesh, &bore, deepest),
            (Some(_), None) => Vec::new(),
            (None, _) => path_cells(mesh, &path, &params, deepest),
        };
        let exit = match &self.laid {
            Some(_) => (mesh.lines[2][0] - path.entry.z) / path.direction.z,
            None => self.scene.tissue.size.z / -path.direction.z,
        };
        let deepest = deepest.min(exit);
        let surfaces = self.separated_surfaces(&path);
        let anchors = match opening {
            true if has_turned => disc_lines(path.direction, needle.radius)
                .map(|o| TipAnchor { surface: path.entry + o, axial_offset: 0.0 })
                .collect(),
            true => disc_lines(path.direction, needle.radius).map(|o| anchor_beside(&path, o, case)).collect(),
            false => tip_anchors(&path, &needle, self.effects.cohesive.is_some(), case),
        };
        // Tip springs act on the corners of the cell that an anchor is in: one cell beyond the outermost anchor, and a path that is laid beside
        // the fine cells has larger ones.
        let outermost = if opening { DISC * needle.radius } else { needle.radius };
        // On an oblique path the corners of a cell are farther from one another along it than the cell is long.
        let fine = self.scene.tissue.cell_size;
        let ahead = path.front_of(&anchors);
        let is_oblique = path.direction.truncate() != DVec2::ZERO;
        let reach_at = |node: usize| {
            let edges = mesh.edges_around(node);
            let (aside, below) = match edges.max_element() > 1.001 * fine || is_oblique {
                true => (edges.length().max(1.5 * fine), 2.0 * edges.z.max(fine)),
                false => (1.5 * fine, 2.0 * fine),
            };
            (aside, ahead + below.max(path.length_of(edges)))
        };
        let cohesive = self.cohesion.is_some();
        let volumes = self.node_volumes();
        self.contact_nodes = (0..mesh.node_count())
            .filter_map(|node| {
                let (r0, s0) = path.material_coordinates(mesh.rest_position(node));
                let surface = surfaces.get(&(node as u32)).copied().unwrap_or(ContactSurface::OpenedPath);
                let in_ring = params.ring_weight(r0) > 0.0;
                let on_slit = matches!(surface, ContactSurface::Slit { .. });
                let on_face = surface != ContactSurface::OpenedPath;
                // What stands still is not pushed aside, but it carries the tip.
                let stands = self.composition.held.get(node).is_some_and(|held| *held);
                let pushed = !stands && (on_slit || s0 < deepest && if cohesive { on_face } else { in_ring });
                let (aside, below) = reach_at(node);
                let carries = r0 < outermost + aside && s0 < deepest + below;
                let carrier = ContactNode::carrier(node, r0, s0, volumes[node]);
                (pushed || carries).then_some(ContactNode { pushed, surface, ..carrier })
            })
            .collect();
        self.weigh_cut_carriers();
        self.join_slit_faces();
        let segments = self.path_segments(&params, &needle, exit, |depth| self.scene.region_at(line.point(depth)));
        self.puncture =
            Some(self.puncture_plan(params, needle, path, Way { segments, anchors, lines: Vec::new(), exit, cells }));
        if opening {
            let direction = line.piece(0.0).direction;
            self.plan_opening(&line, deepest, direction.truncate().length() / -direction.z);
        }
    }

    /// The plan of a needle on a way through the tissue.
    pub(super) fn puncture_plan(
        &self,
        params: puncture::Params,
        needle: NeedleShape,
        path: PlannedPath,
        way: Way,
    ) -> PuncturePlan {
        let Way { segments, anchors, lines, exit, cells } = way;
        // As the nodes of a face would be damped, each with a half of the masses of its cells.
        let h = self.scene.tissue.cell_size;
        let contact_stiffness = self.contact_stiffness(params.contact_stiffness_factor);
        let reference = if self.laid.is_some() { self.scene.motion.direction } else { path.direction };
        let face_mass = 0.5 * self.scaled_density() * h.powi(3);
        PuncturePlan {
            segments,
            exit,
            anchors,
            lines,
            cells,
            contact_stiffness,
            ring_stiffness_per_volume: self.ring_stiffness_per_volume(params.contact_stiffness_factor),
            face_damping: 2.0 * params.contact_damping * (face_mass / contact_stiffness).sqrt(),
            params,
            profile: Profile::new(&needle, reference),
            reference,
            needle,
            path,
            free: None,
            opening: None,
            contact: None,
        }
    }

    /// Nodes that carry the tip in cells that the skin cuts weigh at least a quarter of what they would in whole cells: the springs of
    /// the tip are those of a whole cell, and beside a sliver of tissue they would ask for steps ten times shorter.
    pub(super) fn weigh_cut_carriers(&mut self) {
        const LEAST_PART: f64 = 0.25;
        if self.composition.fill.is_empty() {
            return;
        }
        let surface = self.path_line().point(SEGMENT_STEP);
        let density = self.scene.material_at(surface).density * self.mass_scaling();
        for contact in &self.contact_nodes {
            let node = contact.node as usize;
            let least = LEAST_PART * density * self.mesh.block().node_volume(node);
            self.node_mass[node] = self.node_mass[node].max(least);
        }
    }

    /// The scheme `opening` on the path along `line`, down to the material coordinate `deepest` [m]; `tilt`: of the path against the surface,
    /// tangent of the angle with its normal.
    pub(super) fn plan_opening(&mut self, line: &PathLine, deepest: f64, tilt: f64) {
        let Some(plan) = &self.puncture else { return };
        let opening = OpeningPlan::new(
            &self.mesh,
            &OpeningInput {
                line,
                needle: &plan.needle,
                deepest,
                exit: plan.exit,
                cell_size: self.scene.tissue.cell_size,
                tilt,
                moduli: &|depth| plan.segment(depth.max(0.0)).moduli,
                own_moduli: [self.scene.material.law.shear_modulus(), self.scene.material.law.p_wave_modulus()],
                node_way: self.speed_limit(1.0),
                hole: &|depth| {
                    let segment = plan.segment(depth.max(0.0));
                    (segment.hole, segment.growth)
                },
            },
        );
        let below = line.point(SEGMENT_STEP);
        let material = self.scene.material_at(below);
        let surface = Surface::new(&material.law, &plan.needle);
        let puncture_force = plan.segments[0].cutting.puncture_force;
        let contact =
            TipContact::new(plan.params.tip_stiffness, puncture_force, surface.most_force(), |f| surface.unresolved(f));
        let plan = self.puncture.as_mut().expect("planned above");
        plan.opening = Some(opening);
        plan.contact = Some(contact);
        plan.cells.clear();
        self.contact_nodes.iter_mut().for_each(|c| c.pushed = false);
    }

    /// The line along which the path is planned or laid.
    pub fn path_line(&self) -> PathLine {
        let straight = || PathLine::straight(self.scene.motion.entry, self.scene.motion.direction);
        self.laid.as_ref().map_or_else(straight, |laid| laid.line.clone())
    }

    /// The same model with its path along another line, where paths are laid.
    pub fn relaid(&self, line: PathLine) -> Model {
        let mut model = self.clone();
        if let Some(LaidPath { line: laid, .. }) = &mut model.laid {
            *laid = line;
            model.plan_puncture();
        }
        model
    }

    /// The tip on the surface, in the scheme `opening`.
    pub fn tip_contact(&self) -> Option<&TipContact> {
        self.puncture.as_ref().and_then(|plan| plan.contact.as_ref())
    }

    /// The scheme `opening`, where the scene has it.
    pub fn opening(&self) -> Option<&OpeningPlan> {
        self.puncture.as_ref().and_then(|plan| plan.opening.as_ref())
    }

    /// Sections of an opened path that relax: all of them, or none.
    pub fn relaxing_stations(&self) -> usize {
        self.opening().filter(|_| self.effects.viscoelastic.is_some()).map_or(0, |opening| opening.stations.len())
    }

    /// Prony terms of the tissue in which a station lies.
    pub fn terms_at(&self, station: &OpeningStation) -> &[Term] {
        let cell = match &self.mesh {
            Mesh::Block(block) => {
                let ([i, j, k], _) = block.locate(station.middle);
                block.cell_index(i, j, k)
            }
            Mesh::Tets(tets) => match tets.locate(station.middle) {
                Some((cell, _)) => cell,
                None => return &[],
            },
        };
        let material = self.material(cell);
        material.viscoelastic.as_ref().map_or(&[], |series| series.terms.as_slice())
    }

    /// Largest part of the tip springs that one node can carry: where the anchors are in the first cells of the path.
    pub fn largest_spring_share(&self) -> f64 {
        let Some(plan) = &self.puncture else { return 0.0 };
        let mesh = match &self.mesh {
            Mesh::Block(block) => block,
            Mesh::Tets(_) => return tet_puncture::largest_spring_share(plan, self.scene.tissue.cell_size),
        };
        let anchors = match plan.anchors.is_empty() {
            true => tip_anchors(&plan.path, &plan.needle, false, None),
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
}

impl Model {
    /// Stretches of the path with their own tip forces, from the materials that its axis passes through on its way to where
    /// it leaves the tissue at `exit` [m]. `region_at`: the region at a depth along the axis [m].
    pub(super) fn path_segments(
        &self,
        params: &puncture::Params,
        needle: &NeedleShape,
        exit: f64,
        region_at: impl Fn(f64) -> Option<usize>,
    ) -> Vec<PathSegment> {
        let mut starts: Vec<(f64, Option<usize>)> = Vec::new();
        for i in 0..(exit / SEGMENT_STEP).ceil().max(1.0) as usize {
            // The surface itself belongs to what lies under it.
            let a = i as f64 * SEGMENT_STEP;
            let region = region_at(a + 0.5 * SEGMENT_STEP);
            if starts.last().is_none_or(|(_, last)| *last != region) {
                starts.push((a, region));
            }
        }
        let ends = starts.iter().skip(1).map(|s| s.0).chain([exit]);
        let material = |region: Option<usize>| region.map_or(&self.scene.material, |r| &self.scene.regions[r].material);
        let mut segments = Vec::new();
        for (&(start, region), end) in starts.iter().zip(ends) {
            segments.extend(self.segments_of(material(region), (params, needle), (start, end)));
        }
        segments.truncate(LARGEST_SEGMENT_COUNT);
        segments
    }

    /// The stretch of the path from `start` to `end` [m] in one material: two where a membrane lies on a surface that takes more by itself.
    fn segments_of(
        &self,
        material: &TissueMaterial,
        (params, needle): (&puncture::Params, &NeedleShape),
        (start, end): (f64, f64),
    ) -> Vec<PathSegment> {
        let own = Cutting { puncture_force: params.puncture_force, cutting_force: params.cutting_force };
        let mut segment = PathSegment {
            start,
            cutting: material.cutting.unwrap_or(own),
            transition_length: params.transition_length,
            membrane: material.membrane_energy.is_some(),
            hole: UNKNOWN_HOLE * needle.radius,
            growth: Growth::default(),
            shear_wave_speed: (material.law.shear_modulus() / (material.density * self.mass_scaling())).sqrt(),
            moduli: (!material.rigid).then(|| [material.law.shear_modulus(), material.law.p_wave_modulus()]),
        };
        let opening = params.scheme == SchemeWord::Opening;
        let steady = opening.then(|| material.opened(needle)).flatten().and_then(Result::ok);
        if let Some(steady) = &steady {
            segment.cutting = params.opening_cutting(material.cutting, steady);
            // An inner layer meets a crack that is there already and runs on: it is cut, not punctured.
            if start > 0.0 && material.cutting.is_none() && !params.puncture_stated {
                segment.cutting.puncture_force = segment.cutting.cutting_force;
            }
            segment.hole = steady.hole_radius;
            segment.growth = steady.growth(&material.law).unwrap_or_default();
            // The crack forms over its own length, which is not finer than the tip advances.
            segment.transition_length = steady.crack_half_length.max(puncture::LARGEST_ADVANCE);
        }
        let Some(energy) = material.membrane_energy else { return vec![segment] };
        let length = params.transition_length.min(end - start);
        let bare = PathSegment { transition_length: length, ..segment };
        let with_membrane = PathSegment { cutting: segment.cutting.of_membrane(energy, length), ..bare };
        let Cutting { puncture_force, cutting_force } = segment.cutting;
        if steady.is_none() || start > 0.0 || segment.transition_length >= length || puncture_force <= cutting_force {
            return vec![with_membrane];
        }
        // The surface falls over the length of its crack from what it takes without the membrane, which adds what is left of its own fall.
        let beyond = |way: f64| with_membrane.cutting.threshold(way, length) - cutting_force;
        let after = cutting_force + beyond(segment.transition_length);
        let first = Cutting { puncture_force: puncture_force + beyond(0.0), cutting_force: after };
        let rest = Cutting { puncture_force: after, cutting_force };
        let split = segment.transition_length;
        vec![
            PathSegment { cutting: first, ..segment },
            PathSegment { start: start + split, cutting: rest, transition_length: length - split, ..segment },
        ]
    }
}

/// Lines on which the tip springs are anchored: one on the axis, 6 at R/2, 12 at R. Before a slit none lies on its plane,
/// where it would pull at one side; a cutting ring has 12 on either side of its edge.
fn tip_anchors(path: &PlannedPath, needle: &NeedleShape, cohesive: bool, case: Option<&Case>) -> Vec<TipAnchor> {
    let turn = if cohesive { std::f64::consts::TAU / 24.0 } else { 0.0 };
    let ring = |radius: f64| ring_around(path.direction, 12, radius, turn);
    let offsets: Vec<DVec3> = match needle.bore.filter(|_| cohesive) {
        Some(bore) => ring(bore.edge - CUTTING_RING).chain(ring(bore.edge + CUTTING_RING)).collect(),
        None => tip_lines(path.direction, needle.radius, turn, !cohesive),
    };
    offsets.into_iter().map(|o| anchor_beside(path, o, case)).collect()
}

impl PlannedPath {
    /// How far the lines of anchors begin from the front of the path at most, in its coordinate s0 [m]: skin is no plane.
    pub(crate) fn front_of(&self, anchors: &[TipAnchor]) -> f64 {
        anchors.iter().map(|anchor| self.material_coordinates(anchor.surface).1.abs()).fold(0.0, f64::max)
    }

    /// Largest difference of s0 between two corners of a cell with these edges [m].
    pub(crate) fn length_of(&self, edges: DVec3) -> f64 {
        edges.dot(self.normal.abs()) / self.direction.dot(self.normal).abs()
    }
}

/// The anchor whose line runs at `offset` [m] from the path.
fn anchor_beside(path: &PlannedPath, offset: DVec3, case: Option<&Case>) -> TipAnchor {
    let axial_offset = match case {
        // Where the line meets the skin.
        Some(case) => case.surface_along(path.entry + offset, path.direction, SKIN_REACH).unwrap_or(0.0),
        None => path.entry_beside(offset),
    };
    TipAnchor { surface: path.entry + offset + path.direction * axial_offset, axial_offset }
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
