"""Volumes from arrays."""

import warnings

import nibabel
import numpy as np
import pytest
from conftest import FUNCTION, small

import umbravox as uv


def depths(volume, affine=None, **arguments):
    return uv.Scene(volume, affine, tf=FUNCTION, **arguments).optical_depth([[-50, 1, 2], [3, 40, 1]], [[50, 2, 1], [1, -40, 5]])


@pytest.mark.parametrize("kind", ["?", "u1", "i1", "u2", "i2", "u4", "i4", "u8", "i8", "f2", "f4", "f8", ">i2", ">f4"])
def test_numbers_of_any_type_are_the_same_field(kind):
    voxels, affine = small()
    voxels = (voxels % 2 if kind == "?" else voxels % 120).astype(kind)
    function = {**FUNCTION, "points": [{**p, "value": p["value"] / 300} for p in FUNCTION["points"]]} if kind == "?" else FUNCTION
    expected = uv.Scene(voxels.astype(float), affine, tf=function).optical_depth([-50, 1, 2], [50, 2, 1])
    found = uv.Scene(voxels, affine, tf=function).optical_depth([-50, 1, 2], [50, 2, 1])
    assert expected > 0
    np.testing.assert_allclose(found, expected, rtol=1e-12)


def test_layouts_in_memory_do_not_matter():
    voxels, affine = small()
    expected = depths(voxels, affine)
    wide = np.zeros((18, 8, 14), np.uint8)
    wide[::2, :, ::2] = voxels
    for same in [np.asfortranarray(voxels), wide[::2, :, ::2], voxels[::-1].copy()[::-1], voxels.tolist()]:
        np.testing.assert_array_equal(depths(same, affine), expected)
    np.testing.assert_array_equal(depths(voxels.T, affine, axes="kji"), expected)
    volume = uv.Volume(voxels, affine, name="mine")
    np.testing.assert_array_equal(depths(volume), expected)
    assert volume.shape == (9, 8, 7) and volume.name == "mine" and "9 x 8 x 7" in repr(volume)
    np.testing.assert_array_equal(volume.voxels(), voxels)
    np.testing.assert_array_equal(volume.affine, affine)
    assert volume.value_range == (voxels.min(), voxels.max())
    np.testing.assert_allclose(volume.spacing, np.linalg.norm(affine[:3, :3], axis=0))


def test_images_of_nibabel_have_their_affine():
    voxels, affine = small()
    image = nibabel.Nifti1Image(voxels, affine)
    np.testing.assert_array_equal(depths(image), depths(voxels, affine))
    labels = nibabel.Nifti1Image((voxels > 90).astype(np.uint8), affine)
    assert uv.Volume(image, labels=labels).labels == [0, 1]


def test_where_a_voxel_is():
    voxels = np.zeros((6, 5, 4))
    voxels[4, 1, 2] = 200.0
    affine = np.diag([2.0, 3.0, 4.0, 1.0])
    affine[:3, 3] = [10, 20, 30]
    x, y, z = affine[:3] @ [4, 1, 2, 1]
    scene = uv.Scene(voxels, affine, tf=FUNCTION)
    through, beside = scene.optical_depth([[x, y, 0], [x + 4, y, 0]], [[x, y, 99], [x + 4, y, 99]])
    assert through > 0.01 and beside == 0.0


def test_what_is_not_a_number_becomes_the_smallest_value():
    voxels, affine = small()
    holed = voxels.astype(np.float32)
    holed[2, 3, 4] = np.nan
    with pytest.warns(UserWarning, match="1 voxels were not finite"):
        volume = uv.Volume(holed, affine)
    assert volume.voxels()[2, 3, 4] == voxels.min()
    with pytest.warns(UserWarning, match="53 bits"):
        uv.Volume(np.full((2, 2, 2), 2**60 + 1), affine)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        uv.Volume(voxels, affine)


