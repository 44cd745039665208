"""Which nodes make the graph; without ROS."""

import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import pytest
import yaml
from helpers.live_graph import live_graph
from helpers.naming import names, naming
from helpers.two_cameras import write_body
from static_cameras.dressed_body import static_cameras_around

from bodycam_ros.body.body_file import read_body
from bodycam_ros.body.body_file import write_body as write_body_file
from bodycam_ros.errors import BodycamError, BodyError, StaticCameraError
from bodycam_ros.formats.static_cameras_file import write_static_cameras
from bodycam_ros.graph.declared_graph import USER_ERROR, GraphArguments, GraphNode, from_command_line, graph


def test_a_tracker_for_each_camera_and_one_of_the_rest(tmp_path: Path) -> None:
    nodes = live_graph(tmp_path / "map", write_body(tmp_path / "body.yaml"))
    assert [node.executable for node in nodes] == ["tracker", "tracker", "registration", "skeleton_solver"]
    assert [node.parameters["camera"] for node in nodes[:2]] == ["left", "right"]
    assert {nodes[index].parameters["map"] for index in range(4)} == {str(tmp_path / "map")}
    assert nodes[2].parameters["cameras"] == ["left", "right"]
    assert nodes[3].parameters["body"] == str(tmp_path / "body.yaml")


@pytest.mark.parametrize("registrations, shares", [(1, [["left", "odd", "right"]]), (2, [["left", "odd"], ["right"]])])
def test_registrations_share_the_cameras(tmp_path: Path, registrations: int, shares: list[list[str]]) -> None:
    body = write_body(tmp_path / "body.yaml", "odd")
    nodes = live_graph(tmp_path / "map", body, ["left", "right", "odd"], registrations)
    registering = [node for node in nodes if node.executable == "registration"]
    assert [sorted(node.parameters["cameras"]) for node in registering] == shares
    assert [node.parameters["publish_map"] for node in registering] == [True, False][:registrations]
    assert len({node.name for node in nodes}) == len(nodes)


def test_cameras_of_the_equipment_are_tracked(tmp_path: Path) -> None:
    machine = tmp_path / "stick.yaml"
    machine.write_text("cameras: {tip: {segment: stick}}\n")
    nodes = live_graph(tmp_path / "map", write_body(tmp_path / "body.yaml"), equipment=str(machine))
    assert [node.parameters["camera"] for node in nodes if node.executable == "tracker"] == ["left", "right", "tip"]
    assert nodes[-1].parameters["equipment"] == str(machine)


def test_static_cameras_around_a_body_that_wears_none_may_have_a_map(tmp_path: Path) -> None:
    body, stations = write_body(tmp_path / "body.yaml"), tmp_path / "cameras.yaml"
    write_body_file(replace(read_body(body), mounts={}), body)
    write_static_cameras(stations, static_cameras_around(1).values())
    nodes = live_graph(tmp_path / "map", body, stations=str(stations), start=str(tmp_path / "start.yaml"))
    assert [node.executable for node in nodes] == ["skeleton_solver"]
    assert nodes[0].parameters["map"] == str(tmp_path / "map")
    assert nodes[0].parameters["body_cameras"] is False


def test_a_rig_instead_of_a_body(tmp_path: Path) -> None:
    rig = tmp_path / "rig.yaml"
    rig.write_text("cameras: {left: torso, right: arm}\nsegments: {torso: null, arm: torso}\n")
    nodes = live_graph(tmp_path / "map", tmp_path / "body.yaml", rig=str(rig))
    assert [node.name for node in nodes] == ["tracker_left", "tracker_right", "registration", "skeleton_solver"]
    assert nodes[-1].parameters["rig"] == str(rig)


@pytest.mark.parametrize(
    "given, named",
    [
        ({"body": ""}, "body"),
        ({"body": "no.yaml"}, "no.yaml"),
        ({"map": ""}, "stations"),
        ({"cameras": "hat"}, "hat"),
        ({"nodes": "kitchen"}, "kitchen"),
        ({"surface": "meshes"}, "surface"),
        ({"urdf": "talos.urdf"}, "mapping"),
        ({"rate": "fast"}, "rate"),
        ({"loop": "perhaps"}, "loop"),
        ({"stations": "nowhere.yaml"}, "nowhere.yaml"),
    ],
)
def test_wrong_arguments_are_refused(tmp_path: Path, given: dict[str, str], named: str) -> None:
    whole = {"map": "map", "body": str(write_body(tmp_path / "body.yaml")), **given}
    with naming(BodycamError, named):
        graph(GraphArguments.from_texts(whole))


@pytest.mark.parametrize(
    "name, content",
    [
        ("calib.toml", "[cam_0]\nname = 'x'"),
        ("cv.yaml", "%YAML:1.0\n---\n"),
        ("number.yaml", "5"),
        ("list.yaml", "[a]"),
    ],
)
def test_a_file_that_is_no_table_of_static_cameras_is_refused(tmp_path: Path, name: str, content: str) -> None:
    (tmp_path / name).write_text(content)
    given = {"body": str(write_body(tmp_path / "body.yaml")), "stations": str(tmp_path / name), "start": "start.yaml"}
    with naming(StaticCameraError, tmp_path / name, "bodycam stations"):
        graph(GraphArguments.from_texts(given))


