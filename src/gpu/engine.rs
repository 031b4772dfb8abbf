//! The GPU engine: buffers and kernels of the chosen effects, one submission per frame, a ring of read-backs.

use std::collections::{BTreeMap, BTreeSet, VecDeque};
use std::sync::Arc;
use std::sync::atomic::{AtomicU8, Ordering};

use bytemuck::Zeroable;
use glam::{DMat3, DVec3};
use rayon::prelude::*;

use super::device::Gpu;
use super::kernel::{BindingKind, Compiled, Kernel, MeshNumbers, STEP_INPUT};
use super::layout::Layout;
use super::memory::Memory;
use super::pace::Pace;
use super::structs::*;
use super::texels::{Texels, texel_numbers};
use crate::effects::EffectSet;
use crate::effects::adhesion::Bond;
use crate::effects::cohesive::TORN_REACH;
use crate::engine::elements::{HOURGLASS_MODULUS, PrismBase};
use crate::engine::{
    ContactState, Engine, EngineImage, EngineInfo, FramePlan, FrameSums, Health, Stage, State, foreign_image,
};
use crate::error::{Error, Result};
use crate::material::law::Form;
use crate::material::{LAWS, Law};
use crate::material_point::{Material as Constants, PointState};
use crate::mesh::BlockMesh;
use crate::model::{
    ContactSurface, FreePlan, LARGEST_ANCHOR_COUNT, LARGEST_MATERIAL_COUNT, LARGEST_SEGMENT_COUNT, Model,
};
use crate::needle::{Tool, free_path as needle};

/// One fixed-point unit of displacement, 2^-36 m.
pub const DISPLACEMENT_UNIT: f64 = 1.0 / (1u64 << 36) as f64;

/// Frames whose results may be under way.
const RING: usize = 3;

/// Bytes from the input of one step to that of the next: the default limits let a device ask for offsets in multiples of 256.
const STEP_STRIDE: usize = size_of::<StepInput>().next_multiple_of(256);

/// How long the mapping of a finished submission may take.
const MAPPING_PATIENCE: std::time::Duration = std::time::Duration::from_secs(10);

/// Partial sums per face of `measure_faces`.
const FACE_PARTS: usize = 64;

/// Partial sums of `measure_separation`.
const SEPARATION_PARTS: usize = 64;

/// Partial sums of `measure_contact`.
const CONTACT_PARTS: usize = 64;

/// What decides which code a shader contains, beside the effects.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Features {
    pub loaded_faces: bool,
    pub driven_faces: bool,
    /// Several materials.
    pub regions: bool,
    /// Tetrahedra instead of the block.
    pub tetrahedra: bool,
    /// The tissue separates around a hollow needle, or on a slit before a solid one.
    pub bore: bool,
    pub slit: bool,
    /// The path of the needle is found while the tip moves.
    pub free_path: bool,
    /// A window draws the fields.
    pub drawn: bool,
    /// Keys of the elastic laws that occur.
    pub laws: BTreeSet<&'static str>,
}

impl Features {
    pub fn of(model: &Model) -> Self {
        Features {
            loaded_faces: !model.node_load.is_empty(),
            driven_faces: model.has_driven_faces(),
            regions: !model.cell_material.is_empty(),
            tetrahedra: model.mesh.as_tets().is_some(),
            bore: model.has_surface(|s| matches!(s, ContactSurface::OuterWall | ContactSurface::Bore)),
            slit: model.has_surface(|s| matches!(s, ContactSurface::Slit { .. })),
            free_path: model.puncture.as_ref().is_some_and(|p| p.free.is_some()),
            drawn: false,
            laws: model.materials.iter().map(|m| m.law.isochoric.key()).collect(),
        }
    }
}

/// Effects of tools, which work on the block only.
const BLOCK_EFFECTS: [&str; 6] = ["cohesive", "puncture", "adhesion", "indentation", "friction", "flexible_needle"];

/// Names that are defined for the shaders.
pub fn defines(effects: &EffectSet, features: &Features) -> BTreeSet<&'static str> {
    // A flexible needle acts by the contact of `puncture`, on a planned path.
    let bends = effects.puncture.is_some() && !features.free_path;
    let works =
        |key: &str| (!features.tetrahedra || !BLOCK_EFFECTS.contains(&key)) && (key != "flexible_needle" || bends);
    let mut defines: BTreeSet<&'static str> = effects.active().filter(|e| works(e.key)).map(|e| e.define).collect();
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
    define("TETRAHEDRA", features.tetrahedra);
    let separates = !features.tetrahedra && effects.cohesive.is_some() && effects.puncture.is_some();
    // Grid lines are doubled where faces may separate: copies that stay together move as one.
    define("TIED", !features.tetrahedra && effects.cohesive.is_some());
    define("INNER_BOUND", !features.tetrahedra && effects.bounds_inner_cells());
    define("BORE", features.bore && separates);
    define("SLIT", features.slit && separates);
    define("FREE_PATH", features.free_path && effects.puncture.is_some() && !features.tetrahedra);
    // The bulk stiffness of a cell is not that of all others.
    define("VARYING_STIFFNESS", features.tetrahedra && (features.regions || effects.damage.is_some()));
    define("HISTORY", effects.plasticity.is_some() || effects.viscoelastic.is_some() || effects.damage.is_some());
    // Its key chooses a law: `#for law`.
    for law in &LAWS {
        define(law.key, features.laws.contains(law.key));
    }
    let of_invariants = |law: &Law| law.form == Form::Invariants && features.laws.contains(law.key);
    define("INVARIANT_LAWS", LAWS.iter().any(of_invariants));
    define("SEVERAL_LAWS", features.laws.len() > 1);
    defines
}

/// The stages that a set of effects needs, in the order of the step.
pub fn stages(effects: &EffectSet, features: &Features) -> Vec<Stage> {
    let (block, tetrahedra) = (!features.tetrahedra, features.tetrahedra);
    let puncture = block && effects.puncture.is_some();
    let indentation = block && effects.indentation.is_some();
    let cohesive = block && effects.cohesive.is_some();
    let wanted = |stage: &Stage| match stage {
        // Where faces separate no cell is softened, but a core is severed.
        Stage::SoftenPath => puncture && (!cohesive || features.bore) && !features.free_path,
        Stage::CohesiveForces | Stage::MeasureSeparation => cohesive,
        Stage::AdvanceTip => puncture && !features.free_path,
        Stage::AdvanceFreeTip | Stage::SoftenFreePath => puncture && features.free_path,
        Stage::NeedleContact => puncture,
        Stage::IndenterContact => indentation,
        Stage::MeasureContact => puncture || indentation,
        Stage::MeasureDilatation | Stage::AveragePressure | Stage::TetrahedronForces => tetrahedra,
        Stage::ElementForces => block,
        Stage::MeasureFaces => features.driven_faces,
        Stage::CellFields | Stage::NodeFields => features.drawn,
        _ => true,
    };
    Stage::ALL.into_iter().filter(wanted).collect()
}

/// Results of one frame on their way to the host.
struct InFlight {
    slot: usize,
    frame: u64,
    steps: u32,
    /// The last one of its submissions, see [`Pace`].
    submission: u64,
    /// 0: not mapped yet, 1: mapped, 2: failed.
    mapped: Arc<AtomicU8>,
}

/// A part of a buffer that is read back after every frame, and where it lies in a staging buffer.
#[derive(Debug, Clone, Copy)]
struct ResultRange {
    name: &'static str,
    /// Where it begins in its own buffer.
    from: u64,
    offset: u64,
    size: u64,
}

/// The engine.
pub struct GpuEngine {
    model: Arc<Model>,
    gpu: Gpu,
    info: EngineInfo,
    layout: Layout,
    dt: f64,
    kernels: Vec<Kernel>,
    buffers: BTreeMap<&'static str, Memory>,
    results: Vec<ResultRange>,
    staging: Vec<wgpu::Buffer>,
    in_flight: VecDeque<InFlight>,
    finished: VecDeque<FrameSums>,
    pace: Pace<wgpu::SubmissionIndex>,
    /// What its times count from.
    begin: std::time::Instant,
    /// Buffers that a checkpoint holds.
    kept: Vec<&'static str>,
    max_steps: usize,
    /// [`moment`] of the nodes at the end of the last frame [kg m], and what gravity has done since t = 0 [J].
    moment: DVec3,
    gravity_work: f64,
}

impl GpuEngine {
    /// Prepares buffers and pipelines for a model at rest, steps of `dt` [s], at most `max_steps` steps per frame.
    ///
    /// # Errors
    /// `Error::Input` where the mesh is too large for a portable device, `Error::Shader` for a broken shader.
    pub fn new(model: Arc<Model>, gpu: Gpu, dt: f64, max_steps: usize) -> Result<Self> {
        Self::for_purpose(model, gpu, dt, max_steps, false)
    }

