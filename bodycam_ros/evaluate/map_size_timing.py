"""What an image costs in maps of different sizes: landmarks found directly, named by descriptors, and looked for."""

import gc
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.camera import CameraModel
from bodycam_ros.camera.camera_image import decode_grey
from bodycam_ros.evaluate.endurance import memory_bytes
from bodycam_ros.evaluate.scaled_map import scaled_map
from bodycam_ros.pipeline import PipelineSettings
from bodycam_ros.recording.bag_reader import open_recording
from bodycam_ros.registration.direct_registration import DirectRegistration
from bodycam_ros.registration.landmark_matches import LandmarkMatches
from bodycam_ros.registration.local_landmarks import LocalLandmarks
from bodycam_ros.registration.matching import match_by_looks, match_near_prediction
from bodycam_ros.registration.reference_map import ReferenceMap
from bodycam_ros.tracking.feature_tracker import FeatureTracker
from bodycam_ros.tracking.track_frame import TrackFrame

SIZES = (5_000, 50_000, 500_000)
"""Landmarks of the maps."""

_PICTURES = 24
_EXPECTED_PX = 100.0  # around where the body has a camera that it is unsure of by 8 degrees
_MB = 1e-6


@dataclass(frozen=True)
class MapSizeTiming:
    """Milliseconds of an image (medians) in a map.

    Attributes:
        landmarks: that it has.
        direct_ms: landmarks chosen, aligned and fitted, around a pose; None without photographs.
        named_ms: described tracks matched around a pose.
        expected_ms: the same as far around it as the body's prediction asks for.
        similar_ms: a search of the landmarks that similar photographs show.
        anywhere_ms: a search of the whole map.
        prepared_s: to get ready for these searches, once [s].
        memory_mb: of the map, of what is made of it, and of what each camera keeps [MB].
    """

    landmarks: int
    direct_ms: float | None
    named_ms: float
    expected_ms: float
    similar_ms: float
    anywhere_ms: float
    prepared_s: float
    memory_mb: float


@dataclass(frozen=True)
class _Picture:
    camera: CameraModel
    grey: NDArray[np.uint8]
    frame: TrackFrame
    world_T_camera: NDArray[np.float64]


def time_map_sizes(
    recording_path: Path,
    map_path: Path,
    registered: Sequence[LandmarkMatches],
    settings: PipelineSettings,
    on_map: Callable[[], None] = lambda: None,
) -> list[MapSizeTiming]:
    """Time what depends on the map, in maps that are made of this one.

    Args:
        recording_path, map_path: where recording and map are.
        registered: what its cameras said.
        settings: of the pipeline.
        on_map: told after each map.

    Raises:
        BodycamError: recording or map cannot be read.
    """
    reference_map = ReferenceMap.load(map_path)
    pictures = list(_pictures(recording_path, registered, settings))
    timings = []
    for landmarks in SIZES if pictures else ():
        timings.append(_time_map(reference_map, landmarks, pictures, settings))
        on_map()
    return timings


def _pictures(
    recording_path: Path, registered: Sequence[LandmarkMatches], settings: PipelineSettings
) -> Iterator[_Picture]:
    """Some registered images of all cameras, each described as if it were a keyframe."""
    located = [matches for matches in registered if matches.world_T_camera is not None]
    chosen = {
        (matches.camera, matches.stamp_ns): matches.world_T_camera
        for matches in located[:: max(1, len(located) // _PICTURES)]
    }
    with open_recording(recording_path) as recording:
        for image in recording.images(sorted({camera for camera, _ in chosen})):
            pose = chosen.get((image.camera, image.stamp_ns))
            if pose is not None:
                camera, grey = recording.camera_model(image.camera), decode_grey(image)
                tracker = FeatureTracker(camera, settings.tracker, settings.keypoints, settings.flow, settings.rotation)
                yield _Picture(camera, grey, tracker.track(grey, image.stamp_ns), pose)


def _time_map(
    reference_map: ReferenceMap, landmarks: int, pictures: Sequence[_Picture], settings: PipelineSettings
) -> MapSizeTiming:
    gc.collect()
    memory = memory_bytes()
    scaled = scaled_map(reference_map, landmarks)
    started = time.perf_counter()
    search, grid = scaled.search, scaled.grid
    prepared_s = time.perf_counter() - started
    matching = settings.matching
    photographs = scaled.photographs
    direct: dict[str, DirectRegistration] = {}
    local: dict[str, LocalLandmarks] = {}
    for picture in pictures:
        name = picture.camera.name
        local[name] = LocalLandmarks(grid, picture.camera.fx, matching.min_visible_scale_px)
        if photographs is not None:
            direct[name] = DirectRegistration(picture.camera, scaled, photographs, settings.direct, settings.pose_fit)

    def find(picture: _Picture) -> None:
        direct[picture.camera.name].find(picture.world_T_camera, None, picture.frame.stamp_ns)

    def near(radius_px: float) -> Callable[[_Picture], None]:
        def match(picture: _Picture) -> None:
            frame, pose = picture.frame, picture.world_T_camera
            pixels = frame.pixels[frame.described.astype(np.int64)]
            around = local[picture.camera.name].around(pose[:3, 3])
            match_near_prediction(
                scaled, picture.camera, pose, pixels, frame.descriptors, frame.scales, radius_px, matching, around
            )

        return match

    def similar(picture: _Picture) -> None:
        places = search.places.similar(picture.frame.descriptors, matching.similar_places)
        match_by_looks(scaled, picture.frame.descriptors, search.places.seen_from(places), matching)

    def anywhere(picture: _Picture) -> None:
        match_by_looks(scaled, picture.frame.descriptors, None, matching)

    direct_ms = None
    if photographs is not None:
        for picture in pictures:
            direct[picture.camera.name].see(picture.grey)
            find(picture)  # develops the photographs that it needs
        direct_ms = _median_ms(find, pictures, lambda picture: direct[picture.camera.name].see(picture.grey))
    timing = MapSizeTiming(
        landmarks=len(scaled.landmark_ids),
        direct_ms=direct_ms,
        named_ms=_median_ms(near(matching.radius_px), pictures),
        expected_ms=_median_ms(near(_EXPECTED_PX), pictures),
        similar_ms=_median_ms(similar, pictures),
        anywhere_ms=_median_ms(anywhere, pictures),
        prepared_s=prepared_s,
        memory_mb=0.0,
    )
    return replace(timing, memory_mb=_MB * (memory_bytes() - memory))


def _median_ms(
    step: Callable[[_Picture], None],
    pictures: Iterable[_Picture],
    before: Callable[[_Picture], None] = lambda picture: None,
) -> float:
    """Of a step that is done once for each picture."""
    spent = []
    for picture in pictures:
        before(picture)
        started = time.perf_counter()
        step(picture)
        spent.append(time.perf_counter() - started)
    return 1e3 * float(np.median(spent))
