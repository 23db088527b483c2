"""Files that an export is to write, checked against those that the scene was made from."""

from __future__ import annotations

from pathlib import Path

import bpy

from ...core.cli.paths import check_outputs
from .texts import rpt_


def check_export(path: Path) -> None:
    """Raises UsageError when an export to `path` would overwrite the file of a photo or of a splat."""
    images = [image.filepath for image in bpy.data.images if image.filepath and image.source in ("FILE", "SEQUENCE", "MOVIE")]
    clips = [clip.filepath for clip in bpy.data.movieclips]
    splats = [cloud.gssmc.file for cloud in bpy.data.objects if cloud.type == "POINTCLOUD" and cloud.gssmc.file]
    read = {
        rpt_("a photo of this file"): [Path(bpy.path.abspath(name)) for name in (*images, *clips)],
        rpt_("the scan of a splat"): [Path(bpy.path.abspath(name)) for name in splats],
    }
    check_outputs({rpt_("The export"): path}, read)
