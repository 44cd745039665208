"""Damaged bags are read up to the damage, with a warning that names the file and the time; ranges by the index."""

import shutil
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import yaml
from helpers.naming import naming
from helpers.tiny_bag import START_NS, write_by_rosbags, write_camera_info
from mcap.reader import make_reader

from bodycam_ros.errors import RecordingError
from bodycam_ros.messages.factory import header_message
from bodycam_ros.recording.bag_file import BagFile
from bodycam_ros.recording.bag_reader import open_recording
from bodycam_ros.recording.bag_writer import write_recording
from bodycam_ros.recording.typestore import recorded_messages

FRAMES, FRAME_NS = 40, 10_000_000
IMAGES = "/front/image_raw/compressed"


@pytest.fixture
def bag(tmp_path: Path) -> Path:
    """A bag of 40 images of 100 KB, so in several chunks."""
    make = recorded_messages()
    with write_recording(tmp_path / "walk", command="a recorder") as writer:
        for frame in range(FRAMES):
            stamp_ns = START_NS + frame * FRAME_NS
            write_camera_info(writer, "front", stamp_ns)
            header = header_message(make, stamp_ns, "front_optical_frame")
            data = np.random.default_rng(frame).integers(0, 256, 100_000, np.uint8)
            writer.write(IMAGES, stamp_ns, make("sensor_msgs/msg/CompressedImage", header=header, data=data))
    return tmp_path / "walk"


def chunks_of(file: Path) -> list[tuple[int, int]]:
    """Where the chunks begin and end."""
    with file.open("rb") as opened:
        summary = make_reader(opened).get_summary()
    assert summary is not None
    return [(each.chunk_start_offset, each.chunk_start_offset + each.chunk_length) for each in summary.chunk_indexes]


def images_of(path: Path) -> list[tuple[int, bytes]]:
    with BagFile(path) as opened:
        return [(stamp_ns, message.data.tobytes()) for _, stamp_ns, message in opened.messages([IMAGES])]


def cut(file: Path, at: int) -> None:
    file.write_bytes(file.read_bytes()[:at])


def overwrite(file: Path, at: int, content: bytes) -> None:
    with file.open("r+b") as opened:
        opened.seek(at)
        opened.write(content)


@pytest.mark.parametrize("how", ["compressed", "plain"])
@pytest.mark.parametrize("through", ["folder", "file"])
def test_what_is_cut_off_is_read_up_to_there(
    bag: Path, caplog: pytest.LogCaptureFixture, how: str, through: str
) -> None:
    if how == "plain":
        write_by_rosbags(bag)
    file = bag / "walk.mcap"
    whole, chunks = images_of(bag), chunks_of(file)
    assert len(whole) == FRAMES and len(chunks) > 3
    cut(file, chunks[2][1] - 1000)  # within the third
    path = bag if through == "folder" else file
    read = images_of(path)
    assert 10 < len(read) < FRAMES
    assert read == whole[: len(read)], "each message is whole"
    until_ns = read[-1][0]
    after_s = (until_ns - START_NS) * 1e-9
    assert f"{file}: is cut off; it is read up to {after_s:.3f} s" in caplog.text
    assert f"({until_ns} ns)" in caplog.text
    with open_recording(path) as recording:
        assert recording.duration_s == pytest.approx(after_s)
        assert len(list(recording.images())) == len(read)
        counted = FRAMES if through == "folder" else len(read)  # metadata.yaml counts them
        assert recording.image_count("front") == counted
        assert recording.lost["front"] == counted - len(read)
        assert "walk.mcap: is cut off" in recording.damage


def test_a_range_of_time_of_what_is_cut_off(bag: Path) -> None:
    cut(bag / "walk.mcap", chunks_of(bag / "walk.mcap")[2][1])
    start_ns, stop_ns = START_NS + 5 * FRAME_NS, START_NS + 13 * FRAME_NS
    with BagFile(bag) as opened:
        stamps = [stamp_ns for _, stamp_ns, _ in opened.messages([IMAGES], start_ns, stop_ns)]
    assert stamps == list(range(start_ns, stop_ns, FRAME_NS))


