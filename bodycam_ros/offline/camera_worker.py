"""A process that tracks and registers some of the cameras, in order of time."""

import ctypes
import logging
import math
import multiprocessing
import os
import signal
import sys
import threading
from collections.abc import Iterable, Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from multiprocessing.connection import wait
from multiprocessing.queues import Queue
from pathlib import Path

import cv2

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.camera.camera_image import decode_grey
from bodycam_ros.camera.readout import Readout, best_known
from bodycam_ros.camera_pipeline import CameraPipeline
from bodycam_ros.errors import BodycamError, RecordingError
from bodycam_ros.mapping.worn_keyframe import WornKeyframe
from bodycam_ros.messages.tracks import camera_pose_message, landmarks_message, tracks_message
from bodycam_ros.offline.growth_epochs import Growth, GrowthOfOne
from bodycam_ros.own_process import bound_inputs
from bodycam_ros.pipeline_settings import PipelineSettings
from bodycam_ros.recording.bag_reader import Recording, images_backwards, open_recording
from bodycam_ros.recording.typestore import recorded_messages, recording_typestore
from bodycam_ros.registration.landmark_matches import LandmarkMatches
from bodycam_ros.registration.reference_map import ReferenceMap
from bodycam_ros.tracking.track_frame import TrackFrame

_HEAD_START = 0.13
"""In beats: the first image is well within its beat, and jitter of later stamps does not part the cameras."""


class Beat:
    """Picks the first image of each camera in every beat, which starts with the first image of all.

    Args:
        max_rate: beats per second [Hz]; infinite to take every image.
    """

    def __init__(self, max_rate: float) -> None:
        self._max_rate = max_rate
        self._start_ns: int | None = None
        self._latest: dict[str, int] = {}

    def is_due(self, camera: str, stamp_ns: int) -> bool:
        """Whether a camera's next image is the first in its beat."""
        if math.isinf(self._max_rate):
            return True
        if self._start_ns is None:
            self._start_ns = stamp_ns
        number = math.floor(1e-9 * (stamp_ns - self._start_ns) * self._max_rate + _HEAD_START)
        if number == self._latest.get(camera):
            return False
        self._latest[camera] = number
        return True


_PR_SET_PDEATHSIG = 1


@dataclass(frozen=True)
class SerializedMessage:
    """A message ready to be written: topic, type and CDR bytes."""

    topic: str
    message_type: str
    cdr: bytes


@dataclass(frozen=True)
class RegisteredImage:
    """What became of one image."""

    camera: str
    stamp_ns: int
    matches: LandmarkMatches
    messages: tuple[SerializedMessage, ...]
    keyframe: WornKeyframe | None = None


@dataclass(frozen=True)
class AwaitedGrowth:
    """The worker has nothing older to say, and goes on when it knows by what the map has grown."""

    stamp_ns: int


@dataclass(frozen=True)
class SkippedImage:
    """An image that could not be used, and why."""

    camera: str
    stamp_ns: int
    reason: str


@dataclass(frozen=True)
class DroppedImages:
    """Images that were left out unread because their stamps do not increase."""

    camera: str
    stamp_ns: int
    count: int


@dataclass(frozen=True)
class LostImages:
    """Images that the bag says it holds, but that are not in it."""

    camera: str
    stamp_ns: int
    count: int

    def __str__(self) -> str:
        return (
            f"camera {self.camera}: {self.count} images that the recording should hold are not in it; its file is "
            "damaged, copy it again"
        )


@dataclass(frozen=True)
class WorkerFailure:
    """A user's error that ended the worker."""

    error: BodycamError


Result = RegisteredImage | SkippedImage | DroppedImages | LostImages
"""What became of an image, or of several."""

WorkerItem = Result | AwaitedGrowth | WorkerFailure | None
"""What a worker sends; None is its last word."""


@dataclass(frozen=True)
class RegistrationTask:
    """What is to be registered, and how.

    Attributes:
        recording_path, map_path: where recording and map are.
        settings: of the pipeline.
        max_rate: images per second and camera; of a faster recording those nearest to an even beat [Hz].
        with_messages: make the messages that a bag keeps of each image.
        slim: of these none of tracks, and none of the landmarks but the pose by them.
        backwards: register the last image first. Then time is mirrored: stamps, what comes of them, and the read-out of
            the rows count from the end; ``mirrored_ns`` turns stamps back.
        readouts: camera -> how long its rows are read out, where something but the recording knows.
    """

    recording_path: Path
    map_path: Path
    settings: PipelineSettings
    max_rate: float = math.inf
    with_messages: bool = True
    slim: bool = False
    backwards: bool = False
    readouts: Mapping[str, Readout] = field(default_factory=dict)


