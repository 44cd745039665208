"""What each stage costs: milliseconds per frame, and the tracker against the OpenCV calls that it cannot do without."""

import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from bodycam_ros.body.body_file import read_body
from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.camera import CameraModel
from bodycam_ros.camera.camera_image import CameraImage, decode_grey
from bodycam_ros.kernels.preparation import load_kernels, prepare_kernels
from bodycam_ros.pipeline import PipelineSettings, SkeletonPipeline, landmark_tracker, registrar
from bodycam_ros.recording.bag_reader import open_recording
from bodycam_ros.registration.landmark_matches import LandmarkMatches
from bodycam_ros.registration.reference_map import ReferenceMap


@dataclass
class StageTiming:
    """Seconds that the stages took, in one process on one thread.

    Attributes:
        images: images processed.
        keyframes: of these, how many were described.
        instants: instants of the body solved.
        seconds: stage -> seconds over all images: decode, track, describe, register.
        solve_s: the solver's seconds for each instant.
        bare_opencv_s: seconds of the OpenCV calls alone that track and describe rest on.
        registered: what all cameras said, in order of time.
    """

    images: int = 0
    keyframes: int = 0
    instants: int = 0
    seconds: dict[str, float] = field(
        default_factory=lambda: dict.fromkeys(("decode", "track", "describe", "register"), 0.0)
    )
    solve_s: list[float] = field(default_factory=list)
    bare_opencv_s: float = 0.0
    registered: list[LandmarkMatches] = field(default_factory=list)

    @property
    def tracker_ratio(self) -> float:
        """Track and describe over the bare OpenCV calls."""
        return (
            (self.seconds["track"] + self.seconds["describe"]) / self.bare_opencv_s
            if self.bare_opencv_s
            else float("nan")
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
    prepare_kernels()
    load_kernels()
    body = read_body(body_path)
    reference_map = ReferenceMap.load(map_path)
    timing = StageTiming()
    with open_recording(recording_path) as recording:
        cameras = {camera: recording.camera_model(camera) for camera in recording.cameras if camera in body.mounts}
        for camera, model in cameras.items():
            images = recording.images([camera])
            for matches in _time_camera(model, images, reference_map, settings, timing):
                timing.registered.append(matches)
                on_image()
    timing.registered.sort(key=lambda matches: matches.stamp_ns)
    _time_solver(body, cameras, timing.registered, settings, timing)
    return timing


def _time_camera(
    camera: CameraModel,
    images: Iterator[CameraImage],
    reference_map: ReferenceMap,
    settings: PipelineSettings,
    timing: StageTiming,
) -> Iterator[LandmarkMatches]:
    tracker = landmark_tracker(camera, reference_map, settings)
    camera_registrar = registrar(camera, reference_map, settings)
    bare = _BareOpenCv(settings)
    before: tuple[NDArray[np.uint8], NDArray[np.float32]] | None = None
    while True:
        with _add_to(timing.seconds, "decode"):
            # A video is decoded as it is read.
            if (image := next(images, None)) is None:
                break
            grey = decode_grey(image)
        spent = {"track": 0.0, "flow": 0.0, "keypoints": 0.0}
        with _add_to(spent, "track"):
            tracks = tracker.track(grey, image.stamp_ns)
        if before is not None:
            with _add_to(spent, "flow"):
                bare.flow(before[0], grey, before[1])
        if tracks.keyframe:
            with _add_to(spent, "keypoints"):
                bare.keypoints(grey)
        with _add_to(timing.seconds, "register"):
            matches = camera_registrar.register(tracks)
        tracker.hear(matches)
        followed = tracks.pixels if matches.world_T_camera is None else matches.shown
        before = (grey, followed)
        timing.images += 1
        timing.keyframes += tracks.keyframe
        # Within a call the tracker does not tell its steps apart; the keypoints alone are what a keyframe costs more.
        timing.seconds["track"] += spent["track"] - spent["keypoints"]
        timing.seconds["describe"] += spent["keypoints"]
        timing.bare_opencv_s += spent["flow"] + spent["keypoints"]
        yield matches


class _BareOpenCv:
    """The calls of OpenCV that the tracker cannot do without, and nothing around them."""

    def __init__(self, settings: PipelineSettings) -> None:
        window = (settings.flow.window_px, settings.flow.window_px)
        self._forward = {"winSize": window, "maxLevel": settings.flow.pyramid_levels}
        self._backward = {"winSize": window, "maxLevel": 0, "flags": cv2.OPTFLOW_USE_INITIAL_FLOW}
        self._scale = settings.keypoints.image_scale
        self._sift = cv2.SIFT_create(
            nfeatures=settings.keypoints.max_keypoints, contrastThreshold=settings.keypoints.contrast_threshold
        )

    def flow(self, previous: NDArray[np.uint8], current: NDArray[np.uint8], pixels: NDArray[np.float32]) -> None:
        """Lucas-Kanade there and back."""
        if len(pixels):
            points = pixels.reshape(-1, 1, 2)
            forward, _, _ = cv2.calcOpticalFlowPyrLK(previous, current, points, None, **self._forward)
            cv2.calcOpticalFlowPyrLK(current, previous, forward, points.copy(), **self._backward)

    def keypoints(self, image: NDArray[np.uint8]) -> None:
        """SIFT of the image at the scale that the tracker uses."""
        small = cv2.resize(image, None, fx=self._scale, fy=self._scale, interpolation=cv2.INTER_AREA)
        self._sift.detectAndCompute(small, None)


def _time_solver(
    body: BodyModel,
    cameras: Mapping[str, CameraModel],
    registered: list[LandmarkMatches],
    settings: PipelineSettings,
    timing: StageTiming,
) -> None:
    # Live, every instant is solved by itself; offline a recording of some seconds would be solved at its end at once.
    skeleton = SkeletonPipeline(body, cameras, settings, live=True)
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
