"""Images of other packages are the volumes of their files."""

import os

import nibabel
import numpy as np
import pytest
from conftest import FUNCTION, package_named, small

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
    sitk = package_named("SimpleITK")
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
    voxels, *place = oblique()
    hidden = dict(tf=FUNCTION, hide="1")
    through = uv.Scene(uv.Volume(voxels, affine_of(*place), labels=(voxels > 90).astype(np.uint8)), **hidden).optical_depth(STARTS, ENDS)
    assert (through < expected()).any()
    # The same labels in another order of voxels have the same place.
    for labels in [image > 90, sitk.Flip(image > 90, [True, False, True])]:
        for volume in [uv.Volume(image, labels=labels), uv.Volume(voxels.T, affine_of(*place), axes="kji", labels=labels)]:
            np.testing.assert_allclose(uv.Scene(volume, **hidden).optical_depth(STARTS, ENDS), through, rtol=1e-9)
    with pytest.raises(uv.InputError, match="`axes` is about arrays"):
        uv.Volume(image, axes="kji")
    with pytest.raises(uv.InputError, match="3 components"):
        uv.Volume(sitk.Compose([image] * 3))
    with pytest.raises(uv.InputError, match="2 axes"):
        uv.Volume(image[:, :, 0])


def itk_image():
    itk = package_named("itk")
    voxels, directions, spacing, origin = oblique()
    image = itk.image_from_array(np.ascontiguousarray(voxels.T))
    image.SetSpacing(spacing)
    image.SetOrigin([-origin[0], -origin[1], origin[2]])
    image.SetDirection(itk.matrix_from_array(np.diag([-1.0, -1, 1]) @ directions))
    return itk, image


def test_images_of_itk():
    itk, image = itk_image()
    np.testing.assert_allclose(depths(image), expected(), rtol=1e-9)
    # The buffer of a part begins at an index other than 0.
    region = itk.ImageRegion[3](itk.Index[3]([2, 1, 1]), itk.Size[3]([6, 5, 5]))
    part = itk.extract_image_filter(image, extraction_region=region, direction_collapse_to_strategy=1)
    voxels, *place = oblique()
    affine = affine_of(*place)
    affine[:3, 3] += affine[:3, :3] @ [2, 1, 1]
    np.testing.assert_allclose(depths(part), depths(voxels[2:8, 1:6, 1:6], affine), rtol=1e-9)


def test_images_of_vtk():
    vtk = package_named("vtkmodules.vtkCommonDataModel")
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
    xarray = package_named("xarray")
    voxels, _, spacing, origin = oblique()
    coordinates = {name: origin[n] + spacing[n] * np.arange(voxels.shape[n]) for n, name in enumerate("xyz")}
    array = xarray.DataArray(voxels, coordinates, ("x", "y", "z"))
    straight = depths(voxels, affine_of(np.eye(3), spacing, origin))
    for order in [("x", "y", "z"), ("z", "y", "x"), ("y", "x", "z")]:
        np.testing.assert_allclose(depths(array.transpose(*order)), straight, rtol=1e-9)
    flipped = array.isel(y=slice(None, None, -1)).drop_vars("z")
    straight = affine_of(np.eye(3), spacing, origin)
    straight[2, 2], straight[2, 3] = 1, 0
    np.testing.assert_allclose(depths(flipped), depths(voxels, straight), rtol=1e-9)
    with pytest.raises(uv.InputError, match="one of its arrays"):
        uv.Volume(array.to_dataset(name="ct"))
    with pytest.raises(uv.InputError, match="not evenly spaced"):
        uv.Volume(array.assign_coords(x=coordinates["x"] ** 2))
    with pytest.raises(uv.InputError, match="expected x, y and z"):
        uv.Volume(array.rename(x="time"))


def test_arrays_of_xarray_that_itk_made():
    package_named("xarray")
    itk, image = itk_image()
    np.testing.assert_allclose(depths(itk.xarray_from_image(image)), expected(), rtol=1e-9)


def test_layers_of_napari():
    layers = package_named("napari.layers")
    voxels, *place = oblique()
    affine = affine_of(*place)
    # Axes of layers and of their world are z, y, x.
    reverse = np.eye(4)
    reverse[:3, :3] = np.eye(3)[::-1]
    layer = layers.Image(voxels.T, affine=reverse @ affine @ reverse)
    np.testing.assert_allclose(depths(layer), expected(), rtol=1e-9)
    voxels, _, spacing, origin = oblique()
    moved = layers.Image(voxels.T, scale=spacing[::-1], translate=origin[::-1])
    np.testing.assert_allclose(depths(moved), depths(voxels, affine_of(np.eye(3), spacing, origin)), rtol=1e-9)
    half = voxels.T[::2, ::2, ::2]
    levels = layers.Image([voxels.T, half], multiscale=True, affine=reverse @ affine @ reverse)
    np.testing.assert_allclose(depths(levels), expected(), rtol=1e-9)


@pytest.mark.parametrize("package", ["dask.array", "zarr"])
def test_arrays_that_are_not_in_memory(package):
    module = package_named(package)
    voxels, *place = oblique()
    lazy = module.from_array(voxels) if package == "dask.array" else module.array(voxels)
    np.testing.assert_allclose(depths(lazy, affine_of(*place)), expected(), rtol=1e-9)


def test_an_affine_that_is_given_goes_before_that_of_the_image():
    voxels, affine = small()
    image = nibabel.Nifti1Image(voxels, np.eye(4))
    np.testing.assert_array_equal(depths(image, affine), depths(voxels, affine))
