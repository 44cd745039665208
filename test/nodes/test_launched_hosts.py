"""What one host starts: a person of several, some of the nodes, one process, and who says where the links are."""

from pathlib import Path

import pytest
from launch_stand_in import ExecutableInPackage, PackageNotFoundError, performed
from launched import LAUNCH_FILE, REPOSITORY, launched, write_rig
from outside.dressed_body import stations_around
from talos import MAPPING
from two_cameras import write_body

from bodycam_ros.body.body_file import read_body
from bodycam_ros.body.urdf import urdf_text
from bodycam_ros.errors import SettingsError
from bodycam_ros.nodes.launched import FILES_OF_GRAPH, STATE_PUBLISHER
from bodycam_ros.outside.stations_file import write_stations
from bodycam_ros.secured.enclaves import enclaves_of


def test_a_person_has_a_namespace_and_frames_of_that_name(tmp_path: Path) -> None:
    given = {"map": "map", "body": str(write_body(tmp_path / "body.yaml")), "bagfile": "bag"}
    assert all("frame_prefix" not in node.parameters and node.namespace is None for node in launched(**given).values())
    for namespace, prefix in (("anna", "anna/"), ("/lab/anna", "lab/anna/")):
        nodes = launched(**given, namespace=namespace)
        assert {node.namespace for node in nodes.values()} == {f"/{namespace.strip('/')}"}, "the player's, too"
        assert {node.parameters["frame_prefix"] for node in nodes.values()} == {prefix}
        command = nodes["tracker_left"].command_arguments(tmp_path)
        at = command.index("-r")
        assert command[at : at + 4] == ["-r", "__node:=tracker_left", "-r", f"__ns:=/{namespace.strip('/')}"]
    nodes = launched(**given, namespace="anna", frame_prefix="a_")
    assert {node.parameters["frame_prefix"] for node in nodes.values()} == {"a_"}
    nodes = launched(**given, namespace="anna", frame_prefix="none")
    assert {node.parameters["frame_prefix"] for node in nodes.values()} == {""}, "whatever the parameter file says"


def test_a_host_runs_what_it_is_to_run(tmp_path: Path) -> None:
    given = {"map": "map", "body": str(write_body(tmp_path / "body.yaml")), "registrations": "1"}
    assert [*launched(**given, nodes="tracker")] == ["tracker_left", "tracker_right"]
    assert [*launched(**given, nodes="registration, skeleton_solver")] == ["registration", "skeleton_solver"]
    assert [*launched(**given, nodes="tracker_right", bagfile="bag")] == ["tracker_right", "player"]
    installed = (STATE_PUBLISHER,)
    assert STATE_PUBLISHER not in launched(installed, **given, nodes="tracker"), "it goes with the solver"
    with pytest.raises(SettingsError, match="the graph has no trakker; it has tracker, registration, skeleton_solver"):
        launched(**given, nodes="trakker")


def test_the_whole_graph_in_one_process(tmp_path: Path) -> None:
    body = write_body(tmp_path / "body.yaml")
    given = {"map": "map", "body": str(body), "one_process": "true", "namespace": "anna"}
    (graph,) = launched(**given, cameras="right, left", transport="raw", params_file="mine.yaml").values()
    assert (graph.executable, graph.respawn) == ("graph", True)
    assert graph.command_arguments(tmp_path) == [
        *("--map", "map", "--body", str(body), "--cameras", "right", "left", "--registrations", "1"),
        *("--ros-args", "--enclave", "/anna/graph", "--ros-args", "-r", "__ns:=/anna"),
        *("--params-file", "mine.yaml", "--params-file", str(tmp_path / "anna.graph.params.yaml")),
    ]
    assert graph.parameters == {"frame_prefix": "anna/", "transport": "raw"}, "of all its nodes"
    (graph,) = launched(**given, bagfile="bag", rate="0.5", loop="true", registrations="2").values()
    words = graph.command_arguments(tmp_path)
    assert words[4:11] == ["--registrations", "2", "--bag", "bag", "--rate", "0.5", "--loop"]
    assert not graph.respawn
    nodes = launched((STATE_PUBLISHER,), **given)
    assert nodes["graph"].parameters["publish_links"] is False and STATE_PUBLISHER in nodes
    (graph,) = launched(**given, bagfile="bag", use_sim_time="true").values()
    assert graph.parameters == {"frame_prefix": "anna/", "use_sim_time": True, "clock": 40.0}
    (graph,) = launched(**given, nodes="tracker, registration").values()
    assert graph.command_arguments(tmp_path)[4:9] == ["--registrations", "1", "--nodes", "tracker", "registration"]
    with pytest.raises(SettingsError, match="the graph has no registration_1"):
        launched(**given, nodes="registration_1")


