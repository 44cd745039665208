"""The strides of somebody who walks, and what a clinician asks of them.

In walking a heel meets the floor where it is furthest ahead of the pelvis, and the ball leaves it where it is furthest
behind (Zeni, Richards and Higginson 2008, "Two simple methods for determining gait events during treadmill and
overground walking using kinematic data"). That a foot stands in between is seen by its rest, as standing feet are known
elsewhere: who waves a foot in the air does not walk.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import uniform_filter1d
from scipy.signal import find_peaks

from bodycam_ros.estimation.contact import LEAVE
from bodycam_ros.evaluate.anatomical_angles import planes_of
from bodycam_ros.evaluate.comparison import Comparison
from bodycam_ros.evaluate.sliding import feet_of, sole_of
from bodycam_ros.geometry import Array
from bodycam_ros.results.solved_recording import SolvedRecording

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


SIDES = ("left", "right")
JOINTS = {"hip": "thigh", "knee": "shin", "ankle": "foot"}
_PARENTS = {"thigh": "pelvis", "shin": "thigh", "foot": "shin"}

LEAST_STRIDES = 3
LEAST_LENGTH_M, LEAST_SPEED = 0.3, 0.2
SHORTEST_S, LONGEST_S = 0.5, 2.5
CRITERION = (
    f"{LEAST_STRIDES} strides or more, of both feet, each of {SHORTEST_S:g} to {LONGEST_S:g} s, {LEAST_LENGTH_M:g} m "
    f"long or longer and {LEAST_SPEED:g} m/s fast or faster, in which the foot rests and the other one meets the floor"
)
"""What counts; where there is less nothing is said."""

_SMOOTH_S = 1.0  # that the direction in which the body goes is taken over
_FASTEST_STILL = 0.1  # [m/s] who goes slower is ahead where the pelvis faces
CYCLE = 101
"""Points of a stride that curves are brought to: per cent, both ends included."""


@dataclass(frozen=True, eq=False)
class Stride:
    """From one contact of a foot to its next.

    Attributes:
        side: "left".
        start_s, release_s, end_s: contact, when the foot leaves the floor, and contact again [s].
        length: between the two places where the heel meets the floor, level [m].
        speed: of the pelvis, level [m/s].
        step_length: by which the heel is ahead of the other one at its end [m].
        step_width: by which heels are beside each other then [m].
        double_support: share of the stride for which both feet stand; NaN if the other foot's events are not known.
        clearance: least height of the ball in the middle half of the swing, over where it stood [m].
        heel_rise: greatest height of the heel over where it stood [m].
        angles: joint -> (CYCLE,) flexion [rad] over the stride.
    """

    side: str
    start_s: float
    release_s: float
    end_s: float
    length: float
    speed: float
    step_length: float
    step_width: float
    double_support: float
    clearance: float
    heel_rise: float
    angles: Mapping[str, Array]

    @property
    def duration(self) -> float:
        """[s]."""
        return self.end_s - self.start_s

    @property
    def stance(self) -> float:
        """Share of the stride for which the foot stands."""
        return (self.release_s - self.start_s) / self.duration

    def range_of(self, joint: str) -> float:
        """Greatest less least flexion [rad]."""
        return float(np.ptp(self.angles[joint]))


@dataclass(frozen=True, eq=False)
class Gait:
    """Strides of both feet, and what they are told by.

    Attributes:
        strides: in order of time.
        stances: side -> (contact, release) [s] of all stances.
        seconds: (T,) instants [s].
        soles: side -> (T, 2, 3) heel and ball [m].
    """

    strides: tuple[Stride, ...]
    stances: Mapping[str, tuple[tuple[float, float], ...]]
    seconds: Array
    soles: Mapping[str, Array]

    def of(self, side: str) -> tuple[Stride, ...]:
        """Strides of one foot."""
        return tuple(stride for stride in self.strides if stride.side == side)


def gait(
    seconds: Array, world_T_segment: Mapping[str, Array], soles: Mapping[str, Array], longest_step_s: float
) -> Gait | None:
    """Strides of a motion; None where nobody walks, by ``CRITERION``.

    Args:
        seconds: (T,) instants [s].
        world_T_segment: segment -> (T, 4, 4) [m], z up.
        soles: side -> (T, 2, 3) heel and ball [m].
        longest_step_s: instants further apart have a gap between them [s].
    """
    needed = {"pelvis", *(f"{kind}_{side}" for kind in JOINTS.values() for side in SIDES)}
    if not needed <= set(world_T_segment) or set(soles) != set(SIDES) or len(seconds) < 5:
        return None
    pelvis = world_T_segment["pelvis"]
    ahead = _ahead(seconds, pelvis)
    events = {side: foot_events(seconds, soles[side], pelvis[:, :3, 3], ahead) for side in SIDES}
    stances = {side: tuple(events[side].stances()) for side in SIDES}
    motion = _Motion(seconds, pelvis[:, :3, 3], ahead, soles, events, stances, _flexions(world_T_segment))
    strides = [
        stride
        for side in SIDES
        for stance in stances[side]
        if (end_s := events[side].next_contact(stance[0])) is not None
        and _unbroken(seconds, stance[0], end_s, longest_step_s)
        and rested(events[side], seconds, stance)
        and (stride := motion.stride(side, stance, end_s)) is not None
    ]
    if len(strides) < LEAST_STRIDES or {stride.side for stride in strides} != set(SIDES):
        return None
    return Gait(tuple(sorted(strides, key=lambda stride: stride.start_s)), stances, seconds, soles)


@dataclass(frozen=True, eq=False)
class _Motion:
    """What all strides are measured in."""

    seconds: Array
    pelvis: Array
    ahead: Array
    soles: Mapping[str, Array]
    events: Mapping[str, FootEvents]
    stances: Mapping[str, tuple[tuple[float, float], ...]]
    flexions: Mapping[str, Array]

    def stride(self, side: str, stance: tuple[float, float], end_s: float) -> Stride | None:
        """A stride; None if it is none of somebody who walks."""
        start_s, release_s = stance
        other = SIDES[1 - SIDES.index(side)]
        heel = self.soles[side][:, HEEL]
        ends = [self._at(heel, at) for at in (start_s, end_s)]
        length = float(np.linalg.norm((ends[1] - ends[0])[:2]))
        went = (self._at(self.pelvis, end_s) - self._at(self.pelvis, start_s))[:2]
        duration = end_s - start_s
        speed = float(np.linalg.norm(went)) / duration
        alternates = any(start_s < contact < end_s for contact in self.events[other].contacts)
        walks = SHORTEST_S <= duration <= LONGEST_S and length >= LEAST_LENGTH_M and speed >= LEAST_SPEED
        if not (walks and alternates and start_s < release_s < end_s):
            return None
        apart = ends[1] - self._at(self.soles[other][:, HEEL], end_s)
        ahead = self._at(self.ahead, end_s)
        ahead /= np.linalg.norm(ahead)
        cycle = np.linspace(start_s, end_s, CYCLE)
        return Stride(
            side=side,
            start_s=start_s,
            release_s=release_s,
            end_s=end_s,
            length=length,
            speed=speed,
            step_length=float(apart @ ahead),
            step_width=float(abs(apart[0] * ahead[1] - apart[1] * ahead[0])),
            double_support=self._both(other, start_s, release_s) / duration,
            clearance=self._clearance(side, stance, end_s),
            heel_rise=float(
                (heel[self._between(release_s, end_s), 2]).max(initial=-np.inf) - self._level(side, HEEL, stance)
            ),
            angles={joint: np.interp(cycle, self.seconds, self.flexions[f"{joint}_{side}"]) for joint in JOINTS},
        )

    def _at(self, values: Array, at_s: float) -> Array:
        return np.array([np.interp(at_s, self.seconds, column) for column in values.T])

    def _between(self, first_s: float, last_s: float) -> NDArray[np.bool_]:
        inside: NDArray[np.bool_] = (self.seconds >= first_s) & (self.seconds <= last_s)
        return inside

    def _level(self, side: str, point: int, stance: tuple[float, float]) -> float:
        """Height [m] at which a point of the sole stands: the median of the middle of the stance."""
        quarter = (stance[1] - stance[0]) / 4.0
        inside = self._between(stance[0] + quarter, stance[1] - quarter)
        return float(np.median(self.soles[side][inside, point, 2])) if inside.any() else np.nan

    def _clearance(self, side: str, stance: tuple[float, float], end_s: float) -> float:
        quarter = (end_s - stance[1]) / 4.0
        inside = self._between(stance[1] + quarter, end_s - quarter)
        after = [of for of in self.stances[side] if of[0] >= end_s - 1e-6]
        levels = [self._level(side, BALL, of) for of in (stance, *after[:1])]
        if not inside.any():
            return np.nan
        return float(self.soles[side][inside, BALL, 2].min() - np.nanmean(levels))

    def _both(self, other: str, start_s: float, release_s: float) -> float:
        """For how long both feet stand in a stance [s]: until the other leaves the floor, and from when it is back."""
        releases, contacts = self.events[other].releases, self.events[other].contacts
        left = releases[(releases > start_s) & (releases < release_s)]
        back = contacts[(contacts > start_s) & (contacts < release_s)]
        if not (len(left) and len(back) and left[0] < back[-1]):
            return np.nan
        return float(left[0] - start_s + release_s - back[-1])


def _ahead(seconds: Array, world_T_pelvis: Array) -> Array:
    """Unit vectors (T, 3), level, in which the body goes; where it stands, those in which the pelvis faces."""
    step = float(np.median(np.diff(seconds)))
    size = max(1, round(_SMOOTH_S / step))
    way = uniform_filter1d(np.gradient(world_T_pelvis[:, :2, 3], seconds, axis=0), size, axis=0, mode="nearest")
    facing = world_T_pelvis[:, :2, 0]
    goes = np.linalg.norm(way, axis=1, keepdims=True) > _FASTEST_STILL
    level = np.where(goes, way, facing)
    level = level / np.maximum(np.linalg.norm(level, axis=1, keepdims=True), 1e-9)
    return np.column_stack([level, np.zeros(len(level))])


def _flexions(world_T_segment: Mapping[str, Array]) -> dict[str, Array]:
    """``hip_left`` -> (T,) angle [rad] in the sagittal plane."""
    found = {}
    for joint, kind in JOINTS.items():
        for side in SIDES:
            above = _PARENTS[kind] if _PARENTS[kind] == "pelvis" else f"{_PARENTS[kind]}_{side}"
            parent, child = (world_T_segment[s][:, :3, :3] for s in (above, f"{kind}_{side}"))
            found[f"{joint}_{side}"] = planes_of(f"{kind}_{side}", np.swapaxes(parent, 1, 2) @ child)[:, 0]
    return found


def _unbroken(seconds: Array, start_s: float, end_s: float, longest_step_s: float) -> bool:
    inside = (seconds >= start_s) & (seconds <= end_s)
    return bool(inside.sum() > 3 and np.diff(seconds[inside]).max() <= longest_step_s)


def solved_gait(solved: SolvedRecording) -> Gait | None:
    """How the body walks as it was solved; None where it does not."""
    soles = {foot.removeprefix("foot_"): sole_of(solved, foot, solved.world_T_link[foot]) for foot in feet_of(solved)}
    segments = {segment: solved.world_T_link[segment] for segment in solved.body_segments}
    return gait(solved.seconds(solved.stamps_ns), segments, soles, 1e-9 * solved.longest_step_ns)


def true_gait(solved: SolvedRecording, comparison: Comparison) -> Gait | None:
    """How it truly walks, by feet of the same size; None where it does not."""
    segments = dict(zip(comparison.segments, comparison.true_segments, strict=True))
    soles = {
        foot.removeprefix("foot_"): sole_of(solved, foot, segments[foot])
        for foot in feet_of(solved)
        if foot in segments
    }
    seconds = np.asarray(solved.seconds(comparison.stamps_ns))
    return gait(seconds, segments, soles, 1e-9 * solved.longest_step_ns)
