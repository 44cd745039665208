"""The one place that says what each node of the live graph says and hears. Live tests hold the nodes to it."""

from collections.abc import Callable, Iterable, Mapping, Sequence

from bodycam_ros.messages.clocks import TIMING
from bodycam_ros.messages.equipment import EQUIPMENT
from bodycam_ros.messages.segment_poses import SEGMENT_POSES
from bodycam_ros.messages.segments_now import SEGMENTS_NOW
from bodycam_ros.nodes.graph import NodeProcess, cameras_of, stations_of
from bodycam_ros.secured.access import Access

_EQUIPMENT, _SEGMENT_POSES, _SEGMENTS_NOW, _TIMING = (
    topic.removeprefix("/") for topic in (EQUIPMENT, SEGMENT_POSES, SEGMENTS_NOW, TIMING)
)
_INFO, _KEPT_INFOS = "camera_info", "camera_infos"
_IMAGES = ("image_raw/compressed", "image_raw", "image_raw/compressed_video", "image_raw/foxglove")
_MOTION = ("robot_description", "joint_states", "odometry")
_OUTPUTS = (*_MOTION, "joint_rotations", "joint_covariances", "skeleton", _EQUIPMENT, "/tf", "/tf_static")
_PARAMETERS = (
    *("describe_parameters", "get_parameter_types", "get_parameters", "list_parameters"),
    *("set_parameters", "set_parameters_atomically", "get_type_description"),
)
_LOGGING = ("get_logger_levels", "set_logger_levels")
_LIFE = ("change_state", "get_state", "get_available_states", "get_available_transitions", "get_transition_graph")
_PLAYBACK = ("pause", "resume", "toggle_paused", "is_paused", "play_next")
_OF_RCLPY = ("/rosout", "/parameter_events")

_EVERYBODY = Access(
    publishes=frozenset((*_OF_RCLPY, "/diagnostics")),
    subscribes=frozenset({"/clock"}),
    serves=frozenset(f"~/{service}" for service in (*_PARAMETERS, *_LOGGING)),
)
"""What every node of ours does, whatever it is for. ``/clock`` is heard with ``use_sim_time`` alone."""


_MANAGED = Access(publishes=frozenset({"~/transition_event"}), serves=frozenset(f"~/{service}" for service in _LIFE))
"""What a node does besides if others may configure and activate it."""


def access_of_graph(graph: Sequence[NodeProcess]) -> dict[str, Access]:
    """What each node may do, by its name, with names relative to its namespace.

    Args:
        graph: all nodes, for what is asked of one depends on the cameras of the others.

    Raises:
        KeyError: a node is of a kind that the table does not know.
    """
    worn, stations = cameras_of(graph), stations_of(graph)
    return {node.name: _EVERYBODY | _KINDS[node.executable](node, worn, stations) for node in graph}


def drivers(worn: Iterable[str], stations: Iterable[str]) -> dict[str, Access]:
    """What the drivers of the cameras may do, which are no nodes of ours: each its own images, and nothing else.

    Drivers in C++ hear of parameters.
    """
    return {
        f"driver_{camera}": Access(
            publishes=frozenset((*_topics([camera], *_IMAGES, _INFO), *_OF_RCLPY, "/diagnostics")),
            subscribes=frozenset({"/parameter_events", "/clock"}),
            serves=frozenset(f"~/{service}" for service in _PARAMETERS),
        )
        for camera in (*worn, *stations)
    }


def people(of_nodes: Mapping[str, Access]) -> dict[str, Access]:
    """What those who look on may do, with any tool: hear everything, and who operates also asks every service.

    Args:
        of_nodes: what the nodes do, with absolute names.
    """
    everybody = Access()
    for access in of_nodes.values():
        everybody |= access
    tools = ("/*observer", "/*operator", "/*rviz2", "/*_ros2cli*", "/*bodycam_view")
    own = Access(
        publishes=frozenset(_OF_RCLPY),
        subscribes=everybody.publishes | {"/clock"},
        serves=frozenset(f"{tool}/{service}" for tool in tools for service in _PARAMETERS),
    )
    return {"observer": own, "operator": own | Access(calls=everybody.serves)}


def state_publisher() -> Access:
    """What robot_state_publisher may do, beside a solver that leaves the links to it."""
    return Access(
        publishes=frozenset((*_OF_RCLPY, "/tf", "/tf_static", "~/robot_description")),
        subscribes=frozenset({"joint_states", "/parameter_events", "/clock"}),
        serves=frozenset(f"~/{service}" for service in (*_PARAMETERS, *_LOGGING)),
    )


