"""The read-out times that a recording teaches, and what those that it does not may cost."""

import math
from collections.abc import Collection, Mapping
from dataclasses import dataclass

import numpy as np

from bodycam_ros.camera import CameraModel
from bodycam_ros.camera.readout import Readout
from bodycam_ros.registration.landmark_matches import LandmarkMatches
from bodycam_ros.registration.readout_pool import ReadoutSettings, pooled


@dataclass
class TypicalSpeed:
    """How fast a camera moves on average while it is registered.

    Attributes:
        latest: the last registered image; None before the first.
        angle_rad, distance_m, seconds: it went so far in so long.
    """

    latest: LandmarkMatches | None = None
    angle_rad: float = 0.0
    distance_m: float = 0.0
    seconds: float = 0.0

    def add(self, matches: LandmarkMatches) -> None:
        """The next image."""
        if matches.world_T_camera is None:
            return
        before, self.latest = self.latest, matches
        if before is None or before.world_T_camera is None or before.stamp_ns != matches.previous_stamp_ns:
            return
        # Of every image of every camera: kept to what the two numbers need.
        cosine = 0.5 * (float(np.vdot(before.world_T_camera[:3, :3], matches.world_T_camera[:3, :3])) - 1.0)
        self.angle_rad += math.acos(min(1.0, max(-1.0, cosine)))
        self.distance_m += math.dist(before.world_T_camera[:3, 3], matches.world_T_camera[:3, 3])
        self.seconds += 1e-9 * (matches.stamp_ns - before.stamp_ns)

    def within(self, seconds: float) -> tuple[float, float]:
        """How far it turns [rad] and goes [m] in some time [s]; 0 of a camera that was never seen to move."""
        share = seconds / self.seconds if self.seconds else 0.0
        return share * self.angle_rad, share * self.distance_m


class ReadoutLog:
    """Collects what the registrations of all cameras say of their read-out times.

    Args:
        cameras: their models, by name.
        settings: which cameras share a read-out time, and when it is known well enough.
        known: cameras whose read-out time was known beforehand. Others have told them already, and to ask them again
            would count the same images twice.
    """

    def __init__(
        self, cameras: Mapping[str, CameraModel], settings: ReadoutSettings, known: Collection[str] = ()
    ) -> None:
        self._known = known
        self._sizes = {camera: (model.width, model.height) for camera, model in cameras.items()}
        self._settings = settings
        self._latest: dict[str, Readout] = {}
        self._speeds = {camera: TypicalSpeed() for camera in cameras}

    def add(self, matches: LandmarkMatches) -> None:
        """The next registration of a camera; the latest one says all that its camera knows."""
        if matches.readout is not None:
            self._latest[matches.camera] = matches.readout
        self._speeds[matches.camera].add(matches)

    def readouts(self) -> dict[str, Readout]:
        """Camera -> its read-out time, with the help of those of its make."""
        alone = {camera: readout for camera, readout in self._latest.items() if camera not in self._known}
        return self._latest | pooled(alone, self._sizes, self._settings)

    def doubts(self) -> dict[str, str]:
        """Camera -> what is not known of its read-out time, and what that may cost, of those that are doubtful."""
        return {
            camera: f"camera {camera}: {doubt(readout, self._speeds[camera])}"
            for camera, readout in sorted(self.readouts().items())
            if readout.sigma > self._settings.doubtful
        }


def doubt(readout: Readout, speed: TypicalSpeed) -> str:
    """What a read-out time that is hardly known may cost."""
    angle_rad, distance_m = speed.within(readout.sigma)
    return (
        f"it moved too little to tell how long its rows are read out ({readout}); at its usual speed that may leave "
        f"{1e3 * distance_m:.1f} mm and {np.degrees(angle_rad):.2f} deg. Give readout_time in its lens YAML, or turn "
        "it more"
    )
