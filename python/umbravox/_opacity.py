"""Opacity points of a transfer function, apart from its colours."""

from __future__ import annotations

from typing import Any

import numpy as np


def quantity_of(function: dict[str, Any]) -> str:
    """Quantity of the points: ``opacity`` or ``extinction``."""
    return "extinction" if "extinction" in function["points"][0] else "opacity"


def opacity_points(function: dict[str, Any]) -> list[list[float]]:
    """Pairs of value and opacity (or extinction, 1/mm)."""
    quantity = quantity_of(function)
    return [[float(p["value"]), float(p[quantity])] for p in function["points"]]


def with_opacity(function: dict[str, Any], points: Any) -> dict[str, Any]:
    """Transfer function with other opacity points and the same colours.

    It has a point wherever the opacity or the colour has one, so that both stay linear in between.
    """
    quantity = quantity_of(function)
    colors = [(float(p["value"]), _linear(p.get("color", "#ffffff"))) for p in function["points"]]
    amounts = [(float(value), np.array([float(amount)])) for value, amount in points]
    merged = []
    for value in sorted({value for value, _ in [*colors, *amounts]}):
        sides = list(zip(_limits(amounts, value), _limits(colors, value)))
        if all(np.array_equal(left, right) for left, right in zip(*sides)):
            sides = sides[:1]
        merged += [{"value": value, quantity: float(a[0]), "color": _hex(c)} for a, c in sides]
    return {**function, "points": merged}


def _limits(knots: list[tuple[float, Any]], value: float) -> tuple[Any, Any]:
    """Limits from below and from above at a value; they differ at a jump, which is two knots of one value."""
    here = [number for at, number in knots if at == value]
    if here:
        return here[0], here[-1]
    below = [knot for knot in knots if knot[0] < value]
    above = [knot for knot in knots if knot[0] > value]
    if not below or not above:
        end = above[0][1] if above else below[-1][1]
        return end, end
    (start, first), (end, last) = below[-1], above[0]
    between = first + (last - first) * ((value - start) / (end - start))
    return between, between


def _linear(color: str) -> Any:
    codes = np.array([int(color[i : i + 2], 16) for i in (1, 3, 5)]) / 255.0
    return np.where(codes <= 0.04045, codes / 12.92, ((codes + 0.055) / 1.055) ** 2.4)


def _hex(linear: Any) -> str:
    codes = np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055)
    return "#" + "".join(f"{round(255.0 * float(code)):02x}" for code in codes)