def _tracker(node: NodeProcess, worn: Sequence[str], stations: Sequence[str]) -> Access:
    camera = [str(node.parameters["camera"])]
    return _MANAGED | Access(
        publishes=_topics(camera, "tracks", "clock_told"),
        subscribes=_topics(camera, *_IMAGES, _INFO, "landmarks", "want_keyframe", "clock_asked") | {_KEPT_INFOS},
        serves=frozenset({"~/reset"}),
    )


def _registration(node: NodeProcess, worn: Sequence[str], stations: Sequence[str]) -> Access:
    cameras = _names(node, "cameras") or worn
    told = {"map/points"} if node.parameters.get("publish_map", True) else set()
    return (
        _MANAGED
        | Access.of_action("~/extend_map")
        | Access(
            publishes=_topics(cameras, "landmarks", "pose", "want_keyframe", "clock_asked") | {_KEPT_INFOS} | told,
            subscribes=_topics(cameras, "tracks", "expected_pose", "doubt", "clock_told", _TIMING, _INFO)
            | {_KEPT_INFOS},
            serves=frozenset({"~/save_map", "~/load_map", "~/reset_map", "~/grow", "~/reset"}),
        )
    )


def _region_tracker(node: NodeProcess, worn: Sequence[str], stations: Sequence[str]) -> Access:
    camera = [str(node.parameters["camera"])]
    return _MANAGED | Access(
        publishes=_topics(camera, _SEGMENT_POSES),
        subscribes=_topics(camera, *_IMAGES) | {_SEGMENTS_NOW},
        serves=frozenset({"~/reset"}),
    )


def _skeleton_solver(node: NodeProcess, worn: Sequence[str], stations: Sequence[str]) -> Access:
    told = {_SEGMENTS_NOW} if stations else set()
    return (
        _MANAGED
        | Access.of_action("~/calibrate")
        | Access(
            publishes=_topics(worn, "expected_pose", "doubt", _TIMING) | {*_OUTPUTS, _KEPT_INFOS} | told,
            subscribes=_topics(worn, "landmarks", _INFO) | _topics(stations, _SEGMENT_POSES) | {_KEPT_INFOS},
            serves=frozenset({"~/flush", "~/reset", "~/calibrate", "~/start_calibration"}),
        )
    )


def _retarget(node: NodeProcess, worn: Sequence[str], stations: Sequence[str]) -> Access:
    robot = [str(node.parameters.get("robot", "robot"))]
    return _MANAGED | Access(
        publishes=_topics(robot, "robot_description", "joint_states") | {"/tf"}, subscribes=frozenset(_MOTION)
    )


def _humans(node: NodeProcess, worn: Sequence[str], stations: Sequence[str]) -> Access:
    # A name that is made anew at every start cannot be known before.
    body = f"/humans/bodies/{node.parameters.get('body_id') or '*'}"
    return _MANAGED | Access(
        publishes=_topics([body], "urdf", "joint_states") | {"/humans/bodies/tracked", "/tf"},
        subscribes=frozenset(_MOTION),
    )


def _player(node: NodeProcess, worn: Sequence[str], stations: Sequence[str]) -> Access:
    played = _names(node, "cameras") or [*worn, *stations]
    return Access(
        publishes=_topics(played, *_IMAGES, _INFO, _TIMING) | {"/clock"},
        serves=frozenset(f"~/{service}" for service in _PLAYBACK),
    )


_KINDS: Mapping[str, Callable[[NodeProcess, Sequence[str], Sequence[str]], Access]] = {
    "tracker": _tracker,
    "registration": _registration,
    "region_tracker": _region_tracker,
    "skeleton_solver": _skeleton_solver,
    "retarget": _retarget,
    "humans": _humans,
    "player": _player,
}
"""Executable -> what such a node does beside what everybody does, of itself, worn cameras and static ones."""


def _names(node: NodeProcess, parameter: str) -> list[str]:
    given = node.parameters.get(parameter, ())
    return [str(name) for name in given] if isinstance(given, list | tuple) else []


def _topics(cameras: Iterable[str], *endings: str) -> frozenset[str]:
    return frozenset(f"{camera}/{ending}" for camera in cameras for ending in endings)
