"""Images of other packages are the volumes of their files."""

import os

import nibabel
import numpy as np
import pytest
from conftest import FUNCTION, package_named, small

import umbravox as uv


STARTS, ENDS = [[-50, 1, 12], [3, 40, -1]], [[50, 2, 1], [1, -40, 12]]


def depths(volume, *place, **arguments):
    found = uv.Scene(volume, *place, tf=FUNCTION, **arguments).optical_depth(STARTS, ENDS)
    # Segments beside a volume would compare nothing.
    assert (found > 0).any()
    return found


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
    return depths(voxels, affine_of(*place))


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


def vtk_image():
    """Image without scalars, and its scalars."""
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
    return image, numpy_to_vtk(voxels.T.ravel(), deep=True)


def test_images_of_vtk():
    image, scalars = vtk_image()
    with pytest.raises(uv.InputError, match="no active scalars"):
        uv.Volume(image)
    image.GetPointData().SetScalars(scalars)
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


def ome_zarr(store, zarr_format=3, **changes):
    """Group of an OME-Zarr image with two levels and one channel; `changes` replace entries of its metadata."""
    zarr = package_named("zarr")
    voxels, _, spacing, origin = oblique()
    group = zarr.open_group(store, mode="w", zarr_format=zarr_format)
    for level in [0, 1]:
        values = voxels.T[None, :: level + 1, :: level + 1, :: level + 1]
        array = group.create_array(str(level), shape=values.shape, chunks=(1, 4, 3, 5), dtype=values.dtype)
        array[:] = values
    axes = [{"name": "c", "type": "channel"}]
    axes += [{"name": name, "type": "space", "unit": "micrometer"} for name in "zyx"]
    # The translation of a level is scaled by the transformation of the image.
    moved = [0.0, *(1e3 * np.array(origin[::-1]) / 2)]
    scales = {"type": "scale", "scale": [1.0, *(1e3 * np.array(spacing[::-1]) / 2)]}
    levels = [{"path": str(n), "coordinateTransformations": [scales, {"type": "translation", "translation": moved}]} for n in [0, 1]]
    image = {"version": "0.4", "axes": axes, "datasets": levels}
    image["coordinateTransformations"] = [{"type": "identity"}, {"type": "scale", "scale": [1.0, 2.0, 2.0, 2.0]}]
    images = {"multiscales": [{**image, **changes}]}
    group.attrs.update(images if zarr_format == 2 else {"ome": {"version": "0.5", **images}})
    return group


def test_groups_of_zarr():
    voxels, _, spacing, origin = oblique()
    group = ome_zarr({})
    np.testing.assert_allclose(depths(group), depths(voxels, affine_of(np.eye(3), spacing, origin)), rtol=1e-9)
    assert uv.Volume(group, labels=group).labels == np.unique(voxels).tolist()
    with pytest.warns(UserWarning, match="no known unit of length: taken as mm"):
        assert uv.Volume(ome_zarr({}, axes=[{"name": name} for name in "czyx"])).spacing[2] == 3000
    for changes, why in [
        ({"axes": []}, "no axes x, y and z; give one of its arrays"),
        ({"axes": list("czyx")}, "no axes x, y and z; give one of its arrays"),
        ({"coordinateTransformations": [{"type": "affine"}]}, "a transformation affine"),
        ({"axes": [{"unit": "meter"}] * 4}, "are not valid .KeyError.'name'.."),
        ({"datasets": []}, "are not valid .IndexError"),
        ({"datasets": [{"path": "0", "coordinateTransformations": [{"type": "scale"}]}]}, "are not valid .KeyError"),
        ({"axes": [{"name": name, "unit": "meter"} for name in "ztyx"]}, "its axis t has 7 entries; give an array"),
    ]:
        with pytest.raises(uv.InputError, match=why):
            uv.Volume(ome_zarr({}, **changes))
    group.attrs.clear()
    with pytest.raises(uv.InputError, match="without OME multiscales; give one of its arrays and an affine"):
        uv.Volume(group)


