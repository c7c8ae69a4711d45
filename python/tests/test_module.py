"""What comes with the module: its types, and the notebook."""

import subprocess
import sys
from pathlib import Path

import nbclient
import nbformat
from conftest import ROOT

import umbravox as uv


def test_the_types_know_every_argument():
    stub = (Path(uv.__file__).parent / "__init__.pyi").read_text()
    names = {}
    for part in stub.split("\nclass ")[1:]:
        lines = part.split("\n\n")[0].splitlines() if part.startswith(("Scene:", "Volume:")) else part.splitlines()
        names[part.split("(")[0].split(":")[0]] = {
            line.strip().split(":")[0] for line in lines[1:] if line.startswith("    ") and ": " in line and '"""' not in line
        }
    reading = names["FormatArguments"] | names["ReadArguments"]
    assert names["SceneAndReadArguments"] == names["ReadArguments"] == {"labels"}
    assert reading | names["SceneArguments"] | names["FileArguments"] == set(uv.arguments())
    assert names["FileArguments"] == {"volume"}
    # The classes that are written in Rust have their docs where `help` looks.
    assert uv.Scene.render.__doc__ and uv.Volume.__doc__


def test_the_types_are_those_of_the_module():
    line = [sys.executable, "-m", "mypy.stubtest", "umbravox", "--ignore-missing-stub", "--allowlist", "/dev/null"]
    told = subprocess.run(line, capture_output=True, text=True, cwd=ROOT / "python" / "tests")
    assert told.returncode == 0, told.stdout + told.stderr


def test_the_notebook_runs(adapter, tmp_path):
    notebook = nbformat.read(ROOT / "examples" / "shadow_errors.ipynb", as_version=4)
    nbformat.validate(notebook)
    done = nbclient.NotebookClient(notebook, timeout=900, resources={"metadata": {"path": tmp_path}}).execute()
    last = done.cells[-1].outputs
    plots = [o for o in last if "image/png" in o.get("data", {})]
    assert plots, "the last cell shows no plot"
    # Kept in the repository without what it shows.
    assert all(not c.get("outputs") for c in nbformat.read(ROOT / "examples" / "shadow_errors.ipynb", 4).cells if c.cell_type == "code")
