#!/usr/bin/env python3
"""Writes the files that tests/formats reads, with the libraries whose formats they are, and what these read back.

    python3 -m venv v && v/bin/pip install nibabel scipy pydicom pynrrd SimpleITK tifffile pyjpegls pylibjpeg-openjpeg numpy zarr \
        ome-zarr vtk
    v/bin/python tests/formats/make.py            (or of some kinds alone: make.py zarrs vtis)

`expected.json` says for each file: the size of its grid, the affine from indices to RAS mm, and its values, the first
index fastest, all as the library has them that is named with it.
"""
import gzip
import json
import pathlib
import shutil
import sys

import nibabel
import nrrd
import numcodecs
import numpy as np
import ome_zarr.format
import ome_zarr.writer
import pydicom
import SimpleITK as sitk
import tifffile
import vtk
import vtk.util.numpy_support
import zarr
from pydicom.dataset import Dataset, FileDataset, FileMetaDataset
from pydicom.sequence import Sequence
from pydicom.uid import (CTImageStorage, DeflatedExplicitVRLittleEndian, EnhancedCTImageStorage, ExplicitVRBigEndian,
                         ExplicitVRLittleEndian, ImplicitVRLittleEndian, JPEG2000Lossless, JPEGLSLossless, RLELossless)

HERE = pathlib.Path(__file__).parent
OUT = HERE / "files"
LPS = np.diag([-1.0, -1.0, 1.0, 1.0])
expected = []


def say(name, by, affine, values, **more):
    """`values` has its first index fastest in the list: shape (x, y, z)."""
    values = np.asarray(values)
    expected.append({
        "name": name, "by": by, "dims": list(values.shape), "affine": np.asarray(affine)[:3].tolist(),
        "values": [float(v) for v in values.flatten(order="F")], **more,
    })


def numbers(dtype, shape=(5, 4, 3), seed=1):
    rng = np.random.default_rng(seed)
    info = np.iinfo(dtype) if np.issubdtype(dtype, np.integer) else None
    if info:
        return rng.integers(max(info.min, -3000), min(info.max, 3000), shape).astype(dtype)
    return rng.normal(0, 100, shape).astype(dtype)


def rotation(a, b, c):
    """An oblique one."""
    ca, sa, cb, sb, cc, sc = *(f(x) for x in (a, b, c) for f in (np.cos, np.sin)),
    rx = np.array([[1, 0, 0], [0, ca, -sa], [0, sa, ca]])
    ry = np.array([[cb, 0, sb], [0, 1, 0], [-sb, 0, cb]])
    rz = np.array([[cc, -sc, 0], [sc, cc, 0], [0, 0, 1]])
    return rx @ ry @ rz


def of_sitk(image):
    """Values (x, y, z) and the RAS affine of an ITK image."""
    direction = np.array(image.GetDirection()).reshape(3, 3)
    affine = np.eye(4)
    affine[:3, :3] = direction * np.array(image.GetSpacing())
    affine[:3, 3] = image.GetOrigin()
    return sitk.GetArrayFromImage(image).transpose(2, 1, 0), LPS @ affine


# --- NRRD, by pynrrd -------------------------------------------------------------------------------------------------
def nrrds():
    oblique = rotation(0.2, -0.3, 0.4) * np.array([0.7, 0.8, 2.5])
    for name, dtype, encoding, space, endian in [
        ("raw_lps.nrrd", "int16", "raw", "left-posterior-superior", "little"),
        ("gzip_ras.nrrd", "float32", "gzip", "right-anterior-superior", "little"),
        ("text_las.nrrd", "uint8", "ascii", "left-anterior-superior", "little"),
        ("big.nrrd", "uint16", "raw", "left-posterior-superior", "big"),
    ]:
        data = numbers(dtype)
        origin = [10.5, -20.25, 30.0]
        header = {"space": space, "space directions": oblique.T, "space origin": origin, "encoding": encoding,
                  "endian": endian, "kinds": ["domain"] * 3}
        stored = data.astype(data.dtype.newbyteorder(">")) if endian == "big" else data
        nrrd.write(str(OUT / name), stored, header)
        back, said = nrrd.read(str(OUT / name))
        affine = np.eye(4)
        affine[:3, :3] = np.asarray(said["space directions"]).T
        affine[:3, 3] = said["space origin"]
        flip = {"left-posterior-superior": LPS, "left-anterior-superior": np.diag([-1.0, 1, 1, 1])}
        say(name, "pynrrd", flip.get(space, np.eye(4)) @ affine, back)
    (OUT / "all.nrrd.gz").write_bytes(gzip.compress((OUT / "raw_lps.nrrd").read_bytes()))
    say("all.nrrd.gz", "pynrrd", expected[0]["affine"], nrrd.read(str(OUT / "raw_lps.nrrd"))[0])
    data = numbers("float64")
    nrrd.write(str(OUT / "detached.nhdr"), data, {"spacings": [0.5, 0.6, 0.7], "encoding": "raw"},
               detached_header=True, relative_data_path=True)
    say("detached.nhdr", "pynrrd", np.diag([0.5, 0.6, 0.7, 1]), nrrd.read(str(OUT / "detached.nhdr"))[0])
    nrrd.write(str(OUT / "itk.seq.nrrd"), numbers("int16", (5, 4, 3, 2)), {"encoding": "gzip", "spacings": [1, 2, 3, 1]})
    say("itk.seq.nrrd", "pynrrd", np.diag([1.0, 2, 3, 1]), nrrd.read(str(OUT / "itk.seq.nrrd"))[0][..., 1], frame=1)


