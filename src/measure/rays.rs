//! Choice of the shadow map texels whose light rays are tested, spread evenly over the region with extinction and
//! over the edges of that region.

use crate::random::mix;

/// Largest fraction of the tested shadow map texels that lie at the edges of the region with extinction.
const EDGE_SHARE: f64 = 0.25;

/// Picks `count` distinct texels `[column, row]` of a `map x map` shadow map whose light rays are tested. Equal
/// arguments always give the same texels.
///
/// `meets(column, row)` returns whether a texel's light ray meets extinction. Up to a quarter of the texels lie at
/// the edges of the region with extinction, on either side: there, interpolation and curve fits fail first. The
/// others lie inside the region. Texels without extinction are used only where these are too few.
///
/// Each of the three groups is sampled evenly: its texels are sorted along a Morton curve, and one is taken from each
/// of equal intervals. The result has Morton order, so neighbours in the list are neighbours in the map. It has fewer
/// than `count` texels only if the map is smaller.
pub fn pick_texels(map: u32, count: usize, meets: impl Fn(u32, u32) -> bool) -> Vec<[u32; 2]> {
    let side = map as usize;
    let met: Vec<bool> = (0..side * side).map(|i| meets((i % side) as u32, (i / side) as u32)).collect();
    let class = |[column, row]: [u32; 2]| {
        let (c, r) = (column as usize, row as usize);
        let here = met[r * side + c];
        let differs = |dc: usize, dr: usize| {
            // Neighbour index plus one, so that 0 means before the first; outside the map nothing is met.
            let (nc, nr) = ((c + dc).wrapping_sub(1), (r + dr).wrapping_sub(1));
            (nc < side && nr < side && met[nr * side + nc]) != here
        };
        if differs(0, 1) || differs(2, 1) || differs(1, 0) || differs(1, 2) {
            Class::Edge
        } else if here {
            Class::Inside
        } else {
            Class::Empty
        }
    };
    let (mut edge, mut inside, mut empty) = (Vec::new(), Vec::new(), Vec::new());
    for code in 0..u64::from(map.next_power_of_two()).pow(2) {
        let texel = [even_bits(code), even_bits(code >> 1)];
        if texel[0] < map && texel[1] < map {
            match class(texel) {
                Class::Edge => edge.push(code),
                Class::Inside => inside.push(code),
                Class::Empty => empty.push(code),
            }
        }
    }

    let edge_quota = (EDGE_SHARE * count as f64).round() as usize;
    let from_inside = inside.len().min(count - edge_quota.min(edge.len()).min(count));
    let from_edge = edge.len().min(count - from_inside);
    let from_empty = empty.len().min(count - from_inside - from_edge);
    let mut codes = spread(&inside, from_inside);
    codes.extend(spread(&edge, from_edge));
    codes.extend(spread(&empty, from_empty));
    codes.sort_unstable();
    codes.into_iter().map(|code| [even_bits(code), even_bits(code >> 1)]).collect()
}

enum Class {
    Edge,
    Inside,
    Empty,
}

/// Picks one element from each of `count` equal intervals of a list that has at least `count` elements.
fn spread(line: &[u64], count: usize) -> Vec<u64> {
    (0..count)
        .map(|i| {
            let (start, end) = (i * line.len() / count, (i + 1) * line.len() / count);
            line[start + (mix(i as u64) % (end - start) as u64) as usize]
        })
        .collect()
}

/// Extracts one coordinate from a Morton code: its bits 0, 2, 4, ..., packed.
fn even_bits(code: u64) -> u32 {
    (0..u64::BITS / 2).fold(0, |packed, bit| packed | ((code >> (2 * bit)) as u32 & 1) << bit)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::HashSet;

    fn disc(c: u32, r: u32) -> bool {
        let (x, y) = (f64::from(c) - 50.0, f64::from(r) - 40.0);
        x.hypot(y) < 30.0
    }

    fn is_edge(c: u32, r: u32) -> bool {
        let met = |c: i64, r: i64| c >= 0 && r >= 0 && disc(c as u32, r as u32);
        let (x, y) = (i64::from(c), i64::from(r));
        [(1, 0), (-1, 0), (0, 1), (0, -1)].iter().any(|(a, b)| met(x + a, y + b) != met(x, y))
    }

    #[test]
    fn morton_codes_visit_every_texel_once() {
        let visited: HashSet<_> = (0..256_u64).map(|m| [even_bits(m), even_bits(m >> 1)]).collect();
        assert_eq!(visited.len(), 256);
        assert!(visited.iter().all(|t| t[0] < 16 && t[1] < 16));
        assert_eq!([even_bits(0b10_0111), even_bits(0b10_0111 >> 1)], [0b011, 0b101]);
    }

    #[test]
    fn texels_are_distinct_deterministic_and_prefer_what_is_met() {
        let picked = pick_texels(100, 600, disc);
        assert_eq!(picked.len(), 600);
        assert_eq!(picked.iter().collect::<HashSet<_>>().len(), 600);
        assert_eq!(picked, pick_texels(100, 600, disc));
        let edges = picked.iter().filter(|t| is_edge(t[0], t[1])).count();
        assert_eq!(edges, 150, "a quarter at the edge");
        assert!(picked.iter().all(|t| disc(t[0], t[1]) || is_edge(t[0], t[1])));
        assert!(picked.iter().any(|t| !disc(t[0], t[1])), "the outer side of the edge too");
    }

    #[test]
    fn texels_are_spread_over_what_is_met() {
        // Each quarter of the disc gets about a quarter.
        let picked = pick_texels(100, 600, disc);
        for quadrant in 0..4 {
            let n =
                picked.iter().filter(|t| (t[0] >= 50, t[1] >= 40) == (quadrant & 1 == 1, quadrant & 2 == 2));
            assert!((130..=170).contains(&n.count()), "quadrant {quadrant}");
        }
        // On a full grid, one from each block of 4 x 4.
        let inside = |c: u32, r: u32| (1..65).contains(&c) && (1..65).contains(&r);
        let picked = pick_texels(66, 256, inside);
        let widest = (1..65)
            .flat_map(|c| (1..65).map(move |r| (c, r)))
            .map(|(c, r)| picked.iter().map(|t| t[0].abs_diff(c).max(t[1].abs_diff(r))).min().unwrap())
            .max()
            .unwrap();
        assert!(widest <= 8, "a hole of {widest} texels");
    }

    #[test]
    fn what_is_short_is_filled_from_the_rest() {
        let lone = |c: u32, r: u32| (c, r) == (3, 5);
        let picked = pick_texels(10, 20, lone);
        assert_eq!(picked.len(), 20);
        assert!(picked.contains(&[3, 5]));
        assert_eq!(picked.iter().collect::<HashSet<_>>().len(), 20);
        // More than there are; nothing met; everything met; no map at all.
        assert_eq!(pick_texels(10, 500, disc).len(), 100);
        assert_eq!(pick_texels(10, 30, |_, _| false).len(), 30);
        assert_eq!(pick_texels(10, 30, |_, _| true).len(), 30);
        assert_eq!(pick_texels(10, 1, |_, _| true).len(), 1);
        assert!(pick_texels(0, 5, |_, _| true).is_empty());
        assert!(pick_texels(5, 0, |_, _| true).is_empty());
    }
}
