//! Screen readers: what they ask of the window (feature `screen-reader`). The panels name themselves; here it is handed on.

use winit::event_loop::{ActiveEventLoop, EventLoopProxy};
use winit::window::Window;

#[cfg(feature = "screen-reader")]
pub use egui_winit::accesskit_winit::Event as Message;

/// Nobody sends anything.
#[cfg(not(feature = "screen-reader"))]
#[derive(Debug)]
pub enum Message {}

/// Connects a window that is not shown yet with the readers of the system.
#[cfg(feature = "screen-reader")]
pub fn connect(
    egui: &mut egui_winit::State,
    event_loop: &ActiveEventLoop,
    window: &Window,
    proxy: EventLoopProxy<Message>,
) {
    egui.init_accesskit(event_loop, window, proxy);
}

#[cfg(not(feature = "screen-reader"))]
pub fn connect(_: &mut egui_winit::State, _: &ActiveEventLoop, _: &Window, _: EventLoopProxy<Message>) {}

/// Does what a reader asks.
#[cfg(feature = "screen-reader")]
pub fn heed(egui: &mut egui_winit::State, message: Message) {
    use egui_winit::accesskit_winit::WindowEvent;
    match message.window_event {
        WindowEvent::InitialTreeRequested => egui.egui_ctx().enable_accesskit(),
        WindowEvent::ActionRequested(request) => egui.on_accesskit_action_request(request),
        WindowEvent::AccessibilityDeactivated => egui.egui_ctx().disable_accesskit(),
    }
}

#[cfg(not(feature = "screen-reader"))]
pub fn heed(_: &mut egui_winit::State, message: Message) {
    match message {}
}