def slicer_layers():
    """Overlapping segments in two layers, with the header fields of 3D Slicer; both layers count from 1."""
    layers = np.random.default_rng(5).integers(0, 3, (2, 5, 4, 3)).astype("uint8")
    layers[1] = np.minimum(layers[1], 1)
    header = {"space": "left-posterior-superior", "space directions": [[np.nan] * 3, [0.7, 0, 0], [0, 0.8, 0], [0, 0, 2.5]],
              "space origin": [10.5, -20.25, 30.0], "encoding": "gzip", "kinds": ["list"] + ["domain"] * 3}
    for n, (layer, value, name) in enumerate([(0, 1, "liver"), (0, 2, "rib"), (1, 1, "tumour")]):
        header |= {f"Segment{n}_Layer": str(layer), f"Segment{n}_LabelValue": str(value), f"Segment{n}_Name": name}
    nrrd.write(str(OUT / "layers.seg.nrrd"), layers, header)
    back = nrrd.read(str(OUT / "layers.seg.nrrd"))[0]
    affine = LPS @ np.array([[0.7, 0, 0, 10.5], [0, 0.8, 0, -20.25], [0, 0, 2.5, 30], [0, 0, 0, 1]])
    overlaps = np.count_nonzero((back > 0).all(0))
    say("layers.seg.nrrd", "pynrrd", affine, np.where(back[1] > 0, 3, back[0]), warning=f"{overlaps} voxels belong to several")


# --- MetaImage, by SimpleITK ----------------------------------------------------------------------------------------
def metaimages():
    for name, dtype, packed in [("plain.mha", "int16", False), ("packed.mha", "uint16", True),
                                ("plain.mhd", "float32", False), ("packed.mhd", "uint8", True),
                                ("double.mha", "float64", False), ("wide.mha", "int32", True)]:
        image = sitk.GetImageFromArray(numbers(dtype).transpose(2, 1, 0))
        image.SetSpacing([0.7, 0.8, 2.5])
        image.SetOrigin([10.5, -20.25, 30.0])
        image.SetDirection(rotation(0.2, -0.3, 0.4).flatten().tolist())
        sitk.WriteImage(image, str(OUT / name), packed)
        values, affine = of_sitk(sitk.ReadImage(str(OUT / name)))
        say(name, "SimpleITK", affine, values)


def lists():
    """Headers whose voxels lie in several files; ITK reads them, and the files are made by hand."""
    data = numbers("int16", (5, 4, 6))
    slices = [data[:, :, k].flatten(order="F").tobytes() for k in range(6)]
    for k in range(6):
        (OUT / f"slice{k + 8:02d}.raw").write_bytes(slices[k])
        (OUT / f"slice{k + 8:02d}.gz").write_bytes(gzip.compress(slices[k], mtime=0))
    for k in range(2):
        (OUT / f"half{k}.raw").write_bytes(b"12345" + b"".join(slices[3 * k:3 * k + 3]))
    nrrd_header = ("NRRD0005\ntype: short\ndimension: 3\nsizes: 5 4 6\nspace: left-posterior-superior\nendian: little\n"
                   "space directions: (0.7,0,0) (0,0.8,0) (0,0,2.5)\nspace origin: (1,2,3)\n")
    meta_header = ("ObjectType = Image\nNDims = 3\nDimSize = 5 4 6\nElementType = MET_SHORT\nElementSpacing = 0.7 0.8 2.5\n"
                   "Offset = 1 2 3\nElementByteOrderMSB = False\n")
    names = [f"slice{k + 8:02d}.raw" for k in range(6)]
    for name, text in [
        ("list.nhdr", nrrd_header + "encoding: raw\ndata file: LIST\n" + "\n".join(names) + "\n"),
        ("pattern.nhdr", nrrd_header + "encoding: gzip\ndata file: slice%02d.gz 8 13 1\n"),
        ("slabs.nhdr", nrrd_header + "encoding: raw\nbyte skip: 5\ndata file: LIST 3\nhalf0.raw\nhalf1.raw\n"),
        ("list.mhd", meta_header + "ElementDataFile = LIST\n" + "\n".join(names) + "\n"),
        ("pattern.mhd", meta_header + "ElementDataFile = slice%02d.raw 8 13 1\n"),
    ]:
        (OUT / name).write_text(text)
        values, affine = of_sitk(sitk.ReadImage(str(OUT / name)))
        assert (values == data).all(), name
        say(name, "SimpleITK", affine, values)


# --- NumPy -----------------------------------------------------------------------------------------------------------
def arrays():
    for name, array in [("c.npy", numbers("int16", (3, 4, 5))), ("fortran.npy", np.asfortranarray(numbers("float32", (3, 4, 5)))),
                        ("big.npy", numbers("float64", (3, 4, 5)).astype(">f8")), ("long.npy", numbers("int64", (3, 4, 5)))]:
        np.save(OUT / name, array)
        # An array's last axis is x.
        say(name, "numpy", np.eye(4), np.load(OUT / name).transpose(2, 1, 0))
    np.save(OUT / "frames.npy", numbers("uint8", (2, 3, 4, 5)))
    say("frames.npy", "numpy", np.eye(4), np.load(OUT / "frames.npy")[1].transpose(2, 1, 0), frame=1)


