"""The point pairs of an attachment as one joint with six sigmas: the row of the joint table that couples it.

The sum of squares of N weighted distances between the points of two rigid segments depends, to first order, on six
numbers: with the joint's frame at the weighted centroid and its axes along the points' principal axes, shift and turn
come apart (B eq. 15-19 as a quadratic form). One pair holds a place, two let the segments turn about their line, three
or more weld.
"""

import numpy as np

from bodycam_ros.equipment.equipment import Attachment
from bodycam_ros.geometry import Array, nearest_rotation, rigid
from bodycam_ros.kinematics.joint import LOOSE_RAD, Joint, JointType

_LEAST_LEVER_M = 1e-4
"""Points that are nearer to each other than this tell nothing of a rotation."""


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
    kind = _kind(turn_rad)
    axis = np.array([1.0, 0.0, 0.0])  # of two points: the line through them, the first principal axis
    return Joint(
        name=attachment.name,
        parent=attachment.equipment_segment,
        child=attachment.body_segment,
        type=kind,
        parent_T_joint=equipment_T_joint,
        child_T_joint=body_T_joint,
        axis=axis,
        sigmas=(*turn_rad.tolist(), *place_m.tolist()),
    )


def _kind(turn_rad: Array) -> JointType:
    free = int((turn_rad >= LOOSE_RAD).sum())
    return "ball" if free == 3 else "hinge" if free == 1 else "weld"


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
    # Two points, or points on a line, say nothing of the turn about it.
    spread[spread < weights.sum() * _LEAST_LEVER_M**2] = 0.0
    about_axes = np.sqrt(spread.sum() - spread)
    return rigid(axes, centre), about_axes


def _alignment(on_body: Array, on_equipment: Array, weights: Array) -> Array:
    """equipment_R_body (3, 3) that brings the body's points nearest to the equipment's (Kabsch 1976)."""
    a = (on_body - weights @ on_body / weights.sum()) * weights[:, None]
    b = on_equipment - weights @ on_equipment / weights.sum()
    scatter = b.T @ a
    return np.eye(3) if np.linalg.norm(scatter, 2) < 1e-12 else nearest_rotation(scatter)
