"""From frame to frame: each solved from the one before, gaps tried again from the other side, what is lost said.

The walk goes from a start frame to the end of its part of the shot. Where a frame is lost (a cut, somebody in front of the
lens, too much blur), the frames behind it are tried to be found anew, each time after twice as many frames; from where that
succeeds, the walk goes on, and back into the gap.
"""

from __future__ import annotations

from collections.abc import Callable, Generator, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from ..errors import GssmcError
from ..geometry.camera import Pose
from ..geometry.lie import se3_exp, se3_log
from ..photos.photo import Photo
from ..pose.final.solution import deviations
from ..pose.shared.lens import CameraUnknowns
from .evidence import XI, Evidence, evidence_of
from .frames import FrameMatcher, ReadFrame, SolvedFrame
from .shot import Link

# Finds a frame's pose anew: the frame, and the last pose that was known. None where it finds none.
Recover = Callable[[Photo, Pose], Pose | None]


@dataclass(frozen=True, eq=False)
class Tie:
    """How a frame is tied to the splat: its pose, its evidence, how many cells of the picture hold a corner of it, and the
    median depth (scene units).
    """

    pose: Pose
    evidence: Evidence
    cells: int
    median_depth: float

    @property
    def std_pct(self) -> float:
        """Standard deviation of the camera's place as this frame alone tells it, per cent of the median depth."""
        std = deviations(self.evidence.equations.information[XI, XI], self.median_depth)
        return 100 * float(np.linalg.norm(std[:3])) / self.median_depth


@dataclass(eq=False)
class PartialTrack:
    """What the walks found so far: `ties` and `links` of frames, and why the others are `lost`. `rolling`: whether a rolling
    shutter is to be solved for.
    """

    ties: dict[int, Tie] = field(default_factory=dict)
    links: list[Link] = field(default_factory=list)
    lost: dict[int, str] = field(default_factory=dict)
    rolling: bool = False

    def add(self, frame: int, solved: SolvedFrame) -> None:
        height = solved.photo.intrinsics.height
        evidence = evidence_of(solved.fit, height, self.rolling)
        self.ties[frame] = Tie(solved.pose, evidence, solved.cells, solved.median_depth)
        self.lost.pop(frame, None)


@dataclass(frozen=True, eq=False)
class Walk:
    """`matcher` solves frames that `read` gives; `recover`: see Recover, None where nothing is found anew."""

    matcher: FrameMatcher
    read: ReadFrame
    found: PartialTrack
    recover: Recover | None = None

    def along(self, frames: Sequence[int], before: SolvedFrame, at: int) -> Generator[int, None, None]:
        """Solves `frames` one after the other, from `before`, the solved frame `at`; yields each number when it is done. Those
        that were found or lost before are passed over.
        """
        step, last_at, gap = _Motion(), at, 0
        step.note(at, before.pose)
        known = [f for f in frames if f in self.found.ties or f in self.found.lost]
        tied = [f for f in known if f in self.found.ties]
        if tied and (again := self.again(tied[-1])) is not None:
            before, last_at = again, tied[-1]
            for earlier in tied[-2:]:
                step.note(earlier, self.found.ties[earlier].pose)
        frames = [f for f in frames if f not in known]
        wanted = 1
        for frame in frames:
            solved = self._next(before, last_at, frame, step)
            if solved is None:
                gap += 1
                if gap == wanted and self.recover is not None:
                    wanted *= 2
                    solved = self._anew(frame, before.pose)
                    if solved is not None:
                        yield from self._back(frames, frame, solved)
            if solved is not None:
                self.found.add(frame, solved)
                if gap:
                    step = _Motion()
                step.note(frame, solved.pose)
                before, last_at, gap, wanted = solved, frame, 0, 1
            yield frame

    def first(self, frame: int, guess: Pose) -> SolvedFrame | None:
        """The frame tied to the splat from a start; None where too little holds it, which is noted."""
        if frame in self.found.ties:
            return self.again(frame)
        solved = self._solve(frame, guess)
        if solved is not None:
            self.found.add(frame, solved)
        return solved

    def again(self, frame: int) -> SolvedFrame | None:
        """A frame that was found before, with the corners that hold it, at the pose that it was found at."""
        pose = self.found.ties[frame].pose
        try:
            solved = self.matcher.solve(self.matcher.working(self.read(frame)), pose)
        except GssmcError:
            return None
        if solved is None:
            return None
        camera = CameraUnknowns(pose, solved.fit.camera.intrinsics)
        return replace(solved, fit=replace(solved.fit, camera=camera))

    def _next(self, before: SolvedFrame, at: int, frame: int, motion: _Motion) -> SolvedFrame | None:
        try:
            photo = self.matcher.working(self.read(frame))
        except GssmcError as error:
            self.found.lost[frame] = str(error)
            return None
        link = self.matcher.link(before, photo, motion.expected(frame))
        if link is None:
            self.found.lost[frame] = "The picture changed too much from the frame before to follow it."
            return None
        solved = self.matcher.solve(photo, link.fit.camera.pose, link)
        if solved is None:
            self.found.lost[frame] = "Too little of the picture sits on the splat."
            return None
        # The shot's problem begins at the pose of the tie, so that the link has to be told what it costs there.
        at_tie = replace(link.fit, camera=solved.fit.camera)
        self.found.links.append(Link(at, frame, evidence_of(at_tie, photo.intrinsics.height, self.found.rolling)))
        return solved

    def _anew(self, frame: int, last: Pose) -> SolvedFrame | None:
        assert self.recover is not None
        try:
            pose = self.recover(self.read(frame), last)
        except GssmcError as error:
            self.found.lost[frame] = str(error)
            return None
        return None if pose is None else self._solve(frame, pose)

    def _solve(self, frame: int, guess: Pose) -> SolvedFrame | None:
        try:
            solved = self.matcher.solve(self.matcher.working(self.read(frame)), guess)
        except GssmcError as error:
            self.found.lost[frame] = str(error)
            return None
        if solved is None:
            self.found.lost[frame] = "Too little of the picture sits on the splat."
        return solved

    def _back(self, frames: Sequence[int], frame: int, solved: SolvedFrame) -> Generator[int, None, None]:
        """From a frame that was found anew back into the gap before it, as far as frames can be followed."""
        earlier = [f for f in frames[: frames.index(frame)] if f in self.found.lost]
        motion, before, at = _Motion(), solved, frame
        motion.note(frame, solved.pose)
        for other in reversed(earlier):
            again = self._next(before, at, other, motion)
            if again is None:
                return
            self.found.add(other, again)
            motion.note(other, again.pose)
            before, at = again, other
            yield other


@dataclass
class _Motion:
    """The last poses, and where the next one is expected if the camera goes on as it went."""

    known: list[tuple[int, Pose]] = field(default_factory=list)

    def note(self, frame: int, pose: Pose) -> None:
        self.known = [*self.known[-1:], (frame, pose)]

    def expected(self, frame: int) -> Pose:
        at, pose = self.known[-1]
        if len(self.known) < 2:
            return pose
        earlier, before = self.known[0]
        speed = se3_log(pose @ before.inverse()) / (at - earlier)
        return se3_exp(speed * (frame - at)) @ pose
