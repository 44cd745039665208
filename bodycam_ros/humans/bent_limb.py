"""Elbow and knee as hinges: the bone above them is turned about itself so that they bend the way the limb does.

Our upper arms and thighs turn about their length as their cameras say, and forearms and shins are balls on them. A
human of REP-155 has hinges there, and forearms that cannot turn about themselves. Where wrist and ankle are matters
more to who looks at a human than how a bone is turned about itself.
"""

import numpy as np

from bodycam_ros.geometry import Array, exp_so3

_STRAIGHT, _BENT = 0.09, 0.34
"""Sines of 5 and 20 degrees: a limb that is straighter says nothing of how it would bend; beyond, it says all."""


def turned_to_bend(world_R_link: Array, along: Array, axis: Array, bends: float, direction: Array) -> Array:
    """The upper bone's rotation (3, 3), turned about its length as far as the limb is bent.

    Args:
        world_R_link: (3, 3) how our segment is turned.
        along: (3,) to the hinge, in the link's frame.
        axis: (3,) unit axis of the hinge in the link's frame.
        bends: sign of its angle when the limb bends.
        direction: (3,) where the lower bone points, in the world.
    """
    along = along / np.linalg.norm(along)
    pointing = world_R_link.T @ (direction / np.linalg.norm(direction))
    sideways = pointing - (pointing @ along) * along
    bent = float(np.linalg.norm(sideways))
    share = float(np.clip((bent - _STRAIGHT) / (_BENT - _STRAIGHT), 0.0, 1.0))
    forward = bends * np.cross(axis, along)
    turn = np.arctan2(along @ np.cross(forward, sideways), forward @ sideways)
    turned: Array = world_R_link @ exp_so3(share * share * (3.0 - 2.0 * share) * turn * along)
    return turned


def hinge_towards(base_R: Array, axis: Array, straight: Array, direction: Array) -> float:
    """Angle [rad] of a hinge by which a bone points as nearly as it can in a direction.

    Args:
        base_R: (3, 3) world rotation of the link that the hinge is on.
        axis: (3,) its unit axis there.
        straight: (3,) where the bone points at angle zero, there.
        direction: (3,) in the world.
    """
    wanted = base_R.T @ direction
    return float(np.arctan2(axis @ np.cross(straight, wanted), straight @ wanted - (straight @ axis) * (wanted @ axis)))
