//! Strands: polylines with a thickness (hair, fur, fibre tracks), and the extinction volume voxelised from them.
//!
//! Strand files give points in world coordinates, mm, and thickness as a diameter, mm. A segment of length `L` has the
//! mean diameter `d` and mean transparency `t` of its two ends. Its area is `(1 - t) d L` mm^2: the area that it hides
//! when seen from the side. [`voxelise`] distributes this area over the voxels that the segment crosses. Divided by
//! the voxel's volume it is an extinction in 1/mm.
//!
//! ```text
//!  a file  ────┐
//!  built-in ───┴─> Strands ─> StrandGrid ─> voxelise ─> Volume (values are extinction, 1/mm)
//!                     │                └───> tangents: directions of the strands, for shading
//!                     └─────────────> measure::cylinders: error of the volume's transmittance against the strands'
//! ```

mod cell_traversal;
mod formats;
mod grid;
mod sets;
mod tangents;
mod tubes;
mod volume;
mod voxelise;

pub use formats::{
    HAIR_EXTENSIONS, HEADER_BYTES, STRAND_EXTENSIONS, STRAND_FORMATS, StrandFormat, read_strands,
    strands_of_bytes, write_hair,
};
pub use grid::{DEFAULT_RESOLUTION, RESOLUTIONS, StrandGrid};
pub use sets::StrandSet;
pub use tangents::tangents;
pub use tubes::{MOST_TRIANGLES, SIDES, Tubes, tubes};
pub use volume::{STRANDS_FORMAT, StrandVolume, VoxelisedStrands};
pub use voxelise::{Conservation, Kernel, voxelise};

use crate::error::{Error, Result};
use glam::DVec3;
use rayon::prelude::*;

/// Largest coordinate and thickness of strands, mm. Beyond it 32-bit positions have too little precision.
pub const MAX_MM: f32 = 1e9;

/// Attribute of strands, such as thickness: one common value, or one value for each strand or point.
#[derive(Debug, Clone, PartialEq)]
pub struct Attribute<D, T = D> {
    /// Common value of the attribute for all strands or points, used if there is no array of values.
    pub default: D,
    /// Array of the attribute's values, one for each strand or point; `None` if all have the common value.
    pub values: Option<Vec<T>>,
}

impl<D, T> Attribute<D, T> {
    /// Creates a strand attribute with one value for all strands or points.
    pub fn constant(default: D) -> Self {
        Self { default, values: None }
    }
}

/// Contents of a strand file before validation. Every array except `segments` has one entry for each point.
#[derive(Debug, Clone, PartialEq)]
pub struct StrandArrays {
    /// Number of strands in the strand file.
    pub strands: u32,
    /// Number of segments of each strand, one fewer than its points.
    pub segments: Attribute<u32>,
    /// Points of all strands, strand after strand, mm.
    pub points: Vec<[f32; 3]>,
    /// Diameter of the strand at each point, mm.
    pub thickness_mm: Attribute<f32>,
    /// Transparency of the strand at each point, 0 (opaque) to 1.
    pub transparency: Attribute<f32>,
    /// RGB colour of the strand at each point. Voxelisation ignores it.
    pub color: Attribute<[f32; 3]>,
    /// Information text of a `.hair` file (88 bytes); it may be binary.
    pub info: [u8; 88],
}

/// Kind of data in a strand file, such as points or thickness, to which an error refers.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum StrandQuantity {
    /// Refers to the number of points in a strand file.
    Count,
    /// Refers to the array of segment counts, one for each strand of a strand file.
    Segments,
    /// Refers to the array of point positions in a strand file.
    Points,
    /// Refers to the array of strand diameters, one for each point of a strand file.
    Thickness,
    /// Refers to the array of strand transparencies, one for each point of a strand file.
    Transparency,
    /// Refers to the array of strand colours, one for each point of a strand file.
    Color,
}

/// Error in the arrays of a strand file ([`StrandArrays`]): an invalid value or a wrong length.
#[derive(Debug, Clone, PartialEq)]
pub struct Flaw {
    /// Kind of strand data that is invalid, such as points or thickness.
    pub part: StrandQuantity,
    /// Index of the invalid entry in the strand file's array; `None` if the array's default or length is invalid.
    pub entry: Option<usize>,
    /// Reason why the strand data are invalid, in one line.
    pub why: String,
}

/// Set of strands whose arrays were validated: matching lengths and valid numbers.
#[derive(Debug, Clone, PartialEq)]
pub struct Strands {
    source: String,
    arrays: StrandArrays,
    /// Index of the first of the two points of each strand segment.
    first_points: Vec<u32>,
    /// Warnings about the strand file, for the user.
    warnings: Vec<String>,
}

/// Segment of a strand between two neighbouring points.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Segment {
    /// End points of the strand segment, world mm.
    pub ends: [DVec3; 2],
    /// Diameter of the strand segment, the mean of its ends, mm.
    pub diameter_mm: f64,
    /// Transparency of the strand segment, the mean of its ends, 0 (opaque) to 1.
    pub transparency: f64,
}

impl Segment {
    /// Area that the strand segment hides when viewed from the side, `(1 - transparency) diameter length`, mm^2.
    pub fn area_mm2(&self) -> f64 {
        (1.0 - self.transparency) * self.diameter_mm * self.ends[0].distance(self.ends[1])
    }
}

