"""Alignment of a solved body with another system's motion, in space and in time."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.camera.model import OPTICAL_SUFFIX
from bodycam_ros.errors import RecordingError
from bodycam_ros.evaluate.clock_search import Clock, Signals, find_clock, fit_clock, rate_clock
from bodycam_ros.formats.captured_motion import CapturedMotion
from bodycam_ros.formats.point_sites import PointSite
from bodycam_ros.geometry import Array, inverse, transform_points, umeyama

_MIN_EXACT = 3
"""Joint centres that are enough to align with; with fewer, markers are used too."""

_STEPS, _CONVERGED_M = 300, 1e-6  # of fitting worlds and places on the body in turn
_ROUNDS = 3  # of fitting the clock and the places of markers in turn
_SCAN_S, _SCAN_STEP_S, _SCAN_STEPS, _SCAN_FRAMES = 0.4, 0.02, 15, 120
_SMOOTH_S = 0.05  # of signals: speeds of noisy points are noise
_SPEED_S = 0.04  # over which speeds are computed
_MAX_PAIRS, _MIN_CHANGE_M = 30, 1e-3  # of points, by the standard deviation of their distance
_MAX_FRAMES = 1500  # that the clock is fitted to, spread over the recording
_MAX_CHANCE = 0.5  # of a clock that was found
_MAX_SHARED_CHANCE, _MIN_SHARED_LEAD = 0.02, -1.0  # of a shared clock


@dataclass(frozen=True, eq=False)
class BodyPoints:
    """Links of the body that points of another system lie on, over T frames.

    Attributes:
        captured: the other's motion.
        seconds: (T,) since the start of our recording [s].
        world_T_link: link -> (T, 4, 4) [m].
        places: name of theirs -> its place on the body.
    """

    captured: CapturedMotion
    seconds: Array
    world_T_link: Mapping[str, Array]
    places: Mapping[str, PointSite]

    def ours(self, offsets: Mapping[str, Array]) -> Array:
        """Positions (T, N, 3) [m] of all points by their offsets on the links."""
        links = [(self.world_T_link[place.link], offsets[name]) for name, place in self.places.items()]
        return np.stack([transform_points(poses, at[None])[:, 0] for poses, at in links], axis=1)

    def theirs(self, clock: Clock) -> Array:
        """Positions (T, N, 3) [m] of the same points in the other's world; NaN where unknown."""
        seconds = clock.theirs(self.seconds)
        return np.stack([self.captured.points_at(name, seconds) for name in self.places], axis=1)

    @property
    def origins(self) -> dict[str, Array]:
        """Name -> no offset (3,) on its link, where those of markers are not fitted yet."""
        return {name: np.zeros(3) for name in self.places}

    def at(self, rows: NDArray[np.bool_] | slice) -> "BodyPoints":
        """The same at some frames."""
        links = {link: poses[rows] for link, poses in self.world_T_link.items()}
        return replace(self, seconds=self.seconds[rows], world_T_link=links)

    def as_captured(self, offsets: Mapping[str, Array]) -> CapturedMotion:
        """Our points as a captured motion."""
        points = dict(zip(self.places, np.moveaxis(self.ours(offsets), 1, 0), strict=True))
        return CapturedMotion(self.captured.path, "ours", np.rint(1e9 * self.seconds).astype(np.int64), points)

    def fit_world(self, ours: Array, theirs: Array, with_scale: bool) -> tuple[float, Array, Array]:
        """Scale, rotation (3, 3) and translation (3,) [m] that bring points (T, N, 3) [m] closest to theirs.

        Raises:
            RecordingError: they share too little.
        """
        known = np.isfinite(theirs).all(axis=2)
        try:
            return umeyama(ours[known], theirs[known], with_scale)
        except ValueError as error:
            raise RecordingError(
                f"{self.captured.path} shares too little with this recording to be aligned: {', '.join(self.places)} "
                f"in {len(self.seconds)} states; several joints are needed, or one that does not move along one line"
            ) from error


