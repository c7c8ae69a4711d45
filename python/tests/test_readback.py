"""Settings, transfer function and picture file of a scene, read back as arguments and bytes."""

import io

import matplotlib.image
import numpy as np
from conftest import FUNCTION, small

import umbravox as uv


def test_settings_make_the_same_scene(scene, adapter):
    voxels, affine = small()
    own = scene.settings()
    assert own["tf"]["points"] == scene.transfer_function()["points"] and own["size"] == "40x30"
    toward = [float(x) for x in own["light"].removeprefix("dir:").split(",")]
    np.testing.assert_allclose(toward, np.array([0.3, 0.5, 0.8]) / np.sqrt(0.98))
    assert own["ambient"] == 0.1
    assert np.array_equal(uv.Scene(voxels, affine, **own).render(), scene.render())
    # Defaults and arguments of the call too, and nothing about reading a file.
    scene = uv.Scene("phantom:thorax:24", tf="bone", size=(20, 16))
    lights = ["dir:0.0,0.0,1.0", "point:1.0,2.0,3.0,intensity=0.5"]
    given = {"view": "A", "clip": [(0, 0, 1, 0)], "light": lights, "shadow": "osm:layers=8"}
    settings = scene.settings(**given)
    assert "volume" not in settings and settings["light"] == lights and settings["tf"] == "bone"
    assert np.array_equal(scene.render(**settings), scene.render(**given))


def test_the_transfer_function_is_that_of_the_volume(scene):
    points = scene.transfer_function()["points"]
    assert [(p["value"], p["extinction"], p["color"]) for p in points] == [
        (p["value"], p["extinction"], p["color"]) for p in FUNCTION["points"]
    ]
    doubled = scene.transfer_function(opacity_scale=2.0)["points"]
    np.testing.assert_allclose([p["extinction"] for p in doubled], [2 * p["extinction"] for p in points])
    # Presets in HU have the values of a volume that is not in HU.
    engine = uv.Scene(small()[0], small()[1], units="fraction", tf="bone").transfer_function()["points"]
    assert 0 <= engine[0]["value"] < engine[-1]["value"] <= 500


def test_a_copy_has_its_own_settings(scene, adapter):
    before = scene.render()
    other = scene.copy(view="A", light=(0, 1, 0))
    assert np.array_equal(other.render(), scene.render(view="A", light=(0, 1, 0)))
    assert np.array_equal(scene.render(), before) and not np.array_equal(other.render(), before)
    assert np.array_equal(other.volume.voxels(), scene.volume.voxels())


def test_png_is_the_picture(scene, adapter):
    png = scene.png(view="L", size=(24, 20))
    shown = np.round(255 * matplotlib.image.imread(io.BytesIO(png))[..., :3])
    assert np.array_equal(shown, uv.srgb8(scene.render(view="L", size=(24, 20))))
    assert scene._repr_png_() == scene.png()
