"""Static cameras beside worn ones: what each instant takes from them, and what it leaves to the worn."""

from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass, field, replace
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.body_state import BodyFrame, BodyUncertainty, SegmentPose
from bodycam_ros.geometry import Array, exp_se3, inverse, log_se3


@dataclass(frozen=True, eq=False)
class SeenBody:
    """What all static cameras say of an instant.

    Attributes:
        evidence: camera -> what it says of each segment that it sees.
        together: what they say together of each segment that any sees, where the body as a whole has it.
        world_T_segment: (S, 4, 4) the body as a whole, joints closed.
        confidence: camera -> (S,) how sure it is of each segment, 0 to 1.
        jumped: rows of segments that were looked for, and may be somewhere else than before.
        unsupported: rows of segments that the images do not show where the body has them.
        misplaced: cameras whose images do not show the body where the others have it.
        surface_variances: (S, 6) of errors in the segments' axes that last for a recording, rotation [rad^2] then
            translation [m^2]; empty for none.
    """

    evidence: Mapping[str, list[SegmentPose]]
    together: list[SegmentPose]
    world_T_segment: Array
    confidence: Mapping[str, Array]
    jumped: frozenset[int] = frozenset()
    unsupported: frozenset[int] = frozenset()
    misplaced: frozenset[str] = frozenset()
    surface_variances: Array = field(default_factory=lambda: np.zeros(0))


class Onlookers(Protocol):
    """Static cameras around a body."""

    def begin(self, frame: BodyFrame) -> list[SegmentPose]:
        """Where the body was placed by hand, at the first instant; empty if nobody did."""

    def look(self, frame: BodyFrame, expected: Array, dt_s: float, known: Collection[SegmentPose]) -> SeenBody | None:
        """What they say of one instant of a body that is expected at poses (S, 4, 4); None if they cannot tell.

        Args:
            frame: what they saw or said.
            expected: where the body should be.
            dt_s: since the instant before [s]; 0 where there is none.
            known: what the worn cameras say of the instant.
        """


_SEEN_RAD = 0.2
"""Sigma of joints that static cameras see, beside what they say of the segments: it holds what no contour tells."""

_KNOWN_S = 0.1
"""What worn cameras said so lately is known of an instant of which static ones alone speak, for each runs freely."""

_GONE_ON = np.diag(np.repeat([0.03, 0.01], 3) ** 2)
"""[rad], [m] how far a segment may be from where it should be by then."""

_UNSUPPORTED = np.repeat([1.0, 0.3], 3)
"""[rad], [m] sigmas of a segment that the images do not show where the body has it."""

Mask = NDArray[np.bool_]


@dataclass(frozen=True)
class ToldJoints:
    """Joints that static cameras see.

    Attributes:
        which: (J,) of the joints in ``BodyModel.tree_joints``.
        rotations: (J, 3, 3) of all joints; those of ``which`` count.
        sigma: how far a joint may be from it [rad].
    """

    which: Mask
    rotations: Array
    sigma: float


