"""Tables whose rows are measured by workers of Dask, in processes of their own."""

import os
import signal
import threading
import time

import numpy as np
import pytest
from conftest import FUNCTION, small

import umbravox as uv

METHODS = "rays;dsm:map=32,epsilon=0.06,0.02;osm:map=32,layers=8"
EFFORT = {"repeats": 1, "points": 100, "rays": 10, "depths": 5}


class KillsItsProcess:
    """An array whose reader ends the process, as a worker ends that has too little memory."""

    def __array__(self, dtype=None, copy=None):
        os._exit(1)


class CannotBeRead:
    def __array__(self, dtype=None, copy=None):
        raise OSError("the disk is gone\nand more lines")


@pytest.fixture(scope="module")
def client(adapter):
    distributed = pytest.importorskip("distributed")
    kinds = {"n_workers": 2, "threads_per_worker": 2, "host": "127.0.0.1", "dashboard_address": None}
    with distributed.LocalCluster(processes=True, **kinds) as cluster, distributed.Client(cluster) as client:
        # The classes of this file are those of a module that workers do not have.
        distributed.protocol.pickle.cloudpickle.register_pickle_by_value(__import__(__name__))
        yield client


def scene():
    voxels, affine = small()
    return {"volume": voxels, "affine": affine, "tf": FUNCTION, "size": (24, 18), "light": "dir:0.3,0.5,0.8"}


def is_time(column):
    about_times = ("_ms", "_ms_min", "_ms_max", "_ms_lo", "_ms_hi", "_mhz", "fps_", "pareto")
    return any(word in column for word in about_times)


def test_rows_of_workers_are_those_of_one_process(client):
    steps = []
    rows = uv.compare(methods=METHODS, client=client, progress=steps.append, **scene(), **EFFORT)
    alone = uv.compare(methods=METHODS, **scene(), **EFFORT)
    assert [row["method"] for row in rows] == ["rays", "dsm", "dsm", "osm"]
    for ours, theirs in zip(rows, alone, strict=True):
        assert list(ours) == list(theirs)
        differing = {column for column in ours if ours[column] != theirs[column] and not is_time(column)}
        assert not differing, {column: (ours[column], theirs[column]) for column in differing}
        assert ours["frame_ms"] > 0
    # The Pareto front is that of all rows: none of these is both slower and less accurate than another.
    for row in rows:
        beaten = any(o["fps_moving"] > row["fps_moving"] and o["point_err_rms"] < row["point_err_rms"] for o in rows)
        assert row["pareto"] is not beaten
    assert [step["done"] for step in steps] == [0, 1, 2, 3] and steps[0]["total"] == 4


def test_rows_are_tasks_on_both_workers(client):
    uv.compare(methods=METHODS, client=client, **scene(), **EFFORT)
    log = client.run(lambda dask_worker: sum("umbravox-compare" in str(entry) for entry in dask_worker.state.log))
    assert len(log) == 2 and all(log.values())


def test_warnings_of_workers_come_to_the_caller(client):
    voxels, affine = small()
    with pytest.warns(UserWarning, match="units="):
        uv.compare(voxels, "none;rays", affine, client=client, size=(8, 8), **EFFORT)


def test_errors_of_workers_are_one_line(client):
    with pytest.raises(uv.InputError, match="no_such.nii") as caught:
        uv.compare("no_such.nii", "none", client=client)
    assert "\n" not in str(caught.value).split("\nhint:")[0]
    with pytest.raises(uv.Error, match="the disk is gone") as caught:
        uv.compare(CannotBeRead(), "none", np.eye(4), client=client)
    assert "\n" not in caught.value.why


def test_a_worker_that_ends_is_an_error_of_one_line(client):
    with pytest.raises(uv.RunError, match="none") as caught:
        uv.compare(KillsItsProcess(), "none", np.eye(4), client=client)
    assert "\n" not in caught.value.why and caught.value.what == "cannot compare on workers"
    client.wait_for_workers(2, timeout=60)
    assert len(uv.compare(methods="none", client=client, **scene(), **EFFORT)) == 1


def test_an_interrupt_ends_the_table_and_its_rows(client):
    # A program that is started in the background inherits a handler that ignores the signal.
    before = signal.signal(signal.SIGINT, signal.default_int_handler)

    def interrupt(step):
        if step["done"] == 1:
            threading.Timer(0.05, os.kill, (os.getpid(), signal.SIGINT)).start()

    # Enough rows that most of them wait when the interrupt comes.
    methods = "dsm:map=" + ",".join(str(side) for side in range(32, 232, 2))
    try:
        with pytest.raises(KeyboardInterrupt):
            uv.compare(methods=methods, client=client, progress=interrupt, **scene(), **EFFORT)
    finally:
        signal.signal(signal.SIGINT, before)

    def rows(dask_scheduler):
        return [key for key in dask_scheduler.tasks if str(key).startswith("umbravox-compare")]

    deadline = time.monotonic() + 60
    while client.run_on_scheduler(rows):
        assert time.monotonic() < deadline, client.run_on_scheduler(rows)
        time.sleep(0.1)
    assert len(uv.compare(methods="none", client=client, **scene(), **EFFORT)) == 1


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ({"methods": "dsmm"}, "dsmm"),
        ({"budget": "bytes=1MB"}, "budget.*one process"),
        ({"output": "somewhere"}, "output.*one process"),
        ({"volume": uv.Volume(np.zeros((2, 2, 2), np.uint8))}, "cannot be sent"),
        ({"client": "tcp://127.0.0.1"}, "expected a dask.distributed.Client, got str"),
    ],
)
def test_what_workers_cannot_do_is_refused(client, arguments, words):
    volume = arguments.pop("volume", "phantom:slab:8")
    with pytest.raises(uv.InputError, match=words):
        uv.compare(volume, **{"methods": "none", "client": client, **arguments})
