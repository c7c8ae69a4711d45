from collections.abc import Callable, Mapping, Sequence
from os import PathLike
from typing import Any, TypedDict, final, type_check_only

import numpy as np
from numpy.typing import ArrayLike, DTypeLike, NDArray
from typing_extensions import Unpack

from ._types import Camera as Camera
from ._types import Cost as Cost
from ._types import Step as Step
from ._widget import Widget as Widget

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

__version__: str

_Path = str | PathLike[str]
_Three = str | Sequence[float] | NDArray[Any]

_Progress = bool | Callable[[Step], object] | None

@type_check_only
class FormatArguments(TypedDict, total=False):
    """Arguments for data that a file lacks."""

    raw: str | None
    spacing: _Three | None
    offset: int | None
    series: int | None
    frame: int | None
    level: int | None
    crop: str | None
    downsample: bool | str | None
    host_memory: str | None
    scratch: _Path | None
    thickness: float | str | None
    resolution: int | str | None
    kernel: str | None
    sha256: str | None

@type_check_only
class ReadArguments(FormatArguments, total=False):
    """Arguments about reading a file."""

    labels: _Path | None

@type_check_only
class SceneArguments(TypedDict, total=False):
    """Arguments about the picture: transfer function, camera, lights, method."""

    clip: str | Sequence[str] | ArrayLike | None
    hide: str | int | Sequence[int] | NDArray[Any] | None
    label_tf: str | Sequence[str] | Mapping[int, _Path] | Mapping[str, _Path] | None
    name: str | None
    tf: _Path | dict[str, Any] | None
    opacity_scale: float | str | None
    gradient_opacity: str | None
    units: str | None
    shadow: str | None
    size: str | Sequence[int] | NDArray[Any] | None
    eye: _Three | None
    target: _Three | None
    up: _Three | None
    view: str | None
    zoom: float | str | None
    fov: float | None
    light: str | _Three | Sequence[str | _Three] | None
    mesh: _Path | Sequence[_Path] | None
    strands: _Path | Sequence[_Path] | None
    ambient: float | None
    ambient_occlusion: float | str | None
    shading: str | None
    phase: float | None
    background: str | None
    step: float | None
    skip: str | None
    no_skip: str | None
    adapter: str | None
    device_memory: str | None

@type_check_only
class SceneAndReadArguments(SceneArguments, FormatArguments, total=False):
    """Arguments of a scene that reads its volume from a file."""

    labels: ArrayLike | _Path | None

@type_check_only
class CompareArguments(SceneAndReadArguments, total=False):
    """Arguments of a scene and of the measurement of its methods."""

    output: _Path | None
    repeats: int | None
    points: int | None
    rays: int | None
    depths: int | None
    check: str
    flicker: int | None
    budget: str | Sequence[str] | None
    overwrite: bool
    resume: bool
    progress: _Progress

@type_check_only
class FileArguments(SceneAndReadArguments, total=False):
    """Arguments that a scene file may contain."""

    volume: _Path | None

class Error(Exception):
    what: str
    place: str
    why: str
    hint: str | None
    def __init__(self, what: str, place: str, why: str, hint: str | None = None) -> None: ...

class InputError(Error, ValueError): ...
class RunError(Error, RuntimeError): ...

@final
class Volume:
    """A scalar field on a regular grid, with an affine to world millimetres (RAS+).

    ``voxels`` has the axes i, j, k, as nibabel's arrays do and as the affine counts them; ``axes="kji"`` says that the first
    axis is the slowest, as in SimpleITK's arrays and in .npy files that this program reads. Integers of 32 and 64 bits become
    float64; NaN and infinities the smallest finite value, with a warning. Images of nibabel, SimpleITK, ITK, VTK and PyVista,
    arrays of xarray, layers of napari and Zarr groups of OME-Zarr images bring their affine along. ``labels`` is a
    segmentation: an array of the same grid, or an image or a file of any.
    """

    def __new__(
        cls,
        voxels: ArrayLike,
        affine: ArrayLike | None = None,
        *,
        spacing: _Three | None = None,
        labels: ArrayLike | _Path | None = None,
        axes: str | None = None,
        name: str | None = None,
    ) -> Volume: ...
    def __array__(self, dtype: DTypeLike | None = None, copy: bool | None = None) -> NDArray[Any]: ...
    @property
    def shape(self) -> tuple[int, int, int]:
        """Voxels along the axes i, j and k."""
    @property
    def affine(self) -> NDArray[np.float64]:
        """World mm (RAS+) from index coordinates, 4 x 4."""
    @property
    def spacing(self) -> tuple[float, float, float]:
        """Distance between voxel centres along i, j and k, mm."""
    @property
    def value_range(self) -> tuple[float, float]:
        """Smallest and largest value."""
    @property
    def name(self) -> str:
        """File, or name of the array."""
    @property
    def notes(self) -> list[str]:
        """Assumptions made while reading, one line each."""
    @property
    def labels(self) -> list[int]:
        """Labels of the voxels; empty without a segmentation."""
    def voxels(self) -> NDArray[Any]:
        """Copy of the values, axes i, j, k: in the stored type without scaling, else float64."""
    def save(self, path: _Path) -> None:
        """Writes the volume like ``umbravox convert``: .nii, .nii.gz, .nrrd, .mha, .vti, .npy or .raw."""

