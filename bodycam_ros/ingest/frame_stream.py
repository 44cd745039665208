"""The messages of one camera in order of time, as they go into the bag."""

import heapq
import math
import os
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass, replace
from itertools import islice
from operator import attrgetter
from threading import Event
from typing import TypeVar

import numpy as np

from bodycam_ros.camera.model import optical_frame
from bodycam_ros.camera.readout import Readout
from bodycam_ros.errors import RecordingError
from bodycam_ros.ingest.clock_fit import CameraTime
from bodycam_ros.ingest.inertial_stream import read_inertial_samples
from bodycam_ros.ingest.ingest_camera import IngestCamera
from bodycam_ros.messages.factory import Message, header_message, time_message
from bodycam_ros.messages.images import COMPRESSED_VIDEO, camera_info_message
from bodycam_ros.messages.imu import IMU_TOPIC, imu_message
from bodycam_ros.messages.timing import timing_message
from bodycam_ros.progress import Progress, in_parallel
from bodycam_ros.recording.bag_writer import SerializedMessage
from bodycam_ros.recording.camera_video import CameraVideo
from bodycam_ros.recording.image_folder import ImageFolder
from bodycam_ros.recording.typestore import recorded_messages
from bodycam_ros.recording.video_encoder import h264_packets
from bodycam_ros.recording.video_file import TimedPacket
from bodycam_ros.timing.clock_state import ClockState

_INFO_EVERY_NS = 1_000_000_000  # a reader that starts in the middle of a bag finds the lens
_ASTRAY_S = 60.0  # a frame so far from the time of its file has a damaged time
_LONGEST_S = 1e6
_FORMATS = {"h264": "h264", "hevc": "h265"}
_BATCH = 8  # messages made ahead by a thread

BY_STAMP: Callable[[SerializedMessage], int] = attrgetter("stamp_ns")

T = TypeVar("T")


