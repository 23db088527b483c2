"""Niantic's .spz: Gaussians quantised to about 20 bytes (64 with SH) and compressed. Versions 1 to 4 are read.

Positions: 24-bit fixed point (version 1: half floats). Opacities: bytes over 0..1. Colours: f_dc = (byte / 255 - 0.5) / 0.15.
Scales: log scale = byte / 16 - 10. Rotations: versions 1 and 2 the bytes of x y z, w >= 0; from 3 on 2 bits for the largest
of x y z w, then 10 for each other one, sign and 9 bits over 0..sqrt(1/2). SH: (byte - 128) / 128, colour innermost; degree 4
is read up to degree 3. Axes: x right, y up, z back (RUB), unless version 4 declares others. The writer is in spz_write.py.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ..format import Progress, SplatFormat, SplatInfo
from ..scene import SH_COEFFICIENTS, Float32Array, GaussianScene
from .payload import ORIENTATION, Payload, Source, SpzHeader, first_bytes, open_payload, read_spz_header

Bytes = NDArray[np.uint8]
COLOUR_FACTOR = 0.15
SCALE_STEPS, SCALE_OFFSET = 16.0, 10.0
MAX_DEGREE = 3
# The memory for positions grows by this factor, because their number is only a claim until they have been read.
GROWTH = 1.5
SCALES = np.exp(np.arange(256) / SCALE_STEPS - SCALE_OFFSET).astype(np.float32)
W_XYZ = np.array([3, 0, 1, 2])  # from SPZ's order x y z w to w x y z


def detect(header: bytes) -> bool:
    """Whether these first bytes are an SPZ header, plain or behind gzip."""
    return bool(first_bytes(header))


def inspect(path: str | Path) -> SplatInfo:
    """What the header says. Raises SplatFormatError."""
    header = read_spz_header(Path(path))
    return SplatInfo(
        f"spz version {header.version}", header.count, min(header.degree, MAX_DEGREE), header.orientation, header.declared
    )


def read(path: str | Path, progress: Progress | None = None) -> GaussianScene:
    """The scene in the file. `progress` is called with a fraction 0..1 and may raise to stop the reading.

    Raises SplatFormatError, and OSError from the file system.
    """
    return read_source(Path(path), progress)


def read_source(source: Source, progress: Progress | None = None) -> GaussianScene:
    """As `read`, of a file or of the bytes of one."""
    header = read_spz_header(source)
    position, one, colour, scale, rotation, rest = header.widths
    n, coefficients = header.count, SH_COEFFICIENTS[min(header.degree, MAX_DEGREE)]
    done = _Progress(progress, n * sum(header.widths))
    with open_payload(source, header) as payload:
        means = _grown(payload, position, n, _positions(header), done)
        # As many Gaussians have come as the header claims: from here on it may be believed.
        opacities, scales = np.empty((n, 1), np.float32), np.empty((n, 3), np.float32)
        rotations, sh = np.empty((n, 4), np.float32), np.empty((n, coefficients, 3), np.float32)
        _decode(payload, one, opacities, _share, done)
        _decode(payload, colour, sh[:, 0], _colour, done)
        _decode(payload, scale, scales, lambda raw: SCALES[raw], done)
        _decode(payload, rotation, rotations, _smallest_three if header.version >= 3 else _first_three, done)
        _decode(payload, rest, sh[:, 1:], lambda raw: _sh(raw, coefficients - 1), done)
        payload.check_end()
    name = f"spz version {header.version}"
    arrays = (means, scales, rotations, opacities[:, 0], sh)
    made = GaussianScene(*arrays, format=name, orientation=header.orientation, antialiased=header.antialiased)
    return made.checked()


class _Progress:
    """Bytes decoded so far, told as a fraction."""

    def __init__(self, tell: Progress | None, total: int) -> None:
        self._tell, self._total, self._done = tell, total, 0

    def add(self, amount: int) -> None:
        self._done += amount
        if self._tell is not None:
            self._tell(self._done / self._total)


def _grown(payload: Payload, width: int, most: int, decode: Callable[[Bytes], Float32Array], done: _Progress) -> Float32Array:
    """Positions (most, 3). Their memory grows with what comes, so that a header that lies about their number costs none."""
    rows, count = np.empty((0, 3), np.float32), 0
    for raw in payload.blocks(width):
        end = count + len(raw)
        if end > len(rows):
            rows.resize((max(end, min(most, int(GROWTH * len(rows)))), 3), refcheck=False)
        rows[count:end] = decode(raw)
        count = end
        done.add(raw.size)
    return rows


def _decode(payload: Payload, width: int, out: Float32Array, decode: Callable[[Bytes], Float32Array], done: _Progress) -> None:
    at = 0
    for raw in payload.blocks(width):
        out[at : at + len(raw)] = decode(raw)
        at += len(raw)
        done.add(raw.size)


def _positions(header: SpzHeader) -> Callable[[Bytes], Float32Array]:
    def half(raw: Bytes) -> Float32Array:
        return raw.view("<f2").astype(np.float32)

    def fixed(raw: Bytes) -> Float32Array:
        wide = np.zeros((raw.size // 3, 4), np.uint8)
        wide[:, 1:] = raw.reshape(-1, 3)  # in the upper bytes, so that the shift back carries the sign
        return np.asarray((wide.view("<i4") >> 8) * np.float32(2.0**-header.bits), np.float32).reshape(-1, 3)

    return half if header.version == 1 else fixed


def _share(raw: Bytes) -> Float32Array:
    return np.divide(raw, 255, dtype=np.float32)


def _colour(raw: Bytes) -> Float32Array:
    return np.asarray((_share(raw) - 0.5) / COLOUR_FACTOR, np.float32)


def _first_three(raw: Bytes) -> Float32Array:
    out = np.empty((len(raw), 4))  # float64, for w is the root of a small difference
    out[:, 1:] = raw / 127.5 - 1
    out[:, 0] = np.sqrt(np.maximum(0, 1 - (out[:, 1:] ** 2).sum(axis=1)))
    return (out / np.linalg.norm(out, axis=1, keepdims=True)).astype(np.float32)


def _smallest_three(raw: Bytes) -> Float32Array:
    packed = raw.view("<u4")[:, 0].astype(np.uint32)
    largest = (packed >> 30).astype(np.intp)
    xyzw = np.empty((len(raw), 4), np.float32)
    spread = np.arange(4)[None, :] - (np.arange(4)[None, :] > largest[:, None])  # 0, 1, 2 in the order of the others
    field = packed[:, None] >> ((2 - np.minimum(spread, 2)) * 10).astype(np.uint32)
    xyzw[:] = (field & 511) * np.float32(math.sqrt(0.5) / 511)
    np.negative(xyzw, out=xyzw, where=(field & 512) > 0)
    np.put_along_axis(xyzw, largest[:, None], 0, axis=1)
    np.put_along_axis(xyzw, largest[:, None], np.sqrt(np.maximum(0, 1 - (xyzw**2).sum(axis=1)))[:, None], axis=1)
    return np.asarray((xyzw / np.linalg.norm(xyzw, axis=1, keepdims=True))[:, W_XYZ])


def _sh(raw: Bytes, wanted: int) -> Float32Array:
    values = np.subtract(raw[:, : 3 * wanted], 128, dtype=np.float32)
    values *= 1 / 128
    return values.reshape(len(raw), wanted, 3)


FORMAT = SplatFormat("spz", ".spz", ORIENTATION, detect, inspect, read)
