"""Node ``retarget``: a real process lets Talos do what it is told of the sample's person, as offline."""

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from helpers.published_by_solver import SolverPublisher
from helpers.recorded_progress import Unshown
from helpers.talos import MAPPING, talos_urdf

from bodycam_ros.body.urdf import urdf_text
from bodycam_ros.graph.declared_graph import GraphNode
from bodycam_ros.kinematics.joint_angles import JointAngles
from bodycam_ros.messages.factory import numbers, stamp_ns
from bodycam_ros.results.solved_body import SolvedBody, read_solved_body
from bodycam_ros.robot.mapping import read_mapping
from bodycam_ros.robot.retargeting import Retargeting, RobotState
from bodycam_ros.robot.robot_model import Robot

INSTANTS = slice(0, 30, 5)
_START_S, _SOON_S = 60.0, 60.0
_HEARD = {
    "/robot/robot_description": "std_msgs/msg/String",
    "/robot/joint_states": "sensor_msgs/msg/JointState",
    "/diagnostics": "diagnostic_msgs/msg/DiagnosticArray",
}


@pytest.fixture(scope="module")
def solved(sample_out: Path) -> SolvedBody:
    return read_solved_body(sample_out, Unshown())


@pytest.fixture(scope="module")
def robot() -> Robot:
    return Robot(talos_urdf(), read_mapping(MAPPING))


@pytest.fixture(scope="module")
def states(robot: Robot, solved: SolvedBody) -> list[RobotState]:
    """What the robot does offline."""
    following = Retargeting(solved.body, robot)
    motion = solved
    poses = solved.body.forward_kinematics(
        motion.world_T_root[INSTANTS], JointAngles(solved.body).poses(motion.joint_angles[INSTANTS])
    )
    return [following.follow(*each) for each in zip(motion.stamps_ns[INSTANTS].tolist(), poses, strict=True)]


def test_a_robot_follows_live_as_offline(
    graph: Any, robot: Robot, solved: SolvedBody, states: list[RobotState]
) -> None:
    graph.listen(_HEARD)
    solver = SolverPublisher(graph, solved)
    (started,) = graph.run(GraphNode("retarget", "retarget", {"urdf": str(talos_urdf()), "mapping": str(MAPPING)}))
    graph.until_known(_START_S)
    graph.until(solver.has_readers, _START_S, "the robot hears the solver")

    legless = urdf_text(solved.body).replace("shin_left", "stump")
    solver.describe(legless)
    solver.publish(0)
    graph.until(lambda: "has no shin_left" in graph.diagnostics("retarget: robot").get("text", ""), _SOON_S, "a no")
    assert not started.is_over and not graph.heard["/robot/joint_states"]

    solver.describe(urdf_text(solved.body))
    rows = range(len(solved.stamps_ns))[INSTANTS]
    for row in rows:
        solver.publish(row)
    solver.publish(rows[-1])  # once more
    solver.publish(rows[-1] + 1, knee_left_y=math.nan)
    graph.until(lambda: len(graph.heard["/robot/joint_states"]) >= len(rows), _SOON_S, "an answer to every instant")
    graph.until(
        lambda: graph.diagnostics("retarget: robot").get("frames dropped") == "2", _SOON_S, "what is no instant"
    )
    assert set(graph.end().values()) == {0}, graph.report()

    said = graph.messages("/robot/joint_states")
    assert [stamp_ns(message.header.stamp) for message in said] == [state.stamp_ns for state in states]
    for message, state in zip(said, states, strict=True):
        assert tuple(message.name) == robot.joint_names
        for told, offline in ((message.position, state.positions), (message.velocity, state.velocities)):
            np.testing.assert_allclose(numbers(told, np.float64, len(robot.joint_names)), offline, atol=1e-6)
    assert np.ptp([message.position for message in said], axis=0).max() > 0.05  # it moves
    (described,) = graph.messages("/robot/robot_description")
    assert described.data == talos_urdf().read_text()
