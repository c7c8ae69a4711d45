"""Exact optical depths against enclosures in ball arithmetic, which include the errors of rounding and quadrature.

Cell faces that a ray crosses within about 1e-35 of its ends or of each other are ordered by their middles.
"""

import math

import numpy as np
import pytest
from conftest import DATA, FUNCTION, missing, package_named, small

import umbravox as uv

# An interval of the ray parameter this small is not cut again: extinction there is between 0 and its greatest value.
SHORTEST = 2.0**-60


class Enclosure:
    """Optical depth through a trilinear volume (docs/model.md) as a ball that contains it, in 128 bits."""

    def __init__(self, voxels, affine, function):
        flint = package_named("flint")
        flint.ctx.prec = 128
        self.arb, self.acb, self.poly = flint.arb, flint.acb, flint.arb_poly
        self.voxels = np.asarray(voxels, float)
        matrix = flint.arb_mat([[self.arb(float(x)) for x in row] for row in np.asarray(affine)])
        self.index_from_world = matrix.inv()
        self.column = lambda v: flint.arb_mat([[self.arb(float(x))] for x in [*v, 1.0]])
        points = function["points"]
        self.by_opacity = "opacity" in points[0]
        key = "opacity" if self.by_opacity else "extinction"
        self.given = [(float(p["value"]), self.arb(float(p[key]))) for p in points]
        assert not self.by_opacity or function.get("reference_length_mm", 1.0) == 1.0
        greatest = max(float(p[key]) for p in points)
        self.greatest = self.arb(2 * (-math.log1p(-greatest) if self.by_opacity else greatest))

    def optical_depth(self, start, end):
        """The ball for one segment, world mm."""
        first, last = (self.index_from_world * self.column(p) for p in (start, end))
        line = [(first[i, 0], last[i, 0] - first[i, 0]) for i in range(3)]
        cuts = self.cuts(line)
        total = self.arb(0)
        for a, b in zip(cuts, cuts[1:]):
            if (b - a).contains(0):
                total += self.between_0_and((b - a).abs_upper())
                continue
            value, is_empty = self.value_along(line, float(((a + b) / 2).mid()))
            if not is_empty:
                total += self.integral(value, a, b)
        squares = [(self.arb(float(e)) - self.arb(float(s))) ** 2 for s, e in zip(start, end)]
        return total * sum(squares, self.arb(0)).sqrt()

    def cuts(self, line):
        """Ray parameters in order: ends inside the volume, and where the ray leaves a cell."""
        begin, end, inner = self.arb(0), self.arb(1), []
        for (p, d), n in zip(line, self.voxels.shape):
            if d == 0:
                if p <= -0.5 or p >= n - 0.5:
                    return []
                continue
            at = [(plane - p) / d for plane in (-0.5, n - 0.5)]
            low, high = at if d > 0 else at[::-1]
            begin, end = begin.max(low), end.min(high)
            inner += [(k - p) / d for k in range(n)]
        inner = [t for t in inner if t > begin and t < end]
        return [begin, *sorted(inner, key=lambda t: t.mid()), end] if begin < end else []

    def value_along(self, line, middle):
        """The value in the cell at a ray parameter, as a polynomial in it; and whether its extinction is 0."""
        corners, factors = self.voxels, []
        for (p, d), n in zip(line, self.voxels.shape):
            at = float((p + d * middle).mid())
            base = min(max(math.floor(at), 0), n - 2)
            corners = corners[(*len(factors) * [slice(None)], slice(base, base + 2))]
            # Beyond the outermost voxel centres the value is that of the nearest.
            factors.append(self.poly([0]) if at < 0 else self.poly([1]) if at > n - 1 else self.poly([p - base, d]))
        value, extinction = self.given[0]
        if extinction == 0 and corners.max() <= value and self.given[1][0] > value:
            return None, True
        corners = [self.poly([value]) for value in corners.ravel()]
        for f in factors[::-1]:
            corners = [a + (b - a) * f for a, b in zip(corners[::2], corners[1::2])]
        return corners[0], False

    def integral(self, value, a, b):
        """The integral of extinction: pieces are halved until each has values within one piece of the function."""
        slope, total, rest = value.derivative(), self.arb(0), [(a, b)]
        while rest:
            a, b = rest.pop()
            whole, middle = a.union(b), (a + b) / 2
            reach = value(middle) + slope(whole) * (whole - middle)
            given = self.function_within(reach)
            if given is not None:
                total += self.piece(given(value), a, b)
            elif b - a < SHORTEST or slope.degree() < 0:
                total += self.between_0_and(b - a)
            else:
                rest += [(a, middle), (middle, b)]
        return total

    def function_within(self, reach):
        """The piece of the transfer function, a straight line, that has all values of a ball."""
        (first, start), (last, end) = self.given[0], self.given[-1]
        if reach < first:
            return lambda value: self.poly([start])
        if reach > last:
            return lambda value: self.poly([end])
        for (v0, y0), (v1, y1) in zip(self.given, self.given[1:]):
            if v0 < v1 and reach >= v0 and reach <= v1:
                return lambda value: y0 + (value - v0) * ((y1 - y0) / (self.arb(v1) - v0))
        return None

    def piece(self, given, a, b):
        """The integral over one smooth piece."""
        if not self.by_opacity:
            whole = given.integral()
            return whole(b) - whole(a)
        transmission = [1 - given[0], *(-given[i] for i in range(1, len(given)))]

        def minus_extinction(t, analytic):
            total = self.acb(0)
            for c in reversed(transmission):
                total = total * t + c
            return total.log(analytic=analytic)

        return -self.acb.integral(minus_extinction, a, b).real

    def between_0_and(self, length):
        return self.arb(0).union(self.greatest * length)


