"""One lens for many photos, against exact truth: closer than each by itself, and a photo of another lens is left out."""

import numpy as np
import pytest
from solved_photos import GUESS, LENS, OTHER, solved_photo

from core.geometry.camera import pose_error
from core.pose.shared.lens import GUESS_STD, MODES
from core.pose.shared_lens import share_lens


@pytest.fixture(scope="module")
def photos():
    return [solved_photo(seed, LENS) for seed in range(8)]


def _share(photos):
    return share_lens([p[1] for p in photos], [p[2] for p in photos])


def _errors(truths, cameras):
    return np.array([pose_error(c.pose, t)[0] for t, c in zip(truths, cameras, strict=True)])


def test_eight_photos_tell_the_lens_and_their_poses_better_than_each_alone(photos):
    shared = _share(photos)
    truths, own = [p[0] for p in photos], [p[1] for p in photos]
    together = [shared.photos[i].camera for i in range(8)]
    assert np.linalg.norm(_errors(truths, together)) < 0.7 * np.linalg.norm(_errors(truths, own))
    focal = [abs(c.intrinsics.focal / LENS.focal - 1) for c in own]
    assert abs(shared.intrinsics.focal / LENS.focal - 1) < 0.5 * np.median(focal)
    assert {c.intrinsics for c in together} == {shared.intrinsics} and shared.others == ()


def test_the_step_is_the_joint_problems_own(photos):
    """Against the poses and the lens that one large least-squares problem over all photos has, written out densely."""
    n, size = len(photos), 6 * len(photos) + 9
    H, g = np.zeros((size, size)), np.zeros(size)
    reference = photos[0][1].intrinsics
    for i, (_, camera, known) in enumerate(photos):
        at = [*range(6 * i, 6 * i + 6), *range(6 * n, size)]
        own = np.concatenate([np.zeros(6), _difference(camera.intrinsics, reference)])
        pull = np.concatenate([np.zeros(6), _difference(camera.intrinsics, GUESS) / GUESS_STD**2])
        H[np.ix_(at, at)] += known.information
        g[at] += known.information @ own + pull
    lens = slice(6 * n, size)
    H[lens, lens] += np.diag(GUESS_STD**-2.0)
    g[lens] += _difference(GUESS, reference) / GUESS_STD**2
    answer = np.linalg.solve(H, g)
    shared = _share(photos)
    np.testing.assert_allclose(_difference(shared.intrinsics, reference), answer[lens], atol=1e-6)
    np.testing.assert_allclose(shared.std, np.sqrt(np.diag(np.linalg.inv(H)))[lens], rtol=1e-6)


def _difference(now, prior):
    return np.array(
        [
            np.log(now.focal / prior.focal),
            (now.cx - prior.cx) / prior.focal,
            (now.cy - prior.cy) / prior.focal,
            *np.subtract(now.dist, prior.dist),
            np.log(now.fx / now.fy) - np.log(prior.fx / prior.fy),
        ]
    )


def test_a_photo_of_another_lens_keeps_its_own(photos):
    shared = _share([*photos[:3], solved_photo(50, OTHER), *photos[3:]])
    assert shared.others == (3,)
    assert abs(shared.intrinsics.focal / LENS.focal - 1) < 0.01


def test_two_photos_that_disagree_share_nothing(photos):
    assert _share([photos[0], solved_photo(50, OTHER)]) is None
    assert _share(photos[:1]) is None and _share([]) is None


def test_the_stated_deviations_are_the_errors():
    ratios = []
    for group in range(6):
        photos = [solved_photo(100 + 10 * group + i, LENS) for i in range(4)]
        shared = _share(photos)
        for i, (truth, _, _) in enumerate(photos):
            ratios.append(pose_error(shared.photos[i].camera.pose, truth)[0] / shared.photos[i].translation_std_units)
    assert 0.2 < np.sqrt(np.mean(np.square(ratios))) < 1.2  # noise alone, without a splat's own errors, is overstated


def test_pixels_that_were_square_stay_square():
    square = [solved_photo(seed, LENS, free=MODES["full"]) for seed in range(3)]
    k = _share(square).intrinsics
    assert k.fx == pytest.approx(k.fy, rel=1e-12)
