//! Gradient opacity window: the joint histogram of values and gradient magnitudes, and the factor on the extinction
//! by gradient magnitude over it.

use crate::app::document::Document;
use crate::app::gradient::{GradientEdit, apply};
use crate::app::model::Model;
use crate::app::theme;
use crate::engine::task::{Task, Wake};
use crate::transfer::GradientOpacity;
use crate::volume::{JointHistogram, Volume};
use eframe::egui::{self, Align2, Color32, FontId, Pos2, Rect, Sense, Stroke, pos2, vec2};
use std::sync::atomic::Ordering;
use std::sync::mpsc::TryRecvError;
use std::sync::{Arc, Weak};

/// Title of the gradient opacity window.
pub const TITLE: &str = "Gradient opacity";

/// Columns of values and rows of gradient magnitudes in the window.
const BINS: [usize; 2] = [128, 72];
/// Radius of a point, screen points.
const GRIP: f32 = 6.0;
/// Room for labels at the left and below, screen points.
const MARGIN: egui::Vec2 = vec2(44.0, 30.0);

/// State of the gradient opacity window.
#[derive(Default)]
pub struct Gradient {
    /// Whether the window is open.
    pub open: bool,
    /// Volume whose joint histogram is shown or computed. A closed window does not keep it in memory.
    volume: Weak<Volume>,
    counting: Option<Task<JointHistogram>>,
    joint: Option<JointHistogram>,
    selected: Option<usize>,
    /// Gradient opacity to which `selected` belongs.
    known: Option<GradientOpacity>,
    /// Whether the drag of a point or number has its undo step.
    noted: bool,
    /// Gradient magnitude at the upper end while a point is dragged, value units per mm.
    dragged_top: Option<f64>,
}

impl Gradient {
    /// Whether the joint histogram of the open volume is shown.
    pub fn is_counted(&self) -> bool {
        self.joint.is_some()
    }

    /// Shows the window while it is open.
    pub fn show(&mut self, context: &egui::Context, model: &mut Model) {
        let Some(document) = model.document.as_ref().filter(|_| self.open) else { return };
        self.count(&document.volume, &model.wake);
        // Of both editors, only the point that was clicked last is selected, until another edit may have moved it.
        let is_edited = self.known != document.tf.gradient_opacity;
        if document.selected.is_some() || is_edited {
            self.selected = None;
        }
        let selected = self.selected;
        let (units, opacity) = (document.tf.units.clone(), per_mm(document));
        let (mut open, mut edits) = (true, Vec::new());
        let most = context.content_rect().size() - vec2(40.0, 70.0);
        let view = model.view.unwrap_or(context.content_rect());
        let window = egui::Window::new(TITLE)
            .id(egui::Id::unique(TITLE))
            .open(&mut open)
            .default_pos(view.left_top() + vec2(12.0, 12.0))
            .default_size(vec2(420.0, 340.0).min(most))
            .max_size(most)
            .show(context, |ui| {
                self.tools(ui, opacity.as_ref(), &mut edits);
                self.plot(ui, (&units, opacity.as_ref()), &mut edits);
            });
        self.open = open;
        if let (Some(_), Some(document)) =
            (self.selected.filter(|_| self.selected != selected), &mut model.document)
        {
            document.selected = None;
        }
        let is_shown = window.is_some_and(|window| window.inner.is_some());
        let is_deleted =
            is_shown && !context.text_edit_focused() && context.input(|i| i.key_pressed(egui::Key::Delete));
        if let Some(index) = self.selected.take_if(|_| is_deleted) {
            edits.push(GradientEdit::Remove { index });
        }
        for edit in edits {
            self.take(edit, model);
        }
        self.known = model.document.as_ref().and_then(|document| document.tf.gradient_opacity.clone());
    }

