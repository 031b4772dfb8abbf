//! The CPU engine: f64, rayon, written from the equations. Reference for the tests and fallback without an adapter.

mod added;
mod cohesive_forces;
mod free_tip;
mod indenter_contact;
mod integrate_nodes;
mod lanes;
mod needle_contact;
mod needle_touch;
mod opening;
mod path_reactions;
mod slit_contact;
mod team;
mod tip;

use std::sync::Arc;

use added::Added;
use glam::{DMat3, DVec3};
use lanes::LaneCells;
pub use lanes::unknown_to_lanes;
use needle_contact::{NearNodes, NodeLoads};
use opening::OpenPath;
use rayon::prelude::*;

use crate::effects::adhesion::Bond;
use crate::effects::viscoelastic::SectionRelaxation;
use crate::engine::elements::{CellForces, CellInput, CellMeasure, CellStates, Elements, Grown};
use crate::engine::{
    ContactState, Engine, EngineImage, EngineInfo, FrameEnergies, FramePlan, FrameSums, LARGEST_DISPLACEMENT, State,
    StepInput, foreign_image,
};
use crate::error::{Error, Result};
use crate::material_point::{PointState, Volumetric};
use crate::model::Model;
use crate::needle::ToolPose;
use crate::needle::centre_line::CentreLine;
use crate::needle::tip_contact::Touch;
use crate::scene::Face;

/// Sums of one contact node over one step.
#[derive(Debug, Clone, Copy, Default)]
struct ContactSums {
    /// Forces on the tissue [N].
    tip: DVec3,
    normal: DVec3,
    friction: DVec3,
    /// The part of the normal force on the shaft of a needle [N].
    on_shaft: DVec3,
    /// Torque about the tip [N m].
    torque: DVec3,
    /// Dissipated by friction and by contact damping [J].
    friction_work: f64,
    damping: f64,
    stored: f64,
    /// Held by the springs of a contact that has ended [J].
    released: f64,
}

/// The f64 engine.
pub struct CpuEngine {
    model: Arc<Model>,
    elements: Elements,
    dt: f64,
    /// Largest nodal speed [m/s] and centres of the faces at rest [m], which look at all of a mesh of tetrahedra.
    speed_limit: f64,
    face_centres: [DVec3; 6],
    /// Rest positions of the nodes [m], and the columns of the tip's anchors, which a bent grid works out with much ado.
    rest: Vec<DVec3>,
    anchor_columns: Arc<[tip::Column]>,
    info: EngineInfo,
    state: State,
    /// True where lanes were asked for; cells in lanes; without them they are in `cells`.
    wants_lanes: bool,
    lanes: Option<LaneCells>,
    cells: Vec<CellForces>,
    /// Beside what the cells exert.
    added: Added,
    tip_forces: Vec<(f64, [usize; 8], [f64; 8])>,
    tip_energy: f64,
    /// Force across the needle on every anchor of a free tip [N].
    tip_sway: DVec3,
    contact_energy: f64,
    /// Contact nodes of a free path that are looked at.
    near: Option<NearNodes>,
    tip_loads: NodeLoads,
    /// In the scheme `opening`: how far the tip advanced in this step, and how far the dimple shifted the path with it [m].
    advanced: [f64; 2],
    /// True in the last step of a frame, at which energies are told.
    measures: bool,
    /// Elastic energy that the scheme `opening` added in the last step [J].
    opening_elastic: f64,
    /// Tetrahedra that grow beside an opened path, and the averaged volumetric answer of all of them in f64, in the last step; in lanes in the last
    /// step of a frame.
    grown: Vec<Grown>,
    averaged: Vec<Volumetric>,
    /// What the points have dissipated and earlier frames have told.
    booked: FrameEnergies,
    /// Centre-line of a flexible needle in the frame under way.
    centre_line: Option<CentreLine>,
    /// Impulse of that frame on each contact node [N s]; used with a centre-line only.
    node_impulse: Vec<DVec3>,
    finished: std::collections::VecDeque<FrameSums>,
    sums: FrameSums,
}

