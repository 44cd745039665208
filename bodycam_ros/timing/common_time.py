"""The time at which most cameras are: one whose clock was never set must not draw the others along."""

_NEAR_NS = 5_000_000_000
"""Cameras that are further apart are not of one time; on a busy machine one may be heard seconds before another."""

_VOTES = 2
"""Images per camera that must come from elsewhere, more than from here, before time is there."""


class CommonTime:
    """Follows the stamps of all cameras.

    Attributes:
        latest_ns: the latest stamp of those that go together [ns]; None before the first.
        moves: how often most cameras went elsewhere.
        strangers: cameras that are elsewhere.
    """

    def __init__(self) -> None:
        self.latest_ns: int | None = None
        self.moves = 0
        self.strangers: set[str] = set()
        self._votes = 0

    def most_votes(self, cameras: int) -> int:
        """Images from elsewhere after which time is there."""
        return _VOTES * cameras

    def add(self, camera: str, stamp_ns: int, cameras: int) -> None:
        """Note an image of one of some cameras."""
        latest_ns = stamp_ns if self.latest_ns is None else self.latest_ns
        if abs(stamp_ns - latest_ns) <= _NEAR_NS:
            self.strangers.discard(camera)
            self._votes = max(0, self._votes - 1)
            self.latest_ns = max(stamp_ns, latest_ns)
            return
        self.strangers.add(camera)
        self._votes += 1
        if self._votes >= self.most_votes(cameras):
            self.latest_ns, self._votes = stamp_ns, 0
            self.moves += 1
            self.strangers.clear()
