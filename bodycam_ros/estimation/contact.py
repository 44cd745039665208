"""Contact of the feet: a point of a sole that hardly moved since the state before is where it was.

A foot rests on its heel, on its ball or on both, so each point is tested by itself, at any height: floors, steps and
pedals. Feet whose rotation is not measured are left to the pose prior.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.body.body_model import BodyModel, sole_points
from bodycam_ros.estimation.between_factors import RestingPoint
from bodycam_ros.geometry import Array, transform_points
from bodycam_ros.settings import setting

Mask = NDArray[np.bool_]

FEET = ("foot_left", "foot_right")
_REST = 0.06  # [m/s] a slower point of the sole rests, and may creep by as much
_LEAST_SHIN_M = 0.05  # a foot whose parent starts at the ankle has no known size


@dataclass(frozen=True)
class ContactSettings:
    """Contact of feet with the floor."""

    enabled: bool = setting(True, reason="constrain resting feet; false leaves feet to the cameras alone")


def foot_points(body: BodyModel) -> list[tuple[int, Array]]:
    """Row of each foot of a body and one of its points (3,), in the foot's frame [m]."""
    points = []
    for foot in (joint for joint in body.tree_joints if joint.child in FEET):
        shin_m = float(np.linalg.norm(foot.parent_T_joint[:3, 3]))
        if shin_m > _LEAST_SHIN_M:
            row = body.segment_index[foot.child]
            points += [(row, foot.child_T_joint[:3, 3] + arm) for arm in sole_points(shin_m)]
    return points


def resting_points(
    points: Sequence[tuple[int, Array]], before: Array, poses: Array, dt_s: float, observed: Mask, turning: Mask
) -> list[RestingPoint]:
    """The constraints of points that rest.

    Args:
        points: of the feet (``foot_points``).
        before: (S, 4, 4) poses of the state before.
        poses: (S, 4, 4) solved without the constraints.
        dt_s: between the two [s].
        observed: (S,) observed segments.
        turning: (S,) segments whose rotation is measured at least.
    """
    resting = []
    for row, place in points:
        if turning[row]:
            start, end = transform_points(np.stack([before[row], poses[row]]), place[None])[:, 0]
            if np.linalg.norm(end - start) < _REST * dt_s:
                resting.append(RestingPoint(row, place, _REST * dt_s * (1.0 if observed[row] else 2.0)))
    return resting
