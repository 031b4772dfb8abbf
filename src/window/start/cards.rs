//! The tasks as cards: picture, name, what is learned, difficulty, how the trainee stands.

use std::collections::BTreeMap;

use egui::{Align, Color32, Layout, Rect, Sense, Stroke, StrokeKind, TextureHandle, Vec2, WidgetInfo, vec2};

use super::progress::Standing;
use super::tasks::Task;
use crate::window::theme::Tint;
use crate::words::{say, say_with};

/// Narrowest and widest card, height of its texts with a task told in two rows, room within it and beside it [points].
const NARROWEST: f32 = 205.0;
const WIDEST: f32 = 320.0;
const TEXTS: f32 = 118.0;
const MARGIN: f32 = 8.0;
const GAP: f32 = 10.0;
/// Height of a picture against its width.
const PICTURE: f32 = 0.56;
/// Part of a picture, across, that is shown.
const MIDDLE: f32 = 0.78;

/// Pictures of the cards, decoded when they are first shown.
#[derive(Default)]
pub struct Pictures(BTreeMap<String, Option<TextureHandle>>);

impl Pictures {
    fn of(&mut self, context: &egui::Context, task: &Task) -> Option<TextureHandle> {
        let load = || {
            let image = decoded(task.picture()?)?;
            Some(context.load_texture(task.key.clone(), image, egui::TextureOptions::LINEAR))
        };
        self.0.entry(task.key.clone()).or_insert_with(load).clone()
    }
}

/// A PNG with three or four bytes a pixel.
fn decoded(png: &[u8]) -> Option<egui::ColorImage> {
    let mut reader = png::Decoder::new(std::io::Cursor::new(png)).read_info().ok()?;
    let mut bytes = vec![0; reader.output_buffer_size()?];
    let info = reader.next_frame(&mut bytes).ok()?;
    let size = [info.width as usize, info.height as usize];
    bytes.truncate(info.buffer_size());
    match info.color_type {
        png::ColorType::Rgb => Some(egui::ColorImage::from_rgb(size, &bytes)),
        png::ColorType::Rgba => Some(egui::ColorImage::from_rgba_unmultiplied(size, &bytes)),
        _ => None,
    }
}

/// Draws the cards in as many columns as there is room for; the number of the one that was chosen. `standings`: one per task; none
/// without a trainee.
pub fn cards(
    ui: &mut egui::Ui,
    tasks: &[Task],
    standings: Option<&[Standing]>,
    pictures: &mut Pictures,
) -> Option<usize> {
    let mut chosen = None;
    let room = ui.available_width();
    let columns = ((room + GAP) / (NARROWEST + GAP)).floor().clamp(1.0, 9.0);
    let width = ((room - (columns - 1.0) * GAP) / columns).floor().min(WIDEST);
    let texts = TEXTS + more_rows(ui, tasks, width - 2.0 * MARGIN);
    for (row, in_row) in tasks.chunks(columns as usize).enumerate() {
        ui.horizontal(|ui| {
            ui.spacing_mut().item_spacing.x = GAP;
            for (column, task) in in_row.iter().enumerate() {
                let number = row * columns as usize + column;
                let picture = pictures.of(ui.ctx(), task);
                if card(ui, vec2(width, texts), (number, task), standings.map(|all| &all[number]), picture) {
                    chosen = Some(number);
                }
            }
        });
        ui.add_space(GAP);
    }
    chosen
}

/// Height of the rows beyond two that the longest line of all tasks takes in a card of this width: cards of a row are of one height.
fn more_rows(ui: &egui::Ui, tasks: &[Task], width: f32) -> f32 {
    let font = egui::TextStyle::Body.resolve(ui.style());
    let height = |task: &Task| {
        let text = ui.painter().layout(task.line().to_string(), font.clone(), Color32::WHITE, width);
        (text.rows.len().saturating_sub(2)) as f32 * ui.text_style_height(&egui::TextStyle::Body)
    };
    tasks.iter().map(height).fold(0.0, f32::max)
}

