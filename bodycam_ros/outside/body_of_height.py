"""A body of a given height, with the lengths that people have: what static cameras begin with when nobody measured it.

Limbs are those of the proportions that calibrations are judged by, of de Leva 1996, table 4, and shoulders are as high
above the hips as the middle of the shoulders there: 515.5 mm of men, 497.9 mm of women. All that is used of that table
was compared with another transcription of it. The spine bends and the neck begins where Dumas, Cheze and Verriest 2007,
"Adjustments to McConville et al. and Young et al. body segment inertial parameters", put the joints between pelvis,
torso and head, of men 1.77 m and women 1.61 m tall. Of these four lengths no second transcription was at hand; by them
the neck's joint is 0.023 of the stature below de Leva's cervicale, which is on the skin behind it. Distances between
the centres of the hips, and of the shoulders, which tables have from skin to skin only, are round values.
"""

import numpy as np

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.calibration.anatomy import LEFT, RIGHT, SegmentName
from bodycam_ros.errors import BodyError
from bodycam_ros.geometry import rigid
from bodycam_ros.kinematics.joint import Joint
from bodycam_ros.outside.girths import BONES
from bodycam_ros.outside.hands import with_hands

SHORTEST_M, TALLEST_M = 0.6, 2.75
"""Nobody stands who is shorter, and nobody was taller."""

SPINE_ABOVE_HIPS = 0.5 * (0.094 / 1.77 + 0.107 / 1.61)
NECK_ABOVE_SPINE = 0.5 * (0.477 / 1.77 + 0.429 / 1.61)
"""Height of the joint of the spine above the hips, and of the neck above that, in statures."""

_SHOULDERS = 0.5 * (0.5155 / 1.741 + 0.4979 / 1.735) - SPINE_ABOVE_HIPS
_HALF_HIPS, _HALF_SHOULDERS = 0.05, 0.105


def body_of_height(height_m: float, name: str) -> BodyModel:
    """A body of average people of a height [m], with hands; all joints are balls.

    Raises:
        BodyError: nobody is so tall.
    """
    if not SHORTEST_M <= height_m <= TALLEST_M:
        raise BodyError(f"{height_m:g} m is nobody's height; expected {SHORTEST_M:g} to {TALLEST_M:g} m, such as 1.78")
    offsets = {"torso": ("pelvis", (0.0, 0.0, SPINE_ABOVE_HIPS)), "head": ("torso", (0.0, 0.0, NECK_ABOVE_SPINE))}
    for side, sign in ((LEFT, 1.0), (RIGHT, -1.0)):
        offsets |= {
            f"upper_arm{side}": ("torso", (0.0, sign * _HALF_SHOULDERS, _SHOULDERS)),
            f"forearm{side}": (f"upper_arm{side}", (0.0, 0.0, -BONES["upper_arm"])),
            f"thigh{side}": ("pelvis", (0.0, sign * _HALF_HIPS, 0.0)),
            f"shin{side}": (f"thigh{side}", (0.0, 0.0, -BONES["thigh"])),
            f"foot{side}": (f"shin{side}", (0.0, 0.0, -BONES["shin"])),
        }
    joints = []
    for child, (parent, offset) in offsets.items():
        called = SegmentName(child)
        place = rigid(np.eye(3), height_m * np.array(offset))
        joints.append(Joint(called.joint, parent, child, "ball", place, angle_axes=called.angle_axes))
    return with_hands(BodyModel(name, "pelvis", ("pelvis", *offsets), tuple(joints), {}))
