//! Painted text of the window: complete, not overlapping, and readable on its background.

use super::widgets::meanings;
use eframe::egui::emath::Rot2;
use eframe::egui::epaint::text::PlacedRow;
use eframe::egui::epaint::{ClippedShape, TextShape, TextureId};
use eframe::egui::{self, Color32, Pos2, Rect, Role, Shape, pos2};
use egui_kittest::Harness;
use std::ops::Range;
use umbravox::app::theme::{MIN_CONTRAST, contrast, over};

/// Tolerance for text rectangles, points: letters reach a little over their lines, and positions are rounded to
/// pixels.
const SLACK: f32 = 1.5;

/// All shapes of the last frame, from the bottom up.
struct Painted {
    shapes: Vec<(Rect, Shape)>,
}

/// Painted line of text.
struct Text<'a> {
    /// Index of the text among all painted shapes.
    order: usize,
    clip: Rect,
    shape: &'a TextShape,
    row: &'a PlacedRow,
    rect: Rect,
}

impl Painted {
    fn of<S>(harness: &Harness<'_, S>) -> Self {
        fn flatten(clip: Rect, shape: &Shape, all: &mut Vec<(Rect, Shape)>) {
            match shape {
                Shape::Vec(inner) => inner.iter().for_each(|shape| flatten(clip, shape, all)),
                Shape::Noop => {}
                other => all.push((clip, other.clone())),
            }
        }
        let mut shapes = Vec::new();
        for ClippedShape { clip_rect, shape, .. } in &harness.output().shapes {
            flatten(*clip_rect, shape, &mut shapes);
        }
        Self { shapes }
    }

    /// Visible lines of text.
    fn texts(&self) -> impl Iterator<Item = Text<'_>> {
        self.shapes.iter().enumerate().flat_map(|(order, (clip, shape))| {
            let shape = if let Shape::Text(shape) = shape { Some(shape) } else { None };
            let lines =
                shape.into_iter().flat_map(|shape| shape.galley.rows.iter().map(move |row| (shape, row)));
            lines.filter_map(move |(shape, row)| {
                let turn = Rot2::from_angle(shape.angle);
                let rect = row.row.visuals.mesh_bounds.translate(row.pos.to_vec2()).rotate_bb(turn);
                let rect = rect.translate(shape.pos.to_vec2());
                // Text without letters has no rectangle.
                let is_seen =
                    rect.is_finite() && rect.intersect(*clip).is_positive() && shape.opacity_factor > 0.0;
                is_seen.then_some(Text { order, clip: *clip, shape, row, rect })
            })
        })
    }

    /// Whether a painted shape of at least this alpha covers a position.
    fn hides(&self, orders: Range<usize>, at: Pos2, alpha: u8) -> bool {
        self.shapes[orders].iter().any(|(clip, shape)| match shape {
            Shape::Rect(r) => {
                r.fill.a() >= alpha && r.blur_width == 0.0 && clip.contains(at) && r.rect.contains(at)
            }
            _ => false,
        })
    }

    /// Colours painted at a position before shape `order`; over a picture it may be any colour.
    fn below(&self, order: usize, at: Pos2, ground: Color32, view: Option<Rect>) -> Vec<Color32> {
        let anything = || vec![Color32::BLACK, Color32::WHITE];
        let mut backs = vec![ground];
        let lay = |color: Color32, backs: &mut Vec<Color32>| {
            backs.iter_mut().for_each(|back| *back = over(color, *back));
        };
        for (_, shape) in self.shapes[..order].iter().filter(|(clip, _)| clip.contains(at)) {
            match shape {
                Shape::Rect(r) if r.rect.contains(at) && r.blur_width == 0.0 => {
                    if r.brush.is_some() || Some(r.rect) == view {
                        backs = anything();
                    } else {
                        lay(r.fill, &mut backs);
                    }
                }
                Shape::Path(path) if path.closed && is_inside_polygon(&path.points, at) => {
                    lay(path.fill, &mut backs);
                }
                Shape::Circle(c) if c.center.distance(at) <= c.radius => lay(c.fill, &mut backs),
                Shape::Mesh(mesh) => {
                    for corners in mesh.indices.chunks_exact(3) {
                        let [a, b, c] = [0, 1, 2].map(|i| mesh.vertices[corners[i] as usize]);
                        if !is_inside([a.pos, b.pos, c.pos], at) {
                            continue;
                        }
                        match mesh.texture_id {
                            TextureId::Managed(0) => lay(a.color, &mut backs),
                            _ => backs = anything(),
                        }
                    }
                }
                Shape::Callback(callback) if callback.rect.contains(at) => backs = anything(),
                _ => {}
            }
        }
        backs
    }
}

