from typing import Any

from traitlets import Float, HasTraits, List  # type: ignore

from . import Scene

class Widget(HasTraits):
    """View of a scene in a notebook: drag turns, the wheel zooms, Shift and drag moves the first light.

    The state can be read and set from Python. ``arguments()`` returns it as arguments of a scene, and ``scene`` as a scene.
    """

    azimuth_deg: Float[float, float]
    elevation_deg: Float[float, float]
    distance: Float[float, float]
    light_direction: List[float]
    opacity_points: List[Any]

    def __init__(self, scene: Scene) -> None: ...
    @property
    def scene(self) -> Scene:
        """Scene in the state of the widget."""
    def arguments(self) -> dict[str, Any]:
        """State as arguments of the scene: what differs from the scene that the widget was made of."""
