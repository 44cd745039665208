"""The live graph: a tracker for each camera of the body, the registration and the solver, and a bag if one is given;
static cameras have a region tracker each, and a robot may follow.

ros2 launch bodycam_ros bodycam.launch.py map:=MAP body:=body.yaml [bagfile:=BAG rate:=0.5] [cameras:=head,foot_left]
ros2 launch bodycam_ros bodycam.launch.py map:=MAP body:=body.yaml equipment:=bicycle
ros2 launch bodycam_ros bodycam.launch.py map:=MAP body:=body.yaml stations:=cameras.yaml [surface:=FOLDER]
ros2 launch bodycam_ros bodycam.launch.py body:=body.yaml stations:=cameras.yaml start:=start.yaml
ros2 launch bodycam_ros bodycam.launch.py map:=MAP body:=body.yaml robot:=robot.urdf mapping:=mapping.yaml
ros2 launch bodycam_ros bodycam.launch.py map:=MAP rig:=rig.yaml body:=body.yaml    then call /skeleton_solver/calibrate
ros2 launch bodycam_ros bodycam.launch.py map:=MAP body:=body.yaml namespace:=anna      beside another for somebody else
ros2 launch bodycam_ros bodycam.launch.py map:=MAP body:=body.yaml nodes:=tracker       and the others on another host
"""

from collections.abc import Mapping
from pathlib import Path
from typing import List  # noqa: UP035 - launch compares types with typing's

from ament_index_python.packages import PackageNotFoundError, get_package_prefix, get_package_share_directory
from launch.actions import DeclareLaunchArgument, ExecuteProcess, OpaqueFunction, SetEnvironmentVariable
from launch.substitutions import EnvironmentVariable, LaunchConfiguration
from launch_ros.actions import Node
from launch_ros.parameter_descriptions import ParameterValue
from launch_ros.substitutions import ExecutableInPackage

from bodycam_ros.nodes.graph import NodeProcess
from bodycam_ros.nodes.launched import NO_PREFIX, OF_NAMESPACE, RESPAWN_DELAY_S, STATE_PUBLISHER, TRUTH, hosted
from launch import LaunchContext, LaunchDescription, LaunchDescriptionEntity

SHARE = Path(get_package_share_directory("bodycam_ros"))

TRANSPORTS = ("compressed", "raw", "video", "foxglove")

_ENCLAVE = "ROS_SECURITY_ENCLAVE_OVERRIDE"
"""Whose keys a program has that takes no ROS arguments; without keys it does nothing."""

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
                "registrations",
                default_value="",
                description="nodes that share the registration of the cameras; 4, or 1 in one process, if empty",
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
            DeclareLaunchArgument(
                "humans", default_value="", description="REP-155's id of the body, to say all as it does; none if empty"
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
                "config", default_value=str(SHARE / "config/bodycam.yaml"), description="older name of params_file"
            ),
            DeclareLaunchArgument(
                "params_file",
                default_value=LaunchConfiguration("config"),
                description="settings, a ROS parameter file; what is said here comes after it",
            ),
            DeclareLaunchArgument(
                "namespace", default_value="", description="of all nodes, such as anna: one for each person in a graph"
            ),
            DeclareLaunchArgument(
                "frame_prefix",
                default_value=OF_NAMESPACE,
                description="before the names of all frames but the map's; the namespace and a slash if it is not "
                f"given, '{NO_PREFIX}' for nothing",
            ),
            DeclareLaunchArgument(
                "use_sim_time",
                default_value="false",
                choices=list(TRUTH),
                description="whether the nodes' clocks follow /clock, which bagfile then has; stamps are the images'",
            ),
            DeclareLaunchArgument(
                "transport",
                default_value="",
                choices=["", *TRANSPORTS],
                description="how images are read; as params_file says, or compressed, if empty",
            ),
            DeclareLaunchArgument(
                "nodes",
                default_value="",
                description="what this host runs, with commas: tracker, registration, skeleton_solver, region_tracker, "
                "retarget, humans, or names of nodes, such as tracker_head; all if empty. The player goes with bagfile",
            ),
            DeclareLaunchArgument(
                "one_process",
                default_value="false",
                choices=list(TRUTH),
                description="run all nodes of this host in one process: sooner there, and cheaper, on few cores",
            ),
            DeclareLaunchArgument(
                "processes",
                default_value="auto",
                choices=["auto", "separate", "forked"],
                description="of the nodes: 'separate' starts each by itself, 'forked' all of them from one that has "
                "loaded what they need, which is sooner on few cores and takes less memory; 'auto' has that there",
            ),
            DeclareLaunchArgument(
                "autostart",
                default_value="true",
                choices=list(TRUTH),
                description="whether the nodes become active by themselves; false leaves that to a lifecycle manager",
            ),
            DeclareLaunchArgument(
                "robot_state_publisher",
                default_value="auto",
                choices=["auto", *TRUTH],
                description="whether that package publishes where the links are, beside the solver; 'auto' where it is "
                "installed, and neither rig nor equipment is given; else the solver does",
            ),
            DeclareLaunchArgument(
                "viewer", default_value="false", choices=list(TRUTH), description="also start bodycam view --live"
            ),
            DeclareLaunchArgument(
                "viewer_port", default_value="8080", description="of this machine: where the page of viewer is"
            ),
            SetEnvironmentVariable(
                profiles, EnvironmentVariable(profiles, default_value=str(SHARE / "config/fastdds-shm.xml"))
            ),
            OpaqueFunction(function=_nodes),
        ]
    )