impl CpuEngine {
    /// The state of a model at rest.
    pub fn new_state(model: &Model) -> State {
        let (nodes, cells) = (model.mesh.node_count(), model.mesh.cell_count());
        State {
            displacement: vec![DVec3::ZERO; nodes],
            velocity: vec![DVec3::ZERO; nodes],
            inertia: vec![1.0; nodes],
            stiffness: if model.puncture.is_some() { vec![1.0; cells] } else { Vec::new() },
            tip_coordinate: 0.0,
            tip: model.free_tip(),
            cut_samples: vec![0; model.puncture.as_ref().and_then(|p| p.free.as_ref()).map_or(0, |f| f.cell_count())],
            bond: Bond::default(),
            contact: vec![ContactState::default(); model.contact_nodes.len()],
            stations: vec![0.0; model.opening().map_or(0, |o| o.stations.len())],
            relaxation: vec![SectionRelaxation::default(); model.relaxing_stations()],
            opening_resistance: 0.0,
            opening_spreading: 0.0,
            opening_stiffness: 0.0,
            touch: Touch::default(),
            pairs: vec![0.0; model.separation.pairs.len()],
            points: if model.has_history() { vec![PointState::default(); cells] } else { Vec::new() },
        }
    }

    /// A model at rest in f64, advanced with steps of `dt` [s]: the reference.
    pub fn new(model: Arc<Model>, dt: f64) -> Self {
        Self::with(model, dt, false)
    }

    /// The same with cells in lanes of f32, as far as these know the model; what they do not know is in f64.
    pub fn in_lanes(model: Arc<Model>, dt: f64) -> Self {
        Self::with(model, dt, true)
    }

    fn with(model: Arc<Model>, dt: f64, wants_lanes: bool) -> Self {
        let (nodes, cells) = (model.mesh.node_count(), model.mesh.cell_count());
        let state = Self::new_state(&model);
        let elements = Elements::new(&model);
        let lanes = if wants_lanes { LaneCells::new(&model, &elements) } else { Err(String::new()) };
        let arithmetic = match &lanes {
            Ok(_) => format!("cells in {} lanes of f32", lanes::width()),
            Err(unknown) if unknown.is_empty() => "f64".into(),
            Err(unknown) => format!("f64: lanes do not know {unknown}"),
        };
        let lanes = lanes.ok();
        let bytes = nodes * (4 * size_of::<DVec3>() + 8)
            + lanes.as_ref().map_or(cells * size_of::<CellForces>(), LaneCells::bytes)
            + state.stiffness.len() * 8
            + state.points.len() * (size_of::<PointState>() + model.prony_term_count() * size_of::<DMat3>())
            + state.contact.len() * (size_of::<ContactState>() + size_of::<ContactSums>());
        CpuEngine {
            wants_lanes,
            dt,
            speed_limit: model.speed_limit(dt),
            face_centres: Face::ALL.map(|face| model.face_centre(face)),
            rest: (0..nodes).map(|node| model.mesh.rest_position(node)).collect(),
            anchor_columns: tip::anchor_columns(&model),
            info: EngineInfo {
                engine: if wants_lanes { "cpu" } else { "cpu64" }.into(),
                adapter: format!("{} CPU threads, {arithmetic}", rayon::current_num_threads()),
                driver: format!("stylet {}", env!("CARGO_PKG_VERSION")),
                device_bytes: bytes as u64,
                software: true,
            },
            state,
            cells: if lanes.is_some() { Vec::new() } else { vec![CellForces::default(); cells] },
            lanes,
            elements,
            added: Added::new(nodes).with_constant(path_reactions::stick_bounds(&model).into_iter()),
            tip_forces: Vec::new(),
            tip_energy: 0.0,
            tip_sway: DVec3::ZERO,
            contact_energy: 0.0,
            near: NearNodes::of(&model),
            tip_loads: NodeLoads::default(),
            advanced: [0.0; 2],
            measures: false,
            opening_elastic: 0.0,
            grown: Vec::new(),
            averaged: Vec::new(),
            booked: FrameEnergies::default(),
            centre_line: None,
            node_impulse: vec![DVec3::ZERO; model.contact_nodes.len()],
            finished: Default::default(),
            sums: FrameSums::default(),
            model,
        }
    }

    /// What it computes.
    pub(crate) fn model(&self) -> &Arc<Model> {
        &self.model
    }

    /// The state at the end of the last frame.
    pub fn state(&self) -> &State {
        &self.state
    }

