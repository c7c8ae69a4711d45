//! What pictures have cost lately.

use super::worker::Frame;
use eframe::egui;
use std::collections::VecDeque;

/// Pictures that the running plots show.
const MOST: usize = 120;

/// A running series of milliseconds.
#[derive(Default)]
pub struct Series(VecDeque<f64>);

impl Series {
    fn push(&mut self, value: f64) {
        self.0.push_back(value);
        if self.0.len() > MOST {
            self.0.pop_front();
        }
    }

    pub fn last(&self) -> Option<f64> {
        self.0.back().copied()
    }

    /// Draws the series as a small line, the largest at the top.
    pub fn show(&self, ui: &mut egui::Ui, name: &str, tooltip: &str) {
        let text = self.last().map_or("–".to_owned(), |ms| format!("{ms:.1} ms"));
        ui.label(name).on_hover_text(tooltip);
        ui.label(egui::RichText::new(text).monospace());
        let (rect, response) =
            ui.allocate_exact_size(egui::vec2(ui.available_width().max(60.0), 18.0), egui::Sense::hover());
        let largest = self.0.iter().copied().fold(0.0, f64::max);
        response
            .on_hover_text(format!("{tooltip}; the last {} pictures, at most {largest:.1} ms", self.0.len()));
        let visuals = ui.visuals();
        ui.painter().rect_filled(rect, 2.0, visuals.extreme_bg_color);
        if self.0.len() > 1 && largest > 0.0 {
            let point = |(i, v): (usize, &f64)| {
                let x = rect.left() + rect.width() * i as f32 / (MOST - 1) as f32;
                egui::pos2(x, rect.bottom() - 1.0 - (rect.height() - 3.0) * (*v / largest) as f32)
            };
            let line = self.0.iter().enumerate().map(point).collect();
            ui.painter().line(line, egui::Stroke::new(1.2, visuals.selection.bg_fill));
        }
        ui.end_row();
    }
}

/// The series that the shadows panel shows.
#[derive(Default)]
pub struct Timings {
    pub tables: Series,
    pub bricks: Series,
    pub build: Series,
    pub frame: Series,
    pub latency: Series,
    /// Whether the last picture made each of the first three anew.
    pub last_made: [bool; 3],
}

impl Timings {
    pub fn note(&mut self, frame: &Frame) {
        let made = [frame.work.table_ms, frame.work.classify_ms, frame.work.build_ms];
        for (series, ms) in [&mut self.tables, &mut self.bricks, &mut self.build].into_iter().zip(made) {
            if let Some(ms) = ms {
                series.push(ms);
            }
        }
        self.last_made = made.map(|ms| ms.is_some());
        self.frame.push(frame.main.frame_ms + frame.other.as_ref().map_or(0.0, |o| o.frame_ms));
        if !frame.whole || frame.work != Default::default() {
            self.latency.push(frame.latency_ms);
        }
    }
}
