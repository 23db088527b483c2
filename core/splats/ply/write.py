"""Writing the .ply layouts: a header, then rows of little-endian numbers of one width, in chunks."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Literal

import numpy as np
from numpy.lib.recfunctions import unstructured_to_structured
from numpy.typing import NDArray

from ...support.atomic import atomic_write
from ..scene import Float32Array, GaussianScene
from .layout import COLOUR

Precision = Literal["half", "float", "double"]
CODES: dict[Precision, str] = {"half": "<f2", "float": "<f4", "double": "<f8"}
WRITE_ROWS = 1 << 14
PLACE = ("x", "y", "z")  # written with double precision where the scene has an origin
ANTIALIASED = "comment SplatRenderMode: mip"  # as Brush writes it
Z_UP = "comment Vertical Axis: z"  # as nerfstudio writes it


def property_names(scene: GaussianScene, scales: int = 3, extra: Sequence[str] = ()) -> list[str]:
    """INRIA's property order, for `scales` scale properties and some more at the end."""
    rest = 3 * (scene.sh.shape[1] - 1)
    names = ["x", "y", "z", "nx", "ny", "nz", *COLOUR, *(f"f_rest_{i}" for i in range(rest)), "opacity"]
    return [*names, *(f"scale_{i}" for i in range(scales)), *(f"rot_{i}" for i in range(4)), *extra]


def write_rows(
    path: str | Path,
    scene: GaussianScene,
    names: Sequence[str],
    rows: Callable[[slice], NDArray[np.floating]],
    precision: Precision,
) -> None:
    """A PLY with one element, a vertex for each Gaussian; `rows` gives the values (n, len(names)) of a slice of them.

    The file appears whole or not at all. OSError passes through.
    """
    said = [ANTIALIASED] if scene.antialiased else []
    said += [Z_UP] if scene.orientation == "Z_UP" else []
    count = len(scene)
    lines = ["ply", "format binary_little_endian 1.0", *said, f"element vertex {count}"]
    kinds: list[Precision] = ["double" if name in PLACE and any(scene.origin) else precision for name in names]
    lines += [f"property {kind} {name}" for kind, name in zip(kinds, names, strict=True)] + ["end_header", ""]
    row = np.dtype([(name, CODES[kind]) for kind, name in zip(kinds, names, strict=True)])
    with atomic_write(path, "wb") as file:
        file.write("\n".join(lines).encode("ascii"))
        for start in range(0, count, WRITE_ROWS):
            values = rows(slice(start, start + WRITE_ROWS))
            if len(set(kinds)) == 1:
                file.write(values.astype(CODES[precision]).tobytes())
            else:
                file.write(unstructured_to_structured(values, row).tobytes())


def raw_rows(scene: GaussianScene, at: slice, scales: int = 3) -> NDArray[np.float64]:
    """Raw values (n, P) in the order of `property_names`, without its extra ones."""
    means, sh = scene.means[at], scene.sh[at]
    parts: list[NDArray[np.floating]] = [
        means + np.array(scene.origin) if any(scene.origin) else means,
        np.zeros_like(means),
        sh[:, 0],
        sh[:, 1:].transpose(0, 2, 1).reshape(len(means), -1),
    ]
    parts += [logit(scene.opacities[at])[:, None], log_scales(scene.scales[at, :scales]), scene.rotations[at]]
    return np.concatenate(parts, axis=1, dtype=np.float64)


def logit(opacities: Float32Array) -> NDArray[np.float64]:
    """The raw opacity; exactly 0 and 1 are moved to the nearest value with a finite one."""
    opacity = np.clip(opacities.astype(np.float64), 1e-7, 1 - 1e-7)
    return np.asarray(np.log(opacity / (1 - opacity)))


def log_scales(scales: Float32Array) -> NDArray[np.float64]:
    """The raw scales; 0 is moved to the smallest normal float32."""
    return np.asarray(np.log(np.maximum(scales, np.finfo(np.float32).tiny).astype(np.float64)))
