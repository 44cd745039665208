"""Which cameras contradict the others, as the fewest that explain what does not fit.

Two cameras on one segment keep their place to each other. Two on neighbouring segments see the joint between them at
one point of the world. Where segments without a camera lie between them, the first and the last joint on the way are as
far apart as those segments allow. A camera that contradicts its links is wrong even if the solver followed it.
"""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np

from bodycam_ros.body.body_model import BodyModel, CameraMount
from bodycam_ros.geometry import Array, inverse, log_so3
from bodycam_ros.kinematics.joint import Joint
from bodycam_ros.quality.agreement import Agreement
from bodycam_ros.quality.thresholds import DOUBTFUL_GAP_M, LEAST_STAY_S

LEVER_M = 0.3
"""From a camera to the joint of its segment that is next: what a wrong turn of the segment costs."""


@dataclass(frozen=True, eq=False)
class CameraLink:
    """Two cameras and what lies between them on the body.

    Attributes:
        first, second: cameras.
        first_mount, second_mount: where they sit.
        way: joints from the segment of the first to that of the second; none if they share a segment.
        lengths: (K) of the segments in between, from joint to joint [m]; of one joint there are none.
    """

    first: str
    second: str
    first_mount: CameraMount
    second_mount: CameraMount
    way: tuple[Joint, ...]
    lengths: Array

    @cached_property
    def reach(self) -> tuple[float, float]:
        """Least and greatest distance of the first and the last joint on the way [m]."""
        if not len(self.lengths):
            return 0.0, 0.0
        longest, total = float(self.lengths.max()), float(self.lengths.sum())
        return max(0.0, 2.0 * longest - total), total

    @property
    def is_exact(self) -> bool:
        """Whether both cameras say where one and the same point is, not only how far two points are apart."""
        return not len(self.lengths)

    def gap(self, world_T_first: Array, world_T_second: Array) -> Array:
        """By how much poses (T, 4, 4) of the two cameras contradict the body (T,) [m]; NaN where one is unknown.

        Cameras on one segment that turned against each other are as wrong as the turn moves what is an arm's length
        away, since that is where the next joint of a limb is.
        """
        distance = np.linalg.norm(self.offset(world_T_first, world_T_second), axis=-1)
        low, high = self.reach
        outside: Array = np.maximum(np.maximum(low - distance, distance - high), 0.0)
        if self.way:
            return outside
        first_R_second = np.swapaxes(self._segment_R(world_T_first, self.first_mount), -1, -2) @ self._segment_R(
            world_T_second, self.second_mount
        )
        known = np.isfinite(outside)
        turned = np.full(len(outside), np.nan)
        turned[known] = np.linalg.norm(log_so3(first_R_second[known]), axis=-1)
        return np.maximum(outside, LEVER_M * turned)

    def offset(self, world_T_first: Array, world_T_second: Array) -> Array:
        """(T, 3) from where the first camera has the first joint to where the second has the last, in the world [m]."""
        return self.place(self.second, world_T_second) - self.place(self.first, world_T_first)

    def place(self, camera: str, world_T_camera: Array) -> Array:
        """(T, 3) where one of the two has its end of the way in the world [m]."""
        camera_point = self.end(camera)
        place: Array = world_T_camera[..., :3, :3] @ camera_point + world_T_camera[..., :3, 3]
        return place

    def end(self, camera: str) -> Array:
        """(3,) its end of the way in the frame of one of the two cameras [m]; the middle of both if there is no way."""
        mount = self.first_mount if camera == self.first else self.second_mount
        camera_T_segment = inverse(mount.segment_T_camera)
        return camera_T_segment[:3, :3] @ self._point(camera) + camera_T_segment[:3, 3]

    def _point(self, camera: str) -> Array:
        """(3,) the end of the way in the frame of the camera's segment [m]."""
        if not self.way:
            return (self.first_mount.segment_T_camera[:3, 3] + self.second_mount.segment_T_camera[:3, 3]) / 2.0
        joint = self.way[0] if camera == self.first else self.way[-1]
        mount = self.first_mount if camera == self.first else self.second_mount
        return _joint_on(joint, mount.segment)

    @staticmethod
    def _segment_R(world_T_camera: Array, mount: CameraMount) -> Array:
        rotations: Array = world_T_camera[..., :3, :3] @ mount.segment_T_camera[:3, :3].T
        return rotations


