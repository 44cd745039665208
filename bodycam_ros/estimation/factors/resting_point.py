"""A point of a segment that rests: of a sole in contact with the floor, of equipment that stands."""

from dataclasses import dataclass

import numpy as np

from bodycam_ros.geometry import Array, hat

_IDENTITY = np.eye(3)


@dataclass(frozen=True, eq=False)
class RestingPoint:
    """A point of a segment that is where it was in the state before: its displacement in sigmas.

    Attributes:
        segment: row of the segment.
        place: (3,) of the point on the segment [m].
        sigma: of its displacement in the world [m].
    """

    segment: int
    place: Array
    sigma: float

    def residual(self, before: Array, after: Array, *twists: Array) -> tuple[Array, Array, Array]:
        """See ``SegmentStep``."""
        moved = (after[:3, :3] - before[:3, :3]) @ self.place + after[:3, 3] - before[:3, 3]
        moves = np.concatenate([-hat(self.place), _IDENTITY, np.zeros((3, 6))], axis=1) / self.sigma
        return moved / self.sigma, -before[:3, :3] @ moves, after[:3, :3] @ moves
