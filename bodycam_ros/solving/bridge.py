"""The body between two instants while no camera spoke at all: a curve that leaves and arrives with the body's velocity.

Cubic Hermite curves, of the root's pose and of every joint's rotation, so that no limb is stretched on the way.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.geometry import exp_se3, exp_so3, inverse, log_se3, log_so3
from bodycam_ros.solving.body_covariance import BodyUncertainty

_SWING = 0.7
"""Share of the velocities that the curve keeps: at one, a joint that reverses on the way overshoots."""

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Posture:
    """Poses (S, 4, 4) of all segments at a stamp [ns], and how well they are known."""

    stamp_ns: int
    world_T_segment: Array
    uncertainty: BodyUncertainty


def bridge(
    body: BodyModel, before: Sequence[Posture], after: Sequence[Posture], stamps_ns: Sequence[int], density: Array
) -> tuple[Array, list[BodyUncertainty]]:
    """Poses (T, S, 4, 4) at stamps between two instants, and their covariances.

    Args:
        body: its joints.
        before: the last one or two instants before, in order of time.
        after: the first one or two instants after, in order of time.
        stamps_ns: (T) in between.
        density: (6) spectral density of a segment's accelerations, rotation then translation.
    """
    start, end = before[-1], after[0]
    root = body.segment_index[body.root]
    start_R, end_R = (body.joint_rotations(posture.world_T_segment) for posture in (start, end))
    leaving_s, arriving_s = _seconds(before), _seconds(after)
    whole_s = 1e-9 * (end.stamp_ns - start.stamp_ns)
    share = 1e-9 * (np.array(stamps_ns) - start.stamp_ns) / whole_s

    from_R = np.swapaxes(start_R, -1, -2)
    turned = log_so3(from_R @ end_R)
    leaving, arriving = np.zeros_like(turned), np.zeros_like(turned)
    if leaving_s:
        leaving = -log_so3(from_R @ body.joint_rotations(before[0].world_T_segment)) / leaving_s
    if arriving_s:
        arriving = (log_so3(from_R @ body.joint_rotations(after[1].world_T_segment)) - turned) / arriving_s
    rotations = start_R @ exp_so3(_curve(share, turned, whole_s * leaving, whole_s * arriving))

    root_T_world = inverse(start.world_T_segment[root])
    moved = log_se3(root_T_world @ end.world_T_segment[root])
    leaving, arriving = np.zeros(6), np.zeros(6)
    if leaving_s:
        leaving = -log_se3(root_T_world @ before[0].world_T_segment[root]) / leaving_s
    if arriving_s:
        arriving = (log_se3(root_T_world @ after[1].world_T_segment[root]) - moved) / arriving_s
    world_T_root = start.world_T_segment[root] @ exp_se3(_curve(share, moved, whole_s * leaving, whole_s * arriving))
    known = [_between(start.uncertainty, end.uncertainty, float(u), whole_s, density) for u in share]
    return body.forward_kinematics(world_T_root, rotations), known


def _between(
    start: BodyUncertainty, end: BodyUncertainty, share: float, whole_s: float, density: Array
) -> BodyUncertainty:
    """Covariances on the way: a white-noise acceleration pinned at both ends leaves q (t (T - t))^3 / (3 T^3)."""
    pinned = (share * (1.0 - share)) ** 3 * whole_s**3 / 3.0 * density
    spun = 0.25 * whole_s * share * (1.0 - share) * 4.0 * density
    mixed = [
        (1.0 - share) * a + share * b
        for a, b in ((start.root, end.root), (start.root_twist, end.root_twist), (start.joints, end.joints))
    ]
    # Both segments of a joint may have turned.
    return BodyUncertainty(mixed[0] + np.diag(pinned), mixed[1] + np.diag(spun), mixed[2] + 2.0 * np.diag(pinned[:3]))


def _seconds(postures: Sequence[Posture]) -> float:
    return 1e-9 * (postures[-1].stamp_ns - postures[0].stamp_ns)


def _curve(share: Array, end: Array, leaving: Array, arriving: Array) -> Array:
    """Cubic Hermite curve (T, ...) from zero to ``end`` (...) at shares (T,) of the way, with both ends' velocities."""
    u = share.reshape(-1, *[1] * end.ndim)
    curve: Array = u**2 * (3 - 2 * u) * end + _SWING * ((u**3 - 2 * u**2 + u) * leaving + (u**3 - u**2) * arriving)
    return curve
