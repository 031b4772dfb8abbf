//! The CPU engine: f64, rayon, written from the equations. Reference for the tests and fallback without an adapter.

use std::sync::Arc;

use glam::{DMat3, DVec3};
use rayon::prelude::*;

use super::elements::{CORNERS, CellForces, CellInput, CellMeasure, CellStates, Elements};
use super::engine::{ContactState, Engine, EngineInfo, FramePlan, FrameSums, State, StepInput};
use crate::error::{Error, Result};
use crate::material_point::PointState;
use crate::mesh::BlockMesh;
use crate::model::{Model, PuncturePlan};
use crate::needle::ToolPose;
use crate::scene::{Face, Tool};

/// Sums of one contact node over one step.
#[derive(Debug, Clone, Copy, Default)]
struct ContactSums {
    /// Forces on the tissue [N].
    tip: DVec3,
    normal: DVec3,
    friction: DVec3,
    /// Torque about the tip [N m].
    torque: DVec3,
    friction_work: f64,
    damping_power: f64,
    stored: f64,
}

/// The f64 engine.
pub struct CpuEngine {
    model: Arc<Model>,
    elements: Elements,
    dt: f64,
    info: EngineInfo,
    state: State,
    cells: Vec<CellForces>,
    external: Vec<DVec3>,
    tip_forces: Vec<(f64, [usize; 8], [f64; 8])>,
    tip_energy: f64,
    contact_energy: f64,
    /// Plastic and damage dissipation that earlier frames have told [J].
    booked: (f64, f64),
    finished: std::collections::VecDeque<FrameSums>,
    sums: FrameSums,
}

impl CpuEngine {
    /// A model at rest, advanced with steps of `dt` [s].
    pub fn new(model: Arc<Model>, dt: f64) -> Self {
        let nodes = model.mesh.node_count();
        let cells = model.mesh.cell_count();
        let state = State {
            displacement: vec![DVec3::ZERO; nodes],
            velocity: vec![DVec3::ZERO; nodes],
            stiffness: if model.puncture.is_some() { vec![1.0; cells] } else { Vec::new() },
            tip_coordinate: 0.0,
            contact: vec![ContactState::default(); model.contact_nodes.len()],
            points: if model.has_history() { vec![PointState::default(); cells] } else { Vec::new() },
        };
        let bytes = nodes * (3 * size_of::<DVec3>() + 8)
            + cells * size_of::<CellForces>()
            + state.stiffness.len() * 8
            + state.points.len() * (size_of::<PointState>() + model.prony_term_count() * size_of::<DMat3>())
            + state.contact.len() * (size_of::<ContactState>() + size_of::<ContactSums>());
        CpuEngine {
            elements: Elements::new(&model),
            dt,
            info: EngineInfo {
                engine: "cpu".into(),
                adapter: format!("{} CPU threads, f64", rayon::current_num_threads()),
                driver: format!("stylet {}", env!("CARGO_PKG_VERSION")),
                device_bytes: bytes as u64,
                software: true,
            },
            state,
            cells: vec![CellForces::default(); cells],
            external: vec![DVec3::ZERO; nodes],
            tip_forces: Vec::new(),
            tip_energy: 0.0,
            contact_energy: 0.0,
            booked: (0.0, 0.0),
            finished: Default::default(),
            sums: FrameSums::default(),
            model,
        }
    }

    /// One step: the list of stages.
    fn step(&mut self, input: &StepInput) {
        let model = self.model.clone();
        self.external.fill(DVec3::ZERO);
        if let (Some(plan), Some(pose)) = (&model.puncture, input.pose) {
            self.advance_tip(plan, &pose);
            self.soften_path(plan);
        }
        self.element_forces(input);
        if let (Some(plan), Some(pose)) = (&model.puncture, input.pose) {
            self.needle_contact(plan, &pose);
        }
        if let (Some(_), Some(pose)) = (model.effects.indentation, input.pose) {
            self.indenter_contact(&pose);
        }
        self.integrate_nodes(input);
    }

