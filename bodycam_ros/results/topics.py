"""The topics of a solved bag."""

import math
from collections.abc import Collection, Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.body.urdf import body_from_urdf
from bodycam_ros.camera.readout import Readout, readout_of
from bodycam_ros.errors import BodyError, RecordingError
from bodycam_ros.messages.factory import Message
from bodycam_ros.messages.timing import TIMING, TIMING_TYPE, clock_state
from bodycam_ros.messages.tracks import landmark_matches
from bodycam_ros.recording.bag_file import BagFile
from bodycam_ros.registration.landmark_matches import LandmarkMatches
from bodycam_ros.timing.clock_state import ClockHistory, ClockState

ROBOT, ROBOT_TYPE = "/robot_description", "std_msgs/msg/String"
JOINT_STATES, ODOMETRY = "/joint_states", "/odometry"
MOTION_TOPICS = {JOINT_STATES: "sensor_msgs/msg/JointState", ODOMETRY: "nav_msgs/msg/Odometry"}
"""Topic -> type of what a body's motion is published on."""

LANDMARKS, LANDMARKS_TYPE = "/landmarks", "bodycam_msgs/msg/LandmarkMatches"
"""End and type of a camera's topic of registrations."""


def published_robot(bag: BagFile) -> str:
    """The URDF that was published last; empty if none was."""
    text = ""
    if bag.topics.get(ROBOT) == ROBOT_TYPE:
        for _, _, message in bag.messages([ROBOT]):
            text = str(message.data)
    return text


def published_body(bag: BagFile) -> BodyModel | None:
    """The body that was published last; None if none was.

    Raises:
        RecordingError: what was published is no body.
    """
    try:
        return body_from_urdf(text) if (text := published_robot(bag)) else None
    except BodyError as error:
        raise RecordingError(f"{bag.path}: {ROBOT}: {error}") from error


def read_landmarks(path: Path, cameras: Collection[str]) -> Iterator[LandmarkMatches]:
    """The registrations of some cameras, in the order of the bag.

    Raises:
        RecordingError: the bag or a message is damaged.
    """
    with BagFile(path) as bag:
        topics = {t: c for t, c in bag.camera_topics(LANDMARKS, LANDMARKS_TYPE).items() if c in cameras}
        for topic, _, message in bag.messages(topics):
            with wrong_message_named(path, topic):
                matches = landmark_matches(message, topics[topic])
            yield matches


def read_clock(path: Path, camera: str) -> ClockHistory | None:
    """How the clock of a camera went; None where it is not in the bag.

    Raises:
        RecordingError: the bag is damaged.
    """
    topic = f"/{camera}{TIMING}"
    with BagFile(path) as bag:
        if bag.topics.get(topic) != TIMING_TYPE:
            return None
        return clock_history(camera, (message for _, _, message in bag.messages([topic])))


def clock_history(camera: str, timings: Iterable[Message]) -> ClockHistory | None:
    """The clock by bodycam_msgs/CameraTiming of a camera, with the last read-out time; None where none has a clock."""
    clocks: dict[int, ClockState] = {}
    readout: Readout | None = None
    for message in timings:
        if not math.isnan(message.offset_sigma):
            clock = clock_state(message)
            clocks[clock.since_ns] = clock
        readout = readout_of(message.readout_time, message.readout_sigma) or readout
    return ClockHistory(camera, tuple(clocks[since] for since in sorted(clocks)), readout) if clocks else None


@contextmanager
def wrong_message_named(path: Path, topic: str) -> Iterator[None]:
    """Raise a ValueError of the block as RecordingError that names the bag and the topic."""
    try:
        yield
    except ValueError as error:
        raise RecordingError(f"{path}: a message on {topic} contradicts itself: {error}") from error
