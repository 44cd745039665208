"""The whole calibration on a body of which everything is known."""

from dataclasses import replace

import numpy as np
import pytest
from helpers.naming import naming
from helpers.range_of_motion import (
    STILL_S,
    joints_in_cameras,
    known_body,
    known_rig,
    range_of_motion,
    registrations,
    wide_cameras,
)

from bodycam_ros.body.body_model import BodyModel, CameraMount
from bodycam_ros.calibration.body_calibrator import BodyCalibrator, CalibratedBody
from bodycam_ros.errors import RangeOfMotionError
from bodycam_ros.geometry import exp_so3, rigid
from bodycam_ros.registration.landmark_matches import LandmarkMatches


def calibrated(body: BodyModel, matches, facing_rad: float | None = None) -> CalibratedBody:
    calibrator = BodyCalibrator(known_rig(body), wide_cameras(body.mounts), facing_rad=facing_rad)
    for one in matches:
        calibrator.add(one)
    return calibrator.solve()


def greatest_error(found: BodyModel, true: BodyModel) -> float:
    """The greatest error of a joint in a camera's frame [m]."""
    truth = joints_in_cameras(true)
    return max(float(np.linalg.norm(place - truth[key])) for key, place in joints_in_cameras(found).items())


@pytest.fixture(scope="module")
def exact() -> CalibratedBody:
    body = known_body()
    return calibrated(body, registrations(range_of_motion(body)))


def test_exact_images_give_the_exact_body(exact: CalibratedBody) -> None:
    body = known_body()
    assert greatest_error(exact.body, body) < 1e-7
    for joint in exact.body.joints:
        true = next(other for other in body.joints if other.name == joint.name)
        np.testing.assert_allclose(joint.parent_T_joint, true.parent_T_joint, atol=1e-7)
    for camera, mount in exact.body.mounts.items():
        np.testing.assert_allclose(mount.segment_T_camera, body.mounts[camera].segment_T_camera, atol=1e-7)


def test_noise_and_wrong_registrations_cost_millimetres_that_sigma_knows() -> None:
    body = known_body()
    motion = range_of_motion(body)
    found = calibrated(body, registrations(motion, pixel_noise=0.5, wrong_share=0.05))
    assert greatest_error(found.body, body) < 0.004
    true = {joint.name: joint.parent_T_joint[:3, 3] for joint in body.joints}
    for joint in found.diagnosis.joints:
        offset = next(j.parent_T_joint[:3, 3] for j in found.body.joints if j.name == joint.name)
        # Of the joints on the root only the differences are known as well as this: its origin is between two of them.
        if joint.parent != body.root:
            assert np.linalg.norm(offset - true[joint.name]) < 5.0 * np.linalg.norm(joint.sigma_m) + 0.001


def test_a_joint_held_still_is_named() -> None:
    held, body = "knee_left", known_body()
    with naming(RangeOfMotionError, held):
        calibrated(body, registrations(range_of_motion(body, held=[held])))


@pytest.mark.parametrize(
    ("slipping", "seconds", "turn", "shift", "error_m"),
    [
        ("chest", 5.0, [0.0, 0.12, 0.0], [0.03, 0.02, 0.0], 0.006),  # one of two on its segment
        ("foot_left", 9.0, [0.1, 0.0, 0.1], [0.02, -0.06, 0.05], 0.006),
        ("foot_left", 5.0, [0.1, 0.0, 0.1], [0.02, -0.06, 0.05], 0.006),
        ("forearm_left", 7.0, [0.0, 0.1, 0.1], [0.02, -0.02, 0.03], 0.015),
    ],
)
def test_a_slipped_strap_is_named_and_the_body_has_it_where_it_was_for_longest(
    slipping: str, seconds: float, turn: list[float], shift: list[float], error_m: float
) -> None:
    body = known_body()
    mount = body.mounts[slipping]
    slipped = mount.segment_T_camera @ rigid(exp_so3(np.array(turn)), np.array(shift))
    motion = range_of_motion(body, duration_s=12.0, slip=(slipping, seconds, slipped))
    found = calibrated(body, registrations(motion, pixel_noise=0.3))
    (diagnosis,) = (camera for camera in found.diagnosis.cameras if camera.slipped_s is not None)
    assert diagnosis.camera == slipping and diagnosis.slipped_s == pytest.approx(seconds, abs=0.3)
    assert f"{slipping} slipped" in diagnosis.warning and "repeat the recording" in diagnosis.warning
    now = replace(body, mounts={**body.mounts, slipping: CameraMount(mount.segment, slipped)})
    assert greatest_error(found.body, body if seconds > 6.0 else now) < error_m