    /// Trilinear position in the mesh: nodes, weights and derivative of the weights along `direction`.
    fn locate(mesh: &BlockMesh, x: DVec3, direction: DVec3) -> ([usize; 8], [f64; 8], [f64; 8]) {
        let (mut c, mut xi, mut width) = ([0; 3], [0.0; 3], [0.0; 3]);
        for a in 0..3 {
            let lines = &mesh.lines[a];
            let i = lines.partition_point(|l| *l <= x[a]).clamp(1, lines.len() - 1) - 1;
            c[a] = i;
            width[a] = lines[i + 1] - lines[i];
            xi[a] = ((x[a] - lines[i]) / width[a]).clamp(0.0, 1.0);
        }
        let nodes = mesh.cell_nodes(mesh.cell_index(c[0], c[1], c[2]));
        let (mut weight, mut slope) = ([0.0; 8], [0.0; 8]);
        for (i, signs) in CORNERS.iter().enumerate() {
            let n: [f64; 3] = std::array::from_fn(|a| 0.5 + signs[a] * (xi[a] - 0.5));
            let d: [f64; 3] = std::array::from_fn(|a| signs[a] * direction[a] / width[a]);
            weight[i] = n[0] * n[1] * n[2];
            slope[i] = d[0] * n[1] * n[2] + n[0] * d[1] * n[2] + n[0] * n[1] * d[2];
        }
        (nodes, weight, slope)
    }

    /// Stage `advance_tip`: each anchor k carries a spring between the tip plane and the material point at `a`.
    ///
    /// `g_k = max(0, (p_tip - x_k).t)`, `F = k_tip/N sum g_k`, threshold `F_c(a)` falls from F_pun to F_cut over l_p;
    /// where F > F_c: `a += min((F - F_c) / (k_tip lambda), cap)`, `lambda = <dx_k/da . t>` clamped to 0.2..3.
    fn advance_tip(&mut self, plan: &PuncturePlan, pose: &ToolPose) {
        let model = self.model.clone();
        let mesh = model.mesh.block();
        let u = &self.state.displacement;
        let t = pose.direction;
        let spring = plan.params.tip_stiffness / plan.anchors.len() as f64;
        let tip_axial = (pose.tip - plan.path.entry).dot(t);
        let gaps = |a: f64| -> Vec<(f64, f64, [usize; 8], [f64; 8])> {
            plan.anchors
                .iter()
                .map(|anchor| {
                    let x = anchor.surface + t * a;
                    let (nodes, weight, slope) = Self::locate(mesh, x, t);
                    let (mut du, mut stretch) = (0.0, 1.0);
                    for i in 0..8 {
                        let along = u[nodes[i]].dot(t);
                        du += weight[i] * along;
                        stretch += slope[i] * along;
                    }
                    ((tip_axial - a - du).max(0.0), stretch, nodes, weight)
                })
                .collect()
        };
        let a = self.state.tip_coordinate;
        let mut springs = gaps(a);
        let force: f64 = springs.iter().map(|s| spring * s.0).sum();
        let p = &plan.params;
        let threshold = plan.threshold(a);
        if force > threshold {
            let lambda = springs.iter().map(|s| s.1).sum::<f64>() / springs.len() as f64;
            let speed = pose.velocity.length();
            let cap = if a == 0.0 { 0.005e-3 } else { 0.013e-3 };
            let cap = f64::min(cap, 4.0 * speed * self.dt);
            let advance = ((force - threshold) / (p.tip_stiffness * lambda.clamp(0.2, 3.0))).min(cap);
            self.state.tip_coordinate = a + advance;
            let before = springs;
            springs = gaps(a + advance);
            // Force after the advance times the loss of stretch: with the force of the next step this closes the
            // trapezoidal rule of the leapfrog work; the loss of spring energy would count half a step twice.
            let lost = before.iter().zip(&springs).map(|(b, s)| spring * s.0 * (b.0 - s.0));
            self.sums.tip_dissipation += lost.sum::<f64>();
        }
        self.tip_energy = springs.iter().map(|s| 0.5 * spring * s.0 * s.0).sum();
        self.tip_forces = springs.into_iter().map(|s| (spring * s.0, s.2, s.3)).collect();
    }