def test_processes_are_forked_from_one_where_cores_are_few(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    body = write_body(tmp_path / "body.yaml")
    given = {"map": "map", "body": str(body)}
    monkeypatch.setattr("os.cpu_count", lambda: 2)
    assert len(launched(**given, processes="auto")) == 5
    monkeypatch.setattr("os.cpu_count", lambda: 1)
    (graph,) = launched(**given, processes="auto").values()
    assert (graph.executable, graph.respawn) == ("graph", True)
    assert graph.command_arguments(tmp_path)[:9] == [
        *("--map", "map", "--body", str(body), "--registrations", "4", "--processes", "--respawn", "2")
    ]
    assert [*launched(**given, processes="auto", nodes="tracker")] == ["tracker_left", "tracker_right"]
    (graph,) = launched(**given, processes="forked", respawn="false", bagfile="bag").values()
    assert not graph.respawn and "--respawn" not in graph.cmd, "a bag is played once"


def test_the_graph_in_one_process_knows_what_launch_says(tmp_path: Path) -> None:
    pytest.importorskip("rclpy", reason="rclpy is not installed; 'make test' installs it")
    from bodycam_ros.nodes.graph_command import _parser

    body, stations = write_body(tmp_path / "body.yaml"), tmp_path / "cameras.yaml"
    write_stations(stations, stations_around(1).values())
    given = {"body": str(body), "stations": str(stations), "equipment": "", "mapping": str(MAPPING)}
    given = (
        dict.fromkeys(FILES_OF_GRAPH, "some")
        | given
        | {"rig": "", "cameras": "left", "registrations": "2", "humans": "anna"}
    )
    (graph,) = launched(**given, bagfile="bag", loop="true", one_process="true").values()
    said = vars(_parser().parse_args([str(word) for word in graph.cmd[1:]]))
    left_out = {name for name, value in said.items() if not value}
    assert left_out == {"rig", "overwrite_body", "equipment", "nodes", "processes", "respawn"}
    assert (said["cameras"], said["registrations"], said["grown_map"]) == (["left"], 2, Path("some"))
    (graph,) = launched(**given, bagfile="bag", nodes="tracker", processes="forked").values()
    said = vars(_parser().parse_args([str(word) for word in graph.cmd[1:]]))
    assert (said["processes"], said["respawn"], said["nodes"], said["rate"]) == (True, 2.0, ["tracker"], 1.0)


def test_robot_state_publisher_takes_over_the_links_where_it_is(tmp_path: Path) -> None:
    body = write_body(tmp_path / "body.yaml")
    given = {"map": "map", "body": str(body)}
    alone = launched(**given)
    assert STATE_PUBLISHER not in alone and "publish_links" not in alone["skeleton_solver"].parameters
    nodes = launched((STATE_PUBLISHER,), **given, namespace="anna", use_sim_time="true", params_file="mine.yaml")
    assert nodes["skeleton_solver"].parameters["publish_links"] is False, "or every link is published twice"
    beside = nodes[STATE_PUBLISHER]
    assert (beside.package, beside.namespace) == (STATE_PUBLISHER, "/anna")
    assert beside.files == [Path("mine.yaml")], "a frame_prefix that the file alone has is of these frames, too"
    assert beside.parameters == {
        "robot_description": urdf_text(read_body(body)),
        "frame_prefix": "anna/",
        "publish_frequency": 1000.0,
        "ignore_timestamp": True,
        "use_sim_time": True,
    }
    assert beside.ros_arguments == ["--enclave", f"/anna/{STATE_PUBLISHER}"]
    assert beside.ros_arguments[1] in enclaves_of([], "anna"), "or it has no keys"
    (source, target) = beside.remappings[0]
    assert source == "robot_description" != target, "the solver publishes that"
    for alone in (
        launched((STATE_PUBLISHER,), **given, robot_state_publisher="false"),
        launched((STATE_PUBLISHER,), **(given | {"body": "new.yaml", "rig": str(write_rig(tmp_path))})),
    ):
        assert STATE_PUBLISHER not in alone and "publish_links" not in alone["skeleton_solver"].parameters
    with pytest.raises(PackageNotFoundError):
        launched(**given, robot_state_publisher="true")


def test_links_whose_lengths_are_learned_are_the_solvers_to_publish(sample: Path) -> None:
    nodes = launched((STATE_PUBLISHER,), map="map", body=str(sample / "body.yaml"), equipment="bicycle")
    assert STATE_PUBLISHER not in nodes and "publish_links" not in nodes["skeleton_solver"].parameters


def test_the_view_is_of_the_persons_graph(tmp_path: Path) -> None:
    given = {"map": "map", "body": str(write_body(tmp_path / "body.yaml")), "namespace": "anna"}
    _, context = performed(LAUNCH_FILE, REPOSITORY, **given, viewer="true", viewer_port="8081")
    *_, view = context.started
    program, *words = view.cmd
    assert isinstance(program, ExecutableInPackage)
    assert (program.executable, program.package) == ("bodycam", "bodycam_ros")
    assert words == ["view", "--live", "--map", "map", "--namespace", "anna", "--port", "8081"]
    assert not view.respawn
    assert view.additional_env == {"ROS_SECURITY_ENCLAVE_OVERRIDE": "/anna/observer"}, "whose keys it has, if there are"
    assert "/anna/observer" in enclaves_of([], "anna")
