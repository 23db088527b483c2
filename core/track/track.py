"""A track from its start frames to the end: walks over all frames, then the shot as one problem, then what is to be said."""

from __future__ import annotations

import itertools
import time
from collections.abc import Callable, Generator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from statistics import median

from ..errors import RefineError
from ..geometry.camera import Camera, Intrinsics, Pose
from ..geometry.conventions import focal_px_from_35mm
from ..pose.lens_report import shared_numbers
from ..pose.report import LensNumber, Verdict
from ..pose.sequence import FramePose, interpolate, nearest, smooth
from ..pose.shared.lens import LensPrior, moved_lens
from ..render.view import ViewRenderer
from ..support.words import counted
from .focal import focal_words, grown
from .frames import GOOD_CELLS, GOOD_MATCHES, FrameMatcher, ReadFrame
from .problem import ShotProblem
from .report import FrameState, Track, TrackedFrame, TrackProgress
from .settings import TrackSettings
from .shot import ShotSolution, solve_shot
from .walk import PartialTrack, Recover, Tie, Walk

# The RMS of a frame that is called good, in pixels of the frame, reduced to a long side of LONG_SIDE_PX where it is larger.
GOOD_RMS_PX = 1.0
LONG_SIDE_PX = 1280
# And the deviation of its place, as it alone tells it, per cent of the median depth: that of a trusted photo.
GOOD_STD_PCT = 0.5
# A shot is trusted with at least this share of good frames, and fails with fewer tied to the splat than that.
TRUSTED_SHARE, FAILED_SHARE = 0.9, 0.5
# How much more a pinned frame counts than another where the path is smoothed.
PINNED_WEIGHT = 1e6
DOUBTED = "The camera that it was tracked from is not trusted."
WALKED = 0.97  # of the progress, when all frames were seen

Tracking = Generator[TrackProgress, None, Track]


@dataclass(frozen=True, eq=False)
class Shot:
    """A plate: `read` gives the frame of a number, `frames` are the numbers to track, in order; `recover` finds a frame anew
    behind a gap, None where it is not to be tried; `name` gives the file of a frame. `doubt`: why the cameras of the starts are
    not trusted, "" where they are; no frame is called good then, for all are tracked from these. `pinned`: poses of frames,
    world-to-camera in the coordinates of the splat, that are held exactly; `readout`: that of the shutter where it is known, 0
    where it is not.
    """

    read: ReadFrame
    frames: Sequence[int]
    recover: Recover | None = None
    name: Callable[[int], str] = "".format
    doubt: str = ""
    pinned: Mapping[int, Pose] = field(default_factory=dict)
    readout: float = 0.0


def iterate_track(
    renderer: ViewRenderer,
    shot: Shot,
    starts: Mapping[int, Camera],
    settings: TrackSettings,
    found: PartialTrack | None = None,
) -> Tracking:
    """Tracks all frames; a generator that yields a `TrackProgress` after each and returns the `Track`.

    `starts`: solved cameras of some frames, all with one lens, which belongs to the frames at their full size; poses are
    world-to-camera in the coordinates of the splat. `found`: what an earlier, interrupted track of the same shot found, which
    is taken over; it grows while this one runs. Raises RefineError where there is no start, or none of them sits on the splat.
    Closing the generator cancels.
    """
    began = time.perf_counter()
    known = {frame: starts[frame] for frame in sorted(starts) if frame in set(shot.frames)}
    if not known:
        raise RefineError("No frame of the range has a camera to begin with; give one with a start, or find it first.")
    camera = next(iter(known.values()))
    prior, change = LensPrior.of(camera), settings.focal_change
    matcher = FrameMatcher(renderer, camera.intrinsics, prior, settings.long_side_px, change)
    found = PartialTrack() if found is None else found
    found.rolling = settings.rolling_shutter or shot.readout > 0
    found.starts = {frame: matcher.grow_of(start.intrinsics) for frame, start in known.items()}
    walk = Walk(matcher, shot.read, found, shot.recover)
    yield from _walked(walk, shot, known)
    yield TrackProgress(WALKED, "solving the shot", shot.frames[-1])
    return track_of(shot, camera, settings, found, time.perf_counter() - began)


