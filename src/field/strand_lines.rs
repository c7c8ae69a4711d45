//! Draws strands (hair or fibres) directly into a shadow map, without voxels: each strand segment becomes intervals
//! with extinction on the light rays that it crosses.
//!
//! A strand covers the share `d l / A` of a texel: `d` is its diameter, `l` its length in the texel across the light,
//! and `A` the area of the texel. With opacity `a` it transmits `1 - a d l / A` of the texel's light, as deep shadow
//! maps do where a surface covers a part of a pixel (Lokovic and Veach 2000). Several strands count as independent:
//! their factors are multiplied. Consecutive parts of one strand in a texel do not overlap: their shares are added
//! up, to at most `a`. A strand wider than half a texel is drawn as parallel lines, eight per texel where it covers
//! whole texels.
//!
//! Kim and Neumann 2001, Yuksel and Keyser 2008 and Voicu 2014 rasterise lines in hardware: their fragments attenuate
//! as a medium does, `exp(-sum of opacities)`, each at a single depth. Here a fragment has the depth extent of the
//! strand in the texel, and overlapping neighbours are cut half way, since a march produces disjoint intervals in
//! order.
//!
//! The host cuts and sorts segments in float64, so that the order of intervals is the same on every device.

use super::LightSpace;
use super::constants::{NO_TILE, TILE, TILE_TEXELS};
use crate::strands::Strands;
use glam::DVec3;
use rayon::prelude::*;
use std::ops::Range;
use std::sync::atomic::{AtomicUsize, Ordering};

/// Number of parallel lines per texel width with which a strand is drawn into a shadow map: for a strand narrower
/// than a texel, and for a wider one.
const FEW_LINES: f64 = 2.0;
const MANY_LINES: f64 = 8.0;
/// Smallest transmittance of a shadow-map texel that strands cover, so that its logarithm is finite.
const LEAST_LEFT: f64 = 1e-7;
/// Tolerance within which the depths of two strand fragments count as equal, relative to the shadow map's depth range
/// or largest depth.
const SAME_DEPTH: f64 = 1e-6;
/// Ratio of shadow-map texel widths at the ends of a strand segment, beyond which the segment is halved; and the
/// largest number of successive halvings.
const MOST_CHANGE: f64 = 1.25;
const MOST_HALVINGS: u32 = 12;
/// Largest number of parallel lines with which a strand segment is drawn, per texel along a side of the shadow map.
/// The limit matters only for a strand that reaches to the light.
const MOST_LINES: f64 = 4.0;
/// Largest number of parts into which all strands together may be cut when they are drawn into a shadow map. Drawing
/// so many takes tens of seconds.
const MOST_PARTS: usize = 1 << 28;
/// Number of 32-bit words that store one interval of a light ray: start, end and optical depth.
const PIECE_WORDS: u32 = 3;
/// Number of strands that a thread draws into the shadow map as one parallel task.
const STRANDS_AT_ONCE: usize = 64;

/// Contribution of one strand to one texel of a shadow map, over a range of depths.
#[derive(Debug, Clone, Copy)]
struct Fragment {
    /// Index of the shadow-map texel's data record.
    record: u32,
    /// Depth at the middle of a strand fragment in a shadow-map texel, and half its extent in depth, mm.
    middle: f64,
    half: f64,
    /// Share of a shadow-map texel's light that the strand absorbs, and the share that it would absorb if it covered
    /// the whole texel.
    taken: f64,
    opacity: f64,
}

impl Fragment {
    fn place(&self, other: &Self) -> std::cmp::Ordering {
        let depths = self.middle.total_cmp(&other.middle).then(self.taken.total_cmp(&other.taken));
        self.record.cmp(&other.record).then(depths)
    }

    fn start(&self) -> f64 {
        self.middle - self.half
    }

    fn end(&self) -> f64 {
        self.middle + self.half
    }

    /// Whether another fragment of the same strand follows in the same shadow-map texel, without a gap in depth.
    fn goes_on_in(&self, next: &Self) -> bool {
        self.record == next.record && next.start() <= self.end()
    }

    /// Joins two consecutive fragments of one strand in a shadow-map texel.
    fn joined(&self, next: &Self) -> Self {
        let (from, to) = (self.start().min(next.start()), self.end().max(next.end()));
        let (taken, opacity) = (self.taken + next.taken, self.opacity.max(next.opacity));
        Self { middle: 0.5 * (from + to), half: 0.5 * (to - from), taken, opacity, ..*self }
    }
}