impl Strands {
    /// Validates the arrays of a strand file and makes strands of them; `source` is the path or name for messages.
    ///
    /// # Errors
    /// Arrays disagree in length, or a number is out of its range.
    pub fn new(source: impl Into<String>, arrays: StrandArrays) -> Result<Self, Flaw> {
        arrays.check()?;
        let count = arrays.points.len() - arrays.strands as usize;
        let mut first_points = Vec::new();
        first_points.try_reserve_exact(count).map_err(|_| {
            let why = format!("there is not enough memory for {count} segments");
            Flaw { part: StrandQuantity::Count, entry: None, why }
        })?;
        let mut first = 0;
        for segments in arrays.segment_counts() {
            first_points.extend(first..first + segments);
            first += segments + 1;
        }
        Ok(Self { source: source.into(), arrays, first_points, warnings: Vec::new() })
    }

    /// Replaces the warnings about the strand file from which these strands were read.
    #[must_use]
    pub fn with_warnings(self, warnings: Vec<String>) -> Self {
        Self { warnings, ..self }
    }

    /// Warnings about the strand file from which these strands were read, one line each.
    pub fn warnings(&self) -> &[String] {
        &self.warnings
    }

    /// Source of the strands: a file path, or `phantom:hair-NAME:SEGMENTS` for a built-in set.
    pub fn source(&self) -> &str {
        &self.source
    }

    /// Arrays that store the strands: points, numbers of segments, thickness, transparency and colour.
    pub fn arrays(&self) -> &StrandArrays {
        &self.arrays
    }

    /// Number of segments of all strands.
    pub fn segment_count(&self) -> usize {
        self.first_points.len()
    }

    /// Range of segment indices of each strand; segments are numbered strand after strand.
    pub fn segment_ranges(&self) -> Vec<std::ops::Range<usize>> {
        let mut first = 0;
        let range = |count: u32| {
            let start = first;
            first += count as usize;
            start..first
        };
        self.arrays.segment_counts().map(range).collect()
    }

    /// Returns whether the strands have a thickness: an array of diameters, or a default above 0.
    pub fn has_thickness(&self) -> bool {
        self.arrays.thickness_mm.values.is_some() || self.arrays.thickness_mm.default > 0.0
    }

    /// Largest diameter of the strands, mm; 0 if none is given.
    pub fn widest_mm(&self) -> f64 {
        let Attribute { default, values } = &self.arrays.thickness_mm;
        values.as_ref().map_or(*default, |values| values.iter().copied().fold(0.0, f32::max)).into()
    }

    /// Sets one diameter (mm) for all strands.
    ///
    /// # Errors
    /// The diameter is not above 0, or beyond [`MAX_MM`].
    pub fn with_thickness(mut self, diameter_mm: f64) -> Result<Self> {
        if !(diameter_mm > 0.0 && diameter_mm <= f64::from(MAX_MM)) {
            let why = format!("{diameter_mm} is not above 0 and at most {MAX_MM:e} mm");
            return Err(Error::input("cannot use thickness", "--thickness", why));
        }
        self.arrays.thickness_mm = Attribute::constant(diameter_mm as f32);
        Ok(self)
    }

    /// Returns a segment of the strands by its index; segments are numbered strand after strand.
    ///
    /// # Panics
    /// There are fewer segments.
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

    /// z coordinates of the two ends of a strand segment, mm.
    #[inline]
    fn segment_z(&self, index: usize) -> [f64; 2] {
        let first = self.first_points[index] as usize;
        [first, first + 1].map(|p| f64::from(self.arrays.points[p][2]))
    }

    /// Bounding box of all strands including their thickness, world mm; `None` if there are no points.
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
    /// Number of segments of each strand.
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
            (StrandQuantity::Segments, self.segments.values.as_ref().map(Vec::len), self.strands as usize),
            (StrandQuantity::Thickness, self.thickness_mm.values.as_ref().map(Vec::len), points),
            (StrandQuantity::Transparency, self.transparency.values.as_ref().map(Vec::len), points),
            (StrandQuantity::Color, self.color.values.as_ref().map(Vec::len), points),
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
            return flaw(StrandQuantity::Count, None, why);
        }
        let coordinate = |x: &f32| x.abs() <= MAX_MM;
        if let Some(i) = self.points.iter().position(|p| !p.iter().all(coordinate)) {
            let why = format!("the point {:?} is not finite or beyond {MAX_MM:e} mm", self.points[i]);
            return flaw(StrandQuantity::Points, Some(i), why);
        }
        let thickness = |d: &f32| (0.0..=MAX_MM).contains(d);
        check_each(StrandQuantity::Thickness, &self.thickness_mm, thickness, "a thickness, 0 to 1e9 mm")?;
        let transparency = |t: &f32| (0.0..=1.0).contains(t);
        check_each(StrandQuantity::Transparency, &self.transparency, transparency, "a transparency, 0 to 1")?;
        let color = |c: &[f32; 3]| c.iter().all(|x| x.is_finite());
        check_each(StrandQuantity::Color, &self.color, color, "a colour of three finite numbers")
    }

    /// Number of points that the strands must have according to their numbers of segments.
    fn points_wanted(&self) -> u64 {
        let strands = u64::from(self.strands);
        match &self.segments.values {
            Some(values) => strands + values.iter().map(|&n| u64::from(n)).sum::<u64>(),
            // At most 2^32 (2^32 - 1), which fits a u64.
            None => strands * (u64::from(self.segments.default) + 1),
        }
    }
}

/// Returns an error for the first invalid value of a strand attribute, such as a negative thickness. Without an array
/// it tests the common value.
fn check_each<T: std::fmt::Debug>(
    part: StrandQuantity,
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
