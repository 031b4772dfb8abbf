//! Opening the window: display, device, the first attempt; and why it may not open.

use std::sync::Arc;
use std::time::Instant;

use egui_wgpu::RendererOptions;
use winit::event_loop::ActiveEventLoop;
use winit::window::Window;

use super::canvas::canvas;
use super::renewal::shader_files;
use super::{App, Open};
use crate::gpu::Gpu;
use crate::window::anatomy_view::legend;
use crate::window::camera::Camera;
use crate::window::devices::Devices;
use crate::window::foresight::Foresight;
use crate::window::grip::Grip;
use crate::window::hand::{Desk, Recording};
use crate::window::kernels_on_disk::KernelsOnDisk;
use crate::window::lost_display::OpenWindow;
use crate::window::panels::Choices;
use crate::window::practice::{Leader, Practice, State};
use crate::window::scan::Scan;
use crate::window::scene_view::SceneView;
use crate::window::texts;
use crate::window::watch::Watch;
use crate::{Error, Result};

/// Size of the window at the start, in points.
const SIZE: [u32; 2] = [1280, 800];

impl App {
    pub(super) fn open_window(&mut self, event_loop: &ActiveEventLoop) -> Result<Open> {
        let refused = |reason: String| no_display(&reason);
        let [width, height] = self.options.size().unwrap_or(SIZE);
        let attributes = Window::default_attributes()
            .with_title(format!("{} - {}", texts::TITLE, self.scene.title))
            .with_inner_size(winit::dpi::LogicalSize::new(width, height));
        let window = Arc::new(event_loop.create_window(attributes).map_err(|e| refused(e.to_string()))?);
        let display = Box::new(event_loop.owned_display_handle());
        let instance = wgpu::Instance::new(wgpu::InstanceDescriptor::new_with_display_handle_from_env(display));
        let surface = instance.create_surface(window.clone()).map_err(|e| no_driver(&e.to_string()))?;
        let (gpu, adapter) = Gpu::for_surface(&instance, &surface)?;
        let leader = if self.options.script { Leader::Script } else { Leader::Hand };
        let practice = Practice::new(
            self.scene.clone(),
            self.source.clone(),
            gpu.clone(),
            leader,
            self.options.out.as_deref(),
            self.options.force,
        )?;
        let size = window.inner_size();
        let config = configuration(&surface, &adapter, [size.width.max(1), size.height.max(1)])?;
        surface.configure(&gpu.device, &config);
        let canvas = canvas(&gpu, &config);
        let (egui, painter) = panels(&gpu, &window, config.format);
        let mut practice = practice;
        let model = practice.simulation.model.clone();
        let engine = practice.simulation.on_device();
        let engine = engine.ok_or_else(|| Error::Device("the window needs the engine of a device".into()))?;
        let view = SceneView::new(&gpu, engine, &model, config.format)?;
        let (low, high) = model.mesh.bounds();
        let centre = 0.5 * (low + high);
        let camera = Camera::around(centre.as_vec3(), (0.62 * (high - low).length()) as f32);
        // Open through the entry point, so that the needle is seen.
        let at = (self.scene.motion.entry.y - low.y) / (high.y - low.y);
        // That of the script, which mass scaling is chosen for; a slider has others.
        let desk = Desk::new(self.scene.motion.largest_speed().min(practice.speed_limit));
        if self.options.script || self.recorded.is_some() || self.options.frames.is_some() {
            practice.state = State::Running;
        }
        // Only Mesa is known to keep the kernels of a software adapter on disk. Another process has the shaders of this program.
        if gpu.is_software() && cfg!(target_os = "linux") && self.options.shaders.is_none() {
            practice.tuning.kernels = Some(KernelsOnDisk::default());
        }
        let devices = Devices::open(&self.options, desk.speed)?;
        let now = Instant::now();
        let mut open = Open {
            alive: OpenWindow::with(practice.folder()),
            window,
            surface,
            config,
            gpu,
            egui,
            painter,
            view,
            scan: Scan::default(),
            practice,
            foresight: Foresight::default(),
            desk,
            devices,
            recording: self.recorded.as_ref().map(|session| Recording::new(session.poses.clone())),
            recorded: self.recorded.clone(),
            choices: Choices { error_bar: self.options.error_bar, ..Choices::new(Some((1, at)), self.options.pace) },
            camera,
            ahead: false,
            due: 0.0,
            counted: now,
            next: now,
            shown: now,
            pictures: 0,
            canvas,
            area: egui::Rect::NOTHING,
            scale: 1.0,
            presented: None,
            longest_pause: 0.0,
            ranged: None,
            panelled: None,
            panel_count: 0,
            stale: true,
            scene_file: Watch::new([self.source.path.clone()]),
            shader_files: Watch::new(self.options.shaders.iter().flat_map(|folder| shader_files(folder))),
            control: false,
            grip: Grip::Camera,
            debriefing: None,
        };
        open.choices.look.probe.on = self.options.ultrasound;
        open.choices.parts = legend(&model);
        open.cut();
        Ok(open)
    }
}

/// How pictures come onto the display.
fn configuration(
    surface: &wgpu::Surface,
    adapter: &wgpu::Adapter,
    [width, height]: [u32; 2],
) -> Result<wgpu::SurfaceConfiguration> {
    let mut config = surface
        .get_default_config(adapter, width, height)
        .ok_or_else(|| no_display("the adapter cannot draw into this window"))?;
    // The panels blend bytes, not light.
    let formats = surface.get_capabilities(adapter).formats;
    config.format = formats.into_iter().find(|f| !f.is_srgb()).unwrap_or(config.format);
    config.present_mode = wgpu::PresentMode::AutoNoVsync;
    config.usage = wgpu::TextureUsages::COPY_DST;
    Ok(config)
}

/// What the panels take their input from, and what draws them.
fn panels(gpu: &Gpu, window: &Window, format: wgpu::TextureFormat) -> (egui_winit::State, egui_wgpu::Renderer) {
    let context = egui::Context::default();
    let largest = gpu.device.limits().max_texture_dimension_2d as usize;
    let scale = Some(window.scale_factor() as f32);
    let egui = egui_winit::State::new(context, egui::ViewportId::ROOT, window, scale, None, Some(largest));
    let options = RendererOptions { dithering: false, ..Default::default() };
    (egui, egui_wgpu::Renderer::new(&gpu.device, format, options))
}

/// The reason of a library without the place in its source, which helps nobody who wants a window: `os error at FILE.rs:LINE: REASON`.
fn without_place(reason: &str) -> &str {
    reason.split_once(".rs:").and_then(|(_, rest)| rest.split_once(": ")).map_or(reason, |(_, reason)| reason)
}

/// There is a display, and nothing that can draw on it.
fn no_driver(reason: &str) -> Error {
    Error::input(
        format!("no graphics driver can draw on this display: {}", reason.trim_end_matches(": {}")),
        "install a Vulkan driver (Debian/Ubuntu: mesa-vulkan-drivers, which draws without a graphics card too), look at `stylet \
         adapters`, or use `stylet run`, which needs no picture and computes on the processor where there is no adapter",
    )
}

pub(super) fn no_display(reason: &str) -> Error {
    Error::input(
        format!("no window can be opened here: {}", without_place(reason)),
        "start it on a desktop; on a terminal alone use `stylet run` (pictures, charts and tables in a folder) or a virtual \
         display: xvfb-run stylet view. Debian/Ubuntu: libx11-6 libxcursor1 libxi6 libxrandr2 libxkbcommon-x11-0",
    )
}
