"""The program of examples/ that answers the points of a benchmark cell."""

import json
import os
import subprocess
import sys

import nibabel
import numpy as np
import pytest
from conftest import FUNCTION, ROOT, small

import umbravox as uv

OPACITY = {
    **FUNCTION,
    "reference_length_mm": 2.0,
    "points": [
        {"value": 40, "opacity": 0.0, "color": "#ffffff"},
        {"value": 200, "opacity": 0.3, "color": "#ffffff"},
    ],
}


@pytest.mark.parametrize("function", [FUNCTION, OPACITY], ids=["extinction", "opacity"])
@pytest.mark.parametrize("light", ["dir:0.3,0.5,0.8", "point:30,-5,40"])
def test_a_march_in_numpy_answers_like_the_exact_integral(function, light, tmp_path):
    voxels, affine = small()
    # Two voxels are alike along every axis, so that steps of half a voxel sample every line well.
    voxels = np.repeat(np.repeat(np.repeat(voxels, 2, 0), 2, 1), 2, 2)
    affine = affine @ np.diag([0.5, 0.5, 0.5, 1])
    nibabel.save(nibabel.Nifti1Image(voxels, affine), tmp_path / "volume.nii")
    (tmp_path / "function.json").write_text(json.dumps(function))
    (tmp_path / "scene.toml").write_text(f'light = "{light}"\n')
    index = np.random.default_rng(8).uniform(0, np.array(voxels.shape) - 1, (2000, 3))
    points = index @ affine[:3, :3].T + affine[:3, 3]
    np.savetxt(tmp_path / "points.txt", points)
    names = {"SCENE": "scene.toml", "VOLUME": "volume.nii", "FUNCTION": "function.json", "POINTS": "points.txt"}
    names["TRANSMITTANCES"] = "transmittances.txt"
    files = {f"UMBRAVOX_{name}": str(tmp_path / file) for name, file in names.items()}
    subprocess.run([sys.executable, ROOT / "examples" / "external.py"], env={**os.environ, **files}, check=True)
    answers = np.loadtxt(tmp_path / "transmittances.txt")
    exact = uv.Scene(tmp_path / "volume.nii", tf=function, light=light).transmittance(points, "exact")
    assert exact.std() > 0.2, "the points must tell lights and functions apart"
    assert np.sqrt(np.mean((answers - exact) ** 2)) < 0.02
