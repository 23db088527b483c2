"""Cameras placed by pins on the built-in sample: how near hands come with three pairs and more, and how long a drag takes.

    .venv/bin/python benchmarks/pins.py [--trials N] [--click-px PX]

A hand hits within PX pixels of what it meant, evenly over that circle, of a photo of 640 x 480 (3 px there are 0.34 degrees);
both clicks of a pair are made so. Pairs are wide apart in the photo: the smaller spread of their pixels is at least 110 px, or
170 where "widest" stands: out to the photo's corners, as the tutorial says. The start camera is 12 % of the depth and 8 degrees
off. "near and far": depths at least 1.8 times apart. "off / said" is of the cameras that are not called doubtful.

"bound": the share of hands that the best estimator without bias (Cramer and Rao) would bring within 3 % and 1.5 degrees of
those places, by the pins and a given lens alone, without what the start camera tells.

A drag is timed as Blender does it: a whole solve where the mouse is pressed, one that follows it for each of 20 moves.
"""

from __future__ import annotations

import argparse
import sys
import time
from dataclasses import replace
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from core.geometry.camera import Camera, pose_error
from core.pose.pins.lift import surface_point
from core.pose.pins.pin import Pin, pinned_points
from core.pose.pins.place import PinOptions, place_by_pins
from core.pose.shared.lens import CameraUnknowns
from core.render import Renderer, RenderSettings
from core.synthetic import make_scene, perturb_camera, sample_cameras
from core.synthetic.sample import DEPTH

ANY, WIDEST = 110, 170  # px
CASES = [(3, 1.0, ANY, False), (3, 1.8, ANY, False), (3, 1.8, WIDEST, False)]
CASES += [(4, 1.0, ANY, False), (4, 1.8, ANY, False), (4, 1.8, WIDEST, False), (6, 1.0, ANY, False), (10, 1.0, ANY, False)]
CASES += [(4, 1.8, ANY, True), (6, 1.8, ANY, True), (10, 1.8, ANY, True)]
DRAWS = 200
COLUMNS = ("pairs", "depths", "lens", "off, median", "worst tenth", "within 3 % / 1.5 deg", "bound", "off / said (RMS)")
COLUMNS += ("focal", "doubtful")
MOVES = 20


class Hand:
    """Clicks on photo and splat."""

    def __init__(self, click_px: float) -> None:
        self.click_px, self.truths = click_px, sample_cameras()
        self.renderer = Renderer(make_scene(0), RenderSettings())
        self.views = {k: self.renderer.render(c.intrinsics.pinhole(), c.pose).depth for k, c in enumerate(self.truths)}

    def off(self, rng: np.random.Generator, count: int) -> np.ndarray:
        angle, radius = rng.uniform(0, 2 * np.pi, count), self.click_px * np.sqrt(rng.uniform(size=count))
        return radius[:, None] * np.column_stack([np.cos(angle), np.sin(angle)])

    def pins(self, seed: int, count: int, near_and_far: float, wide_px: float = ANY) -> tuple[Camera, list[Pin]]:
        """The true camera, and pins; the point of a pin is the depth at the pixel that was hit."""
        rng, which = np.random.default_rng(seed), seed % len(self.truths)
        truth, depth = self.truths[which], self.views[which]
        while True:
            meant = rng.uniform((30, 30), (610, 450), (count, 2))
            hit = meant + self.off(rng, count)
            rows, columns = np.clip(hit[:, 1], 0, 479).astype(int), np.clip(hit[:, 0], 0, 639).astype(int)
            z, true = depth[rows, columns].astype(float), depth[meant[:, 1].astype(int), meant[:, 0].astype(int)]
            wide = np.linalg.eigvalsh(np.cov(meant.T))[0] > wide_px**2
            # Nobody pins a point beside an edge, where the other side is hit as easily.
            if z.min() > 0.5 and z.max() / z.min() >= near_and_far and wide and (np.abs(z / true - 1) < 0.05).all():
                break
        pinhole = truth.intrinsics.pinhole()
        world = (np.column_stack([pinhole.normalise(hit), np.ones(count)]) * z[:, None] - truth.pose.t) @ truth.pose.R
        aim = (np.column_stack([pinhole.normalise(meant), np.ones(count)]) * true[:, None] - truth.pose.t) @ truth.pose.R
        photo = truth.intrinsics.project(truth.pose.transform(aim)) + self.off(rng, count)
        return truth, [Pin(tuple(p), tuple(w)) for p, w in zip(photo.tolist(), world.tolist(), strict=True)]


def bound(truth: Camera, pins: list[Pin], seed: int) -> float:
    """How likely the best estimator without bias comes within 3 % and 1.5 degrees, by pins whose clicks are so far off."""
    exact = replace_pixels(truth, pins)
    information = pinned_points(exact, truth.intrinsics).equations(CameraUnknowns(truth.pose, truth.intrinsics), ()).information
    off = np.random.default_rng(seed).multivariate_normal(np.zeros(6), np.linalg.pinv(information, hermitian=True), DRAWS)
    near = np.linalg.norm(off[:, :3], axis=1) < 0.03 * DEPTH
    return float((near & (np.degrees(np.linalg.norm(off[:, 3:], axis=1)) < 1.5)).mean())


