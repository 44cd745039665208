"""Keypoints of static cameras as measurements of a body: whose they are, and which are rejected."""

from collections.abc import Mapping

import numpy as np
import pytest
from numpy.typing import NDArray
from static_cameras.dressed_body import DressedBody, small_motion, static_cameras_around

from bodycam_ros.body.body_file import read_body
from bodycam_ros.body.limb_mesh import capsule_surfaces
from bodycam_ros.body.surface import BodySurface
from bodycam_ros.formats.keypoints import JOINTS
from bodycam_ros.geometry import exp_so3, inverse, transform_points
from bodycam_ros.static_cameras.articulated_step import PredictedBody
from bodycam_ros.static_cameras.keypoint_evidence import SIGMA_M, AgreedKeypoints, KeypointEvidence, RecordedPeople
from bodycam_ros.static_cameras.region_settings import RegionSettings
from bodycam_ros.static_cameras.region_tracker import RegionTracker

Array = NDArray[np.float64]
KINDS = {"Shoulder": "upper_arm", "Elbow": "forearm", "Wrist": "hand", "Hip": "thigh", "Knee": "shin", "Ankle": "foot"}
SIDES = {"L": "left", "R": "right"}
STAMP_NS = 1000
SIGMAS = np.repeat([0.05, 0.03], 3)


@pytest.fixture(scope="module")
def dressed(sample) -> DressedBody:
    body = read_body(sample / "body.yaml")
    return DressedBody(body, capsule_surfaces(body), static_cameras_around(4))


@pytest.fixture(scope="module")
def truth(dressed: DressedBody) -> Array:
    return small_motion(dressed.body, 1)[0]


def person(dressed: DressedBody, camera: str, poses: Array, exchanged: bool = False, off_px: float = 0.0) -> Array:
    """(J, 3) keypoints of a body in a camera; of joints that it has."""
    station, found = dressed.stations[camera], np.zeros((len(JOINTS), 3))
    for row, joint in enumerate(JOINTS):
        side = {"L": "R", "R": "L"}[joint[0]] if exchanged else joint[0]
        segment = dressed.body.segment_index.get(f"{KINDS[joint[1:]]}_{SIDES[side]}")
        if segment is not None:
            at = transform_points(inverse(station.world_T_camera), poses[segment, None, :3, 3])
            found[row] = [*(station.camera.project(at)[0][0] + off_px), 0.9]
    return found


def agreed(dressed: DressedBody, people: Mapping[str, list[Array]], near: Array) -> AgreedKeypoints:
    by_stamp = {camera: {STAMP_NS: group} for camera, group in people.items()}
    evidence = KeypointEvidence(dressed.body, dressed.stations, JOINTS, RecordedPeople(by_stamp))
    blank = dict.fromkeys(dressed.stations, np.zeros((1, 1, 3), np.uint8))
    return evidence.agreed(blank, dict.fromkeys(dressed.stations, STAMP_NS), near)


def test_keypoints_are_where_the_joints_are(dressed: DressedBody, truth: Array) -> None:
    found = agreed(dressed, {camera: [person(dressed, camera, truth)] for camera in dressed.stations}, truth)
    np.testing.assert_allclose(found.places, truth[found.segments, :3, 3], atol=1e-6)
    assert len(found.keypoints) == len(dressed.stations) * len(found.segments)
    _, downhill = found.keypoints.equations(truth)
    assert np.abs(downhill).max() < 1e-3
    station = dressed.stations["ext_00"]
    at = transform_points(inverse(station.world_T_camera), truth[found.keypoints.segments[:1], :3, 3])
    assert found.keypoints.sigmas[0] == pytest.approx(SIGMA_M * station.camera.fx / np.linalg.norm(at), rel=0.02)


def test_a_camera_with_left_for_right_is_rejected(dressed: DressedBody, truth: Array) -> None:
    people = {camera: [person(dressed, camera, truth, camera == "ext_01")] for camera in dressed.stations}
    found = agreed(dressed, people, truth)
    np.testing.assert_allclose(found.places, truth[found.segments, :3, 3], atol=1e-6)
    assert 1 not in found.keypoints.cameras and {0, 2, 3} <= {*found.keypoints.cameras}


