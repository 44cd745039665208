"""Clock offsets from some seconds of a moving body: the side problem of the solver.

A camera whose clock is ahead by a delay shows its segment where it was that much earlier: its pose is off by its twist
times the delay. Over a window of stamps the delays are the only lasting unknowns; the state of the body at each stamp,
articulated without gaps (A eq. 3-5), is eliminated on its own, as in the refinement of a calibration. What is left are
the delays' normal equations, with as many rows as there are cameras.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.body.articulation import distance_weights, eliminate_instants, motion_of_cameras
from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.geometry import Array, inverse, log_se3
from bodycam_ros.registration.landmark_matches import LandmarkMatches
from bodycam_ros.timing.camera_path import CameraPath

MAX_GAP_S = 0.12
"""Longest time between two images of a camera over which its pose is interpolated: beyond, limbs may do anything."""

MARGIN_NS = 300_000_000
"""Images beyond the ends of a window, for the paths at its ends and for clocks that are off."""

CORRELATED = 6.0
"""Neighbouring states of a window that share their errors, because tracks keep theirs."""

_RATE = 10.0  # [Hz] states of a window at which cameras are compared
_SETTLED_S = 0.001  # shifts below this need no further turn of a window
_MOST_TURNS = 6  # of a window with clocks that moved; each leaves a fifth of the error
_OUTLIER_SIGMAS = 4.0
_LEAST_STAMPS = 5


@dataclass(frozen=True, eq=False)
class CameraTrack:
    """A camera's registered images in a window.

    Attributes:
        path: through their poses, by the predicted clock.
        covariances: (N, 6, 6) of the poses, floor included.
    """

    path: CameraPath
    covariances: Array


@dataclass(frozen=True, eq=False)
class ClockEvidence:
    """Measurement of the remaining delays in one window.

    Attributes:
        delays: (C) by how much the clocks are ahead of the prediction, the prior included [s].
        information: (C, C) without the prior [1/s^2]; a shift of all clocks together changes nothing.
    """

    delays: Array
    information: Array


def window_evidence(
    body: BodyModel,
    images: Mapping[str, Sequence[LandmarkMatches]],
    offsets: Mapping[str, float],
    prior_information: Array,
    floor: Array,
    window_ns: tuple[int, int],
) -> ClockEvidence | None:
    """The evidence of a window of images beyond the prediction; it is repeated for clocks that are far off.

    Args:
        body: calibrated.
        images: camera -> its images, in order of time, some beyond both ends.
        offsets: camera -> predicted clock offset [s], in the order of the prior.
        prior_information: (C, C) on the offsets [1/s^2].
        floor: (6, 6) covariance that is added to every registration's.
        window_ns: its two ends [ns].
    """
    evidence = None
    shifts = np.zeros(len(offsets))
    stamps_ns = np.arange(*window_ns, round(1e9 / _RATE), dtype=np.int64)
    for _ in range(_MOST_TURNS):
        tracks = {
            camera: _track(images[camera], round(1e9 * (offset + shift)), floor, window_ns)
            for (camera, offset), shift in zip(offsets.items(), shifts.tolist(), strict=True)
        }
        found = clock_evidence(body, tracks, stamps_ns, prior_information, -shifts)
        if found is None:
            return None
        evidence = replace(found, delays=found.delays + shifts)
        if np.abs(found.delays).max() < _SETTLED_S:
            break
        shifts = evidence.delays
    return evidence


def _track(images: Sequence[LandmarkMatches], ahead_ns: int, floor: Array, window_ns: tuple[int, int]) -> CameraTrack:
    """The registered images in and near a window, by a clock that is ahead by some time [ns]."""
    near = [
        (image.stamp_ns - ahead_ns, image.world_T_camera, image.pose_covariance)
        for image in images
        if image.world_T_camera is not None
        and window_ns[0] - MARGIN_NS <= image.stamp_ns - ahead_ns <= window_ns[1] + MARGIN_NS
    ]
    stamps_ns, poses, covariances = zip(*near, strict=True) if near else ((), (), ())
    path = CameraPath(np.array(stamps_ns, np.int64), np.array(poses).reshape(-1, 4, 4))
    return CameraTrack(path, np.array(covariances).reshape(-1, 6, 6) + floor)


def clock_evidence(
    body: BodyModel,
    tracks: Mapping[str, CameraTrack],
    stamps_ns: NDArray[np.int64],
    prior_information: Array,
    prior_delays: Array,
) -> ClockEvidence | None:
    """Compare all cameras at some stamps (A eq. 3-5, 8): one step of Gauss-Newton; ``window_evidence`` repeats it.

    Args:
        body: calibrated.
        tracks: camera -> its images, in the order of the prior.
        stamps_ns: (T) of the compared states [ns].
        prior_information: (C, C) on the delays [1/s^2].
        prior_delays: (C) their prior mean [s].

    Returns:
        None where too few cameras are registered.
    """
    cameras = tuple(tracks)
    poses, twists, information = _interpolate(tracks, stamps_ns)
    # Equipment moves by itself: it carries no information on the body, nor the body on a camera there.
    information[:, [body.mounts[camera].segment in body.equipment_segments for camera in cameras]] = 0.0
    known: NDArray[np.bool_] = np.trace(information, axis1=2, axis2=3) > 0.0
    rows = np.flatnonzero(known.sum(axis=1) >= 2)
    if len(rows) < _LEAST_STAMPS:
        return None
    poses, twists, information, known = poses[rows], twists[rows], information[rows], known[rows]
    motion = motion_of_cameras(body, cameras, poses, twists, known, np.zeros(len(cameras), bool))
    errors = log_se3(inverse(poses) @ motion.world_T_camera())
    gradients = (information @ errors[..., None])[..., 0]
    weights = distance_weights(np.einsum("tci,tci->tc", gradients, errors), known, _OUTLIER_SIGMAS)
    eliminated = eliminate_instants(
        motion.moving_jacobians(),
        motion.delay_jacobians(),
        weights[..., None, None] * information,
        weights[..., None] * gradients,
    )
    hessian, gradient = eliminated.hessians.sum(axis=0), eliminated.gradients.sum(axis=0)
    delays = np.linalg.solve(hessian + prior_information, prior_information @ prior_delays - gradient)
    return ClockEvidence(delays, 0.5 * (hessian + hessian.T))


def _interpolate(tracks: Mapping[str, CameraTrack], stamps_ns: NDArray[np.int64]) -> tuple[Array, Array, Array]:
    """Poses (T, C, 4, 4), twists (T, C, 6) and information (T, C, 6, 6), which is zero where a camera is unknown."""
    shape = len(stamps_ns), len(tracks)
    poses, twists = np.broadcast_to(np.eye(4), (*shape, 4, 4)).copy(), np.zeros((*shape, 6))
    information = np.zeros((*shape, 6, 6))
    for column, track in enumerate(tracks.values()):
        if not len(track.path.stamps_ns):
            continue
        rows = np.flatnonzero(track.path.covers(stamps_ns, MAX_GAP_S))
        points = track.path.interpolate(stamps_ns[rows])
        poses[rows, column], twists[rows, column] = points.poses, points.twists
        information[rows, column] = np.linalg.inv(track.covariances[points.nearest])
    return poses, twists, information