    /// Force [N] and stiffness bound [N/m] of every node at the present state, as a step with this input would find them; tied
    /// copies have those of all of them. Nothing changes: a look at one step, for tests and bisecting.
    pub fn forces_and_bounds(&mut self, input: &StepInput) -> (Vec<DVec3>, Vec<f64>) {
        let kept = (self.state.clone(), self.sums.clone());
        self.bring_to_lanes();
        self.forces(input);
        let nodes = 0..self.model.mesh.node_count();
        let at = |node: usize| {
            let ((force, bound), added) = (self.gather(node), self.added.at(node));
            (force + added.0, bound + added.1)
        };
        let (mut forces, mut bounds): (Vec<DVec3>, Vec<f64>) = nodes.map(at).unzip();
        for tie in &self.model.separation.ties {
            let copies = || tie.iter().map(|n| *n as usize);
            let sum = (copies().map(|n| forces[n]).sum::<DVec3>(), copies().map(|n| bounds[n]).sum::<f64>());
            copies().for_each(|n| (forces[n], bounds[n]) = sum);
        }
        (self.state, self.sums) = kept;
        self.look_at_all();
        (forces, bounds)
    }

    /// Gives the lanes the state that a frame begins with.
    fn bring_to_lanes(&mut self) {
        if let Some(lanes) = &mut self.lanes {
            lanes.take(&self.state.displacement);
            lanes.take_points(&self.state.points);
        }
    }

    /// The state is another one: what the contact knew of its nodes means nothing.
    fn look_at_all(&mut self) {
        if let Some(near) = &mut self.near {
            near.is_stale = true;
        }
    }

    /// All stages but the last: forces and stiffness bounds.
    fn forces(&mut self, input: &StepInput) {
        let model = self.model.clone();
        self.added.clear();
        if let (Some(plan), Some(pose)) = (&model.puncture, input.pose) {
            match &plan.free {
                None => {
                    self.advance_tip(plan, &pose);
                    self.soften_path(plan);
                }
                Some(free) => {
                    self.advance_free_tip(plan, free, &pose);
                    self.soften_free_path(plan, free);
                }
            }
        }
        let opened = match (&model.puncture, input.pose) {
            (Some(plan), Some(pose)) => self.open_path(plan, &pose, input.step),
            _ => None,
        };
        self.element_forces(input, opened.as_ref());
        self.cohesive_forces();
        if let (Some(plan), Some(pose)) = (&model.puncture, input.pose) {
            self.needle_contact(plan, &pose, input.step);
            if let (Some(opening), Some(opened)) = (&plan.opening, opened) {
                self.opening(opening, &pose, &opened);
            }
        }
        if let (Some(_), Some(pose)) = (model.effects.indentation, input.pose) {
            self.indenter_contact(&pose);
        }
    }

    /// Force of the cells on a node (-f_int) [N] and its stiffness bound [N/m].
    fn gather(&self, node: usize) -> (DVec3, f64) {
        match &self.lanes {
            Some(lanes) => lanes.at(node),
            None => self.elements.gather(&self.model.mesh, &self.cells, node),
        }
    }

    /// Calls `work` with `0..count` on all threads; results in that order.
    fn each<R: Send>(&self, count: usize, work: impl Fn(usize) -> R + Sync + Send) -> Vec<R> {
        match &self.lanes {
            Some(lanes) => lanes.team().each(count, work),
            None => (0..count).into_par_iter().map(work).collect(),
        }
    }

    /// Puts what `work` makes of every index in its place, on all threads.
    fn fill<R: Send>(&self, all: &mut [R], work: impl Fn(usize) -> R + Sync + Send) {
        match &self.lanes {
            Some(lanes) => lanes.team().fill(all, work),
            None => all.par_iter_mut().enumerate().for_each(|(i, value)| *value = work(i)),
        }
    }

    /// Calls `work` with ranges that make up `0..count`, on all threads; results in their order.
    fn in_ranges<R: Send>(&self, count: usize, work: impl Fn(std::ops::Range<usize>) -> R + Sync + Send) -> Vec<R> {
        let ranges = |part: usize| (0..count).step_by(part).map(move |first| first..(first + part).min(count));
        match &self.lanes {
            Some(lanes) => {
                let team = lanes.team();
                team.map(ranges(team.part(count)), |_, range| work(range))
            }
            None => ranges(2048).collect::<Vec<_>>().into_par_iter().map(work).collect(),
        }
    }

