"""How thick people are, as fractions of their stature: what bones do not say and a surface needs.

Each is the mean of the women's and the men's fraction, because nobody says which a body is. Girths of limbs and the
chest: means of 247 men, 177.7 cm tall, and 260 women, 164.9 cm tall, of Heinz, Peterson, Johnson and Kerk 2003,
"Exploring relationships in body dimensions", Journal of Statistics Education 11(2); people who exercise, of normal
weight, with the biceps tensed and the thigh measured below the gluteal fold. Waist, buttocks, neck, head and the
breadths of heel and hand, which are not in it: means of 4082 men, 175.6 cm tall, and 1986 women, 162.9 cm tall, of
Gordon et al. 2014, *2012 anthropometric survey of U.S. Army personnel*. The height of the head, hand and foot: Drillis
and Contini 1966 (in Winter, *Biomechanics and Motor Control of Human Movement*, figure 4.1); from the neck up: de Leva
1996, table 4.
"""

from statistics import median

import numpy as np

from bodycam_ros.body.body_model import BONE_RADIUS_M, BodyModel
from bodycam_ros.calibration.anthropometry import PROPORTIONS, SegmentName

THIGH, KNEE, CALF, ANKLE = (girth / (2.0 * np.pi) for girth in (0.332, 0.212, 0.211, 0.130))
BICEPS, FOREARM, WRIST, NECK = (girth / (2.0 * np.pi) for girth in (0.182, 0.152, 0.094, 0.215))
"""Radii of round sections with the girths that were measured."""

CHEST_BREADTH, CHEST_DEPTH = 0.163, 0.112
WAIST_BREADTH, WAIST_DEPTH = 0.183, 0.133
BUTTOCK_DEPTH = 0.145
HEAD_BREADTH, HEAD_LENGTH = 0.089, 0.114  # of which the length is from the forehead to its back
HEAD_HEIGHT = 0.130  # from the chin
NECK_TO_VERTEX = 0.140 + 0.023  # from the joint of the neck, below the cervicale, to the top of the head
FOOT_LENGTH, FOOT_BREADTH, HEEL_BREADTH = 0.152, 0.055, 0.041
HAND_LENGTH, HAND_BREADTH = 0.108, 0.049

BONES = {kind: proportion.middle for (kind, _), proportion in PROPORTIONS.items()}
"""Kind of segment -> length of its bone."""

SLENDERNESS = 0.15
"""Mean radius over length of a bone that nobody measured; those of the four limbs are 0.12 to 0.20."""

_USUAL_STATURE_M = 1.738


def stature_of(body: BodyModel) -> float:
    """Stature [m] that the bones of a body let expect: the median of what each says; a usual one if none is known."""
    said = []
    for joint in body.tree_joints:
        known, above = BONES.get(SegmentName(joint.parent).kind), body.joint_to_parent(joint.parent)
        if known is not None and above is not None and joint.type != "free":
            length = float(np.linalg.norm(joint.parent_T_joint[:3, 3] - above.child_T_joint[:3, 3]))
            said += [length / known] if length > BONE_RADIUS_M else []
    return median(said) if said else _USUAL_STATURE_M
