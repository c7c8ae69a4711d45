"""What a scene keeps, refuses and lets go on."""

import copy
import pickle
import signal
import subprocess
import sys
import threading
import time

import numpy as np
import pytest
from conftest import FUNCTION, small

import umbravox as uv


def test_no_answer_depends_on_the_questions_before(scene, adapter):
    asked = [
        {},
        {"eye": (60, 10, 5), "target": (0, 0, 0)},
        {"light": "point:40,40,40"},
        {"tf": "engine"},
        {"tf": {**FUNCTION, "points": FUNCTION["points"][:2]}},
        {"shadow": "osm:layers=8"},
        {"shadow": "dsm:fit=volume,map=64", "view": "A"},
        {"shadow": "dsm:fit=volume,map=64", "view": "L"},
        {"ambient": 1.0},
        {"size": (17, 31)},
    ]
    voxels, affine = small()
    first = [scene.render(**a) for a in asked]
    points = np.zeros((3, 3))
    light = scene.transmittance(points)
    for a, picture in sorted(zip(asked, first), key=lambda both: str(both[0]), reverse=True):
        assert np.array_equal(scene.render(**a), picture), a
        fresh = uv.Scene(voxels, affine, **{"tf": FUNCTION, "size": (40, 30), "light": "dir:0.3,0.5,0.8", **a})
        assert np.array_equal(fresh.render(), picture), a
        assert np.array_equal(scene.transmittance(points), light)


def test_what_a_call_does_not_change_is_kept(scene, adapter):
    scene.render(shadow="dsm:map=64")
    assert scene.last["build_ms"] > 0 and scene.last["table_ms"] > 0
    scene.render(shadow="dsm:map=64", ambient=0.2)
    assert scene.last["build_ms"] is None and scene.last["table_ms"] is None
    assert scene.last["frame_ms"] > 0 and scene.last["bytes"] > 0
    # A map of the whole volume serves every camera.
    for view in ["A", "L"]:
        scene.render(shadow="dsm:fit=volume,map=64", view=view)
    assert scene.last["build_ms"] is None


def test_several_threads_may_ask(scene, adapter):
    expected = [scene.render(view=view) for view in "APLRSI"]
    found = {}
    threads = [threading.Thread(target=lambda v=v: found.update({v: scene.render(view=v)})) for v in "APLRSI"]
    [t.start() for t in threads], [t.join() for t in threads]
    assert all(np.array_equal(found[v], e) for v, e in zip("APLRSI", expected))


def test_other_threads_run_meanwhile(adapter):
    scene = uv.Scene("phantom:thorax:24", size=(8, 8))
    turns, done = 0, threading.Event()

    def count():
        nonlocal turns
        while not done.is_set():
            turns += 1
            time.sleep(0.001)

    counter = threading.Thread(target=count)
    counter.start()
    try:
        start, before = time.monotonic(), turns
        scene.exact_picture(size=(24, 24))
        took, counted = time.monotonic() - start, turns - before
    finally:
        done.set()
        counter.join()
    # A thread that sleeps a millisecond has at least a turn in 20 where the interpreter is free, and none where it is not.
    assert took > 0.05 and counted > took * 50, (took, counted)


INTERRUPTED = """
import sys, threading, signal, os, time
import umbravox as uv
scene = uv.Scene("phantom:thorax:64", size=(400, 400))
def begun(step):
    print("begun", flush=True)
try:
    {work}
except KeyboardInterrupt:
    print("interrupted", flush=True)
    sys.exit(7)
"""


def test_nobody_waits_for_a_picture_to_hear_of_the_last(adapter):
    scene = uv.Scene("phantom:thorax:48", size=(300, 300), shadow="rays")
    scene.render(size=(4, 4))
    thread = threading.Thread(target=scene.render)
    thread.start()
    time.sleep(0.05)
    waits = []
    while thread.is_alive():
        start = time.monotonic()
        assert scene.last["frame_ms"] > 0 and isinstance(scene.notes, list)
        waits.append(time.monotonic() - start)
        time.sleep(0.01)
    thread.join()
    assert len(waits) > 3 and max(waits) < 0.5, (len(waits), max(waits))