    /// Adds to the forces of a cell (with the sign of f_int) and to its bounds.
    fn add_to_cell(&mut self, cell: usize, added: &CellForces) {
        match &mut self.lanes {
            Some(lanes) => lanes.add(&self.model.mesh.cell_nodes(cell), added),
            None => {
                let cell = &mut self.cells[cell];
                for i in 0..8 {
                    cell.force[i] += added.force[i];
                    cell.bound[i] += added.bound[i];
                }
            }
        }
    }

    /// Stage `element_forces`; tetrahedra get their averaged pressure first.
    fn element_forces(&mut self, input: &StepInput, opened: Option<&OpenPath>) {
        if let Some(lanes) = &mut self.lanes {
            let State { displacement, stiffness, .. } = &self.state;
            // An opened path softens nothing: to look at every cell for that is as long as a stage.
            let stiffness = if self.model.opening().is_some() { &[] } else { stiffness.as_slice() };
            let advance = Some((self.dt, input.step));
            let opened = opened.map(OpenPath::opened);
            lanes.compute(&self.model, &self.elements, (displacement, opened), stiffness, advance);
            return;
        }
        let (model, elements, dt) = (&self.model, &self.elements, self.dt);
        let State { displacement, stiffness, points, .. } = &mut self.state;
        let states = CellStates { points, stiffness };
        self.averaged = elements.averaged_volumetrics(model, displacement, states, &self.grown).unwrap_or_default();
        let averaged = &self.averaged;
        let forces = |cell: usize, point: Option<&mut PointState>| {
            let remaining = stiffness.get(cell).copied().unwrap_or(1.0);
            let averaged = averaged.get(cell).copied();
            let input = CellInput { averaged, remaining, point, advance: Some((dt, input.step)) };
            elements.corner_forces(model, cell, displacement, input)
        };
        if points.is_empty() {
            self.cells.par_iter_mut().with_min_len(256).enumerate().for_each(|(cell, out)| *out = forces(cell, None).0);
            return;
        }
        let failures: u32 = self
            .cells
            .par_iter_mut()
            .zip(points.par_iter_mut())
            .with_min_len(64)
            .enumerate()
            .map(|(cell, (out, point))| {
                let (forces, met) = forces(cell, Some(point));
                *out = forces;
                u32::from(!met)
            })
            .sum();
        self.sums.health.return_failures += failures;
    }

    /// What the points keep as totals since t = 0.
    fn dissipated(&self) -> FrameEnergies {
        let mut total = FrameEnergies::default();
        for (cell, p) in self.state.points.iter().enumerate() {
            let v = self.model.mesh.cell_volume(cell);
            total.plastic += v * p.plastic_dissipation;
            total.damage += v * p.damage_dissipation;
        }
        total
    }

    /// Takes what effects of the program's own supplied in this frame out of the points.
    fn take_own_supply(&mut self) {
        for (cell, point) in self.state.points.iter_mut().enumerate() {
            let volume = self.model.mesh.cell_volume(cell);
            for (sum, own) in self.sums.energy.own.iter_mut().zip(&mut point.own) {
                *sum += volume * std::mem::take(&mut own.supplied);
            }
        }
    }

