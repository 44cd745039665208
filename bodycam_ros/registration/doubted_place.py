"""A place where the body says that a camera is not, although its landmarks say so.

A camera that was registered to the wrong place is tracked there from image to image, and would be found there again by
the same likeness that led it there. So the registrar stays away from it, until what speaks for it is more than it was,
or some time has passed: the body may have been wrong.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.geometry import inverse, log_se3
from bodycam_ros.settings import setting


@dataclass(frozen=True)
class DoubtSettings:
    """How long, and how far around, a registrar stays away from where the body says that its camera is not."""

    lasting: float = setting(
        1.0,
        unit="s",
        limits=(0.0, 60.0),
        reason="then the same landmarks count again: a body that is wrong itself must not keep a camera out for ever",
        live=True,
    )
    stronger: float = setting(
        1.5,
        limits=(1.0, 100.0),
        reason="with this many times the landmarks that agreed before, the camera is believed against the body",
        live=True,
    )
    reach: float = setting(
        0.3, unit="m", limits=(0.0, 10.0), reason="what is this near to the doubted place is the same place", live=True
    )
    reach_turn: float = setting(0.3, unit="rad", limits=(0.0, 3.2), reason="the same for the rotation", live=True)
    speed: float = setting(
        2.0, unit="m/s", limits=(0.0, 20.0), reason="the wrong place moves as the camera does meanwhile", live=True
    )
    turning: float = setting(5.0, unit="rad/s", limits=(0.0, 50.0), reason="the same for the rotation", live=True)


@dataclass(frozen=True)
class DoubtedPlace:
    """What is not believed.

    Attributes:
        stamp_ns: of the image that showed it last [ns].
        world_T_camera: (4, 4) where the camera was said to be.
        landmarks: that agreed on it.
        settings: how long it lasts.
    """

    stamp_ns: int
    world_T_camera: NDArray[np.float64]
    landmarks: int
    settings: DoubtSettings

    def lasts(self, stamp_ns: int) -> bool:
        """Whether it counts at a stamp [ns]."""
        return stamp_ns - self.stamp_ns < 1e9 * self.settings.lasting

    def refuses(self, stamp_ns: int, world_T_camera: NDArray[np.float64], landmarks: int) -> bool:
        """Whether a pose (4, 4) that so many landmarks agree on at a stamp [ns] is the same lie again."""
        if not self.lasts(stamp_ns) or landmarks >= self.settings.stronger * self.landmarks:
            return False
        passed_s = 1e-9 * (stamp_ns - self.stamp_ns)
        moved = log_se3(inverse(self.world_T_camera) @ world_T_camera)
        near = np.linalg.norm(moved[3:]) < self.settings.reach + passed_s * self.settings.speed
        alike = np.linalg.norm(moved[:3]) < self.settings.reach_turn + passed_s * self.settings.turning
        return bool(near and alike)
