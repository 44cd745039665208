"""Which processes make the graph; without ROS."""

from dataclasses import replace
from pathlib import Path

import pytest
import yaml
from outside.dressed_body import stations_around
from two_cameras import write_body

from bodycam_ros.body.body_file import read_body
from bodycam_ros.body.body_file import write_body as write_body_file
from bodycam_ros.errors import BodyError
from bodycam_ros.nodes.graph import NodeProcess, cameras_of, live_graph
from bodycam_ros.outside.outside_files import OutsideInput
from bodycam_ros.outside.stations_file import write_stations


def test_a_tracker_for_each_camera_and_one_of_the_rest(tmp_path: Path) -> None:
    nodes = live_graph(tmp_path / "map", write_body(tmp_path / "body.yaml"))
    assert [node.executable for node in nodes] == ["tracker", "tracker", "registration", "skeleton_solver"]
    assert len({node.name for node in nodes}) == len(nodes)
    assert [node.parameters["camera"] for node in nodes[:2]] == ["left", "right"]
    of_registration = {"map": str(tmp_path / "map"), "cameras": ["left", "right"], "publish_map": True}
    assert nodes[2].parameters == of_registration | {"landmark_readers": 2}
    assert nodes[3].parameters == {"body": str(tmp_path / "body.yaml")}


@pytest.mark.parametrize("registrations, shares", [(1, [["left", "odd", "right"]]), (2, [["left", "odd"], ["right"]])])
def test_registrations_share_the_cameras(tmp_path: Path, registrations: int, shares: list[list[str]]) -> None:
    body = write_body(tmp_path / "body.yaml", "odd")
    nodes = live_graph(tmp_path / "map", body, ["left", "right", "odd"], registrations)
    registering = [node for node in nodes if node.executable == "registration"]
    assert [sorted(node.parameters["cameras"]) for node in registering] == shares
    assert [node.parameters["publish_map"] for node in registering] == [True, False][:registrations]
    assert len({node.name for node in nodes}) == len(nodes)


def test_equipment_is_the_solvers_and_its_cameras_are_tracked(tmp_path: Path) -> None:
    machine = tmp_path / "stick.yaml"
    machine.write_text(
        "name: stick\nroot: stick\nsegments: {stick: {}}\n"
        "attachments:\n"
        "  grip: {body: arm, equipment: stick, weight: 9, points: [{body: [0, 0, 0], equipment: [9, 0, 0]}]}\n"
        "cameras: {tip: {segment: stick, position: [1, 0, 0], quaternion_xyzw: [0, 0, 0, 1]}}\n"
    )
    nodes = live_graph(tmp_path / "map", write_body(tmp_path / "body.yaml"), equipment=str(machine))
    assert cameras_of(nodes) == ["left", "right", "tip"]
    assert nodes[-1].parameters == {"body": str(tmp_path / "body.yaml"), "equipment": str(machine)}
    with pytest.raises(BodyError, match="bicycle: attachment foot_left is to segment foot_left, which body two"):
        live_graph(tmp_path / "map", tmp_path / "body.yaml", equipment="bicycle")


def test_static_cameras_around_a_body_that_wears_none_may_have_a_map(tmp_path: Path) -> None:
    body = write_body(tmp_path / "body.yaml")
    write_body_file(replace(read_body(body), mounts={}), body)
    outside = OutsideInput(tmp_path / "cameras.yaml", start=tmp_path / "start.yaml")
    write_stations(outside.stations, stations_around(1).values())
    nodes = live_graph(tmp_path / "map", body, outside=outside)
    assert [node.executable for node in nodes] == ["region_tracker", "skeleton_solver"]
    assert all(node.parameters["map"] == str(tmp_path / "map") for node in nodes)
    assert nodes[1].parameters["worn"] is False


def test_a_rig_instead_of_a_body(tmp_path: Path) -> None:
    rig = tmp_path / "rig.yaml"
    rig.write_text("cameras: {left: torso, right: arm}\nsegments: {torso: null, arm: torso}\n")
    nodes = live_graph(tmp_path / "map", tmp_path / "body.yaml", rig=rig)
    assert [node.name for node in nodes] == ["tracker_left", "tracker_right", "registration", "skeleton_solver"]
    written = {
        "body": str(tmp_path / "body.yaml"),
        "rig": str(rig),
        "map": str(tmp_path / "map"),
        "overwrite_body": False,
    }
    assert nodes[-1].parameters == written
    with pytest.raises(BodyError, match="the rig carries no camera hat; it carries left, right"):
        live_graph(tmp_path / "map", tmp_path / "body.yaml", ["hat"], rig=rig)
    with pytest.raises(BodyError, match="needs all cameras of the rig"):
        live_graph(tmp_path / "map", tmp_path / "body.yaml", ["left"], rig=rig)


def test_arguments_are_yaml_whatever_the_value() -> None:
    node = NodeProcess("player", "player_2", {"bag": "a folder: with #signs", "rate": 0.5, "cameras": ["a", "b"]})
    arguments = node.arguments(Path("some.yaml"))
    assert arguments[:5] == ["--ros-args", "-r", "__node:=player_2", "--params-file", "some.yaml"]
    given = dict(argument.split(":=", 1) for argument in arguments[6:-2:2])
    assert {name: yaml.safe_load(value) for name, value in given.items()} == node.parameters
    assert arguments[-2:] == ["--enclave", "/player_2"]
    assert NodeProcess("player", "player_2", namespace="/lab/anna/").enclave == "/lab/anna/player_2"
