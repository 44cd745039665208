"""CPU time of each stage on one thread: python -m benchmarks.stage_timing BAG --map MAP --body BODY.yaml."""

import argparse
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path

import cv2
import numpy as np
from threadpoolctl import threadpool_limits

from bodycam_ros.body.body_file import read_body
from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.camera import CameraModel
from bodycam_ros.camera.camera_image import CameraImage, decode_grey
from bodycam_ros.kernels import load_kernels
from bodycam_ros.pipeline.camera_front import CameraFront
from bodycam_ros.pipeline.settings import PipelineSettings
from bodycam_ros.pipeline.skeleton import SkeletonPipeline
from bodycam_ros.recording.bag_reader import open_recording
from bodycam_ros.registration.landmark_matches import LandmarkMatches
from bodycam_ros.registration.reference_map import ReferenceMap
from bodycam_ros.tracking.keypoints import KeypointDetector

STAGES = ("decode", "track", "describe", "register")


@dataclass
class StageTiming:
    """CPU seconds of the stages, in one process on one thread.

    Attributes:
        images: images processed.
        keyframes: images with SIFT descriptors.
        seconds: stage -> seconds over all images; describe: SIFT, not part of track.
        solve_s: seconds of the solver for each body state.
    """

    images: int = 0
    keyframes: int = 0
    seconds: dict[str, float] = field(default_factory=lambda: dict.fromkeys(STAGES, 0.0))
    solve_s: list[float] = field(default_factory=list)

    def image_ms(self, stage: str) -> float:
        """Mean milliseconds of an image."""
        return 1e3 * self.seconds[stage] / max(self.images, 1)

    def solve_ms(self, percent: float = 50.0) -> float:
        """Percentile of the milliseconds of the solver for a body state."""
        return 1e3 * float(np.percentile(self.solve_s, percent)) if self.solve_s else float("nan")


def time_stages(recording_path: Path, map_path: Path, body_path: Path, settings: PipelineSettings) -> StageTiming:
    """Run all stages over a recording, one after the other on one thread.

    Raises:
        BodycamError: recording, map or body cannot be read.
    """
    load_kernels()
    body = read_body(body_path)
    reference_map = ReferenceMap.load(map_path)
    timing = StageTiming()
    registered: list[LandmarkMatches] = []
    threads = cv2.getNumThreads()
    cv2.setNumThreads(1)
    try:
        with threadpool_limits(1), open_recording(recording_path) as recording:
            cameras = {name: recording.camera_model(name) for name in recording.cameras if name in body.mounts}
            for name, camera in cameras.items():
                registered += _time_camera(camera, recording.images([name]), reference_map, settings, timing)
            registered.sort(key=lambda matches: matches.stamp_ns)
            _time_solver(body, cameras, registered, settings, timing)
    finally:
        cv2.setNumThreads(threads)
    return timing


@contextmanager
def timed_method(owner: type, method: str) -> Iterator[list[float]]:
    """CPU seconds of each call of a method while the block lasts."""
    called: Callable[..., object] = getattr(owner, method)
    spent: list[float] = []

    def timed(*args: object, **keywords: object) -> object:
        started = time.process_time()
        result = called(*args, **keywords)
        spent.append(time.process_time() - started)
        return result

    setattr(owner, method, timed)
    try:
        yield spent
    finally:
        setattr(owner, method, called)


def _time_camera(
    camera: CameraModel,
    images: Iterator[CameraImage],
    reference_map: ReferenceMap,
    settings: PipelineSettings,
    timing: StageTiming,
) -> list[LandmarkMatches]:
    front = CameraFront(camera, reference_map, settings)
    registered, seconds = [], timing.seconds
    with timed_method(KeypointDetector, "detect") as describing:
        while True:
            with _add_to(seconds, "decode"):
                # A video is decoded as it is read.
                if (image := next(images, None)) is None:
                    break
                grey = decode_grey(image)
            with _add_to(seconds, "track"):
                tracks = front.track(grey, image.stamp_ns)
            with _add_to(seconds, "register"):
                matches = front.register(tracks)
            with _add_to(seconds, "track"):
                front.accept(matches)
            timing.images += 1
            timing.keyframes += tracks.keyframe
            registered.append(matches)
    seconds["track"] -= sum(describing)
    seconds["describe"] += sum(describing)
    return registered


def _time_solver(
    body: BodyModel,
    cameras: dict[str, CameraModel],
    registered: list[LandmarkMatches],
    settings: PipelineSettings,
    timing: StageTiming,
) -> None:
    # Live, each state is solved by itself; offline a recording of some seconds is solved as a whole at its end.
    skeleton = SkeletonPipeline(body, cameras, settings, live=True)
    spent = 0.0
    for matches in registered:
        started = time.process_time()
        outputs = skeleton.add(matches)
        spent += time.process_time() - started
        if outputs:
            timing.solve_s += [spent / len(outputs)] * len(outputs)
            spent = 0.0


@contextmanager
def _add_to(seconds: dict[str, float], stage: str) -> Iterator[None]:
    started = time.process_time()
    yield
    seconds[stage] += time.process_time() - started


def main() -> None:
    """Print a row for each stage."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("recording", type=Path)
    parser.add_argument("--map", type=Path, required=True)
    parser.add_argument("--body", type=Path, required=True)
    arguments = parser.parse_args()
    timing = time_stages(arguments.recording, arguments.map, arguments.body, PipelineSettings())
    print(f"CPU time on one thread, {timing.images} images, {len(timing.solve_s)} states")
    for stage in STAGES:
        print(f"{stage:10} {timing.image_ms(stage):8.2f} ms an image")
    print(f"{'describe':10} {1e3 * timing.seconds['describe'] / max(timing.keyframes, 1):8.2f} ms a keyframe")
    print(f"{'solve':10} {timing.solve_ms():8.2f} ms a state (median), {timing.solve_ms(99.0):.2f} (p99)")


if __name__ == "__main__":
    main()