def test_an_affine_that_is_given_goes_before_that_of_the_image():
    voxels, affine = small()
    image = nibabel.Nifti1Image(voxels, np.eye(4))
    np.testing.assert_array_equal(depths(image, affine), depths(voxels, affine))


def numpy_file(path):
    voxels, _, spacing, _ = oblique()
    np.save(path / "voxels.npy", voxels.T)
    return depths(voxels, spacing=spacing), depths(path / "voxels.npy", spacing=spacing)


def nibabel_file(path):
    # Its affine is exact in float32, the type of NIfTI.
    image = nibabel.Nifti1Image(*small())
    nibabel.save(image, path / "image.nii.gz")
    return depths(image), depths(path / "image.nii.gz")


def simple_itk_file(path):
    sitk, image = simple_itk_image()
    sitk.WriteImage(image, str(path / "image.nrrd"))
    return depths(image), depths(path / "image.nrrd")


def itk_file(path):
    itk, image = itk_image()
    itk.imwrite(image, str(path / "image.mha"))
    return depths(image), depths(path / "image.mha")


def vtk_file(path):
    image, scalars = vtk_image()
    image.GetPointData().SetScalars(scalars)
    writer = package_named("vtkmodules.vtkIOXML").vtkXMLImageDataWriter()
    writer.SetFileName(str(path / "image.vti"))
    writer.SetInputData(image)
    assert writer.Write()
    return depths(image), depths(path / "image.vti")


def xarray_file(path):
    package_named("xarray")
    itk, image = itk_image()
    itk.imwrite(image, str(path / "image.nrrd"))
    return depths(itk.xarray_from_image(image)), depths(path / "image.nrrd")


def napari_file(path):
    layers = package_named("napari.layers")
    voxels, directions, spacing, origin = oblique()
    reverse = np.eye(4)
    reverse[:3, :3] = np.eye(3)[::-1]
    layer = layers.Image(voxels.T, affine=reverse @ affine_of(directions, spacing, origin) @ reverse)
    sitk, image = simple_itk_image()
    sitk.WriteImage(image, str(path / "image.nrrd"))
    return depths(layer), depths(path / "image.nrrd")


def dask_file(path):
    dask = package_named("dask.array")
    voxels, _, spacing, _ = oblique()
    np.save(path / "voxels.npy", voxels.T)
    array = dask.from_array(np.load(path / "voxels.npy", mmap_mode="r"), chunks=3)
    return depths(array, axes="kji", spacing=spacing), depths(path / "voxels.npy", spacing=spacing)


def zarr_file(path):
    zarr = package_named("zarr")
    voxels, _, spacing, _ = oblique()
    array = zarr.create_array(path / "voxels.zarr", data=voxels.T, chunks=(4, 3, 5))
    return depths(array, axes="kji", spacing=spacing), depths(path / "voxels.zarr", spacing=spacing)


def ome_zarr_2_file(path):
    return depths(ome_zarr(path / "image.zarr", zarr_format=2)), depths(path / "image.zarr")


def ome_zarr_3_file(path):
    return depths(ome_zarr(path / "image.zarr")), depths(path / "image.zarr")


FILES = [numpy_file, nibabel_file, simple_itk_file, itk_file, vtk_file, xarray_file, napari_file, dask_file, zarr_file]


@pytest.mark.parametrize("written", [*FILES, ome_zarr_2_file, ome_zarr_3_file])
def test_an_object_has_the_optical_depths_of_its_file(written, tmp_path):
    of_object, of_file = written(tmp_path)
    np.testing.assert_allclose(of_object, of_file, rtol=0, atol=1e-9)


def test_objects_that_numpy_makes_arrays_of():
    class Tensor:
        """Object with the array protocol, as tensors of PyTorch in host memory have it."""

        def __init__(self, values):
            self.values = values

        def __array__(self, dtype=None, copy=None):
            return np.asarray(self.values, dtype)

    voxels, *place = oblique()
    np.testing.assert_allclose(depths(Tensor(voxels), affine_of(*place)), expected(), rtol=0, atol=1e-9)