@dataclass
class FrameStream:
    """The messages of one camera, and what became of its frames while they are read.

    Attributes:
        camera: what is read.
        time: where its media time lies in the recording.
        base_ns: stamp of the recording's time 0 [ns].
        threads: that decode and compress.
        window_s: (from, to) of the frames that are wanted, in the recording's time [s].
        frames: in the bag, so far.
        first_ns, last_ns: their stamps [ns].
        imu_samples: of its inertial sensor in the bag.
        without_key: frames that came before the first keyframe and cannot be decoded.
        unordered: frames whose time is not after the one before, or out of all reason.
        fault: why the camera ended early, if it did.
        imu_fault: what is wrong with its inertial sensor, if anything is.
    """

    camera: IngestCamera
    time: CameraTime
    base_ns: int
    threads: int
    window_s: tuple[float, float] = (-math.inf, math.inf)
    frames: int = 0
    first_ns: int = 0
    last_ns: int = 0
    imu_samples: int = 0
    without_key: int = 0
    unordered: int = 0
    fault: str = ""
    imu_fault: str = ""

    def messages(self) -> Iterator[SerializedMessage]:
        """Lens and timing first, then the frames, and samples of the inertial sensor; the lens once a second.

        What cannot be read or compressed ends the camera early, and is noted: the others go on.
        """
        return heapq.merge(self._frames_until_fault(), self._imu_messages(), key=BY_STAMP)

    def remark_lines(self) -> list[str]:
        """For the user, when all frames were read: lines that name the camera."""
        remarks = []
        if self.fault:
            remarks.append(f"ends early: {self.fault}")
        read = self.frames + self.without_key + self.unordered
        is_cut = self.is_whole and self.camera.video.facts.frames > read
        remarks += frame_remarks(self.camera, read if is_cut else None, self.without_key, self.unordered)
        if self.imu_fault:
            remarks.append(imu_remark(self.imu_fault))
        return [f"camera {self.camera.name}: {remark}" for remark in remarks]

    @property
    def is_whole(self) -> bool:
        """Whether all frames are wanted."""
        return self.window_s == (-math.inf, math.inf)

    def _recording_s(self, media_s: float) -> float:
        return float(self.time.recording_s(np.array([media_s]))[0])

    def _is_wanted(self, media_s: float) -> bool:
        return self.window_s[0] <= self._recording_s(media_s) < self.window_s[1]

    def _frames_until_fault(self) -> Iterator[SerializedMessage]:
        try:
            yield from self._stamped_frames()
        except RecordingError as error:
            self.fault = error.cause

    def _imu_messages(self) -> Iterator[SerializedMessage]:
        try:
            samples = read_inertial_samples(self.camera)
        except RecordingError as error:
            self.imu_fault = error.cause
            return
        if samples is None:
            return
        make, camera = recorded_messages(), self.camera.topic_name
        if not self.is_whole:
            wanted = np.array([self._is_wanted(each) for each in (1e-9 * samples.stamps_ns).tolist()], bool)
            samples = replace(
                samples,
                stamps_ns=samples.stamps_ns[wanted],
                angular_velocity=samples.angular_velocity[wanted],
                acceleration=samples.acceleration[wanted],
            )
        self.imu_samples = len(samples)
        media_s = np.asarray(1e-9 * samples.stamps_ns, np.float64)
        stamps_ns = self.base_ns + np.round(1e9 * self.time.recording_s(media_s)).astype(np.int64)
        for stamp_ns, w, a in zip(stamps_ns.tolist(), samples.angular_velocity, samples.acceleration, strict=True):
            yield SerializedMessage.of(stamp_ns, f"/{camera}{IMU_TOPIC}", imu_message(make, camera, stamp_ns, w, a))

    def _stamped_frames(self) -> Iterator[SerializedMessage]:
        make = recorded_messages()
        name = self.camera.topic_name
        lens = self.camera.written_lens
        info_due_ns: int | None = None
        latest_s = min((self.camera.video.facts.duration_s or math.inf) + _ASTRAY_S, _LONGEST_S)
        for media_s, kind, content in self._frames():
            stamp_ns = self.base_ns + round(1e9 * float(self.time.recording_s(np.array([media_s]))[0]))
            if not -_ASTRAY_S < media_s < latest_s or (self.frames and stamp_ns <= self.last_ns):
                self.unordered += 1
                continue
            if info_due_ns is None:
                self.first_ns = info_due_ns = stamp_ns
                yield SerializedMessage.of(stamp_ns, f"/{name}/timing", self._timing(stamp_ns))
            if stamp_ns >= info_due_ns:
                info_due_ns += _INFO_EVERY_NS
                yield SerializedMessage.of(stamp_ns, f"/{name}/camera_info", camera_info_message(make, lens, stamp_ns))
            self.frames += 1
            self.last_ns = stamp_ns
            frame_id, data = optical_frame(name), np.frombuffer(content, dtype=np.uint8)
            if kind in _FORMATS.values():
                time = time_message(make, stamp_ns)
                message = make(COMPRESSED_VIDEO, timestamp=time, frame_id=frame_id, data=data, format=kind)
                yield SerializedMessage.of(stamp_ns, f"/{name}/image_raw/compressed_video", message)
            else:
                header = header_message(make, stamp_ns, frame_id)
                message = make("sensor_msgs/msg/CompressedImage", header=header, format=kind, data=data)
                yield SerializedMessage.of(stamp_ns, f"/{name}/image_raw/compressed", message)

    def _timing(self, stamp_ns: int) -> Message:
        time = self.time
        readout = None if self.camera.readout_s is None else Readout(self.camera.readout_s, 0.0)
        # Stamps are corrected.
        clock = ClockState(stamp_ns, stamp_ns, 0.0, 0.0, time.start_sigma_s, time.drift_sigma)
        return timing_message(recorded_messages(), self.camera.topic_name, time.source, readout, clock)

    def _frames(self) -> Iterator[tuple[float, str, bytes]]:
        """Media time [s], format and content."""
        video = self.camera.video
        if isinstance(video, ImageFolder) and self.camera.is_copied:
            yield from (each for each in video.files() if self._is_wanted(each[0]))
        else:
            for media_s, packet in self._packets():
                yield media_s, _FORMATS[packet.codec], packet.data

    def _packets(self) -> Iterator[TimedPacket]:
        video, facts = self.camera.video, self.camera.video.facts
        if isinstance(video, ImageFolder) or not self.camera.is_copied:
            lens = self.camera.written_lens
            size = None if self.camera.scale == 1.0 else (lens.width, lens.height)
            frames = (each for each in video.frames(self.threads) if self._is_wanted(each[0]))
            yield from h264_packets(frames, facts.rotation_deg, facts.rate_hz, self.threads, size)
            return
        has_key = False
        before: list[TimedPacket] = []  # since the last keyframe before the window: its first frame is made of them
        for media_s, packet in video.packets():
            has_key = has_key or packet.is_key
            if not has_key:
                self.without_key += 1
                continue
            if (at_s := self._recording_s(media_s)) >= self.window_s[1]:
                return
            if at_s < self.window_s[0]:
                before = [] if packet.is_key else before
                before.append((media_s, packet))
                continue
            if before and not packet.is_key:
                yield from before
            before = []
            yield media_s, packet