@final
class Scene:
    """A volume with scene settings; every argument has the name of a flag of the command line.

    Methods take the same arguments, for that call alone. ``None`` counts as absent; an empty list removes the values of the
    scene (``clip=[]``). ``view`` replaces the scene's eye, target and up. Data on the device are reused: a new camera costs a
    picture (and a map, unless the method has ``fit=volume`` and a fixed size), a new light its map. No result depends on
    earlier calls.
    """

    def __new__(
        cls,
        volume: Volume | ArrayLike | _Path | None = None,
        affine: ArrayLike | None = None,
        *,
        axes: str | None = None,
        **arguments: Unpack[SceneAndReadArguments],
    ) -> Scene: ...
    @staticmethod
    def read(path: _Path, **arguments: Unpack[FileArguments]) -> Scene:
        """Scene of a TOML file; arguments replace its settings."""
    @property
    def volume(self) -> Volume:
        """Volume of the scene."""
    @property
    def notes(self) -> list[str]:
        """Assumptions, one line each."""
    @property
    def last(self) -> Cost | None:
        """Cost of the last picture: milliseconds, bytes, and skipped work."""
    def render(self, **arguments: Unpack[SceneArguments]) -> NDArray[np.float32]:
        """Renders a picture, height x width x 4: linear RGB over the background, and opacity."""
    def write(self, path: _Path, **arguments: Unpack[SceneArguments]) -> None:
        """Renders a picture to a file (.png, .exr, .npy) like ``umbravox render``."""
    def _repr_png_(self) -> bytes:
        """Picture of the scene as a PNG file, which notebooks show."""
    def png(self, **arguments: Unpack[SceneArguments]) -> bytes:
        """Renders a picture to the bytes of a PNG file, over the background."""
    def exact_picture(
        self, *, progress: _Progress = None, **arguments: Unpack[SceneArguments]
    ) -> NDArray[np.float32]:
        """Renders the exact reference picture, which takes minutes at large sizes."""
    def transmittance(
        self, points: ArrayLike, method: str | None = None, **arguments: Unpack[SceneArguments]
    ) -> NDArray[np.floating[Any]]:
        """Transmittance from the light to points in world mm by the scene's method, another one, or ``"exact"``.

        The last axis of ``points`` is x, y and z, and the answer has the shape of the rest; float32 by a method, float64 exactly.
        """
    def optical_depth(
        self, starts: ArrayLike, ends: ArrayLike, **arguments: Unpack[SceneArguments]
    ) -> NDArray[np.float64]:
        """Exact optical depth of segments between points in world mm, as many starts as ends."""
    def compare(
        self,
        methods: str | Sequence[str] | None = None,
        *,
        output: _Path | None = None,
        repeats: int | None = None,
        points: int | None = None,
        rays: int | None = None,
        depths: int | None = None,
        check: str = "sample",
        flicker: int | None = None,
        budget: str | Sequence[str] | None = None,
        overwrite: bool = False,
        resume: bool = False,
        progress: _Progress = None,
        **arguments: Unpack[SceneArguments],
    ) -> list[dict[str, Any]]:
        """Rows of the error-against-time table: the columns of ``compare.csv``, ``None`` for empty cells.

        With ``output``, a folder, all the files of ``umbravox compare`` are written as well. ``progress`` is called with a
        :class:`Step`, or is ``True`` for a line on stderr.
        """
    def camera(self, **arguments: Unpack[SceneArguments]) -> Camera:
        """Camera of the arguments, as arguments."""
    def settings(self, **arguments: Unpack[SceneArguments]) -> dict[str, Any]:
        """All settings as arguments, defaults included; those about reading the volume are absent."""
    def transfer_function(self, **arguments: Unpack[SceneArguments]) -> dict[str, Any]:
        """Transfer function, adapted to the volume, as a dictionary in the form of a transfer-function file."""
    def copy(self, **arguments: Unpack[SceneArguments]) -> Scene:
        """Scene of the same volume; arguments replace settings."""
    def to_toml(self, **arguments: Unpack[SceneArguments]) -> str:
        """Text of a scene file with the same settings, defaults included."""

def read(path: _Path, **arguments: Unpack[ReadArguments]) -> Volume:
    """Reads a volume; arguments are the flags of the command line."""

def render(
    volume: Volume | ArrayLike | _Path | None = None,
    affine: ArrayLike | None = None,
    *,
    axes: str | None = None,
    **arguments: Unpack[SceneAndReadArguments],
) -> NDArray[np.float32]:
    """Renders a volume: ``Scene(volume, affine, **arguments).render()``."""

def transmittance(
    volume: Volume | ArrayLike | _Path | None,
    points: ArrayLike,
    method: str | None = None,
    affine: ArrayLike | None = None,
    *,
    axes: str | None = None,
    **arguments: Unpack[SceneAndReadArguments],
) -> NDArray[np.floating[Any]]:
    """Transmittance from the light to points: ``Scene(volume, affine, ...).transmittance(points, method)``."""

def compare(
    volume: Volume | ArrayLike | _Path | None = None,
    methods: str | Sequence[str] | None = None,
    affine: ArrayLike | None = None,
    *,
    axes: str | None = None,
    client: Any = None,
    **arguments: Unpack[CompareArguments],
) -> list[dict[str, Any]]:
    """Rows of a comparison table: ``Scene(volume, affine, ...).compare(methods, ...)``.

    With ``client``, a Dask client, each method is measured on a worker.
    """

def arguments() -> dict[str, str]:
    """Arguments of a scene, with their help."""

def methods() -> dict[str, str]:
    """Names of the shadow methods, with descriptions."""

def presets() -> dict[str, str]:
    """Names of the built-in transfer functions, with descriptions."""

def srgb8(picture: ArrayLike) -> NDArray[np.uint8]:
    """Converts a picture to 8-bit sRGB, height x width x 3."""

def write_picture(path: _Path, picture: ArrayLike, *, transparent: bool = False) -> None:
    """Writes a picture (height x width x 4) by its file extension: .png, .exr or .npy."""
