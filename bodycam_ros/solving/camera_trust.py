"""Which registrations the body is solved from: those that the other cameras, or the body's own motion, bear out.

A wrong registration is seldom alone: a camera of the same segment, or of a segment that a joint ties to it, says
otherwise. So the cameras are asked first, pair by pair, and whoever is contradicted by more of the others than agree
with it is refused. Only where nobody can be asked does the body's own prediction decide, and a camera that insists is
believed against it: a state gone wrong would refuse all cameras for ever.
"""

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.geometry import inverse, log_se3
from bodycam_ros.settings import setting
from bodycam_ros.solving.camera_evidence import SegmentPose
from bodycam_ros.solving.motion import MotionSettings, motion_sigmas

_SIGMAS = 3.0
"""What two registrations may differ by beyond the tolerance: their own scatter."""

_EXTRAPOLATED = 5.0
_KNOWS_VELOCITY = 2  # instants in a row at which a segment was seen
_VELOCITY = np.repeat([6.0, 2.0], 3)
"""Sigmas [rad/s], [m/s] of people's segments, as long as nothing is known of their motion."""

Pose = NDArray[np.float64]


@dataclass(frozen=True)
class TrustSettings:
    """When a camera is believed against the others and against the body."""

    max_gap: float = setting(
        0.08,
        unit="m",
        limits=(0.005, 2.0),
        reason="two cameras that put one joint this far apart contradict each other; a body is known better than this",
    )
    max_turn: float = setting(
        0.25, unit="rad", limits=(0.01, 3.2), reason="the same for the rotation of a segment that carries both"
    )
    max_jump: float = setting(
        5.0,
        limits=(1.0, 100.0),
        reason="sigmas of its motion by which a segment may surprise; farther, and nobody else to ask, it is refused",
    )
    max_refusals: int = setting(
        3,
        unit="frames",
        limits=(1, 100),
        reason="a camera that nobody contradicts and that insists for this many frames in a row is believed",
    )


@dataclass(frozen=True)
class Trusted:
    """The outcome of one instant.

    Attributes:
        evidence: camera -> its registration, of the cameras that are believed.
        refused: cameras that are not.
        seats: row of a segment -> pose (4, 4) at which it starts, because its cameras are far from the prediction.
        jumped: rows of segments that did not move there: what they were taken to be before is no motion to go on with.
    """

    evidence: dict[str, SegmentPose]
    refused: frozenset[str]
    seats: dict[int, Pose]
    jumped: frozenset[int]