def frame_remarks(camera: IngestCamera, read: int | None, without_key: int, unordered: int) -> list[str]:
    """What is said of a camera's files, and of frames that are not in its bag.

    Args:
        camera: of the frames.
        read: how many its files have, where that is fewer than their index lists; else None.
        without_key: that came before the first keyframe.
        unordered: whose time is not after the one before.
    """
    video, remarks = camera.video, []
    files = " and ".join(path.name for path in (video.files if isinstance(video, CameraVideo) else [video.path]))
    if isinstance(video, CameraVideo) and video.is_joined_by_name:
        remarks.append(
            f"{files} are joined, by their names alone, as chapters that follow each other; if these are several "
            "recordings, its clock is wrong: keep each recording in a folder of its own"
        )
    if read is not None:
        remarks.append(
            f"{files} should have {video.facts.frames} frames, and {read} can be read: cut off or damaged; "
            "copy it again from the camera if you can"
        )
    if without_key:
        remarks.append(f"{without_key} frames before the first keyframe cannot be decoded")
    if unordered:
        remarks.append(f"{unordered} frames dropped: their time is out of order")
    return remarks


def imu_remark(fault: str) -> str:
    """What is said of a camera whose inertial sensor cannot be used, and why."""
    return f"its inertial sensor is not used: {fault}"


@contextmanager
def merged_ahead(streams: Sequence[Iterator[T]], order: Callable[[T], int], jobs: int) -> Iterator[Iterator[T]]:
    """Merge ordered streams, of each of which the next items are made ahead on a thread.

    An error in a stream is raised where its items would have come; when the block is left, all threads have ended.

    Args:
        streams: what to merge; each is used by one thread at a time.
        order: of an item.
        jobs: threads that may work at the same time.
    """
    with ThreadPoolExecutor(jobs) as pool:

        def items(stream: Iterator[T]) -> Iterator[T]:
            batch = pool.submit(lambda: list(islice(stream, _BATCH)))
            while ready := batch.result():
                batch = pool.submit(lambda: list(islice(stream, _BATCH)))
                yield from ready

        try:
            yield heapq.merge(*(items(stream) for stream in streams), key=order)
        finally:
            pool.shutdown(cancel_futures=True)


def for_each_camera(
    cameras: Iterable[str], work: Callable[[str, Event], T], step: str, progress: Progress
) -> dict[str, T]:
    """Camera -> the result of its work.

    Args:
        cameras: names.
        work: done in threads; ends soon once the event is set: Ctrl-C must not wait for two hours of video.
        step: name of the whole.
        progress: of the cameras.
    """
    ended, names = Event(), list(cameras)
    try:
        with progress.step(step, len(names)) as advance:
            results = in_parallel(lambda name: work(name, ended), names, os.cpu_count() or 1, advance)
            return dict(zip(names, results, strict=True))
    finally:
        ended.set()
