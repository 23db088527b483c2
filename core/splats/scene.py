"""The one in-memory form of a splat scan, whatever file it came from."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ..errors import SplatFormatError
from ..geometry.conventions import Orientation

Float32Array = NDArray[np.float32]

SH_COEFFICIENTS = (1, 4, 9, 16)
# So many Gaussians are checked at a time, so that their numbers stay in the processor's cache.
CHECKED_ROWS = 1 << 14
# A quaternion whose length is off by less than this is unit up to rounding, and stays as it is.
UNIT_TOLERANCE = 1e-4


@dataclass(frozen=True, eq=False)
class GaussianScene:
    """N Gaussians with activated values, in the coordinates of the splat file less `origin`. All arrays float32, C-contiguous.

    means (N, 3); scales (N, 3) linear standard deviations; rotations (N, 4) unit quaternions w x y z; opacities (N,) in 0..1;
    sh (N, K, 3) spherical-harmonics coefficients (colour last), K = 1, 4, 9 or 16 for degree 0..3.
    `dropped` counts Gaussians that `checked` left out, `normalised` those that it kept with an opacity or a rotation put
    right; `format` names the source format.
    `orientation` is which way the file's axes point by the convention of its format: the importer's default, nothing more.
    `antialiased`: the scan was trained so that a splat's opacity falls as the low-pass filter widens it, and is drawn so.
    `origin`: what was subtracted from the means of a scan that lies so far out (map coordinates) that float32 would round them;
    cameras stand among the means as `Pose.relative_to(origin)` gives them.
    Raises SplatFormatError when shapes disagree.
    """

    means: Float32Array
    scales: Float32Array
    rotations: Float32Array
    opacities: Float32Array
    sh: Float32Array
    dropped: int = 0
    normalised: int = 0
    format: str = ""
    orientation: Orientation = "Y_DOWN"
    antialiased: bool = False
    origin: tuple[float, float, float] = (0.0, 0.0, 0.0)

    def __post_init__(self) -> None:
        n = len(self.means)
        want = {"means": (n, 3), "scales": (n, 3), "rotations": (n, 4), "opacities": (n,)}
        for name, shape in want.items():
            if getattr(self, name).shape != shape:
                raise SplatFormatError(f"The scene's {name} have shape {getattr(self, name).shape}; {shape} is needed.")
        if self.sh.ndim != 3 or len(self.sh) != n or self.sh.shape[1] not in SH_COEFFICIENTS or self.sh.shape[2] != 3:
            raise SplatFormatError(f"The scene's SH have shape {self.sh.shape}; (N, K, 3) with K = 1, 4, 9 or 16 is needed.")

    def checked(self) -> GaussianScene:
        """The same scene with nothing taken on trust: every reader ends here, and so does what is copied out of Blender.
        Gaussians with a NaN, an infinity, a negative scale or a zero quaternion are left out and counted in `dropped`;
        quaternions of another length than 1 and opacities outside 0..1 are put right and counted in `normalised`.

        The arrays are taken over: where something is wrong, what is kept moves up inside them, so that a scan is in memory
        once; `self` is not to be used afterwards. Raises SplatFormatError when nothing is left.
        """
        count, own = len(self), [np.require(array, np.float32, ("C", "W")) for array in self._arrays]
        kept, normalised = _compacted(own)
        if kept == 0:
            raise SplatFormatError(
                f"Every Gaussian of the file ({count}) holds a NaN or infinite value; export the scan again."
            )
        m, s, r, o, h = (array[:kept] for array in own)
        return replace(self, means=m, scales=s, rotations=r, opacities=o, sh=h, dropped=count - kept, normalised=normalised)

    @property
    def _arrays(self) -> tuple[Float32Array, ...]:
        """All arrays, with a row for each Gaussian."""
        return self.means, self.scales, self.rotations, self.opacities, self.sh

    def __len__(self) -> int:
        return len(self.means)

    @property
    def sh_degree(self) -> int:
        return SH_COEFFICIENTS.index(self.sh.shape[1])


def check_near(scene: GaussianScene, suffix: str) -> None:
    """Raises SplatFormatError when the scene has an origin, for which a format of `suffix` has no room."""
    if any(scene.origin):
        raise SplatFormatError(f"The scan lies too far from its origin for {suffix}, which would round its places; write .ply.")


def _compacted(arrays: Sequence[Float32Array]) -> tuple[int, int]:
    """Puts the sound Gaussians at the front of a scene's `arrays`; how many they are, and how many had to be put right."""
    kept = normalised = 0
    for start in range(0, len(arrays[0]), CHECKED_ROWS):
        part = [a[start : start + CHECKED_ROWS] for a in arrays]
        good, odd = _judged(*part)
        normalised += int(odd.sum())
        if odd.any():
            rotations, opacities = part[2][odd], part[3][odd]
            lengths = np.linalg.norm(rotations.astype(np.float64), axis=1, keepdims=True)
            part[2][odd], part[3][odd] = rotations / lengths, np.clip(opacities, 0, 1)
        count = int(good.sum())
        if kept < start or count < len(good):
            for array, rows in zip(arrays, part, strict=True):
                array[kept : kept + count] = rows[good]
        kept += count
    return kept, normalised


def _judged(
    means: Float32Array, scales: Float32Array, rotations: Float32Array, opacities: Float32Array, sh: Float32Array
) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """Which of n Gaussians can be used (n,), and which of those only once they are put right (n,)."""
    good = np.isfinite(opacities)
    for rows in (means, scales, rotations, sh):
        good &= np.isfinite(rows.reshape(len(rows), -1)).all(axis=1)
    with np.errstate(invalid="ignore", over="ignore"):
        squared = np.einsum("ij,ij->i", rotations, rotations, dtype=np.float64)
        good &= (scales >= 0).all(axis=1) & (squared > 0)
        odd = (np.abs(squared - 1) > 2 * UNIT_TOLERANCE) | (opacities < 0) | (opacities > 1)
    return good, good & odd
