"""Recordings whose cameras are in a namespace, or have other drivers' names."""

import pytest

from bodycam_ros.errors import RecordingError
from bodycam_ros.recording.topic_names import AS_RECORDED, TopicNames


def test_topics_are_found_by_namespace_and_table() -> None:
    assert AS_RECORDED.own("/anna/head/image_raw") == "/anna/head/image_raw"
    anna = TopicNames.parse("anna/", [])
    assert anna.own("/anna/head/camera_info") == "/head/camera_info"
    assert anna.own("/ben/head/camera_info") is None and anna.own("/annabel/head/imu") is None
    foreign = TopicNames.parse(
        "", ["head=/cam0/color/image_raw/compressed", "chest=/cam1/image_color", "head/imu=/imu"]
    )
    assert foreign.own("/cam0/color/image_raw/compressed") == "/head/image_raw/compressed"
    assert foreign.own("/cam0/color/image_raw") == "/head/image_raw"
    assert foreign.own("/cam0/color/camera_info") == "/head/camera_info"
    assert foreign.own("/cam1/image_color") == "/chest/image_raw"
    assert foreign.own("/cam1/camera_info") == "/chest/camera_info"
    assert foreign.own("/imu") == "/head/imu" and foreign.own("/foot/imu") == "/foot/imu"


@pytest.mark.parametrize("rows", [["head"], ["head=cam0"], ["=/cam0"], ["head=/a", "head=/b"]])
def test_malformed_rows_are_refused(rows: list[str]) -> None:
    with pytest.raises(RecordingError, match="topics"):
        TopicNames.parse("", rows)
