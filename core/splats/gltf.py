"""glTF 2.0 with KHR_gaussian_splatting, as .glb or .gltf: points whose attributes are the values of Gaussians, activated.

POSITION, and with the extension's name before them ROTATION (x y z w), SCALE (linear), OPACITY (0..1) and SH_DEGREE_l_COEF_n,
of which degree 0 is f_dc. Numbers may be normalised integers. What several primitives hold is put together, each moved as its
node says. Axes: y up, as all of glTF. With KHR_gaussian_splatting_compression_spz (or ..._spz_2) a primitive is a whole .spz
file, whose axes (x right, y up, z back) its loader turns to glTF's (x left, y up, z front) as that extension says.
"""

from __future__ import annotations

import base64
import binascii
import json
import struct
from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import CameraError, SplatFormatError
from ..geometry.camera import FloatArray
from ..geometry.conventions import Orientation, Similarity
from ..geometry.quaternion import rotations_of
from .format import Progress, SplatFormat, SplatInfo
from .parts import together, unit
from .scene import SH_COEFFICIENTS, Float32Array, GaussianScene
from .spz import reader as spz
from .spz.payload import read_spz_header
from .transform import transformed
from .turn import half_turned

NAME = "glTF"
ORIENTATION: Orientation = "Y_UP"
EXTENSION = "KHR_gaussian_splatting"
MAGIC, JSON_CHUNK, BINARY_CHUNK = b"glTF", 0x4E4F534A, 0x004E4942
KINDS = {5120: ("<i1", 127), 5121: ("<u1", 255), 5122: ("<i2", 32767), 5123: ("<u2", 65535), 5126: ("<f4", 1)}
COMPONENTS = {"SCALAR": 1, "VEC3": 3, "VEC4": 4}
COMPRESSIONS = (f"{EXTENSION}_compression_spz", f"{EXTENSION}_compression_spz_2")
MAX_DEGREE, MAX_DEPTH = 3, 64
CHUNK_ROWS = 1 << 13
Data = bytes | memoryview
FAULTS = (KeyError, IndexError, TypeError, ValueError, OverflowError, AttributeError, RecursionError, struct.error, CameraError)


def detect(header: bytes) -> bool:
    """Whether these first bytes are of a .glb, or of a .gltf that names the extension near its beginning."""
    return header.startswith(MAGIC) or (header.lstrip()[:1] == b"{" and EXTENSION.encode() in header)


def inspect(path: str | Path) -> SplatInfo:
    """What the file says, without its numbers. Raises SplatFormatError."""
    model = _Model(Path(path))
    parts = list(model.parts())
    return SplatInfo(NAME, sum(part.count for part in parts), max(part.degree for part in parts), ORIENTATION)


def read(path: str | Path, progress: Progress | None = None) -> GaussianScene:
    """The scene in the file. `progress` is called with a fraction 0..1 and may raise to stop the reading.

    Raises SplatFormatError, and OSError from the file system.
    """
    model = _Model(Path(path))
    parts = list(model.parts())
    degree = max(part.degree for part in parts)
    scenes = []
    for number, part in enumerate(parts, 1):
        scenes.append(part.scene(degree))
        if progress is not None:
            progress(number / len(parts))
    return together(scenes, NAME, ORIENTATION)


