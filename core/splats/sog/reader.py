"""Reading SOG scenes. A Gaussian is a pixel of each picture; version 2 looks values up in codebooks, version 1 has ranges.

Positions: 16 bits (two pictures) over a range, then sign(v) (e^|v| - 1). Scales: logarithms. Rotations: three components over
+-1 / sqrt 2, and in the alpha channel 252 plus the number of the largest one, of w x y z, which is left out. Colours and
opacities: one picture; the opacity is a share (version 2) or a logit (1). SH above degree 0: a label of 16 bits for a palette,
64 entries in a row, whose pixels are the coefficients, colour by colour. Axes as in the .ply that the scene was made from.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...errors import SplatFormatError
from ...geometry.conventions import Orientation
from ..activate import SceneBuilder
from ..format import Progress, SplatFormat, SplatInfo
from ..scene import SH_COEFFICIENTS, Float32Array, GaussianScene
from .container import META, ZIP_MAGIC, Bytes, SogFiles, open_files

ORIENTATION: Orientation = "Y_DOWN"
LARGEST_COUNT = 1 << 28
CHUNK_ROWS = 1 << 16
PALETTE_COLUMNS = 64
LARGEST_PALETTE = (1 << 16) * 15  # pixels: as many entries as a label can name, each of degree 3
FIRST_TAG = 252  # of the largest quaternion component
Look = Callable[[Bytes], Float32Array]  # bytes (n, C) to values (n, C)


def detect(header: bytes) -> bool:
    """Whether a file begins as a ZIP archive, or as the meta.json of a scene."""
    return header.startswith(ZIP_MAGIC) or (header.lstrip()[:1] == b"{" and b'"means"' in header and b'"quats"' in header)


def is_folder(path: Path) -> bool:
    """Whether a folder holds a scene."""
    return (path / META).is_file()


def inspect(path: str | Path) -> SplatInfo:
    """What meta.json says. Raises SplatFormatError."""
    with open_files(Path(path)) as files:
        layout = SogLayout(files.meta())
        return SplatInfo(layout.name, layout.count, layout.degree(files), ORIENTATION)


def read(path: str | Path, progress: Progress | None = None) -> GaussianScene:
    """The scene at `path`: an archive, a folder, or its meta.json. `progress` is called with a fraction 0..1 and may raise to
    stop the reading. Raises SplatFormatError, and OSError from the file system.
    """
    with open_files(Path(path)) as files:
        layout = SogLayout(files.meta())
        n, table = layout.count, SogPictures(files, layout)
        builder = SceneBuilder(n, SH_COEFFICIENTS[table.degree])
        for start in range(0, n, CHUNK_ROWS):
            builder.add_activated(*table.rows(slice(start, min(start + CHUNK_ROWS, n))))
            if progress is not None:
                progress(builder.filled / n)
    return builder.scene(layout.name, ORIENTATION, antialiased=layout.antialiased)


class SogLayout:
    """What meta.json says of one scene, its numbers checked. Raises SplatFormatError."""

    def __init__(self, meta: dict[str, Any]) -> None:
        self._meta = meta
        version = meta.get("version", 1)
        if version not in (1, 2):
            raise SplatFormatError(f"The SOG scene is of version {version!s:.20}; versions 1 and 2 can be read.")
        self.version: int = version
        self.name = f"sog version {version}"
        self.antialiased = meta.get("antialias") is True
        shape = self.part("means").get("shape")
        count = meta.get("count") if version == 2 else shape[0] if isinstance(shape, list) and shape else None
        if not isinstance(count, int) or not 0 < count <= LARGEST_COUNT:
            raise SplatFormatError(f"The {META} of the SOG scene tells no number of Gaussians; export the scene again.")
        self.count = count

    def part(self, name: str) -> dict[str, Any]:
        found = self._meta.get(name)
        if not isinstance(found, dict):
            raise self._lack(name)
        return found

    def files(self, name: str, count: int) -> list[Any]:
        found = self.part(name).get("files")
        if not isinstance(found, list) or len(found) < count:
            raise self._lack(f"{name}.files")
        return found

    def numbers(self, name: str, key: str, count: int) -> NDArray[np.float64]:
        """`count` finite numbers; a single one stands for all of them."""
        try:
            values = np.asarray(self.part(name).get(key), np.float64).reshape(-1)
        except (TypeError, ValueError, OverflowError):
            raise self._lack(f"{name}.{key}") from None
        values = np.repeat(values, count) if len(values) == 1 else values
        if len(values) < count or not np.isfinite(values[:count]).all():
            raise self._lack(f"{name}.{key}")
        return values[:count]

    def look(self, name: str, channels: int) -> Look:
        """How the bytes of a picture become values: by its codebook, or within its ranges."""
        if self.version == 2:
            book = self.numbers(name, "codebook", 256).astype(np.float32)
            return lambda raw: book[raw]
        low, high = (self.numbers(name, key, channels) for key in ("mins", "maxs"))
        return lambda raw: np.asarray(low + (high - low) * (raw / 255), np.float32)

    @property
    def has_rest(self) -> bool:
        return isinstance(self._meta.get("shN"), dict)

    def degree(self, files: SogFiles) -> int:
        """The SH degree: told by version 2; in version 1 the width of the palette's picture shows it."""
        if not self.has_rest:
            return 0
        bands = self.part("shN").get("bands")
        if self.version == 1:
            width = files.picture(self.files("shN", 2)[0], 1, LARGEST_PALETTE).shape[1]
            bands = next((d for d in (1, 2, 3) if width == PALETTE_COLUMNS * (SH_COEFFICIENTS[d] - 1)), None)
        if bands not in (0, 1, 2, 3):
            raise self._lack("shN.bands")
        return int(bands)

    def _lack(self, what: str) -> SplatFormatError:
        return SplatFormatError(f"The {META} of the SOG scene lacks a usable '{what}'; export the scene again.")


