"""What a trial runs inside of Blender as a Python module: `inside_blender.py ACTION FOLDER`, ACTION one of the functions below.

The camera, or the file, that comes of it is written to FOLDER/out; an operator's refusal goes to stderr, with exit code 2.
"""

from __future__ import annotations

import json
import os
import sys
from pathlib import Path

import bpy

MODULE = "bl_ext.user_default.gssmc"
QUICK = {"long_side_px": 240, "iterations": 1, "candidates": 2}
VIEWS = 5


def install(folder: Path) -> None:
    """Puts the extension into the user's folder, once for all trials."""
    bpy.ops.extensions.package_install_files(filepath=os.environ["GSSMC_ZIP"], repo="user_default", enable_on_install=True)


def refine(folder: Path) -> None:
    _placed(folder)
    bpy.ops.gssmc.refine(locate=False, **QUICK)
    _write_camera(folder)


def find(folder: Path) -> None:
    _placed(folder)
    bpy.context.scene.gssmc.map_views = VIEWS
    bpy.context.scene.camera.location.x += 40  # from where nothing is seen
    bpy.ops.gssmc.find_camera(**QUICK)
    _write_camera(folder)


def export(folder: Path) -> None:
    bpy.ops.gssmc.import_splats(filepath=str(folder / "in" / "room.ply"))
    bpy.ops.gssmc.export_splats(filepath=str(folder / "out" / "s.ply"), coordinates="OBJECT")


def _placed(folder: Path) -> None:
    """The splat and two photos with their rough starts."""
    bpy.ops.gssmc.import_splats(filepath=str(folder / "in" / "room.ply"))
    starts = str(folder / "in" / "starts.json")
    bpy.ops.gssmc.add_photo_folder(directory=str(folder / "in" / "photos"), camera_file=starts)
    bpy.context.view_layer.update()


def _write_camera(folder: Path) -> None:
    camera = bpy.context.scene.camera
    bpy.context.view_layer.update()
    solved = camera.data.gssmc
    matrix = [list(row) for row in camera.matrix_world]
    found = {"matrix": matrix, "lens": camera.data.lens, "verdict": solved.verdict, "reasons": solved.reasons}
    (folder / "out" / "r.json").write_text(json.dumps(found))


def main() -> int:
    action, folder = sys.argv[1], Path(sys.argv[2])
    try:
        if action != "install":
            bpy.ops.wm.read_homefile(use_empty=True)
            bpy.ops.preferences.addon_enable(module=MODULE)
        {"install": install, "refine": refine, "find": find, "export": export}[action](folder)
    except RuntimeError as error:  # an operator's report of an error
        sys.stderr.write(f"{str(error).strip()}\n")
        return 2
    return 0


if __name__ == "__main__":
    sys.exit(main())
