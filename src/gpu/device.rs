//! Adapter choice and device. Our own selection, so that a wrong name lists the right ones.

#![warn(missing_docs)]

use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, PoisonError};

use super::kernel::KernelCache;
use super::texels::{Access, rewritten};
use super::workers::Threads;
use crate::error::{Error, Result};

/// An opened device and what is known about its adapter.
#[derive(Clone)]
pub struct Gpu {
    /// Makes buffers and pipelines.
    pub device: wgpu::Device,
    /// Takes what is submitted, in order.
    pub queue: wgpu::Queue,
    /// Name, backend and kind of the adapter.
    pub info: wgpu::AdapterInfo,
    /// First error that the device reported outside a call of ours, if any.
    pub failure: Arc<Mutex<Option<String>>>,
    /// What was compiled for this device so far.
    pub kernels: KernelCache,
    /// Whether arrays lie in textures, see [`super::texels`]; engines that are made later follow it.
    pub texels: bool,
    /// Whether short stages get many threads, see [`super::grain::Grain`]; engines that are made later follow it.
    pub wide: bool,
}

/// One line about an adapter.
pub fn describe(info: &wgpu::AdapterInfo) -> String {
    format!("{} [{}, {:?}]", info.name, info.backend, info.device_type)
}

/// All adapters that wgpu finds under `WGPU_BACKEND` (all backends without it).
///
/// # Errors
/// `Error::Adapter` where `WGPU_BACKEND` names a backend that there is not.
pub fn adapters() -> Result<Vec<wgpu::Adapter>> {
    adapters_of(wgpu::Backends::all())
}

fn adapters_of(backends: wgpu::Backends) -> Result<Vec<wgpu::Adapter>> {
    let mut descriptor = wgpu::InstanceDescriptor::new_without_display_handle_from_env();
    descriptor.backends &= backends;
    let backends = descriptor.backends;
    if let Ok(wanted) = std::env::var("WGPU_BACKEND") {
        // wgpu skips names that it does not know; a mistyped one must not silently mean "all" or "none".
        const KNOWN: [&str; 9] = ["vulkan", "vk", "metal", "mtl", "dx12", "d3d12", "gl", "opengl", "gles"];
        let unknown: Vec<&str> =
            wanted.split(',').map(str::trim).filter(|w| !KNOWN.contains(&w.to_lowercase().as_str())).collect();
        if !unknown.is_empty() {
            return Err(Error::Adapter {
                message: format!("WGPU_BACKEND: there is no backend `{}`", unknown.join("`, `")),
                way_out: "use one or several of vulkan, metal, dx12, gl, separated by commas".into(),
            });
        }
    }
    let mut found = pollster::block_on(instance(descriptor).enumerate_adapters(backends));
    // Hardware first, software last; the order of wgpu otherwise.
    found.sort_by_key(rank);
    Ok(found)
}

/// The instance of these backends: one for the whole program. A driver may take an instance for good (NVIDIA's gives none any more after
/// some dozens, and then there seems to be no adapter).
fn instance(descriptor: wgpu::InstanceDescriptor) -> wgpu::Instance {
    static INSTANCES: Mutex<BTreeMap<u32, wgpu::Instance>> = Mutex::new(BTreeMap::new());
    let mut made = INSTANCES.lock().unwrap_or_else(PoisonError::into_inner);
    made.entry(descriptor.backends.bits()).or_insert_with(|| wgpu::Instance::new(descriptor)).clone()
}

/// Place of an adapter among others.
fn rank(adapter: &wgpu::Adapter) -> u8 {
    match adapter.get_info().device_type {
        wgpu::DeviceType::DiscreteGpu => 0,
        wgpu::DeviceType::IntegratedGpu => 1,
        wgpu::DeviceType::VirtualGpu => 2,
        wgpu::DeviceType::Other => 3,
        wgpu::DeviceType::Cpu => 4,
    }
}

