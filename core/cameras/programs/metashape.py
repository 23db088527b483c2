"""Agisoft Metashape's cameras as XML (File > Export > Export Cameras): camera-to-world matrices of the chunk's own coordinates.

The lens (Metashape's manual, appendix on camera models): its centre as an offset from the picture's, k1 to k4, p1 and p2 in the
other order than OpenCV's, and b1, b2 for a scaled and skewed sensor. Cameras are of the photos as they are stored.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from xml.etree import ElementTree
from xml.etree.ElementTree import Element

from ...errors import CameraError, DatasetError
from ...geometry.camera import Intrinsics
from ...geometry.foreign_lens import BROWN, Lens
from ..types import PosedFrame, PoseSet, Split, collect, pose_set
from .parts import FAULTS, begins, finite, foreign, pose_of, with_lens

MODELS = {"frame": BROWN, "fisheye": "THIN_PRISM_FISHEYE", "spherical": "EQUIRECTANGULAR", "cylindrical": "CYLINDRICAL"}
LARGEST_FILE = 256 << 20


def detect(path: Path) -> bool:
    """An XML document with a chunk in it."""
    start = begins(path)
    return start.lstrip().startswith("<") and "<document" in start and "<chunk" in start


def read(path: Path, split: Split = "test") -> PoseSet:
    """The cameras that were aligned. Raises DatasetError."""
    root = _root(path)
    lenses = {sensor.get("id", ""): _lens(sensor) for sensor in root.iter("sensor")}
    cameras = [camera for camera in root.iter("camera") if camera.get("label")]
    placed = [camera for camera in cameras if camera.find("transform") is not None]
    frames, bad = collect(placed, lambda camera: _frame(camera, lenses, path.name))
    found = pose_set(path, frames, metric=False, unsolved=len(cameras) - len(placed), bad=bad)
    return replace(found, pixel_order="stored")


def _root(path: Path) -> Element:
    data = path.read_bytes() if path.stat().st_size <= LARGEST_FILE else b""
    # Such a file defines no entities of its own, which could grow without bound.
    if not data or b"<!ENTITY" in data:
        raise DatasetError(f"'{path.name}' is no export of cameras; export them from Metashape as XML again.")
    try:
        return ElementTree.fromstring(data)
    except (ElementTree.ParseError, ValueError, LookupError):
        raise DatasetError(f"'{path.name}' is no valid XML; export the cameras from Metashape again.") from None


def _frame(camera: Element, lenses: Mapping[str, Lens], file: str) -> PosedFrame:
    name = camera.get("label", "")
    where = f"The camera '{name:.60}' of '{file}'"
    try:
        matrix = finite(camera.findtext("transform", "").split(), 16).reshape(4, 4)
    except FAULTS:
        raise DatasetError(f"{where} has a transform that is not 16 numbers; export the cameras again.") from None
    pose = pose_of(where, matrix[:3, :3].T, matrix[:3, 3])
    return with_lens(name, pose, lenses.get(camera.get("sensor_id", ""), Lens(None)))


def _lens(sensor: Element) -> Lens:
    """The adjusted calibration, else the only one."""
    found = sensor.findall("calibration")
    chosen = next((one for one in found if one.get("class") == "adjusted"), found[0] if found else None)
    size = sensor.find("resolution")
    if chosen is None or size is None:
        return Lens(None)
    try:
        numbers = {child.tag: finite([child.text], 1)[0] for child in chosen if child.tag != "resolution"}
        width, height, f = int(size.get("width", "")), int(size.get("height", "")), float(numbers["f"])
        centre = width / 2 + float(numbers.get("cx", 0)), height / 2 + float(numbers.get("cy", 0))
        values = {name: float(numbers.get(name, 0)) for name in ("k1", "k2", "k3", "k4")}
        values |= {"p1": float(numbers.get("p2", 0)), "p2": float(numbers.get("p1", 0))}
        skew = {name: float(numbers.get(name, 0)) / f for name in ("b1", "b2")}
        model = MODELS.get(sensor.get("type", "frame"), sensor.get("type", ""))
        values |= skew if model == BROWN else {"sx1": 0.0, "sy1": 0.0}
        return foreign(model, Intrinsics(width, height, f, f, *centre), values)
    except (*FAULTS, CameraError):
        return Lens(None, "the lens is left out, for its values make none")
