//! Strands: polylines with a thickness (hair, fur), and the extinction volume that stands for them.
//!
//! World coordinates are the file's own, taken as mm; thickness is the diameter in mm. Along a segment of length `L`
//! diameter `d` and transparency `t` are the means of those at its two ends, and it counts `(1 - t) d L` mm^2: the
//! area that it hides when it is seen from the side. [`voxelise`] spreads that area over the voxels that it crosses;
//! divided by the voxel's volume it is an extinction in 1/mm.
//!
//! ```text
//!  a file  ────┐
//!  built-in ───┴─> Strands ─> StrandGrid ─> voxelise ─> Volume (values are extinction, 1/mm)
//!                     │                └───> tangents: which way they run, where a picture is shaded by that
//!                     └─────────────> measure::cylinders: how far the volume's transmittance is from the strands'
//! ```

mod formats;
mod grid;
mod random;
mod sets;
mod tangents;
mod tubes;
mod volume;
mod voxelise;
mod walk;

pub use formats::{
    HAIR_EXTENSIONS, HEADER_BYTES, STRAND_EXTENSIONS, STRAND_FORMATS, StrandFormat, read_strands,
    strands_of_bytes, write_hair,
};
pub use grid::{DEFAULT_RESOLUTION, RESOLUTIONS, StrandGrid};
pub use random::Chance;
pub use sets::StrandSet;
pub use tangents::{tangents, tangents_with};
pub use tubes::{MOST_TRIANGLES, SIDES, Tubes, tubes};
pub use volume::{STRANDS_FORMAT, StrandVolume, VoxelisedStrands};
pub use voxelise::{Conservation, Kernel, voxelise, voxelise_with};

use crate::error::{Error, Result};
use glam::DVec3;
use rayon::prelude::*;

/// Beyond a thousand kilometres 32-bit positions, and their squares, mean nothing.
pub const MAX_MM: f32 = 1e9;

/// A quantity given once for all (`default`) or one by one.
#[derive(Debug, Clone, PartialEq)]
pub struct Attribute<D, T = D> {
    /// Holds where `values` is absent, and is kept where it is not.
    pub default: D,
    /// One by one.
    pub values: Option<Vec<T>>,
}

impl<D, T> Attribute<D, T> {
    /// One for all.
    pub fn constant(default: D) -> Self {
        Self { default, values: None }
    }
}

/// What a strand file holds, unchecked; every array but `segments` has one entry a point.
#[derive(Debug, Clone, PartialEq)]
pub struct StrandArrays {
    /// Number of strands.
    pub strands: u32,
    /// Segments of each strand, one fewer than its points.
    pub segments: Attribute<u32>,
    /// Strand after strand, mm.
    pub points: Vec<[f32; 3]>,
    /// Diameter, mm.
    pub thickness_mm: Attribute<f32>,
    /// 0 (opaque) to 1.
    pub transparency: Attribute<f32>,
    /// RGB; kept, not used by voxelising.
    pub color: Attribute<[f32; 3]>,
    /// What the file says about itself; may be binary.
    pub info: [u8; 88],
}

/// One of the quantities of [`StrandArrays`].
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Part {
    /// The number of points.
    Count,
    /// Segments of each strand.
    Segments,
    /// Positions.
    Points,
    /// Diameters.
    Thickness,
    /// Transparencies.
    Transparency,
    /// Colours.
    Color,
}

/// What is wrong with [`StrandArrays`], and where.
#[derive(Debug, Clone, PartialEq)]
pub struct Flaw {
    /// Which quantity.
    pub part: Part,
    /// Which entry of the array; `None` for its default.
    pub entry: Option<usize>,
    /// What is wrong, in one line.
    pub why: String,
}

/// Strands whose arrays have been checked: they agree in length and every number means something.
#[derive(Debug, Clone, PartialEq)]
pub struct Strands {
    source: String,
    arrays: StrandArrays,
    /// The first of the two points of each segment.
    first_points: Vec<u32>,
    /// What a user should know of the file.
    warnings: Vec<String>,
}

/// A piece of a strand between two neighbouring points.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Segment {
    /// World mm.
    pub ends: [DVec3; 2],
    /// Diameter, mm.
    pub diameter_mm: f64,
    /// 0 (opaque) to 1.
    pub transparency: f64,
}

