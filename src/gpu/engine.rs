//! The GPU engine: buffers and kernels of the chosen effects, one submission per frame, a ring of read-backs.

use std::collections::{BTreeMap, VecDeque};
use std::sync::Arc;
use std::sync::atomic::{AtomicU8, Ordering};

use glam::DVec3;
use rayon::prelude::*;

use super::arrays::{
    self, Contents, Exchange, Life, STEP_INPUT, STEP_STRIDE, Source, Sums, centre_line, displacement, read_all,
    step_input,
};
use super::device::Gpu;
use super::grain::Grain;
use super::kernel::{BindingKind, Compiled, Kernel};
use super::layout::{Layout, strip_layers};
use super::memory::{Memory, allocate};
use super::pace::Pace;
use super::plan::{Features, defines, mesh_numbers, stages, threads};
use super::structs::StepInput;
use crate::engine::{Engine, EngineImage, EngineInfo, FramePlan, FrameSums, Health, Stage, State, foreign_image};
use crate::error::{Error, Result};
use crate::material_point::PointState;
use crate::model::Model;

/// Frames whose results may be under way.
const RING: usize = 3;

/// How long the mapping of a finished submission may take.
const MAPPING_PATIENCE: std::time::Duration = std::time::Duration::from_secs(10);

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
    pub(super) model: Arc<Model>,
    gpu: Gpu,
    info: EngineInfo,
    pub(super) layout: Layout,
    pub(super) grain: Grain,
    dt: f64,
    pub(super) kernels: Vec<Kernel>,
    pub(super) buffers: BTreeMap<&'static str, Memory>,
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
        let layers = strip_layers(model.mesh.cell_count(), gpu.is_software());
        let layout = Layout::new(&model.mesh, layers);
        let grain = Grain::of(&model, gpu.wide);
        let features = Features { drawn, wide: grain.wide, ..Features::of(&model) };
        let defines = defines(&model.effects, &features);
        let numbers = mesh_numbers(&model, &layout, grain);
        let source = Source { model: &model, layout: &layout, dt, grain, max_steps, opening: Default::default() };
        // Composing, validating and compiling go side by side: they are most of the time to the first step.
        let compiled = stages(&model.effects, &features)
            .into_par_iter()
            .map(|stage| gpu.kernels.compiled(&gpu.device, stage, &defines, &numbers, gpu.texels))
            .collect::<Result<Vec<Arc<Compiled>>>>()?;
        let scope = gpu.device.push_error_scope(wgpu::ErrorFilter::Validation);
        compiled.iter().try_for_each(|kernel| binds_few(kernel))?;
        let buffers = allocated(&gpu, &compiled, &source)?;
        // What a shader writes and a later step may read; sums of a frame are written whole.
        let kept: Vec<&'static str> = arrays::all()
            .filter(|array| !matches!(array.life, Life::Result | Life::Drawn))
            .map(|array| array.name)
            .filter(|name| compiled.iter().flat_map(|r| &r.bindings).any(|b| b.writable && b.name == *name))
            .collect();
        let kernels = compiled
            .into_iter()
            .map(|r| {
                let threads = threads(r.stage, &model, &layout, grain);
                Kernel::new(&gpu.device, r, &buffers, size_of::<StepInput>() as u64, threads)
            })
            .collect::<Result<Vec<Kernel>>>()?;
        let results = result_ranges(&buffers, &source);
        let size = results.iter().map(|range| range.size).sum::<u64>();
        let staging: Vec<wgpu::Buffer> = (0..RING)
            .map(|_| {
                gpu.device.create_buffer(&wgpu::BufferDescriptor {
                    label: Some("frame results"),
                    size,
                    usage: wgpu::BufferUsages::COPY_DST | wgpu::BufferUsages::MAP_READ,
                    mapped_at_creation: false,
                })
            })
            .collect();
        let bytes = buffers.values().map(Memory::device_bytes).sum::<u64>() + size * RING as u64;
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
            grain,
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

    /// What it computes.
    pub(crate) fn model(&self) -> &Arc<Model> {
        &self.model
    }

    /// Takes the displacement of a state that another engine computed, and nothing else of it.
    pub(crate) fn write_displacement(&mut self, state: &State) {
        let source = self.source();
        for array in arrays::all().filter(|array| array.name == "node_displacement") {
            if let (Some(buffer), Some(exchange)) = (self.buffers.get(array.name), array.state) {
                buffer.write(&self.gpu.queue, &(exchange.write)(&source, state));
            }
        }
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

    /// What arrays are filled from.
    fn source(&self) -> Source<'_> {
        Source {
            model: &self.model,
            layout: &self.layout,
            dt: self.dt,
            grain: self.grain,
            max_steps: self.max_steps,
            opening: Default::default(),
        }
    }

    /// Adds the partial sums of a frame in f64.
    fn sum_up(&mut self, done: &InFlight, view: &[u8]) -> FrameSums {
        let sums = FrameSums {
            frame: done.frame,
            steps: done.steps,
            health: Health { min_j: f64::INFINITY, min_corner_j: f64::INFINITY, ..Default::default() },
            ..Default::default()
        };
        let has_steps = if done.steps > 0 { 1.0 } else { 0.0 };
        let mut out = Sums { sums, has_steps, moment: DVec3::ZERO, corners: Vec::new() };
        for range in &self.results {
            let bytes = &view[range.offset as usize..(range.offset + range.size) as usize];
            match arrays::find(range.name).and_then(|array| array.add) {
                Some(add) => add(bytes, &mut out),
                None => out.corners.extend(read_all(bytes).map(displacement)),
            }
        }
        let Sums { mut sums, moment: weighted, corners, .. } = out;
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

/// The arrays that the stages bind, with what they begin with.
fn allocated(gpu: &Gpu, compiled: &[Arc<Compiled>], source: &Source) -> Result<BTreeMap<&'static str, Memory>> {
    let mut buffers = BTreeMap::new();
    for binding in compiled.iter().flat_map(|r| &r.bindings) {
        let Some(array) = arrays::find(&binding.name) else {
            return Err(Error::Shader {
                stage: "bindings".into(),
                message: format!("the engine knows no buffer `{}`", binding.name),
            });
        };
        let name = array.name;
        if buffers.contains_key(name) {
            continue;
        }
        let contents = (array.fill)(source);
        // One stage may read what another one writes.
        let kinds: Vec<BindingKind> =
            compiled.iter().flat_map(|r| &r.bindings).filter(|b| b.name == name).map(|b| b.kind).collect();
        let buffer = allocate(gpu, name, &contents, &kinds)?;
        buffers.insert(name, buffer);
    }
    Ok(buffers)
}