/// True where the user names an adapter or a backend: then a failure to open one is the user's to mend.
pub fn adapter_wanted_by_name() -> bool {
    ["WGPU_ADAPTER_NAME", "WGPU_BACKEND"].iter().any(|v| std::env::var(v).is_ok_and(|s| !s.is_empty()))
}

impl Gpu {
    /// Opens the adapter named by `WGPU_ADAPTER_NAME` (part of the name, any case), or the best one.
    ///
    /// # Errors
    /// `Error::Adapter` where none is found or the name fits none; the message lists those that are there.
    pub fn open() -> Result<Self> {
        // OpenGL only where nothing better is there: starting EGL alone takes 0.3 s.
        let mut found = adapters_of(wgpu::Backends::PRIMARY)?;
        let named = std::env::var("WGPU_ADAPTER_NAME").is_ok_and(|n| !n.is_empty());
        if found.is_empty() || named {
            found = adapters()?;
        }
        let list = |found: &[wgpu::Adapter]| {
            found.iter().map(|a| format!("\n    {}", describe(&a.get_info()))).collect::<String>()
        };
        let wanted = std::env::var("WGPU_ADAPTER_NAME").ok().filter(|w| !w.is_empty());
        let adapter = match &wanted {
            None => found.first(),
            Some(name) => found.iter().find(|a| a.get_info().name.to_lowercase().contains(&name.to_lowercase())),
        };
        let Some(adapter) = adapter else {
            return Err(match wanted {
                Some(name) if !found.is_empty() => Error::Adapter {
                    message: format!("WGPU_ADAPTER_NAME={name} fits none of the adapters here:{}", list(&found)),
                    way_out: "use a part of one of these names, or unset the variable".into(),
                },
                _ => Error::Adapter {
                    message: "no GPU adapter found, not even a software one".into(),
                    way_out: "install a Vulkan driver (Debian/Ubuntu: libvulkan1 mesa-vulkan-drivers), unset \
                              WGPU_BACKEND, or use --engine cpu"
                        .into(),
                },
            });
        };
        Self::of_adapter(adapter)
    }

    /// Opens this adapter.
    ///
    /// # Errors
    /// `Error::Adapter` where it does not offer what the engine needs.
    pub fn of_adapter(adapter: &wgpu::Adapter) -> Result<Self> {
        let info = adapter.get_info();
        let threads = Threads::now();
        // Exactly the default limits: what a software adapter offers beyond them must not be relied on.
        let (device, queue) = pollster::block_on(adapter.request_device(&wgpu::DeviceDescriptor {
            label: Some("stylet"),
            required_limits: wgpu::Limits::default(),
            ..Default::default()
        }))
        .map_err(|e| Error::Adapter {
            message: format!("{} could not be opened: {e}", describe(&info)),
            way_out: "choose another adapter with WGPU_ADAPTER_NAME (see `stylet adapters`), or use --engine cpu"
                .into(),
        })?;
        if info.device_type == wgpu::DeviceType::Cpu {
            threads.spread_new();
        }
        let failure = Arc::new(Mutex::new(None));
        let keep = |slot: Arc<Mutex<Option<String>>>| {
            move |text: String| {
                if let Ok(mut first) = slot.lock() {
                    first.get_or_insert(text);
                }
            }
        };
        let note = keep(failure.clone());
        device.on_uncaptured_error(Arc::new(move |e: wgpu::Error| note(e.to_string())));
        let note = keep(failure.clone());
        device.set_device_lost_callback(move |reason, text| {
            if reason != wgpu::DeviceLostReason::Destroyed {
                note(format!("lost ({reason:?}): {text}"));
            }
        });
        let gpu = Self::shared(device, queue, info);
        Ok(Gpu { failure, ..gpu })
    }

