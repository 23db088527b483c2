"""Writing SOG scenes, version 2, as one archive. The layout is that of `reader`."""

from __future__ import annotations

import json
import math
import zipfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from ...errors import SplatFormatError
from ...support.atomic import atomic_write
from ..ply.write import log_scales
from ..scene import SH_COEFFICIENTS, Float32Array, GaussianScene, check_near
from ..turn import turned
from .codebook import codebook, palette
from .container import META, Bytes
from .reader import FIRST_TAG, ORIENTATION, PALETTE_COLUMNS

STEPS = 65535  # of a position along each axis
LOSSLESS = 101  # what OpenCV takes as a quality for it
DATE = (1980, 1, 1, 0, 0, 0)  # the same scene gives the same file
SMALLEST_LOG = -20.0  # of a scale; flat Gaussians have minus infinity
ORDER_BITS = 10


def write_sog(path: str | Path, scene: GaussianScene) -> str:
    """Write `scene`, y down; the file appears whole or not at all. A sentence on how exact it is.

    Lossy: positions keep 16 bits of sign(v) log(1 + |v|) over the scan's range, rotations 8 bits a component, opacities 1/255,
    scales and colours the nearest of 256 values each, SH above degree 0 one of 65536 sets, whose numbers are of 256 values.
    The order of the Gaussians changes, because neighbours beside each other pack better.
    Raises SplatFormatError when the scene's axes can't be turned to the format's, or it lies too far out.
    """
    check_near(scene, ".sog")
    scene = turned(scene, ORIENTATION)
    order = _order(scene.means)
    lost = {"place": 0.0, "sh": 0.0}
    meta: dict[str, Any] = {"version": 2, "asset": {"generator": "GS-SMC for Blender"}, "count": len(scene)}
    if scene.antialiased:
        meta["antialias"] = True
    with atomic_write(path, "wb") as file, zipfile.ZipFile(file, "w", zipfile.ZIP_STORED) as archive:
        for name, picture in _pictures(scene, order, meta, lost):
            archive.writestr(zipfile.ZipInfo(name, DATE), _webp(picture))
        archive.writestr(zipfile.ZipInfo(META, DATE), json.dumps(meta))
    place, sh = lost["place"], lost["sh"]
    return f"The .sog keeps positions to {place:.2g} units, and SH above degree 0 to {sh:.2g} (root mean square)."


def _pictures(
    scene: GaussianScene, order: NDArray[np.intp], meta: dict[str, Any], lost: dict[str, float]
) -> Iterator[tuple[str, Bytes]]:
    """The pictures by their names, while `meta` comes to say what they mean, and `lost` how far off that is."""
    count = len(order)
    means = scene.means[order]
    logs = np.sign(means) * np.log1p(np.abs(means.astype(np.float64)))
    low, high = logs.min(axis=0), logs.max(axis=0)
    span = np.where(high > low, high - low, 1)
    steps = np.rint((logs - low) / span * STEPS).astype(np.uint16)
    for name, part in (("means_l.webp", steps & 255), ("means_u.webp", steps >> 8)):
        yield name, _picture(part.astype(np.uint8), count)
    meta["means"] = {"mins": low.tolist(), "maxs": (low + span).tolist(), "files": ["means_l.webp", "means_u.webp"]}
    back = low + span * (steps / STEPS)
    lost["place"] = float(np.abs(np.sign(back) * np.expm1(np.abs(back)) - means).max())
    book, bytes_ = codebook(np.maximum(log_scales(scene.scales[order]), SMALLEST_LOG).astype(np.float32))
    yield "scales.webp", _picture(bytes_, count)
    meta["scales"] = {"codebook": book.tolist(), "files": ["scales.webp"]}
    yield "quats.webp", _picture(_rotations(scene.rotations[order]), count)
    meta["quats"] = {"files": ["quats.webp"]}
    book, bytes_ = codebook(scene.sh[order, 0])
    shares = np.rint(scene.opacities[order, None] * 255).astype(np.uint8)
    yield "sh0.webp", _picture(np.concatenate([bytes_, shares], axis=1), count)
    meta["sh0"] = {"codebook": book.tolist(), "files": ["sh0.webp"]}
    if scene.sh_degree:
        yield from _rest(scene, order, meta, lost)


