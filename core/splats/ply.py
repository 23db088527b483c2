"""Gaussian splats in the INRIA PLY layout: SH degree 0-3, binary (little, big endian) and ascii, any property order."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import IO

import numpy as np

from ..atomic import atomic_write
from ..errors import SplatFormatError
from .activate import SceneBuilder
from .ply_body import rows_at_most, skip_elements_before_vertex, vertex_columns
from .ply_header import PlyElement, PlyHeader, read_header
from .scene import SH_COEFFICIENTS, GaussianScene

GEOMETRY = ("x", "y", "z", "scale_0", "scale_1", "scale_2", "rot_0", "rot_1", "rot_2", "rot_3", "opacity")
COLOUR = ("f_dc_0", "f_dc_1", "f_dc_2")
REST_COUNTS = tuple(3 * (k - 1) for k in SH_COEFFICIENTS)
WRITE_ROWS = 1 << 14


def detect(header: bytes) -> bool:
    """Whether a file that begins with these bytes is a PLY of any kind."""
    return header.startswith((b"ply\n", b"ply\r", b"ply "))


def read(path: str | Path, progress: Callable[[float], None] | None = None) -> GaussianScene:
    """The scene in the file, activated: exp for scales, sigmoid for opacities, unit quaternions.

    `progress` is called with a fraction 0..1 and may raise to stop the reading. Gaussians with NaN, infinite values or a
    zero quaternion are left out and counted in `dropped`. Raises SplatFormatError, and OSError from the file system.
    """
    with open(path, "rb") as file:
        header = read_header(file)
        vertex = _gaussian_element(header)
        names = _columns(vertex)
        skip_elements_before_vertex(file, header)
        builder = SceneBuilder(rows_at_most(file, header, vertex), (len(names) - len(GEOMETRY)) // 3)
        _fill(builder, file, header, names, progress)
    if builder.seen < vertex.count:
        raise SplatFormatError(
            f"The file is cut off: it holds {builder.seen} of the {vertex.count} Gaussians it promises; export it again."
        )
    if builder.kept == 0:
        raise SplatFormatError(f"All {vertex.count} Gaussians of the file hold NaN or infinite values; export the scan again.")
    return builder.scene("ply")


def _fill(
    builder: SceneBuilder, file: IO[bytes], header: PlyHeader, names: list[str], progress: Callable[[float], None] | None
) -> None:
    vertex = header.element("vertex")
    assert vertex is not None
    with np.errstate(over="ignore", invalid="ignore"):
        for rows in vertex_columns(file, header, names):
            builder.add(rows)
            if progress is not None:
                progress(builder.seen / vertex.count)


def _gaussian_element(header: PlyHeader) -> PlyElement:
    """The vertex element, checked to hold Gaussians; otherwise SplatFormatError says what the file is instead."""
    vertex = header.element("vertex")
    names = [p.name for p in vertex.properties] if vertex else []
    if "packed_position" in names:
        raise SplatFormatError("The file is a compressed splat .ply (packed_position); export it as an uncompressed .ply.")
    if vertex is None or not {"opacity", "f_dc_0", "scale_0", "rot_0"} & set(names):
        raise SplatFormatError(
            "The .ply holds a mesh or plain points, no Gaussians (no f_dc_0, opacity, scale_0, rot_0); choose a 3DGS file."
        )
    missing = [name for name in (*GEOMETRY, *COLOUR) if name not in names]
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


def _columns(vertex: PlyElement) -> list[str]:
    """Property names in the order that SceneBuilder takes."""
    rest = {p.name for p in vertex.properties if p.name.startswith("f_rest_") and p.name[7:].isdecimal()}
    if len(rest) not in REST_COUNTS:
        raise SplatFormatError(
            f"The splat .ply has {len(rest)} f_rest values per Gaussian; 0, 9, 24 or 45 (SH degree 0 to 3) are needed."
        )
    if rest != {f"f_rest_{i}" for i in range(len(rest))}:
        raise SplatFormatError(
            f"The splat .ply has {len(rest)} f_rest values that are not numbered 0 to {len(rest) - 1}; export the scan again."
        )
    per_channel = len(rest) // 3  # f_rest is channel-major: all of R, then G, then B
    names = list(GEOMETRY)
    for channel, dc in enumerate(COLOUR):
        names += [dc, *(f"f_rest_{channel * per_channel + i}" for i in range(per_channel))]
    return names


def write_ply(path: str | Path, scene: GaussianScene) -> None:
    """Write `scene` in the INRIA layout, binary little endian; the file appears whole or not at all.

    Opacities of exactly 0 or 1 and scales of 0 are moved to the nearest value with a finite logit or logarithm.
    """
    rest = 3 * (scene.sh.shape[1] - 1)
    names = ["x", "y", "z", "nx", "ny", "nz", *COLOUR, *(f"f_rest_{i}" for i in range(rest)), "opacity"]
    names += [f"scale_{i}" for i in range(3)] + [f"rot_{i}" for i in range(4)]
    lines = ["ply", "format binary_little_endian 1.0", f"element vertex {len(scene)}"]
    lines += [f"property float {name}" for name in names] + ["end_header", ""]
    with atomic_write(path, "wb") as file:
        file.write("\n".join(lines).encode("ascii"))
        for start in range(0, len(scene), WRITE_ROWS):
            at = slice(start, start + WRITE_ROWS)
            file.write(_raw_rows(scene, at).tobytes())


def _raw_rows(scene: GaussianScene, at: slice) -> np.ndarray[tuple[int, ...], np.dtype[np.float32]]:
    means, sh = scene.means[at], scene.sh[at]
    opacity = np.clip(scene.opacities[at].astype(np.float64), 1e-7, 1 - 1e-7)
    scales = np.maximum(scene.scales[at], np.finfo(np.float32).tiny)
    parts = [means, np.zeros_like(means), sh[:, 0], sh[:, 1:].transpose(0, 2, 1).reshape(len(means), -1)]
    parts += [np.log(opacity / (1 - opacity))[:, None], np.log(scales), scene.rotations[at]]
    return np.concatenate(parts, axis=1).astype("<f4")
