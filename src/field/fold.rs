//! Folding of a volume that is too long for a 3-D texture. The volume is cut into tiles across its long axis, and the
//! tiles lie side by side along the other axes of the texture.
//!
//! Neighbouring tiles share the voxel layer at their seam, so that every cell lies in one tile. Where tiles touch in
//! the texture, each one repeats its outermost voxels around it, so that filters do not read the neighbour.

use crate::volume::BRICK_CELLS;
use bytemuck::{Pod, Zeroable};
use std::ops::Range;

/// Folding of a long volume into a 3-D texture: the volume is cut into tiles, which lie side by side in the texture.
/// A volume that fits the texture has one tile.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Fold {
    /// Number of voxels of the volume along each axis.
    dims: [usize; 3],
    /// Distance between the starts of neighbouring tiles of a folded (tiled) volume along each axis, in voxels. Along
    /// an axis that is cut, a tile has one voxel more.
    period: [usize; 3],
    /// Number of tiles into which a folded (tiled) volume is cut along each axis of the volume.
    tiles: [usize; 3],
    /// Number of volume tiles along each axis of the folded 3-D texture.
    placed: [usize; 3],
}

/// Uniform of a folded (tiled) volume texture: `Fold` of `shaders/field/field.wgsl`. The fourth component of each
/// vector is unused.
#[repr(C)]
#[derive(Debug, Clone, Copy, Default, Pod, Zeroable)]
pub(super) struct FoldUniform {
    pub period: [i32; 4],
    pub tiles: [i32; 4],
    pub placed: [i32; 4],
    pub stride: [i32; 4],
    pub margin: [i32; 4],
    pub inv_sides: [f32; 4],
}

/// Position of one tile of a folded (tiled) volume along one axis: its range of voxels, and its texels in the 3-D
/// texture.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct FoldSpan {
    /// Range of voxels along one axis that a tile of a folded (tiled) volume covers.
    pub voxels: Range<usize>,
    /// Number of copies of a tile's first voxel that precede it in a folded (tiled) volume texture; as many copies of
    /// the last voxel follow it.
    pub margin: usize,
    /// Index of a tile's first texel along one axis of a folded (tiled) volume texture, including the copies of the
    /// tile's first voxel.
    pub first_texel: usize,
}

impl FoldSpan {
    /// Returns the voxel index of each texel of a tile along one axis of a folded (tiled) volume texture, including
    /// the copies of border voxels.
    pub(super) fn voxels_by_texel(&self) -> impl Iterator<Item = usize> + Clone {
        let Range { start, end } = self.voxels;
        let (before, behind) =
            (std::iter::repeat_n(start, self.margin), std::iter::repeat_n(end - 1, self.margin));
        before.chain(start..end).chain(behind)
    }

    /// Returns the number of texels of a tile along one axis of a folded (tiled) volume texture, including the copies
    /// of border voxels.
    pub(super) fn texels(&self) -> usize {
        self.voxels.len() + 2 * self.margin
    }
}

impl Fold {
    /// Finds the folding of a long volume into a 3-D texture that needs the fewest texels. The volume has `dims`
    /// voxels, and the texture at most `limit` texels along each axis. Returns `None` if no folding fits.
    pub fn of(dims: [usize; 3], limit: usize) -> Option<Self> {
        let limit = limit.max(2);
        let tiles = dims.map(|n| if n <= limit { 1 } else { (n - 1).div_ceil(limit - 1) });
        let period =
            std::array::from_fn(|a| if tiles[a] == 1 { dims[a] } else { (dims[a] - 1).div_ceil(tiles[a]) });
        let whole = Self { dims, period, tiles, placed: [1; 3] };
        let count = tiles.iter().try_fold(1usize, |product, n| product.checked_mul(*n))?;
        // Along a cut axis, the texture is one tile long.
        let most = |a: usize| if tiles[a] == 1 { (limit / (dims[a] + 2)).clamp(1, count) } else { 1 };
        let mut best: Option<(usize, Self)> = None;
        for x in 1..=most(0) {
            for y in 1..=most(1) {
                let z = count.div_ceil(x * y);
                if z > most(2) {
                    continue;
                }
                let fold = Self { placed: [x, y, z], ..whole };
                let texels = fold.sides().iter().product();
                if best.is_none_or(|(fewest, _)| texels < fewest) {
                    best = Some((texels, fold));
                }
            }
        }
        best.map(|(_, fold)| fold)
    }

