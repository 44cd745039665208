"""Messages that the solver publishes: joints, root, transforms, a skeleton for display, the coupling to equipment."""

from collections.abc import Sequence

import numpy as np

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.body.equipment_report import EquipmentReport
from bodycam_ros.body.urdf import LinkTransform
from bodycam_ros.body_state import BodyOutput, BodyState
from bodycam_ros.geometry import Array, inverse
from bodycam_ros.messages.factory import MAP_FRAME, Message, MessageFactory, header_message, numbers
from bodycam_ros.messages.poses import (
    point_message,
    pose_with_covariance_message,
    transform_messages,
    twist_covariance,
    vector_message,
)

EQUIPMENT, EQUIPMENT_TYPE = "/equipment", "bodycam_msgs/msg/EquipmentState"

_LINE_LIST, _SPHERE_LIST = 5, 7  # visualization_msgs/Marker types
_LIFETIME_S = 2  # of markers: a skeleton that is no longer solved leaves the display
_BONE_WIDTH_M, _JOINT_DIAMETER_M = 0.02, 0.05
_OBSERVED_COLOUR, _UNOBSERVED_COLOUR = (0.1, 0.6, 1.0), (1.0, 0.5, 0.1)


def joint_state_message(
    make: MessageFactory, stamp_ns: int, names: Sequence[str], positions: Array, velocities: Array
) -> Message:
    """sensor_msgs/JointState of J joints.

    Args:
        names: J names, in constant order.
        positions: (J,) continuous angles [rad].
        velocities: (J,) [rad/s].
    """
    return make(
        "sensor_msgs/msg/JointState",
        header=header_message(make, stamp_ns, ""),
        name=list(names),
        position=make.array(positions, np.float64),
        velocity=make.array(velocities, np.float64),
    )


def _odometry(make: MessageFactory, output: BodyOutput, root: str) -> Message:
    """nav_msgs/Odometry of the root segment in the map; its twist is in the root's axes."""
    state = output.state
    velocity = state.twists[state.segments.index(root)]
    twist = make(
        "geometry_msgs/msg/Twist", angular=vector_message(make, velocity[:3]), linear=vector_message(make, velocity[3:])
    )
    covariance = twist_covariance(state.uncertainty.root_twist).reshape(-1)
    world_T_root = state.world_T_segment[state.segments.index(root)]
    return make(
        "nav_msgs/msg/Odometry",
        header=header_message(make, state.stamp_ns, MAP_FRAME),
        child_frame_id=make.frame(root),
        pose=pose_with_covariance_message(make, world_T_root, state.uncertainty.root),
        twist=make("geometry_msgs/msg/TwistWithCovariance", twist=twist, covariance=covariance),
    )


def transforms_message(make: MessageFactory, stamp_ns: int, transforms: Sequence[LinkTransform]) -> Message:
    """tf2_msgs/TFMessage of (parent frame, child frame, parent_T_child (4, 4))."""
    poses = np.array([parent_T_child for _, _, parent_T_child in transforms]).reshape(-1, 4, 4)
    stamped = [
        make(
            "geometry_msgs/msg/TransformStamped",
            header=header_message(make, stamp_ns, parent if parent == MAP_FRAME else make.frame(parent)),
            child_frame_id=make.frame(child),
            transform=transform,
        )
        for (parent, child, _), transform in zip(transforms, transform_messages(make, poses), strict=True)
    ]
    return make("tf2_msgs/msg/TFMessage", transforms=stamped)


