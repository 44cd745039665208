"""What a static camera says of segments: through a bag, and malformed."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from helpers.naming import naming

from bodycam_ros.body_state import SegmentPose
from bodycam_ros.geometry import exp_se3
from bodycam_ros.messages.factory import Message, stamp_ns
from bodycam_ros.messages.poses import transform_from_pose
from bodycam_ros.messages.segment_poses import (
    SEGMENT_POSES,
    SEGMENT_POSES_TYPE,
    observed_segments,
    segment_poses_message,
)
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


def message_of(said: list[SegmentPose]) -> Message:
    shares = np.array([*CONFIDENCE.values()])
    return segment_poses_message(recorded_messages(), STAMP_NS, "ext_02", said, [*CONFIDENCE], shares)


CONFIDENCE = {"pelvis": 1.0, "thigh_left": 0.75, "foot_right": 0.3, "foot_left": 0.1, "head": 0.0}


def check_same(heard: Message, said: list[SegmentPose]) -> None:
    assert (heard.station, stamp_ns(heard.header.stamp)) == ("ext_02", STAMP_NS)
    assert dict(zip(heard.looked_for, heard.confidence, strict=True)) == CONFIDENCE
    assert heard.segments == [pose.segment for pose in said]
    for mine, theirs in zip(heard.poses, said, strict=True):
        np.testing.assert_allclose(transform_from_pose(mine), theirs.world_T_segment, atol=1e-12)
    covariances = np.array([pose.covariance for pose in said]).ravel()
    np.testing.assert_array_equal(heard.covariances, covariances)


def test_what_is_said_survives_a_bag(tmp_path: Path) -> None:
    said = evidence(np.random.default_rng(1))
    topic = f"/ext_02{SEGMENT_POSES}"
    with write_recording(tmp_path / "bag") as writer:
        for poses in (said, []):
            message = message_of(poses)
            assert message.header.frame_id == "map"
            writer.write(topic, STAMP_NS, message)
    with BagFile(tmp_path / "bag") as bag:
        assert bag.topics == {topic: SEGMENT_POSES_TYPE}
        heard = [message for _, _, message in bag.messages([topic])]
    for message, poses in zip(heard, (said, []), strict=True):
        check_same(message, poses)
        assert observed_segments(message) == ("ext_02", STAMP_NS, len(poses), pytest.approx(0.43))


@pytest.mark.parametrize(
    ("field", "change", "named"),
    [
        ("station", lambda m: "", "station"),
        ("confidence", lambda m: m.confidence[:4], "5"),
        ("confidence", lambda m: np.array([1.0, 0.5, np.nan, 0.0, 0.0]), "foot_right"),
    ],
)
def test_what_contradicts_itself_is_refused(field: str, change: Callable[[Message], Any], named: str) -> None:
    make = recorded_messages()
    message = message_of(evidence(np.random.default_rng(3)))
    fields = {name: getattr(message, name) for name in message.__dataclass_fields__ if name != "__msgtype__"}
    with naming(ValueError, named):
        observed_segments(make(SEGMENT_POSES_TYPE, **(fields | {field: change(message)})))