def test_what_an_array_is_taken_for_is_said():
    voxels, affine = small()
    with pytest.warns(UserWarning, match="units="):
        uv.Scene(voxels, affine, tf="bone")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        uv.Scene(voxels, affine, tf="bone", units="hu")
        uv.Scene(voxels, affine, tf=FUNCTION)


def test_labels_are_hidden_and_seen_otherwise(tmp_path):
    voxels, affine = small()
    labels = np.zeros(voxels.shape, np.uint8)
    labels[:5] = 3
    volume = uv.Volume(voxels, affine, labels=labels)
    assert volume.labels == [0, 3]
    whole, part = depths(volume), depths(volume, hide=3)
    assert (part < whole).all() and (part > 0).any()
    np.testing.assert_array_equal(depths(volume, hide="0,3"), 0.0)
    np.testing.assert_array_equal(depths(voxels, affine, labels=labels, hide=[3]), part)
    with pytest.raises(uv.InputError, match="shape"):
        uv.Volume(voxels, affine, labels=labels[1:])
    # Of a file, or for a volume that is there.
    uv.Volume(labels, affine).save(tmp_path / "labels.nii.gz")
    uv.Volume(voxels, affine).save(tmp_path / "voxels.nii.gz")
    for volume, given in [
        (uv.Volume(voxels, affine, labels=tmp_path / "labels.nii.gz"), {}),
        (uv.Volume(voxels, affine), {"labels": labels}),
        (tmp_path / "voxels.nii.gz", {"labels": labels}),
        (tmp_path / "voxels.nii.gz", {"labels": tmp_path / "labels.nii.gz"}),
    ]:
        np.testing.assert_allclose(depths(volume, hide=3, **given), part, rtol=1e-6)
    seen = depths(volume, label_tf={3: "engine"}, units="fraction", **given)
    np.testing.assert_array_equal(seen, depths(volume, label_tf="3=engine", units="fraction", **given))


@pytest.mark.parametrize(
    ("voxels", "arguments", "words"),
    [
        (np.zeros((4, 4)), {}, "three axes"),
        (np.zeros((0, 4, 4)), {}, "dimension is 0"),
        (np.zeros((2, 2, 2), complex), {}, "complex128"),
        (np.full((2, 2, 2), "a"), {}, "not a real number type"),
        (np.full((2, 2, 2), np.inf), {}, "no voxel has a finite value"),
        (np.zeros((2, 2, 2)), {"affine": np.zeros((4, 4))}, "last row"),
        (np.zeros((2, 2, 2)), {"affine": np.diag([1, 0, 1, 1])}, "singular"),
        (np.zeros((2, 2, 2)), {"affine": np.eye(3)}, "4 x 4"),
        (np.zeros((2, 2, 2)), {"affine": np.eye(4), "spacing": (1, 1, 1)}, "both"),
        (np.zeros((2, 2, 2)), {"axes": "xyz"}, "ijk or kji"),
        (np.zeros((2, 2, 2)), {"affine": "eye"}, "4 x 4"),
        (np.zeros((2, 2, 2)), {"spacing": 1}, "three lengths"),
        (np.ma.masked_array(np.zeros((2, 2, 2)), True), {}, "masked"),
        ([[[1, 2]], [[1]]], {}, "no array"),
    ],
)
def test_what_is_no_volume_is_refused(voxels, arguments, words):
    with pytest.raises(uv.InputError, match=words):
        uv.Volume(voxels, **arguments)


def test_arrays_may_lie_at_any_byte():
    voxels, affine = small()
    expected = uv.Scene(voxels.astype(np.int16), affine, tf=FUNCTION).optical_depth([[0, 0, -20]], [[1, 2, 20]])

    def displaced(array):
        at = np.empty(array.nbytes + 1, np.uint8)[1:].view(array.dtype).reshape(array.shape)
        at[...] = array
        assert not at.flags.aligned
        return at

    points = displaced(np.array([[0.0, 0, -20]])), displaced(np.array([[1.0, 2, 20]]))
    scene = uv.Scene(displaced(voxels.astype(np.int16)), displaced(affine), tf=FUNCTION)
    assert scene.optical_depth(*points) == expected
