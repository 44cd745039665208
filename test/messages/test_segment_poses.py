"""What a static camera says of segments: through a bag, over the wire of rclpy, and malformed."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from bodycam_ros.body_state import SegmentMeasurements, SegmentPose
from bodycam_ros.geometry import exp_se3
from bodycam_ros.messages.factory import Message, MessageFactory
from bodycam_ros.messages.segment_poses import SEGMENT_POSES, SEGMENT_POSES_TYPE, segment_poses, segment_poses_message
from bodycam_ros.recording.bag_file import BagFile
from bodycam_ros.recording.bag_writer import write_recording
from bodycam_ros.recording.typestore import recorded_messages

STAMP_NS = 1_700_000_000_123_456_789


def evidence(rng: np.random.Generator) -> list[SegmentPose]:
    """Three segments, whose depth is all but free."""
    said = []
    for segment in ("pelvis", "thigh_left", "foot_right"):
        factor = rng.normal(0.0, 0.005, (6, 6))
        covariance = factor @ factor.T + np.diag([0.0, 0.0, 1.0, 0.0, 0.0, 1.0])
        said.append(SegmentPose(segment, exp_se3(rng.normal(size=6)), covariance))
    return said


CONFIDENCE = {"pelvis": 1.0, "thigh_left": 0.75, "foot_right": 0.3, "foot_left": 0.1, "head": 0.0}


def check_same(heard: SegmentMeasurements, said: list[SegmentPose]) -> None:
    assert (heard.station, heard.stamp_ns, heard.confidence) == ("ext_02", STAMP_NS, CONFIDENCE)
    assert [pose.segment for pose in heard.evidence] == [pose.segment for pose in said]
    for mine, theirs in zip(heard.evidence, said, strict=True):
        np.testing.assert_allclose(mine.world_T_segment, theirs.world_T_segment, atol=1e-12)
        np.testing.assert_array_equal(mine.covariance, theirs.covariance)


def test_what_is_said_survives_a_bag(tmp_path: Path) -> None:
    said = evidence(np.random.default_rng(1))
    topic = f"/ext_02{SEGMENT_POSES}"
    with write_recording(tmp_path / "bag") as writer:
        for poses in (said, []):
            message = segment_poses_message(recorded_messages(), STAMP_NS, "ext_02", poses, CONFIDENCE)
            assert message.header.frame_id == "map"
            writer.write(topic, STAMP_NS, message)
    with BagFile(tmp_path / "bag") as bag:
        assert bag.topics == {topic: SEGMENT_POSES_TYPE}
        heard = [segment_poses(message) for _, _, message in bag.messages([topic])]
    check_same(heard[0], said)
    check_same(heard[1], [])


def with_nan_position(make: MessageFactory) -> Message:
    return make("geometry_msgs/msg/Pose", position=make("geometry_msgs/msg/Point", x=np.nan))


def changed(row: int, column: int, value: float) -> Callable[[Message], Any]:
    """One number of the second segment's covariance."""

    def change(message: Message) -> Any:
        covariances = message.covariances.reshape(-1, 6, 6).copy()
        covariances[1, row, column] = value
        return covariances.ravel()

    return change


@pytest.mark.parametrize(
    ("field", "change", "named"),
    [
        ("station", lambda m: "", "station"),
        ("segments", lambda m: m.segments[:2], "poses"),
        ("segments", lambda m: ["pelvis", "pelvis", "head"], "pelvis"),
        ("poses", lambda m: [*m.poses[:2], with_nan_position(recorded_messages())], "foot_right"),
        ("covariances", changed(0, 0, np.nan), "thigh_left"),
        ("covariances", changed(2, 2, 0.0), "thigh_left"),
        ("confidence", lambda m: m.confidence[:4], "confidence"),
        ("confidence", lambda m: np.array([1.0, 0.5, np.nan, 0.0, 0.0]), "foot_right"),
    ],
)
def test_what_contradicts_itself_is_refused(field: str, change: Callable[[Message], Any], named: str) -> None:
    make = recorded_messages()
    message = segment_poses_message(make, STAMP_NS, "ext_02", evidence(np.random.default_rng(3)), CONFIDENCE)
    fields = {name: getattr(message, name) for name in message.__dataclass_fields__ if name != "__msgtype__"}
    with pytest.raises(ValueError, match=named):
        segment_poses(make(SEGMENT_POSES_TYPE, **(fields | {field: change(message)})))
