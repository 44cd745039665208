"""What a body is coupled to: its own segments and joints, and the points at which the body holds it (B 3.2).

A constraint is a row in a joint table. The point pairs of an attachment (B eq. 15) say how far its two segments may
be from each other; summed up they are one joint with six sigmas, like any other (``attachment_joint``).
"""

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.body.body_model import CameraMount
from bodycam_ros.geometry import Array, transform_points
from bodycam_ros.kinematics.joint import Joint

Interval = tuple[float, float]
"""From and until, seconds since the recording's first image; the end may be infinite."""


@dataclass(frozen=True)
class SegmentMotion:
    """How a segment of the equipment moves.

    Attributes:
        stands: it does not move in the world at all (a bicycle on a roller); the sigmas then mean nothing.
        keeps_speed: it goes on at its speed for as long as nobody sees it (a crank, a wheel); else it comes to rest, as
            the segments of a body do.
        angular_acceleration_sigma, acceleration_sigma: how suddenly it changes its motion [rad/s^2], [m/s^2]; None: as
            the body's segments.
    """

    stands: bool = False
    keeps_speed: bool = False
    angular_acceleration_sigma: float | None = None
    acceleration_sigma: float | None = None


@dataclass(frozen=True, eq=False)
class Attachment:
    """Where the body holds the equipment: N pairs of points that should coincide (B eq. 15-17).

    Attributes:
        name: unique among the attachments.
        body_segment: of the body.
        equipment_segment: of the equipment.
        on_body: (N, 3) points on the body's segment [m].
        on_equipment: (N, 3) the same points on the equipment's segment [m].
        sigmas: (N) how far the two may be from each other, the weight of the pair [m].
        unknown: (3) how far the equipment's points may be, all together, from where they are said to be, in the axes of
            its segment [m]; zero along what is known. What is unknown is estimated.
        intervals: when it holds; None: always.
        detected: whether it is let go, within its intervals, while what is seen of the body contradicts it.
        optional: whether bodies without its segment do without it (``fitted_equipment``).
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
        """Whether it is said to hold at a time since the recording's first image [s]."""
        return self.intervals is None or any(start <= seconds <= end for start, end in self.intervals)

    def distances(self, world_T_body: Array, world_T_equipment: Array) -> NDArray[np.float64]:
        """(N) distances [m] between the points of its pairs, of the poses (4, 4) of its two segments (B eq. 15)."""
        body = transform_points(world_T_body, self.on_body)
        distances: NDArray[np.float64] = np.linalg.norm(
            body - transform_points(world_T_equipment, self.on_equipment), axis=1
        )
        return distances


@dataclass(frozen=True, eq=False)
class Equipment:
    """A machine, board or bar.

    Attributes:
        name: of the equipment; its segments are added to the body's.
        root: the segment that carries the others.
        segments: name -> how it moves.
        joints: between its own segments, in the order of the file.
        attachments: to the body.
        unknown: joint -> (3) how far its place on its parent may be from where it is said to be, in the parent's axes
            [m]; joints that are not in it sit where they are said to.
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