# --- TIFF, by tifffile -----------------------------------------------------------------------------------------------
def tiffs():
    for name, dtype, options in [
        ("pages.tif", "uint8", {}), ("deflate.tif", "uint16", {"compression": "zlib", "predictor": True}),
        ("signed.tif", "int16", {}), ("big.tif", "uint16", {"byteorder": ">", "bigtiff": True}),
        ("tiled.tif", "float32", {"tile": (16, 16), "compression": "zlib"}), ("wide.tif", "uint32", {}),
    ]:
        tifffile.imwrite(OUT / name, numbers(dtype, (3, 4, 5)), photometric="minisblack", metadata=None, **options)
        say(name, "tifffile", np.eye(4), tifffile.imread(OUT / name).transpose(2, 1, 0))
    tifffile.imwrite(OUT / "imagej.tif", numbers("uint16", (3, 4, 5)), imagej=True, resolution=(4.0, 2.0),
                     metadata={"spacing": 2.5, "unit": "um", "axes": "ZYX"})
    say("imagej.tif", "tifffile", np.diag([0.25e-3, 0.5e-3, 2.5e-3, 1]), tifffile.imread(OUT / "imagej.tif").transpose(2, 1, 0))
    tifffile.imwrite(OUT / "ome.ome.tif", numbers("uint8", (3, 4, 5)), metadata={
        "axes": "ZYX", "PhysicalSizeX": 0.5, "PhysicalSizeXUnit": "µm", "PhysicalSizeY": 0.25, "PhysicalSizeYUnit": "µm",
        "PhysicalSizeZ": 0.002, "PhysicalSizeZUnit": "mm"}, photometric="minisblack")
    say("ome.ome.tif", "tifffile", np.diag([0.5e-3, 0.25e-3, 2e-3, 1]), tifffile.imread(OUT / "ome.ome.tif").transpose(2, 1, 0))
    folder = OUT / "tiff_folder"
    folder.mkdir()
    data = numbers("uint16", (11, 4, 5))
    for k, page in enumerate(data):
        tifffile.imwrite(folder / f"slice{k}.tif", page, metadata=None)
    say("tiff_folder", "tifffile", np.eye(4), data.transpose(2, 1, 0))


# --- Analyze, by nibabel ---------------------------------------------------------------------------------------------
def analyzes():
    for name, kind in [("plain.hdr", nibabel.AnalyzeImage), ("spm.img", nibabel.Spm99AnalyzeImage)]:
        image = kind(numbers("int16"), np.diag([-0.7, 0.8, 2.5, 1.0]))
        if kind is nibabel.Spm99AnalyzeImage:
            image = kind(numbers("float32"), np.diag([-0.7, 0.8, 2.5, 1.0]))
            image.set_data_dtype(np.int16)
        image.to_filename(OUT / name)
        (OUT / name).with_suffix(".mat").unlink(missing_ok=True)
        back = kind.from_filename(OUT / name)
        say(name, "nibabel", back.header.get_base_affine(), back.get_fdata())


# --- DICOM, by pydicom; read back by SimpleITK (GDCM) where it says nothing else --------------------------------------
STUDY = "1.2.826.0.1.3680043.8.498.1"


def dicom_file(path, pixels, position, orientation, *, series=1, number=1, syntax=ExplicitVRLittleEndian, bits=16,
               slope="1", intercept="-1024", spacing=(0.8, 0.7), photometric="MONOCHROME2", modality="CT", **more):
    meta = FileMetaDataset()
    meta.MediaStorageSOPClassUID = CTImageStorage
    meta.MediaStorageSOPInstanceUID = f"{STUDY}.{series}.{number}"
    meta.TransferSyntaxUID = syntax
    ds = FileDataset(str(path), {}, file_meta=meta, preamble=b"\0" * 128,
                     is_implicit_VR=syntax == ImplicitVRLittleEndian, is_little_endian=syntax != ExplicitVRBigEndian)
    ds.SOPClassUID, ds.SOPInstanceUID = CTImageStorage, meta.MediaStorageSOPInstanceUID
    ds.StudyInstanceUID, ds.SeriesInstanceUID = STUDY, f"{STUDY}.{series}"
    ds.PatientName, ds.PatientID, ds.PatientBirthDate = "Secret^Person", "S3CR3T", "19700101"
    ds.Modality, ds.SeriesNumber, ds.InstanceNumber = modality, series, number
    ds.SeriesDescription = f"Thorax {series}"
    ds.ImagePositionPatient = [f"{v:.8g}" for v in position]
    ds.ImageOrientationPatient = [f"{v:.10f}"[:16] for v in orientation]
    ds.PixelSpacing = list(spacing)
    ds.SliceThickness = 2.5
    ds.SamplesPerPixel, ds.PhotometricInterpretation = 1, photometric
    ds.Rows, ds.Columns = pixels.shape
    ds.BitsAllocated, ds.BitsStored, ds.HighBit = 8 * pixels.dtype.itemsize, bits, bits - 1
    ds.PixelRepresentation = int(np.issubdtype(pixels.dtype, np.signedinteger))
    ds.RescaleSlope, ds.RescaleIntercept = slope, intercept
    for key, value in more.items():
        setattr(ds, key, value)
    if syntax in (RLELossless, JPEGLSLossless, JPEG2000Lossless):
        ds.file_meta.TransferSyntaxUID = ExplicitVRLittleEndian
        ds.set_pixel_data(pixels, photometric, bits)
        ds.PixelRepresentation = int(np.issubdtype(pixels.dtype, np.signedinteger))
        ds.compress(syntax, generate_instance_uid=False)
    else:
        order = ">" if syntax == ExplicitVRBigEndian else "<"
        ds.PixelData = pixels.astype(pixels.dtype.newbyteorder(order)).tobytes()
        ds["PixelData"].VR = "OW"
    ds.save_as(path, enforce_file_format=True)


def series_by_itk(folder):
    reader = sitk.ImageSeriesReader()
    reader.SetFileNames(sitk.ImageSeriesReader.GetGDCMSeriesFileNames(str(folder)))
    return of_sitk(reader.Execute())


