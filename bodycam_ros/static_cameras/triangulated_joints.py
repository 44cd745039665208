"""Joints of people by keypoints of several static cameras: who is who, and points where rays meet.

A person is found in two cameras whose keypoints agree, then in the others; the one that the most keypoints of all
cameras agree on is the first, and the next is found among what is left. A joint is the point that the most cameras
agree on; keypoints that are elsewhere (left for right, another person's) are rejected.
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
_MOST_PAIRS = 30  # that are looked for in all cameras; the number of all grows with the square of people and cameras
_LEAST_PARALLAX = np.sin(np.radians(3.0))


def triangulate_people(
    stations: Mapping[str, StaticCamera], people: Mapping[str, Sequence[Array]]
) -> list[tuple[Array, Counts]]:
    """People that two cameras or more agree on, those first whom the most keypoints agree on.

    Args:
        stations: the cameras.
        people: camera -> (J, 3) pixel and score of each person in its image.

    Returns:
        joints (J, 3) of each [m], NaN where fewer than two cameras agree; and how many do (J,).
    """
    views = [_View(stations[name], keypoints) for name, group in people.items() for keypoints in group]
    found: list[tuple[Array, Counts]] = []
    while chosen := _person(views):
        points, counts = _triangulate(chosen)
        found.append((points, counts))
        # A detector that finds somebody twice, or a part of him, makes no second person.
        views = [view for view in views if view not in chosen and not view.is_of(points)]
    return found


def _person(views: Sequence["_View"]) -> list["_View"]:
    """The views of one person, whom the most keypoints agree on; none where no two cameras have one in common."""
    pairs: list[tuple[int, float, Array, list[_View]]] = []
    for first, second in combinations(views, 2):
        if first.station is second.station:
            continue
        points, counts = _triangulate([first, second])
        agree = counts == 2
        if agree.sum() >= _LEAST_JOINTS:
            error = float(np.sum(np.minimum(first.errors(points), 1.0)[agree]))
            pairs.append((int(agree.sum()), -error, points, [first, second]))
    best: tuple[int, float] = (0, 0.0)
    chosen: list[_View] = []
    for _, error, points, pair in sorted(pairs, key=lambda pair: pair[:2], reverse=True)[:_MOST_PAIRS]:
        everywhere = [*pair, *_in_other_cameras(points, pair, views)]
        score = int(_triangulate(everywhere)[1].sum()), error
        if score > best:
            best, chosen = score, everywhere
    return chosen


def _in_other_cameras(points: Array, pair: Sequence["_View"], views: Sequence["_View"]) -> list["_View"]:
    """Views of a person with joints at points (J, 3) in the cameras that are not those of a pair, one for each."""
    others: dict[str, list[_View]] = {}
    for view in views:
        if all(view.station is not one.station for one in pair):
            others.setdefault(view.station.name, []).append(view)
    best = [max(group, key=lambda view: view.agreeing(points)) for group in others.values()]
    return [view for view in best if 2 * view.agreeing(points) >= int(np.isfinite(points[:, 0]).sum())]


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

    def agreeing(self, points: Array) -> int:
        """How many keypoints are where points (J, 3) project."""
        return int((self.errors(points) < 1.0).sum())

    def is_of(self, points: Array) -> bool:
        """Whether half of the keypoints are those of a person with joints at points (J, 3)."""
        return 2 * self.agreeing(points) >= max(1, int(self.usable.sum()))


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
