"""What the .ply layouts of INRIA, 2DGS and Mip-Splatting share: a vertex element with one named number per value."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ...errors import SplatFormatError
from ...geometry.conventions import Orientation
from ...support.words import counted
from ..activate import SceneBuilder
from ..format import Progress, SplatInfo
from ..scene import SH_COEFFICIENTS, Float32Array, GaussianScene
from .body import FarOrigin, rows_at_most, skip_elements_before_vertex, vertex_columns
from .header import PlyElement, PlyHeader, read_header

ORIENTATION: Orientation = "Y_DOWN"  # trainers keep COLMAP's world: x right, y down, z forward (RDF)
COLOUR = ("f_dc_0", "f_dc_1", "f_dc_2")
REST_COUNTS = tuple(3 * (k - 1) for k in SH_COEFFICIENTS)
MARKS = (b"ply\n", b"ply\r", b"ply ")


@dataclass(frozen=True)
class PlyLayout:
    """`geometry`: the properties wanted beside the colours; `to_raw` turns rows of those and of the colours, (n, G + 3 K)
    float32, into raw rows as SceneBuilder.add takes them.
    """

    name: str
    geometry: tuple[str, ...]
    to_raw: Callable[[Float32Array], Float32Array] = lambda rows: rows


# nerfstudio's comment on its axes, and what Brush and Postshot write of scans to be drawn with compensated opacities.
VERTICAL_AXIS = re.compile(r"vertical axis:\s*([yz])\b", re.IGNORECASE)
ANTIALIASED = re.compile(r"splatrendermode:\s*mip\b|antialias(ed)?[\s:=]+(1|true)\b", re.IGNORECASE)
UPWARDS: dict[str, Orientation] = {"y": "Y_UP", "z": "Z_UP"}


def declared_axes(header: PlyHeader) -> Orientation | None:
    """Which way the axes point by the file's own comments; None where they say nothing."""
    found = next((match for comment in header.comments if (match := VERTICAL_AXIS.fullmatch(comment.strip()))), None)
    return UPWARDS[found[1].lower()] if found else None


def is_antialiased(header: PlyHeader) -> bool:
    """Whether a comment says that the opacities are to be compensated for the low-pass filter."""
    return any(ANTIALIASED.search(comment) for comment in header.comments)


def header_names(header: bytes) -> set[str]:
    """Names of the properties in a PLY's first bytes, of all elements; empty when it is no PLY."""
    if not header.startswith(MARKS):
        return set()
    lines = header.partition(b"end_header")[0].decode("latin-1").splitlines()
    return {line.split()[-1] for line in lines if line.startswith("property ")}


def inspect_layout(path: Path, layout: PlyLayout) -> SplatInfo:
    """Count and degree from the header. Raises SplatFormatError as `read_layout` does for the header."""
    with open(path, "rb") as file:
        header = read_header(file)
    vertex, declared = _gaussian_element(header.element("vertex"), layout), declared_axes(header)
    degree = SH_COEFFICIENTS.index(len(_colours(vertex)) // 3)
    return SplatInfo(layout.name, vertex.count, degree, declared or ORIENTATION, declared is not None)


def read_layout(path: Path, layout: PlyLayout, progress: Progress | None) -> GaussianScene:
    """The scene in a file of that layout. Raises SplatFormatError, and OSError from the file system."""
    with open(path, "rb") as file:
        header = read_header(file)
        vertex = _gaussian_element(header.element("vertex"), layout)
        colours = _colours(vertex)
        skip_elements_before_vertex(file, header)
        far = FarOrigin()
        builder = SceneBuilder(rows_at_most(file, header, vertex), len(colours) // 3)
        with np.errstate(over="ignore", invalid="ignore"):
            for rows in vertex_columns(file, header, [*layout.geometry, *colours], far):
                builder.add(layout.to_raw(rows))
                if progress is not None:
                    progress(builder.filled / vertex.count)
    if builder.filled < vertex.count:
        raise SplatFormatError(
            f"The file is cut off: it holds {builder.filled} of "
            f"{counted(vertex.count, 'Gaussian')} that it promises; export it again."
        )
    x, y, z = (float(value) for value in far.origin)
    axes, soft = declared_axes(header) or ORIENTATION, is_antialiased(header)
    return builder.scene(layout.name, axes, antialiased=soft, origin=(x, y, z))


def _gaussian_element(vertex: PlyElement | None, layout: PlyLayout) -> PlyElement:
    """The vertex element, checked to hold Gaussians; otherwise SplatFormatError says what the file is instead."""
    names = [p.name for p in vertex.properties] if vertex else []
    if vertex is None or not {"opacity", "f_dc_0", "scale_0", "rot_0"} & set(names):
        if "scalar_f_dc_0" in names or "scalar_opacity" in names:
            raise SplatFormatError(
                "The .ply is a splat that CloudCompare saved as plain points, with its values under other names "
                "(scalar_opacity); take the splat as it was before, or take 'scalar_' off the names."
            )
        raise SplatFormatError(
            "The .ply holds a mesh or plain points, no Gaussians (no f_dc_0, opacity, scale_0, rot_0); choose a 3DGS file."
        )
    missing = [name for name in (*layout.geometry, *COLOUR) if name not in names]
    if missing:
        raise SplatFormatError(f"The splat .ply lacks the properties {', '.join(missing)}; export it in the INRIA 3DGS layout.")
    if vertex.has_lists:
        listed = next(p.name for p in vertex.properties if p.count_type)
        raise SplatFormatError(
            f"The vertex property '{listed}' is a list, which no splat .ply has; export it in the INRIA layout."
        )
    if len(set(names)) < len(names):
        twice = next(name for name in names if names.count(name) > 1)
        raise SplatFormatError(f"The PLY header lists the property '{twice}' twice; the file is damaged, so export it again.")
    if vertex.count == 0:
        raise SplatFormatError("The splat .ply holds zero Gaussians; export the scan again.")
    return vertex


def _colours(vertex: PlyElement) -> list[str]:
    """Colour properties in the order that SceneBuilder takes."""
    rest = rest_names([p.name for p in vertex.properties])
    per_channel = len(rest) // 3  # f_rest is channel-major: all of R, then G, then B
    names = []
    for channel, dc in enumerate(COLOUR):
        names += [dc, *rest[channel * per_channel : (channel + 1) * per_channel]]
    return names


def rest_names(names: list[str]) -> list[str]:
    """f_rest_0, f_rest_1, ... of an element. Raises SplatFormatError when they make no degree or are not numbered through."""
    rest = {name for name in names if name.startswith("f_rest_") and name[7:].isdecimal()}
    if len(rest) not in REST_COUNTS:
        raise SplatFormatError(
            f"The splat .ply has {len(rest)} f_rest values per Gaussian; 0, 9, 24 or 45 (SH degree 0 to 3) are needed."
        )
    wanted = [f"f_rest_{i}" for i in range(len(rest))]
    if rest != set(wanted):
        raise SplatFormatError(
            f"The splat .ply has {len(rest)} f_rest values that are not numbered 0 to {len(rest) - 1}; export the scan again."
        )
    return wanted
