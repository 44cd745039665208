"""What each stage costs: milliseconds per frame, and the tracker against the OpenCV calls that it cannot do without."""

import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.camera import CameraModel
from bodycam_ros.mapping.landmark_matches import LandmarkMatches
from bodycam_ros.mapping.reference_map import ReferenceMap
from bodycam_ros.pipeline import PipelineSettings, SkeletonPipeline, feature_tracker, registrar
from bodycam_ros.recording.bag_reader import open_recording
from bodycam_ros.recording.camera_image import CameraImage, decode_grey
from bodycam_ros.tracking.keypoints import KeypointDetector
from bodycam_ros.tracking.optical_flow import follow


@dataclass
class StageTiming:
    """Seconds that the stages took, in one process on one thread.

    Attributes:
        images: images processed.
        keyframes: of these, how many were described.
        instants: instants of the body solved.
        seconds: stage -> seconds in all: decode, track, describe, register, and the solver's median per instant.
        bare_opencv: seconds of the OpenCV calls alone that decode, track and describe rest on.
    """

    images: int = 0
    keyframes: int = 0
    instants: int = 0
    seconds: dict[str, float] = field(
        default_factory=lambda: dict.fromkeys(("decode", "track", "describe", "register"), 0.0)
    )
    solve_s: list[float] = field(default_factory=list)
    bare_opencv: float = 0.0

    @property
    def tracker_ratio(self) -> float:
        """Track and describe over the bare OpenCV calls."""
        return (
            (self.seconds["track"] + self.seconds["describe"]) / self.bare_opencv if self.bare_opencv else float("nan")
        )

    @property
    def solve_ms(self) -> float:
        """Median milliseconds of the solver per instant."""
        return 1e3 * float(np.median(self.solve_s)) if self.solve_s else float("nan")


def time_stages(
    recording_path: Path,
    map_path: Path,
    body_path: Path,
    settings: PipelineSettings,
    on_image: Callable[[], None] = lambda: None,
) -> StageTiming:
    """Run all stages over a recording, one after the other on one thread, and time each.

    Raises:
        BodycamError: see the stages.
    """
    cv2.setNumThreads(1)
    body = BodyModel.from_yaml(body_path)
    reference_map = ReferenceMap.load(map_path)
    timing = StageTiming()
    registered: list[LandmarkMatches] = []
    with open_recording(recording_path) as recording:
        cameras = {camera: recording.camera_model(camera) for camera in recording.cameras if camera in body.mounts}
        for camera, model in cameras.items():
            images = recording.images([camera])
            for matches in _time_camera(model, images, reference_map, settings, timing):
                registered.append(matches)
                on_image()
    _time_solver(body, cameras, sorted(registered, key=lambda matches: matches.stamp_ns), settings, timing)
    return timing


def _time_camera(
    camera: CameraModel,
    images: Iterator[CameraImage],
    reference_map: ReferenceMap,
    settings: PipelineSettings,
    timing: StageTiming,
) -> Iterator[LandmarkMatches]:
    tracker = feature_tracker(camera, settings)
    camera_registrar = registrar(camera, reference_map, settings)
    detector = KeypointDetector(settings.keypoints)
    nowhere_masked = np.full((camera.height, camera.width), 255, np.uint8)
    before: tuple[NDArray[np.uint8], NDArray[np.float32]] | None = None
    for image in images:
        with _add_to(timing.seconds, "decode"):
            grey = decode_grey(image)
        spent = {"track": 0.0, "bare flow": 0.0, "bare keypoints": 0.0}
        with _add_to(spent, "track"):
            tracks = tracker.track(grey, image.stamp_ns)
        if before is not None:
            with _add_to(spent, "bare flow"):
                follow(before[0], grey, before[1], before[1], settings.flow)
        if tracks.keyframe:
            with _add_to(spent, "bare keypoints"):
                detector.detect(grey, nowhere_masked)
        with _add_to(timing.seconds, "register"):
            matches = camera_registrar.register(tracks)
        tracker.prune(matches)
        before = (grey, matches.pixels)
        timing.images += 1
        timing.keyframes += tracks.keyframe
        timing.seconds["track"] += spent["track"] - spent["bare keypoints"]
        timing.seconds["describe"] += spent["bare keypoints"]
        timing.bare_opencv += spent["bare flow"] + spent["bare keypoints"]
        yield matches


def _time_solver(
    body: BodyModel,
    cameras: Mapping[str, CameraModel],
    registered: list[LandmarkMatches],
    settings: PipelineSettings,
    timing: StageTiming,
) -> None:
    skeleton = SkeletonPipeline(body, cameras, settings)
    spent = 0.0
    for matches in registered:
        started = time.perf_counter()
        outputs = skeleton.add(matches)
        spent += time.perf_counter() - started
        if outputs:
            timing.solve_s += [spent / len(outputs)] * len(outputs)
            spent = 0.0
    timing.instants = len(timing.solve_s) + len(skeleton.flush())


@contextmanager
def _add_to(seconds: dict[str, float], stage: str) -> Iterator[None]:
    started = time.perf_counter()
    yield
    seconds[stage] += time.perf_counter() - started
