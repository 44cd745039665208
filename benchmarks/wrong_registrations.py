"""States of a body with wrong registrations: python -m benchmarks.wrong_registrations [--body BODY.yaml].

The body moves as is known. Registrations have noise by their covariance; wrong ones are off by 0.4 m and 0.36 rad, a
share of all of them by chance, or all cameras of a limb, or two of three cameras on the root, for 0.3 s in each second.
A state is wrong where a segment is more than 6 of its sigmas off. States that say so (``converged``) are counted apart.
"""

import argparse
from collections.abc import Callable
from pathlib import Path

import numpy as np

from bodycam_ros.body.body_file import read_body
from bodycam_ros.body.body_model import BodyModel, CameraMount
from bodycam_ros.body_state import BodyFrame
from bodycam_ros.estimation.estimator import BodyEstimator
from bodycam_ros.estimation.estimator_settings import EstimatorSettings
from bodycam_ros.geometry import Array, exp_se3, exp_so3, inverse, log_se3, rigid
from bodycam_ros.registration.landmark_matches import LandmarkMatches

STEP_NS = 33_333_333
FRAMES, SEEDS = 90, range(10, 13)
COVARIANCE = np.diag(np.repeat([0.001, 0.002], 3) ** 2)
OFF = np.array([0.3, 0.0, 0.2, 0.4, 0.1, 0.0])
FAR = 6.0

Wrong = Callable[[str, int, np.random.Generator], bool]
"""Camera, frame and a generator of chance -> whether its registration is wrong."""


def true_poses(body: BodyModel, frame: int) -> Array:
    """(S, 4, 4) walking on while all joints swing, each at a pace of its own."""
    t, joints = frame / 30.0, len(body.tree_joints)
    root = rigid(
        exp_so3(np.array([0.05 * np.sin(4.0 * t), 0.0, 0.3 * t])), np.array([1.2 * t, 0.1 * np.sin(3.0 * t), 1.0])
    )
    swings = np.empty((joints, 3, 3))
    for row, joint in enumerate(body.tree_joints):
        angle = 0.5 * np.sin((3.0 + 0.2 * row) * t + row)
        swings[row] = (
            joint.hinge_rotation(np.array(0.6 + angle))
            if joint.type == "hinge"
            else exp_so3(angle * np.array([0.3, 1.0, 0.2 * (-1) ** row]))
        )
    return body.forward_kinematics(root, swings)


def with_third_root_camera(body: BodyModel) -> BodyModel:
    """The body with three cameras on its root at least."""
    mounts = dict(body.mounts)
    while len([m for m in mounts.values() if m.segment == body.root]) < 3:
        place = exp_se3(np.array([0.0, 0.0, 2.0 * len(mounts), 0.1, 0.05, 0.0]))
        mounts[f"root_{len(mounts)}"] = CameraMount(body.root, place)
    return BodyModel(body.name, body.root, body.segments, body.joints, mounts)


def count_wrong(body: BodyModel, wrong: Wrong) -> tuple[int, int, int, float]:
    """Wrong states, those of them that say so, all states, and the 99th percentile of the worst joint's error [cm]."""
    bad = said = total = 0
    errors = []
    for seed in SEEDS:
        rng = np.random.default_rng(seed)
        estimator = BodyEstimator(body, body.mounts, EstimatorSettings(output_delay=0))
        for frame in range(FRAMES):
            poses, matches = true_poses(body, frame), {}
            for camera, mount in body.mounts.items():
                pose = poses[body.segment_index[mount.segment]] @ mount.segment_T_camera
                noisy = pose @ exp_se3(np.sqrt(np.diag(COVARIANCE)) * rng.standard_normal(6))
                if wrong(camera, frame, rng):
                    noisy = noisy @ exp_se3(OFF)
                matches[camera] = _registration(camera, frame, noisy)
            for state in estimator.update(BodyFrame((frame + 1) * STEP_NS, matches)):
                off = log_se3(inverse(state.world_T_segment) @ poses)
                sigmas = np.einsum("si,si->s", off, np.linalg.solve(state.uncertainty.segments, off[..., None])[..., 0])
                is_bad = float(sigmas.max()) > FAR**2
                bad = bad + is_bad
                said = said + (is_bad and not state.converged)
                total = total + 1
                errors.append(float(np.linalg.norm((state.world_T_segment - poses)[:, :3, 3], axis=1).max()))
    return bad, said, total, 100.0 * float(np.percentile(errors, 99))


def _registration(camera: str, frame: int, world_T_camera: Array) -> LandmarkMatches:
    nothing = np.zeros(0, np.uint32)
    return LandmarkMatches(
        camera=camera,
        stamp_ns=(frame + 1) * STEP_NS,
        previous_stamp_ns=frame * STEP_NS,
        track_ids=nothing,
        landmark_ids=nothing,
        pixels=np.zeros((0, 2), np.float32),
        points_world=np.zeros((0, 3), np.float32),
        world_T_camera=world_T_camera,
        pose_covariance=COVARIANCE,
        current_R_previous=np.eye(3),
        rotation_inliers=0,
    )


def cases(body: BodyModel) -> dict[str, Wrong]:
    """What is wrong, by name."""
    limb = {name for name, mount in body.mounts.items() if mount.segment in ("thigh_left", "shin_left", "foot_left")}
    root = [name for name, mount in body.mounts.items() if mount.segment == body.root]

    def in_burst(frame: int) -> bool:
        return frame % 30 >= 15 and frame % 30 < 24

    return {
        "none wrong": lambda camera, frame, rng: False,
        "20 % wrong": lambda camera, frame, rng: bool(rng.random() < 0.2),
        "30 % wrong": lambda camera, frame, rng: bool(rng.random() < 0.3),
        "left leg wrong for 0.3 s": lambda camera, frame, rng: camera in limb and in_burst(frame),
        "two of three on the root wrong for 0.3 s": lambda camera, frame, rng: camera in root[:2] and in_burst(frame),
    }


def main() -> None:
    """Print a row for each case."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--body", type=Path, default=Path("bags/body.yaml"))
    body = with_third_root_camera(read_body(parser.parse_args().body))
    for name, wrong in cases(body).items():
        bad, said, total, p99_cm = count_wrong(body, wrong)
        print(f"{name}: {bad} of {total} states wrong, {said} of these not converged; p99 {p99_cm:.2f} cm", flush=True)


if __name__ == "__main__":
    main()