class _Model:
    """A glTF file: its JSON, and its buffers as they are asked for."""

    def __init__(self, path: Path) -> None:
        self._folder = path.parent
        data = path.read_bytes()
        self._binary, self._buffers = memoryview(b""), dict[int, Data]()
        try:
            self.json = json.loads(self._chunks(data) if data.startswith(MAGIC) else data)
            if not isinstance(self.json, dict):
                raise ValueError
        except FAULTS:
            raise SplatFormatError("The glTF file is cut off or damaged; copy or export it again.") from None

    def _chunks(self, data: bytes) -> bytes:
        """The JSON chunk of a .glb; the binary one is kept."""
        version, length = struct.unpack_from("<II", data, 4)
        if version != 2 or length > len(data):
            raise ValueError
        at, text = 12, b""
        while at + 8 <= length:
            size, kind = struct.unpack_from("<II", data, at)
            chunk = memoryview(data)[at + 8 : at + 8 + size]
            text, self._binary = (bytes(chunk), self._binary) if kind == JSON_CHUNK else (text, self._binary or chunk)
            at += 8 + size
        return text

    def parts(self) -> Iterator[_Part]:
        """The primitives that hold Gaussians. Raises SplatFormatError where there is none, or one that is not understood."""
        found = False
        try:
            meshes = self.json.get("meshes", [])
            for mesh, matrix in self._placed(len(meshes)):
                for primitive in meshes[mesh]["primitives"]:
                    extension = primitive.get("extensions", {}).get(EXTENSION)
                    if extension is None:
                        continue
                    yield self._part(primitive, extension, matrix)
                    found = True
        except FAULTS:
            raise _damaged() from None
        if not found:
            raise SplatFormatError(f"The glTF file holds no Gaussian splats ({EXTENSION}); choose a splat file.")

    def _part(self, primitive: Mapping[str, Any], extension: Mapping[str, Any], matrix: FloatArray) -> _Part:
        inner = extension.get("extensions") or {}
        name = next((name for name in inner if name in COMPRESSIONS), None)
        if name is not None:
            return _SpzPrimitive(self.view(inner[name]["bufferView"]), matrix)
        if inner and "bufferView" not in self.json["accessors"][primitive["attributes"]["POSITION"]]:
            name = next(iter(inner))
            raise SplatFormatError(f"The Gaussians of the glTF file are compressed ({name:.60}); export it without.")
        return _Primitive(self, primitive["attributes"], matrix)

    def view(self, number: int) -> bytes:
        """The bytes of a buffer view. Raises ValueError and the like where the file does not hold as many."""
        view = self.json["bufferViews"][number]
        start, length = int(view.get("byteOffset", 0)), int(view["byteLength"])
        data = self._buffer(view["buffer"])
        if min(start, length) < 0 or start + length > len(data):
            raise ValueError
        return bytes(data[start : start + length])

    def _placed(self, meshes: int) -> Iterator[tuple[int, FloatArray]]:
        """(mesh, matrix) of each node with a mesh; of a file without nodes, all meshes as they are."""
        nodes = self.json.get("nodes", [])
        children = {child for node in nodes for child in node.get("children", [])}
        if not nodes:
            yield from ((mesh, np.eye(4)) for mesh in range(meshes))
        for root in (number for number in range(len(nodes)) if number not in children):
            yield from self._below(nodes, root, np.eye(4), 0)

    def _below(self, nodes: list[Any], number: int, above: FloatArray, depth: int) -> Iterator[tuple[int, FloatArray]]:
        node = nodes[number]
        matrix = above @ _matrix(node)
        if depth > MAX_DEPTH:
            raise ValueError
        if "mesh" in node:
            yield int(node["mesh"]), matrix
        for child in node.get("children", []):
            yield from self._below(nodes, child, matrix, depth + 1)

    def values(self, accessor: int, kind: str) -> Float32Array:
        """The numbers of an accessor (n, components)."""
        return _decoded(*self.stored(accessor, kind))

    def stored(self, accessor: int, kind: str) -> tuple[NDArray[Any], int]:
        """The numbers (n, components) as they lie in the file, and what to divide them by. Raises ValueError and the like where
        the file does not hold as many.
        """
        one = self.json["accessors"][accessor]
        view = self.json["bufferViews"][one["bufferView"]]
        code, most = KINDS[one["componentType"]]
        if one["type"] != kind or one.get("sparse"):
            raise ValueError
        dtype, width, count = np.dtype(code), COMPONENTS[kind], int(one["count"])
        row = dtype.itemsize * width
        stride = int(view.get("byteStride", 0)) or row
        start = int(view.get("byteOffset", 0)) + int(one.get("byteOffset", 0))
        data = self._buffer(view["buffer"])
        if (
            min(start, count) < 0
            or stride < dtype.itemsize * width
            or start + stride * (count - 1) + dtype.itemsize * width > len(data)
        ):
            raise ValueError
        raw: NDArray[Any] = np.ndarray((count, width), dtype, data, start, (stride, dtype.itemsize))
        return raw, most if one.get("normalized") else 1

    def _buffer(self, number: int) -> Data:
        if number not in self._buffers:
            self._buffers[number] = self._loaded(self.json["buffers"][number].get("uri"))
        return self._buffers[number]

    def _loaded(self, uri: str | None) -> Data:
        if uri is None:
            return self._binary
        if uri.startswith("data:"):
            try:
                return base64.b64decode(uri.partition(",")[2])
            except binascii.Error:
                raise ValueError from None
        if "/" in uri or "\\" in uri:
            raise SplatFormatError("The glTF file keeps its numbers in another folder; export it as .glb.")
        return (self._folder / uri).read_bytes()


