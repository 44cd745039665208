"""One instant of the chain: what was measured, what is believed of it, and what its state still waits for."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.estimation.attachment_watch import Holding
from bodycam_ros.estimation.belief import Belief, Link
from bodycam_ros.estimation.body_uncertainty import BodyUncertainty
from bodycam_ros.estimation.looking_on import ToldJoints
from bodycam_ros.estimation.measurements import Measured
from bodycam_ros.estimation.turns import SegmentTurn
from bodycam_ros.kinematics.tangent import TreeTangent

Mask = NDArray[np.bool_]


@dataclass(eq=False)
class Instant:
    """What is kept of an instant.

    Attributes:
        stamp_ns: when it is [ns].
        stamps_ns: camera -> stamp of its own image [ns].
        belief: given all that was measured until then.
        link: to the instant before; None at the first.
        measured, turns: at it, of the cameras that are believed.
        own_motion: density and times (K) of its prediction, where equipment moves by itself.
        joints_seen: (J,) whether worn cameras see both segments.
        turning: (J,) whether the rotations of both are measured at least.
        told: joints that static cameras see.
        observed: (S,) whether a camera on the segment, or one that looks at it, is believed.
        cameras_used: how many are.
        uncertainty: of the belief.
        holding: which attachments of equipment hold.
        unseen: (J,) joints that later images may still tell, by their turns until they are seen.
        is_silent: whether nothing was measured, and nothing has been since.
        is_published: whether its state has gone out.
    """

    stamp_ns: int
    stamps_ns: Mapping[str, int]
    belief: Belief
    link: Link | None
    measured: Measured
    turns: Sequence[SegmentTurn]
    own_motion: tuple[Any, ...]
    joints_seen: Mask
    turning: Mask
    told: ToldJoints
    observed: Mask
    cameras_used: int
    uncertainty: BodyUncertainty
    holding: Holding | None
    unseen: Mask = field(init=False)
    is_silent: bool = field(init=False)
    is_published: bool = False

    def __post_init__(self) -> None:
        self.unseen, self.is_silent = ~self.joints_seen, not self.is_observed

    @property
    def is_observed(self) -> bool:
        """Whether any camera spoke and is believed."""
        return bool(self.observed.any())

    @property
    def is_waiting(self) -> bool:
        """Whether later images may still tell what nothing saw."""
        return self.is_silent or bool(self.unseen.any())

    def follow(self, latest: "Instant") -> None:
        """Take note of an instant after it."""
        self.unseen &= latest.turning & ~latest.joints_seen
        self.is_silent = self.is_silent and not latest.is_observed


def smoothed(instants: Sequence[Instant], tangent: TreeTangent) -> list[Belief]:
    """What is known of instants given all of them: the last one's belief, carried back to the first."""
    beliefs = [instants[-1].belief]
    for later in reversed(instants[1:]):
        assert later.link is not None  # only the first has none
        beliefs.append(later.link.smoothed(tangent, beliefs[-1], covariance=False))
    return beliefs[::-1]
