"""Images of other packages as an array with axes i, j, k and an affine to world millimetres (RAS+).

Objects are known by their attributes, so that none of these packages is imported unless its image is given.
"""

import warnings
from typing import Any

import numpy as np

#: DICOM and ITK count x and y towards left and posterior (LPS+).
_RAS_FROM_LPS = np.diag([-1.0, -1.0, 1.0, 1.0])

#: Lengths of OME-NGFF in mm.
_MM = {"angstrom": 1e-7, "nanometer": 1e-6, "micrometer": 1e-3, "millimeter": 1.0, "centimeter": 10.0, "meter": 1e3}


def array_and_affine(given: Any) -> tuple[Any, Any]:
    """The array and the affine of an image; other objects are returned unchanged, with the affine ``None``."""
    if hasattr(given, "dataobj") and hasattr(given, "affine"):
        return given.dataobj, given.affine
    if hasattr(given, "GetPixelID") and hasattr(given, "GetDirection"):
        return _of_simple_itk(given)
    if hasattr(given, "GetBufferedRegion") and hasattr(given, "GetDirection"):
        return _of_itk(given)
    if hasattr(given, "GetDirectionMatrix") and hasattr(given, "GetPointData"):
        return _of_vtk(given)
    if hasattr(given, "data_vars") and hasattr(given, "coords"):
        raise ValueError("it is a Dataset; give one of its arrays")
    if hasattr(given, "dims") and hasattr(given, "coords"):
        return _of_xarray(given)
    if hasattr(given, "data_to_world") and hasattr(given, "multiscale"):
        return _of_napari(given)
    if hasattr(given, "attrs") and hasattr(given, "array_keys"):
        return _of_ome_zarr(given)
    return given, None


def _affine(directions: Any, spacing: Any, origin: Any) -> Any:
    """Affine from directions of the axes i, j, k in its columns, voxel spacing and the position of voxel 0, 0, 0."""
    affine = np.eye(4)
    affine[:3, :3] = np.asarray(directions, float).reshape(3, 3) * np.asarray(spacing, float)
    affine[:3, 3] = origin
    return affine


def _require_scalars(components: int) -> None:
    if components != 1:
        raise ValueError(f"a voxel has {components} components; a volume has one value in a voxel")


def _require_three(axes: int) -> None:
    if axes != 3:
        raise ValueError(f"it has {axes} axes; a volume has three")


def _of_simple_itk(image: Any) -> tuple[Any, Any]:
    import SimpleITK  # type: ignore

    _require_three(image.GetDimension())
    _require_scalars(image.GetNumberOfComponentsPerPixel())
    array = SimpleITK.GetArrayViewFromImage(image).T
    return array, _RAS_FROM_LPS @ _affine(image.GetDirection(), image.GetSpacing(), image.GetOrigin())


def _of_itk(image: Any) -> tuple[Any, Any]:
    import itk  # type: ignore

    _require_three(image.GetImageDimension())
    _require_scalars(image.GetNumberOfComponentsPerPixel())
    directions = itk.array_from_matrix(image.GetDirection())
    array = itk.array_view_from_image(image).T
    # The buffer begins at this index, which is not 0 in a part of an image.
    start = list(image.GetBufferedRegion().GetIndex())
    affine = _affine(directions, list(image.GetSpacing()), list(image.GetOrigin()))
    affine[:3, 3] += affine[:3, :3] @ start
    return array, _RAS_FROM_LPS @ affine


def _of_vtk(image: Any) -> tuple[Any, Any]:
    """VTK has no patient orientation: coordinates are taken as RAS+, as in its files."""
    from vtkmodules.util.numpy_support import vtk_to_numpy  # type: ignore

    scalars = image.GetPointData().GetScalars()
    if scalars is None:
        raise ValueError("its points have no active scalars")
    _require_scalars(scalars.GetNumberOfComponents())
    array = vtk_to_numpy(scalars).reshape(image.GetDimensions()[::-1]).T
    matrix = image.GetDirectionMatrix()
    directions = [[matrix.GetElement(row, column) for column in range(3)] for row in range(3)]
    affine = _affine(directions, image.GetSpacing(), image.GetOrigin())
    affine[:3, 3] += affine[:3, :3] @ image.GetExtent()[::2]
    return array, affine


