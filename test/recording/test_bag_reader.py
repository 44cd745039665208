"""Cameras, intrinsics and images of a bag; damaged and foreign bags."""

import logging
import os
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import yaml
from helpers.naming import naming
from helpers.tiny_bag import (
    FRAME_NS,
    HEIGHT,
    START_NS,
    WIDTH,
    write_by_rosbags,
    write_camera_info,
    write_jpeg,
    write_tiny_bag,
)
from mcap.writer import Writer as McapWriter
from rosbags.rosbag1 import Writer as Rosbag1Writer

from bodycam_ros.camera.camera_image import decode_colour, decode_grey
from bodycam_ros.camera.readout import Readout
from bodycam_ros.errors import LensError, RecordingError
from bodycam_ros.messages.diagnostics import text_message
from bodycam_ros.messages.factory import header_message
from bodycam_ros.messages.images import INFO_TYPE
from bodycam_ros.messages.timing import timing_message
from bodycam_ros.recording.bag_reader import open_recording
from bodycam_ros.recording.bag_writer import RecordingWriter, write_recording
from bodycam_ros.recording.typestore import recorded_messages


def test_folder_and_file_give_the_same_images(tiny_bag: Path) -> None:
    with open_recording(tiny_bag) as folder, open_recording(tiny_bag / "tiny.mcap") as file:
        assert folder.cameras == file.cameras == ("left", "right")
        assert folder.image_count("left") == 4
        assert folder.duration_s == pytest.approx(3 * FRAME_NS * 1e-9)
        assert list(folder.images()) == list(file.images())


def test_images_come_in_order_of_time_and_decode(tiny_bag: Path) -> None:
    with open_recording(tiny_bag) as recording:
        images = list(recording.images())
    assert [i.stamp_ns for i in images] == sorted(i.stamp_ns for i in images)
    assert {i.camera for i in images} == {"left", "right"}
    grey = decode_grey(images[-1])
    assert grey.shape == (HEIGHT, WIDTH) and grey.dtype == np.uint8
    assert abs(float(grey.mean()) - 40) < 1


def test_one_camera_alone(tiny_bag: Path) -> None:
    with open_recording(tiny_bag) as recording:
        assert [i.stamp_ns for i in recording.images(["right"])] == [START_NS + k * FRAME_NS for k in range(4)]
        with naming(RecordingError, "camera 'knee'", "left, right"):
            list(recording.images(["knee"]))


def write_timing(*readouts: Readout | None) -> Callable[[RecordingWriter], None]:
    """What appends the timing of the left camera."""

    def write(writer: RecordingWriter) -> None:
        for readout in readouts:
            message = timing_message(recorded_messages(), "left", "given", readout)
            writer.write("/left/timing", START_NS, message)

    return write


def test_timing_is_read_where_it_is(tmp_path: Path) -> None:
    bag = write_tiny_bag(tmp_path / "timed", alter=write_timing(Readout(0.012, 0.0)))
    with open_recording(bag) as recording:
        assert recording.cameras == ("left", "right")
        assert recording.readout("left") == Readout(0.012, 0.0)
        assert recording.readout("right") is None


def test_a_readout_time_that_cannot_be_is_named(tmp_path: Path) -> None:
    bag = write_tiny_bag(tmp_path / "timed", alter=write_timing(Readout(12.0, 0.0)))
    with (
        open_recording(bag) as recording,
        naming(RecordingError, "camera left", "/left/timing", "12 s"),
    ):
        recording.readout("left")


def test_intrinsics_come_from_the_first_camera_info(tiny_bag: Path) -> None:
    with open_recording(tiny_bag) as recording:
        model = recording.camera_model("left")
    assert (model.name, model.width, model.height, model.distortion_model) == ("left", WIDTH, HEIGHT, "equidistant")
    assert (model.fx, model.cx) == (30.0, 31.5)


def test_camera_without_info_is_named(tmp_path: Path) -> None:
    with (
        open_recording(write_tiny_bag(tmp_path / "bag", infos=("left",))) as recording,
        naming(LensError, "camera right", "/right/camera_info"),
    ):
        recording.camera_model("right")


