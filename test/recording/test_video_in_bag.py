"""A bag of video as everything that reads bags sees it: one frame a message, whatever is looked at."""

from pathlib import Path

import numpy as np
import pytest
from helpers.made_video import make_video, number_in, write_lens

from bodycam_ros.camera.camera_image import decode_grey
from bodycam_ros.cli.main import main
from bodycam_ros.messages.factory import time_message
from bodycam_ros.messages.images import COMPRESSED_VIDEO
from bodycam_ros.recording.bag_file import BagFile
from bodycam_ros.recording.bag_reader import open_recording
from bodycam_ros.recording.bag_writer import write_recording
from bodycam_ros.recording.typestore import recorded_messages
from bodycam_ros.results.footage import Footage

VIDEO = "/left/image_raw/compressed_video"


@pytest.fixture(scope="module")
def bag(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two cameras' videos of forty frames, with a keyframe in ten."""
    videos, place = tmp_path_factory.mktemp("videos"), tmp_path_factory.mktemp("place") / "bag"
    for camera in ("left", "right"):
        make_video(videos / f"{camera}.mp4", created="2024-05-01T12:00:00Z")
        write_lens(videos / f"{camera}.yaml")
    assert main(["ingest", str(videos), "-o", str(place)]) == 0
    return place


def test_each_frame_has_the_stamp_of_its_message(bag: Path) -> None:
    with open_recording(bag) as recording, BagFile(bag) as file:
        stamps = [stamp_ns for _, stamp_ns, _ in file.messages([VIDEO])]
        images = list(recording.images(["left"]))
        assert [image.stamp_ns for image in images] == stamps
        assert [number_in(decode_grey(image)) for image in images] == list(range(40))
        assert recording.image_count("left") == 40 and not recording.lost["left"]


def test_frames_that_nobody_looks_at_are_decoded_all_the_same(bag: Path) -> None:
    with open_recording(bag) as recording:
        looked_at = [image for number, image in enumerate(recording.images(["left"])) if number % 3 == 2]
    assert [number_in(decode_grey(image)) for image in looked_at] == list(range(2, 40, 3))


def test_one_frame_out_of_the_middle(bag: Path) -> None:
    with open_recording(bag) as recording:
        times = recording.image_times()["left"]
        for number in (0, 9, 10, 25, 39):
            image = recording.images_at({"left": tuple(times[number].tolist())})["left"]
            assert image.stamp_ns == times[number, 1]
            assert number_in(decode_grey(image)) == number
        assert recording.images_at({"left": (int(times[0, 0]), int(times[0, 1]) - 5)}) == {}


def test_the_view_shows_any_frame(bag: Path) -> None:
    footage = Footage(bag, None)
    times_ns = footage.times_ns("left")
    assert len(times_ns) == 40
    for number in (39, 0, 17):
        image = footage.image_at("left", int(times_ns[number]), 1)
        assert image is not None and number_in(decode_grey(image)) == number


def test_other_formats_and_stamps_that_do_not_increase(bag: Path, tmp_path: Path) -> None:
    make = recorded_messages()
    with BagFile(bag) as file:
        messages = [message for _, _, message in file.messages([VIDEO])]
        infos = [message for _, _, message in file.messages(["/left/camera_info"])]
    messages[14] = make(COMPRESSED_VIDEO, timestamp=messages[14].timestamp, format="av1", data=messages[14].data)
    messages[25].timestamp = time_message(make, 5)
    with write_recording(tmp_path / "altered") as writer:
        writer.write("/left/camera_info", 0, infos[0])
        for number, message in enumerate(messages):
            writer.write(VIDEO, number, message)
    with open_recording(tmp_path / "altered") as recording:
        images = list(recording.images())
        assert recording.dropped["left"] == 1 and len(images) == 39
        seen = []
        for image in images:
            try:
                seen.append(number_in(decode_grey(image)))
            except Exception as error:
                assert "av1" in str(error)
    # The frame whose stamp is odd is left out; those made of it are not.
    assert seen == [*range(14), *range(20, 25), *range(26, 40)]


def test_another_program_reads_the_schema(bag: Path) -> None:
    mcap = pytest.importorskip("mcap.reader")
    with next(bag.glob("*.mcap")).open("rb") as file:
        schemas = {schema.name: schema for schema in mcap.make_reader(file).get_summary().schemas.values()}
    text = schemas[COMPRESSED_VIDEO].data.decode()
    fields = [line for line in text.split("=" * 10)[0].splitlines() if line and not line.startswith("#")]
    assert fields == ["builtin_interfaces/Time timestamp", "string frame_id", "uint8[] data", "string format"]
    assert "MSG: builtin_interfaces/Time" in text
    assert np.all([schema.encoding == "ros2msg" for schema in schemas.values()])


def test_a_part_is_decoded_from_the_keyframes_before_it_even_if_recorded_early(bag: Path, tmp_path: Path) -> None:
    """Five frames a second, with a keyframe in ten, recorded 0.8 s before the delay that is given."""
    step_ns, early_ns, begin_ns = 200_000_000, 800_000_000, 10 * 10**9
    make = recorded_messages()
    with BagFile(bag) as file, write_recording(tmp_path / "slow") as writer:
        (info, *_) = [message for _, _, message in file.messages(["/left/camera_info"])]
        writer.write("/left/camera_info", 10**9, info)
        for number, (_, _, message) in enumerate(file.messages([VIDEO])):
            stamp_ns = begin_ns + number * step_ns
            message.timestamp = time_message(make, stamp_ns)
            writer.write(VIDEO, stamp_ns - early_ns, message)
    with open_recording(tmp_path / "slow") as recording:
        for number in range(40):
            window_ns = begin_ns + number * step_ns, 10**18
            images = recording.images(["left"], window_ns, 0)
            assert [number_in(decode_grey(image)) for image in images] == list(range(number, 40))
