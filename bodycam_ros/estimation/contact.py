"""Contact of the feet: a point of a sole that hardly moved since the state before is where it was.

A foot rests on its heel, on its ball or on both, so each point is tested by itself, at any height: floors, steps and
pedals. Feet whose rotation is not measured are left to the pose prior.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.body.body_model import BodyModel, sole_points
from bodycam_ros.estimation.factors.resting_point import RestingPoint
from bodycam_ros.geometry import Array
from bodycam_ros.settings import setting

Mask = NDArray[np.bool_]

FEET = ("foot_left", "foot_right")
_REST = 0.06  # [m/s] a slower point of the sole rests, and may creep by as much
_LEAST_SHIN_M = 0.05  # a foot whose parent starts at the ankle has no known size


@dataclass(frozen=True)
class ContactSettings:
    """Contact of feet with the floor."""

    enabled: bool = setting(True, reason="constrain resting feet; false leaves feet to the cameras alone")


class Soles:
    """The P points of the soles on which a body's feet rest.

    Args:
        body: with feet, or without.
        settings: whether feet are constrained.
    """

    def __init__(self, body: BodyModel, settings: ContactSettings) -> None:
        points = []
        for foot in (joint for joint in body.tree_joints if joint.child in FEET and settings.enabled):
            shin_m = float(np.linalg.norm(foot.parent_T_joint[:3, 3]))
            arms = sole_points(shin_m) if shin_m > _LEAST_SHIN_M else ()
            points += [(body.segment_index[foot.child], foot.child_T_joint[:3, 3] + arm) for arm in arms]
        self._rows = np.array([row for row, _ in points], np.int64)
        self._places = np.array([place for _, place in points]).reshape(-1, 3)

    def resting(self, before: Array, poses: Array, dt_s: float, turning: Mask) -> list[RestingPoint]:
        """The constraints of points that rest.

        Args:
            before: (S, 4, 4) poses of the state before.
            poses: (S, 4, 4) without the constraints.
            dt_s: between the two [s].
            turning: (S,) segments whose rotation is measured at least.
        """
        rows, creep_m = self._rows, _REST * dt_s
        moved = (poses - before)[rows]
        moved_m = np.linalg.norm((moved[:, :3, :3] @ self._places[..., None])[..., 0] + moved[:, :3, 3], axis=1)
        resting = np.flatnonzero(turning[rows] & (moved_m < creep_m)).tolist()
        return [RestingPoint(int(rows[i]), self._places[i], creep_m) for i in resting]
