"""Everything that is published about one instant of the body, by topic (DESIGN 3)."""

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.geometry import inverse
from bodycam_ros.messages.body import (
    joint_covariances_message,
    joint_rotations_message,
    joint_state_message,
    odometry_message,
    skeleton_message,
    transforms_message,
)
from bodycam_ros.messages.factory import Message, MessageFactory
from bodycam_ros.messages.header import MAP_FRAME
from bodycam_ros.solving.body_output import BodyOutput


def output_messages(make: MessageFactory, output: BodyOutput, body: BodyModel) -> dict[str, Message]:
    """Topic -> message of one instant: joint states, joint rotations, odometry, tf and the skeleton."""
    state = output.state
    rows = [(body.segment_index[joint.parent], body.segment_index[joint.child]) for joint in body.tree_joints]
    parents, children = (list(column) for column in zip(*rows, strict=True)) if rows else ([], [])
    parent_T_child = inverse(state.world_T_segment[parents]) @ state.world_T_segment[children]
    world_T_root = state.world_T_segment[body.segment_index[body.root]]
    joint_names = [joint.name for joint in body.tree_joints]
    joints_observed = state.observed[parents] & state.observed[children]
    return {
        "/joint_states": joint_state_message(
            make, state.stamp_ns, output.joint_names, output.positions, output.velocities
        ),
        "/joint_rotations": joint_rotations_message(make, state.stamp_ns, joint_names, parent_T_child),
        "/joint_covariances": joint_covariances_message(
            make, state.stamp_ns, joint_names, joints_observed, state.uncertainty.joints
        ),
        "/odometry": odometry_message(make, state, body.root, output.root_velocity),
        "/tf": transforms_message(make, state.stamp_ns, [(MAP_FRAME, body.root, world_T_root)]),
        "/skeleton": skeleton_message(make, state, rows),
    }
