"""Published velocities against those of the truth, beside differences of the published positions."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from rosbags.highlevel import AnyReader
from scipy.interpolate import CubicSpline
from scipy.spatial.transform import Rotation, RotationSpline

from bodycam_ros.body.body_file import read_body
from bodycam_ros.geometry import Array, rigid
from bodycam_ros.kinematics.joint_angles import JointAngles, JointAngleTracker

_SINGULAR = 4.0
"""Rates of angles beyond which, near a middle angle of 90 degrees, noise is all that they show."""


def _messages(bag: Path, topic: str) -> Iterator[Any]:
    with AnyReader([bag]) as reader:
        connections = [each for each in reader.connections if each.topic == topic]
        for connection, _, raw in reader.messages(connections):
            yield reader.deserialize(raw, connection.msgtype)


def _true_poses(folder: Path, segments: tuple[str, ...]) -> tuple[Array, Array]:
    """Times (N,) [s] and world_T_segment (N, S, 4, 4)."""
    rows = [np.loadtxt(folder / f"{segment}.tum") for segment in segments]
    poses = [rigid(Rotation.from_quat(each[:, 4:]).as_matrix(), each[:, 1:4]) for each in rows]
    return rows[0][:, 0] - rows[0][0, 0], np.stack(poses, axis=1)


def _rms(values: Array) -> float:
    return float(np.sqrt(np.nanmean(values**2)))


def test_velocities_are_nearer_to_the_truth_than_differences_of_positions(sample: Path, sample_out: Path) -> None:
    body = read_body(sample / "body.yaml")
    times_s, poses = _true_poses(sample / "sample/truth/segments", body.segments)
    tracker, joint_angles = JointAngleTracker(body), JointAngles(body)
    angles = np.unwrap([tracker.angles(each) for each in poses], axis=0)
    true = CubicSpline(times_s, angles)(times_s, 1)
    true[[np.abs(joint_angles.rates(each)).max(axis=1) > _SINGULAR for each in angles]] = np.nan
    states = list(_messages(sample_out, "/joint_states"))
    assert len(states) == len(times_s) and tuple(states[0].name) == tracker.names
    positions = np.unwrap([state.position for state in states], axis=0)
    inner = slice(1, -1)
    central = (positions[2:] - positions[:-2]) / (times_s[2:] - times_s[:-2])[:, None]
    published = _rms((np.array([state.velocity for state in states]) - true)[inner])
    assert published < 0.1 and published < 0.5 * _rms(central - true[inner])

    root, world_T_root = body.root, poses[:, body.segment_index[body.root]]
    world_R_root = world_T_root[:, :3, :3]
    turning = RotationSpline(times_s, Rotation.from_matrix(world_R_root))(times_s, 1)
    moving = (np.swapaxes(world_R_root, 1, 2) @ CubicSpline(times_s, world_T_root[:, :3, 3])(times_s, 1)[..., None])[
        ..., 0
    ]
    odometry = list(_messages(sample_out, "/odometry"))
    assert {each.child_frame_id for each in odometry} == {root}
    twists = [each.twist.twist for each in odometry]
    angular = np.array([(t.angular.x, t.angular.y, t.angular.z) for t in twists])
    linear = np.array([(t.linear.x, t.linear.y, t.linear.z) for t in twists])
    assert _rms((angular - turning)[inner]) < 0.06 and _rms((linear - moving)[inner]) < 0.02
