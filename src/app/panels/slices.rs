//! Three slices of the volume along its axes, with a crosshair that is linked to the probe.

use crate::app::document::Document;
use crate::app::model::Model;
use crate::app::panels::widgets::shadowed_text;
use crate::app::theme;
use crate::engine::messages::ProbeTarget;
use crate::scene::anatomical_marks;
use crate::volume::Volume;
use eframe::egui::{self, Align2, Color32, Rect, Sense, Stroke, pos2, vec2};
use glam::DVec3;
use std::sync::Arc;

/// Maximum number of texels along a side of a slice's texture. Larger slices are subsampled.
const MAX_TEXELS: usize = 512;

/// Contents of a slice texture: index of the volume slice, and the two scalar values shown as black and white.
type Shown = (usize, [f64; 2]);

/// State of the three views of volume slices: crosshair, grey window and textures.
#[derive(Default)]
pub struct Slices {
    /// Position of the crosshair in the volume, index coordinates.
    at: DVec3,
    /// Two scalar values that the volume slices show as black and white; `None` without a volume.
    window: Option<[f64; 2]>,
    /// Texture of each volume slice view, with the slice index and grey window for which it was made.
    textures: [Option<(egui::TextureHandle, Shown)>; 3],
}

/// Volume axes of each slice view: horizontal, vertical and perpendicular to the slice.
const PLANES: [[usize; 3]; 3] = [[0, 1, 2], [0, 2, 1], [1, 2, 0]];

/// Position, size and orientation of a volume slice on screen.
struct Layout {
    /// Rectangle in which the volume slice is shown, screen points.
    place: Rect,
    dims: [usize; 3],
    /// Indices of the volume axes that are horizontal, vertical and perpendicular to the slice.
    axes: [usize; 3],
    /// World directions of the horizontal and vertical axes of the volume slice. `flip` tells whether each axis is
    /// mirrored on screen.
    world: [DVec3; 2],
    flip: [bool; 2],
}

impl Layout {
    fn new(volume: &Volume, plane: usize, cell: Rect) -> Self {
        let (dims, spacing, axes) = (volume.dims(), volume.spacing_mm(), PLANES[plane]);
        let [across, down, _] = axes;
        let mm = [across, down].map(|a| dims[a] as f64 * spacing[a]);
        let scale = (f64::from(cell.width()) / mm[0]).min(f64::from(cell.height()) / mm[1]);
        let size = vec2((mm[0] * scale) as f32, (mm[1] * scale) as f32);
        // Superior and anterior are up, whatever the direction of the index axes.
        let world = [across, down].map(|axis| volume.world_from_index().matrix3.col(axis).normalize());
        let flip = [world[0].x > 0.0 && across == 0, world[1].z + world[1].y > 0.0];
        Self { place: Rect::from_center_size(cell.center(), size), dims, axes, world, flip }
    }

    /// Texture coordinates of the volume slice, mirrored where an axis is flipped.
    fn uv(&self) -> Rect {
        let [x, y] = self.flip.map(|flip| if flip { [1.0, 0.0] } else { [0.0, 1.0] });
        Rect::from_min_max(pos2(x[0], y[0]), pos2(x[1], y[1]))
    }

    /// Screen position on this volume slice of a point given by index coordinates.
    fn on_screen(&self, at: DVec3) -> egui::Pos2 {
        let [x, y] = [0, 1].map(|i| {
            let axis = self.axes[i];
            let share = ((at[axis] + 0.5) / self.dims[axis] as f64) as f32;
            if self.flip[i] { 1.0 - share } else { share }
        });
        self.place.min + vec2(x, y) * self.place.size()
    }

    /// Moves the volume point `at` (index coordinates) within the slice plane to a screen position on the slice.
    fn move_to(&self, at: &mut DVec3, place: egui::Pos2) {
        let share = (place - self.place.min) / self.place.size();
        for (i, share) in [share.x, share.y].into_iter().enumerate() {
            let (axis, share) = (self.axes[i], f64::from(if self.flip[i] { 1.0 - share } else { share }));
            let side = self.dims[axis] as f64;
            at[axis] = (share * side - 0.5).clamp(0.0, side - 1.0);
        }
    }
}

impl Slices {
    /// Resets the slice views: crosshair at the centre of the volume, grey window around the value range of the
    /// transfer function.
    pub fn reset(&mut self, document: Option<&Document>) {
        *self = Self::default();
        let Some(document) = document else { return };
        let dims = document.volume.dims();
        self.at = DVec3::from_array(dims.map(|n| 0.5 * (n as f64 - 1.0)));
        let points = &document.tf.points;
        let (lo, hi) = (points[0].value, points[points.len() - 1].value);
        let [min, max] = document.volume.value_range();
        // Window around the range of the transfer function.
        let room = 0.5 * (hi - lo);
        let window = [(lo - room).max(min), (hi + room).min(max)];
        self.window = Some(if window[1] > window[0] { window } else { [min, max.max(min + 1e-6)] });
    }

    /// Moves the crosshair of the slice views to a world point.
    pub fn go_to(&mut self, document: Option<&Document>, point: DVec3) {
        let Some(document) = document else { return };
        let index = document.volume.index_from_world().transform_point3(point);
        let last = DVec3::from_array(document.volume.dims().map(|n| n as f64 - 1.0));
        self.at = index.clamp(DVec3::ZERO, last);
    }