class LookingOn:
    """Asks the static cameras of a body, and remembers what they saw of the latest instant.

    Args:
        body: that is looked at.
        onlookers: static cameras; None where there are none.

    Attributes:
        seen: what they say of the latest instant.
        rows: (S,) which segments any of them sees; those of the instant before until it is asked.
    """

    def __init__(self, body: BodyModel, onlookers: Onlookers | None) -> None:
        self._body, self._onlookers = body, onlookers
        self.seen = SeenBody({}, [], np.zeros((len(body.segments), 4, 4)), {})
        self.rows = np.zeros(len(body.segments), bool)
        self._known: Collection[SegmentPose] = ()
        self._known_since_s = 0.0

    def begin(self, frame: BodyFrame, worn: Iterable[SegmentPose]) -> list[SegmentPose]:
        """Where the body was placed by hand, at the first instant, but for what worn cameras know."""
        placed = self._onlookers.begin(frame) if self._onlookers and (frame.images or frame.said) else []
        known = {each.segment for each in worn}
        return [each for each in placed if each.segment not in known]

    def look(self, frame: BodyFrame, path: Array, dt_s: float, known: Collection[SegmentPose]) -> None:
        """Ask them of an instant at which the body should be at poses (S, 4, 4).

        Args:
            frame: what they saw or said.
            path: where the body should be.
            dt_s: since the instant before [s].
            known: what the worn cameras say.
        """
        known = self._lately_known(path, dt_s, known)
        asked, before = self._onlookers if frame.images or frame.said else None, self.seen.world_T_segment
        seen = asked.look(frame, path, dt_s, known) if asked else None
        if seen and dt_s > 0.0:
            seen = self._at_instant(seen, frame, log_se3(inverse(before) @ path) / dt_s)
        self.seen = seen or SeenBody({}, [], path, {})
        self.rows = np.zeros(len(path), bool)
        self.rows[[self._body.segment_index[each.segment] for each in self.seen.together]] = True

    def _lately_known(self, path: Array, dt_s: float, known: Collection[SegmentPose]) -> Collection[SegmentPose]:
        """What worn cameras say; where they say nothing, what they said just before, gone on to poses (S, 4, 4)."""
        self._known_since_s = 0.0 if known or dt_s == 0.0 else self._known_since_s + dt_s
        if known or dt_s == 0.0:
            self._known = known
            return known
        if self._known_since_s > _KNOWN_S:
            return known
        row = self._body.segment_index
        return [SegmentPose(e.segment, path[row[e.segment]], e.covariance + _GONE_ON) for e in self._known]

    def _at_instant(self, seen: SeenBody, frame: BodyFrame, velocities: Array) -> SeenBody:
        """What each says carried from its own image's time to the instant, at the segments' velocities (S, 6)."""
        stamps_ns = {name: image.stamp_ns for name, image in frame.images.items()}
        stamps_ns |= {name: said.stamp_ns for name, said in frame.said.items()}
        evidence = dict(seen.evidence)
        for name, shown in seen.evidence.items():
            if late_ns := stamps_ns.get(name, frame.stamp_ns) - frame.stamp_ns:
                rows = [self._body.segment_index[each.segment] for each in shown]
                steps = exp_se3(-1e-9 * late_ns * velocities[rows])
                evidence[name] = [
                    replace(each, world_T_segment=each.world_T_segment @ step)
                    for each, step in zip(shown, steps, strict=True)
                ]
        return replace(seen, evidence=evidence)

    @property
    def unsupported(self) -> Mask:
        """(S,) segments that the images do not show where the body has them."""
        rows = np.zeros(len(self.rows), bool)
        rows[list(self.seen.unsupported)] = True
        return rows

    def widen(self, uncertainty: BodyUncertainty, on_body: Mask) -> BodyUncertainty:
        """Covariances with the errors of static cameras that last for a recording: their surfaces are wrong.

        Args:
            uncertainty: by the solver, which takes the errors of different frames as independent.
            on_body: (S,) segments that cameras on the body measure.
        """
        added = np.zeros((len(self.rows), 6))
        if len(self.seen.surface_variances):
            added[self.rows & ~on_body] = self.seen.surface_variances[self.rows & ~on_body]
        added[self.unsupported & ~on_body] = _UNSUPPORTED**2
        joints, segments = uncertainty.joints.copy(), uncertainty.segments.copy()
        segments += added[:, :, None] * np.eye(6)
        children = self._body.joint_ends[:, 1]
        joints += added[children, :3, None] * np.eye(3)
        root = segments[self._body.segment_index[self._body.root]]
        return replace(uncertainty, root=root, joints=joints, segments=segments)

    @property
    def evidence(self) -> list[SegmentPose]:
        """All that they say of the instant."""
        return [each for said in self.seen.evidence.values() for each in said]

    @property
    def speaking(self) -> int:
        """How many of them say something."""
        return sum(bool(said) for said in self.seen.evidence.values())

    def path(self, path: Array, observed: Mask) -> Array:
        """Poses (S, 4, 4) where worn cameras have the segments that they observe (S,), and static ones the others."""
        return np.where(observed[:, None, None], path, self.seen.world_T_segment) if self.rows.any() else path

    def told(self, observed: Mask) -> ToldJoints:
        """Joints of which they see segments that worn cameras do not observe (S,), where they have them.

        To be expected there, for no contour tells how a limb spins about its long axis.
        """
        ends = self._body.joint_ends
        seen = (observed | self.rows)[ends].all(axis=1) & ~observed[ends].all(axis=1) & self.rows.any()
        return ToldJoints(seen, self._body.joint_rotations(self.seen.world_T_segment), _SEEN_RAD)

    def with_worn(self, worn: Mapping[str, SegmentPose]) -> Mapping[str, SegmentPose]:
        """What worn cameras say of their segments, and static ones together of those that carry none."""
        theirs = {each.segment for each in worn.values()}
        return dict(worn) | {f"outside {e.segment}": e for e in self.seen.together if e.segment not in theirs}