class SogPictures:
    """The pictures of a scene, decoded, and what their bytes mean."""

    def __init__(self, files: SogFiles, layout: SogLayout) -> None:
        n, self.degree, self._version = layout.count, layout.degree(files), layout.version
        lower, upper = layout.files("means", 2)[:2]
        self._lower, self._upper = files.pixels(lower, n), files.pixels(upper, n)
        self._mins, self._maxs = layout.numbers("means", "mins", 3), layout.numbers("means", "maxs", 3)
        self._scales, self._quats, self._colours = (files.pixels(layout.files(p, 1)[0], n) for p in ("scales", "quats", "sh0"))
        self._scale, self._colour = layout.look("scales", 3), layout.look("sh0", 4)
        self._palette: Float32Array = np.zeros((1, 0, 3), np.float32)
        if self.degree:
            centroids, labels = layout.files("shN", 2)[:2]
            self._labels = files.pixels(labels, n)
            self._palette = self._entries(files.picture(centroids, 1, LARGEST_PALETTE), layout.look("shN", 3))

    def _entries(self, picture: Bytes, look: Look) -> Float32Array:
        """The palette (entries, K - 1, 3), and a last entry of zeros for labels beyond it."""
        each = SH_COEFFICIENTS[self.degree] - 1
        if picture.shape[1] != PALETTE_COLUMNS * each:
            raise SplatFormatError("The SH palette of the SOG scene has another width than its degree; export the scene again.")
        found = look(picture[..., :3].reshape(-1, 3)).reshape(-1, each, 3)
        return np.concatenate([found, np.zeros((1, each, 3), np.float32)])

    def rows(self, at: slice) -> tuple[Float32Array, Float32Array, Float32Array, Float32Array, Float32Array]:
        """Means, scales, rotations, opacities and SH of the Gaussians of a slice, as SceneBuilder.add_activated takes them."""
        steps = self._lower[at, :3] + self._upper[at, :3].astype(np.float64) * 256
        logs = self._mins + (self._maxs - self._mins) * (steps / 65535)
        colours = self._colours[at]
        with np.errstate(over="ignore", invalid="ignore"):
            means = np.asarray(np.sign(logs) * np.expm1(np.abs(logs)), np.float32)
            scales = np.exp(self._scale(self._scales[at, :3]))
            opacities = colours[:, 3].astype(np.float32) / np.float32(255)
            if self._version == 1:
                opacities = 1 / (1 + np.exp(-self._colour(colours)[:, 3]))
        values = self._colour(colours)[:, None, :3] if self._version == 1 else self._colour(colours[:, :3])[:, None]
        if self.degree:
            label = self._labels[at, 0] + self._labels[at, 1].astype(np.intp) * 256
            values = np.concatenate([values, self._palette[np.minimum(label, len(self._palette) - 1)]], axis=1)
        return means, scales, _rotations(self._quats[at]), np.asarray(opacities, np.float32), values


def _rotations(raw: Bytes) -> Float32Array:
    """w x y z (n, 4); a tag that is none stands for no rotation."""
    tag = raw[:, 3].astype(np.intp) - FIRST_TAG
    small = np.asarray((raw[:, :3] / 255 * 2 - 1) / np.sqrt(2))
    largest = np.sqrt(np.maximum(0, 1 - (small * small).sum(axis=1)))
    out = np.zeros((len(raw), 4), np.float32)
    out[:, 0] = 1
    for number in range(4):
        own = tag == number
        out[own] = np.insert(small[own], number, largest[own], axis=1)
    return out


FORMAT = SplatFormat("sog", ".sog", ORIENTATION, detect, inspect, read)
