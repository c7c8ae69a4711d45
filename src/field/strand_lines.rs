//! Strands drawn straight into a map: every segment as pieces of the light rays that it crosses, without a voxel between.
//!
//! A strand hides the share `d l / A` of a texel: `d` its diameter, `l` how long what lies in the texel is as seen from the
//! light, `A` the texel's area there. With opacity `a` the texel's transmittance falls by the factor `1 - a d l / A`, as
//! Lokovic and Veach 2000 have it of a surface that covers a part of a pixel (section 3.1). Parts of one strand that follow
//! each other within a texel lie beside each other: their shares are added up first, to no more than the opacity. A strand
//! that is wider than half a texel is drawn as lines side by side, eight a texel where it covers whole ones.
//!
//! Kim and Neumann 2001, Yuksel and Keyser 2008 and Voicu 2014 draw lines by the hardware, whose fragments count as a
//! medium does, `exp(-sum of opacities)`, each at a single depth. Here fragments are as deep as the strand is in the texel,
//! and cut half way to their neighbours where two overlap, since a march hands on pieces one after another.
//!
//! Segments are cut and sorted on the host, in float64, so that the order of pieces is the same on every device.

use super::LightSpace;
use super::constants::{NO_TILE, TILE, TILE_TEXELS};
use crate::strands::Strands;
use rayon::prelude::*;
use std::ops::Range;

/// Lines beside each other a texel that a strand is drawn as: one narrower than a texel, and a wider one.
const FEW_LINES: f64 = 2.0;
const MANY_LINES: f64 = 8.0;
/// What a covered texel lets through at least: what is over is over, and a logarithm of it finite.
const LEAST_LEFT: f64 = 1e-7;
/// Depths that are no further apart than this share of the map's range are one.
const SAME_DEPTH: f64 = 1e-6;
/// Words of a piece.
const PIECE_WORDS: u32 = 3;
/// Strands that a thread takes at a time.
const STRANDS_AT_ONCE: usize = 64;

/// What a strand does in a texel.
#[derive(Debug, Clone, Copy)]
struct Fragment {
    /// The texel's record.
    record: u32,
    /// Depths, mm.
    middle: f64,
    half: f64,
    /// Share of the light that it takes, and what it takes where it covers all.
    taken: f64,
    opacity: f64,
}

impl Fragment {
    fn place(&self, other: &Self) -> std::cmp::Ordering {
        let depths = self.middle.total_cmp(&other.middle).then(self.taken.total_cmp(&other.taken));
        self.record.cmp(&other.record).then(depths)
    }

    /// Of the same strand in the same texel, and right behind it.
    fn goes_on_in(&self, next: &Self, most_extent_mm: f64) -> bool {
        let extent = next.middle + next.half - (self.middle - self.half);
        self.record == next.record
            && next.middle - next.half <= self.middle + self.half
            && extent <= most_extent_mm
    }

    fn joined(&self, next: &Self) -> Self {
        let from = (self.middle - self.half).min(next.middle - next.half);
        let to = (self.middle + self.half).max(next.middle + next.half);
        let opacity = self.opacity.max(next.opacity);
        let taken = (self.taken + next.taken).min(opacity);
        Self { middle: 0.5 * (from + to), half: 0.5 * (to - from), taken, opacity, ..*self }
    }
}

