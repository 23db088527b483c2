"""How a frame's threads share the interpreter lock: quickly while they draw, and afterwards as the process had it."""

from __future__ import annotations

import sys
from collections.abc import Iterator

import pytest
from render_scenes import cloud, make_scene

from core.errors import Cancelled
from core.geometry.camera import Intrinsics, Pose
from core.render import Renderer, RenderSettings
from core.render.sharing import HANDOVER_S, quick_handover

CAMERA = Intrinsics(61, 43, 50.0, 55.0, 28.0, 24.0)
USUAL_S = 0.004


@pytest.fixture(autouse=True)
def usual_interval() -> Iterator[None]:
    before = sys.getswitchinterval()
    sys.setswitchinterval(USUAL_S)
    yield
    sys.setswitchinterval(before)


@pytest.mark.parametrize(("threads", "while_drawing"), [(1, USUAL_S), (2, HANDOVER_S)])
def test_only_threads_that_share_a_frame_hand_over_quickly(threads: int, while_drawing: float) -> None:
    seen: list[float] = []

    def look() -> bool:
        seen.append(sys.getswitchinterval())
        return False

    Renderer(make_scene(*cloud()), RenderSettings(threads=threads)).render(CAMERA, Pose(), look)
    assert seen == pytest.approx([while_drawing] * len(seen), abs=2e-6)
    assert seen
    assert sys.getswitchinterval() == pytest.approx(USUAL_S, abs=2e-6)


def test_a_cancelled_frame_puts_the_interval_back() -> None:
    with pytest.raises(Cancelled):
        Renderer(make_scene(*cloud()), RenderSettings(threads=2)).render(CAMERA, Pose(), lambda: True)
    assert sys.getswitchinterval() == pytest.approx(USUAL_S, abs=2e-6)


def test_frames_that_overlap_leave_nothing_changed() -> None:
    first, second = quick_handover(), quick_handover()
    first.__enter__()
    second.__enter__()
    first.__exit__(None, None, None)
    second.__exit__(None, None, None)
    assert sys.getswitchinterval() == pytest.approx(USUAL_S, abs=2e-6)


def test_a_shorter_interval_of_the_process_is_kept() -> None:
    sys.setswitchinterval(1e-5)
    with quick_handover():
        assert sys.getswitchinterval() == pytest.approx(1e-5, abs=2e-6)
    assert sys.getswitchinterval() == pytest.approx(1e-5, abs=2e-6)
