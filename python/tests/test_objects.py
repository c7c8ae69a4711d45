"""Images of other packages are the volumes of their files."""

import nibabel
import numpy as np
import pytest
from conftest import FUNCTION, small

import umbravox as uv

STARTS, ENDS = [[-50, 1, 2], [3, 40, 1]], [[50, 2, 1], [1, -40, 5]]


def depths(volume, *place):
    return uv.Scene(volume, *place, tf=FUNCTION).optical_depth(STARTS, ENDS)


def oblique():
    """Voxels with axes i, j, k, directions of these axes (a rotation and a reflection), spacing and origin, RAS+ mm."""
    voxels, _ = small()
    c, s = np.cos(0.4), np.sin(0.4)
    directions = np.array([[c, -s, 0], [s, c, 0], [0, 0, -1.0]]) @ np.array([[1, 0, 0], [0, c, s], [0, -s, c]])
    return voxels, directions, (2.0, 1.5, 3.0), (-9.0, -4.0, 7.0)


def affine_of(directions, spacing, origin):
    affine = np.eye(4)
    affine[:3, :3] = directions * spacing
    affine[:3, 3] = origin
    return affine


def expected():
    voxels, *place = oblique()
    found = depths(voxels, affine_of(*place))
    assert (found > 0).all()
    return found


def simple_itk_image():
    sitk = pytest.importorskip("SimpleITK")
    voxels, directions, spacing, origin = oblique()
    image = sitk.GetImageFromArray(voxels.T)
    image.SetSpacing(spacing)
    image.SetOrigin([-origin[0], -origin[1], origin[2]])
    image.SetDirection((np.diag([-1, -1, 1]) @ directions).ravel())
    return sitk, image


def test_images_of_simple_itk():
    _, image = simple_itk_image()
    np.testing.assert_allclose(depths(image), expected(), rtol=1e-9)


def test_a_file_is_the_image_that_simple_itk_reads(tmp_path):
    sitk, image = simple_itk_image()
    for ending in ["nrrd", "mha", "nii"]:
        path = tmp_path / f"image.{ending}"
        sitk.WriteImage(image, str(path))
        np.testing.assert_allclose(depths(sitk.ReadImage(str(path))), depths(path), rtol=1e-6 if ending == "nii" else 1e-9)


def test_labels_of_simple_itk():
    sitk, image = simple_itk_image()
    assert uv.Volume(image, labels=image > 90).labels == [0, 1]
    with pytest.raises(uv.InputError, match="3 components"):
        uv.Volume(sitk.Compose([image] * 3))
    with pytest.raises(uv.InputError, match="2 axes"):
        uv.Volume(image[:, :, 0])


def itk_image():
    itk = pytest.importorskip("itk")
    voxels, directions, spacing, origin = oblique()
    image = itk.image_from_array(np.ascontiguousarray(voxels.T))
    image.SetSpacing(spacing)
    image.SetOrigin([-origin[0], -origin[1], origin[2]])
    image.SetDirection(itk.matrix_from_array(np.diag([-1.0, -1, 1]) @ directions))
    return itk, image


def test_images_of_itk():
    _, image = itk_image()
    np.testing.assert_allclose(depths(image), expected(), rtol=1e-9)


def test_images_of_vtk():
    vtk = pytest.importorskip("vtkmodules.vtkCommonDataModel")
    from vtkmodules.util.numpy_support import numpy_to_vtk

    voxels, directions, spacing, origin = oblique()
    affine = affine_of(directions, spacing, origin)
    image = vtk.vtkImageData()
    # The extent begins at 2, 3, 4; the origin is the place of index 0, 0, 0.
    start = np.array([2, 3, 4])
    image.SetExtent(*np.column_stack([start, start + voxels.shape - np.array(1)]).ravel().tolist())
    image.SetSpacing(spacing)
    image.SetOrigin(affine[:3, 3] - affine[:3, :3] @ start)
    image.SetDirectionMatrix(directions.ravel().tolist())
    with pytest.raises(uv.InputError, match="no active scalars"):
        uv.Volume(image)
    image.GetPointData().SetScalars(numpy_to_vtk(voxels.T.ravel(), deep=True))
    np.testing.assert_allclose(depths(image), expected(), rtol=1e-9)


def test_arrays_of_xarray():
    xarray = pytest.importorskip("xarray")
    voxels, _, spacing, origin = oblique()
    coordinates = {name: origin[n] + spacing[n] * np.arange(voxels.shape[n]) for n, name in enumerate("xyz")}
    array = xarray.DataArray(voxels, coordinates, ("x", "y", "z"))
    straight = depths(voxels, affine_of(np.eye(3), spacing, origin))
    for order in [("x", "y", "z"), ("z", "y", "x"), ("y", "x", "z")]:
        np.testing.assert_allclose(depths(array.transpose(*order)), straight, rtol=1e-9)
    with pytest.raises(uv.InputError, match="not evenly spaced"):
        uv.Volume(array.assign_coords(x=coordinates["x"] ** 2))
    with pytest.raises(uv.InputError, match="expected x, y and z"):
        uv.Volume(array.rename(x="time"))


def test_arrays_of_xarray_that_itk_made():
    pytest.importorskip("xarray")
    itk, image = itk_image()
    np.testing.assert_allclose(depths(itk.xarray_from_image(image)), expected(), rtol=1e-9)


def test_layers_of_napari():
    layers = pytest.importorskip("napari.layers")
    voxels, *place = oblique()
    affine = affine_of(*place)
    # Axes of layers and of their world are z, y, x.
    reverse = np.eye(4)
    reverse[:3, :3] = np.eye(3)[::-1]
    layer = layers.Image(voxels.T, affine=reverse @ affine @ reverse)
    np.testing.assert_allclose(depths(layer), expected(), rtol=1e-9)
    half = voxels.T[::2, ::2, ::2]
    levels = layers.Image([voxels.T, half], multiscale=True, affine=reverse @ affine @ reverse)
    np.testing.assert_allclose(depths(levels), expected(), rtol=1e-9)


@pytest.mark.parametrize("package", ["dask.array", "zarr"])
def test_arrays_that_are_not_in_memory(package):
    module = pytest.importorskip(package)
    voxels, *place = oblique()
    lazy = module.from_array(voxels) if package == "dask.array" else module.array(voxels)
    np.testing.assert_allclose(depths(lazy, affine_of(*place)), expected(), rtol=1e-9)


def test_an_affine_that_is_given_goes_before_that_of_the_image():
    voxels, affine = small()
    image = nibabel.Nifti1Image(voxels, np.eye(4))
    np.testing.assert_array_equal(depths(image, affine), depths(voxels, affine))
