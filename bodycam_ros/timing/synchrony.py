"""On how many of the body's instants each camera speaks."""

from collections import Counter, deque
from collections.abc import Iterable

from bodycam_ros.estimation.body_frame import BodyFrame

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
