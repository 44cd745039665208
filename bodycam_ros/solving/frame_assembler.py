"""From the streams of single cameras to frames of the whole body."""

from collections import deque
from collections.abc import Iterable
from dataclasses import dataclass

from bodycam_ros.registration.landmark_matches import LandmarkMatches
from bodycam_ros.settings import setting
from bodycam_ros.solving.body_frame import BodyFrame


@dataclass(frozen=True)
class AssemblerSettings:
    """Which stamps belong together, and how long to wait for a camera."""

    sync_tolerance: float = setting(
        0.008, unit="s", limits=(0.0, 0.1), reason="stamps this close are one instant; below half a frame at 60 Hz"
    )
    max_wait: float = setting(
        1.0,
        unit="s",
        limits=(0.05, 60.0),
        reason="a camera silent for this long, in time of the recording, is not waited for any more",
    )


class FrameAssembler:
    """Merges the registrations of all cameras by stamp.

    The frames depend on the stamps alone, not on the order in which cameras are heard, unless one falls silent
    for longer than ``max_wait``.

    Args:
        cameras: the cameras to wait for.
        settings: tolerances.
    """

    def __init__(self, cameras: Iterable[str], settings: AssemblerSettings | None = None) -> None:
        settings = settings or AssemblerSettings()
        self._tolerance_ns = round(1e9 * settings.sync_tolerance)
        self._max_wait_ns = round(1e9 * settings.max_wait)
        self._queues: dict[str, deque[LandmarkMatches]] = {camera: deque() for camera in cameras}
        self._heard: dict[str, int] = {}
        self._newest_ns = 0
        self._assembled_ns = -1
        self.assembled = 0
        """Frames made so far."""
        self.late = 0
        """Registrations that came after their frame had gone; they are left out."""

    def add(self, matches: LandmarkMatches) -> list[BodyFrame]:
        """Add what one camera says; return the frames that are complete now, in order of time."""
        if matches.camera not in self._queues:
            return []
        if matches.stamp_ns <= self._assembled_ns:
            self.late += 1
            return []
        self._queues[matches.camera].append(matches)
        self._heard[matches.camera] = matches.stamp_ns
        self._newest_ns = max(self._newest_ns, matches.stamp_ns)
        frames = []
        while self._is_complete():
            frames.append(self._take())
        return frames

    def flush(self) -> list[BodyFrame]:
        """The frames that were still waiting for a camera; the recording is over."""
        frames = []
        while any(self._queues.values()):
            frames.append(self._take())
        return frames

    def _is_complete(self) -> bool:
        heads = [queue[0].stamp_ns for queue in self._queues.values() if queue]
        if not heads:
            return False
        wanted = min(heads)
        return all(
            queue
            or self._heard.get(camera, 0) > wanted + self._tolerance_ns
            or self._newest_ns - wanted > self._max_wait_ns
            for camera, queue in self._queues.items()
        )

    def _take(self) -> BodyFrame:
        stamp_ns = min(queue[0].stamp_ns for queue in self._queues.values() if queue)
        last_ns = stamp_ns + self._tolerance_ns
        matches = {
            camera: queue.popleft() for camera, queue in self._queues.items() if queue and queue[0].stamp_ns <= last_ns
        }
        self.assembled += 1
        self._assembled_ns = max(self._assembled_ns, *(seen.stamp_ns for seen in matches.values()))
        return BodyFrame(stamp_ns, matches)
