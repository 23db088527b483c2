"""From frame to frame: each solved from the one before, gaps tried again from the other side, what is lost said.

The walk goes from a start frame to the end of its part of the shot. Where a frame is lost (a cut, somebody in front of the
lens, too much blur), the frames behind it are tried to be found anew, each time after twice as many frames; from where that
succeeds, the walk goes on, and back into the gap.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Generator, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from ..errors import GssmcError
from ..geometry.camera import Camera, Pose
from ..geometry.lie import se3_exp, se3_log
from ..photos.photo import Photo
from ..pose.final.solution import deviations
from ..pose.shared.lens import CameraUnknowns
from .evidence import XI, Evidence, evidence_of
from .focal import grown
from .frames import FrameMatcher, ReadFrame, SolvedFrame
from .problem import Link

# Finds a frame's camera anew: the frame, and the last camera that was known. None where it finds none.
Recover = Callable[[Photo, Camera], Camera | None]

TOO_LITTLE = "Too little of the picture sits on the splat."
# So many cameras are kept of the path, to tell from them where it goes on.
REMEMBERED = 24


@dataclass(frozen=True, eq=False)
class Tie:
    """How a frame is tied to the splat: its pose, its evidence, how many cells of the picture hold a corner of it, the median
    depth (scene units), and the logarithm of its focal length over the shot's.
    """

    pose: Pose
    evidence: Evidence
    cells: int
    median_depth: float
    grow: float = 0.0

    @property
    def std_pct(self) -> float:
        """Standard deviation of the camera's place as this frame alone tells it, per cent of the median depth."""
        std = deviations(self.evidence.equations.information[XI, XI], self.median_depth)
        return 100 * float(np.linalg.norm(std[:3])) / self.median_depth


