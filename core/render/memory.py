"""A rough estimate of the memory that a piece of work takes, so that it can be refused before the machine runs out of it.

The factors err on the side of too much. Peaks measured while the built-in sample was refined at several sizes (SH degree 1,
engine alone, all processes together): 12k Gaussians on one thread 0.44 GB, 300k on two 0.71, 1M on two 1.32, on four 2.27; the
estimate says 0.58, 0.99, 1.74 and 2.74.
"""

from __future__ import annotations

import os
from pathlib import Path

from ..errors import GssmcError
from ..splats import scan_files
from .processes import views_at_once

# Taken by numpy, OpenCV, SciPy and the features of all views.
BASE_BYTES = 450_000_000
# Mean, scale, rotation and opacity of a Gaussian.
FLOATS_WITHOUT_SH = 11
# Taken by each process that draws views: Python, numpy, OpenCV and one view.
PROCESS_BYTES = 100_000_000
# Taken by each Gaussian in each view that is being drawn: projected, sorted and listed by tiles.
RENDER_BYTES = 400
# Copies of the scene: Blender's, the engine's, and the one being assembled (later the one that the processes share).
COPIES = 3
# Taken by each Gaussian while a map of the scan is made: its light copy, the tables of that, and a view's buffers. Measured of
# 1.5 million Gaussians: 262 bytes each.
MAP_BYTES = 300
# Taken by each view of a map: descriptors and places of its landmarks.
MAP_VIEW_BYTES = 200_000
# Taken by each pixel of a view of a proxy, all of which are kept, and by each triangle of its budget.
PROXY_PIXEL_BYTES, PROXY_FACE_BYTES = 60, 6000
# Taken by each pixel of a photo while it is decoded and reduced.
PIXEL_BYTES = 60


class MemoryLimitError(GssmcError):
    """The work would take more memory than it may."""


def machine_bytes() -> int:
    """The machine's memory; 0 where the system does not say (Windows)."""
    try:
        return os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    except (AttributeError, ValueError, OSError):
        return 0


def refine_bytes(gaussians: int, sh_coefficients: int, photo_pixels: int, threads: int) -> int:
    """What a refinement takes at its peak. `threads`: views drawn side by side, 0 = one per core."""
    scene = 4 * (FLOATS_WITHOUT_SH + 3 * sh_coefficients) * gaussians
    views = views_at_once(threads)
    each = PROCESS_BYTES + RENDER_BYTES * gaussians
    return BASE_BYTES + COPIES * scene + each * views + PIXEL_BYTES * photo_pixels


def find_bytes(gaussians: int, sh_coefficients: int, threads: int, views: int) -> int:
    """What finding a photo's camera takes at its peak: a refinement, while the scan, what draws its map's `views` and the map
    itself are kept for what follows.
    """
    scene = 4 * (FLOATS_WITHOUT_SH + 3 * sh_coefficients) * gaussians
    return refine_bytes(gaussians, sh_coefficients, 0, threads) + scene + MAP_BYTES * gaussians + MAP_VIEW_BYTES * views


def proxy_bytes(gaussians: int, sh_coefficients: int, faces: int, view_pixels: int) -> int:
    """What a proxy of `faces` triangles takes at its peak, from views of `view_pixels` together: the scan, the tables of its
    colours and of its planes, one view being drawn, and the grid or the mesh before it is decimated, whichever is larger.
    """
    tables = 4 * (2 * FLOATS_WITHOUT_SH + 3 * sh_coefficients) * gaussians
    scene = 4 * (FLOATS_WITHOUT_SH + 3 * sh_coefficients) * gaussians
    views = PROXY_PIXEL_BYTES * view_pixels + RENDER_BYTES * gaussians
    return BASE_BYTES + COPIES * scene + 2 * tables + views + PROXY_FACE_BYTES * faces


def import_bytes(file: Path) -> int:
    """What reading a splat file into Blender takes at its peak; compressed formats hold about five times their size."""
    size = sum(one.stat().st_size for one in scan_files(file)) if file.exists() else 0
    return BASE_BYTES + COPIES * size * (1 if file.suffix.lower() == ".ply" else 6)


def check(what: str, needed: int, limit: int) -> None:
    """Raises MemoryLimitError when `needed` bytes are more than `limit`; 0 means no limit."""
    if limit and needed > limit:
        raise MemoryLimitError(
            f"{what} would take about {needed / 1e9:.1f} GB of memory, and {limit / 1e9:.1f} GB are allowed; "
            "use a smaller scan or fewer threads, or raise the limit in the preferences."
        )
