"""The live graph: a tracker for each camera of the body, the registration and the solver, and a bag if one is given.

ros2 launch bodycam_ros bodycam.launch.py map:=MAP body:=body.yaml [bagfile:=BAG rate:=0.5] [cameras:=head,foot_left]
ros2 launch bodycam_ros bodycam.launch.py map:=MAP rig:=rig.yaml body:=body.yaml    then call /skeleton_solver/calibrate
"""

from pathlib import Path

from ament_index_python.packages import get_package_share_directory
from launch.actions import DeclareLaunchArgument, OpaqueFunction, SetEnvironmentVariable
from launch.substitutions import EnvironmentVariable, LaunchConfiguration
from launch_ros.actions import Node

from bodycam_ros.nodes.graph import live_graph, player
from launch import LaunchContext, LaunchDescription, LaunchDescriptionEntity

SHARE = Path(get_package_share_directory("bodycam_ros"))


def generate_launch_description() -> LaunchDescription:
    """Arguments, and the nodes that follow from them."""
    profiles = "FASTRTPS_DEFAULT_PROFILES_FILE"
    return LaunchDescription(
        [
            DeclareLaunchArgument("map", description="folder of the reference map, made by 'bodycam map'"),
            DeclareLaunchArgument(
                "body", description="body YAML: segments, joints, camera mounts; with rig it is written"
            ),
            DeclareLaunchArgument(
                "rig", default_value="", description="rig YAML, to make the body from a range of motion (~/calibrate)"
            ),
            DeclareLaunchArgument(
                "overwrite_body", default_value="false", description="with rig: replace a body that is there already"
            ),
            DeclareLaunchArgument(
                "cameras", default_value="", description="names with commas; all of the body if empty"
            ),
            DeclareLaunchArgument(
                "registrations", default_value="4", description="processes that share the registration of the cameras"
            ),
            DeclareLaunchArgument("bagfile", default_value="", description="ros2 bag or .mcap file to play"),
            DeclareLaunchArgument("rate", default_value="1.0", description="times the recorded speed, for bagfile"),
            DeclareLaunchArgument(
                "config", default_value=str(SHARE / "config/bodycam.yaml"), description="settings, a ROS parameter file"
            ),
            SetEnvironmentVariable(
                profiles, EnvironmentVariable(profiles, default_value=str(SHARE / "config/fastdds-shm.xml"))
            ),
            OpaqueFunction(function=_nodes),
        ]
    )


def _nodes(context: LaunchContext) -> list[LaunchDescriptionEntity]:
    def value(name: str) -> str:
        return LaunchConfiguration(name).perform(context)

    cameras = [camera.strip() for camera in value("cameras").split(",") if camera.strip()]
    nodes = live_graph(
        Path(value("map")),
        Path(value("body")),
        cameras,
        int(value("registrations")),
        Path(value("rig")) if value("rig") else None,
        value("overwrite_body").lower() in ("true", "1"),
    )
    if value("bagfile"):
        # Not `ros2 bag play`, which starts before 18 nodes have loaded; it does as well in another terminal.
        nodes.append(player(Path(value("bagfile")), float(value("rate"))))
    return [
        Node(
            package="bodycam_ros",
            executable=node.executable,
            name=node.name,
            parameters=[value("config"), dict(node.parameters)],
            output="screen",
        )
        for node in nodes
    ]
