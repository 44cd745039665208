"""Minutes of motion from the seconds of a recording, played to and fro in a map that grows:

    python test/tools/there_and_back.py BAG MAP --minutes 10

Prints what an image costs, how many landmarks have grown and how large the process is, minute by minute. All of them
should stay the same: whatever grows with the motion's length is a leak.
"""

import argparse
import resource
import time
from collections import deque
from collections.abc import Iterator
from itertools import count
from pathlib import Path

import numpy as np

from bodycam_ros.camera.camera_image import CameraImage, decode_grey
from bodycam_ros.camera_pipeline import CameraPipeline
from bodycam_ros.kernels.preparation import prepare_kernels
from bodycam_ros.pipeline import PipelineSettings
from bodycam_ros.recording.bag_reader import open_recording
from bodycam_ros.registration.reference_map import ReferenceMap
from bodycam_ros.replay.growth_epochs import Growth, GrowthOfAll, GrowthOfOne

_NS = 1_000_000_000


def to_and_fro(images: list[CameraImage]) -> Iterator[tuple[CameraImage, int]]:
    """The images and the time of each [ns], from the first to the last, back to the first, and so on for ever."""
    first_ns, length_ns = images[0].stamp_ns, images[-1].stamp_ns - images[0].stamp_ns
    frame_ns = length_ns // max(1, len({image.stamp_ns for image in images}) - 1)
    for number in count():
        ordered = images if number % 2 == 0 else images[::-1]
        for image in ordered:
            passed_ns = image.stamp_ns - first_ns if number % 2 == 0 else length_ns - (image.stamp_ns - first_ns)
            yield image, first_ns + number * (length_ns + frame_ns) + passed_ns


def main() -> None:
    """Command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("recording", type=Path)
    parser.add_argument("map", type=Path)
    parser.add_argument("--minutes", type=float, default=10.0)
    parser.add_argument("--cameras", nargs="*", help="those that see; all by default")
    arguments = parser.parse_args()
    prepare_kernels()
    settings = PipelineSettings()
    reference_map = ReferenceMap.load(arguments.map)
    told: deque[Growth] = deque()
    with open_recording(arguments.recording) as recording:
        names = arguments.cameras or recording.cameras
        cameras = {name: recording.camera_model(name) for name in names}
        images = sorted(recording.images(names), key=lambda image: image.stamp_ns)
    of_all = GrowthOfAll(reference_map, cameras, settings.growth, told.append)
    of_one = GrowthOfOne(reference_map, settings.growth, told.popleft)
    pipelines = {
        name: CameraPipeline(camera, reference_map, settings, growing_map=of_one.map)
        for name, camera in cameras.items()
    }
    costs_ms, registered, grown = [], 0, 0
    minute, start_ns = 1, images[0].stamp_ns
    print("minute  ms per image: median, p99  registered [%]  of them by grown [%]  landmarks grown  memory [MB]")
    for image, stamp_ns in to_and_fro(images):
        if stamp_ns - start_ns >= minute * 60 * _NS or stamp_ns - start_ns >= arguments.minutes * 60 * _NS:
            memory_mb = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
            median, high = np.percentile(costs_ms, (50, 99))
            share, by_grown = 100 * registered / len(costs_ms), 100 * grown / max(1, registered)
            print(
                f"{minute:6d}  {median:20.2f}, {high:5.1f}  {share:14.1f}  {by_grown:20.1f}  "
                f"{of_all.growth.landmarks:15d}  {memory_mb:11.0f}",
                flush=True,
            )
            costs_ms, registered, grown, minute = [], 0, 0, minute + 1
            if stamp_ns - start_ns >= arguments.minutes * 60 * _NS:
                return
        began_s = time.thread_time()
        of_all.reach(stamp_ns)
        of_one.catch_up(stamp_ns)
        _, matches, keyframe = pipelines[image.camera].process(decode_grey(image), stamp_ns)
        of_all.hear(matches, keyframe)
        costs_ms.append(1e3 * (time.thread_time() - began_s))
        registered += matches.world_T_camera is not None
        grown += 2 * matches.grown > len(matches.landmark_ids)


if __name__ == "__main__":
    main()
