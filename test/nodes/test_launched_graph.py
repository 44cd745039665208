"""The graph as the launch file starts it: joint states come of its usage line, and others read them as we do."""

from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
from frame_tree import FrameTree
from launch_stand_in import LaunchedProcess, performed
from launched import LAUNCH_FILE, REPOSITORY
from numpy.testing import assert_allclose
from stock_consumer import StockConsumer

from bodycam_ros.body.body_file import read_body
from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.body.joint_angles import JointAngles
from bodycam_ros.body.urdf import optical_frame
from bodycam_ros.messages.header import stamp_ns
from bodycam_ros.messages.pose import pose_and_covariance

TRANSFORMS_ARE_THERE = find_spec("tf2_msgs") is not None
_START_S, _SOON_S = 90.0, 30.0


def test_joint_states_come_of_the_usage_line(graph: Any, sample: Path, tmp_path: Path) -> None:
    cameras = ("waist_front", "torso_front")
    nodes, _ = performed(
        LAUNCH_FILE,
        REPOSITORY,
        map=str(sample / "map"),
        body=str(sample / "body.yaml"),
        bagfile=str(sample / "sample/bag"),
        rate="0.5",
        cameras=",".join(cameras),
        processes="separate",
    )
    graph.listen({"/joint_states": "sensor_msgs/msg/JointState", "/map/points": "sensor_msgs/msg/PointCloud2"})
    graph.listen({"/diagnostics": "diagnostic_msgs/msg/DiagnosticArray", "/odometry": "nav_msgs/msg/Odometry"})
    graph.listen({"/robot_description": "std_msgs/msg/String"})
    if TRANSFORMS_ARE_THERE:
        graph.listen({topic: "tf2_msgs/msg/TFMessage" for topic in ("/tf", "/tf_static")})
    *others, playing = (LaunchedProcess.of(node, tmp_path) for node in nodes)
    graph.start(*others)
    # The player waits for the nodes, not for the listener, which hears no joint states before the solver knows it.
    graph.until_known(_START_S)
    graph.start(playing)
    started = {each.node.name: each for each in graph.started}
    assert len(started) == 6
    player = started["player"]
    graph.until(lambda: player.process.poll() is not None, _START_S, "the bag is played")
    assert player.process.returncode == 0, graph.report()
    assert f"plays {', '.join(sorted(cameras))}; leaves out " in player.printed
    graph.until(lambda: len(graph.heard["/joint_states"]) > 50, _SOON_S, "joint states for the 60 images of a camera")
    assert len(graph.heard["/map/points"]) == 1, "several registrations, one map"
    unused = set(read_body(sample / "body.yaml").mounts) - set(cameras)
    waited_for = [camera for camera in unused if camera in started["skeleton_solver"].printed]
    assert not waited_for, "cameras that nobody starts"
    assert set(graph.end().values()) == {0}, graph.report()
    assert "Traceback" not in graph.report()
    _agree_with_a_stock_consumer(graph, read_body(sample / "body.yaml"))


def _agree_with_a_stock_consumer(graph: Any, body: BodyModel) -> None:
    """Who knows but robot_description, joint_states and odometry has all links where we have them."""
    said = ("/joint_states", "/odometry", *(("/tf",) if TRANSFORMS_ARE_THERE else ()))

    def heard() -> set[int]:
        return {len(graph.heard[topic]) for topic in said}

    graph.until(lambda: len(heard()) == 1 and min(heard()) > 50, _SOON_S, "the same instants of all")
    cameras = {optical_frame(camera) for camera in body.mounts}
    roots = {stamp_ns(each.header.stamp): pose_and_covariance(each.pose)[0] for each in graph.messages("/odometry")}
    consumer = StockConsumer(graph.messages("/robot_description")[-1].data)
    tree = FrameTree(graph.messages("/tf"), graph.messages("/tf_static")) if TRANSFORMS_ARE_THERE else None
    for state in graph.messages("/joint_states"):
        stamp = stamp_ns(state.header.stamp)
        links = consumer.links(state)
        assert cameras | {*body.segments} <= links.keys()
        if tree is not None:
            for link, root_T_link in links.items():
                assert_allclose(tree.pose(link, stamp), roots[stamp] @ root_T_link, atol=1e-6, err_msg=link)
        angles = np.array(state.position)
        poses = body.forward_kinematics(roots[stamp], JointAngles(body).poses(angles))
        for segment, pose in zip(body.segments, poses, strict=True):
            assert_allclose(roots[stamp] @ links[segment], pose, atol=1e-6, err_msg=segment)
        for camera, mount in body.mounts.items():
            expected = poses[body.segment_index[mount.segment]] @ mount.segment_T_camera
            assert_allclose(roots[stamp] @ links[optical_frame(camera)], expected, atol=1e-6, err_msg=camera)
