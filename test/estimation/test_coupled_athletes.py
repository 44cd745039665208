"""Athletes solved with and without what they ride, stand on or lift: what the coupling is for (B 4)."""

import numpy as np
import pytest
from helpers.athlete_frames import JUMPING, LEGS, Sight, boot_from_its_binding, leg_errors, solved
from helpers.athletes import BODY, Athlete, cyclist, lifter, snowboarder

pytestmark = pytest.mark.long

TURNS, CADENCE_RPM = 3.0, 80.0
THREE_TURNS_S = 60.0 * TURNS / CADENCE_RPM


@pytest.fixture(scope="module")
def rider() -> Athlete:
    return snowboarder(3.0)


def test_the_second_boot_stays_in_its_binding_through_jump_and_turn(rider: Athlete) -> None:
    free = solved(rider, JUMPING)
    bound = solved(rider, JUMPING, rider.equipment)
    # B figure 12. Without the board the left boot alone says where it is, as it does in the paper.
    assert boot_from_its_binding(free).max() > 0.03
    assert boot_from_its_binding(bound).mean() < 0.005
    assert boot_from_its_binding(bound).max() < 0.015
    for name in ("binding_left", "binding_right"):
        assert bound.attachment_gaps(name).max() < 0.005
    # Nobody else pays for it.
    assert bound.position_errors.mean() < free.position_errors.mean() + 1e-4
    foot = BODY.segment_index["foot_right"]
    toes = [
        np.linalg.norm(((done.poses - rider.poses)[:, foot] @ [0.2, 0.0, 0.0, 1.0])[:, :3], axis=1)
        for done in (free, bound)
    ]
    assert toes[1].max() < 0.5 * toes[0].max()


@pytest.fixture(scope="module")
def rides() -> Athlete:
    return cyclist(THREE_TURNS_S + 0.1, CADENCE_RPM)


def test_half_of_the_leg_cameras_are_enough_on_a_bicycle(rides: Athlete) -> None:
    half = Sight(blind=("thigh_left", "foot_left", "shin_right"))
    errors = leg_errors(solved(rides, half, rides.equipment))
    assert errors.mean() < 0.01
    assert errors.mean() < leg_errors(solved(rides, half)).mean()


def test_legs_that_no_camera_sees_any_more_go_on_with_the_crank(rides: Athlete) -> None:
    # B figure 9: stable at first, and without the constraint soon no more.
    from_then = 1.2
    gone = Sight(dark={camera: ((from_then, np.inf),) for camera in LEGS})
    unseen = rides.times > from_then
    bound, free = (leg_errors(solved(rides, gone, equipment))[unseen] for equipment in (rides.equipment, None))
    assert bound.mean() < 0.04
    assert bound.mean() < 0.5 * free.mean()


def test_hands_that_no_camera_sees_stay_on_a_bar_that_may_roll() -> None:
    # All points on the bar lie on its axis, so nobody knows how it is turned about itself; nor need anybody.
    squat = lifter(2.0)
    arms = ("upper_arm_left", "forearm_left", "upper_arm_right", "forearm_right")
    dark = Sight(dark={camera: ((0.5, np.inf),) for camera in arms})
    free, bound = (solved(squat, dark, equipment) for equipment in (None, squat.equipment))
    for name in ("grip_left", "grip_right"):
        assert free.attachment_gaps(name, true_equipment=True).max() > 0.1
        assert bound.attachment_gaps(name, true_equipment=True).mean() < 0.03
    assert bound.position_errors.mean() < 0.5 * free.position_errors.mean()
