"""The one in-memory form of a splat scan, whatever file it came from."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..errors import SplatFormatError
from ..geometry.conventions import Orientation

Float32Array = NDArray[np.float32]

SH_COEFFICIENTS = (1, 4, 9, 16)


@dataclass(frozen=True, eq=False)
class GaussianScene:
    """N Gaussians with activated values, in the coordinates of the splat file. All arrays float32, C-contiguous.

    means (N, 3); scales (N, 3) linear standard deviations; rotations (N, 4) unit quaternions w x y z; opacities (N,) in 0..1;
    sh (N, K, 3) spherical-harmonics coefficients (colour last), K = 1, 4, 9 or 16 for degree 0..3.
    `dropped` counts Gaussians left out on reading because a value was not finite; `format` names the source format.
    `orientation` is which way the file's axes point by the convention of its format: the importer's default, nothing more.
    Raises SplatFormatError when shapes disagree.
    """

    means: Float32Array
    scales: Float32Array
    rotations: Float32Array
    opacities: Float32Array
    sh: Float32Array
    dropped: int = 0
    format: str = ""
    orientation: Orientation = "Y_DOWN"

    def __post_init__(self) -> None:
        n = len(self.means)
        want = {"means": (n, 3), "scales": (n, 3), "rotations": (n, 4), "opacities": (n,)}
        for name, shape in want.items():
            if getattr(self, name).shape != shape:
                raise SplatFormatError(f"The scene's {name} have shape {getattr(self, name).shape}; {shape} is needed.")
        if self.sh.ndim != 3 or len(self.sh) != n or self.sh.shape[1] not in SH_COEFFICIENTS or self.sh.shape[2] != 3:
            raise SplatFormatError(f"The scene's SH have shape {self.sh.shape}; (N, K, 3) with K = 1, 4, 9 or 16 is needed.")

    def __len__(self) -> int:
        return len(self.means)

    @property
    def sh_degree(self) -> int:
        return SH_COEFFICIENTS.index(self.sh.shape[1])
