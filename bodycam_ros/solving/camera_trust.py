"""Which registrations the body is solved from: those that the other cameras, or the body's own motion, bear out.

A wrong registration is seldom alone: a camera of the same segment, or of a segment that a joint ties to it, says
otherwise. So the cameras are asked first, pair by pair, and whoever is contradicted by more of the others than agree
with it is refused. Only where nobody can be asked does the body's own prediction decide, and a camera that insists is
believed against it: a state gone wrong would refuse all cameras for ever.
"""

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.geometry import inverse, log_se3
from bodycam_ros.settings import setting
from bodycam_ros.solving.camera_evidence import SegmentPose
from bodycam_ros.solving.camera_pairs import SpeakingPairs, comparable_pairs
from bodycam_ros.solving.motion import MotionSettings, motion_sigmas

_SIGMAS = 3.0
"""What two registrations may differ by beyond the tolerance: their own scatter."""

_EXTRAPOLATED = 5.0
_DIAGONAL = np.arange(6)
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
        # Of every segment: when it was last seen, and for how many instants in a row.
        self._seen_ns = np.full(len(body.segments), -1, np.int64)
        self._streaks = np.zeros(len(body.segments), int)
        self._refusals: Counter[str] = Counter()
        self._pairs = comparable_pairs(body)
        self._pairs_of: tuple[tuple[str, ...], SpeakingPairs] = (), SpeakingPairs.of((), {})

    def judge(self, evidence: Mapping[str, SegmentPose], predicted: Pose | None, stamp_ns: int) -> Trusted:
        """Part what is believed from what is refused.

        Args:
            evidence: camera -> its registration.
            predicted: (S, 4, 4) where the body should be; None while nothing is known.
            stamp_ns: of the instant.
        """
        said = _Said.of(self._body, evidence, predicted)
        surprise = dict(zip(evidence, self._surprise(said, stamp_ns).tolist(), strict=True))
        agreeing, opposing = self._ask_each_other(said)
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
        kept = np.array([camera not in refused for camera in evidence], bool)
        rows = said.rows[kept]
        self._seen_ns[rows] = stamp_ns
        streaks = self._streaks[rows] + 1
        self._streaks[:] = 0
        self._streaks[rows] = streaks
        jumped = frozenset(
            row
            for row, camera in zip(rows.tolist(), believed, strict=True)
            if surprise[camera] > self._settings.max_jump
        )
        return Trusted(believed, frozenset(refused), self._seats(said, np.flatnonzero(kept)), jumped)

    def _surprise(self, said: "_Said", stamp_ns: int) -> Pose:
        """Sigmas (N) between registrations and prediction, allowing for what may have happened while unseen."""
        if said.errors is None:
            return np.zeros(len(said.rows))
        seen_ns = self._seen_ns[said.rows]
        unseen_s = 1e-9 * (stamp_ns - seen_ns)[:, None].astype(np.float64)
        reach = motion_sigmas(unseen_s, unseen_s, self._motion)
        knows_velocity = self._streaks[said.rows, None] >= _KNOWS_VELOCITY
        reach = np.where(knows_velocity, reach, np.hypot(reach, unseen_s * _VELOCITY))
        # The prediction goes on from two registrations like this one: 2 x - y has five times their variance.
        enlarged = (1.0 + _EXTRAPOLATED) * said.covariances
        enlarged[:, _DIAGONAL, _DIAGONAL] += reach**2
        return np.where(seen_ns >= 0, _distances(said.errors, enlarged), 0.0)

    def _ask_each_other(self, said: "_Said") -> tuple[dict[str, set[str]], dict[str, set[str]]]:
        """Camera -> cameras that agree with it, and cameras that contradict it."""
        agreeing: dict[str, set[str]] = {camera: set() for camera in said.cameras}
        opposing: dict[str, set[str]] = {camera: set() for camera in said.cameras}
        if self._pairs_of[0] != said.cameras:
            self._pairs_of = said.cameras, SpeakingPairs.of(self._pairs, {c: row for row, c in enumerate(said.cameras)})
        pairs = self._pairs_of[1]
        if not pairs.names:
            return agreeing, opposing
        places, variances = said.world_T_segment, np.diagonal(said.covariances, axis1=1, axis2=2)
        gaps = np.linalg.norm(_points(places[pairs.a], pairs.on_a) - _points(places[pairs.b], pairs.on_b), axis=1)
        spread = _spread(variances[pairs.a], pairs.on_a) + _spread(variances[pairs.b], pairs.on_b)
        agree = gaps < self._settings.max_gap + _SIGMAS * np.sqrt(spread)
        # Two cameras of one segment see it turned alike.
        a, b = pairs.a[pairs.rigid], pairs.b[pairs.rigid]
        cosines = 0.5 * (np.einsum("nij,nij->n", places[a, :3, :3], places[b, :3, :3]) - 1.0)
        turning = variances[a, :3].sum(axis=1) + variances[b, :3].sum(axis=1)
        alike = np.arccos(np.clip(cosines, -1.0, 1.0)) < self._settings.max_turn + _SIGMAS * np.sqrt(turning)
        agree[pairs.rigid] &= alike
        for (one, other), near in zip(pairs.names, agree.tolist(), strict=True):
            into = agreeing if near else opposing
            into[one].add(other)
            into[other].add(one)
        return agreeing, opposing

    def _seats(self, said: "_Said", believed: NDArray[np.intp]) -> dict[int, Pose]:
        """Where the kernel would let a believed registration go, the segment starts at the surest of them."""
        if said.errors is None:
            return {}
        spreads = np.trace(said.covariances, axis1=1, axis2=2)
        surest: dict[int, int] = {}
        for row, number in zip(said.rows[believed].tolist(), believed.tolist(), strict=True):
            if row not in surest or spreads[number] < spreads[surest[row]]:
                surest[row] = number
        chosen = list(surest.values())
        far = _distances(said.errors[chosen], said.covariances[chosen]) > self._outlier_sigmas
        return {row: said.world_T_segment[surest[row]] for row, seat in zip(surest, far.tolist(), strict=True) if seat}


