"""Data sets in: one module per layout, asked in this order. Poses leave through `pose_list`, `colmap` and `nerfstudio`."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

from ..errors import CameraError, DatasetError
from ..support.words import counted
from . import cambridge, camera_json, colmap, inria, nerfstudio, pose_list, seven_scenes
from .files import StartCamera
from .names import match_names, record_of_photo
from .programs import (
    bundler,
    fspy,
    meshroom,
    metashape,
    ns_export,
    nvm,
    opensfm,
    others,
    polycam,
    realitycapture,
    realitycapture_xmp,
    record3d,
)
from .types import PosedFrame, PoseSet, QueryPhoto, Split, bad_note, short
from .unplaced import Unplaced, read_wanted

__all__ = [
    "LAYOUTS",
    "CameraFile",
    "Layout",
    "PoseSet",
    "PosedFrame",
    "QueryPhoto",
    "Split",
    "camera_file",
    "detect",
    "has_queries",
    "match_names",
    "queries",
    "read",
    "read_usable",
    "short",
    "starts",
]


@dataclass(frozen=True)
class Layout:
    """`detect` tells whether a path is of this layout; `read` gives its poses; `queries` its test photos, where it has photos
    with a known place on disk, for an optional focal length in pixels.
    """

    detect: Callable[[Path], bool]
    read: Callable[[Path, Split], PoseSet]
    queries: Callable[[Path, float | None], list[QueryPhoto]] | None = None


@dataclass(frozen=True)
class CameraFile:
    """The usable records of a file, in its order, sentences on what of it is left out, `bad` those on records that cannot be
    used, and how many records the file has in all.
    """

    records: tuple[StartCamera | Unplaced, ...]
    notes: tuple[str, ...] = ()
    bad: tuple[str, ...] = ()
    count: int = 0

    @property
    def placed(self) -> tuple[StartCamera, ...]:
        """Those that have a pose."""
        return tuple(one for one in self.records if isinstance(one, StartCamera))

    def record_of(self, photo: str, source: str) -> StartCamera | Unplaced:
        """The photo's own record (`record_of_photo`). Raises CameraError, which tells of a record that cannot be used too."""
        try:
            return record_of_photo(self.records, photo, source, alone=self.count == 1)
        except CameraError as error:
            raise CameraError(" ".join([str(error), *self.bad[:1]])) from None


LAYOUTS: dict[str, Layout] = {
    "7scenes": Layout(seven_scenes.detect, seven_scenes.read, seven_scenes.queries),
    "cambridge": Layout(cambridge.detect, cambridge.read, cambridge.queries),
    "nerfstudio": Layout(nerfstudio.detect, nerfstudio.read),
    "inria": Layout(inria.detect, inria.read),
    "ns-export": Layout(ns_export.detect, ns_export.read),
    "opensfm": Layout(opensfm.detect, opensfm.read),
    "meshroom": Layout(meshroom.detect, meshroom.read),
    "metashape": Layout(metashape.detect, metashape.read),
    "realitycapture": Layout(realitycapture.detect, realitycapture.read),
    "bundler": Layout(bundler.detect, bundler.read),
    "nvm": Layout(nvm.detect, nvm.read),
    "polycam": Layout(polycam.detect, polycam.read),
    "record3d": Layout(record3d.detect, record3d.read),
    "fspy": Layout(fspy.detect, fspy.read),
    "others": Layout(others.detect, others.read),
    "cameras": Layout(camera_json.detect, camera_json.read),
    "colmap": Layout(colmap.detect, colmap.read),
    "realitycapture-xmp": Layout(realitycapture_xmp.detect, realitycapture_xmp.read),
    "poses": Layout(pose_list.detect, pose_list.read),
}


def detect(path: Path) -> str | None:
    """The name of the path's layout, or None when it has none (a folder of something else, or nothing at all)."""
    return next((name for name, layout in LAYOUTS.items() if path.exists() and layout.detect(path)), None)


def read(path: Path, split: Split = "test") -> PoseSet:
    """The poses at `path`. `split` matters to layouts that have one. Raises DatasetError or CameraError, also where only one of
    the records cannot be used.
    """
    found = read_usable(path, split)
    if found.bad:
        raise DatasetError(found.bad[0])
    return found


def read_usable(path: Path, split: Split = "test") -> PoseSet:
    """As `read`; records that cannot be used are left out, and told of in the set's `notes`."""
    return LAYOUTS[_known(path)].read(path, split)


def camera_file(path: Path) -> CameraFile:
    """The cameras at `path`, in any layout, with or without poses; a record that cannot be used is left out, with a note.

    Raises DatasetError or CameraError.
    """
    if not path.exists():
        raise CameraError(f"There is no camera file at '{path}'; check the path.")
    if _known(path) == "cameras":
        wanted, bad = read_wanted(path)
        return CameraFile(tuple(wanted), bad_note(bad, path.name), bad, len(wanted) + len(bad))
    found = LAYOUTS[_known(path)].read(path, "test")
    records = [
        StartCamera(one.pose, one.name, one.intrinsics, one.focal_guessed, found.pixel_order, one.lens_of_size, one.wide)
        for one in found.frames
        if one.is_picture
    ]
    if not records:
        raise DatasetError(
            " ".join(found.notes) or f"No camera in '{path.name}' has a pose; give a file of cameras with poses."
        )
    count = found.unsolved + len(found.frames)
    notes = (*found.notes, *_lacking(found.unsolved, count, path))
    return CameraFile(tuple(records), notes, found.bad, count + len(found.bad))


def starts(path: Path) -> CameraFile:
    """As `camera_file`, without the photos that have no pose."""
    found = camera_file(path)
    if not found.placed:
        raise DatasetError(f'No camera in \'{path.name}\' has a pose; give cameras with "R" and "t".')
    count = len(found.records)
    notes = (*found.notes, *_lacking(count - len(found.placed), count, path))
    return replace(found, records=found.placed, notes=notes)


def _lacking(rest: int, count: int, path: Path) -> tuple[str, ...]:
    """What is said of the records of a file that have no pose."""
    return (f"Without a pose, hence left out: {rest} of {counted(count, 'camera')} in '{path.name}'.",) if rest else ()


def has_queries(path: Path) -> bool:
    """Whether `queries` gives the test photos of a folder; one of no layout counts, so that its error is told."""
    layout = detect(path)
    return layout is None or LAYOUTS[layout].queries is not None


def queries(path: Path, focal: float | None = None) -> list[QueryPhoto]:
    """The test photos of a scene folder. Raises DatasetError when it is none that brings its photos and lenses."""
    ask = LAYOUTS[_known(path)].queries
    if ask is None:
        able = ", ".join(name for name, layout in LAYOUTS.items() if layout.queries)
        raise DatasetError(f"'{path.name}' is no folder that photos can be taken from; give one of these layouts: {able}.")
    return ask(path, focal)


def _known(path: Path) -> str:
    layout = detect(path)
    if layout is None:
        if not path.exists():
            raise DatasetError(f"There is nothing at '{path}'; check the path.")
        raise DatasetError(
            f"'{path}' is no folder of poses; it should hold TestSplit.txt, dataset_test.txt, images.txt, images.bin, "
            "transforms.json, a capture of Polycam or Record3D, or XMP files of RealityCapture."
        )
    return layout
