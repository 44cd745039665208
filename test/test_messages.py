"""Converters, each with messages of both libraries: rosbags, and rclpy where it is installed."""

import math
from collections.abc import Callable
from dataclasses import fields, replace
from typing import Any

import numpy as np
import pytest
from helpers.naming import naming
from helpers.ride_with_open_joints import report
from numpy.typing import NDArray

from bodycam_ros import geometry
from bodycam_ros.body_state import BodyState, BodyUncertainty
from bodycam_ros.camera.readout import Readout
from bodycam_ros.messages.body import equipment_message, equipment_report
from bodycam_ros.messages.factory import Message, MessageFactory, stamp_ns
from bodycam_ros.messages.imu import IMU_TYPE, imu_message, imu_row, imu_row_of_cdr
from bodycam_ros.messages.poses import body_covariance, ros_covariance
from bodycam_ros.messages.timing import clock_state, readout_time, timing_message
from bodycam_ros.messages.tracks import (
    landmark_matches,
    landmarks_message,
    map_points_message,
    track_frame,
    tracks_message,
)
from bodycam_ros.recording.typestore import recorded_messages, recording_typestore
from bodycam_ros.registration.landmark_matches import LandmarkMatches
from bodycam_ros.timing.clock_state import ClockState
from bodycam_ros.tracking.track_frame import TrackFrame

STAMP_NS = 1_700_000_000_123_456_789

Send = Callable[[Message], Message]
"""A message's way over the wire: serialized and deserialized."""


def send_recorded(message: Message) -> Message:
    typestore = recording_typestore()
    return typestore.deserialize_cdr(typestore.serialize_cdr(message, message.__msgtype__), message.__msgtype__)


def send_live(message: Message) -> Message:
    from rclpy.serialization import deserialize_message, serialize_message

    return deserialize_message(serialize_message(message), type(message))


@pytest.fixture(params=["rosbags", "rclpy"])
def library(request: pytest.FixtureRequest) -> tuple[MessageFactory, Send]:
    if request.param == "rosbags":
        return recorded_messages(), send_recorded
    pytest.importorskip("rclpy", reason="rclpy is not installed")
    pytest.importorskip("bodycam_msgs", reason="bodycam_msgs is not built")
    from bodycam_ros.nodes.parameters import node_messages

    return node_messages(), send_live


@pytest.fixture
def rng() -> np.random.Generator:
    return np.random.default_rng(4)


def random_pose(rng: np.random.Generator) -> NDArray[np.float64]:
    return geometry.exp_se3(rng.normal(size=6))


def random_covariance(rng: np.random.Generator) -> NDArray[np.float64]:
    root = rng.normal(size=(6, 6))
    return root @ root.T


def random_tracks(rng: np.random.Generator, count: int, described: int) -> TrackFrame:
    return TrackFrame(
        camera="head",
        stamp_ns=STAMP_NS,
        previous_stamp_ns=STAMP_NS - 33_333_333,
        track_ids=rng.integers(0, 2**32, count, dtype=np.uint32),
        pixels=rng.uniform(0, 640, (count, 2)).astype(np.float32),
        described=rng.permutation(count)[:described].astype(np.uint32),
        descriptors=rng.integers(0, 256, (described, 128), dtype=np.uint8),
        scales=rng.uniform(1, 20, described).astype(np.float32),
        keyframe=described > 0,
        current_R_previous=random_pose(rng)[:3, :3],
        rotation_inliers=count // 2,
        map_identity="9f86d081884c7d65",
    )


