"""How a bicycle goes on by itself: its crank at its speed, its pedals on the crank."""

from dataclasses import replace

import numpy as np
import pytest
from athletes import RATE_HZ, bicycle, cyclist

from bodycam_ros.equipment.equipment import Equipment
from bodycam_ros.geometry import Array, exp_se3, inverse, log_so3
from bodycam_ros.solving.equipment_motion import EquipmentMotion
from bodycam_ros.solving.motion import MotionSettings

SETTINGS = MotionSettings()
CADENCE_RPM = 80.0
SPEED = 2.0 * np.pi * CADENCE_RPM / 60.0
DT_S = 1.0 / RATE_HZ
FRAME, CRANK, LEFT, RIGHT = range(4)
FEET = frozenset({"on_pedal_left", "on_pedal_right"})


def motion_of(equipment: Equipment, speed_time: float = 0.06) -> EquipmentMotion:
    return EquipmentMotion(equipment, equipment.joints, SETTINGS, speed_time)


def turned(before: Array, after: Array) -> float:
    """By how much the crank (4, 4) turned about its axle [rad]."""
    return float(log_so3(before[:3, :3].T @ after[:3, :3])[1])


@pytest.fixture
def ridden() -> Array:
    """(T, E, 4, 4)"""
    return cyclist(1.0, CADENCE_RPM).equipment_poses


@pytest.fixture
def coasting(ridden: Array) -> EquipmentMotion:
    """A bicycle whose rider was seen to pedal until the last instant."""
    motion = motion_of(bicycle())
    for before, latest in zip(ridden[:-1], ridden[1:], strict=True):
        motion.learn_speeds(latest, before, DT_S, lambda attachments: True)
    return motion


def test_who_is_asked_is_whoever_holds_the_segment_or_what_hangs_on_it() -> None:
    motion = motion_of(bicycle())
    assert motion.held_below("crank") == FEET
    assert motion.held_below("pedal_left") == {"on_pedal_left"}
    assert motion.held_below("frame") == {a.name for a in bicycle().attachments}
    assert motion.keeping_joints == {"crank_axle"}
    assert motion.keeping.tolist() == [False, True, False, False]


def test_while_nobody_drives_it_the_crank_keeps_its_speed(ridden: Array, coasting: EquipmentMotion) -> None:
    poses = ridden[-1]
    for _ in range(30):
        # By itself each segment would stay where it is.
        ahead = coasting.predict(poses, poses, bicycle().joints, DT_S)
        assert turned(poses[CRANK], ahead[CRANK]) == pytest.approx(SPEED * DT_S, rel=1e-3)
        # Nobody sees what it does, and guesses of legs are no news of its speed.
        guessed = ahead.copy()
        guessed[CRANK] = poses[CRANK]
        coasting.learn_speeds(guessed, poses, DT_S, lambda attachments: False)
        poses = ahead


def test_a_rider_who_is_seen_to_stop_stops_it(ridden: Array, coasting: EquipmentMotion) -> None:
    stopped = ridden[-1]
    for _ in range(15):
        coasting.learn_speeds(stopped, stopped, DT_S, lambda attachments: attachments >= {"on_pedal_left"})
    ahead = coasting.predict(stopped, stopped, bicycle().joints, DT_S)
    assert abs(turned(stopped[CRANK], ahead[CRANK])) < 0.01 * SPEED * DT_S


def test_the_speed_is_a_mean_over_some_time(ridden: Array) -> None:
    for speed_time in (0.01, 0.3):
        motion = motion_of(bicycle(), speed_time)
        motion.learn_speeds(ridden[1], ridden[0], DT_S, lambda attachments: True)
        motion.learn_speeds(ridden[1], ridden[1], DT_S, lambda attachments: True)
        ahead = motion.predict(ridden[1], ridden[1], bicycle().joints, DT_S)
        left = np.exp(-DT_S / speed_time)
        assert turned(ridden[1, CRANK], ahead[CRANK]) == pytest.approx(left * SPEED * DT_S, rel=1e-6)


def test_once_forgotten_it_goes_where_its_prediction_goes(ridden: Array, coasting: EquipmentMotion) -> None:
    coasting.forget()
    ahead = coasting.predict(ridden[5], ridden[4], bicycle().joints, DT_S)
    np.testing.assert_allclose(ahead, ridden[5], atol=1e-9)


def test_a_prediction_has_no_open_joint(ridden: Array, coasting: EquipmentMotion) -> None:
    joints = bicycle().joints
    torn = ridden[-1] @ exp_se3(np.random.default_rng(0).normal(0.0, 0.1, (4, 6)))
    for motion in (coasting, motion_of(bicycle())):
        given = torn.copy()
        closed = motion.predict(torn, ridden[-1], joints, DT_S)
        np.testing.assert_array_equal(torn, given)
        np.testing.assert_array_equal(closed[FRAME], torn[FRAME])
        for joint, (parent, child) in zip(joints, ((FRAME, CRANK), (CRANK, LEFT), (CRANK, RIGHT)), strict=True):
            between = inverse(closed[parent]) @ closed[child]
            np.testing.assert_allclose(joint.measured_relative_pose(between), between, atol=1e-9)


def test_it_goes_on_past_half_a_turn() -> None:
    """An angle that jumps from 180 to -180 deg is no speed."""
    ridden = cyclist(2.0, CADENCE_RPM).equipment_poses
    motion = motion_of(bicycle())
    for before, latest in zip(ridden[:-1], ridden[1:], strict=True):
        motion.learn_speeds(latest, before, DT_S, lambda attachments: True)
        ahead = motion.predict(latest, latest, bicycle().joints, DT_S)
        assert turned(latest[CRANK], ahead[CRANK]) == pytest.approx(SPEED * DT_S, rel=1e-6)


def test_segments_change_their_motion_as_their_file_says() -> None:
    bike = bicycle()
    segments = {
        **bike.segments,
        "crank": replace(bike.segments["crank"], angular_acceleration_sigma=30.0),
        "pedal_left": replace(bike.segments["pedal_left"], acceleration_sigma=2.5),
    }
    motion = motion_of(replace(bike, segments=segments))
    usual = [SETTINGS.angular_acceleration_sigma] * 3 + [SETTINGS.acceleration_sigma] * 3
    driven = motion.accelerations(lambda attachments: True)
    np.testing.assert_allclose(driven[FRAME], usual)
    np.testing.assert_allclose(driven[CRANK], [30.0] * 3 + usual[3:])
    np.testing.assert_allclose(driven[LEFT], usual[:3] + [2.5] * 3)
    coasting = motion.accelerations(lambda attachments: not attachments & FEET)
    # Limbs that are guessed must not drive it.
    assert (coasting[CRANK, :3] < 0.5 * driven[CRANK, :3]).all()
    np.testing.assert_allclose(np.delete(coasting, CRANK, axis=0), np.delete(driven, CRANK, axis=0))
    np.testing.assert_allclose(motion.sigmas(0.1, 0.3, lambda attachments: True), driven * 0.5 * 0.1 * 0.4)
