"""By how much clocks are off, from some seconds of a body that moves: the side problem of the solver.

A camera whose clock is ahead by a delay shows its segment where it was that much earlier: its pose is off by its twist
times the delay. Over a window of instants the delays are the only lasting unknowns; the body of each instant,
articulated without gaps (A eq. 3-5), is eliminated on its own, as in the refinement of a calibration. What is left are
the delays' normal equations, a matrix of as many rows as there are cameras.
"""

from collections.abc import Generator, Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.body.articulation import ArticulatedMotion, articulated, distance_weights, eliminate_instants
from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.geometry import inverse, log_se3
from bodycam_ros.timing.instant_sampler import CameraPath, nearest_rows

Array = NDArray[np.float64]

_ITERATIONS = 4
_SETTLED_S = 1e-5
"""A hundredth of what a window tells of a clock; the next step would be a tenth of that."""

_OUTLIER_SIGMAS = 4.0
_LEAST_INSTANTS = 5


@dataclass(frozen=True, eq=False)
class CameraTrack:
    """A camera's registered images in a window.

    Attributes:
        path: through their poses, by the clock as it is believed to be.
        covariances: (N, 6, 6) of the poses, floor included.
    """

    path: CameraPath
    covariances: Array


@dataclass(frozen=True, eq=False)
class ClockEvidence:
    """What a window says of the delays that are left.

    Attributes:
        cameras: (C) names.
        delays: (C) by how much the clocks are ahead of what was believed [s].
        information: (C, C) without the prior [1/s^2]; a shift of all clocks together changes nothing.
        seen: (C) instants at which the camera was known.
    """

    cameras: tuple[str, ...]
    delays: Array
    information: Array
    seen: NDArray[np.int64]


def clock_evidence(
    body: BodyModel,
    tracks: Mapping[str, CameraTrack],
    stamps_ns: NDArray[np.int64],
    max_gap_s: float,
    prior_information: Array,
    prior_delays: Array,
) -> Generator[None, None, ClockEvidence | None]:
    """Compare all cameras at some instants (A eq. 3-5, 8), a few milliseconds at a time.

    Args:
        body: which has been calibrated.
        tracks: camera -> its images, in the order of the prior.
        stamps_ns: (T) instants [ns].
        max_gap_s: between two images of a camera that are believed to have a path between them [s].
        prior_information: (C, C) on the delays [1/s^2].
        prior_delays: (C) what they are believed to be [s].

    Returns:
        None where too little is seen of the body.
    """
    cameras = tuple(tracks)
    poses, twists, information = _at_instants(tracks, stamps_ns, max_gap_s)
    # What stands beside the body says nothing of it, and it nothing of the clock of a camera there.
    information[:, [body.mounts[camera].segment in body.equipment_segments for camera in cameras]] = 0.0
    told: NDArray[np.bool_] = np.trace(information, axis1=2, axis2=3) > 0.0
    rows = np.flatnonzero(told.sum(axis=1) >= 2)
    if len(rows) < _LEAST_INSTANTS:
        return None
    poses, twists, information, told = poses[rows], twists[rows], information[rows], told[rows]
    motion = _follow(body, cameras, poses, twists, told)
    yield
    for _ in range(_ITERATIONS):
        errors = log_se3(inverse(poses) @ motion.world_T_camera())
        gradients = (information @ errors[..., None])[..., 0]
        squared = np.einsum("tci,tci->tc", gradients, errors)
        weights = distance_weights(squared, told, _OUTLIER_SIGMAS)
        eliminated = eliminate_instants(
            motion.moving_jacobians(),
            motion.delay_jacobians(),
            weights[..., None, None] * information,
            weights[..., None] * gradients,
        )
        hessian, gradient = eliminated.hessians.sum(axis=0), eliminated.gradients.sum(axis=0)
        step = -np.linalg.solve(
            hessian + prior_information, gradient + prior_information @ (motion.delays - prior_delays)
        )
        motion = motion.moved(eliminated.moving(step), _lasting(motion, step))
        yield
        if np.abs(step).max() < _SETTLED_S:
            break
    return ClockEvidence(cameras, motion.delays, 0.5 * (hessian + hessian.T), told.sum(axis=0))


def _at_instants(
    tracks: Mapping[str, CameraTrack], stamps_ns: NDArray[np.int64], max_gap_s: float
) -> tuple[Array, Array, Array]:
    """Poses (T, C, 4, 4), twists (T, C, 6) and information (T, C, 6, 6), which is zero where a camera is not known."""
    shape = len(stamps_ns), len(tracks)
    poses, twists = np.broadcast_to(np.eye(4), (*shape, 4, 4)).copy(), np.zeros((*shape, 6))
    information = np.zeros((*shape, 6, 6))
    for column, track in enumerate(tracks.values()):
        if not len(track.path.stamps_ns):
            continue
        rows = np.flatnonzero(track.path.inside(stamps_ns, 1e9 * max_gap_s))
        points = track.path.at(stamps_ns[rows])
        poses[rows, column], twists[rows, column] = points.poses, points.twists
        information[rows, column] = np.linalg.inv(track.covariances[points.nearest])
    return poses, twists, information


