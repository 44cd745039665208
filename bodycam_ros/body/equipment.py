"""What a body is coupled to: its own segments and joints, and the points at which the body holds it (B 3.2).

A constraint is a row in a joint table. The point pairs of an attachment (B eq. 15) bound how far its two segments may
be from each other; summed up they are one joint with six sigmas, like any other (``equipment``).

The sum of squares of N weighted distances between the points of two rigid segments depends, to first order, on six
numbers: with the joint's frame at the weighted centroid and its axes along the points' principal axes, shift and turn
come apart (B eq. 15-19 as a quadratic form). One pair holds a place, two let the segments turn about their line, three
or more weld.
"""

import logging
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Annotated

import msgspec
import numpy as np
from numpy.typing import NDArray

from bodycam_ros.body.body_model import BodyModel, CameraMount
from bodycam_ros.body.checked_fields import Entry
from bodycam_ros.errors import BodyError
from bodycam_ros.geometry import Array, nearest_rotation, rigid, transform_points
from bodycam_ros.kinematics.joint import LOOSE_RAD, Joint

_Acceleration = Annotated[float, msgspec.Meta(ge=0.01, le=1e4)]
Interval = tuple[float, float]
"""From and until, seconds since the recording's first image; the end may be infinite."""


class SegmentMotion(Entry):
    """How a segment of the equipment moves, as its file has it.

    Attributes:
        stands: it does not move in the world at all (a bicycle on a roller); the sigmas then mean nothing.
        keeps_speed: it keeps its speed while it is unobserved (a crank, a wheel); else it comes to rest, as
            the segments of a body do.
        angular_acceleration_sigma, acceleration_sigma: how suddenly it changes its motion [rad/s^2], [m/s^2]; None: as
            the body's segments.
    """

    stands: bool = False
    keeps_speed: bool = False
    angular_acceleration_sigma: _Acceleration | None = msgspec.field(default=None, name="angular_acceleration")
    acceleration_sigma: _Acceleration | None = msgspec.field(default=None, name="acceleration")


@dataclass(frozen=True, eq=False)
class Attachment:
    """Where the body holds the equipment: N pairs of points that should coincide (B eq. 15-19).

    Attributes:
        name: unique among the attachments.
        body_segment: of the body.
        equipment_segment: of the equipment.
        on_body: (N, 3) points on the body's segment [m].
        on_equipment: (N, 3) the same points on the equipment's segment [m].
        sigmas: (N) how far the two may be from each other, the weight of the pair [m].
        unknown: (3) how far the equipment's points may be, all together, from where the file has them, in the axes of
            its segment [m]; zero along what is known. What is unknown is estimated.
        intervals: when it holds; None: always.
        detected: whether it is let go, within its intervals, while what is seen of the body contradicts it.
        optional: whether bodies without its segment do without it (``equipment``).
    """

    name: str
    body_segment: str
    equipment_segment: str
    on_body: Array
    on_equipment: Array
    sigmas: Array
    unknown: Array = field(default_factory=lambda: np.zeros(3))
    intervals: tuple[Interval, ...] | None = None
    detected: bool = True
    optional: bool = False

    def holds_at(self, seconds: float) -> bool:
        """Whether the file has it active at a time since the recording's first image [s]."""
        return self.intervals is None or any(start <= seconds <= end for start, end in self.intervals)

    def distances(self, world_T_body: Array, world_T_equipment: Array) -> NDArray[np.float64]:
        """(N) distances [m] between the points of its pairs, of the poses (4, 4) of its two segments (B eq. 15)."""
        body = transform_points(world_T_body, self.on_body)
        apart = body - transform_points(world_T_equipment, self.on_equipment)
        return np.asarray(np.linalg.norm(apart, axis=1), np.float64)


@dataclass(frozen=True, eq=False)
class Equipment:
    """A machine, board or bar.

    Attributes:
        name: of the equipment; its segments are added to the body's.
        root: the segment that carries the others.
        segments: name -> how it moves.
        joints: between its own segments, in the order of the file.
        attachments: to the body.
        unknown: joint -> (3) how far its place on its parent may be from where the file has it, in the parent's axes
            [m]; joints that are not in it are known.
        upright_sigma: by how much its root's z axis may lean from the vertical [rad]; infinite: it may lie as it likes.
        mounts: camera -> where on the equipment it sits.
    """

    name: str
    root: str
    segments: Mapping[str, SegmentMotion]
    joints: tuple[Joint, ...]
    attachments: tuple[Attachment, ...]
    unknown: Mapping[str, Array] = field(default_factory=dict)
    upright_sigma: float = np.inf
    mounts: Mapping[str, CameraMount] = field(default_factory=dict)


logger = logging.getLogger(__name__)


def fitted_equipment(equipment: Equipment, body: BodyModel) -> Equipment:
    """The equipment without its optional attachments to segments that the body does not have; each is logged.

    Raises:
        BodyError: a needed attachment is to such a segment, or none is left; the message names both.
    """
    missing = [each for each in equipment.attachments if each.body_segment not in body.segments]
    if not missing:
        return equipment
    has = f"body {body.name} does not have; it has {', '.join(body.segments)}"
    if needed := [each for each in missing if not each.optional]:
        name, segment = needed[0].name, needed[0].body_segment
        raise BodyError(f"equipment {equipment.name}: attachment {name} is to segment {segment}, which {has}")
    if len(missing) == len(equipment.attachments):
        segments = ", ".join(sorted({each.body_segment for each in missing}))
        raise BodyError(f"equipment {equipment.name}: all of its attachments are to {segments}, which {has}")
    logger.warning(
        "equipment %s: %d of %d attachments are not used, since body %s does not have their segments: %s",
        equipment.name, len(missing), len(equipment.attachments), body.name,
        ", ".join(f"{each.name} (to {each.body_segment})" for each in missing),
    )  # fmt: skip
    return replace(equipment, attachments=tuple(each for each in equipment.attachments if each not in missing))


