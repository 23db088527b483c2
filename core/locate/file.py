"""The map on disk: one file that is whole or refused, and belongs to one scan and one set of settings."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import CameraError, GssmcError
from ..geometry.camera import Camera, FloatArray, Pose
from ..splats.scene import GaussianScene
from ..support.arrays_file import ArraysFileError, read_arrays
from ..support.atomic import atomic_write
from .landmarks import LandmarkMap, MapView
from .search_file import search_arrays, search_of
from .settings import MapSettings

VERSION = 2  # of the file and of how maps are made; a map of another version is made again
FORMAT = "gssmc-map"
DIGEST_BYTES = 16
HEAD = "head"
COLUMNS = ("R", "t", "depth", "known", "counts", "points", "descriptors")


class MapFileError(GssmcError):
    """A map file is damaged, of another version, or belongs to another scan or other settings; make the map again."""


def scan_digest(scene: GaussianScene) -> str:
    """A fingerprint (hexadecimal) of the Gaussians themselves, whatever file or format they came from."""
    digest = hashlib.blake2b(digest_size=DIGEST_BYTES)
    for values in (scene.means, scene.scales, scene.rotations, scene.opacities, scene.sh):
        digest.update(str(values.shape).encode())
        digest.update(np.ascontiguousarray(values).data)
    if scene.antialiased:
        digest.update(b"antialiased")
    return digest.hexdigest()


def map_key(digest: str, settings: MapSettings, known: Sequence[Camera] = ()) -> str:
    """What a map depends on, as one word: the scan's `digest`, the settings but for threads, the known cameras, the version."""
    options = {name: value for name, value in asdict(settings).items() if name != "threads"}
    text = json.dumps([FORMAT, VERSION, digest, options, [_numbers(camera) for camera in known]])
    return hashlib.blake2b(text.encode(), digest_size=DIGEST_BYTES).hexdigest()


def _numbers(camera: Camera) -> list[float]:
    k, pose = camera.intrinsics, camera.pose
    values: list[float] = np.round([k.width, k.height, k.fx, k.fy, k.cx, k.cy, *pose.R.ravel(), *pose.t], 9).tolist()
    return values


def write_map(path: str | Path, made: LandmarkMap) -> None:
    """Write the map; the file appears whole or not at all. OSError passes through."""
    views = made.views
    width = views[0].descriptors.shape[1] if views else 0
    arrays: dict[str, Any] = {
        "R": np.array([v.pose.R for v in views]).reshape(-1, 3, 3),
        "t": np.array([v.pose.t for v in views]).reshape(-1, 3),
        "depth": np.array([v.depth for v in views], np.float64),
        "known": np.array([v.known for v in views], np.bool_),
        "counts": np.array([len(v) for v in views], np.int64),
        "points": np.concatenate([np.zeros((0, 3), np.float32), *(v.points for v in views)]),
        "descriptors": np.concatenate([np.zeros((0, width), np.uint8), *(v.descriptors for v in views)]),
    }
    search, columns = search_arrays(made.search)
    arrays |= columns
    head = {"format": FORMAT, "version": VERSION, "key": made.key, "complete": made.complete, "search": search}
    with atomic_write(path, "wb") as file:
        np.savez(file, **{HEAD: np.frombuffer(json.dumps(head).encode(), np.uint8), **arrays})


def read_map(path: str | Path, key: str) -> LandmarkMap:
    """The map in the file, which must be the one that `key` names. Raises MapFileError, whose remedy is to make it again."""
    path = Path(path)
    try:
        head = read_head(path)
        arrays = read_arrays(path) if _is_ours(head, key) else {}
    except (OSError, ArraysFileError) as error:
        what = f"cannot be read ({error.strerror})" if isinstance(error, OSError) and error.strerror else "is damaged"
        raise MapFileError(f"The map '{path.name}' {what}; it has to be made again.") from error
    if not arrays:
        raise MapFileError(f"The map '{path.name}' belongs to another scan, other settings or another version; make it again.")
    try:
        views, search = _views(arrays), search_of(head.get("search"), arrays)
    except (CameraError, ValueError, TypeError, KeyError) as error:
        raise MapFileError(f"The map '{path.name}' holds impossible values; it has to be made again.") from error
    return LandmarkMap(key, views, bool(head.get("complete")), search)


def read_head(path: Path) -> dict[str, Any]:
    """The head of a map's file; empty where it is something else. Raises ArraysFileError, and OSError."""
    try:
        head = json.loads(read_arrays(path, HEAD.__eq__)[HEAD].tobytes())
    except (KeyError, ValueError, RecursionError) as error:
        raise ArraysFileError("no head") from error
    return head if isinstance(head, dict) and head.get("format") == FORMAT else {}


def _is_ours(head: dict[str, Any], key: str) -> bool:
    return (head.get("format"), head.get("version"), head.get("key")) == (FORMAT, VERSION, key)


def _views(arrays: dict[str, Any]) -> tuple[MapView, ...]:
    """The views; raises ValueError or CameraError when the arrays do not fit each other."""
    R, t, depth, known, counts, points, descriptors = (arrays[name] for name in COLUMNS)
    count, total = len(counts), len(points)
    fitting = R.shape == (count, 3, 3) and t.shape == (count, 3) and depth.shape == known.shape == counts.shape == (count,)
    if not fitting or points.shape != (total, 3) or descriptors.ndim != 2 or len(descriptors) != total:
        raise ValueError("the arrays' shapes do not fit each other")
    if points.dtype != np.float32 or descriptors.dtype != np.uint8 or counts.dtype != np.int64:
        raise ValueError("an array is of another kind")
    if (counts < 0).any() or counts.sum() != total or not np.isfinite(points).all() or not (depth > 0).all():
        raise ValueError("a count, point or depth is out of range")
    ends = np.cumsum(counts)
    return tuple(
        MapView(_pose(R[i], t[i]), points[e - c : e], descriptors[e - c : e], float(depth[i]), bool(known[i]))
        for i, (e, c) in enumerate(zip(ends.tolist(), counts.tolist(), strict=True))
    )


def _pose(R: FloatArray, t: FloatArray) -> Pose:
    """The pose as it was written, to the last bit: a photo has the same answer with a new map and with a stored one. Raises
    CameraError where it is none.
    """
    Pose(R, t)
    return Pose.as_it_is(R, t)
