"""The module and the command line are one program: the same bytes, the same figures, the same words."""

import csv
import importlib.metadata
import json
import struct
import subprocess
import sys

import numpy as np
import pytest
from matplotlib import image
from conftest import FUNCTION, small

import umbravox as uv

CASES = [
    {"size": (48, 36)},
    {"tf": "bone", "shadow": "rays", "view": "R", "zoom": 1.5, "size": "40x40"},
    {"light": ["dir:0,1,1", "point:300,0,0,color=#ff8040"], "ambient": 0.3, "shading": "lambert", "size": (32, 32)},
    {"clip": [[0, 0, 1, -20], [1, 0, 0, 0]], "background": "none", "size": (40, 30)},
    {"eye": (0, 400, 20), "target": [0, 0, 0], "up": np.array([0, 0, 2.0]), "fov": 30, "opacity_scale": 2, "size": (31, 17)},
]


def flags(arguments):
    """The same arguments as flags."""
    for name, given in arguments.items():
        several = isinstance(given, list) and not isinstance(given[0], (int, float))
        for one in given if several else [given]:
            text = one if isinstance(one, str) else None
            if text is None:
                text = ("x" if name == "size" else ",").join(str(x) for x in one) if np.ndim(one) else str(one)
            yield f"--{name.replace('_', '-')}={text}"


def chunks(path):
    """The chunks of a PNG file: the revision that drew it, and all others."""
    data, found, at = path.read_bytes(), [], 8
    while at < len(data):
        (length,) = struct.unpack(">I", data[at : at + 4])
        found.append(data[at : at + 12 + length])
        at += 12 + length
    assert sum(b"umbravox:scene" in c for c in found) == 1
    revision = [c for c in found if b"Software" in c[:20]]
    return revision, [c for c in found if c not in revision]


@pytest.mark.parametrize("arguments", CASES, ids=lambda a: next(iter(a)))
def test_pictures_have_the_same_bytes(arguments, program, adapter, tmp_path):
    scene = uv.Scene("phantom:thorax:24")
    same_revision = False
    for ending in ["npy", "png", "exr"]:
        theirs, ours = tmp_path / f"theirs.{ending}", tmp_path / f"ours.{ending}"
        told = program("render", "phantom:thorax:24", *flags(arguments), "-o", theirs)
        assert told.returncode == 0, told.stderr
        scene.write(ours, **arguments)
        if ending == "png":
            (revision, rest), (other, others) = chunks(ours), chunks(theirs)
            assert rest == others
            same_revision = revision == other
        # An OpenEXR file's revision moves all else, and on a desk the program may be an older build.
        elif ending == "npy" or same_revision:
            assert ours.read_bytes() == theirs.read_bytes(), ending
    picture = scene.render(**arguments)
    assert np.array_equal(picture, np.load(tmp_path / "theirs.npy"))
    assert picture[..., 3].max() > 0.1
    # Drawn anew by another scene, and written from the array.
    again = uv.render("phantom:thorax:24", **arguments)
    assert np.array_equal(picture, again)
    transparent = arguments.get("background") == "none"
    uv.write_picture(tmp_path / "array.npy", picture, transparent=transparent)
    assert (tmp_path / "array.npy").read_bytes() == (tmp_path / "theirs.npy").read_bytes()


def test_pictures_on_the_screen_are_those_of_the_file(adapter, tmp_path):
    picture = uv.render("phantom:thorax:24", size=(32, 24))
    uv.write_picture(tmp_path / "x.png", picture)
    assert np.array_equal(np.round(255 * image.imread(tmp_path / "x.png")[..., :3]), uv.srgb8(picture))
    with pytest.raises(uv.InputError, match=r"its shape is \[24, 32\]; expected height x width x 4"):
        uv.write_picture(tmp_path / "x.png", picture[..., 0])


def test_transmittances_are_those_of_probe(program, adapter, tmp_path):
    points = np.random.default_rng(2).uniform(-90, 90, (50, 3)).round(2)
    np.savetxt(tmp_path / "points.txt", points, fmt="%.2f")
    told = program("probe", "phantom:thorax:24", "--shadow=dsm:map=128", "--points", tmp_path / "points.txt")
    method, exact = np.loadtxt(told.stdout.splitlines()).T
    scene = uv.Scene("phantom:thorax:24", shadow="dsm:map=128")
    np.testing.assert_allclose(scene.transmittance(points), method, atol=1e-9)
    np.testing.assert_allclose(scene.transmittance(points, "exact"), exact, rtol=0, atol=1e-16)


def test_tables_have_the_same_columns_and_errors(program, adapter, tmp_path):
    effort = {"repeats": 1, "points": 200, "rays": 20, "depths": 10}
    line = [f"--{name}={n}" for name, n in effort.items()]
    methods = "rays;dsm:map=64,epsilon=0.05,0.01"
    told = program("compare", "phantom:thorax:24", "--size=24x24", f"--methods={methods}", *line, "-o", tmp_path / "theirs")
    assert told.returncode == 0, told.stderr
    with open(tmp_path / "theirs" / "compare.csv", newline="") as file:
        theirs = list(csv.DictReader(file))
    rows = uv.Scene("phantom:thorax:24", size=(24, 24)).compare(methods, output=tmp_path / "ours", **effort)
    assert [r["method"] for r in rows] == ["rays", "dsm", "dsm"]
    assert list(rows[0]) == list(theirs[0])
    for row, other in zip(rows, theirs):
        assert (row["scene"], row["params"]) == (other["scene"], other["params"])
        for column in ["point_err_rms", "point_err_max", "ray_err_max", "image_rmse", "bytes"]:
            assert row[column] == (float(other[column]) if other[column] else None), column
    files = {p.name for p in (tmp_path / "ours").iterdir()}
    assert {"compare.csv", "report.html", "run.json", "scene.toml"} <= files
    with pytest.raises(uv.InputError, match="it holds"):
        uv.compare("phantom:thorax:24", methods, size=(24, 24), output=tmp_path / "ours", **effort)