/// A card; `size`: its width, and the height of its texts.
fn card(
    ui: &mut egui::Ui,
    size: Vec2,
    (number, task): (usize, &Task),
    standing: Option<&Standing>,
    picture: Option<TextureHandle>,
) -> bool {
    let picture_size = vec2(size.x, (PICTURE * size.x).round());
    let (rect, response) = ui.allocate_exact_size(picture_size + vec2(0.0, size.y), Sense::click());
    let told = format!("{}: {}. {}", task.name(), task.line(), difficulty(task.difficulty));
    response.widget_info(|| WidgetInfo::labeled(egui::Role::Button, true, &told));
    if response.has_focus() {
        response.scroll_to_me(None);
    }
    if !ui.is_rect_visible(rect) {
        return response.clicked();
    }
    let visuals = *ui.style().interact(&response);
    let painter = ui.painter_at(rect.expand(2.0));
    painter.rect_filled(rect, 6.0, ui.visuals().faint_bg_color);
    let upper = Rect::from_min_size(rect.min, picture_size);
    painter.rect_filled(upper, 6.0, ui.visuals().extreme_bg_color);
    if let Some(texture) = picture {
        // The middle of the picture, as much as the card has room for: the tissue lies there.
        let [w, h] = texture.size().map(|n| n as f32);
        let scale = (upper.width() / w).max(upper.height() / h);
        let part = MIDDLE * vec2(upper.width() / (scale * w), upper.height() / (scale * h));
        let uv = Rect::from_center_size(egui::pos2(0.5, 0.5), part);
        painter.image(texture.id(), upper, uv, Color32::WHITE);
    }
    let edge = match response.has_focus() {
        true => Stroke::new(3.0, Tint::Focus.of(ui)),
        false if response.hovered() => Stroke::new(1.5, visuals.fg_stroke.color),
        false => ui.visuals().widgets.noninteractive.bg_stroke,
    };
    painter.rect_stroke(rect, 6.0, edge, StrokeKind::Inside);
    let lower = Rect::from_min_max(upper.left_bottom(), rect.max).shrink(MARGIN);
    let mut inner = ui.new_child(egui::UiBuilder::new().max_rect(lower).layout(Layout::top_down(Align::Min)));
    inner.spacing_mut().item_spacing = vec2(4.0, 3.0);
    // The card is the widget; its texts are not chosen one by one.
    inner.style_mut().interaction.selectable_labels = false;
    texts(&mut inner, number, task, standing);
    response.clicked()
}

fn texts(ui: &mut egui::Ui, number: usize, task: &Task, standing: Option<&Standing>) {
    ui.horizontal(|ui| {
        ui.label(egui::RichText::new(task.name()).strong().size(15.0));
        ui.with_layout(Layout::right_to_left(Align::Center), |ui| {
            if number < 9 {
                ui.weak(format!("{}", number + 1));
            }
        });
    });
    ui.add(egui::Label::new(task.line()).wrap());
    ui.with_layout(Layout::bottom_up(Align::Min), |ui| {
        ui.horizontal(|ui| {
            ui.label(told(standing));
            ui.with_layout(Layout::right_to_left(Align::Center), |ui| results(ui, standing));
        });
        ui.horizontal(|ui| {
            for level in 1..=3 {
                let (rect, _) = ui.allocate_exact_size(Vec2::splat(9.0), Sense::hover());
                let colour = ui.visuals().text_color();
                match level <= task.difficulty {
                    true => ui.painter().circle_filled(rect.center(), 4.0, colour),
                    false => ui.painter().circle_stroke(rect.center(), 3.5, Stroke::new(1.0, colour)),
                };
            }
            ui.label(difficulty(task.difficulty));
        });
    });
}

/// How hard a task is, in a word.
fn difficulty(level: u8) -> &'static str {
    match level {
        1 => say("start-easy"),
        2 => say("start-medium"),
        _ => say("start-hard"),
    }
}

/// The best result in a few words.
pub fn told(standing: Option<&Standing>) -> String {
    match standing {
        None => String::new(),
        Some(Standing { attempts: 0, .. }) => say("start-new").into(),
        Some(Standing { best: Some(best), .. }) => say_with("start-best", &[("seconds", format!("{best:.1}").into())]),
        Some(Standing { passed: 0, .. }) => say("start-not-passed").into(),
        Some(_) => say("start-passed").into(),
    }
}

/// The last attempts one by one, the newest on the right: full is passed, empty is not, a dash is not scored.
pub fn results(ui: &mut egui::Ui, standing: Option<&Standing>) {
    let Some(standing) = standing else { return };
    let (good, bad) = (Tint::Good.of(ui), Tint::Bad.of(ui));
    let (rect, _) = ui.allocate_exact_size(vec2(11.0 * standing.last.len() as f32, 10.0), Sense::hover());
    for (n, passed) in standing.last.iter().enumerate() {
        let centre = egui::pos2(rect.left() + 11.0 * (n as f32 + 0.5), rect.center().y);
        match passed {
            Some(true) => ui.painter().circle_filled(centre, 4.0, good),
            Some(false) => ui.painter().circle_stroke(centre, 3.5, Stroke::new(1.5, bad)),
            None => {
                let dash = Stroke::new(1.5, ui.visuals().weak_text_color());
                ui.painter().hline(centre.x - 3.0..=centre.x + 3.0, centre.y, dash)
            }
        };
    }
}
