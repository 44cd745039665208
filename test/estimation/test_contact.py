"""Standing feet: they do not slide, seen or not, and are let go when they leave the floor."""

import numpy as np
import pytest
from helpers.standing_leg import FRAMES, ROLLS, SWINGS, ball_of, frame_of, leg, true_poses

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.camera import CameraModel, camera_from_info
from bodycam_ros.estimation.contact import ContactSettings
from bodycam_ros.estimation.estimator import BodyEstimator
from bodycam_ros.geometry import Array

OFF = ContactSettings(enabled=False)


@pytest.fixture(scope="module")
def body() -> BodyModel:
    return leg()


def lenses(body: BodyModel) -> dict[str, CameraModel]:
    k = [240.0, 0, 320.0, 0, 240.0, 240.0, 0, 0, 1]
    return {name: camera_from_info(name, 640, 480, "equidistant", [0.0] * 4, k) for name in body.mounts}


def solved(body: BodyModel, settings: ContactSettings, seed: int = 0) -> Array:
    """Poses (FRAMES, 2, 4, 4)."""
    rng = np.random.default_rng(seed)
    estimator = BodyEstimator(body, lenses(body), contact=settings)
    states = []
    for frame in range(FRAMES):
        states += estimator.update(frame_of(body, frame, rng))
    states += estimator.flush()
    return np.array([state.world_T_segment for state in states])


def truth() -> Array:
    return np.array([true_poses(frame) for frame in range(FRAMES)])


def sliding_mm(poses: Array) -> float:
    """How far the ball goes while the foot is flat, or rolls over it: mean distance from its mean place."""
    stance = ball_of(poses)[5 : ROLLS.stop]
    return float(1000.0 * np.linalg.norm((stance - stance.mean(axis=0))[:, :2], axis=1).mean())


def way_mm(poses: Array) -> float:
    """The length of its way."""
    return float(1000.0 * np.linalg.norm(np.diff(ball_of(poses)[5 : ROLLS.stop], axis=0), axis=1).sum())


def place_errors(poses: Array) -> Array:
    """(FRAMES, 2) distances [m] of shin and foot from the truth."""
    return np.asarray(np.linalg.norm((poses - truth())[:, :, :3, 3], axis=2))


def test_a_foot_that_is_seen_trembles_less_and_is_no_worse(body: BodyModel) -> None:
    for seed in range(3):
        free, held = (solved(body, s, seed=seed) for s in (OFF, ContactSettings()))
        assert way_mm(held) < 0.8 * way_mm(free)
        assert sliding_mm(held) < sliding_mm(free) < 1.0
        assert place_errors(held).mean() < 1.02 * place_errors(free).mean()


def test_a_foot_that_swings_is_free(body: BodyModel) -> None:
    free, held = (solved(body, settings) for settings in (OFF, ContactSettings()))
    swings = slice(SWINGS[1], SWINGS[-1])
    assert place_errors(held)[swings].max() < 1.1 * place_errors(free)[swings].max()
