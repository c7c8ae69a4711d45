//! Tiles of a shadow map that may contain extinction, from the projections of bricks (blocks of voxel cells).

use super::LightSpace;
use super::boxes::{GridBox, Region};
use super::mapping::Projection;
use crate::field::ActiveBricks;
use crate::field::brick_runs::{BrickRun, brick_box};
use crate::field::constants::TILE;
use crate::volume::Volume;
use glam::{DVec2, IVec3};
use rayon::prelude::*;
use std::ops::Range;

/// Number of bricks whose projections one task of a thread computes for a parallel light: each takes few operations.
const PARALLEL_BRICKS: usize = 1 << 14;
/// Number of bricks whose projections one task of a thread computes for other lights.
const OTHER_BRICKS: usize = 1 << 10;

/// Set of tiles of a shadow map, one bit for each tile.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct TileSet {
    across: u32,
    /// Number of words of 64 bits for a row of tiles.
    row_words: usize,
    words: Vec<u64>,
}

impl TileSet {
    /// Creates an empty set of the tiles of a shadow map with `across` tiles along each side.
    pub fn empty(across: u32) -> Self {
        let row_words = across.div_ceil(u64::BITS) as usize;
        Self { across, row_words, words: vec![0; row_words * across as usize] }
    }

    /// Creates the set of all tiles of a shadow map with `across` tiles along each side.
    pub fn all(across: u32) -> Self {
        let mut tiles = Self::empty(across);
        if across > 0 {
            tiles.insert([0, across - 1], [0, across - 1]);
        }
        tiles
    }

    /// Number of tiles of the shadow map along each side.
    pub fn across(&self) -> u32 {
        self.across
    }

    /// Whether the set contains the tile in column `x` and row `y`.
    pub fn contains(&self, [x, y]: [u32; 2]) -> bool {
        let word = self.words[y as usize * self.row_words + (x / u64::BITS) as usize];
        word >> (x % u64::BITS) & 1 == 1
    }

    /// Number of tiles in the set.
    pub fn len(&self) -> u32 {
        self.words.iter().map(|word| word.count_ones()).sum()
    }

    /// Whether the set contains no tile.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Adds the tiles from the first to the last column and from the first to the last row (inclusive).
    pub(in crate::field) fn insert(&mut self, [left, right]: [u32; 2], [top, bottom]: [u32; 2]) {
        let [first, last] = [left, right].map(|x| (x / u64::BITS) as usize);
        for word in first..=last {
            let start = if word == first { left % u64::BITS } else { 0 };
            let end = if word == last { right % u64::BITS } else { u64::BITS - 1 };
            let bits = (u64::MAX >> (u64::BITS - 1 - end)) & (u64::MAX << start);
            for y in top..=bottom {
                self.words[y as usize * self.row_words + word] |= bits;
            }
        }
    }

    /// Returns all tiles of the set, row by row.
    pub fn iter(&self) -> impl Iterator<Item = [u32; 2]> {
        let all = (0..self.across).flat_map(|y| (0..self.across).map(move |x| [x, y]));
        all.filter(|tile| self.contains(*tile))
    }

    /// Returns the subset of the tiles with these positions in the order of rows.
    pub(in crate::field) fn range(&self, positions: Range<usize>) -> Self {
        let mut tiles = Self::empty(self.across);
        let own = self.iter().skip(positions.start).take(positions.len());
        own.for_each(|[x, y]| tiles.insert([x, x], [y, y]));
        tiles
    }

    fn union(mut self, other: &Self) -> Self {
        self.words.iter_mut().zip(&other.words).for_each(|(own, other)| *own |= other);
        self
    }
}

impl LightSpace {
    /// Returns the tiles of the shadow map that may contain active bricks (blocks of cells with extinction). The test
    /// uses the bounding rectangles of the bricks on their surface: a light ray through an inner brick leaves through
    /// one of these.
    pub fn occupied_tiles(&self, volume: &Volume, active: &ActiveBricks) -> TileSet {
        let across = self.tiles_across();
        if self.projection == Projection::Octahedral {
            return if active.active > 0 { TileSet::all(across) } else { TileSet::empty(across) };
        }
        let bricks = active.outer();
        if self.projection == Projection::Orthographic {
            let parts = self.brick_parts(volume.dims(), active.counts);
            return self
                .union_of(bricks, PARALLEL_BRICKS, |tiles, bricks| self.project(tiles, bricks, &parts));
        }
        self.union_of(bricks, OTHER_BRICKS, |tiles, bricks| {
            let texels_of = self.texels_of_boxes();
            let (mark, margin) = (self.marker(), self.margin());
            for brick in bricks {
                let brick = brick.to_array().map(|n| n as usize);
                let Region { lo, hi } = texels_of(GridBox::of_bricks(brick, brick, volume.dims()));
                let [lo, hi] = [lo - margin, hi + margin].map(|texel| texel / f64::from(TILE));
                mark(tiles, Region { lo, hi });
            }
        })
    }

