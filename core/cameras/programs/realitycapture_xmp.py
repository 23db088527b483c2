"""RealityCapture's (RealityScan's) XMP files, one beside each photo: a place, a rotation, and a lens.

The rotation is world-to-camera, row by row, the place is the camera's centre; OpenCV's axes. Each may be an attribute or an
element, as versions differ. FocalLength35mm is in mm on film of 36 mm across the photo's long side; the centre is an offset in
shares of that side, with the sizes that the program's own export templates give to f, px and py.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from xml.etree import ElementTree

from ...errors import DatasetError
from ...geometry.foreign_lens import BROWN
from ..types import PosedFrame, PoseSet, Split, collect, pose_set
from .parts import FAULTS, begins, finite, lens_by_size, pose_of, without_lens

SUFFIX, SIGN = ".xmp", "xcr:"
NAMESPACE = "{http://www.capturingreality.com/ns/xcr/1.1#}"
LARGEST_FILE = 1 << 20
FILM_MM = 36.0
# t1 and t2 stand in the other order than OpenCV's p1 and p2.
COEFFICIENTS = ("k1", "k2", "k3", "k4", "p2", "p1")
MODELS = {"perspective": BROWN, "division": "SIMPLE_DIVISION", **dict.fromkeys(("brown3", "brown3t2", "brown4"), BROWN)}
MODELS["brown4t2"] = BROWN

Values = Mapping[str, str]


def detect(path: Path) -> bool:
    """Such a file, or a folder that has some."""
    if path.is_dir():
        return any(SIGN in begins(file) for file in _files(path))
    start = begins(path)
    return start.lstrip("\ufeff \r\n\t").startswith("<") and SIGN in start and "xmpmeta" in start


def read(path: Path, split: Split = "test") -> PoseSet:
    """The cameras of the folder's files, or of the one file. Raises DatasetError."""
    files = [file for file in _files(path) if SIGN in begins(file)] if path.is_dir() else [path]
    # A file without a pose tells what the program shall begin with, a lens for instance.
    unsolved: list[Path] = []

    def frame_of(file: Path) -> PosedFrame | None:
        values = _values(file)
        if "Position" in values and "Rotation" in values:
            return _frame(file, values)
        unsolved.append(file)
        return None

    frames, bad = collect(files, frame_of)
    return pose_set(path, frames, metric=False, unsolved=len(unsolved), bad=bad)


def _files(folder: Path) -> list[Path]:
    try:
        return sorted(file for file in folder.iterdir() if file.suffix.lower() == SUFFIX and file.is_file())
    except OSError:
        return []


def _values(file: Path) -> dict[str, str]:
    """What the file says under the program's own names, as attributes or as elements. Raises DatasetError."""
    try:
        data = file.read_bytes() if file.stat().st_size <= LARGEST_FILE else b""
    except OSError as error:
        raise DatasetError(f"'{file}' cannot be read ({error.strerror}); check its permissions.") from error
    # Such a file defines no entities of its own, which could grow without bound.
    if not data or b"<!ENTITY" in data:
        raise DatasetError(f"'{file.name}' is no XMP of RealityCapture; export the metadata again.")
    try:
        root = ElementTree.fromstring(data.strip())
    except (ElementTree.ParseError, ValueError, LookupError):
        raise DatasetError(f"'{file.name}' is no valid XML; export the metadata from RealityCapture again.") from None
    values: dict[str, str] = {}
    for element in root.iter():
        values |= {name.removeprefix(NAMESPACE): text for name, text in element.attrib.items() if NAMESPACE in name}
        if element.tag.startswith(NAMESPACE) and element.text:
            values[element.tag.removeprefix(NAMESPACE)] = element.text
    return values


def _frame(file: Path, values: Values) -> PosedFrame:
    if values.get("Coordinates", "absolute") != "absolute":
        raise DatasetError(f"'{file.name}' places its camera on a rig, not in the scene; export absolute coordinates.")
    try:
        rotation, centre = finite(values["Rotation"].split(), 9).reshape(3, 3), finite(values["Position"].split(), 3)
    except FAULTS:
        raise DatasetError(f"'{file.name}' has no rotation and place of a camera; export the metadata again.") from None
    pose, name = pose_of(f"The camera in '{file.name}'", rotation, centre), file.stem
    if "FocalLength35mm" not in values:
        return PosedFrame(name, pose)
    model = values.get("DistortionModel", "perspective")
    if model not in MODELS:
        return PosedFrame(name, pose, problem=f"the lens model {model[:30]} is not known, and the lens is left out")
    try:
        f, skew = finite([values["FocalLength35mm"], values.get("Skew", 0)], 2).tolist()
        shift = finite([values.get("PrincipalPointU", 0), values.get("PrincipalPointV", 0)], 2).tolist()
        given = [float(value) for value in values.get("DistortionCoeficients", "").split()]
        aspect = float(values.get("AspectRatio", 1))
    except FAULTS:
        return without_lens(name, pose)
    if skew or aspect != 1:
        return PosedFrame(name, pose, problem="the lens is left out, for its pixels are not square")
    numbers = dict(zip(COEFFICIENTS, finite(given, len(given)).tolist(), strict=False))
    values_of = {"k": numbers.get("k1", 0.0)} if model == "division" else {} if model == "perspective" else numbers
    centred = {**values_of, "cx": shift[0], "cy": shift[1]}
    return PosedFrame(name, pose, lens_of_size=lens_by_size(MODELS[model], f / FILM_MM, centred, of_long_side=True))