def replace_pixels(truth: Camera, pins: list[Pin]) -> list[Pin]:
    """The pins where the true camera shows them."""
    seen = truth.intrinsics.project(truth.pose.transform([pin.world for pin in pins]))
    return [replace(pin, photo=tuple(at)) for pin, at in zip(pins, seen.tolist(), strict=True)]


def start_of(truth: Camera, seed: int, guessed: bool) -> Camera:
    start = perturb_camera(truth, 0.12 * DEPTH, 8.0, seed)
    if not guessed:
        return start
    factor = float(np.exp(np.random.default_rng(seed).uniform(-0.25, 0.25)))
    k = start.intrinsics
    return replace(start, intrinsics=replace(k, fx=k.fx * factor, fy=k.fy * factor), focal_guessed=True)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--trials", type=int, default=120)
    parser.add_argument("--click-px", type=float, default=3.0)
    args = parser.parse_args()
    hand = Hand(args.click_px)
    print(f"| {' | '.join(COLUMNS)} |\n|{'---|' * len(COLUMNS)}")
    for count, near_and_far, wide_px, guessed in CASES:
        off, said, focal, doubtful, best = [], [], [], [], []
        for seed in range(args.trials):
            truth, pins = hand.pins(seed, count, near_and_far, wide_px)
            best.append(bound(truth, pins, seed))
            report = place_by_pins(start_of(truth, seed, guessed), pins)
            off.append(np.array(pose_error(report.camera.pose, truth.pose)) * (100 / DEPTH, 1))
            said.append((report.translation_std_pct, report.rotation_std_deg))
            focal.append(100 * abs(report.camera.intrinsics.focal / truth.intrinsics.focal - 1))
            doubtful.append(report.state == "doubtful")
        errors, told = np.array(off), np.array(said)
        middle, worst = np.median(errors, axis=0), np.percentile(errors, 90, axis=0)
        ratio = np.sqrt(np.mean((errors / told)[~np.array(doubtful)] ** 2, axis=0))
        within = 100 * float((errors < (3.0, 1.5)).all(axis=1).mean())
        kind = f"{count} | {depths_of(near_and_far, wide_px)} | {'guess' if guessed else 'given'}"
        found = f"{middle[0]:.1f} % / {middle[1]:.1f} deg | {worst[0]:.1f} % / {worst[1]:.1f} deg | {within:.0f} %"
        found += " | " if guessed else f" | {100 * np.mean(best):.0f} %"
        lens = f"{np.median(focal):.1f} %" if guessed else ""
        print(f"| {kind} | {found} | {ratio[0]:.1f} / {ratio[1]:.1f} | {lens} | {sum(doubtful)} of {args.trials} |")
    drags(hand)


def depths_of(near_and_far: float, wide_px: float) -> str:
    return ("near and far" if near_and_far > 1 else "any") + (", widest" if wide_px > ANY else "")


def drags(hand: Hand) -> None:
    """How long one move of the mouse takes, of the last pin of several."""
    print("\n| pins | lens | a move: median, 95 % | of the processor alone | the press |\n|---|---|---|---|---|")
    for count, guessed in ((3, False), (4, True), (6, True), (10, True)):
        wall, own, press = [], [], []
        for seed in range(6):
            truth, pins = hand.pins(seed, count, 1.8)
            start, (x, y) = start_of(truth, seed, guessed), pins[-1].photo
            x, y = x + 60, y - 60
            pressed = [*pins[:-1], replace(pins[-1], photo=(x, y))]
            cpu = time.process_time()
            options = PinOptions(last=place_by_pins(start, pressed).camera)
            press.append(1e3 * (time.process_time() - cpu))
            for move in range(MOVES):
                left = 60 * (1 - (move + 1) / MOVES)
                now = [*pins[:-1], replace(pins[-1], photo=(x - 60 + left, y + 60 - left))]
                began, cpu = time.perf_counter(), time.process_time()
                options = PinOptions(last=place_by_pins(start, now, options).camera)
                wall.append(1e3 * (time.perf_counter() - began))
                own.append(1e3 * (time.process_time() - cpu))
        kind = f"{count} | {'guess' if guessed else 'given'}"
        print(f"| {kind} | {spread(wall)} | {spread(own)} | {spread(press)} |")
    splat = hand.renderer
    truth, wall = hand.truths[0], []
    for seed in range(20):
        began = time.perf_counter()
        surface_point(splat, truth.intrinsics, truth.pose, (100.0 + 20 * seed, 240.0))
        wall.append(1e3 * (time.perf_counter() - began))
    print(f"\nA click on the splat, whose depth is rendered there: {spread(wall)} (median, 95 %)")


def spread(milliseconds: list[float]) -> str:
    return f"{np.median(milliseconds):.0f} ms, {np.percentile(milliseconds, 95):.0f} ms"


if __name__ == "__main__":
    main()
