"""`convert SCENE OUT`: a splat scan into another format, its axes turned to those of the format."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from ..errors import SplatFormatError
from ..geometry.conventions import Orientation, Similarity, orientation_matrix
from ..splats import GaussianScene, read_splats, scan_files
from ..splats.ply.compressed_write import write_compressed
from ..splats.ply.reader import write_ply
from ..splats.sog.write import write_sog
from ..splats.splat import write_splat
from ..splats.spz.write import write_spz
from ..splats.transform import transformed
from ..splats.turn import turned
from .console import message, say
from .dropped import say_dropped
from .paths import check_outputs

# A sentence on what is lost, where the writer measures that.
Write = Callable[[Path, GaussianScene], str | None]
# By the end of the file's name, the longer ones first.
WRITERS: dict[str, tuple[Orientation, Write]] = {
    ".compressed.ply": ("Y_DOWN", write_compressed),
    ".ply": ("Y_DOWN", write_ply),
    ".spz": ("Y_UP", write_spz),
    ".sog": ("Y_DOWN", write_sog),
    ".splat": ("Y_DOWN", write_splat),
}
UNFLAGGED = (".compressed.ply", ".splat")
UNWRITTEN = (".ksplat", ".glb", ".gltf", ".usd", ".usda", ".usdc", ".usdz")
AXES: dict[Orientation, str] = {"Y_DOWN": "y down", "Y_UP": "y up", "Z_UP": "z up", "Z_DOWN": "z down"}


def is_scene(out: Path) -> bool:
    """Whether the name is that of a splat file, read here or not."""
    return out.name.lower().endswith((*WRITERS, *UNWRITTEN))


def convert_scene(scene_file: Path, out: Path, level: int = 0) -> None:
    """Writes the scan, of a streamed one the `level`, in the format that the name of `out` tells. Raises SplatFormatError,
    UsageError.
    """
    name = out.name.lower()
    ending = next((one for one in WRITERS if name.endswith(one)), None)
    if ending is None:
        raise SplatFormatError(
            f"'{out.suffix}' files are not written; write .ply, and turn that into {out.suffix} with splat-transform."
        )
    check_outputs({"OUT": out}, {"the scan": scan_files(scene_file) if scene_file.exists() else scene_file})
    scene = read_splats(scene_file, level=level)
    say_dropped(scene)
    orientation, write = WRITERS[ending]
    if scene.orientation != orientation:
        message(f"The scan is turned from {AXES[scene.orientation]} to {AXES[orientation]}, as {ending} files have it.")
    if scene.antialiased and ending in UNFLAGGED:
        message(f"That the scan is to be drawn anti-aliased is lost, because {ending} files have no place for it.")
    lost = write(out, _with_axes(scene, orientation))
    if lost:
        message(lost)
    say(f"The scan was written to '{out}'.")


def _with_axes(scene: GaussianScene, orientation: Orientation) -> GaussianScene:
    """The scene turned so that its axes point as `orientation` says: exactly where it is only a half turn about x."""
    if {scene.orientation, orientation} <= {"Y_DOWN", "Y_UP"}:
        return turned(scene, orientation)
    turn = orientation_matrix(orientation).T @ orientation_matrix(scene.orientation)
    return transformed(scene, Similarity.from_matrix(turn), orientation)
