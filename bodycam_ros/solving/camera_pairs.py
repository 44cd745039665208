"""Which cameras have a point of the body in common, so that they can be asked about each other."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.body.body_model import BodyModel

Array = NDArray[np.float64]


@dataclass(frozen=True)
class CameraPair:
    """Two cameras that have a point in common: a joint between their segments, or their one segment's origin.

    Attributes:
        a, b: the cameras.
        on_a, on_b: (3,) the point on their segments [m].
        rigid: whether one segment carries both, so that they turn alike, too.
    """

    a: str
    b: str
    on_a: Array
    on_b: Array
    rigid: bool


def comparable_pairs(body: BodyModel) -> list[CameraPair]:
    """All pairs of a body's cameras that can be compared."""
    origin = np.zeros(3)
    pairs = [
        CameraPair(a, b, origin, origin, True)
        for segment in body.segments
        for a, b in combinations(body.cameras_on(segment), 2)
    ]
    return pairs + [
        CameraPair(a, b, joint.parent_T_joint[:3, 3], joint.child_T_joint[:3, 3], False)
        for joint in body.joints
        if joint.type != "free"
        for a in body.cameras_on(joint.parent)
        for b in body.cameras_on(joint.child)
    ]


@dataclass(frozen=True, eq=False)
class SpeakingPairs:
    """Those pairs (P) of which both cameras speak.

    Attributes:
        names: (P) of the two cameras.
        a, b: (P) their numbers.
        on_a, on_b: (P, 3) the point on their segments [m].
        rigid: (P) whether one segment carries both.
    """

    names: list[tuple[str, str]]
    a: NDArray[np.intp]
    b: NDArray[np.intp]
    on_a: Array
    on_b: Array
    rigid: NDArray[np.bool_]

    @classmethod
    def of(cls, pairs: Iterable[CameraPair], number: Mapping[str, int]) -> "SpeakingPairs":
        """Of all pairs those whose cameras have a number."""
        speaking = [pair for pair in pairs if pair.a in number and pair.b in number]
        return cls(
            [(pair.a, pair.b) for pair in speaking],
            np.array([number[pair.a] for pair in speaking], np.intp),
            np.array([number[pair.b] for pair in speaking], np.intp),
            np.array([pair.on_a for pair in speaking]).reshape(-1, 3),
            np.array([pair.on_b for pair in speaking]).reshape(-1, 3),
            np.array([pair.rigid for pair in speaking], bool),
        )
