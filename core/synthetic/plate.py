"""A hand-held shot in the sample room, with the camera of every frame known exactly: what a track is measured on.

The camera goes along an arc and shakes. A frame is lit while the shutter is open and read out row by row where there is a
rolling shutter; the truth of a frame is the camera at the middle of both.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import cv2
import numpy as np
from numpy.typing import NDArray

from ..geometry.camera import Camera, FloatArray, Intrinsics, Pose
from ..geometry.lie import so3_exp
from ..photos.photo import Photo
from ..pictures.through_lens import render_through_lens
from ..render.view import ViewRenderer
from .sample import BLUR_PX, DEPTH, GAIN, GAMMA, LENS, NOISE, look_at

FRAMES_PER_SECOND = 24.0
# Shake: waves of so many per second, each with an amplitude of its share of these.
WAVES_HZ = (0.7, 1.3, 2.9, 5.3, 7.7)
SHARES = (1.0, 0.8, 0.5, 0.3, 0.2)
SHAKE_UNITS, SHAKE_DEG = 0.003 * DEPTH, 0.15
BLUR_SAMPLES = 3
# Behind a cut the camera stands by so much elsewhere, and looks at a place by so much from the one before (scene units).
ELSEWHERE, LOOKS_ELSEWHERE = np.array([0.6, 0.05, -0.1]), np.array([1.5, 0.0, -0.4])
# A lens that zooms stands for this share of the shot before and after.
STANDS = 0.2
# A card that hides the picture slides in and out in so many frames.
SLIDES = 4


@dataclass(frozen=True)
class HandHeld:
    """`count` frames, numbered from `first`. shutter: how long it is open, readout: how long reading a frame out takes, both as
    shares of the time from frame to frame; walker: somebody walks through in front of the lens; seed: of the shake; zoom: the
    focal length at the end over that of `lens`, which it begins with; covered: frames that a card right in front of the lens
    hides; cut: the frame from which on another camera place is seen, None where there is none.
    """

    count: int = 120
    first: int = 1001
    lens: Intrinsics = LENS
    shutter: float = 0.5
    readout: float = 0.0
    walker: bool = False
    seed: int = 0
    zoom: float = 1.0
    covered: range = range(0)
    cut: int | None = None

    @property
    def frames(self) -> range:
        return range(self.first, self.first + self.count)

    def pose(self, frame: float) -> Pose:
        """World to camera at any time, in frames."""
        t = (frame - self.first) / 120.0
        along = np.array([0.55 * np.sin(1.6 * t - 0.8), -0.12 + 0.06 * np.cos(3 * t), 0.1 + 0.3 * t])
        target = np.array([0.35 * np.sin(1.2 * t - 0.4), 0.22, 3.4])
        move, turn = self._shake(frame)
        if self.cut is not None and round(frame) >= self.cut:
            along, target = along + ELSEWHERE, target + LOOKS_ELSEWHERE
        looking = look_at(along, target).R
        return Pose.from_centre(so3_exp(turn) @ looking, along + move)

    def lens_at(self, frame: float) -> Intrinsics:
        """The lens at any time: where it zooms, it stands at first, starts and stops smoothly, and stands at the end."""
        share = (frame - self.first) / max(self.count - 1, 1)
        share = float(np.clip((share - STANDS) / (1 - 2 * STANDS), 0, 1))
        grow = self.zoom ** (share * share * (3 - 2 * share))
        return replace(self.lens, fx=self.lens.fx * grow, fy=self.lens.fy * grow)

    def camera(self, frame: int) -> Camera:
        return Camera(self.lens_at(frame), self.pose(frame), f"plate.{frame:04d}.png")

    def photo(self, renderer: ViewRenderer, frame: int) -> Photo:
        """The frame as a camera takes it: moved while it was lit, read out by rows, exposed, noisy, 8 bits."""
        offsets = np.linspace(-self.readout / 2, self.readout / 2, 1 if self.readout == 0 else 1 + _slices(self.readout))
        light = [self._lit(renderer, frame + offset) for offset in offsets]
        color = light[0] if len(light) == 1 else _by_rows(light)
        if self.walker:
            color = self._walked(color, frame)
        if self.covered:
            color = self._behind_card(color, frame)
        exposed = cv2.GaussianBlur((GAIN * color**GAMMA).astype(np.float32), (0, 0), BLUR_PX)
        grain = np.random.default_rng([self.seed, frame]).normal(0, NOISE, exposed.shape)
        return Photo(np.clip((exposed + grain) * 255 + 0.5, 0, 255).astype(np.uint8), f"plate.{frame:04d}.png")

    def _lit(self, renderer: ViewRenderer, at: float) -> NDArray[np.float32]:
        """What falls on the sensor while the shutter is open around a time."""
        times = at + self.shutter * (np.arange(BLUR_SAMPLES) - (BLUR_SAMPLES - 1) / 2) / BLUR_SAMPLES
        drawn = [render_through_lens(renderer, Camera(self.lens_at(float(t)), self.pose(float(t)), "")) for t in times]
        return np.asarray(np.clip(np.mean(drawn, axis=0), 0, 1), np.float32)

    def _shake(self, frame: float) -> tuple[FloatArray, FloatArray]:
        """How far the hand moves (scene units) and turns (radians) the camera."""
        rng, t = np.random.default_rng(self.seed), frame / FRAMES_PER_SECOND
        phases, ways = rng.uniform(0, 2 * np.pi, (2, len(WAVES_HZ), 3)), np.array(SHARES)[:, None]
        waves = np.sin(2 * np.pi * np.array(WAVES_HZ)[:, None] * t + phases)
        move, turn = (ways * waves).sum(axis=1)
        return SHAKE_UNITS * move, np.radians(SHAKE_DEG) * turn

    def _walked(self, color: NDArray[np.float32], frame: int) -> NDArray[np.float32]:
        """With a dark, patterned figure that crosses the picture once."""
        height, width = color.shape[:2]
        x = int((frame - self.first) / self.count * 1.4 * width - 0.2 * width)
        shape = np.zeros((height, width), np.uint8)
        cv2.ellipse(shape, (x, int(0.62 * height)), (int(0.11 * width), int(0.42 * height)), 0, 0, 360, 255, -1)
        cv2.circle(shape, (x, int(0.2 * height)), int(0.05 * width), 255, -1)
        cloth = np.random.default_rng(self.seed).uniform(0.05, 0.5, (24, 12, 3)).astype(np.float32)
        pattern = np.zeros_like(color)
        w, h = int(0.24 * width), height
        left = x - w // 2
        a, b = max(left, 0), min(left + w, width)
        if a < b:
            pattern[:, a:b] = cv2.resize(cloth, (w, h), interpolation=cv2.INTER_NEAREST)[:, a - left : b - left]
        return np.where(shape[..., None] > 0, pattern, color)

    def _behind_card(self, color: NDArray[np.float32], frame: int) -> NDArray[np.float32]:
        """With a patterned card that slides in from the left until it hides all, moves a little, and slides out again."""
        away = max(self.covered.start - frame, frame - self.covered.stop + 1, 0)
        width = int(color.shape[1] * max(1 - away / SLIDES, 0))
        if width == 0:
            return color
        pattern = np.random.default_rng(self.seed).uniform(0.05, 0.5, (18, 24, 3)).astype(np.float32)
        card = cv2.resize(pattern, color.shape[1::-1], interpolation=cv2.INTER_NEAREST)
        card = np.roll(card, 3 * (frame - self.covered.start), axis=1)
        return np.concatenate([card[:, -width:], color[:, width:]], axis=1)


def _slices(readout: float) -> int:
    return max(4, round(12 * readout))


def _by_rows(light: list[NDArray[np.float32]]) -> NDArray[np.float32]:
    """Pictures at times from the first row's to the last one's, blended so that each row is of its own time."""
    height = light[0].shape[0]
    place = (np.arange(height) + 0.5) / height * (len(light) - 1)
    low = np.minimum(place.astype(int), len(light) - 2)
    share = (place - low).astype(np.float32)[:, None, None]
    stack = np.stack(light)
    rows = np.arange(height)
    return np.asarray((1 - share) * stack[low, rows] + share * stack[low + 1, rows])
