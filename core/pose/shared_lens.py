"""One lens for many photos: what each photo's own solution knows of the lens, put together, and each pose moved along.

A photo's last fit leaves a quadratic cost in its pose xi and its lens l, with information H. Taking the pose out of it leaves
what the photo says of the lens, A = H_ll - H_lx H_xx^-1 H_xl about its own answer; the sum of these and of one prior has its
minimum at the lens that all photos share, and each pose follows by xi = -H_xx^-1 H_xl (l - l_own). This is one Gauss-Newton
step of the joint problem over all photos, begun at their own solutions, and needs no match and no render again.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from ..geometry.camera import Camera, FloatArray, Intrinsics, pose_error
from ..geometry.lie import se3_exp
from .report import LensEvidence
from .shared.lens import GUESS_STD, SQUEEZE, lens_difference, moved_lens

# A photo whose lens lies farther from that of the others is not of that lens: squared distance in deviations, of nine numbers
# that chance brings beyond this once in a hundred thousand times.
MAX_DISTANCE = 38.0
MIN_PHOTOS = 2
# A smaller logarithm of a ratio of fx to fy is what rounding leaves of one that was held.
SAME_SQUEEZE = 1e-9
IndexArray = npt.NDArray[np.int64]
P = slice(0, 6)
L = slice(6, 15)


@dataclass(frozen=True, eq=False)
class SharedPhoto:
    """A photo after its lens was shared: the camera, the deviations of its position (scene units) and rotation (degrees), and
    how far it moved from the photo's own solution (scene units, degrees).
    """

    camera: Camera
    translation_std_units: float
    rotation_std_deg: float
    moved_units: float
    moved_deg: float


@dataclass(frozen=True, eq=False)
class SharedLens:
    """The lens that photos share: its numbers' deviations (9,) of `lens.NAMES`, and the photos by their index among those that
    were given; the indices in `others` are of photos whose own lens is another one, or that had no other beside them.
    """

    intrinsics: Intrinsics
    std: FloatArray
    photos: dict[int, SharedPhoto]
    others: tuple[int, ...]


def share_lens(cameras: Sequence[Camera], evidence: Sequence[LensEvidence]) -> SharedLens | None:
    """The lens that the most of the photos agree on; None where no two of them do. All are of one size."""
    if not cameras:
        return None
    reference, says = cameras[0].intrinsics, _Statements.of(cameras, evidence)
    prior = _prior(evidence[0])
    centre = prior @ lens_difference(evidence[0].guess, reference)
    members = np.arange(len(cameras))
    while len(members) >= MIN_PHOTOS:
        S, b = prior + says.A[members].sum(0), centre + says.b[members].sum(0)
        distances = says.distances(members, S, b)
        worst = int(np.argmax(distances))
        if distances[worst] <= MAX_DISTANCE:
            lens = moved_lens(reference, np.linalg.solve(S, b))
            return _shared(members.tolist(), cameras, evidence, lens, np.linalg.inv(S))
        members = np.delete(members, worst)
    return None


def _information(camera: Camera, known: LensEvidence) -> FloatArray:
    """What a photo's matches know (15, 15), without what they say of pixels that were taken for square: these stay so."""
    H = known.information.copy()
    if abs(lens_difference(camera.intrinsics, known.guess)[SQUEEZE]) < SAME_SQUEEZE:
        H[6 + SQUEEZE] = H[:, 6 + SQUEEZE] = 0.0
    return H


def _prior(known: LensEvidence) -> FloatArray:
    """Inverse covariance (9, 9) of the prior that a photo's solution was found with."""
    std = GUESS_STD.copy()
    std[0] = known.focal_std
    return np.diag(std**-2.0)


@dataclass(frozen=True, eq=False)
class _Statements:
    """Each photo's cost in the lens l about that of the first one: l^T A l / 2 - b^T l. A (N, 9, 9), b (N, 9), `inverse` the
    pseudoinverses of A.
    """

    A: FloatArray
    b: FloatArray
    inverse: FloatArray

    @classmethod
    def of(cls, cameras: Sequence[Camera], evidence: Sequence[LensEvidence]) -> _Statements:
        reference = cameras[0].intrinsics
        H = np.stack([_information(*pair) for pair in zip(cameras, evidence, strict=True)])
        A = H[:, L, L] - H[:, L, P] @ np.linalg.pinv(H[:, P, P], hermitian=True) @ H[:, P, L]
        own = np.stack([lens_difference(camera.intrinsics, reference) for camera in cameras])
        # A photo's own answer balances its matches and its prior, so that the gradient of the matches is minus the prior's.
        pairs = zip(cameras, evidence, strict=True)
        pull = np.stack([_prior(known) @ lens_difference(camera.intrinsics, known.guess) for camera, known in pairs])
        return cls(A, np.einsum("nij,nj->ni", A, own) + pull, np.linalg.pinv(A, hermitian=True))

    def distances(self, members: IndexArray, S: FloatArray, b: FloatArray) -> FloatArray:
        """Squared distances, in deviations, of each member's lens from that of the others, who with it and the prior make up S
        and b.
        """
        A, own, inverse = self.A[members], self.b[members], self.inverse[members]
        others = np.linalg.solve(S - A, (b - own)[..., None])[..., 0]
        v = own - np.einsum("nij,nj->ni", A, others)
        return np.asarray(np.einsum("ni,nij,nj->n", v, inverse, v) - np.einsum("ni,ij,nj->n", v, np.linalg.inv(S), v))


def _shared(
    members: Sequence[int],
    cameras: Sequence[Camera],
    evidence: Sequence[LensEvidence],
    lens: Intrinsics,
    covariance: FloatArray,
) -> SharedLens:
    photos = {i: _moved(cameras[i], evidence[i], lens, covariance) for i in members}
    others = tuple(i for i in range(len(cameras)) if i not in photos)
    return SharedLens(lens, np.sqrt(np.diag(covariance)), photos, others)


def _moved(camera: Camera, known: LensEvidence, lens: Intrinsics, covariance: FloatArray) -> SharedPhoto:
    """A photo's camera under the shared lens, whose covariance (9, 9) is that of all photos together."""
    H = _information(camera, known)
    own = np.linalg.pinv(H[P, P], hermitian=True)
    follow = -own @ H[P, L]
    pose = se3_exp(follow @ lens_difference(lens, camera.intrinsics)) @ camera.pose
    spread = np.diag(own + follow @ covariance @ follow.T)
    moved = pose_error(pose, camera.pose)
    shared = replace(camera, pose=pose, intrinsics=lens)
    return SharedPhoto(shared, float(np.sqrt(spread[:3].sum())), float(np.degrees(np.sqrt(spread[3:].sum()))), *moved)
