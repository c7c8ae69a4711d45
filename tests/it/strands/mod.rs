//! Strands: file formats, built-in sets, and voxelisation and directions against closed forms, brute force and
//! cylinders.

mod cylinders;
mod formats;
mod hair;
mod sets;
mod tangents;
mod voxelise;

use umbravox::strands::{Attribute, StrandArrays, Strands};

/// Creates strands of one thickness and transparency through the given points.
fn strands(lines: &[Vec<[f32; 3]>], thickness_mm: f32, transparency: f32) -> Strands {
    Strands::new("test", arrays(lines, thickness_mm, transparency)).unwrap()
}

fn arrays(lines: &[Vec<[f32; 3]>], thickness_mm: f32, transparency: f32) -> StrandArrays {
    StrandArrays {
        strands: lines.len() as u32,
        segments: Attribute {
            default: 0,
            values: Some(lines.iter().map(|l| u32::try_from(l.len() - 1).unwrap()).collect()),
        },
        points: lines.concat(),
        thickness_mm: Attribute::constant(thickness_mm),
        transparency: Attribute::constant(transparency),
        color: Attribute::constant([1.0; 3]),
        info: [0; 88],
    }
}
