"""Cameras that are elsewhere than the rig says, by the motion of pairs of cameras.

Two cameras on one segment keep their pose to each other; two on neighbouring segments have a point in common, the joint
(A eq. 13). How well either holds is computed once for each pair. What it costs to have the cameras on other segments is
then a sum, so that exchanges and moves of cameras are tried one after the other.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations, product

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import median_filter

from bodycam_ros.body.segment_name import LEFT, mirrored
from bodycam_ros.calibration.joint_centre import weighted_joint_centre
from bodycam_ros.calibration.rig import Rig
from bodycam_ros.errors import RigError
from bodycam_ros.geometry import Array, inverse, log_so3, robust_average_pose

_MAX_ROWS = 300  # of the recording, evenly spread
_LEAST_ROWS = 20  # that two cameras need in common
_QUANTILE = 0.9  # of the rows' gaps: joints are exercised one after the other, and are still most of the time
_SPIKE_M = 0.03  # by which the gap of a wrong registration exceeds those before and after
_FITS = 4  # of a joint, each without the spikes of the one before
_LEVER_M = 0.3  # from a camera to the next joint of its segment: a turn counts as the motion of that joint
_UNKNOWN_M = 0.05  # of two cameras that were hardly registered together
_LARGEST_M = 0.5  # a gap that is larger says no more
_SUSPICIOUS_M = 0.06  # neighbours of a right rig have 25 mm, others 35 to 500; soft tissue and blur leave more
_LEAST_GAIN_M = 0.05  # of the sum of gaps, by a step of the search
_EXPLAINED = 0.5  # share of the sum of gaps, or of the largest, that a change may leave
_EQUAL_M = 1e-6  # left and right of a limb explain as much as right and left
_MOST_STEPS = 8


@dataclass(frozen=True)
class MisplacedCameras:
    """The least change of a rig that explains the motion of its cameras.

    Attributes:
        cameras: camera -> segment that it is on, of all cameras.
        gap_m, left_m: largest gap between cameras of a joint or a segment, by the rig and by ``cameras`` [m].
        other: sum of gaps that the next best change leaves, as a multiple of what this one leaves.
    """

    cameras: Mapping[str, str]
    gap_m: float
    left_m: float
    other: float

    @property
    def evidence(self) -> str:
        """What speaks against the rig, and how clearly."""
        return (
            f"with this rig cameras of one segment or joint contradict each other by up to {1e3 * self.gap_m:.0f} mm, "
            f"after this correction by {1e3 * self.left_m:.0f} mm; the second best correction leaves "
            f"{self.other:.1f} times as much"
        )


def find_misplaced(
    rig: Rig, cameras: Sequence[str], world_T_camera: Array, known: NDArray[np.bool_]
) -> MisplacedCameras | None:
    """Search for cameras that are exchanged, or on another segment than the rig says.

    Left and right of a whole limb fit either way; see ``exchanged_limbs``.

    Args:
        rig: which camera is on which segment.
        cameras: (C) names.
        world_T_camera: (T, C, 4, 4) poses of all cameras at T common stamps [m].
        known: (T, C) whether a pose is known.

    Returns:
        None where the rig fits, or no change of it fits clearly better.
    """
    gaps = _PairGaps(rig, cameras, world_T_camera, known)
    best = dict(rig.cameras)
    before = gaps.of(best)
    if max(before, default=0.0) < _SUSPICIOUS_M:
        return None
    best_sum = sum(before)
    others: list[float] = []
    for _ in range(_MOST_STEPS):
        tried = sorted(((sum(gaps.of(each)), each) for each in _changed(rig, best)), key=lambda one: one[0])
        if not tried or tried[0][0] > best_sum - _LEAST_GAIN_M:
            break
        best_sum, best = tried[0]
        others = [total for total, _ in tried if total > best_sum + _EQUAL_M]
    after = gaps.of(best)
    if best == rig.cameras or (sum(after) > _EXPLAINED * sum(before) and max(after) > _EXPLAINED * max(before)):
        return None
    return MisplacedCameras(best, max(before), max(after), min(others, default=sum(before)) / max(best_sum, 1e-3))


def refuse_rig(rig: Rig, cameras: Mapping[str, str], evidence: str) -> RigError:
    """The error that names the cameras which are elsewhere than the rig says.

    Args:
        rig: as it was given.
        cameras: camera -> segment that it is on.
        evidence: what speaks against the rig.
    """
    wrong = [camera for camera in rig.cameras if cameras[camera] != rig.cameras[camera]]
    pairs = []
    alone = []
    named = set[str]()
    for camera in (each for each in wrong if each not in named):
        partners = [c for c in wrong if cameras[c] == rig.cameras[camera] and rig.cameras[c] == cameras[camera]]
        partner = next((each for each in partners if each not in named), None)
        if partner is None:
            alone.append(f"camera {camera} is on {cameras[camera]}, not on {rig.cameras[camera]}")
        else:
            pairs.append(f"{camera} and {partner}")
            named |= {camera, partner}
    exchanged = [f"cameras {', and '.join(pairs)} are exchanged"] if pairs else []
    return RigError(
        f"{'; '.join([*exchanged, *alone])}: {evidence}. Correct the rig, or the names of the files, and make the body "
        "again"
    )


class _PairGaps:
    """How far pairs of cameras are from being on one segment, and on two that a joint holds together [m]."""

    def __init__(self, rig: Rig, cameras: Sequence[str], world_T_camera: Array, known: NDArray[np.bool_]) -> None:
        self._rig, self._names = rig, list(cameras)
        rows = np.unique(np.linspace(0, len(known) - 1, _MAX_ROWS).round().astype(np.intp))
        self._poses, self._known = world_T_camera[rows], known[rows]
        self._rigid: dict[frozenset[str], float] = {}
        self._joint: dict[frozenset[str], float] = {}

    def of(self, cameras: Mapping[str, str]) -> list[float]:
        """Gaps of each segment with several cameras and of each joint, with cameras on some segments [m]."""
        on: dict[str, list[str]] = {}
        for camera, segment in cameras.items():
            on.setdefault(segment, []).append(camera)
        gaps = []
        for segment, own in on.items():
            gaps += [self._rigid_gap(*pair) for pair in combinations(own, 2)]
            parent = self._rig.parents[segment]
            if pairs := list(product(on.get(parent, ()) if parent else (), own)):
                gaps.append(float(np.mean([self._joint_gap(*pair) for pair in pairs])))
        return gaps

    def _rigid_gap(self, one: str, other: str) -> float:
        pair = frozenset((one, other))
        if pair not in self._rigid:
            poses, self._rigid[pair] = self._relative(one, other), _UNKNOWN_M
            if len(poses) >= _LEAST_ROWS:
                off = inverse(robust_average_pose(poses)) @ poses
                moved, turned = (np.linalg.norm(part, axis=1) for part in (off[:, :3, 3], log_so3(off[:, :3, :3])))
                self._rigid[pair] = _most(np.maximum(moved, _LEVER_M * turned))
        return self._rigid[pair]

    def _joint_gap(self, one: str, other: str) -> float:
        pair = frozenset((one, other))
        if pair not in self._joint:
            poses, self._joint[pair] = self._relative(one, other), _UNKNOWN_M
            if len(poses) >= _LEAST_ROWS:
                self._joint[pair] = _most(_joint_residuals(poses))
        return self._joint[pair]

    def _relative(self, one: str, other: str) -> Array:
        """(N, 4, 4) poses of a camera in another."""
        a, b = sorted((self._names.index(one), self._names.index(other)))
        both = self._known[:, a] & self._known[:, b]
        return np.asarray(inverse(self._poses[both, a]) @ self._poses[both, b])


def _joint_residuals(parent_T_child: Array) -> Array:
    """(N,) distances between a joint on the parent and on the child [m], of the joint that fits best.

    The robust fit of ``find_joint_centre`` takes a short exercise that does not fit for errors, and fits the rest.
    """
    weights = np.ones(len(parent_T_child))
    for _ in range(_FITS):
        residuals = weighted_joint_centre(parent_T_child, weights).residuals_m
        weights = (residuals < _without_spikes(residuals) + _SPIKE_M).astype(np.float64)
    return residuals


def _without_spikes(values: Array) -> Array:
    return np.asarray(median_filter(values, 3, mode="nearest"))


def _most(values: Array) -> float:
    return min(float(np.quantile(_without_spikes(values), _QUANTILE)), _LARGEST_M)


def _changed(rig: Rig, cameras: Mapping[str, str]) -> Iterator[dict[str, str]]:
    """Two cameras exchanged; limbs exchanged with those of the other side from a segment on; a camera moved."""
    for a, b in combinations(cameras, 2):
        if cameras[a] != cameras[b]:
            yield {**cameras, a: cameras[b], b: cameras[a]}
    for segment in rig.segments:
        other = mirrored(segment)
        if segment.endswith(LEFT) and other in rig.segments:
            outer = {each for each in rig.segments if _hangs_on(rig, each, (segment, other))}
            if all(mirrored(each) in rig.segments for each in outer):
                yield {c: (mirrored(place) or place) if place in outer else place for c, place in cameras.items()}
    counts = {segment: sum(place == segment for place in cameras.values()) for segment in rig.segments}
    for camera, segment in product(cameras, rig.segments):
        if segment != cameras[camera] and counts[cameras[camera]] > 1:
            yield {**cameras, camera: segment}


def _hangs_on(rig: Rig, segment: str, tops: Sequence[str]) -> bool:
    place: str | None = segment
    while place is not None and place not in tops:
        place = rig.parents[place]
    return place is not None
