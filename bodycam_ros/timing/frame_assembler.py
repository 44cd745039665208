"""From the streams of single cameras to frames of the whole body."""

import time
from collections import Counter, deque
from collections.abc import Iterable
from dataclasses import dataclass, field
from math import inf
from statistics import median

from bodycam_ros.body_state import BodyFrame, SegmentMeasurements
from bodycam_ros.camera.camera_image import CameraImage
from bodycam_ros.registration.landmark_matches import LandmarkMatches
from bodycam_ros.settings import setting
from bodycam_ros.timing.timeline import Message

FIRST_WAIT_S = 10.0
"""Live, a static camera first searches for the limbs, which takes seconds of a core: its first message is waited for
by so much longer than ``max_wait``."""

_RECENT = 150  # frames by which cameras are judged: some seconds
_SAME_FRAME = 0.49  # of the time between two images of a camera: within it they are of the same state
_INTERVALS = 9  # intervals of whose median a camera's rate is made: a lost image now and then does not matter


@dataclass(frozen=True)
class AssemblerSettings:
    """Which stamps belong together, and how long to wait for a camera."""

    sync_tolerance: float = setting(
        0.008,
        unit="s",
        limits=(0.0, 0.1),
        reason="stamps this close are one state; of cameras faster than 60 Hz less than half the time of an image",
    )
    max_wait: float = setting(
        1.0,
        unit="s",
        limits=(0.05, 60.0),
        reason="a camera without images while another goes on for this long, in time of the recording, is not waited "
        "for until its next image; raise it for slow networks, at the cost of delay when a camera fails",
        live=True,
    )


@dataclass
class _Stream:
    """One camera.

    Attributes:
        queue: messages of frames to come, by stamp.
        latest_ns: its latest stamp.
        before_ns: the one before.
        intervals_ns: times between its latest images.
        frame_ns: their median.
        came_s: when its latest message came, on the steady clock.
    """

    queue: deque[Message] = field(default_factory=deque)
    latest_ns: int | None = None
    before_ns: int | None = None
    intervals_ns: deque[int] = field(default_factory=lambda: deque(maxlen=_INTERVALS))
    frame_ns: float = inf
    came_s: float = field(default_factory=time.monotonic)


