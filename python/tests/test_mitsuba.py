"""Exact pictures against Mitsuba 3, a renderer that shares nothing with this one: single scattering by `volpath`."""

import json

import numpy as np
import pytest
from conftest import package_named

import umbravox as uv

mi = package_named("mitsuba")

SAMPLES = 20_000
PIXELS = 16
SIZE = (24, 16)
# Standard errors of one value, and of the mean over all values of a scene.
MOST_DEVIATIONS, MOST_MEAN = 5.0, 4.0



def linear(ends):
    """A transfer function that is linear in the value, so that grids of extinction and colour are interpolated exactly."""
    points = [{"value": value, "extinction": sigma, "color": color} for value, sigma, color in ends]
    return {"name": "linear", "units": "", "reference_length_mm": 1.0, "points": points}


BODY = linear([(-1100, 0.0, "#2090f0"), (3100, 0.06, "#f07030")])
BALL = linear([(-2000, 0.0, "#ff8040"), (2000, 0.06, "#ff8040")])
SCENES = {
    "one light": ("phantom:thorax:32", BODY, {"light": "dir:0.3,0.7,0.6"}),
    "phase function": (
        "phantom:shell:24",
        BALL,
        {"light": ["dir:1,0.2,0.1,color=#ff8040", "dir:-0.2,-1,0.4,intensity=0.5"], "phase": 0.6},
    ),
    "sky": ("phantom:sphere:24", BALL, {"light": "sky,intensity=2"}),
}


def exported(program, folder, volume, function, arguments):
    """Writes the scene by the command line, and returns Mitsuba's scene."""
    tf = folder / "function.json"
    tf.write_text(json.dumps(function))
    lights = arguments["light"]
    flags = [f"--light={light}" for light in (lights if isinstance(lights, list) else [lights])]
    flags += [f"--{key}={value}" for key, value in arguments.items() if key != "light"]
    size = "x".join(map(str, SIZE))
    to = f"--mitsuba={folder / 'scene'}"
    done = program("export", volume, f"--tf={tf}", "--ambient=0", f"--size={size}", *flags, to, "--json")
    assert done.returncode == 0, done.stderr
    error = json.loads(done.stdout)
    assert error["max_per_mm"] < 1e-6 * error["largest_extinction_per_mm"], error
    mi.set_variant("scalar_rgb")
    return mi.load_file(str(folder / "scene" / "scene.xml"))


def radiance(scene, pixel):
    """Mean and standard error of the radiance on the eye ray through the centre of a pixel."""
    sensor, integrator = scene.sensors()[0], scene.integrator()
    sampler = mi.load_dict({"type": "independent"})
    sampler.seed(1000 * pixel[0] + pixel[1])
    at = mi.Point2f((pixel[1] + 0.5) / SIZE[0], (pixel[0] + 0.5) / SIZE[1])
    ray, _ = sensor.sample_ray_differential(0.0, 0.5, at, mi.Point2f(0.5))
    values = np.array([np.array(integrator.sample(scene, sampler, ray)[0]) for _ in range(SAMPLES)])
    return values.mean(axis=0), values.std(axis=0, ddof=1) / np.sqrt(SAMPLES)


@pytest.mark.parametrize("name", SCENES)
def test_exact_pictures_lie_in_the_interval_of_mitsuba(name, program, tmp_path):
    volume, function, arguments = SCENES[name]
    scene = exported(program, tmp_path, volume, function, arguments)
    exact = uv.Scene(volume, tf=function, ambient=0, size=SIZE, background="#000000", **arguments).exact_picture()
    rows, columns = np.nonzero(exact[..., 3] > 0.05)
    chosen = np.random.default_rng(5).choice(len(rows), PIXELS, replace=False)
    deviations = []
    for pixel in zip(rows[chosen], columns[chosen]):
        mean, error = radiance(scene, tuple(int(x) for x in pixel))
        # The exact picture under a sky is itself a mean of samples.
        own = 3e-4 if name == "sky" else 0.0
        deviations.append((exact[pixel][:3] - mean) / np.hypot(error, own))
    largest = np.abs(deviations).max()
    common = np.mean(deviations) * np.sqrt(PIXELS)
    print(f"{name}: largest standardised deviation {largest:.2f} of {np.size(deviations)} values, mean {common:.2f}")
    assert largest < MOST_DEVIATIONS
    # Channels of a pixel have the same paths.
    assert abs(common) < MOST_MEAN, deviations