def align_worlds(
    body: BodyPoints, theirs: Array, with_scale: bool = True, steps: int = _STEPS
) -> tuple[Array, float, dict[str, Array]]:
    """Align our world with theirs, theirs = scale * R ours + t, and fit the offsets of markers on the body.

    Args:
        body: our links.
        theirs: (T, N, 3) [m] of the points; NaN where unknown.
        with_scale: by a similarity (A section 5.1); else rigidly, and the scale is 1.
        steps: at most, of fitting in turn.

    Returns:
        Our points (T, N, 3) in their world [m], the scale, and name -> offset (3,) of the point on its link [m].

    Raises:
        RecordingError: the points share too little to be aligned.
    """
    exact = np.array([not place.is_fitted for place in body.places.values()])
    cameras = np.array([place.link.endswith(OPTICAL_SUFFIX) for place in body.places.values()])
    used = next((rows for rows in (exact & ~cameras, exact) if rows.sum() >= _MIN_EXACT), np.ones(len(exact), bool))
    offsets = body.origins
    for _ in range(steps):
        before = offsets
        scale, R, t = body.fit_world(body.ours(offsets)[:, used], theirs[:, used], with_scale)
        offsets = _fit_offsets(body, (theirs - t) @ R / scale, offsets)
        if max(float(np.abs(offsets[name] - before[name]).max()) for name in offsets) < _CONVERGED_M:
            break
    return scale * body.ours(offsets) @ R.T + t, scale, offsets


def _fit_offsets(body: BodyPoints, theirs_in_ours: Array, offsets: Mapping[str, Array]) -> dict[str, Array]:
    """Offsets with the median position of each marker in the axes of its link."""
    found = dict(offsets)
    for column, (name, place) in enumerate(body.places.items()):
        known = np.isfinite(theirs_in_ours[:, column, 0])
        if place.is_fitted and known.any():
            link_T_world = inverse(body.world_T_link[place.link][known])
            points = transform_points(link_T_world, theirs_in_ours[known, column][:, None])
            found[name] = np.median(points[:, 0], axis=0)
    return found


def _clock_points(body: BodyPoints) -> tuple[BodyPoints, bool]:
    """The joint centres, and True; all points, and False, where there are too few of them."""
    exact = {name: place for name, place in body.places.items() if not place.is_fitted}
    has_centres = len(exact) >= _MIN_EXACT
    return replace(body, places=exact if has_centres else body.places), has_centres


def find_motion_clock(body: BodyPoints) -> Clock:
    """Find start and rate of the other's clock by the motion.

    Space is aligned with a scale meanwhile, whatever the final alignment: a wrong scale would bend time. Markers follow
    their segments' origins roughly, so with markers alone offsets nearby are tried, too.

    Raises:
        RecordingError: at no offset the two show the same motion.
    """
    used, has_centres = _clock_points(body)
    clock = find_clock(*_signals_of_both(used, has_centres))
    if clock is None or clock.chance > _MAX_CHANCE:
        how = "" if clock is None else f" better than by chance (probability {clock.chance:.0%})"
        raise RecordingError(
            f"{body.captured.path}: its motion fits this recording at no clock offset{how} (points: "
            f"{', '.join(used.places)}). Check that it is of this recording, and correct the names of points with "
            "--points POINTS.yaml; --clock shared uses its stamps unchanged"
        )
    if not has_centres:
        clock = _scan_clock(used.at(_thinned(used, _SCAN_FRAMES)), clock)
    for _ in range(1 if has_centres else _ROUNDS):
        clock = fit_clock(clock, _clock_residuals(used, clock))
    return clock


