//! Times section of the side panel: render times and memory of recent pictures.

use crate::app::model::Model;
use crate::engine::ResidentPages;
use crate::engine::messages::Frame;
use eframe::egui;
use std::collections::VecDeque;

/// Number of recent pictures in the plots of the times section.
const MAX_PICTURES: usize = 120;
/// Width of the column of values in the times section, screen points.
const VALUE_WIDTH: f32 = 78.0;

/// Function that formats a quantity of the times section in the side panel: a time, byte count or number of curve
/// nodes.
type Text = fn(f64) -> String;

fn milliseconds(ms: f64) -> String {
    format!("{ms:.1} ms")
}

/// Name, tooltip and formatter of each plot in the times section of the side panel.
const ROWS: [(&str, &str, Text); 7] = [
    ("tables", "Tables of the transfer function, host ms", milliseconds),
    ("bricks", "Classification of bricks, host ms", milliseconds),
    ("map", "Build of the shadow map, ms", milliseconds),
    ("frame", "Ray casting, ms", milliseconds),
    ("latency", "From the input to the finished picture, ms", milliseconds),
    ("memory", "Bytes of the shadow map (both in a split view)", |bytes| format!("{:.2} MB", bytes * 1e-6)),
    ("nodes", "Nodes of the deep shadow map (both in a split view)", |n| format!("{n:.0}")),
];

/// Shows one quantity in the times section of the side panel: name, value for the last picture, and sparkline of
/// recent pictures.
fn show_series(ui: &mut egui::Ui, series: &VecDeque<f64>, name: &str, tooltip: &str, text: Text) {
    let last = series.back().map_or("–".to_owned(), |value| text(*value));
    ui.label(name).on_hover_text(tooltip);
    // A fixed width keeps the panel from changing with the values.
    ui.scope(|ui| {
        ui.set_min_width(VALUE_WIDTH);
        ui.label(egui::RichText::new(last).monospace());
    });
    let width = (ui.available_width() - 6.0).max(30.0);
    let (rect, response) = ui.allocate_exact_size(egui::vec2(width, 18.0), egui::Sense::hover());
    let largest = series.iter().copied().fold(0.0, f64::max);
    let (pictures, most) = (series.len(), text(largest));
    response.on_hover_text(format!("{tooltip}; the last {pictures} pictures, at most {most}"));
    let visuals = ui.visuals();
    ui.painter().rect_filled(rect, 2.0, visuals.extreme_bg_color);
    if series.len() > 1 && largest > 0.0 {
        let point = |(i, v): (usize, &f64)| {
            let x = rect.left() + rect.width() * i as f32 / (MAX_PICTURES - 1) as f32;
            egui::pos2(x, rect.bottom() - 1.0 - (rect.height() - 3.0) * (*v / largest) as f32)
        };
        let line = series.iter().enumerate().map(point).collect();
        ui.painter().line(line, egui::Stroke::new(1.2, visuals.selection.bg_fill));
    }
    ui.end_row();
}

/// Render times and shadow-map memory of recent pictures. The order of the quantities is that of [`ROWS`].
#[derive(Default)]
pub struct Times {
    series: [VecDeque<f64>; ROWS.len()],
    /// Whether the last picture recomputed the transfer-function tables, the brick classes and the shadow map.
    last_made: [bool; 3],
}

impl Times {
    /// Records the times and memory of a rendered picture for the plots of the side panel.
    pub fn note(&mut self, frame: &Frame) {
        let sides = || frame.sides();
        let made = [frame.work.table_ms, frame.work.classify_ms, frame.work.build_ms];
        self.last_made = made.map(|ms| ms.is_some());
        let waited = (!frame.is_final || frame.work != Default::default()).then_some(frame.latency_ms);
        let nodes: Vec<u64> = sides().filter_map(|side| side.report.nodes_total).collect();
        let costs = [
            made[0],
            made[1],
            made[2],
            Some(sides().map(|side| side.frame_ms).sum()),
            waited,
            Some(sides().map(|side| side.report.bytes as f64).sum()),
            (!nodes.is_empty()).then(|| nodes.iter().sum::<u64>() as f64),
        ];
        for (series, cost) in self.series.iter_mut().zip(costs) {
            series.extend(cost);
            series.drain(..series.len().saturating_sub(MAX_PICTURES));
        }
    }

    /// Shows sparklines of the render times and shadow-map memory of recent pictures, and the times of the last
    /// picture.
    pub fn show(&self, ui: &mut egui::Ui, model: &Model) {
        egui::Grid::new("times").num_columns(3).show(ui, |ui| {
            for (i, ((name, tooltip, text), series)) in ROWS.iter().zip(&self.series).enumerate() {
                let idle = self.last_made.get(i).is_some_and(|made| !made);
                let needed_none = if idle { "; reused by the last picture" } else { "" };
                show_series(ui, series, name, &format!("{tooltip}{needed_none}"), *text);
            }
        });
        if let Some(frame) = &model.frame {
            let made = [frame.work.table_ms, frame.work.classify_ms, frame.work.build_ms];
            let text = |ms: Option<f64>| ms.map_or("reused".to_owned(), milliseconds);
            ui.weak(format!(
                "Last: tables {}, bricks {}, map {}, frame {}",
                text(made[0]),
                text(made[1]),
                text(made[2]),
                milliseconds(frame.main.frame_ms)
            ));
        }
        if let Some(pages) = model.pages {
            resident(ui, pages);
        }
        ui.weak(model.device.adapter.as_deref().unwrap_or_default()).on_hover_text("Graphics adapter");
    }
}

/// Shows which part of the pages that the picture needs is on the device.
fn resident(ui: &mut egui::Ui, ResidentPages { needed, resident, blocks }: ResidentPages) {
    let share = resident as f32 / needed.max(1) as f32;
    let text = format!("{} of {needed} pages resident", resident.min(needed));
    let bar = ui.add(egui::ProgressBar::new(share.min(1.0)).text(&text));
    bar.widget_info(|| egui::WidgetInfo::labeled(egui::Role::ProgressIndicator, true, &text));
    let tooltip = match blocks {
        Some(blocks) => format!(
            "More pages have extinction than the device memory holds: the picture is drawn block by block ({blocks} blocks \
             so far), and a reduced copy of the volume while something moves"
        ),
        None => "Cubes of 32 cells with extinction, which are on the device".into(),
    };
    bar.on_hover_text(tooltip);
}
