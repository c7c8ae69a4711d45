"""Types of the dictionaries that the module takes and returns."""

from __future__ import annotations

from typing import TypedDict


class Step(TypedDict):
    """Step that begins, as passed to ``progress``, and an estimate of the seconds left."""

    done: int
    total: int
    what: str
    left_s: float | None


class Camera(TypedDict):
    """Camera as arguments of a scene; ``fov`` includes the zoom."""

    eye: tuple[float, float, float]
    target: tuple[float, float, float]
    up: tuple[float, float, float]
    fov: float
    zoom: float


class Cost(TypedDict):
    """Time and memory of a picture; the time of a reused table or map is ``None``."""

    adapter: str
    clock: str
    table_ms: float | None
    classify_ms: float | None
    build_ms: float | None
    frame_ms: float
    bytes: int
    left_out: list[str]
