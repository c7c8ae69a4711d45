"""Notebook widget that turns, zooms and lights a volume, and edits its opacity. Pictures come from the kernel as PNG."""

from __future__ import annotations

import math
import time
from pathlib import Path
from typing import Any

import numpy as np

try:
    import anywidget  # type: ignore
    import traitlets  # type: ignore
except ImportError:
    raise ImportError("umbravox.Widget needs anywidget: pip install 'umbravox[widget]' or pip install anywidget") from None

from ._errors import Error
from ._lights import direction_of, turned
from ._opacity import opacity_points, quantity_of, with_opacity
from ._orbit import MAX_ELEVATION_DEG, Orbit

_HERE = Path(__file__).parent
#: Smallest and largest factor of the distance of the scene's own camera.
_DISTANCES = 0.05, 20.0
#: Share of the width and of the height that a picture has while something is dragged, and the share where the full picture
#: takes longer than this time, s.
_DRAGGED, _DRAGGED_SLOW, _SLOW_S = 0.5, 0.25, 0.5
#: Bars of the histogram, and the largest volume that has one: it needs a copy of the voxels.
_BARS, _MOST_VOXELS = 96, 1 << 27


class Widget(anywidget.AnyWidget):
    """View of a scene in a notebook: drag turns, the wheel zooms, Shift and drag moves the first light.

    The state can be read and set from Python. ``arguments()`` returns it as arguments of a scene, and ``scene`` as a scene.
    """

    _esm = _HERE / "widget.js"
    _css = _HERE / "widget.css"

    azimuth_deg = traitlets.Float(help="Angle of the camera about its up direction, degrees.").tag(sync=True)
    elevation_deg = traitlets.Float(help="Angle of the camera above the plane across that, degrees.").tag(sync=True)
    distance = traitlets.Float(1.0, help="Distance of the camera from its target, in those of the scene's camera.").tag(sync=True)
    light_direction = traitlets.List(traitlets.Float(), minlen=3, maxlen=3, help="Unit vector towards the first light.").tag(
        sync=True
    )
    opacity_points = traitlets.List(help="Pairs of value and opacity (or extinction, 1/mm).").tag(sync=True)

    _home = traitlets.Dict().tag(sync=True)
    _axes = traitlets.List().tag(sync=True)
    _size = traitlets.List().tag(sync=True)
    _editor = traitlets.Dict().tag(sync=True)
    _request = traitlets.Dict().tag(sync=True)
    _picture = traitlets.Bytes().tag(sync=True)
    _answer = traitlets.Dict().tag(sync=True)
    _error = traitlets.Unicode().tag(sync=True)

    _STATE = "azimuth_deg", "elevation_deg", "distance", "light_direction", "opacity_points"

    def __init__(self, scene: Any) -> None:
        settings = scene.settings()
        self._base = scene
        self._orbit = Orbit(scene.camera())
        lights = settings["light"]
        self._lights = [lights] if isinstance(lights, str) else lights
        # The editor has the function of the scene before this factor, which stays an argument.
        self._scale = {"opacity_scale": settings["opacity_scale"]} if "opacity_scale" in settings else {}
        self._function = scene.transfer_function(**({"opacity_scale": 1.0} if self._scale else {}))
        self._of_page, self._full_s = False, 0.0
        home = {
            "azimuth_deg": self._orbit.azimuth_deg,
            "elevation_deg": self._orbit.elevation_deg,
            "distance": 1.0,
            "light_direction": direction_of(self._lights[0], self._orbit.target).tolist(),
            "opacity_points": opacity_points(self._function),
        }
        size = [int(side) for side in settings["size"].split("x")]
        hidden = {"_home": home, "_axes": self._orbit.axes.tolist(), "_size": size, "_editor": self._editor_of(scene)}
        super().__init__(**home, **hidden)
        self.observe(self._changed, names=list(self._STATE))

    @property
    def scene(self) -> Any:
        """Scene in the state of the widget."""
        return self._base.copy(**self.arguments())

    def arguments(self) -> dict[str, Any]:
        """State as arguments of the scene: what differs from the scene that the widget was made of."""
        changed = {name for name in self._STATE if getattr(self, name) != self._home[name]}
        arguments: dict[str, Any] = {}
        if changed & {"azimuth_deg", "elevation_deg", "distance"}:
            arguments |= self._orbit.arguments(self.azimuth_deg, self.elevation_deg, self.distance)
        if "light_direction" in changed:
            first = turned(self._lights[0], self._orbit.target, self.light_direction)
            arguments["light"] = [first, *self._lights[1:]]
        if "opacity_points" in changed:
            arguments |= {"tf": with_opacity(self._function, self.opacity_points), **self._scale}
        return arguments

    def set_state(self, sync_data: Any) -> None:
        """Takes over the state of a page, and draws the picture that the page requests."""
        # Of the hidden names, a page sets its request alone.
        hidden = "_home", "_axes", "_size", "_editor", "_picture", "_answer", "_error"
        given = {name: value for name, value in sync_data.items() if name not in hidden}
        self._of_page, error = True, ""
        try:
            super().set_state(given)
        except traitlets.TraitError as e:
            error = str(e)
        finally:
            self._of_page = False
        request = given.get("_request")
        if not isinstance(request, dict):
            return
        if error:
            # A page waits for the answer.
            with self.hold_sync():
                self._error, self._answer = error, {"id": request.get("id")}
        else:
            self._draw(request)

    def _changed(self, _change: Any) -> None:
        # A change by a page comes with a request, of all that it changes.
        if not self._of_page:
            self._draw({"id": "", "drag": False})

    def _draw(self, request: dict[str, Any]) -> None:
        drag = bool(request.get("drag"))
        factor = (_DRAGGED_SLOW if self._full_s > _SLOW_S else _DRAGGED) if drag else 1.0
        size = [max(1, round(factor * side)) for side in self._size]
        error, start = "interrupted", time.monotonic()
        try:
            picture = self._base.png(**self.arguments(), size=size)
            error = ""
            self._full_s = self._full_s if drag else time.monotonic() - start
        except Error as e:
            error = str(e)
        finally:
            # A page waits for the answer, also where Ctrl-C ends the picture.
            with self.hold_sync():
                self._error = error
                if not error:
                    self._picture = picture
                self._answer = {**request, "size": size}

    def _editor_of(self, scene: Any) -> dict[str, Any]:
        """Axes of the editor of opacity: range of values, histogram, quantity and colours."""
        volume, points = scene.volume, opacity_points(self._function)
        low, high = volume.value_range
        low, high = min(low, points[0][0]), max(high, points[-1][0])
        if not low < high:
            low, high = low - 0.5, high + 0.5
        counts = [0.0]
        if math.prod(volume.shape) <= _MOST_VOXELS:
            found = np.histogram(np.asarray(volume, np.float32), _BARS, (low, high))[0]
            counts = (np.log1p(found) / np.log1p(found.max())).tolist()
        per = f"opacity per {self._function['reference_length_mm']:g} mm"
        quantity = per if quantity_of(self._function) == "opacity" else "extinction, 1/mm"
        colors = [[float(p["value"]), p.get("color", "#ffffff")] for p in self._function["points"]]
        return {"range": [low, high], "histogram": counts, "quantity": quantity, "colors": colors}

    @traitlets.validate("elevation_deg")
    def _valid_elevation(self, proposal: Any) -> float:
        return float(np.clip(_finite(proposal), -MAX_ELEVATION_DEG, MAX_ELEVATION_DEG))

    @traitlets.validate("azimuth_deg")
    def _valid_azimuth(self, proposal: Any) -> float:
        return _finite(proposal)

    @traitlets.validate("distance")
    def _valid_distance(self, proposal: Any) -> float:
        return float(np.clip(_finite(proposal), *_DISTANCES))

    @traitlets.validate("light_direction")
    def _valid_light(self, proposal: Any) -> list[float]:
        length = math.hypot(*proposal["value"])
        if not (math.isfinite(length) and length > 0):
            raise traitlets.TraitError("light_direction needs three finite numbers that are not all 0")
        # A page sends unit vectors, whose last digits would go back and forth.
        return proposal["value"] if abs(length - 1) < 1e-6 else [x / length for x in proposal["value"]]

    @traitlets.validate("opacity_points")
    def _valid_points(self, proposal: Any) -> list[list[float]]:
        try:
            points = [[float(value), float(amount)] for value, amount in proposal["value"]]
        except (TypeError, ValueError):
            raise traitlets.TraitError("opacity_points needs pairs of value and opacity") from None
        most = 1.0 if quantity_of(self._function) == "opacity" else math.inf
        if not points or any(not (math.isfinite(v) and 0 <= a <= most and math.isfinite(a)) for v, a in points):
            raise traitlets.TraitError(f"opacity_points needs finite values, and amounts from 0 to {most:g}")
        return sorted(points, key=lambda point: point[0])


def _finite(proposal: Any) -> float:
    if not math.isfinite(proposal["value"]):
        raise traitlets.TraitError(f"{proposal['trait'].name} needs a finite number")
    return float(proposal["value"])