def test_damage_within_ends_the_reading_there(bag: Path, caplog: pytest.LogCaptureFixture) -> None:
    file = bag / "walk.mcap"
    whole, (begin, end) = images_of(bag), chunks_of(file)[2]
    overwrite(file, (begin + end) // 2, b"\xff" * 1000)
    read = images_of(bag)
    assert 10 < len(read) < FRAMES and read == whole[: len(read)]
    assert f"{bag}: is damaged inside" in caplog.text
    assert f"it is read up to {(read[-1][0] - START_NS) * 1e-9:.3f} s" in caplog.text
    with open_recording(bag) as recording:
        assert recording.damage == ""
        assert len(list(recording.images())) == len(read)
        assert recording.lost["front"] == FRAMES - len(read)
        assert "is damaged inside" in recording.damage


def test_a_range_of_time_is_read_by_the_index(bag: Path, caplog: pytest.LogCaptureFixture) -> None:
    """Damage outside the range is not even noticed: those chunks are not read."""
    file = bag / "walk.mcap"
    begin, end = chunks_of(file)[0]
    overwrite(file, (begin + end) // 2, b"\xff" * 1000)
    start_ns, stop_ns = START_NS + 20 * FRAME_NS, START_NS + 25 * FRAME_NS
    with BagFile(bag) as opened:
        stamps = [stamp_ns for _, stamp_ns, _ in opened.messages([IMAGES], start_ns, stop_ns)]
        assert opened.damage == ""
    assert stamps == list(range(start_ns, stop_ns, FRAME_NS))
    assert not caplog.records
    with naming(RecordingError, bag, "mcap recover"):
        images_of(bag)  # nothing is before it


@pytest.mark.parametrize(
    "damage",
    [
        lambda file: overwrite(file, file.stat().st_size - 8 - 20, b"\x77" * 8),
        lambda file: overwrite(file, file.stat().st_size - 3, b"\x77"),
        lambda file: cut(file, file.stat().st_size - 2000),
    ],
    ids=["index elsewhere", "end", "half an index"],
)
def test_without_its_index_everything_is_read(
    bag: Path, caplog: pytest.LogCaptureFixture, damage: Callable[[Path], None]
) -> None:
    file = bag / "walk.mcap"
    whole = images_of(file)
    damage(file)
    assert images_of(file) == whole
    assert f"{file}: its index is damaged; it is read up to 0.390 s" in caplog.text


def test_the_second_file_of_a_bag_is_cut_off(bag: Path, tmp_path: Path) -> None:
    later = tmp_path / "later" / "walk"
    with write_recording(later) as writer, BagFile(bag) as first:
        for topic, stamp_ns, message in first.messages([IMAGES, "/front/camera_info"]):
            writer.write(topic, stamp_ns + 10**9, message)
    shutil.copy(later / "walk.mcap", bag / "second.mcap")
    document = yaml.safe_load((bag / "metadata.yaml").read_text())
    information = document["rosbag2_bagfile_information"]
    information["relative_file_paths"] = ["walk.mcap", "second.mcap"]
    for each in information["topics_with_message_count"]:
        each["message_count"] *= 2
    (bag / "metadata.yaml").write_text(yaml.safe_dump(document))
    assert len(images_of(bag)) == 2 * FRAMES
    cut(bag / "second.mcap", chunks_of(bag / "second.mcap")[2][1])
    assert FRAMES + 10 < len(images_of(bag)) < 2 * FRAMES
    with BagFile(bag) as opened:
        assert f"{bag}/second.mcap: is cut off" in opened.damage
        assert opened.message_count(IMAGES) == 2 * FRAMES
