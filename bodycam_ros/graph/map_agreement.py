"""One map in a live graph: which one the registrations are in, and which cameras contradict it."""

from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass

from bodycam_ros.registration.landmark_matches import LandmarkMatches
from bodycam_ros.registration.map_identity import MapIdentity
from bodycam_ros.results.verdict import Finding, Level

_LASTS_S = 3.0
"""A camera without a message for so long has no say, and its contradiction is over."""

_REMEDY = "start all nodes with the same map:=MAP"


@dataclass(frozen=True)
class _Said:
    """Maps of a camera's latest registration and of its tracks, and when it arrived [s]."""

    map: MapIdentity
    of_tracks: MapIdentity
    arrived_s: float

    @property
    def is_refused(self) -> bool:
        """Whether the registration has refused the tracks, as they are another map's."""
        return self.map.contradicts(self.of_tracks)


class MapAgreement:
    """Decides which map the body is solved in: that of most cameras' latest registrations.

    Where as many are in another map, the map stays. Registrations of which the map is not known are taken as they are.

    Args:
        given: map that the solver itself was given, which is never exchanged for another; None without.

    Attributes:
        identity: of the map; None until a registration has one.
    """

    def __init__(self, given: MapIdentity | None = None) -> None:
        self._given, self.identity = given, given
        self._said: dict[str, _Said] = {}

    def add(self, matches: LandmarkMatches, now_s: float) -> bool:
        """Add a registration; whether it is in the map, so that it may be used.

        Args:
            now_s: time on a steady clock [s].
        """
        said = _Said(MapIdentity.parse(matches.map_identity), MapIdentity.parse(matches.tracks_map_identity), now_s)
        self._said[matches.camera] = said
        if self._given is None and said.map.landmarks and not said.is_refused:
            self._choose(said.map, now_s)
        return self.identity is None or not self.identity.contradicts(said.map)

    def _choose(self, latest: MapIdentity, now_s: float) -> None:
        votes = Counter(
            said.map.landmarks
            for said in self._said.values()
            if said.map.landmarks and not said.is_refused and now_s - said.arrived_s <= _LASTS_S
        )
        used = "" if self.identity is None else self.identity.landmarks
        if self.identity is None or latest.landmarks == used or votes[latest.landmarks] > votes[used]:
            self.identity = latest

    def findings(self, now_s: float) -> Iterator[Finding]:
        """A finding for each camera that contradicts the map now."""
        for camera, said in sorted(self._said.items()):
            if now_s - said.arrived_s > _LASTS_S:
                continue
            if said.is_refused:
                what = f"its tracker uses map {said.of_tracks}, its registration map {said.map}: its tracks are refused"
            elif self.identity is not None and self.identity.contradicts(said.map):
                what = f"it is registered in map {said.map}, the body is solved in map {self.identity}: it is not used"
            else:
                continue
            yield Finding(camera, Level.WRONG, what, remedy=_REMEDY, check="map")
