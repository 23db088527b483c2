"""One lens for photos of one camera: the groups of the list, and their cameras under the lens that each group tells together.

What a photo's own solution left (`record.SolvedCamera.own`) is never changed by it: sharing again, with other photos or in
other groups, begins there. Cameras that are no longer as they were solved take no part and are left alone.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import bpy
import numpy as np

from ...core.cameras.files import camera_from_dict
from ...core.errors import GssmcError
from ...core.photos.taken_with import taken_with
from ...core.pose.shared_records import share_records
from ..camera import bridge as camera_bridge
from ..camera import channels as camera_channels
from ..camera import record as camera_record
from ..camera import solution as camera_solution
from ..camera.record import SolvedCamera
from ..support.texts import rpt_
from . import image as photo_image
from . import list as photo_list
from .entry import GssmcPhoto

Record = dict[str, Any]
ROUNDING = 1e-12


@dataclass(frozen=True)
class Shared:
    """How many cameras were changed, and a sentence on each lens that is shared, or on what stood in the way."""

    changed: int
    sentences: tuple[str, ...]


@dataclass(frozen=True)
class _Solved:
    """A camera of the list that is as it was solved; `own` is the record of its photo's own solution."""

    camera: bpy.types.Object
    solution: SolvedCamera
    own: Record


def share(scene: bpy.types.Scene) -> Shared:
    """Gives the cameras of each group their shared lens, and those in none their own one back."""
    groups = _groups(scene)
    wanted: list[tuple[_Solved, Record]] = []
    sentences: list[str] = []
    for name, members in groups:
        shared = share_records([member.own for member in members], name) if name and len(members) > 1 else None
        records: Mapping[int, Record] = shared.records if shared else {}
        wanted += [(member, records.get(i, member.own)) for i, member in enumerate(members)]
        if shared:
            values = {"name": name, "count": shared.count, "focal": shared.focal}
            sentences.append(rpt_("One lens for {count} of the photos ({name}): {focal}.", **values))
        elif name and len(members) > 1:
            sentences.append(rpt_("The photos of {name} agree on no lens, so each keeps its own.", name=name))
    problems = [_write(scene, member, record) for member, record in wanted if _differs(member.solution, record)]
    return Shared(problems.count(""), (*sentences, *filter(None, problems)))


def _groups(scene: bpy.types.Scene) -> list[tuple[str, list[_Solved]]]:
    """The groups by name, in the order of the list. The last one, without a name, has the cameras that are in no group."""
    groups: dict[Any, list[_Solved]] = {}
    for entry in scene.gssmc.photos:
        solved = _solved(scene, entry)
        if solved:
            groups.setdefault(_key(entry, solved), []).append(solved)
    alone = groups.pop(None, [])
    return [*((str(key[0]), members) for key, members in groups.items()), ("", alone)]


def _key(entry: GssmcPhoto, solved: _Solved) -> tuple[Any, int, int] | None:
    """What the photos of a group have in common, its name first; None for a photo that is in none."""
    size = solved.own["width"], solved.own["height"]
    image, name = photo_image.camera_photo(solved.camera), entry.lens_group.strip()
    file = photo_image.photo_file(image) if image and not name else ""
    taken = taken_with(file) if file else None
    return (name, *size) if name else (taken, *size) if taken else None


def _solved(scene: bpy.types.Scene, entry: GssmcPhoto) -> _Solved | None:
    """None where the camera is not as it was solved, or its photo can tell nothing of its lens."""
    camera = photo_list.camera_of(scene, entry)
    solution = camera_record.read(camera.data) if camera else None
    own = camera_record.own_of(solution) if solution else None
    if camera is None or solution is None or own is None:
        return None
    holds = camera_solution.verdict(scene, camera) in ("TRUSTED", "CHECK")
    return _Solved(camera, solution, own) if holds else None


def _differs(solution: SolvedCamera, record: Record) -> bool:
    now, wanted = solution.camera, camera_from_dict(record)
    turned = np.abs(now.pose.R - wanted.pose.R).max() > ROUNDING  # a rotation that is read is orthonormalised anew
    said = solution.verdict, list(solution.reasons)
    return bool(
        turned
        or (now.pose.t != wanted.pose.t).any()
        or now.intrinsics != wanted.intrinsics
        or said != (record["verdict"], record["reasons"])
    )


def _write(scene: bpy.types.Scene, solved: _Solved, record: Record) -> str:
    """Sets a camera to its record. Returns "", or why it was left as it was."""
    camera, splat = solved.camera, scene.gssmc.splat
    try:
        found = replace(camera_from_dict(record), focal_guessed=solved.solution.camera.focal_guessed)
        camera_channels.check_writable(camera)
        camera_bridge.write_camera(scene, camera, splat, found)
        camera_channels.write_keyframes(scene, camera)
    except GssmcError as error:
        return rpt_('"{name}" keeps its lens: {reason}', name=camera.name, reason=error)
    changed = replace(solved.solution, camera=found, verdict=record["verdict"], reasons=tuple(record["reasons"]))
    camera_solution.keep(scene, camera, splat, changed)
    return ""
