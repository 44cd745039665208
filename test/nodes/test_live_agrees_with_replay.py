"""The acceptance of the live graph: real processes and a player give the joint states that the replay gives."""

import os
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from altered_sample import write_altered_sample

from bodycam_ros.body.body_file import read_body
from bodycam_ros.nodes.graph import live_graph, player
from bodycam_ros.pipeline import PipelineSettings
from bodycam_ros.recording.bag_reader import open_recording
from bodycam_ros.replay.replay import replay
from bodycam_ros.solved.solved_recording import read_solved

ANGLE_DEG, POSITION_M, COVERAGE, LATE = 0.5, 0.005, 0.98, 0.01
SOME = ("waist_front", "torso_front", "thigh_left", "shin_left")
FRAMES = 60
PAUSE_S = 3.5
"""Longer than anything here has patience."""

_START_S, _PLAY_S, _SOON_S = 180.0, 300.0, 60.0


@pytest.mark.parametrize(
    ("cameras", "pause_s"),
    [(SOME, PAUSE_S), pytest.param((), 0.0, marks=pytest.mark.long)],
    ids=["four cameras and a pause", "all cameras"],
)
def test_live_joint_states_agree_with_the_replay(
    graph: Any, sample: Path, tmp_path: Path, cameras: tuple[str, ...], pause_s: float
) -> None:
    """At the recorded rate and as the launch file has it; a machine that is too slow for that catches up.

    A pause in the middle of the recording changes nothing, although all wait in vain, and the solver says what it has.
    """
    from std_srvs.srv import Trigger

    reference_map, body = sample / "map", sample / "body.yaml"
    bag = (
        write_altered_sample(sample, tmp_path / "bag", cameras=cameras, frames=FRAMES)
        if cameras
        else sample / "sample/bag"
    )
    replay(bag, reference_map, body, tmp_path / "replayed", PipelineSettings(), jobs=os.cpu_count() or 1)
    replayed = read_solved(tmp_path / "replayed")
    with open_recording(bag) as recording:
        images = {camera: recording.image_count(camera) for camera in recording.cameras}
    assert set(images.values()) == {FRAMES} and len(images) == (len(cameras) or len(read_body(body).mounts))

    landmarks = {f"/{camera}/landmarks": "bodycam_msgs/msg/LandmarkMatches" for camera in images}
    of_body = {
        "/robot_description": "std_msgs/msg/String",
        "/joint_states": "sensor_msgs/msg/JointState",
        "/odometry": "nav_msgs/msg/Odometry",
        "/diagnostics": "diagnostic_msgs/msg/DiagnosticArray",
    }
    graph.listen(landmarks | of_body)
    # No image may be left out: the replay leaves none out either.
    own = {"tracker": {"longest_wait": 0.0}, "skeleton_solver": {"idle_flush": 0.3 * pause_s} if pause_s else {}}
    of_all = {"use_sim_time": True} if pause_s else {}
    graph.start(
        *(
            replace(node, parameters={**node.parameters, **of_all, **own.get(node.executable, {})})
            for node in live_graph(reference_map, body, cameras, registrations=4)
        )
    )
    playing_node = player(bag, rate=1.0)
    waits = {"reader_wait": _START_S, "settle": 5.0, "clock": 40.0 if pause_s else 0.0}
    (playing,) = graph.start(replace(playing_node, parameters={**playing_node.parameters, **waits}))
    if pause_s:
        graph.until(lambda: graph.diagnostics("player"), _START_S, "the player waits for readers")
        # Already now, so that it hears us at once later on.
        assert all(graph.call(f"/player/{service}", Trigger).success for service in ("pause", "resume"))
    graph.until(lambda: any(graph.heard[topic] for topic in landmarks), _START_S + _SOON_S, "the graph runs")
    if pause_s:
        assert graph.call("/player/pause", Trigger).success
        resume_s = time.monotonic() + pause_s
        graph.until(lambda: time.monotonic() > resume_s, _SOON_S, "the pause is over")
        heard = [len(graph.heard[topic]) for topic in landmarks]
        assert 0 < max(heard) < FRAMES, "it was in the middle"
        assert graph.call("/player/resume", Trigger).success
    graph.until(lambda: playing.process.poll() is not None, _PLAY_S, "the bag is played")
    assert playing.process.returncode == 0, graph.report()
    graph.until(
        lambda: all(len(graph.heard[f"/{camera}/landmarks"]) >= count for camera, count in images.items()),
        _PLAY_S,
        "every image of every camera is registered: nothing is lost on the way",
    )
    assert graph.call("/skeleton_solver/flush", Trigger).success
    enough = COVERAGE * len(replayed.stamps_ns)
    graph.until(lambda: len(graph.heard["/joint_states"]) >= enough, _SOON_S, "a joint state for nearly every instant")
    graph.until(lambda: len(graph.heard["/odometry"]) >= enough, _SOON_S, "an odometry for nearly every instant")
    graph.until(lambda: graph.diagnostics("skeleton_solver: body"), _SOON_S, "the solver reports")
    # On a machine that others use, too, a process may stand still for longer than an instant waits.
    assert int(graph.diagnostics("skeleton_solver: body")["late registrations"]) <= LATE * sum(images.values())
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
