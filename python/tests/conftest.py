"""A small volume, the program and real scans for all tests.

A test whose requirement is missing fails, unless a variable says that it is not expected on this machine (tests/common).
"""

import importlib
import os
import subprocess
from pathlib import Path

import numpy as np
import pytest

import umbravox as uv

ROOT = Path(__file__).parents[2]
DATA = Path(os.environ.get("UMBRAVOX_DATA", ROOT.parent / "shared" / "data"))

# Jumps, a peak, and amounts between points: all that a transfer function can do.
FUNCTION = {
    "name": "test",
    "units": "",
    "reference_length_mm": 1.0,
    "points": [
        {"value": 20, "extinction": 0.0, "color": "#e08030"},
        {"value": 90, "extinction": 0.04, "color": "#e0d0b0"},
        {"value": 90, "extinction": 0.15, "color": "#ffffff"},
        {"value": 250, "extinction": 0.01, "color": "#5090ff"},
    ],
}


def missing(variable, why):
    """Skips the test where `variable` is 1, and fails it elsewhere."""
    if os.environ.get(variable) != "1":
        pytest.fail(f"{why}; {variable}=1 skips the tests that need it", pytrace=False)
    pytest.skip(why)


@pytest.fixture(scope="session")
def adapter():
    """Skips tests that need a graphics adapter where none is expected."""
    try:
        uv.Scene("phantom:slab:8").render(size=(2, 2))
    except uv.RunError as e:
        if "no graphics adapter" not in str(e):
            raise
        missing("UMBRAVOX_NO_GPU", str(e))


def small():
    """A volume of 9 x 8 x 7 voxels on an oblique grid, by whole numbers alone."""
    i, j, k = np.indices((9, 8, 7))
    voxels = ((37 * i + 53 * j * j + 11 * k * i + 29 * k) % 251).astype(np.uint8)
    affine = np.array([[2.0, 0.5, 0.0, -9.0], [-0.25, 1.5, 0.25, -5.0], [0.0, 0.0, 3.0, -8.0], [0, 0, 0, 1.0]])
    return voxels, affine


@pytest.fixture
def scene():
    voxels, affine = small()
    return uv.Scene(voxels, affine, tf=FUNCTION, size=(40, 30), light="dir:0.3,0.5,0.8")


@pytest.fixture(scope="session")
def program():
    """Runs the command line."""
    target = Path(os.environ.get("CARGO_TARGET_DIR", ROOT / "target"))
    named = [Path(os.environ["UMBRAVOX_PROGRAM"])] if "UMBRAVOX_PROGRAM" in os.environ else []
    found = [p for p in named + [target / "debug" / "umbravox", target / "release" / "umbravox"] if p.exists()]
    if not found:
        pytest.fail("the program is not built: cargo build", pytrace=False)

    def run(*line):
        return subprocess.run([found[0], *map(str, line)], capture_output=True, text=True, timeout=600)

    return run


def package_named(name):
    """Imports a package; where it is missing, the test fails at full size and is skipped otherwise."""
    if os.environ.get("UMBRAVOX_TESTS") == "full":
        return importlib.import_module(name)
    return pytest.importorskip(name)
