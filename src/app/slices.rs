//! Three slices through the volume along its own axes, with a crosshair that the probe follows.

use super::camera::marks;
use super::jobs::Aim;
use super::{App, Document};
use crate::volume::Volume;
use eframe::egui::{self, Align2, Color32, FontId, Rect, Sense, Stroke, pos2, vec2};
use glam::DVec3;

/// Longest side of a slice's texture; finer ones are sampled.
const MOST_TEXELS: usize = 512;

/// The crosshair, and slices as textures.
#[derive(Default)]
pub struct SliceState {
    /// Index coordinates.
    at: DVec3,
    /// Values at black and white; `None` until a volume is open.
    window: Option<[f64; 2]>,
    textures: [Option<(egui::TextureHandle, usize, [f64; 2])>; 3],
}

/// Index axes to the right and down, and the one that is cut across.
const PLANES: [[usize; 3]; 3] = [[0, 1, 2], [0, 2, 1], [1, 2, 0]];

impl SliceState {
    /// Starts in the middle of a volume.
    pub fn reset(&mut self, document: Option<&Document>) {
        *self = Self::default();
        let Some(document) = document else { return };
        let dims = document.volume.dims();
        self.at = DVec3::from_array(dims.map(|n| 0.5 * (n as f64 - 1.0)));
        let points = &document.tf.points;
        let (lo, hi) = (points[0].value, points[points.len() - 1].value);
        let [min, max] = document.volume.value_range();
        // What the transfer function spans, with some room, is what is of interest.
        let room = 0.5 * (hi - lo);
        let window = [(lo - room).max(min), (hi + room).min(max)];
        self.window = Some(if window[1] > window[0] { window } else { [min, max.max(min + 1e-6)] });
    }

    /// Moves the crosshair to a world point.
    pub fn go_to(&mut self, document: Option<&Document>, point: DVec3) {
        let Some(document) = document else { return };
        let index = document.volume.index_from_world().transform_point3(point);
        let last = DVec3::from_array(document.volume.dims().map(|n| n as f64 - 1.0));
        self.at = index.clamp(DVec3::ZERO, last);
    }
}

