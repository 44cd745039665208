"""Gruebler's count: the freedoms of a mechanism if no two of its joints said the same (B eq. 9)."""

from collections.abc import Iterator
from dataclasses import dataclass

from bodycam_ros.kinematics.joint_gap import held_rows
from bodycam_ros.mobility.mechanism import Mechanism


@dataclass(frozen=True)
class GrueblerCount:
    """The numbers of B eq. 9.

    Attributes:
        links: N, the segments that may move.
        joints: name -> f, for all g joints.
        leaning: what a machine that may not lean loses.
    """

    links: int
    joints: dict[str, int]
    leaning: int

    @property
    def freedoms(self) -> int:
        """F = 6 N - sum (6 - f)."""
        return 6 * self.links - sum(6 - f for f in self.joints.values()) - self.leaning


def gruebler_count(mechanism: Mechanism) -> GrueblerCount:
    """Count segments and joints; what stands is the ground, and the free joint to it takes no freedom."""
    links = len(mechanism.body.segments) - len(mechanism.stands)
    leaning = 2 if mechanism.only_upright else 0
    return GrueblerCount(links, dict(_freedoms(mechanism)), leaning)


def _freedoms(mechanism: Mechanism) -> Iterator[tuple[str, int]]:
    for joint, tangents in zip(mechanism.body.tree_joints, mechanism.tangents_of_joints, strict=True):
        yield joint.name, tangents.shape[1]
    for joint in mechanism.loops:
        yield joint.name, 6 - len(held_rows(joint))