class CameraTrust:
    """Remembers when segments were seen and who was refused.

    Args:
        body: segments, joints and mounts.
        outlier_sigmas: scale of the kernel on registrations; a segment farther off starts anew.
        settings: thresholds.
        motion: how far a segment gets in a given time.
    """

    def __init__(self, body: BodyModel, outlier_sigmas: float, settings: TrustSettings, motion: MotionSettings) -> None:
        self._body = body
        self._outlier_sigmas = outlier_sigmas
        self._settings = settings
        self._motion = motion
        self._seen_ns: dict[str, int] = {}
        self._streaks: Counter[str] = Counter()
        self._refusals: Counter[str] = Counter()
        self._pairs = _comparable_pairs(body)

    def judge(self, evidence: Mapping[str, SegmentPose], predicted: Pose | None, stamp_ns: int) -> Trusted:
        """Part what is believed from what is refused.

        Args:
            evidence: camera -> its registration.
            predicted: (S, 4, 4) where the body should be; None while nothing is known.
            stamp_ns: of the instant.
        """
        surprise = self._surprise(evidence, predicted, stamp_ns)
        agreeing, opposing = self._ask_each_other(evidence)
        contradicted = _outvoted(agreeing, opposing, surprise)
        refused = set(contradicted)
        for camera in set(evidence) - refused:
            if surprise[camera] > self._settings.max_jump and not (agreeing[camera] - refused):
                self._refusals[camera] += 1
                if self._refusals[camera] <= self._settings.max_refusals:
                    refused.add(camera)
            else:
                self._refusals[camera] = 0
        believed = {camera: seen for camera, seen in evidence.items() if camera not in refused}
        seats = {} if predicted is None else self._seats(believed, predicted)
        segments = {seen.segment for seen in believed.values()}
        self._seen_ns |= dict.fromkeys(segments, stamp_ns)
        self._streaks = Counter({segment: self._streaks[segment] + 1 for segment in segments})
        jumped = {
            self._body.segment_index[seen.segment]
            for camera, seen in believed.items()
            if surprise[camera] > self._settings.max_jump
        }
        return Trusted(believed, frozenset(refused), seats, frozenset(jumped))

    def _surprise(self, evidence: Mapping[str, SegmentPose], predicted: Pose | None, stamp_ns: int) -> dict[str, float]:
        """Camera -> sigmas between registration and prediction, allowing for what may have happened while unseen."""
        if predicted is None or not evidence:
            return dict.fromkeys(evidence, 0.0)
        unseen_s = [1e-9 * (stamp_ns - self._seen_ns.get(seen.segment, 0)) for seen in evidence.values()]
        moved = np.stack(
            [np.diag(self._reach(seen.segment, s) ** 2) for seen, s in zip(evidence.values(), unseen_s, strict=True)]
        )
        # The prediction goes on from two registrations like this one: 2 x - y has five times their variance.
        predicted_from = _EXTRAPOLATED * np.stack([seen.covariance for seen in evidence.values()])
        sigmas = self._distances(evidence, predicted, moved + predicted_from)
        known = [seen.segment in self._seen_ns for seen in evidence.values()]
        return dict(zip(evidence, np.where(known, sigmas, 0.0).tolist(), strict=True))

    def _reach(self, segment: str, unseen_s: float) -> Pose:
        """Sigmas (6) of how far a segment may have gone from its prediction, rotation [rad] then translation [m]."""
        sigmas = motion_sigmas(unseen_s, unseen_s, self._motion)
        if self._streaks[segment] >= _KNOWS_VELOCITY:
            return sigmas
        return np.hypot(sigmas, unseen_s * _VELOCITY)

    def _distances(self, evidence: Mapping[str, SegmentPose], predicted: Pose, more: Pose) -> Pose:
        """Sigmas (N) from prediction (S, 4, 4) to registrations, whose covariances ``more`` (N, 6, 6) enlarges."""
        rows = [self._body.segment_index[seen.segment] for seen in evidence.values()]
        measured = np.stack([seen.world_T_segment for seen in evidence.values()])
        errors = log_se3(inverse(predicted[rows]) @ measured)
        covariances = np.stack([seen.covariance for seen in evidence.values()]) + more
        whitened = np.linalg.solve(covariances, errors[:, :, None])[:, :, 0]
        sigmas: Pose = np.sqrt(np.einsum("ni,ni->n", errors, whitened))
        return sigmas

    def _ask_each_other(self, evidence: Mapping[str, SegmentPose]) -> tuple[dict[str, set[str]], dict[str, set[str]]]:
        """Camera -> cameras that agree with it, and cameras that contradict it."""
        agreeing: dict[str, set[str]] = {camera: set() for camera in evidence}
        opposing: dict[str, set[str]] = {camera: set() for camera in evidence}
        pairs = [pair for pair in self._pairs if pair.a in evidence and pair.b in evidence]
        if not pairs:
            return agreeing, opposing
        point_a, spread_a = _points([evidence[pair.a] for pair in pairs], np.stack([pair.on_a for pair in pairs]))
        point_b, spread_b = _points([evidence[pair.b] for pair in pairs], np.stack([pair.on_b for pair in pairs]))
        gaps = np.linalg.norm(point_a - point_b, axis=1)
        agree = gaps < self._settings.max_gap + _SIGMAS * np.sqrt(spread_a + spread_b)
        for pair, near in zip(pairs, agree.tolist(), strict=True):
            near = near and (not pair.rigid or self._turn_agrees(evidence[pair.a], evidence[pair.b]))
            into = agreeing if near else opposing
            into[pair.a].add(pair.b)
            into[pair.b].add(pair.a)
        return agreeing, opposing

    def _turn_agrees(self, a: SegmentPose, b: SegmentPose) -> bool:
        """Whether two cameras of one segment see it turned alike."""
        cosine = 0.5 * (np.sum(a.world_T_segment[:3, :3] * b.world_T_segment[:3, :3]) - 1.0)
        spread = np.trace(a.covariance[:3, :3]) + np.trace(b.covariance[:3, :3])
        return bool(np.arccos(np.clip(cosine, -1.0, 1.0)) < self._settings.max_turn + _SIGMAS * np.sqrt(spread))

    def _seats(self, believed: Mapping[str, SegmentPose], predicted: Pose) -> dict[int, Pose]:
        """Where the kernel would let a believed registration go, the segment starts at the surest of them."""
        if not believed:
            return {}
        surest: dict[str, SegmentPose] = {}
        for seen in believed.values():
            best = surest.get(seen.segment)
            if best is None or np.trace(seen.covariance) < np.trace(best.covariance):
                surest[seen.segment] = seen
        far = self._distances(surest, predicted, np.zeros((6, 6))) > self._outlier_sigmas
        return {
            self._body.segment_index[segment]: seen.world_T_segment
            for (segment, seen), seat in zip(surest.items(), far, strict=True)
            if seat
        }


@dataclass(frozen=True)
class _Pair:
    """Two cameras that have a point in common: a joint between their segments, or their one segment's origin."""

    a: str
    b: str
    on_a: Pose
    on_b: Pose
    rigid: bool


def _comparable_pairs(body: BodyModel) -> list[_Pair]:
    origin = np.zeros(3)
    pairs = [
        _Pair(a, b, origin, origin, True)
        for segment in body.segments
        for a, b in combinations(body.cameras_on(segment), 2)
    ]
    return pairs + [
        _Pair(a, b, joint.parent_T_joint[:3, 3], joint.child_T_joint[:3, 3], False)
        for joint in body.joints
        for a in body.cameras_on(joint.parent)
        for b in body.cameras_on(joint.child)
    ]


def _points(seen: Sequence[SegmentPose], on_segment: Pose) -> tuple[Pose, Pose]:
    """Where registrations put points (N, 3) of their segments (N, 3) [m], and the variance of that (N)."""
    world_T_segment = np.stack([s.world_T_segment for s in seen])
    variances = np.diagonal(np.stack([s.covariance for s in seen]), axis1=1, axis2=2)
    points = (world_T_segment[:, :3, :3] @ on_segment[:, :, None])[:, :, 0] + world_T_segment[:, :3, 3]
    squared_arms = np.einsum("ni,ni->n", on_segment, on_segment)
    return points, variances[:, 3:].sum(axis=1) + squared_arms * variances[:, :3].sum(axis=1)


def _outvoted(
    agreeing: Mapping[str, set[str]], opposing: Mapping[str, set[str]], surprise: Mapping[str, float]
) -> set[str]:
    """Cameras refused one by one, the most contradicted first, until the rest contradict each other no more.

    Of two that stand alone against each other the one goes that surprises more.
    """
    refused: set[str] = set()
    while True:
        contradictions = {c: len(opposing[c] - refused) for c in agreeing if c not in refused}
        worst = max(
            (camera for camera, count in contradictions.items() if count),
            key=lambda c: (contradictions[c] - len(agreeing[c] - refused), surprise[c], c),
            default=None,
        )
        if worst is None:
            return refused
        refused.add(worst)
