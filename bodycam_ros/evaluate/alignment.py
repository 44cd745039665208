"""Our world brought to another system's, and its clock to ours, with the places of markers on the body."""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from bodycam_ros.body.urdf import CAMERA_SUFFIX
from bodycam_ros.errors import RecordingError
from bodycam_ros.evaluate.agreement import NONE, SIMILARITY
from bodycam_ros.evaluate.clock_search import Clock, Signals, fitted_clock, found_clock, rate_clock
from bodycam_ros.formats.captured_motion import CapturedMotion
from bodycam_ros.formats.point_sites import PointSite
from bodycam_ros.geometry import Array, inverse, transform_points, umeyama

_ENOUGH = 3
"""So many centres of joints that are known say where the other's world is; with fewer, markers help."""

_STEPS = 300  # at most, of the alternating fit of worlds and of places on the body
_CONVERGED_M = 1e-6
_ROUNDS = 3  # of fitting the clock and the places of markers in turn
_SCAN_S, _SCAN_STEP_S, _SCAN_STEPS, _FEW_INSTANTS = 0.4, 0.02, 15, 120
_SMOOTH_S = 0.05  # of what the clock is searched by: speeds of noisy points are noise
_MOST_PAIRS = 30
_STILL_M = 1e-3  # a distance that changes less tells no time
_MOST_INSTANTS = 1500
"""That the clock is fitted by, spread over the recording."""

_SPEED_S = 0.04
"""Speeds are taken over this time."""

_CHANCE_LEVEL = 0.5
"""Clocks that are found with a greater chance are none."""

_SHARED_CHANCE_LEVEL = 0.02
"""Motions that agree as well at a greater share of other offsets are not the same."""

_WORST_LEAD = -1.0  # of a shared clock over all other offsets, in their standard deviations


@dataclass(frozen=True, eq=False)
class Alignment:
    """theirs = scale * R ours + t.

    Attributes:
        scale: 1 unless it is a similarity.
        R: (3, 3).
        t: (3,) [m].
        at: name -> where on its link a point is (3,) [m].
    """

    scale: float
    R: Array
    t: Array
    at: Mapping[str, Array]


@dataclass(frozen=True, eq=False)
class Tracked:
    """Our links that points of another system are on, over T instants.

    Attributes:
        seconds: (T,) since the start of our recording [s].
        world_T_link: link -> (T, 4, 4) [m].
        places: name of theirs -> where it is on the body.
    """

    seconds: Array
    world_T_link: Mapping[str, Array]
    places: Mapping[str, PointSite]

    def ours(self, at: Mapping[str, Array]) -> Array:
        """Places (T, N, 3) [m] of all points on our body."""
        return np.stack([self._ours(name, at[name]) for name in self.places], axis=1)

    def _ours(self, name: str, at: Array) -> Array:
        return transform_points(self.world_T_link[self.places[name].link], at[None])[:, 0]

    def theirs(self, captured: CapturedMotion, clock: Clock) -> Array:
        """Places (T, N, 3) [m] of the same points in the other's world; NaN where they are not known."""
        seconds = clock.theirs(self.seconds)
        return np.stack([captured.points_at(name, seconds) for name in self.places], axis=1)

    @property
    def known_at(self) -> dict[str, Array]:
        """Name -> where on its link it is, the link's origin of those that are to be fitted."""
        return {name: np.zeros(3) if place.at is None else place.at for name, place in self.places.items()}

    def every(self, step: int) -> "Tracked":
        """The same at each so-manieth instant."""
        some = {link: poses[::step] for link, poses in self.world_T_link.items()}
        return Tracked(self.seconds[::step], some, self.places)

    def only(self, places: Mapping[str, PointSite]) -> "Tracked":
        """The same with some of the points."""
        return replace(self, places=places)


def aligned(
    tracked: Tracked, theirs: Array, align: str, with_scale: bool | None = None, steps: int = _STEPS
) -> Alignment:
    """Bring our world to theirs, and find where on the body the points are that nobody measured.

    Args:
        tracked: our links.
        theirs: (T, N, 3) [m] of the points; NaN where they are not known.
        align: one of ``ALIGNMENTS``.
        with_scale: find the scale; by default if it is a similarity.
        steps: at most, of fitting in turn.

    Raises:
        ValueError: the points share too little to be aligned.
    """
    with_scale = align == SIMILARITY if with_scale is None else with_scale
    places = list(tracked.places.values())
    exact = np.array([not place.is_fitted for place in places])
    cameras = np.array([place.link.endswith(CAMERA_SUFFIX) for place in places])
    trusted = exact & ~cameras if (exact & ~cameras).sum() >= _ENOUGH else exact
    anchored = trusted if trusted.sum() >= _ENOUGH else np.ones(len(places), bool)
    at = tracked.known_at
    scale, R, t = 1.0, np.eye(3), np.zeros(3)
    for _ in range(steps):
        before = at
        if align != NONE:
            scale, R, t = _umeyama(tracked.ours(at)[:, anchored], theirs[:, anchored], with_scale)
        at = _places_fitted(tracked, (theirs - t) @ R / scale, at)
        if max(float(np.abs(at[name] - before[name]).max()) for name in at) < _CONVERGED_M or align == NONE:
            break
    return Alignment(scale, R, t, at)