@pytest.mark.parametrize(
    "change",
    [
        {"distortion_model": "scaramuzza"},
        {"k": np.array([np.nan, 0.0, 31.5, 0.0, 30.0, 23.5, 0.0, 0.0, 1.0])},
        {"k": np.zeros(9)},
        {"width": 0},
        {"width": 4_000_000_000, "height": 4_000_000_000},
    ],
)
def test_malformed_intrinsics_name_the_camera(tmp_path: Path, change: dict[str, object]) -> None:
    def alter(writer: RecordingWriter) -> None:
        write_camera_info(writer, "right", START_NS, **change)

    bag = write_tiny_bag(tmp_path / "bag", infos=(), alter=alter)
    with open_recording(bag) as recording, naming(LensError, "camera right"):
        recording.camera_model("right")


def test_a_damaged_camera_info_costs_no_camera(tmp_path: Path) -> None:
    def alter(writer: RecordingWriter) -> None:
        for number, k in enumerate((np.zeros(9), np.array([31.0, 0.0, 31.5, 0.0, 30.0, 23.5, 0.0, 0.0, 1.0]))):
            write_camera_info(writer, "right", START_NS + number, k=k)

    with open_recording(write_tiny_bag(tmp_path / "bag", infos=(), alter=alter)) as recording:
        assert recording.camera_model("right").fx == 31.0


def test_a_camera_info_that_cannot_be_decoded_is_there_and_damaged(tmp_path: Path) -> None:
    def alter(writer: RecordingWriter) -> None:
        for number in range(3):
            writer.write_serialized("/right/camera_info", INFO_TYPE, START_NS + number, b"\0\1\0\0 odd")

    with (
        open_recording(write_tiny_bag(tmp_path / "bag", infos=(), alter=alter)) as recording,
        naming(LensError, "camera right", "3 messages", "/right/camera_info"),
    ):
        recording.camera_model("right")


def test_the_camera_of_a_binned_part_of_the_image(tmp_path: Path) -> None:
    make = recorded_messages()

    def alter(writer: RecordingWriter) -> None:
        roi = make("sensor_msgs/msg/RegionOfInterest", x_offset=8, y_offset=4, width=48, height=40, do_rectify=False)
        write_camera_info(writer, "left", START_NS)
        write_camera_info(writer, "right", START_NS, binning_x=2, binning_y=4, roi=roi)

    with open_recording(write_tiny_bag(tmp_path / "bag", infos=(), alter=alter)) as recording:
        full, part = recording.camera_model("left"), recording.camera_model("right")
    assert (part.width, part.height) == (24, 10)
    points = np.random.default_rng(1).uniform([-0.4, -0.3, 1.0], [0.4, 0.3, 2.0], (50, 3))
    # Of images whose first pixel's corner is 0, parts and sizes are sums and quotients.
    corners = full.project(points)[0] + 0.5
    np.testing.assert_allclose(part.project(points)[0] + 0.5, (corners - [8, 4]) / [2, 4], atol=1e-9)


@pytest.mark.parametrize(
    ("region", "binning", "named"),
    [
        ((0, 0, 65, 48), 1, ("65x48", "0, 0", "64x48")),
        ((40, 0, 30, 48), 1, ("30x48", "40, 0")),
        ((4, 4, 0, 0), 1, ("0x0", "4, 4")),
        ((0, 0, 0, 0), 100, ("camera right", "100x100")),
    ],
)
def test_a_region_of_interest_that_cannot_be_is_named(
    tmp_path: Path, region: tuple[int, int, int, int], binning: int, named: tuple[str, ...]
) -> None:
    make = recorded_messages()

    def alter(writer: RecordingWriter) -> None:
        x, y, width, height = region
        fields = {"x_offset": x, "y_offset": y, "width": width, "height": height, "do_rectify": False}
        roi = make("sensor_msgs/msg/RegionOfInterest", **fields)
        write_camera_info(writer, "right", START_NS, binning_x=binning, binning_y=binning, roi=roi)

    with (
        open_recording(write_tiny_bag(tmp_path / "bag", infos=(), alter=alter)) as recording,
        naming(LensError, *named),
    ):
        recording.camera_model("right")