def test_arguments_are_yaml_whatever_the_value() -> None:
    values = {"bagfile": "a folder: with #signs", "rate": 0.5, "cameras": ["a", "b"]}
    words = GraphNode("player", "player_2", values, "/lab/anna/").arguments()
    assert words[:5] == ["--ros-args", "-r", "__node:=player_2", "-r", "__ns:=/lab/anna"]
    given = dict(word.split(":=", 1) for word in words[6::2])
    assert {name: yaml.safe_load(value) for name, value in given.items()} == values


def test_the_launch_file_loads_nothing_heavy() -> None:
    """It is read in the interpreter of ``ros2``, also on computers without NumPy."""
    command = "import sys, bodycam_ros.graph.declared_graph; print(*sys.modules)"
    loaded = subprocess.run([sys.executable, "-c", command], capture_output=True, text=True, check=True).stdout.split()
    assert not {"numpy", "scipy", "cv2", "numba", "rclpy"} & {*loaded}


@pytest.mark.parametrize("node", ["tracker", "player", "retarget"])
def test_a_node_loads_no_library_that_it_does_not_need(node: str) -> None:
    """There is a tracker for each camera: 16 times the time and memory."""
    command = f"import sys, bodycam_ros.nodes.{node}; print(*sys.modules)"
    loaded = subprocess.run([sys.executable, "-c", command], capture_output=True, text=True, check=True).stdout.split()
    assert not {"scipy", "matplotlib", "pycolmap", "numba", "jinja2", "trimesh", "av", "gtsam"} & {*loaded}


def given(tmp_path: Path, **texts: str) -> dict[str, str]:
    return {"map": "map", "body": str(write_body(tmp_path / "body.yaml")), **texts}


def test_a_played_bag_waits_for_every_reader_of_its_cameras(tmp_path: Path) -> None:
    *others, player = graph(GraphArguments.from_texts(given(tmp_path, bagfile="walk", rate="0.5", use_sim_time="true")))
    assert player.executable == "player"
    assert player.parameters["cameras"] == ["left", "right"] and player.parameters["rate"] == 0.5
    readers = sum("left" in (node.parameters.get("camera"), *node.parameters.get("cameras", ())) for node in others)
    assert player.parameters["readers"] == readers + 1, "its tracker, its registration, and the solver, which has all"
    # The player makes the clock that the others follow.
    assert player.parameters["clock"] > 0.0 and "use_sim_time" not in player.parameters
    assert all(node.parameters["use_sim_time"] for node in others)


def test_a_computer_runs_the_nodes_that_are_named_by_kind_or_by_name(tmp_path: Path) -> None:
    chosen = graph(GraphArguments.from_texts(given(tmp_path, nodes="tracker_right, registration")))
    assert [node.name for node in chosen] == ["tracker_right", "registration_1", "registration_2"]
    with_names = graph(GraphArguments.from_texts(given(tmp_path, nodes="tracker")))
    assert [node.name for node in with_names] == ["tracker_left", "tracker_right"]


def test_an_argument_goes_to_the_nodes_that_have_it_as_a_parameter(tmp_path: Path) -> None:
    nodes = graph(GraphArguments.from_texts(given(tmp_path, transport="raw", autostart="false", grown_map="grown")))
    for node in nodes:
        assert node.parameters["autostart"] is False
        assert node.parameters.get("transport") == ("raw" if "registration" not in node.name else None)
        assert node.parameters.get("grown_map") == ("grown" if "registration" in node.name else None)


def test_cameras_of_a_urdf_are_its_optical_frames(tmp_path: Path) -> None:
    urdf = tmp_path / "body.URDF"
    urdf.write_text('<robot name="r"><link name="a"/><link name="cam_optical_frame"/><link name="b_optical"/></robot>')
    nodes = graph(GraphArguments.from_texts({"map": "map", "body": str(urdf)}))
    assert [node.parameters["camera"] for node in nodes if node.executable == "tracker"] == ["cam"]
    urdf.write_text("<robot")
    with naming(BodyError, urdf, "URDF"):
        graph(GraphArguments.from_texts({"map": "map", "body": str(urdf)}))


def test_a_calibration_takes_all_cameras_of_its_rig(tmp_path: Path) -> None:
    rig = tmp_path / "rig.yaml"
    rig.write_text("cameras: {left: torso, right: arm}\nsegments: {torso: null, arm: torso}\n")
    with naming(BodyError, rig, "cameras"):
        graph(GraphArguments.from_texts(given(tmp_path, rig=str(rig), cameras="left")))
    rig.write_text("cameras: [left, right]\n")
    with naming(BodyError, rig, "cameras"):
        graph(GraphArguments.from_texts(given(tmp_path, rig=str(rig))))


def test_a_wrong_word_on_the_command_line_ends_with_one_line(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as ended:
        from_command_line(["--map", "map", "--ros-args", "--params-file", "x.yaml"])
    assert ended.value.code == USER_ERROR
    (line,) = capsys.readouterr().err.splitlines()
    assert names(line, "body") and line.startswith("graph: error: ")


def test_the_command_line_has_the_arguments_of_the_launch_file(tmp_path: Path) -> None:
    body = str(write_body(tmp_path / "body.yaml"))
    words = ["--map", "map", "--body", body, "--registrations", "1", "--use-sim-time", "--ros-args", "-r", "__ns:=/a"]
    texts = {"map": "map", "body": body, "registrations": "1", "use_sim_time": "true"}
    assert from_command_line(words) == graph(GraphArguments.from_texts(texts))