def _umeyama(ours: Array, theirs: Array, with_scale: bool) -> tuple[float, Array, Array]:
    known = np.isfinite(theirs).all(axis=2)
    return umeyama(ours[known], theirs[known], with_scale)


def _places_fitted(tracked: Tracked, theirs_in_ours: Array, at: Mapping[str, Array]) -> dict[str, Array]:
    """The median place of each marker in the axes of its link, of those to be fitted."""
    found = dict(at)
    for column, (name, place) in enumerate(tracked.places.items()):
        seen = np.isfinite(theirs_in_ours[:, column, 0])
        if place.is_fitted and seen.any():
            link_T_world = inverse(tracked.world_T_link[place.link][seen])
            found[name] = np.median(transform_points(link_T_world, theirs_in_ours[seen, column][:, None])[:, 0], axis=0)
    return found


def clock_of(tracked: Tracked, captured: CapturedMotion) -> Clock:
    """Find when the other's recording began and how fast its clock goes.

    Space is aligned with a scale meanwhile, however it will be aligned: else a wrong scale would bend time. Markers
    move only about as their segments do, so where there are no more than these, times around are tried.

    Args:
        tracked: our links.
        captured: the other's motion.

    Raises:
        RecordingError: at no offset the two show the same motion.
    """
    exact = {name: place for name, place in tracked.places.items() if not place.is_fitted}
    used = tracked.only(exact if len(exact) >= _ENOUGH else tracked.places)
    some = used.every(-(-len(tracked.seconds) // _MOST_INSTANTS))
    has_centres = len(exact) >= _ENOUGH
    clock = _searched(used, captured, with_distances=has_centres)
    try:
        if not has_centres:
            clock = _scanned(used.every(-(-len(tracked.seconds) // _FEW_INSTANTS)), captured, clock)
        for _ in range(1 if has_centres else _ROUNDS):
            clock = _fitted(used, some, captured, clock)
    except ValueError as error:
        raise too_little(captured, some) from error
    return clock


def _scanned(few: Tracked, captured: CapturedMotion, around: Clock) -> Clock:
    """The clock near one that was found by which points can be held best, wherever on their segments they are."""
    tried = []
    for shift in np.arange(-_SCAN_S, _SCAN_S + _SCAN_STEP_S, _SCAN_STEP_S).tolist():
        clock = replace(around, start_s=around.start_s + shift)
        theirs = few.theirs(captured, clock)
        if np.isfinite(theirs).any():
            world = aligned(few, theirs, SIMILARITY, steps=_SCAN_STEPS)
            off = world.scale * few.ours(world.at) @ world.R.T + world.t - theirs
            tried.append((float(np.nanmean(np.linalg.norm(off, axis=2))) / world.scale, clock))
    return min(tried, key=lambda of: of[0])[1]


def _fitted(used: Tracked, some: Tracked, captured: CapturedMotion, clock: Clock) -> Clock:
    """Offset and rate, with points held where the clock so far has them, by motions that are equally smooth."""
    ours = _as_captured(used, captured, aligned(some, some.theirs(captured, clock), SIMILARITY).at)
    sigma_s = _bell_s(ours, captured)
    ours, theirs_smooth = ours.smoothed(sigma_s), captured.smoothed(sigma_s)
    step = -(-len(used.seconds) // _MOST_INSTANTS)
    here = np.stack([ours.points[name][::step] for name in used.places], axis=1)

    def residuals(clock: Clock) -> Array:
        theirs = np.where(np.isfinite(here), some.theirs(theirs_smooth, clock), np.nan)
        known = np.isfinite(theirs).all(axis=2, keepdims=True)
        scale, R, t = _umeyama(here, theirs, with_scale=True)
        return np.where(known, scale * np.nan_to_num(here) @ R.T + t - np.where(known, theirs, 0.0), 0.0)

    return fitted_clock(clock, residuals)


def _searched(used: Tracked, captured: CapturedMotion, with_distances: bool) -> Clock:
    """The clock by which points move most alike, markers as their segments' origins do."""
    found = found_clock(*_both_signals(used, captured, with_distances))
    if found is None or found.chance > _CHANCE_LEVEL:
        how = "" if found is None else f" better than by chance (probability {found.chance:.0%})"
        raise RecordingError(
            f"{captured.path}: at no offset in time it shows the motion of this recording{how} (of points "
            f"{', '.join(used.places)}); is it another recording, or are names mistaken? --points POINTS.yaml says "
            "which point is which, --clock shared that stamps are of one clock"
        )
    return found


def rate_shared_clock(tracked: Tracked, captured: CapturedMotion, clock: Clock) -> Clock:
    """A shared clock with how sure it is that the two show one motion.

    Raises:
        RecordingError: they agree no better than at other offsets in time.
    """
    exact = {name: place for name, place in tracked.places.items() if not place.is_fitted}
    used = tracked.only(exact if len(exact) >= _ENOUGH else tracked.places)
    if len(used.seconds) < 2 or len(captured.stamps_ns) < 2:
        return clock
    rated = rate_clock(clock, *_both_signals(used, captured, with_distances=len(exact) >= _ENOUGH))
    if rated.chance > _SHARED_CHANCE_LEVEL or rated.lead < _WORST_LEAD:
        raise RecordingError(
            f"{captured.path}: is not of the same motion by this clock: motions correlate by {rated.likeness:.2f}, and "
            f"at {rated.chance:.0%} of other offsets in time they do better; is it of another recording? --clock "
            "found searches for the offset"
        )
    return rated


def _both_signals(
    used: Tracked, captured: CapturedMotion, with_distances: bool
) -> tuple[Signals, tuple[float, float], Signals, float]:
    """Our signals and their span, the other's and its duration [s], by motions that are equally smooth."""
    ours = _as_captured(used, captured, used.known_at)
    sigma_s = max(_SMOOTH_S, _bell_s(ours, captured))
    ours = ours.smoothed(sigma_s)
    theirs = replace(captured, points={name: captured.points[name] for name in used.places}).smoothed(sigma_s)
    pairs = _pairs(ours) if with_distances else []
    first_s, last_s = float(used.seconds[0]), float(used.seconds[-1])
    here = _signals(ours, pairs)
    return lambda seconds: here(seconds - first_s), (first_s, last_s), _signals(theirs, pairs), captured.duration_s


def _bell_s(ours: CapturedMotion, captured: CapturedMotion) -> float:
    """Over which points are averaged [s]: a frame of the slower, narrower ones know where frames are."""
    return 1e-9 * max(ours.frame_ns, captured.frame_ns)


def _as_captured(used: Tracked, captured: CapturedMotion, at: Mapping[str, Array]) -> CapturedMotion:
    """Our points at places on the body, as another system would have them."""
    stamps_ns = np.rint(1e9 * used.seconds).astype(np.int64)
    points = dict(zip(used.places, np.moveaxis(used.ours(at), 1, 0), strict=True))
    return CapturedMotion(captured.path, "ours", stamps_ns, points)


def too_little(captured: CapturedMotion, tracked: Tracked) -> RecordingError:
    """What is to be said where worlds cannot be aligned."""
    return RecordingError(
        f"{captured.path} shares too little with this recording to be aligned: {', '.join(tracked.places)}, "
        f"{len(tracked.seconds)} instants; several joints, or one that goes more ways than straight on, are needed"
    )


def _pairs(ours: CapturedMotion) -> list[tuple[str, str]]:
    """Pairs of points whose distance changes most."""
    names = list(ours.points)
    changes = {
        (a, b): float(np.nanstd(np.linalg.norm(ours.points[a] - ours.points[b], axis=1)))
        for i, a in enumerate(names)
        for b in names[i + 1 :]
    }
    return sorted((pair for pair in changes if changes[pair] > _STILL_M), key=lambda pair: -changes[pair])[:_MOST_PAIRS]


def _signals(motion: CapturedMotion, pairs: list[tuple[str, str]]) -> Signals:
    """What no frame of reference changes, by times since the motion's first frame."""

    def signals(seconds: Array) -> Array:
        here, before, after = (
            {name: motion.points_at(name, seconds + shift) for name in motion.points}
            for shift in (0.0, -_SPEED_S / 2.0, _SPEED_S / 2.0)
        )
        distances = [np.linalg.norm(here[a] - here[b], axis=1) for a, b in pairs]
        speeds = [np.linalg.norm(after[name] - before[name], axis=1) for name in motion.points]
        return np.array([*distances, *speeds])

    return signals