    /// The same; `drawn`: with the fields that a window draws, see [`GpuEngine::encode_fields`].
    ///
    /// # Errors
    /// As [`GpuEngine::new`].
    pub fn for_purpose(model: Arc<Model>, gpu: Gpu, dt: f64, max_steps: usize, drawn: bool) -> Result<Self> {
        // Software adapters pay per buffer access: long strips share most planes. Hardware wants many threads.
        let layers = if gpu.is_software() { 8 } else { 4 };
        let layout = Layout::new(&model.mesh, layers);
        let features = Features { drawn, ..Features::of(&model) };
        let defines = defines(&model.effects, &features);
        let measure_threads = measure_threads(&model);
        let numbers = mesh_numbers(&model, &layout, measure_threads);
        // Composing, validating and compiling go side by side: they are most of the time to the first step.
        let compiled = stages(&model.effects, &features)
            .into_par_iter()
            .map(|stage| gpu.kernels.compiled(&gpu.device, stage, &defines, &numbers, gpu.texels))
            .collect::<Result<Vec<Arc<Compiled>>>>()?;
        let scope = gpu.device.push_error_scope(wgpu::ErrorFilter::Validation);
        let mut buffers = BTreeMap::new();
        let mut bytes = 0;
        for binding in compiled.iter().flat_map(|r| &r.bindings) {
            let Some(name) = BUFFERS.iter().find(|n| **n == binding.name) else {
                return Err(Error::Shader {
                    stage: "bindings".into(),
                    message: format!("the engine knows no buffer `{}`", binding.name),
                });
            };
            if buffers.contains_key(name) {
                continue;
            }
            let contents = contents(name, &model, &layout, dt, measure_threads, max_steps);
            // One stage may read what another one writes.
            let kinds: Vec<BindingKind> =
                compiled.iter().flat_map(|r| &r.bindings).filter(|b| b.name == *name).map(|b| b.kind).collect();
            let buffer = allocate(&gpu, name, &contents, &kinds)?;
            bytes += buffer.device_bytes();
            buffers.insert(*name, buffer);
        }
        // What a shader writes and a later step may read; sums of a frame are written whole.
        let kept: Vec<&'static str> = BUFFERS
            .into_iter()
            .filter(|name| !FRAME_RESULTS.contains(name) && !DRAWN.contains(name))
            .filter(|name| compiled.iter().flat_map(|r| &r.bindings).any(|b| b.writable && b.name == *name))
            .collect();
        let kernels = compiled
            .into_iter()
            .map(|r| {
                let threads = threads(r.stage, &model, &layout, measure_threads);
                Kernel::new(&gpu.device, r, &buffers, size_of::<StepInput>() as u64, threads)
            })
            .collect::<Result<Vec<Kernel>>>()?;
        let mut offset = 0;
        let sums = FRAME_RESULTS.into_iter().filter_map(|name| buffers.get(name).map(|b| (name, 0, b.size())));
        // Of the displacements only those around the targets.
        let corners = model.targets.iter().flat_map(|target| target.nodes).map(|node| {
            let size = size_of::<[i32; 4]>() as u64;
            ("node_displacement", u64::from(node) * size, size)
        });
        let results: Vec<ResultRange> = sums
            .chain(corners)
            .map(|(name, from, size)| {
                offset += size;
                ResultRange { name, from, offset: offset - size, size }
            })
            .collect();
        let staging: Vec<wgpu::Buffer> = (0..RING)
            .map(|_| {
                gpu.device.create_buffer(&wgpu::BufferDescriptor {
                    label: Some("frame results"),
                    size: offset,
                    usage: wgpu::BufferUsages::COPY_DST | wgpu::BufferUsages::MAP_READ,
                    mapped_at_creation: false,
                })
            })
            .collect();
        bytes += offset * RING as u64;
        // Error scopes belong to a thread; what the compiling threads met is with the device.
        gpu.check()?;
        if let Some(error) = pollster::block_on(scope.pop()) {
            return Err(Error::Device(error.to_string()));
        }
        let info = EngineInfo {
            engine: "gpu".into(),
            adapter: super::device::describe(&gpu.info),
            driver: format!("{} {}", gpu.info.driver, gpu.info.driver_info).trim().into(),
            device_bytes: bytes,
            software: gpu.is_software(),
        };
        Ok(GpuEngine {
            model,
            gpu,
            info,
            layout,
            dt,
            kernels,
            buffers,
            results,
            staging,
            in_flight: VecDeque::new(),
            finished: VecDeque::new(),
            pace: Pace::default(),
            begin: std::time::Instant::now(),
            kept,
            max_steps,
            moment: DVec3::ZERO,
            gravity_work: 0.0,
        })
    }

    /// The opened device, for drawing on the same adapter.
    pub fn gpu(&self) -> &Gpu {
        &self.gpu
    }

    /// An array by the name of its shader variable.
    pub fn memory(&self, name: &str) -> Option<&Memory> {
        self.buffers.get(name)
    }

    /// Brings the fields that a window draws up to date with the present state.
    pub fn encode_fields(&self, encoder: &mut wgpu::CommandEncoder) {
        let mut pass = encoder.begin_compute_pass(&Default::default());
        // The fields are those of the displacement after the last step, and so are the pressures that they need.
        for kernel in self.kernels.iter().filter(|k| k.stage.averages() || k.stage.draws()) {
            kernel.encode(&mut pass, 0);
        }
    }

    /// Names and sizes of all device buffers [bytes].
    pub fn buffer_sizes(&self) -> Vec<(&'static str, u64)> {
        self.buffers.iter().map(|(n, b)| (*n, b.device_bytes())).collect()
    }

    /// Wall and process CPU time of one dispatch of every stage [s], each repeated `repeats` times by itself. The state
    /// means nothing afterwards.
    pub fn time_stages(&mut self, repeats: u32) -> Result<Vec<(Stage, f64, Option<f64>)>> {
        while self.collect_oldest(true)? {}
        let mut times = Vec::new();
        for kernel in &self.kernels {
            let mut encoder = self.gpu.device.create_command_encoder(&Default::default());
            {
                let mut pass = encoder.begin_compute_pass(&Default::default());
                for _ in 0..repeats {
                    kernel.encode(&mut pass, 0);
                }
            }
            let (begin, cpu) = (std::time::Instant::now(), crate::process::cpu_seconds());
            self.gpu.queue.submit([encoder.finish()]);
            self.wait(wgpu::PollType::wait_indefinitely())?;
            let wall = begin.elapsed().as_secs_f64() / f64::from(repeats);
            let cpu = crate::process::cpu_seconds().zip(cpu).map(|(b, a)| (b - a) / f64::from(repeats));
            times.push((kernel.stage, wall, cpu));
        }
        Ok(times)
    }

    /// Polls the device. What the device itself has reported says more than the failed wait that follows it.
    fn wait(&self, poll: wgpu::PollType) -> Result<()> {
        let polled = self.gpu.device.poll(poll);
        self.gpu.check()?;
        polled.map(|_| ()).map_err(|e| Error::Device(e.to_string()))
    }

    /// Waits for the oldest submission under way. Without a limit of time: where several threads share a device, one that ran out
    /// while another thread collects the last submission makes wgpu 30 panic. [`Pace`] bounds how long it takes.
    fn wait_for_oldest(&mut self) -> Result<()> {
        /// A wait that is shorter has not waited [s].
        const NOTHING: f64 = 2e-4;
        let Some(oldest) = self.pace.oldest() else { return Ok(()) };
        let from = self.begin.elapsed().as_secs_f64();
        self.wait(wgpu::PollType::Wait { submission_index: Some(oldest), timeout: None })?;
        let now = self.begin.elapsed().as_secs_f64();
        self.pace.finished(now, now - from > NOTHING);
        Ok(())
    }

    /// Submits what was encoded, `steps` steps, once the device has little enough to do; the number of the submission.
    fn submit(&mut self, encoder: wgpu::CommandEncoder, steps: usize) -> Result<u64> {
        while !self.pace.has_room(steps) {
            self.wait_for_oldest()?;
        }
        let submission = self.gpu.queue.submit([encoder.finish()]);
        Ok(self.pace.submitted(steps, submission, self.begin.elapsed().as_secs_f64()))
    }

    fn collect_oldest(&mut self, wait: bool) -> Result<bool> {
        let Some((last, mapped)) = self.in_flight.front().map(|front| (front.submission, front.mapped.clone())) else {
            return Ok(false);
        };
        if wait {
            while self.pace.is_under_way(last) {
                self.wait_for_oldest()?;
            }
            await_mapping(&self.gpu, &mapped)?;
        } else {
            self.wait(wgpu::PollType::Poll)?;
        }
        match mapped.load(Ordering::Acquire) {
            1 => {}
            2 => return Err(Error::Device("results of a frame could not be mapped".into())),
            _ if wait => return Err(Error::Device("results of a frame did not arrive".into())),
            _ => return Ok(false),
        }
        while self.pace.is_under_way(last) {
            self.pace.finished(self.begin.elapsed().as_secs_f64(), false);
        }
        let Some(done) = self.in_flight.pop_front() else { return Ok(false) };
        let buffer = self.staging[done.slot].clone();
        let sums = {
            let view = buffer.get_mapped_range(..).map_err(|e| Error::Device(e.to_string()))?;
            self.sum_up(&done, &view)
        };
        buffer.unmap();
        self.finished.push_back(sums);
        Ok(true)
    }

