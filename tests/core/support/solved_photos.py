"""Photos solved without knowing their lens, by exact matches with noise: what each knows of it, and its record."""

import json
from dataclasses import replace

import numpy as np
from geometry import CAMERA, fan, make_matches, random_pose, world

from core.geometry.camera import Camera
from core.pose.final.joint import JointProblem, fit_joint
from core.pose.lens_report import lens_sentence
from core.pose.report import LENS_NUMBERS, LensEvidence, LensNumber, PoseQuality, RefineReport
from core.pose.report_json import report_to_dict
from core.pose.shared.lens import ALL, GUESS_STD, CameraUnknowns, LensPrior
from core.pose.verdict import sentences
from core.pose.verdict.verdict import judge

LENS = replace(CAMERA, fx=540.0, fy=540.0, cx=330.0, cy=232.0, dist=(-0.06, 0.01, 0.001, -0.0005, 0.0))
OTHER = replace(LENS, fx=600.0, fy=600.0, dist=(0.05, 0.0, 0.0, 0.0, 0.0))
GUESS = replace(CAMERA, fx=500.0, fy=500.0, cx=320.0, cy=240.0)


def solved_photo(seed, lens, noise=0.5, free=ALL):
    """A photo's true pose, its own solution without knowing the lens, and what that leaves."""
    rng = np.random.default_rng(seed)
    truth, points = random_pose(rng), world(rng, 120)
    views = [make_matches(rng, truth, v, points, noise) for v in fan(rng, truth, 5)]
    pixels = [lens.project(np.column_stack([v.query, np.ones(len(v))])) for v in views]
    views = [replace(v, query=GUESS.normalise(p)) for v, p in zip(views, pixels, strict=True)]
    problem = JointProblem.of(views, GUESS, LensPrior(GUESS, GUESS_STD, "guess"), free)
    fit = fit_joint(CameraUnknowns(truth, replace(GUESS, fx=lens.fx, fy=lens.fy)), problem, "joint")
    camera = Camera(fit.camera.intrinsics, fit.camera.pose, f"{seed}.jpg")
    return truth, camera, LensEvidence(fit.evidence.information, GUESS)


def record_of(photo, also=(), **evidence):
    """The record of such a photo as JSON gives it back; `evidence`: what differs from a good pose; `also`: further reasons."""
    _, camera, known = photo
    quality = PoseQuality("refined", camera.pose, 640, 4.0, 500, 0.8, 0.5, 0.9, 7, 1500, 0.9, 0.4, 0.03, 0.02, 0.4, 0.2, 0.8)
    sits = {"region_corners": 400, "region_share": 0.8, "region_area": 0.6, "region_offset_px_of_photo": 0.5, "unrivalled": 1.0}
    quality = replace(quality, **{**sits, **evidence})
    k, (verdict, reasons) = camera.intrinsics, judge(quality)
    values = (k.focal, k.cx, k.cy, *k.dist, k.fx / k.fy)
    lens = tuple(LensNumber(name, "solved", value, 0.01 * abs(value)) for name, value in zip(LENS_NUMBERS, values, strict=True))
    reasons = (*reasons, lens_sentence(lens, k), *also)
    report = RefineReport(
        camera, camera, verdict, reasons, (), 1.0, quality, "joint", lens, known, tuple(sentences.details(quality))
    )
    return json.loads(json.dumps(report_to_dict(report)))
