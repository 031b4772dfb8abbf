//! How grave something is and how far a step is, as a drawn sign and a colour: the sign alone says it to those who see no colours.

use egui::{Color32, Pos2, Response, Shape, Stroke, Ui, vec2};

use crate::training::events::Gravity;
use crate::window::theme::Tint;

/// What a sign says.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Sign {
    /// A tick.
    Done,
    /// An arrow to the right.
    Now,
    /// A ring.
    Later,
    /// A dot.
    Note,
    /// A triangle with a bar in it.
    Bad,
}

impl From<Gravity> for Sign {
    fn from(gravity: Gravity) -> Sign {
        match gravity {
            Gravity::Good => Sign::Done,
            Gravity::Note => Sign::Note,
            Gravity::Bad => Sign::Bad,
        }
    }
}

/// The colour on the panels as they are now.
pub fn colour(gravity: Gravity, ui: &Ui) -> Color32 {
    match gravity {
        Gravity::Good => Tint::Good.of(ui),
        Gravity::Note => ui.visuals().text_color(),
        Gravity::Bad => Tint::Bad.of(ui),
    }
}

/// Draws a sign as high as a line of text.
pub fn sign(ui: &mut Ui, sign: Sign, colour: Color32) -> Response {
    let size = ui.text_style_height(&egui::TextStyle::Body);
    let (rect, response) = ui.allocate_exact_size(vec2(size, size), egui::Sense::hover());
    let at = |x: f32, y: f32| Pos2::new(rect.left() + x * size, rect.top() + y * size);
    let stroke = Stroke::new(0.13 * size, colour);
    let shape = match sign {
        Sign::Done => Shape::line(vec![at(0.15, 0.55), at(0.4, 0.8), at(0.85, 0.2)], stroke),
        Sign::Now => Shape::convex_polygon(vec![at(0.25, 0.15), at(0.85, 0.5), at(0.25, 0.85)], colour, Stroke::NONE),
        Sign::Later => Shape::circle_stroke(at(0.5, 0.5), 0.28 * size, Stroke::new(0.08 * size, colour)),
        Sign::Note => Shape::circle_filled(at(0.5, 0.5), 0.22 * size, colour),
        Sign::Bad => {
            let triangle = vec![at(0.5, 0.08), at(0.97, 0.92), at(0.03, 0.92)];
            ui.painter().add(Shape::convex_polygon(triangle, colour, Stroke::NONE));
            Shape::line(vec![at(0.5, 0.36), at(0.5, 0.74)], Stroke::new(0.13 * size, ui.visuals().panel_fill))
        }
    };
    ui.painter().add(shape);
    response
}
