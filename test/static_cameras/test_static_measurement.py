"""Images on their way from a recording to the region tracker: what cannot be used is named once, and left out."""

import logging
from collections.abc import Mapping

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray
from static_cameras.dressed_body import DressedBody, small_motion, static_cameras_around

from bodycam_ros.body.body_file import read_body
from bodycam_ros.body.limb_mesh import capsule_surfaces
from bodycam_ros.body.surface import BodySurface
from bodycam_ros.body_state import BodyFrame
from bodycam_ros.camera.camera_image import CameraImage
from bodycam_ros.errors import RecordingError
from bodycam_ros.estimation.motion_settings import MotionSettings
from bodycam_ros.estimation.static_evidence import StaticMeasurement
from bodycam_ros.static_cameras.region_settings import RegionSettings
from bodycam_ros.static_cameras.region_tracker import RegionTracker
from bodycam_ros.static_cameras.start_file import PlacedBody
from bodycam_ros.static_cameras.static_measurement import ImageMeasurement

Images = dict[str, CameraImage]

STATIONS = ("ext_00", "ext_01")
SETTINGS = RegionSettings()


@pytest.fixture(scope="module")
def dressed(sample) -> DressedBody:
    body = read_body(sample / "body.yaml")
    return DressedBody(body, capsule_surfaces(body), static_cameras_around(len(STATIONS)))


@pytest.fixture(scope="module")
def truth(dressed: DressedBody) -> NDArray[np.float64]:
    return small_motion(dressed.body, 1)[0]


@pytest.fixture(scope="module")
def images(dressed: DressedBody, truth: NDArray[np.float64]) -> Images:
    pictures = dressed.images(truth, 1.0, 0)
    return {
        name: CameraImage(name, 1000 + number, cv2.imencode(".png", pictures[name])[1].tobytes())
        for number, name in enumerate(STATIONS)
    }


def frame_of(images: dict[str, CameraImage], stamp_ns: int = 0) -> BodyFrame:
    return BodyFrame(stamp_ns, {}, images)


def watch_of(
    dressed: DressedBody,
    placed: NDArray[np.float64] | None,
    told: list[tuple[Mapping[str, int], StaticMeasurement]] | None = None,
) -> ImageMeasurement:
    tracker = RegionTracker(dressed.body, BodySurface.of(dressed.body, dressed.surfaces), dressed.stations, SETTINGS)
    told = [] if told is None else told
    start = None if placed is None else PlacedBody(placed, np.zeros(len(placed), bool))
    return ImageMeasurement(tracker, start, MotionSettings(), lambda stamps_ns, seen: told.append((stamps_ns, seen)))


def test_the_first_images_place_the_body_and_the_next_are_asked(
    dressed: DressedBody, truth: NDArray[np.float64], images: Images
) -> None:
    told: list[tuple[Mapping[str, int], StaticMeasurement]] = []
    watch = watch_of(dressed, truth, told)
    placed = watch.place(frame_of(images))
    assert [each.segment for each in placed] == list(dressed.body.segments)
    assert max(np.linalg.norm((each.world_T_segment - truth[row])[:3, 3]) for row, each in enumerate(placed)) < 0.02
    assert not told
    seen = watch.measure(frame_of(images), truth, 0.0, [])
    assert seen is not None and seen.observed >= {"torso", "head", "thigh_left"}
    assert [stamps_ns for stamps_ns, _ in told] == [{"ext_00": 1000, "ext_01": 1001}] and told[0][1] is seen
    assert np.linalg.norm((seen.world_T_segment - truth)[:, :3, 3], axis=1).mean() < 0.008


@pytest.mark.parametrize(
    "content",
    [
        b"no picture",
        RecordingError("camera ext_01: the message was cut short"),
        np.zeros((240, 320), np.uint8),
        np.zeros((480, 641), np.uint8),
    ],
    ids=["no file", "malformed", "small", "wider by a pixel"],
)
def test_an_image_that_cannot_be_used_is_warned_about_once_and_left_out(
    dressed: DressedBody,
    truth: NDArray[np.float64],
    images: Images,
    content: bytes | NDArray[np.uint8] | RecordingError,
    caplog: pytest.LogCaptureFixture,
) -> None:
    damaged = images | {"ext_01": CameraImage("ext_01", 1001, content)}
    told: list[tuple[Mapping[str, int], StaticMeasurement]] = []
    watch = watch_of(dressed, truth, told)
    with caplog.at_level(logging.WARNING):
        watch.place(frame_of(damaged))
        for _ in range(2):
            seen = watch.measure(frame_of(damaged), truth, 0.03, [])
            assert seen is not None and set(seen.evidence) == {"ext_00"}
    warnings = [record.getMessage() for record in caplog.records if "static_cameras" in record.name]
    assert len(warnings) == 1
    assert "ext_01" in warnings[0]
    assert [stamps_ns for stamps_ns, _ in told] == [{"ext_00": 1000}] * 2
    # One that is whole again is taken again.
    seen = watch.measure(frame_of(images), truth, 0.03, [])
    assert seen is not None and set(seen.evidence) == set(STATIONS)


def test_after_a_gap_the_body_is_where_it_was_and_where_stamps_go_back_at_its_start(
    dressed: DressedBody, truth: NDArray[np.float64], images: Images
) -> None:
    watch = watch_of(dressed, truth)
    assert watch.measure(frame_of(images), truth, 0.0, []) is None
    first = watch.place(frame_of(images, 1000))
    seen = watch.measure(frame_of(images, 1000), truth, 0.0, [])
    assert seen is not None
    continued = watch.place(frame_of(images, 3000))
    for row, each in enumerate(continued):
        np.testing.assert_array_equal(each.world_T_segment, seen.world_T_segment[row])
    again = watch.place(frame_of(images, 500))
    for before, after in zip(first, again, strict=True):
        np.testing.assert_array_equal(before.world_T_segment, after.world_T_segment)