    /// Stage `soften_path`: factor `max(residual, 1 - phi ramp(a))`; the energy that a cell loses is dissipated.
    fn soften_path(&mut self, plan: &PuncturePlan) {
        let a = self.state.tip_coordinate;
        for path_cell in &plan.cells {
            let cell = path_cell.cell as usize;
            let length = path_cell.axial_end - path_cell.axial_start;
            let ramp = ((a - path_cell.axial_start) / length.max(1e-9)).clamp(0.0, 1.0);
            let factor = (1.0 - path_cell.fraction * ramp).max(plan.params.residual_stiffness);
            let old = self.state.stiffness[cell];
            if factor < old {
                // Half a step back: the mean of the energies before and after the step, as the leapfrog work has it.
                let half = 0.5 * self.dt;
                let mut u = [DVec3::ZERO; 8];
                for (u, n) in u.iter_mut().zip(self.model.mesh.cell_nodes(cell).iter()) {
                    *u = self.state.displacement[*n] - self.state.velocity[*n] * half;
                }
                let intact = CellStates { points: &self.state.points, stiffness: &[] };
                let m = self.elements.measure_corners(&self.model, cell, &u, None, intact);
                // What Prony terms hold is booked with their work, which the softening does not touch.
                self.sums.softening_dissipation += (old - factor) * (m.elastic - m.held + m.hourglass);
                self.state.stiffness[cell] = factor;
            }
        }
    }