def test_stamps_that_do_not_increase_are_dropped_counted_and_warned_of_once(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    def alter(writer: RecordingWriter) -> None:
        last = START_NS + 3 * FRAME_NS
        write_jpeg(writer, "left", last + 1, last, 50)  # a duplicate
        write_jpeg(writer, "left", last + 2, START_NS, 60)  # a jump back
        write_jpeg(writer, "left", last + 3, last + FRAME_NS, 70)

    with (
        caplog.at_level(logging.WARNING),
        open_recording(write_tiny_bag(tmp_path / "bag", alter=alter)) as recording,
    ):
        for _ in range(2):
            stamps = [i.stamp_ns for i in recording.images(["left"])]
            assert stamps == [START_NS + k * FRAME_NS for k in range(5)]
            assert recording.dropped == {"left": 2}
    assert [r.getMessage() for r in caplog.records] == 2 * [caplog.records[0].getMessage()]
    assert "camera left" in caplog.text


@pytest.mark.parametrize(("encoding", "channels"), [("mono8", 1), ("bgr8", 3), ("rgb8", 3)])
def test_raw_images_with_padded_rows(tmp_path: Path, encoding: str, channels: int) -> None:
    red = {"mono8": [77], "bgr8": [0, 0, 255], "rgb8": [255, 0, 0]}[encoding]
    rows = np.full((HEIGHT, WIDTH * channels + 5), 200, np.uint8)
    rows[:, :-5] = red * WIDTH
    with write_recording(tmp_path / "bag") as writer:
        write_raw(writer, encoding, rows)
    with open_recording(tmp_path / "bag") as recording:
        (image,) = recording.images()
    expected = 77 if encoding == "mono8" else 76  # 0.299 * 255
    np.testing.assert_array_equal(decode_grey(image), np.full((HEIGHT, WIDTH), expected))
    colour = [77, 77, 77] if encoding == "mono8" else [0, 0, 255]
    np.testing.assert_array_equal(decode_colour(image), np.full((HEIGHT, WIDTH, 3), colour))


@pytest.mark.parametrize(
    ("encoding", "rows", "named"),
    [("32FC1", HEIGHT, ("encoding '32FC1'",)), ("bgr8", HEIGHT, ("bgr8",)), ("mono8", 3, ("mono8", "192 bytes"))],
)
def test_raw_images_that_we_cannot_read(tmp_path: Path, encoding: str, rows: int, named: tuple[object, ...]) -> None:
    with write_recording(tmp_path / "bag") as writer:
        write_raw(writer, encoding, np.zeros((rows, WIDTH), np.uint8))
    with (
        open_recording(tmp_path / "bag") as recording,
        naming(RecordingError, "camera cam", *named),
    ):
        [decode_grey(image) for image in recording.images()]


def write_raw(writer: RecordingWriter, encoding: str, rows: np.ndarray) -> None:
    make = recorded_messages()
    image = make(
        "sensor_msgs/msg/Image",
        header=header_message(make, START_NS, "cam"),
        height=HEIGHT,
        width=WIDTH,
        encoding=encoding,
        step=rows.shape[1],
        data=rows.reshape(-1),
    )
    writer.write("/cam/image_raw", START_NS, image)


def test_bag_without_cameras_lists_what_is_there(tmp_path: Path) -> None:
    with write_recording(tmp_path / "bag") as writer:
        writer.write("/chatter", START_NS, text_message(recorded_messages(), "hello"))
    with (
        naming(RecordingError, tmp_path / "bag", "/chatter", "std_msgs/msg/String"),
        open_recording(tmp_path / "bag"),
    ):
        pass


def refused(path: Path) -> str:
    with pytest.raises(RecordingError) as caught, open_recording(path) as recording:
        for _ in recording.images():
            pass
    assert str(path) in str(caught.value)
    return str(caught.value)


def test_a_solved_bag_is_not_taken_for_a_recording(tmp_path: Path) -> None:
    make = recorded_messages()
    with write_recording(tmp_path / "out") as writer:
        writer.write("/skeleton", 1, make("visualization_msgs/msg/MarkerArray", markers=[]))
        for number in range(30):
            writer.write(f"/topic_{number}", 1, make("std_msgs/msg/Empty"))
    said = refused(tmp_path / "out")
    assert "and 23 more; it is the solved bag of a recording: give the recording" in said


def test_what_is_no_bag(tmp_path: Path) -> None:
    assert "does not exist" in refused(tmp_path / "nothing")
    assert "neither metadata.yaml nor an .mcap file; 'bodycam ingest' makes one" in refused(tmp_path)
    (tmp_path / "film.mp4").write_bytes(b"film")
    assert "is not a bag" in refused(tmp_path / "film.mp4")
    with Rosbag1Writer(tmp_path / "walk.bag"):
        pass
    assert "is a bag of ROS 1; convert it: rosbags-convert --src walk.bag --dst walk" in refused(tmp_path / "walk.bag")
    (tmp_path / "empty.mcap").write_bytes(b"")
    assert "is empty" in refused(tmp_path / "empty.mcap")
    (tmp_path / "takes/walk").mkdir(parents=True)
    (tmp_path / "takes/walk/metadata.yaml").write_text("")
    assert f"is {tmp_path / 'takes/walk'} meant?" in refused(tmp_path / "takes")
    (tmp_path / "text.mcap").write_bytes(b"hello, I am not MCAP at all" * 10)
    assert "is not an MCAP file" in refused(tmp_path / "text.mcap")


def test_folder_without_metadata_points_to_its_file(tiny_bag: Path) -> None:
    (tiny_bag / "metadata.yaml").unlink()
    assert "no metadata.yaml; give the file itself (tiny.mcap)" in refused(tiny_bag)


@pytest.mark.parametrize("text", ["", ": [", "rosbag2_bagfile_information: {version: 99}", "[1, 2]"])
def test_folder_with_broken_metadata(tiny_bag: Path, text: str) -> None:
    (tiny_bag / "metadata.yaml").write_text(text)
    said = refused(tiny_bag)
    assert "metadata is not YAML" in said or "give its file itself" in said


@pytest.mark.parametrize("share", [0.05, 0.5])
def test_a_bag_that_is_cut_off_before_any_message_is_refused(tiny_bag: Path, share: float) -> None:
    file = tiny_bag / "tiny.mcap"
    content = file.read_bytes()
    file.write_bytes(content[: int(share * len(content))])
    assert "is cut off" in refused(file)
    assert "tiny.mcap is cut off" in refused(tiny_bag)


def test_damage_in_the_middle_is_an_error_not_a_traceback(tiny_bag: Path) -> None:
    file = tiny_bag / "tiny.mcap"
    content = bytearray(file.read_bytes())
    content[200 : len(content) // 2] = b"\xff" * (len(content) // 2 - 200)
    file.write_bytes(content)
    refused(file)


def test_what_is_lost_inside_is_counted_against_the_metadata(tiny_bag: Path) -> None:
    """Zeros over two messages: nothing in the file tells that something was there, but the statistics do."""
    write_by_rosbags(tiny_bag)
    file = tiny_bag / "tiny.mcap"
    content = bytearray(file.read_bytes())
    images = [place for place in messages_of(content) if place.stop - place.start > 400]
    assert len(images) == 8
    for place in images[2:4]:
        length = place.stop - place.start
        content[place] = bytes(1) + (length - 9).to_bytes(8, "little") + bytes(length - 9)
    images[5] = slice(images[5].start + 31, images[5].stop)
    content[images[5]] = b"\xff" * (images[5].stop - images[5].start)  # a message that cannot be decoded
    file.write_bytes(content)
    for path in (tiny_bag, file):
        with open_recording(path) as recording:
            assert recording.lost == {}, "nobody looked yet"
            found = list(recording.images())
            assert (len(found), recording.lost) == (5, {"left": 1, "right": 2})
            list(recording.images(["left"]))
            assert recording.lost["left"] == 1


def messages_of(content: bytes) -> list[slice]:
    """Where the message records in the one chunk of a small file are (MCAP's specification, without compression)."""
    at = 8 + 9 + int.from_bytes(content[9:17], "little")
    assert content[at] == 0x06
    end = at + 9 + int.from_bytes(content[at + 1 : at + 9], "little")
    at += 9 + 40
    places = []
    while at < end:
        length = 9 + int.from_bytes(content[at + 1 : at + 9], "little")
        if content[at] == 0x05:
            places.append(slice(at, at + length))
        at += length
    return places


def test_negative_stamps_are_left_out(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    def alter(writer: RecordingWriter) -> None:
        for stamp_ns in (-(10**9), -5):
            write_jpeg(writer, "front", START_NS, stamp_ns, 50)
        write_jpeg(writer, "front", START_NS, START_NS, 50)

    with open_recording(write_tiny_bag(tmp_path / "bag", alter=alter)) as recording:
        assert [image.stamp_ns for image in recording.images(["front"])] == [START_NS]
        assert recording.dropped["front"] == 2
    assert "camera front: the stamp of an image is -1000000000 ns, before 1970" in caplog.text


def test_pipes_and_metadata_of_nobody_are_refused_at_once(tiny_bag: Path, tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe.mcap")
    assert "pipe or device" in refused(tmp_path / "pipe.mcap")
    (tiny_bag / "tiny.mcap").unlink()
    os.mkfifo(tiny_bag / "tiny.mcap")
    assert "pipe or device" in refused(tiny_bag)
    (tiny_bag / "metadata.yaml").write_text("a: " + "[" * 5000)
    assert "more than 50 deep" in refused(tiny_bag)
    (tiny_bag / "metadata.yaml").unlink()
    os.mkfifo(tiny_bag / "metadata.yaml")
    assert "pipe or device" in refused(tiny_bag)
    assert "too long" in refused(tmp_path / ("x" * 300 + ".mcap"))


@pytest.mark.parametrize("start", [".inf", "-5", "1.5", str(1 << 70)])
def test_metadata_with_impossible_times_are_refused(tiny_bag: Path, start: str) -> None:
    file = tiny_bag / "metadata.yaml"
    whole = file.read_text()
    for key, value in (("nanoseconds_since_epoch", 1_000_000_000), ("message_count", 4)):
        file.write_text(whole.replace(f"{key}: {value}\n", f"{key}: {start}\n"))
        assert "metadata.yaml has impossible times or counts" in refused(tiny_bag)


def test_a_profile_that_is_damaged_is_shown_in_short(tiny_bag: Path) -> None:
    file = tiny_bag / "tiny.mcap"
    content = file.read_bytes()
    file.write_bytes(content[:17] + (2000).to_bytes(4, "little") + content[21:])  # the length of the profile
    assert len(refused(file)) < 500


def test_mcap_of_another_system_is_named(tmp_path: Path) -> None:
    path = tmp_path / "foxglove.mcap"
    with path.open("wb") as file:
        writer = McapWriter(file)
        writer.start(profile="", library="another")
        schema = writer.register_schema("foxglove.CompressedImage", "protobuf", b"")
        channel = writer.register_channel("/cam/image_raw/compressed", "protobuf", schema)
        writer.add_message(channel, log_time=1, publish_time=1, data=b"\x0a\x00")
        writer.finish()
    assert "not from ROS 2, though MCAP: its profile is ''" in refused(path)


def test_real_recording_has_sixteen_cameras(shared: Path) -> None:
    with open_recording(shared / "dev_walk" / "bag") as recording:
        assert len(recording.cameras) == 16
        assert {recording.camera_model(c).distortion_model for c in recording.cameras} == {"equidistant"}
        images = list(recording.images(["head"]))
    assert len(images) == 180
    assert decode_grey(images[0]).shape == (480, 640)


def test_metadata_of_many_missing_files_is_a_short_error(tmp_path: Path) -> None:
    bag = write_tiny_bag(tmp_path / "bag")
    document = yaml.safe_load((bag / "metadata.yaml").read_text())
    document["rosbag2_bagfile_information"]["relative_file_paths"] = [f"part_{row}.mcap" for row in range(100_000)]
    (bag / "metadata.yaml").write_text(yaml.safe_dump(document))
    with pytest.raises(RecordingError) as caught, open_recording(bag):
        pass
    assert str(bag) in str(caught.value) and len(str(caught.value)) < 1000


def test_messages_of_times_that_ros_cannot_count_are_left_out(tmp_path: Path) -> None:
    bag = write_tiny_bag(tmp_path / "bag", alter=lambda writer: write_jpeg(writer, "left", 1 << 63, START_NS, 10))
    with open_recording(bag / "bag.mcap") as recording:
        assert len(recording.image_times()["left"]) == 4