def dicoms():
    r = rotation(0.2, -0.3, 0.4)
    row, column, normal = r[:, 0], r[:, 1], r[:, 2]
    orientation = [*row, *column]
    origin = np.array([10.5, -20.25, 30.0])

    def series(name, data, along=normal * 2.5, depths=None, read_back=True, **options):
        """One file a slice; names count down where positions go up."""
        folder = OUT / name
        folder.mkdir()
        for k in range(data.shape[2]):
            depth = k if depths is None else depths[k]
            dicom_file(folder / f"{90 - k}.dcm", np.ascontiguousarray(data[:, :, k].T), origin + along * depth, orientation,
                       number=k + 1, **options)
        if read_back:
            values, affine = series_by_itk(folder)
            say(name, "SimpleITK", affine, values)
        return folder

    twelve = (numbers("uint16") % 4096).astype("uint16")
    series("dicom_oblique", twelve, bits=12)
    series("dicom_signed_implicit", numbers("int16"), syntax=ImplicitVRLittleEndian, slope="0.5", intercept="3")
    series("dicom_big", twelve, bits=12, syntax=ExplicitVRBigEndian)
    series("dicom_deflated", twelve, bits=12, syntax=DeflatedExplicitVRLittleEndian)
    # Packed without loss: the values are those that were packed.
    affine = np.eye(4)
    affine[:3] = np.column_stack([row * 0.7, column * 0.8, normal * 2.5, origin])
    x, y, z = np.indices((40, 36, 3))
    smooth = (500 + 50 * x + 20 * y * z + numbers("uint16", (40, 36, 3)) % 8).astype("uint16")
    for name, syntax, data, bits in [
        ("dicom_rle", RLELossless, twelve, 12), ("dicom_jpegls", JPEGLSLossless, smooth, 12),
        ("dicom_j2k", JPEG2000Lossless, smooth, 12),
        ("dicom_j2k_signed", JPEG2000Lossless, smooth.astype("int16") - np.int16(2000), 16),
        ("dicom_rle_signed", RLELossless, numbers("int16"), 16),
    ]:
        series(name, data, read_back=False, syntax=syntax, bits=bits)
        say(name, "pydicom", LPS @ affine, data.astype(float) - 1024)
    # JPEG lossless, by ITK's own writer.
    folder = OUT / "dicom_jpeg_lossless"
    folder.mkdir()
    for k in range(3):
        source = sitk.ReadImage(str(OUT / "dicom_oblique" / f"{90 - k}.dcm"))
        writer = sitk.ImageFileWriter()
        writer.KeepOriginalImageUIDOn()
        writer.SetImageIO("GDCMImageIO")
        writer.SetUseCompression(True)
        writer.SetCompressor("JPEG")
        writer.SetFileName(str(folder / f"{k}.dcm"))
        writer.Execute(source)
    values, by_itk = series_by_itk(folder)
    say("dicom_jpeg_lossless", "SimpleITK", by_itk, values)
    # A tilted gantry: slices shift as they go up. ITK has no sheared grids: by the definition of the attributes.
    leaning = normal * 2.5 + column * 0.9
    data = twelve
    series("dicom_tilted", data, along=leaning, read_back=False, bits=12)
    affine[:3, 2] = leaning
    say("dicom_tilted", "definition", LPS @ affine, data.astype(float) - 1024)
    # One slice of five is missing: the mean of its neighbours.
    five = (numbers("uint16", (5, 4, 5)) % 4096).astype("uint16")
    folder = series("dicom_missing", five, read_back=False, bits=12)
    (folder / "88.dcm").unlink()
    filled = five.astype(float) - 1024
    filled[:, :, 2] = (filled[:, :, 1] + filled[:, :, 3]) / 2
    affine[:3, 2] = normal * 2.5
    say("dicom_missing", "definition", LPS @ affine, filled, warning="resampled")
    # The same place twice.
    folder = series("dicom_doubled", twelve, read_back=False, bits=12)
    dicom_file(folder / "again.dcm", np.zeros((4, 5), "uint16"), origin, orientation, number=77, bits=12)
    say("dicom_doubled", "definition", LPS @ affine, twelve.astype(float) - 1024, warning="repeat the position")
    # Padding beyond the scanner's circle.
    padded = np.maximum(numbers("int16"), -1000)
    bare = padded.copy()
    padded[0, :, :] = -2000
    series("dicom_padded", padded, read_back=False, PixelPaddingValue=-2000, intercept="0")
    bare[0, :, :] = padded[1:].min()
    say("dicom_padded", "definition", LPS @ affine, bare, warning="padding")
    # Where the scaling falls the smallest value is the largest number; what lies beside padding is no mean with it.
    folder = series("dicom_padded_falling", padded[:, :, [0, 1, 1]], read_back=False, PixelPaddingValue=-2000, slope="-1",
                    intercept="0")
    (folder / "89.dcm").unlink()
    falling = -bare[:, :, [0, 1]].astype(float)
    falling[0, :, :] = falling[1:].min()
    affine[:3, 2] = normal * 5
    say("dicom_padded_falling", "definition", LPS @ affine, falling, warning="padding")
    affine[:3, 2] = normal * 2.5
    # A file of the series that ends early is left out and said.
    folder = series("dicom_damaged", twelve, read_back=False, bits=12)
    whole = (folder / "88.dcm").read_bytes()
    (folder / "88.dcm").write_bytes(whole[:-10])
    say("dicom_damaged", "definition", LPS @ affine, twelve[:, :, :2].astype(float) - 1024, warning="damaged")
    # Slices with scalings of their own, as PET has them.
    folder = OUT / "dicom_pet"
    folder.mkdir()
    scaled = np.zeros(twelve.shape)
    for k in range(3):
        dicom_file(folder / f"{k}.dcm", np.ascontiguousarray(twelve[:, :, k].T), origin + normal * 2.5 * k, orientation,
                   number=k + 1, slope=str(k + 0.5), intercept=str(-k), modality="PT", bits=12)
        scaled[:, :, k] = twelve[:, :, k] * (k + 0.5) - k
    say("dicom_pet", "definition", LPS @ affine, scaled, warning="different scalings")
    # Small values are the bright ones, in what is no CT.
    series("dicom_monochrome1", twelve, read_back=False, bits=12, photometric="MONOCHROME1", modality="CR", intercept="0")
    say("dicom_monochrome1", "definition", LPS @ affine, 4095.0 - twelve, warning="MONOCHROME1")
    # Two series in a folder: a choice is needed.
    folder = series("dicom_two", twelve, read_back=False, bits=12)
    for k in range(2):
        dicom_file(folder / f"other{k}.dcm", np.ascontiguousarray(twelve[:, :, k].T), origin + normal * 2.5 * k, orientation,
                   series=2, number=k + 1, bits=12)
    say("dicom_two", "definition", LPS @ affine, twelve.astype(float) - 1024, series=1)
    say("dicom_two", "definition", LPS @ affine, twelve[:, :, :2].astype(float) - 1024, series=2)
    say("dicom_two/other0.dcm", "definition", LPS @ affine, twelve[:, :, :2].astype(float) - 1024)
    # Two volumes in one series, one after the other in time.
    folder = OUT / "dicom_times"
    folder.mkdir()
    for t in range(2):
        for k in range(3):
            dicom_file(folder / f"{t}{k}.dcm", np.ascontiguousarray(twelve[:, :, k].T) + np.uint16(100 * t),
                       origin + normal * 2.5 * k, orientation, number=10 * t + k, bits=13, AcquisitionNumber=t)
    for t in range(2):
        say("dicom_times", "definition", LPS @ affine, twelve.astype(float) + 100 * t - 1024, frame=t)
    enhanced(twelve, origin, row, column, normal, affine)


