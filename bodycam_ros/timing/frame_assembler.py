"""From the streams of single cameras to frames of the whole body."""

import time
from collections import Counter, deque
from collections.abc import Iterable
from dataclasses import dataclass, field
from math import inf
from statistics import median

from bodycam_ros.body_state import BodyFrame, SaidSegments
from bodycam_ros.camera.camera_image import CameraImage
from bodycam_ros.registration.landmark_matches import LandmarkMatches
from bodycam_ros.settings import setting

FIRST_WAIT_S = 10.0
"""Live, a static camera first searches for the limbs, which takes seconds of a core: its first message is waited for
by so much longer than ``max_wait``."""

_RECENT = 150  # frames by which cameras are judged: some seconds
_ELSEWHERE_NS = 10_000_000_000  # a message so far behind the body is not late: its camera is of another time
_KEPT_NS = 30_000_000_000  # of a queue that the other cameras have not reached, in its own stamps
_LIVELY = 8  # a camera without a message while each sent so many, on average, has no vote on the time
_SAME_FRAME = 0.49  # of the time between two images of a camera: within it they are of the same state
_INTERVALS = 9  # intervals of whose median a camera's rate is made: a lost image now and then does not matter
_FAR_BEHIND = 5  # times ``max_wait`` behind most others: such a camera is not waited for

Message = LandmarkMatches | CameraImage | SaidSegments
"""Of a body camera, the image of a static one, or what a static one measured."""


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


class Synchrony:
    """Which cameras took part in the latest frames.

    Args:
        cameras: their names.

    Attributes:
        missed: camera -> frames so far without it, but with half of all cameras: images that were dropped or late.
    """

    def __init__(self, cameras: Iterable[str]) -> None:
        self._cameras = list(cameras)
        self._frames: deque[frozenset[str]] = deque(maxlen=_RECENT)
        self.missed: Counter[str] = Counter()

    def join(self, camera: str) -> None:
        """One more camera."""
        self._cameras.append(camera)

    def add(self, present: frozenset[str]) -> None:
        """Note the cameras of a frame."""
        self._frames.append(present)
        if 2 * len(present) >= len(self._cameras):
            self.missed.update(camera for camera in self._cameras if camera not in present)

    def shares(self) -> dict[str, float]:
        """Camera -> share of the latest frames that it took part in, 0 to 1; empty before the first frame.

        Counted over frames with the camera that has most company.
        """
        if not self._frames:
            return {}
        company = {camera: sum(len(f) for f in self._frames if camera in f) for camera in self._cameras}
        reference = max(self._cameras, key=lambda camera: company[camera])
        frames = [frame for frame in self._frames if reference in frame]
        return {camera: sum(camera in frame for frame in frames) / len(frames) for camera in self._cameras}


@dataclass
class _Stream:
    """One camera.

    Attributes:
        queue: messages of frames to come, by stamp.
        behind: messages of a time before the last frame; the body may go there.
        latest_ns: its latest stamp.
        left_ns: the stamp from which its time went back.
        intervals_ns: times between its latest images.
        frame_ns: their median.
        others_run_ns: other camera -> how far its stamps ran on since this one's latest; of a jump only ``max_wait``.
        number: of its latest message, counted over all cameras.
        came_s: when that came, on the steady clock.
        far_behind: whether most others were far ahead of it then.
    """

    queue: deque[Message] = field(default_factory=deque)
    behind: list[Message] = field(default_factory=list)
    latest_ns: int | None = None
    left_ns: int = 0
    intervals_ns: deque[int] = field(default_factory=lambda: deque(maxlen=_INTERVALS))
    frame_ns: float = inf
    others_run_ns: Counter[str] = field(default_factory=Counter)
    number: int = 0
    came_s: float = field(default_factory=time.monotonic)
    far_behind: bool = False


