"""A body that turns and goes, of which a solver speaks late and a station knows one side."""

import numpy as np
import pytest
from numpy.typing import NDArray

from bodycam_ros.geometry import exp_se3, inverse, log_se3
from bodycam_ros.outside.carried_body import CarriedBody
from bodycam_ros.solving.body_now import BodyNow
from bodycam_ros.solving.motion import MotionSettings

Array = NDArray[np.float64]

STEP_NS = 33_333_333
VELOCITY = np.array([[0.5, 0.0, 2.0, 0.0, 0.2, -0.3], [0.0, 0.0, -3.0, 0.0, 0.5, 0.4]])
OFF = np.array([0.0, 0.05, 0.0, 0.2, 0.0, 0.0])
"""Of a station that does not see how far away things are, nor how they turn about one axis."""


def truth(instant: float) -> Array:
    """(2, 4, 4) at constant velocity."""
    return exp_se3(1e-9 * STEP_NS * instant * VELOCITY)


def said(instant: int) -> BodyNow:
    return BodyNow(instant * STEP_NS, truth(instant), np.tile(np.eye(6), (2, 1, 1)), np.ones(2, bool))


def off(poses: Array, instant: float) -> float:
    return float(np.abs(log_se3(inverse(truth(instant)) @ poses)).max())


@pytest.fixture
def carried() -> CarriedBody:
    return CarriedBody(MotionSettings(velocity_time=60.0))  # hardly fades


def test_nothing_is_known_at_first(carried: CarriedBody) -> None:
    assert carried.at(STEP_NS) is None
    carried.hear(said(5))
    assert carried.at(4 * STEP_NS) is None, "of a later time"
    poses, ahead_s = carried.at(6 * STEP_NS)
    np.testing.assert_array_equal(poses, truth(5))
    assert ahead_s == pytest.approx(1e-9 * STEP_NS)


@pytest.mark.parametrize("late", [1, 2, 4])
def test_it_goes_on_at_the_velocity_that_was_heard(carried: CarriedBody, late: int) -> None:
    carried.hear(said(0))
    carried.hear(said(1))
    assert off(carried.at((1 + late) * STEP_NS)[0], 1 + late) < 2e-3


@pytest.mark.parametrize("late", [1, 2, 4])
def test_a_station_that_errs_in_depth_does_not_carry_it_on(carried: CarriedBody, late: int) -> None:
    """It begins 20 cm and 3 degrees off, and mends only what it sees; what the solver says mends most of the rest."""
    carried.find(0, truth(0) @ exp_se3(OFF))
    for instant in range(1, 12):
        if instant > late:
            carried.hear(said(instant - 1 - late))
        expected, ahead_s = carried.at(instant * STEP_NS)
        assert ahead_s == pytest.approx(1e-9 * STEP_NS)
        assert off(expected, instant) > 0.15 if instant <= late else off(expected, instant) < 0.1, instant
        unseen = np.where(OFF != 0.0, log_se3(inverse(truth(instant)) @ expected), 0.0)
        carried.find(instant * STEP_NS, truth(instant) @ exp_se3(unseen))


def test_without_a_solver_it_follows_what_the_station_sees(carried: CarriedBody) -> None:
    for instant in range(3):
        carried.find(instant * STEP_NS, truth(instant) @ exp_se3(OFF))
    assert off(carried.at(3 * STEP_NS)[0] @ exp_se3(-OFF), 3) < 0.02


def test_a_solver_that_speaks_between_the_images(carried: CarriedBody) -> None:
    for instant in range(4):
        carried.find(instant * STEP_NS, truth(instant))
    carried.hear(BodyNow(round(1.5 * STEP_NS), truth(1.5), np.tile(np.eye(6), (2, 1, 1)), np.ones(2, bool)))
    assert off(carried.at(4 * STEP_NS)[0], 4) < 2e-3


def test_after_a_long_pause_it_is_where_it_was(carried: CarriedBody) -> None:
    carried.hear(said(0))
    carried.hear(said(1))
    poses, ahead_s = carried.at(60 * STEP_NS)
    np.testing.assert_array_equal(poses, truth(1))
    assert ahead_s == 0.5


def test_when_time_begins_anew_what_was_said_is_forgotten(carried: CarriedBody) -> None:
    for instant in (5, 6, 2):
        carried.hear(said(instant))
    assert carried.heard_by(10 * STEP_NS).stamp_ns == 2 * STEP_NS
    assert carried.heard_by(STEP_NS) is None
