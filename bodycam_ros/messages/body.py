"""What the solver publishes about the body: joints, root, transforms, a skeleton to look at; and all of it by topic."""

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.body.urdf import LinkTransform
from bodycam_ros.body_state import BodyOutput, BodyState
from bodycam_ros.geometry import Array, inverse
from bodycam_ros.kinematics.joint_angles import JointAngles
from bodycam_ros.messages.factory import MAP_FRAME, Message, MessageFactory, flat, header_message, numbers, stamp_ns
from bodycam_ros.messages.health import EQUIPMENT, equipment_message
from bodycam_ros.messages.tracks import (
    point_message,
    pose_and_covariance,
    pose_with_covariance_message,
    transform_messages,
    vector_message,
)

_LINE_LIST, _SPHERE_LIST = 5, 7  # visualization_msgs/Marker types
_BONE_WIDTH_M = 0.02
_JOINT_DIAMETER_M = 0.05
_MEASURED_COLOUR = (0.1, 0.6, 1.0)
_PREDICTED_COLOUR = (1.0, 0.5, 0.1)


def joint_state_message(
    make: MessageFactory,
    stamp_ns: int,
    names: Sequence[str],
    positions: NDArray[np.float64],
    velocities: NDArray[np.float64],
) -> Message:
    """sensor_msgs/JointState of J joints.

    Args:
        names: J names, always in the same order.
        positions: (J,) continuous angles [rad].
        velocities: (J,) [rad/s].
    """
    return make(
        "sensor_msgs/msg/JointState",
        header=header_message(make, stamp_ns, ""),
        name=list(names),
        position=make.sequence(flat(positions, np.float64)),
        velocity=make.sequence(flat(velocities, np.float64)),
    )


def joint_rotations_message(
    make: MessageFactory, stamp_ns: int, names: Sequence[str], parent_T_child: NDArray[np.float64]
) -> Message:
    """sensor_msgs/MultiDOFJointState: poses (J, 4, 4) of child segments in their parents, without singularity."""
    return make(
        "sensor_msgs/msg/MultiDOFJointState",
        header=header_message(make, stamp_ns, ""),
        joint_names=list(names),
        transforms=transform_messages(make, parent_T_child),
    )


def joint_covariances_message(
    make: MessageFactory,
    stamp_ns: int,
    names: Sequence[str],
    observed: NDArray[np.bool_],
    covariances: NDArray[np.float64],
) -> Message:
    """bodycam_msgs/JointCovariances of J joints.

    Args:
        names: J names, in the order of the joint rotations.
        observed: (J,) whether cameras saw both of its segments.
        covariances: (J, 3, 3) of the rotations, in the child segments' axes [rad^2].
    """
    return make(
        "bodycam_msgs/msg/JointCovariances",
        header=header_message(make, stamp_ns, ""),
        names=list(names),
        observed=make.sequence(flat(observed, np.uint8)),
        covariances=make.sequence(flat(covariances, np.float64)),
    )


def odometry_message(make: MessageFactory, state: BodyState, root: str, root_velocity: NDArray[np.float64]) -> Message:
    """nav_msgs/Odometry of the root segment in the map.

    Args:
        root: name of the root, whose pose and velocity ``state.uncertainty`` speaks of.
        root_velocity: (6,) angular [rad/s] then linear [m/s], both in the root's axes.
    """
    twist = make(
        "geometry_msgs/msg/Twist",
        angular=vector_message(make, root_velocity[:3]),
        linear=vector_message(make, root_velocity[3:]),
    )
    return make(
        "nav_msgs/msg/Odometry",
        header=header_message(make, state.stamp_ns, MAP_FRAME),
        child_frame_id=make.frame(root),
        pose=pose_with_covariance_message(
            make, state.world_T_segment[state.segments.index(root)], state.uncertainty.root
        ),
        twist=make(
            "geometry_msgs/msg/TwistWithCovariance",
            twist=twist,
            covariance=_linear_first(state.uncertainty.root_twist).reshape(-1),
        ),
    )


def _linear_first(covariance: NDArray[np.float64]) -> NDArray[np.float64]:
    """A covariance (6, 6) of a twist, linear before angular as ROS has it, in the same axes."""
    order = [3, 4, 5, 0, 1, 2]
    return np.ascontiguousarray(covariance[np.ix_(order, order)])


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


def skeleton_message(make: MessageFactory, state: BodyState, bones: Sequence[tuple[int, int]]) -> Message:
    """visualization_msgs/MarkerArray: a ball at each segment's origin, a line along each bone.

    The colour of a segment, and of the line to it, says whether a camera saw it.

    Args:
        bones: pairs of rows of ``state.segments`` whose origins a line joins, the child second.
    """
    points = [point_message(make, world_T_segment[:3, 3]) for world_T_segment in state.world_T_segment]
    seen, unseen = (
        make("std_msgs/msg/ColorRGBA", r=r, g=g, b=b, a=1.0) for r, g, b in (_MEASURED_COLOUR, _PREDICTED_COLOUR)
    )
    colours = [seen if observed else unseen for observed in state.observed]
    header = header_message(make, state.stamp_ns, MAP_FRAME)
    lines, line_colours = [points[row] for bone in bones for row in bone], [colours[bone[1]] for bone in bones]
    markers = [
        make(
            "visualization_msgs/msg/Marker",
            header=header,
            ns="skeleton",
            id=number,
            type=kind,
            scale=vector_message(make, np.full(3, size)),
            color=seen,
            points=where,
            colors=of_points,
        )
        for number, (kind, size, where, of_points) in enumerate(
            [
                (_LINE_LIST, _BONE_WIDTH_M, lines, [colour for colour in line_colours for _ in range(2)]),
                (_SPHERE_LIST, _JOINT_DIAMETER_M, points, colours),
            ]
        )
    ]
    return make("visualization_msgs/msg/MarkerArray", markers=markers)


