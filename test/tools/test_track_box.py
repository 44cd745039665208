"""The comparison with silhouette ICP on a few frames: that each of the two is what the table says."""

from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from tools.silhouette_icp import SilhouetteIcp
from tools.track_box import (
    CAMERA,
    COLOURS,
    PHOTOGRAPHS,
    STEPS,
    box_surface,
    compare,
    follow,
    painted_frames,
    read_photograph,
    smooth_motion,
)

from bodycam_ros.outside.region_settings import RegionSettings

FRAMES = 20


@pytest.fixture(scope="module")
def motion() -> NDArray[np.float64]:
    return smooth_motion(FRAMES, 1)


def test_a_box_over_a_photograph_is_followed_by_its_regions(sample: Path, motion: NDArray[np.float64]) -> None:
    photograph = read_photograph(sample / "reference" / PHOTOGRAPHS[1], CAMERA)
    frames = list(painted_frames(box_surface(), COLOURS["box like the floor"], photograph, motion))
    for step, least in ((1, 1.0), (2, 0.8)):
        outcomes = compare(frames[::step], motion[::step], RegionSettings())
        regions, icp = outcomes["regions"], outcomes["silhouette ICP"]
        assert regions.rate >= max(least, icp.rate)
        assert np.median(regions.off_m) < 0.01 and np.median(regions.off_deg) < 1.5
        assert len(regions.success) == len(frames[::step]) - 1


def test_silhouette_icp_does_what_it_can(motion: NDArray[np.float64]) -> None:
    """Before a plain background, where nothing but the box has edges, it fails at nothing."""
    plain = np.full((CAMERA.height, CAMERA.width, 3), (90, 120, 160), np.uint8)
    frames = list(painted_frames(box_surface(), COLOURS["blue box"], plain, motion))
    icp = SilhouetteIcp(CAMERA, box_surface())
    outcome = follow(frames, motion, icp.look, lambda image, pose: None)
    assert outcome.rate == 1.0 and np.median(outcome.off_m) < 0.01


def test_who_does_nothing_fails_and_starts_again_at_the_truth(motion: NDArray[np.float64]) -> None:
    """Where a box moves by 16 degrees from frame to frame; so the rate counts what it says."""
    starts: list[NDArray[np.float64]] = []
    slow = motion[:: STEPS[-1]]
    images = [np.zeros((1, 1, 3), np.uint8)] * len(slow)
    outcome = follow(images, slow, lambda image, before: before, lambda image, pose: starts.append(pose))
    assert outcome.rate < 0.5
    failed = np.flatnonzero(~outcome.success) + 1
    np.testing.assert_array_equal(starts, slow[[0, *failed]])


def test_the_box_stays_in_sight() -> None:
    for seed in range(len(PHOTOGRAPHS)):
        centres = smooth_motion(200, seed)[:, :3, 3]
        pixels, valid = CAMERA.project(centres)
        assert valid.all() and CAMERA.in_image(pixels).all()