def test_scene_files_go_both_ways(program, adapter, tmp_path):
    scene = uv.Scene("phantom:thorax:24", tf="skin", size=(20, 16), view="A")
    text = scene.to_toml(zoom=2.0)
    (tmp_path / "scene.toml").write_text(text)
    again = uv.Scene.read(tmp_path / "scene.toml", ambient=0.5)
    expected = scene.render(zoom=2.0, ambient=0.5)
    assert np.array_equal(again.render(), expected)
    told = program("render", "--scene", tmp_path / "scene.toml", "--ambient=0.5", "-o", tmp_path / "x.npy")
    assert told.returncode == 0, told.stderr
    assert np.array_equal(np.load(tmp_path / "x.npy"), expected)
    # The camera as arguments is the camera.
    camera = scene.camera(zoom=2.0)
    assert np.array_equal(scene.render(ambient=0.5, **camera), expected)


def test_files_and_arrays_are_one_volume(program, adapter, tmp_path):
    voxels, affine = small()
    (tmp_path / "tf.json").write_text(json.dumps(FUNCTION))
    uv.Volume(voxels, affine).save(tmp_path / "small.nii.gz")
    told = program("render", tmp_path / "small.nii.gz", "--tf", tmp_path / "tf.json", "--size=33x22", "-o", tmp_path / "x.npy")
    assert told.returncode == 0, told.stderr
    assert np.array_equal(uv.render(voxels, affine, tf=FUNCTION, size=(33, 22)), np.load(tmp_path / "x.npy"))
    back = uv.read(tmp_path / "small.nii.gz")
    assert np.array_equal(back.voxels(), voxels) and back.voxels().dtype == np.uint8
    np.testing.assert_allclose(back.affine, affine, atol=1e-6)


@pytest.mark.parametrize(
    ("arguments", "line"),
    [
        ({"volume": "no_such.nii"}, ["no_such.nii"]),
        ({"tf": "bonee"}, ["--tf=bonee"]),
        ({"shadow": "dsm:epsilon=2"}, ["--shadow=dsm:epsilon=2"]),
        ({"eye": (0, 0, 0), "target": (0, 0, 0)}, ["--eye=0,0,0", "--target=0,0,0"]),
        ({"hide": 3}, ["--hide=3"]),
    ],
)
def test_errors_have_the_same_words(arguments, line, program, tmp_path):
    told = program("render", *([] if "volume" in arguments else ["phantom:slab:8"]), *line, "-o", tmp_path / "x.png")
    volume = arguments.pop("volume", "phantom:slab:8")
    with pytest.raises(uv.InputError) as caught:
        uv.Scene(volume, **arguments)
    e = caught.value
    # An argument of the module is a flag of the program: both give the same reason.
    assert told.stderr.splitlines()[0].startswith("error: ")
    assert told.stderr.splitlines()[0].endswith(f": {e.why}")
    assert told.returncode == 2 and isinstance(e, ValueError)


def package(*words, **options):
    """Runs the command of the package, in a process of its own."""
    command = [sys.executable, "-m", "umbravox", *map(str, words)]
    return subprocess.run(command, capture_output=True, text=True, **options)


@pytest.mark.parametrize(
    "line",
    [["--version"], ["info", "phantom:thorax:24"], ["render", "--help"], ["tf", "list"], [], ["info", "nowhere.nii"], ["rendr"]],
    ids=" ".join,
)
def test_the_command_of_the_package_is_the_program(line, program):
    ours, theirs = package(*line), program(*line)
    assert (ours.returncode, ours.stdout, ours.stderr) == (theirs.returncode, theirs.stdout, theirs.stderr)


def test_the_command_of_the_package_renders(program, adapter, tmp_path):
    for run, name in [(package, "ours.npy"), (program, "theirs.npy")]:
        told = run("render", "phantom:thorax:24", "--size", "32x24", "-o", tmp_path / name)
        assert told.returncode == 0, told.stderr
    assert (tmp_path / "ours.npy").read_bytes() == (tmp_path / "theirs.npy").read_bytes()


def test_the_package_says_that_it_has_no_window():
    told = package("view")
    assert told.returncode == 2 and "no window" in told.stderr and "cargo install" in told.stderr


def test_the_package_installs_its_command():
    try:
        importlib.metadata.distribution("umbravox")
    except importlib.metadata.PackageNotFoundError:
        pytest.skip("the module is imported from a folder, not installed")
    (entry,) = (e for e in importlib.metadata.entry_points(group="console_scripts") if e.name == "umbravox")
    assert entry.load().__module__ == "umbravox.__main__"
