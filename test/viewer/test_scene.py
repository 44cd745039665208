"""What the scene holds, read back from the server."""

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose
from numpy.typing import NDArray

from bodycam_ros.body.body_file import read_body
from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.body.stick_figure import Bone, body_bones
from bodycam_ros.geometry import rigid, rotation_from_xyzw
from bodycam_ros.registration.landmark_matches import LandmarkMatches
from bodycam_ros.registration.reference_map import ReferenceMap
from bodycam_ros.results.colours import EQUIPMENT, rgb
from bodycam_ros.results.footage import Footage
from bodycam_ros.viewer.correction import Correction, Part, place_of
from bodycam_ros.viewer.motion import Motion
from bodycam_ros.viewer.scene import CAMERAS, LOST, NAMES, REGISTERED, SELECTED, UNKNOWN, Scene
from bodycam_ros.viewer.server import LocalServer
from bodycam_ros.viewer.viewpoint import FIELD_OF_VIEW, OpeningView, points_to_see

KNEE = Part("joint", "knee_left")
FLOAT32 = 1e-6


@pytest.fixture
def server() -> Iterator[LocalServer]:
    server = LocalServer(0, "test")
    yield server
    server.stop()


@pytest.fixture
def body(sample: Path) -> BodyModel:
    return read_body(sample / "body.yaml")


@pytest.fixture
def motion(body: BodyModel) -> Motion:
    """Two steps; one camera is registered first and lost then, another the reverse."""
    standing = Motion.standing(body)
    stamps = np.array([0, 33_333_333], dtype=np.int64)
    root = np.repeat(standing.world_T_root, 2, axis=0)
    root[:, :2, 3] = [[2.0, 1.0], [2.5, 1.5]]
    angles = np.repeat(standing.angles, 2, axis=0)
    angles[1, [name.startswith("knee") for name in standing.angle_names]] = 0.8
    registered = {"head": (stamps[:1], root[:1]), "shin_left": (stamps[1:], root[1:])}
    return replace(standing, stamps_ns=stamps, world_T_root=root, angles=angles, registered=registered)


@pytest.fixture
def scene(server: LocalServer, sample: Path, body: BodyModel, motion: Motion) -> Scene:
    return Scene(server, body, ReferenceMap.load(sample / "map"), motion, lambda part: None)


def knee_moved(body: BodyModel, by_m: list[float]) -> BodyModel:
    pose = place_of(body, KNEE)[1].copy()
    pose[:3, 3] += by_m
    return Correction(body, body).moved_to(KNEE, pose).body


def pose_of(server: LocalServer, name: str) -> NDArray[np.float64]:
    """Pose of a node of the scene, through all its parents."""
    pose = np.eye(4)
    for depth in range(2, len(name.split("/")) + 1):
        node = server.scene.get_handle_by_name("/".join(name.split("/")[:depth]))
        if node is not None:
            pose = pose @ rigid(rotation_from_xyzw(np.roll(node.wxyz, -1)), np.array(node.position))
    return pose


def colour_of(server: LocalServer, name: str) -> tuple[int, int, int]:
    node = server.scene.get_handle_by_name(name)
    assert node is not None
    colour: tuple[int, int, int] = tuple(node.color)  # type: ignore[attr-defined]
    return colour


def test_everything_is_where_the_corrected_body_puts_it(
    server: LocalServer, scene: Scene, body: BodyModel, motion: Motion
) -> None:
    corrected = knee_moved(body, [0.01, -0.02, 0.03])
    scene.reshape(corrected)
    scene.show(1, follow=False)
    world_T_segment = motion.segments_at(corrected, 1)
    for camera, mount in corrected.mounts.items():
        expected = world_T_segment[body.segment_index[mount.segment]] @ mount.segment_T_camera
        found = pose_of(server, f"/world/body/{mount.segment}/camera_{camera}")
        assert_allclose(found, expected, rtol=0.0, atol=FLOAT32, err_msg=camera)
        assert_allclose(scene.world_T_camera(camera), expected, rtol=0.0, atol=1e-12)
    for joint in corrected.joints:
        expected = world_T_segment[body.segment_index[joint.parent]] @ joint.parent_T_joint
        found = pose_of(server, f"/world/body/{joint.parent}/joint_{joint.name}")
        assert_allclose(found, expected, rtol=0.0, atol=FLOAT32, err_msg=joint.name)