def camera_links(body: BodyModel, mounts: Mapping[str, CameraMount], cameras: Sequence[str]) -> tuple[CameraLink, ...]:
    """The links between cameras that no other camera's segment lies between.

    Args:
        body: segments and joints.
        mounts: camera -> where it is taken to sit.
        cameras: those that there are.
    """
    carried = {mounts[camera].segment for camera in cameras}
    ways = {segment: _ways(body, segment, carried) for segment in carried}
    links = []
    for number, first in enumerate(cameras):
        for second in cameras[number + 1 :]:
            way = ways[mounts[first].segment].get(mounts[second].segment)
            if way is not None:
                lengths = _lengths(way, mounts[first].segment)
                links.append(CameraLink(first, second, mounts[first], mounts[second], way, lengths))
    return tuple(links)


def _ways(body: BodyModel, start: str, carried: set[str]) -> dict[str, tuple[Joint, ...]]:
    """Segment with a camera -> the joints on the way there, over segments without one."""
    ways: dict[str, tuple[Joint, ...]] = {start: ()}
    pending = [start]
    while pending:
        segment = pending.pop(0)
        if segment in carried and segment != start:
            continue
        for joint in body.tree_joints:
            if joint.type != "free" and segment in (joint.parent, joint.child):
                other = joint.child if segment == joint.parent else joint.parent
                if other not in ways:
                    ways[other] = (*ways[segment], joint)
                    pending.append(other)
    return {segment: way for segment, way in ways.items() if segment in carried}


def _lengths(way: Sequence[Joint], start: str) -> Array:
    """(K) lengths of the segments between the joints of a way [m]."""
    lengths, segment = [], start
    for joint, following in pairwise(way):
        segment = joint.child if segment == joint.parent else joint.parent
        lengths.append(np.linalg.norm(_joint_on(following, segment) - _joint_on(joint, segment)))
    return np.array(lengths)


def _joint_on(joint: Joint, segment: str) -> Array:
    """(3,) where a joint is in the frame of one of its segments [m]."""
    place: Array = (joint.parent_T_joint if segment == joint.parent else joint.child_T_joint)[:3, 3]
    return place


_LEAST_ROWS = 3
"""Fewest times at which a link must be known."""


@dataclass(frozen=True, eq=False)
class Contradiction:
    """What does not fit.

    Attributes:
        core: cameras that agree with each other.
        gaps: camera that contradicts them -> its worst lasting gap [m].
        rivals: camera that contradicts -> the one that could be blamed as well, where they cannot be distinguished.
    """

    core: tuple[str, ...]
    gaps: Mapping[str, float]
    rivals: Mapping[str, str]


def contradiction(agreement: Agreement, body: BodyModel, cameras: Sequence[str]) -> Contradiction:
    """Find the cameras whose own poses contradict the body that the others agree on.

    Args:
        agreement: poses over time.
        body: segments, joints and mounts.
        cameras: those that were registered at all.
    """
    limit = DOUBTFUL_GAP_M
    gaps = lasting_gaps(agreement, camera_links(body, body.mounts, cameras))
    blamed, rivals = blame(gaps, limit, lambda camera: _registration_rank(agreement, camera))
    core = [camera for camera in cameras if camera not in blamed]
    # Without the blamed, cameras on either side of them are linked over more joints: another may not fit.
    while len(core) > 1:
        gaps = gaps | lasting_gaps(agreement, camera_links(body, body.mounts, core))
        of_core = {pair: gap for pair, gap in gaps.items() if set(pair) <= set(core)}
        more, more_rivals = blame(of_core, limit, lambda camera: _registration_rank(agreement, camera))
        if not more:
            break
        blamed, rivals = [*blamed, *more], rivals | more_rivals
        core = [camera for camera in core if camera not in more]
    worst = {camera: max(gap for pair, gap in gaps.items() if camera in pair) for camera in blamed}
    return Contradiction(tuple(core), worst, rivals)


