"""A process that tracks and registers some of the cameras, in order of time."""

import ctypes
import logging
import multiprocessing
import os
import signal
import sys
import threading
from collections import Counter
from collections.abc import Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import partial
from itertools import chain
from multiprocessing.connection import wait
from multiprocessing.queues import Queue
from pathlib import Path
from typing import Literal

import cv2

from bodycam_ros.camera.camera_image import decode_grey
from bodycam_ros.camera.readout import Readout, best_known
from bodycam_ros.errors import BodycamError, RecordingError
from bodycam_ros.files.bounded_inputs import bound_inputs
from bodycam_ros.files.merged_lines import merge_lines
from bodycam_ros.inertial.camera_turn import CameraTurn
from bodycam_ros.mapping.body_keyframe import BodyKeyframe, KeyframeDensity
from bodycam_ros.messages.factory import Message
from bodycam_ros.messages.tracks import camera_pose_message, image_messages, landmarks_message
from bodycam_ros.pipeline.camera_front import CameraFront, camera_fronts
from bodycam_ros.pipeline.settings import PipelineSettings
from bodycam_ros.recording.bag_reader import LAST_NS, WHOLE_NS, Recording, open_recording
from bodycam_ros.recording.bag_writer import SerializedMessage
from bodycam_ros.recording.topic_names import AS_RECORDED, TopicNames
from bodycam_ros.recording.typestore import recorded_messages
from bodycam_ros.registration.landmark_matches import LandmarkMatches
from bodycam_ros.registration.reference_map import ReferenceMap
from bodycam_ros.replaying.fresh_fronts import FreshFronts
from bodycam_ros.replaying.map_updates import MapReplica, MapUpdate
from bodycam_ros.tracking.image_rate import ImageRateLimit
from bodycam_ros.tracking.track_frame import TrackFrame

logger = logging.getLogger(__name__)

BATCH = 8
"""Results that are sent together: waking the other process costs as much as a result."""

_PR_SET_PDEATHSIG = 1


@dataclass(frozen=True)
class RegisteredImage:
    """The registration of one image; ``keyframe`` if the map may be extended by it."""

    camera: str
    stamp_ns: int
    recorded_ns: int
    matches: LandmarkMatches
    messages: tuple[SerializedMessage, ...]
    keyframe: BodyKeyframe | None = None


@dataclass(frozen=True)
class AwaitedUpdate:
    """The worker has no results before this image, and waits for an update of the map."""

    camera: str
    recorded_ns: int


@dataclass(frozen=True)
class UnusableImages:
    """Images that could not be used.

    Attributes:
        camera: its name.
        stamp_ns: of the image, or of the latest one read [ns].
        kind: undecodable, unordered by their stamps, or missing: counted by the bag's metadata, but not in it.
        reason: why, for the user.
        count: how many.
        recorded_ns: when the image was recorded [ns]; of several, after the last.
    """

    camera: str
    stamp_ns: int
    kind: Literal["undecodable", "unordered", "missing"]
    reason: str
    count: int = 1
    recorded_ns: int = LAST_NS


class UnusableCount:
    """Counts unusable images by camera; warns of the first of each kind at once, of other cameras' in the end.

    Attributes:
        skipped: images that are in the recording.
        lost: images that are not in it.
        reasons: why, of the first of each camera and kind.
        items: camera and kind -> the first of these images, with the count of all.
    """

    def __init__(self) -> None:
        self.skipped: Counter[str] = Counter()
        self.lost: Counter[str] = Counter()
        self.reasons: list[str] = []
        self.items: dict[tuple[str, str], UnusableImages] = {}
        self._others: list[str] = []
        self._reported: set[tuple[str, str]] = set()

    def add(self, item: UnusableImages) -> None:
        """Count an item."""
        counts = self.lost if item.kind == "missing" else self.skipped
        counts[item.camera] += item.count
        known = self.items.get((item.camera, item.kind))
        self.items[item.camera, item.kind] = replace(known, count=known.count + item.count) if known else item
        if (item.camera, item.kind) in self._reported:
            return
        if all(kind != item.kind for _, kind in self._reported):
            logger.warning("%s", item.reason)
        else:
            self._others.append(item.reason)
        self._reported.add((item.camera, item.kind))
        self.reasons.append(item.reason)

    def warn_of_others(self) -> None:
        """Warn of the cameras after the first of each kind, a line for each kind."""
        for line in merge_lines(self._others):
            logger.warning("%s", line)
        self._others.clear()


