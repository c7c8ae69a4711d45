//! Blocks of pages that fit in the pool together: leaves of a k-d tree over the pages of a volume.
//!
//! A k-d tree orders its leaves from front to back for all rays of a parallel or a central projection (Fuchs, Kedem and
//! Naylor 1980, *On visible surface generation by a priori tree structures*), so that rays pass each block once.

use glam::DVec3;
use std::ops::Range;

/// Box of pages, by the range of their positions along each axis.
pub(super) type PageBox = [Range<usize>; 3];

/// Rays that cross a volume, in coordinates of its pages.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Rays {
    /// Rays of one direction.
    Along(DVec3),
    /// Rays from one point.
    From(DVec3),
}

/// k-d tree over the pages of a volume.
#[derive(Debug)]
pub(super) enum BlockTree {
    /// Block of pages.
    Leaf(PageBox),
    /// Two halves, below and above a plane between pages.
    Split {
        /// Axis across which the plane lies, and its position along it.
        axis: usize,
        at: usize,
        /// Halves below and above the plane.
        halves: Box<[BlockTree; 2]>,
    },
}

impl BlockTree {
    /// Divides all pages of a volume into blocks. In each block and up to `reach` pages around it, at most `most` pages
    /// are stored. Returns `None` if the surroundings of a single page have more.
    pub fn of(stored: &StoredCounts, reach: usize, most: usize) -> Option<Self> {
        Self::within(stored.counts.map(|n| 0..n), stored, reach, most)
    }

    fn within(all: PageBox, stored: &StoredCounts, reach: usize, most: usize) -> Option<Self> {
        if stored.inside(&stored.grown(&all, reach)) <= most {
            return Some(Self::Leaf(all));
        }
        let axis = (0..3).max_by_key(|a| all[*a].len()).filter(|a| all[*a].len() > 1)?;
        let halves_at = |at: usize| {
            let (mut below, mut above) = (all.clone(), all.clone());
            (below[axis].end, above[axis].start) = (at, at);
            [below, above]
        };
        let Range { start, end } = all[axis];
        let uneven = |at: &usize| {
            let [below, above] = halves_at(*at).map(|half| stored.inside(&half));
            below.abs_diff(above)
        };
        let at = (start + 1..end).min_by_key(uneven)?;
        let [below, above] = halves_at(at).map(|half| Self::within(half, stored, reach, most));
        Some(Self::Split { axis, at, halves: Box::new([below?, above?]) })
    }

    /// Returns the first block in the order of the rays for which `is_wanted` holds.
    pub fn first(&self, rays: Rays, is_wanted: &mut impl FnMut(&PageBox) -> bool) -> Option<PageBox> {
        match self {
            Self::Leaf(pages) => is_wanted(pages).then(|| pages.clone()),
            Self::Split { axis, at, halves } => {
                let starts_below = match rays {
                    Rays::Along(direction) => direction[*axis] >= 0.0,
                    Rays::From(origin) => origin[*axis] < *at as f64,
                };
                let [below, above] = halves.as_ref();
                let [near, far] = if starts_below { [below, above] } else { [above, below] };
                near.first(rays, is_wanted).or_else(|| far.first(rays, is_wanted))
            }
        }
    }

    /// Number of blocks.
    pub fn len(&self) -> usize {
        match self {
            Self::Leaf(_) => 1,
            Self::Split { halves, .. } => halves.iter().map(Self::len).sum(),
        }
    }
}

/// Number of stored pages in any box of pages, by a summed-volume table.
pub(super) struct StoredCounts {
    /// Number of pages along each axis.
    counts: [usize; 3],
    /// Number of stored pages below each corner of a page along all axes, x fastest.
    sums: Vec<usize>,
}

impl StoredCounts {
    /// Counts the stored pages of a volume with `counts` pages along each axis, x fastest.
    pub fn of(counts: [usize; 3], is_stored: impl Fn(usize) -> bool) -> Self {
        let [nx, ny, nz] = counts;
        let mut made = Self { counts, sums: vec![0; (nx + 1) * (ny + 1) * (nz + 1)] };
        for z in 0..nz {
            for y in 0..ny {
                let mut row = 0;
                for x in 0..nx {
                    row += usize::from(is_stored((z * ny + y) * nx + x));
                    let [a, b, c] =
                        [[y, z + 1], [y + 1, z], [y, z]].map(|[y, z]| made.sums[made.place([x + 1, y, z])]);
                    let place = made.place([x + 1, y + 1, z + 1]);
                    made.sums[place] = row + a + b - c;
                }
            }
        }
        made
    }