    /// Adds the partial sums of a frame in f64.
    fn sum_up(&mut self, done: &InFlight, view: &[u8]) -> FrameSums {
        let mut sums = FrameSums {
            frame: done.frame,
            steps: done.steps,
            health: Health { min_j: f64::INFINITY, min_corner_j: f64::INFINITY, ..Default::default() },
            ..Default::default()
        };
        let has_steps = if done.steps > 0 { 1.0 } else { 0.0 };
        let mut weighted = DVec3::ZERO;
        let mut corners = Vec::new();
        for range in &self.results {
            let bytes = &view[range.offset as usize..(range.offset + range.size) as usize];
            match range.name {
                "cell_sums" => {
                    for s in read_all::<CellSums>(bytes) {
                        sums.energy.elastic += f64::from(s.elastic);
                        sums.energy.hourglass += f64::from(s.hourglass);
                        sums.health.min_j = sums.health.min_j.min(f64::from(s.min_jacobian));
                        sums.health.min_corner_j = sums.health.min_corner_j.min(f64::from(s.min_corner_jacobian));
                        sums.health.inverted_cells += s.inverted_cells;
                        sums.health.folded_cells += s.folded_cells;
                        sums.health.not_finite |= s.overstretched_cells > 0;
                        sums.energy.plastic += f64::from(s.flow);
                        sums.energy.damage += f64::from(s.degradation);
                        sums.energy.viscous += f64::from(s.relaxation);
                        sums.health.largest_damage = sums.health.largest_damage.max(1.0 - f64::from(s.least_intact));
                        sums.health.deleted_cells += s.deleted_cells;
                        sums.health.return_failures += s.failures as u32;
                        if s.inverted_cells > 0 {
                            sums.health.inverted_cell.get_or_insert(s.inverted_cell);
                        }
                    }
                }
                "node_sums" => {
                    for s in read_all::<NodeSums>(bytes) {
                        sums.energy.kinetic += f64::from(s.kinetic);
                        sums.energy.half_step += has_steps * f64::from(s.half_step);
                        sums.energy.damping += f64::from(s.damping);
                        sums.load_work += f64::from(s.work);
                        weighted += DVec3::new(s.moment_x.into(), s.moment_y.into(), s.moment_z.into());
                        sums.health.max_speed = sums.health.max_speed.max(f64::from(s.max_speed));
                        sums.health.raised_mass += s.raised_mass;
                        sums.health.clamped_nodes += s.clamped_nodes;
                        sums.energy.raised_mass += f64::from(s.raised_energy);
                        sums.energy.speed_limit += f64::from(s.clamped_energy);
                        sums.step_ratio = sums.step_ratio.max(f64::from(s.step_ratio));
                        sums.health.not_finite |= s.out_of_range > 0;
                    }
                }
                "face_sums" => {
                    for (index, s) in read_all::<[f32; 4]>(bytes).enumerate() {
                        let force = DVec3::new(s[0].into(), s[1].into(), s[2].into());
                        sums.reactions[index / FACE_PARTS] += force;
                        sums.face_moments[index / FACE_PARTS] += f64::from(s[3]);
                    }
                }
                "node_displacement" => corners.extend(read_all(bytes).map(displacement)),
                "needle_loads" => {
                    for (load, s) in sums.needle_loads.iter_mut().zip(read_all::<[f32; 4]>(bytes)) {
                        *load = DVec3::new(s[0].into(), s[1].into(), s[2].into());
                    }
                }
                "separation_sums" => {
                    for s in read_all::<SeparationSums>(bytes) {
                        sums.energy.cohesive += f64::from(s.dissipation);
                        sums.energy.cohesive_stored += f64::from(s.stored);
                        sums.health.torn_area += f64::from(s.torn_area);
                    }
                }
                "contact_totals" => {
                    for s in read_all::<ContactSums>(bytes) {
                        let vector = |v: [f32; 4]| DVec3::new(v[0].into(), v[1].into(), v[2].into());
                        sums.impulse += vector(s.impulse);
                        // What the tool does until the middle of the last step goes into the springs of contact.
                        sums.energy.half_step += has_steps * 0.5 * f64::from(s.impulse[3]);
                        sums.angular_impulse += vector(s.angular_impulse);
                        let [cutting, spreading, sliding, shaft] = s.parts.map(f64::from);
                        sums.cutting_impulse += cutting;
                        sums.spreading_impulse += spreading;
                        sums.friction_impulse += sliding;
                        sums.shaft_impulse += shaft;
                        let [work, sliding, damping, stored] = s.energies.map(f64::from);
                        sums.tool_work += work;
                        sums.energy.friction += sliding;
                        sums.energy.contact_damping += damping;
                        sums.energy.contact_stored += stored;
                    }
                }
                _ => {
                    for s in read_all::<TipState>(bytes) {
                        sums.tip_coordinate = f64::from(s.coordinate);
                        sums.energy.tip = f64::from(s.dissipation);
                        sums.energy.advance_cap = f64::from(s.cap_dissipation);
                        sums.energy.softening = f64::from(s.softening);
                        sums.energy.contact_stored += f64::from(s.spring_energy);
                        sums.membrane_impulse = f64::from(s.membrane_impulse);
                        sums.adhesion_impulse = f64::from(s.bond_impulse);
                        sums.energy.adhesion = f64::from(s.bond_dissipation);
                        // The contact nodes have booked the whole force of the anchors.
                        sums.cutting_impulse -= sums.membrane_impulse + sums.adhesion_impulse;
                    }
                }
            }
        }
        let around = corners.chunks_exact(8).map(|c| std::array::from_fn(|n| c[n]));
        sums.targets = self.model.targets.iter().zip(around).map(|(target, u)| target.interpolated(u)).collect();
        if let Some(gravity) = self.model.effects.gravity {
            self.moment = weighted / self.model.mass_scaling();
            let total = self.moment.dot(gravity.acceleration);
            sums.load_work += total - self.gravity_work;
            self.gravity_work = total;
        }
        sums
    }

    /// Copies buffers to the host; waits for everything under way.
    fn read_buffers(&mut self, names: &[&'static str]) -> Result<Vec<Vec<u8>>> {
        while self.collect_oldest(true)? {}
        let wanted: Vec<&Memory> = names.iter().map(|n| &self.buffers[n]).collect();
        let total = wanted.iter().map(|b| b.size()).sum();
        let staging = self.gpu.device.create_buffer(&wgpu::BufferDescriptor {
            label: Some("state"),
            size: total,
            usage: wgpu::BufferUsages::COPY_DST | wgpu::BufferUsages::MAP_READ,
            mapped_at_creation: false,
        });
        let mut encoder = self.gpu.device.create_command_encoder(&Default::default());
        let mut offset = 0;
        for buffer in &wanted {
            buffer.encode_copy(&mut encoder, (0, buffer.size()), (&staging, offset));
            offset += buffer.size();
        }
        self.gpu.queue.submit([encoder.finish()]);
        let mapped = map_for_reading(&staging);
        self.wait(wgpu::PollType::wait_indefinitely())?;
        await_mapping(&self.gpu, &mapped)?;
        let view = staging.get_mapped_range(..).map_err(|e| Error::Device(e.to_string()))?;
        let mut start = 0;
        Ok(wanted
            .iter()
            .map(|b| {
                let end = start + b.size() as usize;
                let bytes = view[start..end].to_vec();
                start = end;
                bytes
            })
            .collect())
    }

    /// Steps of the frame as one compute pass.
    fn encode_steps(&self, encoder: &mut wgpu::CommandEncoder, steps: std::ops::Range<usize>) -> Result<()> {
        let mut pass = encoder.begin_compute_pass(&Default::default());
        for step in steps {
            if crate::ending::is_overdue() {
                return Err(Error::Ended(crate::ending::reason()));
            }
            self.encode_step(&mut pass, step);
        }
        Ok(())
    }

    /// The last step of a frame: what it measures belongs to the displacement of its forces, but for velocities, which belong to its
    /// middle.
    fn encode_measured_step(&self, encoder: &mut wgpu::CommandEncoder, step: usize) {
        let moves = |stage| matches!(stage, Stage::IntegrateNodes | Stage::MeasureNodes);
        self.encode_selected(encoder, step, |stage| !stage.once_per_frame() && !stage.draws() && !moves(stage));
        self.encode_selected(encoder, step, |stage| stage.once_per_frame() && !moves(stage));
        self.encode_selected(encoder, step, moves);
    }

    /// Some of the stages as one compute pass, with the input of a step.
    fn encode_selected(&self, encoder: &mut wgpu::CommandEncoder, step: usize, wanted: impl Fn(Stage) -> bool) {
        let mut pass = encoder.begin_compute_pass(&Default::default());
        for kernel in self.kernels.iter().filter(|k| wanted(k.stage)) {
            kernel.encode(&mut pass, (step * STEP_STRIDE) as u32);
        }
    }

    fn encode_step(&self, pass: &mut wgpu::ComputePass<'_>, step: usize) {
        let offset = (step * STEP_STRIDE) as u32;
        for kernel in self.kernels.iter().filter(|k| !k.stage.once_per_frame() && !k.stage.draws()) {
            kernel.encode(pass, offset);
        }
    }
}

/// Asks for a mapping; the flag becomes 1 when it is there, 2 when it failed.
fn map_for_reading(buffer: &wgpu::Buffer) -> Arc<AtomicU8> {
    let mapped = Arc::new(AtomicU8::new(0));
    let flag = mapped.clone();
    buffer.map_async(wgpu::MapMode::Read, .., move |result| {
        flag.store(if result.is_ok() { 1 } else { 2 }, Ordering::Release);
    });
    mapped
}

/// Waits for the flag of a mapping whose submission has finished. Another thread that uses the same device may have
/// taken over the callback in its own poll and be about to call it, so the flag can come a moment after the poll.
fn await_mapping(gpu: &Gpu, mapped: &AtomicU8) -> Result<()> {
    let begin = std::time::Instant::now();
    while mapped.load(Ordering::Acquire) == 0 && begin.elapsed() < MAPPING_PATIENCE {
        std::thread::yield_now();
        gpu.device.poll(wgpu::PollType::Poll).map_err(|e| Error::Device(e.to_string()))?;
    }
    Ok(())
}

/// Values of a byte slice that need not be aligned.
fn read_all<T: bytemuck::Pod>(bytes: &[u8]) -> impl Iterator<Item = T> + '_ {
    bytes.chunks_exact(size_of::<T>()).map(bytemuck::pod_read_unaligned)
}