    /// Shows the three slices of the volume in the rectangle `rect` of the window.
    pub fn show(&mut self, ui: &mut egui::Ui, rect: Rect, model: &mut Model) {
        let Some(document) = &model.document else { return };
        let Some(window) = self.window else { return };
        let volume = Arc::clone(&document.volume);
        ui.painter().rect_filled(rect, 0.0, Color32::BLACK);
        let mut new_window = window;
        let size = vec2(rect.width(), rect.height() / 3.0);
        for plane in 0..PLANES.len() {
            let corner = pos2(rect.left(), rect.top() + size.y * plane as f32);
            let cell = Rect::from_min_size(corner, size).shrink(3.0);
            let layout = Layout::new(&volume, plane, cell);
            self.paint(ui, cell, &layout, &volume, plane);
            let response = ui.interact(cell, ui.scope_id().with(("slice", plane)), Sense::click_and_drag());
            response.widget_info(|| {
                egui::WidgetInfo::labeled(egui::Role::Image, true, format!("slice {}", plane + 1))
            });
            if self.follow(ui, &layout, &response, &mut new_window) {
                model.probe(ProbeTarget::Point(volume.world_from_index().transform_point3(self.at)));
            }
            response.on_hover_text_at_pointer("Drag: crosshair; wheel: slice; right drag: window and level");
        }
        self.window = Some(new_window);
    }

    fn paint(&mut self, ui: &egui::Ui, cell: Rect, layout: &Layout, volume: &Volume, plane: usize) {
        let Layout { place, dims, axes: [_, _, through], world, flip } = *layout;
        let depth = (self.at[through].round().max(0.0) as usize).min(dims[through] - 1);
        let painter = ui.painter_at(cell);
        painter.image(self.texture(ui.ctx(), volume, plane, depth), place, layout.uv(), Color32::WHITE);
        let cross = layout.on_screen(self.at);
        let line = Stroke::new(1.0, Color32::from_rgba_unmultiplied(255, 200, 60, 130));
        painter.hline(place.x_range(), cross.y, line);
        painter.vline(cross.x, place.y_range(), line);
        let sign = |flip: bool| if flip { -1.0 } else { 1.0 };
        let letters = [
            (place.left_center() + vec2(4.0, 0.0), Align2::LEFT_CENTER, -sign(flip[0]) * world[0]),
            (place.center_top() + vec2(0.0, 2.0), Align2::CENTER_TOP, -sign(flip[1]) * world[1]),
        ];
        for (at, align, direction) in letters {
            shadowed_text(&painter, at, align, &anatomical_marks(direction), 12.0, theme::OVER_PICTURE);
        }
        let note = format!("{} / {}", depth + 1, dims[through]);
        let corner = cell.right_bottom() - vec2(3.0, 1.0);
        shadowed_text(&painter, corner, Align2::RIGHT_BOTTOM, &note, 10.5, theme::DIM_OVER_PICTURE);
    }

    /// Handles pointer input on one slice of the volume. Returns whether to probe the transmittance at the crosshair.
    fn follow(
        &mut self,
        ui: &egui::Ui,
        layout: &Layout,
        response: &egui::Response,
        window: &mut [f64; 2],
    ) -> bool {
        let mut probes = false;
        let primary = response.dragged_by(egui::PointerButton::Primary) || response.clicked();
        if primary && let Some(place) = response.interact_pointer_pos() {
            layout.move_to(&mut self.at, place);
            probes = response.clicked() || response.drag_stopped();
        }
        if response.dragged_by(egui::PointerButton::Secondary) {
            let delta = response.drag_delta();
            let [lo, hi] = *window;
            let (center, width) = (0.5 * (lo + hi), hi - lo);
            let center = center - f64::from(delta.y) * 0.004 * width;
            let width = (width * (f64::from(delta.x) * 0.01).exp()).max(1e-9 * center.abs().max(1e-3));
            *window = [center - 0.5 * width, center + 0.5 * width];
        }
        if response.hovered() {
            let scroll = ui.input(|i| i.smooth_scroll_delta().y);
            let through = layout.axes[2];
            let moved = self.at[through] + f64::from(scroll) / 25.0;
            self.at[through] = moved.clamp(0.0, layout.dims[through] as f64 - 1.0);
        }
        probes
    }

    /// Returns the texture of a volume slice. Computes it again if the slice index or the grey window has changed.
    fn texture(
        &mut self,
        context: &egui::Context,
        volume: &Volume,
        plane: usize,
        depth: usize,
    ) -> egui::TextureId {
        let window = self.window.unwrap_or([0.0, 1.0]);
        let shown = self.textures[plane].as_ref().filter(|(_, of)| *of == (depth, window));
        if let Some((texture, _)) = shown {
            return texture.id();
        }
        let [across, down, through] = PLANES[plane];
        let dims = volume.dims();
        let stride = dims[across].max(dims[down]).div_ceil(MAX_TEXELS);
        let [width, height] = [across, down].map(|axis| dims[axis].div_ceil(stride));
        let mut part = dims.map(|n| 0..n);
        part[through] = depth..depth + 1;
        let (block, scaling) = (volume.block_or_zeros(&part), volume.scaling());
        let pixel = |i: usize| {
            let mut index = [0; 3];
            (index[across], index[down], index[through]) = (i % width * stride, i / width * stride, depth);
            let share = (scaling.apply(block.stored(index)) - window[0]) / (window[1] - window[0]);
            Color32::from_gray((255.0 * share.clamp(0.0, 1.0)).round() as u8)
        };
        let image = egui::ColorImage::new([width, height], (0..width * height).map(pixel).collect());
        let texture = context.load_texture(format!("slice {plane}"), image, egui::TextureOptions::LINEAR);
        self.textures[plane].insert((texture, (depth, window))).0.id()
    }
}
