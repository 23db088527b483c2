"""A proxy as a file that other programs read: PLY, OBJ and GLB, with a colour for each vertex."""

from __future__ import annotations

import io
import json
import struct
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import ProxyError
from ..support.atomic import atomic_write
from .mesh import ProxyMesh


def write_proxy(path: Path, mesh: ProxyMesh) -> None:
    """Writes the mesh in the layout of the file's suffix; the file appears whole or not at all. Coordinates are those of the
    splat's file, as they are. Raises ProxyError for another suffix; OSError passes through.
    """
    data = writer_of(path)(mesh)
    with atomic_write(path, "wb") as file:
        file.write(data)


def writer_of(path: Path) -> Callable[[ProxyMesh], bytes]:
    """Raises ProxyError where the suffix names no layout."""
    writer = WRITERS.get(path.suffix.lower())
    if writer is None:
        raise ProxyError(f"'{path.name}' is no kind of mesh file that is written; give one of {', '.join(WRITERS)}.")
    return writer


def _bytes_of(mesh: ProxyMesh) -> np.ndarray[Any, np.dtype[np.uint8]]:
    return np.rint(np.clip(mesh.colors, 0, 1) * 255).astype(np.uint8)


def _ply(mesh: ProxyMesh) -> bytes:
    """Binary, little endian. Doubles, for a scan may lie far from its origin."""
    kind = [("x", "<f8"), ("y", "<f8"), ("z", "<f8"), ("red", "u1"), ("green", "u1"), ("blue", "u1")]
    vertices = np.empty(len(mesh.vertices), kind)
    for column, name in enumerate("xyz"):
        vertices[name] = mesh.vertices[:, column]
    for column, name in enumerate(("red", "green", "blue")):
        vertices[name] = _bytes_of(mesh)[:, column]
    faces = np.empty(len(mesh.faces), [("count", "u1"), ("corners", "<i4", 3)])
    faces["count"], faces["corners"] = 3, mesh.faces
    header = ["ply", "format binary_little_endian 1.0", f"element vertex {len(vertices)}"]
    header += [f"property double {name}" for name in "xyz"] + [f"property uchar {name}" for name in ("red", "green", "blue")]
    header += [f"element face {len(faces)}", "property list uchar int vertex_indices", "end_header", ""]
    return "\n".join(header).encode() + vertices.tobytes() + faces.tobytes()


def _obj(mesh: ProxyMesh) -> bytes:
    """Text; colours stand behind the places, as many programs write and read them."""
    out = io.StringIO()
    out.write("# made by GS-SMC\n")
    np.savetxt(out, np.hstack([mesh.vertices, mesh.colors]), "v %.9g %.9g %.9g %.4f %.4f %.4f")
    np.savetxt(out, mesh.faces + 1, "f %d %d %d")
    return out.getvalue().encode()


def _glb(mesh: ProxyMesh) -> bytes:
    """glTF 2.0 in one file. Its y is up and a scan's is usually down; nothing is turned: the mesh is to lie on the splat."""
    places = mesh.vertices.astype("<f4")
    # A row of colours has to begin at a multiple of four bytes, hence the alpha.
    colors = np.hstack([_linear(mesh.colors), np.ones((len(mesh.colors), 1))]).astype("<f4")
    parts = [mesh.faces.astype("<u4").tobytes(), places.tobytes(), colors.tobytes()]
    starts = np.cumsum([0, *map(len, parts)])
    views = [{"buffer": 0, "byteOffset": int(at), "byteLength": len(part)} for at, part in zip(starts, parts, strict=False)]
    bounds = {"min": places.min(axis=0).tolist(), "max": places.max(axis=0).tolist()}
    document = {
        "asset": {"version": "2.0", "generator": "GS-SMC"},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0, "name": "Proxy"}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 1, "COLOR_0": 2}, "indices": 0}]}],
        "accessors": [
            {"bufferView": 0, "componentType": 5125, "count": mesh.faces.size, "type": "SCALAR"},
            {"bufferView": 1, "componentType": 5126, "count": len(places), "type": "VEC3", **bounds},
            {"bufferView": 2, "componentType": 5126, "count": len(colors), "type": "VEC4"},
        ],
        "bufferViews": views,
        "buffers": [{"byteLength": int(starts[-1])}],
    }
    text = json.dumps(document).encode()
    text += b" " * (-len(text) % 4)
    body = b"".join(parts)
    chunks = struct.pack("<II", len(text), 0x4E4F534A) + text + struct.pack("<II", len(body), 0x004E4942) + body
    return struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks


def _linear(colors: np.ndarray[Any, np.dtype[np.float32]]) -> np.ndarray[Any, np.dtype[np.float32]]:
    """Display-encoded sRGB 0..1 as linear light, which glTF wants."""
    return np.where(colors <= 0.04045, colors / 12.92, ((colors + 0.055) / 1.055) ** 2.4).astype(np.float32)


WRITERS: dict[str, Callable[[ProxyMesh], bytes]] = {".ply": _ply, ".obj": _obj, ".glb": _glb}