/// A displacement in fixed point [m].
fn displacement(u: [i32; 4]) -> DVec3 {
    DVec3::new(u[0].into(), u[1].into(), u[2].into()) * DISPLACEMENT_UNIT
}

/// Sum of mass without scaling times displacement half a step ago, where the velocity `v` of (u, v) is known [kg m]: the work of a
/// uniform field is its change, with the mean of the old and the new velocity of each step as for every other load.
fn moment(nodes: impl Iterator<Item = (DVec3, DVec3)>, model: &Model, dt: f64) -> DVec3 {
    let sum: DVec3 = nodes.zip(&model.node_mass).map(|((u, v), m)| (u - v * (0.5 * dt)) * *m).sum();
    sum / model.mass_scaling()
}

/// Threads of the measuring stages: enough to fill a device, few enough that the sums are a short read-back.
fn measure_threads(model: &Model) -> u32 {
    (model.mesh.cell_count() as u32 / 16).clamp(64, 8192).next_multiple_of(64)
}

/// Threads that a stage needs.
fn threads(stage: Stage, model: &Model, layout: &Layout, measure_threads: u32) -> u32 {
    match stage {
        Stage::AdvanceTip | Stage::AdvanceFreeTip => 32,
        Stage::SoftenFreePath => free_plan(model).map_or(1, |f| f.cell_count() as u32),
        Stage::SoftenPath => model.puncture.as_ref().map_or(1, |p| p.cells.len() as u32),
        Stage::CellFields => model.mesh.cell_count() as u32,
        Stage::NodeFields => model.mesh.node_count() as u32,
        Stage::MeasureDilatation | Stage::TetrahedronForces => model.mesh.cell_count() as u32,
        Stage::AveragePressure => model.mesh.node_count() as u32,
        Stage::ElementForces => layout.strips().columns * layout.strips().count,
        Stage::NeedleContact | Stage::IndenterContact => model.contact_nodes.len() as u32,
        Stage::IntegrateNodes => model.mesh.node_count() as u32,
        Stage::MeasureCells | Stage::MeasureNodes => measure_threads,
        Stage::CohesiveForces => model.separation.pairs.len() as u32,
        Stage::MeasureSeparation => SEPARATION_PARTS as u32,
        Stage::MeasureContact => CONTACT_PARTS as u32,
        Stage::MeasureFaces => 6 * FACE_PARTS as u32,
    }
}

/// Buffers that hold what a frame tells, and nothing that the next one needs.
const FRAME_RESULTS: [&str; 7] =
    ["cell_sums", "node_sums", "contact_totals", "face_sums", "separation_sums", "needle_loads", "tip_result"];

/// Buffers of what a window draws: they follow from the state.
const DRAWN: [&str; 2] = ["drawn_cells", "drawn_nodes"];

/// Buffers that are written anew for every frame.
const PER_FRAME: [&str; 2] = [STEP_INPUT, "centre_line"];

/// All buffers by the name of their shader variable.
const BUFFERS: [&str; 56] = [
    "cohesive",
    "face_pairs",
    "pair_states",
    "separation_sums",
    "tied_nodes",
    "params",
    STEP_INPUT,
    "gravity",
    "puncture",
    "adhesion",
    "friction",
    "centre_line",
    "needle_loads",
    "indentation",
    "cell_edges",
    "node_mass",
    "node_load",
    "grid_lines",
    "contact_nodes",
    "tip_anchors",
    "path_cells",
    "node_displacement",
    "node_velocity",
    "corner_force",
    "node_cures",
    "node_work",
    "cell_sums",
    "node_sums",
    "cell_stiffness",
    "tip_state",
    "tip_anchor_loads",
    "free_tip",
    "free_cells",
    "contact_records",
    "face_sums",
    "materials",
    "cell_material",
    "point_history",
    "plasticity",
    "plastic_state",
    "fibres",
    "prony",
    "viscous_layout",
    "viscous_state",
    "damage",
    "contact_totals",
    "tip_result",
    "tetrahedra",
    "mesh_nodes",
    "node_cells",
    "cell_dilatation",
    "cell_bulk_stiffness",
    "pressed_nodes",
    "node_dilatation",
    "drawn_cells",
    "drawn_nodes",
];

/// What a buffer holds at the start: bytes, or zeros of a size.
enum Contents {
    Bytes(Vec<u8>),
    Zeros(u64),
}

fn bytes_of<T: bytemuck::NoUninit>(values: &[T]) -> Contents {
    Contents::Bytes(bytemuck::cast_slice(values).to_vec())
}

fn vec4(v: DVec3) -> [f32; 4] {
    [v.x as f32, v.y as f32, v.z as f32, 0.0]
}

fn contents(name: &str, model: &Model, layout: &Layout, dt: f64, measure_threads: u32, max_steps: usize) -> Contents {
    let nodes = model.mesh.node_count() as u64;
    let contacts = model.contact_nodes.len().max(1) as u64;
    let cells = model.mesh.cell_count() as u64;
    let zeros = |count: u64, size: usize| Contents::Zeros(count * size as u64);
    match name {
        "params" => bytes_of(&[params(model, dt)]),
        STEP_INPUT => zeros(max_steps.max(1) as u64, STEP_STRIDE),
        "gravity" => {
            let g = model.effects.gravity.map_or(DVec3::ZERO, |g| g.acceleration);
            bytes_of(&[GravityParams { acceleration: vec4(g / model.mass_scaling()) }])
        }
        "puncture" => bytes_of(&[puncture_params(model)]),
        "adhesion" => {
            let p = model.effects.adhesion.unwrap_or_default();
            bytes_of(&[AdhesionParams {
                static_force: p.static_force as f32,
                kinetic_force: p.kinetic_force as f32,
                stiffness: p.stiffness as f32,
                sliding_distance: p.sliding_distance as f32,
            }])
        }
        "friction" => {
            let p = model.effects.friction.unwrap_or_default();
            bytes_of(&[FrictionParams {
                coefficient: p.coefficient as f32,
                stiffness_ratio: p.stiffness_ratio as f32,
                fade_length: p.fade_length as f32,
                _pad: 0.0,
            }])
        }
        "centre_line" => zeros(1, size_of::<CentreLine>()),
        "needle_loads" => zeros(CONTACT_PARTS as u64, 16),
        "indentation" => bytes_of(&[indentation_params(model)]),
        "cohesive" => bytes_of(&[cohesive_params(model)]),
        "face_pairs" => bytes_of(&face_pairs(model, layout)),
        "pair_states" => zeros(model.separation.pairs.len().max(1) as u64, size_of::<PairState>()),
        "separation_sums" => zeros(SEPARATION_PARTS as u64, size_of::<SeparationSums>()),
        "tied_nodes" => bytes_of(&tied_nodes(model)),
        "cell_edges" => {
            let mut edges: Vec<CellEdge> = model
                .mesh
                .block()
                .lines
                .iter()
                .flat_map(|l| l.windows(2).map(|w| w[1] - w[0]))
                .map(|d| CellEdge {
                    length: d as f32,
                    cube_root: d.cbrt() as f32,
                    // A gap between two copies of a line carries nothing.
                    quarter_inverse: if d > 0.0 { (0.25 / d) as f32 } else { 0.0 },
                    _pad: 0.0,
                })
                .collect();
            if model.mesh.block().bore.is_some() {
                edges.extend(bent_columns(model.mesh.block()));
            }
            bytes_of(&edges)
        }
        "node_mass" => bytes_of(&model.node_mass.iter().map(|m| *m as f32).collect::<Vec<_>>()),
        "node_load" => bytes_of(&model.node_load.iter().map(|f| vec4(*f)).collect::<Vec<_>>()),
        "grid_lines" => bytes_of(&model.mesh.block().lines.iter().flatten().map(|x| *x as f32).collect::<Vec<_>>()),
        "contact_nodes" => bytes_of(&contact_nodes(model, layout)),
        "tip_anchors" => {
            let plan = model.puncture.as_ref();
            let anchors = plan.map_or(&[][..], |p| &p.anchors);
            let block = model.mesh.block();
            let anchor = |a: &crate::model::TipAnchor| {
                let ([i, j, _], local) = block.locate(a.surface);
                TipAnchor { surface: vec4(a.surface), column: [i as u32, j as u32, 0, 0], local: vec4(local) }
            };
            bytes_of(&anchors.iter().map(anchor).collect::<Vec<_>>())
        }
        "path_cells" => {
            let plan = model.puncture.as_ref();
            let mut cells: Vec<PathCell> = plan
                .map_or(&[][..], |p| &p.cells)
                .iter()
                .map(|c| PathCell {
                    cell: c.cell,
                    left: c.left as f32,
                    axial_start: c.axial_start as f32,
                    axial_end: c.axial_end as f32,
                    material: model.material_index(c.cell as usize) as u32,
                    ..PathCell::zeroed()
                })
                .collect();
            cells.resize(cells.len().max(1), PathCell::zeroed());
            bytes_of(&cells)
        }
        "node_displacement" | "node_velocity" => zeros(nodes, 16),
        "corner_force" => zeros(layout.slot_count(), 16),
        "tetrahedra" => bytes_of(&tetrahedra(model, layout)),
        "mesh_nodes" => bytes_of(&mesh_nodes(model, layout)),
        "node_cells" => bytes_of(&layout.fours().cells),
        "cell_dilatation" | "cell_bulk_stiffness" => zeros(cells + 1, 4),
        "pressed_nodes" => zeros(nodes, 16),
        "node_dilatation" => zeros(nodes, 4),
        "drawn_cells" => zeros(cells + 1, 16),
        "drawn_nodes" => zeros(nodes, 16),
        "node_cures" => zeros(nodes, size_of::<NodeCures>()),
        "node_work" => zeros(nodes, 4),
        "cell_sums" => zeros(measure_threads.into(), size_of::<CellSums>()),
        "node_sums" => zeros(measure_threads.into(), size_of::<NodeSums>()),
        "cell_stiffness" => bytes_of(&vec![1.0f32; model.mesh.cell_count()]),
        "tip_state" | "tip_result" => zeros(1, size_of::<TipState>()),
        "tip_anchor_loads" => zeros(LARGEST_ANCHOR_COUNT as u64, size_of::<TipAnchorLoad>()),
        "free_tip" => bytes_of(&[free_tip(&model.free_tip())]),
        "free_cells" => bytes_of(&free_cells(model, &[])),
        "contact_records" => zeros(contacts, size_of::<ContactRecord>()),
        "face_sums" => zeros(6 * FACE_PARTS as u64, 16),
        "materials" => bytes_of(&per_material(model, |m| material(model, m))),
        "cell_material" => bytes_of(&model.cell_material.iter().map(|m| u32::from(*m)).collect::<Vec<_>>()),
        "point_history" => zeros(cells, size_of::<PointHistory>()),
        "plasticity" => bytes_of(&per_material(model, |m| {
            let p = m.plasticity.unwrap_or_default();
            PlasticityParams {
                yield_stress: p.yield_stress as f32,
                hardening: p.hardening as f32,
                ..Zeroable::zeroed()
            }
        })),
        "plastic_state" => zeros(cells, size_of::<PlasticState>()),
        "fibres" => bytes_of(&per_material(model, |m| {
            let p = m.fibres.unwrap_or_default();
            FibreParams { direction: vec4(p.direction), k1: p.k1 as f32, k2: p.k2 as f32, ..Zeroable::zeroed() }
        })),
        "prony" => bytes_of(&per_material(model, |m| prony_series(m, dt))),
        "viscous_layout" => bytes_of(&[ViscousLayout {
            entries: model.prony_term_count() as u32 + 1,
            term_count: model.prony_term_count() as u32,
            ..Zeroable::zeroed()
        }]),
        "viscous_state" => bytes_of(&viscous_state(model, dt, &vec![PointState::default(); cells as usize])),
        "damage" => bytes_of(&per_material(model, |m| {
            let p = m.damage.unwrap_or_default();
            DamageParams {
                onset: p.onset as f32,
                inverse_displacement: (1.0 / p.failure_displacement) as f32,
                largest: p.largest as f32,
                deletion: if p.deletion { 1.0 } else { 0.0 },
            }
        })),
        _ => zeros(CONTACT_PARTS as u64, size_of::<ContactSums>()),
    }
}

