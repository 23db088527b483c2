"""OpenUSD with ParticleField3DGaussianSplat (.usd, .usda, .usdc, .usdz), read by the USD library that Blender brings.

positions, orientations (quaternions), scales (linear) and opacities (0..1), each with single or (name + "h") half precision,
and radiance:sphericalHarmonicsCoefficients: (degree + 1)^2 of each particle after one another, of which the first is f_dc. What
several prims hold is put together in the coordinates of the stage, at its earliest time. Axes: as the stage says.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import CameraError, SplatFormatError
from ..geometry.conventions import Orientation, Similarity
from .format import Progress, SplatFormat, SplatInfo
from .parts import together, unit
from .scene import SH_COEFFICIENTS, Float32Array, GaussianScene
from .transform import transformed

NAME = "OpenUSD"
ORIENTATION: Orientation = "Y_UP"  # where a stage does not say
PRIM = "ParticleField3DGaussianSplat"
ENDINGS = (".usd", ".usda", ".usdc", ".usdz")  # which the library goes by
BINARY, TEXT, ARCHIVE = b"PXR-USDC", b"#usda ", b"PK\x03\x04"
INNER = (b".usdc", b".usda", b".usd")  # how the name of an archive's first file ends
SH, DEGREE = "radiance:sphericalHarmonicsCoefficients", "radiance:sphericalHarmonicsDegree"
MAX_DEGREE = 3
FAULTS = (ValueError, TypeError, IndexError, AttributeError, OverflowError)
TOLD = "The OpenUSD file is damaged, or holds its Gaussians in an unknown way"


def detect(header: bytes) -> bool:
    """Whether a file begins as one of USD's three kinds. An archive is one whose first file is of another kind."""
    name = header[30 : 30 + int.from_bytes(header[26:28], "little")]
    return header.startswith((BINARY, TEXT)) or (header.startswith(ARCHIVE) and name.endswith(INNER))


def inspect(path: str | Path) -> SplatInfo:
    """What the stage holds. Raises SplatFormatError."""
    with _stage(Path(path)) as stage:
        parts = list(_parts(stage))
        count, degree = sum(part.count for part in parts), max(part.degree for part in parts)
        return SplatInfo(NAME, count, degree, *_axes(stage))


def read(path: str | Path, progress: Progress | None = None) -> GaussianScene:
    """The scene in the file. `progress` is called with a fraction 0..1 and may raise to stop the reading.

    Raises SplatFormatError, and OSError from the file system.
    """
    with _stage(Path(path)) as stage:
        orientation, _ = _axes(stage)
        parts = list(_parts(stage))
        degree = max(part.degree for part in parts)
        scenes = []
        for number, part in enumerate(parts, 1):
            scenes.append(part.scene(degree, orientation))
            if progress is not None:
                progress(number / len(parts))
    return together(scenes, NAME, orientation)


@contextmanager
def _stage(path: Path) -> Iterator[Any]:
    """The stage in a file, whatever the library says of it as SplatFormatError."""
    try:
        from pxr import Tf, Usd
    except ImportError:
        raise SplatFormatError(
            "OpenUSD files need Blender's own USD library, which is not here; import the file in Blender, or export it as .ply."
        ) from None
    with open(path, "rb"):
        pass  # What the file system refuses is its own error.
    if path.suffix.lower() not in ENDINGS:
        raise SplatFormatError(f"'{path.name}' is an OpenUSD file, whose name has to end in {', '.join(ENDINGS)}; rename it.")
    try:
        yield Usd.Stage.Open(str(path))
    except SplatFormatError:
        raise
    except (Tf.ErrorException, RuntimeError, CameraError, *FAULTS):
        raise SplatFormatError(f"{TOLD}; export it again.") from None


def _axes(stage: Any) -> tuple[Orientation, bool]:
    """Which way the axes of the stage point, and whether it says so itself."""
    from pxr import UsdGeom

    return ("Z_UP" if UsdGeom.GetStageUpAxis(stage) == UsdGeom.Tokens.z else "Y_UP"), stage.HasAuthoredMetadata("upAxis")


def _parts(stage: Any) -> Iterator[_Prim]:
    """The prims that hold Gaussians. Raises SplatFormatError where there is none."""
    found = False
    for prim in stage.Traverse():
        if prim.GetTypeName() == PRIM:
            found = True
            yield _Prim(prim)
    if not found:
        raise SplatFormatError(f"The OpenUSD file holds no Gaussian splats ({PRIM}); choose a splat file.")


class _Prim:
    """One prim."""

    def __init__(self, prim: Any) -> None:
        self._prim = prim
        # The library maps arrays; only `values` copies them.
        values = self._raw(SH)
        self.count = len(self._raw("positions"))
        told = prim.GetAttribute(DEGREE)
        degree = int(told.Get()) if told and told.Get() is not None else MAX_DEGREE
        whole = degree >= 0 and self.count > 0 and len(values) == self.count * (degree + 1) ** 2
        if len(values) and not whole:
            raise ValueError
        self.degree = min(degree, MAX_DEGREE) if len(values) else 0

    def values(self, name: str, width: int) -> Float32Array:
        """An attribute (n, width), n = 0 where there is none."""
        return np.asarray(self._raw(name), np.float32).reshape(-1, width)

    def _raw(self, name: str) -> Any:
        """An attribute as the library has it, of single or half precision; empty where there is none."""
        from pxr import Usd

        for own in (name, f"{name}h"):
            attribute = self._prim.GetAttribute(own)
            value = attribute.Get(Usd.TimeCode.EarliestTime()) if attribute else None
            if value is not None and len(value):
                return value
        return ()

    def scene(self, degree: int, orientation: Orientation) -> GaussianScene:
        """Its Gaussians in the coordinates of the stage, with as many SH coefficients as `degree` has. Raises ValueError."""
        from pxr import Usd, UsdGeom

        means, scales, opacities = self.values("positions", 3), self.values("scales", 3), self.values("opacities", 1)
        # numpy sees a quaternion of USD as x y z w.
        rotations = unit(self.values("orientations", 4)[:, [3, 0, 1, 2]])
        sh = np.zeros((len(means), SH_COEFFICIENTS[degree], 3), np.float32)
        values = self.values(SH, 3)
        if len(values):
            own = SH_COEFFICIENTS[self.degree]
            sh[:, :own] = values.reshape(len(means), -1, 3)[:, :own]
        scene = GaussianScene(means, scales, rotations, np.ascontiguousarray(opacities[:, 0]), sh, orientation=orientation)
        matrix = np.array(UsdGeom.Xformable(self._prim).ComputeLocalToWorldTransform(Usd.TimeCode.EarliestTime())).T
        if np.allclose(matrix, np.eye(4), atol=1e-7):
            return scene.checked()
        return transformed(scene.checked(), Similarity.from_matrix(matrix), orientation)


FORMAT = SplatFormat(NAME, ".usdc", ORIENTATION, detect, inspect, read)