def track_of(shot: Shot, camera: Camera, settings: TrackSettings, found: PartialTrack, seconds: float) -> Track:
    """The shot solved from what was `found` of it, also where the tracking was stopped in between; `camera`: that of a start.

    Raises RefineError where no frame was tied to the splat.
    """
    if not found.ties:
        raise RefineError(f"No frame sits on the splat at its start: {next(iter(found.lost.values()), '')}")
    return _Ending(found, shot, camera, _solved(found, shot, camera, settings), settings).track(seconds)


def _walked(walk: Walk, shot: Shot, known: Mapping[int, Camera]) -> Generator[TrackProgress, None, None]:
    """From each start forward to the next one, and from the first one that sits on the splat backward."""
    frames, starts = list(shot.frames), list(known)
    done = set(walk.found.ties) | set(walk.found.lost)
    backward = True
    for start, end in itertools.pairwise([*starts, frames[-1] + 1]):
        solved = walk.first(start, known[start])
        done.add(start)
        if solved is None:
            continue
        done.update(walk.meet(frames[: frames.index(start)], start, solved))
        ways = [[f for f in frames if start < f < end]]
        if backward:
            ways.append([f for f in reversed(frames) if f < start])
            backward = False
        for way in ways:
            for frame in walk.along(way, solved, start):
                done.add(frame)
                tie = walk.found.ties.get(frame)
                found = None
                if tie is not None:
                    found = replace(known[start], pose=tie.pose, intrinsics=grown(walk.matcher.lens, tie.grow))
                yield TrackProgress(WALKED * len(done) / len(frames), "tracking", frame, found)


def _solved(found: PartialTrack, shot: Shot, camera: Camera, settings: TrackSettings) -> ShotSolution:
    ties, prior = found.ties, LensPrior.of(camera)
    pinned = {frame: pose for frame, pose in shot.pinned.items() if frame in set(shot.frames)}
    lens = camera.intrinsics.with_long_side(settings.long_side_px)
    problem = ShotProblem(
        pinned | {frame: tie.pose for frame, tie in ties.items()},
        {frame: tie.evidence for frame, tie in ties.items()},
        [link for link in found.links if link.a in ties and link.b in ties],
        lens,
        prior.resized(lens.width, lens.height),
        settings.solve_lens and not prior.calibrated,
        settings.rolling_shutter and shot.readout == 0,
        settings.focal_change,
        {frame: tie.grow for frame, tie in ties.items()},
        found.starts,
        pinned,
        shot.readout,
    )
    return solve_shot(problem)