class FrameAssembler:
    """Merges the messages of all cameras by stamp; those of each camera come in order of time (``Timeline``).

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

    Attributes:
        assembled: number of frames so far.
        late_of: camera -> messages that came after their frame, and were dropped.
        max_wait_ns: by the settings, or as it is replaced.
    """

    def __init__(self, cameras: Iterable[str], settings: AssemblerSettings | None = None, live: bool = False) -> None:
        settings = settings or AssemblerSettings()
        self._tolerance_ns = round(1e9 * settings.sync_tolerance)
        self.max_wait_ns = round(1e9 * settings.max_wait)
        self._live = live
        self._streams = {camera: _Stream() for camera in cameras}
        self._first_ns: int | None = None
        self._assembled_ns = -1
        self._recent: deque[frozenset[str]] = deque(maxlen=_RECENT)
        self.assembled = 0
        self.late_of: Counter[str] = Counter()

    @property
    def late(self) -> int:
        """Messages that were dropped because they came too late."""
        return self.late_of.total()

    @property
    def silent(self) -> list[str]:
        """Cameras that are not waited for."""
        return [camera for camera, stream in self._streams.items() if not stream.queue and self._has_stopped(stream)]

    @property
    def shares(self) -> dict[str, float]:
        """Camera -> its share of the latest frames, of those that the most frequent camera took part in, 0 to 1."""
        counts = Counter(camera for frame in self._recent for camera in frame)
        most = max(counts.values(), default=0)
        return {camera: counts[camera] / most for camera in self._streams} if most else {}

    def join(self, camera: str, longer_s: float = 0.0) -> None:
        """Wait for one more camera from now on; live, for its first message by so much longer."""
        if camera not in self._streams:
            self._streams[camera] = _Stream(came_s=time.monotonic() + longer_s)

    def add(self, message: Message) -> list[BodyFrame]:
        """Add a message; frames that are complete now, in order of time."""
        stream = self._streams.get(message.camera)
        if stream is None:
            return []
        stamp_ns = message.stamp_ns
        stream.came_s = time.monotonic()
        if self._first_ns is None:
            # No camera has stopped before the first message of any.
            self._first_ns = stamp_ns
            for each in self._streams.values():
                each.came_s = max(each.came_s, stream.came_s)
        if stream.latest_ns is not None:
            stream.intervals_ns.append(stamp_ns - stream.latest_ns)
            stream.frame_ns = median(stream.intervals_ns)
        stream.before_ns, stream.latest_ns = stream.latest_ns, stamp_ns
        if stamp_ns > self._assembled_ns:
            stream.queue.append(message)
        else:
            self.late_of[message.camera] += 1
        return self.complete()

    def complete(self) -> list[BodyFrame]:
        """Frames that are complete by now, because a camera has stopped for long enough."""
        frames = []
        while self._is_complete():
            frames.append(self._take())
        return frames

    def skip(self, stamp_ns: int) -> None:
        """Drop what comes up to a stamp [ns]: its state was solved without images."""
        self._assembled_ns = max(self._assembled_ns, stamp_ns)

    def flush(self) -> list[BodyFrame]:
        """Frames that were still waiting for a camera; the recording is over."""
        frames = []
        while self._heads_ns():
            frames.append(self._take())
        return frames

    def restart(self) -> None:
        """Begin a new epoch, after ``flush``: its time may be earlier."""
        self._streams = {camera: _Stream() for camera in self._streams}
        self._first_ns, self._assembled_ns = None, -1

    def _within_ns(self, stream: _Stream) -> int:
        """How far after the earliest stamp [ns] a camera's image is of the same state."""
        return round(min(self._tolerance_ns, _SAME_FRAME * stream.frame_ns))

    def _heads_ns(self) -> list[int]:
        return [stream.queue[0].stamp_ns for stream in self._streams.values() if stream.queue]

    def _is_complete(self) -> bool:
        """Whether no camera is to be waited for at the earliest stamp."""
        heads_ns = self._heads_ns()
        if not heads_ns:
            return False
        first_ns = min(heads_ns)
        all_there, latest_ns = True, first_ns
        for stream in self._streams.values():
            stream_ns = stream.latest_ns or 0
            latest_ns = max(latest_ns, stream_ns)
            if stream.queue or stream_ns > first_ns + self._within_ns(stream):
                continue
            if not self._has_stopped(stream):
                return False
            all_there = False
        return all_there or self._live or latest_ns > first_ns + self._tolerance_ns

    def _has_stopped(self, stream: _Stream) -> bool:
        """Whether a camera is not waited for: another has two stamps that are later by ``max_wait``."""
        if self._first_ns is None or (self._live and time.monotonic() - stream.came_s < 1e-9 * self.max_wait_ns):
            return False
        # Two: after a pause of all cameras, the first to go on is ahead of the others by its length.
        since_ns = self._first_ns if stream.latest_ns is None else stream.latest_ns
        others_ns = (other.before_ns for other in self._streams.values() if other.before_ns is not None)
        return any(before_ns > since_ns + self.max_wait_ns for before_ns in others_ns)

    def _take(self) -> BodyFrame:
        stamp_ns = min(self._heads_ns())
        taken = {
            camera: stream.queue.popleft()
            for camera, stream in self._streams.items()
            if stream.queue and stream.queue[0].stamp_ns <= stamp_ns + self._within_ns(stream)
        }
        self.assembled += 1
        self._assembled_ns = max(self._assembled_ns, *(message.stamp_ns for message in taken.values()))
        self._recent.append(frozenset(taken))
        return BodyFrame(
            stamp_ns,
            {camera: each for camera, each in taken.items() if isinstance(each, LandmarkMatches)},
            {camera: each for camera, each in taken.items() if isinstance(each, CameraImage)},
            {camera: each for camera, each in taken.items() if isinstance(each, SegmentMeasurements)},
        )
