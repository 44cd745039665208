"""Stations that each look by themselves, and a solver that hears them: the live graph, but without its processes."""

from collections.abc import Sequence

import numpy as np
import pytest
from numpy.typing import NDArray
from outside.dressed_body import DressedBody, small_motion, stations_around
from outside.test_region_tracker import axes_off, joints_off, placed_by_hand

from bodycam_ros.body.body_file import read_body
from bodycam_ros.camera.camera_image import CameraImage
from bodycam_ros.camera.raw_picture import RawPicture
from bodycam_ros.outside.body_surface import BodySurface
from bodycam_ros.outside.capsules import capsule_surfaces
from bodycam_ros.outside.lone_station import LoneStation
from bodycam_ros.outside.region_tracker import RegionTracker
from bodycam_ros.outside.station_reports import StationReports
from bodycam_ros.pipeline import PipelineSettings, SkeletonPipeline
from bodycam_ros.solving.body_now import BodyNow
from bodycam_ros.solving.body_state import BodyState

Array = NDArray[np.float64]

FRAMES, STEP_NS, START_NS = 9, 33_333_333, 1_000_000_000
SETTINGS = PipelineSettings()


@pytest.fixture(scope="module")
def dressed(sample) -> DressedBody:
    body = read_body(sample / "body.yaml")
    return DressedBody(body, capsule_surfaces(body), stations_around(3))


@pytest.fixture(scope="module")
def motion(dressed: DressedBody) -> Array:
    return small_motion(dressed.body, FRAMES)


@pytest.fixture(scope="module")
def images(dressed: DressedBody, motion: Array) -> list[list[CameraImage]]:
    return [
        [
            CameraImage(name, START_NS + frame * STEP_NS, RawPicture("bgr8", pixels))
            for name, pixels in dressed.images(poses, 1.0, frame).items()
        ]
        for frame, poses in enumerate(motion)
    ]


def station_of(dressed: DressedBody, name: str, placed: Array | None) -> LoneStation:
    surface = BodySurface.of(dressed.body, dressed.surfaces)
    tracker = RegionTracker(dressed.body, surface, {name: dressed.stations[name]}, SETTINGS.region)
    return LoneStation(name, tracker, placed, SETTINGS.region, SETTINGS.motion)


def followed(
    dressed: DressedBody, placed: Array, images: Sequence[Sequence[CameraImage]], late: int
) -> list[BodyState]:
    """What the solver says where stations hear of its latest instant so many instants late."""
    alone = {name: station_of(dressed, name, placed) for name in dressed.stations}
    reports = StationReports(dressed.body, placed, SETTINGS.region, SETTINGS.motion)
    pipeline = SkeletonPipeline(dressed.body, {}, SETTINGS, live=True, onlookers=reports, stations=[*alone])
    on_the_way: list[list[BodyNow]] = [[]] * late
    outputs = []
    for of_instant in images:
        for image in of_instant:
            said = alone[image.camera].look(image)
            assert said is not None and set(said.confidence) == set(dressed.body.segments)
            outputs += pipeline.add_static(said)
        on_the_way.append(pipeline.lately)
        for heard in on_the_way.pop(0):
            for station in alone.values():
                station.hear(heard)
    return [output.state for output in (*outputs, *pipeline.flush())]


@pytest.mark.parametrize("late", [0, 1])
def test_a_body_placed_by_hand_is_followed(
    dressed: DressedBody, motion: Array, images: list[list[CameraImage]], late: int
) -> None:
    states = followed(dressed, placed_by_hand(dressed.body, motion[0], 1), images, late)
    assert [state.stamp_ns for state in states] == [of_instant[0].stamp_ns for of_instant in images]
    for state, truth in zip(states, motion, strict=True):
        assert joints_off(state.world_T_segment, truth).mean() < 0.012
        assert joints_off(state.world_T_segment, truth).max() < 0.035
        assert axes_off(state.world_T_segment, truth).mean() < 4.0
        assert state.observed.mean() > 0.9 and state.cameras_used == 3


def test_a_station_waits_for_who_knows_where_the_body_is(
    dressed: DressedBody, motion: Array, images: list[list[CameraImage]]
) -> None:
    """Then it learns the colours there, and says what it sees."""
    station, stamp_ns = station_of(dressed, "ext_00", None), images[1][0].stamp_ns
    assert not station.knows(stamp_ns) and station.look(images[0][0]) is None
    segments, covariances = len(motion[0]), np.tile(1e-4 * np.eye(6), (len(motion[0]), 1, 1))
    station.hear(BodyNow(images[0][0].stamp_ns, motion[0], covariances, np.zeros(segments, bool)))
    assert not station.knows(stamp_ns), "a guess of what nobody sees"
    station.hear(BodyNow(stamp_ns, motion[1], covariances, np.ones(segments, bool)))
    assert not station.knows(stamp_ns - 1) and station.knows(stamp_ns)
    said = station.look(images[1][0])
    assert said is not None and said.station == "ext_00" and said.stamp_ns == stamp_ns
    assert len(said.evidence) > 8
    later = station.look(images[2][0])
    assert later is not None and len(later.evidence) > 8


def test_an_image_that_cannot_be_decoded_says_nothing(dressed: DressedBody, motion: Array) -> None:
    assert station_of(dressed, "ext_00", motion[0]).look(CameraImage("ext_00", START_NS, b"no image")) is None
