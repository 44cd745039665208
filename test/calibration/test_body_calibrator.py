"""The whole calibration on a body of which everything is known."""

from dataclasses import replace

import numpy as np
import pytest
from range_of_motion import (
    HINGES,
    STILL_S,
    hinge_axis,
    joints_in_cameras,
    known_body,
    known_rig,
    range_of_motion,
    registrations,
    wide_cameras,
)

from bodycam_ros.body.body_model import BodyModel, CameraMount
from bodycam_ros.calibration.body_calibrator import BodyCalibrator, CalibratedBody
from bodycam_ros.calibration.calibration_settings import CalibrationSettings
from bodycam_ros.calibration.joint_limits import JointLimitSettings
from bodycam_ros.calibration.rig import Rig
from bodycam_ros.errors import BodyError, MapError, RangeOfMotionError
from bodycam_ros.geometry import exp_so3, rigid


def calibrated(body: BodyModel, matches, facing_rad: float | None = None) -> CalibratedBody:
    calibrator = BodyCalibrator(known_rig(body), wide_cameras(body.mounts), facing_rad=facing_rad)
    for one in matches:
        calibrator.add(one)
    return calibrator.solve()


def greatest_error(found: BodyModel, true: BodyModel) -> float:
    """Of a joint in a camera's frame [m]."""
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


def test_the_diagnosis_says_what_was_done(exact: CalibratedBody) -> None:
    diagnosis = exact.diagnosis
    assert diagnosis.heading_rad == pytest.approx(0.7, abs=1e-6)
    assert diagnosis.rest_s[1] == pytest.approx(STILL_S, abs=0.3)
    assert {joint.name for joint in diagnosis.joints if joint.freedom == "hinge"} == set(HINGES)
    for joint in diagnosis.joints:
        if joint.axis is not None:
            np.testing.assert_allclose(joint.axis, hinge_axis(joint.name), atol=1e-6)
    knee = next(joint for joint in diagnosis.joints if joint.name == "knee_left")
    assert knee.placed_by == "collinearity"
    assert knee.exercised_rad[0] == pytest.approx(1.6, abs=0.1)
    assert np.abs(knee.exercised_rad[1:]).max() < 1e-6
    assert next(joint for joint in diagnosis.joints if joint.name == "elbow_left").placed_by == "vertical"
    thigh = next(bone for bone in diagnosis.bones if bone.segment == "thigh_left")
    assert thigh.length_m == pytest.approx(0.42, abs=1e-7)
    assert not any(camera.warning for camera in diagnosis.cameras)


def test_joint_limits_are_the_range_that_was_exercised(exact: CalibratedBody) -> None:
    knee = next(joint for joint in exact.body.joints if joint.name == "knee_left")
    assert knee.limits is not None
    low, high = knee.limits[0]  # yzx: about y first, as the knee bends
    assert -0.2 < low < 0.0
    assert 1.6 < high < 1.8


def test_hinges_are_held_on_request() -> None:
    body = known_body()
    settings = CalibrationSettings(joint_limits=JointLimitSettings(hold_hinges=True))
    calibrator = BodyCalibrator(known_rig(body), wide_cameras(body.mounts), settings)
    for one in registrations(range_of_motion(body)):
        calibrator.add(one)
    joints = {joint.name: joint for joint in calibrator.solve().body.joints}
    assert {name for name, joint in joints.items() if joint.type == "hinge"} == set(HINGES)
    knee = joints["knee_left"]
    np.testing.assert_allclose(knee.axis, hinge_axis("knee_left"), atol=1e-6)
    assert knee.limits is not None and knee.limits[0][1] == pytest.approx(1.6 + JointLimitSettings().margin, 0.05)


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
    assert found.diagnosis.refinement is not None
    assert found.diagnosis.refinement.after_px < found.diagnosis.refinement.before_px


