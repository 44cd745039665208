"""bodycam stations, on a small bag of the sample's photographs, and scored where there is truth."""

from collections.abc import Callable, Iterable
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from bodycam_ros.camera import CameraModel
from bodycam_ros.cli.main import main
from bodycam_ros.formats.static_cameras_file import read_static_cameras
from bodycam_ros.geometry import Array, inverse, log_se3
from bodycam_ros.messages.factory import header_message
from bodycam_ros.messages.images import camera_info_message
from bodycam_ros.recording.bag_writer import RecordingWriter, write_recording
from bodycam_ros.recording.typestore import recorded_messages
from bodycam_ros.registration.reference_map import ReferenceMap

Image = NDArray[np.uint8]
BEGIN_NS = 1_000_000_000


def write_camera(writer: RecordingWriter, name: str, camera: CameraModel | None, images: Iterable[Image]) -> None:
    make = recorded_messages()
    for number, image in enumerate(images):
        stamp_ns = BEGIN_NS + 100_000_000 * number
        if camera is not None:
            writer.write(f"/{name}/camera_info", stamp_ns, camera_info_message(make, camera, stamp_ns))
        data = cv2.imencode(".png", image)[1].reshape(-1)
        header = header_message(make, stamp_ns, f"{name}_optical_frame")
        message = make("sensor_msgs/msg/CompressedImage", header=header, format="png", data=data)
        writer.write(f"/{name}/image_raw/compressed", stamp_ns, message)


@pytest.fixture(scope="module")
def bag(
    tmp_path_factory: pytest.TempPathFactory,
    camera: CameraModel,
    still_images: list[Image],
    photograph: Callable[[str], Image],
) -> Path:
    """Two cameras that stand, and others of which each has something wrong."""
    path = tmp_path_factory.mktemp("stations") / "bag"
    blank = [np.full_like(still_images[0], 90)] * 2
    window = [photograph("ref_0107.jpg")] * 2
    carried = [photograph(f"ref_{number:04}.jpg") for number in (99, 103, 107)]
    with write_recording(path) as writer:
        write_camera(writer, "door", camera, still_images)
        write_camera(writer, "window", camera, window)
        write_camera(writer, "hand", camera, carried)
        write_camera(writer, "blank", camera, blank)
        write_camera(writer, "lensless", None, blank)
        write_camera(writer, "halved", camera, [image[::2, ::2] for image in still_images])
    return path


def command(bag: Path, sample: Path, output: Path, *more: str) -> list[str]:
    return ["stations", str(bag), "--map", str(sample / "map"), "-o", str(output), *more]


def test_who_stands_is_written_and_who_does_not_is_named(
    bag: Path,
    sample: Path,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    reference_map: ReferenceMap,
    taken_from: Callable[[str], Array],
) -> None:
    output = tmp_path / "cameras.yaml"
    assert main(command(bag, sample, output)) == 0
    said = capsys.readouterr().out
    stations = read_static_cameras(output, reference_map)
    assert list(stations) == ["door", "window"]
    for name, photograph in (("door", "ref_0099.jpg"), ("window", "ref_0107.jpg")):
        apart = log_se3(inverse(taken_from(photograph)) @ stations[name].world_T_camera)
        assert np.degrees(np.linalg.norm(apart[:3])) < 0.05 and 1e3 * np.linalg.norm(apart[3:]) < 3.0
        assert any(line.split()[:1] == [name] for line in said.splitlines())
    assert ["door", "3", "4"] in [line.split()[:3] for line in said.splitlines()]
    assert "2 of 6 cameras written to" in said
    for told in (
        "NOT placed: camera hand: it moves",
        "NOT placed: camera blank: 0 of its 2 images can be registered in the map; photograph what it sees",
        "NOT placed: camera lensless: ",
        "NOT placed: camera halved: its images have 320 x 240 pixels, but its lens (camera_info) is for 640 x 480",
    ):
        assert told in said


def test_only_the_cameras_that_are_asked_for(
    bag: Path, sample: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    output = tmp_path / "cameras.yaml"
    assert main(command(bag, sample, output, "--cameras", "window")) == 0
    assert list(read_static_cameras(output)) == ["window"]
    before = output.read_bytes()
    assert main(command(bag, sample, output, "--cameras", "window")) == 1
    assert "exists already" in capsys.readouterr().err
    assert main(command(bag, sample, output, "--force", "--cameras", "blank")) == 1
    captured = capsys.readouterr()
    assert "NOT placed: camera blank" in captured.out
    assert "no camera could be placed" in captured.err and captured.err.count("bodycam: error") == 1
    assert main(command(bag, sample, output, "--force", "--cameras", "window", "roof")) == 1
    assert "no camera 'roof'; there are blank, door, " in capsys.readouterr().err
    assert output.read_bytes() == before


def test_a_file_of_others_is_not_replaced(
    bag: Path, sample: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    output = tmp_path / "cameras.yaml"
    output.write_text("ext_00: measured by hand for a week")
    assert main(command(bag, sample, output, "--force")) == 1
    assert "so --force does not replace it" in capsys.readouterr().err
    assert output.read_text() == "ext_00: measured by hand for a week"
    assert main(command(bag, sample, bag / "cameras.yaml")) == 1
    assert "lies within what this command reads" in capsys.readouterr().err


def test_a_map_without_metres_is_no_place_for_stations(
    bag: Path, tmp_path: Path, reference_map: ReferenceMap, capsys: pytest.CaptureFixture[str]
) -> None:
    replace(reference_map, metric=False).save(tmp_path / "map")
    assert main(command(bag, tmp_path, tmp_path / "cameras.yaml")) == 1
    assert "this map has no scale" in capsys.readouterr().err
    assert not (tmp_path / "cameras.yaml").exists()
