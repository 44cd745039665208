"""What every worn camera knew over time, read from OUT on a thread, without keeping the view waiting."""

import threading
from collections import defaultdict
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.errors import BodycamError
from bodycam_ros.geometry import Array
from bodycam_ros.messages.clocks import TIMING, TIMING_TYPE
from bodycam_ros.recording.bag_file import BagFile
from bodycam_ros.solved.camera_record import CameraLog
from bodycam_ros.solved.topics import LANDMARKS, LANDMARKS_TYPE, camera_topics, contradictions_named
from bodycam_ros.view.inbox import Inbox

Bands = Mapping[str, tuple[Array, NDArray[np.int8]]]
"""Camera -> seconds (K,) of its images since the first instant, and a ``CameraSight`` for each."""


def read_bands(solved: Path, first_ns: int, cameras: Sequence[str]) -> Bands:
    """What the cameras of a solved bag knew.

    Args:
        solved: the bag.
        first_ns: the instant that seconds are counted from [ns].
        cameras: in the order that is wanted; others come after them.

    Raises:
        RecordingError: the bag or a message is damaged.
    """
    logs: dict[str, CameraLog] = defaultdict(CameraLog)
    with BagFile(solved) as bag:
        topics = camera_topics(bag, LANDMARKS, LANDMARKS_TYPE) | camera_topics(bag, TIMING, TIMING_TYPE)
        for topic, _, message in bag.messages(topics):
            with contradictions_named(solved, topic):
                logs[topics[topic]].add(topic, message, topics[topic])
    order = {camera: place for place, camera in enumerate(cameras)}
    named = sorted(logs, key=lambda camera: (order.get(camera, len(order)), camera))
    records = [logs[camera].record(camera) for camera in named if logs[camera].landmarks]
    return {of.camera: (np.asarray((of.stamps_ns - first_ns) * 1e-9, np.float64), of.sights) for of in records}


def load_bands(
    solved: Path,
    first_ns: int,
    cameras: Sequence[str],
    inbox: Inbox,
    on_loaded: Callable[[Bands], None],
    on_error: Callable[[BodycamError], None],
) -> None:
    """Begin to read them; what is read, or why it cannot be, is passed through the inbox."""

    def read() -> None:
        try:
            bands = read_bands(solved, first_ns, cameras)
        except BodycamError as error:
            failed = error
            inbox.put(lambda: on_error(failed))
            return
        inbox.put(lambda: on_loaded(bands))

    threading.Thread(target=read, daemon=True).start()
