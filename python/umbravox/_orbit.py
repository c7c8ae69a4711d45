"""Camera of the widget: a position on a sphere around the target, by azimuth, elevation and a factor of the distance."""

from __future__ import annotations

from typing import Any

import numpy as np

#: Largest elevation, degrees: at 90 the camera would look along its up direction.
MAX_ELEVATION_DEG = 89.0


class Orbit:
    """Orbit around the target of a scene's camera, about the up direction of that camera.

    Azimuth 0 is the front of the patient (+y), and 90 the patient's left side (-x), where the up direction is +z.
    """

    def __init__(self, camera: Any) -> None:
        self.camera = camera
        self.target = np.array(camera["target"], float)
        offset = np.array(camera["eye"], float) - self.target
        self.distance_mm = float(np.linalg.norm(offset))
        #: Rows: directions of azimuth 0, of azimuth 90, and up.
        self.axes = _axes(np.array(camera["up"], float))
        x, y, z = self.axes @ (offset / self.distance_mm)
        self.azimuth_deg = float(np.degrees(np.arctan2(y, x)))
        elevation = float(np.degrees(np.arcsin(np.clip(z, -1.0, 1.0))))
        self.elevation_deg = float(np.clip(elevation, -MAX_ELEVATION_DEG, MAX_ELEVATION_DEG))

    def arguments(self, azimuth_deg: float, elevation_deg: float, distance: float) -> dict[str, Any]:
        """Camera as arguments of a scene; ``distance`` is a factor of the distance of the scene's own camera."""
        azimuth, elevation = np.radians([azimuth_deg, elevation_deg])
        across = np.cos(elevation) * np.array([np.cos(azimuth), np.sin(azimuth)])
        away = np.array([*across, np.sin(elevation)]) @ self.axes
        eye = self.target + distance * self.distance_mm * away
        return {**self.camera, "eye": tuple(eye.tolist())}


def _axes(up: Any) -> Any:
    up = up / np.linalg.norm(up)
    front = np.array([0.0, 1.0, 0.0])
    if abs(up @ front) > 0.99:
        front = np.array([0.0, 0.0, 1.0])
    front = front - (front @ up) * up
    front /= np.linalg.norm(front)
    return np.array([front, np.cross(up, front), up])
