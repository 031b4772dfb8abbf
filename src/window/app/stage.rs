//! The window with its device, whatever screen fills it: surface, canvas, input of the panels, pictures shown and counted.

use std::path::Path;
use std::sync::Arc;
use std::time::{Duration, Instant};

use egui_wgpu::{RendererOptions, ScreenDescriptor};
use winit::event_loop::{ActiveEventLoop, EventLoopProxy};
use winit::window::Window;

use super::display::{no_display, no_driver};
use super::reader::{self, Message};
use crate::Result;
use crate::commands::view::ViewArgs;
use crate::gpu::Gpu;
use crate::window::help::{Help, Topic};
use crate::window::lost_display::OpenWindow;
use crate::window::settings::Settings;
use crate::window::theme;
use crate::words::say;

/// Size of the window at the start, in points.
const SIZE: [u32; 2] = [1280, 800];
/// Lines of a monitor on which texts have their own size, in points.
const LINES: f64 = 1200.0;
/// Shortest time between two pictures [s].
pub const PICTURE: f64 = 1.0 / 60.0;
/// Longest time between two pictures of a screen that nothing happens on [s].
const IDLE: f64 = 0.25;
/// Pictures after which pauses are counted.
const WARM_UP: u64 = 5;

/// The panels as triangles.
pub struct Panels {
    pub triangles: Vec<egui::ClippedPrimitive>,
    textures: egui::TexturesDelta,
    /// When they want to be drawn again without any input.
    pub again: Duration,
}

/// An open window.
pub struct Stage {
    /// Has the last word where the display goes down.
    pub alive: OpenWindow,
    pub help: Help,
    pub window: Arc<Window>,
    surface: wgpu::Surface<'static>,
    pub config: wgpu::SurfaceConfiguration,
    pub gpu: Gpu,
    pub egui: egui_winit::State,
    pub painter: egui_wgpu::Renderer,
    /// What the window shows. It stays from picture to picture: a software adapter draws the panels on some of them only.
    pub canvas: wgpu::Texture,
    /// Size of texts where none is chosen.
    text_size: f32,
    /// Pixels per point, since the panels were drawn last.
    pub scale: f32,
    /// Something has happened that the panels have not shown yet.
    pub stale: bool,
    /// When the next picture is due.
    pub next: Instant,
    /// Pictures since a screen began to count them.
    pub pictures: u64,
    /// When the last picture was shown, and the longest time between two of them [s].
    presented: Option<Instant>,
    pub longest_pause: f64,
}

impl Stage {
    /// Opens a window and the device that draws on it.
    ///
    /// # Errors
    /// `Error::Input` where there is no display or no driver for it, `Error::Adapter` where no adapter can draw there.
    pub fn open(
        event_loop: &ActiveEventLoop,
        options: &ViewArgs,
        proxy: Option<EventLoopProxy<Message>>,
    ) -> Result<Self> {
        let refused = |reason: String| no_display(&reason);
        let [width, height] = options.size().unwrap_or(SIZE);
        let attributes = Window::default_attributes()
            .with_title(say("title"))
            // Readers are connected before it is shown.
            .with_visible(!cfg!(feature = "screen-reader"))
            .with_inner_size(winit::dpi::LogicalSize::new(width, height));
        let window = Arc::new(event_loop.create_window(attributes).map_err(|e| refused(e.to_string()))?);
        let display = Box::new(event_loop.owned_display_handle());
        let instance = wgpu::Instance::new(wgpu::InstanceDescriptor::new_with_display_handle_from_env(display));
        let surface = instance.create_surface(window.clone()).map_err(|e| no_driver(&e.to_string()))?;
        let (gpu, adapter) = Gpu::for_surface(&instance, &surface)?;
        let size = window.inner_size();
        let config = configuration(&surface, &adapter, [size.width.max(1), size.height.max(1)])?;
        surface.configure(&gpu.device, &config);
        let (mut egui, painter) = panels(&gpu, &window, config.format);
        if let Some(proxy) = proxy {
            reader::connect(&mut egui, event_loop, &window, proxy);
        }
        window.set_visible(true);
        Ok(Stage {
            alive: OpenWindow::with(None),
            help: Help::default(),
            canvas: canvas(&gpu, &config),
            text_size: text_size(&window),
            scale: window.scale_factor() as f32,
            window,
            surface,
            config,
            gpu,
            egui,
            painter,
            stale: true,
            next: Instant::now(),
            pictures: 0,
            presented: None,
            longest_pause: 0.0,
        })
    }

    /// After the window has another size.
    pub fn resize(&mut self, size: winit::dpi::PhysicalSize<u32>) {
        // A minimised window has no size; its surface stays as it was.
        if size.width == 0 || size.height == 0 {
            return;
        }
        (self.config.width, self.config.height) = (size.width, size.height);
        self.surface.configure(&self.gpu.device, &self.config);
        self.canvas = canvas(&self.gpu, &self.config);
        self.stale = true;
    }

