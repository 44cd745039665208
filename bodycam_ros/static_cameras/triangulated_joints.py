"""Joints of one person by keypoints of several static cameras: who is who, and points where rays meet.

The person is found in the two cameras whose keypoints agree in the most joints, then in the others. A joint is the
point that the most cameras agree on; keypoints that are elsewhere (left for right, another person's) are rejected.
"""

from collections.abc import Mapping, Sequence
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.geometry import Array, inverse, transform_points
from bodycam_ros.static_cameras.static_camera import StaticCamera

Counts = NDArray[np.int64]

LEAST_SCORE = 0.3
"""Score from which on a keypoint counts."""

INLIER = 0.015
"""Share of the image's larger side, from a keypoint to where its point projects, within which they agree."""

_LEAST_JOINTS = 5  # that two cameras agree on, to be of one person
_LEAST_PARALLAX = np.sin(np.radians(3.0))


def triangulate_person(
    stations: Mapping[str, StaticCamera], people: Mapping[str, Sequence[Array]]
) -> tuple[Array, Counts]:
    """Joints (J, 3) of the person that cameras agree on best [m], NaN where fewer than two do; and how many do (J,).

    Args:
        stations: the cameras.
        people: camera -> (J, 3) pixel and score of each person in its image.
    """
    views = {
        (name, k): _View(stations[name], keypoints)
        for name, group in people.items()
        for k, keypoints in enumerate(group)
    }
    best: tuple[int, float] = (0, 0.0)
    chosen: list[_View] = []
    for (a, first), (b, second) in combinations(views.items(), 2):
        if a[0] == b[0]:
            continue
        points, counts = _triangulate([first, second])
        agree = counts == 2
        score = int(agree.sum()), -float(np.sum(np.minimum(first.errors(points), 1.0)[agree]))
        if score > best:
            best, chosen = score, [first, second]
    count = len(next(iter(views.values())).pixels) if views else 0
    if best[0] < _LEAST_JOINTS:
        return np.full((count, 3), np.nan), np.zeros(count, np.int64)
    points, _ = _triangulate(chosen)
    used = {view.station.name for view in chosen}
    for name in [name for name in people if name not in used]:
        group = [view for (camera, _), view in views.items() if camera == name]
        agreeing = [int((view.errors(points) < 1.0).sum()) for view in group]
        if agreeing and 2 * max(agreeing) >= int(np.isfinite(points[:, 0]).sum()):
            chosen.append(group[int(np.argmax(agreeing))])
    return _triangulate(chosen)


class _View:
    """Keypoints (J) of a person in an image: pixels (J, 2), rays (J, 3) in the world, and where both can be used."""

    def __init__(self, station: StaticCamera, keypoints: Array) -> None:
        self.station = station
        self.pixels = keypoints[:, :2]
        rays, valid = station.camera.unproject(np.ascontiguousarray(np.nan_to_num(self.pixels)))
        self.usable = valid & (keypoints[:, 2] >= LEAST_SCORE)
        self.rays: Array = rays @ station.world_T_camera[:3, :3].T
        self.centre: Array = station.world_T_camera[:3, 3]
        self._limit = INLIER * max(station.camera.width, station.camera.height)

    def errors(self, points: Array) -> Array:
        """(J,) from keypoints to points (J, 3), in limits of an inlier; infinite where either is not known."""
        known = self.usable & np.isfinite(points).all(axis=1)
        in_camera = transform_points(inverse(self.station.world_T_camera), np.nan_to_num(points))
        seen, valid = self.station.camera.project(in_camera)
        errors: Array = np.linalg.norm(seen - self.pixels, axis=1) / self._limit
        return np.where(known & valid, np.nan_to_num(errors, nan=np.inf), np.inf)


def _triangulate(views: Sequence[_View]) -> tuple[Array, Counts]:
    """Points (J, 3) that the most views agree on, and how many do (J,)."""
    joints = len(views[0].pixels)
    points, errors = np.full((joints, 3), np.nan), np.full(joints, np.inf)
    counts: Counts = np.zeros(joints, np.int64)
    for pair in combinations(views, 2):
        candidates = _meeting(pair, np.ones((2, joints), bool))
        off = np.stack([view.errors(candidates) for view in views])
        agree = off < 1.0
        number, sizes = agree.sum(axis=0), np.where(agree, off, 0.0).sum(axis=0)
        better = (number >= 2) & ((number > counts) | ((number == counts) & (sizes < errors)))
        refined = _meeting(views, agree)
        points[better], counts[better], errors[better] = refined[better], number[better], sizes[better]
    return points, counts


def _meeting(views: Sequence[_View], used: NDArray[np.bool_]) -> Array:
    """Points (J, 3) nearest to the rays of those views that are used (V, J); NaN where they are nearly parallel."""
    used = used & np.stack([view.usable for view in views])
    rays = np.stack([view.rays for view in views])
    across = (np.eye(3) - rays[..., None] * rays[..., None, :]) * used[..., None, None]
    A = across.sum(axis=0)
    right = np.einsum("vjab,vb->ja", across, np.stack([view.centre for view in views]))
    least = np.linalg.eigvalsh(A)[:, 0]
    good = (used.sum(axis=0) >= 2) & (least > 0.5 * _LEAST_PARALLAX**2)
    points = np.full((rays.shape[1], 3), np.nan)
    if good.any():
        points[good] = np.linalg.solve(A[good], right[good][..., None])[..., 0]
    return points
