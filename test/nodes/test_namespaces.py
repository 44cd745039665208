"""Two people in one graph: a namespace and frames each, and the map between them."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from frame_tree import FrameTree
from tiny_bag import write_tiny_bag
from told_pose import told_pose
from two_cameras import write_body

from bodycam_ros.body.body_file import read_body
from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.geometry import Array, rigid
from bodycam_ros.messages.tracks import landmarks_message
from bodycam_ros.nodes.graph import NodeProcess
from bodycam_ros.nodes.launched import frames_of
from bodycam_ros.registration.landmark_matches import LandmarkMatches

FRAME_NS = 33_333_333
START_NS = 10_000_000_000_000
FRAMES = 20
_START_S, _SOON_S = 60.0, 60.0


class Person:
    """Somebody who walks steadily in the N-pose, as the solver of a namespace hears it from two cameras.

    Args:
        graph: of the test.
        path: of the body.
        namespace: of the person.
        start: (3,) where the root is at first [m].
        velocity: (3,) of the root [m/s].
    """

    def __init__(self, graph: Any, path: Path, namespace: str, start: Array, velocity: Array) -> None:
        from bodycam_ros.nodes.message_classes import node_messages

        self.namespace, self._start, self._velocity = namespace, start, velocity
        self._make, self._body = node_messages(), read_body(path)
        self.prefix = frames_of(namespace)
        topics = {"joint_states": "sensor_msgs/msg/JointState", "odometry": "nav_msgs/msg/Odometry"}
        graph.listen({f"/{namespace}/{topic}": kind for topic, kind in topics.items()})
        cameras, kind = self._body.mounts, "bodycam_msgs/msg/LandmarkMatches"
        self._landmarks = {camera: graph.publisher(f"/{namespace}/{camera}/landmarks", kind) for camera in cameras}
        kind = "sensor_msgs/msg/CameraInfo"
        self._infos = {camera: graph.publisher(f"/{namespace}/{camera}/camera_info", kind) for camera in cameras}
        given = {"body": str(path), "frame_prefix": self.prefix}
        self.solver = NodeProcess("skeleton_solver", "skeleton_solver", given, namespace)

    def is_heard(self) -> bool:
        """Whether the solver listens."""
        return all(each.get_subscription_count() for each in (*self._landmarks.values(), *self._infos.values()))

    def map_T_root(self, stamp: int) -> Array:
        """Where the person is."""
        return rigid(np.eye(3), self._start + 1e-9 * (stamp - START_NS) * self._velocity)

    def walk(self) -> None:
        """Say what the cameras see."""
        for publisher in self._infos.values():
            info = self._make("sensor_msgs/msg/CameraInfo", width=64, height=48, distortion_model="equidistant")
            info.d, info.k = [0.0] * 4, [30.0, 0.0, 31.5, 0.0, 30.0, 23.5, 0.0, 0.0, 1.0]
            publisher.publish(info)
        for number in range(FRAMES):
            stamp = START_NS + number * FRAME_NS
            for camera, matches in _matches(self._body, self.map_T_root(stamp), stamp, bool(number)).items():
                self._landmarks[camera].publish(landmarks_message(self._make, matches))


def _matches(body: BodyModel, map_T_root: Array, stamp: int, follows: bool) -> dict[str, LandmarkMatches]:
    n_pose = np.tile(np.eye(4), (len(body.tree_joints), 1, 1))
    world_T_segment = body.forward_kinematics(map_T_root, n_pose)
    return {
        camera: told_pose(
            camera,
            stamp,
            stamp - FRAME_NS if follows else 0,
            world_T_segment[body.segment_index[mount.segment]] @ mount.segment_T_camera,
        )
        for camera, mount in body.mounts.items()
    }


def test_two_people_share_the_map_and_nothing_else(graph: Any, tmp_path: Path) -> None:
    pytest.importorskip("tf2_msgs", reason="tf2_msgs is not installed; 'make test' builds it")
    path = write_body(tmp_path / "body.yaml")
    graph.listen({topic: "tf2_msgs/msg/TFMessage" for topic in ("/tf", "/tf_static")})
    graph.listen({"/diagnostics": "diagnostic_msgs/msg/DiagnosticArray", "/joint_states": "sensor_msgs/msg/JointState"})
    anna = Person(graph, path, "anna", np.array([0.0, 0.0, 1.0]), np.array([0.5, 0.0, 0.0]))
    ben = Person(graph, path, "lab/ben", np.array([3.0, 2.0, 1.2]), np.array([0.0, -0.5, 0.0]))
    people = (anna, ben)
    graph.run(*(person.solver for person in people))
    graph.until_known(_START_S)
    graph.until(lambda: all(person.is_heard() for person in people), _START_S, "both solvers listen")
    for person in people:
        person.walk()
    heard = [f"/{person.namespace}/odometry" for person in people]
    # Who is interrupted solves what has come to it: the first instants say that it does.
    graph.until(lambda: all(len(graph.heard[topic]) >= FRAMES // 2 for topic in heard), _SOON_S, "most instants")
    assert set(graph.end().items()) == {("anna/skeleton_solver", 0), ("lab/ben/skeleton_solver", 0)}, graph.report()
    graph.until(lambda: all(len(graph.heard[topic]) == FRAMES for topic in heard), _SOON_S, "all instants of both")
    graph.until(lambda: len(graph.heard["/tf"]) == 2 * FRAMES, _SOON_S, "the transforms of both")

    tree = FrameTree(graph.messages("/tf"), graph.messages("/tf_static"))
    assert set(tree.told.values()) == {1}, "nobody says where somebody else's frames are"
    assert sum(parent == "map" for parent in tree.parents.values()) == 2
    for person in people:
        frames = {frame for frame in tree.parents if frame.startswith(person.prefix)}
        named = {frame.removeprefix(person.prefix) for frame in frames}
        assert {"torso", "arm", "left_optical_frame", "right_optical_frame"} <= named
        assert {tree.parents[frame] for frame in frames} <= frames | {"map"}
        root = f"{person.prefix}torso"
        assert tree.stamps[root] == [START_NS + number * FRAME_NS for number in range(FRAMES)]
        for stamp in tree.stamps[root]:
            np.testing.assert_allclose(tree.pose(root, stamp), person.map_T_root(stamp), atol=2e-3)
        for odometry in graph.messages(f"/{person.namespace}/odometry"):
            assert (odometry.header.frame_id, odometry.child_frame_id) == ("map", root)
    assert len(tree.parents) == sum(frame.startswith((anna.prefix, ben.prefix)) for frame in tree.parents)
    assert not graph.heard["/joint_states"], "of nobody in particular"
    names = {status.name for message in graph.messages("/diagnostics") for status in message.status}
    assert {"anna/skeleton_solver: body", "lab/ben/skeleton_solver: body"} <= names
    assert all(name.startswith(("anna/skeleton_solver: ", "lab/ben/skeleton_solver: ")) for name in names)


def test_a_bag_is_played_into_the_players_namespace(graph: Any, tmp_path: Path) -> None:
    """Its tracker there hears it, and says so there; who is in no namespace hears nothing."""
    tracks, info = "bodycam_msgs/msg/FeatureTracks", "sensor_msgs/msg/CameraInfo"
    graph.listen({"/anna/left/tracks": tracks, "/left/tracks": tracks, "/anna/left/camera_info": info})
    graph.listen({"/diagnostics": "diagnostic_msgs/msg/DiagnosticArray"})
    bag, theirs = str(write_tiny_bag(tmp_path / "bag", 12)), {"frame_prefix": "anna/"}
    graph.run(
        NodeProcess("tracker", "tracker_left", {"camera": "left"}),
        NodeProcess("tracker", "tracker_left", {"camera": "left", **theirs}, "anna"),
        NodeProcess("player", "player", {"bag": bag, "cameras": ["left"], "loop": True, **theirs}, "anna"),
    )
    graph.until(lambda: len(graph.heard["/anna/left/tracks"]) >= 12, _START_S, "all images are tracked")
    assert {message.header.frame_id for message in graph.messages("/anna/left/tracks")} == {"anna/left_optical_frame"}
    assert graph.messages("/anna/left/camera_info")[0].header.frame_id.startswith("anna/")
    assert not graph.heard["/left/tracks"]
    parts = ("anna/player", "anna/tracker_left: camera left", "tracker_left: camera left")
    graph.until(lambda: all(map(graph.all_diagnostics, parts)), _SOON_S, "all three report by their full names")
    lacking = "no image: nobody publishes left/image_raw/compressed, and no left/camera_info"
    assert {report["text"] for report in graph.all_diagnostics(parts[-1])} == {lacking}
