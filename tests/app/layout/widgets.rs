//! Widgets that are cut by their container and cannot be scrolled into view, and overlapping widgets.

use eframe::egui::accesskit::{Action, ActionRequest, NodeId, TreeId};
use eframe::egui::{
    Event, Id, LayerId, Modifiers, MouseWheelSource, MouseWheelUnit, Order, Rect, Role, Sense, TouchPhase,
    Vec2,
};
use egui_kittest::Harness;
use egui_kittest::kittest::NodeT;
use std::collections::HashMap;

/// Tolerance for rounding to pixels, points.
const SLACK: f32 = 1.0;
/// Width of a floating window's border, points.
const BORDER: f32 = 10.0;
/// Pictures and canvases, on which other widgets may lie.
const GROUNDS: [&str; 5] = ["3-D view", "slice 1", "slice 2", "slice 3", "opacity curve"];

#[derive(Debug, Clone)]
struct Widget {
    id: Id,
    layer: LayerId,
    rect: Rect,
    /// Part of the widget that its panel shows.
    seen: Rect,
    sense: Sense,
    name: String,
    role: Role,
}

impl Widget {
    /// Whether the widget is fully visible.
    fn is_whole(&self) -> bool {
        self.seen.is_positive() && self.seen.expand(SLACK).contains_rect(self.rect)
    }
}

/// Accessibility roles and names of widgets; spaces, panels and backgrounds of areas have none.
pub fn meanings<S>(harness: &Harness<'_, S>) -> HashMap<NodeId, (Role, String)> {
    let means = harness.root().children_recursive().filter_map(|node| {
        let node = node.accesskit_node();
        let empty = matches!(
            node.role(),
            Role::GenericContainer
                | Role::Window
                | Role::Pane
                | Role::Dialog
                | Role::Menu
                | Role::Tooltip
                | Role::Unknown
        );
        let name = node.label().or_else(|| node.value()).unwrap_or_default();
        (!empty).then(|| (node.locate().0, (node.role(), name)))
    });
    means.collect()
}

/// Every widget with an accessibility role, with its rectangle in the last frame.
fn widgets<S>(harness: &Harness<'_, S>) -> Vec<Widget> {
    let meanings = meanings(harness);
    harness.ctx.viewport(|v| {
        let all = &v.prev_pass.widgets;
        let of_layer = |layer: LayerId| all.get_layer(layer).collect::<Vec<_>>();
        let found = all.layer_ids().flat_map(of_layer).filter_map(|w| {
            let (role, name) = meanings.get(&w.id.accesskit_id())?.clone();
            (w.visible && w.rect.is_positive()).then_some(Widget {
                id: w.id,
                layer: w.layer_id,
                rect: w.rect,
                seen: w.interact_rect,
                sense: w.sense,
                name,
                role,
            })
        });
        found.collect()
    })
}

/// Number of visible widgets.
pub fn count<S>(harness: &Harness<'_, S>) -> usize {
    widgets(harness).len()
}

/// Widgets that are cut, covered or outside the window. Floating windows may cover only `view`.
pub fn faults<S>(harness: &mut Harness<'_, S>, view: Option<Rect>) -> Vec<String> {
    let mut faults = overlaps(harness);
    faults.extend(out_of_the_window(harness));
    faults.extend(view.into_iter().flat_map(|view| out_of_the_view(harness, view)));
    faults.extend(cut(harness));
    faults
}

/// Widgets that are not fully visible, even after scrolling to them.
fn cut<S>(harness: &mut Harness<'_, S>) -> Vec<String> {
    fn find<S>(harness: &Harness<'_, S>) -> HashMap<Id, Widget> {
        widgets(harness).into_iter().filter(|w| !w.is_whole()).map(|w| (w.id, w)).collect()
    }
    let (mut waiting, mut faults) = (find(harness), Vec::new());
    while let Some(widget) = first(&waiting) {
        waiting.remove(&widget.id);
        harness.event(Event::AccessKitActionRequest(ActionRequest {
            action: Action::ScrollIntoView,
            target_tree: TreeId::ROOT,
            target_node: widget.id.accesskit_id(),
            data: None,
        }));
        harness.run_steps(3);
        // Only the innermost scroll area takes the wheel; if it is cut, the wheel is turned beside it.
        for _ in 0..12 {
            let Some(still) = find(harness).remove(&widget.id) else { break };
            turn_the_wheel(harness, &still);
        }
        let now = find(harness);
        if let Some(still) = now.get(&widget.id) {
            faults.push(format!("cut: {:?} `{}` {} seen {}", still.role, still.name, still.rect, still.seen));
        }
        // Widgets that became visible by this scrolling need none of their own.
        waiting.retain(|id, _| now.contains_key(id));
    }
    faults
}