fn allocate(gpu: &Gpu, name: &str, contents: &Contents, kinds: &[BindingKind]) -> Result<Memory> {
    let size = match contents {
        Contents::Bytes(bytes) => bytes.len() as u64,
        Contents::Zeros(size) => *size,
    }
    .next_multiple_of(4)
    .max(4);
    let limit = gpu.device.limits().max_storage_buffer_binding_size.min(Texels::LARGEST);
    if size > limit {
        return Err(Error::input(
            format!(
                "the mesh is too fine: buffer `{name}` would need {:.0} MiB, a portable device binds {:.0} MiB",
                size as f64 / 1048576.0,
                limit as f64 / 1048576.0
            ),
            "choose a larger cell_size_mm or a smaller block, or --engine cpu",
        ));
    }
    let memory = if kinds.iter().any(|kind| matches!(kind, BindingKind::Texels | BindingKind::Sampled)) {
        Memory::Texels(Texels::new(&gpu.device, name, size, texel_numbers(name)))
    } else {
        let usage = |kind: &BindingKind| match kind {
            BindingKind::Uniform => wgpu::BufferUsages::UNIFORM,
            _ => wgpu::BufferUsages::STORAGE,
        };
        let copied = wgpu::BufferUsages::COPY_DST | wgpu::BufferUsages::COPY_SRC;
        Memory::Buffer(gpu.device.create_buffer(&wgpu::BufferDescriptor {
            label: Some(name),
            size,
            usage: kinds.iter().map(usage).fold(copied, |all, usage| all | usage),
            mapped_at_creation: false,
        }))
    };
    if let Contents::Bytes(bytes) = contents {
        memory.write(&gpu.queue, bytes);
    }
    Ok(memory)
}

/// Cells at rest with the slots of their forces.
fn tetrahedra(model: &Model, layout: &Layout) -> Vec<Tetrahedron> {
    let Some(mesh) = model.mesh.as_tets() else { return Vec::new() };
    let with = |v: DVec3, w: f64| [v.x as f32, v.y as f32, v.z as f32, w as f32];
    (0..mesh.tets.len())
        .map(|cell| {
            let [_, b, c, d] = mesh.gradients(cell);
            let volume = mesh.volume(cell);
            Tetrahedron {
                nodes: mesh.tets[cell],
                slots: layout.fours().slots[cell],
                gradient_b_and_volume: with(b, volume),
                gradient_c_and_edge: with(c, volume.cbrt()),
                gradient_d_and_material: with(d, model.material_index(cell) as f64),
            }
        })
        .collect()
}

fn mesh_nodes(model: &Model, layout: &Layout) -> Vec<MeshNode> {
    let Some(mesh) = model.mesh.as_tets() else { return Vec::new() };
    let mut volume = vec![0.0; mesh.positions.len()];
    for (cell, tet) in mesh.tets.iter().enumerate() {
        let share = 0.25 * mesh.volume(cell);
        tet.iter().for_each(|n| volume[*n as usize] += share);
    }
    let (low, high) = mesh.bounds();
    let first = &layout.fours().first;
    (0..mesh.positions.len())
        .map(|node| MeshNode {
            arm: vec4(mesh.positions[node] - 0.5 * (low + high)),
            first_four: first[node],
            end_four: first[node + 1],
            flags: model.node_flags[node],
            inverse_volume: (1.0 / volume[node]) as f32,
        })
        .collect()
}

fn params(model: &Model, dt: f64) -> Params {
    let solver = &model.scene.solver;
    Params {
        quartic: solver.hourglass_quartic as f32,
        dt: dt as f32,
        mass_damping: solver.mass_damping as f32,
        speed_limit: model.speed_limit(dt) as f32,
    }
}

/// What shaders/shared/mesh_numbers.wgsl leaves open.
fn mesh_numbers(model: &Model, layout: &Layout, measure_threads: u32) -> MeshNumbers {
    let mut numbers = MeshNumbers::from([
        ("CELL_COUNT", model.mesh.cell_count() as u32),
        ("NODE_COUNT", model.mesh.node_count() as u32),
        ("MEASURE_THREADS", measure_threads),
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
        ]);
    }
    numbers
}

/// One entry per material of a scene; the rest of the 16 repeats the first.
fn per_material<T: Copy>(model: &Model, entry: impl Fn(&Constants) -> T) -> Vec<T> {
    let mut entries: Vec<T> = model.materials.iter().map(&entry).collect();
    entries.resize(LARGEST_MATERIAL_COUNT, entries[0]);
    entries
}

fn material(model: &Model, m: &Constants) -> Material {
    let law = &m.law;
    Material {
        constants: law.isochoric.values().map(|constant| constant as f32),
        bulk_modulus: law.bulk_modulus as f32,
        shear_modulus: law.shear_modulus() as f32,
        hourglass: (model.scene.solver.hourglass_stiffness * HOURGLASS_MODULUS * law.shear_modulus()) as f32,
        law: law.isochoric.word() as u32,
    }
}

fn prony_series(m: &Constants, dt: f64) -> PronySeries {
    let mut series = PronySeries::zeroed();
    let terms = m.viscoelastic.as_ref().map_or(&[][..], |v| &v.terms);
    for (out, term) in series.terms.iter_mut().zip(terms) {
        *out = PronyTerm {
            ratio: term.ratio as f32,
            decay: term.decay(dt) as f32,
            compliance: (1.0 / (4.0 * m.law.shear_modulus() * term.ratio.max(1e-12))) as f32,
            _pad: 0.0,
        };
    }
    series
}

/// Per cell the sum of the terms and the terms.
fn viscous_state(model: &Model, dt: f64, points: &[PointState]) -> Vec<ViscousStress> {
    let count = model.prony_term_count();
    // Binary logarithms of the intervals, one byte each; a term that a material lacks never changes.
    let intervals: Vec<[u32; 2]> = model
        .materials
        .iter()
        .map(|m| {
            let mut bytes = [0u8; 8];
            for (byte, term) in bytes.iter_mut().zip(m.viscoelastic.iter().flat_map(|v| &v.terms)) {
                *byte = term.interval(dt).ilog2() as u8;
            }
            [0, 4].map(|i| u32::from_le_bytes([bytes[i], bytes[i + 1], bytes[i + 2], bytes[i + 3]]))
        })
        .collect();
    let bits = |x: f64, y: f64, z: f64, w: u32| [(x as f32).to_bits(), (y as f32).to_bits(), (z as f32).to_bits(), w];
    let entries = |q: DMat3, [first, last]: [u32; 2]| ViscousStress {
        normal: bits(q.x_axis.x, q.y_axis.y, q.z_axis.z, first),
        shear: bits(q.y_axis.x, q.z_axis.y, q.x_axis.z, last),
    };
    let mut state = Vec::with_capacity(points.len() * (count + 1));
    for (cell, point) in points.iter().enumerate() {
        let intervals = intervals[model.material_index(cell)];
        let q = |i: usize| point.viscous.get(i).copied().unwrap_or(DMat3::ZERO);
        state.push(entries((0..count).map(q).fold(DMat3::ZERO, |sum, q| sum + q), intervals));
        state.extend((0..count).map(q).map(|q| entries(q, intervals)));
    }
    state
}

