"""The body made from ground truth against the true trajectories."""

from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from benchmarks.body_from_truth import body_from_truth
from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.body.joint_angles import JointAngles, JointAngleTracker
from bodycam_ros.geometry import rigid, rotation_from_xyzw

Trajectory = dict[int, NDArray[np.float64]]


def trajectory(path: Path) -> Trajectory:
    """Stamp [us] -> pose."""
    rows = np.loadtxt(path, ndmin=2)
    poses = rigid(rotation_from_xyzw(rows[:, 4:8]), rows[:, 1:4])
    return dict(zip(np.round(rows[:, 0] * 1e6).astype(int).tolist(), poses, strict=True))


@pytest.fixture(scope="module", params=["dev_walk", "dev_rom"])
def recording(request: pytest.FixtureRequest, shared: Path) -> Path:
    return shared / str(request.param)


@pytest.fixture(scope="module")
def true_body(recording: Path) -> BodyModel:
    return body_from_truth(recording)


@pytest.fixture(scope="module")
def true_poses(recording: Path, true_body: BodyModel) -> NDArray[np.float64]:
    """(T, S, 4, 4)."""
    trajectories = [trajectory(recording / "truth" / "segments" / f"{name}.tum") for name in true_body.segments]
    return np.stack([np.stack(list(poses.values())) for poses in trajectories], axis=1)


def test_it_has_the_default_body_of_the_design(true_body: BodyModel) -> None:
    sides = [
        f"{limb}_{side}" for limb in ("upper_arm", "forearm", "thigh", "shin", "foot") for side in ("left", "right")
    ]
    assert set(true_body.segments) == {"pelvis", "torso", "head", *sides}
    assert true_body.root == "pelvis"
    assert len(true_body.tree_joints) == 12
    assert len(true_body.mounts) == 16


def test_cameras_sit_where_the_truth_has_them(recording: Path, true_body: BodyModel) -> None:
    for camera, mount in true_body.mounts.items():
        segments = trajectory(recording / "truth" / "segments" / f"{mount.segment}.tum")
        cameras = trajectory(recording / "truth" / "cameras" / f"{camera}.tum")
        common = segments.keys() & cameras.keys()
        assert len(common) > 100
        for stamp in common:
            np.testing.assert_allclose(segments[stamp] @ mount.segment_T_camera, cameras[stamp], atol=1e-5)


def test_joint_angles_alone_rebuild_the_true_segments(true_body: BodyModel, true_poses: NDArray[np.float64]) -> None:
    tracker = JointAngleTracker(true_body)
    angles = np.array([tracker.angles(poses) for poses in true_poses])
    rebuilt = true_body.forward_kinematics(true_poses[:, 0], JointAngles(true_body).rotations(angles))
    np.testing.assert_allclose(rebuilt, true_poses, atol=1e-5)
    # DESIGN 3: people hardly reach the singularity of these angles, where the middle one is 90 degrees.
    middle = [tracker.names.index(joint.angle_names[1]) for joint in true_body.tree_joints]
    assert np.degrees(np.abs(angles[:, middle]).max()) < 80.0
    assert np.degrees(np.abs(np.diff(angles, axis=0)).max()) < 40.0  # from one frame to the next
