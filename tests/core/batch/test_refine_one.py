"""What several tries of one photo come to."""

from dataclasses import replace

from boxroom import LENS, TRUTH

from core.batch import refine_one
from core.geometry.camera import Camera
from core.pose.report import RefineReport

START = Camera(LENS, TRUTH)
REPORT = RefineReport(START, START, "failed", ("Nothing matches.",), (), 4.0)


def test_the_seconds_told_are_those_of_all_starts_that_were_tried(monkeypatch):
    ends = [REPORT, replace(REPORT, verdict="trusted", seconds=2.5)]
    monkeypatch.setattr(refine_one, "refine_photo", lambda *_: ends.pop(0))
    tried = refine_one.refine_starts(None, None, [(START, ""), (START, "The camera is turned.")], None)
    assert (tried.verdict, tried.seconds, tried.reasons[-1]) == ("trusted", 6.5, "The camera is turned.")
    ends = [REPORT, replace(REPORT, seconds=1.0, reasons=("Another reason.",))]
    tried = refine_one.refine_starts(None, None, [(START, ""), (START, "")], None)
    assert (tried.seconds, tried.reasons) == (5.0, REPORT.reasons)
