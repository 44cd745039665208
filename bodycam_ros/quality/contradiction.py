"""Cameras that contradict the others: the fewest that explain what does not fit.

Two cameras on one segment keep their pose relative to each other. Two on neighbouring segments have the joint between
them at one point of the world. Where segments without a camera lie between them, the first and the last joint are as
far apart as those segments allow. A camera that contradicts its links is wrong even if the solver followed it.
This judges a result; what the solver does with such a camera is in ``estimation/camera_gate.py``.
"""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import combinations, pairwise

import numpy as np

from bodycam_ros.body.body_model import BodyModel, CameraMount
from bodycam_ros.geometry import Array, inverse, log_so3, transform_points
from bodycam_ros.kinematics.joint import Joint
from bodycam_ros.quality.camera_poses import CameraPoses

LEVER_M = 0.3
"""From a camera to the next joint of its segment: a turn of the segment counts as the motion of that joint."""

DOUBTFUL_GAP_M = 0.06
"""Gap between two cameras that is doubtful; good recordings stay below 0.045 in their worst second."""

LEAST_STAY_S = 1.0
"""Half of this time must disagree; a wrong registration or blur passes sooner, and the solver interpolates it."""

_MIN_ROWS = 3  # states at which a link must be known


@dataclass(frozen=True, eq=False)
class CameraLink:
    """Two cameras and the joints between them.

    Attributes:
        mounts: camera -> its mount; the first and the second camera.
        joints: from the segment of the first to that of the second; none if they share a segment.
        lengths: (K) of the segments in between, from joint to joint [m]; of one joint there are none.
    """

    mounts: Mapping[str, CameraMount]
    joints: tuple[Joint, ...]
    lengths: Array

    @property
    def pair(self) -> tuple[str, str]:
        """The first and the second camera."""
        first, second = self.mounts
        return first, second

    @property
    def is_exact(self) -> bool:
        """Whether both cameras give one and the same point, not only the distance of two."""
        return not len(self.lengths)

    def other(self, camera: str) -> str:
        """The camera beside one of the two."""
        return next(name for name in self.mounts if name != camera)

    @cached_property
    def ends(self) -> dict[str, Array]:
        """Camera -> (3,) the joint nearest to it in its own frame [m]; without joints the middle of both cameras."""
        first, second = self.mounts.values()
        points = [(first.segment_T_camera + second.segment_T_camera)[:3, 3] / 2.0] * 2
        if self.joints:
            points = [_joint_on(self.joints[0], first.segment), _joint_on(self.joints[-1], second.segment)]
        poses = inverse(np.array([mount.segment_T_camera for mount in (first, second)]))
        return dict(zip(self.pair, transform_points(poses, np.array(points)[:, None])[:, 0], strict=True))

    def place(self, camera: str, world_T_camera: Array) -> Array:
        """(T, 3) its end in the world [m] by poses (T, 4, 4) of one of the two."""
        place: Array = transform_points(world_T_camera, self.ends[camera][None])[..., 0, :]
        return place

    def gap(self, poses: CameraPoses) -> Array:
        """(T,) by how much the two registrations contradict the body [m]; NaN where one is unknown.

        Cameras on one segment that turned against each other are as wrong as the turn moves a point at an arm's length,
        the next joint of a limb.
        """
        registered = [poses.registered[camera] for camera in self.pair]
        distance = np.linalg.norm(np.subtract(*map(self.place, self.pair, registered)), axis=-1)
        longest, total = float(self.lengths.max(initial=0.0)), float(self.lengths.sum())
        outside: Array = np.maximum(np.maximum(max(0.0, 2.0 * longest - total) - distance, distance - total), 0.0)
        if self.joints:
            return outside
        first, second = (
            pose @ inverse(mount.segment_T_camera) for pose, mount in zip(registered, self.mounts.values(), strict=True)
        )
        turned = np.linalg.norm(log_so3((inverse(first) @ second)[..., :3, :3]), axis=-1)
        gap: Array = np.maximum(outside, LEVER_M * turned)
        return gap


def camera_links(
    body: BodyModel, cameras: Sequence[str], mounts: Mapping[str, CameraMount] | None = None, of: str | None = None
) -> tuple[CameraLink, ...]:
    """The links between cameras without the segment of another camera between them.

    Args:
        body: segments and joints.
        cameras: names.
        mounts: camera -> its mount; by default that of the body.
        of: only links of this camera, to the others.
    """
    cameras = cameras if of is None else [*(camera for camera in cameras if camera != of), of]
    mounts = body.mounts if mounts is None else mounts
    carried = {mounts[camera].segment for camera in cameras}
    paths = {segment: _paths(body, segment, carried) for segment in carried}
    links = []
    for first, second in combinations(cameras, 2):
        start = mounts[first].segment
        joints = paths[start].get(mounts[second].segment)
        if joints is not None and (of is None or of in (first, second)):
            links.append(CameraLink({c: mounts[c] for c in (first, second)}, joints, _lengths(joints, start)))
    return tuple(links)


