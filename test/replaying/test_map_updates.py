"""A growing map for several processes: the same for all, whatever their number and pace, and nobody waits for ever."""

import threading
import time
from collections.abc import Sequence
from dataclasses import replace
from itertools import groupby
from pathlib import Path
from queue import SimpleQueue
from typing import Any

import numpy as np
import pytest
from helpers.altered_sample import write_altered_sample
from helpers.grown_room import CAMERAS, elsewhere, named, unlike, walk, walls
from helpers.naming import naming

from benchmarks.half_map import half_map
from bodycam_ros.errors import RecordingError
from bodycam_ros.mapping.body_keyframe import BodyKeyframe
from bodycam_ros.mapping.extendable_map import ExtendableMap
from bodycam_ros.mapping.map_settings import ExtensionSettings
from bodycam_ros.pipeline.settings import PipelineSettings
from bodycam_ros.recording.bag_reader import open_recording
from bodycam_ros.registration.landmark_matches import LandmarkMatches
from bodycam_ros.registration.reference_map import ReferenceMap
from bodycam_ros.replaying.camera_worker import RegisteredImage, RegistrationTask
from bodycam_ros.replaying.front_end import Worker, registered_images, start_workers
from bodycam_ros.replaying.map_updates import EPOCH_NS, MapReplica, MapUpdate, MapUpdateSource

CAPACITY = 400
MAP = elsewhere(np.random.default_rng(9))


def room_walk(frames: int) -> list[BodyKeyframe]:
    random = np.random.default_rng(0)
    return list(walk(walls(200, random), unlike(200, random), frames, random))


def contents(of: ExtendableMap) -> list[np.ndarray]:
    return [of.landmark_ids, of.points_world, of.descriptors, of.descriptor_view, of.descriptor_size, of.landmark_sizes]


def together(
    shares: Sequence[Sequence[str]], keyframes: list[BodyKeyframe]
) -> tuple[MapUpdateSource, list[MapReplica]]:
    """Workers beside a parent, as processes are, but one after the other; they must never wait for what does not come.

    Each worker names what its cameras see by its copy of the map.
    """
    inboxes = [SimpleQueue[MapUpdate]() for _ in shares]
    parent = MapUpdateSource(MAP, CAPACITY, lambda growth: [inbox.put(growth) for inbox in inboxes])
    workers = [MapReplica(MAP, CAPACITY, inbox.get_nowait) for inbox in inboxes]
    order = [
        (share.index(one.camera), row, one)
        for one in keyframes
        for row, share in enumerate(shares)
        if one.camera in share
    ]
    for _, instant in groupby(order, key=lambda item: item[2].stamp_ns):
        for _, row, one in sorted(instant, key=lambda item: item[:2]):
            parent.advance(one.stamp_ns)
            workers[row].advance(one.stamp_ns)
            seen = named(one, workers[row].map)
            parent.mapper.wait_for_turn(seen)
    last_ns = keyframes[-1].stamp_ns
    parent.advance(last_ns + EPOCH_NS)
    for worker in workers:
        worker.advance(last_ns + 2 * EPOCH_NS)
    return parent, workers


def test_parent_and_workers_agree_however_the_cameras_are_shared() -> None:
    keyframes = room_walk(10)
    results = []
    for shares in ([CAMERAS], [CAMERAS[::-1]], [CAMERAS[:1], CAMERAS[1:]], [(camera,) for camera in CAMERAS]):
        parent, workers = together(shares, keyframes)
        results.append(contents(parent.mapper.map))
        assert parent.mapper.landmarks > 60
        for worker in workers:
            for ours, its in zip(results[-1], contents(worker.map), strict=True):
                np.testing.assert_array_equal(ours, its)
    for other in results[1:]:
        for first, second in zip(results[0], other, strict=True):
            np.testing.assert_array_equal(first, second)


def test_what_is_seen_counts_two_epochs_later_and_not_before() -> None:
    """A worker that hears early keeps it for when it counts."""
    told: SimpleQueue[MapUpdate] = SimpleQueue()
    parent = MapUpdateSource(MAP, CAPACITY, told.put)
    early = MapReplica(MAP, CAPACITY, told.get_nowait)
    keyframes = room_walk(4)
    last_epoch = keyframes[-1].stamp_ns // EPOCH_NS
    for one in keyframes:
        parent.advance(one.stamp_ns)
        parent.mapper.wait_for_turn(one)
    parent.advance((last_epoch + 1) * EPOCH_NS)
    assert parent.mapper.landmarks > 20
    final = contents(parent.mapper.map)
    early.advance((last_epoch + 1) * EPOCH_NS)
    assert (early.map.landmark_ids != parent.mapper.map.landmark_ids).any()
    early.advance((last_epoch + 2) * EPOCH_NS)
    for ours, its in zip(final, contents(early.map), strict=True):
        np.testing.assert_array_equal(ours, its)