    /// A device that a host program has opened and goes on using: an engine on it submits to the same queue. It needs
    /// `wgpu::Limits::default()`; errors outside the engine's calls stay with the host, whose callbacks are not replaced.
    pub fn shared(device: wgpu::Device, queue: wgpu::Queue, info: wgpu::AdapterInfo) -> Self {
        let texels = info.name.contains("llvmpipe");
        let wide = info.device_type != wgpu::DeviceType::Cpu;
        Gpu { device, queue, info, failure: Arc::new(Mutex::new(None)), kernels: KernelCache::default(), texels, wide }
    }

    /// Opens the first adapter of an instance that can draw on a surface; `WGPU_ADAPTER_NAME` names another.
    ///
    /// # Errors
    /// As [`Gpu::open`].
    pub fn for_surface(instance: &wgpu::Instance, surface: &wgpu::Surface<'_>) -> Result<(Self, wgpu::Adapter)> {
        let mut found = pollster::block_on(instance.enumerate_adapters(wgpu::Backends::all()));
        found.retain(|adapter| adapter.is_surface_supported(surface));
        found.sort_by_key(rank);
        let wanted = std::env::var("WGPU_ADAPTER_NAME").unwrap_or_default().to_lowercase();
        let Some(adapter) = found.into_iter().find(|a| a.get_info().name.to_lowercase().contains(&wanted)) else {
            return Err(Error::Adapter {
                message: "no GPU adapter can draw into a window here".into(),
                way_out: "install a Vulkan driver (Debian/Ubuntu: libvulkan1 mesa-vulkan-drivers), unset \
                          WGPU_ADAPTER_NAME and WGPU_BACKEND, or run the scene without a window: stylet run"
                    .into(),
            });
        };
        Ok((Self::of_adapter(&adapter)?, adapter))
    }

    /// Copies a buffer to the host; waits for everything under way.
    ///
    /// # Errors
    /// `Error::Device`.
    pub fn read_back(&self, buffer: &wgpu::Buffer) -> Result<Vec<u8>> {
        let failed = |reason: String| Error::Device(format!("a buffer could not be read: {reason}"));
        let staging = self.device.create_buffer(&wgpu::BufferDescriptor {
            label: Some("read back"),
            size: buffer.size(),
            usage: wgpu::BufferUsages::COPY_DST | wgpu::BufferUsages::MAP_READ,
            mapped_at_creation: false,
        });
        let mut encoder = self.device.create_command_encoder(&Default::default());
        encoder.copy_buffer_to_buffer(buffer, 0, &staging, 0, buffer.size());
        self.queue.submit([encoder.finish()]);
        let (sender, receiver) = std::sync::mpsc::channel();
        staging.map_async(wgpu::MapMode::Read, .., move |result| {
            // Nobody listens any more where the wait below has failed.
            let _ = sender.send(result);
        });
        self.device.poll(wgpu::PollType::wait_indefinitely()).map_err(|e| failed(e.to_string()))?;
        receiver.recv().map_err(|e| failed(e.to_string()))?.map_err(|e| failed(e.to_string()))?;
        let view = staging.get_mapped_range(..).map_err(|e| failed(e.to_string()))?;
        Ok(view.to_vec())
    }

    /// The source of a shader that draws from arrays of an engine on this device.
    pub fn drawing(&self, source: &str) -> std::borrow::Cow<'static, str> {
        if self.texels { rewritten(source, Access::Sampled).into() } else { source.to_string().into() }
    }

    /// True for a software adapter.
    pub fn is_software(&self) -> bool {
        self.info.device_type == wgpu::DeviceType::Cpu
    }

    /// Destroys the device, as a driver that resets it does.
    pub fn lose(&self) {
        if let Ok(mut first) = self.failure.lock() {
            first.get_or_insert("lost (given away)".into());
        }
        self.device.destroy();
    }

    /// Fails when the device has reported an error since it was opened.
    ///
    /// # Errors
    /// `Error::Device` with the first of them.
    pub fn check(&self) -> Result<()> {
        let failure = self.failure.lock().map_or(None, |f| f.clone());
        failure.map_or(Ok(()), |text| Err(Error::Device(text)))
    }
}