fn puncture_params(model: &Model) -> PunctureParams {
    model.puncture.as_ref().map_or(PunctureParams::zeroed(), |plan| {
        let p = plan.params;
        // s0 depends on z alone, and an anchor acts on the two node planes around it.
        let mut segments = [[0.0; 4]; LARGEST_SEGMENT_COUNT];
        let mut membranes = 0;
        let last = plan.segments.len() - 1;
        for (i, out) in segments.iter_mut().enumerate() {
            let s = plan.segments[i.min(last)];
            let c = s.cutting;
            *out = [s.start, c.puncture_force, c.cutting_force, s.transition_length].map(|x| x as f32);
            membranes |= u32::from(s.membrane) << i;
        }
        let tallest = model.mesh.block().lines[2].windows(2).map(|w| w[1] - w[0]).fold(0.0, f64::max);
        let mut anchor_reach = 1.001 * tallest / plan.path.direction.z.abs();
        let (mut free_low, mut free_count, mut path_cell_count) = ([0; 4], [0; 4], plan.cells.len());
        if let Some(free) = &plan.free {
            let mesh = model.mesh.block();
            let diagonal = |index: usize| {
                let [i, j, k] = free.cell(index);
                mesh.cell_size(mesh.cell_index(i, j, k)).length()
            };
            // An anchor acts on the corners of its cell.
            anchor_reach = 1.001 * (plan.needle.radius + (0..free.cell_count()).map(diagonal).fold(0.0, f64::max));
            for (out, value) in free_low.iter_mut().zip(free.low).chain(free_count.iter_mut().zip(free.count)) {
                *out = value as u32;
            }
            for (out, i) in segments.iter_mut().zip(0..) {
                let c = free.cuttings.get(i).unwrap_or(&free.cuttings[0]);
                *out = [0.0, c.puncture_force, c.cutting_force, p.transition_length].map(|x| x as f32);
            }
            path_cell_count = free.cell_count();
        }
        PunctureParams {
            exit: plan.exit as f32,
            tip_stiffness: p.tip_stiffness as f32,
            residual_stiffness: p.residual_stiffness as f32,
            contact_stiffness: plan.contact_stiffness as f32,
            contact_damping: p.contact_damping as f32,
            entry_fade: p.entry_fade as f32,
            needle_radius: plan.needle.radius as f32,
            tip_length: plan.needle.tip_length as f32,
            anchor_reach: anchor_reach as f32,
            path_cell_count: path_cell_count as u32,
            softened_radius: p.softened_radius as f32,
            ring_radius: p.ring_radius as f32,
            membranes,
            rate_exponent: p.rate_exponent as f32,
            reference_speed: p.reference_speed as f32,
            transition_length: p.transition_length as f32,
            shift: vec4(plan.profile.shift),
            edge_radius: plan.profile.bore.map_or(0.0, |b| b.edge as f32),
            bore_radius: plan.profile.bore.map_or(0.0, |b| b.radius as f32),
            bore_grip: plan.needle.bore.map_or(0.0, |b| b.friction as f32),
            face_stiffness: plan.face_stiffness() as f32,
            face_damping: plan.face_damping as f32,
            ring_stiffness: plan.ring_stiffness_per_volume as f32,
            reference: vec4(plan.path.direction),
            free_low,
            free_count,
            segments,
            ..Zeroable::zeroed()
        }
    })
}

fn free_plan(model: &Model) -> Option<&FreePlan> {
    model.puncture.as_ref().and_then(|p| p.free.as_ref())
}

fn free_tip(tip: &needle::FreeTip) -> FreeTip {
    FreeTip {
        place: vec4(tip.place),
        along: vec4(tip.along),
        across: vec4(tip.across),
        coordinate: tip.coordinate as f32,
        entry: tip.entry as f32,
        advance: tip.advance as f32,
        inside: if tip.inside { 1.0 } else { 0.0 },
        material: tip.material as u32,
        ..Zeroable::zeroed()
    }
}

/// The cells of the box of a free path with their marked samples; without any where `samples` is empty.
fn free_cells(model: &Model, samples: &[u64]) -> Vec<FreeCell> {
    let (Some(free), Some(mesh)) = (free_plan(model), model.mesh.as_block()) else { return Vec::new() };
    (0..free.cell_count())
        .map(|index| {
            let [i, j, k] = free.cell(index);
            let cell = mesh.cell_index(i, j, k);
            let marked = samples.get(index).copied().unwrap_or(0);
            FreeCell {
                low: vec4(DVec3::new(mesh.lines[0][i], mesh.lines[1][j], mesh.lines[2][k])),
                size: vec4(mesh.cell_size(cell)),
                cell: cell as u32,
                material: model.material_index(cell) as u32,
                marked_low: marked as u32,
                marked_high: (marked >> 32) as u32,
                ..Zeroable::zeroed()
            }
        })
        .collect()
}

fn indentation_params(model: &Model) -> IndentationParams {
    let (radius, flat, bonded) = match model.scene.tool {
        Some(Tool::Sphere { radius }) => (radius, false, false),
        Some(Tool::FlatPunch { radius, bonded }) => (radius, true, bonded),
        _ => (0.0, false, false),
    };
    IndentationParams {
        radius: radius as f32,
        face_stiffness: model.indentation.map_or(0.0, |p| p.face_stiffness) as f32,
        face_damping: model.indentation.map_or(0.0, |p| p.face_damping) as f32,
        flat: flat.into(),
        bonded: bonded.into(),
        entry: [model.scene.motion.entry.x as f32, model.scene.motion.entry.y as f32],
        ..Zeroable::zeroed()
    }
}

/// Two vectors per column, in the layout that `shared/bent_column` reads.
fn bent_columns(block: &BlockMesh) -> Vec<CellEdge> {
    let [nx, ny, _] = block.cells();
    let vector = |v: [f64; 4]| {
        let [length, cube_root, quarter_inverse, _pad] = v.map(|v| v as f32);
        CellEdge { length, cube_root, quarter_inverse, _pad }
    };
    (0..nx * ny)
        .flat_map(|cell| {
            let base = PrismBase::new(block, cell);
            let [xi, eta] = base.gradients;
            [vector([xi.x, xi.y, eta.x, eta.y]), vector([base.taper.x, base.taper.y, base.area, base.area.cbrt()])]
        })
        .collect()
}

fn cohesive_params(model: &Model) -> CohesiveParams {
    let Some(law) = model.cohesion else { return CohesiveParams::zeroed() };
    let h = model.scene.tissue.cell_size;
    CohesiveParams {
        onset: (law.strength / law.penalty) as f32,
        shear_onset: (law.shear_strength / law.penalty) as f32,
        energy: (2.0 * law.energy / law.penalty) as f32,
        shear_energy: (2.0 * law.shear_energy / law.penalty) as f32,
        exponent: law.exponent as f32,
        penalty: law.penalty as f32,
        inverse_ramp: (1.0 / h) as f32,
        torn_reach: (TORN_REACH * h) as f32,
        pair_count: model.separation.pairs.len() as u32,
        ..Zeroable::zeroed()
    }
}

fn face_pairs(model: &Model, layout: &Layout) -> Vec<FacePair> {
    // Farther than any path [m].
    const NEVER: f64 = 1e6;
    let Some(block) = model.mesh.as_block() else { return Vec::new() };
    let contact_of = |node: u32| model.contact_nodes.binary_search_by_key(&node, |c| c.node).ok();
    let untouched = model.contact_nodes.iter().position(|c| !c.pushed).unwrap_or(0);
    let mut pairs: Vec<FacePair> = model
        .separation
        .pairs
        .iter()
        .map(|pair| {
            let [a, b] = pair.nodes;
            let slot = |n: u32| {
                let at = block.node_coordinates(n as usize);
                layout.strips().pair_slot(at, block.cells(), pair.axis)
            };
            let way = |[from, to]: [u32; 2], w: f64| {
                let d = block.rest_position(to as usize) - block.rest_position(from as usize);
                [d.x as f32, d.y as f32, d.z as f32, w as f32]
            };
            let [first, second] = pair.ring;
            let touched = contact_of(a).zip(contact_of(b)).filter(|_| pair.tip_driven.is_some());
            let (ca, cb) = touched.unwrap_or((untouched, untouched));
            FacePair {
                nodes: [a, b, slot(a), slot(b)],
                ring: [first[0], first[1], second[0], second[1]],
                first_way_and_area: way(first, pair.area),
                second_way_and_start: way(second, pair.tip_driven.unwrap_or(NEVER)),
                contacts: [ca as u32, cb as u32, 0, 0],
            }
        })
        .collect();
    pairs.resize(pairs.len().max(1), FacePair::zeroed());
    pairs
}

fn tied_nodes(model: &Model) -> Vec<TiedNode> {
    (0..model.mesh.node_count())
        .map(|node| {
            let mut copies = [u32::MAX; 4];
            let own = [node as u32];
            let tied = model.separation.tied(node).unwrap_or(&own);
            copies.iter_mut().zip(tied).for_each(|(place, copy)| *place = *copy);
            let whole: f64 = tied.iter().map(|n| model.node_mass[*n as usize]).sum();
            TiedNode { copies, mass: model.node_mass[node] as f32, whole_mass: whole as f32, ..Zeroable::zeroed() }
        })
        .collect()
}