impl Segment {
    /// `(1 - transparency) diameter length`, mm^2.
    pub fn area_mm2(&self) -> f64 {
        (1.0 - self.transparency) * self.diameter_mm * self.ends[0].distance(self.ends[1])
    }
}

impl Strands {
    /// Checks arrays and takes them over; `source` is the path or name for messages.
    ///
    /// # Errors
    /// Arrays that disagree in length, or a number out of its range.
    pub fn new(source: impl Into<String>, arrays: StrandArrays) -> Result<Self, Flaw> {
        arrays.check()?;
        let count = arrays.points.len() - arrays.strands as usize;
        let mut first_points = Vec::new();
        first_points.try_reserve_exact(count).map_err(|_| Flaw {
            part: Part::Count,
            entry: None,
            why: format!("there is not enough memory for {count} segments"),
        })?;
        let mut first = 0;
        for segments in arrays.segment_counts() {
            first_points.extend(first..first + segments);
            first += segments + 1;
        }
        Ok(Self { source: source.into(), arrays, first_points, warnings: Vec::new() })
    }

    /// With what a user should know of the file.
    #[must_use]
    pub fn with_warnings(self, warnings: Vec<String>) -> Self {
        Self { warnings, ..self }
    }

    /// What a user should know of the file that they are from, a line each.
    pub fn warnings(&self) -> &[String] {
        &self.warnings
    }

    /// Path or `phantom:hair-NAME:SEGMENTS`.
    pub fn source(&self) -> &str {
        &self.source
    }

    /// What it was made of.
    pub fn arrays(&self) -> &StrandArrays {
        &self.arrays
    }

    /// Number of segments of all strands.
    pub fn segment_count(&self) -> usize {
        self.first_points.len()
    }

    /// Numbers of the segments of each strand, strand after strand.
    pub fn segment_ranges(&self) -> Vec<std::ops::Range<usize>> {
        let mut first = 0;
        let range = |count: u32| {
            let start = first;
            first += count as usize;
            start..first
        };
        self.arrays.segment_counts().map(range).collect()
    }

    /// Whether any thickness is given: an array, or a default above 0.
    pub fn has_thickness(&self) -> bool {
        self.arrays.thickness_mm.values.is_some() || self.arrays.thickness_mm.default > 0.0
    }

    /// The largest diameter of a segment, mm; 0 where there is none.
    pub fn widest_mm(&self) -> f64 {
        let thickness = &self.arrays.thickness_mm;
        let default = f64::from(thickness.default);
        let widest = |values: &Vec<f32>| values.iter().copied().fold(0.0, f32::max).into();
        thickness.values.as_ref().map_or(default, widest)
    }

    /// The same strands, all of one diameter.
    ///
    /// # Errors
    /// A diameter that is not above 0, or beyond [`MAX_MM`].
    pub fn with_thickness(mut self, diameter_mm: f64) -> Result<Self> {
        if !(diameter_mm > 0.0 && diameter_mm <= f64::from(MAX_MM)) {
            let why = format!("{diameter_mm} is not above 0 and at most {MAX_MM:e} mm");
            return Err(Error::input("cannot use thickness", "--thickness", why));
        }
        self.arrays.thickness_mm = Attribute::constant(diameter_mm as f32);
        Ok(self)
    }

    /// A segment by its number, strand after strand.
    ///
    /// # Panics
    /// When there are not as many.
    #[inline]
    pub fn segment(&self, index: usize) -> Segment {
        let first = self.first_points[index] as usize;
        let mean = |a: &Attribute<f32>| match &a.values {
            Some(values) => 0.5 * (f64::from(values[first]) + f64::from(values[first + 1])),
            None => f64::from(a.default),
        };
        Segment {
            ends: [first, first + 1].map(|p| DVec3::from_array(self.arrays.points[p].map(f64::from))),
            diameter_mm: mean(&self.arrays.thickness_mm),
            transparency: mean(&self.arrays.transparency),
        }
    }

    /// The z coordinates of a segment's ends alone.
    #[inline]
    fn segment_z(&self, index: usize) -> [f64; 2] {
        let first = self.first_points[index] as usize;
        [first, first + 1].map(|p| f64::from(self.arrays.points[p][2]))
    }