    fn place(&self, [x, y, z]: [usize; 3]) -> usize {
        let [nx, ny, _] = self.counts;
        (z * (ny + 1) + y) * (nx + 1) + x
    }

    /// Returns the number of stored pages in a box.
    fn inside(&self, [x, y, z]: &PageBox) -> usize {
        let below = |z: usize| {
            let at = |x, y| self.sums[self.place([x, y, z])];
            at(x.end, y.end) + at(x.start, y.start) - at(x.start, y.end) - at(x.end, y.start)
        };
        below(z.end) - below(z.start)
    }

    /// Returns a box with the pages up to `reach` pages around it.
    pub fn grown(&self, pages: &PageBox, reach: usize) -> PageBox {
        std::array::from_fn(|a| {
            pages[a].start.saturating_sub(reach)..(pages[a].end + reach).min(self.counts[a])
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn leaves(tree: &BlockTree, rays: Rays) -> Vec<PageBox> {
        let mut all = Vec::new();
        tree.first(rays, &mut |pages: &PageBox| {
            all.push(pages.clone());
            false
        });
        all
    }

    fn pages_of([x, y, z]: &PageBox, [nx, ny, _]: [usize; 3]) -> Vec<usize> {
        let rows = z.clone().flat_map(|z| y.clone().map(move |y| (z * ny + y) * nx));
        rows.flat_map(|row| x.clone().map(move |x| row + x)).collect()
    }

    #[test]
    fn blocks_cover_all_pages_once_and_fit() {
        let counts = [7, 5, 9];
        let mut random = fastrand::Rng::with_seed(3);
        let stored: Vec<bool> = (0..7 * 5 * 9).map(|_| random.f64() < 0.4).collect();
        let sums = StoredCounts::of(counts, |page| stored[page]);
        for (reach, most) in [(0, 10), (1, 27), (0, 1000), (1, 60)] {
            let tree = BlockTree::of(&sums, reach, most).unwrap();
            let blocks = leaves(&tree, Rays::Along(DVec3::ONE));
            assert_eq!(blocks.len(), tree.len());
            let mut all: Vec<usize> = blocks.iter().flat_map(|block| pages_of(block, counts)).collect();
            all.sort_unstable();
            assert_eq!(all, (0..stored.len()).collect::<Vec<_>>());
            for block in &blocks {
                let around = pages_of(&sums.grown(block, reach), counts);
                assert!(around.iter().filter(|page| stored[**page]).count() <= most);
            }
        }
        assert!(BlockTree::of(&StoredCounts::of(counts, |_| true), 1, 26).is_none());
    }

    /// Along any ray, the numbers of the blocks in the order of the rays never fall.
    #[test]
    fn rays_pass_blocks_in_their_order() {
        let counts = [6, 8, 5];
        let mut random = fastrand::Rng::with_seed(8);
        let tree =
            BlockTree::of(&StoredCounts::of(counts, |page| page % 3 == 0 || page > 150), 0, 6).unwrap();
        assert!(tree.len() > 8);
        let size = DVec3::from_array(counts.map(|n| n as f64));
        let mut vector = |scale: DVec3| DVec3::from_array([0; 3].map(|_| random.f64())) * scale;
        for i in 0..400 {
            let (inside, origin) = (vector(size), vector(3.0 * size) - size);
            let direction = (inside - origin).normalize();
            let rays = if i % 2 == 0 { Rays::Along(direction) } else { Rays::From(origin) };
            let blocks = leaves(&tree, rays);
            let mut last = 0;
            for step in 0..3000 {
                let p = origin + f64::from(step) * 0.01 * direction;
                if p.cmplt(DVec3::ZERO).any() || p.cmpge(size).any() {
                    continue;
                }
                let page = p.floor().to_array().map(|x| x as usize);
                let holds = |block: &PageBox| (0..3).all(|a| block[a].contains(&page[a]));
                let now = blocks.iter().position(holds).unwrap();
                assert!(now >= last, "{rays:?} at {p}: block {now} after {last}");
                last = now;
            }
        }
    }
}