def test_refinement_brings_joints_nearer_to_the_truth(monkeypatch: pytest.MonkeyPatch) -> None:
    body = known_body()
    matches = list(registrations(range_of_motion(body), pixel_noise=0.5, map_noise=0.02))
    refined = calibrated(body, matches).body
    import bodycam_ros.calibration.body_calibrator as module

    def unrefined(motion, poses, images, trust, limbs, settings, clock, on_progress):
        settings = replace(settings, pose_iterations=1, image_iterations=0)
        found = module_refine(motion, poses, images, trust, limbs, settings, clock, on_progress)
        return replace(found, motion=motion)

    module_refine = module.refine
    monkeypatch.setattr(module, "refine", unrefined)
    first = calibrated(body, matches).body
    truth = joints_in_cameras(body)

    def mean_error(found: BodyModel) -> float:
        return float(np.mean([np.linalg.norm(p - truth[k]) for k, p in joints_in_cameras(found).items()]))

    assert mean_error(refined) < 0.5 * mean_error(first)


@pytest.mark.parametrize("sigma", [0.0003, 0.006])
def test_what_the_cameras_learnt_of_their_rows_is_kept_and_named_where_it_is_little(sigma: float) -> None:
    body = known_body()
    matches = registrations(range_of_motion(body, rate_hz=10.0))
    found = calibrated(body, (replace(one, readout_time=0.012, readout_sigma=sigma) for one in matches))
    for camera, mount in found.body.mounts.items():
        assert mount.readout is not None and mount.readout.seconds == pytest.approx(0.012)
        assert 0.1 * sigma < mount.readout.sigma < sigma, camera
    assert {camera.readout for camera in found.diagnosis.cameras} == {m.readout for m in found.body.mounts.values()}
    named = [camera.camera for camera in found.diagnosis.cameras if "how long its rows are read out" in camera.warning]
    assert named == ([] if sigma < 0.001 else list(body.mounts))


@pytest.mark.parametrize("held", ["hip_left", "knee_left", "spine"])
def test_a_joint_held_still_is_named(held: str) -> None:
    body = known_body()
    with pytest.raises(RangeOfMotionError, match=f"joint {held} was held still"):
        calibrated(body, registrations(range_of_motion(body, held=[held])))


def test_every_joint_held_still_is_named_at_once() -> None:
    body = known_body()
    with pytest.raises(RangeOfMotionError) as caught:
        calibrated(body, registrations(range_of_motion(body, held=["hip_left", "ankle_left"])))
    assert "hip_left" in str(caught.value)
    assert "circle the left foot" in str(caught.value)


@pytest.mark.parametrize("slipping", ["waist_left", "chest"])  # one of three, and one of two
def test_a_slipped_strap_is_named_and_left_out(slipping: str) -> None:
    body = known_body()
    mount = body.mounts[slipping]
    slipped = mount.segment_T_camera @ rigid(exp_so3(np.array([0.0, 0.12, 0.0])), np.array([0.03, 0.02, 0.0]))
    motion = range_of_motion(body, slip=(slipping, 5.0, slipped))
    found = calibrated(body, registrations(motion, pixel_noise=0.3))
    diagnosis = next(camera for camera in found.diagnosis.cameras if camera.camera == slipping)
    assert diagnosis.slipped_s == pytest.approx(5.0, abs=0.3)
    assert f"{slipping} slipped" in diagnosis.warning
    assert sum(camera.slipped_s is not None for camera in found.diagnosis.cameras) == 1
    now = replace(body, mounts={**body.mounts, slipping: CameraMount(mount.segment, slipped)})
    assert greatest_error(found.body, now) < 0.006


@pytest.mark.parametrize("slipping", ["thigh_left", "foot_left"])  # with joints on both ends, and on one
def test_a_camera_alone_on_its_segment_that_slips_is_named(slipping: str) -> None:
    body = known_body()
    mount = body.mounts[slipping]
    slipped = mount.segment_T_camera @ rigid(exp_so3(np.array([0.1, 0.0, 0.1])), np.array([0.02, -0.06, 0.05]))
    motion = range_of_motion(body, duration_s=12.0, slip=(slipping, 9.0, slipped))
    found = calibrated(body, registrations(motion, pixel_noise=0.3))
    diagnosis = {camera.camera: camera for camera in found.diagnosis.cameras}
    assert diagnosis[slipping].slipped_s == pytest.approx(9.0, abs=0.3)
    assert "repeat the recording" in diagnosis[slipping].warning
    assert sum(camera.slipped_s is not None for camera in found.diagnosis.cameras) == 1
    assert greatest_error(found.body, body) < 0.006