def test_tables_count_no_work_of_others(adapter):
    table = uv.Scene("phantom:thorax:24", size=(16, 16))
    effort = {"repeats": 1, "points": 20, "rays": 5, "depths": 5}
    counted = ["work_samples", "work_cells", "work_lookups", "work_loads"]
    alone = [[row[c] for c in counted] for row in table.compare("rays;dsm:map=32", **effort)]
    other, ended = uv.Scene("phantom:thorax:24", size=(16, 16), shadow="dsm:map=32"), threading.Event()

    def draw():
        while not ended.is_set():
            other.render()

    thread = threading.Thread(target=draw)
    thread.start()
    try:
        beside = [[row[c] for c in counted] for row in table.compare("rays;dsm:map=32", **effort)]
    finally:
        ended.set()
        thread.join()
    assert beside == alone


FORKED = """
import multiprocessing, numpy as np, umbravox as uv
def depth(_):
    try:
        return float(uv.Scene(np.arange(64.0).reshape(4, 4, 4), tf="engine", units="fraction").optical_depth([3, 3, -9], [3, 3, 9])[0])
    except uv.RunError as e:
        return str(e)
if __name__ == "__main__":
    print(depth(0))
    with multiprocessing.get_context({kind!r}).Pool(1) as pool:
        print(pool.map(depth, [0])[0])
"""


@pytest.mark.skipif(sys.platform == "win32", reason="skipped: no fork there")
def test_processes_have_their_own_or_say_so(tmp_path):
    for kind, words in [("fork", "spawn"), ("spawn", "")]:
        (tmp_path / "forked.py").write_text(FORKED.format(kind=kind))
        told = subprocess.run([sys.executable, tmp_path / "forked.py"], capture_output=True, text=True, timeout=60)
        first, second = told.stdout.split("\n", 1)
        assert float(first) > 0, told.stderr
        assert words in second if words else float(second) == float(first)


def test_what_is_given_as_empty_is_taken_away(adapter):
    voxels, affine = small()
    plain = uv.Scene(voxels, affine, tf=FUNCTION, size=(20, 16)).render()
    cut = uv.Scene(voxels, affine, tf=FUNCTION, size=(20, 16), clip=(0, 0, 1, 0), eye=(60, 0, 0), target=(0, 0, 0))
    assert not np.array_equal(cut.render(view="A"), cut.render(view="A", clip=[]))
    again = uv.Scene(voxels, affine, tf=FUNCTION, size=(20, 16), view="A").render()
    assert np.array_equal(cut.render(view="A", clip=[]), again) and not np.array_equal(again, plain)


@pytest.mark.skipif(sys.platform == "win32", reason="skipped: no SIGINT there")
@pytest.mark.parametrize(
    "work",
    [
        "scene.compare('rays;dsm', points=1000, progress=begun)",
        "scene.exact_picture(progress=begun)",
        "begun(0), scene.render(shadow='rays', size=(2000, 2000))",
    ],
)
def test_ctrl_c_ends_work(work, adapter):
    child = subprocess.Popen([sys.executable, "-c", INTERRUPTED.format(work=work)], stdout=subprocess.PIPE, text=True)
    assert child.stdout.readline() == "begun\n"
    time.sleep(0.3)
    child.send_signal(signal.SIGINT)
    start = time.monotonic()
    rest = child.communicate(timeout=120)[0]
    # Within a step: a part of a picture, of a table, of exact rows.
    assert time.monotonic() - start < 40
    assert rest.splitlines()[-1] == "interrupted" and child.returncode == 7


def test_what_a_listener_raises_comes_back(scene, adapter):
    def refuse(step):
        raise LookupError(step["what"])

    with pytest.raises(LookupError):
        scene.compare("rays;none", points=10, progress=refuse)
    # The scene is as good as before.
    assert scene.render().shape == (30, 40, 4)


def test_progress_is_told(scene, adapter, capfd):
    heard = []
    rows = scene.compare(["none", "rays"], repeats=1, points=20, rays=5, depths=5, progress=heard.append)
    assert [r["method"] for r in rows] == ["none", "rays"]
    assert [s["done"] for s in heard] == sorted(s["done"] for s in heard) and heard[-1]["total"] >= len(heard)
    scene.compare("none", repeats=1, points=20, rays=5, depths=5, progress=True)
    assert "none" in capfd.readouterr().err


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ({"tff": "bone"}, r"bad argument \(tff\): unknown key"),
        ({"explain": True}, "to the command line alone"),
        ({"size": (0, 5)}, "bad argument .size"),
        ({"size": (5, 5, 5)}, "bad argument .size"),
        ({"light": "dir:0,0,0"}, "bad argument .light"),
        ({"ambient": float("nan")}, "bad argument .ambient"),
        ({"ambient": object()}, "expected a text, a number"),
        ({"tf": {"points": []}}, "bad argument .tf"),
        ({"volume": "phantom:thorax"}, "is there already"),
        ({"crop": "0:1,,"}, "is there already"),
        ({"adapter": "another"}, "a scene for each"),
        ({"light": ["dir:0,0,1"] * 17}, "light"),
    ],
)
def test_arguments_that_mean_nothing_are_refused(scene, arguments, words):
    with pytest.raises(uv.InputError, match=words):
        scene.render(**arguments)