def _skeleton(make: MessageFactory, state: BodyState, bones: Sequence[tuple[int, int]]) -> Message:
    """visualization_msgs/MarkerArray: a sphere at each segment's origin, a line for each bone (rows of its ends).

    Segments, and the lines to them, have one colour if they are observed and another if they are not.
    """
    points = [point_message(make, world_T_segment[:3, 3]) for world_T_segment in state.world_T_segment]
    observed, unobserved = (
        make("std_msgs/msg/ColorRGBA", r=r, g=g, b=b, a=1.0) for r, g, b in (_OBSERVED_COLOUR, _UNOBSERVED_COLOUR)
    )
    colours = [observed if each else unobserved for each in state.observed]
    ends = [(points[row], colours[child]) for parent, child in bones for row in (parent, child)]
    spheres = list(zip(points, colours, strict=True))
    markers = [
        make(
            "visualization_msgs/msg/Marker",
            header=header_message(make, state.stamp_ns, MAP_FRAME),
            ns="skeleton",
            id=number,
            type=kind,
            scale=vector_message(make, np.full(3, size)),
            color=observed,
            lifetime=make("builtin_interfaces/msg/Duration", sec=_LIFETIME_S),
            points=[point for point, _ in coloured],
            colors=[colour for _, colour in coloured],
        )
        for number, (kind, size, coloured) in enumerate(
            [(_LINE_LIST, _BONE_WIDTH_M, ends), (_SPHERE_LIST, _JOINT_DIAMETER_M, spheres)]
        )
    ]
    return make("visualization_msgs/msg/MarkerArray", markers=markers)


def equipment_message(make: MessageFactory, stamp_ns: int, report: EquipmentReport) -> Message:
    """bodycam_msgs/EquipmentState at one stamp [ns]."""
    return make(
        EQUIPMENT_TYPE,
        header=header_message(make, stamp_ns, MAP_FRAME),
        name=report.name,
        placed=report.placed,
        attachments=list(report.attachments),
        engaged=make.array(report.engaged, np.uint8),
        deviations=make.array(report.deviations, np.float64),
        lengths=list(report.lengths),
        priors=make.array(report.priors, np.float64),
        values=make.array(report.values, np.float64),
        sigmas=make.array(report.sigmas, np.float64),
    )


def equipment_report(message: Message) -> EquipmentReport:
    """Content of a bodycam_msgs/EquipmentState.

    Raises:
        ValueError: an array does not have one value for each name.
    """
    attachments, lengths = tuple(message.attachments), tuple(message.lengths)
    return EquipmentReport(
        name=message.name,
        placed=bool(message.placed),
        attachments=attachments,
        engaged=numbers(message.engaged, np.uint8, len(attachments)).astype(bool),
        deviations=numbers(message.deviations, np.float64, len(attachments)),
        lengths=lengths,
        priors=numbers(message.priors, np.float64, len(lengths)),
        values=numbers(message.values, np.float64, len(lengths)),
        sigmas=numbers(message.sigmas, np.float64, len(lengths)),
    )


def output_messages(
    make: MessageFactory, output: BodyOutput, body: BodyModel, links: Sequence[LinkTransform] = ()
) -> dict[str, Message]:
    """Topic -> message of one state: joints, odometry, transforms, skeleton, and equipment if there is any.

    Args:
        links: transforms on /tf in addition to the root's.
    """
    state, stamp_ns = output.state, output.state.stamp_ns
    rows = [(body.segment_index[joint.parent], body.segment_index[joint.child]) for joint in body.tree_joints]
    parents, children = (list(column) for column in zip(*rows, strict=True)) if rows else ([], [])
    parent_T_child = inverse(state.world_T_segment[parents]) @ state.world_T_segment[children]
    world_T_root = state.world_T_segment[body.segment_index[body.root]]
    joint_names = [joint.name for joint in body.tree_joints]
    bones = [ends for ends, joint in zip(rows, body.tree_joints, strict=True) if joint.type != "free"]
    header = header_message(make, stamp_ns, "")
    coupling = {} if state.equipment is None else {EQUIPMENT: equipment_message(make, stamp_ns, state.equipment)}
    return coupling | {
        "/joint_states": joint_state_message(make, stamp_ns, output.joint_names, output.positions, output.velocities),
        "/joint_rotations": make(
            "sensor_msgs/msg/MultiDOFJointState",
            header=header,
            joint_names=joint_names,
            transforms=transform_messages(make, parent_T_child),
        ),
        "/joint_covariances": make(
            "bodycam_msgs/msg/JointCovariances",
            header=header,
            names=joint_names,
            observed=make.array(state.observed[parents] & state.observed[children], np.uint8),
            covariances=make.array(state.uncertainty.joints, np.float64),
        ),
        "/odometry": _odometry(make, output, body.root),
        "/tf": transforms_message(make, stamp_ns, [(MAP_FRAME, body.root, world_T_root), *links]),
        "/skeleton": _skeleton(make, state, bones),
    }