@dataclass(frozen=True, eq=False)
class _Ending:
    """What is made of a solved shot."""

    found: PartialTrack
    shot: Shot
    camera: Camera
    solution: ShotSolution
    settings: TrackSettings

    @property
    def lens(self) -> Intrinsics:
        return moved_lens(self.camera.intrinsics, self.solution.lens_step)

    def track(self, seconds: float) -> Track:
        poses, depth = self._poses(), median(tie.median_depth for tie in self.found.ties.values())
        frames = tuple(self._frame(frame, poses[frame]) for frame in self.shot.frames)
        if (curve := self.solution.curve) is not None:
            frames = tuple(replace(frame, focal_std_pct=100 * curve.std(frame.frame)) for frame in frames)
        verdict, reasons = judge_frames(frames)
        if self.shot.doubt:
            verdict, reasons = "failed" if verdict == "failed" else "check", (self.shot.doubt, *reasons)
        if self.solution.curve is not None:
            reasons = (*reasons, focal_range(frames))
        numbers: tuple[LensNumber, ...] = ()
        if self.solution.lens_std.any():
            numbers = shared_numbers(self.lens, self.solution.lens_std)
        return Track(frames, self.lens, numbers, self.solution.readout, depth, verdict, reasons, seconds)

    def _poses(self) -> dict[int, Pose]:
        """A pose for every frame: the solved ones, smoothed where that is wanted, the path between these, else the nearest."""
        pinned = self.shot.pinned
        solved = [
            FramePose(frame, self.solution.poses[frame], PINNED_WEIGHT if frame in pinned else 1.0)
            for frame in sorted(self.solution.poses)
        ]
        path = smooth(solved, self.settings.smooth_frames)
        known = [FramePose(point.frame, pose) for point, pose in zip(solved, path, strict=True)]
        inside = [f for f in self.shot.frames if known[0].frame <= f <= known[-1].frame]
        poses = dict(zip(inside, interpolate(known, inside), strict=True))
        poses |= {point.frame: pinned.get(point.frame, point.pose) for point in known}
        for frame in self.shot.frames:
            if frame not in poses:
                end = nearest(frame, (known[0].frame, known[-1].frame))
                assert end is not None
                poses[frame] = poses[end]
        return poses

    def _frame(self, frame: int, pose: Pose) -> TrackedFrame:
        name = self.shot.name(frame)
        lens = grown(self.lens, self.solution.grow(frame))
        camera = replace(self.camera, intrinsics=lens, pose=pose, focal_guessed=False, file=name)
        tie = self.found.ties.get(frame)
        if tie is None and frame in self.shot.pinned:
            return TrackedFrame(frame, camera, "weak", "Its camera is pinned, and nothing else holds it.", 0, float("nan"))
        if tie is None:
            reason = self.found.lost.get(frame, "No frame beside it could be followed to it.")
            return TrackedFrame(frame, camera, "lost", reason, 0, float("nan"))
        k = self.camera.intrinsics
        size = max(k.width, k.height)
        scale = size / min(size, self.settings.long_side_px)
        rms = scale * self.solution.rms_px[frame]
        state, reason = _state(rms * min(1.0, LONG_SIDE_PX / size), tie)
        if state == "good" and self.shot.doubt:
            state, reason = "weak", DOUBTED
        return TrackedFrame(frame, camera, state, reason, tie.evidence.matches, rms)


def _state(rms_px: float, tie: Tie) -> tuple[FrameState, str]:
    if not rms_px <= GOOD_RMS_PX:
        return "weak", f"Its corners sit on the splat only to {rms_px:.1f} px."
    if tie.evidence.matches < GOOD_MATCHES:
        return "weak", f"Only {counted(tie.evidence.matches, 'corner')} on the splat hold it."
    if tie.cells < GOOD_CELLS:
        return "weak", "What holds it lies in a small part of the picture."
    if not tie.std_pct <= GOOD_STD_PCT:
        return "weak", f"Where the camera stands is known only to {tie.std_pct:.1f} % of the distance to the scene."
    return "good", ""


def zooms(frames: Sequence[TrackedFrame]) -> bool:
    """Whether the frames have more than one focal length."""
    return len({frame.camera.intrinsics.focal for frame in frames}) > 1


def focal_range(frames: Sequence[TrackedFrame]) -> str:
    """A sentence on the focal lengths of the frames."""
    lenses = [frame.camera.intrinsics for frame in frames]
    return focal_words([k.focal / focal_px_from_35mm(1.0, k.width, k.height) for k in lenses])


def judge_frames(frames: Sequence[TrackedFrame]) -> tuple[Verdict, tuple[str, ...]]:
    """The verdict on every frame that there is, in words."""
    count = {state: sum(f.state == state for f in frames) for state in ("good", "weak", "lost")}
    said = f"Held well: {count['good']} of {counted(len(frames), 'frame')}"
    more = [f"held loosely: {count['weak']}"] if count["weak"] else []
    more += [f"not tied to the splat, on the path of the others: {count['lost']}"] if count["lost"] else []
    sentence = "; ".join([said, *more]) + "."
    if len(frames) - count["lost"] < FAILED_SHARE * len(frames):
        return "failed", (f"Fewer than half of the frames could be tied to the splat. {sentence}",)
    trusted = count["good"] >= TRUSTED_SHARE * len(frames) and not count["lost"]
    return ("trusted" if trusted else "check"), (sentence,)
