"""Small data sets in the layouts of the published ones, with poses worked out by hand."""

import struct

import cv2
import numpy as np

from core.geometry.camera import Pose

# A camera at (1, 2, 3) that looks along the world's +x axis, with the world's +z axis up:
# its right is -y, its down is -z, its forward is +x. Rows of R are those axes.
R = np.array([[0.0, -1, 0], [0, 0, -1], [1, 0, 0]])
CENTRE = np.array([1.0, 2.0, 3.0])
T = np.array([2.0, 3.0, -1.0])  # -R c
QUATERNION = (0.5, 0.5, -0.5, 0.5)  # w x y z; 120 degrees about (1, -1, 1) / sqrt 3
LINE = "0.5 0.5 -0.5 0.5 2 3 -1"
CAMERA_TO_WORLD = "0 0 1 1\n-1 0 0 2\n0 -1 0 3\n0 0 0 1\n"  # columns: the camera's x, y, z axes and its centre
OPENGL = [[0, 0, -1, 1], [-1, 0, 0, 2], [0, 1, 0, 3], [0, 0, 0, 1]]  # the same, y up and z backwards
CAMBRIDGE_LINE = "1 2 3 0.5 0.5 -0.5 0.5"
POSE = Pose(R, T)
CAMBRIDGE_TITLE = "Visual Landmark Dataset V1\nImageFile, Camera Position [X Y Z W P Q R]\n\n"


def same(pose, truth=POSE, atol=1e-12):
    np.testing.assert_allclose(pose.R, truth.R, atol=atol)
    np.testing.assert_allclose(pose.t, truth.t, atol=atol)


def put(path, text):
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(text) if isinstance(text, bytes) else path.write_text(text, encoding="utf-8")
    return path


def seven_scenes(root, frames=2):
    """Sequences 1 (train), 2 and 3 (test), each with `frames` tiny pictures and poses, the depth files left out."""
    put(root / "TrainSplit.txt", "sequence1\n")
    put(root / "TestSplit.txt", "sequence3 \nsequence2\n")
    for sequence in (1, 2, 3):
        for frame in range(frames):
            stem = root / f"seq-{sequence:02d}" / f"frame-{frame:06d}"
            put(stem.with_name(stem.name + ".pose.txt"), CAMERA_TO_WORLD.replace(" 1\n-1", f" {sequence}.{frame}\n-1"))
            cv2.imwrite(f"{stem}.color.png", np.full((6, 8, 3), 40 * sequence, np.uint8))
    return root


def cambridge(root, photos=("seq2/frame00001.png", "seq2/frame00002.png")):
    """A scene folder whose photos are 16 x 9 pixels."""
    lines = "".join(f"{name} {CAMBRIDGE_LINE}\n" for name in photos)
    put(root / "dataset_test.txt", CAMBRIDGE_TITLE + lines)
    put(root / "dataset_train.txt", CAMBRIDGE_TITLE + f"seq1/frame00001.png {CAMBRIDGE_LINE}\n")
    for name in photos:
        (root / name).parent.mkdir(parents=True, exist_ok=True)
        cv2.imwrite(str(root / name), np.zeros((9, 16, 3), np.uint8))
    return root


def binary_images(names, quaternion=QUATERNION, translation=(2.0, 3.0, -1.0), points=2):
    """images.bin byte by byte as COLMAP's page on its output format has it, each image with camera `i + 1`."""
    out = struct.pack("<Q", len(names))
    for i, name in enumerate(names):
        out += struct.pack("<i4d3di", i + 10, *quaternion, *translation, i + 1) + name.encode() + b"\0"
        out += struct.pack("<Q", points) + struct.pack("<ddq", 1.5, 2.5, -1) * points
    return out


def binary_cameras(cameras):
    """cameras.bin of (id, model id, width, height, parameters...)."""
    out = struct.pack("<Q", len(cameras))
    for number, model, width, height, *values in cameras:
        out += struct.pack("<iiQQ", number, model, width, height) + struct.pack(f"<{len(values)}d", *values)
    return out
