"""The whole graph in one process gives what the replay gives, is heard outside, and ends as its nodes do."""

import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from helpers.altered_sample import write_altered_sample
from helpers.naming import naming

from bodycam_ros.errors import MapError
from bodycam_ros.graph.declared_graph import GraphNode
from bodycam_ros.pipeline.settings import PipelineSettings
from bodycam_ros.recording.bag_reader import open_recording
from bodycam_ros.replaying.replay import replay
from bodycam_ros.replaying.replay_request import ReplayRequest
from bodycam_ros.results.solved_recording import read_solved

ANGLE_DEG = 0.5
POSITION_M = 0.005
COVERAGE = 0.98
CAMERAS = ("waist_front", "torso_front", "thigh_left")
FRAMES = 45

_START_S, _PLAY_S, _SOON_S = 90.0, 120.0, 60.0


@dataclass(frozen=True)
class GraphProcess(GraphNode):
    """All nodes by one command, with flags and not as parameters."""

    flags: tuple[str, ...] = ()

    def arguments(self, config: Path | None = None) -> list[str]:
        return list(self.flags)


OUTPUTS = {
    "/robot_description": "std_msgs/msg/String",
    "/joint_states": "sensor_msgs/msg/JointState",
    "/odometry": "nav_msgs/msg/Odometry",
    "/diagnostics": "diagnostic_msgs/msg/DiagnosticArray",
}


NODES = {*(f"tracker_{camera}" for camera in CAMERAS), "registration", "skeleton_solver", "player"}


def _reporting(graph: Any) -> set[str]:
    """Nodes that have published on /diagnostics."""
    return {status.name.split(":")[0] for each in graph.messages("/diagnostics") for status in each.status}


@pytest.fixture(scope="module")
def played(sample: Path, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Any]:
    """The graph has played some of the sample, was listened to from outside, and has been interrupted."""
    for package in ("rclpy", "bodycam_msgs"):
        pytest.importorskip(package, reason=f"{package} is not installed; 'make test' installs it")
    from helpers.live_graph import running_graph
    from std_srvs.srv import Trigger

    folder = tmp_path_factory.mktemp("one_process")
    bag = write_altered_sample(sample, folder / "bag", cameras=CAMERAS, frames=FRAMES)
    flags = ["--map", str(sample / "map"), "--body", str(sample / "body.yaml"), "--cameras", ",".join(CAMERAS)]
    flags += [
        "--bagfile",
        str(bag),
        "--registrations",
        "1",
        "--ros-args",
        "-p",
        "longest_wait:=0.0",
        "-p",
        "settle:=3.0",
    ]
    with running_graph(folder) as graph:
        graph.listen(OUTPUTS | {f"/{camera}/landmarks": "bodycam_msgs/msg/LandmarkMatches" for camera in CAMERAS})
        (process,) = graph.start(GraphProcess("graph", "graph", flags=tuple(flags)))
        heard = graph.heard["/joint_states"]
        # All but those that wait for later ones, for the last come when it is asked for them.
        come = lambda: process.process.poll() is not None or len(heard) >= FRAMES - 5  # noqa: E731
        graph.until(come, _START_S + _PLAY_S, "joint states")
        assert process.process.poll() is None, graph.report()
        graph.until(lambda: graph.call("/skeleton_solver/flush", Trigger).success, _SOON_S, "the solver flushes")
        graph.until(lambda: len(heard) >= COVERAGE * FRAMES, _SOON_S, "a joint state for nearly every instant")
        graph.until(lambda: len(graph.heard["/odometry"]) >= len(heard), _SOON_S, "as much odometry")
        graph.until(lambda: _reporting(graph) >= NODES, _SOON_S, "every node reports")
        codes = graph.end()
        yield SimpleNamespace(
            bag=bag,
            live=read_solved(graph.write(folder / "live")),
            codes=codes,
            printed=process.printed,
            names=_reporting(graph),
        )


def test_joint_states_agree_with_the_replay(played: Any, sample: Path, tmp_path: Path) -> None:
    replay(
        ReplayRequest(
            played.bag, sample / "map", sample / "body.yaml", tmp_path / "replayed", PipelineSettings(), jobs=1
        )
    )
    live, replayed = played.live, read_solved(tmp_path / "replayed")
    with open_recording(played.bag) as recording:
        assert len(replayed.stamps_ns) <= max(map(recording.image_count, recording.cameras)) == FRAMES
    _, of_live, of_replay = np.intersect1d(live.stamps_ns, replayed.stamps_ns, return_indices=True)
    assert len(of_live) >= COVERAGE * len(replayed.stamps_ns)
    assert live.joint_names == replayed.joint_names
    apart_deg = np.degrees(np.abs(live.joint_angles[of_live] - replayed.joint_angles[of_replay]))
    assert np.median(apart_deg) <= ANGLE_DEG
    for link, world_T_link in replayed.world_T_link.items():
        apart_m = np.linalg.norm(live.world_T_link[link][of_live, :3, 3] - world_T_link[of_replay, :3, 3], axis=1)
        assert np.median(apart_m) <= POSITION_M, link


def test_every_node_reports_under_its_own_name(played: Any) -> None:
    assert played.names >= NODES


def test_ctrl_c_ends_all_nodes(played: Any) -> None:
    assert played.codes == {"graph": 0}
    assert "Traceback" not in played.printed


def test_the_process_idles_while_the_others_end_after_a_failure() -> None:
    """They may save a map, and need the processor."""
    pytest.importorskip("rclpy", reason="rclpy is not installed; 'make test' installs it")
    from bodycam_ros.nodes import process

    def fail(stopped: object) -> None:
        raise MapError("this map is damaged")

    failing = SimpleNamespace(work=fail, finish=lambda: None)
    saving = SimpleNamespace(work=lambda stopped: None, finish=lambda: time.sleep(0.5))
    started_s = time.process_time()
    with naming(MapError, "this map is damaged"):
        process._work([failing, saving], lambda: False)
    assert time.process_time() - started_s < 0.1
