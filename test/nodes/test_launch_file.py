"""The launch file: what it starts, with which parameters, and that joint states come of its own usage line."""

import runpy
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest
from launch_stand_in import Node, performed
from outside.dressed_body import stations_around
from talos import MAPPING
from two_cameras import write_body

from bodycam_ros.body.body_file import read_body
from bodycam_ros.errors import BodyError, StationError
from bodycam_ros.nodes.graph import NodeProcess
from bodycam_ros.outside.stations_file import write_stations

REPOSITORY = Path(__file__).parents[2]
LAUNCH_FILE = REPOSITORY / "launch/bodycam.launch.py"
PROFILES = "FASTRTPS_DEFAULT_PROFILES_FILE"
_START_S, _SOON_S = 90.0, 30.0


def _launched(**arguments: str) -> dict[str, Node]:
    nodes, _ = performed(LAUNCH_FILE, REPOSITORY, **arguments)
    return {node.name: node for node in nodes}


def test_a_process_for_each_camera_and_the_rest(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv(PROFILES, raising=False)
    body = str(write_body(tmp_path / "body.yaml"))
    nodes, context = performed(LAUNCH_FILE, REPOSITORY, map="map", body=body)
    assert [node.executable for node in nodes] == [
        *("tracker", "tracker", "registration", "registration", "skeleton_solver")
    ]
    assert {node.package for node in nodes} == {"bodycam_ros"}
    assert all(node.files == [REPOSITORY / "config/bodycam.yaml"] and node.files[0].is_file() for node in nodes)
    assert Path(context.environment[PROFILES]).is_file()
    monkeypatch.setenv(PROFILES, "mine.xml")
    assert performed(LAUNCH_FILE, REPOSITORY, map="map", body=body)[1].environment[PROFILES] == "mine.xml"


def test_everybody_is_told_of_the_cameras(tmp_path: Path) -> None:
    body = str(write_body(tmp_path / "body.yaml", "odd", "spare"))
    nodes = _launched(map="map", body=body, cameras=" left, odd ", bagfile="bag", rate="0.5", loop="true")
    assert [name for name in nodes if name.startswith("tracker")] == ["tracker_left", "tracker_odd"]
    registering = [node for node in nodes.values() if node.executable == "registration"]
    assert sorted(camera for node in registering for camera in node.parameters["cameras"]) == ["left", "odd"]
    assert [node.parameters["publish_map"] for node in registering] == [True, False], "one map is enough"
    assert nodes["skeleton_solver"].parameters == {"body": body, "cameras": ["left", "odd"]}
    played = nodes["player"].parameters
    assert (played["bag"], played["rate"], played["cameras"], played["loop"]) == ("bag", 0.5, ["left", "odd"], True)


def test_registrations_are_told_where_to_keep_what_their_maps_grow_by(tmp_path: Path) -> None:
    body = str(write_body(tmp_path / "body.yaml"))
    nodes = _launched(map="map", body=body, grown_map="grown")
    kept = {name: node.parameters.get("grown_map") for name, node in nodes.items() if "grown_map" in node.parameters}
    assert kept == {"registration_1": "grown", "registration_2": "grown"}
    assert all("grown_map" not in node.parameters for node in _launched(map="map", body=body).values())


def test_the_solver_is_told_of_the_equipment(sample: Path) -> None:
    nodes = _launched(map="map", body=str(sample / "body.yaml"), equipment="bicycle")
    assert nodes["skeleton_solver"].parameters == {"body": str(sample / "body.yaml"), "equipment": "bicycle"}


def test_static_cameras_have_region_trackers(tmp_path: Path) -> None:
    body, stations = str(write_body(tmp_path / "body.yaml")), tmp_path / "cameras.yaml"
    write_stations(stations, stations_around(2).values())
    nodes = _launched(map="map", body=body, stations=str(stations), surface="scan", bagfile="bag")
    shared = {"body": body, "stations": str(stations), "map": "map"}
    assert nodes["region_tracker_ext_01"].parameters == shared | {"camera": "ext_01", "surface": "scan"}
    assert nodes["skeleton_solver"].parameters == shared
    assert nodes["player"].parameters["cameras"] == ["left", "right", "ext_00", "ext_01"]
    assert nodes["player"].parameters["image_only"] == ["ext_00", "ext_01"]
    alone = _launched(body=body, stations=str(stations), start="start.yaml", equipment="bicycle")
    assert [*alone] == ["region_tracker_ext_00", "region_tracker_ext_01", "skeleton_solver"]
    shared = {"body": body, "stations": str(stations), "start": "start.yaml", "equipment": "bicycle"}
    assert alone["region_tracker_ext_00"].parameters == shared | {"camera": "ext_00"}
    assert alone["skeleton_solver"].parameters == shared | {"worn": False}


def test_a_robot_follows_where_one_is_given(tmp_path: Path) -> None:
    given = {"map": "map", "body": str(write_body(tmp_path / "body.yaml")), "bagfile": "bag"}
    assert "retarget" not in _launched(**given)
    nodes = _launched(**given, robot="talos.urdf", mapping=str(MAPPING))
    assert nodes["retarget"].parameters == {"urdf": "talos.urdf", "mapping": str(MAPPING)}
    assert nodes["retarget"].executable == "retarget" and nodes["retarget"].respawn
    with pytest.raises(BodyError, match="needs both: robot:=ROBOT.urdf mapping:=MAPPING.yaml"):
        _launched(**given, robot="talos.urdf")
    with pytest.raises(BodyError, match="needs both"):
        _launched(**given, mapping=str(MAPPING))
    with pytest.raises(BodyError, match="nothing.yaml"):
        _launched(**given, robot="talos.urdf", mapping="nothing.yaml")


@pytest.mark.parametrize("respawn", ["true", "false"])
def test_who_dies_is_started_again_but_a_bag_is_played_once(tmp_path: Path, respawn: str) -> None:
    body = str(write_body(tmp_path / "body.yaml"))
    given = {} if respawn == "true" else {"respawn": respawn}
    nodes = _launched(map="map", body=body, bagfile="bag", **given)
    assert {name for name, node in nodes.items() if node.respawn} == (
        set(nodes) - {"player"} if respawn == "true" else set()
    )
    assert all(1.0 <= node.respawn_delay <= 5.0 for node in nodes.values())


def test_launch_kills_nobody_who_would_end_himself(tmp_path: Path) -> None:
    pytest.importorskip("rclpy", reason="rclpy is not installed; 'make test' installs it")
    from bodycam_ros.nodes.farewell import PATIENCE_S

    body = str(write_body(tmp_path / "body.yaml"))
    assert all(node.leave_s > PATIENCE_S for node in _launched(map="map", body=body).values())


def test_wrong_arguments_are_refused(tmp_path: Path) -> None:
    body = str(write_body(tmp_path / "body.yaml"))
    with pytest.raises(RuntimeError, match="missing required argument 'body'"):
        _launched(map="map")
    with pytest.raises(StationError, match="neither a map.* nor a file of static cameras"):
        _launched(body=body)
    with pytest.raises(RuntimeError, match="'respawn' provided value 'perhaps'"):
        _launched(map="map", body=body, respawn="perhaps")
    with pytest.raises(BodyError, match="no camera hat"):
        _launched(map="map", body=body, cameras="hat")
    stations = str(tmp_path / "cameras.yaml")
    write_stations(Path(stations), stations_around(1).values())
    with pytest.raises(StationError, match="cameras, grown_map: for cameras on the body, which need a map"):
        _launched(body=body, stations=stations, cameras="left", grown_map="grown")
    with pytest.raises(StationError, match="surface, start: for static cameras"):
        _launched(map="map", body=body, surface="scan", start="start.yaml")


def test_a_rig_instead_of_a_body(tmp_path: Path) -> None:
    rig = tmp_path / "rig.yaml"
    rig.write_text("cameras: {left: torso, right: arm}\nsegments: {torso: null, arm: torso}\n")
    nodes = _launched(map="map", rig=str(rig), body="new.yaml", overwrite_body="True")
    given = {"body": "new.yaml", "rig": str(rig), "map": "map", "overwrite_body": True}
    assert nodes["skeleton_solver"].parameters == given


@dataclass(frozen=True)
class LaunchedProcess(NodeProcess):
    """A node with the command line that launch gives it."""

    command: tuple[str, ...] = ()

    def arguments(self, config: Path | None = None) -> list[str]:
        return list(self.command)


def test_joint_states_come_of_the_usage_line(graph: Any, sample: Path, tmp_path: Path) -> None:
    cameras = ("waist_front", "torso_front")
    nodes, _ = performed(
        LAUNCH_FILE,
        REPOSITORY,
        map=str(sample / "map"),
        body=str(sample / "body.yaml"),
        bagfile=str(sample / "sample/bag"),
        rate="0.5",
        cameras=",".join(cameras),
    )
    graph.listen({"/joint_states": "sensor_msgs/msg/JointState", "/map/points": "sensor_msgs/msg/PointCloud2"})
    graph.listen({"/diagnostics": "diagnostic_msgs/msg/DiagnosticArray"})
    *others, playing = (
        LaunchedProcess(node.executable, node.name, command=tuple(node.command_arguments(tmp_path))) for node in nodes
    )
    graph.start(*others)
    # The player waits for the nodes, not for the listener, which hears no joint states before the solver knows it.
    graph.until_known(_START_S)
    graph.start(playing)
    started = {each.node.name: each for each in graph.started}
    assert len(started) == 6
    player = started["player"]
    graph.until(lambda: player.process.poll() is not None, _START_S, "the bag is played")
    assert player.process.returncode == 0, graph.report()
    assert f"plays {', '.join(sorted(cameras))}; leaves out " in player.printed
    graph.until(lambda: len(graph.heard["/joint_states"]) > 50, _SOON_S, "joint states for the 60 images of a camera")
    assert len(graph.heard["/map/points"]) == 1, "several registrations, one map"
    unused = set(read_body(sample / "body.yaml").mounts) - set(cameras)
    waited_for = [camera for camera in unused if camera in started["skeleton_solver"].printed]
    assert not waited_for, "cameras that nobody starts"
    assert set(graph.end().values()) == {0}, graph.report()
    assert "Traceback" not in graph.report()


def test_launch_itself_takes_the_file(tmp_path: Path) -> None:
    pytest.importorskip("launch_ros", reason="launch has no wheels; this test runs where ROS 2 is installed")
    from launch import LaunchContext

    described = runpy.run_path(str(LAUNCH_FILE))
    context = LaunchContext()
    given = {"map": "map", "body": str(write_body(tmp_path / "body.yaml")), "bagfile": "bag"}
    context.launch_configurations.update(given)
    for entity in described["generate_launch_description"]().entities[:-1]:
        entity.execute(context)
    nodes = described["_nodes"](context)
    assert [node.node_executable for node in nodes] == [
        *("tracker", "tracker", "registration", "registration", "skeleton_solver", "player")
    ]
