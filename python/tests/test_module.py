"""What comes with the module: its types, and the notebooks."""

import ast
import inspect
import os
import pydoc
import subprocess
import sys
from pathlib import Path

import nbclient
import nbformat
import pytest
from conftest import ROOT

import umbravox as uv

NOTEBOOKS = sorted((ROOT / "examples").glob("*.ipynb"))


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
    for item in uv.Scene, uv.Scene.render, uv.Scene.compare, uv.Volume, uv.read, uv.render, uv.compare, uv.transmittance:
        assert ">>> " in item.__doc__, f"no example of {item}"
    # Examples are code, and their arguments have the names that the functions know.
    for line in "\n".join(item.__doc__ for item in (uv.Scene, uv.Volume, uv.read, uv.render, uv.compare)).splitlines():
        if line.strip().startswith(">>> "):
            calls = [node for node in ast.walk(ast.parse(line.strip()[4:])) if isinstance(node, ast.Call)]
            names = {keyword.arg for call in calls for keyword in call.keywords}
            assert names <= set(uv.arguments()) | {"name", "output"}, line


def test_the_types_are_those_of_the_module():
    line = [sys.executable, "-m", "mypy.stubtest", "umbravox", "--ignore-missing-stub", "--allowlist", "/dev/null"]
    told = subprocess.run(line, capture_output=True, text=True, cwd=ROOT / "python" / "tests")
    assert told.returncode == 0, told.stdout + told.stderr


def test_the_notebooks_are_stored_without_outputs():
    assert len(NOTEBOOKS) == 6
    for path in NOTEBOOKS:
        notebook = nbformat.read(path, as_version=4)
        nbformat.validate(notebook)
        assert all(not c.outputs and c.execution_count is None for c in notebook.cells if c.cell_type == "code"), path.name
        assert f"../examples/{path.name}" in (ROOT / "python" / "README.md").read_text()


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_the_notebook_runs(path, adapter, tmp_path):
    if path.stem != "shadow_errors" and os.environ.get("UMBRAVOX_TESTS") != "full":
        pytest.skip("a notebook of the full size (UMBRAVOX_TESTS=full)")
    notebook = nbformat.read(path, as_version=4)
    done = nbclient.NotebookClient(notebook, timeout=900, resources={"metadata": {"path": tmp_path}}).execute()
    kinds = {kind for cell in done.cells if cell.cell_type == "code" for o in cell.outputs for kind in o.get("data", {})}
    assert "image/png" in kinds, "it shows no picture"
    assert path.stem != "transfer_functions" or "application/vnd.jupyter.widget-view+json" in kinds


def test_signatures_name_the_arguments_of_scenes():
    names = set(uv.arguments()) - {"volume"}
    for function in uv.Scene, uv.render, uv.transmittance, uv.compare:
        assert names <= set(inspect.signature(function).parameters), function
    assert "tf=None" in pydoc.plain(pydoc.render_doc(uv.Scene))
