"""What cannot be held together: the attachments that stay open when all others are closed, and what they contradict."""

from dataclasses import dataclass

import numpy as np

from bodycam_ros.geometry import Array
from bodycam_ros.kinematics.joint_gap import joint_gap
from bodycam_ros.mobility.closing import closed, closes, nearest, placed
from bodycam_ros.mobility.mechanism import Configuration, Mechanism
from bodycam_ros.mobility.open_loops import open_loops


@dataclass(frozen=True)
class Contradiction:
    """A loop that does not close.

    Attributes:
        name: of the attachment, or of the body's own joint.
        apart_m: how near its points come to each other at best, the worst of them, while all others hold [m].
        turned_rad: by how much it is turned from what it permits then [rad].
        against: loops any one of which, given up, would let it close.
    """

    name: str
    apart_m: float
    turned_rad: float
    against: tuple[str, ...]


def without_contradictions(mechanism: Mechanism) -> tuple[Configuration, tuple[Contradiction, ...]]:
    """A configuration that closes as many loops as can be closed together, and the loops that it leaves open."""
    configuration = closed(mechanism, placed(mechanism))
    left_open = set(open_loops(mechanism, configuration))
    for name in sorted(left_open, key=lambda name: _apart(mechanism, configuration, name)[0]):
        tried = closes(mechanism, configuration, left_open - {name})
        if tried is not None:
            left_open -= {name}
            configuration = tried
    if not left_open:
        return configuration, ()
    configuration = closed(mechanism, [configuration], left_open)
    left_open |= set(open_loops(mechanism, configuration))
    stretched = nearest(mechanism, configuration, left_open)
    kept = [joint.name for joint in mechanism.loops if joint.name not in left_open]
    found = []
    for name in sorted(left_open):
        others = left_open - {name}
        against = tuple(other for other in kept if closes(mechanism, stretched, others | {other}) is not None)
        found.append(Contradiction(name, *_apart(mechanism, stretched, name), against))
    return configuration, tuple(found)


def _apart(mechanism: Mechanism, configuration: Configuration, name: str) -> tuple[float, float]:
    """How far a loop is open: [m], the worst of an attachment's points, and [rad]."""
    joint = next(joint for joint in mechanism.loops if joint.name == name)
    poses, index = mechanism.poses(configuration), mechanism.body.segment_index
    parent, child = poses[index[joint.parent]], poses[index[joint.child]]
    gap = joint_gap(mechanism.loop(joint, configuration), parent, child)
    turned = float(np.linalg.norm(gap[:3]))
    attachments = () if mechanism.equipment is None else mechanism.equipment.attachments
    for attachment in attachments:
        if attachment.name == name:
            return float(attachment.distances(child, _shifted(parent, configuration, name)).max()), turned
    return float(np.linalg.norm(gap[3:])), turned


def _shifted(world_T_equipment: Array, configuration: Configuration, name: str) -> Array:
    shifted = world_T_equipment.copy()
    shifted[:3, 3] += shifted[:3, :3] @ configuration.shifts.get(name, np.zeros(3))
    return shifted
