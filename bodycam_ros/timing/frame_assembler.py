"""From the messages of single cameras to frames of the whole body, within one epoch: which belong to which state.

Cameras that share their stamps give frames at these, as static cameras do. The others are interpolated to them; where
no cameras share, frames are equally spaced.
"""

import time
from bisect import bisect_left, insort
from collections import Counter
from collections.abc import Callable, Iterable
from dataclasses import dataclass

from bodycam_ros.body_state import BodyFrame
from bodycam_ros.camera.camera_image import CameraImage
from bodycam_ros.registration.landmark_matches import LandmarkMatches
from bodycam_ros.settings import setting
from bodycam_ros.timing.camera_stream import CameraStream
from bodycam_ros.timing.clock_estimator import ALL_NS, ClockEstimator
from bodycam_ros.timing.common_stamps import CommonStamps
from bodycam_ros.timing.timeline import Message


def _order(message: Message) -> tuple[int, str]:
    return message.stamp_ns, message.camera


@dataclass(frozen=True)
class AssemblerSettings:
    """Which stamps belong together, and how long to wait for a camera."""

    sync_tolerance: float = setting(
        0.008,
        unit="s",
        limits=(0.0, 0.1),
        reason="stamps that differ by less than this belong to one state; for cameras faster than 60 Hz set it below "
        "half of the time between two images",
    )
    max_wait: float = setting(
        1.0,
        unit="s",
        limits=(0.05, 60.0),
        reason="longest time, in the recording's time, that a frame waits for a camera that sends no images while "
        "others do; then frames are complete without it until its next image. Raise it for slow networks; a camera "
        "that fails then delays the output longer",
        live=True,
    )