/// The words of `shaders/field/march_lines.wgsl`: of each record the place of its first piece, and behind the last one the
/// place behind all; then the pieces, each two depths (mm) and an optical depth, in the order of records and depths.
///
/// `first_records` is the tile table of a map with so many records.
pub(super) fn line_words(
    strands: &Strands,
    space: &LightSpace,
    first_records: &[u32],
    records: u32,
) -> Vec<u32> {
    let drawing = Drawing { strands, space, first_records, most_extent_mm: space.texel_mm() };
    let ranges = strands.segment_ranges();
    let drawn = ranges.par_chunks(STRANDS_AT_ONCE).map(|ranges| {
        let (mut of_one, mut all) = (Vec::new(), Vec::new());
        for range in ranges {
            of_one.clear();
            drawing.draw(range.clone(), &mut of_one);
            of_one.sort_unstable_by(Fragment::place);
            drawing.join(&of_one, &mut all);
        }
        all
    });
    let fragments = in_order(&drawn.collect::<Vec<_>>(), records);
    let pieces = pieces(&fragments, space.z_range);

    let mut words = vec![0; records as usize + 1];
    words.reserve_exact(3 * pieces.len());
    pieces.iter().for_each(|(record, _)| words[*record as usize + 1] += PIECE_WORDS);
    let mut sum = records + 1;
    for count in &mut words {
        sum += *count;
        *count = sum;
    }
    words.extend(pieces.iter().flat_map(|(_, numbers)| numbers.map(f32::to_bits)));
    words
}

struct Drawing<'a> {
    strands: &'a Strands,
    space: &'a LightSpace,
    first_records: &'a [u32],
    most_extent_mm: f64,
}

impl Drawing<'_> {
    /// Fragments of a strand's segments.
    fn draw(&self, segments: Range<usize>, out: &mut Vec<Fragment>) {
        for index in segments {
            let segment = self.strands.segment(index);
            let (diameter, opacity) = (segment.diameter_mm, 1.0 - segment.transparency);
            if diameter <= 0.0 || opacity <= 0.0 {
                continue;
            }
            let [a, b] = segment.ends;
            let middle = 0.5 * (a + b);
            let (way, texel_mm) = self.space.ray_and_texel_mm(middle);
            let texels = diameter / texel_mm;
            let lines = (texels * if texels < 1.0 { FEW_LINES } else { MANY_LINES }).ceil();
            // Beyond the map's sides there is nothing to draw.
            let lines = lines.clamp(1.0, MANY_LINES * f64::from(self.space.map_size));
            let side = (b - a).cross(way).normalize_or_zero() * diameter;
            for line in 0..lines as u32 {
                let beside = side * ((f64::from(line) + 0.5) / lines - 0.5);
                self.space.texels_along([a + beside, b + beside], self.most_extent_mm, |part| {
                    let Some(record) = self.record(part.texel) else { return };
                    out.push(Fragment {
                        record,
                        middle: part.depth_mm,
                        half: 0.5 * (part.extent_mm + diameter / lines),
                        taken: opacity * (diameter / lines * part.across_mm / part.texel_mm2).min(1.0),
                        opacity,
                    });
                });
            }
        }
    }

    /// The record of a texel, as `record_of` of `shaders/field/tile_table.wgsl` has it.
    fn record(&self, [column, row]: [u32; 2]) -> Option<u32> {
        let tile = row / TILE * self.space.tiles_across() + column / TILE;
        let first = self.first_records.get(tile as usize).copied().filter(|first| *first != NO_TILE)?;
        let record = first + row % TILE * TILE + column % TILE;
        debug_assert!(record - first < TILE_TEXELS);
        Some(record)
    }

    /// Adds up what of one strand, sorted, follows each other within a texel.
    fn join(&self, fragments: &[Fragment], out: &mut Vec<Fragment>) {
        let first = out.len();
        for next in fragments {
            match out[first..].last_mut() {
                Some(last) if last.goes_on_in(next, self.most_extent_mm) => *last = last.joined(next),
                _ => out.push(*next),
            }
        }
    }
}

/// Fragments of all strands in the order of records and depths.
fn in_order(drawn: &[Vec<Fragment>], records: u32) -> Vec<Fragment> {
    let mut places = vec![0; records as usize + 1];
    drawn.iter().flatten().for_each(|f| places[f.record as usize + 1] += 1);
    let mut sum = 0;
    for place in &mut places {
        sum += *place;
        *place = sum;
    }
    let none = Fragment { record: 0, middle: 0.0, half: 0.0, taken: 0.0, opacity: 0.0 };
    let mut fragments = vec![none; sum];
    for fragment in drawn.iter().flatten() {
        let place = &mut places[fragment.record as usize];
        fragments[*place] = *fragment;
        *place += 1;
    }
    let of_one_texel = fragments.par_chunk_by_mut(|a, b| a.record == b.record);
    of_one_texel.for_each(|fragments| fragments.sort_unstable_by(Fragment::place));
    fragments
}