def run_camera_worker(
    task: RegistrationTask,
    cameras: tuple[str, ...],
    outbox: "Queue[WorkerItem]",
    inbox: "Queue[Growth]",
) -> None:
    """Entry of the process: register the cameras' images and send the results, ending with None.

    Args:
        task: what is to be done.
        cameras: this worker's.
        outbox: for the results.
        inbox: for what the map has grown by, epoch by epoch.
    """
    _end_with_parent()
    bound_inputs()
    # What there is to warn about goes to the parent, who counts it and says it once.
    logging.getLogger("bodycam_ros").setLevel(logging.ERROR)
    cv2.setNumThreads(1)
    try:
        for item in register_images(task, cameras, inbox):
            outbox.put(item)
        outbox.put(None)
    except BodycamError as error:
        outbox.put(WorkerFailure(error))
    except MemoryError:
        outbox.put(WorkerFailure(RecordingError("there is not enough memory; give fewer processes (--jobs)")))


def _end_with_parent() -> None:
    """End this process as soon as its parent is gone, however that one ended.

    The parent holds the other end of a pipe, which closes even if it is killed. On Linux the kernel is asked as well:
    it needs no thread of ours to be given time.
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
    task: RegistrationTask, cameras: tuple[str, ...], inbox: "Queue[Growth]"
) -> Iterator[Result | AwaitedGrowth]:
    """Register the images of some cameras in the order in which they were recorded."""
    reference_map = ReferenceMap.load(task.map_path)
    growth = GrowthOfOne(reference_map, task.settings.growth, inbox.get) if task.settings.growth.enabled else None
    with open_recording(task.recording_path) as recording:
        pipelines = {
            camera: CameraPipeline(
                recording.camera_model(camera),
                reference_map,
                task.settings,
                _readout(recording, camera, task),
                None if growth is None else growth.map,
            )
            for camera in cameras
        }
        beat = Beat(task.max_rate)
        stamp_ns = 0
        images = images_backwards(recording, cameras) if task.backwards else recording.images(cameras)
        for image in images:
            stamp_ns = image.stamp_ns
            if task.backwards:
                stamp_ns = mirrored_ns(recording.start_ns, recording.duration_s, stamp_ns)
            if not beat.is_due(image.camera, stamp_ns):
                continue
            if growth is not None:
                if growth.is_behind(stamp_ns):
                    yield AwaitedGrowth(stamp_ns)
                growth.catch_up(stamp_ns)
            try:
                tracks, matches, keyframe = pipelines[image.camera].process(decode_grey(image), stamp_ns)
            except RecordingError as error:
                yield SkippedImage(image.camera, stamp_ns, str(error))
                continue
            messages = _serialised(image.camera, tracks, matches, task.slim) if task.with_messages else ()
            yield RegisteredImage(image.camera, stamp_ns, matches, messages, keyframe)
        for camera, count in sorted(recording.dropped.items()):
            if count:
                yield DroppedImages(camera, stamp_ns, count)
        for camera, count in sorted(recording.lost.items()):
            if count:
                yield LostImages(camera, stamp_ns, count)


def mirrored_ns(start_ns: int, duration_s: float, stamp_ns: int) -> int:
    """A stamp as it is where a recording's time runs from its end to its start, or one of those as it was [ns]."""
    return 2 * start_ns + round(1e9 * duration_s) - stamp_ns


def _readout(recording: Recording, camera: str, task: RegistrationTask) -> Readout | None:
    known = best_known(recording.readout(camera), task.readouts.get(camera))
    return Readout(-known.seconds, known.sigma) if task.backwards and known is not None else known


def _serialised(camera: str, tracks: TrackFrame, matches: LandmarkMatches, slim: bool) -> tuple[SerializedMessage, ...]:
    """The messages that a bag keeps of one image."""
    make = recorded_messages()
    messages = {
        "tracks": None if slim else tracks_message(make, tracks),
        "landmarks": landmarks_message(make, matches.bare() if slim else matches),
        "pose": camera_pose_message(make, matches),
    }
    return tuple(
        SerializedMessage(
            f"/{camera}/{name}",
            message.__msgtype__,
            bytes(recording_typestore().serialize_cdr(message, message.__msgtype__)),
        )
        for name, message in messages.items()
        if message is not None
    )


def known_readouts(recording: Recording, body: BodyModel, cameras: Iterable[str]) -> dict[str, Readout]:
    """Camera -> its read-out time by the body file, hardly known where the recording is in another video mode."""
    known = {
        camera: body.mounts[camera].readout_in(recording.video_mode(camera))
        for camera in cameras
        if body.mounts[camera].readout is not None
    }
    return {camera: readout for camera, readout in known.items() if readout is not None}
