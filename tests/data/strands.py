#!/usr/bin/env python3
"""Files of strands made by other people's writers, and what their own readers say of them: tests/data/strands/.

usage: strands.py
Needs numpy, nibabel (5.4) and vtk (9.7): `pip install nibabel vtk`. Run once; the results are committed, and `tests/it/strands/formats.rs`
holds this program's readers against `points.json`, which has the points of every line of every file, world mm.
"""
import json
import re
import struct
from pathlib import Path

import nibabel as nib
import numpy as np
import vtk
from nibabel.streamlines import Tractogram, TckFile, TrkFile
from vtk.util.numpy_support import vtk_to_numpy

OUT = Path(__file__).resolve().parent / "strands"
RANDOM = np.random.default_rng(7)


def tracks(lengths=(7, 2, 5, 12)):
    """Bent lines of so many points, mm."""
    made = []
    for n in lengths:
        steps = np.cumsum(RANDOM.normal(0, 1, (n, 3)) + RANDOM.normal(0, 2, 3), axis=0)
        made.append((steps + RANDOM.uniform(-40, 40, 3)).astype(np.float32))
    return made


def listed(lines):
    return [[[float(x) for x in p] for p in line] for line in lines]


def read_by_nibabel(path):
    # Lines of one point are left out here, and counted.
    return listed(line for line in nib.streamlines.load(path).streamlines if len(line) > 1)


def write_tck():
    lines = tracks() + [np.float32([[1, 2, 3]])]
    path = OUT / "little.tck"
    TckFile(Tractogram(lines, affine_to_rasmm=np.eye(4)), {"method": "by hand", "step": "0.5"}).save(path)
    data = path.read_bytes()
    offset = int(re.search(rb"file: \. (\d+)", data)[1])
    swapped = np.frombuffer(data[offset:], "<f4").astype(">f4").tobytes()
    (OUT / "big.tck").write_bytes(data[:offset].replace(b"Float32LE", b"Float32BE") + swapped)


def oblique(sizes, degrees, order):
    """An affine of voxels of these sizes, turned about, its axes going towards the letters of `order`."""
    a, b = np.radians(degrees), np.radians(degrees / 3)
    turn = np.array([[np.cos(a), -np.sin(a), 0], [np.sin(a), np.cos(a), 0], [0, 0, 1]])
    turn = turn @ np.array([[1, 0, 0], [0, np.cos(b), -np.sin(b)], [0, np.sin(b), np.cos(b)]])
    ways = nib.orientations.axcodes2ornt(order)
    axes = np.zeros((3, 3))
    for column, (axis, sign) in enumerate(ways):
        axes[int(axis), column] = sign
    affine = np.eye(4)
    affine[:3, :3] = turn @ axes @ np.diag(sizes)
    affine[:3, 3] = [-12.5, 30.25, 7]
    return affine


def write_trk(name, order, affine, sizes, numbers=False, edit=lambda data: data):
    lines = tracks()
    header = {"voxel_to_rasmm": affine.astype(np.float32), "voxel_sizes": np.float32(sizes),
              "dimensions": np.int16([40, 50, 60]), "voxel_order": order}
    more = {}
    if numbers:
        more["data_per_point"] = {"fa": [np.float32(np.arange(len(l)))[:, None] for l in lines],
                                  "rgb": [np.tile(np.float32([1, 2, 3]), (len(l), 1)) for l in lines]}
        more["data_per_streamline"] = {"id": [np.float32([i]) for i in range(len(lines))]}
    path = OUT / name
    TrkFile(Tractogram(lines, affine_to_rasmm=np.eye(4), **more), header).save(path)
    path.write_bytes(edit(path.read_bytes()))


def big_endian(data):
    """A .trk file without scalars and properties, the other way about."""
    head = np.frombuffer(data[:1000], nib.streamlines.trk.header_2_dtype)
    swapped = head.astype(head.dtype.newbyteorder(">")).tobytes()
    return swapped + np.frombuffer(data[1000:], "<u4").astype(">u4").tobytes()


def put(at, number):
    return lambda data: data[:at] + struct.pack("<i", number) + data[at + 4:]


