//! Collects the polylines of a strand file point by point, for the readers of these files.

use super::super::{Attribute, MAX_MM, StrandArrays, Strands};
use super::input::{WHAT, in_file, read_whole};
use crate::error::{Error, Result};
use crate::files::input::says_lps;
use glam::DVec3;
use std::io::Read;

/// Polylines read from a strand file whose format stores no thickness of the strands.
#[derive(Debug, Default)]
pub(super) struct Polylines {
    points: Vec<[f32; 3]>,
    segments: Vec<u32>,
    /// Number of points of the polyline that is still being read.
    open: usize,
    /// Number of polylines that were skipped because they have fewer than two points.
    lone: usize,
    /// Warnings for the user about the strand file.
    pub warnings: Vec<String>,
    /// Whether the strand file's coordinates are LPS (x to the patient's left, y to the back), so that the reader
    /// negates x and y.
    is_lps: bool,
}

impl Polylines {
    /// Creates an empty set of polylines for a strand file. Coordinates are LPS if the beginning of the file contains
    /// `SPACE=LPS`.
    pub fn in_space_of(bytes: &[u8]) -> Self {
        Self { is_lps: says_lps(bytes), ..Self::default() }
    }

    /// Reserves memory for a number of polyline points, after the caller has tested that the strand file is long
    /// enough for them.
    pub fn reserve(&mut self, points: usize) -> Result<()> {
        let reserved = self.points.try_reserve_exact(points);
        reserved.map_err(|_| in_file(format!("there is not enough memory for {points} points")))
    }

    /// Appends a point (mm) to the polyline that is being read from a strand file.
    pub fn point(&mut self, p: DVec3) -> Result<(), String> {
        if !p.to_array().iter().all(|x| x.abs() <= f64::from(MAX_MM)) {
            let [x, y, z] = p.to_array();
            return Err(format!("the point ({x}, {y}, {z}) is not finite or beyond {MAX_MM:e} mm"));
        }
        if self.points.len() >= u32::MAX as usize {
            return Err(format!("it has more than {} points", u32::MAX));
        }
        let reserved = self.points.try_reserve(1);
        reserved
            .map_err(|_| format!("there is not enough memory for more than {} points", self.points.len()))?;
        let turned = if self.is_lps { p * DVec3::new(-1.0, -1.0, 1.0) } else { p };
        self.points.push(turned.as_vec3().to_array());
        self.open += 1;
        Ok(())
    }

    /// Ends the polyline that is being read from a strand file. A polyline of fewer than two points is skipped and
    /// counted.
    pub fn end(&mut self) {
        if self.open < 2 {
            self.points.truncate(self.points.len() - self.open);
            self.lone += 1;
        } else {
            // There are at most `u32::MAX` points.
            self.segments.push((self.open - 1) as u32);
        }
        self.open = 0;
    }

    /// Whether a polyline of the strand file has been started and not yet ended.
    pub fn is_open(&self) -> bool {
        self.open > 0
    }

    /// Number of polylines read from the strand file so far, including those skipped for having fewer than two
    /// points.
    pub fn count(&self) -> usize {
        self.segments.len() + self.lone
    }

    fn into_strands(mut self, source: &str) -> Result<Strands> {
        if self.lone > 0 {
            let lone = self.lone;
            self.warnings.push(format!("{lone} lines of fewer than two points were skipped"));
        }
        let arrays = StrandArrays {
            strands: self.segments.len() as u32,
            segments: Attribute { default: 0, values: Some(self.segments) },
            points: self.points,
            thickness_mm: Attribute::constant(0.0),
            transparency: Attribute::constant(0.0),
            color: Attribute::constant([1.0; 3]),
            info: [0; 88],
        };
        let strands = Strands::new(source, arrays).map_err(|flaw| Error::input(WHAT, source, flaw.why))?;
        Ok(strands.with_warnings(self.warnings))
    }
}

/// Reads strands from a file of `length` bytes with the polyline parser of the file's format.
pub(super) fn read_by(
    parse: fn(&[u8]) -> Result<Polylines>,
    input: &mut dyn Read,
    length: u64,
    source: &str,
) -> Result<Strands> {
    let bytes = read_whole(input, length, source)?;
    let lines = parse(&bytes).map_err(|e| e.at(source))?;
    // Frees the file's bytes before memory is taken for the strands.
    drop(bytes);
    lines.into_strands(source)
}
