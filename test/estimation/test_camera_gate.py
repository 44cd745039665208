"""The gate of cameras: which of them it rejects, and that its distances are those of a fit without each."""

from dataclasses import replace

import numpy as np
import pytest
from helpers.moving_body import COVARIANCE, body_with_cameras, true_poses

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.body_state import SegmentPose
from bodycam_ros.estimation.camera_gate import gate_cameras
from bodycam_ros.estimation.coordinates import Coordinates
from bodycam_ros.estimation.factors.camera_poses import SegmentPoses
from bodycam_ros.estimation.factors.joint_rotations import SLIDES_M
from bodycam_ros.estimation.state_solution import Prediction
from bodycam_ros.geometry import exp_se3
from bodycam_ros.kinematics.tangent import TreeTangent
from bodycam_ros.kinematics.tree import all_motion

BODY = body_with_cameras()
TANGENT = TreeTangent(BODY, SLIDES_M)
CAMERAS = list(BODY.mounts)  # chest and back on the trunk, arm and wrist alone on their segments
SIGMA = 0.05  # [rad], [m] of the prediction


def prediction(speed: float = 0.0) -> Prediction:
    """A predicted state whose elbow turns at a speed [rad/s]."""
    poses = true_poses(BODY, 7)
    velocity = np.zeros(TANGENT.count)
    velocity[TANGENT.columns[BODY.joint_row["elbow"]]] = speed
    at = Coordinates(TANGENT, all_motion(poses[0], BODY.joint_poses(poses)), velocity)
    return Prediction(at, at, np.eye(2 * TANGENT.count) / SIGMA, 1.0 / 30.0)


def measured(off: dict[str, np.ndarray], body: BodyModel = BODY) -> SegmentPoses:
    """Registrations with noise, some of them off by a twist (6)."""
    rng, poses = np.random.default_rng(3), true_poses(body, 7)
    evidence = []
    for camera in CAMERAS:
        noise = np.sqrt(np.diag(COVARIANCE)) * rng.standard_normal(6)
        segment = body.mounts[camera].segment
        pose = poses[body.segment_index[segment]] @ exp_se3(noise + off.get(camera, np.zeros(6)))
        evidence.append(SegmentPose(segment, pose, COVARIANCE))
    return SegmentPoses.from_evidence(body, evidence)


def accepted(off: dict[str, np.ndarray], unobserved: np.ndarray | None = None, speed: float = 0.0) -> list[str]:
    nothing = np.zeros(TANGENT.count, bool)
    passes, _ = gate_cameras(prediction(speed), measured(off), nothing if unobserved is None else unobserved)
    return [camera for camera, each in zip(CAMERAS, passes, strict=True) if each]


def turned(rad: float) -> np.ndarray:
    return np.array([0.0, rad, 0.0, 0.0, 0.0, 0.0])


def shifted(metres: float) -> np.ndarray:
    return np.array([0.0, 0.0, 0.0, 0.0, 0.0, metres])


def test_cameras_that_agree_are_accepted() -> None:
    assert accepted({}) == CAMERAS


def test_a_small_slip_of_a_strap_is_borne() -> None:
    assert accepted({"back": shifted(0.02) + turned(0.06)}) == CAMERAS


@pytest.mark.parametrize("camera", CAMERAS)
@pytest.mark.parametrize("off", [shifted(0.6), turned(1.2)], ids=["shifted", "turned"])
def test_one_that_is_far_off_is_rejected_and_no_other(camera: str, off: np.ndarray) -> None:
    assert accepted({camera: off}) == [each for each in CAMERAS if each != camera]


def test_two_on_one_segment_are_told_apart_by_the_others() -> None:
    """The trunk's two cameras differ; arm and prediction show which of them is off."""
    assert "chest" in accepted({"back": shifted(0.5)})
    assert "back" in accepted({"chest": shifted(0.5)})


def test_a_limb_that_nothing_measured_may_be_elsewhere() -> None:
    """A camera that sees again after a while is no contradiction to a prediction of nothing."""
    forearm = np.zeros(TANGENT.count, bool)
    forearm[TANGENT.columns[BODY.joint_row["elbow"]]] = True
    axis = BODY.tree_joints[BODY.joint_row["elbow"]].axis
    off = {"wrist": np.append(1.0 * axis, np.zeros(3))}
    assert "wrist" not in accepted(off)
    assert "wrist" in accepted(off, forearm)


def test_a_limb_that_turns_fast_may_stop_at_once() -> None:
    """A foot that lands in a run: what a limb at rest may not do, one that turns at 30 rad/s may."""
    axis = BODY.tree_joints[BODY.joint_row["elbow"]].axis
    off = {"wrist": np.append(-0.6 * axis, np.zeros(3))}
    assert "wrist" not in accepted(off)
    assert "wrist" in accepted(off, speed=30.0)


def test_a_body_that_rides_fast_is_gated_as_one_at_rest() -> None:
    predicted = prediction()
    velocity = np.zeros(TANGENT.count)
    velocity[3:6] = 10.0
    predicted = replace(predicted, at=replace(predicted.at, velocity=velocity))
    observed = np.zeros(TANGENT.count, bool)
    passes, _ = gate_cameras(predicted, measured({"wrist": shifted(0.5)}), observed)
    assert [camera for camera, each in zip(CAMERAS, passes, strict=True) if not each] == ["wrist"]


def test_coordinates_are_those_without_the_rejected_camera() -> None:
    off = {"wrist": shifted(5.0)}
    nothing = np.zeros(TANGENT.count, bool)
    found, at = gate_cameras(prediction(), measured(off), nothing)
    all_cameras = measured(off)
    kept = SegmentPoses(all_cameras.segments[:3], all_cameras.world_T_segment[:3], all_cameras.covariances[:3])
    _, alone = gate_cameras(prediction(), kept, nothing)
    assert not found[3]
    # Both are linearised where their iterations ended.
    assert np.abs(at.step_to(alone)).max() < 2e-3
