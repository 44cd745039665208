"""Joint angles of two systems side by side: by rotations of bones, or by joint centres alone."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from bodycam_ros.evaluate import comparison
from bodycam_ros.evaluate.anatomical_angles import angles_of_points, kind_and_side, planes_of
from bodycam_ros.geometry import Array, log_so3, nearest_rotation

_ORDER = ("torso", "head", "upper_arm", "forearm", "hand", "thigh", "shin", "foot")


@dataclass(frozen=True, eq=False)
class AngleAgreement:
    """A joint over T frames.

    Attributes:
        segment: below it.
        ours, theirs: (T, 3) angles [rad] in the anatomical planes; NaN where unknown.
        ours_turned, theirs_turned: (T,) [rad] turn since the first frame (A figure 7a).
        from_points: by joint centres alone, not by rotations of bones.
    """

    segment: str
    ours: Array
    theirs: Array
    ours_turned: Array
    theirs_turned: Array
    from_points: bool


def compare_rotations(segment: str, ours: Array, theirs: Array) -> AngleAgreement:
    """Compare rotations (T, 3, 3) of a segment in its parent; the axes that systems give to bones are fitted."""
    known = np.isfinite(theirs).all(axis=(1, 2))
    planes, turned = np.full((2, len(ours), 3), np.nan), np.full((2, len(ours)), np.nan)
    for row, rotations in enumerate((ours[known], _in_our_axes(ours[known], theirs[known]))):
        planes[row, known] = planes_of(segment, rotations)
        turned[row, known] = comparison.turned(rotations)
    planes[1] -= 2.0 * np.pi * np.round((planes[1] - planes[0]) / (2.0 * np.pi))
    return AngleAgreement(segment, planes[0], planes[1], turned[0], turned[1], from_points=False)


def _in_our_axes(ours: Array, theirs: Array) -> Array:
    """Their rotations (T, 3, 3) with constant frames that bring them closest to ours.

    Axes of bones may differ by right angles, from where the alternating fit may not converge. Rotation vectors since
    the first frame differ by the child's frame alone, so the fit starts from there, too.
    """
    ours_since, theirs_since = (log_so3(np.swapaxes(R[:1], 1, 2) @ R) for R in (ours, theirs))
    tried = []
    for child in (np.eye(3), nearest_rotation(theirs_since.T @ ours_since)):
        parent = nearest_rotation(np.mean(ours @ np.swapaxes(theirs @ child, 1, 2), axis=0))
        start = parent @ theirs @ child
        A, B = comparison.fit_constant_frames(ours, start)
        tried.append((float(comparison.rotation_errors(ours, start, A, B).mean()), A @ start @ B))
    return min(tried, key=lambda pair: pair[0])[1]


def compare_centre_angles(ours: Mapping[str, Array], theirs: Mapping[str, Array]) -> tuple[AngleAgreement, ...]:
    """Compare angles between joint centres, segment -> (T, 3) [m]; theirs NaN where unknown."""
    if not ours:
        return ()
    known = np.all([np.isfinite(points).all(axis=1) for points in theirs.values()], axis=0)
    if not known.any():
        return ()
    both = [angles_of_points({name: points[known] for name, points in each.items()}) for each in (ours, theirs)]
    found = []
    for segment in sorted(both[0], key=_order):
        planes = np.full((2, len(known), 3), np.nan)
        planes[:, known] = both[0][segment], both[1][segment]
        turned = np.sqrt(np.nansum((planes - planes[:, known][:, :1]) ** 2, axis=2))
        turned[:, ~known] = np.nan
        found.append(AngleAgreement(segment, planes[0], planes[1], turned[0], turned[1], from_points=True))
    return tuple(found)


def _order(segment: str) -> tuple[int, str]:
    kind = kind_and_side(segment)[0]
    return _ORDER.index(kind) if kind in _ORDER else len(_ORDER), segment
