"""The live graph: a tracker for each camera of the body, registrations and the solver, and a bag if one is given.

A robot may follow.

ros2 launch bodycam_ros bodycam.launch.py map:=MAP body:=body.yaml [bagfile:=BAG rate:=0.5] [cameras:=head,foot_left]
ros2 launch bodycam_ros bodycam.launch.py --show-args
"""

from pathlib import Path
from typing import Any

from ament_index_python.packages import get_package_share_directory
from launch.actions import DeclareLaunchArgument, ExecuteProcess, GroupAction, OpaqueFunction
from launch.events.process import ProcessExited
from launch.substitutions import EnvironmentVariable, LaunchConfiguration
from launch_ros.actions import Node, PushRosNamespace
from launch_ros.parameter_descriptions import ParameterValue
from launch_ros.substitutions import ExecutableInPackage

from bodycam_ros.graph.declared_graph import USER_ERROR, GraphArguments, GraphNode, graph
from bodycam_ros.settings import SettingDescription, describe
from launch import LaunchContext, LaunchDescription, LaunchDescriptionEntity

SHARE = Path(get_package_share_directory("bodycam_ros"))
TRUTH = ["true", "false"]

RESPAWN_DELAY_S = 2.0
SIGTERM_AFTER_S, SIGKILL_AFTER_S = "30", "40"
"""Under load the nodes take longer to leave than launch would wait; after 60 s they end themselves."""

_BLOCKED = "env --block-signal=INT,TERM "
"""Until the node can end cleanly (``nodes/start.py``): a Ctrl-C while Python starts would end it with a traceback."""

_PROFILES = "FASTRTPS_DEFAULT_PROFILES_FILE"


def generate_launch_description() -> LaunchDescription:
    """Arguments, and the nodes that follow from them; in a scope of their own, for launch files that include this."""
    return LaunchDescription(
        [
            GroupAction(
                [
                    *(_declared(each) for each in describe(GraphArguments)),
                    DeclareLaunchArgument(
                        "params_file",
                        default_value=str(SHARE / "config/all_settings.yaml"),
                        description="settings, a ROS parameter file; the other arguments win over it",
                    ),
                    DeclareLaunchArgument(
                        "namespace", default_value="", description="of all nodes, such as anna: one for each person"
                    ),
                    DeclareLaunchArgument(
                        "one_process",
                        default_value="false",
                        choices=TRUTH,
                        description="run all nodes of this computer in one process: cheaper, for few cores",
                    ),
                    DeclareLaunchArgument(
                        "respawn",
                        default_value="true",
                        choices=TRUTH,
                        description=f"start a node that crashed again after {RESPAWN_DELAY_S:g} s; not the player",
                    ),
                    DeclareLaunchArgument(
                        "viewer", default_value="false", choices=TRUTH, description="also start bodycam view --live"
                    ),
                    DeclareLaunchArgument(
                        "viewer_port", default_value="8080", description="of this machine: where the page of viewer is"
                    ),
                    PushRosNamespace(LaunchConfiguration("namespace")),
                    OpaqueFunction(function=_nodes),
                ]
            )
        ]
    )


def _declared(of: SettingDescription) -> DeclareLaunchArgument:
    text = ",".join(of.default) if of.type is tuple else str(of.default).lower() if of.type is bool else str(of.default)
    choices = TRUTH if of.type is bool else None
    return DeclareLaunchArgument(of.name, default_value=text, choices=choices, description=of.text())


def _nodes(context: LaunchContext) -> list[LaunchDescriptionEntity]:
    given: dict[str, str] = context.launch_configurations
    arguments = GraphArguments.from_texts(given)
    nodes = graph(arguments)
    respawn = given["respawn"] == "true"
    actions: list[LaunchDescriptionEntity] = []
    if given["one_process"] == "true":
        words = [word for each in describe(GraphArguments) for word in _word(each, given[each.name])]
        clock = {"use_sim_time": True} if arguments.use_sim_time else {}
        actions.append(_action("graph", None, clock, given["params_file"], respawn and not arguments.bagfile, words))
    else:
        for node in nodes:
            may_respawn = respawn and node.executable != "player"
            actions.append(_action(node.executable, node, node.parameters, given["params_file"], may_respawn, []))
    if given["viewer"] == "true":
        actions.append(_viewer(given))
    return actions


def _word(of: SettingDescription, text: str) -> list[str]:
    """An argument as the executable ``graph`` takes it."""
    return [f"--{of.name.replace('_', '-')}={text}"] if text else []


def _action(
    executable: str, node: GraphNode | None, parameters: Any, settings: str, respawn: bool, words: list[str]
) -> Node:
    name = node.name if node is not None else None
    return Node(
        package="bodycam_ros",
        executable=executable,
        exec_name=executable,
        prefix=[_BLOCKED, LaunchConfiguration("launch-prefix", default="")],
        name=name,
        parameters=[settings, _as_they_are(parameters)],
        arguments=words,
        ros_arguments=["--enclave", f"/{name or executable}"],
        additional_env={_PROFILES: EnvironmentVariable(_PROFILES, default_value=str(SHARE / "config/fastdds-shm.xml"))},
        output="screen",
        respawn=respawn,
        respawn_delay=RESPAWN_DELAY_S,
        on_exit=_after,
        sigterm_timeout=SIGTERM_AFTER_S,
        sigkill_timeout=SIGKILL_AFTER_S,
    )


def _after(event: ProcessExited, context: LaunchContext) -> list[LaunchDescriptionEntity]:
    """A crash is healed by starting the node again; an error of the user's ends the graph, launch with exit code 1."""
    if event.returncode == USER_ERROR:
        raise RuntimeError(f"{event.process_name} cannot work; its error is above")
    return []


def _as_they_are(parameters: Any) -> dict[str, Any]:
    """Parameters whose texts stay texts: launch would read them as YAML, and a camera named 1 would be a number."""
    types = {str: str, tuple: list[str], list: list[str]}
    return {
        name: ParameterValue(value, value_type=types[type(value)]) if type(value) in types else value
        for name, value in parameters.items()
    }


def _viewer(given: dict[str, str]) -> ExecuteProcess:
    values = {"--map": given["map"], "--namespace": given.get("ros_namespace", ""), "--port": given["viewer_port"]}
    return ExecuteProcess(
        cmd=[
            ExecutableInPackage(executable="bodycam", package="bodycam_ros"),
            *("view", "--live"),
            *(word for flag, value in values.items() if value for word in (flag, value)),
        ],
        name="viewer",
        output="screen",
    )