    /// Stage `element_forces`; tetrahedra get their averaged pressure first.
    fn element_forces(&mut self, input: &StepInput) {
        let (model, elements, dt) = (&self.model, &self.elements, self.dt);
        let State { displacement, stiffness, points, .. } = &mut self.state;
        let states = CellStates { points, stiffness };
        let averaged = elements.averaged_volumetrics(model, displacement, states);
        let forces = |cell: usize, point: Option<&mut PointState>| {
            let remaining = stiffness.get(cell).copied().unwrap_or(1.0);
            let averaged = averaged.as_ref().map(|a| a[cell]);
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
        self.sums.return_failures += failures;
    }

    /// Stage `needle_contact`: nodes of the ring that the tip has passed keep `r >= r_e(s)`,
    /// `r_e = sqrt(r0^2 + rc(s)^2) - overlap fade(s)`, `rc = R min(1, s/Lc)`; friction on the shaft; tip springs.
    fn needle_contact(&mut self, plan: &PuncturePlan, pose: &ToolPose) {
        let model = self.model.clone();
        let d = -pose.direction;
        let k = plan.contact_stiffness;
        let a = self.state.tip_coordinate;
        let (radius, cone) = (plan.needle.radius, plan.needle.tip_length);
        let mut stored = self.tip_energy;
        let mut tip_on_node: std::collections::HashMap<usize, f64> = Default::default();
        for (force, nodes, weights) in &self.tip_forces {
            for (n, w) in nodes.iter().zip(weights) {
                *tip_on_node.entry(*n).or_default() += force * w;
            }
        }
        for (contact, memory) in model.contact_nodes.iter().zip(&mut self.state.contact) {
            let node = contact.node as usize;
            let x = model.mesh.rest_position(node) + self.state.displacement[node];
            let mut sums = ContactSums::default();
            if let Some(f) = tip_on_node.get(&node) {
                sums.tip = pose.direction * *f;
            }
            let relative = x - pose.tip;
            let s = relative.dot(d);
            if !(contact.pushed && contact.rest_axial < a && s > 0.0) {
                *memory = ContactState::default();
            } else {
                let radial = relative - d * s;
                let r = radial.length();
                let e = if r > 1e-9 { radial / r } else { DVec3::ZERO };
                let (rc, slope) = if s < cone { (radius * s / cone, radius / cone) } else { (radius, 0.0) };
                let open = (contact.rest_radius.powi(2) + rc * rc).sqrt();
                if !memory.touching {
                    memory.touching = true;
                    memory.overlap = (open - r).max(0.0);
                    memory.axial_on = s;
                }
                let travel = (s - memory.axial_on) / plan.params.entry_fade;
                let fade = (1.0 - travel).clamp(0.0, 1.0);
                let target = open - memory.overlap * fade;
                let fading = if travel > 0.0 && travel < 1.0 { memory.overlap / plan.params.entry_fade } else { 0.0 };
                let m = rc * slope / open + fading;
                let scale = 1.0 / (1.0 + m * m).sqrt();
                let n = (e - d * m) * scale;
                let depth = (target - r) * scale;
                let v = self.state.velocity[node] - pose.velocity;
                let vn = v.dot(n);
                let mass = model.node_mass[node];
                let damping = 2.0 * plan.params.contact_damping * (k * mass).sqrt();
                let normal = if depth > 0.0 { (k * depth - damping * vn).max(0.0) } else { 0.0 };
                sums.normal = n * normal;
                if depth > 0.0 {
                    sums.stored = 0.5 * k * depth * depth;
                    sums.damping_power = (k * depth - normal) * vn;
                }
                memory.stick = match model.effects.friction {
                    Some(friction) if normal > 0.0 => {
                        let kt = friction.stiffness_ratio * k;
                        let mu = friction.coefficient * ((s - cone) / friction.fade_length).clamp(0.0, 1.0);
                        let trial = memory.stick + (v - n * vn) * self.dt;
                        let trial = trial - n * trial.dot(n);
                        let length = trial.length();
                        let allowed = mu * normal / kt;
                        let stretch = if length > allowed { trial * (allowed / length) } else { trial };
                        sums.friction = stretch * -kt;
                        // Friction force times slip.
                        sums.friction_work = kt * stretch.dot(trial - stretch);
                        sums.stored += 0.5 * kt * stretch.length_squared();
                        stretch
                    }
                    _ => DVec3::ZERO,
                };
            }
            let total = sums.tip + sums.normal + sums.friction;
            sums.torque = relative.cross(total);
            self.external[node] += total;
            stored += sums.stored;
            self.sums.book(&sums, pose, self.dt);
        }
        self.contact_energy = stored;
    }

    /// Stage `indenter_contact`: penalty contact of the top face with a sphere or a flat punch.
    fn indenter_contact(&mut self, pose: &ToolPose) {
        let model = self.model.clone();
        let (Some(params), Some(tool)) = (model.effects.indentation, &model.scene.tool) else { return };
        let k = model.tool_contact_stiffness();
        let mut stored = 0.0;
        for (contact, memory) in model.contact_nodes.iter().zip(&mut self.state.contact) {
            let node = contact.node as usize;
            let x = model.mesh.rest_position(node) + self.state.displacement[node];
            let (depth, n, bonded) = match *tool {
                Tool::Sphere { radius } => {
                    let centre = pose.tip - pose.direction * radius;
                    let to = x - centre;
                    let length = to.length();
                    (radius - length, to / length, false)
                }
                Tool::FlatPunch { radius, bonded } => {
                    let s = (pose.tip - x).dot(pose.direction);
                    let inside = contact.rest_radius <= radius;
                    (if inside { s } else { -1.0 }, pose.direction, bonded)
                }
                Tool::Needle(_) => return,
            };
            let v = self.state.velocity[node] - pose.velocity;
            let vn = v.dot(n);
            let damping = 2.0 * params.contact_damping * (k * model.node_mass[node]).sqrt();
            let mut sums = ContactSums::default();
            if bonded && (memory.touching || depth > 0.0) {
                memory.touching = true;
                memory.stick += (v - n * vn) * self.dt;
                sums.normal = n * (k * depth) - v * damping - memory.stick * k;
                sums.damping_power = damping * v.length_squared();
                sums.stored = 0.5 * k * (depth * depth + memory.stick.length_squared());
            } else if depth > 0.0 {
                memory.touching = true;
                let normal = (k * depth - damping * vn).max(0.0);
                sums.normal = n * normal;
                sums.damping_power = (k * depth - normal) * vn;
                sums.stored = 0.5 * k * depth * depth;
                if let Some(friction) = model.effects.friction {
                    let kt = friction.stiffness_ratio * k;
                    let trial = memory.stick + (v - n * vn) * self.dt;
                    let trial = trial - n * trial.dot(n);
                    let length = trial.length();
                    let allowed = friction.coefficient * normal / kt;
                    memory.stick = if length > allowed { trial * (allowed / length) } else { trial };
                    sums.friction = memory.stick * -kt;
                    sums.friction_work = kt * memory.stick.dot(trial - memory.stick);
                    sums.stored += 0.5 * kt * memory.stick.length_squared();
                }
            } else {
                *memory = ContactState::default();
            }
            let total = sums.normal + sums.friction;
            sums.torque = (x - pose.tip).cross(total);
            self.external[node] += total;
            stored += sums.stored;
            self.sums.book(&sums, pose, self.dt);
        }
        self.contact_energy = stored;
    }

    /// Stage `integrate_nodes`: `v+ = ((1 - alpha dt/2) v + dt f/m) / (1 + alpha dt/2)`, `u+ = u + dt v+`.
    fn integrate_nodes(&mut self, input: &StepInput) {
        let model = self.model.clone();
        let mesh = &model.mesh;
        let dt = self.dt;
        let alpha = model.scene.solver.mass_damping;
        let limit = model.speed_limit(dt);
        let selective = model.effects.mass_scaling.is_some();
        let gravity = model.effects.gravity.map_or(DVec3::ZERO, |g| g.acceleration / model.mass_scaling());
        let (cells, elements) = (&self.cells, &self.elements);
        let external = &self.external;
        let result: (f64, f64, u32, u32) = self
            .state
            .displacement
            .par_iter_mut()
            .zip(self.state.velocity.par_iter_mut())
            .enumerate()
            .with_min_len(256)
            .map(|(node, (u, v))| {
                let (mut force, bound) = elements.gather(mesh, cells, node);
                let scaled = model.node_mass[node];
                let mut load = gravity * scaled;
                if let Some(f) = model.node_load.get(node) {
                    load += *f * input.load_factor;
                }
                force += external[node] + load;
                let mut mass = scaled;
                let mut raised = 0;
                if selective {
                    let needed = bound * dt * dt / (4.0 * 0.81);
                    if needed > scaled {
                        mass = needed.min(100.0 * scaled);
                        raised = 1;
                    }
                }
                let old = *v;
                let mut new = (old * (1.0 - 0.5 * alpha * dt) + force * (dt / mass)) / (1.0 + 0.5 * alpha * dt);
                // A held component moves as prescribed, whatever its load: the limit concerns the free ones.
                let fixed = model.fixed_components(node);
                for a in 0..3 {
                    if fixed[a] {
                        new[a] = 0.0;
                    }
                }
                let speed = new.length();
                let mut clamped = 0;
                if speed > limit {
                    new *= limit / speed;
                    clamped = 1;
                }
                let mut free_mid = 0.5 * (old + new);
                let mut work = 0.0;
                if fixed.contains(&true) {
                    let prescribed = prescribed_velocity(&model, node, input, dt);
                    for a in 0..3 {
                        if fixed[a] {
                            // Reaction: what the support must add to move the node as prescribed.
                            let mid = 0.5 * (old[a] + prescribed[a]);
                            let reaction = mass * (prescribed[a] - old[a]) / dt - force[a];
                            work += reaction * mid * dt;
                            new[a] = prescribed[a];
                            free_mid[a] = 0.0;
                        }
                    }
                }
                let mid = 0.5 * (old + new);
                work += load.dot(mid) * dt;
                *v = new;
                *u += new * dt;
                (alpha * mass * free_mid.length_squared() * dt, work, clamped, raised)
            })
            .reduce(|| (0.0, 0.0, 0, 0), |a, b| (a.0 + b.0, a.1 + b.1, a.2 + b.2, a.3 + b.3));
        self.sums.damping_dissipation += result.0;
        self.sums.load_work += result.1;
        self.sums.clamped_nodes += result.2;
        self.sums.raised_mass += result.3;
    }

    /// Stages `measure_cells`, `measure_nodes`, `measure_contact`.
    fn measure(&mut self) {
        let (model, elements, state) = (&self.model, &self.elements, &self.state);
        let states = CellStates { points: &state.points, stiffness: &state.stiffness };
        let averaged = elements.averaged_volumetrics(model, &state.displacement, states);
        let measures: Vec<CellMeasure> = (0..model.mesh.cell_count())
            .into_par_iter()
            .map(|cell| elements.measure(model, cell, &state.displacement, averaged.as_ref().map(|a| a[cell]), states))
            .collect();
        let sums = &mut self.sums;
        sums.elastic = measures.iter().map(|m| m.elastic).sum();
        sums.hourglass = measures.iter().map(|m| m.hourglass).sum();
        sums.viscous_dissipation = measures.iter().map(|m| m.viscous).sum();
        // What deletion has taken out may be turned inside out.
        let present = || measures.iter().filter(|m| m.damage < 1.0);
        sums.deleted_cells = (measures.len() - present().count()) as u32;
        sums.largest_damage = measures.iter().map(|m| m.damage).fold(0.0, f64::max);
        sums.min_j = present().map(|m| m.jacobian).fold(f64::INFINITY, f64::min);
        sums.min_corner_j = present().map(|m| m.corner_jacobian).fold(f64::INFINITY, f64::min);
        let inverted = |m: &CellMeasure| m.damage < 1.0 && (m.jacobian <= 0.0 || m.corner_jacobian <= 0.0);
        sums.inverted_cells = measures.iter().filter(|m| inverted(m)).count() as u32;
        sums.inverted_cell = measures.iter().position(inverted).map(|c| c as u32);
        let dissipated = state.points.iter().enumerate().fold((0.0, 0.0), |sum, (cell, p)| {
            let v = model.mesh.cell_volume(cell);
            (sum.0 + v * p.plastic_dissipation, sum.1 + v * p.damage_dissipation)
        });
        sums.plastic_dissipation = dissipated.0 - self.booked.0;
        sums.damage_dissipation = dissipated.1 - self.booked.1;
        self.booked = dissipated;
        if model.has_driven_faces() {
            sums.reactions = face_reactions(model, &elements.nodal_forces(&model.mesh, &self.cells));
        }
        sums.kinetic = state.velocity.iter().zip(&model.node_mass).map(|(v, m)| 0.5 * m * v.length_squared()).sum();
        sums.max_speed = state.velocity.iter().map(|v| v.length()).fold(0.0, f64::max);
        sums.not_finite = !state.displacement.iter().chain(&state.velocity).all(|v| v.is_finite());
        sums.contact_energy = self.contact_energy;
        sums.tip_coordinate = state.tip_coordinate;
    }
}

impl FrameSums {
    fn book(&mut self, c: &ContactSums, pose: &ToolPose, dt: f64) {
        let total = c.tip + c.normal + c.friction;
        self.cutting_impulse += c.tip.dot(pose.direction) * dt;
        self.spreading_impulse += c.normal.dot(pose.direction) * dt;
        self.friction_impulse += c.friction.dot(pose.direction) * dt;
        self.impulse += total * dt;
        self.angular_impulse += c.torque * dt;
        self.tool_work += total.dot(pose.velocity) * dt;
        self.friction_dissipation += c.friction_work;
        self.contact_dissipation += c.damping_power * dt;
    }
}

/// Velocity that the driven faces prescribe at a node (zero where a face only holds) [m/s].
fn prescribed_velocity(model: &Model, node: usize, input: &StepInput, dt: f64) -> DVec3 {
    let mut velocity = DVec3::ZERO;
    for face in Face::ALL {
        if !model.lies_on(node, face) || model.faces()[face as usize].drive.is_none() {
            continue;
        }
        let axis = face.axis();
        let drive = input.drives[face as usize];
        let arm = model.mesh.rest_position(node) - model.face_centre(face);
        let (b, c) = ((axis + 1) % 3, (axis + 2) % 3);
        let mut du = drive.translation;
        du[b] += drive.cosine * arm[b] - drive.sine * arm[c];
        du[c] += drive.sine * arm[b] + drive.cosine * arm[c];
        velocity += du / dt;
    }
    velocity
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

impl Engine for CpuEngine {
    fn info(&self) -> &EngineInfo {
        &self.info
    }

    fn start_frame(&mut self, plan: &FramePlan) -> Result<()> {
        self.sums = FrameSums { frame: plan.frame, steps: plan.steps.len() as u32, ..Default::default() };
        for input in &plan.steps {
            self.step(input);
        }
        self.measure();
        self.finished.push_back(self.sums);
        Ok(())
    }

    fn collect(&mut self, _wait: bool) -> Result<Option<FrameSums>> {
        Ok(self.finished.pop_front())
    }

    fn read_state(&mut self) -> Result<State> {
        Ok(self.state.clone())
    }

    fn write_state(&mut self, state: &State) -> Result<()> {
        if state.displacement.len() != self.state.displacement.len() {
            return Err(Error::Device("state of another mesh".into()));
        }
        self.state = state.clone();
        Ok(())
    }

    fn internal_forces(&mut self) -> Result<Vec<DVec3>> {
        let states = CellStates { points: &self.state.points, stiffness: &self.state.stiffness };
        Ok(self.elements.internal_forces(&self.model, &self.state.displacement, states))
    }
}
