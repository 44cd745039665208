"""How well each camera is registered lately, for /diagnostics."""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from bodycam_ros.messages.status import Health, HealthLevel
from bodycam_ros.registration.landmark_matches import LandmarkMatches

_POOR_SHARE = 0.9
"""A camera registered on a smaller share of its frames gets a warning: the body still holds, but with less."""


@dataclass
class _Tally:
    frames: int = 0
    registered: int = 0
    landmarks: int = 0
    sigma_mm: float = float("nan")


class RegistrationHealth:
    """Counts registrations between two reports.

    Args:
        cameras: the cameras that should be heard; a silent one is reported too.
    """

    def __init__(self, cameras: Iterable[str]) -> None:
        self._tallies = {camera: _Tally() for camera in cameras}

    def add(self, matches: LandmarkMatches) -> None:
        """Count one image's registration."""
        tally = self._tallies.setdefault(matches.camera, _Tally())
        tally.frames += 1
        tally.landmarks += len(matches.landmark_ids)
        if matches.world_T_camera is not None:
            tally.registered += 1
            tally.sigma_mm = 1e3 * float(np.sqrt(np.trace(matches.pose_covariance[3:, 3:])))

    def report(self) -> list[Health]:
        """The health of every camera since the last report, which starts the count anew."""
        parts = [_health(camera, tally) for camera, tally in sorted(self._tallies.items())]
        self._tallies = {camera: _Tally() for camera in self._tallies}
        return parts


def _health(camera: str, tally: _Tally) -> Health:
    name = f"camera {camera}"
    if tally.frames == 0:
        return Health(name, HealthLevel.STALE, "no images")
    share = tally.registered / tally.frames
    values = {
        "frames": tally.frames,
        "registered": tally.registered,
        "landmarks per frame": round(tally.landmarks / tally.frames, 1),
        "position sigma [mm]": round(tally.sigma_mm, 2),
    }
    if tally.registered == 0:
        return Health(name, HealthLevel.ERROR, "not registered in the map", values)
    level = HealthLevel.OK if share >= _POOR_SHARE else HealthLevel.WARN
    return Health(name, level, f"registered on {share:.0%} of its frames", values)
