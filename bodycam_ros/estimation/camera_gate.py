"""The chi-square gate of each camera against all others and the prediction.

The residual of a left-out camera, in units of its predicted covariance, follows in closed form from the fit with all of
them. While the largest exceeds the gate, that camera is rejected, and the rest is fitted anew. Where two cameras
are on a segment, the one that fits the body is kept. ``quality/judge.py`` judges a bag, which does not tell which were.
"""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.estimation.coordinates import LINEAR, STEPS, UNKNOWN, Coordinates
from bodycam_ros.estimation.factors.camera_poses import SegmentPoses
from bodycam_ros.estimation.state_solution import Prediction, solve_normal_equations

_GATE = 40.0  # squared sigmas of 6 degrees of freedom; chance exceeds them once in two million
_GROSS = np.repeat([0.06, 0.02], 3)  # [rad], [m] a smaller strap slip bends the body less than rejecting its camera
_ELSEWHERE_M = 1000.0  # from the prediction: such a pose is rejected before its turns, by this lever, outweigh all else
_UNEVEN = 0.25  # share of what joints moved a segment since the state before that may be missed: a foot lands


def gate_cameras(
    prediction: Prediction, cameras: SegmentPoses, unobserved: NDArray[np.bool_]
) -> tuple[NDArray[np.bool_], Coordinates]:
    """Which (N,) of N cameras are accepted, and the coordinates that fit these.

    Args:
        prediction: of the state that they measure, without them.
        cameras: their poses.
        unobserved: (K,) predicted coordinates that had no measurement: no reason to reject a camera.
    """
    predicted = at = prediction.at
    off_m = np.linalg.norm((cameras.world_T_segment - predicted.poses[cameras.segments])[:, :3, 3], axis=1)
    accepted = off_m < _ELSEWHERE_M
    # By joints alone: the root of a body that rides is fast, and predicted as well as at rest.
    moved = prediction.dt_s * (at.jacobians[cameras.segments, :, 6:] @ at.velocity[6:]).reshape(-1, 2, 3)
    missed = _UNEVEN * np.linalg.norm(moved, axis=2).repeat(3, axis=1)
    cameras = replace(cameras, covariances=cameras.covariances + (_GROSS**2 + missed**2)[:, :, None] * np.eye(6))
    prior = prediction.information
    if unobserved.any():
        covariance = np.linalg.inv(prior) + np.diag(UNKNOWN**2 * unobserved)
        prior = np.asarray(np.linalg.inv(covariance), np.float64)
    while accepted.any():
        kept, at = np.flatnonzero(accepted), predicted
        tested = cameras[kept]
        for _ in range(STEPS):
            A, b, r, J = tested.equations(at)
            step, C = solve_normal_equations(prior + A, b - prior @ predicted.step_to(at))
            at = at.moved(step)
            if np.abs(step).max() < LINEAR:
                break
        off, known = r - J @ step, J @ C @ np.swapaxes(J, 1, 2)
        squared = np.einsum("ni,ni->n", off, np.linalg.solve(tested.covariances - known, off[..., None])[..., 0])
        if squared.max() < _GATE:
            break
        accepted[kept[int(np.argmax(squared))]] = False
    else:
        at = predicted
    return accepted, at
