//! Why a window may not open, in words that help.

use crate::Error;

/// The reason of a library without the place in its source, which helps nobody who wants a window: `os error at FILE.rs:LINE: REASON`.
fn without_place(reason: &str) -> &str {
    reason.split_once(".rs:").and_then(|(_, rest)| rest.split_once(": ")).map_or(reason, |(_, reason)| reason)
}

/// There is a display, and nothing that can draw on it.
pub fn no_driver(reason: &str) -> Error {
    Error::input(
        format!("no graphics driver can draw on this display: {}", reason.trim_end_matches(": {}")),
        "install a Vulkan driver (Debian/Ubuntu: mesa-vulkan-drivers, which draws without a graphics card too), look at `stylet \
         adapters`, or use `stylet run`, which needs no picture and computes on the processor where there is no adapter",
    )
}

pub fn no_display(reason: &str) -> Error {
    Error::input(
        format!("no window can be opened here: {}", without_place(reason)),
        "start it on a desktop; on a terminal alone use `stylet run` (pictures, charts and tables in a folder) or a virtual \
         display: xvfb-run stylet view. Debian/Ubuntu: libx11-6 libxcursor1 libxi6 libxrandr2 libxkbcommon-x11-0",
    )
}
