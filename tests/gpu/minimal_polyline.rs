//! Polyline of fewest nodes within a tunnel, in float64 and without limits: the reference for `compress=optimal` of
//! `dsm`.
//!
//! The tunnel of a curve that never rises is the curve plus and minus `epsilon`, its floor not below 0. It begins at
//! the curve's first point, below 1, and the last node's value is kept behind it. Imai and Iri's greedy line, with
//! all corners since the window in two lists and every tangent searched among them: slow, and nothing in common with
//! the device's hulls.

use fastrand::Rng;

/// Point of a transmittance curve: depth and transmittance.
pub type Point = [f64; 2];

#[derive(Clone, Copy)]
struct Line {
    at: Point,
    slope: f64,
}

impl Line {
    fn value(&self, x: f64) -> f64 {
        self.at[1] + self.slope * (x - self.at[0])
    }

    fn meets(&self, other: &Self, [low, high]: [f64; 2]) -> Point {
        let x = self.at[0] + (other.value(self.at[0]) - self.at[1]) / (self.slope - other.slope);
        let x = x.clamp(low, high);
        let flatter = if self.slope.abs() < other.slope.abs() { self } else { other };
        [x, flatter.value(x)]
    }
}

const UPRIGHT: f64 = -1e30;

/// Line through `to` that passes every one of `points` on its right side: the flattest, or the steepest.
fn tangent(points: &[Point], to: Point, steepest: bool) -> Line {
    let slopes = points.iter().filter(|p| p[0] < to[0]).map(|p| (to[1] - p[1]) / (to[0] - p[0]));
    let slope = if steepest { slopes.fold(f64::INFINITY, f64::min) } else { slopes.fold(UPRIGHT, f64::max) };
    Line { at: to, slope }
}

/// Point at which a line leaves the tunnel between two of its corners.
fn exit(line: &Line, before: Point, behind: Point) -> Point {
    let [inside, outside] = [before, behind].map(|p| (p[1] - line.value(p[0])).abs());
    let x = before[0] + (behind[0] - before[0]) * inside / (inside + outside).max(1e-300);
    [x, line.value(x)]
}

/// Computes the polyline with the fewest nodes within the tunnel of a curve.
pub fn fewest(curve: &[Point], epsilon: f64) -> Vec<Point> {
    let first = curve[0];
    let mut nodes = Vec::new();
    let (mut floor, mut ceiling) = (vec![[first[0], (first[1] - epsilon).max(0.0)]], vec![first]);
    let mut lowest = Line { at: first, slope: UPRIGHT };
    let mut highest = Line { at: first, slope: -UPRIGHT };
    let mut before = lowest;
    let mut window = [first[0]; 2];
    for point in &curve[1..] {
        let x = point[0];
        let (low, high) = ([x, (point[1] - epsilon).max(0.0)], [x, point[1] + epsilon]);
        if high[1] < lowest.value(x) {
            let e = exit(&lowest, *ceiling.last().unwrap(), high);
            nodes.push(before.meets(&lowest, window));
            (before, window) = (lowest, [lowest.at[0], e[0]]);
            floor.retain(|f| f[0] >= window[0]);
            ceiling = vec![e];
            highest = Line { at: e, slope: lowest.slope };
            lowest = Line { at: e, slope: UPRIGHT };
        } else if low[1] > highest.value(x) {
            let e = exit(&highest, *floor.last().unwrap(), low);
            nodes.push(before.meets(&highest, window));
            (before, window) = (highest, [highest.at[0], e[0]]);
            ceiling.retain(|c| c[0] >= window[0]);
            floor = vec![e];
            lowest = Line { at: e, slope: highest.slope };
            highest = Line { at: e, slope: -UPRIGHT };
        }
        if low[1] > lowest.value(x) {
            lowest = tangent(&ceiling, low, false);
        }
        if high[1] < highest.value(x) {
            highest = tangent(&floor, high, true);
        }
        floor.push(low);
        ceiling.push(high);
    }
    let [x, last] = *curve.last().unwrap();
    let top = floor[0][1];
    let level = top <= (last + epsilon).min(1.0);
    let end = if level {
        Line { at: [x, 0.5 * (top + (last + epsilon).min(1.0))], slope: 0.0 }
    } else {
        let value = 0.5 * (lowest.value(x) + highest.value(x));
        Line { at: [x, value], slope: 0.5 * (lowest.slope + highest.slope) }
    };
    nodes.push(before.meets(&end, window));
    if !level {
        nodes.push(end.at);
    }
    nodes
}

/// Value of a polyline at a depth, constant behind its end.
fn value(nodes: &[Point], x: f64) -> f64 {
    let after = nodes.partition_point(|n| n[0] <= x);
    match (after.checked_sub(1).map(|i| nodes[i]), nodes.get(after)) {
        (None, Some(first)) => first[1],
        (Some(a), Some(b)) => a[1] + (b[1] - a[1]) * (x - a[0]) / (b[0] - a[0]),
        (Some(last), None) => last[1],
        (None, None) => f64::NAN,
    }
}

/// Random curve that never rises, of constant parts, jumps, arcs and noise, over the depths from 0.
fn random_curve(rng: &mut Rng, points: usize) -> Vec<Point> {
    let mut curve = vec![[0.0, 1.0]];
    let mut rate: f64 = 0.0;
    for i in 1..points {
        if rng.f64() < 0.3 {
            rate = if rng.f64() < 0.4 { 0.0 } else { rng.f64().powi(3) };
        }
        let [_, t] = curve[i - 1];
        curve.push([i as f64, t * (-rate).exp()]);
    }
    curve
}

