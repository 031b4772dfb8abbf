//! The mouse over the view.

use glam::{DVec3, Vec2};

use crate::window::camera::Camera;
use crate::window::grip::{Grip, Modifiers, Sight};
use crate::window::hand::Desk;

/// Way that a notch of the wheel asks for [m].
const NOTCH: f64 = 0.25e-3;

/// Mouse over the view: drags turn and shift it or lead the needle where they begin on it, the wheel leads the needle or, with Ctrl,
/// zooms.
pub(super) fn look(
    response: &egui::Response,
    ui: &egui::Ui,
    camera: &mut Camera,
    desk: &mut Desk,
    (tool, grip): (Option<(DVec3, DVec3)>, &mut Grip),
) {
    desk.seen_from(camera.level().map(|axis| axis.as_dvec3()));
    let led = tool.is_some_and(|needle| {
        let size = Vec2::new(response.rect.width(), response.rect.height());
        take_hold(response, ui, &Sight { camera, size, needle }, (desk, grip))
    });
    let height = response.rect.height().max(1.0);
    let drag = response.drag_delta() / height;
    let drag = Vec2::new(drag.x, drag.y);
    if response.dragged_by(egui::PointerButton::Primary) {
        if !led {
            camera.orbit(drag);
        }
    } else if response.dragged_by(egui::PointerButton::Secondary) || response.dragged_by(egui::PointerButton::Middle) {
        camera.pan(drag);
    }
    if response.hovered() {
        let (notches, zoom) = ui.input(|input| {
            let mut notches = 0.0;
            for event in &input.events {
                if let egui::Event::MouseWheel { unit, delta, modifiers, .. } = event
                    && !modifiers.command
                {
                    notches += match unit {
                        egui::MouseWheelUnit::Point => delta.y / 50.0,
                        egui::MouseWheelUnit::Line => delta.y,
                        egui::MouseWheelUnit::Page => 10.0 * delta.y,
                    };
                }
            }
            (notches, input.zoom_delta())
        });
        // Towards the user is into the tissue, as a page goes down.
        desk.ask(-f64::from(notches) * NOTCH);
        camera.zoom(zoom.ln() / 1.1f32.ln());
    }
}

/// The left button over the needle; true while a drag leads it.
fn take_hold(response: &egui::Response, ui: &egui::Ui, sight: &Sight, (desk, grip): (&mut Desk, &mut Grip)) -> bool {
    let place = |at: egui::Pos2| Vec2::new(at.x - response.rect.left(), at.y - response.rect.top());
    let (held, pressed_at) = ui.input(|input| {
        let m = input.modifiers;
        (Modifiers { shift: m.shift, control: m.ctrl || m.command, alt: m.alt }, input.pointer.press_origin())
    });
    if response.drag_started_by(egui::PointerButton::Primary) {
        // A drag is one some points after the button went down.
        *grip = Grip::begin(held, pressed_at.is_some_and(|at| sight.is_on_needle(place(at))), desk.drag);
    }
    if *grip == Grip::Camera && response.hover_pos().is_some_and(|at| sight.is_on_needle(place(at))) {
        ui.ctx().set_cursor_icon(egui::CursorIcon::Grab);
    }
    if !response.dragged_by(egui::PointerButton::Primary) {
        *grip = Grip::Camera;
        return false;
    }
    let Some(to) = response.interact_pointer_pos().map(place) else { return *grip != Grip::Camera };
    let drag = response.drag_delta();
    sight.drag(*grip, to - Vec2::new(drag.x, drag.y), to, desk)
}
