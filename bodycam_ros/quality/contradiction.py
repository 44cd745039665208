"""Cameras that contradict the body: for a while, they are registered elsewhere than the solved body has them.

The body is solved by all cameras, and the solver leaves out one that does not fit the others
(``estimation/camera_gate.py``): so it is the wrong one that is far from the body.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from bodycam_ros.geometry import Array, inverse, log_so3
from bodycam_ros.quality.camera_poses import CameraPoses

LEVER_M = 0.3
"""From a camera to the next joint of its segment: a turn of the segment counts as the motion of that joint."""

DOUBTFUL_GAP_M = 0.06
"""Gap between a camera and the body that is doubtful; good recordings stay below 0.045 in their worst second."""

LEAST_STAY_S = 1.0
"""Half of this time must disagree; a wrong registration or blur passes sooner, and the solver interpolates it."""

_MIN_ROWS = 3  # states at which a gap must be known
_MIN_SCALE = 0.03  # a map that is larger or smaller by less is no cause
_SCALE_EXPLAINS = 0.9  # share of the gaps; a camera 40 cm off, of four, looks like a scale to 0.78
_MIN_OFF_BY_SCALE = 3  # cameras that contradict the body


@dataclass(frozen=True, eq=False)
class Contradiction:
    """What does not fit.

    Attributes:
        poses: of all cameras; if most are off alike, as where the solver went astray, solved poses are moved by that.
        core: cameras that agree with the body.
        gaps: camera that contradicts it -> its worst lasting gap [m].
        map_scale: how many times as large the map is as the body, where that explains the gaps.
        shown_by: camera that contradicts -> another one whose gap shows it.
    """

    poses: CameraPoses
    core: tuple[str, ...]
    gaps: Mapping[str, float]
    map_scale: float | None
    shown_by: Mapping[str, str] = field(default_factory=dict)


def find_contradiction(poses: CameraPoses, cameras: Sequence[str]) -> Contradiction:
    """Find the cameras whose registrations contradict the body.

    Args:
        poses: over time.
        cameras: those that were registered at all.
    """
    lasting_gaps = {camera: lasting(pose_gap(poses, camera), poses.seconds) for camera in cameras}
    off = [camera for camera, gap in lasting_gaps.items() if gap > DOUBTFUL_GAP_M]
    scale = _map_scale(poses, cameras) if len(off) >= _MIN_OFF_BY_SCALE else None
    if scale is None and len(off) > len(cameras) / 2:
        poses = _moved_alike(poses, cameras)
        lasting_gaps = {camera: lasting(pose_gap(poses, camera), poses.seconds) for camera in cameras}
    gaps = {camera: gap for camera, gap in lasting_gaps.items() if gap > DOUBTFUL_GAP_M}
    return Contradiction(poses, tuple(camera for camera in cameras if camera not in gaps), gaps, scale)


def pose_gap(poses: CameraPoses, camera: str) -> Array:
    """(T,) distance between a camera's registered and solved poses [m]; NaN where it is not registered."""
    return pose_distance(poses.solved[camera], poses.registered[camera])


def pose_distance(first: Array, second: Array) -> Array:
    """(T,) between poses (T, 4, 4) of one body [m], a turn counted at the next joint."""
    gap = inverse(first) @ second
    moved, turned = (np.linalg.norm(each, axis=1) for each in (gap[:, :3, 3], log_so3(gap[:, :3, :3])))
    farther: Array = np.maximum(moved, LEVER_M * turned)
    return farther


def lasting(values: Array, seconds: Array) -> float:
    """The largest median of values (T,) over ``LEAST_STAY_S``; NaN of too few. Shorter recordings are one stretch."""
    known = np.isfinite(values)
    values, seconds = values[known], seconds[known]
    if len(values) < _MIN_ROWS:
        return float("nan")
    step_s = float(np.median(np.diff(seconds)))
    rows = max(_MIN_ROWS, round(LEAST_STAY_S / step_s))
    if len(values) <= rows:
        return float(np.median(values))
    # A stretch with a pause in it is none.
    whole = seconds[rows - 1 :] - seconds[: 1 - rows] < 2.0 * rows * step_s
    medians = np.median(np.lib.stride_tricks.sliding_window_view(values, rows), axis=1)[whole]
    return float(medians.max()) if len(medians) else float(np.median(values))


def _moved_alike(poses: CameraPoses, cameras: Sequence[str]) -> CameraPoses:
    """The poses with the solved ones moved by the median of all cameras at each state."""
    registered, solved = _positions(poses, cameras)
    shifts = np.ma.median(registered - solved, axis=0).filled(0.0)  # type: ignore[no-untyped-call]
    moved = {camera: poses.solved[camera].copy() for camera in poses.solved}
    for world_T_camera in moved.values():
        world_T_camera[:, :3, 3] += shifts
    return replace(poses, solved=moved)


def _map_scale(poses: CameraPoses, cameras: Sequence[str]) -> float | None:
    """Scale of the map over the body, by the cameras' places about their mean; None if none explains the gaps."""
    registered, solved = ((each - each.mean(axis=0)).compressed() for each in _positions(poses, cameras))
    larger, explained = proportion(solved, registered - solved)
    return 1.0 + larger if explained > _SCALE_EXPLAINS and abs(larger) > _MIN_SCALE else None


def _positions(poses: CameraPoses, cameras: Sequence[str]) -> Iterator["np.ma.MaskedArray[Any, Any]"]:
    """Registered and solved positions (C, T, 3) of cameras [m], masked where a camera is not registered."""
    places = [np.array([of[camera][:, :3, 3] for camera in cameras]) for of in (poses.registered, poses.solved)]
    return (np.ma.masked_array(each, np.isnan(places[0])) for each in places)


def proportion(x: Array, y: Array) -> tuple[float, float]:
    """The factor of x (...) that is closest to y (...), and which share of y's squares it explains; 0 of nothing."""
    squared, total = float((x**2).sum()), float((y**2).sum())
    if squared == 0.0 or total == 0.0:
        return 0.0, 0.0
    factor = float((x * y).sum()) / squared
    return factor, 1.0 - float(((y - factor * x) ** 2).sum()) / total
