"""A leg that nobody knows the pose of, found in painted images; and whose colours are looked for."""

import numpy as np
import pytest
from static_cameras.dressed_body import DressedBody, small_motion, static_cameras_around

from bodycam_ros.body.body_file import read_body
from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.body.limb_mesh import capsule_surfaces
from bodycam_ros.body.surface import BodySurface
from bodycam_ros.body_state import SegmentPose
from bodycam_ros.geometry import exp_so3
from bodycam_ros.static_cameras.region_settings import RegionSettings
from bodycam_ros.static_cameras.region_tracker import RegionTracker

LEG = ("thigh_left", "shin_left", "foot_left")


@pytest.fixture(scope="module")
def dressed(sample) -> DressedBody:
    body = read_body(sample / "body.yaml")
    return DressedBody(body, capsule_surfaces(body), static_cameras_around(2))


def rows(body: BodyModel, segments: tuple[str, ...]) -> list[int]:
    return [body.segment_index[segment] for segment in segments]


def turned_at(body: BodyModel, poses: np.ndarray, joint: str, degrees: float) -> np.ndarray:
    """The body with a joint turned about its y axis, and all that hangs on it."""
    rotations = body.joint_rotations(poses)
    row = [each.name for each in body.tree_joints].index(joint)
    rotations[row] = rotations[row] @ exp_so3(np.radians(degrees) * np.eye(3)[1])
    return body.forward_kinematics(poses[body.segment_index[body.root]], rotations)


def test_a_leg_that_begins_60_degrees_off_is_found(dressed: DressedBody) -> None:
    body = dressed.body
    truth = small_motion(body, 1)[0]
    lost = rows(body, LEG)
    wrong = turned_at(body, truth, "hip_left", -60.0)
    others = np.setdiff1d(np.arange(len(truth)), lost)
    np.testing.assert_allclose(wrong[others], truth[others], atol=1e-12)
    off = np.linalg.norm(wrong[lost, :3, 3] - truth[lost, :3, 3], axis=1)
    assert off[1] > 0.35 and off[2] > 0.7
    tracker = RegionTracker(body, BodySurface.of(body, dressed.surfaces), dressed.stations, RegionSettings())
    sure = np.diag(np.repeat([0.002, 0.003], 3) ** 2)
    known = [SegmentPose(body.segments[row], truth[row], sure) for row in others]
    found = tracker.find_limbs(dressed.images(truth, 1.0, 0), wrong, known)
    off = np.linalg.norm(found[:, :3, 3] - truth[:, :3, 3], axis=1)
    assert off[lost].max() < 0.04
    assert off[others].max() < 0.015
    axes = np.degrees(np.arccos(np.clip((found[lost, :3, 2] * truth[lost, :3, 2]).sum(axis=1), -1.0, 1.0)))
    assert axes[:2].max() < 5.0  # thigh and shin; a foot lies