def random_matches(rng: np.random.Generator, count: int, registered: bool) -> LandmarkMatches:
    return LandmarkMatches(
        camera="head",
        stamp_ns=STAMP_NS,
        previous_stamp_ns=0,
        track_ids=rng.integers(0, 2**32, count, dtype=np.uint32),
        landmark_ids=rng.integers(0, 2**32, count, dtype=np.uint32),
        pixels=rng.uniform(0, 640, (count, 2)).astype(np.float32),
        points_world=rng.normal(size=(count, 3)).astype(np.float32),
        world_T_camera=random_pose(rng) if registered else None,
        pose_covariance=random_covariance(rng),
        current_R_previous=random_pose(rng)[:3, :3],
        rotation_inliers=7,
        shifts=rng.normal(size=(count, 2)).astype(np.float32) if registered else None,
        readout=Readout(0.0123, 0.0004),
        grown=1,
        map_identity="9f86d081884c7d65+60303ae22b998861",
        tracks_map_identity="9f86d081884c7d65",
    )


def assert_same(came: Any, sent: Any) -> None:
    for f in fields(sent):
        a, b = getattr(came, f.name), getattr(sent, f.name)
        if isinstance(b, np.ndarray):
            assert a.dtype == b.dtype and a.shape == b.shape, f.name
            # Rotations travel as quaternions, covariances in other axes: equal to rounding.
            np.testing.assert_allclose(a, b, atol=1e-13 if b.dtype == np.float64 else 0, rtol=0, err_msg=f.name)
        else:
            assert a == b, f.name


@pytest.mark.parametrize(("count", "described"), [(300, 40), (3, 0), (0, 0)])
def test_tracks_survive_the_wire(
    library: tuple[MessageFactory, Send], rng: np.random.Generator, count: int, described: int
) -> None:
    make, send = library
    sent = random_tracks(rng, count, described)
    message = send(tracks_message(make, sent))
    assert message.header.frame_id == "head_optical_frame"
    assert_same(track_frame(message, "head"), sent)


@pytest.mark.parametrize("covariance", [-np.eye(6), np.zeros((6, 6)), np.full((6, 6), np.nan)])
def test_a_covariance_that_is_none_is_refused(
    library: tuple[MessageFactory, Send], rng: np.random.Generator, covariance: NDArray[np.float64]
) -> None:
    """It ended the solver."""
    make, send = library
    sent = replace(random_matches(rng, 3, True), pose_covariance=covariance)
    with naming(ValueError, "covariance"):
        landmark_matches(send(landmarks_message(make, sent)), "head")


@pytest.mark.parametrize(("count", "registered"), [(120, True), (5, False), (0, False)])
def test_landmarks_survive_the_wire(
    library: tuple[MessageFactory, Send], rng: np.random.Generator, count: int, registered: bool
) -> None:
    make, send = library
    sent = random_matches(rng, count, registered)
    assert_same(landmark_matches(send(landmarks_message(make, sent)), "head"), sent)


@pytest.mark.parametrize("readout", [Readout(0.012, 0.0), Readout(-0.0123, 0.0004), None])
def test_a_cameras_timing_survives_the_wire(library: tuple[MessageFactory, Send], readout: Readout | None) -> None:
    make, send = library
    sent = ClockState(STAMP_NS, STAMP_NS, 0.003, 2e-6, 0.0005, 1e-6)
    message = send(timing_message(make, "head", "sound", readout, sent))
    assert (message.header.frame_id, message.source) == ("head_optical_frame", "sound")
    assert (readout_time(message), clock_state(message)) == (readout, sent)
    unknown = send(timing_message(make, "head", "body", readout))
    assert readout_time(unknown) == readout and math.isnan(clock_state(unknown).offset_sigma)


@pytest.mark.parametrize("readout", [Readout(0.5, 0.0), Readout(math.inf, 0.0), Readout(0.01, -1.0)])
def test_a_readout_time_that_cannot_be_is_refused(readout: Readout) -> None:
    make = recorded_messages()
    with naming(ValueError, "0.1 s"):
        readout_time(timing_message(make, "head", "given", readout))


def test_lengths_that_disagree_are_refused(library: tuple[MessageFactory, Send], rng: np.random.Generator) -> None:
    make, send = library
    message = send(tracks_message(make, random_tracks(rng, 8, 2)))
    message.pixels = message.pixels[:-1]
    with pytest.raises(ValueError):
        track_frame(message, "head")


