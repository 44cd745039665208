"""The known walk's body on a bicycle: one leg turns a crank, and every loop is closed, because the angles are solved by
hand. The frame is seen from a pelvis that sways, so its free joint never rests.
"""

import numpy as np

from bodycam_ros.body.body_model import CameraMount
from bodycam_ros.body.coupled_body import coupled_body
from bodycam_ros.body.equipment import Attachment, Equipment, SegmentMotion
from bodycam_ros.geometry import exp_so3, rigid
from bodycam_ros.kinematics.joint import Joint
from bodycam_ros.kinematics.joint_angles import JointAngles
from helpers.known_walk import FRAME_NS, FRAMES, START_NS, Poses, Walk, translation, walking_body

TURNS = 3.0
_LIMB_M, _CRANK_M = 0.4, 0.17
_HIP = np.array([0.0, 0.1, 0.0])  # in the pelvis
_BRACKET = np.array([0.1, 0.0, 0.4])  # in the map
_PEDAL_IN_FOOT = np.array([0.12, 0.0, -0.08])


def bicycle() -> Equipment:
    """A frame, a crank whose angle has no limits, a pedal as a line of two points, and a camera on the frame."""
    pedal_line = np.array([[0.0, -0.04, 0.0], [0.0, 0.04, 0.0]])
    pedal = Attachment(
        "pedal_left", "foot_left", "crank",
        _PEDAL_IN_FOOT + pedal_line, np.array([_CRANK_M, 0.1, 0.0]) + pedal_line, np.full(2, 2e-3),
    )  # fmt: skip
    return Equipment(
        name="bicycle",
        root="frame",
        segments={"frame": SegmentMotion(stands=True), "crank": SegmentMotion(keeps_speed=True)},
        joints=(Joint("crank", "frame", "crank", "hinge", np.eye(4)),),
        attachments=(pedal,),
        mounts={"stem": CameraMount("frame", translation(0.4, 0.0, 0.5))},
    )


def make_ride() -> Walk:
    """Two seconds, in which the crank turns three times."""
    body = coupled_body(walking_body(), bicycle())
    stamps_ns = START_NS + FRAME_NS * np.arange(FRAMES, dtype=np.int64)
    crank = np.linspace(0.0, 2.0 * np.pi * TURNS, FRAMES)
    pitch = 0.1 + 0.05 * np.sin(crank)
    pelvis = np.column_stack([0.01 * np.cos(crank), np.zeros(FRAMES), 1.0 + 0.01 * np.sin(crank)])
    pedal = _BRACKET + _CRANK_M * np.column_stack([np.cos(crank), 0.0 * crank, -np.sin(crank)]) + _HIP
    # The foot stays level; hip and knee follow from the two equal sides of a triangle.
    in_pelvis = _about_y(-pitch)
    leg = _turned(in_pelvis, pedal - _PEDAL_IN_FOOT - pelvis) - _HIP
    knee = np.arccos(np.sum(leg**2, axis=1) / (2.0 * _LIMB_M**2) - 1.0)
    hip = np.arctan2(-leg[:, 0], -leg[:, 2]) - knee / 2.0
    place = _turned(in_pelvis, _BRACKET - pelvis)
    angles = {
        "hip_left_y": hip,
        "knee_left": knee,
        "ankle_left_y": -pitch - hip - knee,
        "spine_y": 0.3 + 0.1 * np.sin(crank),
        "bicycle_at_x": place[:, 0],
        "bicycle_at_y": place[:, 1],
        "bicycle_at_z": place[:, 2],
        "bicycle_y": -pitch,
        "crank": crank,
    }
    names = JointAngles(body).names
    all_angles = np.stack([angles.get(name, np.zeros(FRAMES)) for name in names], axis=1)
    root = rigid(_about_y(pitch), pelvis)
    return Walk(body, stamps_ns, body.forward_kinematics(root, JointAngles(body).poses(all_angles)))


def _about_y(angle: Poses) -> Poses:
    return exp_so3(angle[:, None] * np.array([0.0, 1.0, 0.0]))


def _turned(R: Poses, points: Poses) -> Poses:
    return (R @ points[..., None])[..., 0]