    /// Starts to count the joint histogram of a volume unless it is known, and takes it when it is.
    fn count(&mut self, volume: &Arc<Volume>, wake: &Wake) {
        if !self.volume.upgrade().is_some_and(|known| Arc::ptr_eq(&known, volume)) {
            let counted = Arc::clone(volume);
            *self = Self { open: true, volume: Arc::downgrade(volume), ..Self::default() };
            let task = Task::start("joint histogram", Arc::clone(wake), move |sender, cancelled| {
                let goes_on = || !cancelled.load(Ordering::Relaxed);
                if let Some(joint) = JointHistogram::of(&counted, BINS, &goes_on) {
                    let _ = sender.send(joint);
                }
            });
            // Without a thread the window stays without histogram.
            self.counting = task.ok();
        }
        match self.counting.as_ref().map(Task::poll) {
            Some(Ok(joint)) => (self.joint, self.counting) = (Some(joint), None),
            Some(Err(TryRecvError::Disconnected)) => self.counting = None,
            Some(Err(TryRecvError::Empty)) | None => {}
        }
    }

    /// Gradient magnitude at the upper end of the window, value units per mm.
    fn top(&self, opacity: Option<&GradientOpacity>) -> f64 {
        let of_volume = self.joint.as_ref().map_or(0.0, |joint| joint.top_gradient);
        let of_points = opacity.and_then(|o| o.points().last()).map_or(0.0, |p| p.magnitude);
        let top = of_volume.max(of_points);
        self.dragged_top.unwrap_or(if top > 0.0 { top } else { 1.0 })
    }

    fn tools(&mut self, ui: &mut egui::Ui, opacity: Option<&GradientOpacity>, edits: &mut Vec<GradientEdit>) {
        let top = self.top(opacity);
        ui.horizontal_wrapped(|ui| {
            let boundaries = ui.add_enabled(self.is_counted(), egui::Button::new("Boundaries"));
            if boundaries.on_hover_text("Hide what has no gradient").clicked() {
                edits.push(GradientEdit::Boundaries { top });
                self.selected = None;
            }
            let clear = ui.add_enabled(opacity.is_some(), egui::Button::new("None"));
            if clear.on_hover_text("The factor 1 everywhere").clicked() {
                edits.push(GradientEdit::Clear);
                self.selected = None;
            }
            let points = opacity.map_or(&[][..], GradientOpacity::points);
            let Some((index, point)) = self.selected.and_then(|i| Some((i, points.get(i)?))) else {
                ui.weak("Double-click to add a point; right-click one, or press Delete, to remove it.");
                return;
            };
            let (mut magnitude, mut factor) = (point.magnitude, point.factor);
            let drag =
                egui::DragValue::new(&mut magnitude).speed(0.005 * top).range(0.0..=1e15).suffix(" /mm");
            let drag = ui.add(drag).accessible_name("gradient magnitude").on_hover_text("Gradient magnitude");
            let factors = egui::DragValue::new(&mut factor).speed(0.005).range(0.0..=1.0);
            let factors =
                ui.add(factors).accessible_name("gradient factor").on_hover_text("Factor on the extinction");
            if [&drag, &factors].iter().any(|field| field.drag_started() || field.gained_focus()) {
                self.noted = false;
            }
            if drag.changed() || factors.changed() {
                edits.push(GradientEdit::Move { index, magnitude, factor });
            }
        });
    }

    fn plot(
        &mut self,
        ui: &mut egui::Ui,
        (units, opacity): (&str, Option<&GradientOpacity>),
        edits: &mut Vec<GradientEdit>,
    ) {
        let (whole, response) =
            ui.allocate_exact_size(ui.available_size().max(vec2(160.0, 120.0)), Sense::click());
        let place = Place {
            rect: Rect::from_min_max(whole.min + vec2(MARGIN.x, 6.0), whole.max - vec2(8.0, MARGIN.y)),
            top: self.top(opacity),
        };
        response
            .widget_info(|| egui::WidgetInfo::labeled(egui::Role::Canvas, true, "gradient opacity curve"));
        let painter = ui.painter_at(whole);
        self.paint(ui, &painter, &place, units);
        paint_curve(ui, &painter, &place, opacity);
        if self.points(ui, &painter, &place, opacity, edits) {
            return;
        }
        let Some(p) = response.interact_pointer_pos() else { return };
        if response.double_clicked() && self.is_counted() {
            let (magnitude, factor) = (place.magnitude(p.y), place.factor(p.x));
            edits.push(GradientEdit::Add { magnitude, factor, top: place.top });
            self.selected = None;
        } else if response.clicked() {
            self.selected = None;
        }
    }

