//! Central area of the viewer window: the rendered picture, its overlays and the messages below it.

use super::difference::Difference;
use super::slices::Slices;
use super::{cube, overlays, pointer};
use crate::app::model::Model;
use crate::app::panels::widgets::tag;
use crate::app::picture_shape::{Place, shape as shown};
use crate::app::theme;
use crate::engine::messages::MethodFrame;
use crate::files::input::source_name;
use eframe::egui::{self, Align2, Color32, CornerRadius, FontId, Rect, Sense, Stroke, pos2, vec2};
use eframe::egui_wgpu::RenderState;

/// Maximum width and height of a rendered picture, pixels.
const MAX_PIXELS: u32 = 8192;
/// Width of the progress bar while a volume is read, screen points.
const READING_WIDTH: f32 = 360.0;

/// Shows the rendered picture in the remaining space of the window, with volume slices beside it.
pub fn show(
    ui: &mut egui::Ui,
    model: &mut Model,
    difference: &Difference,
    slices: &mut Slices,
    render_state: Option<&RenderState>,
) {
    egui::CentralPanel::no_frame().show(ui, |ui| {
        let mut rect = ui.available_rect_before_wrap();
        if model.settings.slices && model.document.is_some() {
            let left = pos2(rect.right() - rect.width() * 0.3, rect.top());
            let column = Rect::from_min_max(left, rect.max);
            rect.max.x = column.left() - 2.0;
            slices.show(ui, column, model);
        }
        view(ui, rect, model, difference, render_state);
    });
}

fn view(
    ui: &mut egui::Ui,
    rect: Rect,
    model: &mut Model,
    difference: &Difference,
    render_state: Option<&RenderState>,
) {
    model.view = Some(rect);
    let response = ui.interact(rect, ui.scope_id().with("view"), Sense::click_and_drag());
    response.widget_info(|| egui::WidgetInfo::labeled(egui::Role::Image, true, "3-D view"));
    let painter = ui.painter_at(rect);
    // A picture covers the view, so a software adapter need not fill it first.
    if model.frame.is_none() || render_state.is_none() {
        painter.rect_filled(rect, CornerRadius::ZERO, theme::NO_PICTURE);
    }
    if let Some(document) = &mut model.document {
        let pixels = rect.size() * ui.ctx().pixels_per_point();
        let side = |n: f32| (n.round().max(1.0) as u32).min(MAX_PIXELS);
        document.scene.width = side(pixels.x);
        document.scene.height = side(pixels.y);
        pointer::follow(ui, rect, model, &response);
    }
    pictures(ui, rect, model, difference, render_state);
    let below_tags = tags(ui, rect, model);
    if model.document.is_some() {
        overlays::paint(ui, rect, below_tags, model, difference);
        cube::show(ui, rect, model);
    }
    if let Some(text) = text_without_picture(model) {
        let font = FontId::proportional(18.0);
        painter.text(rect.center(), Align2::CENTER_CENTER, text, font, theme::DIM_OVER_PICTURE);
    }
    reading(ui, rect, model);
    messages(ui, rect, model);
}

/// Returns the text in the middle of the view while it has no picture: work in progress, or how to open a volume.
fn text_without_picture(model: &Model) -> Option<&'static str> {
    // The progress of reading has a place of its own.
    if model.reading.is_some() || model.frame.is_some() {
        return None;
    }
    let is_due = model.document.is_some() && !model.settled;
    match &model.document {
        _ if model.uploading || is_due => Some("Preparing the first picture…"),
        None => Some("Drop a volume here, or choose File › Open"),
        // The first picture failed, and a message says why.
        Some(_) => None,
    }
}

/// Paints the pictures of one or two shadow methods, or their error heat maps.
fn pictures(
    ui: &egui::Ui,
    rect: Rect,
    model: &Model,
    difference: &Difference,
    render_state: Option<&RenderState>,
) {
    let (Some(frame), Some(state)) = (&model.frame, render_state) else { return };
    let painter = ui.painter_at(rect);
    // A picture of another shape fills the height until the next one arrives.
    let size = vec2(frame.main.texture.width as f32, frame.main.texture.height as f32);
    let place = Rect::from_center_size(rect.center(), vec2(rect.height() * size.x / size.y, rect.height()));
    let place = if (place.width() / rect.width() - 1.0).abs() < 0.02 { rect } else { place };
    let errors = |side: usize| {
        let found = difference.found.as_ref().filter(|_| difference.shows.is_some())?;
        found.sides.get(side).map(|s| &s.texture)
    };
    let shape = |side: usize, drawn: &MethodFrame| {
        let texture = errors(side).unwrap_or(&drawn.texture);
        shown(place, texture, Place::Side(side), state)
    };
    if let Some((side, _)) = model.flicker(ui.ctx()) {
        frame.sides().nth(side).into_iter().for_each(|drawn| _ = painter.add(shape(side, drawn)));
        return;
    }
    painter.add(shape(0, &frame.main));
    let (Some(other), Some(share)) = (&frame.other, model.split.share) else { return };
    let x = rect.left() + share * rect.width();
    let right = ui.painter_at(Rect::from_min_max(egui::pos2(x, rect.top()), rect.max));
    right.add(shape(1, other));
    painter.vline(x, rect.y_range(), Stroke::new(1.5, Color32::from_white_alpha(200)));
    painter.circle_filled(egui::pos2(x, rect.center().y), 5.0, Color32::from_white_alpha(220));
}