def test_bones_reach_from_joint_to_joint(server: LocalServer, scene: Scene, body: BodyModel) -> None:
    corrected = knee_moved(body, [0.0, 0.05, 0.1])
    scene.reshape(corrected)
    knee = next(joint for joint in corrected.joints if joint.name == "knee_left").parent_T_joint[:3, 3]
    names = [f"/world/body/thigh_left/bone_{number}" for number in range(30)]
    (bone,) = [handle for name in names if (handle := server.scene.get_handle_by_name(name)) is not None]
    assert bone.height == pytest.approx(np.linalg.norm(knee))  # type: ignore[attr-defined]
    assert_allclose(bone.position, knee / 2.0, rtol=0.0, atol=FLOAT32)
    axis = rotation_from_xyzw(np.roll(bone.wxyz, -1))[:, 2]
    assert_allclose(np.abs(axis @ knee), np.linalg.norm(knee), rtol=1e-6)


def test_following_keeps_the_body_in_the_middle_and_on_the_floor(
    server: LocalServer, scene: Scene, body: BodyModel, motion: Motion
) -> None:
    for instant in (0, 1):
        scene.show(instant, follow=True)
        expected = [0.0, 0.0, motion.world_T_root[instant, 2, 3]]
        assert_allclose(pose_of(server, "/world/body/pelvis")[:3, 3], expected, rtol=0.0, atol=FLOAT32)
    scene.show(0, follow=False)  # the world stays where it was left
    step = motion.world_T_root[0, :2, 3] - motion.world_T_root[1, :2, 3]
    assert_allclose(pose_of(server, "/world/body/pelvis")[:2, 3], step, rtol=0.0, atol=FLOAT32)


def test_cameras_are_coloured_by_what_they_know_and_by_selection(
    server: LocalServer, scene: Scene, body: BodyModel
) -> None:
    head, shin = "/world/body/head/camera_head", "/world/body/shin_left/camera_shin_left"
    scene.show(0, follow=True)
    assert (colour_of(server, head), colour_of(server, shin)) == (rgb(REGISTERED), rgb(LOST))
    assert colour_of(server, "/world/body/torso/camera_torso_back") == rgb(UNKNOWN)
    scene.show(1, follow=True)
    assert (colour_of(server, head), colour_of(server, shin)) == (rgb(LOST), rgb(REGISTERED))
    scene.select(Part("camera", "head"))
    assert (colour_of(server, head), colour_of(server, shin)) == (rgb(SELECTED), rgb(REGISTERED))
    scene.select(KNEE)
    assert colour_of(server, head) == rgb(LOST)
    assert colour_of(server, "/world/body/thigh_left/joint_knee_left") == rgb(SELECTED)


def test_the_chosen_camera_shows_its_image_larger_than_the_others(server: LocalServer, scene: Scene) -> None:
    image = np.full((4, 6, 3), 100, np.uint8)
    head, shin = (
        server.scene.get_handle_by_name(f"/world/body/{name}/camera_{name}") for name in ("head", "shin_left")
    )
    assert head is not None and shin is not None
    for camera, larger, other in (("head", head, shin), ("shin_left", shin, head)):
        scene.show_image(camera, image)
        assert larger.image is not None and other.image is None  # type: ignore[attr-defined]
        assert larger.scale > other.scale  # type: ignore[attr-defined]
    scene.show_image(None, None)
    assert head.image is None and shin.image is None and head.scale == shin.scale  # type: ignore[attr-defined]


def test_equipment_stands_where_the_recording_has_it_whatever_is_corrected(
    server: LocalServer, sample: Path, body: BodyModel, motion: Motion
) -> None:
    start, end = np.array([[1.0, 0.0, 0.5], [1.0, 0.0, 0.6]]), np.array([[1.0, 0.0, 1.5], [1.8, 0.0, 0.0]])
    beside = replace(motion, equipment=(Bone("frame", start, end, True),))
    scene = Scene(server, body, ReferenceMap.load(sample / "map"), beside, lambda part: None)
    scene.show(1, follow=False)
    rod = server.scene.get_handle_by_name("/world/equipment/line_0")
    assert rod is not None and rod.height == pytest.approx(1.0)  # type: ignore[attr-defined]
    assert_allclose(rod.position, [1.4, 0.0, 0.3], rtol=0.0, atol=FLOAT32)
    axis = rotation_from_xyzw(np.roll(rod.wxyz, -1))[:, 2]
    assert_allclose(np.abs(axis @ [0.8, 0.0, -0.6]), 1.0, rtol=1e-6)
    assert colour_of(server, "/world/equipment/line_0") == rgb(EQUIPMENT)


