"""Clock offsets from some seconds of a moving body: the side problem of the solver.

A camera whose clock is ahead by a delay shows its segment where it was that much earlier: its pose is off by its twist
times the delay. Over a window of stamps the delays are the only lasting unknowns; the state of the body at each stamp,
articulated without gaps (A eq. 3-5), is eliminated on its own, as in the refinement of a calibration. What is left are
the delays' normal equations, with as many rows as there are cameras.
"""

from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass

import numpy as np

from bodycam_ros.body.articulation import distance_weights, eliminate_states, motion_of_cameras
from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.geometry import Array, inverse, log_se3
from bodycam_ros.registration.landmark_matches import LandmarkMatches
from bodycam_ros.timing.camera_path import path_points

MAX_GAP_S = 0.12
"""Longest time between two images of a camera over which its pose is interpolated: beyond, limbs may do anything."""

MARGIN_NS = 300_000_000
"""Images beyond the ends of a window, for the paths at its ends and for clocks that are off."""

_CORRELATED = 6.0  # neighbouring states of a window that share their errors, because tracks keep theirs
_RATE = 10.0  # [Hz] states of a window at which cameras are compared
_OUTLIER_SIGMAS = 4.0
_LEAST_STAMPS = 5


@dataclass(frozen=True, eq=False)
class ClockEvidence:
    """What a window shows of C clocks, linearised at offsets of these.

    Attributes:
        hessian: (C, C) by the clocks' delays [1/s^2].
        gradient: (C) [1/s].
        distances: (C) each camera's median distance from where the body has it, in its own sigmas; 0 without images.
    """

    hessian: Array
    gradient: Array
    distances: Array


def clock_evidence(
    body: BodyModel,
    images: Mapping[str, Iterable[LandmarkMatches]],
    offsets: Mapping[str, float],
    left_out: Collection[str] = (),
    *,
    floor: Array,
    window_ns: tuple[int, int],
) -> ClockEvidence | None:
    """Compare all cameras at the states of a window (A eq. 3-5, 8), linearised at predicted offsets of their clocks.

    Args:
        body: calibrated.
        images: camera -> its images, in order of time, some beyond both ends.
        offsets: C cameras -> predicted clock offset [s].
        left_out: cameras whose images are not used.
        floor: (6, 6) covariance that is added to every registration's.
        window_ns: its two ends [ns].

    Returns:
        By the delays beyond the prediction; a shift of all clocks together changes nothing. None where too few cameras
        are registered.
    """
    stamps_ns, cameras = np.arange(*window_ns, round(1e9 / _RATE), dtype=np.int64), tuple(offsets)
    shape = len(stamps_ns), len(cameras)
    poses, twists = np.tile(np.eye(4), (*shape, 1, 1)), np.zeros((*shape, 6))
    information, known = np.zeros((*shape, 6, 6)), np.zeros(shape, bool)
    for column, (camera, offset) in enumerate(offsets.items()):
        ahead_ns = round(1e9 * offset)
        near = [
            (image.stamp_ns - ahead_ns, image.world_T_camera, image.pose_covariance + floor)
            for image in images[camera]
            if image.world_T_camera is not None
            and window_ns[0] - MARGIN_NS <= image.stamp_ns - ahead_ns <= window_ns[1] + MARGIN_NS
        ]
        # Equipment moves by itself: it carries no information on the body, nor the body on a camera there.
        if not near or camera in left_out or body.mounts[camera].segment in body.equipment_segments:
            continue
        own_ns, own_poses, covariances = map(np.array, zip(*near, strict=True))
        points = path_points(own_ns, own_poses, stamps_ns, MAX_GAP_S)
        poses[points.rows, column], twists[points.rows, column] = points.poses, points.twists
        known[points.rows, column] = True
        information[points.rows, column] = np.linalg.inv(covariances[points.nearest])
    rows = np.flatnonzero(known.sum(axis=1) >= 2)
    if len(rows) < _LEAST_STAMPS:
        return None
    poses = poses[rows]
    twists = twists[rows]
    information = information[rows]
    known = known[rows]
    motion = motion_of_cameras(body, cameras, poses, twists, known, np.zeros(len(cameras), bool))
    errors = log_se3(inverse(poses) @ motion.world_T_camera())
    gradients = (information @ errors[..., None])[..., 0]
    squared = np.einsum("tci,tci->tc", gradients, errors)
    weights = distance_weights(squared, known, _OUTLIER_SIGMAS) / _CORRELATED
    eliminated = eliminate_states(
        motion.moving_jacobians(),
        motion.delay_jacobians(),
        weights[..., None, None] * information,
        weights[..., None] * gradients,
    )
    hessian = eliminated.hessians.sum(axis=0)
    by_camera = zip(squared.T, known.T, strict=True)
    distances = np.sqrt([np.median(own[there]) if there.any() else 0.0 for own, there in by_camera])
    return ClockEvidence(0.5 * (hessian + hessian.T), eliminated.gradients.sum(axis=0), distances)