/// Paints the names of the two shadow methods over a split view. Returns the lower edge of the names.
fn tags(ui: &egui::Ui, rect: Rect, model: &Model) -> f32 {
    let frame = model.frame.as_ref();
    if let Some(side) = model.flicker(ui.ctx()).and_then(|(side, _)| frame?.sides().nth(side)) {
        let at = rect.center_top() + vec2(0.0, 8.0);
        let shown = tag(ui, rect, at, Align2::CENTER_TOP, &side.spec, rect.width() - 16.0);
        let place = Rect::from_center_size(at, vec2(2.0, 2.0));
        let label = ui.interact(place, ui.scope_id().with("flicker"), Sense::empty());
        let name = format!("shown: {}", side.spec);
        label.widget_info(|| egui::WidgetInfo::labeled(egui::Role::Label, true, &name));
        return shown.bottom();
    }
    let sides = frame.and_then(|frame| Some((&frame.main, frame.other.as_ref()?)));
    let (Some((main, other)), Some(share)) = (sides, model.split.share) else { return rect.top() };
    let (x, y) = (rect.left() + share * rect.width(), rect.top() + 8.0);
    let left = tag(ui, rect, pos2(x - 8.0, y), Align2::RIGHT_TOP, &main.spec, x - rect.left() - 20.0);
    let right = tag(ui, rect, pos2(x + 8.0, y), Align2::LEFT_TOP, &other.spec, rect.right() - x - 20.0);
    left.bottom().max(right.bottom())
}

/// Shows the progress of a volume that is being read.
fn reading(ui: &mut egui::Ui, rect: Rect, model: &mut Model) {
    let Some(reading) = &model.reading else { return };
    let progress = reading.loading.progress();
    let source = reading.source.as_str();
    let name = source_name(source);
    let seconds = reading.since.elapsed().as_secs_f64();
    let width = READING_WIDTH.min(rect.width() - 24.0).max(160.0);
    let mut cancelled = false;
    egui::Area::new(ui.scope_id().with("opening"))
        .fixed_pos(rect.center_top() + vec2(-0.5 * width, 24.0))
        .order(egui::Order::Foreground)
        .show(ui.ctx(), |ui| {
            egui::Frame::popup(ui.style()).show(ui, |ui| {
                ui.set_width(width);
                ui.add(egui::Label::new(format!("{name}: {}", progress.stage.name())).truncate())
                    .on_hover_text(source);
                ui.horizontal(|ui| {
                    cancelled = ui.button("Cancel").on_hover_text("End the reading").clicked();
                    ui.weak(format!("{seconds:.0} s"));
                    let bar = egui::ProgressBar::new(progress.share as f32).show_percentage();
                    ui.add(bar).accessible_name("share read");
                });
            });
        });
    if cancelled {
        model.reading = None;
    }
}

fn messages(ui: &mut egui::Ui, rect: Rect, model: &mut Model) {
    if model.messages.is_empty() {
        return;
    }
    let mut closed = None;
    egui::Area::new(ui.scope_id().with("messages"))
        .pivot(Align2::LEFT_BOTTOM)
        .fixed_pos(rect.left_bottom() + vec2(96.0, -10.0))
        .order(egui::Order::Foreground)
        .show(ui.ctx(), |ui| {
            for (i, message) in model.messages.iter().enumerate() {
                egui::Frame::popup(ui.style()).show(ui, |ui| {
                    ui.set_max_width((rect.width() - 140.0).max(200.0));
                    ui.horizontal_wrapped(|ui| {
                        if ui.small_button("×").on_hover_text("Close").clicked() {
                            closed = Some(i);
                        }
                        let text = egui::RichText::new(&message.text);
                        let color = ui.visuals().error_fg_color;
                        ui.label(if message.is_error { text.color(color) } else { text });
                        if let Some(hint) = &message.hint {
                            ui.label(egui::RichText::new(format!("hint: {hint}")).weak());
                        }
                    });
                });
            }
        });
    if let Some(i) = closed {
        model.messages.remove(i);
    }
}