/// Fragments in their order, as pieces that do not overlap, with their records.
fn pieces(fragments: &[Fragment], [start, end]: [f64; 2]) -> Vec<(u32, [f32; 3])> {
    let same = SAME_DEPTH * (end - start).max(start.abs()).max(end.abs());
    let mut apart: Vec<(Fragment, f64)> = Vec::with_capacity(fragments.len());
    for next in fragments {
        let depth = -(1.0 - next.taken).max(LEAST_LEFT).ln();
        match apart.last_mut() {
            Some((last, sum)) if last.record == next.record && next.middle - last.middle <= same => {
                last.half = last.half.max(next.half);
                *sum += depth;
            }
            _ => apart.push((*next, depth)),
        }
    }
    let piece = |i: usize| {
        let (this, depth) = apart[i];
        let beside = |j: Option<usize>| {
            let (other, _) = j.and_then(|j| apart.get(j)).filter(|(f, _)| f.record == this.record)?;
            Some(0.5 * (this.middle + other.middle))
        };
        let from = beside(i.checked_sub(1)).unwrap_or(start).max(this.middle - this.half);
        let to = beside(Some(i + 1)).unwrap_or(end).min(this.middle + this.half);
        (this.record, [from.min(end) as f32, to.max(start) as f32, depth as f32])
    };
    (0..apart.len()).into_par_iter().map(piece).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn fragment(record: u32, middle: f64, half: f64, taken: f64) -> Fragment {
        Fragment { record, middle, half, taken, opacity: 1.0 }
    }

    #[test]
    fn pieces_are_cut_half_way_to_their_neighbours() {
        let fragments = [fragment(3, 1.0, 0.5, 0.5), fragment(3, 1.5, 0.5, 0.25), fragment(4, 1.6, 0.1, 0.5)];
        let found = pieces(&fragments, [0.0, 10.0]);
        let depth = |taken: f64| (-(1.0 - taken).ln()) as f32;
        let expected =
            [(3, [0.5, 1.25, depth(0.5)]), (3, [1.25, 2.0, depth(0.25)]), (4, [1.5, 1.7, depth(0.5)])];
        assert_eq!(found, expected);
    }

    #[test]
    fn parts_of_a_strand_take_no_more_than_it_can() {
        let part = |middle: f64| Fragment { opacity: 0.6, ..fragment(0, middle, 0.1, 0.4) };
        assert!(part(1.0).goes_on_in(&part(1.2), 1.0) && !part(1.0).goes_on_in(&part(1.3), 1.0));
        assert!(!part(1.0).goes_on_in(&part(1.2), 0.3), "too deep together");
        let both = part(1.0).joined(&part(1.2));
        assert!((both.middle - 1.1).abs() < 1e-12 && (both.half - 0.2).abs() < 1e-12);
        assert_eq!((both.taken, both.opacity), (0.6, 0.6));
    }

    #[test]
    fn what_lies_at_one_depth_is_one_piece_and_what_is_covered_ends_a_ray() {
        let found = pieces(&[fragment(0, 5.0, 1.0, 0.5), fragment(0, 5.0, 2.0, 0.5)], [0.0, 10.0]);
        assert_eq!(found.len(), 1);
        assert_eq!(found[0].1, [3.0, 7.0, -(0.25_f64.ln()) as f32]);
        let covered = pieces(&[fragment(0, 5.0, 1.0, 1.0)], [0.0, 10.0])[0].1[2];
        assert!(covered > 16.0 && covered.is_finite());
        // Nothing lies beyond the range of the map.
        let outside = pieces(&[fragment(0, 0.1, 1.0, 0.5), fragment(0, 9.9, 1.0, 0.5)], [0.0, 10.0]);
        assert_eq!((outside[0].1[0], outside[1].1[1]), (0.0, 10.0));
    }
}