def test_equipment_is_not_shown_while_nobody_knows_where_it_is(
    server: LocalServer, sample: Path, body: BodyModel, motion: Motion
) -> None:
    start, end = np.zeros((2, 3)), np.ones((2, 3))
    beside = replace(motion, equipment=(Bone("frame", start, end, True),), unplaced=frozenset([0]))
    scene = Scene(server, body, ReferenceMap.load(sample / "map"), beside, lambda part: None)
    rod = server.scene.get_handle_by_name("/world/equipment/line_0")
    assert rod is not None
    for instant, is_shown in ((0, False), (1, True), (0, False)):
        scene.show(instant, follow=False)
        assert rod.visible == is_shown


def test_legs_alone_are_drawn_to_their_tips_and_fill_the_opening_view(body: BodyModel) -> None:
    """Last segments without a joint below them had no line, and the window ended at the knees."""
    kept = {"pelvis", "thigh_left", "shin_left", "thigh_right"}
    legs = replace(
        body,
        segments=tuple(segment for segment in body.segments if segment in kept),
        joints=tuple(joint for joint in body.joints if joint.child in kept),
        mounts={camera: mount for camera, mount in body.mounts.items() if mount.segment in kept},
    )
    poses = Motion.standing(legs).segments_at(legs, 0)
    lines = body_bones(legs, poses)
    assert {line.segment for line in lines} == kept
    shin = next(line for line in lines if line.segment == "shin_left")
    assert shin.start[0, 2] - shin.end[0, 2] > 0.1
    points = points_to_see(legs, poses)
    view = OpeningView.of_body(poses[0], points)
    forward = (view.look_at - view.position) / np.linalg.norm(view.look_at - view.position)
    right = np.cross(forward, [0.0, 0.0, 1.0])
    right /= np.linalg.norm(right)
    x, y, z = np.stack([right, np.cross(right, forward), forward]) @ (points - view.position).T
    edge = np.tan(FIELD_OF_VIEW / 2.0)
    assert z.min() > 0.0 and np.abs(y / z).max() < edge and np.abs(x / z).max() < edge
    assert np.ptp(y / z) > edge  # half of the window's height at least


def test_layers_are_shown_and_hidden(server: LocalServer, scene: Scene) -> None:
    name = server.scene.get_handle_by_name("/world/body/thigh_left/joint_knee_left/name")
    camera = server.scene.get_handle_by_name("/world/body/shin_left/camera_shin_left")
    camera_name = server.scene.get_handle_by_name("/world/body/shin_left/camera_shin_left/name")
    assert (name.text, name.visible, camera_name.text, camera_name.visible) == ("knee left", False, "shin left", False)
    scene.show_layer(NAMES, True)
    assert name.visible and camera_name.visible and camera.visible
    scene.show_layer(CAMERAS, False)
    assert name.visible and not camera.visible  # and all beneath it, its name included


def test_landmarks_that_a_camera_matched_are_shown_with_its_image(
    server: LocalServer, scene: Scene, sample: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    cloud = server.scene.get_handle_by_name("/world/matched")
    assert cloud is not None and not cloud.visible
    footage = Footage(sample / "sample" / "bag", None)
    points = np.array([[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]], np.float32)
    at_ns = int(footage.times_ns("head")[0])
    found = LandmarkMatches(
        camera="head",
        stamp_ns=at_ns,
        previous_stamp_ns=0,
        track_ids=np.arange(2, dtype=np.uint32),
        landmark_ids=np.arange(2, dtype=np.uint32),
        pixels=np.full((2, 2), 100.0, np.float32),
        points_world=points,
        world_T_camera=None,
        pose_covariance=np.eye(6),
        current_R_previous=np.eye(3),
        rotation_inliers=0,
    )
    scene.motion = replace(scene.motion, stamps_ns=scene.motion.stamps_ns + at_ns)
    monkeypatch.setattr(footage, "matches_of", lambda image: found)
    assert scene.show_picture("head", footage) is not None
    assert cloud.visible
    assert_allclose(cloud.points, points)  # type: ignore[attr-defined]
    monkeypatch.setattr(footage, "matches_of", lambda image: None)
    assert scene.show_picture("head", footage) is not None
    assert not cloud.visible
