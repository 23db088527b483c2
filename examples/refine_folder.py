"""Refines every photo of a folder in background Blender, and saves one scene with all cameras.

blender -b --python-exit-code 1 --python examples/refine_folder.py -- SCENE.ply PHOTOS_DIR CAMERAS.json OUT.blend

CAMERAS.json holds a rough start camera for each photo (format: README). The extension must be installed. A photo that cannot
be refined is reported and leaves its camera at the start; the others go on.
"""

import argparse
import sys
from pathlib import Path

import addon_utils
import bpy

EXTENSION = "bl_ext.user_default.gssmc"
PHOTO_SUFFIXES = {".jpg", ".jpeg", ".png", ".tif", ".tiff", ".webp"}


def main() -> None:
    options = parse_arguments()
    if addon_utils.enable(EXTENSION) is None:
        raise SystemExit("The GS-SMC extension is not installed; install its zip first (README).")
    start_with_empty_scene()
    bpy.ops.gssmc.import_splats(filepath=str(options.scene.resolve()), orientation=options.up)
    photos = sorted(p for p in options.photos.iterdir() if p.suffix.lower() in PHOTO_SUFFIXES)
    if not photos:
        raise SystemExit(f"{options.photos} holds no photos.")
    for photo in photos:
        print(f"{photo.name}: {refine_one(photo.resolve(), options.cameras.resolve())}", flush=True)
    bpy.ops.wm.save_as_mainfile(filepath=str(options.out.resolve()))


def parse_arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="refine_folder.py", description=__doc__)
    parser.add_argument("scene", type=Path)
    parser.add_argument("photos", type=Path)
    parser.add_argument("cameras", type=Path)
    parser.add_argument("out", type=Path)
    parser.add_argument("--up", default="Y_DOWN", choices=("Y_DOWN", "Y_UP", "Z_UP", "Z_DOWN"), help="the splat's up axis")
    return parser.parse_args(sys.argv[sys.argv.index("--") + 1 :] if "--" in sys.argv else sys.argv[1:])


def start_with_empty_scene() -> None:
    for obj in list(bpy.data.objects):
        bpy.data.objects.remove(obj)


def refine_one(photo: Path, cameras: Path) -> str:
    """One line on what came out. Operators raise RuntimeError, with their message, when they cannot do their work."""
    try:
        bpy.ops.gssmc.add_photo(filepath=str(photo), camera="NEW", camera_file=str(cameras))
        bpy.ops.gssmc.refine()
    except RuntimeError as error:
        return str(error).removeprefix("Error: ").strip()
    camera = bpy.context.scene.camera
    x, y, z = camera.matrix_world.translation
    reason = camera.data.gssmc.reasons.splitlines()[0]
    return (
        f"{camera.data.gssmc.verdict.lower()}, camera at ({x:.4f}, {y:.4f}, {z:.4f}), lens {camera.data.lens:.3f} mm. {reason}"
    )


if __name__ == "__main__":
    main()
