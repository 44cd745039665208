"""A slipped strap: a camera whose place on its segment changes during the recording and stays changed.

The refined body has a camera where it was for longest, because the fit is robust; from there it is off for the rest of
the time. A camera alone on its segment takes the segment with it, and its neighbours share what remains.
"""

from dataclasses import dataclass

import numpy as np

from bodycam_ros.geometry import Array, inverse, log_se3, robust_average_pose

_MIN_SHIFT_M = 0.025  # registrations err by half of this for a second or two
_MIN_TURN_RAD = 0.03  # soft tissue gives by a degree and comes back; a strap does not
_MIN_STAY_S = 1.0  # a change lasts this long on either side; blur passes sooner
_MIN_POSES = 10  # on either side of a change; fewer may be a few wrong registrations


@dataclass(frozen=True)
class Slip:
    """A lasting change: when [s], and by how much [m], [rad]."""

    seconds: float
    moved_m: float
    turned_rad: float


def slip_warning(camera: str, slip: Slip) -> str:
    """Warning of a slip."""
    return (
        f"camera {camera} slipped after {slip.seconds:.1f} s, by {1e3 * slip.moved_m:.0f} mm and "
        f"{np.degrees(slip.turned_rad):.1f} deg, or one next to it did: tighten its strap and repeat the recording"
    )


def lasting_change(poses: Array, seconds: Array) -> Slip | None:
    """The greatest lasting change of poses that should stay the same; None if there is none.

    Args:
        poses: (N, 4, 4) of a camera, from where the body puts it.
        seconds: (N) [s].
    """
    if len(poses) < 2 * _MIN_POSES or seconds[-1] - seconds[0] < 2 * _MIN_STAY_S:
        return None
    # In units of the thresholds, so that turns and shifts can be added.
    unit = np.repeat([_MIN_TURN_RAD, _MIN_SHIFT_M], 3)
    offsets = log_se3(inverse(robust_average_pose(poses)) @ poses) / unit
    times = np.arange(seconds[0] + _MIN_STAY_S, seconds[-1] - _MIN_STAY_S, _MIN_STAY_S / 8)
    rows = np.unique(np.searchsorted(seconds, times))
    rows = rows[(rows >= _MIN_POSES) & (rows <= len(poses) - _MIN_POSES)]
    if len(rows) == 0:
        return None
    # The change is where two places instead of one leave the least residual, in absolute values: blur is no place.
    row = int(min(rows, key=lambda row: _scatter(offsets[:row]) + _scatter(offsets[row:])))
    change = np.median(offsets[row:], axis=0) - np.median(offsets[:row], axis=0)
    turned, moved = float(np.linalg.norm(change[:3])), float(np.linalg.norm(change[3:]))
    if max(turned, moved) < 1.0:
        return None
    return Slip(float(seconds[row]), moved * _MIN_SHIFT_M, turned * _MIN_TURN_RAD)


def _scatter(offsets: Array) -> float:
    """Sum of distances from the median."""
    return float(np.linalg.norm(offsets - np.median(offsets, axis=0), axis=1).sum())