fn is_inside([a, b, c]: [Pos2; 3], p: Pos2) -> bool {
    let side = |u: Pos2, v: Pos2| (v.x - u.x) * (p.y - u.y) - (v.y - u.y) * (p.x - u.x);
    let sides = [side(a, b), side(b, c), side(c, a)];
    sides.iter().all(|s| *s >= 0.0) || sides.iter().all(|s| *s <= 0.0)
}

/// Whether a convex polygon contains a point.
fn is_inside_polygon(corners: &[Pos2], p: Pos2) -> bool {
    let fans = corners.windows(2).skip(1);
    corners.first().is_some_and(|first| fans.into_iter().any(|edge| is_inside([*first, edge[0], edge[1]], p)))
}

impl Text<'_> {
    fn words(&self) -> &str {
        &self.shape.galley.job.text
    }

    /// Some letters of the text: their centres and colours.
    fn letters(&self) -> Vec<(Pos2, Color32)> {
        let visuals = &self.row.row.visuals;
        let corners = &visuals.mesh.vertices[visuals.glyph_vertex_range.clone()];
        let glyphs: Vec<_> = corners.chunks_exact(4).collect();
        let some = [0, glyphs.len() / 2, glyphs.len().saturating_sub(1)];
        let letters = some.into_iter().filter_map(|i| glyphs.get(i)).map(|glyph| {
            let middle = glyph.iter().fold(egui::Vec2::ZERO, |sum, v| sum + v.pos.to_vec2()) / 4.0;
            let own = glyph[0].color;
            let own = if own == Color32::PLACEHOLDER { self.shape.fallback_color } else { own };
            let color = self.shape.override_text_color.unwrap_or(own);
            let turned = Rot2::from_angle(self.shape.angle) * (self.row.pos.to_vec2() + middle);
            (self.shape.pos + turned, color.gamma_multiply(self.shape.opacity_factor))
        });
        letters.collect()
    }
}

/// Lines of text that are cut or overlap each other.
pub fn faults<S>(harness: &Harness<'_, S>) -> Vec<String> {
    let painted = Painted::of(harness);
    let window = harness.ctx.content_rect();
    [cut(harness, &painted), collisions(&painted), veiled(&painted, window)].concat()
}

/// Text that its clip rectangle cuts. Text of a widget that is itself cut, and text in a field, which scrolls, do not
/// count.
fn cut<S>(harness: &Harness<'_, S>, painted: &Painted) -> Vec<String> {
    let meanings = meanings(harness);
    let excused: Vec<Rect> = harness.ctx.viewport(|v| {
        let all = &v.prev_pass.widgets;
        let of_layer = |layer| all.get_layer(layer).collect::<Vec<_>>();
        let mine = all.layer_ids().flat_map(of_layer).filter(|w| {
            let Some((role, _)) = meanings.get(&w.id.accesskit_id()) else { return false };
            *role == Role::TextInput || !w.interact_rect.expand(SLACK).contains_rect(w.rect)
        });
        mine.map(|w| w.rect.expand(2.0 * SLACK)).collect()
    });
    let is_cut = |text: &Text<'_>| !text.clip.expand(SLACK).contains_rect(text.rect);
    let known = |text: &Text<'_>| excused.iter().any(|rect| rect.contains(text.rect.center()));
    let cut = painted.texts().filter(|text| is_cut(text) && !known(text));
    cut.map(|text| format!("text cut: `{}` {} in {}", text.words(), text.rect, text.clip)).collect()
}