def test_covariance_is_that_of_positions_and_fixed_axis_rotations(rng: np.random.Generator) -> None:
    """Perturb a pose at random in body axes; measure the spread of position and of rotation about the world's axes."""
    world_T_body, covariance = random_pose(rng), 1e-8 * random_covariance(rng)
    samples = rng.multivariate_normal(np.zeros(6), covariance, 200_000)
    moved = world_T_body @ geometry.exp_se3(samples)
    positions = moved[:, :3, 3] - world_T_body[:3, 3]
    rotations = geometry.log_so3(moved[:, :3, :3] @ world_T_body[:3, :3].T)
    measured = np.cov(np.hstack([positions, rotations]).T)
    np.testing.assert_allclose(ros_covariance(world_T_body, covariance), measured, atol=0.02 * np.abs(measured).max())
    back = body_covariance(world_T_body, ros_covariance(world_T_body, covariance))
    np.testing.assert_allclose(back, covariance, rtol=1e-12, atol=1e-20)


@pytest.fixture
def body(rng: np.random.Generator) -> BodyState:
    poses = np.stack([random_pose(rng) for _ in range(3)])
    segments = np.stack([random_covariance(rng) for _ in range(3)])
    known = BodyUncertainty(segments[0], random_covariance(rng), np.stack([0.01 * np.eye(3)] * 2), segments)
    observed, twists = np.array([True, True, False]), rng.normal(size=(3, 6))
    return BodyState(STAMP_NS, ("pelvis", "torso", "head"), poses, twists, known, observed, 5)


def test_map_points_are_packed_as_rviz_reads_them(library: tuple[MessageFactory, Send]) -> None:
    make, send = library
    points = np.array([[1.0, 2.0, 3.0], [-4.0, 5.5, 6.25]])
    colours = np.array([[255, 128, 0], [1, 2, 3]], np.uint8)
    message = send(map_points_message(make, STAMP_NS, points, colours))
    assert [f.name for f in message.fields] == ["x", "y", "z", "rgb"]
    packed = np.frombuffer(bytes(message.data), np.dtype([("xyz", "<f4", 3), ("bgr", "u1", 3), ("unused", "u1")]))
    np.testing.assert_array_equal(packed["xyz"], points)
    np.testing.assert_array_equal(packed["bgr"][:, ::-1], colours)
    assert (message.width, message.height, message.row_step) == (2, 1, 32)


def test_equipment_survives_the_wire(library: tuple[MessageFactory, Send]) -> None:
    make, send = library
    for said in (report(0), report(30)):
        message = send(equipment_message(make, STAMP_NS, said))
        assert (stamp_ns(message.header.stamp), message.header.frame_id) == (STAMP_NS, "map")
        heard = equipment_report(message)
        for field in fields(said):
            np.testing.assert_array_equal(getattr(heard, field.name), getattr(said, field.name))
    with pytest.raises(ValueError):
        equipment_report(make("bodycam_msgs/msg/EquipmentState", attachments=["pedal"]))


@pytest.mark.parametrize("frame", ["", "a", "thigh_left_imu_frame"])
def test_a_serialized_sample_of_an_inertial_sensor_is_read_without_rclpy(frame: str) -> None:
    make = recorded_messages()
    message = imu_message(
        make, "head", 1_700_000_000_123_456_789, np.array([0.1, -2.0, 3e3]), np.array([9.8, 0.0, -1.0])
    )
    message.header.frame_id = frame
    for little_endian in (True, False):
        cdr = bytes(recording_typestore().serialize_cdr(message, IMU_TYPE, little_endian=little_endian))
        assert imu_row_of_cdr(cdr) == imu_row(message)
    with naming(ValueError, "sensor_msgs/Imu", "60 bytes"):
        imu_row_of_cdr(cdr[:60])