def check(scene, enclosure, count):
    """Random segments through and into the volume: the exact answer is in the enclosure, which is narrow."""
    affine, shape = scene.volume.affine, scene.volume.shape
    index = np.random.default_rng(12).uniform(-2.0, np.array(shape) + 1.0, (2, count, 3))
    starts, ends = index @ affine[:3, :3].T + affine[:3, 3]
    found = scene.optical_depth(starts, ends)
    balls = [enclosure.optical_depth(*segment) for segment in zip(starts, ends)]
    assert np.isfinite(found).all() and all(float(ball.rad()) < 1e-12 for ball in balls)
    outside = [float((ball - float(depth)).abs_lower()) / max(1.0, depth) for ball, depth in zip(balls, found)]
    print(f"widest {max(float(ball.rad()) for ball in balls):.1e}, farthest outside {max(outside):.1e}")
    assert all(distance < 1e-12 for distance in outside)
    assert (found > 0.1).sum() > count / 10


@pytest.mark.parametrize("quantity", ["extinction", "opacity"])
def test_small_volume(quantity):
    voxels, affine = small()
    points = [{**p, quantity: p["extinction"]} for p in FUNCTION["points"]]
    function = {**FUNCTION, "points": [{k: v for k, v in p.items() if k in {"value", "color", quantity}} for p in points]}
    check(uv.Scene(voxels, affine, tf=function), Enclosure(voxels, affine, function), 40)


@pytest.mark.parametrize(("name", "low", "high"), [("engine", 60, 120), ("CT_AVM", 150, 400)])
def test_scans(name, low, high):
    path = DATA / f"{name}.nii.gz"
    if not path.exists():
        missing("UMBRAVOX_NO_SCANS", f"there is no {path}")
    function = {"name": name, "points": [{"value": low, "opacity": 0.0}, {"value": high, "opacity": 0.6}]}
    scene = uv.Scene(path, tf=function)
    check(scene, Enclosure(scene.volume.voxels(), scene.volume.affine, function), 100)