def test_without_the_n_pose_there_is_no_body() -> None:
    body = known_body()
    motion = range_of_motion(body, duration_s=10.0)
    late = [one for one in registrations(motion) if one.stamp_ns > motion.stamps_ns[0] + 1_700_000_000]
    with naming(RangeOfMotionError, "N-pose"):
        calibrated(body, late)


def played_backwards_first(body: BodyModel, seconds: float) -> list[LandmarkMatches]:
    """A range of motion whose first seconds are played backwards before it: the N-pose is in its midst."""
    matches = list(registrations(range_of_motion(body)))
    start_ns, span_ns = matches[0].stamp_ns, round(1e9 * seconds)
    before = [
        replace(one, stamp_ns=2 * start_ns + span_ns - one.stamp_ns)
        for one in matches
        if start_ns < one.stamp_ns <= start_ns + span_ns
    ]
    return before[::-1] + [replace(one, stamp_ns=one.stamp_ns + span_ns) for one in matches]


def test_the_n_pose_is_found_in_the_midst_of_the_motion(exact: CalibratedBody) -> None:
    body = known_body()
    found = calibrated(body, played_backwards_first(body, 4.0))
    assert found.diagnosis.rest_s == pytest.approx((4.0 - STILL_S, 4.0 + STILL_S), abs=0.4)
    assert found.diagnosis.heading_rad == pytest.approx(exact.diagnosis.heading_rad, abs=0.003)
    assert greatest_error(found.body, body) < 0.0002


def test_the_n_pose_can_be_given(exact: CalibratedBody) -> None:
    body = known_body()
    calibrator = BodyCalibrator(known_rig(body), wide_cameras(body.mounts), rest_s=(4.0, 5.0))
    for one in played_backwards_first(body, 4.0):
        calibrator.add(one)
    found = calibrator.solve()
    assert found.diagnosis.rest_s == pytest.approx((4.0, 5.0), abs=0.1)
    for joint, true in zip(found.body.joints, exact.body.joints, strict=True):
        np.testing.assert_allclose(joint.parent_T_joint, true.parent_T_joint, atol=1e-6)
    calibrator = BodyCalibrator(known_rig(body), wide_cameras(body.mounts), rest_s=(40.0, 50.0))
    for one in registrations(range_of_motion(body)):
        calibrator.add(one)
    with pytest.raises(RangeOfMotionError, match=r"from 40 to 50 s.*part of 0.0 to 8.9 s"):
        calibrator.solve()


def test_sitting_still_for_longer_is_not_the_n_pose() -> None:
    body = known_body()
    matches = played_backwards_first(body, 4.0)
    # The body stops for 5 s in the midst of the motion, limbs bent, and goes on.
    at_ns = min(one.stamp_ns for one in matches) + 2_000_000_000
    halt = max(one.stamp_ns for one in matches if one.stamp_ns <= at_ns)
    pause_ns, step_ns = 5_000_000_000, 100_000_000
    paused = [
        replace(one, stamp_ns=halt + k * step_ns)
        for k in range(1, pause_ns // step_ns)
        for one in matches
        if one.stamp_ns == halt
    ]
    before = [one for one in matches if one.stamp_ns <= halt]
    after = [replace(one, stamp_ns=one.stamp_ns + pause_ns) for one in matches if one.stamp_ns > halt]
    found = calibrated(body, before + paused + after)
    assert found.diagnosis.rest_s == pytest.approx((9.0 - STILL_S, 9.0 + STILL_S), abs=0.4)


def test_a_camera_that_was_never_registered_is_named() -> None:
    body = known_body()
    matches = (
        replace(one, world_T_camera=None) if one.camera == "chest" else one
        for one in registrations(range_of_motion(body, duration_s=3.0))
    )
    with naming(RangeOfMotionError, "camera chest"):
        calibrated(body, matches)


def test_facing_turns_the_axes_alone() -> None:
    body = known_body()
    matches = list(registrations(range_of_motion(body)))
    found = calibrated(body, matches, facing_rad=0.7 + 0.3)
    hip = next(joint for joint in found.body.joints if joint.name == "hip_left").parent_T_joint[:3, 3]
    np.testing.assert_allclose(hip, exp_so3(np.array([0.0, 0.0, -0.3])) @ [0.0, 0.09, 0.0], atol=1e-6)
    assert greatest_error(found.body, body) < 1e-6