impl App {
    /// The three slices above each other in `rect`.
    pub(super) fn slices_column(&mut self, ui: &mut egui::Ui, rect: Rect) {
        let Some(document) = &self.document else { return };
        let Some(window) = self.slices.window else { return };
        let volume = std::sync::Arc::clone(&document.volume);
        let (dims, spacing) = (volume.dims(), volume.spacing_mm());
        ui.painter().rect_filled(rect, 0.0, Color32::BLACK);
        let mut aim = None;
        let mut new_window = window;
        for (plane, [across, down, through]) in PLANES.into_iter().enumerate() {
            let height = rect.height() / 3.0;
            let cell = Rect::from_min_size(
                pos2(rect.left(), rect.top() + height * plane as f32),
                vec2(rect.width(), height),
            )
            .shrink(3.0);
            let mm = [across, down].map(|a| dims[a] as f64 * spacing[a]);
            let scale = (f64::from(cell.width()) / mm[0]).min(f64::from(cell.height()) / mm[1]);
            let place =
                Rect::from_center_size(cell.center(), vec2((mm[0] * scale) as f32, (mm[1] * scale) as f32));
            let depth = (self.slices.at[through].round().max(0.0) as usize).min(dims[through] - 1);
            let texture = self.slice_texture(ui.ctx(), &volume, plane, depth);
            let response = ui.interact(cell, ui.scope_id().with(("slice", plane)), Sense::click_and_drag());
            response.widget_info(|| {
                egui::WidgetInfo::labeled(egui::Role::Image, true, format!("slice {}", plane + 1))
            });
            let painter = ui.painter_at(cell);
            // Index axes may point either way; pictures have superior, and anterior, up.
            let world = |axis: usize| volume.world_from_index().matrix3.col(axis).normalize();
            let flip_x = world(across).x > 0.0 && across == 0;
            let flip_y = world(down).z + world(down).y > 0.0;
            let uv_x = if flip_x { [1.0, 0.0] } else { [0.0, 1.0] };
            let uv_y = if flip_y { [1.0, 0.0] } else { [0.0, 1.0] };
            let uv = Rect::from_min_max(pos2(uv_x[0], uv_y[0]), pos2(uv_x[1], uv_y[1]));
            painter.image(texture, place, uv, Color32::WHITE);
            let share = |axis: usize, flip: bool| {
                let s = ((self.slices.at[axis] + 0.5) / dims[axis] as f64) as f32;
                if flip { 1.0 - s } else { s }
            };
            let cross = place.min + vec2(share(across, flip_x), share(down, flip_y)) * place.size();
            let line = Stroke::new(1.0, Color32::from_rgba_unmultiplied(255, 200, 60, 130));
            painter.hline(place.x_range(), cross.y, line);
            painter.vline(cross.x, place.y_range(), line);
            let sign = |flip: bool| if flip { -1.0 } else { 1.0 };
            let letters = [
                (place.left_center() + vec2(3.0, 0.0), Align2::LEFT_CENTER, -sign(flip_x) * world(across)),
                (place.center_top() + vec2(0.0, 2.0), Align2::CENTER_TOP, -sign(flip_y) * world(down)),
            ];
            for (at, align, direction) in letters {
                painter.text(
                    at,
                    align,
                    marks(direction),
                    FontId::proportional(12.0),
                    Color32::from_gray(220),
                );
            }
            let note = format!("{} / {}", depth + 1, dims[through]);
            painter.text(
                cell.right_bottom(),
                Align2::RIGHT_BOTTOM,
                note,
                FontId::proportional(10.5),
                Color32::GRAY,
            );

            let primary = response.dragged_by(egui::PointerButton::Primary) || response.clicked();
            if primary && let Some(p) = response.interact_pointer_pos() {
                let s = (p - place.min) / place.size();
                let index = |s: f32, axis: usize, flip: bool| {
                    let s = f64::from(if flip { 1.0 - s } else { s });
                    (s * dims[axis] as f64 - 0.5).clamp(0.0, dims[axis] as f64 - 1.0)
                };
                self.slices.at[across] = index(s.x, across, flip_x);
                self.slices.at[down] = index(s.y, down, flip_y);
                if response.clicked() || response.drag_stopped() {
                    aim = Some(Aim::Point(volume.world_from_index().transform_point3(self.slices.at)));
                }
            }
            if response.dragged_by(egui::PointerButton::Secondary) {
                let delta = response.drag_delta();
                let [lo, hi] = new_window;
                let (center, width) = (0.5 * (lo + hi), hi - lo);
                let center = center - f64::from(delta.y) * 0.004 * width;
                let width = (width * (f64::from(delta.x) * 0.01).exp()).max(1e-9 * center.abs().max(1e-3));
                new_window = [center - 0.5 * width, center + 0.5 * width];
            }
            if response.hovered() {
                let scroll = ui.input(|i| i.smooth_scroll_delta().y);
                let moved = self.slices.at[through] + f64::from(scroll) / 25.0;
                self.slices.at[through] = moved.clamp(0.0, dims[through] as f64 - 1.0);
            }
            response.on_hover_text_at_pointer(
                "Drag: crosshair; wheel: through the slices; right drag: window and level",
            );
        }
        self.slices.window = Some(new_window);
        if let Some(aim) = aim {
            self.probe(aim);
        }
    }

    fn slice_texture(
        &mut self,
        context: &egui::Context,
        volume: &Volume,
        plane: usize,
        depth: usize,
    ) -> egui::TextureId {
        let window = self.slices.window.unwrap_or([0.0, 1.0]);
        if let Some((texture, d, w)) = &self.slices.textures[plane]
            && *d == depth
            && *w == window
        {
            return texture.id();
        }
        let [across, down, through] = PLANES[plane];
        let dims = volume.dims();
        let stride = dims[across].max(dims[down]).div_ceil(MOST_TEXELS);
        let size = [dims[across].div_ceil(stride), dims[down].div_ceil(stride)];
        let mut pixels = Vec::with_capacity(size[0] * size[1]);
        for y in 0..size[1] {
            for x in 0..size[0] {
                let mut index = [0; 3];
                index[across] = x * stride;
                index[down] = y * stride;
                index[through] = depth;
                let share =
                    (volume.value(index[0], index[1], index[2]) - window[0]) / (window[1] - window[0]);
                pixels.push(Color32::from_gray((255.0 * share.clamp(0.0, 1.0)).round() as u8));
            }
        }
        let image = egui::ColorImage::new(size, pixels);
        let options = egui::TextureOptions::LINEAR;
        match &mut self.slices.textures[plane] {
            Some((texture, d, w)) => {
                texture.set(image, options);
                (*d, *w) = (depth, window);
                texture.id()
            }
            none => {
                let texture = context.load_texture(format!("slice {plane}"), image, options);
                let id = texture.id();
                *none = Some((texture, depth, window));
                id
            }
        }
    }
}