    /// Returns the number of active bricks (blocks of cells with extinction) over each tile of a set, row by row, as a
    /// measure of the work of its light rays.
    pub fn tile_weights(&self, volume: &Volume, active: &ActiveBricks, tiles: &TileSet) -> Vec<u64> {
        let across = self.tiles_across() as usize;
        if self.projection == Projection::Octahedral {
            return vec![1; tiles.len() as usize];
        }
        let texels_of = self.texels_of_boxes();
        let counted = |runs: &[BrickRun]| {
            let mut counts = vec![0_u64; across * across];
            for run in runs {
                for x in run.x[0]..=run.x[1] {
                    let brick = [x, run.y, run.z].map(|n| n as usize);
                    let Region { lo, hi } = texels_of(GridBox::of_bricks(brick, brick, volume.dims()));
                    let tile = |texel: f64| ((texel / f64::from(TILE)) as usize).min(across - 1);
                    for y in tile(lo.y)..=tile(hi.y) {
                        counts[y * across..][tile(lo.x)..=tile(hi.x)].iter_mut().for_each(|n| *n += 1);
                    }
                }
            }
            counts
        };
        let sum = |mut a: Vec<u64>, b: Vec<u64>| {
            a.iter_mut().zip(b).for_each(|(own, other)| *own += other);
            a
        };
        let none = || vec![0; across * across];
        let counts = active.runs().par_chunks(PARALLEL_BRICKS).map(counted).reduce(none, sum);
        tiles.iter().map(|[x, y]| counts[y as usize * across + x as usize]).collect()
    }

    /// Returns the margin around the projection of a brick, in texels: taps of the pre-filter, filters and rounding
    /// reach beyond it.
    fn margin(&self) -> f64 {
        f64::from(self.shape.border)
    }

    /// Returns the union of the tiles that `add` finds for shares of the bricks, in parallel.
    fn union_of(
        &self,
        bricks: &[IVec3],
        share: usize,
        add: impl Fn(&mut TileSet, &[IVec3]) + Sync + Send,
    ) -> TileSet {
        let none = || TileSet::empty(self.tiles_across());
        let found = |bricks: &[IVec3]| {
            let mut tiles = none();
            add(&mut tiles, bricks);
            tiles
        };
        if bricks.len() <= share {
            // Waking another thread takes longer than these few bricks.
            return found(bricks);
        }
        bricks.par_chunks(share).map(found).reduce(none, |tiles, others| tiles.union(&others))
    }

    /// Adds the tiles of bricks to a set, for a parallel light. `parts` are the bricks' parts of the projection, in
    /// units of tiles.
    fn project(&self, tiles: &mut TileSet, bricks: &[IVec3], parts: &[Vec<Region>; 3]) {
        let mark = self.marker();
        let [xs, ys, zs] = parts.each_ref().map(Vec::as_slice);
        // Bricks are in row-major order, and a row shares the parts of y and z.
        let mut row = (i32::MIN, i32::MIN);
        let mut base = Region { lo: DVec2::ZERO, hi: DVec2::ZERO };
        for brick in bricks {
            if (brick.y, brick.z) != row {
                row = (brick.y, brick.z);
                let (y, z) = (ys[brick.y as usize], zs[brick.z as usize]);
                base = Region { lo: y.lo + z.lo, hi: y.hi + z.hi };
            }
            let x = xs[brick.x as usize];
            mark(tiles, Region { lo: base.lo + x.lo, hi: base.hi + x.hi });
        }
    }

