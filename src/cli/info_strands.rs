//! Properties of strands (hair, fibres, tracks) that `umbravox info` prints.

use super::console::print_message;
use crate::strands::Strands;
use serde::Serialize;
use std::fmt::Write as _;

/// Properties of strands, as `umbravox info` prints them. The fields are keys of `info --json`.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct StrandInfo {
    /// Number of strands.
    pub strands: u32,
    /// Number of points of all strands.
    pub points: usize,
    /// Number of segments of all strands.
    pub segments: usize,
    /// Length of all strands together, mm.
    pub length_mm: f64,
    /// Smallest and largest diameter of the strands, mm; `None` if neither the file nor the user gives one.
    pub thickness_mm: Option<[f64; 2]>,
    /// Bounding box of the strands in world mm: smallest and largest corner; `None` without points.
    pub strand_bounds_mm: Option<[[f64; 3]; 2]>,
}

impl StrandInfo {
    /// Collects the properties of strands, and prints the warnings about their file to stderr.
    pub fn of(strands: &Strands) -> Self {
        strands.warnings().iter().for_each(|warning| print_message("warning", warning));
        let arrays = strands.arrays();
        let length = |i: usize| {
            let [a, b] = strands.segment(i).ends;
            a.distance(b)
        };
        let thickness = &arrays.thickness_mm;
        let widest = strands.widest_mm();
        let thinnest = thickness
            .values
            .as_ref()
            .map_or(widest, |values| values.iter().copied().fold(f32::INFINITY, f32::min).into());
        Self {
            strands: arrays.strands,
            points: arrays.points.len(),
            segments: strands.segment_count(),
            length_mm: (0..strands.segment_count()).map(length).sum(),
            thickness_mm: strands.has_thickness().then_some([thinnest, widest]),
            strand_bounds_mm: strands.bounds_mm().map(|corners| corners.map(|corner| corner.to_array())),
        }
    }

    /// Formats the properties of strands as aligned text, one line per property. `number` formats a number.
    pub fn to_text(&self, number: fn(f64) -> String) -> String {
        let mut text = String::new();
        let mut line = |name: &str, value: String| {
            // Writing to a string cannot fail.
            let _ = writeln!(text, "{name:<12} {value}");
        };
        let Self { strands, points, segments, length_mm, .. } = self;
        line("strands", format!("{strands}, {points} points, {segments} segments"));
        let mean = number(length_mm / f64::from((*strands).max(1)));
        line("length", format!("{} mm in all, {mean} mm a strand", number(*length_mm)));
        line(
            "thickness",
            match self.thickness_mm {
                Some([low, high]) if low < high => format!("{} to {} mm", number(low), number(high)),
                Some([_, high]) => format!("{} mm", number(high)),
                None => "none in the file; --thickness MM is needed to draw them".into(),
            },
        );
        if let Some(corners) = self.strand_bounds_mm {
            let [low, high] = corners.map(|corner| corner.map(number).join(", "));
            line("strand box", format!("({low}) to ({high}) mm"));
        }
        text
    }
}
