"""Our world brought to another system's, and its clock to ours, with the places of markers on the body."""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from bodycam_ros.errors import RecordingError
from bodycam_ros.evaluate.agreement.agreement import NONE, SIMILARITY
from bodycam_ros.geometry import Array, inverse, transform_points, umeyama
from bodycam_ros.other_systems.captured_motion import CapturedMotion
from bodycam_ros.other_systems.clock_search import Clock, Signals, fitted_clock, found_clock
from bodycam_ros.other_systems.known_names import Place

_ENOUGH = 3
"""So many centres of joints that are known say where the other's world is; with fewer, markers help."""

_STEPS = 60  # of the alternating fit of worlds and of places on the body
_CONVERGED_M = 1e-5
_MOST_PAIRS = 30
_MOST_INSTANTS = 1500
"""That the clock is fitted by, spread over the recording."""

_SPEED_S = 0.04
"""Speeds are taken over this time."""


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
    places: Mapping[str, Place]

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

    def only(self, places: Mapping[str, Place]) -> "Tracked":
        """The same with some of the points."""
        return replace(self, places=places)


def aligned(tracked: Tracked, theirs: Array, align: str, with_scale: bool | None = None) -> Alignment:
    """Bring our world to theirs, and find where on the body the points are that nobody measured.

    Args:
        tracked: our links.
        theirs: (T, N, 3) [m] of the points; NaN where they are not known.
        align: one of ``ALIGNMENTS``.
        with_scale: find the scale; by default if it is a similarity.

    Raises:
        ValueError: the points share too little to be aligned.
    """
    with_scale = align == SIMILARITY if with_scale is None else with_scale
    places = list(tracked.places.values())
    exact = np.array([not place.is_fitted for place in places])
    cameras = np.array([place.link.endswith("_optical_frame") for place in places])
    trusted = exact & ~cameras if (exact & ~cameras).sum() >= _ENOUGH else exact
    anchored = trusted if trusted.sum() >= _ENOUGH else np.ones(len(places), bool)
    at = tracked.known_at
    scale, R, t = 1.0, np.eye(3), np.zeros(3)
    for _ in range(_STEPS):
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


def clock_of(tracked: Tracked, captured: CapturedMotion, ours: CapturedMotion) -> Clock:
    """Find when the other's recording began and how fast its clock goes.

    Space is aligned with a scale meanwhile, however it will be aligned: else a wrong scale would bend time.

    Args:
        tracked: our links.
        captured: the other's motion.
        ours: ours as such a motion, with the same names, by times since the start of our recording.

    Raises:
        RecordingError: at no offset the two show the same motion.
    """
    span = (float(tracked.seconds[0]), float(tracked.seconds[-1]))
    pairs = _pairs(ours, list(tracked.places))
    first_s = ours.seconds(ours.stamps_ns)[0] - tracked.seconds[0]
    found = found_clock(
        lambda seconds: _signals(ours, pairs)(seconds + first_s), span, _signals(captured, pairs), captured.duration_s
    )
    if found is None:
        raise RecordingError(
            f"{captured.path}: at no offset in time it shows the motion of this recording (of points "
            f"{', '.join(tracked.places)}); is it another recording, or are names mistaken? --names MAP.yaml says "
            "which point is which, --clock shared that stamps are of one clock"
        )
    some = tracked.every(-(-len(tracked.seconds) // _MOST_INSTANTS))
    exact = {name: place for name, place in tracked.places.items() if not place.is_fitted}
    some = some.only(exact if len(exact) >= _ENOUGH else tracked.places)
    try:
        at = aligned(some, some.theirs(captured, found), SIMILARITY).at
    except ValueError as error:
        raise too_little(captured, some) from error
    fixed = some.only({name: Place(place.link, at[name]) for name, place in some.places.items()})
    here = fixed.ours(at)

    def residuals(clock: Clock) -> Array:
        theirs = fixed.theirs(captured, clock)
        known = np.isfinite(theirs).all(axis=2, keepdims=True)
        scale, R, t = _umeyama(here, theirs, with_scale=True)
        return np.where(known, scale * here @ R.T + t - np.where(known, theirs, 0.0), 0.0)

    return fitted_clock(found, residuals)


def too_little(captured: CapturedMotion, tracked: Tracked) -> RecordingError:
    """What is to be said where worlds cannot be aligned."""
    return RecordingError(
        f"{captured.path} shares too little with this recording to be aligned: {', '.join(tracked.places)}, "
        f"{len(tracked.seconds)} instants; several joints, or one that goes more ways than straight on, are needed"
    )


def _pairs(ours: CapturedMotion, names: list[str]) -> list[tuple[str, str]]:
    """Pairs of points whose distance changes most."""
    changes = {
        (a, b): float(np.nanstd(np.linalg.norm(ours.points[a] - ours.points[b], axis=1)))
        for i, a in enumerate(names)
        for b in names[i + 1 :]
    }
    return sorted((pair for pair in changes if changes[pair] > 1e-3), key=lambda pair: -changes[pair])[:_MOST_PAIRS]


def _signals(motion: CapturedMotion, pairs: list[tuple[str, str]]) -> Signals:
    """What no frame of reference changes, by times since the motion's first frame."""
    names = sorted({name for pair in pairs for name in pair}) or [*motion.points]

    def signals(seconds: Array) -> Array:
        here = {name: motion.points_at(name, seconds) for name in names}
        distances = [np.linalg.norm(here[a] - here[b], axis=1) for a, b in pairs]
        speeds = [
            np.linalg.norm(
                motion.points_at(name, seconds + _SPEED_S / 2) - motion.points_at(name, seconds - _SPEED_S / 2), axis=1
            )
            for name in names
        ]
        return np.array([*distances, *speeds])

    return signals
