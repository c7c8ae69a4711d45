"""Exact answers against the figures of an independent program, and methods against exact answers."""

import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from conftest import DATA, FUNCTION, ROOT, missing, small

import umbravox as uv

ORACLE = Path(os.environ.get("UMBRAVOX_ORACLE_RAYS", ROOT.parent / "shared" / "oracle" / "exact_transmittance.py"))


def segments(seed, count, affine, shape):
    """Segments through and into a volume, world mm."""
    index = np.random.default_rng(seed).uniform(-2.0, np.array(shape) + 1.0, (2, count, 3))
    return np.round(index @ affine[:3, :3].T + affine[:3, 3], 3)


def test_optical_depths_are_those_of_an_independent_program(scene):
    # Made by an exact integrator of another hand, in float64, to 17 digits (oracle_answers.json says how).
    told = json.loads((Path(__file__).parent / "oracle_answers.json").read_text())
    starts, ends = np.array(told["starts"]), np.array(told["ends"])
    found = scene.optical_depth(starts, ends)
    assert found.dtype == np.float64 and found.shape == (len(starts),)
    np.testing.assert_allclose(found, told["optical_depth"], rtol=1e-11, atol=1e-13)
    assert (found > 0.1).sum() > 20


def test_real_scans_agree_with_the_oracle(tmp_path):
    volume = DATA / "CT_AVM.nii.gz"
    if not volume.exists():
        missing("UMBRAVOX_NO_SCANS", f"there is no {volume}")
    if not ORACLE.exists():
        pytest.skip("there is no oracle beside the repository (UMBRAVOX_ORACLE_RAYS)")
    function = {**FUNCTION, "points": [{**p, "value": 4 * p["value"] - 100} for p in FUNCTION["points"]]}
    scene = uv.Scene(volume, tf=function)
    affine, shape = scene.volume.affine, scene.volume.shape
    starts, ends = segments(3, 12, affine, shape)
    (tmp_path / "tf.json").write_text(json.dumps(function))
    np.savetxt(tmp_path / "rays.txt", np.hstack([starts, ends]), fmt="%.17g")
    line = [sys.executable, ORACLE, volume, tmp_path / "tf.json", tmp_path / "rays.txt"]
    told = np.loadtxt(subprocess.run(line, capture_output=True, text=True, check=True).stdout.splitlines())
    np.testing.assert_allclose(scene.optical_depth(starts, ends), told[:, 0], rtol=1e-10, atol=1e-12)


def test_an_even_medium_has_its_closed_form():
    even = {**FUNCTION, "points": [{"value": 0, "extinction": 0.02, "color": "#ffffff"}]}
    scene = uv.Scene(np.zeros((10, 10, 10)), spacing=(1, 2, 3), tf=even, light="dir:0,0,1")
    depth = scene.optical_depth([4.0, 8.0, -100.0], [4.0, 8.0, 100.0])
    assert depth == pytest.approx([0.02 * 30], rel=1e-12)
    # From the middle of the first slice up to the upper face: 28.5 mm.
    assert scene.transmittance([4.0, 8.0, 0.0], "exact") == pytest.approx([np.exp(-0.02 * 28.5)], rel=1e-12)


def test_a_gradient_opacity_has_its_closed_form(adapter):
    # The value rises by 1.5 per mm between the first and the last voxel centre along x, and is constant beyond.
    voxels = 3.0 * np.indices((12, 6, 6))[0]
    even = {**FUNCTION, "points": [{"value": 0, "extinction": 0.02, "color": "#ffffff"}]}
    scene = uv.Scene(voxels, spacing=(2, 1, 1), tf=even, light="dir:1,0,0", gradient_opacity="0:0,3:1")
    depth = scene.optical_depth([-100.0, 2.5, 2.5], [100.0, 2.5, 2.5])
    assert depth == pytest.approx([0.5 * 0.02 * 22], rel=1e-12)
    assert scene.transfer_function()["gradient_opacity"] == [{"gradient": 0, "factor": 0}, {"gradient": 3, "factor": 1}]
    starts = np.array([[4.0, 2.5, 2.5], [20.0, 1.25, 3.5]])
    exact = np.exp(-0.5 * 0.02 * (22 - starts[:, 0]))
    assert scene.transmittance(starts, "exact") == pytest.approx(exact, rel=1e-12)
    assert scene.transmittance(starts, "rays") == pytest.approx(exact, abs=1e-5)
    whole = scene.optical_depth([-100.0, 2.5, 2.5], [100.0, 2.5, 2.5], gradient_opacity="none")
    assert whole == pytest.approx([0.02 * 24], rel=1e-12)
    with pytest.raises(uv.InputError, match="list of GRADIENT:FACTOR"):
        scene.render(gradient_opacity="5")


def test_methods_answer_as_they_promise(scene, adapter):
    points = segments(5, 400, small()[1], small()[0].shape)[0]
    exact = scene.transmittance(points, "exact")
    assert exact.dtype == np.float64 and exact.min() < 0.5 < exact.max()
    rays = scene.transmittance(points, "rays")
    assert rays.dtype == np.float32 and np.abs(rays - exact).max() < 1e-4
    close, coarse = (np.abs(scene.transmittance(points, m) - exact) for m in ["dsm:map=512,epsilon=0.001", "osm:layers=4"])
    assert np.sqrt((close**2).mean()) < 0.01 < np.sqrt((coarse**2).mean())
    assert (scene.transmittance(points, "none") == 1.0).all()


def test_the_exact_picture_is_what_rays_come_close_to(scene, adapter):
    steps = []
    exact = scene.exact_picture(progress=steps.append)
    assert exact.shape == (30, 40, 4) and exact.dtype == np.float32
    assert steps[0]["done"] == 0 and steps[-1]["total"] == 30
    rays = scene.render(shadow="rays", step=0.1)
    assert np.sqrt(((rays - exact) ** 2).mean()) < 1e-3
