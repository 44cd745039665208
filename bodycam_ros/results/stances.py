"""Times for which feet rest on the floor.

A foot stands on its heel, on its ball or on both. A stance is a time for which one of the two rests: it is slow, near
the lowest level at which feet rest, for a tenth of a second.
"""

from collections.abc import Iterator, Mapping

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.body.body_model import sole_points
from bodycam_ros.estimation.contact import FEET
from bodycam_ros.geometry import Array, transform_points
from bodycam_ros.results.solved_body import SolvedBody

_SHORTEST_NS = 100_000_000
_FIRM_NS = 200_000_000
"""A stance this long is on the floor and gives its level; a foot may turn back in the air."""

_MAX_HEIGHT_M = 0.1  # of a stance over the lowest one: pedals are higher
_REST_SPEED, _LEAVE_SPEED = 0.03, 0.06
"""A stance begins below the first and ends above the second [m/s]: 1 and 2 mm from image to image at 30 Hz. True feet
in stance creep by up to 1 mm; faster ones roll or step."""

Stance = tuple[int, int, int]
"""Point of the sole, heel 0 or ball 1, first frame, and the one after the last."""


def feet_of(solved: SolvedBody) -> list[str]:
    """Feet, whose size is known by their parents' length."""
    return [foot for foot in FEET if foot in solved.parents]


def sole_of(solved: SolvedBody, foot: str, world_T_foot: Array) -> Array:
    """Heel and ball (T, 2, 3) in the world [m], of poses world_T_foot (T, 4, 4) [m]."""
    ends = solved.world_T_link[foot][:, :3, 3] - solved.world_T_link[solved.parents[foot]][:, :3, 3]
    return transform_points(world_T_foot, sole_points(float(np.median(np.linalg.norm(ends, axis=1)))))


def find_stances(soles: Mapping[str, Array], stamps_ns: NDArray[np.int64], gap_ns: float) -> dict[str, list[Stance]]:
    """Stances of each foot on the common floor.

    Args:
        soles: foot -> heel and ball (T, 2, 3) in the world [m].
        stamps_ns: (T,) increasing [ns].
        gap_ns: states that are further apart have a gap between them, which ends a stance [ns].
    """
    levels: dict[str, dict[Stance, float]] = {
        foot: {
            (point, first, last): float(np.median(sole[first:last, point, 2]))
            for point in range(sole.shape[1])
            for first, last in _rests(sole[:, point], stamps_ns, gap_ns)
        }
        for foot, sole in soles.items()
    }
    floors = (
        level
        for each in levels.values()
        for (_, first, last), level in each.items()
        if level < _MAX_HEIGHT_M and stamps_ns[last - 1] - stamps_ns[first] >= _FIRM_NS
    )
    highest = _MAX_HEIGHT_M + min(floors, default=0.0)
    return {foot: [stance for stance, level in each.items() if level < highest] for foot, each in levels.items()}


def _rests(place: Array, stamps_ns: NDArray[np.int64], gap_ns: float) -> Iterator[tuple[int, int]]:
    """First frame, and the one after the last, of each time for which a point (T, 3) rests."""
    speeds = np.linalg.norm(np.diff(place, axis=0), axis=1) / (1e-9 * np.diff(stamps_ns))
    speeds[np.diff(stamps_ns) > gap_ns] = np.inf
    first: int | None = None
    for step, speed in enumerate([*speeds, np.inf]):
        if first is None and speed < _REST_SPEED:
            first = step
        elif first is not None and speed >= _LEAVE_SPEED:
            if stamps_ns[step] - stamps_ns[first] >= _SHORTEST_NS:
                yield first, step + 1
            first = None
