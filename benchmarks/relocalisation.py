"""How soon a camera that was blind is registered again: python -m benchmarks.relocalisation BAG --map MAP.

Every camera's images are grey for some time, again and again. What counts is the time from the first image in which
the undisturbed recording is registered to the first that is.
"""

import argparse
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.camera import CameraModel
from bodycam_ros.camera.camera_image import decode_grey
from bodycam_ros.pipeline.camera_front import CameraFront
from bodycam_ros.pipeline.settings import PipelineSettings
from bodycam_ros.recording.bag_reader import open_recording
from bodycam_ros.registration.reference_map import ReferenceMap

Images = Sequence[tuple[NDArray[np.uint8], int]]
Poses = Sequence[NDArray[np.float64] | None]

_GREY = 127


@dataclass(frozen=True)
class Return:
    """A camera that sees again.

    Attributes:
        stamp_ns: of the first image that could be registered [ns].
        after_s: when one was [s]; infinite where none was before it went blind again.
    """

    stamp_ns: int
    after_s: float


def blind_images(images: Images, blind_s: float, seeing_s: float, first_s: float) -> NDArray[np.bool_]:
    """(N,) which images are made grey: so long, after so long of sight, from so long after the first image on [s]."""
    seconds = 1e-9 * np.array([stamp_ns - images[0][1] for _, stamp_ns in images]) - first_s
    return (seconds >= 0.0) & (seconds % (blind_s + seeing_s) < blind_s)


def registered(
    camera: CameraModel,
    reference_map: ReferenceMap,
    images: Images,
    blind: NDArray[np.bool_] | None = None,
) -> list[NDArray[np.float64] | None]:
    """Poses of a camera's images, those that are blind grey."""
    settings = PipelineSettings()
    front = CameraFront(camera, reference_map, settings)
    poses = []
    for number, (image, stamp_ns) in enumerate(images):
        unseen = blind is not None and blind[number]
        _, matches, _ = front.process(np.full_like(image, _GREY) if unseen else image, stamp_ns)
        poses.append(matches.world_T_camera)
    return poses


def returns(images: Images, blind: NDArray[np.bool_], undisturbed: Poses, poses: Poses) -> Iterator[Return]:
    """Every time that sight came back, and was of something that the map knows."""
    begins = np.flatnonzero(blind[:-1] & ~blind[1:]) + 1
    for begin in begins.tolist():
        end = begin + int(np.argmax(np.append(blind[begin:], True)))
        known = [number for number in range(begin, end) if undisturbed[number] is not None]
        found = [number for number in range(begin, end) if poses[number] is not None]
        if known:
            since_ns = images[known[0]][1]
            after_s = max(1e-9 * (images[found[0]][1] - since_ns), 0.0) if found else np.inf
            yield Return(since_ns, after_s)


def main() -> None:
    """Measure all cameras of a recording."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("recording", type=Path)
    parser.add_argument("--map", type=Path, required=True)
    parser.add_argument("--blind", type=float, default=1.0, help="for so long [s]")
    parser.add_argument("--seeing", type=float, default=1.0, help="and so long of sight in between [s]")
    arguments = parser.parse_args()
    reference_map = ReferenceMap.load(arguments.map)
    after_s = []
    with open_recording(arguments.recording) as recording:
        for number, name in enumerate(recording.cameras):
            camera = recording.camera_model(name)
            images = [(decode_grey(image), image.stamp_ns) for image in recording.images([name])]
            usual = registered(camera, reference_map, images)
            blind = blind_images(images, arguments.blind, arguments.seeing, 0.3 + 0.06 * number)
            poses = registered(camera, reference_map, images, blind)
            of_camera = [each.after_s for each in returns(images, blind, usual, poses)]
            after_s += of_camera
            share = np.mean([pose is not None for pose in usual])
            print(f"{name:16} usually {share:.3f} registered; back after {np.round(of_camera, 2).tolist()} s")
    soon = [each <= 0.5 for each in after_s]
    print(f"{len(after_s)} times: median {np.median(after_s):.2f} s, {np.mean(soon):.1%} within 0.5 s")


if __name__ == "__main__":
    main()
