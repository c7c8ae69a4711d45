//! Polylines as they come out of a file, point after point: what all formats but `.hair` have in common.

use super::super::{Attribute, MAX_MM, StrandArrays, Strands};
use super::input::{Trouble, WHAT, whole};
use crate::error::{Error, Result};
use crate::files::input::says_lps;
use glam::DVec3;
use std::io::Read;

/// Polylines without a thickness.
#[derive(Debug, Default)]
pub(super) struct Lines {
    points: Vec<[f32; 3]>,
    segments: Vec<u32>,
    /// Points of the line that has not ended.
    open: usize,
    /// Lines of no length, which are left out.
    lone: usize,
    /// What a user should know.
    warnings: Vec<String>,
    /// The file's axes go left and back: they are turned about.
    is_lps: bool,
}

/// What is wrong, without a place.
type Why<T> = std::result::Result<T, String>;

impl Lines {
    /// Of a file whose beginning may say `SPACE=LPS`.
    pub fn of_space(bytes: &[u8]) -> Self {
        Self { is_lps: says_lps(bytes), ..Self::default() }
    }

    /// Makes room for points that the file has been seen to be long enough for.
    pub fn reserve(&mut self, points: usize) -> Why<()> {
        let room = self.points.try_reserve_exact(points);
        room.map_err(|_| format!("there is not enough memory for {points} points"))
    }

    /// A further point of the line, mm.
    pub fn point(&mut self, p: DVec3) -> Why<()> {
        if !p.to_array().iter().all(|x| x.abs() <= f64::from(MAX_MM)) {
            let [x, y, z] = p.to_array();
            return Err(format!("the point ({x}, {y}, {z}) is not finite or beyond {MAX_MM:e} mm"));
        }
        if self.points.len() >= u32::MAX as usize {
            return Err(format!("it has more than {} points", u32::MAX));
        }
        let room = self.points.try_reserve(1);
        room.map_err(|_| format!("there is not enough memory for more than {} points", self.points.len()))?;
        let turned = if self.is_lps { p * DVec3::new(-1.0, -1.0, 1.0) } else { p };
        self.points.push(turned.as_vec3().to_array());
        self.open += 1;
        Ok(())
    }

    /// The line ends; one of fewer than two points is left out and counted.
    pub fn end(&mut self) -> Why<()> {
        if self.open < 2 {
            self.points.truncate(self.points.len() - self.open);
            self.lone += 1;
        } else {
            let room = self.segments.try_reserve(1);
            room.map_err(|_| format!("there is not enough memory for {} lines", self.segments.len()))?;
            // Points are no more than a u32 counts.
            self.segments.push((self.open - 1) as u32);
        }
        self.open = 0;
        Ok(())
    }

    /// Whether the line that has not ended has any point.
    pub fn is_open(&self) -> bool {
        self.open > 0
    }

    /// Lines that have ended, those that were left out among them.
    pub fn count(&self) -> usize {
        self.segments.len() + self.lone
    }

    /// Says something to the user.
    pub fn warn(&mut self, warning: String) {
        self.warnings.push(warning);
    }

    fn into_strands(mut self, source: &str) -> Result<Strands> {
        if self.lone > 0 {
            let lone = self.lone;
            self.warnings.push(format!("{lone} lines of fewer than two points were left out"));
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

/// Strands of an input of `length` bytes, by what reads its bytes.
pub(super) fn read_by(
    parse: fn(&[u8]) -> std::result::Result<Lines, Trouble>,
    input: &mut dyn Read,
    length: u64,
    source: &str,
) -> Result<Strands> {
    let bytes = whole(input, length, source)?;
    let lines = parse(&bytes).map_err(|trouble| trouble.into_error(source))?;
    // The file is not needed beside the strands' own arrays.
    drop(bytes);
    lines.into_strands(source)
}