/// Converts the absorbed shares of one strand's sorted fragments, so that each is a share of the light that earlier
/// fragments transmit. In each texel, consecutive fragments together absorb the sum of their original shares, but at
/// most the strand's opacity. Adjoining fragments are joined up to a depth extent of `most_extent_mm`.
fn shares_of_the_rest(fragments: &[Fragment], most_extent_mm: f64, out: &mut Vec<Fragment>) {
    // Current chain: its absorbed share before the last fragment, and this fragment.
    let (mut before, mut last): (f64, Option<Fragment>) = (0.0, None);
    let mut close = |before: f64, fragment: Fragment| {
        let all = (before + fragment.taken).min(fragment.opacity);
        let taken = ((all - before) / (1.0 - before)).clamp(0.0, 1.0);
        if taken > 0.0 {
            out.push(Fragment { taken, ..fragment });
        }
        all.max(before)
    };
    for next in fragments {
        last = Some(match last {
            Some(here) if here.goes_on_in(next) => {
                let joined = here.joined(next);
                if 2.0 * joined.half <= most_extent_mm {
                    joined
                } else {
                    before = close(before, here);
                    *next
                }
            }
            Some(here) => {
                close(before, here);
                before = 0.0;
                *next
            }
            None => *next,
        });
    }
    if let Some(here) = last {
        close(before, here);
    }
}

/// Returns the buffer of the intervals of light rays in strands, which `shaders/field/march_strands.wgsl` reads, as
/// 32-bit words. It begins with the offset of each texel's first interval, and the end of the last interval. All
/// intervals follow, in the order of texels and depths; each has two depths (mm) and an optical depth.
///
/// `first_records` is the tile table of a shadow map with `records` texel records.
///
/// # Errors
/// The buffer takes more than `most_bytes`. The error text states the reason.
pub(super) fn line_words(
    strands: &Strands,
    space: &LightSpace,
    first_records: &[u32],
    records: u32,
    most_bytes: u64,
) -> Result<Vec<u32>, String> {
    let (most_extent_mm, parts) = (space.texel_mm(), AtomicUsize::new(0));
    let rasterizer = StrandRasterizer { strands, space, first_records, most_extent_mm, parts: &parts };
    let ranges = strands.segment_ranges();
    let drawn = ranges.par_chunks(STRANDS_AT_ONCE).map(|ranges| {
        let (mut of_one, mut all) = (Vec::new(), Vec::new());
        for range in ranges {
            of_one.clear();
            rasterizer.draw(range.clone(), &mut of_one);
            of_one.sort_unstable_by(Fragment::place);
            shares_of_the_rest(&of_one, most_extent_mm, &mut all);
        }
        all
    });
    let drawn = drawn.collect::<Vec<_>>();
    let count: usize = drawn.iter().map(Vec::len).sum();
    let bytes = 4 * (u64::from(records) + 1 + u64::from(PIECE_WORDS) * count as u64);
    if rasterizer.is_too_much() || bytes > most_bytes {
        let lists = format!("they cross its texels {count} times or more, {bytes} bytes");
        return Err(format!("{lists}, and the adapter's lists hold {most_bytes}: it is too fine for them"));
    }
    let fragments = in_order(&drawn, records);
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
    Ok(words)
}

struct StrandRasterizer<'a> {
    strands: &'a Strands,
    space: &'a LightSpace,
    first_records: &'a [u32],
    most_extent_mm: f64,
    /// Number of parts of strands that all threads have drawn into the shadow map so far.
    parts: &'a AtomicUsize,
}