fn contact_nodes(model: &Model, layout: &Layout) -> Vec<ContactNode> {
    let cells = model.mesh.block().cells();
    let mut nodes: Vec<ContactNode> = model
        .contact_nodes
        .iter()
        .map(|c| {
            let node = c.node as usize;
            let [i, j, k] = model.mesh.block().node_coordinates(node);
            let [ring_low, ring_high] = match c.faces {
                Some(faces) => [0, 4].map(|at| std::array::from_fn(|p| faces.ring[at + p])),
                None => [[0; 4]; 2],
            };
            ContactNode {
                rest: vec4(model.mesh.rest_position(node)),
                grid: [i as u32, j as u32, k as u32, 0],
                surface: match c.surface {
                    ContactSurface::OpenedPath => [0.0; 4],
                    ContactSurface::Slit { side } => vec4(side),
                    ContactSurface::OuterWall => [0.0, 0.0, 0.0, 1.0],
                    ContactSurface::Bore => [0.0, 0.0, 0.0, -1.0],
                },
                numbers: [
                    c.node,
                    layout.strips().owned_slot([i, j, k], cells),
                    c.pushed.into(),
                    c.faces.map_or(0, |f| f.present),
                ],
                sizes: [c.rest_radius, c.rest_axial, model.node_mass[node], c.share].map(|x| x as f32),
                ring_low,
                ring_high,
            }
        })
        .collect();
    nodes.resize(nodes.len().max(1), ContactNode::zeroed());
    nodes
}

/// The tensor of an entry.
fn symmetric(q: &ViscousStress) -> DMat3 {
    let number = |bits: u32| f64::from(f32::from_bits(bits));
    let ([xx, yy, zz, _], [xy, yz, zx, _]) = (q.normal.map(number), q.shear.map(number));
    DMat3::from_cols(DVec3::new(xx, xy, zx), DVec3::new(xy, yy, yz), DVec3::new(zx, yz, zz))
}

/// The centre-line of a frame in the layout of the shader.
fn centre_line(line: &crate::needle::centre_line::CentreLine) -> CentreLine {
    CentreLine {
        per_length: (1.0 / line.spacing) as f32,
        first_step: line.first_step as u32,
        offset: line.offset.map(vec4),
        rate: line.rate.map(vec4),
        ..Zeroable::zeroed()
    }
}

/// The input of step `number` in the layout of the shader.
fn step_input(input: &crate::engine::StepInput, number: u64, dt: f64) -> StepInput {
    // Multiples of the golden ratio: any run of steps sees all offsets alike, so rounding errors cancel.
    const GOLDEN: f64 = 0.618_033_988_749_895;
    let mut out = StepInput {
        load_factor: input.load_factor as f32,
        step: input.step as u32,
        // Below 1 in f32 too, so that a face at rest stays at rest.
        rounding: ((number as f64 * GOLDEN).fract() as f32).min(0.999_999),
        ..StepInput::zeroed()
    };
    if let Some(pose) = input.pose {
        let with = |v: DVec3, w: f64| [v.x as f32, v.y as f32, v.z as f32, w as f32];
        let spin = pose.angular_velocity;
        out.tip = with(pose.tip, spin.x);
        out.velocity = with(pose.velocity, spin.y);
        out.direction = with(pose.direction, spin.z);
        out.velocity_ahead = vec4(pose.velocity_ahead);
        out.angular_velocity_ahead = vec4(pose.angular_velocity_ahead);
        out.depth = pose.depth as f32;
    }
    for (out, drive) in out.drives.iter_mut().zip(&input.drives) {
        *out = DriveStep {
            translation_rate: vec4(drive.translation / dt),
            cosine_rate: (drive.cosine / dt) as f32,
            sine_rate: (drive.sine / dt) as f32,
            _pad0: 0.0,
            _pad1: 0.0,
        };
    }
    out
}

impl Engine for GpuEngine {
    fn info(&self) -> &EngineInfo {
        &self.info
    }

    fn start_frame(&mut self, plan: &FramePlan) -> Result<()> {
        if plan.steps.len() > self.max_steps {
            return Err(Error::Device(format!(
                "a frame of {} steps does not fit the {} that were planned",
                plan.steps.len(),
                self.max_steps
            )));
        }
        if self.in_flight.len() == RING {
            self.collect_oldest(true)?;
        }
        if let Some(buffer) = self.buffers.get(STEP_INPUT) {
            let numbered = (plan.first_step..).zip(&plan.steps);
            let mut inputs = vec![0; plan.steps.len() * STEP_STRIDE];
            for (place, (n, s)) in inputs.chunks_exact_mut(STEP_STRIDE).zip(numbered) {
                place[..size_of::<StepInput>()].copy_from_slice(bytemuck::bytes_of(&step_input(s, n, self.dt)));
            }
            buffer.write(&self.gpu.queue, &inputs);
        }
        if let (Some(buffer), Some(line)) = (self.buffers.get("centre_line"), &plan.centre_line) {
            buffer.write(&self.gpu.queue, bytemuck::bytes_of(&centre_line(line)));
        }
        let mut encoder = self.gpu.device.create_command_encoder(&Default::default());
        if self.pace.must_learn() {
            self.wait_for_oldest()?;
        }
        let mut from = 0;
        match plan.steps.len().checked_sub(1) {
            Some(last) => {
                // The rest goes with the step that is measured.
                while last - from > self.pace.steps() {
                    let part = from..from + self.pace.steps();
                    from = part.end;
                    self.encode_steps(&mut encoder, part.clone())?;
                    let next = self.gpu.device.create_command_encoder(&Default::default());
                    self.submit(std::mem::replace(&mut encoder, next), part.len())?;
                    if self.pace.must_learn() {
                        self.wait_for_oldest()?;
                    }
                }
                self.encode_steps(&mut encoder, from..last)?;
                self.encode_measured_step(&mut encoder, last);
            }
            None => self.encode_selected(&mut encoder, 0, |stage| stage.averages() || stage.once_per_frame()),
        }
        let slot = (0..RING).find(|s| self.in_flight.iter().all(|f| f.slot != *s)).unwrap_or(0);
        for range in &self.results {
            let source = &self.buffers[range.name];
            source.encode_copy(&mut encoder, (range.from, range.size), (&self.staging[slot], range.offset));
        }
        let submission = self.submit(encoder, plan.steps.len() - from)?;
        let mapped = map_for_reading(&self.staging[slot]);
        self.in_flight.push_back(InFlight {
            slot,
            frame: plan.frame,
            steps: plan.steps.len() as u32,
            submission,
            mapped,
        });
        Ok(())
    }

    fn collect(&mut self, wait: bool) -> Result<Option<FrameSums>> {
        if self.finished.is_empty() {
            self.collect_oldest(wait)?;
        }
        Ok(self.finished.pop_front())
    }

    fn retune(&mut self, model: Arc<Model>, dt: f64, steps: usize) -> Result<bool> {
        while self.collect_oldest(true)? {}
        let features = |m: &Model| Features { drawn: self.kernels.iter().any(|k| k.stage.draws()), ..Features::of(m) };
        let (old, new) = (features(&self.model), features(&model));
        let measured = measure_threads(&model);
        let fits = steps <= self.max_steps
            && defines(&model.effects, &new) == defines(&self.model.effects, &old)
            && self.kernels.iter().all(|k| k.threads() == threads(k.stage, &model, &self.layout, measured));
        if !fits {
            return Ok(false);
        }
        let mut writes = Vec::new();
        for (name, buffer) in &self.buffers {
            // Cells of the path count what they lose; between frames that has been told.
            let state = self.kept.contains(name) && *name != "path_cells";
            if state || FRAME_RESULTS.contains(name) || DRAWN.contains(name) || PER_FRAME.contains(name) {
                continue;
            }
            if let Contents::Bytes(bytes) = contents(name, &model, &self.layout, dt, measured, self.max_steps) {
                if (bytes.len() as u64).next_multiple_of(4).max(4) != buffer.size() {
                    return Ok(false);
                }
                writes.push((buffer.clone(), bytes));
            }
        }
        // What the Prony terms remember is kept in a form that depends on the step.
        let viscous = model.effects.viscoelastic.is_some();
        if viscous && model.prony_term_count() != self.model.prony_term_count() {
            return Ok(false);
        }
        let state = if viscous { Some(self.read_state()?) } else { None };
        for (buffer, bytes) in &writes {
            buffer.write(&self.gpu.queue, bytes);
        }
        (self.model, self.dt) = (model, dt);
        if let Some(state) = state {
            self.write_state(&state)?;
        }
        let gravity = self.model.effects.gravity.map_or(DVec3::ZERO, |g| g.acceleration);
        self.gravity_work = self.moment.dot(gravity);
        Ok(true)
    }

