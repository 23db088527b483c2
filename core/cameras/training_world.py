"""From the world of the training to the coordinates of a splat file.

nerfstudio moves, turns and scales a scene before it trains, and `ns-export` leaves the splat there; the cameras of
transforms.json stay where they were. Its dataparser_transforms.json says how: p_splat = scale * (R p_cameras + t), with
`transform` the 3x4 matrix [R | t].

Other trainings take the cameras' world as it is, mostly COLMAP's (x right, y down, z forward), and write it into a .ply. A
format with other axes turns the splat when it is made of that .ply, while the cameras stay: .spz by 180 degrees about x, glTF
by 180 degrees about x or, as PlayCanvas' programs do, about z.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal, TypeVar

import numpy as np

from ..errors import CameraError, DatasetError
from ..geometry.camera import Camera, FloatArray, Intrinsics, Pose
from ..geometry.conventions import Orientation, Similarity, orientation_matrix
from ..splats import GaussianScene
from ..splats.gltf import NAME as GLTF
from .files import StartCamera, load_json

FILE = "dataparser_transforms.json"
Axes = Literal["auto", "file", "training"]
AXES: tuple[Axes, ...] = ("auto", "file", "training")
# So many Gaussians of a scan, and so many cameras, are enough to tell what the cameras see.
MOST_POINTS, MOST_CAMERAS = 20_000, 50
# A camera that sees less than this share of a scan's opacity sees nothing of it.
SEES_NOTHING = 1e-3
# Of a camera without a lens: what its picture shows to each side, in distances.
USUAL_REACH = 0.6
TOLD: dict[Orientation, str] = {"Y_DOWN": "y down", "Y_UP": "y up", "Z_UP": "z up", "Z_DOWN": "z down"}
TAKEN = "In the world of the training, y down, not in the coordinates of the scan's file, "
Placed = TypeVar("Placed", Camera, StartCamera)


def read_training_world(path: Path) -> Similarity:
    """The similarity from the cameras' world to the splat's. Raises DatasetError or CameraError."""
    data = load_json(path)
    if not isinstance(data, dict) or "transform" not in data or "scale" not in data:
        raise DatasetError(f'\'{path.name}\' lacks "transform" or "scale"; give the {FILE} of the training\'s output folder.')
    matrix = np.eye(4)
    try:
        rows, scale = np.asarray(data["transform"], np.float64), float(data["scale"])
        matrix[:3] = scale * rows[:3]
        return Similarity.from_matrix(matrix)
    except (CameraError, ValueError, TypeError, OverflowError, IndexError):
        raise DatasetError(
            f"'{path.name}' holds no rotation, translation and positive scale; take the file from the training's output anew."
        ) from None


def training_turns(orientation: Orientation, source_format: str = "") -> tuple[Similarity, ...]:
    """The turns that may lie between the world of the training (y down) and a splat file whose axes point as `orientation`
    says, the likeliest first; none where the two are the same.
    """
    if orientation == "Y_DOWN":
        return ()
    own = Similarity.from_matrix(orientation_matrix(orientation).T @ orientation_matrix("Y_DOWN"))
    about_z = Similarity.from_matrix(np.diag([-1.0, -1.0, 1.0, 1.0]))
    return (about_z, own) if source_format == GLTF and orientation == "Y_UP" else (own,)


@dataclass(frozen=True, eq=False)
class ScanAxes:
    """What of a scan tells in which world cameras are: some of its Gaussians, `points` (N, 3) in the coordinates of its file
    with their opacities `weights` (N,), and the turns into that file as `training_turns` gives them.
    """

    points: FloatArray
    weights: FloatArray
    turns: tuple[Similarity, ...]
    orientation: Orientation = "Y_DOWN"

    @classmethod
    def of(cls, scene: GaussianScene) -> ScanAxes:
        """Those of a scene."""
        step = max(1, len(scene) // MOST_POINTS)
        points = scene.means[::step].astype(np.float64) + scene.origin
        turns = training_turns(scene.orientation, scene.format)
        return cls(points, scene.opacities[::step].astype(np.float64), turns, scene.orientation)

    def share_seen(self, pose: Pose, lens: Intrinsics | None) -> float:
        """The share 0..1 of the opacity that stands in the picture of a camera; without a lens, in a usual one's."""
        local = self.points @ pose.R.T + pose.t
        ahead = local[:, 2] > 0
        with np.errstate(divide="ignore", invalid="ignore"):
            flat = np.abs(local[:, :2] / local[:, 2:])
        reach = (USUAL_REACH, USUAL_REACH)
        if lens is not None:
            reach = (max(lens.cx, lens.width - lens.cx) / lens.fx, max(lens.cy, lens.height - lens.cy) / lens.fy)
        seen = ahead & (flat <= reach).all(axis=1)
        return float(self.weights[seen].sum() / max(self.weights.sum(), np.finfo(np.float64).tiny))

    def settled(self, cameras: Sequence[Placed], axes: Axes) -> tuple[list[Placed], str]:
        """Cameras of one world in the coordinates of the splat file, and a sentence where that was not what they seemed.

        "auto": they stay, unless they see nothing of the scan there and something in the world of the training.
        """
        cameras = list(cameras)
        few = cameras[:: max(1, len(cameras) // MOST_CAMERAS)]
        ways = list(self._ways(axes))
        seen = [[self.share_seen(way(one).pose, one.intrinsics) for one in few] for way in ways]
        # The ways come with the likeliest first, so that the first one in which the cameras see the scan is taken.
        best = next((i for i, shares in enumerate(seen) if shares and np.median(shares) > SEES_NOTHING), 0)
        return [ways[best](one) for one in cameras], self._told("cameras") if axes == "auto" and best else ""

    def into_training_world(self, cameras: Sequence[Placed]) -> list[Placed]:
        """Cameras in the coordinates of the splat file, in the world of its training: the inverse of the likeliest turn."""
        back = _Way(self.turns[0].inverse() if self.turns else None)
        return [back(one) for one in cameras]

    def starts(self, camera: Camera, axes: Axes) -> list[tuple[Camera, str]]:
        """The cameras to try for a single photo, in the coordinates of the splat file, the likeliest first, each with a
        sentence to say if it is taken. Those that see nothing of the scan are left out where another one sees something.
        """
        tried = [(way(camera), self._told("start") if axes == "auto" and i else "") for i, way in enumerate(self._ways(axes))]
        seen = [one for one in tried if self.share_seen(one[0].pose, camera.intrinsics) > SEES_NOTHING]
        return seen or tried[:1]

    def _ways(self, axes: Axes) -> Iterator[_Way]:
        if axes != "training" or not self.turns:
            yield _Way(None)
        if axes != "file":
            yield from map(_Way, self.turns)

    def _told(self, what: str) -> str:
        return f"{TAKEN}{TOLD[self.orientation]}, the {what} {'show' if what == 'cameras' else 'shows'} the scan."


@dataclass(frozen=True)
class _Way:
    """From one world into the file's coordinates; None: it is the file's."""

    turn: Similarity | None

    def __call__(self, camera: Placed) -> Placed:
        return camera if self.turn is None else replace(camera, pose=self.turn.pose_to_scene(camera.pose))
