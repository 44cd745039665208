"""Maps of other sizes are maps, and what they cost is measured on images of the recording."""

from pathlib import Path

import numpy as np
import pytest

from bodycam_ros.camera.camera_image import decode_grey
from bodycam_ros.camera_pipeline import CameraPipeline
from bodycam_ros.evaluate import map_size_timing
from bodycam_ros.evaluate.map_size_timing import time_map_sizes
from bodycam_ros.evaluate.scaled_map import scaled_map
from bodycam_ros.pipeline import PipelineSettings
from bodycam_ros.recording.bag_reader import open_recording
from bodycam_ros.registration.landmark_matches import LandmarkMatches
from bodycam_ros.registration.reference_map import ReferenceMap


@pytest.fixture(scope="module")
def reference_map(sample: Path) -> ReferenceMap:
    return ReferenceMap.load(sample / "map")


@pytest.mark.parametrize("landmarks", [3000, 21_554, 50_000])
def test_a_scaled_map_is_a_map(reference_map: ReferenceMap, tmp_path: Path, landmarks: int) -> None:
    scaled = scaled_map(reference_map, landmarks)
    scaled.save(tmp_path / "map")
    read = ReferenceMap.load(tmp_path / "map")  # which checks it
    assert len(read.landmark_ids) == landmarks == len(set(read.landmark_ids.tolist()))
    assert len(read.world_T_camera) == -(-landmarks // 21_554) * len(reference_map.world_T_camera)
    photographs = read.photographs
    assert photographs is not None and len(photographs.jpegs) == len(read.world_T_camera)
    # Every look was seen from where one of the photographs of its landmark stands.
    of_look = read.descriptor_landmark.astype(int)
    for look in range(0, len(of_look), 997):
        row = of_look[look]
        first, last = photographs.first_observation[row : row + 2]
        towards = read.world_T_camera[photographs.observation_view[first:last], :3, 3] - read.points_world[row]
        cosines = towards @ read.descriptor_view[look] / np.linalg.norm(towards, axis=1)
        assert cosines.max() > 0.999999


def test_every_size_is_timed(sample: Path, reference_map: ReferenceMap, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(map_size_timing, "SIZES", (2000, 30_000))
    settings = PipelineSettings()
    said: list[LandmarkMatches] = []
    with open_recording(sample / "sample" / "bag") as recording:
        pipeline = CameraPipeline(recording.camera_model("head"), reference_map, settings)
        for image, _ in zip(recording.images(["head"]), range(6), strict=False):
            said.append(pipeline.process(decode_grey(image), image.stamp_ns)[1])
    told: list[int] = []
    small, large = time_map_sizes(
        sample / "sample" / "bag", sample / "map", said, settings, on_map=lambda: told.append(1)
    )
    assert (small.landmarks, large.landmarks) == (2000, 30_000) and len(told) == 2
    for timing in (small, large):
        assert timing.direct_ms is not None
        assert min(timing.direct_ms, timing.named_ms, timing.expected_ms, timing.similar_ms, timing.anywhere_ms) > 0.0
        assert timing.prepared_s > 0.0
    assert large.memory_mb > 10.0
    assert time_map_sizes(sample / "sample" / "bag", sample / "map", [], settings) == []