    fn read_state(&mut self) -> Result<State> {
        const OPTIONAL: [&str; 9] = [
            "pair_states",
            "cell_stiffness",
            "tip_state",
            "free_tip",
            "free_cells",
            "contact_records",
            "plastic_state",
            "viscous_state",
            "point_history",
        ];
        let names: Vec<&'static str> = ["node_displacement", "node_velocity"]
            .into_iter()
            .chain(OPTIONAL.into_iter().filter(|name| self.buffers.contains_key(name)))
            .collect();
        let bytes = self.read_buffers(&names)?;
        let mut state = State::default();
        if self.model.has_history() {
            state.points = vec![PointState::default(); self.model.mesh.cell_count()];
        }
        let vector = |v: [f32; 4]| DVec3::new(v[0].into(), v[1].into(), v[2].into());
        for (name, bytes) in names.iter().zip(&bytes) {
            match *name {
                "node_displacement" => {
                    state.displacement = read_all(bytes).map(displacement).collect();
                }
                "node_velocity" => state.velocity = read_all::<[f32; 4]>(bytes).map(vector).collect(),
                "cell_stiffness" => state.stiffness = read_all::<f32>(bytes).map(f64::from).collect(),
                "tip_state" => {
                    for tip in read_all::<TipState>(bytes) {
                        state.tip_coordinate = tip.coordinate.into();
                        state.bond =
                            Bond { stretch: tip.bond_stretch.into(), slid: tip.bond_slid.into(), gap: tip.gap.into() };
                    }
                }
                "free_tip" => {
                    for t in read_all::<FreeTip>(bytes) {
                        state.tip_coordinate = t.coordinate.into();
                        state.tip = needle::FreeTip {
                            place: vector(t.place),
                            along: vector(t.along),
                            across: vector(t.across),
                            coordinate: t.coordinate.into(),
                            entry: t.entry.into(),
                            advance: t.advance.into(),
                            material: t.material as usize,
                            inside: t.inside != 0.0,
                        };
                    }
                }
                "free_cells" => {
                    let marked = |c: FreeCell| u64::from(c.marked_low) | u64::from(c.marked_high) << 32;
                    state.cut_samples = read_all::<FreeCell>(bytes).map(marked).collect();
                }
                "contact_records" => {
                    state.contact = read_all::<ContactRecord>(bytes)
                        .map(|m| {
                            let [overlap, axial_on, touching, on_shaft] = m.touch;
                            let [passed, rest_radius, damping_y, damping_z] = m.path;
                            ContactState {
                                stick: vector(m.stick),
                                overlap: overlap.into(),
                                axial_on: axial_on.into(),
                                touching: touching != 0.0,
                                on_shaft: on_shaft != 0.0,
                                rest_radius: rest_radius.into(),
                                passed: passed != 0.0,
                                damping: DVec3::new(m.stick[3].into(), damping_y.into(), damping_z.into()),
                                stored: m.energies[3].into(),
                            }
                        })
                        .collect();
                }
                "pair_states" => {
                    let count = self.model.separation.pairs.len();
                    state.pairs = read_all::<PairState>(bytes).map(|p| p.damage.into()).take(count).collect();
                }
                "plastic_state" => {
                    for (point, p) in state.points.iter_mut().zip(read_all::<PlasticState>(bytes)) {
                        point.plastic.inverse_flow = DMat3::from_cols(vector(p.x), vector(p.y), vector(p.z));
                        point.plastic.alpha = p.x[3].into();
                    }
                }
                "viscous_state" => {
                    let all: Vec<ViscousStress> = read_all(bytes).collect();
                    for (point, cell) in state.points.iter_mut().zip(all.chunks(self.model.prony_term_count() + 1)) {
                        point.viscous = cell[1..].iter().map(symmetric).collect();
                    }
                }
                _ => {
                    for (point, h) in state.points.iter_mut().zip(read_all::<PointHistory>(bytes)) {
                        point.plastic_dissipation = h.flow.into();
                        point.damage_dissipation = h.degradation.into();
                        point.viscous_work = h.relaxation_work.into();
                    }
                }
            }
        }
        Ok(state)
    }

    fn write_state(&mut self, state: &State) -> Result<()> {
        while self.collect_oldest(true)? {}
        if state.displacement.len() != self.model.mesh.node_count() {
            return Err(Error::Device("state of another mesh".into()));
        }
        let fixed = |x: f64| (x / DISPLACEMENT_UNIT).round() as i32;
        let u: Vec<[i32; 4]> = state.displacement.iter().map(|u| [fixed(u.x), fixed(u.y), fixed(u.z), 0]).collect();
        let v: Vec<[f32; 4]> = state.velocity.iter().map(|v| vec4(*v)).collect();
        let write = |name: &str, bytes: &[u8]| {
            if let Some(buffer) = self.buffers.get(name) {
                buffer.write(&self.gpu.queue, bytes);
            }
        };
        write("node_displacement", bytemuck::cast_slice(&u));
        write("node_velocity", bytemuck::cast_slice(&v));
        let stiffness: Vec<f32> = state.stiffness.iter().map(|s| *s as f32).collect();
        write("cell_stiffness", bytemuck::cast_slice(&stiffness));
        let tip = TipState {
            coordinate: state.tip_coordinate as f32,
            bond_stretch: state.bond.stretch as f32,
            bond_slid: state.bond.slid as f32,
            gap: state.bond.gap as f32,
            ..TipState::zeroed()
        };
        write("tip_state", bytemuck::bytes_of(&tip));
        write("free_tip", bytemuck::bytes_of(&free_tip(&state.tip)));
        write("free_cells", bytemuck::cast_slice(&free_cells(&self.model, &state.cut_samples)));
        let memory: Vec<ContactRecord> = state
            .contact
            .iter()
            .map(|c| {
                let one = |yes: bool| if yes { 1.0 } else { 0.0 };
                ContactRecord {
                    stick: [c.stick.x as f32, c.stick.y as f32, c.stick.z as f32, c.damping.x as f32],
                    touch: [c.overlap as f32, c.axial_on as f32, one(c.touching), one(c.on_shaft)],
                    energies: [0.0, 0.0, 0.0, c.stored as f32],
                    path: [one(c.passed), c.rest_radius as f32, c.damping.y as f32, c.damping.z as f32],
                    ..Zeroable::zeroed()
                }
            })
            .collect();
        write("contact_records", bytemuck::cast_slice(&memory));
        let pairs: Vec<PairState> =
            state.pairs.iter().map(|d| PairState { damage: *d as f32, ..Zeroable::zeroed() }).collect();
        write("pair_states", bytemuck::cast_slice(&pairs));
        let column = |v: DVec3, w: f64| [v.x as f32, v.y as f32, v.z as f32, w as f32];
        let plastic: Vec<PlasticState> = state
            .points
            .iter()
            .map(|p| {
                let g = p.plastic.inverse_flow;
                PlasticState {
                    x: column(g.x_axis, p.plastic.alpha),
                    y: column(g.y_axis, 0.0),
                    z: column(g.z_axis, 0.0),
                }
            })
            .collect();
        write("plastic_state", bytemuck::cast_slice(&plastic));
        let viscous = viscous_state(&self.model, self.dt, &state.points);
        write("viscous_state", bytemuck::cast_slice(&viscous));
        let history: Vec<PointHistory> = state
            .points
            .iter()
            .map(|p| PointHistory { relaxation_work: p.viscous_work as f32, ..Zeroable::zeroed() })
            .collect();
        write("point_history", bytemuck::cast_slice(&history));
        if let Some(gravity) = self.model.effects.gravity {
            let motion = state.displacement.iter().zip(&state.velocity);
            self.moment = moment(motion.map(|(u, v)| (*u, *v)), &self.model, self.dt);
            self.gravity_work = self.moment.dot(gravity.acceleration);
        }
        Ok(())
    }

    fn save(&mut self) -> Result<EngineImage> {
        let names = self.kept.clone();
        let bytes = self.read_buffers(&names)?;
        let buffers = names.iter().map(|name| name.to_string()).zip(bytes).collect();
        Ok(EngineImage::Gpu { buffers, gravity_work: self.gravity_work })
    }

    fn restore(&mut self, image: &EngineImage) -> Result<()> {
        while self.collect_oldest(true)? {}
        self.finished.clear();
        let EngineImage::Gpu { buffers, gravity_work } = image else { return Err(foreign_image("gpu", image)) };
        let fits = |(name, bytes): &(String, Vec<u8>)| {
            self.buffers.get(name.as_str()).is_some_and(|buffer| buffer.size() == bytes.len() as u64)
        };
        if buffers.len() != self.kept.len() || !buffers.iter().all(fits) {
            return Err(foreign_image("gpu", image));
        }
        for (name, bytes) in buffers {
            self.buffers[name.as_str()].write(&self.gpu.queue, bytes);
        }
        self.gravity_work = *gravity_work;
        let bytes_of = |wanted: &str| buffers.iter().find(|(name, _)| name == wanted).map(|(_, bytes)| bytes);
        if let (Some(u), Some(v)) = (bytes_of("node_displacement"), bytes_of("node_velocity")) {
            let velocities = read_all::<[f32; 4]>(v).map(|v| DVec3::new(v[0].into(), v[1].into(), v[2].into()));
            self.moment = moment(read_all(u).map(displacement).zip(velocities), &self.model, self.dt);
        }
        Ok(())
    }

    fn lose_device(&mut self) {
        self.gpu.lose();
    }

    fn internal_forces(&mut self) -> Result<Vec<DVec3>> {
        while self.collect_oldest(true)? {}
        // The stage also brings histories to its step; they are put back afterwards.
        let history = if self.model.has_history() { Some(self.read_state()?) } else { None };
        let mut encoder = self.gpu.device.create_command_encoder(&Default::default());
        {
            let mut pass = encoder.begin_compute_pass(&Default::default());
            for kernel in self.kernels.iter().filter(|k| k.stage.gives_forces()) {
                kernel.encode(&mut pass, 0);
            }
        }
        self.gpu.queue.submit([encoder.finish()]);
        let bytes = self.read_buffers(&["corner_force"])?;
        if let Some(state) = history {
            self.write_state(&state)?;
        }
        let slots: Vec<[f32; 4]> = read_all(&bytes[0]).collect();
        Ok(self.layout.internal_forces(&self.model.mesh, &slots))
    }
}