/// What is read back of every frame: sums, and displacements around the targets.
fn result_ranges(buffers: &BTreeMap<&'static str, Memory>, source: &Source) -> Vec<ResultRange> {
    let mut offset = 0;
    let sums = arrays::all()
        .filter(|array| array.add.is_some())
        .filter_map(|array| Some((array, buffers.get(array.name)?.size())))
        .map(|(array, size)| (array.name, (array.told_from)(source), size))
        .map(|(name, from, size)| (name, from, size - from));
    // Of the displacements only those around the targets.
    let corners = source.model.targets.iter().flat_map(|target| target.nodes).map(|node| {
        let size = size_of::<[i32; 4]>() as u64;
        ("node_displacement", u64::from(node) * size, size)
    });
    sums.chain(corners)
        .map(|(name, from, size)| {
            offset += size;
            ResultRange { name, from, offset: offset - size, size }
        })
        .collect()
}

/// Refuses a stage that binds more arrays than a portable device does: with many effects and one of the program's own.
fn binds_few(kernel: &Compiled) -> Result<()> {
    let most = wgpu::Limits::default().max_storage_buffers_per_shader_stage as usize;
    let count = kernel.bindings.iter().filter(|b| b.kind == BindingKind::Storage).count();
    if count <= most {
        return Ok(());
    }
    Err(Error::input(
        format!("the stage {} would bind {count} arrays, a portable device binds {most}", kernel.stage.name()),
        "remove one of the effects that remember something in a cell, or the regions, or use --engine cpu",
    ))
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

/// Sum of mass without scaling times displacement half a step ago, where the velocity `v` of (u, v) is known [kg m]: the work of a
/// uniform field is its change, with the mean of the old and the new velocity of each step as for every other load.
fn moment(nodes: impl Iterator<Item = (DVec3, DVec3)>, model: &Model, dt: f64) -> DVec3 {
    let sum: DVec3 = nodes.zip(&model.node_mass).map(|((u, v), m)| (u - v * (0.5 * dt)) * *m).sum();
    sum / model.mass_scaling()
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
            let origin = self.model.laid.as_ref().and(self.model.puncture.as_ref()).map(|plan| plan.path.entry);
            let mut inputs = vec![0; plan.steps.len() * STEP_STRIDE];
            for (place, (n, s)) in inputs.chunks_exact_mut(STEP_STRIDE).zip(numbered) {
                place[..size_of::<StepInput>()].copy_from_slice(bytemuck::bytes_of(&step_input(s, n, self.dt, origin)));
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
        let drawn = self.kernels.iter().any(|k| k.stage.draws());
        let features = |m: &Model| Features { drawn, wide: self.grain.wide, ..Features::of(m) };
        let (old, new) = (features(&self.model), features(&model));
        let grain = Grain::of(&model, self.gpu.wide);
        let fits = steps <= self.max_steps
            && defines(&model.effects, &new) == defines(&self.model.effects, &old)
            && self.kernels.iter().all(|k| k.threads() == threads(k.stage, &model, &self.layout, grain));
        if !fits {
            return Ok(false);
        }
        let mut writes = Vec::new();
        let (layout, max_steps) = (&self.layout, self.max_steps);
        let source = Source { model: &model, layout, dt, grain, max_steps, opening: Default::default() };
        for array in arrays::all() {
            let Some(buffer) = self.buffers.get(array.name) else { continue };
            let state = self.kept.contains(&array.name) && array.life != Life::Told;
            if state || matches!(array.life, Life::Result | Life::Drawn | Life::Input) {
                continue;
            }
            if let Contents::Bytes(bytes) = (array.fill)(&source) {
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
        let held: Vec<(&'static str, Exchange)> = arrays::all()
            .filter(|array| self.buffers.contains_key(array.name))
            .filter_map(|array| Some((array.name, array.state?)))
            .collect();
        let names: Vec<&'static str> = held.iter().map(|(name, _)| *name).collect();
        let bytes = self.read_buffers(&names)?;
        let mut state = State::default();
        if self.model.has_history() {
            state.points = vec![PointState::default(); self.model.mesh.cell_count()];
        }
        for ((_, exchange), bytes) in held.iter().zip(&bytes) {
            (exchange.read)(bytes, &self.model, &mut state);
        }
        Ok(state)
    }

    fn write_state(&mut self, state: &State) -> Result<()> {
        while self.collect_oldest(true)? {}
        if state.displacement.len() != self.model.mesh.node_count() {
            return Err(Error::Device("state of another mesh".into()));
        }
        let source = self.source();
        for array in arrays::all() {
            if let (Some(buffer), Some(exchange)) = (self.buffers.get(array.name), array.state) {
                buffer.write(&self.gpu.queue, &(exchange.write)(&source, state));
            }
        }
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