def _rest(
    scene: GaussianScene, order: NDArray[np.intp], meta: dict[str, Any], lost: dict[str, float]
) -> Iterator[tuple[str, Bytes]]:
    """The two pictures of the SH above degree 0: the palette, and which entry each Gaussian has."""
    each = SH_COEFFICIENTS[scene.sh_degree] - 1
    vectors = scene.sh[order, 1:].reshape(len(order), -1)
    entries, labels = palette(vectors)
    book, bytes_ = codebook(entries)
    lost["sh"] = float(np.sqrt(np.mean((book[bytes_][labels] - vectors) ** 2)))
    rows = math.ceil(len(entries) / PALETTE_COLUMNS)
    whole = np.zeros((rows * PALETTE_COLUMNS, each, 3), np.uint8)
    whole[: len(entries)] = bytes_.reshape(-1, each, 3)
    yield "shN_centroids.webp", whole.reshape(rows, PALETTE_COLUMNS * each, 3)
    pair = np.stack([labels & 255, labels >> 8, np.zeros_like(labels)], axis=1).astype(np.uint8)
    yield "shN_labels.webp", _picture(pair, len(order))
    files = ["shN_centroids.webp", "shN_labels.webp"]
    meta["shN"] = {"count": len(entries), "bands": scene.sh_degree, "codebook": book.tolist(), "files": files}


def _rotations(rotations: Float32Array) -> Bytes:
    """Three components in the order w x y z without the largest one, which is positive, and its number (n, 4)."""
    largest = np.abs(rotations).argmax(axis=1)
    own = np.take_along_axis(rotations, largest[:, None], axis=1)
    signed = rotations * np.where(own < 0, -1, 1)
    others = np.array([[i for i in range(4) if i != top] for top in range(4)])[largest]
    small = np.take_along_axis(signed, others, axis=1) * np.sqrt(2) * 0.5 + 0.5
    return np.concatenate([np.clip(np.rint(small * 255), 0, 255), (largest + FIRST_TAG)[:, None]], axis=1).astype(np.uint8)


def _picture(rows: Bytes, count: int) -> Bytes:
    """Bytes (count, 3 or 4) as a picture that is about square, its rest zero."""
    width = 4 * math.ceil(math.sqrt(count) / 4)
    height = math.ceil(count / width)
    out = np.zeros((height * width, rows.shape[1]), np.uint8)
    out[:count] = rows
    return out.reshape(height, width, -1)


def _webp(picture: Bytes) -> bytes:
    order = [2, 1, 0, 3][: picture.shape[2]]
    done, data = cv2.imencode(".webp", np.ascontiguousarray(picture[..., order]), [cv2.IMWRITE_WEBP_QUALITY, LOSSLESS])
    if not done:
        raise SplatFormatError("The pictures of the .sog can't be packed by this OpenCV; write the scan as .ply.")
    return data.tobytes()


def _order(means: Float32Array) -> NDArray[np.intp]:
    """The Gaussians along a curve that fills space (Morton, 1966): the bits of x, y and z by turns."""
    low, high = means.min(axis=0), means.max(axis=0)
    cells = ((means - low) / np.where(high > low, high - low, 1) * ((1 << ORDER_BITS) - 1)).astype(np.uint32)
    code = np.zeros(len(means), np.uint32)
    for bit in range(ORDER_BITS):
        for axis in range(3):
            code |= (cells[:, axis] >> np.uint32(bit) & np.uint32(1)) << np.uint32(3 * bit + axis)
    return np.argsort(code, kind="stable")
