"""Texts of lights, such as ``dir:0,1,1,color=#ff8040``, and lights in another direction."""

from __future__ import annotations

from typing import Any

import numpy as np

_AT_A_POINT = ("point", "disc")


def direction_of(light: str, target: Any) -> Any:
    """Unit vector from the target of the camera towards a light."""
    kind, place, _ = _parts(light)
    toward = place - target if kind in _AT_A_POINT else place
    length = np.linalg.norm(toward)
    return toward / length if length > 0 else np.array([0.0, 0.0, 1.0])


def turned(light: str, target: Any, toward: Any) -> str:
    """The light in another direction from the target; one at a point keeps its distance, and a sky stays."""
    kind, place, factors = _parts(light)
    toward = np.array(toward, float)
    if kind == "sky":
        return light
    if kind in _AT_A_POINT:
        toward = target + np.linalg.norm(place - target) * toward / np.linalg.norm(toward)
    return ",".join([f"{kind}:{float(toward[0])!r}", *(repr(float(x)) for x in toward[1:]), *factors])


def _parts(light: str) -> tuple[str, Any, list[str]]:
    if light.split(",")[0] == "sky" or light.startswith("sky:"):
        return "sky", np.array([0.0, 0.0, 1.0]), []
    kind, rest = light.split(":", 1)
    words = rest.split(",")
    return kind, np.array([float(word) for word in words[:3]]), words[3:]