    /// Finds the folding of a long volume into a 3-D texture of at most `limit` texels along each axis. Returns
    /// `None` if no folding fits, or if the texture with the distance of each brick, which is never folded, exceeds
    /// the limit.
    pub fn with_bricks(dims: [usize; 3], limit: usize) -> Option<Self> {
        let fit = dims.iter().all(|n| n / BRICK_CELLS < limit);
        fit.then(|| Self::of(dims, limit)).flatten()
    }

    /// Returns the number of tiles into which the volume is cut to fit a 3-D texture; 1 if it is not cut.
    pub fn tiles(&self) -> usize {
        self.tiles.iter().product()
    }

    /// Whether the volume is cut into several tiles to fit a 3-D texture (folded).
    pub fn is_folded(&self) -> bool {
        self.tiles != [1; 3]
    }

    /// Returns the largest number of voxels that a tile of a folded (tiled) volume has along each axis.
    fn tile(&self) -> [usize; 3] {
        std::array::from_fn(|a| if self.tiles[a] == 1 { self.dims[a] } else { self.period[a] + 1 })
    }

    /// Returns the number of copies of a tile's border voxels on each side, along each axis of a folded (tiled)
    /// volume texture.
    fn margin(&self) -> [usize; 3] {
        self.placed.map(|n| usize::from(n > 1))
    }

    /// Returns the distance between the starts of neighbouring tiles along each axis of a folded (tiled) volume
    /// texture, in texels.
    fn stride(&self) -> [usize; 3] {
        let (tile, margin) = (self.tile(), self.margin());
        std::array::from_fn(|a| tile[a] + 2 * margin[a])
    }

    /// Returns the number of texels of the folded (tiled) volume texture along each axis.
    pub fn sides(&self) -> [usize; 3] {
        let stride = self.stride();
        std::array::from_fn(|a| self.placed[a] * stride[a])
    }

    /// Returns the voxels and texels of every tile of a folded (tiled) volume, along all three axes.
    pub(super) fn spans(&self) -> impl Iterator<Item = [FoldSpan; 3]> {
        let Self { dims, period, tiles, placed } = *self;
        let (stride, margin) = (self.stride(), self.margin());
        let at = |number: usize, counts: [usize; 3]| {
            [number % counts[0], number / counts[0] % counts[1], number / (counts[0] * counts[1])]
        };
        (0..self.tiles()).map(move |number| {
            let (tile, place) = (at(number, tiles), at(number, placed));
            std::array::from_fn(|a| {
                let first = tile[a] * period[a];
                let end = if tiles[a] == 1 { dims[a] } else { (first + period[a] + 1).min(dims[a]) };
                FoldSpan { voxels: first..end, margin: margin[a], first_texel: place[a] * stride[a] }
            })
        })
    }

