"""The messages of one camera in order of time, as they go into the bag."""

import heapq
import math
import os
import queue
import threading
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass, field
from threading import Event
from typing import Generic, TypeVar

import numpy as np

from bodycam_ros.camera.readout import Readout
from bodycam_ros.errors import RecordingError
from bodycam_ros.ingest.camera_time import CameraTime
from bodycam_ros.ingest.ingest_camera import IngestCamera
from bodycam_ros.messages.factory import Message, header_message, optical_frame, time_message
from bodycam_ros.messages.images import camera_info_message
from bodycam_ros.messages.timing import SaidTiming, timing_message
from bodycam_ros.recording.typestore import COMPRESSED_VIDEO, recorded_messages, recording_typestore
from bodycam_ros.recording.video_decoder import h264_packets, jpegs
from bodycam_ros.recording.video_file import TimedPacket

_INFO_EVERY_NS = 1_000_000_000
"""A reader that begins in the middle of a bag needs not wait for the lens."""

_ASTRAY_S = 60.0
"""A frame so far from the time of its file has a damaged time."""

_LONGEST_S = 1e6

_FORMATS = {"h264": "h264", "hevc": "h265"}


@dataclass(frozen=True)
class StampedMessage:
    """A message ready to be written: stamp [ns], topic, type and CDR bytes."""

    stamp_ns: int
    topic: str
    message_type: str
    cdr: bytes


@dataclass
class StreamTally:
    """What became of a camera's frames, while they are read.

    Attributes:
        frames: in the bag.
        first_ns, last_ns: their stamps [ns].
        without_key: that came before the first keyframe and cannot be decoded.
        unordered: whose time is not after the one before, or out of all reason.
        fault: why the camera ended early, if it did.
    """

    frames: int = 0
    first_ns: int = 0
    last_ns: int = 0
    without_key: int = 0
    unordered: int = 0
    fault: str = ""


@dataclass
class FrameStream:
    """One camera on its way into the bag.

    Attributes:
        camera: what is read.
        time: where its media time lies in the recording.
        base_ns: stamp of the recording's time 0 [ns].
        as_jpeg: write still images.
        threads: that decode and compress.
        tally: what became of the frames so far.
    """

    camera: IngestCamera
    time: CameraTime
    base_ns: int
    as_jpeg: bool
    threads: int
    tally: StreamTally = field(default_factory=StreamTally)

    @property
    def is_copied(self) -> bool:
        """Whether the frames go into the bag as the camera compressed them."""
        return not self.as_jpeg and self.camera.video.facts.is_upright_annex_b

    def messages(self) -> Iterator[StampedMessage]:
        """Lens and timing first, then the frames; the lens once a second.

        What cannot be read or compressed ends the camera early, and is noted: the others go on.
        """
        try:
            yield from self._stamped_frames()
        except RecordingError as error:
            self.tally.fault = str(error)

    def _stamped_frames(self) -> Iterator[StampedMessage]:
        make, name = recorded_messages(), self.camera.name
        info_due_ns: int | None = None
        latest_s = (self.camera.video.duration_s or math.inf) + _ASTRAY_S
        for media_s, topic, message in self._frames():
            if not -_ASTRAY_S < media_s < min(latest_s, _LONGEST_S):
                self.tally.unordered += 1
                continue
            stamp_ns = self.base_ns + round(1e9 * float(self.time.recording_s(np.array([media_s]))[0]))
            if self.tally.frames and stamp_ns <= self.tally.last_ns:
                self.tally.unordered += 1
                continue
            if info_due_ns is None:
                self.tally.first_ns = info_due_ns = stamp_ns
                yield _stamped(stamp_ns, f"/{name}/timing", self._timing(stamp_ns))
            if stamp_ns >= info_due_ns:
                info_due_ns += _INFO_EVERY_NS
                yield _stamped(stamp_ns, f"/{name}/camera_info", camera_info_message(make, self.camera.lens, stamp_ns))
            self.tally.frames += 1
            self.tally.last_ns = stamp_ns
            if self.as_jpeg:
                message.header = header_message(make, stamp_ns, optical_frame(name))
            else:
                message.timestamp = time_message(make, stamp_ns)
            yield _stamped(stamp_ns, topic, message)

    def _timing(self, stamp_ns: int) -> Message:
        time = self.time
        readout = None if self.camera.readout_s is None else Readout(self.camera.readout_s, 0.0)
        said = SaidTiming(stamp_ns, time.source, readout, offset_sigma=time.start_sigma_s, drift_sigma=time.drift_sigma)
        return timing_message(recorded_messages(), self.camera.name, said)

    def _frames(self) -> Iterator[tuple[float, str, Message]]:
        """Media time [s], topic, and message without a stamp."""
        make, name = recorded_messages(), self.camera.name
        if self.as_jpeg:
            facts = self.camera.video.facts
            for media_s, file in jpegs(self.camera.video.frames(self.threads), facts.rotation_deg):
                data = np.frombuffer(file, dtype=np.uint8)
                image = make("sensor_msgs/msg/CompressedImage", format="jpeg", data=data)
                yield media_s, f"/{name}/image_raw/compressed", image
            return
        for timed in self._packets():
            yield (
                timed.media_s,
                f"/{name}/image_raw/compressed_video",
                make(
                    COMPRESSED_VIDEO,
                    frame_id=optical_frame(name),
                    data=np.frombuffer(timed.packet.data, dtype=np.uint8),
                    format=_FORMATS[timed.packet.codec],
                ),
            )

    def _packets(self) -> Iterator[TimedPacket]:
        video, facts = self.camera.video, self.camera.video.facts
        if not self.is_copied:
            yield from h264_packets(video.frames(self.threads), facts.rotation_deg, facts.rate_hz, self.threads)
            return
        has_begun = False
        for timed in video.packets():
            has_begun = has_begun or timed.packet.is_key
            if has_begun:
                yield timed
            else:
                self.tally.without_key += 1