/// Smallest number of nodes of all polylines with nodes on a lattice, by trying every one: depths of the curve's
/// points, and heights at multiples of `1 / heights`.
fn fewest_on_lattice(curve: &[Point], epsilon: f64, heights: usize) -> Option<usize> {
    let inside = |i: usize, t: f64| {
        let ceiling = if i == 0 { 1.0 } else { curve[i][1] + epsilon };
        t >= (curve[i][1] - epsilon).max(0.0) - 1e-12 && t <= ceiling + 1e-12
    };
    let at = |h: usize| h as f64 / heights as f64;
    let joined = |(i, a): (usize, f64), (j, b): (usize, f64)| {
        (i..=j).all(|k| inside(k, a + (b - a) * (k - i) as f64 / (j - i).max(1) as f64))
    };
    let mut reached: Vec<(usize, usize)> =
        (0..=heights).filter(|h| inside(0, at(*h))).map(|h| (0, h)).collect();
    let mut seen: std::collections::HashSet<_> = reached.iter().copied().collect();
    for nodes in 1..=curve.len() {
        if reached.iter().any(|&(i, h)| (i..curve.len()).all(|k| inside(k, at(h)))) {
            return Some(nodes);
        }
        let mut next = Vec::new();
        for &(i, h) in &reached {
            for j in i + 1..curve.len() {
                for g in 0..=h {
                    if !seen.contains(&(j, g)) && joined((i, at(h)), (j, at(g))) {
                        seen.insert((j, g));
                        next.push((j, g));
                    }
                }
            }
        }
        if next.iter().any(|&(j, _)| j + 1 == curve.len()) {
            return Some(nodes + 1);
        }
        reached = next;
    }
    None
}

#[test]
fn the_fewest_stay_in_the_tunnel_and_never_rise() {
    let mut rng = Rng::with_seed(3);
    for _ in 0..2000 {
        let points = rng.usize(2..60);
        let curve = random_curve(&mut rng, points);
        let epsilon = 0.1 * rng.f64().powi(2) + 1e-4;
        let nodes = fewest(&curve, epsilon);
        assert!(nodes.windows(2).all(|p| p[0][0] <= p[1][0] && p[1][1] <= p[0][1] + 1e-12), "{nodes:?}");
        assert!(nodes.iter().all(|n| (-1e-12..=1.0 + 1e-12).contains(&n[1])), "{nodes:?}");
        for [x, t] in &curve {
            let strays = (value(&nodes, *x) - t).abs();
            assert!(strays <= epsilon + 1e-9, "{strays} of {epsilon} at {x}: {curve:?} {nodes:?}");
        }
    }
}

#[test]
fn no_polyline_on_a_lattice_has_fewer() {
    let mut rng = Rng::with_seed(4);
    let (mut equal, mut tried) = (0, 0);
    for _ in 0..300 {
        let points = rng.usize(2..14);
        let curve = random_curve(&mut rng, points);
        let epsilon = 0.04 + 0.1 * rng.f64();
        let Some(lattice) = fewest_on_lattice(&curve, epsilon, 50) else { continue };
        let found = fewest(&curve, epsilon).len();
        assert!(found <= lattice, "{found} instead of {lattice}: epsilon {epsilon}, {curve:?}");
        tried += 1;
        equal += usize::from(found == lattice);
    }
    // So coarse a lattice sometimes misses the minimum; where it finds it, the comparison is strict.
    assert!(tried > 250 && 2 * equal > tried, "{equal} of {tried}");
}

/// All chords of a parabola over one width deviate equally from it, by `width² / 4` from end to middle, which gives
/// the number of lines.
#[test]
fn a_parabola_takes_chords_of_known_width() {
    for (epsilon, points) in [(0.01, 4000), (0.002, 8000), (0.03, 4000)] {
        let at = |i: usize| i as f64 / points as f64;
        let curve: Vec<Point> = (0..=points).map(|i| [at(i), (1.0 - at(i)).powi(2)]).collect();
        let width = (8.0f64 * epsilon).sqrt();
        // The level end begins where the floor, from where the line left it, is no higher than the last ceiling.
        let level = 1.0 - (2.0f64 * epsilon).sqrt();
        let lines = (level / width).ceil() as usize;
        assert_eq!(fewest(&curve, epsilon).len(), lines + 1, "epsilon {epsilon}");
    }
}

/// Straight falls and constant stretches, each far longer than the tunnel is wide, take one line each.
#[test]
fn straight_stretches_take_a_line_each() {
    for stretches in 1..9usize {
        let fall = 1.0 / stretches.div_ceil(2) as f64;
        let mut curve: Vec<Point> = vec![[0.0, 1.0]];
        for s in 0..stretches {
            let [x, t] = curve[curve.len() - 1];
            let next = if s % 2 == 0 { t - fall } else { t };
            (1..=20).for_each(|i| {
                let w = f64::from(i) / 20.0;
                curve.push([x + w, t + (next - t) * w]);
            });
        }
        // A level end needs no node.
        let lines = if stretches.is_multiple_of(2) { stretches - 1 } else { stretches };
        assert_eq!(fewest(&curve, 0.01).len(), lines + 1, "{stretches}");
    }
}
