"""A walk in a hall of which half was photographed: what is registered as it goes, and in rounds."""

import os
from dataclasses import replace
from pathlib import Path

import pytest

from benchmarks.half_map import half_map
from bodycam_ros.pipeline import PipelineSettings
from bodycam_ros.recording.bag_reader import open_recording
from bodycam_ros.registration.reference_map import ReferenceMap
from bodycam_ros.replay.camera_worker import RegisteredImage, RegistrationTask
from bodycam_ros.replay.extend import MapExtension
from bodycam_ros.replay.front_end import register_recording

SOUTH_DEG = -90.0


@pytest.fixture(scope="module")
def half(sample: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The map without the photographs whose axis has an azimuth from 0 to 180 degrees."""
    path = tmp_path_factory.mktemp("half") / "map"
    half_map(ReferenceMap.load(sample / "map"), SOUTH_DEG).save(path)
    return path


def test_one_pass(shared: Path, half: Path) -> None:
    bag = shared / "dev_walk" / "bag"
    with open_recording(bag) as recording:
        models = {camera: recording.camera_model(camera) for camera in recording.cameras}
    task = RegistrationTask(bag, half, PipelineSettings(), with_messages=False)
    images = [one for one in register_recording(task, models, jobs=2) if isinstance(one, RegisteredImage)]
    registered = sum(one.matches.world_T_camera is not None for one in images)
    assert registered / len(images) >= 0.92


@pytest.mark.skipif(not os.environ.get("BODYCAM_SLOW"), reason="takes minutes; set BODYCAM_SLOW=1")
def test_rounds(shared: Path, half: Path) -> None:
    settings = replace(PipelineSettings(), extend=replace(PipelineSettings().extend, rounds=2))
    extension = MapExtension(shared / "dev_walk" / "bag", half, settings, jobs=2)
    extended = extension.run()
    assert extension.rounds[-1].share >= 0.97
    assert extension.rounds[-1].share >= extension.rounds[0].share > extension.rounds[0].absolute
    assert extended.grown > 1000
