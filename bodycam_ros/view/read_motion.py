"""Reads the movement of a body from a bag that ``bodycam replay`` or the live graph wrote."""

from collections import defaultdict
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.body.joint_angles import JointAngles
from bodycam_ros.errors import BodyError, RecordingError
from bodycam_ros.evaluate.read_solved import camera_topics
from bodycam_ros.geometry import Array
from bodycam_ros.messages.factory import Message, numbers
from bodycam_ros.messages.header import stamp_ns
from bodycam_ros.messages.pose import transform_from_pose
from bodycam_ros.recording.bag_file import BagFile
from bodycam_ros.view.motion import Motion

_JOINTS, _ROOT = "/joint_states", "/odometry"
_TYPES = {_JOINTS: "sensor_msgs/msg/JointState", _ROOT: "nav_msgs/msg/Odometry"}
_POSE, _POSE_TYPE = "/pose", "geometry_msgs/msg/PoseWithCovarianceStamped"


def read_motion(path: Path, body: BodyModel) -> Motion:
    """Read how a body moved.

    Args:
        path: ros2 bag folder or .mcap file.
        body: that it should be the motion of.

    Raises:
        RecordingError: not a bag, or without joint states and odometry of the same instants.
        BodyError: the bag is of a body with other joints or another root.
    """
    angles: dict[int, Array] = {}
    root: dict[int, Array] = {}
    poses: dict[str, dict[int, Array]] = defaultdict(dict)
    names = JointAngles(body).names
    with BagFile(path) as bag:
        _check_topics(bag)
        cameras = {t: c for t, c in camera_topics(bag, _POSE, _POSE_TYPE).items() if c in body.mounts}
        for topic, _, message in bag.messages([_JOINTS, _ROOT, *cameras]):
            stamp = stamp_ns(message.header.stamp)
            if topic == _JOINTS:
                angles[stamp] = _angles(message, names, path)
            elif topic == _ROOT:
                _check_root(message, body, path)
                root[stamp] = transform_from_pose(message.pose.pose)
            else:
                poses[cameras[topic]][stamp] = transform_from_pose(message.pose.pose)
    stamps = sorted(s for s in angles if s in root and np.isfinite(angles[s]).all() and np.isfinite(root[s]).all())
    if not stamps:
        raise RecordingError(
            f"{path}: no {_JOINTS} has an {_ROOT} of the same stamp and finite values; were both recorded, and by one "
            "solver?"
        )
    return Motion(
        stamps_ns=np.array(stamps, dtype=np.int64),
        world_T_root=np.array([root[stamp] for stamp in stamps]),
        angle_names=names,
        angles=np.array([angles[stamp] for stamp in stamps]).reshape(len(stamps), len(names)),
        # Where some cameras' poses were recorded, a camera without one never knew where it was.
        registered={camera: _in_order(poses[camera]) for camera in body.mounts} if cameras else {},
    )


def _in_order(poses: dict[int, Array]) -> tuple[NDArray[np.int64], Array]:
    stamps = sorted(poses)
    return np.array(stamps, dtype=np.int64), np.array([poses[stamp] for stamp in stamps]).reshape(-1, 4, 4)


def _check_topics(bag: BagFile) -> None:
    for topic, wanted in _TYPES.items():
        kind = bag.topics.get(topic)
        if kind != wanted or bag.message_count(topic) == 0:
            came = "no such topic" if kind is None else "no message on it" if kind == wanted else f"it is {kind}"
            raise RecordingError(
                f"{bag.path}: expected {topic} ({wanted}), {came}; OUT is a bag that 'bodycam replay' wrote, the "
                "images that it was made from go to --recording"
            )


def _angles(message: Message, names: tuple[str, ...], path: Path) -> Array:
    if set(message.name) != set(names):
        lacking = [name for name in names if name not in message.name]
        foreign = [name for name in message.name if name not in names]
        raise BodyError(
            f"{path}: {_JOINTS} is of another body than the one given with --body: "
            f"only the body has {', '.join(lacking) or 'none'}; only the bag has {', '.join(foreign) or 'none'}"
        )
    column = {name: column for column, name in enumerate(message.name)}
    try:
        values = numbers(message.position, np.float64, len(message.name))
    except ValueError as error:
        raise RecordingError(f"{path}: a message on {_JOINTS} has not as many positions as names") from error
    return values[[column[name] for name in names]]


def _check_root(message: Message, body: BodyModel, path: Path) -> None:
    if message.child_frame_id != body.root:
        raise BodyError(f"{path}: {_ROOT} is of {message.child_frame_id!r}, but the root of the body is {body.root!r}")