    /// Stages `measure_cells`, `measure_contact`, `measure_faces`, `measure_separation`: stored energies and health, between the forces of
    /// the last step and its motion.
    fn measure_stored(&mut self) {
        if let Some(lanes) = &mut self.lanes {
            self.sums.health.return_failures += lanes.give_points(&mut self.state.points);
        }
        let (model, elements, state) = (&self.model, &self.elements, &self.state);
        let states = CellStates { points: &state.points, stiffness: &state.stiffness };
        let in_f64 = || -> Vec<CellMeasure> {
            let averaged = elements.averaged_volumetrics(model, &state.displacement, states, &self.grown);
            let of = |cell: usize| averaged.as_ref().map(|a| a[cell]);
            let measure = |cell: usize| elements.measure(model, cell, &state.displacement, of(cell), states);
            (0..model.mesh.cell_count()).into_par_iter().map(measure).collect()
        };
        let in_lanes = |lanes: &mut LaneCells| lanes.measure(model, elements, &state.displacement, states);
        let measures = self.lanes.as_mut().and_then(in_lanes).unwrap_or_else(in_f64);
        let dissipated = self.dissipated();
        let sums = &mut self.sums;
        let mut energies = [0.0; 3];
        let health = &mut sums.health;
        (health.min_j, health.min_corner_j) = (f64::INFINITY, f64::INFINITY);
        for (cell, m) in measures.iter().enumerate() {
            for (sum, value) in energies.iter_mut().zip([m.elastic, m.hourglass, m.viscous]) {
                *sum += value;
            }
            health.largest_damage = health.largest_damage.max(m.damage);
            // What deletion has taken out may be turned inside out.
            if m.damage >= 1.0 || state.stiffness.get(cell) == Some(&0.0) {
                health.deleted_cells += 1;
                continue;
            }
            health.min_j = health.min_j.min(m.jacobian);
            health.min_corner_j = health.min_corner_j.min(m.corner_jacobian);
            if m.jacobian <= 0.0 || m.corner_jacobian <= 0.0 {
                health.inverted_cells += 1;
                health.folded_cells += u32::from(m.jacobian > 0.0);
                health.inverted_cell.get_or_insert(cell as u32);
            }
        }
        // Beside what cells hold of a path of no width.
        sums.energy.elastic = energies[0] + self.opening_elastic;
        let beside_path: f64 = state.relaxation.iter().map(|r| r.dissipated).sum();
        (sums.energy.hourglass, sums.energy.viscous) = (energies[1], energies[2] + beside_path);
        sums.energy += dissipated - self.booked;
        self.booked = dissipated;
        self.take_own_supply();
        let (model, elements, state, sums) = (&self.model, &self.elements, &self.state, &mut self.sums);
        if model.has_driven_faces() {
            let forces: Vec<DVec3> = match &self.lanes {
                Some(lanes) => (0..model.mesh.node_count()).map(|n| -lanes.at(n).0).collect(),
                None => elements.nodal_forces(&model.mesh, &self.cells),
            };
            sums.reactions = face_reactions(model, &forces);
            sums.face_moments = face_moments(model, &forces, &self.state.displacement);
        }
        let torn = state.pairs.iter().zip(&model.separation.pairs).map(|(d, p)| d * p.area);
        sums.health.torn_area = torn.sum();
        sums.energy.contact_stored = self.contact_energy;
        sums.tip_coordinate = state.tip_coordinate;
    }

    /// Stage `measure_nodes`: velocities of the middle of the last step, and what its forces make of the stored energies until then:
    /// E - dt/2 f v by the trapezoidal rule.
    fn measure_nodes(&mut self) {
        let (model, state) = (&self.model, &self.state);
        let force = |node: usize| self.gather(node).0 + self.added.at(node).0;
        let power = state.velocity.iter().enumerate().map(|(node, v)| force(node).dot(*v)).sum::<f64>();
        let sums = &mut self.sums;
        if sums.steps > 0 {
            sums.energy.half_step -= 0.5 * self.dt * power;
        }
        sums.energy.kinetic =
            state.velocity.iter().zip(&model.node_mass).map(|(v, m)| 0.5 * m * v.length_squared()).sum();
        sums.health.max_speed = state.velocity.iter().map(|v| v.length()).fold(0.0, f64::max);
        let far = |u: &DVec3| u.abs().max_element() > LARGEST_DISPLACEMENT;
        sums.health.not_finite = !state.displacement.iter().chain(&state.velocity).all(|v| v.is_finite())
            || state.displacement.iter().any(far);
        sums.targets = model.targets.iter().map(|target| target.value(&state.displacement)).collect();
    }
}

impl FrameSums {
    fn book(&mut self, c: &ContactSums, pose: &ToolPose, dt: f64) {
        let total = c.tip + c.normal + c.friction;
        self.cutting_impulse += c.tip.dot(pose.direction) * dt;
        self.spreading_impulse += c.normal.dot(pose.direction) * dt;
        self.shaft_impulse += c.on_shaft.dot(pose.direction) * dt;
        self.friction_impulse += c.friction.dot(pose.direction) * dt;
        self.impulse += total * dt;
        self.angular_impulse += c.torque * dt;
        self.tool_work += (total.dot(pose.velocity) + c.torque.dot(pose.angular_velocity)) * dt;
        self.last_tool_work += (total.dot(pose.velocity_ahead) + c.torque.dot(pose.angular_velocity_ahead)) * dt;
        self.energy.friction += c.friction_work;
        self.energy.contact_damping += c.damping + c.released;
    }
}

/// What each face exerts on the tissue to hold or move its nodes, without inertia and loads [N].
pub fn face_reactions(model: &Model, internal_force: &[DVec3]) -> [DVec3; 6] {
    let mut reactions = [DVec3::ZERO; 6];
    for (node, force) in internal_force.iter().enumerate() {
        for face in Face::ALL {
            if model.lies_on(node, face) {
                reactions[face as usize] += *force;
            }
        }
    }
    reactions
}