def test_of_two_people_the_one_near_the_body_counts(dressed: DressedBody, truth: Array) -> None:
    other = truth.copy()
    other[:, :3, 3] += [0.9, 0.4, 0.0]
    people = {
        camera: [person(dressed, camera, each) for each in (other, truth)[:: -1 if camera == "ext_02" else 1]]
        for camera in dressed.stations
    }
    for near in (truth, other):
        found = agreed(dressed, people, near)
        np.testing.assert_allclose(found.places, near[found.segments, :3, 3], atol=1e-6)


def test_a_detector_is_given_each_image_and_where_the_body_is_predicted(dressed: DressedBody, truth: Array) -> None:
    images, asked = dressed.images(truth, 1.0, 0), {}

    class Detector:
        def people(self, camera: str, stamp_ns: int, image: NDArray[np.uint8], near: Array) -> list[Array]:
            assert image is images[camera] and stamp_ns == STAMP_NS
            asked[camera] = near
            return [person(dressed, camera, truth)]

    predicted = truth.copy()
    predicted[:, :3, 3] += [0.1, 0.0, 0.0]
    evidence = KeypointEvidence(dressed.body, dressed.stations, JOINTS, Detector())
    found = evidence.agreed(images, dict.fromkeys(images, STAMP_NS), predicted)
    np.testing.assert_allclose(found.places, truth[found.segments, :3, 3], atol=1e-6)
    for camera, near in asked.items():
        expected = person(dressed, camera, predicted)
        known = expected[:, 2] > 0.0
        np.testing.assert_allclose(near[known], expected[known, :2])
        assert np.isnan(near[~known]).all()


def test_nobody_near_and_one_camera_alone_measure_nothing(dressed: DressedBody, truth: Array) -> None:
    away = truth.copy()
    away[:, :3, 3] += [0.0, 0.0, 3.0]
    for people in (
        {camera: [person(dressed, camera, away)] for camera in dressed.stations},
        {"ext_00": [person(dressed, "ext_00", truth)]},
        {camera: [] for camera in dressed.stations},
    ):
        assert len(agreed(dressed, people, truth).keypoints) == 0


def test_an_arm_that_was_lost_is_taken_where_keypoints_have_it(dressed: DressedBody, truth: Array) -> None:
    """Contours alone leave it where it is not; keypoints do after three images, and it did not move there."""
    body = dressed.body
    images, motion = dressed.images(truth, 1.0, 0), body.joint_poses(truth)
    row = next(row for row, joint in enumerate(body.tree_joints) if joint.child == "upper_arm_left")
    motion[row, :3, :3] = motion[row, :3, :3] @ exp_so3(np.array([1.5, 0.0, 0.0]))
    lost = body.forward_kinematics(truth[body.segment_index[body.root]], motion)
    forearm = body.segment_index["forearm_left"]
    assert np.linalg.norm((lost - truth)[forearm, :3, 3]) > 0.25
    found = agreed(dressed, {camera: [person(dressed, camera, truth)] for camera in dressed.stations}, truth)
    surface, ends = BodySurface.of(body, dressed.surfaces), []
    for keypoints in (None, found):
        tracker = RegionTracker(body, surface, dressed.stations, RegionSettings(), searches_again=False)
        tracker.initialise(images, truth)
        poses, jumps = lost, []
        for _ in range(4):
            seen = tracker.measure(images, PredictedBody(poses, SIGMAS, 0.05), (), keypoints)
            poses = seen.world_T_segment
            jumps.append(forearm in seen.jumped)
        ends.append((np.linalg.norm((poses - truth)[forearm, :3, 3]), jumps))
    (off_without, jumps_without), (off_with, jumps_with) = ends
    assert off_without > 0.15 and not any(jumps_without)
    assert off_with < 0.05 and jumps_with == [False, False, True, False]
