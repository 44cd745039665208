"""One growing map for several processes, the same whatever their number and pace.

The parent grows it by the keyframes of all cameras and tells every worker. What was seen in one epoch of the recording
counts from the epoch after the next, so nobody has to wait who is not far ahead of the others.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Final

from bodycam_ros.camera import CameraModel
from bodycam_ros.mapping.growing_map import GrowingMap, GrownLandmarks, growing
from bodycam_ros.mapping.growth_settings import GrowthSettings
from bodycam_ros.mapping.map_growth import MapGrowth
from bodycam_ros.mapping.worn_keyframe import WornKeyframe
from bodycam_ros.registration.landmark_matches import LandmarkMatches
from bodycam_ros.registration.reference_map import ReferenceMap

EPOCH_NS: Final = 250_000_000
_LATER: Final = 2


@dataclass(frozen=True)
class Growth:
    """What the map has grown by.

    Attributes:
        through: the last epoch whose keyframes are in it.
        landmarks: the changes; None if there are none.
    """

    through: int
    landmarks: GrownLandmarks | None


class GrowthOfAll:
    """The parent's side.

    Args:
        reference_map: the map that grows; it is not changed itself.
        cameras: models of all cameras.
        settings: of the growth.
        tell: sends a growth to every worker.
    """

    def __init__(
        self,
        reference_map: ReferenceMap,
        cameras: Mapping[str, CameraModel],
        settings: GrowthSettings,
        tell: Callable[[Growth], None],
    ) -> None:
        self.growth = MapGrowth(growing(reference_map, settings.capacity), cameras, settings)
        self._tell = tell
        self._epoch = -1
        self._heard: list[tuple[LandmarkMatches, WornKeyframe | None]] = []

    def reach(self, stamp_ns: int) -> None:
        """All that was seen before a time has been told."""
        epoch = stamp_ns // EPOCH_NS
        if epoch <= self._epoch:
            return
        self._epoch = epoch
        # The same order however the cameras were shared among processes.
        for matches, keyframe in sorted(self._heard, key=lambda said: (said[0].stamp_ns, said[0].camera)):
            self.growth.hear(matches)
            if keyframe is not None:
                self.growth.add(keyframe)
        self._heard.clear()
        self.growth.forget_unseen()
        self._tell(Growth(epoch - 1, self.growth.take_changes()))

    def hear(self, matches: LandmarkMatches, keyframe: WornKeyframe | None) -> None:
        """One image, after ``reach`` of its time."""
        if keyframe is not None or matches.grown:
            self._heard.append((matches, keyframe))


class GrowthOfOne:
    """A worker's side: the copy of the map that its cameras are registered in.

    Args:
        reference_map: the map that grows.
        settings: of the growth.
        receive: waits for the next growth.
    """

    def __init__(self, reference_map: ReferenceMap, settings: GrowthSettings, receive: Callable[[], Growth]) -> None:
        self.map: GrowingMap = growing(reference_map, settings.capacity)
        self._receive = receive
        self._epoch = -1
        self._through = -1
        self._early: list[Growth] = []

    def is_behind(self, stamp_ns: int) -> bool:
        """Whether ``catch_up`` to this time has to wait for the parent."""
        return self._needed(stamp_ns) > self._through

    def catch_up(self, stamp_ns: int) -> None:
        """Let the map grow by what counts at a time, and no more."""
        self._epoch = max(self._epoch, stamp_ns // EPOCH_NS)
        needed = self._needed(stamp_ns)
        while self._through < needed:
            self._early.append(self._receive())
            self._through = self._early[-1].through
        while self._early and self._early[0].through <= needed:
            landmarks = self._early.pop(0).landmarks
            if landmarks is not None:
                self.map.take(landmarks)

    def _needed(self, stamp_ns: int) -> int:
        return max(self._epoch, stamp_ns // EPOCH_NS) - _LATER