def test_nobody_waits_for_what_was_told_and_time_that_steps_back_asks_for_nothing() -> None:
    told: SimpleQueue[MapUpdate] = SimpleQueue()
    parent = MapUpdateSource(MAP, CAPACITY, told.put)
    worker = MapReplica(MAP, CAPACITY, told.get_nowait)
    start_ns = 1_700_000_000_000_000_000
    assert worker.is_behind(start_ns)
    parent.advance(start_ns)
    worker.advance(start_ns)
    # Another camera's clock is five seconds behind.
    assert not worker.is_behind(start_ns - 5_000_000_000)
    parent.advance(start_ns - 5_000_000_000)
    worker.advance(start_ns - 5_000_000_000)
    assert not worker.is_behind(start_ns + EPOCH_NS // 2)
    assert worker.is_behind(start_ns + 5_000_000_000)
    assert told.empty()


@pytest.fixture(scope="module")
def part(sample: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The sample's map without the photographs that look to one side."""
    path = tmp_path_factory.mktemp("part") / "map"
    half_map(ReferenceMap.load(sample / "map"), 180.0).save(path)
    return path


def registered(bag: Path, map_path: Path, jobs: int) -> list[RegisteredImage]:
    with open_recording(bag) as recording:
        models = {camera: recording.camera_model(camera) for camera in recording.cameras}
    task = RegistrationTask(bag, map_path, PipelineSettings(), with_messages=False)
    return list(registered_images(task, models, jobs))


def by_image(results: list[RegisteredImage]) -> dict[tuple[str, int], LandmarkMatches]:
    return {(one.camera, one.stamp_ns): one.matches for one in results}


@pytest.mark.long
def test_registrations_are_identical_whatever_the_number_of_processes(sample: Path, part: Path, tmp_path: Path) -> None:
    """Also where a camera begins late, one pauses, and one ends early: the others go on."""

    def gappy(topic: str, number: int, message: object) -> object:
        there = {"waist_front": range(60), "torso_front": [*range(20), *range(45, 60)], "thigh_left": range(15, 60)}
        camera = topic.split("/")[1]
        return message if "camera_info" in topic or number in there.get(camera, range(10)) else None

    cameras_used = ("waist_front", "torso_front", "thigh_left", "shin_left")
    bag = write_altered_sample(sample, tmp_path / "bag", gappy, cameras_used, frames=60)
    one, several = (by_image(registered(bag, part, number)) for number in (1, 3))
    assert len(one) == 60 + 35 + 45 + 10 and several.keys() == one.keys()
    for image, matches in one.items():
        np.testing.assert_array_equal(matches.landmark_ids, several[image].landmark_ids)
        if matches.world_T_camera is not None:
            np.testing.assert_array_equal(matches.world_T_camera, several[image].world_T_camera)
    assert sum(matches.grown for matches in one.values()) > 0


def test_a_worker_that_fails_ends_those_that_wait_for_growth(sample: Path, part: Path, tmp_path: Path) -> None:
    """One camera is none of the recording; the others' workers are amid their images."""
    bag = write_altered_sample(sample, tmp_path / "bag", cameras=("waist_front", "torso_front"), frames=30)
    with open_recording(bag) as recording:
        models = {camera: recording.camera_model(camera) for camera in recording.cameras}
    task = RegistrationTask(bag, part, PipelineSettings(), with_messages=False)
    with naming(RecordingError, "camera 'nobody'"):
        list(registered_images(task, {**models, "nobody": models["waist_front"]}, 3))


def test_a_recording_that_is_left_in_the_middle_leaves_no_process(sample: Path, part: Path, tmp_path: Path) -> None:
    bag = write_altered_sample(sample, tmp_path / "bag", cameras=("waist_front", "torso_front"), frames=30)
    with open_recording(bag) as recording:
        models = {camera: recording.camera_model(camera) for camera in recording.cameras}
    task = RegistrationTask(bag, part, PipelineSettings(), with_messages=False)
    results = registered_images(task, models, 2)
    assert next(results)
    results.close()
    settings = replace(PipelineSettings(), extension=ExtensionSettings(enabled=False))
    alone = list(registered_images(replace(task, settings=settings), models, 2))
    assert len(alone) == 60 and all(one.matches.grown == 0 for one in alone)


def test_the_share_that_is_done_is_of_the_stamps_whatever_the_clock_of_the_recorder(
    sample: Path, part: Path, tmp_path: Path
) -> None:
    def later(topic: str, number: int, message: Any) -> Any:
        stamp = replace(message.header.stamp, sec=message.header.stamp.sec + 1000)
        return replace(message, header=replace(message.header, stamp=stamp))

    bag = write_altered_sample(sample, tmp_path / "bag", later, ["waist_front"])
    shares: list[float] = []
    task = RegistrationTask(bag, part, PipelineSettings(), with_messages=False)
    assert len(list(registered_images(task, ["waist_front"], 1, shares.append))) == len(shares)
    assert min(shares) == 0.0 and 0.0 < max(shares) <= 1.0


def test_a_worker_that_is_killed_amid_a_result_is_reported(sample: Path, part: Path, tmp_path: Path) -> None:
    """As by the system, for want of memory: most of the time a worker waits for the reader of a large batch."""
    bag = write_altered_sample(sample, tmp_path / "bag", cameras=["waist_front"], frames=30)
    settings = replace(PipelineSettings(), extension=ExtensionSettings(enabled=False))
    errors: list[RecordingError] = []

    def read(worker: Worker) -> None:
        try:
            while worker.next_result():
                pass
        except RecordingError as error:
            errors.append(error)

    with start_workers(RegistrationTask(bag, part, settings), ["waist_front"], 1) as workers:
        (worker,) = workers
        while worker.outbox.empty():
            time.sleep(0.1)
        time.sleep(0.5)
        worker.process.kill()
        reader = threading.Thread(target=read, args=(worker,), daemon=True)
        reader.start()
        reader.join(20.0)
        assert [str(error).split(";")[0] for error in errors] == ["a tracking process ended with exit code -9"]