/// Texts that overlap, with nothing opaque between them.
fn collisions(painted: &Painted) -> Vec<String> {
    let texts: Vec<Text<'_>> = painted.texts().collect();
    let mut faults = Vec::new();
    for (i, a) in texts.iter().enumerate() {
        for b in &texts[i + 1..] {
            let shared = a.rect.intersect(a.clip).intersect(b.rect.intersect(b.clip));
            let meets = shared.width() > SLACK && shared.height() > SLACK;
            if meets && !painted.hides(a.order + 1..b.order, shared.center(), 255) {
                faults.push(format!("`{}` {} is painted over `{}` {}", b.words(), b.rect, a.words(), a.rect));
            }
        }
    }
    faults
}

/// Text below a translucent rectangle. An opaque rectangle is a window or a list over it, and the veil of a modal
/// question covers the whole window.
fn veiled(painted: &Painted, window: Rect) -> Vec<String> {
    let mut faults = Vec::new();
    for text in painted.texts() {
        let at = text.rect.center();
        for (clip, shape) in &painted.shapes[text.order + 1..] {
            let Shape::Rect(r) = shape else { continue };
            let over = clip.contains(at) && r.rect.contains(at) && r.blur_width == 0.0;
            if over && r.fill.a() == 255 {
                break;
            }
            if over && r.fill.a() > 0 && !r.rect.contains_rect(window) {
                faults.push(format!("a plate {} is painted over `{}` {}", r.rect, text.words(), text.rect));
            }
        }
    }
    faults
}

/// Text with too little contrast against its background; `view` is a picture, which may have any colour.
pub fn unreadable<S>(harness: &Harness<'_, S>, view: Option<Rect>) -> Vec<String> {
    let painted = Painted::of(harness);
    let ground = harness.ctx.global_style().visuals.panel_fill;
    let (mut checked, mut faults) = (0, Vec::new());
    for text in painted.texts() {
        let mut worst: Option<(f64, Color32, Color32)> = None;
        for (at, color) in text.letters() {
            // Text under a window or an overlay is not read.
            if !text.clip.contains(at) || painted.hides(text.order + 1..painted.shapes.len(), at, 1) {
                continue;
            }
            checked += 1;
            for back in painted.below(text.order, at, ground, view) {
                let seen = contrast(over(color, back), back);
                if worst.is_none_or(|(least, ..)| seen < least) {
                    worst = Some((seen, over(color, back), back));
                }
            }
        }
        if let Some((seen, color, back)) = worst.filter(|(seen, ..)| *seen < MIN_CONTRAST) {
            faults.push(format!(
                "`{}` {}: contrast {seen:.2}, {color:?} on {back:?}",
                text.words(),
                text.rect
            ));
        }
    }
    if checked < 10 {
        faults.push(format!("only {checked} letters were looked at"));
    }
    faults
}

/// Texts that are shortened with … for lack of room, with their positions.
pub fn elided<S>(harness: &Harness<'_, S>) -> Vec<(String, Pos2)> {
    let painted = Painted::of(harness);
    let elided =
        painted.texts().filter(|text| text.shape.galley.elided && text.clip.contains(text.rect.center()));
    let place = |text: &Text<'_>| pos2(text.rect.left() + 4.0, text.rect.center().y);
    elided.map(|text| (text.words().to_owned(), place(&text))).collect()
}

/// Texts that are shown completely.
pub fn whole<S>(harness: &Harness<'_, S>) -> Vec<String> {
    let painted = Painted::of(harness);
    let whole = painted.texts().filter(|text| !text.shape.galley.elided);
    whole.map(|text| text.words().to_owned()).collect()
}
