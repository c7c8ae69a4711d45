"""Python code of the pages runs: names, arguments and results are those of the module."""

import ast

import nibabel
import numpy as np
import pytest
from conftest import ROOT

import umbravox as uv

# Pages with blocks of Python code; the last block of python/README.md is for a script, and test_cluster.py runs the like.
PAGES = ["README.md", "python/README.md"]
# A table of the size that a page has by default takes half a minute.
EFFORT = dict(size="32x32", points=100, rays=50, depths=5, repeats=1)


class SmallTables(ast.NodeTransformer):
    """Gives calls of `compare` the arguments EFFORT."""

    def visit_Call(self, node):
        if isinstance(node.func, ast.Attribute) and node.func.attr == "compare":
            node.keywords += [ast.keyword(name, ast.Constant(value)) for name, value in EFFORT.items()]
        return ast.fix_missing_locations(node)


def blocks(page):
    """Python blocks of a page, behind as many empty lines as errors need to name the line of the page."""
    parts = page.read_text().split("```")
    for n, part in enumerate(parts):
        if n % 2 == 1 and part.startswith("python\n"):
            yield "\n" * "```".join(parts[:n]).count("\n") + part.removeprefix("python")


def test_all_pages_with_python_code_are_known():
    pages = [ROOT / "README.md", *ROOT.glob("*/README.md"), *ROOT.glob("docs/**/*.md")]
    assert sorted(str(page.relative_to(ROOT)) for page in pages if [*blocks(page)]) == PAGES


@pytest.mark.parametrize("page", PAGES)
def test_python_code_of_pages_runs(page, adapter, tmp_path, monkeypatch):
    # The scan, array and points of the reader: a small chest.
    volume = uv.read("phantom:thorax:24")
    nibabel.save(nibabel.Nifti1Image(volume.voxels(), volume.affine), tmp_path / "ct.nii.gz")
    monkeypatch.chdir(tmp_path)
    names = {"__name__": "page", "array": volume.voxels(), "affine": volume.affine, "points": np.zeros((1, 3))}
    for block in blocks(ROOT / page):
        exec(compile(SmallTables().visit(ast.parse(block)), page, "exec"), names)
    assert names["picture"].shape == (480, 640, 4) and names["picture"][..., 3].max() > 0.1
    assert [row["method"] for row in names["rows"]][:2] == ["rays", "dsm"]