class FrameAssembler:
    """Merges the messages of all cameras by stamp.

    Frames depend on the stamps alone, not on the order of arrival, as long as no camera is behind the others by more
    than ``max_wait``. A camera that stops is waited for once. From then on a frame is complete without it; offline as
    soon as another camera has a later stamp, so that messages in order of time give the same frames whatever the order
    within a frame.

    Args:
        cameras: the cameras to wait for.
        settings: tolerances.
        live: whether messages come while images are taken. Then frames follow when most cameras go back in time, as
            when a bag is played again; and no camera counts as stopped before ``max_wait`` of real time, because on a
            busy machine one process may pause while others go on. Otherwise the stamps alone count.

    Attributes:
        assembled: number of frames so far.
        late_of: camera -> messages that came after their frame, and were dropped.
        max_wait_ns: by the settings, or as it is replaced.
        restarts: how often time went back.
        synchrony: which cameras took part.
    """

    def __init__(self, cameras: Iterable[str], settings: AssemblerSettings | None = None, live: bool = False) -> None:
        settings = settings or AssemblerSettings()
        self._tolerance_ns = round(1e9 * settings.sync_tolerance)
        self.max_wait_ns = round(1e9 * settings.max_wait)
        self._live = live
        self._streams = {camera: _Stream() for camera in cameras}
        self._count = 0
        self._assembled_ns = -1
        self.assembled = 0
        self.late_of: Counter[str] = Counter()
        self.restarts = 0
        self.synchrony = Synchrony(self._streams)

    @property
    def late(self) -> int:
        """Messages that were dropped because they came too late."""
        return self.late_of.total()

    @property
    def silent(self) -> list[str]:
        """Cameras that are not waited for."""
        return [camera for camera, stream in self._streams.items() if not stream.queue and self._has_stopped(stream)]

    def apart_s(self, camera: str) -> float | None:
        """How far the stamps of a camera are ahead of the last frame [s], or behind (negative); None if it stopped."""
        stream = self._streams[camera]
        if stream.latest_ns is None or not self._is_lively(stream):
            return None
        return 1e-9 * (stream.latest_ns - self._assembled_ns)

    def join(self, camera: str, longer_s: float = 0.0) -> None:
        """Wait for one more camera from now on; live, for its first message by so much longer."""
        if camera not in self._streams:
            self._streams[camera] = _Stream(came_s=time.monotonic() + longer_s)
            self.synchrony.join(camera)

    def add(self, message: Message) -> list[BodyFrame]:
        """Add a message; frames that are complete now, in order of time."""
        stream = self._streams.get(message.camera)
        if stream is None:
            return []
        goes_back = self._note(stream, message)
        frames = []
        if message.stamp_ns > self._assembled_ns:
            self._return(stream, message.stamp_ns)
            stream.queue.append(message)
            while stream.queue[-1].stamp_ns - stream.queue[0].stamp_ns > max(_KEPT_NS, 2 * self.max_wait_ns):
                self.late_of[stream.queue.popleft().camera] += 1
        else:
            self._add_behind(stream, message, goes_back)
            lively = [each for each in self._streams.values() if self._is_lively(each)]
            if self._live and 2 * sum(bool(each.behind) for each in lively) > len(lively):
                frames = self._restart()
        return frames + self.complete()

    def complete(self) -> list[BodyFrame]:
        """Frames that are complete by now, because a camera has stopped for long enough."""
        frames = []
        while self._is_complete():
            frames.append(self._take())
        return frames

    def flush(self) -> list[BodyFrame]:
        """Frames that were still waiting for a camera; the recording is over."""
        frames = []
        while self._heads_ns():
            frames.append(self._take())
        return frames

    def _note(self, stream: _Stream, message: Message) -> bool:
        """Update a camera's times with a message; whether its time goes back."""
        stamp_ns, before_ns = message.stamp_ns, stream.latest_ns
        goes_back = before_ns is not None and stamp_ns <= before_ns
        if before_ns is not None and goes_back:
            stream.left_ns = before_ns
        elif before_ns is not None:
            for other in self._streams.values():
                other.others_run_ns[message.camera] += min(stamp_ns - before_ns, self.max_wait_ns)
            stream.intervals_ns.append(stamp_ns - before_ns)
            stream.frame_ns = median(stream.intervals_ns)
        stream.latest_ns = stamp_ns
        stream.others_run_ns.clear()
        far_ns = stamp_ns + _FAR_BEHIND * self.max_wait_ns
        far_ahead = sum(each.latest_ns is not None and each.latest_ns > far_ns for each in self._streams.values())
        stream.far_behind = 2 * far_ahead > len(self._streams)
        stream.came_s = time.monotonic()
        if not self._count:
            # No camera has stopped before the first message of any.
            for each in self._streams.values():
                each.came_s = max(each.came_s, stream.came_s)
        self._count += 1
        stream.number = self._count
        return goes_back

    def _add_behind(self, stream: _Stream, message: Message, goes_back: bool) -> None:
        """Drop a late message; keep it if its camera is of another time, where the body may have to go."""
        self.late_of[message.camera] += 1
        late_ns = self._assembled_ns - message.stamp_ns
        if goes_back:
            stream.behind = [kept for kept in stream.behind if kept.stamp_ns < message.stamp_ns]
        returns = stream.left_ns > self._assembled_ns + self.max_wait_ns or len(stream.behind) >= _LIVELY
        if late_ns <= self.max_wait_ns and returns:
            # Back from a time that the body has left, or that it did not go to: merely late.
            self._return(stream, message.stamp_ns)
        elif stream.behind or goes_back or late_ns > _ELSEWHERE_NS:
            stream.behind.append(message)
            del stream.behind[: -4 * _LIVELY]

    def _return(self, stream: _Stream, stamp_ns: int) -> None:
        """A camera is at the body's time: messages of a later time, from before it went back, are dropped."""
        stream.behind.clear()
        while stream.queue and stream.queue[-1].stamp_ns >= stamp_ns:
            self.late_of[stream.queue.pop().camera] += 1

    def _is_lively(self, stream: _Stream) -> bool:
        return stream.number > 0 and self._count - stream.number <= _LIVELY * len(self._streams)

    def _restart(self) -> list[BodyFrame]:
        """Time goes back to where most cameras are; the frames before, as far as they had come."""
        last_ns = max(stream.left_ns for stream in self._streams.values() if stream.behind)
        frames = []
        while (heads := self._heads_ns()) and min(heads) <= last_ns:
            frames.append(self._take())
        self._assembled_ns = -1
        self.restarts += 1
        for camera, stream in self._streams.items():
            if stream.behind:
                stream.queue = deque(stream.behind)
                self.late_of[camera] -= len(stream.behind)
                stream.behind = []
            elif not stream.queue:
                # It will go back as well; until then it is waited for like one that never came.
                stream.latest_ns = None
            stream.others_run_ns.clear()
            stream.came_s = time.monotonic()
        return frames

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
        missing = [
            stream
            for stream in self._streams.values()
            if not stream.queue
            and not stream.behind
            and (stream.latest_ns is None or stream.latest_ns <= first_ns + self._within_ns(stream))
        ]
        if not all(self._has_stopped(stream) for stream in missing):
            return False
        if not missing or self._live:
            return True
        others = (other.latest_ns for other in self._streams.values() if not other.behind)
        return any(latest_ns is not None and latest_ns > first_ns + self._tolerance_ns for latest_ns in others)

    def _has_stopped(self, stream: _Stream) -> bool:
        """Whether a camera is not waited for: another went on alone, or most are far ahead of it."""
        if stream.far_behind:
            return True
        if self._live and time.monotonic() - stream.came_s < 1e-9 * self.max_wait_ns:
            return False
        since_ns = -self.max_wait_ns if stream.latest_ns is None else stream.latest_ns
        return any(
            run_ns > self.max_wait_ns and (self._streams[camera].latest_ns or 0) - since_ns > self.max_wait_ns
            for camera, run_ns in stream.others_run_ns.items()
        )

    def _take(self) -> BodyFrame:
        stamp_ns = min(self._heads_ns())
        taken = {
            camera: stream.queue.popleft()
            for camera, stream in self._streams.items()
            if stream.queue and stream.queue[0].stamp_ns <= stamp_ns + self._within_ns(stream)
        }
        self.assembled += 1
        self._assembled_ns = max(self._assembled_ns, *(message.stamp_ns for message in taken.values()))
        self.synchrony.add(frozenset(taken))
        return BodyFrame(
            stamp_ns,
            {camera: each for camera, each in taken.items() if isinstance(each, LandmarkMatches)},
            {camera: each for camera, each in taken.items() if isinstance(each, CameraImage)},
            {camera: each for camera, each in taken.items() if isinstance(each, SaidSegments)},
        )
