//! What the command line does, one file per command.

pub mod advise;
pub mod bench;
pub mod bench_effects;
pub mod check;
pub mod compare_adapters;
pub mod fit;
pub mod material;
pub mod prepare;
pub mod replay;
pub mod report;
pub mod run;
pub mod stability;
pub mod study;

use crate::error::Result;

/// `stylet adapters`: what wgpu finds here, and which one a run would take.
pub fn adapters() -> Result<String> {
    let found = crate::gpu::device::adapters()?;
    if found.is_empty() {
        return Ok("no adapter found; runs use the CPU engine (--engine cpu)\n\
             way out: install a Vulkan driver (Debian/Ubuntu: libvulkan1 mesa-vulkan-drivers), unset WGPU_BACKEND\n"
            .into());
    }
    let mut text = String::new();
    for (n, adapter) in found.iter().enumerate() {
        let info = adapter.get_info();
        text += &format!(
            "{} {}\n    driver: {} {}\n",
            if n == 0 { "*" } else { " " },
            crate::gpu::device::describe(&info),
            info.driver,
            info.driver_info
        );
    }
    text += "* is taken unless WGPU_ADAPTER_NAME (a part of the name) or WGPU_BACKEND says otherwise\n";
    Ok(text)
}