def test_questions_that_mean_nothing_are_refused(scene):
    for points in [[[1, 2]], [[1, 2, np.nan]], "a", 3.0, np.ma.masked_array([[1.0, 2, 3]], True)]:
        with pytest.raises(uv.InputError, match="points"):
            scene.transmittance(points, "exact")
    with pytest.raises(uv.InputError, match="1 starts and 2 ends"):
        scene.optical_depth([[0, 0, 0]], [[0, 0, 0], [1, 1, 1]])
    with pytest.raises(uv.InputError, match="light"):
        scene.transmittance([0, 0, 0], "exact", light=["dir:0,0,1", "dir:0,1,0"])
    for arguments in [{"repeats": 0}, {"check": "some"}, {"methods": "dsmm"}, {"methods": 3}, {"budget": "hours=3"}]:
        with pytest.raises(uv.InputError):
            scene.compare(**{"methods": "none", **arguments})
    with pytest.raises(uv.InputError, match="array"):
        scene.compare("none", output="somewhere")
    with pytest.raises(uv.InputError, match="file"):
        scene.to_toml()
    for none in [np.zeros((0, 3)), []]:
        assert scene.transmittance(none, "exact").shape == (0,)
    for arguments in [{"resume": True}, {"resume": True, "overwrite": True, "output": "somewhere"}]:
        with pytest.raises(uv.InputError, match="resume"):
            scene.compare("none", **arguments)
    points = np.random.default_rng(1).uniform(-9, 9, (2, 4, 3))
    answers = scene.transmittance(points, "exact")
    assert answers.shape == (2, 4)
    np.testing.assert_array_equal(answers.ravel(), scene.transmittance(points.reshape(-1, 3), "exact"))


def test_errors_carry_their_words():
    with pytest.raises(uv.InputError) as caught:
        uv.Scene("phantom:slab:8", tf="bonee")
    e = caught.value
    assert (e.what, e.place) == ("unknown transfer function", "--tf bonee") and "bone" in e.hint
    for same in [pickle.loads(pickle.dumps(e)), copy.copy(e)]:
        assert (str(same), same.hint, type(same)) == (str(e), e.hint, uv.InputError)
    assert issubclass(uv.RunError, RuntimeError) and issubclass(uv.RunError, uv.Error)


def test_lists_of_what_there_is():
    assert {"bone", "ct", "engine"} <= set(uv.presets()) and {"dsm", "rays", "osm"} <= set(uv.methods())
    assert "world mm" in uv.arguments()["eye"]


def test_downsampling_is_a_switch_or_factors():
    whole = uv.read("phantom:thorax:16")
    assert uv.read("phantom:thorax:16", downsample="2x2x2").shape == tuple((n + 1) // 2 for n in whole.shape)
    for off in [False, None, True]:
        assert uv.read("phantom:thorax:16", downsample=off).shape == whole.shape


def test_notebooks_show_the_picture(adapter, scene, tmp_path):
    scene.write(tmp_path / "scene.png")
    assert scene._repr_png_() == (tmp_path / "scene.png").read_bytes()


def test_lights_at_infinity_are_directions(adapter, scene):
    expected = scene.render(light="dir:0.5,0,1")
    for same in [(0.5, 0, 1), np.array([0.5, 0, 1]), [(0.5, 0, 1)], "0.5,0,1"]:
        np.testing.assert_array_equal(scene.render(light=same), expected)
    with pytest.raises(uv.InputError, match="light"):
        scene.render(light=(0, 1))


def test_a_scene_is_shown_by_volume_and_transfer_function():
    voxels, affine = small()
    assert repr(uv.Scene("phantom:slab:8", tf="engine")) == "<Scene phantom:slab:8, tf engine>"
    assert repr(uv.Scene("phantom:thorax:8")).endswith(f", tf {next(iter(uv.presets()))}>")
    assert repr(uv.Scene(voxels, affine, tf=FUNCTION)).endswith(f", tf {FUNCTION['name']}>")
