"""Cameras whose clock is some milliseconds off: they are right about places and wrong about when."""

from collections.abc import Sequence

import numpy as np

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.verdict.agreement import Agreement
from bodycam_ros.verdict.camera_link import camera_links
from bodycam_ros.verdict.contradiction import blame
from bodycam_ros.verdict.joint_view import joint_view, joint_views

_EXPLAINED = 0.35
"""Share of the gaps that a clock must explain; on good recordings none of 5 ms explains more than 0.25."""

_LEAST_ROWS = 20
"""Instants that a clock is told by: of fewer, chance explains as much."""

_LEFT = 0.85
"""Share of the gap that may be left once the clock is put right; a fast limb is no straight line."""


def clock_errors(agreement: Agreement, body: BodyModel, cameras: Sequence[str], limit_s: float) -> dict[str, float]:
    """Camera -> by how much its clock is ahead of the others' [s], of those that are off by more than a limit."""
    disagreements = {}
    for link in camera_links(body, body.mounts, cameras):
        if link.is_exact:
            view = joint_view(agreement, link, link.second)
            error_s, explained = view.clock_error() if len(view.places) >= _LEAST_ROWS else (0.0, 0.0)
            disagreements[link.first, link.second] = abs(error_s) if explained > _EXPLAINED else 0.0
    off, _ = blame(disagreements, limit_s, lambda camera: agreement.counts[camera].share)
    right = [camera for camera in cameras if camera not in off]
    errors = {camera: clock_error(agreement, body, right, camera, limit_s) for camera in off}
    return {camera: error_s for camera, error_s in errors.items() if error_s is not None}


def clock_error(
    agreement: Agreement, body: BodyModel, core: Sequence[str], camera: str, limit_s: float
) -> float | None:
    """By how much a camera's clock is ahead of the core's [s], beyond a limit; None if no clock explains its gaps."""
    views = [view for view in joint_views(agreement, body, core, camera) if len(view.places) >= _LEAST_ROWS]
    errors = [view.clock_error() for view in views]
    if not errors or np.median([explained for _, explained in errors]) < _EXPLAINED:
        return None
    error_s = float(np.median([error_s for error_s, _ in errors]))
    better = all(view.gap_with_clock(error_s) < _LEFT * view.gap_with_clock(0.0) for view in views)
    return error_s if abs(error_s) > limit_s and better else None
