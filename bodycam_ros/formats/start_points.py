"""Initial pose of a body by joint points of another system, such as those of a TRC or C3D.

Points are named after joints (RHip, left_knee, ankle_l, hip_left; ``point_sites``) or after our segments. The first row
with enough of them counts. Axes of such files differ (y or z up, and which way is forward): of the right-angled turns
that keep the person upright the one is taken that has the person in view of the most cameras, nearest to the middle of
their images.
"""

import logging
from collections.abc import Iterable, Mapping
from pathlib import Path

import numpy as np

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.body.segment_name import SegmentName
from bodycam_ros.errors import BodyError
from bodycam_ros.formats.point_sites import known_site
from bodycam_ros.geometry import Array, exp_so3, inverse, rigid, transform_points
from bodycam_ros.static_cameras.articulated_step import ArticulatedStep, PredictedBody
from bodycam_ros.static_cameras.limb_search import with_usual_limits
from bodycam_ros.static_cameras.start_file import PlacedBody
from bodycam_ros.static_cameras.static_camera import StaticCamera

logger = logging.getLogger(__name__)

_AXES = {
    **{
        f"as read, turned by {90 * quarter} deg about z": exp_so3(np.array([0.0, 0.0, quarter * np.pi / 2.0]))
        for quarter in range(4)
    },
    "y and z as in the file": exp_so3(np.array([-np.pi / 2.0, 0.0, 0.0])),
}
"""Rotations from a file's axes to a world with z up; readers have brought y up to z up, which need not be right."""

_TRUNK = {
    "neck": "head", "head_origin": "head", "head": "", "torso": "torso", "pelvis": "pelvis", "midhip": "pelvis",
    "hips": "pelvis",
}  # fmt: skip
"""Point of the trunk -> the segment that begins near it, as far as a start needs it; a head's point is its middle."""

_LIMBS = ("shin", "foot", "upper_arm", "forearm", "hand")

_POINT_SIGMA_M = 0.03
_EXPECTED = np.repeat([1.0, 1.0], 3)
_EXPECTED_JOINT_RAD = 0.7  # from the N-pose, for what no point constrains
_MIN_POINTS = 5
_UNITS_M = (1.0, 0.1, 0.01, 0.001)


def place_points(path: Path, points: Mapping[str, Array], body: BodyModel, stations: Iterable[StaticCamera]) -> Array:
    """Poses (S, 4, 4) of a body, joints closed, whose joints are at points.

    Args:
        path: of their file, for messages.
        points: name -> (K, 3) in the file's axes and unit.
        body: segments and joints.
        stations: in whose view the person is.

    Raises:
        BodyError: the file cannot be used, or no camera has the points in view.
    """
    joints = _named_joints(path, points, body)
    stations, scale = list(stations), _unit(joints, body)
    places = scale * np.array([*joints.values()])
    scores = {axes: _view_score(stations, places @ R.T) for axes, R in _AXES.items()}
    best = max(scores, key=lambda axes: scores[axes])
    if not scores[best][0]:
        raise BodyError(f"{path}: no static camera has its points in view, whichever of its axes is up")
    logger.info("%s: %d points, 1 unit = %g m, axes %s", path, len(joints), scale, best)
    return _fit_points(body, dict(zip(joints, places @ _AXES[best].T, strict=True)))


def place_world_points(path: Path, points: Mapping[str, Array], body: BodyModel) -> PlacedBody:
    """The body whose joints are at points (K, 3) that are in the world already [m].

    Limbs whose joint to their parent is not among them are unplaced.

    Raises:
        BodyError: too few joints are known.
    """
    joints = _named_joints(path, points, body)
    unplaced = np.array([SegmentName(s).kind in _LIMBS and s not in joints for s in body.segments])
    if unplaced.any():
        names = ", ".join(np.array(body.segments)[unplaced])
        logger.warning("%s: does not place %s; they are searched for in the first images", path, names)
    return PlacedBody(_fit_points(body, joints), unplaced)


def _named_joints(path: Path, points: Mapping[str, Array], body: BodyModel) -> dict[str, Array]:
    """Segment -> its origin (3,), at the first row with both hips and three other points."""
    named: dict[str, Array] = {}
    for name, rows in sorted(points.items(), key=lambda item: len(item[0])):
        site = known_site(name, body.segments, {}, False, points)
        centre = site.link if site is not None and not site.is_fitted else ""
        segment = _TRUNK.get(name.strip().lower(), centre)
        if segment in body.segments:
            named.setdefault(segment, rows)
    for row in range(max((len(rows) for rows in named.values()), default=0)):
        known = {segment: rows[row] for segment, rows in named.items() if np.isfinite(rows[row]).all()}
        if {"thigh_left", "thigh_right"} <= known.keys() and len(known) >= _MIN_POINTS:
            return known
    raise BodyError(
        f"{path}: expected points of both hips and three other joints, named as LHip, right_knee or ankle_l, and found "
        f"{', '.join(sorted(points)[:10]) or 'none'}"
    )


def _unit(points: Mapping[str, Array], body: BodyModel) -> float:
    """Metres of the unit in which the bones of the points come nearest to those of the body."""
    ratios = [
        float(np.linalg.norm(joint.parent_T_joint[:3, 3]))
        / max(float(np.linalg.norm(points[joint.child] - points[joint.parent])), 1e-9)
        for joint in body.tree_joints
        if joint.parent in points and joint.child in points
    ]
    ratio = float(np.median(ratios)) if ratios else 1.0
    return min(_UNITS_M, key=lambda unit: abs(np.log(unit / ratio)))


def _view_score(stations: Iterable[StaticCamera], places: Array) -> tuple[int, float]:
    """Points in view of all cameras together, and how near to the middle of the images they are."""
    count, off = 0, 0.0
    for station in stations:
        camera = station.camera
        pixels, valid = camera.project(transform_points(inverse(station.world_T_camera), places))
        shares = np.nan_to_num(pixels, nan=-1.0) / [camera.width, camera.height]
        inside = valid & (shares >= 0.0).all(axis=1) & (shares < 1.0).all(axis=1)
        count += int(inside.sum())
        off += float(np.linalg.norm(shares[inside] - 0.5, axis=1).sum())
    return count, -off / max(count, 1)


def _fit_points(body: BodyModel, origins: Mapping[str, Array]) -> Array:
    """Poses (S, 4, 4) of a body whose segments have their origins at points (3,), within people's limits."""
    hips = 0.5 * (origins["thigh_left"] + origins["thigh_right"])
    y = origins["thigh_left"] - origins["thigh_right"]
    above = [at for name, at in origins.items() if SegmentName(name).kind in ("upper_arm", "head")]
    x = np.cross(y, np.mean(above, axis=0) - hips if above else [0.0, 0.0, 1.0])
    axes = np.stack([x, y, np.cross(x, y)], axis=1)
    start = body.n_pose(rigid(axes / np.linalg.norm(axes, axis=0), hips))
    measured = np.stack([rigid(np.eye(3), at) for at in origins.values()])
    information = np.zeros((len(measured), 6, 6))
    information[:, 3:, 3:] = _POINT_SIGMA_M**-2.0 * np.eye(3)  # a point constrains no rotation
    rows = [body.segment_index[name] for name in origins]
    predicted = PredictedBody(start, _EXPECTED, _EXPECTED_JOINT_RAD)
    return ArticulatedStep(with_usual_limits(body)).fit(start, rows, measured, information, predicted)
