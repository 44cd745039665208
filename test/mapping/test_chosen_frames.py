"""The sharp frames of a bag's cameras as photographs."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import cv2
import numpy as np
import pytest
from helpers.naming import naming
from helpers.recorded_progress import Unshown
from helpers.turned_view import CAMERA, rolled_view, turned_view

from bodycam_ros.camera import camera_from_info
from bodycam_ros.camera.camera_image import CameraImage
from bodycam_ros.errors import MapError
from bodycam_ros.mapping.frame_choice import keep_sharp_frames
from bodycam_ros.mapping.moving_camera import MovingCamera, open_body_cameras
from bodycam_ros.messages.factory import header_message
from bodycam_ros.messages.images import camera_info_message
from bodycam_ros.recording.bag_writer import write_recording
from bodycam_ros.recording.typestore import recorded_messages

LENS = camera_from_info("hand", 320, 240, "equidistant", [0.01, 0.0, 0.0, 0.0], [150, 0, 160, 0, 151, 120, 0, 0, 1])
SHARP = [1, 4, 7]
SAMPLE = Path(__file__).parents[2] / "bags/sample/bag"


@pytest.fixture
def bag(tmp_path: Path) -> Path:
    """Three pictures that have nothing in common, each between two that are blurred by motion, by the camera /hand."""
    rng, make = np.random.default_rng(1), recorded_messages()
    with write_recording(tmp_path / "bag") as writer:
        for number in range(9):
            if number % 3 == 0:
                texture = cv2.resize(
                    rng.integers(0, 256, (60, 80), np.uint8), (320, 240), interpolation=cv2.INTER_CUBIC
                )
            picture = texture if number in SHARP else cv2.blur(texture, (9, 1))
            stamp_ns = 1_000_000_000 + number * 100_000_000
            writer.write("/hand/camera_info", stamp_ns, camera_info_message(make, LENS, stamp_ns))
            data = cv2.imencode(".png", picture)[1].reshape(-1)
            header = header_message(make, stamp_ns, "hand_optical_frame")
            image = make("sensor_msgs/msg/CompressedImage", header=header, format="png", data=data)
            writer.write("/hand/image_raw/compressed", stamp_ns, image)
    return tmp_path / "bag"


def test_sharp_frames_are_written(bag: Path, tmp_path: Path) -> None:
    progress = Unshown()
    photographs = keep_sharp_frames(open_body_cameras(bag, ["hand"]), tmp_path, "bag", 150, 1, progress)
    assert [path.name for path in photographs.paths] == [f"frame_{number:06d}.png" for number in SHARP]
    assert all(path.is_file() for path in photographs.paths)
    assert all(np.array_equal(camera.parameters, LENS.parameters) for camera in photographs.camera_of_name.values())
    assert progress.done == progress.totals == {"choosing sharp frames": 9}


def test_frames_of_body_cameras_are_spread_over_the_recording(tmp_path: Path) -> None:
    sources = open_body_cameras(SAMPLE, ("waist_left", "waist_right"))
    kept = keep_sharp_frames(sources, tmp_path, "sample", 10, 2, Unshown())
    assert sorted(path.name for path in tmp_path.iterdir()) == [path.name for path in kept.paths]
    assert set(kept.camera_of_name) == {path.name for path in kept.paths}
    for camera, source in sources.items():
        numbers = [int(path.stem[-6:]) for path in kept.paths if path.name.startswith(camera)]
        assert len(numbers) == 5 and np.diff(numbers).min() >= 1 and np.ptp(numbers) > 0.5 * source.count
    for path in kept.paths:
        camera = kept.camera_of_name[path.name]
        assert path.name.startswith(camera.name)
        assert cv2.imread(str(path), cv2.IMREAD_GRAYSCALE).shape == (camera.height, camera.width)
    assert len({id(camera) for camera in kept.camera_of_name.values()}) == 2


_RATE_DEG, _COUNT = 90.0, 9


def _rolled(seconds: float) -> np.ndarray:
    """A picture of a camera that turns to the right while its rows are read out."""
    return rolled_view(_RATE_DEG * seconds, 0.0, (_RATE_DEG, 0.0), (0.0, 0.02))


@contextmanager
def _turning() -> Iterator[Iterator[CameraImage]]:
    times_s = [number / 15.0 for number in range(_COUNT)]
    yield (CameraImage("hand", round(1e9 * seconds), _rolled(seconds)) for seconds in times_s)


def test_pictures_are_as_if_all_rows_were_exposed_together(tmp_path: Path) -> None:
    kept = keep_sharp_frames(
        {"hand": MovingCamera("hand", CAMERA, _COUNT, 0.6, (0.0, 0.02), _turning)}, tmp_path, "turn", 2, 1, Unshown()
    )
    for path in kept.paths[1:]:  # before the first there is no other
        seconds = int(path.stem[-6:]) / 15.0
        wanted, shown = turned_view(_RATE_DEG * seconds).astype(int), _rolled(seconds)
        written, inner = cv2.imread(str(path), cv2.IMREAD_GRAYSCALE), np.s_[40:-40, 40:-40]
        off = [np.abs(picture[inner] - wanted[inner]).mean() for picture in (shown, written)]
        assert off[1] < 0.3 * off[0]


def test_a_camera_that_is_not_there_is_named() -> None:
    with naming(MapError, "tail", "foot_left"):
        open_body_cameras(SAMPLE, ("tail",))
