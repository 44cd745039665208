"""When a foot meets the floor and leaves it.

In walking a heel meets the floor where it is furthest ahead of the pelvis, and the ball leaves it where it is furthest
behind (Zeni, Richards and Higginson 2008, "Two simple methods for determining gait events during treadmill and
overground walking using kinematic data"). That a foot stands in between is seen by its rest, as standing feet are known
elsewhere: who waves a foot in the air does not walk.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.signal import find_peaks

from bodycam_ros.estimation.contact import LEAVE
from bodycam_ros.geometry import Array

_PROMINENCE_M = 0.08
"""By which a foot is ahead at least, in its swing, of where it was before and after."""

_APART_S = 0.35
_REST_S = 0.08
_REST_SPEED = LEAVE
HEEL, BALL = 0, 1


@dataclass(frozen=True, eq=False)
class FootEvents:
    """Of one foot.

    Attributes:
        contacts: (C,) when the heel meets the floor [s].
        releases: (R,) when the ball leaves it [s].
        rests: (T,) whether heel or ball is at rest at an instant.
    """

    contacts: Array
    releases: Array
    rests: NDArray[np.bool_]

    def stances(self) -> list[tuple[float, float]]:
        """(contact, release) [s] of each stance of which both are known."""
        found = []
        for contact in self.contacts.tolist():
            after = self.releases[self.releases > contact]
            following = self.contacts[self.contacts > contact]
            if len(after) and (not len(following) or after[0] < following[0]):
                found.append((contact, float(after[0])))
        return found

    def next_contact(self, at_s: float) -> float | None:
        """When the heel meets the floor again [s]; None where it was not seen."""
        following = self.contacts[self.contacts > at_s]
        return float(following[0]) if len(following) else None


def foot_events(seconds: Array, sole: Array, pelvis: Array, ahead: Array) -> FootEvents:
    """Events of a foot.

    Args:
        seconds: (T,) instants, increasing [s].
        sole: (T, 2, 3) heel and ball [m].
        pelvis: (T, 3) [m].
        ahead: (T, 3) unit vectors, level, in which the body goes.
    """
    reach = ((sole - pelvis[:, None]) * ahead[:, None]).sum(axis=2)
    speeds = np.linalg.norm(np.gradient(sole, seconds, axis=0), axis=2).min(axis=1)
    return FootEvents(
        contacts=_peaks(seconds, reach[:, HEEL]),
        releases=_peaks(seconds, -reach[:, BALL]),
        rests=np.asarray(speeds < _REST_SPEED, np.bool_),
    )


def rested(events: FootEvents, seconds: Array, stance: tuple[float, float]) -> bool:
    """Whether the foot is at rest for long enough in a stance."""
    inside = (seconds >= stance[0]) & (seconds <= stance[1]) & events.rests
    step = float(np.median(np.diff(seconds)))
    return bool(inside.sum() * step >= _REST_S)


def _peaks(seconds: Array, values: Array) -> Array:
    """Times of the maxima of a curve (T,), between instants by a parabola."""
    step = float(np.median(np.diff(seconds)))
    at, _ = find_peaks(values, prominence=_PROMINENCE_M, distance=max(1, round(_APART_S / step)))
    before, here, after = values[at - 1], values[at], values[at + 1]
    bend = before - 2.0 * here + after
    shift = np.where(bend < 0.0, 0.5 * (before - after) / np.where(bend < 0.0, bend, -1.0), 0.0)
    times: Array = seconds[at] + np.clip(shift, -0.5, 0.5) * step
    return times
