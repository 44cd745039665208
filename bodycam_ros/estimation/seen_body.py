"""What static cameras say of a body at an instant, as the solver takes it."""

from collections.abc import Collection, Mapping
from dataclasses import dataclass
from typing import Protocol

from bodycam_ros.body_state import SegmentPose
from bodycam_ros.estimation.body_frame import BodyFrame
from bodycam_ros.geometry import Array


@dataclass(frozen=True, eq=False)
class SeenBody:
    """What all static cameras say of an instant.

    Attributes:
        evidence: camera -> what it says of each segment that it sees.
        together: what they say together of each segment that any sees, where the body as a whole has it.
        world_T_segment: (S, 4, 4) the body as a whole, joints closed.
        confidence: camera -> (S,) how sure it is of each segment, 0 to 1.
        jumped: rows of segments that were looked for, and may be somewhere else than before.
    """

    evidence: Mapping[str, list[SegmentPose]]
    together: list[SegmentPose]
    world_T_segment: Array
    confidence: Mapping[str, Array]
    jumped: frozenset[int] = frozenset()


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