def _stamped(stamp_ns: int, topic: str, message: Message) -> StampedMessage:
    cdr = bytes(recording_typestore().serialize_cdr(message, message.__msgtype__))
    return StampedMessage(stamp_ns, topic, message.__msgtype__, cdr)


T = TypeVar("T")

_QUEUE_LENGTH = 16
_POLL_S = 0.2


@contextmanager
def merged_ahead(streams: Sequence[Iterator[T]], order: Callable[[T], int], jobs: int) -> Iterator[Iterator[T]]:
    """Merge ordered streams, each made on a thread of its own.

    The heavy work, to decode and to compress, leaves Python to the other threads meanwhile. An error in a stream is
    raised where its item would have come; however the block ends, all threads have ended after it.

    Args:
        streams: what to merge; each is used by one thread only.
        order: of an item.
        jobs: threads that may work at the same time.
    """
    stopped = threading.Event()
    turn = threading.Semaphore(jobs)
    producers = [_Producer(stream, turn, stopped) for stream in streams]
    try:
        yield heapq.merge(*(producer.items() for producer in producers), key=order)
    finally:
        stopped.set()
        for producer in producers:
            producer.thread.join()


class _Producer(Generic[T]):
    def __init__(self, stream: Iterator[T], turn: threading.Semaphore, stopped: threading.Event) -> None:
        self._stream = stream
        self._turn = turn
        self._stopped = stopped
        self._made: queue.Queue[list[T] | BaseException] = queue.Queue(_QUEUE_LENGTH)
        self.thread = threading.Thread(target=self._make, daemon=True)
        self.thread.start()

    def items(self) -> Iterator[T]:
        while True:
            made = self._made.get()
            if isinstance(made, BaseException):
                raise made
            if not made:
                return
            yield from made

    def _make(self) -> None:
        try:
            while not self._stopped.is_set():
                with self._turn:
                    item = next(self._stream, None)
                self._put([] if item is None else [item])
                if item is None:
                    return
        except BaseException as error:  # whatever it is, it is raised where the stream is read
            self._put(error)

    def _put(self, made: list[T] | BaseException) -> None:
        while not self._stopped.is_set():
            try:
                return self._made.put(made, timeout=_POLL_S)
            except queue.Full:
                continue


def for_each_camera(
    cameras: Iterable[str], work: Callable[[str, Event], T], on_done: Callable[[int, int], None]
) -> dict[str, T]:
    """Camera -> what the work for it came to.

    Args:
        cameras: names.
        work: done in threads; it should look at the event now and then, and end once it is set: Ctrl-C must not wait
            for two hours of video.
        on_done: told how many are done, and of how many, from the calling thread.
    """
    ended = Event()
    results: dict[str, T] = {}
    with ThreadPoolExecutor(os.cpu_count() or 1) as pool:
        waiting = {camera: pool.submit(work, camera, ended) for camera in cameras}
        try:
            for done, (camera, result) in enumerate(waiting.items()):
                on_done(done, len(waiting))
                results[camera] = result.result()
        except BaseException:
            ended.set()
            pool.shutdown(cancel_futures=True)
            raise
        on_done(len(waiting), len(waiting))
    return results