def _follow(
    body: BodyModel, cameras: tuple[str, ...], poses: Array, twists: Array, told: NDArray[np.bool_]
) -> ArticulatedMotion:
    """A body whose segments turn as their cameras do, its root where the cameras that hang on it nearest put it."""
    camera_R_segment = np.stack([body.mounts[camera].segment_T_camera[:3, :3].T for camera in cameras])
    world_R_carrier = poses[..., :3, :3] @ camera_R_segment
    index = body.segment_index
    rotations = np.broadcast_to(np.eye(3), (len(poses), len(body.segments), 3, 3)).copy()
    for segment in [body.root, *(joint.child for joint in body.tree_joints)]:
        row, joint = index[segment], body.joint_to_parent(segment)
        if joint is not None:
            rotations[:, row] = rotations[:, index[joint.parent]]
        columns = [c for c, camera in enumerate(cameras) if body.mounts[camera].segment == segment]
        if columns:
            rotations[:, row] = _filled(world_R_carrier[:, columns], told[:, columns], rotations[:, row])
    nobody = np.zeros(len(cameras), bool)
    motion = articulated(body, cameras, np.zeros((len(poses), 3)), rotations, twists, nobody)
    shifts = np.where(told[..., None], poses[..., :3, 3] - motion.world_T_camera()[..., :3, 3], np.nan)
    return replace(motion, root_positions=np.nanmedian(shifts, axis=1))


def _filled(rotations: Array, told: NDArray[np.bool_], otherwise: Array) -> Array:
    """(T, 3, 3) of the first camera (T, C, 3, 3) that tells; else as at the nearest instant that one does."""
    if not told.any():
        return otherwise
    first = rotations[np.arange(len(told)), np.argmax(told, axis=1)]
    known = np.flatnonzero(told.any(axis=1))
    nearest = known[np.argmin(np.abs(np.arange(len(told))[:, None] - known), axis=1)]
    filled: Array = first[nearest]
    return filled


def _lasting(motion: ArticulatedMotion, delays: Array) -> Array:
    lasting = np.zeros(motion.lasting_count)
    lasting[motion.delay_columns] = delays
    return lasting


_TOGETHER_NS = 500_000
"""Stamps of one trigger differ by less."""

_TOGETHER_SHARE = 0.015
"""Of the time between two images; clocks that are started by hand meet so closely once in thirty."""


@dataclass(frozen=True)
class SharedBeat:
    """What the stamps of the first second or more say.

    Attributes:
        together: cameras that share their stamps: most of them, or nobody.
        period_ns: time between two images of a camera; the median of all [ns].
        reference: the camera whose clock is the body's.
    """

    together: frozenset[str]
    period_ns: int
    reference: str


def shared_beat(
    stamps_ns: Mapping[str, NDArray[np.int64]], preferred: tuple[str, ...] = (), alone: bool = False
) -> SharedBeat:
    """Find the cameras that go together.

    Args:
        stamps_ns: camera -> its stamps, ascending; at least one of one camera [ns].
        preferred: cameras that should be the reference, the first that goes with the others.
        alone: whether there is only one camera at all, whose stamps are the instants.
    """
    heard = {camera: stamps for camera, stamps in stamps_ns.items() if len(stamps) > 1}
    if not heard:
        return SharedBeat(frozenset(stamps_ns) if alone else frozenset(), 0, next(iter(stamps_ns)))
    # Cameras that are triggered mostly have the very same stamps, and are compared with the others once.
    alike: dict[bytes, list[str]] = {}
    for camera in sorted(heard):
        alike.setdefault(heard[camera].tobytes(), []).append(camera)
    groups = [
        frozenset(
            camera for others in alike.values() if go_together(heard[others[0]], heard[own[0]]) for camera in others
        )
        for own in alike.values()
    ]
    largest = max(groups, key=len)
    together = largest if alone or 2 * len(largest) > max(2, len(heard)) else frozenset[str]()
    candidates = [camera for camera in (*preferred, *sorted(heard)) if camera in (together or heard)]
    periods = [float(np.median(np.diff(stamps))) for stamps in heard.values()]
    return SharedBeat(together, round(float(np.median(periods))), candidates[0])


def go_together(own_ns: NDArray[np.int64], other_ns: NDArray[np.int64]) -> bool:
    """Whether most stamps (N) of a camera are those (M) of another, where both were heard [ns]."""
    period_ns = float(np.median(np.diff(own_ns))) if len(own_ns) > 1 else np.inf
    near_ns = min(_TOGETHER_NS, _TOGETHER_SHARE * period_ns)
    inside = own_ns[(own_ns >= other_ns[0] - _TOGETHER_NS) & (own_ns <= other_ns[-1] + _TOGETHER_NS)]
    if not len(inside):
        return False
    return bool(np.median(np.abs(other_ns[nearest_rows(other_ns, inside)] - inside)) < near_ns)


_NEAR_NS = 5_000_000_000
"""Cameras that are further apart are not of one time; on a busy machine one may be heard seconds before another."""

_VOTES = 2
"""Images per camera that must come from elsewhere, more than from here, before time is there."""


class CommonTime:
    """Follows the stamps of all cameras.

    Attributes:
        latest_ns: the latest stamp of those that go together [ns]; None before the first.
        moves: how often most cameras went elsewhere.
        strangers: cameras that are elsewhere.
    """

    def __init__(self) -> None:
        self.latest_ns: int | None = None
        self.moves = 0
        self.strangers: set[str] = set()
        self._votes = 0

    def most_votes(self, cameras: int) -> int:
        """Images from elsewhere after which time is there."""
        return _VOTES * cameras

    def add(self, camera: str, stamp_ns: int, cameras: int) -> None:
        """Note an image of one of some cameras."""
        latest_ns = stamp_ns if self.latest_ns is None else self.latest_ns
        if abs(stamp_ns - latest_ns) <= _NEAR_NS:
            self.strangers.discard(camera)
            self._votes = max(0, self._votes - 1)
            self.latest_ns = max(stamp_ns, latest_ns)
            return
        self.strangers.add(camera)
        self._votes += 1
        if self._votes >= self.most_votes(cameras):
            self.latest_ns, self._votes = stamp_ns, 0
            self.moves += 1
            self.strangers.clear()