@dataclass(eq=False)
class PartialTrack:
    """What the walks found so far: `ties` and `links` of frames, and why the others are `lost`. `rolling`: whether a rolling
    shutter is to be solved for; `starts`: the logarithm of the focal length of each start over the shot's.
    """

    ties: dict[int, Tie] = field(default_factory=dict)
    links: list[Link] = field(default_factory=list)
    lost: dict[int, str] = field(default_factory=dict)
    rolling: bool = False
    starts: dict[int, float] = field(default_factory=dict)

    def add(self, frame: int, solved: SolvedFrame, grow: float = 0.0) -> None:
        height = solved.photo.intrinsics.height
        evidence = evidence_of(solved.fit, height, self.rolling)
        self.ties[frame] = Tie(solved.pose, evidence, solved.cells, solved.median_depth, grow)
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
        self._note(step, at, before)
        known = [f for f in frames if f in self.found.ties or f in self.found.lost]
        tied = [f for f in known if f in self.found.ties]
        if tied and (again := self.again(tied[-1])) is not None:
            before, last_at = again, tied[-1]
            for earlier in tied[-2:]:
                step.note(earlier, self.found.ties[earlier].pose, self.found.ties[earlier].grow)
        frames = [f for f in frames if f not in known]
        wanted = 1
        for frame in frames:
            solved = self._next(before, last_at, frame, step)
            if solved is None:
                gap += 1
                if gap == wanted and self.recover is not None:
                    wanted *= 2
                    solved = self._anew(frame, before)
            if solved is not None:
                self._add(frame, solved)
                if gap:
                    behind = frames[: frames.index(frame)]
                    yield from self._back(behind[max(len(behind) - gap, 0) :], frame, solved)
                    step = _Motion()
                self._note(step, frame, solved)
                before, last_at, gap, wanted = solved, frame, 0, 1
            yield frame

    def first(self, frame: int, start: Camera) -> SolvedFrame | None:
        """The frame tied to the splat from a start; None where too little holds it, which is noted."""
        if frame in self.found.ties:
            return self.again(frame)
        solved = self._solve(frame, start)
        if solved is not None:
            self._add(frame, solved)
        return solved

    def meet(self, earlier: Sequence[int], frame: int, solved: SolvedFrame) -> Generator[int, None, None]:
        """Ties a start to the `earlier` frames, where these were walked to it from another start: back into those right before
        it that were lost, yielding each, or to the last one by the corners that both show.
        """
        if not earlier or any({link.a, link.b} == {earlier[-1], frame} for link in self.found.links):
            return
        if earlier[-1] in self.found.ties:
            self._join(earlier[-1], frame, solved)
        lost = list(itertools.takewhile(lambda f: f in self.found.lost, reversed(earlier)))
        yield from self._back(lost[::-1], frame, solved)

    def _join(self, tied: int, frame: int, solved: SolvedFrame) -> None:
        """A link from the solved `frame` to one that is tied already."""
        tie = self.found.ties[tied]
        matcher = self.matcher.at(tie.grow)
        try:
            photo = matcher.working(self.read(tied))
        except GssmcError:  # What it knows by itself stays.
            return
        link = matcher.link(solved, photo, tie.pose)
        if link is not None:
            at_tie = replace(link.fit, camera=CameraUnknowns(tie.pose, photo.intrinsics))
            self.found.links.append(Link(frame, tied, evidence_of(at_tie, photo.intrinsics.height, self.found.rolling)))

    def again(self, frame: int) -> SolvedFrame | None:
        """A frame that was found before, with the corners that hold it, at the camera that it was found at."""
        tie = self.found.ties[frame]
        matcher = self.matcher.at(tie.grow)
        camera = CameraUnknowns(tie.pose, matcher.working_lens)
        try:
            solved = matcher.solve(matcher.working(self.read(frame)), camera)
        except GssmcError:
            return None
        return None if solved is None else solved.placed(camera)

    def _add(self, frame: int, solved: SolvedFrame) -> None:
        self.found.add(frame, solved, self.matcher.grow_of(solved.lens))

    def _note(self, motion: _Motion, frame: int, solved: SolvedFrame) -> None:
        motion.note(frame, solved.pose, self.matcher.grow_of(solved.lens))

    def _next(self, before: SolvedFrame, at: int, frame: int, motion: _Motion) -> SolvedFrame | None:
        pose, grow = motion.expected(frame)
        matcher = self.matcher.at(grow)
        try:
            photo = matcher.working(self.read(frame))
        except GssmcError as error:
            self.found.lost[frame] = str(error)
            return None
        link = matcher.link(before, photo, pose)
        if link is None:
            self.found.lost[frame] = "The picture changed too much from the frame before to follow it."
            return None
        solved = matcher.solve(photo, link.fit.camera, link)
        if solved is None:
            self.found.lost[frame] = TOO_LITTLE
            return None
        # The shot's problem begins at the camera of the tie, so that the link has to be told what it costs there.
        at_tie = replace(link.fit, camera=solved.fit.camera)
        self.found.links.append(Link(at, frame, evidence_of(at_tie, photo.intrinsics.height, self.found.rolling)))
        return solved

    def _anew(self, frame: int, before: SolvedFrame) -> SolvedFrame | None:
        assert self.recover is not None
        lens = grown(self.matcher.lens, self.matcher.grow_of(before.lens))
        try:
            camera = self.recover(self.read(frame), Camera(lens, before.pose))
        except GssmcError as error:
            self.found.lost[frame] = str(error)
            return None
        return None if camera is None else self._solve(frame, camera)

    def _solve(self, frame: int, guess: Camera) -> SolvedFrame | None:
        matcher = self.matcher.at(self.matcher.grow_of(guess.intrinsics))
        try:
            photo = matcher.working(self.read(frame))
            solved = matcher.solve(photo, CameraUnknowns(guess.pose, photo.intrinsics))
        except GssmcError as error:
            self.found.lost[frame] = str(error)
            return None
        if solved is None:
            self.found.lost[frame] = TOO_LITTLE
        return solved

    def _back(self, gap: Sequence[int], frame: int, solved: SolvedFrame) -> Generator[int, None, None]:
        """From a frame behind a gap back into it, as far as frames can be followed; `gap`: its frames as they were tried."""
        motion, before, at = _Motion(), solved, frame
        self._note(motion, frame, solved)
        for other in reversed([f for f in gap if f in self.found.lost]):
            again = self._next(before, at, other, motion)
            if again is None:
                return
            self._add(other, again)
            self._note(motion, other, again)
            before, at = again, other
            yield other


@dataclass
class _Motion:
    """The last poses and focal lengths, and where the next ones are expected if the camera goes on as it went."""

    known: list[tuple[int, Pose, float]] = field(default_factory=list)

    def note(self, frame: int, pose: Pose, grow: float) -> None:
        self.known = [*self.known[1 - REMEMBERED :], (frame, pose, grow)]

    def expected(self, frame: int) -> tuple[Pose, float]:
        """The pose, and the logarithm of the focal length over the shot's, if it all goes on for as long as it is to the frame
        as it went for as long before: behind a gap, a hand's shake is averaged out.
        """
        at, pose, grow = self.known[-1]
        if len(self.known) < 2:
            return pose, grow
        gap = abs(frame - at)
        earlier, before, grew = min(self.known[:-1], key=lambda one: abs(abs(at - one[0]) - gap))
        ahead = (frame - at) / (at - earlier)
        return se3_exp(ahead * se3_log(pose @ before.inverse())) @ pose, grow + ahead * (grow - grew)
