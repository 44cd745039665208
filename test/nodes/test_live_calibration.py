"""The solver makes the body itself: a known body goes through its range of motion before a real node."""

from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np
import yaml
from helpers.range_of_motion import (
    RangeOfMotion,
    joints_in_cameras,
    known_body,
    known_rig,
    range_of_motion,
    registrations,
    wide_cameras,
)

from bodycam_ros.body.body_file import read_body
from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.body.urdf import urdf_text
from bodycam_ros.graph.declared_graph import GraphNode
from bodycam_ros.kinematics.joint_angles import JointAngleTracker
from bodycam_ros.messages.factory import numbers, stamp_ns
from bodycam_ros.messages.tracks import landmarks_message

MAP = Path(__file__).parents[2] / "bags/map"
CALIBRATION = "skeleton_solver: calibration"
PAUSE_NS = 20_000_000_000
LOST_M, LOST_DEG = 0.004, 0.5  # at 0.3 px
_START_S, _SOON_S, _CALIBRATION_S = 60.0, 30.0, 120.0


def _write_rig(path: Path, body: BodyModel) -> Path:
    rig = known_rig(body)
    path.write_text(yaml.safe_dump({"cameras": dict(rig.cameras), "segments": dict(rig.parents)}))
    return path


def _stamped(motion: RangeOfMotion, number: int) -> RangeOfMotion:
    """The motion as the first, second, ... of a session."""
    later = motion.stamps_ns + number * PAUSE_NS
    return RangeOfMotion(motion.body, later, motion.world_T_segment, motion.world_T_camera)


class Studio:
    """A solver that calibrates, and the cameras of the known body that it hears."""

    def __init__(self, graph: Any, folder: Path) -> None:
        from bodycam_ros.nodes.parameters import node_messages

        self._graph = graph
        self._make = node_messages()
        self.truth = known_body()
        self.path = folder / "body.yaml"
        outputs = {"/joint_states": "sensor_msgs/msg/JointState", "/robot_description": "std_msgs/msg/String"}
        graph.listen(outputs | {"/diagnostics": "diagnostic_msgs/msg/DiagnosticArray"})
        self._landmarks = {
            camera: graph.publisher(f"/{camera}/landmarks", "bodycam_msgs/msg/LandmarkMatches")
            for camera in self.truth.mounts
        }
        self._infos = {
            camera: graph.publisher(f"/{camera}/camera_info", "sensor_msgs/msg/CameraInfo")
            for camera in self.truth.mounts
        }
        rig = _write_rig(folder / "rig.yaml", self.truth)
        given = {"body": str(self.path), "rig": str(rig), "map": str(MAP), "idle_flush": 1.0}
        (self.solver,) = graph.run(GraphNode("skeleton_solver", "skeleton_solver", given))
        everything = [*self._landmarks.values(), *self._infos.values()]
        graph.until(lambda: all(each.get_subscription_count() for each in everything), _START_S, "the solver listens")

    def plug_in(self, uncalibrated: str = "") -> None:
        for name, camera in wide_cameras(self.truth.mounts).items():
            info = self._make("sensor_msgs/msg/CameraInfo", width=camera.width, height=camera.height)
            info.distortion_model, info.d = camera.distortion_model, list(camera.distortion)
            if name != uncalibrated:  # else of zeros
                info.k = [camera.fx, 0.0, camera.cx, 0.0, camera.fy, camera.cy, 0.0, 0.0, 1.0]
            self._infos[name].publish(info)

    def perform(self, motion: RangeOfMotion) -> None:
        for matches in registrations(motion, pixel_noise=0.3):
            self._landmarks[matches.camera].publish(landmarks_message(self._make, matches))
        for publisher in self._landmarks.values():
            publisher.wait_for_all_acked()

    def call(self, service: str) -> Any:
        from std_srvs.srv import Trigger

        return self._graph.call(f"/skeleton_solver/{service}", Trigger)

    def calibration(self) -> dict[str, Any]:
        """The latest report on it."""
        return dict(self._graph.diagnostics(CALIBRATION))


def _greatest_error(found: BodyModel, true: BodyModel) -> float:
    truth = joints_in_cameras(true)
    return max(float(np.linalg.norm(place - truth[key])) for key, place in joints_in_cameras(found).items())


def _files(folder: Path) -> set[str]:
    return {path.name for path in folder.iterdir() if not path.name.endswith(".log")}


def _angles(states: Iterable[Any], names: tuple[str, ...]) -> dict[int, Any]:
    """Stamp -> joint angles in the order of names."""
    angles = {}
    for state in states:
        positions = dict(zip(state.name, numbers(state.position, np.float64, len(state.name)), strict=True))
        angles[stamp_ns(state.header.stamp)] = np.array([positions[name] for name in names])
    return angles


def test_a_range_of_motion_becomes_the_body_that_is_solved(graph: Any, tmp_path: Path) -> None:
    studio = Studio(graph, tmp_path)
    refused = studio.call("calibrate")
    assert not refused.success and "no camera_info yet of all of the rig's cameras back, chest" in refused.message
    studio.plug_in(uncalibrated="chest")
    graph.until(lambda: not studio.solver.inside.stage._cameras.missing, _SOON_S, "every camera_info is read")
    assert not studio.call("calibrate").success
    studio.plug_in()
    started = studio.call("start_calibration")
    assert started.success and "N-pose" in started.message

    # One joint is forgotten: it is named, and nothing comes of it.
    studio.perform(range_of_motion(studio.truth, held=["elbow_left"]))
    assert studio.call("calibrate").success
    held = "elbow_left was held still"
    graph.until(lambda: held in studio.calibration().get("text", ""), _CALIBRATION_S, held)
    assert not graph.heard["/robot_description"] and not studio.path.exists()

    # What was forgotten is done, and all of it together makes the body, while the node goes on.
    studio.perform(_stamped(range_of_motion(studio.truth), 1))
    assert studio.call("calibrate").success
    graph.until(lambda: studio.calibration().get("text") == "calibrating", _SOON_S, "progress is reported")
    graph.until(lambda: studio.calibration()["text"] == "collecting", _CALIBRATION_S, "the calibration ends")
    body = read_body(studio.path)
    assert _greatest_error(body, studio.truth) < LOST_M
    assert body.report and body.report["source"] == "range of motion"
    assert _files(tmp_path) == {"rig.yaml", "body.yaml", "body.html"}
    graph.until(lambda: graph.heard["/robot_description"], _SOON_S, "the body is described")
    assert graph.messages("/robot_description")[-1].data == urdf_text(body)

    # From now on that body is solved.
    assert not graph.heard["/joint_states"]
    motion = _stamped(range_of_motion(studio.truth, duration_s=4.0), 2)
    studio.perform(motion)
    assert studio.call("flush").success
    graph.until(lambda: len(graph.heard["/joint_states"]) == len(motion.stamps_ns), _SOON_S, "joint states follow")
    tracker = JointAngleTracker(studio.truth)
    found = _angles(graph.messages("/joint_states"), tracker.names)
    poses = zip(motion.stamps_ns, motion.world_T_segment, strict=True)
    true = {int(stamp): tracker.angles(world_T_segment) for stamp, world_T_segment in poses}
    off_deg = np.degrees([np.abs(found[stamp] - true[stamp]) for stamp in true])
    assert np.median(off_deg) < LOST_DEG
    assert studio.solver.end() == 0
