"""The acceptance of the live graph: nodes and a player give the joint states that the replay gives.

Four cameras in this process; all of them in processes as the launch file has it.
"""

import os
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from helpers.altered_sample import write_altered_sample
from helpers.live_graph import live_graph, player

from bodycam_ros.body.average_person import person_masses
from bodycam_ros.body.body_file import read_body
from bodycam_ros.body.urdf import urdf_text
from bodycam_ros.graph.declared_graph import READERS_OF_LANDMARKS
from bodycam_ros.pipeline.settings import PipelineSettings
from bodycam_ros.recording.bag_reader import open_recording
from bodycam_ros.replaying.replay import replay
from bodycam_ros.replaying.replay_request import ReplayRequest
from bodycam_ros.results.solved_recording import read_solved

ANGLE_DEG = 0.5
POSITION_M = 0.005
COVERAGE = 0.98
LATE = 0.01
SOME = ("waist_front", "torso_front", "thigh_left", "shin_left")
FRAMES = 30
MASS_KG = 72.5

_START_S, _PLAY_S, _SOON_S = 180.0, 300.0, 60.0


@pytest.mark.parametrize(
    ("cameras", "frames"), [(SOME, FRAMES), pytest.param((), 60, marks=pytest.mark.long)], ids=["four", "all cameras"]
)
def test_live_joint_states_agree_with_the_replay(
    graph: Any, sample: Path, tmp_path: Path, cameras: tuple[str, ...], frames: int
) -> None:
    """At the recorded rate; a machine that is too slow for that catches up."""
    from std_srvs.srv import Trigger

    reference_map, body = sample / "map", sample / "body.yaml"
    bag = (
        write_altered_sample(sample, tmp_path / "bag", cameras=cameras, frames=frames)
        if cameras
        else sample / "sample/bag"
    )
    replay(ReplayRequest(bag, reference_map, body, tmp_path / "replayed", PipelineSettings(), jobs=os.cpu_count() or 1))
    replayed = read_solved(tmp_path / "replayed")
    with open_recording(bag) as recording:
        images = {camera: recording.image_count(camera) for camera in recording.cameras}
    assert set(images.values()) == {frames} and len(images) == (len(cameras) or len(read_body(body).mounts))

    landmarks = {f"/{camera}/landmarks": "bodycam_msgs/msg/LandmarkMatches" for camera in images}
    of_body = {
        "/robot_description": "std_msgs/msg/String",
        "/joint_states": "sensor_msgs/msg/JointState",
        "/odometry": "nav_msgs/msg/Odometry",
        "/diagnostics": "diagnostic_msgs/msg/DiagnosticArray",
    }
    graph.listen(landmarks | of_body)
    # No image may be left out: the replay leaves none out either.
    given = {
        "tracker": {"longest_wait": 0.0},
        "registration": {"landmark_readers": READERS_OF_LANDMARKS + 1},  # this test reads them, too
        "skeleton_solver": {"mass": MASS_KG},
    }
    start = graph.start if frames > FRAMES else graph.run
    start(
        *(
            replace(node, parameters={**node.parameters, **given.get(node.executable, {})})
            for node in live_graph(reference_map, body, cameras, registrations=2)
        )
    )
    playing_node = player(bag, rate=1.0)
    waits = {"reader_wait": _START_S, "settle": 2.0}
    (playing,) = start(replace(playing_node, parameters={**playing_node.parameters, **waits}))
    graph.until(lambda: playing.is_over, _PLAY_S, "the bag is played")
    assert playing.end() == 0, graph.report()
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

    described = read_body(body)
    once = [urdf_text(described, person_masses(described, MASS_KG))]
    assert [message.data for message in graph.messages("/robot_description")] == once

    live = read_solved(graph.write(tmp_path / "live"))
    _, of_live, of_replay = np.intersect1d(live.stamps_ns, replayed.stamps_ns, return_indices=True)
    assert len(of_live) >= enough
    assert live.joint_names == replayed.joint_names
    apart_deg = np.degrees(np.abs(live.joint_angles[of_live] - replayed.joint_angles[of_replay]))
    assert np.median(apart_deg) <= ANGLE_DEG
    for link in (f"{camera}_optical_frame" for camera in images):
        world_T_link = replayed.world_T_link[link]
        apart_m = np.linalg.norm(live.world_T_link[link][of_live, :3, 3] - world_T_link[of_replay, :3, 3], axis=1)
        assert np.median(apart_m) <= POSITION_M, link
