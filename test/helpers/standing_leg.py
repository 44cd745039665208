"""A shin and a foot that stands, rolls over its ball, swings on and stands again; registrations of their cameras."""

import numpy as np

from bodycam_ros.body.body_model import BodyModel, CameraMount, sole_points
from bodycam_ros.body_state import BodyFrame
from bodycam_ros.geometry import Array, exp_se3, exp_so3, rigid, transform_points
from bodycam_ros.kinematics.joint import Joint
from bodycam_ros.registration.landmark_matches import LandmarkMatches

STEP_NS = 33_333_333
SHIN_M = 0.43
_, BALL = sole_points(SHIN_M)
ROLLS, SWINGS = range(20, 30), range(30, 42)
FRAMES = 62
STRIDE_M = 0.7
PITCH_RAD = 0.7
TURN_RAD = 0.3

NOISE = np.diag(np.repeat([0.0005, 0.001], 3) ** 2)


def leg() -> BodyModel:
    """A body of shin and foot, with a camera on each."""
    ankle = Joint("ankle_left", "shin_left", "foot_left", "ball", rigid(np.eye(3), np.array([0.0, 0.0, -SHIN_M])))
    mounts = {
        "shin": CameraMount("shin_left", exp_se3(np.array([0.3, 1.0, -0.5, 0.05, 0.1, -0.1]))),
        "foot": CameraMount("foot_left", exp_se3(np.array([-0.4, 1.2, 0.5, 0.1, 0.05, 0.0]))),
    }
    return BodyModel("leg", "shin_left", ("shin_left", "foot_left"), (ankle,), mounts)


def true_poses(frame: int) -> Array:
    """world_T_segment (2, 4, 4); the sole stands on the floor."""
    pitch = 0.0
    ahead = 0.0
    lift = 0.0
    if frame in ROLLS:
        pitch = PITCH_RAD * ((frame - ROLLS[0]) / len(ROLLS)) ** 2
    elif frame in SWINGS:
        done = (frame - SWINGS[0] + 1) / len(SWINGS)
        pitch = PITCH_RAD * (1.0 - done) ** 2
        ahead, lift = STRIDE_M * 0.5 * (1.0 - np.cos(np.pi * done)), 0.08 * np.sin(np.pi * done)
    elif frame >= SWINGS.stop:
        ahead = STRIDE_M
    R = exp_so3(np.array([0.0, pitch, 0.0]))
    foot = rigid(R, BALL - R @ BALL + np.array([ahead, 0.0, lift - BALL[2]]))
    lean = exp_so3(np.array([0.02 * np.sin(0.2 * frame), 0.1 + 0.004 * frame, 0.0]))
    shin = rigid(lean, foot[:3, 3] + lean @ np.array([0.0, 0.0, SHIN_M]))
    return rigid(exp_so3(np.array([0.0, 0.0, TURN_RAD])), np.zeros(3)) @ np.stack([shin, foot])


def frame_of(body: BodyModel, frame: int, rng: np.random.Generator) -> BodyFrame:
    """Registrations of its cameras, with noise as their covariance has it."""
    matches = {}
    for camera, mount in body.mounts.items():
        row = body.segment_index[mount.segment]
        pose, before = (true_poses(f)[row] @ mount.segment_T_camera for f in (frame, frame - 1))
        noisy = pose @ exp_se3(np.sqrt(np.diag(NOISE)) * rng.standard_normal(6))
        matches[camera] = LandmarkMatches(
            camera=camera, stamp_ns=(frame + 1) * STEP_NS, previous_stamp_ns=frame * STEP_NS,
            track_ids=np.zeros(0, np.uint32), landmark_ids=np.zeros(0, np.uint32),
            pixels=np.zeros((0, 2), np.float32), points_world=np.zeros((0, 3), np.float32), world_T_camera=noisy,
            pose_covariance=NOISE, current_R_previous=pose[:3, :3].T @ before[:3, :3], rotation_inliers=50,
        )  # fmt: skip
    return BodyFrame((frame + 1) * STEP_NS, matches)


def ball_of(world_T_segment: Array) -> Array:
    """(T, 3) where the ball of the foot is, of poses (T, 2, 4, 4)."""
    return np.array([transform_points(poses[1], BALL[None])[0] for poses in world_T_segment])