    /// A screen begins that counts its pictures and their pauses.
    pub fn count_anew(&mut self) {
        (self.pictures, self.presented, self.longest_pause, self.stale) = (0, None, 0.0, true);
    }

    /// Asks the panels what they show, the keys of `topics` over them where those are open; their input is used up.
    pub fn lay_out(
        &mut self,
        settings: &mut Settings,
        topics: &[Topic],
        mut contents: impl FnMut(&mut egui::Ui, &mut Settings),
    ) -> Panels {
        let input = self.egui.take_egui_input(&self.window);
        let context = self.egui.egui_ctx().clone();
        theme::apply(&context, settings);
        let text_size = settings.text_size.unwrap_or(self.text_size);
        if (context.zoom_factor() - text_size).abs() > 1e-3 {
            context.set_zoom_factor(text_size);
        }
        let output = context.run_ui(input, |ui| {
            self.help.show(ui.ctx(), topics);
            contents(ui, settings);
        });
        self.scale = output.pixels_per_point;
        let again = output.viewport_output.values().map(|v| v.repaint_delay).min().unwrap_or(Duration::MAX);
        // What moves goes on moving on the next picture.
        self.stale = again.is_zero() || egui::Popup::is_any_open(&context) || self.help.open;
        self.egui.handle_platform_output(&self.window, output.platform_output);
        let triangles = context.tessellate(output.shapes, self.scale);
        Panels { triangles, textures: output.textures_delta, again }
    }

    /// Draws the panels on the canvas.
    pub fn paint(&mut self, encoder: &mut wgpu::CommandEncoder, mut panels: Panels, load: wgpu::LoadOp<wgpu::Color>) {
        let (size, view) = (self.canvas.size(), self.canvas.create_view(&Default::default()));
        let (device, queue) = (&self.gpu.device, &self.gpu.queue);
        for (id, mut deltas) in panels.textures.set.drain() {
            for delta in &mut deltas {
                if self.gpu.is_software() {
                    // Letters lie on pixels: mixing four texels takes a software adapter longer, and changes nothing.
                    delta.options = egui::TextureOptions::NEAREST;
                }
                self.painter.update_texture(device, queue, id, delta);
            }
        }
        let screen = ScreenDescriptor { size_in_pixels: [size.width, size.height], pixels_per_point: self.scale };
        let more = self.painter.update_buffers(device, queue, encoder, &panels.triangles, &screen);
        // Only paint callbacks ask for buffers of their own, and there are none.
        debug_assert!(more.is_empty());
        let pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
            label: Some("panels"),
            color_attachments: &[Some(wgpu::RenderPassColorAttachment {
                view: &view,
                depth_slice: None,
                resolve_target: None,
                ops: wgpu::Operations { load, store: wgpu::StoreOp::Store },
            })],
            ..Default::default()
        });
        self.painter.render(&mut pass.forget_lifetime(), &panels.triangles, &screen);
        for id in panels.textures.free.drain() {
            self.painter.free_texture(&id);
        }
    }

    /// Draws again what panels have drawn before, over a picture that was drawn anew.
    pub fn paint_again(&mut self, encoder: &mut wgpu::CommandEncoder, triangles: Vec<egui::ClippedPrimitive>) {
        let panels = Panels { triangles, textures: egui::TexturesDelta::default(), again: Duration::MAX };
        self.paint(encoder, panels, wgpu::LoadOp::Load);
    }

    /// The picture of the display that the canvas is copied to; `None` where there is nothing to show it on.
    pub fn copied(&mut self, encoder: &mut wgpu::CommandEncoder) -> Option<wgpu::SurfaceTexture> {
        let shown = match self.surface.get_current_texture() {
            wgpu::CurrentSurfaceTexture::Success(texture) | wgpu::CurrentSurfaceTexture::Suboptimal(texture) => {
                Some(texture).filter(|shown| shown.texture.size() == self.canvas.size())
            }
            wgpu::CurrentSurfaceTexture::Outdated | wgpu::CurrentSurfaceTexture::Lost => {
                self.surface.configure(&self.gpu.device, &self.config);
                None
            }
            _ => None,
        };
        if let Some(shown) = &shown {
            let (from, to) = (self.canvas.as_image_copy(), shown.texture.as_image_copy());
            encoder.copy_texture_to_texture(from, to, self.canvas.size());
        }
        shown
    }

    /// Shows what was copied; false where there was nothing.
    pub fn present(&mut self, shown: Option<wgpu::SurfaceTexture>) -> bool {
        let Some(shown) = shown else { return false };
        self.window.pre_present_notify();
        self.gpu.queue.present(shown);
        self.pictures += 1;
        // The first pictures wait for their shaders.
        if let Some(before) = self.presented.replace(Instant::now())
            && self.pictures > WARM_UP
        {
            self.longest_pause = self.longest_pause.max(before.elapsed().as_secs_f64());
        }
        true
    }

    /// A picture of a screen without tissue, where something has happened or `every` picture is wanted.
    ///
    /// # Errors
    /// `Error::Device`.
    pub fn flat(
        &mut self,
        settings: &mut Settings,
        (topics, every): (&[Topic], bool),
        mut contents: impl FnMut(&mut egui::Ui, &mut Settings),
    ) -> Result<()> {
        let begin = Instant::now();
        if !self.stale && !every && self.egui.egui_input().events.is_empty() {
            self.next = begin + Duration::from_secs_f64(IDLE);
            return Ok(());
        }
        let panels = self.lay_out(settings, topics, |ui, settings| {
            egui::CentralPanel::default().show(ui, |ui| contents(ui, settings));
        });
        let pause = panels.again.clamp(Duration::from_secs_f64(PICTURE), Duration::from_secs_f64(IDLE));
        // What asks for a later picture gets it then.
        self.stale |= panels.again < Duration::from_secs_f64(IDLE);
        self.next = begin + pause;
        let mut encoder = self.gpu.device.create_command_encoder(&Default::default());
        self.paint(&mut encoder, panels, wgpu::LoadOp::Clear(wgpu::Color::BLACK));
        let shown = self.copied(&mut encoder);
        self.gpu.queue.submit([encoder.finish()]);
        self.present(shown);
        self.gpu.check()
    }

    /// Writes the canvas, or the part of it within `area` [points], into a PNG file.
    ///
    /// # Errors
    /// `Error::Device`, and what the file cannot take.
    pub fn write(&self, path: &Path, area: Option<egui::Rect>) -> Result<()> {
        let size = self.canvas.size();
        let row = (4 * size.width).next_multiple_of(wgpu::COPY_BYTES_PER_ROW_ALIGNMENT);
        let buffer = self.gpu.device.create_buffer(&wgpu::BufferDescriptor {
            label: Some("screenshot"),
            size: u64::from(row) * u64::from(size.height),
            usage: wgpu::BufferUsages::COPY_DST | wgpu::BufferUsages::COPY_SRC,
            mapped_at_creation: false,
        });
        let mut encoder = self.gpu.device.create_command_encoder(&Default::default());
        encoder.copy_texture_to_buffer(
            self.canvas.as_image_copy(),
            wgpu::TexelCopyBufferInfo {
                buffer: &buffer,
                layout: wgpu::TexelCopyBufferLayout { offset: 0, bytes_per_row: Some(row), rows_per_image: None },
            },
            size,
        );
        self.gpu.queue.submit([encoder.finish()]);
        let bytes = self.gpu.read_back(&buffer)?;
        let swapped =
            matches!(self.config.format, wgpu::TextureFormat::Bgra8Unorm | wgpu::TextureFormat::Bgra8UnormSrgb);
        let pixel = |points: f32, most: u32| (points * self.scale).round().clamp(0.0, most as f32) as usize;
        let [left, top, right, bottom] = match area {
            None => [0, 0, size.width as usize, size.height as usize],
            Some(area) => [
                pixel(area.left(), size.width),
                pixel(area.top(), size.height),
                pixel(area.right(), size.width),
                pixel(area.bottom(), size.height),
            ],
        };
        let mut pixels = Vec::with_capacity(4 * (right - left) * (bottom - top));
        for line in bytes.chunks_exact(row as usize).take(bottom).skip(top) {
            for pixel in line[4 * left..4 * right].chunks_exact(4) {
                let [a, g, c] = [pixel[0], pixel[1], pixel[2]];
                pixels.extend(if swapped { [c, g, a, 255] } else { [a, g, c, 255] });
            }
        }
        crate::render::write_png(path, &pixels, (right - left) as u32, (bottom - top) as u32)
    }
}

