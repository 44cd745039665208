"""The time of the body: that of most cameras, whatever single clocks do, and however often a bag is played again."""

from collections import deque

from bodycam_ros.camera.camera_image import CameraImage
from bodycam_ros.registration.landmark_matches import LandmarkMatches

_NEAR = 5  # times the longest wait for a camera: cameras further apart are not of one time
_NEAR_AT_FIRST_NS = 15_000_000_000  # of a camera's first message: at first registrations search the whole map
_VOTES, _KEPT = 2, 8  # images of a camera elsewhere that count, and that are kept
_LEAST_STEP_NS = 1_000_000  # from image to image; those that are sent again may be nearer
_LIVELY = 8  # a camera without an image while each other sent so many has no vote on the time

Message = LandmarkMatches | CameraImage
"""Registration of a body camera, or the image of a static one."""


class Timeline:
    """The time that most cameras agree on: it admits their messages, in order of time for each camera.

    Messages of another time are kept back. Once most cameras are at one other time, as when a bag is played again or
    a recording paused, a new epoch begins with them.

    Args:
        max_wait_s: longest wait for a camera [s].

    Attributes:
        epoch: how often most cameras went to another time.
    """

    def __init__(self, max_wait_s: float) -> None:
        self.epoch = 0
        self.set_max_wait(max_wait_s)
        self._admitted_ns: dict[str, int] = {}
        self._elsewhere: dict[str, deque[Message]] = {}
        self._numbers: dict[str, int] = {}
        self._count = 0

    def set_max_wait(self, seconds: float) -> None:
        """Replace the longest wait for a camera [s]."""
        self._near_ns = round(1e9 * _NEAR * seconds)

    def admit(self, message: Message) -> list[Message]:
        """The messages that go on with this one: itself, none, or with a new epoch those that began it, in order."""
        camera, stamp_ns = message.camera, message.stamp_ns
        self._count += 1
        self._numbers[camera] = self._count
        near_ns = self._near_ns if camera in self._admitted_ns else max(self._near_ns, _NEAR_AT_FIRST_NS)
        latest_ns = max(self._admitted_ns.values(), default=stamp_ns)
        if abs(stamp_ns - latest_ns) <= near_ns and stamp_ns > self._admitted_ns.get(camera, stamp_ns - 1):
            self._elsewhere.pop(camera, None)
            self._admitted_ns[camera] = stamp_ns
            return [message]
        kept = self._elsewhere.setdefault(camera, deque(maxlen=_KEPT))
        if kept and stamp_ns < kept[-1].stamp_ns + _LEAST_STEP_NS:
            kept.clear()
        kept.append(message)
        there = {c: each for c, each in self._elsewhere.items() if abs(each[-1].stamp_ns - stamp_ns) <= self._near_ns}
        if 2 * sum(len(each) >= _VOTES for each in there.values()) <= len(self._lively()):
            return []
        self.epoch += 1
        self._admitted_ns = {name: each[-1].stamp_ns for name, each in there.items()}
        self._elsewhere = {name: each for name, each in self._elsewhere.items() if name not in there}
        return sorted((each for kept in there.values() for each in kept), key=lambda each: each.stamp_ns)

    def apart_s(self, camera: str) -> float | None:
        """How far a camera's stamps are ahead of the latest of all [s], or behind (negative).

        None if it stopped, or sent nothing since the epoch began.
        """
        elsewhere = self._elsewhere.get(camera)
        own_ns = elsewhere[-1].stamp_ns if elsewhere else self._admitted_ns.get(camera)
        if own_ns is None or camera not in self._lively():
            return None
        return 1e-9 * (own_ns - max(self._admitted_ns.values(), default=own_ns))

    def _lively(self) -> list[str]:
        oldest = self._count - _LIVELY * len(self._numbers)
        return [camera for camera, number in self._numbers.items() if number > oldest]