def _decoded(raw: NDArray[Any], most: int) -> Float32Array:
    """Numbers as they are meant: normalised integers divided by their largest."""
    return raw.astype(np.float32) if most == 1 else np.maximum(raw.astype(np.float32) / most, -1)


class _Primitive:
    """One primitive: its attributes' accessors, and where its node puts it."""

    def __init__(self, model: _Model, attributes: Mapping[str, int], matrix: FloatArray) -> None:
        self._model, self._attributes = model, attributes
        self._move = Similarity.from_matrix(matrix)
        self._moved = not np.allclose(matrix, np.eye(4), atol=1e-7)
        self.count = len(model.stored(attributes["POSITION"], "VEC3")[0])
        names = (f"{EXTENSION}:SH_DEGREE_{degree}_COEF_0" for degree in range(1, MAX_DEGREE + 1))
        self.degree = sum(name in attributes for name in names)

    def scene(self, degree: int) -> GaussianScene:
        """Its Gaussians, with as many SH coefficients as `degree` has. Raises SplatFormatError."""
        try:
            means = self._model.values(self._attributes["POSITION"], "VEC3")
            rotations = unit(self._own("ROTATION", "VEC4")[:, [3, 0, 1, 2]])
            scales, opacities = self._own("SCALE", "VEC3"), self._own("OPACITY", "SCALAR")[:, 0]
            sh = self._sh(degree)
            arrays = (means, scales, rotations, np.ascontiguousarray(opacities), sh)
        except FAULTS:
            raise _damaged() from None
        scene = GaussianScene(*arrays, orientation=ORIENTATION).checked()
        return transformed(scene, self._move, ORIENTATION) if self._moved else scene

    def _sh(self, degree: int) -> Float32Array:
        """All SH coefficients (n, K, 3). Some thousand Gaussians at a time, so that their numbers stay in the cache."""
        sh = np.zeros((self.count, SH_COEFFICIENTS[degree], 3), np.float32)
        names = [f"SH_DEGREE_{band}_COEF_{n}" for band in range(self.degree + 1) for n in range(2 * band + 1)]
        stored = [self._model.stored(self._attributes[f"{EXTENSION}:{name}"], "VEC3") for name in names]
        if any(len(raw) != self.count for raw, _ in stored):
            raise ValueError
        for start in range(0, self.count, CHUNK_ROWS):
            rows = slice(start, start + CHUNK_ROWS)
            for k, (raw, most) in enumerate(stored):
                sh[rows, k] = _decoded(raw[rows], most)
        return sh

    def _own(self, name: str, kind: str) -> Float32Array:
        return self._model.values(self._attributes[f"{EXTENSION}:{name}"], kind)


class _SpzPrimitive:
    """One primitive that is an .spz file as a whole."""

    def __init__(self, data: bytes, matrix: FloatArray) -> None:
        header = read_spz_header(data)
        self._data, self._move = data, Similarity.from_matrix(matrix)
        self._moved = not np.allclose(matrix, np.eye(4), atol=1e-7)
        self.count, self.degree = header.count, min(header.degree, MAX_DEGREE)

    def scene(self, degree: int) -> GaussianScene:
        """As `_Primitive.scene`."""
        scene = half_turned(spz.read_source(self._data), "y", reuse=True)
        scene = transformed(scene, self._move, ORIENTATION) if self._moved else scene
        rest = SH_COEFFICIENTS[degree] - scene.sh.shape[1]
        return replace(scene, sh=np.pad(scene.sh, ((0, 0), (0, rest), (0, 0)))) if rest else scene


_Part = _Primitive | _SpzPrimitive


def _matrix(node: Mapping[str, Any]) -> FloatArray:
    """A node's own matrix (4, 4), given as such, column by column, or as translation, rotation (x y z w) and scale."""
    if "matrix" in node:
        return np.asarray(node["matrix"], np.float64).reshape(4, 4).T
    matrix = np.eye(4)
    x, y, z, w = node.get("rotation", (0.0, 0.0, 0.0, 1.0))
    matrix[:3, :3] = rotations_of(np.array([w, x, y, z], np.float64)) * np.asarray(
        node.get("scale", (1.0, 1.0, 1.0)), np.float64
    )
    matrix[:3, 3] = node.get("translation", (0.0, 0.0, 0.0))
    return matrix


def _damaged() -> SplatFormatError:
    return SplatFormatError("The glTF file's Gaussians are damaged, or are stored in a way that is not known; export it again.")


FORMAT = SplatFormat(NAME, ".glb", ORIENTATION, detect, inspect, read)
