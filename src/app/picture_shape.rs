//! egui shape that paints a rendered picture: the renderer's texture, scaled to a rectangle.

use crate::render::DisplayTexture;
use eframe::egui::{Color32, Rect, Shape, TextureId, pos2};
use eframe::egui_wgpu::RenderState;
use eframe::wgpu::FilterMode;
use std::collections::HashMap;
use std::sync::Arc;

/// Location in the viewer window where a rendered picture is shown. Each location has its own egui texture id.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Place {
    /// Picture of the left (0) or right (1) shadow method in the split view.
    Side(usize),
    /// Thumbnail of a transfer-function preset, by the index of the preset.
    Preset(usize),
}

/// Rendered textures and their egui texture ids, by location in the viewer window. egui's renderer stores them.
#[derive(Default)]
struct Registered(HashMap<Place, (Arc<DisplayTexture>, TextureId)>);

/// Returns an egui shape that paints a rendered texture over `rect`.
pub fn shape(rect: Rect, texture: &Arc<DisplayTexture>, place: Place, state: &RenderState) -> Shape {
    let mut renderer = state.renderer.write();
    let registered = renderer.callback_resources.entry::<Registered>().or_insert_with(Registered::default);
    let id = match registered.0.get(&place).map(|(shown, id)| (Arc::ptr_eq(shown, texture), *id)) {
        Some((true, id)) => id,
        known => {
            let (device, view) = (&state.device, &texture.view);
            let id = match known {
                Some((_, id)) => {
                    renderer.update_egui_texture_from_wgpu_texture(device, view, FilterMode::Linear, id);
                    id
                }
                None => renderer.register_native_texture(device, view, FilterMode::Linear),
            };
            if let Some(registered) = renderer.callback_resources.get_mut::<Registered>() {
                registered.0.insert(place, (Arc::clone(texture), id));
            }
            id
        }
    };
    Shape::image(id, rect, Rect::from_min_max(pos2(0.0, 0.0), pos2(1.0, 1.0)), Color32::WHITE)
}