    /// Paints the joint histogram and axes.
    fn paint(&self, ui: &egui::Ui, painter: &egui::Painter, place: &Place, units: &str) {
        let (rect, visuals) = (place.rect, ui.visuals());
        let mut mesh = egui::Mesh::default();
        mesh.add_colored_rect(rect, visuals.extreme_bg_color);
        let color = visuals.weak_text_color();
        let font = FontId::proportional(10.5);
        if let Some(joint) = &self.joint {
            add_joint(&mut mesh, place, joint, theme::colors(visuals).histogram);
            painter.add(mesh);
            let [low, high] = joint.values.map(super::editor::short);
            let below = rect.bottom() + 2.0;
            painter.text(pos2(rect.left(), below), Align2::LEFT_TOP, low, font.clone(), color);
            let high = format!("value {high} {units}");
            painter.text(pos2(rect.right(), below), Align2::RIGHT_TOP, high, font.clone(), color);
        } else {
            painter.add(mesh);
            let text =
                if self.counting.is_some() { "counting …" } else { "the histogram cannot be counted" };
            painter.text(rect.center(), Align2::CENTER_CENTER, text, font.clone(), color);
        }
        for share in [0.0, 0.25, 0.5, 0.75, 1.0] {
            let y = place.y(share * place.top);
            painter.hline(rect.x_range(), y, Stroke::new(0.5, color.gamma_multiply(0.35)));
            let at = pos2(rect.left() - 4.0, y.clamp(rect.top() + 6.0, rect.bottom() - 5.0));
            painter.text(
                at,
                Align2::RIGHT_CENTER,
                super::editor::short(share * place.top),
                font.clone(),
                color,
            );
        }
        let unit = format!(
            "gradient, {} per mm; factor from 0 at the left to 1 at the right",
            if units.is_empty() { "value" } else { units }
        );
        let at = pos2(rect.left(), rect.bottom() + 15.0);
        painter.text(at, Align2::LEFT_TOP, unit, font, color);
    }

    /// Shows the points and collects edits of them. Returns whether the pointer is on a point.
    fn points(
        &mut self,
        ui: &egui::Ui,
        painter: &egui::Painter,
        place: &Place,
        opacity: Option<&GradientOpacity>,
        edits: &mut Vec<GradientEdit>,
    ) -> bool {
        let mut over_point = false;
        for (index, point) in opacity.map_or(&[][..], GradientOpacity::points).iter().enumerate() {
            let at = pos2(place.x(point.factor), place.y(point.magnitude));
            let area = Rect::from_center_size(at, vec2(3.0 * GRIP, 3.0 * GRIP));
            let grip = ui.interact(area, ui.scope_id().with(("gradient", index)), Sense::click_and_drag());
            grip.widget_info(|| {
                egui::WidgetInfo::labeled(egui::Role::Button, true, format!("gradient point {}", index + 1))
            });
            over_point |= grip.hovered() || grip.dragged();
            if grip.drag_started() || grip.clicked() {
                (self.selected, self.noted) = (Some(index), false);
            }
            if grip.drag_started() {
                self.dragged_top = Some(place.top);
            }
            if grip.drag_stopped() {
                (self.dragged_top, self.noted) = (None, false);
            }
            if let Some(p) = grip.interact_pointer_pos().filter(|_| grip.dragged()) {
                let (magnitude, factor) = (place.magnitude(p.y), place.factor(p.x));
                edits.push(GradientEdit::Move { index, magnitude, factor });
            }
            if grip.secondary_clicked() {
                edits.push(GradientEdit::Remove { index });
                self.selected = None;
            }
            let is_selected = self.selected == Some(index);
            let ring =
                if is_selected { ui.visuals().selection.bg_fill } else { ui.visuals().strong_text_color() };
            painter.circle(at, GRIP, ui.visuals().extreme_bg_color, Stroke::new(2.0, ring));
        }
        over_point
    }

