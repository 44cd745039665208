"""A point of a sole that rests on the floor or does not, by how the solved motion moves it."""

from dataclasses import dataclass

import numpy as np

from bodycam_ros.estimation.contact_settings import ContactSettings
from bodycam_ros.geometry import Array, transform_points

FIRM_NS = 200_000_000
"""A point that has been slow for so long stands, at whatever level; a foot that turns back in the air is not."""


@dataclass(frozen=True)
class Step:
    """The latest motion of a foot.

    Attributes:
        world_T_foot: (4, 4) its latest pose [m].
        world_T_foot_before: (4, 4) that of ``took_s`` earlier [m].
        took_s: [s].
        stamp_ns: when the latest pose is [ns].
        seen: whether its rotation is known, and not a guess.
    """

    world_T_foot: Array
    world_T_foot_before: Array
    took_s: float
    stamp_ns: int
    seen: bool


class RestingPoint:
    """Follows one point.

    Args:
        row: of the foot among the segments.
        ankle: (3,) the joint that the foot hangs on, in the foot [m].
        arm: (3,) from there to the point, in the foot [m].
        settings: when it rests.

    Attributes:
        row, arm: as given.
        place: (3,) of the point in the foot [m].
        since_ns: when it came to rest [ns]; None while it does not rest.
        level: height at which it last stood firmly [m]; None before it has.
        anchor: (3,) where in the world it rests, of a foot that is not seen [m].
    """

    def __init__(self, row: int, ankle: Array, arm: Array, settings: ContactSettings) -> None:
        self.row, self.arm, self.place = row, arm, ankle + arm
        self.since_ns: int | None = None
        self.anchor: Array | None = None
        self.level: float | None = None
        self._slow_since_ns: int | None = None
        self._ankle = ankle
        self._settings = settings

    def let_go(self) -> None:
        """It does not rest."""
        self.since_ns = self.anchor = self._slow_since_ns = None

    def follow(self, step: Step, floor: float) -> None:
        """Decide whether it rests: slow and near the floor, or slow for long enough to be a floor of its own.

        Args:
            step: the latest motion of its foot.
            floor: level of the floor [m].
        """
        ends = np.stack([self.place, self._ankle])
        point, ankle = transform_points(step.world_T_foot, ends)
        point_before, ankle_before = transform_points(step.world_T_foot_before, ends)
        of, rested, place = self._settings, self.since_ns is not None, point
        if step.seen:
            way, limit = (
                np.linalg.norm(point - point_before),
                of.leave_speed if self._slow_since_ns is not None else of.rest_speed,
            )
        elif rested:
            # Its heel rises as it likes, which moves the ankle on a circle about the point.
            rise = np.cross(step.world_T_foot[:3, 1], point - ankle)
            rise /= np.linalg.norm(rise)
            moved = ankle - ankle_before
            way, limit = np.linalg.norm(moved - (moved @ rise) * rise), of.blind_leave_speed
        else:
            # Its rotation is a guess, but it lands flat.
            place = np.array([*point[:2], ankle[2] + self.arm[2]])
            way, limit = np.linalg.norm(ankle - ankle_before), of.blind_rest_speed
        if way >= limit * step.took_s:
            self.let_go()
            return
        if self._slow_since_ns is None:
            self._slow_since_ns = step.stamp_ns
        is_firm = step.seen and step.stamp_ns - self._slow_since_ns >= FIRM_NS
        if place[2] - floor >= of.max_height and not is_firm:
            self.since_ns = self.anchor = None
            return
        if not rested:
            self.since_ns = step.stamp_ns
        if is_firm:
            self.level = float(point[2])
        if step.seen:
            self.anchor = None
        elif self.anchor is None:
            self.anchor = place