def enhanced(data, origin, row, column, normal, affine):
    """An enhanced CT of one file, its frames in no order of their positions."""
    meta = FileMetaDataset()
    meta.MediaStorageSOPClassUID = EnhancedCTImageStorage
    meta.MediaStorageSOPInstanceUID = f"{STUDY}.9.1"
    meta.TransferSyntaxUID = ExplicitVRLittleEndian
    ds = FileDataset("", {}, file_meta=meta, preamble=b"\0" * 128)
    ds.SOPClassUID, ds.SOPInstanceUID = EnhancedCTImageStorage, meta.MediaStorageSOPInstanceUID
    ds.SeriesInstanceUID, ds.StudyInstanceUID, ds.Modality, ds.SeriesNumber = f"{STUDY}.9", STUDY, "CT", 9
    ds.SamplesPerPixel, ds.PhotometricInterpretation = 1, "MONOCHROME2"
    ds.Rows, ds.Columns, ds.NumberOfFrames = 4, 5, 3
    ds.BitsAllocated, ds.BitsStored, ds.HighBit, ds.PixelRepresentation = 16, 12, 11, 0
    shared, measures, plane, values = Dataset(), Dataset(), Dataset(), Dataset()
    measures.PixelSpacing, measures.SliceThickness = [0.8, 0.7], 2.5
    plane.ImageOrientationPatient = [f"{v:.10f}"[:16] for v in (*row, *column)]
    values.RescaleSlope, values.RescaleIntercept, values.RescaleType = "1", "-1024", "HU"
    shared.PixelMeasuresSequence = Sequence([measures])
    shared.PlaneOrientationSequence = Sequence([plane])
    shared.PixelValueTransformationSequence = Sequence([values])
    ds.SharedFunctionalGroupsSequence = Sequence([shared])
    order, frames = [2, 0, 1], []
    for k in order:
        frame, position = Dataset(), Dataset()
        position.ImagePositionPatient = [f"{v:.8g}" for v in origin + normal * 2.5 * k]
        frame.PlanePositionSequence = Sequence([position])
        frames.append(frame)
    ds.PerFrameFunctionalGroupsSequence = Sequence(frames)
    ds.PixelData = b"".join(np.ascontiguousarray(data[:, :, k].T).tobytes() for k in order)
    ds["PixelData"].VR = "OW"
    ds.save_as(OUT / "enhanced.dcm", enforce_file_format=True)
    say("enhanced.dcm", "definition", LPS @ affine, data.astype(float) - 1024)