def blame(
    gaps: Mapping[tuple[str, str], float], limit: float, rank: Callable[[str], float]
) -> tuple[list[str], dict[str, str]]:
    """The fewest cameras that all links beyond the limit have part in: greedily, the most contradicted first.

    Args:
        gaps: (camera, camera) -> by how much the two disagree.
        limit: what is too much.
        rank: how well a camera is registered; of two that are alike the worse is blamed.

    Returns:
        The cameras, and for each whose opposite could be blamed as well, that one.
    """
    bad = {pair: gap for pair, gap in gaps.items() if gap > limit}
    good = set(gaps) - set(bad)
    blamed: list[str] = []
    rivals: dict[str, str] = {}
    while bad:
        weights = {camera: _weight(camera, bad, good) for camera in {camera for pair in bad for camera in pair}}
        worst = max(weights, key=lambda camera: (weights[camera], -rank(camera), camera))
        own = [pair for pair in bad if worst in pair]
        opposite = own[0][0] if own[0][1] == worst else own[0][1]
        if len(own) == 1 and weights[opposite] == weights[worst]:
            rivals[worst] = opposite
        blamed.append(worst)
        bad = {pair: gap for pair, gap in bad.items() if worst not in pair}
        # Agreement with a blamed camera does not count.
        good = {pair for pair in good if worst not in pair}
    return blamed, rivals


def _weight(camera: str, bad: Iterable[tuple[str, str]], good: Iterable[tuple[str, str]]) -> int:
    """How many more cameras a camera contradicts than it agrees with."""
    return sum(camera in pair for pair in bad) - sum(camera in pair for pair in good)


def lasting_gaps(agreement: Agreement, links: Iterable[CameraLink]) -> dict[tuple[str, str], float]:
    """(camera, camera) -> the gap that the two keep for ``min_stay`` in their worst time [m], of known links."""
    found = {}
    for link in links:
        gaps = link.gap(agreement.registered(link.first), agreement.registered(link.second))
        worst = lasting(gaps, agreement.seconds, LEAST_STAY_S)
        if np.isfinite(worst):
            found[link.first, link.second] = worst
    return found


def lasting(values: Array, seconds: Array, min_stay_s: float) -> float:
    """The largest median of values (T,) over a stretch of time; NaN of too few. Shorter recordings are one stretch."""
    known = np.isfinite(values)
    values, seconds = values[known], seconds[known]
    if len(values) < _LEAST_ROWS:
        return float("nan")
    step_s = float(np.median(np.diff(seconds)))
    rows = max(_LEAST_ROWS, round(min_stay_s / step_s))
    if len(values) <= rows:
        return float(np.median(values))
    # A stretch with a pause in it is none.
    whole = seconds[rows - 1 :] - seconds[: 1 - rows] < 2.0 * rows * step_s
    medians = np.median(np.lib.stride_tricks.sliding_window_view(values, rows), axis=1)[whole]
    return float(medians.max()) if len(medians) else float(np.median(values))


def gaps_over_time(agreement: Agreement, body: BodyModel, core: Sequence[str], camera: str) -> Array:
    """(T,) by how much a camera contradicts the core [m], the median of its links; NaN where unknown."""
    others = [name for name in core if name != camera]
    links = [link for link in camera_links(body, body.mounts, [*others, camera]) if camera in (link.first, link.second)]
    gaps = [link.gap(agreement.registered(link.first), agreement.registered(link.second)) for link in links]
    return median_of(np.array(gaps)) if gaps else np.full(len(agreement.seconds), np.nan)


def median_of(values: Array) -> Array:
    """Medians (T,) of columns of values (K, T); NaN of a column that is all NaN."""
    medians = np.full(values.shape[1], np.nan)
    known = np.isfinite(values).any(axis=0)
    medians[known] = np.nanmedian(values[:, known], axis=0)
    return medians


def _registration_rank(agreement: Agreement, camera: str) -> float:
    """How well a camera is registered: where nothing else tells, the lens and the share of images do."""
    lens = agreement.lens_errors.get(camera)
    return agreement.counts[camera].share - (0.0 if lens is None else abs(lens.scale) + lens.centre)