@dataclass(frozen=True, eq=False)
class _Said:
    """The registrations (N) of one instant.

    Attributes:
        cameras: (N) who.
        rows: (N) their segments.
        world_T_segment: (N, 4, 4).
        covariances: (N, 6, 6).
        errors: (N, 6) tangents from the prediction; None without one.
    """

    cameras: tuple[str, ...]
    rows: NDArray[np.intp]
    world_T_segment: Pose
    covariances: Pose
    errors: Pose | None

    @classmethod
    def of(cls, body: BodyModel, evidence: Mapping[str, SegmentPose], predicted: Pose | None) -> "_Said":
        rows = np.array([body.segment_index[seen.segment] for seen in evidence.values()], np.intp)
        measured = np.array([seen.world_T_segment for seen in evidence.values()]).reshape(-1, 4, 4)
        covariances = np.array([seen.covariance for seen in evidence.values()]).reshape(-1, 6, 6)
        errors = None if predicted is None else log_se3(inverse(predicted[rows]) @ measured)
        return cls(tuple(evidence), rows, measured, covariances, errors)


def _distances(errors: Pose, covariances: Pose) -> Pose:
    """How many sigmas (N) errors (N, 6) are."""
    whitened = np.linalg.solve(covariances, errors[:, :, None])[:, :, 0]
    sigmas: Pose = np.sqrt(np.einsum("ni,ni->n", errors, whitened))
    return sigmas


def _points(world_T_segment: Pose, on_segment: Pose) -> Pose:
    """Where poses (N, 4, 4) put points (N, 3) of their segments [m]."""
    points: Pose = (world_T_segment[:, :3, :3] @ on_segment[:, :, None])[:, :, 0] + world_T_segment[:, :3, 3]
    return points


def _spread(variances: Pose, on_segment: Pose) -> Pose:
    """Variance (N) of points (N, 3) of segments whose poses have variances (N, 6) [m^2]."""
    squared_arms = np.einsum("ni,ni->n", on_segment, on_segment)
    spread: Pose = variances[:, 3:].sum(axis=1) + squared_arms * variances[:, :3].sum(axis=1)
    return spread


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