impl StrandRasterizer<'_> {
    fn is_too_much(&self) -> bool {
        self.parts.load(Ordering::Relaxed) > MOST_PARTS
    }

    /// Draws the segments of one strand as fragments in the texels of a shadow map.
    fn draw(&self, segments: Range<usize>, out: &mut Vec<Fragment>) {
        for index in segments {
            let segment = self.strands.segment(index);
            let opacity = 1.0 - segment.transparency;
            if segment.diameter_mm > 0.0 && opacity > 0.0 && segment.ends[0] != segment.ends[1] {
                self.draw_part(segment.ends, (segment.diameter_mm, opacity), MOST_HALVINGS, out);
            }
        }
    }

    /// Draws one strand segment as fragments in the texels of a shadow map. It halves the segment if the texel widths
    /// at its ends differ much.
    fn draw_part(&self, [a, b]: [DVec3; 2], strand: (f64, f64), halvings: u32, out: &mut Vec<Fragment>) {
        let middle = 0.5 * (a + b);
        let (direction, texel_mm) = self.space.ray_and_texel_mm(middle);
        let widths = [a, b].map(|p| self.space.ray_and_texel_mm(p).1);
        let [least, most] = [widths[0].min(widths[1]).min(texel_mm), widths[0].max(widths[1]).max(texel_mm)];
        if self.is_too_much() {
            return;
        }
        if most > MOST_CHANGE * least && halvings > 0 {
            for half in [[a, middle], [middle, b]] {
                self.draw_part(half, strand, halvings - 1, out);
            }
            return;
        }
        let (diameter, opacity) = strand;
        let texels = diameter / least.max(f64::MIN_POSITIVE);
        let lines = (texels * if texels < 1.0 { FEW_LINES } else { MANY_LINES }).ceil();
        let lines = lines.clamp(1.0, MOST_LINES * f64::from(self.space.map_size));
        let side = (b - a).cross(direction).normalize_or_zero() * diameter;
        let before = out.len();
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
        self.parts.fetch_add(out.len() - before + lines as usize, Ordering::Relaxed);
    }

    /// Returns the index of a shadow-map texel's data record, like `record_of` of `shaders/field/tile_table.wgsl`;
    /// `None` in skipped tiles.
    fn record(&self, [column, row]: [u32; 2]) -> Option<u32> {
        let tile = row / TILE * self.space.tiles_across() + column / TILE;
        let first = self.first_records.get(tile as usize).copied().filter(|first| *first != NO_TILE)?;
        let record = first + row % TILE * TILE + column % TILE;
        debug_assert!(record - first < TILE_TEXELS);
        Some(record)
    }
}

/// Sorts the fragments of all strands by shadow-map texel and depth.
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

/// Converts the sorted strand fragments of shadow-map texels to disjoint intervals on light rays, each with the index
/// of its texel, two depths and an optical depth.
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
        (this.record, [from.clamp(start, end) as f32, to.clamp(start, end) as f32, depth as f32])
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

    /// Returns the number of fragments of one strand after [`shares_of_the_rest`], and the share of the light that
    /// they absorb together.
    fn taken(fragments: &[Fragment], most_extent_mm: f64) -> (usize, f64) {
        let mut out = Vec::new();
        shares_of_the_rest(fragments, most_extent_mm, &mut out);
        (out.len(), 1.0 - out.iter().map(|f| 1.0 - f.taken).product::<f64>())
    }

    #[test]
    fn shares_of_a_strand_add_up_to_its_opacity_at_most() {
        let chain = |count: u32, taken: f64| -> Vec<Fragment> {
            let part = |i: u32| Fragment { opacity: 0.6, ..fragment(0, f64::from(i), 0.5, taken) };
            (0..count).map(part).collect()
        };
        // For any number of joined fragments.
        for (most_extent, pieces) in [(0.5, 5), (2.0, 3), (100.0, 1)] {
            let (count, all) = taken(&chain(5, 0.1), most_extent);
            assert_eq!(count, pieces);
            assert!((all - 0.5).abs() < 1e-12, "{all}");
            assert!((taken(&chain(50, 0.1), most_extent).1 - 0.6).abs() < 1e-12);
        }
        // Separate parts count as other strands.
        let apart = [fragment(0, 0.0, 0.1, 0.5), fragment(0, 5.0, 0.1, 0.5), fragment(1, 5.05, 0.1, 0.5)];
        let (count, all) = taken(&apart, 1.0);
        assert!(count == 3 && (all - 0.875).abs() < 1e-12, "{count} {all}");
        assert_eq!(
            taken(&[fragment(0, 0.0, 0.1, 0.0)], 1.0).0,
            0,
            "fragments without absorption are skipped"
        );
    }

    #[test]
    fn fragments_at_one_depth_are_one_piece_and_a_covered_texel_ends_a_ray() {
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
