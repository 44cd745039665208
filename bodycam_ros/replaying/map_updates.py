"""One extended map in several processes, the same whatever their number and pace.

The parent extends the map by the keyframes of all cameras and sends the changes to every worker. What was observed in
one epoch of the recording counts from the epoch after the next, so workers rarely wait for each other.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

from bodycam_ros.mapping.extendable_map import AddedLandmarks, ExtendableMap, make_extendable
from bodycam_ros.mapping.local_mapper import LocalMapper
from bodycam_ros.registration.reference_map import ReferenceMap

EPOCH_NS: Final = 250_000_000
_DELAY: Final = 2  # epochs


@dataclass(frozen=True)
class MapUpdate:
    """Changes of the map up to and including the keyframes of an epoch; None if there are none."""

    epoch: int
    landmarks: AddedLandmarks | None


class MapUpdateSource:
    """The parent's side.

    Args:
        reference_map: the map that is extended; it is not changed itself.
        capacity: most added landmarks.
        send: sends an update to every worker.

    Attributes:
        mapper: extends the map.
    """

    def __init__(
        self,
        reference_map: ReferenceMap,
        capacity: int,
        send: Callable[[MapUpdate], None],
    ) -> None:
        self.mapper = LocalMapper(make_extendable(reference_map, capacity))
        self._send = send
        self._epoch = -1

    def advance(self, stamp_ns: int) -> None:
        """Process and send all epochs before a time, of which every keyframe waits for its turn in ``mapper``."""
        epoch = stamp_ns // EPOCH_NS
        if epoch > self._epoch:
            self._epoch = epoch
            self._send(MapUpdate(epoch - 1, self.mapper.add_waiting()))


class MapReplica:
    """A worker's side: the copy of the map in which its cameras are registered.

    Args:
        reference_map: the map that is extended.
        capacity: most added landmarks.
        receive: waits for the next update.

    Attributes:
        map: the copy.
    """

    def __init__(self, reference_map: ReferenceMap, capacity: int, receive: Callable[[], MapUpdate]) -> None:
        self.map: ExtendableMap = make_extendable(reference_map, capacity)
        self._receive = receive
        self._epoch = self._received = -1
        self._early: list[MapUpdate] = []

    def is_behind(self, stamp_ns: int) -> bool:
        """Whether ``advance`` to this time has to wait for the parent."""
        return self._needed(stamp_ns) > self._received

    def advance(self, stamp_ns: int) -> None:
        """Apply the updates that count at a time, and no more."""
        self._epoch = max(self._epoch, stamp_ns // EPOCH_NS)
        needed = self._needed(stamp_ns)
        while self._received < needed:
            self._early.append(self._receive())
            self._received = self._early[-1].epoch
        while self._early and self._early[0].epoch <= needed:
            landmarks = self._early.pop(0).landmarks
            if landmarks is not None:
                self.map.update(landmarks)

    def _needed(self, stamp_ns: int) -> int:
        return max(self._epoch, stamp_ns // EPOCH_NS) - _DELAY
