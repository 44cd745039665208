"""Arms and legs whose left and right are exchanged: all joints fit, but knees or elbows bend the wrong way."""

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.body.articulation import ArticulatedMotion
from bodycam_ros.body.segment_name import LEFT, RIGHT, SegmentName, mirrored
from bodycam_ros.geometry import Array, log_so3

_LEAST_FLEXION_RAD = 0.5  # a joint that was bent by less does not count
_ONE_SIDED = 2.0  # times as far as the other way: knees and elbows bend one way
_LIMBS = {
    "legs": (("thigh", "shin", "foot"), 1.0, "the knees bend forward"),
    "arms": (("upper_arm", "forearm", "hand"), -1.0, "the elbows bend backward"),
}
"""Limbs -> kinds of their segments, the sense in which their hinge bends about an axis to the left, and the fault."""


def exchanged_limbs(motion: ArticulatedMotion, resting: NDArray[np.bool_]) -> tuple[str, ...]:
    """The limbs, "legs" or "arms", whose sides are exchanged.

    Args:
        motion: of a body, with any axes.
        resting: (T) rows in which the N-pose is held.
    """
    motion = motion.with_zero_at(resting, np.eye(3))
    body = motion.body
    poses = body.n_pose(np.eye(4))
    places = {joint.name: poses[body.segment_index[joint.child], :3, 3] for joint in body.tree_joints}
    return tuple(limbs for limbs in _LIMBS if _bend_wrongly(motion, places, limbs))


def exchange_limbs(cameras: Mapping[str, str], limbs: tuple[str, ...]) -> dict[str, str]:
    """Camera -> segment with the left and the right of some limbs exchanged."""
    kinds = {kind for each in limbs for kind in _LIMBS[each][0]}
    return {
        camera: (mirrored(segment) or segment) if SegmentName(segment).kind in kinds else segment
        for camera, segment in cameras.items()
    }


def wrong_bending(limbs: tuple[str, ...]) -> str:
    """What exchanged limbs do in the motion."""
    return " and ".join(_LIMBS[each][2] for each in limbs)


def _bend_wrongly(motion: ArticulatedMotion, places: Mapping[str, Array], limbs: str) -> bool:
    """Whether the hinges of both sides bend the wrong way about the line from the right limb to the left, by most."""
    (ball, hinge, _), sign, _ = _LIMBS[limbs]
    left, right = (places.get(SegmentName(f"{ball}{side}").joint) for side in (LEFT, RIGHT))
    if left is None or right is None:
        return False
    leftward = (left - right) / max(float(np.linalg.norm(left - right)), 1e-9)
    votes = 0
    for child in (f"{hinge}{side}" for side in (LEFT, RIGHT)):
        if SegmentName(child).joint in places:
            bent = sign * (log_so3(motion.joint_rotations(child)) @ leftward)
            back, forth = (abs(float(value)) for value in np.percentile(bent, [2.0, 98.0]))
            if max(back, forth) > max(_LEAST_FLEXION_RAD, _ONE_SIDED * min(back, forth)):
                votes += 1 if forth > back else -1
    return votes < 0
