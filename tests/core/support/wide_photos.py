"""Fisheye photos and panoramas made without the project's lens code: by ray casting, or cut together from rendered faces."""

import cv2
import numpy as np

from core.geometry.camera import Intrinsics, Pose
from core.geometry.wide_lens import WideLens
from core.photos.photo import Photo

KS = (0.02, -0.008, 0.003, -0.001)


def fisheye_lens(side, degrees=150.0):
    """The lens of a square photo that shows so many degrees from edge to edge."""
    half = np.radians(degrees / 2)
    focal = side / 2 / (half * (1 + sum(k * half ** (2 * i + 2) for i, k in enumerate(KS))))
    names = ("k1", "k2", "k3", "k4")
    return WideLens("OPENCV_FISHEYE", side, side, focal, focal, side / 2, side / 2, tuple(zip(names, KS, strict=True)))


def fisheye_rays(lens, oversampled=1):
    """(H * W, 3) directions of its pixels, by a table of the series; with `oversampled` so many times more to each side."""
    steps = (np.arange(lens.width * oversampled) + 0.5) / oversampled
    x, y = np.meshgrid((steps - lens.cx) / lens.fx, (steps - lens.cy) / lens.fy)
    radius = np.maximum(np.hypot(x, y), 1e-12)
    angles = np.linspace(0, 2, 200_001)
    bent = angles * (1 + sum(k * angles ** (2 * i + 2) for i, k in enumerate(KS)))
    angle = np.interp(radius, bent, angles)
    return np.stack([np.sin(angle) * x / radius, np.sin(angle) * y / radius, np.cos(angle)], -1).reshape(-1, 3)


def panorama_rays(width, oversampled=1):
    """(H * W, 3) directions of an equirectangular picture, z in its middle, x to the right, y down."""
    u = (np.arange(width * oversampled) + 0.5) / (width * oversampled)
    v = (np.arange(width // 2 * oversampled) + 0.5) / (width // 2 * oversampled)
    longitude, latitude = np.meshgrid(2 * np.pi * (u - 0.5), np.pi * (0.5 - v))
    across = np.cos(latitude)
    rays = np.stack([across * np.sin(longitude), -np.sin(latitude), across * np.cos(longitude)], -1)
    return rays.reshape(-1, 3)


def cast_photo(room, rays, shape, pose, file="wide.png"):
    """A photo of a BoxRoom of that shape (H, W), of rays oversampled twice, darkened and with noise."""
    height, width = shape
    color, _ = room._cast(rays, pose)
    small = 0.8 * color.reshape(height, 2, width, 2, 3).mean((1, 3)) ** 1.1
    grain = 0.01 * np.random.default_rng(0).normal(size=small.shape)
    return Photo(np.clip((small + grain) * 255 + 0.5, 0, 255).astype(np.uint8), file)


def rendered_photo(renderer, rays, shape, pose, side, file="wide.png"):
    """A photo whose rays are looked up in the six faces of a cube that a renderer draws around the camera, each of `side`."""
    k = Intrinsics(side, side, 0.45 * side, 0.45 * side, side / 2, side / 2)
    color = np.zeros((len(rays), 3), np.float32)
    main = np.abs(rays).argmax(axis=1)
    for axis in range(3):
        for sign in (1.0, -1.0):
            mine = (main == axis) & (np.sign(rays[np.arange(len(rays)), main]) == sign)
            z = sign * np.eye(3)[axis]
            x = np.eye(3)[(axis + 1) % 3]
            turn = np.stack([x, np.cross(z, x), z])
            drawn = renderer.render(k, Pose(turn @ pose.R, turn @ pose.t)).color
            at = (k.project(rays[mine] @ turn.T) - 0.5).astype(np.float32)
            # OpenCV maps no picture with more than 32767 rows.
            looked = [cv2.remap(drawn, part[None, :, 0], part[None, :, 1], cv2.INTER_CUBIC)[0] for part in _parts(at)]
            color[mine] = np.concatenate(looked) if looked else 0
    pixels = np.clip(color * 255 + 0.5, 0, 255).astype(np.uint8).reshape(*shape, 3)
    return Photo(pixels, file)


def _parts(at):
    return [at[i : i + 30_000] for i in range(0, len(at), 30_000)]
