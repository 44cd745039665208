"""The solver alone, fed with registrations of a known motion: what waits, who joins late, a time that begins anew."""

import time
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np
from helpers.frame_tree import FrameTree
from helpers.steady_motion import FRAME_NS, SPEED, START_NS, registrations
from helpers.two_cameras import write_body

from bodycam_ros.body.body_file import read_body
from bodycam_ros.body.body_file import write_body as write_body_file
from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.body.coupled_body import coupled_body
from bodycam_ros.body.equipment_yaml import read_equipment
from bodycam_ros.estimation.estimator_settings import EstimatorSettings
from bodycam_ros.geometry import exp_se3
from bodycam_ros.graph.declared_graph import GraphNode
from bodycam_ros.inertial.imu_calibration import ImuCalibration
from bodycam_ros.inertial.imu_samples import GRAVITY
from bodycam_ros.messages.factory import header_message, numbers, stamp_ns
from bodycam_ros.messages.imu import IMU_TOPIC, IMU_TYPE, imu_message
from bodycam_ros.messages.tracks import landmarks_message

_SAMPLES = 7  # of an inertial sensor from frame to frame: 210 Hz
_START_S, _SOON_S = 60.0, 60.0

STICK = """
name: stick
root: shaft
segments: {shaft: {}}
attachments:
  grip:
    body: arm
    equipment: shaft
    weight: 3
    points:
      - {body: [0, 0, -300], equipment: [0, 0, 0]}
      - {body: [100, 0, -300], equipment: [100, 0, 0]}
      - {body: [0, 100, -300], equipment: [0, 100, 0]}
cameras: {tip: {segment: shaft, position: [0.5, 0, 0], quaternion_xyzw: [-0.5, 0.5, -0.5, 0.5]}}
"""