/// Size of texts on the monitor of a window: not every system says the scale of one with many pixels.
fn text_size(window: &Window) -> f32 {
    let lines =
        window.current_monitor().map_or(0.0, |monitor| f64::from(monitor.size().height) / window.scale_factor());
    // In steps of a twentieth.
    ((lines / LINES).clamp(1.0, 2.0) * 20.0).round() as f32 / 20.0
}

/// A texture as large as the window.
fn canvas(gpu: &Gpu, config: &wgpu::SurfaceConfiguration) -> wgpu::Texture {
    gpu.device.create_texture(&wgpu::TextureDescriptor {
        label: Some("canvas"),
        size: wgpu::Extent3d { width: config.width, height: config.height, depth_or_array_layers: 1 },
        mip_level_count: 1,
        sample_count: 1,
        dimension: wgpu::TextureDimension::D2,
        format: config.format,
        usage: wgpu::TextureUsages::RENDER_ATTACHMENT | wgpu::TextureUsages::COPY_SRC,
        view_formats: &[],
    })
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
    theme::set_up(&context);
    let largest = gpu.device.limits().max_texture_dimension_2d as usize;
    let scale = Some(window.scale_factor() as f32);
    let egui = egui_winit::State::new(context, egui::ViewportId::ROOT, window, scale, window.theme(), Some(largest));
    let options = RendererOptions { dithering: false, ..Default::default() };
    (egui, egui_wgpu::Renderer::new(&gpu.device, format, options))
}