def test_without_the_n_pose_there_is_no_body() -> None:
    body = known_body()
    motion = range_of_motion(body, duration_s=10.0)
    late = [one for one in registrations(motion) if one.stamp_ns > motion.stamps_ns[0] + 1_700_000_000]
    with pytest.raises(RangeOfMotionError, match="does not begin with the N-pose"):
        calibrated(body, late)


def test_a_camera_that_was_never_registered_is_named() -> None:
    body = known_body()
    matches = (
        replace(one, world_T_camera=None) if one.camera == "chest" else one
        for one in registrations(range_of_motion(body, duration_s=3.0))
    )
    with pytest.raises(RangeOfMotionError, match="camera chest"):
        calibrated(body, matches)


def test_a_camera_of_the_rig_that_is_not_recorded_is_named() -> None:
    body = known_body()
    cameras = wide_cameras(set(body.mounts) - {"chest"})
    with pytest.raises(BodyError, match="chest"):
        BodyCalibrator(known_rig(body), cameras)


def test_a_rig_of_one_segment_has_no_joint() -> None:
    body = known_body()
    rig = Rig({"waist_front": "pelvis"}, {"pelvis": None})
    calibrator = BodyCalibrator(rig, wide_cameras(body.mounts))
    for one in registrations(range_of_motion(body, duration_s=2.0)):
        calibrator.add(one)
    with pytest.raises(RangeOfMotionError, match="cameras on two segments"):
        calibrator.solve()


def test_a_recording_that_is_too_short_is_refused_with_what_is_needed() -> None:
    body = known_body()
    with pytest.raises(RangeOfMotionError, match="instants only"):
        calibrated(body, registrations(range_of_motion(body, duration_s=1.0)))


def test_cameras_that_take_their_images_at_different_times() -> None:
    """Each camera is shifted by some milliseconds, as cameras are that nothing triggers together."""
    body = known_body()
    motions = {
        camera: range_of_motion(body, rate_hz=30.0, delay_s=0.004 * number) for number, camera in enumerate(body.mounts)
    }
    matches = [one for camera, motion in motions.items() for one in registrations(motion, only=[camera])]
    found = calibrated(body, sorted(matches, key=lambda one: one.stamp_ns))
    assert greatest_error(found.body, body) < 0.003


def test_facing_turns_the_axes_alone() -> None:
    body = known_body()
    matches = list(registrations(range_of_motion(body)))
    found = calibrated(body, matches, facing_rad=0.7 + 0.3)
    hip = next(joint for joint in found.body.joints if joint.name == "hip_left").parent_T_joint[:3, 3]
    np.testing.assert_allclose(hip, exp_so3(np.array([0.0, 0.0, -0.3])) @ [0.0, 0.09, 0.0], atol=1e-6)
    assert greatest_error(found.body, body) < 1e-6


def in_map_of_scale(matches, scale: float):
    """The registrations in a map whose lengths are this many times the true ones."""
    for one in matches:
        pose = one.world_T_camera.copy()
        pose[:3, 3] *= scale
        blown_up = np.diag(np.repeat([1.0, scale], 3))
        yield replace(
            one,
            points_world=scale * one.points_world,
            world_T_camera=pose,
            pose_covariance=blown_up @ one.pose_covariance @ blown_up,
        )


@pytest.mark.parametrize("scale", [10.0, 0.1])
def test_a_map_of_another_scale_is_named_before_any_joint_is_blamed(scale: float) -> None:
    body = known_body()
    matches = in_map_of_scale(registrations(range_of_motion(body)), scale)
    with pytest.raises(MapError, match=r"scale looks wrong by a factor of about [0-9.]+ .*tag size in board.yaml"):
        calibrated(body, matches)


def test_an_odd_scale_is_the_first_warning() -> None:
    body = known_body()
    found = calibrated(body, in_map_of_scale(registrations(range_of_motion(body, duration_s=5.0, rate_hz=12.0)), 1.5))
    assert "by a factor of about 1.5 (too large)" in found.diagnosis.warnings[0]