def _paths(body: BodyModel, start: str, carried: set[str]) -> dict[str, tuple[Joint, ...]]:
    """Segment with a camera -> the joints to it, over segments without one."""
    paths: dict[str, tuple[Joint, ...]] = {start: ()}
    pending = [start]
    while pending:
        segment = pending.pop(0)
        if segment in carried and segment != start:
            continue
        for joint in body.tree_joints:
            if joint.type != "free" and segment in (joint.parent, joint.child):
                other = joint.child if segment == joint.parent else joint.parent
                if other not in paths:
                    paths[other] = (*paths[segment], joint)
                    pending.append(other)
    return {segment: joints for segment, joints in paths.items() if segment in carried}


def _lengths(joints: Sequence[Joint], start: str) -> Array:
    """(K) lengths of the segments between the joints of a path [m]."""
    lengths, segment = [], start
    for joint, following in pairwise(joints):
        segment = joint.child if segment == joint.parent else joint.parent
        lengths.append(np.linalg.norm(_joint_on(following, segment) - _joint_on(joint, segment)))
    return np.array(lengths)


def _joint_on(joint: Joint, segment: str) -> Array:
    """(3,) position of a joint in the frame of one of its segments [m]."""
    place: Array = (joint.parent_T_joint if segment == joint.parent else joint.child_T_joint)[:3, 3]
    return place


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


def find_contradiction(poses: CameraPoses, cameras: Sequence[str]) -> Contradiction:
    """Find the cameras whose registrations contradict the body that the others agree on.

    Args:
        poses: over time.
        cameras: those that were registered at all.
    """

    def rank(camera: str) -> float:
        lens = poses.lens_errors.get(camera)
        return poses.counts[camera].share - (0.0 if lens is None else abs(lens.scale) + lens.centre)

    gaps: dict[tuple[str, str], float] = {}
    rivals: dict[str, str] = {}
    core, blamed = list(cameras), [""]
    # Without the blamed, cameras on either side of them are linked over more joints: another may not fit.
    while blamed and core:
        gaps |= lasting_gaps(poses, camera_links(poses.body, core))
        blamed, more = blame({pair: gap for pair, gap in gaps.items() if set(pair) <= set(core)}, DOUBTFUL_GAP_M, rank)
        core, rivals = [camera for camera in core if camera not in blamed], rivals | more
    worst = {c: max(gap for pair, gap in gaps.items() if c in pair) for c in cameras if c not in core}
    return Contradiction(tuple(core), worst, rivals)


def blame(
    gaps: Mapping[tuple[str, str], float], limit: float, rank: Callable[[str], float]
) -> tuple[list[str], dict[str, str]]:
    """The fewest cameras that all links beyond the limit have part in: greedily, the most contradicted first.

    Args:
        gaps: (camera, camera) -> by how much the two disagree.
        limit: of a gap.
        rank: how well a camera is registered; of two that are alike the worse is blamed.

    Returns:
        The cameras, and for each whose opposite could be blamed as well, that one.
    """
    bad = {pair for pair, gap in gaps.items() if gap > limit}
    good = set(gaps) - bad
    blamed: list[str] = []
    rivals: dict[str, str] = {}
    while bad:
        weights = {
            camera: sum(camera in pair for pair in bad) - sum(camera in pair for pair in good)
            for camera in {camera for pair in bad for camera in pair}
        }
        worst = max(weights, key=lambda camera: (weights[camera], -rank(camera), camera))
        opposites = [camera for pair in bad if worst in pair for camera in pair if camera != worst]
        if len(opposites) == 1 and weights[opposites[0]] == weights[worst]:
            rivals[worst] = opposites[0]
        blamed.append(worst)
        # Agreement with a blamed camera does not count.
        bad, good = ({pair for pair in pairs if worst not in pair} for pairs in (bad, good))
    return blamed, rivals


def lasting_gaps(poses: CameraPoses, links: Iterable[CameraLink]) -> dict[tuple[str, str], float]:
    """(camera, camera) -> the gap that the two keep in their worst time [m], of known links."""
    gaps = {link.pair: lasting(link.gap(poses), poses.seconds) for link in links}
    return {pair: gap for pair, gap in gaps.items() if np.isfinite(gap)}


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


def gaps_over_time(poses: CameraPoses, core: Sequence[str], camera: str) -> Array:
    """(T,) by how much a camera contradicts the core [m], the median of its links; NaN where unknown."""
    links = camera_links(poses.body, core, of=camera)
    gaps = np.array([link.gap(poses) for link in links]).reshape(-1, len(poses.seconds))
    medians, known = np.full(gaps.shape[1], np.nan), np.isfinite(gaps).any(axis=0)
    medians[known] = np.nanmedian(gaps[:, known], axis=0)
    return medians
