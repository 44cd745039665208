"""What a user can get wrong when starting a node: one clear line and exit code 1."""

import signal
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from outside.dressed_body import stations_around
from tiny_bag import write_tiny_bag
from two_cameras import write_body, write_map

from bodycam_ros.nodes.graph import NodeProcess
from bodycam_ros.outside.stations_file import write_stations
from bodycam_ros.registration.reference_map import ReferenceMap

_START_S = 60.0


def test_wrong_starts_end_with_one_clear_line(graph: Any, tmp_path: Path) -> None:
    body, reference_map = str(write_body(tmp_path / "body.yaml")), str(write_map(tmp_path / "map"))
    sizeless = tmp_path / "sizeless"
    replace(ReferenceMap.load(Path(reference_map)), metric=False).save(sizeless)
    of_another = ("registration", "map", reference_map, "grown_map", str(tmp_path / "grown"))
    broken = tmp_path / "broken.yaml"
    broken.write_text("name: [")
    rig = str(tmp_path / "rig.yaml")
    Path(rig).write_text("cameras: {left: torso, right: arm}\nsegments: {torso: null, arm: torso}\n")
    stations = tmp_path / "cameras.yaml"
    write_stations(stations, stations_around(1).values())
    static = ("stations", str(stations), "body", body)
    cases = {
        ("tracker",): "the parameter 'camera' is missing",
        (
            "tracker",
            "camera",
            "left",
            "transport",
            "pigeon",
        ): "'pigeon'",
        ("tracker", "camera", "left", "tracker.keyframes", 3): "there is no setting 'keyframes'",
        ("tracker", "camera", "left", "tracker.keyframe_interval", 3000): "keyframe_interval = 3000 is out of range",
        ("registration", "body", body, "map", str(tmp_path / "nowhere")): "there is no map folder",
        ("registration", "body", body, "map", str(sizeless)): "is not metric",
        of_another: "has grown from another one than",
        ("skeleton_solver",): "the parameter 'body' is missing",
        ("skeleton_solver", "body", body, "cameras", ("hat",)): "carries no camera hat; it carries left, right",
        (
            "skeleton_solver",
            "body",
            body,
            "smoother.output_delay",
            "offline",
        ): "live, give the number of frames (0 to 60)",
        ("skeleton_solver", "body", "new.yaml", "rig", rig, "cameras", ("left",)): "needs all cameras of the rig",
        ("region_tracker", *static, "camera", "hat"): "there is no camera hat; it has ext_00",
        ("retarget", "mapping", "m.yaml"): "the parameter 'urdf' is missing",
        ("player", "bag", str(tmp_path / "no_bag")): "no_bag",
        ("player", "bag", str(write_tiny_bag(tmp_path / "bag")), "cameras", ("hat",)): "no images of hat; it has left,",
    }
    write_map(tmp_path / f"grown/wrong_{list(cases).index(of_another)}", landmarks=40)
    nodes = [
        NodeProcess(executable, f"wrong_{number}", dict(zip(given[::2], given[1::2], strict=True)))
        for number, (executable, *given) in enumerate(cases)
    ]
    # A few at a time: each loads OpenCV and gtsam.
    started = []
    for some in range(0, len(nodes), 4):
        new = graph.start(*nodes[some : some + 4])
        graph.until(lambda new=new: all(s.process.poll() is not None for s in new), _START_S, "all have ended")
        started += new
    for each, message in zip(started, cases.values(), strict=True):
        assert each.process.returncode == 1, (message, each.printed)
        assert each.printed.startswith(f"{each.node.executable}: error: "), each.printed
        assert message in each.printed and len(each.printed.splitlines()) == 1, each.printed


@pytest.mark.parametrize("loading", ["numpy", "librmw_fastrtps_cpp"])
def test_ended_while_it_starts(graph: Any, loading: str) -> None:
    """By Ctrl-C, by who starts it, and by a terminal that is closed: libraries are loading, or it is entering ROS."""
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        (started,) = graph.start(NodeProcess("tracker", f"hasty_{number.name}", {"camera": "left"}))
        maps = Path(f"/proc/{started.process.pid}/maps")
        graph.until(lambda maps=maps: loading in maps.read_text(), _START_S, f"it is loading {loading}")
        started.process.send_signal(number)
        assert started.process.wait(_START_S) in (0, -number), started.printed
        assert not started.printed