    /// Applies an edit to the transfer function of the open volume. A drag is one undo step.
    fn take(&mut self, edit: GradientEdit, model: &mut Model) {
        let Some(document) = &mut model.document else { return };
        let is_move = matches!(edit, GradientEdit::Move { .. });
        match apply(per_mm(document).as_ref(), edit) {
            // It would lose its points.
            Ok(Some(edited)) if edited.is_one() => {
                if !is_move {
                    model.note("the factor would be 1 everywhere");
                }
            }
            Ok(edited) => {
                let changed = document.set_gradient_opacity(edited, !(is_move && self.noted));
                self.noted = is_move && (self.noted || changed);
            }
            // A point cannot be dragged past two others.
            Err(_) if is_move => {}
            Err(why) => model.note(why),
        }
    }
}

/// Place of gradient magnitudes and factors on screen.
struct Place {
    rect: Rect,
    /// Gradient magnitude at the upper end, value units per mm.
    top: f64,
}

impl Place {
    fn x(&self, factor: f64) -> f32 {
        self.rect.left() + self.rect.width() * factor as f32
    }

    fn y(&self, magnitude: f64) -> f32 {
        self.rect.bottom() - self.rect.height() * (magnitude / self.top).min(2.0) as f32
    }

    fn factor(&self, x: f32) -> f64 {
        f64::from((x - self.rect.left()) / self.rect.width()).clamp(0.0, 1.0)
    }

    fn magnitude(&self, y: f32) -> f64 {
        f64::from((self.rect.bottom() - y) / self.rect.height()).clamp(0.0, 1.0) * self.top
    }
}

/// Adds the bins of a joint histogram that have cells to a mesh, brighter by the logarithm of their number.
fn add_joint(mesh: &mut egui::Mesh, place: &Place, joint: &JointHistogram, color: Color32) {
    let [columns, rows] = joint.bins;
    let largest = joint.counts.iter().copied().max().unwrap_or(0) as f64;
    let width = place.rect.width() / columns as f32;
    for (bin, count) in joint.counts.iter().enumerate().filter(|(_, count)| **count > 0) {
        let (row, column) = (bin / columns, bin % columns);
        let [low, high] = [row, row + 1].map(|row| place.y(joint.top_gradient * row as f64 / rows as f64));
        let left = place.rect.left() + width * column as f32;
        let share = (1.0 + *count as f64).ln() / (1.0 + largest).ln();
        let area = Rect::from_min_max(pos2(left, high), pos2(left + width, low));
        mesh.add_colored_rect(area, color.gamma_multiply(0.15 + 0.85 * share as f32));
    }
}

fn paint_curve(ui: &egui::Ui, painter: &egui::Painter, place: &Place, opacity: Option<&GradientOpacity>) {
    let points = opacity.map_or(&[][..], GradientOpacity::points);
    let first = points.first().map_or(1.0, |p| p.factor);
    let last = points.last().map_or(1.0, |p| p.factor);
    let mut line: Vec<Pos2> = vec![pos2(place.x(first), place.rect.bottom())];
    line.extend(points.iter().map(|p| pos2(place.x(p.factor), place.y(p.magnitude))));
    line.push(pos2(place.x(last), place.rect.top()));
    painter.line(line, Stroke::new(1.8, ui.visuals().strong_text_color()));
}

/// Gradient opacity of the open volume, value units per mm.
fn per_mm(document: &Document) -> Option<GradientOpacity> {
    let opacity = document.tf.gradient_opacity.as_ref();
    opacity.map(|opacity| opacity.per_mm(document.volume.spacing_mm()))
}