    pub(super) fn uniform(&self) -> FoldUniform {
        let whole = |[x, y, z]: [usize; 3]| [x as i32, y as i32, z as i32, 0];
        let [x, y, z] = self.sides().map(|n| 1.0 / n as f32);
        FoldUniform {
            period: whole(self.period),
            tiles: whole(self.tiles),
            placed: whole(self.placed),
            stride: whole(self.stride()),
            margin: whole(self.margin()),
            inv_sides: [x, y, z, 0.0],
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Computes the position of a voxel in a folded (tiled) volume texture, like `tile_offset` of
    /// `shaders/field/field.wgsl`.
    fn texel(fold: &Fold, cell: [i32; 3], voxel: [i32; 3]) -> [usize; 3] {
        let FoldUniform { period, tiles, placed, stride, margin, .. } = fold.uniform();
        let tile: [i32; 3] = std::array::from_fn(|a| (cell[a] / period[a]).min(tiles[a] - 1));
        let number = tile[0] + tiles[0] * (tile[1] + tiles[1] * tile[2]);
        let place = [number % placed[0], number / placed[0] % placed[1], number / (placed[0] * placed[1])];
        std::array::from_fn(|a| (place[a] * stride[a] + margin[a] - tile[a] * period[a] + voxel[a]) as usize)
    }

    #[test]
    fn a_grid_that_fits_is_one_tile() {
        for dims in [[5, 9, 16], [16, 16, 16], [1, 1, 1]] {
            let fold = Fold::of(dims, 16).unwrap();
            assert!(!fold.is_folded() && fold.sides() == dims);
            let spans: Vec<_> = fold.spans().collect();
            assert_eq!(spans.len(), 1);
            for (span, n) in spans[0].iter().zip(dims) {
                assert_eq!(*span, FoldSpan { voxels: 0..n, margin: 0, first_texel: 0 });
            }
        }
    }

    /// Tests the position in a folded (tiled) volume texture of every voxel of every cell, and of the neighbours that
    /// a texture filter may read.
    #[test]
    fn every_cell_lies_in_one_tile() {
        for (dims, limit) in [
            ([5, 7, 40], 24),
            ([40, 5, 7], 24),
            ([3, 100, 2], 24),
            ([30, 40, 2], 24),
            ([2, 3, 31], 16),
            ([1, 1, 200], 16),
        ] {
            let fold = Fold::of(dims, limit).unwrap();
            let sides = fold.sides();
            assert!(fold.is_folded() && sides.iter().all(|n| *n <= limit), "{dims:?} {sides:?}");
            let mut stored = vec![None; sides.iter().product()];
            for [x, y, z] in fold.spans() {
                for (k, w) in z.voxels_by_texel().zip(z.first_texel..) {
                    for (j, v) in y.voxels_by_texel().zip(y.first_texel..) {
                        for (i, u) in x.voxels_by_texel().zip(x.first_texel..) {
                            let texel = &mut stored[(w * sides[1] + v) * sides[0] + u];
                            assert!(texel.is_none(), "{dims:?}: two tiles overlap");
                            *texel = Some([i, j, k]);
                        }
                    }
                }
            }
            let last = dims.map(|n| n as i32 - 1);
            let all = (0..=last[2])
                .flat_map(|k| (0..=last[1]).flat_map(move |j| (0..=last[0]).map(move |i| [i, j, k])));
            for cell in all {
                // The cell's voxels, and, along axes that are not cut, those a filter may touch beyond the edge.
                for corner in 0..27 {
                    let step = [corner % 3 - 1, corner / 3 % 3 - 1, corner / 9 - 1];
                    let beyond = |a: usize| fold.placed[a] > 1 && fold.tiles[a] == 1;
                    let reaches = |a: usize| {
                        let at = cell[a] + step[a];
                        (step[a] >= 0 && at <= last[a]) || beyond(a)
                    };
                    if !(0..3).all(reaches) {
                        continue;
                    }
                    let voxel: [i32; 3] = std::array::from_fn(|a| cell[a] + step[a]);
                    let [u, v, w] = texel(&fold, cell, voxel);
                    let expected: [usize; 3] = std::array::from_fn(|a| voxel[a].clamp(0, last[a]) as usize);
                    let found = stored[(w * sides[1] + v) * sides[0] + u];
                    assert_eq!(found, Some(expected), "{dims:?}: cell {cell:?} voxel {voxel:?}");
                }
            }
        }
    }

    #[test]
    fn folds_have_the_fewest_texels_or_are_refused() {
        // Two tiles of 1191 slices, side by side.
        assert_eq!(Fold::of([512, 512, 2380], 2048).unwrap().sides(), [512, 1028, 1191]);
        for dims in [[40, 40, 40], [16, 16, 17], [usize::MAX, usize::MAX, usize::MAX], [usize::MAX, 1, 1]] {
            assert_eq!(Fold::of(dims, 16), None, "{dims:?}");
        }
    }
}
