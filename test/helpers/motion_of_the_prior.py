"""Motion drawn from the estimator's motion prior; registrations with noise of known covariance, without outliers."""

from collections.abc import Iterator

import numpy as np

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.body_state import BodyFrame
from bodycam_ros.estimation.coordinates import Coordinates
from bodycam_ros.estimation.factors.joint_rotations import SLIDES_M
from bodycam_ros.estimation.factors.motion import MotionModel
from bodycam_ros.estimation.motion_settings import MotionSettings
from bodycam_ros.geometry import Array, exp_se3, rigid
from bodycam_ros.kinematics.tangent import TreeTangent
from bodycam_ros.registration.landmark_matches import LandmarkMatches

STEP_NS = 33_333_333


def drawn_motion(body: BodyModel, frames: int, rng: np.random.Generator, settings: MotionSettings) -> Array:
    """world_T_segment (T, S, 4, 4): accelerations are white noise of the size that the settings have."""
    tangent = TreeTangent(body, SLIDES_M)
    model = MotionModel(tangent, settings)
    start = body.motion_of(body.n_pose(rigid(np.eye(3), np.array([0.0, 0.0, 1.0]))))
    at = Coordinates(tangent, start, np.zeros(tangent.count))
    poses = []
    for _ in range(frames):
        poses.append(at.poses)
        motion = model.between(at, 1e-9 * STEP_NS)
        _, by_after = motion.jacobians  # of the velocity, then of the increment
        off = np.linalg.solve(by_after, rng.standard_normal(len(by_after)))
        predicted = motion.predict(at)
        moved = predicted.moved(off[tangent.count :])
        at = Coordinates(tangent, moved.motion, predicted.velocity + off[: tangent.count])
    return np.array(poses)


def measured_frames(
    body: BodyModel, world_T_segment: Array, stated: Array, noise: Array, rng: np.random.Generator
) -> Iterator[BodyFrame]:
    """A frame for each state (T, S, 4, 4), with a registration by every camera.

    Args:
        body: whose cameras register.
        world_T_segment: where it truly is [m].
        stated: (6, 6) covariance that each registration has, rotation [rad^2] then translation [m^2] in camera axes.
        noise: (6, 6) covariance of the noise that it truly has.
        rng: of the noise.
    """
    root = np.linalg.cholesky(noise + 1e-30 * np.eye(6))
    for frame, poses in enumerate(world_T_segment):
        matches = {}
        before = world_T_segment[max(frame - 1, 0)]
        for camera, mount in body.mounts.items():
            row = body.segment_index[mount.segment]
            true, last = (each[row] @ mount.segment_T_camera for each in (poses, before))
            matches[camera] = LandmarkMatches(
                camera=camera,
                stamp_ns=(frame + 1) * STEP_NS,
                previous_stamp_ns=frame * STEP_NS,
                track_ids=np.zeros(0, np.uint32),
                landmark_ids=np.zeros(0, np.uint32),
                pixels=np.zeros((0, 2), np.float32),
                points_world=np.zeros((0, 3), np.float32),
                world_T_camera=true @ exp_se3(root @ rng.standard_normal(6)),
                pose_covariance=stated,
                current_R_previous=true[:3, :3].T @ last[:3, :3],
                rotation_inliers=50,
            )
        yield BodyFrame((frame + 1) * STEP_NS, matches)
