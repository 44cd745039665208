"""NPZ: everything as NumPy arrays, for Python.

``stamps_ns`` (T), ``seconds`` (T), ``segments`` (S), ``parents`` (S; -1 of the root), ``world_T_segment`` (T, S, 4, 4)
[m], ``joints`` (J), ``joint_R`` (T, J, 3, 3), ``angle_names`` (A), ``angles`` (T, A) [rad], [m] for positions,
``known`` (T, S) whether a segment's pose is: in a gap of a motion with ``--rate`` it is interpolated.
REP-103's axes; z is up.
"""

import io

import numpy as np

from bodycam_ros.formats.sampled_motion import MotionOptions, SampledMotion
from bodycam_ros.kinematics.joint_angles import JointAngles

MARK = b"bodycam_motion.npy"


def write_npz(motion: SampledMotion, options: MotionOptions) -> bytes:
    """The motion as an archive of arrays; nothing in it is pickled."""
    body = motion.body
    row = body.segment_index
    file = io.BytesIO()
    np.savez_compressed(
        file,
        bodycam_motion=np.array(1),
        name=np.array(motion.name),
        stamps_ns=motion.stamps_ns,
        seconds=motion.seconds,
        segments=np.array(body.segments),
        parents=np.array([row[motion.parents[s]] if s in motion.parents else -1 for s in body.segments]),
        world_T_segment=motion.world_T_segment,
        known=np.stack([motion.known_frames(segment) for segment in body.segments], axis=1),
        joints=np.array([joint.name for joint in body.tree_joints]),
        joint_R=JointAngles(body).rotations(motion.joint_angles),
        angle_names=np.array(motion.joint_names),
        angles=motion.joint_angles,
    )
    return file.getvalue()