_LEAST_LEVER_M = 1e-4
"""Points that are nearer to each other than this do not fix a rotation."""


def attachment_joint(attachment: Attachment) -> Joint:
    """The joint of an attachment; its parent is the equipment's segment, its child the body's.

    Its turn is zero where the points coincide as well as they can.
    """
    weights = 1.0 / np.square(attachment.sigmas)
    equipment_T_joint, levers = _principal_frame(attachment.on_equipment, weights)
    equipment_R_body = _alignment(attachment.on_body, attachment.on_equipment, weights)
    centre_on_body = weights @ attachment.on_body / weights.sum()
    body_T_joint = rigid(equipment_R_body.T @ equipment_T_joint[:3, :3], centre_on_body)
    place_m = np.full(3, 1.0 / np.sqrt(weights.sum()))
    # Points beside an axis hold the turn about it: sigma is that of the points over their lever.
    turn_rad = np.minimum(1.0 / np.maximum(levers, 1e-12), LOOSE_RAD)
    free = int((turn_rad >= LOOSE_RAD).sum())
    return Joint(
        name=attachment.name,
        parent=attachment.equipment_segment,
        child=attachment.body_segment,
        type="ball" if free == 3 else "hinge" if free == 1 else "weld",
        parent_T_joint=equipment_T_joint,
        child_T_joint=body_T_joint,
        axis=np.array([1.0, 0.0, 0.0]),  # of two points: the line through them, the first principal axis
        sigmas=(*turn_rad.tolist(), *place_m.tolist()),
    )


def _principal_frame(points: Array, weights: Array) -> tuple[Array, Array]:
    """Centroid and principal axes (4, 4) of weighted points, the longest first, and the cost of turns (3) [1/rad].

    The information about an axis is the root of the weighted squares of the distances from it.
    """
    centre = weights @ points / weights.sum()
    about = points - centre
    scatter = (about * weights[:, None]).T @ about
    values, vectors = np.linalg.eigh(scatter)
    axes = vectors[:, ::-1]
    axes[:, 2] *= np.sign(np.linalg.det(axes))
    spread = np.maximum(values[::-1], 0.0)
    far = np.linalg.norm(about, axis=1).max()
    if far < _LEAST_LEVER_M:
        return rigid(np.eye(3), centre), np.zeros(3)
    # Two points, or points on a line, do not determine the turn about it.
    spread[spread < weights.sum() * _LEAST_LEVER_M**2] = 0.0
    about_axes = np.sqrt(spread.sum() - spread)
    return rigid(axes, centre), about_axes


def _alignment(on_body: Array, on_equipment: Array, weights: Array) -> Array:
    """equipment_R_body (3, 3) that brings the body's points nearest to the equipment's (Kabsch 1976)."""
    a = (on_body - weights @ on_body / weights.sum()) * weights[:, None]
    b = on_equipment - weights @ on_equipment / weights.sum()
    scatter = b.T @ a
    return np.eye(3) if np.linalg.norm(scatter, 2) < 1e-12 else nearest_rotation(scatter)


def unknown_lengths(equipment: Equipment) -> dict[str, Array]:
    """Attachment or joint of unknown place -> (3) sigmas of that place in the axes of its equipment segment [m]."""
    unknown = {each.name: each.unknown for each in equipment.attachments} | dict(equipment.unknown)
    return {name: sigmas for name, sigmas in unknown.items() if np.any(sigmas)}


class UnknownLengths:
    """All (L) lengths of a piece of equipment that are to be estimated.

    Args:
        equipment: with the sigmas of its lengths.

    Attributes:
        owners: (L) attachment or joint, and the axis 0, 1 or 2 of its equipment segment or parent.
        priors: (L) sigmas [m].
        given: (L) as in the file, of an attachment the mean of its points [m].
    """

    def __init__(self, equipment: Equipment) -> None:
        unknown = unknown_lengths(equipment)
        places = {attachment.name: attachment.on_equipment.mean(axis=0) for attachment in equipment.attachments}
        places |= {joint.name: joint.parent_T_joint[:3, 3] for joint in equipment.joints}
        self.owners = tuple((name, int(axis)) for name, off in unknown.items() for axis in np.flatnonzero(off))
        self.priors = np.array([unknown[name][axis] for name, axis in self.owners])
        self.given = np.array([places[name][axis] for name, axis in self.owners])

    def __len__(self) -> int:
        return len(self.owners)

    @property
    def names(self) -> tuple[str, ...]:
        """(L) ``<attachment or joint>_<x, y or z>``."""
        return tuple(f"{name}_{'xyz'[axis]}" for name, axis in self.owners)

    def joint(self, joint: Joint, shifts: Array) -> Joint:
        """A joint, or an attachment's (``attachment_joint``), shifted by its lengths (L) [m]."""
        place = joint.parent_T_joint.copy()
        for (owner, axis), shift in zip(self.owners, shifts, strict=True):
            place[axis, 3] += shift if owner == joint.name else 0.0
        return replace(joint, parent_T_joint=place)
