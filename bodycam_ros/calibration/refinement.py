"""Bundle adjustment of a body over its range of motion: joints, mounts and poses against the image measurements.

Seed A stops at the SVD and a person's corrections. Here the reprojection errors of all landmarks (A eq. 8-9) decide,
under the articulation (A eq. 3-5). A camera enters as in the solver (``measurements``, DESIGN 4.2): as a pose with
its information, here linearised anew on its landmarks wherever an iteration puts it, floored and robust. The solver's
tight joints are exact here, and its smoothness is left out: the states then depend on each other through the body
alone, and each is eliminated on its own (Schur complement).
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.body.articulation import ArticulatedMotion, EliminatedStates, distance_weights, eliminate_states
from bodycam_ros.calibration.image_evidence import ImageEvidence
from bodycam_ros.geometry import Array
from bodycam_ros.timing.clock_state import TRIGGER_SIGMA_S, ClockSettings

MAX_ROWS = 300
"""Stamps of the recording that are used, evenly spread: neighbours share the errors of their tracks."""

STRAIGHT_SIGMA_M = 0.005
"""How straight a limb stands in the N-pose: it alone fixes a hinge's joint along its axis."""

_ITERATIONS = 4  # from the joint centres; a strap that slipped takes four, others three (bones change by 3 um)
_LANDMARK_SIGMA_M = 0.005  # of a landmark in the map, along each axis; a recording moves it by 4 mm in all (median)
_SIGMA_BLOCKS = 12  # stretches that are left out one by one for the covariance; each must outlast the tracks
_OUTLIER_SIGMAS = 4.0  # a camera this far from the body counts half (Cauchy), as in the solver
_FIXED = 1e12  # information on what is a matter of choice: each segment's axes, and the root's origin


@dataclass(frozen=True, eq=False)
class Refined:
    """A refined motion.

    Attributes:
        motion: the body and its motion.
        covariance: (K, K) of the lasting unknowns, see ``ArticulatedMotion.moved``.
    """

    motion: ArticulatedMotion
    covariance: Array


def refine(
    motion: ArticulatedMotion,
    images: ImageEvidence,
    hinges: Mapping[str, Array],
    clock: ClockSettings,
    on_progress: Callable[[float], None] = lambda share: None,
) -> Refined:
    """Refine a body and its motion.

    Args:
        motion: where to start.
        images: the landmarks that they show.
        hinges: child segment -> (3,) axis of the hinge that it hangs on, in N-pose axes.
        clock: how far clocks may be off.
        on_progress: called with the share that is done.
    """
    start = motion
    for iteration in range(_ITERATIONS):
        world_T_camera = motion.world_T_camera()
        images = images.with_landmarks_refined(world_T_camera, _LANDMARK_SIGMA_M)
        hessians, gradients = images.linearised(world_T_camera)
        weights = _cauchy(hessians, gradients)
        eliminated = eliminate_states(
            motion.moving_jacobians(),
            motion.lasting_jacobians(),
            weights[..., None, None] * hessians,
            weights[..., None] * gradients,
        )
        prior = _priors(motion, start, hinges, clock)
        lasting = _lasting_step(eliminated, prior, np.ones(len(world_T_camera), bool))
        motion = motion.moved(eliminated.moving(lasting), lasting)
        on_progress((iteration + 1) / _ITERATIONS)
    return Refined(motion, _jackknife_covariance(eliminated, prior))


def _lasting_step(of: EliminatedStates, prior: tuple[Array, Array], kept: NDArray[np.bool_]) -> Array:
    """The step (K,) of the lasting unknowns by some states (T,) and the priors: a matrix (K, K) and a gradient."""
    hessian, gradient = of.hessians[kept].sum(axis=0) + prior[0], of.gradients[kept].sum(axis=0) + prior[1]
    # A symmetric scaling: radians, metres and held unknowns differ by many powers of ten.
    scale = 1.0 / np.sqrt(np.maximum(np.diag(hessian), np.finfo(float).tiny))
    scaled = hessian * scale[:, None] * scale
    step: Array = -scale * np.linalg.lstsq(scaled, scale * gradient, rcond=1e-12)[0]
    return step


def _jackknife_covariance(of: EliminatedStates, prior: tuple[Array, Array]) -> Array:
    """Covariance (K, K) of the lasting unknowns: how much they change when a stretch of time is left out.

    Errors of neighbouring states go together, because they see the same landmarks; the inverse of the information
    would not know. Delete-a-block jackknife (Künsch 1989, "The jackknife and the bootstrap for general stationary
    observations"), each solved by one Gauss-Newton step.
    """
    block_of = np.arange(len(of.hessians)) * _SIGMA_BLOCKS // len(of.hessians)
    steps = np.stack([_lasting_step(of, prior, block_of != block) for block in range(_SIGMA_BLOCKS)])
    apart = steps - steps.mean(axis=0)
    covariance: Array = (_SIGMA_BLOCKS - 1) / _SIGMA_BLOCKS * apart.T @ apart
    return covariance


def _priors(
    motion: ArticulatedMotion,
    start: ArticulatedMotion,
    hinges: Mapping[str, Array],
    clock: ClockSettings,
) -> tuple[Array, Array]:
    """What no image determines: the choice of the segments' frames, and where a hinge's joint sits along its axis."""
    count = motion.lasting_count
    hessian, gradient = np.zeros((count, count)), np.zeros(count)
    held = np.zeros(count, dtype=bool)
    first_camera = {carrier: c for c, carrier in reversed(list(enumerate(motion.carriers)))}
    for carrier, c in first_camera.items():
        columns = motion.mount_columns(c)
        is_root = motion.body.segments[carrier] == motion.body.root
        held[columns.start : columns.stop if is_root else columns.start + 3] = True
    # All clocks together may be off by anything: that of the first camera with a shared trigger is the body's, if any.
    held[motion.delay_columns.start + int(np.argmax(motion.triggered))] = True
    hessian[held, held] = _FIXED
    sigmas = np.where(motion.triggered, TRIGGER_SIGMA_S, clock.sigma)
    delays = range(motion.delay_columns.start, motion.delay_columns.stop)
    hessian[delays, delays] += sigmas**-2.0
    gradient[delays] += motion.delays / sigmas**2
    for row, joint in enumerate(motion.body.tree_joints):
        if (axis := hinges.get(joint.child)) is not None:
            columns, information = motion.place_columns(row), np.outer(axis, axis) / STRAIGHT_SIGMA_M**2
            hessian[columns, columns] += information
            moved = joint.parent_T_joint - start.body.tree_joints[row].parent_T_joint
            gradient[columns] += information @ moved[:3, 3]
    return hessian, gradient


def _cauchy(hessians: Array, gradients: Array) -> Array:
    """Weights (T, C) by each camera's distance from where the body puts it, in its own sigmas."""
    traces = np.trace(hessians, axis1=-2, axis2=-1)
    regular = hessians + (1e-12 * traces + (traces == 0))[..., None, None] * np.eye(6)
    squared = np.einsum("tci,tci->tc", gradients, np.linalg.solve(regular, gradients[..., None])[..., 0])
    return distance_weights(np.maximum(squared, 0.0), traces > 0, _OUTLIER_SIGMAS)
