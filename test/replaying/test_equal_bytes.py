"""What is written is the same to the byte for any number of processes."""

import dataclasses
from pathlib import Path

import pytest
from helpers.altered_sample import write_altered_sample

from bodycam_ros.messages.factory import Message
from bodycam_ros.pipeline.settings import PipelineSettings
from bodycam_ros.replaying.replay import replay
from bodycam_ros.replaying.replay_request import ReplayRequest

CAMERAS = ("waist_front", "torso_front", "thigh_left", "shin_left")
_OFF_NS = {"torso_front": 20_000_000, "shin_left": -13_000_000}


def with_other_clocks(topic: str, number: int, message: Message) -> Message:
    """Stamps whose order among cameras is not that of the recording."""
    stamp = message.header.stamp
    ns = stamp.sec * 10**9 + stamp.nanosec + _OFF_NS.get(topic.split("/")[1], 0)
    stamp = dataclasses.replace(stamp, sec=ns // 10**9, nanosec=ns % 10**9)
    return dataclasses.replace(message, header=dataclasses.replace(message.header, stamp=stamp))


@pytest.fixture(scope="module", params=["one clock", "other clocks"])
def recording(request: pytest.FixtureRequest, sample: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("recorded") / "bag"
    alter = with_other_clocks if request.param == "other clocks" else lambda topic, number, message: message
    return write_altered_sample(sample, folder, alter, CAMERAS, frames=20)


def test_any_number_of_processes_gives_equal_bytes(recording: Path, sample: Path, tmp_path: Path) -> None:
    written = []
    for jobs in (1, 2, 3, 4):
        out = tmp_path / str(jobs) / "out"
        replay(ReplayRequest(recording, sample / "map", sample / "body.yaml", out, PipelineSettings(), jobs=jobs))
        written.append({file.name: file.read_bytes() for file in out.iterdir()})
    assert len(written[0]) == 2
    assert all(each == written[0] for each in written)