    /// Smallest and largest corner of the box around all strands as thick as they are, world mm; `None` without
    /// points.
    pub fn bounds_mm(&self) -> Option<[DVec3; 2]> {
        let thickness = &self.arrays.thickness_mm;
        let grow = |[low, high]: [DVec3; 2], (i, p): (usize, &[f32; 3])| {
            let diameter = thickness.values.as_ref().map_or(thickness.default, |values| values[i]);
            let radius = DVec3::splat(0.5 * f64::from(diameter));
            let p = DVec3::from_array(p.map(f64::from));
            [low.min(p - radius), high.max(p + radius)]
        };
        let none = || [DVec3::INFINITY, DVec3::NEG_INFINITY];
        let points = self.arrays.points.par_iter().enumerate();
        let [low, high] = points.fold(none, grow).reduce(none, |a, b| [a[0].min(b[0]), a[1].max(b[1])]);
        (!self.arrays.points.is_empty()).then_some([low, high])
    }
}

impl StrandArrays {
    /// Segments of each strand in turn.
    fn segment_counts(&self) -> impl Iterator<Item = u32> + '_ {
        (0..self.strands as usize).map(|s| match &self.segments.values {
            Some(values) => values[s],
            None => self.segments.default,
        })
    }

    fn check(&self) -> Result<(), Flaw> {
        let flaw = |part, entry, why: String| Err(Flaw { part, entry, why });
        let points = self.points.len();
        let lengths = [
            (Part::Segments, self.segments.values.as_ref().map(Vec::len), self.strands as usize),
            (Part::Thickness, self.thickness_mm.values.as_ref().map(Vec::len), points),
            (Part::Transparency, self.transparency.values.as_ref().map(Vec::len), points),
            (Part::Color, self.color.values.as_ref().map(Vec::len), points),
        ];
        for (part, length, wanted) in lengths {
            if length.is_some_and(|n| n != wanted) {
                return flaw(part, None, format!("it has {length:?} entries instead of {wanted}"));
            }
        }
        let wanted = self.points_wanted();
        if wanted != points as u64 || u32::try_from(points).is_err() {
            let strands = self.strands;
            let why = format!("{strands} strands of these segments have {wanted} points, not {points}");
            return flaw(Part::Count, None, why);
        }
        let coordinate = |x: &f32| x.abs() <= MAX_MM;
        if let Some(i) = self.points.iter().position(|p| !p.iter().all(coordinate)) {
            let why = format!("the point {:?} is not finite or beyond {MAX_MM:e} mm", self.points[i]);
            return flaw(Part::Points, Some(i), why);
        }
        check_each(
            Part::Thickness,
            &self.thickness_mm,
            |d| (0.0..=MAX_MM).contains(d),
            "a thickness, 0 to 1e9 mm",
        )?;
        check_each(
            Part::Transparency,
            &self.transparency,
            |t| (0.0..=1.0).contains(t),
            "a transparency, 0 to 1",
        )?;
        check_each(
            Part::Color,
            &self.color,
            |c| c.iter().all(|x| x.is_finite()),
            "a colour of three finite numbers",
        )
    }

    /// Points that the segments ask for.
    fn points_wanted(&self) -> u64 {
        let strands = u64::from(self.strands);
        match &self.segments.values {
            Some(values) => strands + values.iter().map(|&n| u64::from(n)).sum::<u64>(),
            // At most 2^32 (2^32 - 1), which fits.
            None => strands * (u64::from(self.segments.default) + 1),
        }
    }
}

/// Refuses the first value, or the default where it is in use, that is not as it must be.
fn check_each<T: std::fmt::Debug>(
    part: Part,
    attribute: &Attribute<T>,
    good: impl Fn(&T) -> bool,
    what: &str,
) -> Result<(), Flaw> {
    let bad = match &attribute.values {
        Some(values) => values.iter().position(|v| !good(v)).map(|i| (Some(i), &values[i])),
        None => (!good(&attribute.default)).then_some((None, &attribute.default)),
    };
    match bad {
        Some((entry, value)) => Err(Flaw { part, entry, why: format!("{value:?} is not {what}") }),
        None => Ok(()),
    }
}
