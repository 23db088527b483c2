"""What can be chosen about a proxy."""

from __future__ import annotations

from dataclasses import dataclass, field

from ..errors import ProxyError
from ..support.options import check_options, option

# Of the triangles that the grid is made for; decimation leaves the budget. More make edges finer, and take longer.
OVERSAMPLING = 5


@dataclass(frozen=True)
class ProxySettings:
    """Raises ProxyError for values that make no sense."""

    faces: int = field(
        default=100_000,
        metadata=option("triangles of the mesh at most", low=100, high=2_000_000, soft_low=5_000, soft_high=300_000),
    )
    close_holes: bool = field(default=False, metadata=option("close holes that no camera sees into, but for the outer border"))
    long_side_px: int = field(
        default=720,
        metadata=option("views are drawn at this length of their longer side", low=64, high=4096, soft_low=320, unit="px"),
    )
    smooth_px: float = field(
        default=4.0,
        metadata=option(
            "ripples of the splat's depth that are narrower than this in a view are taken out, for they would catch light and "
            "shadow; 0: none",
            low=0,
            high=50,
            soft_high=12,
            unit="px",
        ),
    )
    threads: int = field(default=0, metadata=option("CPU threads that draw a view, 0 = all cores", low=0, high=4096))

    def __post_init__(self) -> None:
        check_options(self, ProxyError)
