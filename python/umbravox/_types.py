"""What dictionaries of the module hold."""

from __future__ import annotations

from typing import TypedDict


class Step(TypedDict):
    """What ``progress`` hears of: a step that begins, and seconds that are left of all, where that is known."""

    done: int
    total: int
    what: str
    left_s: float | None


class Camera(TypedDict):
    """A camera, as arguments of a scene; what was zoomed is in ``fov``."""

    eye: tuple[float, float, float]
    target: tuple[float, float, float]
    up: tuple[float, float, float]
    fov: float
    zoom: float


class Cost(TypedDict):
    """What a picture took; tables and maps that were kept are ``None``."""

    adapter: str
    clock: str
    table_ms: float | None
    classify_ms: float | None
    build_ms: float | None
    frame_ms: float
    bytes: int
    left_out: list[str]