def _of_xarray(array: Any) -> tuple[Any, Any]:
    """Dimensions are called x, y and z, in any order, with evenly spaced coordinates in mm.

    The attribute ``direction`` of ``itk.xarray_from_image`` has directions of the axes in the order z, y, x. Coordinates are
    LPS+ along these axes then.
    """
    if set(array.dims) != {"x", "y", "z"}:
        raise ValueError(f"its dimensions are {', '.join(map(str, array.dims))}; expected x, y and z")
    starts, spacing = zip(*(_even_coordinates(array, name) for name in "xyz"))
    directions = array.attrs.get("direction")
    affine = _affine(np.eye(3) if directions is None else np.flip(directions), spacing, starts)
    values = array.transpose("x", "y", "z").data
    return values, affine if directions is None else _RAS_FROM_LPS @ affine


def _even_coordinates(array: Any, name: str) -> tuple[float, float]:
    """First coordinate and spacing along a dimension; 0 and 1 for a dimension without coordinates."""
    if name not in array.coords:
        return 0.0, 1.0
    at = np.asarray(array.coords[name], float)
    spacing = (at[-1] - at[0]) / (len(at) - 1) if len(at) > 1 else 1.0
    if not np.allclose(at, at[0] + spacing * np.arange(len(at)), rtol=0, atol=1e-4 * abs(spacing)):
        raise ValueError(f"its coordinates along {name} are not evenly spaced")
    return float(at[0]), float(spacing)


def _of_napari(layer: Any) -> tuple[Any, Any]:
    """The finest level of a layer. Its world axes are z, y and x; they are taken as RAS+ mm."""
    array = layer.data[0] if layer.multiscale else layer.data
    _require_three(layer.ndim)
    world = np.array([layer.data_to_world(point) for point in np.vstack([np.zeros(3), np.eye(3)])])
    affine = np.eye(4)
    affine[:3, :3] = (world[1:] - world[0]).T[::-1, ::-1]
    affine[:3, 3] = world[0][::-1]
    return np.asarray(array).T, affine


def _of_ome_zarr(group: Any) -> tuple[Any, Any]:
    try:
        return _level_0(group)
    except (AttributeError, IndexError, KeyError, TypeError) as error:
        raise ValueError(f"its OME multiscales are not valid ({error!r}); give one of its arrays and an affine") from error


def _level_0(group: Any) -> tuple[Any, Any]:
    """Level 0 of an OME-Zarr image (NGFF 0.4 and 0.5), as its files are read: x, y and z are taken as RAS+."""
    attributes = dict(group.attrs)
    images = attributes.get("ome", attributes).get("multiscales")
    if not images:
        raise ValueError("it is a Zarr group without OME multiscales; give one of its arrays and an affine")
    axes = images[0].get("axes", [])
    if not all(isinstance(axis, dict) for axis in axes) or not {"x", "y", "z"} <= {axis["name"] for axis in axes}:
        raise ValueError("its OME multiscales have no axes x, y and z; give one of its arrays and an affine")
    level = images[0]["datasets"][0]
    scale, translation = np.ones(len(axes)), np.zeros(len(axes))
    # Transformations of the image follow those of its levels.
    for transformation in level.get("coordinateTransformations", []) + images[0].get("coordinateTransformations", []):
        if transformation["type"] == "scale":
            scale, translation = scale * transformation["scale"], translation * transformation["scale"]
        elif transformation["type"] == "translation":
            translation = translation + transformation["translation"]
        elif transformation["type"] != "identity":
            raise ValueError(f"its image has a transformation {transformation['type']}; expected scale and translation")
    names = [axis["name"] for axis in axes]
    place = [names.index(name) for name in "xyz"]
    units = [axes[axis].get("unit") for axis in place]
    if any(unit not in _MM for unit in units):
        warnings.warn("its axes have no known unit of length: taken as mm", stacklevel=4)
    mm = np.array([_MM.get(unit, 1.0) for unit in units])
    array = group[level["path"]]
    for axis, size in enumerate(array.shape):
        if axis not in place and size != 1:
            raise ValueError(f"its axis {names[axis]} has {size} entries; give an array of one of them, and an affine")
    values = np.asarray(array[tuple(slice(None) if axis in place else 0 for axis in range(len(axes)))])
    order = [sorted(place).index(axis) for axis in place]
    return values.transpose(order), _affine(np.eye(3), mm * scale[place], mm * translation[place])
