"""Our skeleton laid onto REP-155's: the angles of its joints, and what they cannot say.

Shoulders, hips and the neck have three axes there and reach every rotation; waist, elbows and knees have one. A chain
is laid from where the chain before it ended up, so that what the waist cannot do does not turn the arms, and bones
above elbows and knees are turned about their length so that these bend as hinges (``bent_limb``).
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.calibration.anatomy import SegmentName
from bodycam_ros.calibration.anthropometry import PROPORTIONS
from bodycam_ros.errors import BodyError
from bodycam_ros.geometry import Array, log_so3, rigid
from bodycam_ros.humans.axis_angles import composed, nearest_angles
from bodycam_ros.humans.bent_limb import hinge_towards, turned_to_bend
from bodycam_ros.humans.kinematic_model import BODY, CHAINS, TORSO, Chain
from bodycam_ros.kinematics.euler_angles import nearest_turn

_DOWN = np.array([0.0, 0.0, -1.0])
_LENGTHS = {segment: proportion.middle for (segment, _), proportion in PROPORTIONS.items()}
_BEFORE = {"forearm": "upper_arm", "shin": "thigh"}


@dataclass(frozen=True, eq=False)
class Laid:
    """One instant.

    Attributes:
        world_T_body: (4, 4) the root link, midway between the hips [m].
        angles: (A) of ``HumanSkeleton.joint_names`` [rad].
        off_rad: link -> angle between it and the segment that it stands for.
        off_m: link -> how far its origin is from that segment's.
    """

    world_T_body: Array
    angles: Array
    off_rad: Mapping[str, float]
    off_m: Mapping[str, float]


class HumanSkeleton:
    """A body as REP-155 has it: with its own lengths, and without what the body lacks.

    Args:
        body: whose segments are named as those of the default body.

    Attributes:
        chains: those that the body has.
        joint_names: (A) of the joints that move, in REP-155's order, without a body's id.
        origins: joint, moving or fixed -> (3,) where it is on the link before it [m].

    Raises:
        BodyError: none of its segments is known.
    """

    def __init__(self, body: BodyModel) -> None:
        self._body = body
        standing = body.n_pose(np.eye(4))
        self._stands_R = standing[:, :3, :3]
        places = {segment: standing[row, :3, 3] for segment, row in body.segment_index.items()}
        links = {BODY}
        chains: list[Chain] = []
        for chain in CHAINS:
            if chain.segment in places and chain.base in links:
                chains.append(chain)
                links |= {chain.link, *([chain.end] if chain.end else [])}
        if not chains:
            known = ", ".join(chain.segment for chain in CHAINS)
            raise BodyError(f"the body {body.name} has none of the segments that REP-155 knows: {known}")
        self.chains = tuple(chains)
        self.joint_names = tuple(name for chain in chains for name in chain.joints)
        self._axes = {chain.segment: np.array(chain.axes) for chain in chains}
        self._root_T_body = rigid(np.eye(3), _between(places, "thigh", np.zeros(3)))
        self.origins = self._joint_origins(places)

    def _joint_origins(self, places: Mapping[str, Array]) -> dict[str, Array]:
        of_link = {BODY: self._root_T_body[:3, 3]}
        origins: dict[str, Array] = {}
        for chain in self.chains:
            here = places[chain.segment]
            origins[chain.joints[0]] = here - of_link[chain.base]
            origins |= dict.fromkeys(chain.joints[1:], np.zeros(3))
            of_link[chain.link] = here
            if chain.end is None:
                continue
            far = here
            if chain.end == TORSO:
                far = _between(places, "upper_arm", here)
            elif chain.end_segment is not None:
                above = float(np.linalg.norm(here - of_link[chain.base]))
                far = places.get(chain.end_segment, here + _usual_length(chain, above) * _DOWN)
            origins[chain.end], of_link[chain.end] = far - here, far
        return origins

    def lay(self, world_T_segment: Array, previous: Array | None = None) -> Laid:
        """Lay poses (S, 4, 4) of all segments onto the joints.

        Args:
            world_T_segment: in the order of ``BodyModel.segments`` [m].
            previous: (A) angles of the instant before [rad], which the new ones are near to; None at the first.
        """
        previous = np.zeros(len(self.joint_names)) if previous is None else previous
        row = self._body.segment_index
        world_T_body = world_T_segment[row[self._body.root]] @ self._root_T_body
        poses = {BODY: world_T_body}
        angles: list[Array] = []
        off_rad, off_m = {}, {}
        for chain in self.chains:
            at = sum(len(part) for part in angles)
            base, axes = poses[chain.base], self._axes[chain.segment]
            target_R = self._turned(chain.segment, world_T_segment)
            if chain.bends:
                straight = self.origins[str(chain.end)]
                angle = hinge_towards(base[:3, :3], axes[0], straight, self._pointing(chain, world_T_segment))
                part = nearest_turn(np.array([angle]), previous[at : at + 1])
            else:
                wanted_R = self._bending(chain, target_R, world_T_segment)
                part = nearest_angles(base[:3, :3].T @ wanted_R, axes, previous[at : at + len(axes)])
            angles.append(part)
            pose = base @ rigid(composed(axes, part), self.origins[chain.joints[0]])
            poses[chain.link] = pose
            off_rad[chain.link] = float(np.linalg.norm(log_so3(pose[:3, :3].T @ target_R)))
            off_m[chain.link] = _apart(world_T_segment[row[chain.segment]], pose)
            if chain.end is not None:
                end = poses[chain.end] = pose @ rigid(np.eye(3), self.origins[chain.end])
                if chain.end_segment in row:
                    off_m[chain.end] = _apart(world_T_segment[row[chain.end_segment]], end)
        return Laid(world_T_body, np.concatenate(angles), off_rad, off_m)

    def _turned(self, segment: str, world_T_segment: Array) -> Array:
        """(3, 3) how a segment is turned from the N-pose, in the world."""
        row = self._body.segment_index[segment]
        turned: Array = world_T_segment[row, :3, :3] @ self._stands_R[row].T
        return turned

    def _pointing(self, hinge: Chain, world_T_segment: Array) -> Array:
        """(3,) where the bone below a hinge points in the world: to the next segment, if there is one."""
        row = self._body.segment_index
        if hinge.end_segment in row:
            here, there = (world_T_segment[row[segment], :3, 3] for segment in (hinge.segment, hinge.end_segment))
            between: Array = there - here
            return between
        return self._turned(hinge.segment, world_T_segment) @ self.origins[str(hinge.end)]

    def _bending(self, chain: Chain, target_R: Array, world_T_segment: Array) -> Array:
        """``target_R``, turned about the bone so that the hinge at its end, if there is one, bends as the limb does."""
        hinge = next((other for other in self.chains if other.bends and other.base == chain.link), None)
        if hinge is None:
            return target_R
        along = self.origins[hinge.joints[0]]
        return turned_to_bend(
            target_R, along, self._axes[hinge.segment][0], hinge.bends, self._pointing(hinge, world_T_segment)
        )


def _between(places: Mapping[str, Array], kind: str, otherwise: Array) -> Array:
    """Midway between a segment's left and right (3,)."""
    both = [place for segment, place in places.items() if segment in (f"{kind}_left", f"{kind}_right")]
    return np.mean(both, axis=0) if len(both) == 2 else otherwise


def _usual_length(chain: Chain, above_m: float) -> float:
    """[m] of a bone whose far end no segment tells, by the one above it, as people are built."""
    kind = SegmentName(chain.segment).kind
    return above_m * _LENGTHS[kind] / _LENGTHS[_BEFORE[kind]]


def _apart(a: Array, b: Array) -> float:
    """[m] between the origins of two poses (4, 4)."""
    return float(np.linalg.norm(a[:3, 3] - b[:3, 3]))
