"""From what cameras say in their own time to what they say of the body's instants.

Cameras that share their stamps pass as they are, and their stamps are the instants. The others are brought to them;
where nobody shares, the instants are a beat of their own.
"""

from collections.abc import Callable, Iterable, Mapping

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.camera import CameraModel
from bodycam_ros.registration.landmark_matches import LandmarkMatches
from bodycam_ros.timing.clock_state import ClockSettings
from bodycam_ros.timing.clock_watch import ClockWatch
from bodycam_ros.timing.instant_sampler import InstantSampler

_SAME_NS = 1_000_000
"""Stamps of one trigger that differ by less are one instant."""

_LEFT_ALONE_NS = 1_000_000_000
"""If those who share their stamps say nothing for so long, the beat goes on without them."""


class BodyInstants:
    """Brings all cameras of a body to common instants.

    Args:
        body: which has been calibrated.
        cameras: models by name; those of the body are listened to.
        settings: what is believed of clocks.
        floor: (6, 6) covariance that is added to every registration's.
        live: whether cameras are heard while they see.
        on_corrected: told what every image said, its stamp corrected.

    Attributes:
        watch: of the cameras' clocks.
    """

    def __init__(
        self,
        body: BodyModel,
        cameras: Mapping[str, CameraModel],
        settings: ClockSettings,
        floor: NDArray[np.float64],
        live: bool,
        on_corrected: Callable[[LandmarkMatches], None] = lambda matches: None,
    ) -> None:
        self._body = body
        self._settings = settings
        self._on_corrected = on_corrected
        self.watch = ClockWatch(body, [name for name in cameras if name in body.mounts], settings, floor, live)
        self._samplers = {
            name: InstantSampler(model, settings.max_gap) for name, model in cameras.items() if name in body.mounts
        }
        self._last_ns = self._shared_ns = -1
        self._moves = 0

    def join(self, camera: str, model: CameraModel) -> None:
        """One more camera, or another model of one."""
        if camera in self._body.mounts:
            self.watch.join(camera)
            self._samplers[camera] = InstantSampler(model, self._settings.max_gap)

    def add(self, matches: LandmarkMatches) -> list[LandmarkMatches]:
        """What one camera says of its own time; what is known by now of the instants."""
        return self._at_instants(self.watch.add(matches))

    def flush(self) -> list[LandmarkMatches]:
        """What is left when the recording is over."""
        left = self._at_instants(self.watch.flush())
        for sampler in self._samplers.values():
            left += sampler.flush()
        return sorted(left, key=lambda matches: (matches.stamp_ns, matches.camera))

    @property
    def _sharing(self) -> frozenset[str]:
        return frozenset() if self._settings.rate > 0.0 else self.watch.sharing

    def _at_instants(self, corrected: Iterable[LandmarkMatches]) -> list[LandmarkMatches]:
        said = []
        sharing = self._sharing
        for matches in corrected:
            self._on_corrected(matches)
            if matches.camera in self.watch.strangers:
                said.append(matches)  # There are no instants where it is.
                continue
            for instant_ns in self._new_instants(matches.stamp_ns, matches.camera in sharing):
                for camera, sampler in self._samplers.items():
                    if camera not in sharing:
                        said += sampler.add_instant(instant_ns)
            if matches.camera in sharing:
                said.append(matches)
            else:
                said += self._samplers[matches.camera].add(matches)
        return said

    def _new_instants(self, stamp_ns: int, shares: bool) -> list[int]:
        """Instants up to a stamp that were not there before."""
        if self.watch.moves > self._moves:
            self._moves, self._last_ns, self._shared_ns = self.watch.moves, -1, -1
        if shares:
            self._shared_ns = max(self._shared_ns, stamp_ns)
            if stamp_ns <= self._last_ns + _SAME_NS:
                return []
            self._last_ns = stamp_ns
            return [stamp_ns]
        period_ns = self._period_ns
        if not period_ns or (self._sharing and not 0 <= self._shared_ns < stamp_ns - _LEFT_ALONE_NS):
            return []
        if self._last_ns < 0:
            self._last_ns = (stamp_ns // period_ns) * period_ns
            return [self._last_ns]
        count = (stamp_ns - self._last_ns) // period_ns
        if count * period_ns > 60 * _LEFT_ALONE_NS:
            self._last_ns = (stamp_ns // period_ns) * period_ns
            return [self._last_ns]
        instants = [self._last_ns + period_ns * (step + 1) for step in range(count)]
        self._last_ns = instants[-1] if instants else self._last_ns
        return instants

    @property
    def _period_ns(self) -> int:
        if self._settings.rate > 0.0:
            return round(1e9 / self._settings.rate)
        return self.watch.beat.period_ns if self.watch.beat else 0
