"""Answers the points of a benchmark cell by a ray march with NumPy: a template for programs of your own.

umbravox benchmark --cells "cloud-*-front-front" --external "march=python3 examples/external.py" -o ranks

Needs numpy and nibabel. The files that it reads and writes are described in docs/benchmark.md.
"""

import json
import math
import os
import sys
import tomllib

import nibabel
import numpy as np

STEP_VOXELS = 0.5


def extinction_of(function, values):
    """Extinction (1/mm) of scalar values."""
    points = function["points"]
    at = np.array([p["value"] for p in points], float)
    key = "opacity" if "opacity" in points[0] else "extinction"
    amounts = np.array([p[key] for p in points], float)
    # The later of two points with one value holds from that value on.
    after = np.searchsorted(at, values, side="right")
    low, high = np.clip(after - 1, 0, len(at) - 1), np.clip(after, 0, len(at) - 1)
    span = at[high] - at[low]
    share = np.where(span > 0, (values - at[low]) / np.where(span > 0, span, 1), 0)
    amount = amounts[low] + np.clip(share, 0, 1) * (amounts[high] - amounts[low])
    # Before the first point, its amount holds.
    amount = np.where(after == 0, amounts[0], amount)
    if key == "extinction":
        return amount
    return -np.log1p(-np.minimum(amount, 1 - 2**-24)) / function["reference_length_mm"]


def trilinear(voxels, index):
    """Values between voxel centres, clamped at the edge; NaN outside of the volume."""
    shape = np.array(voxels.shape)
    inside = np.all((index >= -0.5) & (index <= shape - 0.5), axis=1)
    index = np.clip(index, 0, shape - 1)
    base = np.minimum(index.astype(int), np.maximum(shape - 2, 0))
    part = index - base
    values = np.zeros(len(index))
    for corner in range(8):
        offset = np.array([corner >> axis & 1 for axis in range(3)])
        weight = np.prod(np.where(offset, part, 1 - part), axis=1)
        i, j, k = np.minimum(base + offset, shape - 1).T
        values += weight * voxels[i, j, k]
    return np.where(inside, values, np.nan)


def main():
    scene = tomllib.load(open(os.environ["UMBRAVOX_SCENE"], "rb"))
    function = json.load(open(os.environ["UMBRAVOX_FUNCTION"]))
    image = nibabel.load(os.environ["UMBRAVOX_VOLUME"])
    voxels = np.asarray(image.dataobj, float)
    index_from_world = np.linalg.inv(image.affine)
    points = np.loadtxt(os.environ["UMBRAVOX_POINTS"], ndmin=2)

    kind, _, text = scene["light"].partition(":")
    if kind not in ("dir", "point"):
        sys.exit(f"lights of kind {kind} are not answered")
    light = np.array([float(n) for n in text.split(",")[:3]])
    to_light = light - points if kind == "point" else np.broadcast_to(light, points.shape)
    distance = np.linalg.norm(to_light, axis=1)
    direction = to_light / distance[:, None]
    spacing_mm = np.linalg.norm(image.affine[:3, :3], axis=0)
    step_mm = STEP_VOXELS * spacing_mm.min()
    length_mm = distance if kind == "point" else np.full(len(points), np.inf)
    diagonal_mm = np.linalg.norm(spacing_mm * voxels.shape)

    optical_depth = np.zeros(len(points))
    for n in range(math.ceil(diagonal_mm / step_mm)):
        depth_mm = (n + 0.5) * step_mm
        at = points + depth_mm * direction
        values = trilinear(voxels, at @ index_from_world[:3, :3].T + index_from_world[:3, 3])
        sample = np.where(np.isnan(values), 0, extinction_of(function, np.nan_to_num(values)))
        optical_depth += np.where(depth_mm < length_mm, sample * step_mm, 0)
    np.savetxt(os.environ["UMBRAVOX_TRANSMITTANCES"], np.exp(-optical_depth))


if __name__ == "__main__":
    main()