class Cameras:
    """The cameras of a solver, as it hears them."""

    def __init__(
        self, graph: Any, path: Path, body: BodyModel | None = None, namespace: str = "", **given: object
    ) -> None:
        from bodycam_ros.nodes.parameters import node_messages

        self._make = node_messages()
        self._graph = graph
        self.body = body or read_body(path)
        mounts = self.body.mounts
        topic, kind = "bodycam_msgs/msg/LandmarkMatches", "sensor_msgs/msg/CameraInfo"
        own = f"/{namespace}" if namespace else ""
        graph.listen({f"{own}/joint_states": "sensor_msgs/msg/JointState", f"{own}/odometry": "nav_msgs/msg/Odometry"})
        graph.listen({"/diagnostics": "diagnostic_msgs/msg/DiagnosticArray"})
        self._registrations = {camera: graph.publisher(f"{own}/{camera}/landmarks", topic) for camera in mounts}
        self._infos = {camera: graph.publisher(f"{own}/{camera}/camera_info", kind) for camera in mounts}
        self._sensors: dict[str, Any] = {}
        solver = GraphNode("skeleton_solver", "skeleton_solver", {"body": str(path), **given}, namespace)
        (self.solver,) = graph.run(solver)
        everything = [*self._registrations.values(), *self._infos.values()]
        graph.until(lambda: all(each.get_subscription_count() for each in everything), _START_S, "the solver listens")

    def publish(
        self,
        frames: range,
        *cameras: str,
        off_ns: Mapping[str, int] = MappingProxyType({}),
        lost: str = "",
        wrong: str = "",
    ) -> None:
        for matches in registrations(self.body, frames):
            if not cameras or matches.camera in cameras:
                off = off_ns.get(matches.camera, 0)
                previous = matches.previous_stamp_ns + off if matches.previous_stamp_ns else 0
                stamped = replace(matches, stamp_ns=matches.stamp_ns + off, previous_stamp_ns=previous)
                if matches.camera == wrong:
                    away = np.array([0.2, 0.3, 0.0, 0.4, 0.2, 0.3])
                    stamped = replace(stamped, world_T_camera=matches.world_T_camera @ exp_se3(away))
                if matches.camera == lost:
                    stamped = replace(stamped, world_T_camera=None, pose_covariance=np.full((6, 6), np.nan))
                self._registrations[matches.camera].publish(landmarks_message(self._make, stamped))

    def feel(self, frame: int, spin: Mapping[str, float] = MappingProxyType({})) -> None:
        """Samples of the sensors from a frame to the next, of cameras that do not turn or as if they did [rad/s]."""
        at_frame = {matches.camera: matches for matches in registrations(self.body, range(frame, frame + 1))}
        for sample in range(_SAMPLES):
            for camera, matches in at_frame.items():
                assert matches.world_T_camera is not None
                stamp, up = matches.stamp_ns + sample * FRAME_NS // _SAMPLES, matches.world_T_camera[2, :3]
                turning = np.full(3, spin.get(camera, 0.0))
                if camera not in self._sensors:
                    self._sensors[camera] = self._graph.publisher(f"/{camera}{IMU_TOPIC}", IMU_TYPE)
                self._sensors[camera].publish(imu_message(self._make, camera, stamp, turning, GRAVITY * up))

    def inform(self, *cameras: str, frame: int = 0) -> None:
        for camera in cameras:
            info = self._make("sensor_msgs/msg/CameraInfo", width=64, height=48, distortion_model="equidistant")
            info.d, info.k = [0.0] * 4, [30.0, 0.0, 31.5, 0.0, 30.0, 23.5, 0.0, 0.0, 1.0]
            info.header = header_message(self._make, START_NS + frame * FRAME_NS, camera)
            self._infos[camera].publish(info)

    def solved(self) -> list[int]:
        """Numbers of the frames of which there are joint states, in the order in which they were published."""
        states = self._graph.messages("/joint_states")
        return [(stamp_ns(state.header.stamp) - START_NS) // FRAME_NS for state in states]

    def reports(self, part: str) -> list[dict[str, Any]]:
        return list(self._graph.all_diagnostics(f"skeleton_solver: {part}"))


def test_what_waits_is_published_when_idle_and_at_the_end(graph: Any, tmp_path: Path) -> None:
    delay = EstimatorSettings().output_delay
    cameras = Cameras(graph, write_body(tmp_path / "body.yaml"), idle_flush=1.5)
    # Registrations that come before the cameras are known wait for them.
    cameras.publish(range(10))
    cameras.inform(*cameras.body.mounts)
    graph.until(lambda: len(graph.heard["/joint_states"]) == 10, _SOON_S, "an idle solver publishes what waits")
    cameras.publish(range(10, 20))
    graph.until(lambda: len(graph.heard["/joint_states"]) >= 20 - delay, _SOON_S, "the solver goes on after a pause")
    assert cameras.solver.end() == 0
    graph.until(lambda: len(graph.heard["/odometry"]) == 20, _SOON_S, "the rest is published before the node goes")

    states = graph.messages("/joint_states")
    assert [stamp_ns(state.header.stamp) for state in states] == [START_NS + k * FRAME_NS for k in range(20)]
    angles = np.array([numbers(state.position, np.float64, len(state.name)) for state in states])
    assert np.abs(angles).max() < np.radians(0.1)
    along_x = [odometry.pose.pose.position.x for odometry in graph.messages("/odometry")]
    assert np.allclose(along_x, SPEED * 1e-9 * FRAME_NS * np.arange(20), atol=2e-3)


def test_a_person_in_a_namespace_has_frames_of_its_own(graph: Any, tmp_path: Path) -> None:
    graph.listen({topic: "tf2_msgs/msg/TFMessage" for topic in ("/tf", "/tf_static")})
    graph.listen({"/joint_states": "sensor_msgs/msg/JointState"})
    path = write_body(tmp_path / "body.yaml")
    cameras = Cameras(graph, path, namespace="lab/anna", frame_prefix="lab/anna/")
    cameras.inform(*cameras.body.mounts)
    cameras.publish(range(20))
    # Those that wait for no later frame: by then all images have arrived.
    graph.until(lambda: len(graph.heard["/lab/anna/odometry"]) == 16, _SOON_S, "the first instants")
    assert cameras.solver.end() == 0
    graph.until(lambda: len(graph.heard["/lab/anna/odometry"]) == 20, _SOON_S, "all instants")
    graph.until(lambda: len(graph.heard["/tf"]) == 20, _SOON_S, "their transforms")
    assert not graph.heard["/joint_states"]
    tree = FrameTree(graph.messages("/tf"), graph.messages("/tf_static"))
    assert {f"lab/anna/{name}" for name in ("torso", "arm", "left_optical_frame")} <= set(tree.parents)
    assert all(frame.startswith("lab/anna/") for frame in tree.parents)
    assert [frame for frame, parent in tree.parents.items() if parent == "map"] == ["lab/anna/torso"]
    assert tree.stamps["lab/anna/torso"] == [START_NS + number * FRAME_NS for number in range(20)]
    for odometry in graph.messages("/lab/anna/odometry"):
        assert (odometry.header.frame_id, odometry.child_frame_id) == ("map", "lab/anna/torso")
        x = tree.pose("lab/anna/torso", stamp_ns(odometry.header.stamp))[0, 3]
        assert abs(x - odometry.pose.pose.position.x) < 1e-9


def test_a_camera_joins_late_one_dies_and_time_begins_anew(graph: Any, tmp_path: Path) -> None:
    cameras = Cameras(graph, write_body(tmp_path / "body.yaml", "odd"), idle_flush=60.0)
    left, right, odd = cameras.body.mounts
    cameras.inform(left, odd)
    cameras.publish(range(40), left, odd)
    graph.until(lambda: cameras.solved()[-1:] == [35], _SOON_S, "the solver does not wait for all cameras")
    graph.until(
        lambda: any("solving without right" in r["text"] for r in cameras.reports("body")), _SOON_S, "it says which"
    )
    # Long after the others.
    cameras.inform(right)
    cameras.publish(range(40, 60))
    graph.until(lambda: cameras.solved()[-1:] == [55], _SOON_S, "the body goes on")
    assert cameras.solved() == list(range(56)), "nothing is lost when a camera joins"
    used = "cameras used per frame"
    graph.until(lambda: any(float(r[used]) > 2.5 for r in cameras.reports("body")), _SOON_S, "all are used")

    # One dies: after the first wait the others are not held up by it.
    cameras.publish(range(60, 120), left, odd)
    graph.until(lambda: cameras.solved()[-1:] == [115], _SOON_S, "the body goes on without the camera")
    graph.until(
        lambda: any("no registrations" in r["text"] for r in cameras.reports(f"camera {right}")), _SOON_S, "it is named"
    )

    # Everything is played again.
    count = len(graph.heard["/joint_states"])
    cameras.publish(range(40))
    graph.until(lambda: cameras.solved()[-1:] == [35], _SOON_S, "time begins anew")
    again = cameras.solved()[count:]
    assert again[-36:] == list(range(36)), again
    assert again[:-36] == list(range(116, 120)), "what waited of the time before is published"
    graph.until(lambda: cameras.reports("body")[-1]["restarts"] == "1", _SOON_S, "it is counted")

    graph.until(lambda: cameras.reports("body")[-1]["level"] == 2, _SOON_S, "the end is told")
    assert "no registration" in cameras.reports("body")[-1]["text"]
    assert cameras.solver.end() == 0


def test_a_clock_that_is_off_is_published_and_a_wrong_camera_is_left_out(graph: Any, tmp_path: Path) -> None:
    cameras = Cameras(graph, write_body(tmp_path / "body.yaml", "odd", "spare"))
    left, right, odd, spare = cameras.body.mounts
    topic = f"/{right}/timing"
    graph.listen({topic: "bodycam_msgs/msg/CameraTiming"})
    cameras.inform(left, right, odd, spare)
    for frame in range(0, 420, 60):
        wrong = odd if frame == 360 else ""
        cameras.publish(range(frame, frame + 60), off_ns={right: 12_000_000}, wrong=wrong)
        graph.until(lambda: cameras.solved()[-1:] > [frame + 40], _SOON_S, "the body keeps up")  # noqa: B023

    refused = "registrations rejected"
    graph.until(lambda: any(odd in str(r[refused]) for r in cameras.reports("body")), _SOON_S, "it is left out")
    assert not any(spare in str(r[refused]) or left in str(r[refused]) for r in cameras.reports("body"))

    def ahead_ms() -> list[float]:
        return [float(r["clock offset [ms]"]) for r in cameras.reports(f"camera {right}") if "sigma" in str(r)]

    # With every joint at rest and a straight path, a clock is told by how far its camera lags behind.
    graph.until(lambda: any(abs(ms - 12.0) < 2.0 for ms in ahead_ms()), 3 * _SOON_S, "the clock is known")
    graph.until(
        lambda: any(abs(m.offset - 0.012) < 0.002 for m in graph.messages(topic)), _SOON_S, "the topic says it too"
    )
    said = graph.messages(topic)[-1]
    assert (said.header.frame_id, said.source) == (f"{right}_optical_frame", "body")
    assert np.isnan(said.readout_time) and 0.0 < said.offset_sigma < 0.004

    # Then it is set.
    cameras.publish(range(420, 480), off_ns={right: -3_600_000_000_000})
    behind = "3600.0 s behind"
    graph.until(lambda: any(behind in r["text"] for r in cameras.reports(f"camera {right}")), _SOON_S, behind)
    assert cameras.solver.end() == 0


def test_equipment_is_told_of_live(graph: Any, tmp_path: Path) -> None:
    """A stick in the hand, which has a camera of its own."""
    (tmp_path / "stick.yaml").write_text(STICK)
    path = write_body(tmp_path / "body.yaml")
    body = coupled_body(read_body(path), read_equipment(tmp_path / "stick.yaml"))
    graph.listen({"/equipment": "bodycam_msgs/msg/EquipmentState"})
    cameras = Cameras(graph, path, body, equipment=str(tmp_path / "stick.yaml"))
    cameras.inform(*body.mounts)
    cameras.publish(range(40))
    graph.until(lambda: len(graph.heard["/equipment"]) >= 30, _SOON_S, "the solver tells of the stick")
    said = graph.messages("/equipment")[-1]
    assert (said.name, said.placed, list(said.attachments), list(said.engaged)) == ("stick", True, ["grip"], [1])
    assert said.deviations[0] < 1e-3
    names = graph.messages("/joint_states")[-1].name
    assert {"stick_at_x", "stick_at_y", "stick_at_z"} <= set(names)
    told = "equipment stick"
    graph.until(
        lambda: any(r["text"] == "active: grip" for r in cameras.reports(told)), _SOON_S, "health tells it, too"
    )
    assert cameras.solver.end() == 0
    graph.until(lambda: len(graph.heard["/equipment"]) == 40, _SOON_S, "it is told of every instant")
    stamps = [stamp_ns(message.header.stamp) for message in graph.messages("/equipment")]
    assert stamps == [START_NS + frame * FRAME_NS for frame in range(40)]


def test_inertial_sensors_carry_the_body_while_all_cameras_are_silent(graph: Any, tmp_path: Path) -> None:
    """Half a second without images, at delay 0, and time begins anew; one of the sensors turns where nothing does.

    Before, the registrations of half a second are late, as on an overloaded machine: none is left out.
    """
    path = write_body(tmp_path / "body.yaml", "odd")
    body = read_body(path)
    write_body_file(replace(body, mounts={c: replace(m, imu=ImuCalibration()) for c, m in body.mounts.items()}), path)
    cameras = Cameras(graph, path, **{"estimator.output_delay": 0})
    odd = [*cameras.body.mounts][-1]
    cameras.inform(*cameras.body.mounts)
    late, silence = range(30, 45), range(60, 75)
    for _ in range(2):
        graph.heard["/joint_states"].clear()
        graph.heard["/odometry"].clear()
        for frame in range(90):
            if frame == silence.stop:
                # No image has come since.
                graph.until(lambda: cameras.solved()[-1:] >= [silence.stop - 3], _SOON_S, "states without images")
            if frame in late:
                cameras.inform(*cameras.body.mounts, frame=frame)
            elif frame not in silence:
                cameras.publish(range(late.start if frame == late.stop else frame, frame + 1))
            due_s = time.monotonic() + 1e-9 * FRAME_NS
            cameras.feel(frame, {odd: 0.5})
            graph.until(lambda: time.monotonic() > due_s, _SOON_S, "the next frame is due")  # noqa: B023
        graph.until(lambda: cameras.solved()[-1:] == [89], _SOON_S, "all frames")
        graph.until(lambda: len(graph.heard["/odometry"]) >= 90, _SOON_S, "odometry of all frames")
        assert cameras.solved() == list(range(90))
        along_x = [odometry.pose.pose.position.x for odometry in graph.messages("/odometry")]
        assert np.allclose(along_x, SPEED * 1e-9 * FRAME_NS * np.arange(90), atol=0.01)
    report = cameras.reports("inertial sensors")[-1]
    assert report["level"] == 1 and odd in report["text"] and "contradicts the images" in report[odd], report
    assert report["in use"] == ", ".join(camera for camera in cameras.body.mounts if camera != odd)
    assert cameras.reports("body")[-1]["late registrations"] == "0"
    assert cameras.solver.end() == 0


def test_what_all_cameras_lack_is_one_line_of_the_log(graph: Any, tmp_path: Path) -> None:
    """Drivers that were never calibrated send an empty camera_info; sixteen trackers wrote sixteen lines."""
    from bodycam_ros.nodes.parameters import latched, node_messages

    path, kind = write_body(tmp_path / "body.yaml"), "sensor_msgs/msg/CameraInfo"
    for camera in read_body(path).mounts:
        graph.publisher(f"/{camera}/camera_info", kind, latched()).publish(node_messages()(kind))
    (solver,) = graph.start(GraphNode("skeleton_solver", "skeleton_solver", {"body": str(path)}))
    graph.until(lambda: "until its driver sends a usable camera_info" in solver.log, _START_S, "it is logged")
    (line,) = [line for line in solver.log.splitlines() if "usable camera_info" in line]
    assert f"each of 2 cameras ({', '.join(sorted(read_body(path).mounts))}): " in line
    assert solver.end() == 0
