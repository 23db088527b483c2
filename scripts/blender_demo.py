"""The main job on the built-in sample, through Blender's own Python module: python scripts/blender_demo.py --out demo

Builds a room and a photo of it, imports both with the extension's operators, refines a camera from a wrong start, and leaves
sample.blend and before_after.png. Exit code 0 when the refined camera is trusted and right, 3 otherwise.
"""

from __future__ import annotations

import argparse
import os
import shutil
import sys
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from core.geometry.camera import Camera
    from core.synthetic import SampleFiles

REPO = Path(__file__).resolve().parent.parent
EXTENSION = "bl_ext.user_default.gssmc"
RIGHT_MM, RIGHT_DEG = 15.0, 0.2  # the room's units are metres, and it is 5 m deep


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=Path, default=Path("demo"), help="folder for sample.blend and before_after.png (demo)")
    out = parser.parse_args().out.resolve()
    out.mkdir(parents=True, exist_ok=True)
    sys.path.insert(0, str(REPO))
    with tempfile.TemporaryDirectory() as folder:
        enable_extension(Path(folder))
        return run(out)


def enable_extension(resources: Path) -> None:
    """Makes this checkout an enabled extension of a Blender with user files of its own: nobody's settings are touched."""
    home = resources / "extensions" / "user_default"
    home.mkdir(parents=True)
    try:
        (home / "gssmc").symlink_to(REPO, target_is_directory=True)
    except OSError:  # Windows, without the right to make links
        for name in ("core", "gssmc_addon", "operators"):
            shutil.copytree(REPO / name, home / "gssmc" / name)
        for name in ("__init__.py", "blender_manifest.toml"):
            shutil.copy2(REPO / name, home / "gssmc" / name)
    os.environ["BLENDER_USER_RESOURCES"] = str(resources)  # read when bpy is imported
    import bpy  # noqa: F401, I001 - Blender's own modules can be found only after it
    import addon_utils

    if addon_utils.enable(EXTENSION) is None:
        sys.exit("Blender could not enable the extension; the lines above say why.")


def run(out: Path) -> int:
    """The job as a script of the user's own would do it: three operators and a save."""
    import bpy

    from core.synthetic import write_sample

    print("Building the sample room and its photo ...", flush=True)
    sample = write_sample(out)
    for obj in list(bpy.data.objects):
        bpy.data.objects.remove(obj)
    bpy.ops.gssmc.import_splats(filepath=str(sample.scene))
    bpy.ops.gssmc.add_photo(filepath=str(sample.photo), camera="NEW", camera_file=str(sample.start))
    camera = bpy.context.scene.camera
    before = engine_camera(camera, sample)
    print("Refining the camera ...", flush=True)
    bpy.ops.gssmc.refine()
    after = engine_camera(camera, sample)
    camera.data.gssmc.photo.pack()  # the .blend is whole wherever it is copied to
    bpy.ops.wm.save_as_mainfile(filepath=str(out / "sample.blend"))
    draw_before_after(sample, before, after, out / "before_after.png")
    print(f"Look at {out / 'before_after.png'} and open {out / 'sample.blend'}.")
    return say(sample, camera.data.gssmc, before, after)


def engine_camera(camera: Any, sample: SampleFiles) -> Camera:
    """The Blender camera object as the engine sees it: in the splat file's coordinates, at the photo's size."""
    import bpy
    from bl_ext.user_default.gssmc.gssmc_addon.camera import bridge as camera_bridge

    from core.cameras.files import read_cameras
    from core.geometry.camera import Camera, Intrinsics, Pose

    bpy.context.view_layer.update()
    size = read_cameras(sample.start)[0].intrinsics
    scene = bpy.context.scene
    found = camera_bridge.read_camera(scene, camera, scene.gssmc.splat).at_size(size.width, size.height)
    k = found.intrinsics  # the extension has its own copy of the engine, whose classes are not this script's
    return Camera(Intrinsics(k.width, k.height, k.fx, k.fy, k.cx, k.cy, k.dist), Pose(found.pose.R, found.pose.t))


def draw_before_after(sample: SampleFiles, before: Camera, after: Camera, path: Path) -> None:
    from core.photos.photo import read_photo
    from core.pictures.chessboard import before_after, save_png
    from core.render import Renderer
    from core.splats import read_splats

    renderer = Renderer(read_splats(sample.scene))
    save_png(str(path), before_after(renderer, read_photo(sample.photo), before, after))


def say(sample: SampleFiles, note: Any, before: Camera, after: Camera) -> int:
    """Prints verdict and errors; 0 when the camera is trusted and home, else 3."""
    from core.cameras.files import read_cameras
    from core.geometry.camera import pose_error

    truth = read_cameras(sample.truth)[0].pose
    distance, degrees = pose_error(before.pose, truth)
    print(f"before: {1000 * distance:.1f} mm and {degrees:.2f} deg off (the room is 5 m deep)")
    distance, degrees = pose_error(after.pose, truth)
    print(f"after:  {1000 * distance:.2f} mm and {degrees:.3f} deg off")
    print(f"verdict: {note.verdict.lower()}. {' '.join(note.reasons.splitlines())}")
    return 0 if note.verdict == "TRUSTED" and 1000 * distance < RIGHT_MM and degrees < RIGHT_DEG else 3


if __name__ == "__main__":
    sys.exit(main())
