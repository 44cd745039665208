"""Strides of a person who walks, and their figures.

In walking a heel meets the floor where it is furthest ahead of the pelvis, and the ball leaves it where it is furthest
behind (Zeni, Richards and Higginson 2008, "Two simple methods for determining gait events during treadmill and
overground walking using kinematic data"). In between the foot must rest: a foot that is waved in the air does not walk.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import uniform_filter1d
from scipy.signal import find_peaks
from scipy.stats import t

from bodycam_ros.evaluate.anatomical_angles import LEG_JOINTS, LEGS, flexion_angles
from bodycam_ros.evaluate.comparison import Comparison
from bodycam_ros.evaluate.figures import GaitFigures, GaitMeasure
from bodycam_ros.geometry import Array
from bodycam_ros.results.solved_recording import SolvedRecording
from bodycam_ros.results.stances import feet_of, sole_of

_PROMINENCE_M = 0.08
"""Distance by which a foot is ahead in its swing, at least, of where it was before and after."""

_REST_SPEED = 0.12  # [m/s] of a point that rests
_APART_S = 0.35  # between two contacts of a foot
_REST_S = 0.08  # of a foot in stance, at least
_SMOOTH_S = 1.0  # over which the direction of walking is averaged
_STILL_SPEED = 0.1  # [m/s] below it, ahead is where the pelvis faces
_HEEL, _BALL = 0, 1
SIDES = ("left", "right")

_MIN_STRIDES, _MIN_LENGTH_M, _MIN_SPEED = 3, 0.3, 0.2
_SHORTEST_S, _LONGEST_S = 0.5, 2.5
CRITERION = (
    f"{_MIN_STRIDES} strides or more, of both feet, each of {_SHORTEST_S:g} to {_LONGEST_S:g} s, {_MIN_LENGTH_M:g} m "
    f"long or longer and {_MIN_SPEED:g} m/s fast or faster, in which the foot rests and the other one meets the floor"
)
"""Walking; without it there are no figures."""

MIN_STRIDES_OF_SIDE = 3
"""Least strides of each side; fewer say nothing about a difference of the sides."""

_UPPER = 0.975  # quantile at the upper end of a 95 % interval
_SYMMETRY = ("symmetry_percent", "symmetry_low_percent", "symmetry_high_percent")


@dataclass(frozen=True)
class Stride:
    """From one contact of a foot to its next.

    Attributes:
        side: "left".
        start_s, end_s: contacts [s].
        figures: key of ``MEASURES`` -> value in the unit of its name; NaN where an event is unknown.
    """

    side: str
    start_s: float
    end_s: float
    figures: Mapping[str, float]


MEASURES: Mapping[str, tuple[str, bool]] = {
    "stride_s": ("stride time [s]", True),
    "cadence_per_min": ("cadence [steps/min]", True),
    "stride_m": ("stride length [m]", True),
    "step_m": ("step length [m]", True),
    "step_width_cm": ("step width [cm]", False),
    "speed_m_s": ("walking speed [m/s]", False),
    "stance_percent": ("stance [%]", True),
    "double_support_percent": ("double support [%]", False),
    "clearance_cm": ("clearance of the ball [cm]", True),
    **{f"{joint}_range_deg": (f"{joint}, range [deg]", True) for joint in LEG_JOINTS},
}
"""Key of a figure -> its name with the unit, and whether it is the same on both sides of a healthy person."""


class Walk:
    """Feet and pelvis over T states, and the events of the feet.

    Attributes:
        contacts, releases: side -> when the heel meets the floor, when the ball leaves it [s].
    """

    def __init__(self, seconds: Array, world_T_segment: Mapping[str, Array], soles: Mapping[str, Array]) -> None:
        self.seconds, self.soles = seconds, soles
        self.step_s = float(np.median(np.diff(seconds)))
        self.pelvis = world_T_segment["pelvis"][:, :3, 3]
        self.ahead = self._direction(world_T_segment["pelvis"])
        self.angles = flexion_angles(world_T_segment)
        self.contacts, self.releases, self.rests = {}, {}, {}
        for side, sole in soles.items():
            reach = ((sole - self.pelvis[:, None]) * self.ahead[:, None]).sum(axis=2)
            self.contacts[side], self.releases[side] = self._peaks(reach[:, _HEEL]), self._peaks(-reach[:, _BALL])
            speeds = np.linalg.norm(np.gradient(sole, seconds, axis=0), axis=2).min(axis=1)
            self.rests[side] = speeds < _REST_SPEED

    def _direction(self, world_T_pelvis: Array) -> Array:
        """Unit vectors (T, 3), level, in which the body walks; where it stands, in which the pelvis faces."""
        size = max(1, round(_SMOOTH_S / self.step_s))
        moving = np.gradient(world_T_pelvis[:, :2, 3], self.seconds, axis=0)
        moving = uniform_filter1d(moving, size, axis=0, mode="nearest")
        walks = np.linalg.norm(moving, axis=1, keepdims=True) > _STILL_SPEED
        level = np.where(walks, moving, world_T_pelvis[:, :2, 0])
        level = level / np.maximum(np.linalg.norm(level, axis=1, keepdims=True), 1e-9)
        return np.column_stack([level, np.zeros(len(level))])

    def _peaks(self, values: Array) -> Array:
        """Times of the maxima of a curve (T,), between states by a parabola."""
        at, _ = find_peaks(values, prominence=_PROMINENCE_M, distance=max(1, round(_APART_S / self.step_s)))
        before, here, after = values[at - 1], values[at], values[at + 1]
        bend = np.minimum(before - 2.0 * here + after, -1e-12)
        times: Array = self.seconds[at] + np.clip(0.5 * (before - after) / bend, -0.5, 0.5) * self.step_s
        return times

    def stride(self, side: str, start_s: float, longest_step_s: float) -> Stride | None:
        """The stride from a contact to the next; None where that is none of a person who walks."""
        following = self.contacts[side][self.contacts[side] > start_s]
        releases = self.releases[side][self.releases[side] > start_s]
        inside = self._between(start_s, following[0]) if len(following) else np.zeros(0, bool)
        if not len(releases) or inside.sum() <= 3 or np.diff(self.seconds[inside]).max() > longest_step_s:
            return None
        end_s, release_s = float(following[0]), float(releases[0])
        other = SIDES[1 - SIDES.index(side)]
        others = self.contacts[other]
        rest_s = (self._between(start_s, release_s) & self.rests[side]).sum() * self.step_s
        start, end = (self._value(self.soles[side][:, _HEEL], at_s) for at_s in (start_s, end_s))
        length = float(np.linalg.norm((end - start)[:2]))
        duration = end_s - start_s
        walked = (self._value(self.pelvis, end_s) - self._value(self.pelvis, start_s))[:2]
        speed = float(np.linalg.norm(walked)) / duration
        walks = _SHORTEST_S <= duration <= _LONGEST_S and length >= _MIN_LENGTH_M and speed >= _MIN_SPEED
        if not (walks and release_s < end_s and rest_s >= _REST_S and ((others > start_s) & (others < end_s)).any()):
            return None
        apart = end - self._value(self.soles[other][:, _HEEL], end_s)
        ahead = self._value(self.ahead, end_s)
        ahead /= np.linalg.norm(ahead)
        values = {
            "stride_s": duration,
            "cadence_per_min": 120.0 / duration,
            "stride_m": length,
            "step_m": float(apart @ ahead),
            "step_width_cm": 100.0 * float(abs(apart[0] * ahead[1] - apart[1] * ahead[0])),
            "speed_m_s": speed,
            "stance_percent": 100.0 * (release_s - start_s) / duration,
            "double_support_percent": 100.0 * self._double_support_s(other, start_s, release_s) / duration,
            "clearance_cm": 100.0 * self._clearance(side, start_s, release_s, end_s),
            **{f"{joint}_range_deg": float(np.ptp(self.angles[joint, side][inside])) for joint in LEG_JOINTS},
        }
        return Stride(side, start_s, end_s, values)

    def _value(self, values: Array, at_s: float) -> Array:
        return np.array([np.interp(at_s, self.seconds, column) for column in values.T])

    def _between(self, first_s: float, last_s: float) -> NDArray[np.bool_]:
        inside: NDArray[np.bool_] = (self.seconds >= first_s) & (self.seconds <= last_s)
        return inside

    def _double_support_s(self, other: str, start_s: float, release_s: float) -> float:
        """Time of both feet on the floor in a stance [s]: until the other leaves it, and from when it is back."""
        events = self.releases[other], self.contacts[other]
        left, back = (times[(times > start_s) & (times < release_s)] for times in events)
        if not (len(left) and len(back) and left[0] < back[-1]):
            return np.nan
        return float(left[0] - start_s + release_s - back[-1])

    def _clearance(self, side: str, start_s: float, release_s: float, end_s: float) -> float:
        """Least height of the ball in the swing over its height in the stances before and after [m].

        Only the middle half of each counts.
        """

        def heights(first_s: float, last_s: float) -> Array:
            quarter = (last_s - first_s) / 4.0
            return np.asarray(self.soles[side][self._between(first_s + quarter, last_s - quarter), _BALL, 2])

        next_release = self.releases[side][self.releases[side] > end_s][:1].tolist()
        stances = [heights(start_s, release_s), *(heights(end_s, last_s) for last_s in next_release)]
        levels = [np.median(stance) for stance in stances if len(stance)]
        swing = heights(release_s, end_s)
        return float(swing.min() - np.mean(levels)) if len(swing) and levels else np.nan


def find_strides(
    seconds: Array, world_T_segment: Mapping[str, Array], soles: Mapping[str, Array], longest_step_s: float
) -> tuple[Stride, ...]:
    """Strides of a motion in order of time; empty where no steps are found, by ``CRITERION``.

    Args:
        seconds: (T,) of the states, increasing [s].
        world_T_segment: segment -> (T, 4, 4) [m], z up.
        soles: side -> (T, 2, 3) heel and ball [m].
        longest_step_s: states further apart have a gap between them [s].
    """
    if not set(world_T_segment) >= LEGS or set(soles) != set(SIDES) or len(seconds) < 5:
        return ()
    walk = Walk(seconds, world_T_segment, soles)
    tried = [walk.stride(side, start_s, longest_step_s) for side in SIDES for start_s in walk.contacts[side].tolist()]
    strides = sorted((stride for stride in tried if stride is not None), key=lambda stride: stride.start_s)
    walks = len(strides) >= _MIN_STRIDES and {stride.side for stride in strides} == set(SIDES)
    return tuple(strides) if walks else ()


def gait_figures(strides: Sequence[Stride], true: Sequence[Stride] = ()) -> GaitFigures:
    """Figures of strides, with the mean of true ones, if there are any."""
    sides = {side: [stride for stride in strides if stride.side == side] for side in SIDES}
    measures = {}
    for key, (_, is_symmetric) in MEASURES.items():
        left, right = (_statistic(each, key, np.mean) for each in sides.values())
        symmetry = _symmetry(*(_known(each, key) for each in sides.values())) if is_symmetric else None
        measures[key] = GaitMeasure(
            mean=_statistic(strides, key, np.mean),
            sd=_statistic(strides, key, np.std),
            left=left,
            right=right,
            **({} if symmetry is None else dict(zip(_SYMMETRY, symmetry, strict=True))),
            true=_statistic(true, key, np.mean) if true else None,
        )
    return GaitFigures(strides={side: len(each) for side, each in sides.items()}, **measures)


def _statistic(strides: Sequence[Stride], key: str, statistic: Callable[[Array], Any]) -> float:
    """Statistic of the strides that have the figure; NaN of none."""
    known = _known(strides, key)
    return float(statistic(known)) if known.size else np.nan


def _known(strides: Sequence[Stride], key: str) -> Array:
    """Values (N,) of the strides that have the figure."""
    values: Array = np.array([stride.figures[key] for stride in strides])
    return np.asarray(values[np.isfinite(values)])


def _symmetry(left: Array, right: Array) -> tuple[float, float, float] | None:
    """Left less right over their mean [%], and its 95 % interval (Welch 1947); None of too few strides to say it."""
    if min(left.size, right.size) < MIN_STRIDES_OF_SIDE or not left.mean() + right.mean():
        return None
    percent = 200.0 / float(left.mean() + right.mean())
    difference = percent * float(left.mean() - right.mean())
    sides = left, right
    variances = np.array([side.var(ddof=1) / side.size for side in sides])
    spread = float(sum(v**2 / (side.size - 1) for v, side in zip(variances, sides, strict=True)))
    # scipy's ttest_ind warns of strides that are alike to rounding, as those of made motions are.
    reach = percent * np.sqrt(variances.sum()) * t.ppf(_UPPER, variances.sum() ** 2 / spread) if spread else 0.0
    return difference, difference - float(reach), difference + float(reach)


def solved_strides(solved: SolvedRecording) -> tuple[Stride, ...]:
    """Strides of the body as it was solved; empty where no steps are found."""
    return _strides_of(solved, solved.stamps_ns, {s: solved.world_T_link[s] for s in solved.body_segments})


def solved_gait(
    solved: SolvedRecording, strides: Sequence[Stride], comparison: Comparison | None
) -> GaitFigures | None:
    """Figures of the strides of the solved body; None without any."""
    if not strides:
        return None
    if comparison is None:
        return gait_figures(strides)
    return gait_figures(strides, _strides_of(solved, comparison.stamps_ns, comparison.true_segments))


def _strides_of(
    solved: SolvedRecording, stamps_ns: NDArray[np.int64], world_T_segment: Mapping[str, Array]
) -> tuple[Stride, ...]:
    feet = [foot for foot in feet_of(solved) if foot in world_T_segment]
    soles = {foot.removeprefix("foot_"): sole_of(solved, foot, world_T_segment[foot]) for foot in feet}
    return find_strides(solved.seconds(stamps_ns), world_T_segment, soles, 1e-9 * solved.longest_step_ns)