def polydata(double):
    data, points, cells, faces = vtk.vtkPolyData(), vtk.vtkPoints(), vtk.vtkCellArray(), vtk.vtkCellArray()
    points.SetDataType(vtk.VTK_DOUBLE if double else vtk.VTK_FLOAT)
    for line in tracks():
        numbers = [points.InsertNextPoint(*(float(x) for x in p)) for p in line]
        cells.InsertNextCell(len(numbers))
        for number in numbers:
            cells.InsertCellPoint(number)
    # What is no line is passed over.
    faces.InsertNextCell(3)
    for number in (0, 1, 2):
        faces.InsertCellPoint(number)
    data.SetPoints(points)
    data.SetLines(cells)
    data.SetPolys(faces)
    scalars = vtk.vtkFloatArray()
    scalars.SetName("fa")
    for i in range(points.GetNumberOfPoints()):
        scalars.InsertNextValue(i / 10)
    data.GetPointData().SetScalars(scalars)
    field = vtk.vtkDoubleArray()
    field.SetName("b value")
    field.InsertNextValue(1000)
    data.GetFieldData().AddArray(field)
    return data


def read_by_vtk(reader, path):
    reader.SetFileName(str(path))
    reader.Update()
    data = reader.GetOutput()
    places = vtk_to_numpy(data.GetPoints().GetData())
    cells = data.GetLines()
    ends = vtk_to_numpy(cells.GetOffsetsArray())
    numbers = vtk_to_numpy(cells.GetConnectivityArray())
    return listed(places[numbers[a:b]] for a, b in zip(ends, ends[1:]))


def write_vtk():
    for name, version, binary, double in [
        ("text4.vtk", 42, False, False), ("text5.vtk", 51, False, True),
        ("binary4.vtk", 42, True, True), ("binary5.vtk", 51, True, False),
    ]:
        writer = vtk.vtkPolyDataWriter()
        writer.SetFileVersion(version)
        writer.SetFileTypeToBinary() if binary else writer.SetFileTypeToASCII()
        writer.SetInputData(polydata(double))
        writer.SetFileName(str(OUT / name))
        writer.Write()


def write_vtp():
    for name, settings in [
        ("default.vtp", lambda w: None),
        ("text.vtp", lambda w: w.SetDataModeToAscii()),
        ("inline.vtp", lambda w: (w.SetDataModeToBinary(), w.SetHeaderTypeToUInt64(), w.SetBlockSize(64))),
        ("inline_plain.vtp", lambda w: (w.SetDataModeToBinary(), w.SetCompressorTypeToNone(), w.SetByteOrderToBigEndian())),
        ("raw.vtp", lambda w: (w.EncodeAppendedDataOff(), w.SetHeaderTypeToUInt64())),
        ("raw_plain.vtp", lambda w: (w.EncodeAppendedDataOff(), w.SetCompressorTypeToNone())),
    ]:
        writer = vtk.vtkXMLPolyDataWriter()
        writer.SetInputData(polydata(name == "raw.vtp"))
        writer.SetFileName(str(OUT / name))
        settings(writer)
        writer.Write()


def write_obj():
    writer = vtk.vtkOBJWriter()
    writer.SetInputData(polydata(False))
    writer.SetFileName(str(OUT / "lines.obj"))
    writer.Write()


def main():
    OUT.mkdir(exist_ok=True)
    write_tck()
    write_trk("ras.trk", "RAS", oblique((1, 1, 1), 0, "RAS"), (1, 1, 1))
    write_trk("oblique.trk", "LPS", oblique((0.9, 1.25, 2.5), 25, "LAS"), (0.9, 1.25, 2.5), numbers=True)
    write_trk("big.trk", "LAS", oblique((1.5, 2, 3), -10, "RAS"), (1.5, 2, 3), edit=big_endian)
    write_trk("uncounted.trk", "RAS", oblique((2, 2, 2), 40, "RPS"), (2, 2, 2), edit=put(988, 0))
    write_trk("version1.trk", "LPS", oblique((1.5, 1, 2), 0, "RAS"), (1.5, 1, 2), edit=put(992, 1))
    write_trk("places.trk", "PRS", oblique((1, 1.5, 2), 15, "RAS"), (1, 1.5, 2))
    write_trk("cycle.trk", "SLP", oblique((1, 1.5, 2), 15, "AIL"), (1, 1.5, 2))
    write_vtk()
    write_vtp()
    write_obj()
    readers = {".vtk": vtk.vtkPolyDataReader, ".vtp": vtk.vtkXMLPolyDataReader, ".obj": vtk.vtkOBJReader}
    said = {}
    for path in sorted(p for p in OUT.iterdir() if p.suffix != ".json"):
        reader = readers.get(path.suffix)
        said[path.name] = read_by_vtk(reader(), path) if reader else read_by_nibabel(path)
    lines = [f"{json.dumps(name)}: {json.dumps(value)}" for name, value in said.items()]
    (OUT / "points.json").write_text("{\n" + ",\n".join(lines) + "\n}\n")


if __name__ == "__main__":
    main()
