"""Volumetric shadows for CT volumes, each method with its error against an exact answer.

A scene is a volume with settings: transfer function, camera, lights, shadow method. Its arguments have the names of the
command line's flags, with ``_`` for ``-``, and mean the same (``arguments()`` lists them)::

    import umbravox as uv

    scene = uv.Scene("ct.nii.gz", tf="bone", light="dir:0,1,1", shadow="dsm:epsilon=0.01")
    picture = scene.render(size=(640, 480))                  # height x width x 4, linear RGB and opacity
    transmitted = scene.transmittance(points)                # by the scene's method, points n x 3 in world mm
    exact = scene.transmittance(points, "exact")             # float64, cell by cell
    rows = scene.compare("rays;dsm:epsilon=0.06,0.02")       # a dictionary each, for pandas.DataFrame

Volumes are files, or arrays with an affine from index coordinates (i, j, k) to world mm (RAS+)::

    scene = uv.Scene(array, affine, units="hu")

``Widget(scene)`` shows a scene in a notebook, to turn it, move its light and edit its opacity (needs ``anywidget``).

Lengths are world millimetres, extinction is 1/mm, optical depth its line integral, transmittance ``exp(-optical depth)``.
"""

from ._errors import Error, InputError, RunError
from ._umbravox import Scene, Volume, __version__, arguments, methods, presets, read, write_picture
from ._types import Camera, Cost, Step

__all__ = [
    "Camera",
    "Cost",
    "Error",
    "InputError",
    "RunError",
    "Scene",
    "Step",
    "Volume",
    "__version__",
    "arguments",
    "compare",
    "methods",
    "presets",
    "read",
    "render",
    "srgb8",
    "transmittance",
    "write_picture",
]


def render(volume=None, affine=None, *, axes=None, **arguments):
    """Renders a volume: ``Scene(volume, affine, **arguments).render()``.

    >>> picture = umbravox.render("ct.nii.gz", tf="bone", light="dir:0,1,1", size=(640, 480))
    """
    return Scene(volume, affine, axes=axes, **arguments).render()


def transmittance(volume, points, method=None, affine=None, *, axes=None, **arguments):
    """Transmittance from the light to points: ``Scene(volume, affine, ...).transmittance(points, method)``.

    >>> transmitted = umbravox.transmittance("ct.nii.gz", [[10, -20, 5]], "exact", tf="bone")
    """
    return Scene(volume, affine, axes=axes, **arguments).transmittance(points, method)


#: Arguments of ``Scene.compare``, with their defaults.
_MEASURING = {
    **dict.fromkeys(("output", "repeats", "points", "rays", "depths", "flicker", "budget", "progress")),
    "check": "sample",
    "overwrite": False,
    "resume": False,
}


def compare(volume=None, methods=None, affine=None, *, axes=None, client=None, **arguments):
    """Rows of a comparison table: ``Scene(volume, affine, ...).compare(methods, ...)``.

    With ``client``, a Dask client, each method is measured on a worker.

    >>> rows = umbravox.compare("ct.nii.gz", "rays;dsm:epsilon=0.06,0.02", tf="bone", output="table")
    """
    arguments["axes"] = axes
    measuring = {name: arguments.pop(name) for name in _MEASURING if name in arguments}
    if client is not None:
        from ._cluster import compare_on

        return compare_on(client, (volume, affine, arguments), methods, measuring)
    return Scene(volume, affine, **arguments).compare(methods, **measuring)


def srgb8(picture):
    """Converts a picture to 8-bit sRGB, height x width x 3, like its PNG file, for ``matplotlib``."""
    import numpy as np

    picture = np.asarray(picture, np.float64)
    if picture.ndim != 3 or picture.shape[2] not in (3, 4):
        raise InputError("cannot show picture", "picture", f"its shape is {picture.shape}; expected height x width x 4")
    linear = np.clip(picture[..., :3], 0.0, 1.0)
    codes = np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055)
    return np.round(255.0 * codes).astype(np.uint8)


def _with_keywords(function, defaults={}):
    """Adds the names of ``arguments()`` and others to the signature of a function, for ``help`` and Tab."""
    import inspect

    signature = inspect.signature(function)
    *given, others = signature.parameters.values()
    new = [(name, defaults.get(name)) for name in (*defaults, *arguments()) if name not in signature.parameters]
    keywords = [inspect.Parameter(name, inspect.Parameter.KEYWORD_ONLY, default=default) for name, default in new]
    function.__signature__ = signature.replace(parameters=[*given, *keywords, others])


_with_keywords(Scene)
_with_keywords(render)
_with_keywords(transmittance)
_with_keywords(compare, _MEASURING)


def __getattr__(name):
    # Imported when it is used, because anywidget is optional.
    if name == "Widget":
        from ._widget import Widget

        return Widget
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
