"""Comparison tables whose rows are measured on the workers of a Dask client."""

from __future__ import annotations

import math
import threading
import time
import uuid
import warnings
from typing import Any

from ._errors import Error, InputError, RunError
from ._umbravox import Scene, Volume, method_specs  # type: ignore

_WHAT = "cannot compare on workers"
#: Arguments that need all rows of a table in one process.
_OF_ONE_PROCESS = "output", "overwrite", "resume", "budget"
#: Serializes the measurements of one process: concurrent ones would disturb each other's times.
_measuring = threading.Lock()


def compare_on(client: Any, scene: tuple[Any, Any, dict[str, Any]], methods: Any, measuring: dict[str, Any]) -> list[dict[str, Any]]:
    """Rows of a table; each is a task on a worker. ``scene`` has the volume, the affine and the arguments of ``Scene``."""
    progress = measuring.pop("progress", None)
    _check(client, scene[0], measuring)
    specs = method_specs(methods)
    # Every worker has a copy, so that the scene survives the end of a worker.
    (data,) = client.scatter([scene], broadcast=True, hash=False)
    options: dict[str, Any] = {"pure": False, "resources": _resources(client)}
    name = f"umbravox-compare-{uuid.uuid4().hex[:8]}"
    futures = [client.submit(_row, data, spec, measuring, key=f"{name}-{i}", **options) for i, spec in enumerate(specs)]
    try:
        rows = _gathered(futures, specs, _listener(progress))
    finally:
        # After an error or Ctrl-C, rows that have not started are not measured.
        client.cancel(futures)
    _check_versions(rows)
    _mark_pareto(rows)
    return rows


def _check(client: Any, volume: Any, measuring: dict[str, Any]) -> None:
    if not (hasattr(client, "scatter") and hasattr(client, "submit")):
        raise InputError(_WHAT, "client", f"expected a dask.distributed.Client, got {type(client).__name__}")
    if getattr(client, "asynchronous", False):
        raise InputError(_WHAT, "client", "it is asynchronous; rows are returned, so a client of a thread is needed")
    if isinstance(volume, Volume):
        why = "a Volume cannot be sent to workers"
        raise InputError(_WHAT, "volume", why, "give the file that all workers see, or the array and its affine")
    for name in _OF_ONE_PROCESS:
        if measuring.get(name):
            raise InputError(_WHAT, name, "it needs all rows in one process", "compare without client")


def _resources(client: Any) -> dict[str, float] | None:
    """One adapter for each row, where workers declare that resource."""
    workers = client.scheduler_info(n_workers=-1)["workers"].values()
    return {"adapter": 1} if any("adapter" in worker.get("resources", {}) for worker in workers) else None


def _row(scene: tuple[Any, Any, dict[str, Any]], method: str, measuring: dict[str, Any]) -> tuple[list[dict[str, Any]], list[str]]:
    """Row of one method, on a worker, with the warnings that the worker would print."""
    volume, affine, arguments = scene
    with _measuring, warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        try:
            rows = Scene(volume, affine, **arguments).compare(method, **measuring)
        except Exception:
            raise
        except BaseException as e:
            # Dask never completes a task that raises a BaseException, such as a panic of the library.
            raise RunError(_WHAT, method, f"{type(e).__name__}: {e}") from e
    return rows, [str(warning.message) for warning in caught]


def _gathered(futures: list[Any], specs: list[str], listener: Any) -> list[dict[str, Any]]:
    from distributed import as_completed  # type: ignore

    places, found, start = {future.key: i for i, future in enumerate(futures)}, {}, time.monotonic()
    shown: set[str] = set()
    listener({"done": 0, "total": len(futures), "what": specs[0], "left_s": None})
    for done, future in enumerate(as_completed(futures), 1):
        i = places[future.key]
        found[i], messages = _result(future, specs[i])
        for text in messages:
            if text not in shown:
                warnings.warn(text, stacklevel=4)
        shown |= set(messages)
        running = [spec for at, spec in enumerate(specs) if at not in found]
        if running:
            left_s = (time.monotonic() - start) / done * len(running)
            listener({"done": done, "total": len(futures), "what": running[0], "left_s": left_s})
    return [row for i in range(len(futures)) for row in found[i]]


def _result(future: Any, spec: str) -> Any:
    try:
        return future.result()
    except Error:
        raise
    except Exception as e:
        lines = str(e).strip().splitlines()
        why = f"{type(e).__name__}: {lines[0]}" if lines else type(e).__name__
        raise RunError(_WHAT, spec, why, "the logs of the workers say more") from e


def _listener(progress: Any) -> Any:
    if progress is True:
        from ._progress import Line

        return Line()
    return progress if callable(progress) else lambda step: None


def _check_versions(rows: list[dict[str, Any]]) -> None:
    versions = sorted({f"{row['version']} ({row['revision']})" for row in rows})
    if len(versions) > 1:
        raise RunError(_WHAT, "client", f"workers have several versions: {', '.join(versions)}")


def _mark_pareto(rows: list[dict[str, Any]]) -> None:
    """Fills the column ``pareto`` as a table does that is measured in one process."""
    place = "scene", "adapter", "width", "height"
    points = [(row["fps_moving"], row["point_err_rms"]) for row in rows]
    valid = [None not in point and not any(map(math.isnan, point)) for point in points]
    for row, (fps, error), counts in zip(rows, points, valid):
        others = [p for p, other, ok in zip(points, rows, valid) if ok and all(row[c] == other[c] for c in place)]
        row["pareto"] = not any(p[0] > fps and p[1] < error for p in others) if counts else None
