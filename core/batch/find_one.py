"""One photo found without a start, and its record: shared by `locate`, `refine`, `demo` and the workers of `batch`."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

from ..cameras.unplaced import Unplaced, wanted_to_dict
from ..geometry.camera import Camera
from ..geometry.pinhole_cut import WideCamera
from ..geometry.wide_lens import WideLens
from ..locate import FindReport, Hypothesis, PhotoLens
from ..photos.fit import fit_lens, fit_wide
from ..photos.photo import Photo
from ..photos.wide.cut import central_photo
from ..pose.report import RefineReport
from ..pose.report_json import failed_to_dict, pose_to_dict, report_to_dict
from .refine_wide import cut_sentence

Record = dict[str, Any]
RETRIED = "Found without the start: the refinement from it failed, so the camera was searched for without it."


def find_target(photo: Photo, wanted: Camera | Unplaced) -> PhotoLens:
    """The photo (see `refine_one.read_masked_photo`) with its lens, or the cut of one that needs it (see `whole_found`); the
    pose of `wanted` plays no part.

    Raises PhotoError when the lens does not fit the photo, or it is a panorama, which can't be searched for.
    """
    wide = _wide(wanted)
    if wide is not None:
        made = central_photo(photo, fit_wide(photo, wide, wanted.pixel_order))
        return PhotoLens(made.photo, made.cut.intrinsics)
    lens = None if wanted.intrinsics is None else fit_lens(photo, wanted.intrinsics, wanted.pixel_order)
    return PhotoLens(photo, lens, wanted.focal_guessed)


def whole_found(photo: Photo, found: FindReport, wanted: Camera | Unplaced) -> FindReport:
    """What was found of a cut (`find_target`), told of the whole photo; anything else as it is."""
    wide = _wide(wanted)
    if wide is None:
        return found
    lens = fit_wide(photo, wide, wanted.pixel_order)
    said = cut_sentence(lens, central_photo(photo, lens).cut)

    def whole(camera: Camera) -> WideCamera:
        return WideCamera.of(lens, camera.pose, wanted.file)

    refined: RefineReport | None = None
    if found.refined is not None:
        reasons = (*found.refined.reasons, said)
        refined = replace(found.refined, camera=whole(found.refined.camera), start=whole(found.refined.start), reasons=reasons)
    camera = None if found.camera is None else whole(found.camera)
    return replace(found, camera=camera, refined=refined, reasons=(*found.reasons, said))


def _wide(wanted: Camera | Unplaced) -> WideLens | None:
    if isinstance(wanted, Unplaced):
        return wanted.wide
    return wanted.lens if isinstance(wanted, WideCamera) else None


def found_to_dict(found: FindReport, wanted: Unplaced) -> Record:
    """The record: as `report_to_dict` gives it, with "hypothesis" (what the map said, which was refined; null where nothing in
    it matched) and "map_views" (how many views of the map were tried). A photo that was not found has neither "R" nor "t" nor
    a "start".
    """
    if found.refined is None:
        record = failed_to_dict(wanted, "")
    elif found.camera is None:
        record = {**report_to_dict(found.refined), **wanted_to_dict(wanted), "start": None}
    else:
        record = {**report_to_dict(found.refined), "file": wanted.file}
    told = {"verdict": found.verdict, "reasons": list(found.reasons), "seconds": round(found.seconds, 3)}
    return {**record, **told, "hypothesis": _hypothesis(found.hypothesis), "map_views": found.views}


def joined(first: Record, found: Record) -> Record:
    """The record of a photo whose refinement from its start failed (`first`) and that was searched for without it (`found`):
    what was found, or else the first one, whose camera is the start.
    """
    seconds = round(first["seconds"] + found["seconds"], 3)
    if found["verdict"] != "failed":
        return {**found, "reasons": [*found["reasons"], RETRIED], "seconds": seconds}
    reasons = not_found_either(first["reasons"], found["reasons"])
    more = {name: found.get(name) for name in ("hypothesis", "map_views")}
    return {**first, "reasons": reasons, "seconds": seconds, **more}


def not_found_either(first: Sequence[str], found: Sequence[str]) -> list[str]:
    """The reasons of a photo whose refinement from its start failed, and that was not found without it."""
    return [*first, *(f"Without the start: {reason}" for reason in found if reason not in first)]


def _hypothesis(one: Hypothesis | None) -> Record | None:
    if one is None:
        return None
    numbers = {"focal_factor": one.factor, "inliers": one.inliers, "cells": one.cells, "depth": one.depth}
    return {**pose_to_dict(one.pose), **numbers}