    /// Returns a function that adds the tiles of a rectangle, in units of tiles, to a set. It clips the rectangle to the
    /// texels that queries may read.
    fn marker(&self) -> impl Fn(&mut TileSet, Region) {
        let [first, end] = self.texels_covered().unwrap_or([DVec2::NEG_INFINITY, DVec2::INFINITY]);
        let [first, end] = [first, end].map(|texel| texel / f64::from(TILE));
        let last = self.tiles_across() - 1;
        move |tiles, Region { lo, hi }| {
            let (lo, hi) = (lo.max(first), hi.min(end));
            if lo.cmple(hi).all() {
                // The conversion to integers also clamps to 0.
                let tile = |t: f64| (t as u32).min(last);
                tiles.insert([lo.x, hi.x].map(tile), [lo.y, hi.y].map(tile));
            }
        }
    }

    /// Returns, for each axis and each position of a brick along it, the part that the axis adds to the bounding
    /// rectangle of the brick's projection with its margin, in units of tiles. Parallel projections are sums of such
    /// parts.
    fn brick_parts(&self, dims: [usize; 3], counts: [usize; 3]) -> [Vec<Region>; 3] {
        let frame_from_grid = self.frame_from_world * self.grid_from_world.inverse();
        let scale = self.texel_scale / f64::from(TILE);
        let offset = frame_from_grid.translation.truncate() * scale + self.texel_offset / f64::from(TILE);
        std::array::from_fn(|a| {
            let axis = frame_from_grid.matrix3.col(a).truncate() * scale;
            let (start, margin) =
                if a == 0 { (offset, self.margin() / f64::from(TILE)) } else { (DVec2::ZERO, 0.0) };
            let part = |brick: usize| {
                let [low, high] =
                    brick_box([brick; 3], [brick; 3], dims).map(|corner| start + axis * corner[a]);
                Region { lo: low.min(high) - margin, hi: low.max(high) + margin }
            };
            (0..counts[a]).map(part).collect()
        })
    }

    /// Returns a function from a box in grid space (voxel index coordinates plus one) to the bounding rectangle of its
    /// projection, in texel coordinates of the shadow map.
    fn texels_of_boxes(&self) -> impl Fn(GridBox) -> Region + '_ {
        let frame_from_grid = self.frame_from_world * self.grid_from_world.inverse();
        let axes = frame_from_grid.matrix3;
        move |grid: GridBox| {
            let center = frame_from_grid.transform_point3(grid.center);
            let sides = [axes.x_axis * grid.half.x, axes.y_axis * grid.half.y, axes.z_axis * grid.half.z];
            let Region { lo, hi } = if self.projection == Projection::Orthographic {
                let reach = sides[0].abs() + sides[1].abs() + sides[2].abs();
                Region { lo: (center - reach).truncate(), hi: (center + reach).truncate() }
            } else {
                let corner = |c: usize| {
                    (0..3).fold(center, |p, a| if c >> a & 1 == 0 { p - sides[a] } else { p + sides[a] })
                };
                Region::around((0..8).map(|c| self.plane(corner(c))))
            };
            Region {
                lo: lo * self.texel_scale + self.texel_offset,
                hi: hi * self.texel_scale + self.texel_offset,
            }
        }
    }

    /// Returns the first and last texel, as texel coordinates, that queries of a shadow map may read, if the map
    /// covers only a part of the scene. `None`: all texels.
    fn texels_covered(&self) -> Option<[DVec2; 2]> {
        let reach = DVec2::splat(f64::from(self.shape.reach));
        self.region.map(|region| {
            let texel = |plane: DVec2| plane * self.texel_scale + self.texel_offset;
            [texel(region.lo) - reach, texel(region.hi) + reach]
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rectangles_cross_words_of_bits() {
        for (columns, rows) in
            [([0, 0], [0, 0]), ([3, 70], [1, 2]), ([63, 64], [0, 129]), ([0, 129], [129, 129])]
        {
            let mut tiles = TileSet::empty(130);
            tiles.insert(columns, rows);
            let within = |n: u32, [first, last]: [u32; 2]| (first..=last).contains(&n);
            for y in 0..130 {
                for x in 0..130 {
                    assert_eq!(tiles.contains([x, y]), within(x, columns) && within(y, rows), "{x}, {y}");
                }
            }
            assert_eq!(tiles.len(), (columns[1] - columns[0] + 1) * (rows[1] - rows[0] + 1));
        }
        assert_eq!((TileSet::all(65).len(), TileSet::empty(65).is_empty()), (65 * 65, true));
    }
}
