"""Standing feet: they do not slide, seen or not, and are let go when they leave the floor."""

from dataclasses import replace

import numpy as np
import pytest
from standing_leg import BALL, FLAT, FRAMES, ROLLS, STEP_NS, SWINGS, ball_of, frame_of, leg, true_poses

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.camera import CameraModel, camera_from_info
from bodycam_ros.errors import BodyError
from bodycam_ros.estimation.contact import ContactSettings, FootContacts
from bodycam_ros.estimation.estimator import BodyEstimator
from bodycam_ros.geometry import Array, exp_so3, rigid

OFF = ContactSettings(enabled=False)
ALL, SHIN_ALONE = ("shin", "foot"), ("shin",)


@pytest.fixture(scope="module")
def body() -> BodyModel:
    return leg()


def lenses(body: BodyModel) -> dict[str, CameraModel]:
    k = [240.0, 0, 320.0, 0, 240.0, 240.0, 0, 0, 1]
    return {name: camera_from_info(name, 640, 480, "equidistant", [0.0] * 4, k) for name in body.mounts}


def solved(
    body: BodyModel,
    settings: ContactSettings,
    cameras: tuple[str, ...] = ALL,
    seed: int = 0,
    floor: float = 0.0,
) -> Array:
    """Poses (FRAMES, 2, 4, 4)."""
    rng = np.random.default_rng(seed)
    smoother = BodyEstimator(body, lenses(body), contacts=FootContacts(body, settings))
    states = []
    for frame in range(FRAMES):
        states += smoother.update(frame_of(body, frame, rng, cameras, floor))
    states += smoother.flush()
    return np.array([state.world_T_segment for state in states])


def truth(floor: float = 0.0) -> Array:
    return np.array([true_poses(frame, floor) for frame in range(FRAMES)])


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


def test_a_body_without_feet_has_nothing_that_stands(body: BodyModel) -> None:
    feet = ContactSettings(segments="foot_right")
    assert np.array_equal(solved(body, OFF), solved(body, feet))


@pytest.mark.parametrize("name", ["foot_lef", "shin_left"])
def test_what_cannot_stand_is_named(body: BodyModel, name: str) -> None:
    with pytest.raises(BodyError, match=rf"contact\.segments: '?{name}'? is no foot of body leg.*: foot_left"):
        FootContacts(body, ContactSettings(segments=f"foot_left {name}"))


def foot(pitch: float, x: float, height: float = 0.0) -> Array:
    """Pose of a foot whose ball is at a place over the floor."""
    R = exp_so3(np.array([0.0, pitch, 0.0]))
    return rigid(R, np.array([x, 0.0, height]) - R @ BALL)


@pytest.mark.parametrize("levels", [(-0.5, -0.3), (0.0, -0.4, 0.0), (0.0, 0.17, 0.34)])
def test_feet_stand_on_steps_down_and_up(body: BodyModel, levels: tuple[float, ...]) -> None:
    rng = np.random.default_rng(0)
    contacts = FootContacts(body, ContactSettings())
    smoother = BodyEstimator(body, lenses(body), contacts=contacts)
    for number, floor in enumerate(levels):
        later_ns = number * FRAMES * STEP_NS
        for frame in FLAT:
            said = frame_of(body, frame, rng, ALL, floor)
            later = {c: replace(m, stamp_ns=m.stamp_ns + later_ns) for c, m in said.matches.items()}
            smoother.update(replace(said, stamp_ns=said.stamp_ns + later_ns, matches=later))
        assert [point.rests for point in contacts.points] == [True, True], floor
