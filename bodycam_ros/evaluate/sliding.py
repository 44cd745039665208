"""How far standing feet slide.

A foot stands on its heel, on its ball or on both. A stance is a time for which one of the two rests: it is slow, near
the lowest level at which feet stand, for a tenth of a second. How far it slides is how far the point is, horizontally,
from its mean place in the stance: mean and greatest distance. Its way, which adds up every trembling, is longer.

Against the truth the stances are those of the true foot, which is not quite still: people in motion capture slide,
too. What the solved foot slides beyond it is the same distance of the error of its place.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.body.body_model import sole_points
from bodycam_ros.estimation.contact import MAX_HEIGHT_M, ContactSettings
from bodycam_ros.evaluate.comparison import Comparison
from bodycam_ros.geometry import Array, transform_points
from bodycam_ros.results.solved_recording import SolvedRecording

_SHORTEST_NS = 100_000_000
_FIRM_NS = 200_000_000
"""A stance this long is on the floor, and says where it is; a foot may turn back in the air."""

ALL = "all"
"""Stands for all feet together."""

_CONTACT = ContactSettings()
_REST_SPEED, _LEAVE_SPEED = 0.03, 0.06
"""A stance begins below the first and ends above the second [m/s]: 1 and 2 mm from image to image at 30 Hz. True
feet that stand creep by up to 1 mm; what is faster rolls or steps."""


@dataclass(frozen=True)
class Sliding:
    """Of a foot, or of all; NaN where it never stands.

    Attributes:
        stances: how many, of heel and ball.
        standing: for how long in all [s].
        mean: horizontal distance of the resting point from its mean place in the stance, over all instants [m].
        max: the greatest [m].
        way: horizontal way of the resting point in a stance, the mean over stances [m].
    """

    stances: int
    standing: float
    mean: float
    max: float
    way: float


@dataclass(frozen=True)
class SlidingAgainstTruth:
    """While the true foot stands.

    Attributes:
        solved: of the solved foot.
        true: of the true foot.
        beyond: of the difference between the two.
    """

    solved: Sliding
    true: Sliding
    beyond: Sliding


@dataclass(frozen=True)
class _Stance:
    """A point of the sole, heel 0 or ball 1, rests at the instants from ``first`` up to ``last``, that one excluded."""

    point: int
    first: int
    last: int


def sliding(solved: SolvedRecording) -> dict[str, Sliding]:
    """Foot -> how it slides, by stances of the solved motion; ``ALL`` -> the feet together; empty without feet."""
    soles = {foot: sole_of(solved, foot, solved.world_T_link[foot]) for foot in feet_of(solved)}
    stances = _stances(soles, solved.stamps_ns, solved.longest_step_ns)
    return _each_and_all(soles, stances, solved.stamps_ns)


def sliding_against_truth(solved: SolvedRecording, comparison: Comparison) -> dict[str, SlidingAgainstTruth]:
    """The same, by stances of the true motion, and what the true feet do in them."""
    feet = [foot for foot in feet_of(solved) if foot in comparison.segments]
    inside = np.isin(solved.stamps_ns, comparison.stamps_ns)
    of_truth = {foot: comparison.true_segments[comparison.segments.index(foot)] for foot in feet}
    true = {foot: sole_of(solved, foot, poses) for foot, poses in of_truth.items()}
    ours = {foot: sole_of(solved, foot, solved.world_T_link[foot][inside]) for foot in feet}
    stances = _stances(true, comparison.stamps_ns, solved.longest_step_ns)
    measured = [
        _each_and_all(soles, stances, comparison.stamps_ns)
        for soles in (ours, true, {foot: ours[foot] - true[foot] for foot in feet})
    ]
    return {foot: SlidingAgainstTruth(*(of[foot] for of in measured)) for foot in measured[0]}


def feet_of(solved: SolvedRecording) -> list[str]:
    """Segments that stand, and hang on another whose length tells their size."""
    parents = solved.parents
    return [foot for foot in _CONTACT.segments.split() if foot in parents]


def sole_of(solved: SolvedRecording, foot: str, world_T_foot: Array) -> Array:
    """Heel and ball (T, 2, 3) in the world [m]."""
    shin = solved.parents[foot]
    ends = solved.world_T_link[foot][:, :3, 3] - solved.world_T_link[shin][:, :3, 3]
    return transform_points(world_T_foot, sole_points(float(np.median(np.linalg.norm(ends, axis=1)))))


def _stances(soles: Mapping[str, Array], stamps_ns: NDArray[np.int64], gap_ns: float) -> dict[str, list[_Stance]]:
    """Stances of each foot that are on the floor that all of them tell."""
    found = {
        foot: [
            _Stance(point, first, last)
            for point in range(sole.shape[1])
            for first, last in _rests(sole[:, point], stamps_ns, gap_ns)
        ]
        for foot, sole in soles.items()
    }
    firm = [
        level
        for foot, stances in found.items()
        for stance in stances
        if (level := _level(soles[foot], stance)) < MAX_HEIGHT_M
        and stamps_ns[stance.last - 1] - stamps_ns[stance.first] >= _FIRM_NS
    ]
    highest = min(firm, default=0.0) + MAX_HEIGHT_M
    return {
        foot: [stance for stance in stances if _level(soles[foot], stance) < highest] for foot, stances in found.items()
    }


def _rests(place: Array, stamps_ns: NDArray[np.int64], gap_ns: float) -> Iterator[tuple[int, int]]:
    """First instant, and the one after the last, of each time for which a point (T, 3) rests."""
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


def _level(sole: Array, stance: _Stance) -> float:
    return float(np.median(sole[stance.first : stance.last, stance.point, 2]))


def _each_and_all(
    soles: Mapping[str, Array], stances: Mapping[str, Sequence[_Stance]], stamps_ns: NDArray[np.int64]
) -> dict[str, Sliding]:
    ways = {
        foot: [
            (soles[foot][stance.first : stance.last, stance.point, :2], stamps_ns[stance.first : stance.last])
            for stance in stances[foot]
        ]
        for foot in soles
    }
    measured = {foot: _measured(of_foot) for foot, of_foot in ways.items()}
    return measured | {ALL: _measured([way for of_foot in ways.values() for way in of_foot])} if soles else {}


def _measured(ways: Sequence[tuple[Array, NDArray[np.int64]]]) -> Sliding:
    """Of horizontal ways (N, 2) in stances, and their stamps (N,)."""
    if not ways:
        return Sliding(0, 0.0, np.nan, np.nan, np.nan)
    distances = np.concatenate([np.linalg.norm(way - way.mean(axis=0), axis=1) for way, _ in ways])
    lengths = [np.linalg.norm(np.diff(way, axis=0), axis=1).sum() for way, _ in ways]
    standing_ns = sum(int(stamps[-1] - stamps[0]) for _, stamps in ways)
    return Sliding(
        len(ways), 1e-9 * standing_ns, float(distances.mean()), float(distances.max()), float(np.mean(lengths))
    )
