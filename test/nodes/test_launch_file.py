"""The launch file: what it starts, and with which parameters."""

import runpy
from pathlib import Path

import pytest
from launch_stand_in import performed
from launched import LAUNCH_FILE, REPOSITORY, launched, write_rig
from outside.dressed_body import stations_around
from talos import MAPPING
from two_cameras import write_body

from bodycam_ros.errors import BodyError, SettingsError, StationError
from bodycam_ros.outside.stations_file import write_stations

PROFILES = "FASTRTPS_DEFAULT_PROFILES_FILE"


def test_a_process_for_each_camera_and_the_rest(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv(PROFILES, raising=False)
    body = str(write_body(tmp_path / "body.yaml"))
    nodes, context = performed(LAUNCH_FILE, REPOSITORY, map="map", body=body, processes="separate")
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
    nodes = launched(map="map", body=body, cameras=" left, odd ", bagfile="bag", rate="0.5", loop="true")
    assert [name for name in nodes if name.startswith("tracker")] == ["tracker_left", "tracker_odd"]
    registering = [node for node in nodes.values() if node.executable == "registration"]
    assert sorted(camera for node in registering for camera in node.parameters["cameras"]) == ["left", "odd"]
    assert [node.parameters["publish_map"] for node in registering] == [True, False], "one map is enough"
    assert nodes["skeleton_solver"].parameters == {"body": body, "cameras": ["left", "odd"]}
    played = nodes["player"].parameters
    assert (played["bag"], played["rate"], played["cameras"], played["loop"]) == ("bag", 0.5, ["left", "odd"], True)


def test_registrations_are_told_where_to_keep_what_their_maps_grow_by(tmp_path: Path) -> None:
    body = str(write_body(tmp_path / "body.yaml"))
    nodes = launched(map="map", body=body, grown_map="grown")
    kept = {name: node.parameters.get("grown_map") for name, node in nodes.items() if "grown_map" in node.parameters}
    assert kept == {"registration_1": "grown", "registration_2": "grown"}
    assert all("grown_map" not in node.parameters for node in launched(map="map", body=body).values())


def test_the_solver_is_told_of_the_equipment(sample: Path) -> None:
    nodes = launched(map="map", body=str(sample / "body.yaml"), equipment="bicycle")
    assert nodes["skeleton_solver"].parameters == {"body": str(sample / "body.yaml"), "equipment": "bicycle"}


def test_static_cameras_have_region_trackers(tmp_path: Path) -> None:
    body, stations = str(write_body(tmp_path / "body.yaml")), tmp_path / "cameras.yaml"
    write_stations(stations, stations_around(2).values())
    nodes = launched(map="map", body=body, stations=str(stations), surface="scan", bagfile="bag")
    shared = {"body": body, "stations": str(stations), "map": "map"}
    assert nodes["region_tracker_ext_01"].parameters == shared | {"camera": "ext_01", "surface": "scan"}
    assert nodes["skeleton_solver"].parameters == shared
    assert nodes["player"].parameters["cameras"] == ["left", "right", "ext_00", "ext_01"]
    assert nodes["player"].parameters["image_only"] == ["ext_00", "ext_01"]
    alone = launched(body=body, stations=str(stations), start="start.yaml", equipment="bicycle")
    assert [*alone] == ["region_tracker_ext_00", "region_tracker_ext_01", "skeleton_solver"]
    shared = {"body": body, "stations": str(stations), "start": "start.yaml", "equipment": "bicycle"}
    assert alone["region_tracker_ext_00"].parameters == shared | {"camera": "ext_00"}
    assert alone["skeleton_solver"].parameters == shared | {"worn": False}


def test_a_robot_follows_where_one_is_given(tmp_path: Path) -> None:
    given = {"map": "map", "body": str(write_body(tmp_path / "body.yaml")), "bagfile": "bag"}
    assert "retarget" not in launched(**given)
    nodes = launched(**given, robot="talos.urdf", mapping=str(MAPPING))
    assert nodes["retarget"].parameters == {"urdf": "talos.urdf", "mapping": str(MAPPING)}
    assert nodes["retarget"].executable == "retarget" and nodes["retarget"].respawn
    with pytest.raises(BodyError, match="needs both: robot:=ROBOT.urdf mapping:=MAPPING.yaml"):
        launched(**given, robot="talos.urdf")
    with pytest.raises(BodyError, match="needs both"):
        launched(**given, mapping=str(MAPPING))
    with pytest.raises(BodyError, match="nothing.yaml"):
        launched(**given, robot="talos.urdf", mapping="nothing.yaml")


def test_the_body_is_a_human_of_rep_155_where_it_has_an_id(tmp_path: Path) -> None:
    given = {"map": "map", "body": str(write_body(tmp_path / "body.yaml"))}
    assert "humans" not in launched(**given)
    human = launched(**given, humans="anna", namespace="a")["humans"]
    assert human.executable == "humans" and human.namespace == "/a"
    assert human.parameters["body_id"] == "anna"


@pytest.mark.parametrize("respawn", ["true", "false"])
def test_who_dies_is_started_again_but_a_bag_is_played_once(tmp_path: Path, respawn: str) -> None:
    body = str(write_body(tmp_path / "body.yaml"))
    given = {} if respawn == "true" else {"respawn": respawn}
    nodes = launched(map="map", body=body, bagfile="bag", **given)
    assert {name for name, node in nodes.items() if node.respawn} == (
        set(nodes) - {"player"} if respawn == "true" else set()
    )
    assert all(1.0 <= node.respawn_delay <= 5.0 for node in nodes.values())


def test_clock_images_settings_and_management_are_everybodys(tmp_path: Path) -> None:
    body, stations = str(write_body(tmp_path / "body.yaml")), tmp_path / "cameras.yaml"
    write_stations(stations, stations_around(1).values())
    given = {"map": "map", "body": body, "bagfile": "bag", "stations": str(stations)}
    for node in launched(**given).values():
        assert not {"use_sim_time", "clock", "transport", "autostart"} & node.parameters.keys(), (
            "as the parameter file says"
        )
    nodes = launched(**given, use_sim_time="true", transport="raw", autostart="false", params_file="mine.yaml")
    assert all(node.files == [Path("mine.yaml")] for node in nodes.values())
    player = nodes["player"].parameters
    assert player["clock"] > 0.0 and "use_sim_time" not in player, "it says what time it is"
    assert all(node.parameters["use_sim_time"] is True for name, node in nodes.items() if name != "player")
    reading = {name for name, node in nodes.items() if node.parameters.get("transport") == "raw"}
    assert reading == {"tracker_left", "tracker_right", "region_tracker_ext_00"}
    assert {name for name, node in nodes.items() if node.parameters.get("autostart") is False} == set(nodes) - {
        "player"
    }
    older = launched(**given, config="mine.yaml")
    assert all(node.files == [Path("mine.yaml")] for node in older.values())


def test_every_transport_may_be_asked_for(tmp_path: Path) -> None:
    pytest.importorskip("rclpy", reason="rclpy is not installed; 'make test' installs it")
    from bodycam_ros.nodes.camera_topics import TRANSPORTS

    for transport in ("", *TRANSPORTS):
        assert launched(map="map", body=str(write_body(tmp_path / "body.yaml")), transport=transport)
    with pytest.raises(RuntimeError, match="'transport' provided value 'smoke'"):
        launched(map="map", body=str(tmp_path / "body.yaml"), transport="smoke")


def test_texts_stay_texts(tmp_path: Path) -> None:
    folder = tmp_path / "on: 5"
    folder.mkdir()
    body = write_body(folder / "body.yaml", '"on"', '"12"')
    nodes = launched(map="1.5", body=str(body), cameras="on,12", registrations="1")
    assert nodes["tracker_12"].parameters == {"camera": "12", "map": "1.5"}
    assert nodes["registration"].parameters["cameras"] == ["on", "12"]
    assert nodes["skeleton_solver"].parameters["body"] == str(body)


def test_launch_kills_nobody_who_would_end_himself(tmp_path: Path) -> None:
    pytest.importorskip("rclpy", reason="rclpy is not installed; 'make test' installs it")
    from bodycam_ros.nodes.farewell import PATIENCE_S

    body = str(write_body(tmp_path / "body.yaml"))
    assert all(node.leave_s > PATIENCE_S for node in launched(map="map", body=body).values())


def test_wrong_arguments_are_refused(tmp_path: Path) -> None:
    body = str(write_body(tmp_path / "body.yaml"))
    with pytest.raises(RuntimeError, match="missing required argument 'body'"):
        launched(map="map")
    with pytest.raises(StationError, match="neither a map.* nor a file of static cameras"):
        launched(body=body)
    with pytest.raises(RuntimeError, match="'respawn' provided value 'perhaps'"):
        launched(map="map", body=body, respawn="perhaps")
    for processes in ("separate", "forked"):
        with pytest.raises(SettingsError, match="rate: expected a number, got 'half'"):
            launched(processes=processes, map="map", body=body, bagfile="bag", rate="half")
        with pytest.raises(SettingsError, match="registrations: expected how many, got '2.5'"):
            launched(processes=processes, map="map", body=body, registrations="2.5")
    with pytest.raises(BodyError, match="no camera hat"):
        launched(map="map", body=body, cameras="hat")
    stations = str(tmp_path / "cameras.yaml")
    write_stations(Path(stations), stations_around(1).values())
    with pytest.raises(StationError, match="cameras, grown_map: for cameras on the body, which need a map"):
        launched(body=body, stations=stations, cameras="left", grown_map="grown")
    with pytest.raises(StationError, match="surface, start: for static cameras"):
        launched(map="map", body=body, surface="scan", start="start.yaml")


def test_a_rig_instead_of_a_body(tmp_path: Path) -> None:
    rig = write_rig(tmp_path)
    nodes = launched(map="map", rig=str(rig), body="new.yaml", overwrite_body="True")
    given = {"body": "new.yaml", "rig": str(rig), "map": "map", "overwrite_body": True}
    assert nodes["skeleton_solver"].parameters == given


def test_launch_itself_takes_the_file(tmp_path: Path) -> None:
    pytest.importorskip("launch_ros", reason="launch has no wheels; this test runs where ROS 2 is installed")
    from launch import LaunchContext

    described = runpy.run_path(str(LAUNCH_FILE))
    context = LaunchContext()
    given = {"map": "map", "body": str(write_body(tmp_path / "body.yaml")), "bagfile": "bag"}
    context.launch_configurations.update(given, processes="separate")
    for entity in described["generate_launch_description"]().entities[:-1]:
        entity.execute(context)
    nodes = described["_nodes"](context)
    assert [node.node_executable for node in nodes] == [
        *("tracker", "tracker", "registration", "registration", "skeleton_solver", "player")
    ]
