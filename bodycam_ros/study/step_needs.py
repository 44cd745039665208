"""What steps need: processors, memory and time, by the number of their images and by what such steps took.

A cluster is asked for it. On this machine it counts the processors alone.
"""

import math
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

from bodycam_ros.errors import RecordingError
from bodycam_ros.files.yaml_file import read_yaml
from bodycam_ros.recording.bag_file import METADATA
from bodycam_ros.study.input_files import files_in
from bodycam_ros.study.study import Step

_IMAGE_BYTES = 10_000  # of a file that does not count its images: JPEG at 640 x 480 takes 13 kB, H.264 less or more
_PHOTOGRAPH_BYTES = 1_000_000  # what a map is made of: a larger one counts as several
_MARGIN = 4.0  # a slow computer, large images, and what recordings differ by
_START_MINUTES = 10.0
_ENGINE_MB = 300.0  # Snakemake starts each step on a cluster's computer, and counts as a part of it


@dataclass(frozen=True)
class StepNeed:
    """What a step is given.

    Attributes:
        threads: processors.
        memory_mb, minutes: at its first attempt.
    """

    threads: int
    memory_mb: int
    minutes: int


@dataclass(frozen=True)
class _Cost:
    """What the steps of a command took (docs/decisions/2026-11-study.md).

    Attributes:
        image_s: of one processor for an image or photograph [s].
        memory_mb: of the command itself.
        process_mb: of each further process.
        image_mb: for each image or photograph.
    """

    image_s: float
    memory_mb: float
    process_mb: float
    image_mb: float


_COSTS: Mapping[str, _Cost] = {
    "map": _Cost(1.0, 600.0, 150.0, 8.0),
    "ingest": _Cost(0.01, 500.0, 200.0, 0.0),
    "body": _Cost(0.01, 600.0, 150.0, 0.02),
    "replay": _Cost(0.005, 500.0, 150.0, 0.02),
    "replay first": _Cost(0.005, 500.0, 150.0, 0.0),
    "replay stretch": _Cost(0.005, 500.0, 0.0, 0.0),
    "replay merge": _Cost(0.00002, 200.0, 0.0, 0.0005),
    "evaluate": _Cost(0.01, 800.0, 0.0, 0.05),
    "export": _Cost(0.002, 500.0, 0.0, 0.02),
}


class StepNeeds:
    """What each step of a study is given.

    Args:
        steps: all of them.
        processes: of each parallel step.
        alone: the others wait while a step runs, whether it is parallel or not.
    """

    def __init__(self, steps: Sequence[Step], processes: int, alone: bool = False) -> None:
        self._makers = {step.output: step for step in steps}
        self._processes = processes
        self._alone = alone

    def of(self, step: Step) -> StepNeed:
        """What one step is given."""
        cost, images = _COSTS[step.stage], self._images(step)
        threads = self._processes if step.is_parallel or self._alone else 1
        memory_mb = _ENGINE_MB + cost.memory_mb + cost.process_mb * (threads - 1) + cost.image_mb * images
        minutes = _START_MINUTES + _MARGIN * cost.image_s * images / threads / 60.0
        return StepNeed(threads, math.ceil(memory_mb), math.ceil(minutes))

    def _images(self, step: Step) -> int:
        """Images of the recording, or photographs, from which its first input was made, as far as it reads them."""
        path = step.inputs[0]
        while (maker := self._makers.get(path)) is not None:
            path = maker.inputs[0]
        count = count_photographs(path) if step.stage == "map" else count_images(path)
        return math.ceil(step.share * count)


def count_photographs(path: Path) -> int:
    """Photographs of a folder, large ones as several; of a video as many as its size stands for."""
    sizes = _sizes(path)
    return max(len(sizes), sum(sizes) // _PHOTOGRAPH_BYTES)


def count_images(path: Path) -> int:
    """Images of a recording by its bag's count, else by the size of its files."""
    with suppress(RecordingError, KeyError, TypeError, ValueError, AttributeError):  # the replay names what is wrong
        if (path / METADATA).is_file():
            bag = read_yaml(path / METADATA, "bag's metadata", RecordingError)
            topics = bag["rosbag2_bagfile_information"]["topics_with_message_count"]
            return sum(
                int(each["message_count"]) for each in topics if each["topic_metadata"]["type"].endswith("Image")
            )
    return sum(_sizes(path)) // _IMAGE_BYTES


def _sizes(path: Path) -> list[int]:
    """Sizes of a file, or of all files in a folder [bytes]."""
    return [file.stat().st_size for file in files_in(path)]
