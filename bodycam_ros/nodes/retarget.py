"""Node ``retarget``: the solver's joint states in, joint states of a robot that follows the person out."""

import re
from functools import partial
from pathlib import Path

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.body.urdf import body_from_urdf
from bodycam_ros.errors import BodyError, SettingsError
from bodycam_ros.geometry import Array
from bodycam_ros.graph.joint_state_synchronizer import JointStateSynchronizer
from bodycam_ros.graph.node_parameters import RetargetParameters
from bodycam_ros.kinematics.joint_angles import JointAngles
from bodycam_ros.messages.body import joint_state_message, transforms_message
from bodycam_ros.messages.diagnostics import Status, StatusLevel, text_message
from bodycam_ros.messages.factory import MAP_FRAME, Message
from bodycam_ros.nodes.parameters import OUTPUT_DEPTH, latched, reliable
from bodycam_ros.nodes.stage_node import Stage, StageNode
from bodycam_ros.robot.mapping import read_mapping
from bodycam_ros.robot.retargeting import Retargeting, RobotState
from bodycam_ros.robot.robot_model import Robot

_DROPPED = "frames dropped"
_NAMESPACE = re.compile(r"[A-Za-z]\w*(/[A-Za-z]\w*)*", re.ASCII)


class RetargetStage(Stage[RetargetParameters]):
    """Publishes ``robot_description``, ``joint_states`` and the root's transform of a robot, in its own namespace."""

    name = "retarget"
    parameters_type = RetargetParameters
    groups = ()

    def __init__(self, node: StageNode[RetargetParameters]) -> None:
        super().__init__(node)
        of = self.parameters
        # Without a namespace the robot would publish on its input topics.
        if not _NAMESPACE.fullmatch(of.robot):
            raise SettingsError(f"the parameter 'robot' must be a namespace such as talos, not '{of.robot}'")
        self._robot = Robot(Path(self.required("urdf")), read_mapping(Path(self.required("mapping"))))
        self._following: Retargeting | None = None
        self._body: BodyModel | None = None
        self._input = JointStateSynchronizer(self._follow, partial(self.dropped.add, _DROPPED))
        self._followed_ns = -1
        self._states: list[RobotState] = []  # since the last report
        description, states = f"{of.robot}/robot_description", f"{of.robot}/joint_states"
        often = partial(reliable, OUTPUT_DEPTH)
        self._described = self.publisher("std_msgs/msg/String", description, latched())
        self._joints = self.publisher("sensor_msgs/msg/JointState", states, often(), overridable=True)
        self._tf = self.publisher("tf2_msgs/msg/TFMessage", "/tf", often(), overridable=True)
        self.subscription("std_msgs/msg/String", "robot_description", self._set_body, latched(), even_inactive=True)
        self.subscription(
            "sensor_msgs/msg/JointState", "joint_states", self._input.add_joint_state, often(), overridable=True
        )
        self.subscription("nav_msgs/msg/Odometry", "odometry", self._input.add_odometry, often(), overridable=True)

    def activate(self) -> None:
        """Publish the robot's description."""
        self._described.publish(text_message(self.make, self._robot.text))

    def pause(self) -> None:
        """Restart from the next pose of the body."""
        self._input.clear()
        self._followed_ns = -1
        if self._body is not None:
            self._following = Retargeting(self._body, self._robot)

    def _set_body(self, message: Message) -> None:
        try:
            body = body_from_urdf(message.data)
            if self._following is None:
                self._following = Retargeting(body, self._robot)
            else:
                self._following.set_person(body)
        except BodyError as error:
            body = None  # later joint states are of a body that the robot cannot follow
            self.dropped.add("bodies dropped", f"robot_description: {error}")
        self._body = body
        self._input.set_body(body)

    def _follow(self, stamp_ns: int, angles: Array, world_T_root: Array) -> None:
        """Follow the body in one frame."""
        if self._following is None or self._body is None:
            return
        if stamp_ns == self._followed_ns:
            self.dropped.add(_DROPPED, f"the frame {stamp_ns} ns was received twice; do two solvers publish?")
            return
        if stamp_ns < self._followed_ns:
            self._following = Retargeting(self._body, self._robot)
        self._followed_ns = stamp_ns
        world_T_segment = JointAngles(self._body).forward_kinematics(world_T_root, angles)
        self._publish(self._following.follow(stamp_ns, world_T_segment))

    def _publish(self, state: RobotState) -> None:
        self._states.append(state)
        names = self._robot.joint_names
        self._joints.publish(joint_state_message(self.make, state.stamp_ns, names, state.positions, state.velocities))
        root = f"{self.parameters.robot}/{self._robot.tree_root}"
        self._tf.publish(transforms_message(self.make, state.stamp_ns, [(MAP_FRAME, root, state.world_T_root)]))

    def report(self) -> list[Status]:
        """Status of the robot since the last report."""
        states, self._states = self._states, []
        limited = sum(state.blocked for state in states)
        farthest_m = max((error_m for state in states for error_m in state.errors_m.values()), default=0.0)
        values: dict[str, object] = {
            "frames per second": len(states),
            "farthest hand or foot [cm]": round(100.0 * farthest_m, 1),
            "frames at joint limits": limited,
            **self.dropped.values,
        }
        dropped = self.dropped.count_new()
        level, text = (StatusLevel.WARN, "at its joint limits") if limited else (StatusLevel.OK, "follows")
        if not states:
            reason = self.dropped.latest if dropped or self._body is None else ""
            level, text = StatusLevel.WARN, reason or "nothing to follow: no body is solved"
        return [Status("robot", level, text, values)]


make = partial(StageNode, RetargetStage)
"""Constructor of the node."""