def _nodes(context: LaunchContext) -> list[LaunchDescriptionEntity]:
    given = context.launch_configurations
    run = hosted(given, _has_state_publisher(given[STATE_PUBLISHER]))
    settings, respawn = given["params_file"], TRUTH[given["respawn"]]
    actions: list[LaunchDescriptionEntity] = [
        *(_action(node, settings, respawn) for node in run.nodes),
        *(_action(node, settings, respawn=False) for node in run.once),
    ]
    if run.state_publisher is not None:
        actions.append(_publisher(run.state_publisher, settings, given["namespace"], respawn))
    if TRUTH[given["viewer"]]:
        actions.append(_viewer(given["map"], given["namespace"], given["viewer_port"]))
    return actions


def _action(node: NodeProcess, settings: str, respawn: bool) -> Node:
    return Node(
        package="bodycam_ros",
        executable=node.executable,
        name=node.name or None,
        namespace=node.namespace or None,
        parameters=[settings, _as_they_are(node.parameters)],
        arguments=list(node.words),
        ros_arguments=["--enclave", node.enclave],
        output="screen",
        respawn=respawn,
        respawn_delay=RESPAWN_DELAY_S,
        sigterm_timeout=SIGTERM_AFTER_S,
        sigkill_timeout=SIGKILL_AFTER_S,
    )


def _as_they_are(parameters: Mapping[str, object]) -> dict[str, object]:
    """Parameters whose texts stay texts: launch would read them as YAML, and a camera named 1 would be a number."""

    def as_it_is(value: object) -> object:
        if isinstance(value, str):
            return ParameterValue(value, value_type=str)
        if isinstance(value, list) and all(isinstance(each, str) for each in value):
            return ParameterValue(value, value_type=List[str])  # noqa: UP006
        return value

    return {name: as_it_is(value) for name, value in parameters.items()}


def _has_state_publisher(wanted: str) -> bool:
    """Whether the package is to be used: by ``auto`` where it is installed."""
    try:
        return TRUTH.get(wanted, True) and bool(get_package_prefix(STATE_PUBLISHER))
    except PackageNotFoundError:
        if wanted == "auto":
            return False
        raise


def _publisher(parameters: Mapping[str, object], settings: str, namespace: str, respawn: bool) -> Node:
    return Node(
        package=STATE_PUBLISHER,
        executable=STATE_PUBLISHER,
        name=STATE_PUBLISHER,
        namespace=namespace or None,
        # The prefix of the frames, and whether clocks are simulated, may be said there alone.
        parameters=[settings, _as_they_are(parameters)],
        # The solver tells of the body, and goes on to do so as it learns how far joints bend.
        remappings=[("robot_description", f"{STATE_PUBLISHER}/robot_description")],
        ros_arguments=["--enclave", NodeProcess(STATE_PUBLISHER, STATE_PUBLISHER, namespace=namespace).enclave],
        output="screen",
        respawn=respawn,
        respawn_delay=RESPAWN_DELAY_S,
    )


def _viewer(reference_map: str, namespace: str, port: str) -> ExecuteProcess:
    looks_on = NodeProcess("bodycam", "observer", namespace=namespace).enclave
    given = {"--map": reference_map, "--namespace": namespace, "--port": port}
    return ExecuteProcess(
        cmd=[
            ExecutableInPackage(executable="bodycam", package="bodycam_ros"),
            *("view", "--live"),
            *(word for flag, value in given.items() if value for word in (flag, value)),
        ],
        name="viewer",
        output="screen",
        additional_env={_ENCLAVE: EnvironmentVariable(_ENCLAVE, default_value=looks_on)},
    )
