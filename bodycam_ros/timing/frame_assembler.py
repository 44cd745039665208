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

_REMEMBERED = 150
"""Instants: some seconds, and forgotten soon when a camera is mended."""


class Synchrony:
    """Remembers who spoke of the latest instants.

    Args:
        cameras: their names.

    Attributes:
        missed: camera -> instants so far of which it did not speak, but half of all did: images that were dropped or
            left out, words that came too late.
    """

    def __init__(self, cameras: Iterable[str]) -> None:
        self._cameras = list(cameras)
        self._frames: deque[frozenset[str]] = deque(maxlen=_REMEMBERED)
        self.missed: Counter[str] = Counter()

    def join(self, camera: str) -> None:
        """One more camera."""
        self._cameras.append(camera)

    def add(self, frame: BodyFrame) -> None:
        """Note who speaks of an instant."""
        speaking = frozenset((*frame.matches, *frame.images, *frame.said))
        self._frames.append(speaking)
        if 2 * len(speaking) >= len(self._cameras):
            self.missed.update(camera for camera in self._cameras if camera not in speaking)

    def shares(self) -> dict[str, float]:
        """Camera -> share of the latest instants at which it spoke, 0 to 1; empty before the first instant.

        Those instants count that the camera spoke of which is most in company.
        """
        if not self._frames:
            return {}
        company = {camera: sum(len(f) for f in self._frames if camera in f) for camera in self._cameras}
        reference = max(self._cameras, key=lambda camera: company[camera])
        instants = [frame for frame in self._frames if reference in frame]
        return {camera: sum(camera in frame for frame in instants) / len(instants) for camera in self._cameras}


_ELSEWHERE_NS = 10_000_000_000
"""A registration so far behind the body is not late: its camera lives in another time."""

_KEPT_NS = 30_000_000_000
"""What a camera says of a time that the others have not reached is kept for so long, in its own stamps."""

_LATELY = 8
"""A camera that said nothing while each camera spoke so often, on average, has no say in what time it is."""

_WITHIN_FRAME = 0.49
"""A camera's image is of a state that is less than half the time between two of its images earlier."""

_INTERVALS = 9
"""So many times between images give a camera's rate by their median: an image that is lost now and then is none."""

_FAR_BEHIND = 5
"""A camera that speaks, but is behind most others by so many times ``max_wait``, would only hold them up."""


Heard = LandmarkMatches | CameraImage | SaidSegments
"""What a worn camera says of an image, the image of a static one, or what a static one says of it."""


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
        reason="a camera that is silent while another goes on for this long, in time of the recording, is not waited "
        "for any more until it speaks again",
        live=True,
    )
    first_wait: float = setting(
        10.0,
        unit="s",
        limits=(0.0, 600.0),
        reason="live, a static camera that hears where the body is looks for its limbs first, which takes a second of "
        "a core, and more of a busy one; so much longer than 'max_wait' its first word is waited for",
    )


@dataclass
class _Stream:
    """What is known of one camera.

    Attributes:
        queue: what no frame has taken yet, by stamp.
        heard_ns: its latest stamp.
        intervals_ns: times between its latest images.
        frame_ns: their median.
        run_ns: how far its stamps have run on; of a jump ahead only ``max_wait``.
        others_run_ns: the others' ``run_ns`` when it was last heard.
        turn: number of the message that was its latest.
        heard_s: when that was, on the steady clock.
        behind: what it says of a time before the body's present; the body may go there.
        left_ns: the stamp from which it went back.
        far_behind: whether most others were far ahead when it spoke.
    """

    queue: deque[Heard] = field(default_factory=deque)
    heard_ns: int | None = None
    intervals_ns: deque[int] = field(default_factory=lambda: deque(maxlen=_INTERVALS))
    frame_ns: float = inf
    run_ns: int = 0
    others_run_ns: dict[str, int] = field(default_factory=dict)
    turn: int = 0
    heard_s: float = field(default_factory=time.monotonic)
    behind: list[Heard] = field(default_factory=list)
    left_ns: int = 0
    far_behind: bool = False