def dicom_rarities():
    """What few files have: sequences of an unknown type, tables of values, positions of one decimal, floats."""
    orientation, origin = [1, 0, 0, 0, 1, 0], np.array([10.5, -20.25, 30.0])
    affine = LPS @ np.array([[0.7, 0, 0, 10.5], [0, 0.8, 0, -20.25], [0, 0, 2.5, 30], [0, 0, 0, 1]])
    data = (numbers("uint16") % 1024).astype("uint16")

    def files(name, spacing=2.5, decimals=4, change=lambda ds: None, **options):
        folder = OUT / name
        shutil.rmtree(folder, ignore_errors=True)
        folder.mkdir()
        for k in range(3):
            path = folder / f"{k}.dcm"
            dicom_file(path, np.ascontiguousarray(data[:, :, k].T), origin + np.array([0, 0, spacing * k]), orientation,
                       number=k + 1, **options)
            ds = pydicom.dcmread(path)
            ds.ImagePositionPatient = ["10.5", "-20.25" if decimals > 1 else "-20.2", f"{30 + spacing * k:.{decimals}f}"]
            change(ds)
            ds.save_as(path, enforce_file_format=True)
        return folder

    def unknown(ds):
        # The items of a sequence of unknown type are in the implicit syntax: one within another here.
        inner = bytes.fromhex("feff00e0ffffffff" "08005011" "0c000000") + b"1.2.840.1234" + bytes.fromhex("feff0de000000000")
        nested = bytes.fromhex("feff00e0ffffffff" "08004011" "ffffffff") + inner + bytes.fromhex("feffdde000000000feff0de000000000")
        ds.add_new((0x0009, 0x1002), "UN", nested)
        ds[0x0009, 0x1002].is_undefined_length = True
        ds.add_new((0x0009, 0x0010), "LO", "UMBRAVOX TEST")
    files("dicom_unknown", change=unknown, bits=10)
    say("dicom_unknown", "definition", affine, data.astype(float) - 1024)

    def table(ds):
        item = Dataset()
        values = (np.arange(300) ** 2 // 7).astype("uint16")
        item.add_new((0x0028, 0x3002), "US", [300, 100, 16])
        item.add_new((0x0028, 0x3006), "OW", values.tobytes())
        item.add_new((0x0028, 0x3004), "LO", "OD")
        ds.ModalityLUTSequence = Sequence([item])
        del ds.RescaleSlope, ds.RescaleIntercept
    folder = files("dicom_table", change=table, bits=10, modality="CR")
    mapped = np.stack([pydicom.pixels.apply_modality_lut(ds.pixel_array, ds).T
                       for ds in (pydicom.dcmread(folder / f"{k}.dcm") for k in range(3))], 2)
    say("dicom_table", "pydicom", affine, mapped, warning="modality LUT")

    shutil.rmtree(OUT / "dicom_rounded", ignore_errors=True)
    (OUT / "dicom_rounded").mkdir()
    seven = (numbers("uint16", (5, 4, 7)) % 1024).astype("uint16")
    for k in range(7):
        path = OUT / "dicom_rounded" / f"{k}.dcm"
        dicom_file(path, np.ascontiguousarray(seven[:, :, k].T), origin, orientation, number=k + 1, bits=10)
        ds = pydicom.dcmread(path)
        ds.ImagePositionPatient = ["10.5", "-20.2", f"{30 + 0.15 * k:.1f}"]
        ds.save_as(path, enforce_file_format=True)
    even = LPS @ np.array([[0.7, 0, 0, 10.5], [0, 0.8, 0, -20.2], [0, 0, 0.9 / 6, 30], [0, 0, 0, 1]])
    say("dicom_rounded", "definition", even, seven.astype(float) - 1024)

    for name, dtype, tag, vr in [("dicom_float", "float32", (0x7FE0, 0x0008), "OF"), ("dicom_double", "float64", (0x7FE0, 0x0009), "OD")]:
        values = numbers(dtype)
        slices = iter(range(3))

        def floats(ds):
            del ds.PixelData, ds.BitsStored, ds.HighBit, ds.PixelRepresentation
            ds.BitsAllocated = 8 * values.dtype.itemsize
            ds.add_new(tag, vr, np.ascontiguousarray(values[:, :, next(slices)].T).tobytes())
        folder = files(name, change=floats, slope="2", intercept="1", modality="MR")
        back = np.stack([pydicom.dcmread(folder / f"{k}.dcm").pixel_array.T for k in range(3)], 2)
        say(name, "pydicom", affine, back.astype("float64") * 2 + 1)


def dicom_segmentations():
    """A segmentation of one bit a pixel: two segments in slices 0, 1 and 3; slice 2 is empty."""
    affine = LPS @ np.array([[0.7, 0, 0, 10.5], [0, 0.8, 0, -20.25], [0, 0, 2.5, 30], [0, 0, 0, 1]])
    rng = np.random.default_rng(7)
    frames = [(1, 0, rng.random((4, 5)) < 0.5), (2, 0, rng.random((4, 5)) < 0.3), (1, 1, rng.random((4, 5)) < 0.5),
              (2, 3, rng.random((4, 5)) < 0.5)]
    values = np.zeros((5, 4, 4))
    for segment, k, mask in frames:
        values[:, :, k][mask.T] = segment
    path = OUT / "dicom_segments.dcm"
    dicom_file(path, np.zeros((4, 5), "uint8"), [10.5, -20.25, 30], [1, 0, 0, 0, 1, 0], bits=8, modality="SEG")
    ds = pydicom.dcmread(path)
    del ds.ImagePositionPatient, ds.ImageOrientationPatient, ds.PixelSpacing, ds.SliceThickness, ds.RescaleSlope, ds.RescaleIntercept
    ds.BitsAllocated, ds.BitsStored, ds.HighBit, ds.NumberOfFrames = 1, 1, 0, len(frames)
    ds.SegmentationType = "BINARY"

    def item(**values):
        own = Dataset()
        for key, value in values.items():
            setattr(own, key, value)
        return Sequence([own])
    # Red and blue of sRGB in CIE L*a*b* with the white D50 (brucelindbloom.com), encoded as PS3.3 C.10.7.1.1 says.
    colors = {1: (54.2905, 80.8049, 69.8910), 2: (29.5683, 68.2874, -112.0297)}
    ds.SegmentSequence = Sequence([item(
        SegmentNumber=n, SegmentLabel=name,
        RecommendedDisplayCIELabValue=[round(v * 65535) for v in (l / 100, (a + 128) / 255, (b + 128) / 255)])[0]
        for n, name, (l, a, b) in [(1, "Left lung", colors[1]), (2, "Rib", colors[2])]])
    ds.SharedFunctionalGroupsSequence = item(
        PlaneOrientationSequence=item(ImageOrientationPatient=[1, 0, 0, 0, 1, 0]),
        PixelMeasuresSequence=item(PixelSpacing=[0.8, 0.7], SliceThickness=2.5))
    ds.PerFrameFunctionalGroupsSequence = Sequence([item(
        SegmentIdentificationSequence=item(ReferencedSegmentNumber=segment),
        PlanePositionSequence=item(ImagePositionPatient=[10.5, -20.25, 30 + 2.5 * k]))[0] for segment, k, _ in frames])
    bits = np.concatenate([mask.ravel() for _, _, mask in frames])
    ds.PixelData = np.packbits(bits, bitorder="little").tobytes()
    ds["PixelData"].VR = "OB"
    ds.save_as(path, enforce_file_format=True)
    assert (np.concatenate([f.ravel() for f in pydicom.dcmread(path).pixel_array]) == bits).all()
    say("dicom_segments.dcm", "definition", affine, values, warning="belong to several segments")

    # A label map of 16 bits, compressed as RLE; slice 2 is empty and has no frame.
    values[0, 0, 3] = 300
    own = ds.PerFrameFunctionalGroupsSequence
    ds.PerFrameFunctionalGroupsSequence = Sequence([own[0], own[2], own[3]])
    for frame in ds.PerFrameFunctionalGroupsSequence:
        del frame.SegmentIdentificationSequence
    ds.BitsAllocated, ds.BitsStored, ds.HighBit, ds.NumberOfFrames, ds.SegmentationType = 16, 16, 15, 3, "LABELMAP"
    ds.SegmentSequence[1].SegmentNumber = 300
    del ds.SegmentSequence[1].RecommendedDisplayCIELabValue
    ds.compress(RLELossless, np.stack([values[:, :, k].T for k in (0, 1, 3)]).astype("uint16"))
    ds.save_as(OUT / "dicom_labelmap.dcm", enforce_file_format=True)
    say("dicom_labelmap.dcm", "definition", affine, values)


# --- OME-Zarr, by ome-zarr and zarr ----------------------------------------------------------------------------------
def zarr_image(name, array, fmt, units, **more):
    """An image of two levels; `array` has the axes that `units` names."""
    axes = [{"name": axis, "type": {"t": "time", "c": "channel"}.get(axis, "space"), **({"unit": unit} if unit else {})}
            for axis, unit in units.items()]
    levels = [array, array[..., ::2, ::2]]
    scale = [2.5 if axis == "z" else 0.5 if axis in "xy" else 1.0 for axis in units]
    transformations = [[{"type": "scale", "scale": [s * factor if axis in "xy" else s for axis, s in zip(units, scale)]},
                        {"type": "translation", "translation": [(10.0 + at + (factor - 1) * 0.25) if axis in "xyz" else 0.0
                                                                for at, axis in enumerate(units)]}]
                       for factor in (1, 2)]
    root = zarr.open_group(str(OUT / name), mode="w", zarr_format=fmt.zarr_format)
    ome_zarr.writer.write_multiscale(levels, root, fmt=fmt, axes=axes, coordinate_transformations=transformations,
                                     storage_options=more)
    return root


def of_zarr(root, level):
    """Values (x, y, z) of the first frame, and the affine, as the library reads the metadata back."""
    said = dict(root.attrs)
    said = said.get("ome", said)["multiscales"][0]
    dataset = said["datasets"][level]
    axes = [axis["name"] for axis in said["axes"]]
    mm = [{"micrometer": 1e-3, "millimeter": 1.0, "nanometer": 1e-6}.get(axis.get("unit"), 1.0) for axis in said["axes"]]
    scale, translation = (t[t["type"]] for t in dataset["coordinateTransformations"])
    affine = np.eye(4)
    for row, axis in enumerate("xyz"):
        at = axes.index(axis)
        affine[row, row], affine[row, 3] = scale[at] * mm[at], translation[at] * mm[at]
    return root[dataset["path"]][:], affine


def zarrs():
    v04, v05 = ome_zarr.format.FormatV04(), ome_zarr.format.FormatV05()
    micro = {axis: "micrometer" for axis in "zyx"}
    root = zarr_image("two.ome.zarr", numbers("int16", (3, 6, 8)), v04, micro, chunks=(2, 3, 4))
    for level in (0, 1):
        array, affine = of_zarr(root, level)
        say("two.ome.zarr", "ome-zarr 0.4", affine, array.transpose(2, 1, 0), level=level, warning=f"level {level}")
    root = zarr_image("three.ome.zarr", numbers("uint16", (2, 3, 2, 4, 6)), v05,
                      {"t": "second", "c": None, "z": "nanometer", "y": "millimeter", "x": "micrometer"}, chunks=(1, 2, 2, 3, 4))
    array, affine = of_zarr(root, 0)
    say("three.ome.zarr", "ome-zarr 0.5", affine, array[1, 2].transpose(2, 1, 0), frame=5, warning="frame 5")
    # Smooth, so that every packer finds something, and long enough that blosc cuts its blocks.
    smooth = (np.arange(8 * 8 * 16).reshape(8, 8, 16) // 3 % 200 * 7).astype("uint16")
    blosc = {f"{cname}_{shuffle}": numcodecs.Blosc(cname=cname, clevel=9, shuffle=shuffle)
             for cname in ("blosclz", "lz4", "zlib", "zstd") for shuffle in (0, 1, 2)}
    for name, compressor in {**blosc, "zlib": numcodecs.Zlib(), "gzip": numcodecs.GZip(), "zstd": numcodecs.Zstd(),
                             "plain": None}.items():
        path = f"v2_{name}.zarr"
        zarr.create_array(str(OUT / path), data=smooth, chunks=(8, 8, 16), compressors=compressor, zarr_format=2, filters=None)
        back = zarr.open_array(str(OUT / path), mode="r")[:]
        assert (back == smooth).all()
        say(path, "zarr", np.eye(4), back.transpose(2, 1, 0), warning="single array")
    # In Fortran's order and with the highest byte first; chunks that are not there; several axes in front.
    array = zarr.create_array(str(OUT / "v2_turned.zarr"), shape=(2, 5, 4, 3), chunks=(2, 2, 3, 2), dtype=">i4", order="F",
                              zarr_format=2, fill_value=-7, compressors=numcodecs.Blosc("lz4"), filters=None,
                              chunk_key_encoding={"name": "v2", "separator": "/"})
    array[:, :2] = numbers("int32", (2, 5, 4, 3))[:, :2]
    say("v2_turned.zarr", "zarr", np.eye(4), array[1].transpose(2, 1, 0), frame=1)
    codecs = zarr.codecs
    for name, dtype, more in [
        ("v3_sharded.zarr", "float32", {"shards": (4, 4, 8), "chunks": (2, 4, 4), "compressors": codecs.BloscCodec(cname="zstd")}),
        ("v3_checked.zarr", "uint8", {"chunks": (3, 4, 5), "compressors": [codecs.GzipCodec(), codecs.Crc32cCodec()]}),
        ("v3_turned.zarr", "float64", {"chunks": (3, 2, 5), "filters": codecs.TransposeCodec(order=(1, 2, 0)),
                                       "serializer": codecs.BytesCodec(endian="big"), "compressors": codecs.ZstdCodec(level=19)}),
        ("v3_plain.zarr", "int8", {"chunks": (3, 4, 5), "compressors": None,
                                   "chunk_key_encoding": {"name": "v2", "separator": "."}}),
    ]:
        data = numbers(dtype, (7, 6, 9))
        array = zarr.create_array(str(OUT / name), shape=data.shape, dtype=dtype, fill_value=3, **more)
        # One corner is not written: chunks of the fill value.
        array[:4], array[4:, :4] = data[:4], data[4:, :4]
        say(name, "zarr", np.eye(4), array[:].transpose(2, 1, 0))


# --- VTK images, by VTK ----------------------------------------------------------------------------------------------
def vtis():
    for name, dtype, mode, packed, wide in [
        ("appended.vti", "int16", "appended", True, False), ("raw.vti", "float32", "raw", False, True),
        ("raw_packed.vti", "uint16", "raw", True, True), ("inline.vti", "uint8", "binary", True, False),
        ("text.vti", "float64", "ascii", False, False), ("cells.vti", "int32", "binary", False, False),
        ("pieces.vti", "int16", "binary", True, False),
    ]:
        data = numbers(dtype)
        image = vtk.vtkImageData()
        grown = 1 if name == "cells.vti" else 0
        image.SetExtent(2, 6 + grown, -1, 2 + grown, 0, 2 + grown)
        image.SetSpacing(0.7, 0.8, 2.5)
        image.SetOrigin(10.5, -20.25, 30.0)
        image.SetDirectionMatrix(rotation(0.2, -0.3, 0.4).flatten().tolist())
        scalars = vtk.util.numpy_support.numpy_to_vtk(data.flatten(order="F"), deep=True)
        scalars.SetName("density")
        vectors = vtk.util.numpy_support.numpy_to_vtk(np.zeros((data.size, 3)), deep=True)
        vectors.SetName("gradient")
        of = image.GetCellData() if grown else image.GetPointData()
        of.AddArray(vectors)
        of.SetScalars(scalars)
        writer = vtk.vtkXMLImageDataWriter()
        writer.SetFileName(str(OUT / name))
        writer.SetInputData(image)
        {"appended": writer.SetDataModeToAppended, "raw": writer.SetDataModeToAppended, "binary": writer.SetDataModeToBinary,
         "ascii": writer.SetDataModeToAscii}[mode]()
        writer.SetEncodeAppendedData(mode == "appended")
        (writer.SetCompressorTypeToZLib if packed else writer.SetCompressorTypeToNone)()
        (writer.SetHeaderTypeToUInt64 if wide else writer.SetHeaderTypeToUInt32)()
        if name == "pieces.vti":
            writer.SetNumberOfPieces(2)
        writer.Write()
        reader = vtk.vtkXMLImageDataReader()
        reader.SetFileName(str(OUT / name))
        reader.Update()
        back = reader.GetOutput()
        values = vtk.util.numpy_support.vtk_to_numpy((back.GetCellData() if grown else back.GetPointData()).GetScalars())
        matrix = back.GetIndexToPhysicalMatrix()
        affine = np.array([[matrix.GetElement(row, column) for column in range(4)] for row in range(4)])
        # The first voxel is at the extent's beginning, a cell in its middle.
        affine[:3, 3] = affine[:3, :3] @ (np.array([2, -1, 0]) + 0.5 * grown) + affine[:3, 3]
        say(name, "VTK", affine, values.reshape((5, 4, 3), order="F"))


MAKERS = (nrrds, slicer_layers, metaimages, lists, arrays, tiffs, analyzes, dicoms, dicom_rarities, dicom_segmentations, zarrs, vtis)

if __name__ == "__main__":
    kinds = sys.argv[1:]
    old = []
    if kinds:
        # What other kinds have made is kept.
        old = json.loads((HERE / "expected.json").read_text())
    else:
        shutil.rmtree(OUT, ignore_errors=True)
        OUT.mkdir()
    for make in MAKERS:
        if not kinds or make.__name__ in kinds:
            make()
    made = {e["name"] for e in expected}
    expected = [e for e in old if e["name"] not in made] + expected
    (HERE / "expected.json").write_text("[\n" + ",\n".join(json.dumps(e) for e in expected) + "\n]\n")
    print(len(expected), "files")