class FrameAssembler:
    """Merges the messages of all cameras of one epoch; those of each camera come in order of time (``Timeline``).

    Frames depend on the stamps alone, not on the order of arrival, as long as no camera is behind the others by more
    than ``max_wait``. A camera that stops is waited for once. From then on a frame is complete without it; offline as
    soon as another camera has a later stamp, so that messages in order of time give the same frames whatever the order
    within a frame.

    Args:
        cameras: the cameras to wait for.
        settings: tolerances.
        live: whether messages come while images are taken. Then no camera counts as stopped before ``max_wait`` of
            real time, because on a busy machine one process may pause while others go on. Otherwise the stamps alone
            count.
        clocks: of the body's cameras; stamps of static cameras, and without clocks all, are used as they are.
        on_corrected: called with every registration, its stamp corrected.

    Attributes:
        closed_ns: stamp of the latest frame, in the body's time [ns]: messages up to it are late; -1 before the first.
        late: camera -> its late messages, which were dropped.
        max_wait_ns: by the settings, or as it is replaced.
    """

    def __init__(
        self,
        cameras: Iterable[str],
        settings: AssemblerSettings,
        live: bool,
        clocks: ClockEstimator | None,
        on_corrected: Callable[[LandmarkMatches], None],
    ) -> None:
        self._tolerance_ns = round(1e9 * settings.sync_tolerance)
        self.max_wait_ns = round(1e9 * settings.max_wait)
        self._live = live
        self._clocks = clocks
        self._on_corrected = on_corrected
        self._streams = {camera: CameraStream(self._tolerance_ns) for camera in cameras}
        self._free: frozenset[str] | None = None
        self._common = CommonStamps(clocks) if clocks else None
        self._waiting: list[Message] = []  # for the clocks, by their own stamps
        self._came_ns = -1  # stamp of the first message
        self._first_ns = self._twice_ns = -1  # in the body's time: the first stamp, and the latest but one of a camera
        self.closed_ns = -1
        self.late: Counter[str] = Counter()

    @property
    def silent(self) -> list[str]:
        """Cameras that are not waited for."""
        return [
            camera
            for camera, stream in self._streams.items()
            if (stream.is_free or not stream.messages) and self._has_stopped(stream)
        ]

    def add(self, message: Message) -> list[BodyFrame]:
        """Add a message; frames that are complete now, in order of time."""
        stream = self._streams.get(message.camera)
        if stream is None:
            return []
        stream.came_s = time.monotonic()
        self._came_ns = message.stamp_ns if self._came_ns < 0 else self._came_ns
        insort(self._waiting, message, key=_order)
        if self._clocks and isinstance(message, LandmarkMatches):
            self._clocks.add(message)
        return self._release(message.stamp_ns)

    def complete(self) -> list[BodyFrame]:
        """Frames that are complete by now, because a camera has stopped for long enough."""
        frames = []
        while (stamp_ns := self._next_ns()) is not None and self._is_complete(stamp_ns):
            frames += self._take(stamp_ns)
        return frames

    def close(self, stamp_ns: int) -> None:
        """Let messages up to a stamp [ns] be late: its state was solved without images."""
        self.closed_ns = max(self.closed_ns, stamp_ns)

    def flush(self) -> list[BodyFrame]:
        """Frames that were still waiting for a camera: the epoch is over, or all cameras are silent."""
        if self._clocks:
            self._clocks.flush()
        frames = self._release(ALL_NS)
        while (stamp_ns := self._next_ns()) is not None:
            frames += self._take(stamp_ns)
        return frames

    def _release(self, now_ns: int) -> list[BodyFrame]:
        """Let messages go on to their frames, as far as clocks are known; all, while no body camera sends any."""
        known_ns, clocks = ALL_NS, self._clocks
        if clocks:
            if now_ns - max(clocks.latest_ns, self._came_ns) <= 2 * self.max_wait_ns:
                known_ns = clocks.known_ns
            if self._free != clocks.free:
                self._free = clocks.free
                for camera, stream in self._streams.items():
                    stream.set_free(camera in self._free, self.closed_ns)
        count = bisect_left(self._waiting, (known_ns, ""), key=_order)
        released = self._waiting[:count]
        del self._waiting[:count]
        if clocks:
            released = [clocks.corrected(each) if isinstance(each, LandmarkMatches) else each for each in released]
        frames = []
        for message in sorted(released, key=_order):
            if isinstance(message, LandmarkMatches):
                self._on_corrected(message)
            self._receive(message)
            frames += self.complete()
        return frames

    def _receive(self, message: Message) -> None:
        stream, stamp_ns = self._streams[message.camera], message.stamp_ns
        if self._first_ns < 0:
            # No camera has stopped before the first message of any.
            self._first_ns = stamp_ns
            for each in self._streams.values():
                each.came_s = max(each.came_s, stream.came_s)
        is_late = stamp_ns <= self.closed_ns
        self.late[message.camera] += is_late
        self._twice_ns = max(self._twice_ns, stream.latest_ns)
        stream.add(message, is_late)
        if self._common and isinstance(message, LandmarkMatches):
            self._common.extend(stamp_ns, stream.is_free)

    def _next_ns(self) -> int | None:
        """The earliest stamp of a frame to come."""
        common_ns = None
        if self._common:
            self._common.drop(self.closed_ns)
            common_ns = self._common.first_ns
        heads_ns = [s.messages[0].stamp_ns for s in self._streams.values() if s.messages and not s.is_free]
        return min(heads_ns + ([] if common_ns is None else [common_ns]), default=None)

    def _common_at(self, stamp_ns: int) -> int | None:
        """The stamp that free-running cameras are interpolated to in a frame."""
        within_ns = min((s.within_ns for s in self._streams.values() if s.is_free), default=0)
        common_ns = self._common.first_ns if self._common else None
        return common_ns if common_ns is not None and common_ns <= stamp_ns + within_ns else None

    def _is_complete(self, stamp_ns: int) -> bool:
        """Whether no camera is to be waited for in the frame at a stamp."""
        common_ns = self._common_at(stamp_ns)
        all_there, latest_ns = True, stamp_ns
        for stream in self._streams.values():
            latest_ns = max(latest_ns, stream.latest_ns)
            if not stream.has_passed(stamp_ns, common_ns):
                if not self._has_stopped(stream):
                    return False
                all_there = False
        return all_there or self._live or latest_ns > stamp_ns + self._tolerance_ns

    def _has_stopped(self, stream: CameraStream) -> bool:
        """Whether a camera is not waited for: another has two stamps that are later by ``max_wait``."""
        if self._live and time.monotonic() - stream.came_s < 1e-9 * self.max_wait_ns:
            return False
        # Two: after a pause of all cameras, the first to go on is ahead of the others by its length.
        return self._twice_ns > max(self._first_ns, stream.latest_ns) + self.max_wait_ns

    def _take(self, stamp_ns: int) -> list[BodyFrame]:
        """The frame at a stamp; none where free-running cameras have no image near it, and there are no others."""
        common_ns = self._common_at(stamp_ns)
        given = {name: s.take(stamp_ns, common_ns) for name, s in self._streams.items()}
        taken = {name: each for name, each in given.items() if each is not None}
        self.close(max([stamp_ns, *(each.stamp_ns for each in taken.values())]))
        if not taken:
            return []
        return [
            BodyFrame(
                stamp_ns,
                {camera: each for camera, each in taken.items() if isinstance(each, LandmarkMatches)},
                {camera: each for camera, each in taken.items() if isinstance(each, CameraImage)},
            )
        ]
