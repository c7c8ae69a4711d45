"""Draws the small picture of a benchmark cell with VTK's GPU ray caster and its volumetric shadows.

umbravox benchmark --cells "cloud-*-front-front" --external "vtk=python3 examples/external_vtk.py" -o ranks

Needs Python 3.11, vtk, nibabel, numpy and OpenEXR, and a display (on a server: `xvfb-run -a python3 ...`). VTK gives pictures only,
so `image_rmse` and `frame_ms` apply; `frame_ms` includes the start of Python and two renderings. VTK_STEP_VOXELS sets
the sample distance in units of the smallest voxel spacing, instead of `step` of the scene.

The model is that of umbravox. The shadows of VTK 9.7 have two errors. A shadow ray begins one sample distance from its
point, so points are too bright. A function with a step (`surface`) is therefore no fair comparison. Steps of shadow
rays have equal lengths in texture coordinates. Unless the volume is a cube, their optical depth is wrong by a factor
that depends on the directions of eye ray and light.
"""

import json
import os
import sys
import tomllib

import nibabel
import numpy as np
import OpenEXR
import vtk
from vtk.util.numpy_support import numpy_to_vtk, vtk_to_numpy


def made(kind, **settings):
    """Returns an object of a VTK class with some settings."""
    thing = kind()
    for name, value in settings.items():
        getattr(thing, f"Set{name}")(value)
    return thing


def volume_of(path):
    """Returns image data, its placement in the world as a 4 x 4 matrix, and voxel spacings (mm)."""
    # Axes near those of the world and positive: the placement of an axis-aligned affine of any sign is a translation.
    image = nibabel.as_closest_canonical(nibabel.load(path))
    voxels = np.asarray(image.dataobj, np.float32)
    spacing_mm = np.linalg.norm(image.affine[:3, :3], axis=0)
    placement = image.affine / [*spacing_mm, 1]
    if not np.allclose(placement[:3, :3].T @ placement[:3, :3], np.eye(3), atol=1e-4):
        sys.exit("VTK cannot draw a volume with a sheared affine")
    # Voxels are cells: the domain is then [-0.5, n - 0.5], with values clamped at the edge.
    grid = {"Dimensions": np.add(voxels.shape, 1).tolist(), "Spacing": spacing_mm, "Origin": -0.5 * spacing_mm}
    data = made(vtk.vtkImageData, **grid)
    data.GetCellData().SetScalars(numpy_to_vtk(voxels.ravel(order="F"), deep=True))
    return data, placement, spacing_mm


def property_of(function, value_range):
    """Returns the volume property of a transfer function."""
    points, opacity, color = function["points"], vtk.vtkPiecewiseFunction(), vtk.vtkColorTransferFunction()
    at = np.array([p["value"] for p in points], float)
    # VTK needs increasing values, so the second point of a step moves by about an entry of VTK's table.
    at += np.append(False, np.diff(at) == 0) * (value_range[1] - value_range[0]) / 8192
    for value, point in zip(at, points):
        srgb = np.array([int(point["color"][n : n + 2], 16) / 255 for n in (1, 3, 5)])
        color.AddRGBPoint(value, *np.where(srgb <= 0.04045, srgb / 12.92, ((srgb + 0.055) / 1.055) ** 2.4))
    key = "opacity" if "opacity" in points[0] else "extinction"
    # Opacity is not linear in extinction.
    parts = 1 if key == "opacity" else 64
    values = np.interp(np.arange(parts * (len(at) - 1) + 1) / parts, np.arange(len(at)), at)
    amounts = np.interp(values, at, [p[key] for p in points])
    for value, amount in zip(values, amounts if key == "opacity" else -np.expm1(-amounts)):
        opacity.AddPoint(value, amount)
    length_mm = function["reference_length_mm"] if key == "opacity" else 1
    # Ambient light is added in `main`, because VTK does not multiply it by the colour.
    settings = {"ScalarOpacityUnitDistance": length_mm, "Ambient": 0, "Diffuse": 1, "Specular": 0}
    return made(vtk.vtkVolumeProperty, ScalarOpacity=opacity, Color=color, InterpolationType=1, **settings)


def light_of(scene):
    """Returns the light of a scene, `dir:x,y,z` (towards the light) or `point:x,y,z`."""
    kind, text = scene["light"].split(":")
    place = {"Position": [float(n) for n in text.split(",")[:3]], "FocalPoint": [0, 0, 0]}
    if kind == "point":
        # No cone, and no falloff away from its axis.
        place |= {"Positional": True, "FocalPoint": scene["target"], "ConeAngle": 180, "Exponent": 0}
    return made(vtk.vtkLight, LightType=vtk.VTK_LIGHT_TYPE_SCENE_LIGHT, **place)


def main():
    scene = tomllib.load(open(os.environ["UMBRAVOX_PICTURE_SCENE"], "rb"))
    data, placement, spacing_mm = volume_of(os.environ["UMBRAVOX_VOLUME"])
    prop = property_of(json.load(open(os.environ["UMBRAVOX_FUNCTION"])), data.GetScalarRange())
    step_mm = float(os.environ.get("VTK_STEP_VOXELS", scene["step"])) * spacing_mm.min()
    sampling = {"SampleDistance": step_mm, "AutoAdjustSampleDistances": False, "UseJittering": False}
    # At blending 2, colour is diffuse light times the shadow. Smaller values mix in gradient shading.
    shadows = {"GlobalIlluminationReach": 1, "VolumetricScatteringBlending": 2}
    mapper = made(vtk.vtkOpenGLGPUVolumeRayCastMapper, InputData=data, **sampling, **shadows)
    matrix = vtk.vtkMatrix4x4()
    matrix.DeepCopy(placement.ravel())

    renderer = vtk.vtkRenderer()
    renderer.AddVolume(made(vtk.vtkVolume, Mapper=mapper, Property=prop, UserMatrix=matrix))
    renderer.AddLight(light_of(scene))
    view = {"Position": scene["eye"], "FocalPoint": scene["target"], "ViewUp": scene["up"], "ViewAngle": scene["fov"]}
    renderer.SetActiveCamera(made(vtk.vtkCamera, **view))
    renderer.ResetCameraClippingRange()
    width, height = (int(n) for n in scene["size"].split("x"))
    buffers = {"OffScreenRendering": True, "AlphaBitPlanes": True, "MultiSamples": 0}
    window = made(vtk.vtkRenderWindow, Size=(width, height), **buffers)
    window.AddRenderer(renderer)

    def picture(shade):
        """Returns linear RGBA in steps of 1/255, premultiplied, with light and shadows or without both."""
        prop.SetShade(shade)
        window.Render()
        pixels = vtk.vtkFloatArray()
        window.GetRGBAPixelData(0, 0, width - 1, height - 1, 0, pixels)
        return vtk_to_numpy(pixels).reshape(height, width, 4)[::-1]

    lit, unlit = picture(True), picture(False)
    if np.abs(lit - unlit)[..., 3].max() > 2 / 255:
        sys.exit("the OpenGL driver ended the loops of a shader early: set VTK_STEP_VOXELS to a larger distance")
    rgba = scene["ambient"] * unlit + (1 - scene["ambient"]) * lit
    OpenEXR.File({}, {"RGBA": np.ascontiguousarray(rgba, np.float32)}).write(os.environ["UMBRAVOX_PICTURE"])


if __name__ == "__main__":
    main()
