"""What a user can get wrong when a node is started: an error that has its name; of a process one line and code 2."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from helpers.tiny_bag import write_tiny_bag
from helpers.two_cameras import write_body, write_map
from static_cameras.dressed_body import static_cameras_around

from bodycam_ros.errors import BodycamError
from bodycam_ros.formats.static_cameras_file import write_static_cameras
from bodycam_ros.graph.declared_graph import GraphNode
from bodycam_ros.registration.reference_map import ReferenceMap

_START_S = 90.0


def test_a_wrong_start_ends_with_one_line_and_code_2(graph: Any, tmp_path: Path) -> None:
    wrong = [
        GraphNode("tracker", "tracker", {"camera": "left", "transport": "pigeon"}),
        GraphNode("skeleton_solver", "skeleton_solver", {"body": str(tmp_path / "nobody.yaml")}),
    ]
    started = graph.start(*wrong)
    graph.until(lambda: all(each.process.poll() is not None for each in started), _START_S, "all have ended")
    for each, named in zip(started, ("pigeon", "nobody.yaml"), strict=True):
        assert each.process.returncode == 2
        assert each.printed.startswith(f"{each.node.executable}: error: "), each.printed
        assert named in each.printed and len(each.printed.splitlines()) == 1, each.printed


def test_unknown_parameters_are_warned_about(graph: Any) -> None:
    """A file may be meant for another version, or for other nodes too."""
    odd = {"camra": 1, "tracker.keyframes": 3, "traker.keyframe_interval": 3}
    others = {"rig": "rig.yaml", "estimator.output_delay": 3, "shape.length_sigma": 0.1}
    (started,) = graph.start(GraphNode("tracker", "tracker", {"camera": "left", **odd, **others}))
    info = graph.publisher("/left/camera_info", "sensor_msgs/msg/CameraInfo")
    graph.until(info.get_subscription_count, _START_S, "the tracker is up")
    assert started.end() == 0
    assert [name for name in (*odd, *others) if f"'{name}'" in started.printed] == [*odd]


def test_a_wrong_start_is_an_error_that_names_what_is_wrong(graph: Any, tmp_path: Path) -> None:
    body, reference_map = str(write_body(tmp_path / "body.yaml")), str(write_map(tmp_path / "map"))
    for name, flaw in {"sizeless": {"metric": False}, "tilted": {"gravity_aligned": False}}.items():
        replace(ReferenceMap.load(Path(reference_map)), **flaw).save(tmp_path / name)
    sizeless, tilted = str(tmp_path / "sizeless"), str(tmp_path / "tilted")
    write_map(tmp_path / "grown/registration", landmarks=40)
    grown = str(tmp_path / "grown")
    (tmp_path / "broken.yaml").write_text("name: [")
    (tmp_path / "no_rig.yaml").write_text("cameras: {}")
    (tmp_path / "rig.yaml").write_text("cameras: {left: torso, right: arm}\nsegments: {torso: null, arm: torso}\n")
    broken, no_rig, rig, new = (str(tmp_path / f"{name}.yaml") for name in ("broken", "no_rig", "rig", "new"))
    write_static_cameras(tmp_path / "cameras.yaml", static_cameras_around(1).values())
    static = {"stations": str(tmp_path / "cameras.yaml"), "body": body}
    bag = str(write_tiny_bag(tmp_path / "bag"))
    left = {"camera": "left"}
    cases: list[tuple[str, dict[str, object], str]] = [
        ("tracker", {}, "'camera'"),
        ("tracker", {**left, "transport": "pigeon"}, "pigeon"),
        ("tracker", {**left, "keypoints.max_keypoints": 30}, "max_keypoints"),
        ("tracker", {**left, "image_queue": "many"}, "image_queue"),
        ("registration", {"body": body}, "'map'"),
        ("registration", {"body": body, "map": str(tmp_path / "nowhere")}, "nowhere"),
        ("registration", {"body": body, "map": sizeless}, "has no scale"),
        ("registration", {"map": reference_map}, "'body'"),
        ("registration", {"map": reference_map, "body": body, "grown_map": grown}, "registration"),
        ("registration", {"map": reference_map, "body": body, "grown_map": reference_map}, "lies within"),
        ("skeleton_solver", {}, "'body'"),
        ("skeleton_solver", {"body": broken}, "broken.yaml"),
        ("skeleton_solver", {"body": body, "cameras": ("hat",)}, "hat"),
        ("skeleton_solver", {"body": body, "estimator.output_delay": "offline"}, "output_delay"),
        ("skeleton_solver", {"body": new, "rig": rig, "cameras": ("left",)}, "cameras"),
        ("skeleton_solver", {"body": new, "rig": no_rig}, "no_rig.yaml"),
        ("skeleton_solver", {"body": body, "rig": rig, "map": reference_map}, "overwrite_body"),
        ("skeleton_solver", {"body": new, "rig": rig}, "'map'"),
        ("skeleton_solver", {"body": new, "rig": rig, "map": sizeless}, "has no scale"),
        ("skeleton_solver", {"body": new, "rig": rig, "map": tilted}, "tilted"),
        ("skeleton_solver", {**static, "body_cameras": False}, "static cameras"),
        ("skeleton_solver", {"body": body, "body_cameras": False}, "body_cameras"),
        ("skeleton_solver", {"body": body, "start": "start.yaml"}, "start.yaml"),
        ("skeleton_solver", {**static, "surface": str(tmp_path / "no_scan")}, "no_scan"),
        ("skeleton_solver", {**static, "transport": "pigeon"}, "pigeon"),
        ("retarget", {"mapping": "m.yaml"}, "'urdf'"),
        ("retarget", {"urdf": "r.urdf", "mapping": str(tmp_path / "nothing.yaml")}, "nothing.yaml"),
        ("player", {"bagfile": bag, "rate": 0.0}, "rate"),
    ]
    for executable, given, named in cases:
        with pytest.raises(BodycamError) as raised:
            graph.run(GraphNode(executable, executable, given))
        assert named in str(raised.value) and "\n" not in str(raised.value), (executable, given)
    for given, named in (
        ({"bagfile": str(tmp_path / "no_bag")}, "no_bag"),
        ({"bagfile": bag, "cameras": ("hat",)}, "hat"),
    ):
        (player,) = graph.run(GraphNode("player", "player", given))
        graph.until(lambda player=player: player.is_over, _START_S, "it is refused")
        assert isinstance(player.error, BodycamError) and named in str(player.error)