@dataclass(frozen=True)
class LeftOutImages:
    """``count`` images of a camera up to a stamp [ns] are beyond ``images.max_rate``."""

    camera: str
    stamp_ns: int
    count: int
    recorded_ns: int = LAST_NS


Result = RegisteredImage | UnusableImages | LeftOutImages
"""The result of an image, or of several."""

WorkerItem = Result | AwaitedUpdate | BodycamError | None
"""What a worker sends; the last item is None, or the user's error that ended it."""


@dataclass(frozen=True)
class RegistrationTask:
    """What is to be registered, and how.

    Attributes:
        recording_path, map_path: recording and map.
        settings: of the pipeline.
        with_messages: serialise the messages that a bag keeps of each image.
        slim: of these no tracks, and of the landmarks the pose alone.
        readouts: camera -> read-out time, where it is known from elsewhere than the recording.
        turns: camera -> rotations by its gyroscope.
        keyframes: as of ``CameraFront``.
        names: of the recording's topics.
        windows_ns: first stamp of the images that are registered, and the stamp after the last [ns]; of several parts
            of the recording in order of time.
        recorded_ahead_ns: as of ``Recording.images``: read the bag near these parts alone.
        anew_ns: times that cameras are tracked anew for, see ``FreshFronts``; ascending [ns].
        shares_readouts: the read-out times are those of a first pass: new fronts begin with these again.
    """

    recording_path: Path
    map_path: Path
    settings: PipelineSettings
    with_messages: bool = True
    slim: bool = False
    readouts: Mapping[str, Readout] = field(default_factory=dict)
    turns: Mapping[str, CameraTurn] = field(default_factory=dict)
    keyframes: KeyframeDensity | None = None
    names: TopicNames = AS_RECORDED
    windows_ns: tuple[tuple[int, int], ...] = (WHOLE_NS,)
    recorded_ahead_ns: int | None = None
    anew_ns: tuple[int, ...] = ()
    shares_readouts: bool = False


def run_camera_worker(
    task: RegistrationTask,
    cameras: tuple[str, ...],
    outbox: "Queue[list[WorkerItem]]",
    inbox: "Queue[MapUpdate]",
) -> None:
    """Entry of the process: register the cameras' images and send the results, some at a time, ending with None.

    Args:
        task: what is to be done.
        cameras: this worker's.
        outbox: for the results.
        inbox: of updates of the map.
    """
    end_with_parent()
    bound_inputs()
    # Warnings are for the parent, which counts them and prints each once.
    logging.getLogger("bodycam_ros").setLevel(logging.ERROR)
    cv2.setNumThreads(1)
    ready: list[WorkerItem] = []
    try:
        for item in register_images(task, cameras, inbox):
            ready.append(item)
            if len(ready) == BATCH or isinstance(item, AwaitedUpdate):
                outbox.put(ready)
                ready = []
        last: WorkerItem = None
    except BodycamError as error:
        last = error
    except MemoryError:
        last = RecordingError("there is not enough memory; give fewer processes (--jobs)")
    outbox.put([*ready, last])


def end_with_parent() -> None:
    """End this process as soon as its parent ends, however that happens.

    The parent holds the other end of a pipe, which closes even if it is killed. On Linux the kernel is asked as well:
    it needs no thread of ours to be scheduled.
    """
    parent = multiprocessing.parent_process()
    if parent is None:
        return
    threading.Thread(target=_end_after, args=(parent.sentinel,), daemon=True, name="orphan watch").start()
    if sys.platform == "linux":
        with suppress(OSError, AttributeError):
            ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)


def _end_after(sentinel: int) -> None:
    wait([sentinel])
    os._exit(1)