/// Moment of the same about the axis along the normal of each face through the centre of the tissue at rest [N m].
pub fn face_moments(model: &Model, internal_force: &[DVec3], displacement: &[DVec3]) -> [f64; 6] {
    let centres = Face::ALL.map(|face| model.face_centre(face));
    let mut moments = [0.0; 6];
    for (node, (force, u)) in internal_force.iter().zip(displacement).enumerate() {
        for face in Face::ALL {
            if model.lies_on(node, face) {
                let arm = model.mesh.rest_position(node) + *u - centres[face as usize];
                moments[face as usize] += arm.cross(*force)[face.axis()];
            }
        }
    }
    moments
}

impl Engine for CpuEngine {
    fn info(&self) -> &EngineInfo {
        &self.info
    }

    fn start_frame(&mut self, plan: &FramePlan) -> Result<()> {
        self.sums = FrameSums { frame: plan.frame, steps: plan.steps.len() as u32, ..Default::default() };
        self.centre_line = plan.centre_line;
        self.bring_to_lanes();
        for (index, input) in plan.steps.iter().enumerate() {
            if crate::ending::is_overdue() {
                return Err(Error::Ended(crate::ending::reason()));
            }
            self.sums.last_tool_work = 0.0;
            self.measures = index + 1 == plan.steps.len();
            self.forces(input);
            if index + 1 == plan.steps.len() {
                // What the tool does until the middle of the last step, with the speed that it has then, goes into the springs of contact.
                self.sums.energy.half_step = 0.5 * self.sums.last_tool_work;
                self.measure_stored();
                if let Some(pose) = &input.pose {
                    self.share_needle_loads(pose);
                }
            }
            self.integrate_nodes(input);
        }
        if plan.steps.is_empty() {
            self.measure_stored();
        }
        self.measure_nodes();
        self.finished.push_back(std::mem::take(&mut self.sums));
        Ok(())
    }

    fn collect(&mut self, _wait: bool) -> Result<Option<FrameSums>> {
        Ok(self.finished.pop_front())
    }

    fn retune(&mut self, model: Arc<Model>, dt: f64, _steps: usize) -> Result<bool> {
        if !Self::new_state(&model).fits(&self.state) {
            return Ok(false);
        }
        let mut next = CpuEngine::with(model, dt, self.wants_lanes);
        std::mem::swap(&mut next.state, &mut self.state);
        std::mem::swap(&mut next.finished, &mut self.finished);
        (next.booked, next.tip_energy, next.contact_energy) = (self.booked, self.tip_energy, self.contact_energy);
        *self = next;
        Ok(true)
    }

    fn read_state(&mut self) -> Result<State> {
        Ok(self.state.clone())
    }

    fn write_state(&mut self, state: &State) -> Result<()> {
        if state.displacement.len() != self.state.displacement.len() {
            return Err(Error::Device("state of another mesh".into()));
        }
        self.state = state.clone();
        self.look_at_all();
        self.booked = self.dissipated();
        Ok(())
    }

    fn save(&mut self) -> Result<EngineImage> {
        let (state, lanes) = (Box::new(self.state.clone()), self.wants_lanes);
        Ok(EngineImage::Cpu { state, booked: self.booked, lanes })
    }

    fn restore(&mut self, image: &EngineImage) -> Result<()> {
        match image {
            EngineImage::Cpu { state, booked, lanes } if *lanes == self.wants_lanes && state.fits(&self.state) => {
                self.state = State::clone(state);
                self.look_at_all();
                self.booked = *booked;
                self.finished.clear();
                Ok(())
            }
            _ => Err(foreign_image(&self.info.engine, image)),
        }
    }

    fn internal_forces(&mut self) -> Result<Vec<DVec3>> {
        self.bring_to_lanes();
        if let Some(lanes) = &mut self.lanes {
            let state = &self.state;
            lanes.compute(&self.model, &self.elements, (&state.displacement, None), &state.stiffness, None);
            return Ok((0..self.model.mesh.node_count()).map(|node| -lanes.at(node).0).collect());
        }
        let states = CellStates { points: &self.state.points, stiffness: &self.state.stiffness };
        Ok(self.elements.internal_forces(&self.model, &self.state.displacement, states))
    }
}
