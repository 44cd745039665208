"""The parameters of a robot's node."""

from dataclasses import dataclass

from bodycam_ros.nodes.common_parameters import ManagedParameters
from bodycam_ros.settings import setting


@dataclass(frozen=True)
class RetargetParameters(ManagedParameters):
    """Of the node ``retarget``."""

    urdf: str = setting("", reason="URDF of the robot; its meshes are looked for above it, and where ROS knows them")
    mapping: str = setting("", reason="YAML of which links of the robot follow what, as config/robot/talos.yaml")
    robot: str = setting("robot", reason="namespace of what is published of the robot, and prefix of its root's frame")