/// Turns the mouse wheel towards a widget, over its innermost visible container.
fn turn_the_wheel<S>(harness: &mut Harness<'_, S>, widget: &Widget) {
    let holder = harness.ctx.viewport(|v| {
        let all = &v.prev_pass.widgets;
        let mut holder = all.get(widget.id)?;
        while !holder.interact_rect.shrink(8.0).is_positive() {
            holder = all.get(holder.parent_id).filter(|parent| parent.id != holder.id)?;
        }
        Some(holder.interact_rect)
    });
    let Some(holder) = holder else { return };
    let away = (holder.center() - widget.rect.center()).clamp(Vec2::splat(-60.0), Vec2::splat(60.0));
    harness.event(Event::PointerMoved(holder.center()));
    harness.event(Event::MouseWheel {
        unit: MouseWheelUnit::Point,
        delta: away,
        phase: TouchPhase::Move,
        source: MouseWheelSource::Unknown,
        modifiers: Modifiers::NONE,
    });
    harness.run_steps(3);
}

/// Topmost widget that is still to be inspected, so that scrolling to it shows many of the following ones.
fn first(waiting: &HashMap<Id, Widget>) -> Option<Widget> {
    let key = |w: &Widget| (w.rect.top(), w.rect.left());
    waiting.values().min_by(|a, b| key(a).partial_cmp(&key(b)).unwrap()).cloned()
}

/// Pairs of widgets in one layer that take clicks at the same place.
fn overlaps<S>(harness: &Harness<'_, S>) -> Vec<String> {
    let takes = |w: &&Widget| w.sense.interactive() && w.seen.is_positive();
    let all = widgets(harness);
    let ground = |w: &Widget| GROUNDS.contains(&w.name.as_str());
    // Points of the curve may overlap; tests/app/panels.rs tests which one is taken.
    let point = |w: &Widget| w.name.starts_with("point ");
    let takers: Vec<&Widget> = all.iter().filter(takes).filter(|w| !ground(w)).collect();
    let mut faults = Vec::new();
    for (i, a) in takers.iter().enumerate() {
        for b in &takers[i + 1..] {
            let shared = a.seen.intersect(b.seen);
            let border = is_border(a) || is_border(b);
            let most = if border { BORDER } else { SLACK };
            let over = shared.width() > most && shared.height() > most;
            if over && a.layer == b.layer && a.id != b.id && !(point(a) && point(b)) {
                faults.push(format!("`{}` {} lies over `{}` {}", b.name, b.seen, a.name, a.seen));
            }
        }
    }
    faults
}

/// Floating areas that reach beyond the window, which cuts them.
fn out_of_the_window<S>(harness: &Harness<'_, S>) -> Vec<String> {
    let window = harness.ctx.content_rect().expand(SLACK);
    let areas = harness.ctx.memory(|m| {
        let shown = m.areas().visible_layer_ids().into_iter();
        shown.filter_map(|layer| Some((layer, m.area_rect(layer.id)?))).collect::<Vec<_>>()
    });
    let beyond = areas
        .into_iter()
        .filter(|(layer, rect)| layer.order != Order::Background && !window.contains_rect(*rect));
    beyond.map(|(layer, rect)| format!("{layer:?} {rect} is beyond the window")).collect()
}

/// Floating windows over the view that cover a panel.
fn out_of_the_view<S>(harness: &Harness<'_, S>, view: Rect) -> Vec<String> {
    let over = widgets(harness).into_iter().filter(|w| w.layer.order == Order::Middle && !is_border(w));
    let outside = over.filter(|w| w.seen.is_positive() && !view.expand(SLACK).contains_rect(w.seen));
    outside.map(|w| format!("`{}` {} lies over a panel", w.name, w.seen)).collect()
}

/// Whether a widget is the resize border of a floating window, which reaches a little into the window.
fn is_border(widget: &Widget) -> bool {
    widget.name.starts_with("Resize window")
}
