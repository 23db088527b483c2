"""What spoils a photo: covers, light, blur, mirrors and foregrounds, by name, for the trials of the verdict.

A spoiler changes only pixels; where the photo comes from and what the scan holds is up to the trial.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from pathlib import Path

import cv2
import numpy as np

from core.photos.photo import read_photo

ROOT = Path(__file__).resolve().parents[1]
SCENES = ROOT.parent / "shared" / "scenes"
Pixels = np.ndarray
# (photo (H, W, 3) uint8, random draws, the scan that the photo is of) -> the spoilt photo
Spoiler = Callable[[Pixels, np.random.Generator, str], Pixels]

# Foreground objects begin this much blurred at their rim, pixels, as a lens draws an edge.
RIM_PX = 1.0


@cache
def occluder_photos(scene: str) -> tuple[Path, ...]:
    """Photos of the other scans, which foreground objects for photos of `scene` are cut from."""
    return tuple(p for p in sorted(SCENES.glob("*/queries/*.jpg")) if p.parts[-3] != scene)


def outline(size: tuple[int, int], share: float, rng: np.random.Generator) -> np.ndarray:
    """A mask (H, W) of `size` (H, W) with irregular rims, True on `share` of it: a few large lobes that grow from
    one side, as a tree, a passer-by or a pillar stands in front of a camera.
    """
    h, w = size
    side = max(h, w)
    lobes = sum(
        weight * _smooth_noise(size, side * scale, rng) for weight, scale in ((1.0, 1 / 6), (0.35, 1 / 24), (0.15, 1 / 80))
    )
    y, x = np.mgrid[:h, :w] / side
    angle = rng.uniform(0, 2 * np.pi)
    field = lobes + rng.uniform(1, 4) * (np.cos(angle) * x + np.sin(angle) * y)
    return np.asarray(field >= np.quantile(field, 1 - share))


def _smooth_noise(size: tuple[int, int], scale_px: float, rng: np.random.Generator) -> np.ndarray:
    """Gaussian noise (H, W) of unit deviation, smooth over `scale_px`; drawn coarsely, for it holds nothing finer."""
    step = max(1, int(scale_px / 4))
    coarse = rng.normal(size=(size[0] // step + 2, size[1] // step + 2))
    smooth = cv2.GaussianBlur(coarse, (0, 0), max(scale_px / step, 0.8), borderType=cv2.BORDER_REFLECT)
    return np.asarray(cv2.resize(smooth / smooth.std(), size[::-1], interpolation=cv2.INTER_CUBIC))


def behind(image: Pixels, object_pixels: Pixels, mask: np.ndarray) -> Pixels:
    """`image` (H, W, 3) behind the part of `object_pixels`, of the same size, that `mask` (H, W) keeps."""
    alpha = cv2.GaussianBlur(mask.astype(np.float32), (0, 0), RIM_PX)[..., None]
    return np.asarray(alpha * object_pixels + (1 - alpha) * image + 0.5, np.uint8)


def texture_from(file: Path, size: tuple[int, int], rng: np.random.Generator) -> Pixels:
    """A random half to whole of the photo in `file`, flipped or not, at `size` (H, W)."""
    pixels = read_photo(file).pixels
    h, w = pixels.shape[:2]
    part = rng.uniform(0.5, 1.0)
    height, width = int(part * h), int(part * w)
    y, x = rng.integers(0, h - height + 1), rng.integers(0, w - width + 1)
    cut = pixels[y : y + height, x : x + width]
    cut = cut[:, ::-1] if rng.random() < 0.5 else cut
    return np.asarray(cv2.resize(np.ascontiguousarray(cut), size[::-1], interpolation=cv2.INTER_CUBIC))


def foreground(share: float) -> Spoiler:
    """An object with an irregular outline over `share` of the photo, cut from a photo of another scan."""

    def spoil(image: Pixels, rng: np.random.Generator, scene: str) -> Pixels:
        files = occluder_photos(scene)
        size = image.shape[:2]
        texture = texture_from(files[rng.integers(len(files))], size, rng)
        return behind(image, texture, outline(size, share, rng))

    return spoil


def boxes(share: float) -> Spoiler:
    """`share` of the photo behind flat and noisy rectangles."""

    def spoil(image: Pixels, rng: np.random.Generator, _: str) -> Pixels:
        out, h, w = image.copy(), *image.shape[:2]
        hidden = np.zeros((h, w), bool)
        while hidden.mean() < share:
            y, x = rng.integers(0, h), rng.integers(0, w)
            box = np.s_[y : y + rng.integers(h // 8, h // 3), x : x + rng.integers(w // 8, w // 3)]
            hidden[box] = True
            out[box] = np.clip(rng.integers(0, 255, 3) + rng.normal(0, 20, out[box].shape), 0, 255)
        return out

    return spoil


def repeated(image: Pixels, rng: np.random.Generator, _: str) -> Pixels:
    """A patch of the photo laid out like tiles over all of it."""
    h, w = image.shape[:2]
    size = min(h, w) // 6
    y, x = rng.integers(0, h - size), rng.integers(0, w - size)
    tiled = np.tile(image[y : y + size, x : x + size], (h // size + 1, w // size + 1, 1))
    return np.ascontiguousarray(tiled[:h, :w])


def curve(gain: float, gamma: float) -> Spoiler:
    """Another exposure and tone: 255 gain (v / 255)^gamma, clipped."""
    return lambda image, _rng, _: np.clip(255 * gain * (image / 255.0) ** gamma, 0, 255).astype(np.uint8)


def lit_from_one_side(image: Pixels, _rng: np.random.Generator, _: str) -> Pixels:
    light = np.linspace(0.08, 1.8, image.shape[1])
    return np.clip(image * light[:, None], 0, 255).astype(np.uint8)


def as_it_is(image: Pixels, _rng: np.random.Generator, _: str) -> Pixels:
    return image


SPOILERS: dict[str, Spoiler] = {
    "as it is": as_it_is,
    "40 % covered": boxes(0.4),
    "foreground 50 %": foreground(0.50),
    "foreground 70 %": foreground(0.70),
    "foreground 85 %": foreground(0.85),
    "dark": curve(0.35, 1.3),
    "very dark": curve(0.06, 1.0),
    "bright": curve(1.6, 0.8),
    "blown out": curve(3.0, 0.7),
    "lit from one side": lit_from_one_side,
    "blurred": lambda image, _rng, _: cv2.GaussianBlur(image, (0, 0), 2.0 * max(image.shape) / 640),
    "mirrored": lambda image, _rng, _: np.ascontiguousarray(image[:, ::-1]),
    "repeated texture": repeated,
    "other scan": as_it_is,
    "cut out of the scan": as_it_is,
}
NO_TRUTH = {"mirrored", "repeated texture", "other scan", "cut out of the scan"}