def register_images(
    task: RegistrationTask, cameras: tuple[str, ...], inbox: "Queue[MapUpdate] | None" = None
) -> Iterator[Result | AwaitedUpdate]:
    """Register the images of some cameras in the order in which they were recorded.

    Args:
        task: what is to be done.
        cameras: names.
        inbox: of updates of the map, where that may be extended.
    """
    reference_map = ReferenceMap.load(task.map_path)
    extension = task.settings.extension
    replica = MapReplica(reference_map, extension.capacity, inbox.get) if inbox and extension.enabled else None
    with open_recording(task.recording_path, task.names) as recording:
        fronts = FreshFronts(
            partial(_front, recording, task, reference_map, None if replica is None else replica.map),
            # What a map grows by depends on all that was tracked before, and so does a gyroscope's bias.
            () if replica is not None or task.keyframes is not None or task.turns else task.anew_ns,
            {camera: best_known(recording.readout(camera), task.readouts.get(camera)) for camera in cameras},
            carries_readouts=not task.shares_readouts,
        )
        rate = task.settings.images.max_rate
        limit = ImageRateLimit(rate, recording.first_stamp_ns if rate else 0)
        stamp_ns = 0
        images = (recording.images(cameras, window_ns, task.recorded_ahead_ns) for window_ns in task.windows_ns)
        for image in chain.from_iterable(images):
            stamp_ns = image.stamp_ns
            if not limit.is_due(image.camera, stamp_ns):
                continue
            if replica is not None:
                # By the time of recording, which goes on alike for all cameras, whichever this process has.
                if replica.is_behind(image.recorded_ns):
                    yield AwaitedUpdate(image.camera, image.recorded_ns)
                replica.advance(image.recorded_ns)
            try:
                tracks, matches, keyframe = fronts.process(image.camera, decode_grey(image), stamp_ns)
            except RecordingError as error:
                limit.discard(image.camera)
                text = f"{error}; this image is not used, nor are others like it"
                yield UnusableImages(image.camera, stamp_ns, "undecodable", text, recorded_ns=image.recorded_ns)
                continue
            messages = _serialised(image.camera, tracks, matches, task.slim) if task.with_messages else ()
            yield RegisteredImage(image.camera, stamp_ns, image.recorded_ns, matches, messages, keyframe)
        for camera, count in sorted(limit.left_out.items()):
            yield LeftOutImages(camera, stamp_ns, count)
        for camera, count in sorted((+recording.dropped).items()):
            text = f"camera {camera}: stamps of {count} images do not increase, or are before 1970; they are dropped"
            yield UnusableImages(camera, stamp_ns, "unordered", text, count)
        yield from missing_images(recording, stamp_ns)


def _front(
    recording: Recording,
    task: RegistrationTask,
    reference_map: ReferenceMap,
    registered_in: ReferenceMap | None,
    camera: str,
    readout: Readout | None,
) -> CameraFront:
    """A front of a camera, before its first image."""
    fronts = camera_fronts(
        {camera: recording.camera_model(camera)},
        reference_map,
        task.settings,
        readouts={camera: readout},
        turns=task.turns,
        registered_in=registered_in,
        keyframes=task.keyframes,
    )
    return fronts[camera]


def missing_images(recording: Recording, stamp_ns: int) -> Iterator[UnusableImages]:
    """Images that the last iteration, up to a stamp [ns], should have yielded, by the recording's own count."""
    why = recording.damage or "its file is damaged"
    for camera, count in sorted((+recording.lost).items()):
        text = f"camera {camera}: {count} images that the recording should have are not in it; {why}; copy it again"
        yield UnusableImages(camera, stamp_ns, "missing", text, count)
        why = "its file is damaged"  # the whole text once


def _serialised(camera: str, tracks: TrackFrame, matches: LandmarkMatches, slim: bool) -> tuple[SerializedMessage, ...]:
    """The messages that a bag keeps of one image."""
    make = recorded_messages()
    messages: dict[str, Message | None] = {}
    if slim:
        messages["landmarks"] = landmarks_message(make, matches.bare())
        messages["pose"] = camera_pose_message(make, messages["landmarks"])
    else:
        messages["tracks"], messages["landmarks"], messages["pose"] = image_messages(make, tracks, matches)
    return tuple(
        SerializedMessage.of(matches.stamp_ns, f"/{camera}/{name}", message)
        for name, message in messages.items()
        if message is not None
    )