def _thinned(body: BodyPoints, count: int) -> slice:
    """At most so many frames, evenly spread."""
    return slice(None, None, -(-len(body.seconds) // count))


def _scan_clock(body: BodyPoints, around: Clock) -> Clock:
    """The clock near an estimate at which markers lie most constantly on their segments."""
    tried = []
    for shift in np.arange(-_SCAN_S, _SCAN_S + _SCAN_STEP_S, _SCAN_STEP_S).tolist():
        clock = replace(around, start_s=around.start_s + shift)
        theirs = body.theirs(clock)
        if np.isfinite(theirs).any():
            ours, scale, _ = align_worlds(body, theirs, steps=_SCAN_STEPS)
            tried.append((float(np.nanmean(np.linalg.norm(ours - theirs, axis=2))) / scale, clock))
    return min(tried, key=lambda pair: pair[0])[1]


def _clock_residuals(body: BodyPoints, clock: Clock) -> Callable[[Clock], Array]:
    """Clock -> distances (T, N, 3) [m] after alignment, of equally smooth motions, offsets fitted by a first clock."""
    rows = _thinned(body, _MAX_FRAMES)
    thinned = body.at(rows)
    *_, offsets = align_worlds(thinned, thinned.theirs(clock))
    motion = body.as_captured(offsets)
    sigma_s = _smoothing_s(motion, body.captured)
    motion, smooth = motion.smoothed(sigma_s), replace(thinned, captured=body.captured.smoothed(sigma_s))
    ours = np.stack([motion.points[name][rows] for name in body.places], axis=1)

    def residuals(clock: Clock) -> Array:
        theirs = np.where(np.isfinite(ours), smooth.theirs(clock), np.nan)
        known = np.isfinite(theirs).all(axis=2, keepdims=True)
        scale, R, t = thinned.fit_world(ours, theirs, with_scale=True)
        return np.where(known, scale * np.nan_to_num(ours) @ R.T + t - np.where(known, theirs, 0.0), 0.0)

    return residuals


def rate_shared_clock(body: BodyPoints, start_ns: int) -> Clock:
    """The clock of stamps that are of our clock, with the chance that the two show different motions.

    Args:
        body: our links.
        start_ns: start of our recording [ns].

    Raises:
        RecordingError: they agree no better than at other offsets in time.
    """
    (used, has_centres), captured = _clock_points(body), body.captured
    clock = Clock(1e-9 * float(captured.stamps_ns[0] - start_ns))
    if len(used.seconds) < 2 or len(captured.stamps_ns) < 2:
        return clock
    rated = rate_clock(clock, *_signals_of_both(used, has_centres))
    if rated.chance > _MAX_SHARED_CHANCE or rated.lead < _MIN_SHARED_LEAD:
        raise RecordingError(
            f"{captured.path}: its stamps do not fit this recording: the correlation of the motions is "
            f"{rated.likeness:.2f}, and at {rated.chance:.0%} of other clock offsets it is higher. Check that it is of "
            "the same recording, or let --clock found estimate the offset"
        )
    return rated


def _signals_of_both(body: BodyPoints, with_distances: bool) -> tuple[Signals, tuple[float, float], Signals, float]:
    """Arguments of ``find_clock``, by equally smooth motions."""
    ours, captured = body.as_captured(body.origins), body.captured
    sigma_s = max(_SMOOTH_S, _smoothing_s(ours, captured))
    ours = ours.smoothed(sigma_s)
    theirs = replace(captured, points={name: captured.points[name] for name in body.places}).smoothed(sigma_s)
    pairs = _changing_pairs(ours) if with_distances else []
    first_s, last_s = float(body.seconds[0]), float(body.seconds[-1])
    signals = _signals(ours, pairs)
    return (lambda s: signals(s - first_s)), (first_s, last_s), _signals(theirs, pairs), captured.duration_s


def _smoothing_s(ours: CapturedMotion, captured: CapturedMotion) -> float:
    """Width over which points are averaged [s]: a frame of the slower; narrower, noise shows where frames are."""
    return 1e-9 * max(ours.frame_ns, captured.frame_ns)


def _changing_pairs(ours: CapturedMotion) -> list[tuple[str, str]]:
    """Pairs of points whose distance changes most."""
    changes: dict[tuple[str, str], float] = {}
    for a, b in combinations(ours.points, 2):
        distances = np.linalg.norm(ours.points[a] - ours.points[b], axis=1)
        known = distances[np.isfinite(distances)]
        changes[a, b] = float(known.std()) if len(known) else 0.0
    return sorted((pair for pair in changes if changes[pair] > _MIN_CHANGE_M), key=lambda p: -changes[p])[:_MAX_PAIRS]


def _signals(motion: CapturedMotion, pairs: list[tuple[str, str]]) -> Signals:
    """Distances of pairs and speeds of points, by times since the motion's first frame."""

    def signals(seconds: Array) -> Array:
        here, before, after = (
            {name: motion.points_at(name, seconds + shift) for name in motion.points}
            for shift in (0.0, -_SPEED_S / 2.0, _SPEED_S / 2.0)
        )
        distances = [np.linalg.norm(here[a] - here[b], axis=1) for a, b in pairs]
        return np.array([*distances, *(np.linalg.norm(after[name] - before[name], axis=1) for name in motion.points)])

    return signals