class FrameAssembler:
    """Merges the registrations of all cameras by stamp.

    The frames depend on the stamps alone, not on the order in which cameras are heard, as long as no camera is behind
    the others by more than ``max_wait``. A camera that falls silent is waited for once. From then on an instant is
    complete without it; offline as soon as another camera speaks of a later one, so that who hears all cameras in order
    of time gets the same frames whatever the order within an instant.

    Args:
        cameras: the cameras to wait for.
        settings: tolerances.
        live: whether the cameras are heard while they see. Then the frames follow when most cameras go back in time, as
            when a bag is played again; and no camera is silent before ``max_wait`` of real time has passed as well,
            because on a busy machine one process may stand still while others go on. Otherwise the stamps alone count.

    Attributes:
        assembled: frames made so far.
        late: registrations that came after their frame had gone, and are left out.
        late_of: the same by camera.
        max_wait_ns: by the settings, or as it is replaced.
        restarts: how often time began anew.
        synchrony: how the cameras go together.
    """

    def __init__(self, cameras: Iterable[str], settings: AssemblerSettings | None = None, live: bool = False) -> None:
        settings = settings or AssemblerSettings()
        self._tolerance_ns = round(1e9 * settings.sync_tolerance)
        self.max_wait_ns = round(1e9 * settings.max_wait)
        self._live = live
        self._streams = {camera: _Stream() for camera in cameras}
        self._turn = 0
        self._assembled_ns = -1
        self.assembled = 0
        self.late_of: Counter[str] = Counter()
        self.restarts = 0
        self.synchrony = Synchrony(self._streams)

    @property
    def late(self) -> int:
        """Registrations that were left out because they came too late."""
        return self.late_of.total()

    @property
    def silent(self) -> list[str]:
        """Cameras that are not waited for."""
        return [camera for camera, stream in self._streams.items() if not stream.queue and self._is_silent(stream)]

    def apart_s(self, camera: str) -> float | None:
        """How far the stamps of a camera that speaks are from the body's present [s]: ahead (positive), or behind."""
        stream = self._streams[camera]
        if stream.heard_ns is None or not self._is_lively(stream):
            return None
        return 1e-9 * (stream.heard_ns - self._assembled_ns)

    def join(self, camera: str, longer_s: float = 0.0) -> None:
        """Wait for one more camera from now on; for its first word, live, so much longer than for others'."""
        if camera not in self._streams:
            begun_s = time.monotonic() + longer_s
            self._streams[camera] = _Stream(others_run_ns=self._runs_ns(), heard_s=begun_s)
            self.synchrony.join(camera)

    def add(self, matches: Heard) -> list[BodyFrame]:
        """Add what one camera says or saw; return the frames that are complete now, in order of time."""
        stream = self._streams.get(matches.camera)
        if stream is None:
            return []
        goes_back = self._hear(stream, matches.stamp_ns)
        if matches.stamp_ns <= self._assembled_ns:
            self._put_behind(stream, matches, goes_back)
            frames = self._go_back() if self._live and self._most_are_behind() else []
        else:
            self._come_home(stream, matches.stamp_ns)
            stream.queue.append(matches)
            while stream.queue[-1].stamp_ns - stream.queue[0].stamp_ns > max(_KEPT_NS, 2 * self.max_wait_ns):
                self.late_of[stream.queue.popleft().camera] += 1
            frames = []
        return frames + self.look()

    def look(self) -> list[BodyFrame]:
        """The frames that are complete because a camera has been silent for long enough by now."""
        frames = []
        while self._is_complete():
            frames.append(self._take())
        return frames

    def flush(self) -> list[BodyFrame]:
        """The frames that were still waiting for a camera; the recording is over."""
        frames = []
        while any(stream.queue for stream in self._streams.values()):
            frames.append(self._take())
        return frames

    def _hear(self, stream: _Stream, stamp_ns: int) -> bool:
        """Note that a camera speaks; whether its time goes back."""
        goes_back = stream.heard_ns is not None and stamp_ns <= stream.heard_ns
        if goes_back and stream.heard_ns is not None:
            stream.left_ns = stream.heard_ns
        elif stream.heard_ns is not None:
            stream.run_ns += min(stamp_ns - stream.heard_ns, self.max_wait_ns)
            stream.intervals_ns.append(stamp_ns - stream.heard_ns)
            stream.frame_ns = median(stream.intervals_ns)
        stream.heard_ns = stamp_ns
        stream.others_run_ns = self._runs_ns()
        far_ns = stamp_ns + _FAR_BEHIND * self.max_wait_ns
        far_ahead = sum(s.heard_ns is not None and s.heard_ns > far_ns for s in self._streams.values())
        stream.far_behind = 2 * far_ahead > len(self._streams)
        stream.heard_s = time.monotonic()
        if not self._turn:
            # Nobody is silent before anybody has spoken.
            for each in self._streams.values():
                each.heard_s = stream.heard_s
        self._turn += 1
        stream.turn = self._turn
        return goes_back

    def _runs_ns(self) -> dict[str, int]:
        return {camera: stream.run_ns for camera, stream in self._streams.items()}

    def _put_behind(self, stream: _Stream, matches: Heard, goes_back: bool) -> None:
        """Leave out what is late; keep it if its camera is in another time, where the body may have to go."""
        self.late_of[matches.camera] += 1
        late_ns = self._assembled_ns - matches.stamp_ns
        if goes_back:
            stream.behind = [kept for kept in stream.behind if kept.stamp_ns < matches.stamp_ns]
        comes_home = stream.left_ns > self._assembled_ns + self.max_wait_ns or len(stream.behind) >= _LATELY
        if late_ns <= self.max_wait_ns and comes_home:
            # From a time that the body has left, or nobody went with it: it is merely late, and waited for.
            self._come_home(stream, matches.stamp_ns)
        elif stream.behind or goes_back or late_ns > _ELSEWHERE_NS:
            stream.behind.append(matches)
            del stream.behind[: -4 * _LATELY]

    def _come_home(self, stream: _Stream, stamp_ns: int) -> None:
        """A camera speaks of the body's present; what it said of a later time, before it went back, is left out."""
        stream.behind.clear()
        while stream.queue and stream.queue[-1].stamp_ns >= stamp_ns:
            self.late_of[stream.queue.pop().camera] += 1

    def _most_are_behind(self) -> bool:
        lately = [stream for stream in self._streams.values() if self._is_lively(stream)]
        return 2 * sum(bool(stream.behind) for stream in lately) > len(lately)

    def _is_lively(self, stream: _Stream) -> bool:
        return stream.turn > 0 and self._turn - stream.turn <= _LATELY * len(self._streams)

    def _go_back(self) -> list[BodyFrame]:
        """Time begins anew where most cameras are; the frames of the time before, as far as those had come."""
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
                # It will come back as well; until then it is waited for like one that was never heard.
                stream.heard_ns = None
            stream.others_run_ns = self._runs_ns()
            stream.heard_s = time.monotonic()
        return frames

    def _within_ns(self, stream: _Stream) -> int:
        """How far after the earliest stamp [ns] a camera's image is of the same state."""
        return round(min(self._tolerance_ns, _WITHIN_FRAME * stream.frame_ns))

    def _heads_ns(self) -> list[int]:
        return [stream.queue[0].stamp_ns for stream in self._streams.values() if stream.queue]

    def _is_complete(self) -> bool:
        """Whether nothing more is to be waited for at the earliest instant."""
        heads_ns = self._heads_ns()
        if not heads_ns:
            return False
        first_ns = min(heads_ns)
        nobody_awaited = True
        for stream in self._streams.values():
            if (
                stream.queue
                or stream.behind
                or (stream.heard_ns is not None and stream.heard_ns > first_ns + self._within_ns(stream))
            ):
                continue
            if not self._is_silent(stream):
                return False
            nobody_awaited = False
        if nobody_awaited or self._live:
            return True
        others = (other.heard_ns for other in self._streams.values() if not other.behind)
        return any(heard_ns is not None and heard_ns > first_ns + self._tolerance_ns for heard_ns in others)

    def _is_silent(self, stream: _Stream) -> bool:
        """Whether a camera is not worth waiting for: one of the others went on alone, or most are far ahead of it."""
        if stream.far_behind:
            return True
        if self._live and time.monotonic() - stream.heard_s < 1e-9 * self.max_wait_ns:
            return False
        since_ns = -self.max_wait_ns if stream.heard_ns is None else stream.heard_ns
        for camera, other in self._streams.items():
            if other.heard_ns is None or other is stream or other.heard_ns - since_ns <= self.max_wait_ns:
                continue
            if other.run_ns - stream.others_run_ns.get(camera, 0) > self.max_wait_ns:
                return True
        return False

    def _take(self) -> BodyFrame:
        stamp_ns = min(self._heads_ns())
        said = {
            camera: stream.queue.popleft()
            for camera, stream in self._streams.items()
            if stream.queue and stream.queue[0].stamp_ns <= stamp_ns + self._within_ns(stream)
        }
        self.assembled += 1
        self._assembled_ns = max(self._assembled_ns, *(seen.stamp_ns for seen in said.values()))
        matches = {camera: each for camera, each in said.items() if isinstance(each, LandmarkMatches)}
        images = {camera: each for camera, each in said.items() if isinstance(each, CameraImage)}
        told = {camera: each for camera, each in said.items() if isinstance(each, SaidSegments)}
        frame = BodyFrame(stamp_ns, matches, images, told)
        self.synchrony.add(frame)
        return frame
