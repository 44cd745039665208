"""The acceptance of the live graph: 19 processes and a player give the joint states that the replay gives."""

import os
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from bodycam_ros.body.body_file import read_body
from bodycam_ros.nodes.graph import live_graph, player
from bodycam_ros.pipeline import PipelineSettings
from bodycam_ros.recording.bag_reader import open_recording
from bodycam_ros.replay.replay import replay
from bodycam_ros.solved.read_solved import read_solved

ANGLE_DEG, POSITION_M, COVERAGE = 0.5, 0.005, 0.98

RATE = 0.1
"""Two cores hold some 0.15. A slower machine falls behind and catches up: the queues below are as long as the bag."""

GIVEN = {
    "tracker": {"image_queue": 1000},
    "registration": {},
    # The processes may run seconds apart on a busy machine, which must not make the solver leave a camera out.
    "skeleton_solver": {"assembler.max_wait": 10.0, "idle_flush": 100.0},
}
_START_S, _PLAY_S, _SOON_S = 180.0, 300.0, 60.0


def test_live_joint_states_agree_with_the_replay(graph: Any, sample: Path, tmp_path: Path) -> None:
    from std_srvs.srv import Trigger

    bag, reference_map, body = sample / "sample/bag", sample / "map", sample / "body.yaml"
    settings = PipelineSettings.from_mapping({"assembler": {"max_wait": 10.0}}, "test")
    replay(bag, reference_map, body, tmp_path / "replayed", settings, jobs=os.cpu_count() or 1)
    replayed = read_solved(tmp_path / "replayed")
    with open_recording(bag) as recording:
        images = {camera: recording.image_count(camera) for camera in recording.cameras}

    landmarks = {f"/{camera}/landmarks": "bodycam_msgs/msg/LandmarkMatches" for camera in images}
    of_body = {
        "/robot_description": "std_msgs/msg/String",
        "/joint_states": "sensor_msgs/msg/JointState",
        "/odometry": "nav_msgs/msg/Odometry",
    }
    graph.listen(landmarks | of_body)
    nodes = live_graph(reference_map, body, registrations=2)
    assert sum(node.executable == "tracker" for node in nodes) == len(read_body(body).mounts) == 16
    graph.start(*(replace(node, parameters={**node.parameters, **GIVEN[node.executable]}) for node in nodes))
    patient = {"reader_wait": _START_S, "settle": 5.0}
    playing_node = player(bag, RATE)
    (playing,) = graph.start(replace(playing_node, parameters={**playing_node.parameters, **patient}))

    graph.until(lambda: any(graph.heard[topic] for topic in landmarks), _START_S + _SOON_S, "the graph runs")
    graph.until(lambda: playing.process.poll() is not None, _PLAY_S, "the bag is played")
    assert playing.process.returncode == 0, graph.report()
    graph.until(
        lambda: all(len(graph.heard[f"/{camera}/landmarks"]) >= count for camera, count in images.items()),
        _PLAY_S,
        "every image of every camera is registered: nothing is lost on the way",
    )
    answer = graph.call("/skeleton_solver/flush", Trigger)
    assert answer.success
    enough = COVERAGE * len(replayed.stamps_ns)
    graph.until(lambda: len(graph.heard["/joint_states"]) >= enough, _SOON_S, "a joint state for nearly every instant")
    graph.until(lambda: len(graph.heard["/odometry"]) >= enough, _SOON_S, "an odometry for nearly every instant")
    assert set(graph.end().values()) == {0}, graph.report()
    assert "Traceback" not in graph.report()

    live = read_solved(graph.write(tmp_path / "live"))
    _, of_live, of_replay = np.intersect1d(live.stamps_ns, replayed.stamps_ns, return_indices=True)
    assert len(of_live) >= enough
    assert live.motion.joint_names == replayed.motion.joint_names
    apart_deg = np.degrees(np.abs(live.motion.joint_angles[of_live] - replayed.motion.joint_angles[of_replay]))
    assert np.median(apart_deg) <= ANGLE_DEG
    for link, world_T_link in replayed.world_T_link.items():
        apart_m = np.linalg.norm(live.world_T_link[link][of_live, :3, 3] - world_T_link[of_replay, :3, 3], axis=1)
        assert np.median(apart_m) <= POSITION_M, link
