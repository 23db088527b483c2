"""Painted surfaces of the sample room: float32 RGB pictures (H, W, 3), 0..1, drawn from a random generator."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

Picture = NDArray[np.float32]
Rng = np.random.Generator


def noise(rng: Rng, height: int, width: int, cell: int, channels: int = 1) -> Picture:
    """Smooth noise, deviation about 1, with bumps of `cell` pixels."""
    shape = (max(2, height // cell + 2), max(2, width // cell + 2), channels)
    coarse = rng.normal(size=shape).astype(np.float32)
    drawn = cv2.resize(coarse, (width, height), interpolation=cv2.INTER_CUBIC)
    return np.asarray(drawn.reshape(height, width, channels), np.float32)


def _filled(height: int, width: int, color: tuple[float, float, float]) -> Picture:
    return np.full((height, width, 3), color, np.float32)


def _clip(picture: Picture) -> Picture:
    return np.clip(picture, 0.02, 0.98).astype(np.float32)


def _letter(picture: Picture, text: str, at: tuple[int, int], scale: float) -> None:
    """Writes dark lettering into `picture`; OpenCV letters 8-bit images only, hence by way of a mask."""
    mask = np.zeros(picture.shape[:2], np.uint8)
    cv2.putText(mask, text, at, cv2.FONT_HERSHEY_DUPLEX, scale, 255, 2)
    picture[mask > 127] = 0.05


def plaster(rng: Rng, height: int, width: int, color: tuple[float, float, float]) -> Picture:
    """A painted wall with stains, brush marks and a few cracks."""
    tone = 0.045 * noise(rng, height, width, 70) + 0.025 * noise(rng, height, width, 22) + 0.012 * noise(rng, height, width, 7)
    out = np.ascontiguousarray(_filled(height, width, color) * (1 + tone), np.float32)
    for _ in range(height * width // 30000):
        walk = np.cumsum(rng.normal(0, 9, (9, 2)) + rng.normal(0, 6, 2), axis=0) + rng.uniform(0, 1, 2) * (width, height)
        cv2.polylines(out, [walk.astype(np.int32)], False, [0.6 * c for c in color], 1, cv2.LINE_AA)
    return _clip(out)


def bricks(rng: Rng, height: int, width: int, course: int = 22) -> Picture:
    """Brickwork with mortar; every brick has its own tone."""
    out = _filled(height, width, (0.62, 0.58, 0.53))
    for row, y in enumerate(range(0, height, course)):
        for x in range(-(row % 2) * course, width, 2 * course):
            tone = np.array([0.55, 0.27, 0.2]) * rng.uniform(0.6, 1.35) + rng.normal(0, 0.03, 3)
            cv2.rectangle(out, (x + 2, y + 2), (x + 2 * course - 2, y + course - 2), tone.tolist(), -1)
    return _clip(out + 0.04 * noise(rng, height, width, 5, 3))


def planks(rng: Rng, height: int, width: int, board: int = 34) -> Picture:
    """Floor boards along the width, with grain and knots."""
    out = np.zeros((height, width, 3), np.float32)
    for y in range(0, height, board):
        x = -int(rng.integers(0, 200))
        while x < width:
            length = int(rng.integers(150, 320))
            tone = np.array([0.5, 0.33, 0.2]) * rng.uniform(0.65, 1.3)
            cv2.rectangle(out, (x, y), (x + length - 2, y + board - 2), tone.tolist(), -1)
            x += length
    grain = cv2.resize(rng.normal(size=(height, max(2, width // 40))).astype(np.float32), (width, height))
    for _ in range(height * width // 9000):
        centre = (int(rng.integers(0, width)), int(rng.integers(0, height)))
        cv2.ellipse(out, centre, (int(rng.integers(3, 8)), int(rng.integers(2, 5))), 0, 0, 360, (0.16, 0.09, 0.05), -1)
    return _clip(out + 0.05 * grain[:, :, None])


def rug(rng: Rng, height: int, width: int) -> Picture:
    """A woven rug: borders, medallions, and motifs that do not repeat."""
    out = _filled(height, width, (0.5, 0.08, 0.1))
    for k, color in enumerate([(0.85, 0.72, 0.45), (0.1, 0.15, 0.35), (0.75, 0.25, 0.12), (0.12, 0.3, 0.28)]):
        inset = 10 + 16 * k
        cv2.rectangle(out, (inset, inset), (width - inset, height - inset), color, 7)
    for _ in range(170):
        x, y = int(rng.integers(70, max(71, width - 70))), int(rng.integers(70, max(71, height - 70)))
        color = rng.uniform(0.05, 0.95, 3).tolist()
        size = int(rng.integers(6, 24))
        if rng.random() < 0.5:
            cv2.circle(out, (x, y), size, color, -1)
            cv2.circle(out, (x, y), size // 2, rng.uniform(0.05, 0.95, 3).tolist(), -1)
        else:
            corners = np.array([[x, y - size], [x + size, y], [x, y + size], [x - size, y]], np.int32)
            cv2.fillPoly(out, [corners], color)
    return _clip(out + 0.03 * noise(rng, height, width, 3))


def poster(rng: Rng, height: int, width: int, text: str) -> Picture:
    """A framed print: bold shapes and a line of lettering."""
    out = _filled(height, width, tuple(rng.uniform(0.55, 0.95, 3)))
    for _ in range(16):
        color = rng.uniform(0.05, 0.95, 3).tolist()
        x, y = (int(v) for v in rng.uniform(0.1, 0.9, 2) * (width, height * 0.85))
        size = int(rng.uniform(0.05, 0.2) * width)
        kind = rng.integers(0, 3)
        if kind == 0:
            cv2.circle(out, (x, y), size, color, -1)
        elif kind == 1:
            cv2.rectangle(out, (x - size, y - size // 2), (x + size, y + size // 2), color, -1)
        else:
            cv2.fillPoly(out, [(np.array([x, y]) + size * rng.normal(size=(3, 2))).astype(np.int32)], color)
    scale = width / (22.0 * max(1, len(text)))
    _letter(out, text, (int(0.08 * width), int(0.95 * height)), scale)
    frame = max(4, width // 30)
    cv2.rectangle(out, (0, 0), (width - 1, height - 1), (0.14, 0.09, 0.05), 2 * frame)
    return _clip(out)


def books(rng: Rng, height: int, width: int, shelves: int) -> Picture:
    """A bookcase seen from the front: rows of spines with bands and titles."""
    out = _filled(height, width, (0.1, 0.06, 0.04))
    shelf = height // shelves
    for row in range(shelves):
        x, bottom = 8, (row + 1) * shelf - 10
        while x < width - 14:
            thick, tall = int(rng.integers(9, 26)), int(shelf * rng.uniform(0.6, 0.88))
            color = rng.uniform(0.08, 0.85, 3)
            cv2.rectangle(out, (x, bottom - tall), (min(x + thick, width - 8) - 1, bottom), color.tolist(), -1)
            band = bottom - int(tall * rng.uniform(0.15, 0.85))
            cv2.rectangle(out, (x, band - 4), (min(x + thick, width - 8) - 1, band + 4), (1 - color).tolist(), -1)
            x += thick + 1 + (int(rng.integers(0, 22)) if rng.random() < 0.12 else 0)
        cv2.rectangle(out, (0, bottom), (width, bottom + 10), (0.38, 0.24, 0.14), -1)
    cv2.rectangle(out, (0, 0), (width - 1, height - 1), (0.38, 0.24, 0.14), 16)
    return _clip(out + 0.02 * noise(rng, height, width, 3))


def window(rng: Rng, height: int, width: int) -> Picture:
    """A window onto hills under a cloudy sky, with a cross of glazing bars."""
    y = np.linspace(0, 1, height, dtype=np.float32)[:, None, None]
    sky = np.array([0.45, 0.65, 0.92], np.float32) * (1 - y) + np.array([0.9, 0.92, 0.95], np.float32) * y
    out = sky + np.float32(0.12) * np.maximum(noise(rng, height, width, 30), 0)
    for depth in range(3):
        line = height * (0.55 + 0.13 * depth) + 0.06 * height * noise(rng, 1, width, 40)[0, :, 0]
        below = np.arange(height)[:, None] > line[None, :]
        green = np.array([0.25, 0.42, 0.22]) * (1.15 - 0.3 * depth)
        out[below] = green + 0.06 * noise(rng, height, width, 7, 3)[below]
    out = np.ascontiguousarray(out, np.float32)
    for x0, y0, x1, y1 in ((0, 0, width, height), (width // 2, 0, width // 2, height), (0, height // 2, width, height // 2)):
        cv2.rectangle(out, (x0, y0), (x1, y1), (0.93, 0.92, 0.88), 12)
    return _clip(np.asarray(out, np.float32))


def crate(rng: Rng, height: int, width: int, color: tuple[float, float, float], mark: str = "") -> Picture:
    """A box of boards with a frame, nails, scratches and a stencilled mark."""
    boards = planks(rng, height, width, max(12, height // 5))
    out = np.ascontiguousarray(boards * (np.array(color, np.float32) / (0.5, 0.33, 0.2)), np.float32)
    rim = max(6, min(height, width) // 9)
    for k, (x0, y0, x1, y1) in enumerate(
        (
            (0, 0, width, rim),
            (0, height - rim, width, height),
            (0, rim, rim, height - rim),
            (width - rim, rim, width, height - rim),
        )
    ):
        tone = [float(c) * (0.75 + 0.12 * (k % 2)) for c in color]
        cv2.rectangle(out, (x0, y0), (x1 - 1, y1 - 1), tone, -1)
        cv2.rectangle(out, (x0, y0), (x1 - 1, y1 - 1), [0.35 * c for c in tone], 1)
    for x, y in rng.uniform(0, 1, (18, 2)) * (width, height):
        cv2.circle(out, (int(x), int(y)), 2, (0.08, 0.07, 0.06), -1)
    for _ in range(10):
        p = rng.uniform(0.05, 0.95, 2) * (width, height)
        q = p + rng.normal(0, 0.12, 2) * (width, height)
        cv2.line(out, p.astype(int).tolist(), q.astype(int).tolist(), [1.5 * c for c in color], 1, cv2.LINE_AA)
    if mark:
        _letter(out, mark, (int(0.2 * width), int(0.62 * height)), width / (32.0 * len(mark)))
    return _clip(out + 0.02 * noise(rng, height, width, 4))


def tartan(rng: Rng, height: int, width: int, color: tuple[float, float, float]) -> Picture:
    """Woven cloth: stripes of uneven widths crossing, no two alike."""
    out = _filled(height, width, color)
    for axis, length in ((0, height), (1, width)):
        at = 0
        while at < length:
            wide = int(rng.integers(4, 30))
            stripe = out[at : at + wide] if axis == 0 else out[:, at : at + wide]
            stripe *= rng.uniform(0.55, 1.35, 3).astype(np.float32)
            at += wide
    return _clip(out + 0.03 * noise(rng, height, width, 3))
