"""Whether messages of a camera got lost on the way: each names the frame before it."""


class MissedFrames:
    """Follows the chain of stamps of each camera."""

    def __init__(self) -> None:
        self._latest_ns: dict[str, int] = {}
        self.count = 0
        """Messages whose predecessor never arrived."""

    def add(self, camera: str, stamp_ns: int, previous_stamp_ns: int) -> bool:
        """Whether the message's predecessor is missing; the first message of a camera has none to miss."""
        latest_ns = self._latest_ns.get(camera)
        self._latest_ns[camera] = stamp_ns
        # A predecessor of 0 is a tracker that has started again.
        missed = latest_ns is not None and previous_stamp_ns not in (0, latest_ns)
        self.count += missed
        return missed
