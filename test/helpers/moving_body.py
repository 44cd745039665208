"""A small body with cameras whose motion is known, and registrations of its cameras."""

import dataclasses

import numpy as np

from bodycam_ros.body.body_model import BodyModel, CameraMount
from bodycam_ros.body_state import BodyFrame, BodyState
from bodycam_ros.camera import CameraModel, camera_from_info
from bodycam_ros.geometry import exp_se3, exp_so3, rigid
from bodycam_ros.kinematics.joint import Joint
from bodycam_ros.registration.landmark_matches import LandmarkMatches

STEP_NS = 33_333_333
COVARIANCE = np.diag(np.repeat([0.002, 0.004], 3) ** 2)


def body_with_cameras() -> BodyModel:
    """A trunk, an upper arm on a ball joint, a forearm on a hinge, a camera on each and a second one on the trunk."""
    shoulder = Joint("shoulder", "trunk", "upper_arm", "ball", rigid(np.eye(3), np.array([0.0, 0.2, 0.4])))
    elbow = Joint("elbow", "upper_arm", "forearm", "hinge", rigid(np.eye(3), np.array([0.0, 0.0, -0.28])))
    places = {"chest": "trunk", "back": "trunk", "arm": "upper_arm", "wrist": "forearm"}
    mounts = {
        camera: CameraMount(segment, exp_se3(np.array([0.3 * k, 1.0, -0.5 * k, 0.05, 0.1, -0.1 * k])))
        for k, (camera, segment) in enumerate(places.items())
    }
    return BodyModel("test", "trunk", ("trunk", "upper_arm", "forearm"), (shoulder, elbow), mounts)


def lenses(body: BodyModel) -> dict[str, CameraModel]:
    """One lens for all."""
    k = [240.0, 0, 320.0, 0, 240.0, 240.0, 0, 0, 1]
    return {name: camera_from_info(name, 640, 480, "equidistant", [0.0] * 4, k) for name in body.mounts}


def true_poses(body: BodyModel, frame: int) -> np.ndarray:
    """world_T_segment (3, 4, 4): walking on while the arm swings and bends."""
    t = frame / 30
    trunk = rigid(
        exp_so3(np.array([0.05 * np.sin(4 * t), 0.0, 0.3 * t])), np.array([1.2 * t, 0.1 * np.sin(3 * t), 1.0])
    )
    swing = exp_so3(np.array([0.3 * np.sin(2 * t), 0.8 * np.sin(5 * t), 0.2 * t]))
    bend = body.tree_joints[1].hinge_rotation(np.array(0.6 + 0.5 * np.sin(6 * t)))
    return body.forward_kinematics(trunk, np.stack([swing, bend]))


def seen_by(
    body: BodyModel, camera: str, frame: int, rng: np.random.Generator, lost: bool = False, wrong: bool = False
) -> LandmarkMatches:
    """A camera's registration with noise of its covariance; a lost camera still measures its rotation."""
    mount = body.mounts[camera]
    row = body.segment_index[mount.segment]
    pose = true_poses(body, frame)[row] @ mount.segment_T_camera
    before = true_poses(body, frame - 1)[row] @ mount.segment_T_camera
    noisy = pose @ exp_se3(np.sqrt(np.diag(COVARIANCE)) * rng.standard_normal(6))
    if wrong:
        noisy = noisy @ exp_se3(np.array([0.3, 0.0, 0.2, 0.4, 0.1, 0.0]))
    return LandmarkMatches(
        camera=camera, stamp_ns=(frame + 1) * STEP_NS, previous_stamp_ns=frame * STEP_NS,
        track_ids=np.zeros(0, np.uint32), landmark_ids=np.zeros(0, np.uint32), pixels=np.zeros((0, 2), np.float32),
        points_world=np.zeros((0, 3), np.float32), world_T_camera=None if lost else noisy, pose_covariance=COVARIANCE,
        current_R_previous=pose[:3, :3].T @ before[:3, :3], rotation_inliers=50,
    )  # fmt: skip


def position_errors(body: BodyModel, states: dict[int, BodyState]) -> np.ndarray:
    """Distances (T, S) [m] of segment origins from the truth."""
    truth = np.array([true_poses(body, frame) for frame in states])
    estimate = np.array([state.world_T_segment for state in states.values()])
    return np.linalg.norm(estimate[..., :3, 3] - truth[..., :3, 3], axis=2)


def frame_after(body: BodyModel, before: int, frame: int, rng: np.random.Generator) -> BodyFrame:
    """A frame of all cameras whose last image was the frame ``before``."""
    stamp_ns, previous_ns = (frame + 1) * STEP_NS, (before + 1) * STEP_NS
    return BodyFrame(stamp_ns, {c: stamped(seen_by(body, c, frame, rng), stamp_ns, previous_ns) for c in body.mounts})


def stamped(matches: LandmarkMatches, stamp_ns: int, previous_ns: int) -> LandmarkMatches:
    """The same registration at other times."""
    return dataclasses.replace(matches, stamp_ns=stamp_ns, previous_stamp_ns=previous_ns)
