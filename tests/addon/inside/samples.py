"""Small splats and photos, written by hand: not by the code under test."""

import struct

import cv2
import numpy as np


def counts(bpy):
    """How many of each data-block there are: what "scene unchanged" means."""
    kinds = ("objects", "pointclouds", "cameras", "images", "materials", "scenes")
    return {kind: len(getattr(bpy.data, kind)) for kind in kinds}


def random_gaussians(count, degree, seed=0):
    """Raw columns of an INRIA .ply (before activation), as the trainer writes them."""
    rng = np.random.default_rng(seed)
    rest = 3 * ((degree + 1) ** 2 - 1)
    names = ["x", "y", "z", "f_dc_0", "f_dc_1", "f_dc_2", *[f"f_rest_{i}" for i in range(rest)]]
    names += ["opacity", "scale_0", "scale_1", "scale_2", "rot_0", "rot_1", "rot_2", "rot_3"]
    columns = {name: rng.normal(size=count).astype(np.float32) for name in names}
    for axis in range(3):
        columns[f"scale_{axis}"] -= 4
    return columns


def write_ply(path, columns):
    """A binary little-endian .ply with one float property per column; written by hand, not by the code under test."""
    count = len(next(iter(columns.values())))
    header = ["ply", "format binary_little_endian 1.0", f"element vertex {count}"]
    header += [f"property float {name}" for name in columns] + ["end_header", ""]
    body = np.stack(list(columns.values()), axis=1).astype("<f4").tobytes()
    path.write_bytes("\n".join(header).encode() + body)
    return path


def write_photo(path, width=60, height=90, focal_35mm=None, orientation=None):
    """A JPEG (or PNG) with red top half and blue bottom half as stored, and an EXIF block when asked for."""
    pixels = np.zeros((height, width, 3), np.uint8)
    pixels[: height // 2] = (0, 0, 255)
    pixels[height // 2 :] = (255, 0, 0)
    ok, encoded = cv2.imencode(path.suffix, pixels)
    assert ok
    data = encoded.tobytes()
    if focal_35mm or orientation:
        exif = b"Exif\0\0" + _exif(focal_35mm, orientation)
        data = data[:2] + b"\xff\xe1" + struct.pack(">H", len(exif) + 2) + exif + data[2:]
    path.write_bytes(data)
    return path


def _exif(focal_35mm, orientation):
    """A TIFF block: IFD0 with Orientation and the pointer to an Exif IFD that holds FocalLengthIn35mmFilm."""

    def short(tag, value):
        return struct.pack(">HHIHH", tag, 3, 1, value, 0)

    ifd0_size = 2 + 2 * 12 + 4
    ifd0 = struct.pack(">H", 2) + short(0x0112, orientation or 1) + struct.pack(">HHII", 0x8769, 4, 1, 8 + ifd0_size)
    exif = struct.pack(">H", 1) + short(0xA405, focal_35mm or 0) + struct.pack(">I", 0)
    return b"MM\0*" + struct.pack(">I", 8) + ifd0 + struct.pack(">I", 0) + exif
