"""The live graph: a tracker for each camera of the body, the registration and the solver, and a bag if one is given;
static cameras have a region tracker each, and a robot may follow.

ros2 launch bodycam_ros bodycam.launch.py map:=MAP body:=body.yaml [bagfile:=BAG rate:=0.5] [cameras:=head,foot_left]
ros2 launch bodycam_ros bodycam.launch.py map:=MAP body:=body.yaml equipment:=bicycle
ros2 launch bodycam_ros bodycam.launch.py map:=MAP body:=body.yaml stations:=cameras.yaml [surface:=FOLDER]
ros2 launch bodycam_ros bodycam.launch.py body:=body.yaml stations:=cameras.yaml start:=start.yaml
ros2 launch bodycam_ros bodycam.launch.py map:=MAP body:=body.yaml robot:=robot.urdf mapping:=mapping.yaml
ros2 launch bodycam_ros bodycam.launch.py map:=MAP rig:=rig.yaml body:=body.yaml    then call /skeleton_solver/calibrate
"""

from pathlib import Path

from ament_index_python.packages import get_package_share_directory
from launch.actions import DeclareLaunchArgument, OpaqueFunction, SetEnvironmentVariable
from launch.substitutions import EnvironmentVariable, LaunchConfiguration
from launch_ros.actions import Node

from bodycam_ros.nodes.graph import NodeProcess, cameras_of, follower, live_graph, outside_input, player, stations_of
from launch import LaunchContext, LaunchDescription, LaunchDescriptionEntity

SHARE = Path(get_package_share_directory("bodycam_ros"))

TRUTH = {"true": True, "True": True, "1": True, "false": False, "False": False, "0": False}

RESPAWN_DELAY_S = 2.0
"""A node that cannot run, because its map is missing, say, must not take the others' processors."""

SIGTERM_AFTER_S, SIGKILL_AFTER_S = "30", "40"
"""Under load the nodes take longer to leave than launch would wait; after 60 s they end themselves."""


def generate_launch_description() -> LaunchDescription:
    """Arguments, and the nodes that follow from them."""
    profiles = "FASTRTPS_DEFAULT_PROFILES_FILE"
    return LaunchDescription(
        [
            DeclareLaunchArgument(
                "map",
                default_value="",
                description="folder of the reference map, made by 'bodycam map'; empty where static cameras alone tell",
            ),
            DeclareLaunchArgument(
                "body", description="body YAML: segments, joints, camera mounts; with rig it is written"
            ),
            DeclareLaunchArgument(
                "rig", default_value="", description="rig YAML, to make the body from a range of motion (~/calibrate)"
            ),
            DeclareLaunchArgument(
                "overwrite_body",
                default_value="false",
                choices=list(TRUTH),
                description="with rig: replace a body that is there already",
            ),
            DeclareLaunchArgument(
                "equipment",
                default_value="",
                description="what the person rides, holds or stands on: a YAML file, or the name of a supplied one",
            ),
            DeclareLaunchArgument(
                "cameras", default_value="", description="names with commas; all of the body if empty"
            ),
            DeclareLaunchArgument(
                "registrations", default_value="4", description="processes that share the registration of the cameras"
            ),
            DeclareLaunchArgument(
                "grown_map",
                default_value="",
                description="folder in which the registrations keep what their maps grow by, and go on from; "
                "nowhere if empty",
            ),
            DeclareLaunchArgument(
                "stations", default_value="", description="YAML of static cameras: where they stand, their lenses"
            ),
            DeclareLaunchArgument(
                "surface",
                default_value="",
                description="with stations: folder of the segments' meshes; capsules if empty and body.yaml names none",
            ),
            DeclareLaunchArgument(
                "start",
                default_value="",
                description="with stations: YAML of where the person stands at first; empty where worn cameras tell",
            ),
            DeclareLaunchArgument(
                "robot", default_value="", description="URDF of a robot that follows the person; none if empty"
            ),
            DeclareLaunchArgument(
                "mapping",
                default_value="",
                description="with robot: YAML of which links of it follow what, as config/robot/talos.yaml",
            ),
            DeclareLaunchArgument("bagfile", default_value="", description="ros2 bag or .mcap file to play"),
            DeclareLaunchArgument("rate", default_value="1.0", description="times the recorded speed, for bagfile"),
            DeclareLaunchArgument(
                "loop", default_value="false", choices=list(TRUTH), description="play bagfile again and again"
            ),
            DeclareLaunchArgument(
                "respawn",
                default_value="true",
                choices=list(TRUTH),
                description=f"start a node again {RESPAWN_DELAY_S:g} s after it ended; not the player",
            ),
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

    def path(name: str) -> Path | None:
        return Path(value(name)) if value(name) else None

    cameras = [camera.strip() for camera in value("cameras").split(",") if camera.strip()]
    graph = live_graph(
        path("map"),
        Path(value("body")),
        cameras,
        int(value("registrations")),
        path("rig"),
        TRUTH[value("overwrite_body")],
        path("grown_map"),
        value("equipment"),
        outside_input(path("stations"), path("surface"), path("start")),
    )
    graph += follower(path("robot"), path("mapping"))
    actions = [_action(node, value("config"), TRUTH[value("respawn")]) for node in graph]
    if value("bagfile"):
        # Not `ros2 bag play`, which starts before 18 nodes have loaded; it does as well in another terminal.
        rate, loop = float(value("rate")), TRUTH[value("loop")]
        playing = player(Path(value("bagfile")), rate, cameras_of(graph), loop, stations_of(graph))
        actions.append(_action(playing, value("config"), respawn=False))
    return actions


def _action(node: NodeProcess, config: str, respawn: bool) -> Node:
    return Node(
        package="bodycam_ros",
        executable=node.executable,
        name=node.name,
        parameters=[config, dict(node.parameters)],
        output="screen",
        respawn=respawn,
        respawn_delay=RESPAWN_DELAY_S,
        sigterm_timeout=SIGTERM_AFTER_S,
        sigkill_timeout=SIGKILL_AFTER_S,
    )