def output_messages(
    make: MessageFactory, output: BodyOutput, body: BodyModel, links: Sequence[LinkTransform] = ()
) -> dict[str, Message]:
    """Topic -> message of one instant: joint states, joint rotations, odometry, tf, skeleton, and equipment if any.

    Args:
        links: what tf is to say beside where the root is.
    """
    state = output.state
    rows = [(body.segment_index[joint.parent], body.segment_index[joint.child]) for joint in body.tree_joints]
    parents, children = (list(column) for column in zip(*rows, strict=True)) if rows else ([], [])
    parent_T_child = inverse(state.world_T_segment[parents]) @ state.world_T_segment[children]
    world_T_root = state.world_T_segment[body.segment_index[body.root]]
    joint_names = [joint.name for joint in body.tree_joints]
    bones = [ends for ends, joint in zip(rows, body.tree_joints, strict=True) if joint.type != "free"]
    joints_observed = state.observed[parents] & state.observed[children]
    coupled = {} if state.equipment is None else {EQUIPMENT: equipment_message(make, state.stamp_ns, state.equipment)}
    return coupled | {
        "/joint_states": joint_state_message(
            make, state.stamp_ns, output.joint_names, output.positions, output.velocities
        ),
        "/joint_rotations": joint_rotations_message(make, state.stamp_ns, joint_names, parent_T_child),
        "/joint_covariances": joint_covariances_message(
            make, state.stamp_ns, joint_names, joints_observed, state.uncertainty.joints
        ),
        "/odometry": odometry_message(make, state, body.root, output.root_velocity),
        "/tf": transforms_message(make, state.stamp_ns, [(MAP_FRAME, body.root, world_T_root), *links]),
        "/skeleton": skeleton_message(make, state, bones),
    }


_KEPT = 100
"""Instants of which one half is waited for."""


class AnglesAndRoot:
    """Hears joint states and odometry.

    Args:
        on_instant: called with the stamp [ns], names and angles (J,) of joints [rad], and world_T_root (4, 4) [m].
        on_fault: called with what is wrong with a message.
    """

    def __init__(
        self,
        on_instant: Callable[[int, tuple[str, ...], NDArray[np.float64], Array], None],
        on_fault: Callable[[str], None],
    ) -> None:
        self._on_instant, self._on_fault = on_instant, on_fault
        self._angles: dict[int, tuple[tuple[str, ...], NDArray[np.float64]]] = {}
        self._roots: dict[int, Array] = {}

    def forget(self) -> None:
        """Wait for no half of what was told so far."""
        self._angles.clear()
        self._roots.clear()

    def hear_angles(self, message: Message) -> None:
        """sensor_msgs/JointState."""
        try:
            angles = numbers(message.position, np.float64, len(message.name))
        except ValueError as error:
            # Others publish on such topics, too: joint states without positions are theirs.
            self._on_fault(f"joint_states: malformed message ({error})")
            return
        stamp = stamp_ns(message.header.stamp)
        self._angles[stamp] = tuple(message.name), angles
        self._tell(stamp)

    def hear_root(self, message: Message) -> None:
        """nav_msgs/Odometry."""
        stamp = stamp_ns(message.header.stamp)
        self._roots[stamp] = pose_and_covariance(message.pose)[0]
        self._tell(stamp)

    def _tell(self, stamp: int) -> None:
        for waiting in (self._angles, self._roots):
            while len(waiting) > _KEPT:
                del waiting[next(iter(waiting))]
        if stamp in self._angles and stamp in self._roots:
            self._on_instant(stamp, *self._angles.pop(stamp), self._roots.pop(stamp))


class ToldBody(AnglesAndRoot):
    """Hears joint states and odometry of one body.

    Args:
        on_pose: called with the stamp [ns] and world_T_segment (S, 4, 4) [m] of every instant.
        on_fault: called with what is wrong with a message.
    """

    def __init__(self, on_pose: Callable[[int, Array], None], on_fault: Callable[[str], None]) -> None:
        super().__init__(self._place, on_fault)
        self._on_pose, self._on_fault = on_pose, on_fault
        self._body: BodyModel | None = None

    def is_of(self, body: BodyModel | None) -> None:
        """What is told from now on is of this body; None: of nobody known."""
        self._body = body
        self._joint_angles = None if body is None else JointAngles(body)
        self.forget()

    def _place(self, stamp: int, names: tuple[str, ...], angles: NDArray[np.float64], root: Array) -> None:
        if self._body is None or self._joint_angles is None:
            return
        told = dict(zip(names, angles.tolist(), strict=True))
        if missing := [name for name in self._joint_angles.names if name not in told]:
            self._on_fault(f"joint_states lacks {missing[0]}; is it of another robot_description?")
            return
        ours = np.array([told[name] for name in self._joint_angles.names])
        if not (np.isfinite(ours).all() and np.isfinite(root).all()):
            self._on_fault(f"joint_states or odometry at {stamp} ns is not finite")
            return
        self._on_pose(stamp, self._body.forward_kinematics(root, self._joint_angles.poses(ours)))
