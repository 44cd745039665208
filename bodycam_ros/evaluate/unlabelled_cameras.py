"""Which camera each track of an optical system is, where no name and no time is shared (A section 5.1).

The system tracks the centres of the body cameras under names that mean nothing. The clock is found by the distances
between all centres, of which the system has the same quantiles in whatever order. Then both sets of tracks are aligned
by the iterative closest point algorithm (Besl and McKay 1992), whose points are whole tracks: each of theirs goes to
the nearest of ours, none to two (Kuhn 1955). As the paper's does, the scale begins with the distances between centres.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import linear_sum_assignment
from scipy.spatial import distance
from scipy.spatial.transform import Rotation

from bodycam_ros.camera.model import optical_frame
from bodycam_ros.errors import RecordingError
from bodycam_ros.evaluate.clock_search import Clock, find_clock
from bodycam_ros.formats.captured_motion import CapturedMotion
from bodycam_ros.formats.point_sites import PointSite
from bodycam_ros.geometry import Array, umeyama
from bodycam_ros.results.solved_recording import SolvedRecording

_QUANTILES = np.linspace(0.05, 0.95, 19)
_LEAST_TRACKS = 4  # of which distances and places say which is which
_FRAMES = 200  # that tracks are compared at
_TURNS = np.radians(np.arange(0.0, 360.0, 15.0))  # about the vertical, from which the algorithm begins
_LAID = (np.zeros(3), np.array([np.pi / 2, 0.0, 0.0]), np.array([-np.pi / 2, 0.0, 0.0]))
"""Rotation vectors of worlds with z up, and with y up or down."""
_STEPS = 30  # it has converged long before, or never does
_MOST_OFF = 0.15
"""Largest distance of a track from its camera, as a share of how far the cameras are apart: 0.03 where it is right."""
_LEAST_LEAD = 1.5
"""Least factor by which the next best match of names has to be worse."""


@dataclass(frozen=True)
class _Match:
    """A matching of tracks: rows of our cameras for theirs, and distances as shares of how far cameras are apart.

    Attributes:
        off: of all tracks, the mean.
        farthest: of the track that is farthest off, the mean over time.
    """

    cameras: tuple[int, ...]
    off: float
    farthest: float


def find_cameras(solved: SolvedRecording, captured: CapturedMotion) -> dict[str, PointSite]:
    """Name of each track of theirs -> the centre of the body camera that it is.

    Args:
        solved: our recording.
        captured: tracks of camera centres, in any unit and world.

    Raises:
        RecordingError: there are too few or too many tracks, or they fit no cameras clearly.
    """
    centres = {record.camera: poses[:, :3, 3] for record, poses in solved.solved_cameras()}
    names, cameras = list(captured.points), list(centres)
    if not _LEAST_TRACKS <= len(names) <= len(cameras):
        raise RecordingError(
            f"{captured.path}: has {len(names)} tracks, expected {_LEAST_TRACKS} to {len(cameras)}, the centres of the "
            "body's cameras and nothing else; leave out the other points, or name the cameras with --points"
        )
    seconds = solved.seconds(solved.stamps_ns)
    clock = _shared_clock(seconds, np.stack([*centres.values()], axis=1), captured)
    if clock is None:
        raise RecordingError(
            f"{captured.path}: the distances between its tracks change like those of the body's cameras at no clock "
            "offset; check that it is of this recording, and that it has the centres of all of its cameras"
        )
    theirs = np.stack([captured.points_at(name, clock.theirs(seconds)) for name in names], axis=1)
    whole = np.flatnonzero(np.isfinite(theirs).all(axis=(1, 2)))
    rows = whole[:: max(1, len(whole) // _FRAMES)]
    if not len(rows):
        raise RecordingError(f"{captured.path}: never has all of its tracks at once while {solved.path} is solved")
    best, *others = _closest_tracks(np.stack([each[rows] for each in centres.values()], axis=1), theirs[rows])
    if best.farthest > _MOST_OFF:
        raise RecordingError(
            f"{captured.path}: one of its tracks is {best.farthest:.0%} of the cameras' distances off its camera where "
            f"they fit best, expected {_MOST_OFF:.0%} or less; check that it is of this recording, and that it has the "
            "centres of cameras and nothing else"
        )
    if others and others[0].off < _LEAST_LEAD * best.off:
        raise RecordingError(
            f"{captured.path}: its tracks fit the cameras in two ways, {best.off:.1%} and {others[0].off:.1%} of their "
            "distances off; name some of them with --points"
        )
    return {name: PointSite(optical_frame(cameras[row])) for name, row in zip(names, best.cameras, strict=True)}


def _shared_clock(seconds: Array, ours: Array, captured: CapturedMotion) -> Clock | None:
    """The clock at which quantiles of all distances change alike, whatever the names."""
    at = np.clip(np.searchsorted(seconds, np.arange(seconds[0], seconds[-1], 0.01)), 0, len(seconds) - 1)
    grid, ours_grid = seconds[at], _quantiles(ours[at])

    def our_signals(times: Array) -> Array:
        return np.array([np.interp(times, grid, each) for each in ours_grid])

    def their_signals(times: Array) -> Array:
        return _quantiles(np.stack([captured.points_at(name, times) for name in captured.points], axis=1))

    return find_clock(our_signals, (float(seconds[0]), float(seconds[-1])), their_signals, captured.duration_s)


def _quantiles(points: Array) -> Array:
    """(Q, T) quantiles of the distances between points (T, N, 3); NaN where one is missing."""
    return np.quantile(_distances(points), _QUANTILES, axis=1)


def _distances(points: Array) -> Array:
    """(T, P) distances between all pairs of points (T, N, 3)."""
    first, second = np.triu_indices(points.shape[1], 1)
    apart: Array = np.linalg.norm(points[:, first] - points[:, second], axis=2)
    return apart


def _closest_tracks(ours: Array, theirs: Array) -> list[_Match]:
    """Different matches of tracks (T, C, 3) and (T, N, 3) that the algorithm ends in, the best first."""
    size = float(np.median(_distances(theirs)))
    scale = size / float(np.median(_distances(ours)))
    found: dict[tuple[int, ...], _Match] = {}
    for laid in _LAID:
        for turn in _TURNS:
            start = Rotation.from_rotvec(laid) * Rotation.from_rotvec([0.0, 0.0, turn])
            match = _iterate(ours, theirs, scale, size, start.as_matrix())
            found[match.cameras] = min(match, found.get(match.cameras, match), key=lambda each: each.off)
    return sorted(found.values(), key=lambda match: match.off)


def _iterate(ours: Array, theirs: Array, scale: float, size: float, R: Array) -> _Match:
    """The iterative closest point algorithm from one start, by how far the cameras are apart in the unit of theirs."""
    t = theirs.mean(axis=(0, 1)) - scale * R @ ours.mean(axis=(0, 1))
    cameras: NDArray[np.intp] | None = None
    for _ in range(_STEPS):
        moved = np.moveaxis(scale * ours @ R.T + t, 1, 0).reshape(ours.shape[1], -1)
        tracks = np.moveaxis(theirs, 1, 0).reshape(theirs.shape[1], -1)
        _, closest = linear_sum_assignment(distance.cdist(tracks, moved, "sqeuclidean"))
        if cameras is not None and np.array_equal(closest, cameras):
            break
        cameras = closest
        scale, R, t = umeyama(ours[:, cameras].reshape(-1, 3), theirs.reshape(-1, 3), with_scale=True)
    assert cameras is not None
    off = np.linalg.norm(scale * ours[:, cameras] @ R.T + t - theirs, axis=2) / size
    return _Match(tuple(cameras.tolist()), float(off.mean()), float(off.mean(axis=0).max()))
