"""Node ``humans``: a real process says of the sample's person what REP-155 wants said, as it is laid offline."""

from pathlib import Path
from typing import Any

import numpy as np
from said_by_solver import SaidBySolver
from unshown_progress import Unshown

from bodycam_ros.body.joint_angles import JointAngles
from bodycam_ros.body.urdf import urdf_text
from bodycam_ros.humans.human_urdf import human_urdf
from bodycam_ros.humans.projection import HumanSkeleton
from bodycam_ros.messages.factory import numbers
from bodycam_ros.messages.header import stamp_ns
from bodycam_ros.nodes.graph import NodeProcess
from bodycam_ros.nodes.message_classes import is_installed
from bodycam_ros.solved.solved_body import read_solved_body

ROWS = range(0, 30, 5)
_START_S, _SOON_S = 60.0, 30.0
_BODY = "/humans/bodies/b3bd5"
_HEARD = {
    f"{_BODY}/urdf": "std_msgs/msg/String",
    f"{_BODY}/joint_states": "sensor_msgs/msg/JointState",
    "/diagnostics": "diagnostic_msgs/msg/DiagnosticArray",
}


def test_a_human_is_told_live_as_offline(graph: Any, sample_out: Path) -> None:
    solved = read_solved_body(sample_out, Unshown())
    skeleton, motion = HumanSkeleton(solved.body), solved.motion
    graph.listen(_HEARD)
    solver = SaidBySolver(graph, solved)
    (started,) = graph.start(NodeProcess("humans", "humans", {"body_id": "b3bd5"}))
    graph.until_known(_START_S)
    graph.until(solver.is_heard, _START_S, "the node hears the solver")

    solver.describe("<robot name='chair'><link name='seat'/></robot>")
    part = "humans: body b3bd5"
    graph.until(lambda: "none of the segments" in graph.diagnostics(part).get("text", ""), _SOON_S, "a no")
    assert started.process.poll() is None

    solver.describe(urdf_text(solved.body))
    for row in ROWS:
        solver.tell(row)
    solver.tell(ROWS[-1] + 1, knee_left_y=np.nan)
    graph.until(lambda: len(graph.heard[f"{_BODY}/joint_states"]) >= len(ROWS), _SOON_S, "an answer to every instant")
    graph.until(lambda: graph.diagnostics(part).get("instants skipped") == "1", _SOON_S, "what is no instant")
    (described,) = graph.messages(f"{_BODY}/urdf")
    said = [health for health in graph.all_diagnostics(part) if "farthest off: waist [deg]" in health]
    spoken = {status.name for message in graph.messages("/diagnostics") for status in message.status}
    assert spoken == {part}, "config/diagnostic_aggregator.yaml knows the node by it"
    assert set(graph.end().values()) == {0}, graph.report()
    assert "Traceback" not in graph.report()

    # The body comes by way of a URDF, whose numbers have twelve digits.
    assert described.data.count("_b3bd5") == human_urdf(skeleton, "b3bd5").count("_b3bd5")
    poses = solved.body.forward_kinematics(
        motion.world_T_root[list(ROWS)], JointAngles(solved.body).poses(motion.joint_angles[list(ROWS)])
    )
    previous, farthest_deg = None, 0.0
    messages = graph.messages(f"{_BODY}/joint_states")
    assert [stamp_ns(message.header.stamp) for message in messages] == motion.stamps_ns[list(ROWS)].tolist()
    for message, pose in zip(messages, poses, strict=True):
        laid = skeleton.lay(pose, previous)
        assert list(message.name) == [f"{name}_b3bd5" for name in skeleton.joint_names]
        np.testing.assert_allclose(numbers(message.position, np.float64, len(laid.angles)), laid.angles, atol=1e-6)
        farthest_deg = max(farthest_deg, float(np.degrees(laid.off_rad["waist"])))
        previous = laid.angles
    assert farthest_deg > 1.0
    assert max(float(health["farthest off: waist [deg]"]) for health in said) == round(farthest_deg, 1)
    if not is_installed("hri_msgs/msg/IdsList"):
        assert "hri_msgs is not installed" in said[0]["/humans/bodies/tracked"]
