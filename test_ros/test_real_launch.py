"""The launch file under the real ``ros2``, in the workspace that ``make test-ros`` builds."""

import os
import re
import signal
import subprocess
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import rclpy
import yaml
from diagnostic_msgs.msg import DiagnosticArray
from helpers.own_domain import own_domain
from rclpy.executors import SingleThreadedExecutor
from rclpy.qos import DurabilityPolicy, QoSProfile
from rosbags.highlevel import AnyReader
from sensor_msgs.msg import JointState
from std_msgs.msg import String

from bodycam_ros.body.body_file import read_body, write_body
from bodycam_ros.inertial.imu_calibration import ImuCalibration
from bodycam_ros.messages.imu import IMU_TOPIC, imu_message
from bodycam_ros.recording.bag_writer import write_recording
from bodycam_ros.recording.typestore import recorded_messages

BAGS = Path(__file__).parents[1] / "bags"
BAG = BAGS / "sample/bag"
SAMPLE = {"map": BAGS / "map", "body": BAGS / "body.yaml"}
TWO, FOUR = "waist_front,thigh_left", "waist_front,torso_front,thigh_left,shin_left"
INSTANTS = 60
AGREEMENT_DEG = 0.05
_SENSORS = "skeleton_solver: inertial sensors"
_DIRECTLY = ("--no-daemon", "--spin-time", "4")
_UP_S, _PLAYED_S, _END_S = 120.0, 240.0, 60.0
_STARTED = re.compile(r"\[([\w.]+-\d+)\]: process started with pid \[(\d+)\]")
_ENDED = re.compile(r"\[([\w.]+-\d+)\]: process has (?:finished cleanly|died \[pid \d+, exit code (-?\d+))")


@pytest.fixture(autouse=True)
def domain() -> Iterator[None]:
    """A ROS domain that nothing else on this machine has."""
    with own_domain() as number, pytest.MonkeyPatch.context() as patch:
        patch.setenv("ROS_DOMAIN_ID", str(number))
        patch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
        yield
        subprocess.run(["ros2", "daemon", "stop"], capture_output=True)


def ros2(*words: object) -> str:
    """Output of a command of ros2, which must succeed; without the daemon, which remembers nodes that are gone."""
    words = (*words, *(_DIRECTLY if words[0] in ("node", "topic", "lifecycle", "param") else ()))
    for _ in range(3):  # a command finds nodes in some seconds, or not
        done = subprocess.run(["ros2", *map(str, words)], capture_output=True, text=True, timeout=_UP_S)
        if done.returncode == 0:
            break
    assert done.returncode == 0, f"ros2 {' '.join(map(str, words))}: {done.stdout}{done.stderr}"
    return done.stdout


def nodes_there() -> list[str]:
    """Nodes of the graph."""
    listed = ros2("node", "list").split()
    return sorted(name for name in listed if "_ros2cli" not in name and name != "/test_ros")


def shared_memory(pid: int) -> set[str]:
    """Segments in /dev/shm that a process has mapped; ports, 52 KB each, are everybody's."""
    try:
        maps = Path(f"/proc/{pid}/maps").read_text()
    except OSError:
        return set()
    return set(re.findall(r"(/dev/shm/fastrtps_[0-9a-f]+)$", maps, re.MULTILINE))


class Launch:
    """A running ``ros2 launch``, and the joint states and descriptions that were received."""

    def __init__(self, process: "subprocess.Popen[bytes]", log: Path, executor: SingleThreadedExecutor) -> None:
        self.process = process
        self.log = log
        self._executor = executor
        self.received: list[JointState] = []
        self.received_s: list[float] = []
        self.descriptions: list[str] = []
        self.statuses: dict[str, dict[str, str]] = {}
        self._shared: set[str] = set()

    @property
    def output(self) -> str:
        return self.log.read_text()

    def add(self, state: JointState) -> None:
        self.received.append(state)
        self.received_s.append(time.monotonic())

    def add_diagnostics(self, diagnostics: DiagnosticArray) -> None:
        for status in diagnostics.status:
            self.statuses[status.name] = {each.key: each.value for each in status.values}

    def processes(self) -> list[tuple[str, int]]:
        """Name in the launch and process id of each start, in order."""
        return [(name, int(pid)) for name, pid in _STARTED.findall(self.output)]

    def codes(self) -> list[int]:
        """Exit codes of the processes that have ended."""
        return [int(code or 0) for _, code in _ENDED.findall(self.output)]

    def until(self, holds: Callable[[], bool], seconds: float) -> None:
        deadline_s = time.monotonic() + seconds
        while not holds():
            assert time.monotonic() < deadline_s, self.output[-6000:]
            self._executor.spin_once(timeout_sec=0.1)

    def end(self, number: int = signal.SIGINT) -> int:
        """Send a signal to the whole process group, as a terminal does by Ctrl-C; the exit code."""
        for _, pid in self.processes():
            self._shared |= shared_memory(pid)
        os.killpg(self.process.pid, number)
        return self.process.wait(_END_S)

    def assert_gone(self, *codes: int) -> None:
        """Every process has ended with 0, or one of the codes, and left nothing in shared memory that only it used."""
        self.until(lambda: not any(Path(f"/proc/{pid}").exists() for _, pid in self.processes()), _END_S)
        assert set(self.codes()) <= {0, *codes}, self.output[-6000:]
        left = {path for path in self._shared - shared_memory(os.getpid()) if Path(path).exists()}
        assert codes or not left, left  # who is killed leaves it


@contextmanager
def launched(folder: Path, *files: Path, topic: str = "/joint_states", **arguments: object) -> Iterator[Launch]:
    what = [*map(str, files)] or ["bodycam_ros", "bodycam.launch.py"]
    command = ["ros2", "launch", *what, *(f"{k}:={v}" for k, v in arguments.items())]
    log, context = folder / "launch.log", rclpy.Context()
    rclpy.init(context=context)
    listener = rclpy.create_node("test_ros", context=context)
    executor = SingleThreadedExecutor(context=context)
    executor.add_node(listener)
    signal.signal(signal.SIGINT, signal.default_int_handler)  # else a run in the background hands on "ignored"
    with log.open("wb") as output:
        process = subprocess.Popen(command, stdout=output, stderr=subprocess.STDOUT, start_new_session=True)
    running = Launch(process, log, executor)
    listener.create_subscription(JointState, topic, running.add, 1000)
    listener.create_subscription(DiagnosticArray, "/diagnostics", running.add_diagnostics, 1000)
    latched = QoSProfile(depth=10, durability=DurabilityPolicy.TRANSIENT_LOCAL)
    described = topic.replace("joint_states", "robot_description")
    listener.create_subscription(String, described, lambda text: running.descriptions.append(text.data), latched)
    try:
        yield running
    finally:
        for pid in (process.pid, *(pid for _, pid in running.processes())):
            try:
                os.killpg(process.pid, signal.SIGKILL) if pid == process.pid else os.kill(pid, signal.SIGKILL)
            except ProcessLookupError:
                continue
        process.wait()
        executor.shutdown()
        listener.destroy_node()
        rclpy.shutdown(context=context)


def _angles(state: Any) -> tuple[int, dict[str, float]]:
    stamp = state.header.stamp
    return stamp.sec * 10**9 + stamp.nanosec, dict(zip(state.name, state.position, strict=True))


def test_arguments_are_shown() -> None:
    shown = ros2("launch", "bodycam_ros", "bodycam.launch.py", "--show-args")
    assert {"map", "body", "bagfile", "cameras", "respawn"} <= set(re.findall(r"^\s+'(\w+)':", shown, re.MULTILINE))


@pytest.mark.parametrize("one_process", ["false", "true"])
def test_sixteen_cameras_agree_with_replay(tmp_path: Path, one_process: str) -> None:
    # Slow enough for two busy cores, and no image may be left out: a replay leaves none out either.
    patient = {"longest_wait": 0.0, "idle_flush": 10.0, "assembler": {"max_wait": 30.0}}
    (tmp_path / "patient.yaml").write_text(yaml.safe_dump({"/**": {"ros__parameters": patient}}))
    given = {"bagfile": BAG, "rate": 0.1, "one_process": one_process, "params_file": tmp_path / "patient.yaml"}
    with launched(tmp_path, **SAMPLE, **given) as walk:
        walk.until(lambda: len(walk.received) >= INSTANTS, _PLAYED_S)
        live = dict(map(_angles, walk.received))
        assert len(walk.descriptions) == 1
        between_s = np.diff(walk.received_s[INSTANTS // 2 + 5 :])  # the first second waits until clocks are known
        assert np.mean(between_s < 0.002) < 0.1, f"messages in bursts: {between_s}"
        assert walk.end() in (0, 130)
        walk.assert_gone()
    assert nodes_there() == []
    assert len(live) == INSTANTS
    words = [word for name, path in SAMPLE.items() for word in (f"--{name}", path)]
    out = tmp_path / "replayed"
    ros2("run", "bodycam_ros", "bodycam", "replay", BAG, *words, "-o", out)
    with AnyReader([out]) as reader:
        topics = [each for each in reader.connections if each.topic == "/joint_states"]
        replayed = dict(_angles(reader.deserialize(raw, c.msgtype)) for c, _, raw in reader.messages(topics))
    assert replayed.keys() == live.keys()
    apart = [live[at][name] - angle for at, angles in replayed.items() for name, angle in angles.items()]
    assert np.degrees(np.median(np.abs(apart))) <= AGREEMENT_DEG


def test_every_killed_node_is_started_again_and_sigterm_ends_all(tmp_path: Path) -> None:
    given = {"cameras": TWO, "registrations": 1, "bagfile": BAG, "rate": 0.2, "loop": "true"}
    with launched(tmp_path, **SAMPLE, **given) as graph:
        graph.until(lambda: len(graph.received) > 5, _UP_S)
        for name, pid in [each for each in graph.processes() if not each[0].startswith("player")]:
            os.kill(pid, signal.SIGKILL)
            graph.until(lambda n=name: sum(each == n for each, _ in graph.processes()) == 2, _UP_S)
            count = len(graph.received)
            graph.until(lambda c=count: len(graph.received) > c + 10, _UP_S)
        assert graph.end(signal.SIGTERM) in (0, 143, -15)
        graph.assert_gone(-9)
    subprocess.run(["fastdds", "shm", "clean"], capture_output=True)  # of those that were killed
    assert nodes_there() == []


@pytest.mark.parametrize("one_process", ["false", "true"])
def test_inertial_sensors_of_a_bag_of_their_own_are_played(tmp_path: Path, one_process: str) -> None:
    """Sensors that feel no motion contradict the images of a walk."""
    person = read_body(SAMPLE["body"])
    body = tmp_path / "body.yaml"
    sensors = tmp_path / "imu"
    mounts = {c: replace(m, imu=ImuCalibration()) if c in TWO.split(",") else m for c, m in person.mounts.items()}
    write_body(replace(person, mounts=mounts), body)
    make, still = recorded_messages(), (np.zeros(3), np.array([0.0, -9.8, 0.0]))
    with AnyReader([BAG]) as bag, write_recording(sensors) as writer:
        for stamp in range(bag.start_time, bag.end_time, 5_000_000):
            for camera in TWO.split(","):
                writer.write(f"/{camera}{IMU_TOPIC}", stamp, imu_message(make, camera, stamp, *still))
    given = {"cameras": TWO, "registrations": 1, "bagfile": BAG, "imu": sensors, "rate": 0.2, "loop": "true"}
    with launched(tmp_path, **{**SAMPLE, "body": body}, **given, one_process=one_process) as walk:
        reported = walk.statuses
        walk.until(
            lambda: all("contradicts" in reported.get(_SENSORS, {}).get(c, "") for c in TWO.split(",")), _PLAYED_S
        )
        assert reported[_SENSORS]["in use"] == "none"
        assert walk.end() in (0, 130)
        walk.assert_gone()


@pytest.mark.parametrize("one_process", ["false", "true"])
@pytest.mark.parametrize("after_s", [0.5, 1.5, 3.0])
def test_an_early_ctrl_c_ends_all(tmp_path: Path, after_s: float, one_process: str) -> None:
    with launched(tmp_path, **SAMPLE, one_process=one_process) as graph:
        graph.until(lambda: bool(graph.processes()), _UP_S)
        time.sleep(after_s)
        assert graph.end() in (0, 130)
        graph.assert_gone()


@pytest.mark.parametrize("wrong", ["map", "body", "bagfile"])
@pytest.mark.parametrize("one_process", ["false", "true"])
def test_a_wrong_file_is_one_line_and_launch_ends(tmp_path: Path, wrong: str, one_process: str) -> None:
    nowhere = tmp_path / "nowhere"
    given = {**SAMPLE, "cameras": TWO, "bagfile": BAG, "one_process": one_process, wrong: nowhere}
    with launched(tmp_path, **given) as graph:
        assert graph.process.wait(_UP_S) == 1
        errors = [line for line in graph.output.splitlines() if str(nowhere) in line and "process started" not in line]
        assert errors and "Traceback" not in graph.output, graph.output
        by_process = {line.split("]")[0] for line in errors}
        assert len(errors) == len(by_process), graph.output  # a process prints it once
        graph.assert_gone(2)


_INCLUDING = """
from ament_index_python.packages import get_package_share_directory
from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, GroupAction, IncludeLaunchDescription, LogInfo, OpaqueFunction
from launch.launch_description_sources import PythonLaunchDescriptionSource
from launch_ros.actions import Node, PushRosNamespace


def _left(context):
    environment = {name for name in context.environment if "PROFILES" in name}
    return [LogInfo(msg=f"left: {sorted(context.launch_configurations)} {sorted(environment)}")]


def generate_launch_description():
    path = get_package_share_directory("bodycam_ros") + "/launch/bodycam.launch.py"
    people = [
        GroupAction([
            PushRosNamespace(name),
            IncludeLaunchDescription(PythonLaunchDescriptionSource(path), launch_arguments=GIVEN.items()),
        ], forwarding=False)
        for name in ("anna", "bert")
    ]
    foreign = Node(package="bodycam_ros", executable="player", name="foreign", parameters=[{"bagfile": BAGFILE}])
    return LaunchDescription([*people, OpaqueFunction(function=_left), foreign])
"""


def test_two_people_are_included_by_another_launch_file(tmp_path: Path) -> None:
    """Their topics and frames are apart, and nothing of ours is left in the file that includes."""
    given = {**{k: str(v) for k, v in SAMPLE.items()}, "cameras": TWO, "bagfile": str(BAG), "rate": "0.2"}
    given |= {"one_process": "true", "loop": "true"}
    file = tmp_path / "people.launch.py"
    file.write_text(f"GIVEN = {given!r}\nBAGFILE = '{tmp_path / 'nowhere'}'\n{_INCLUDING}")
    with launched(tmp_path, file, topic="/anna/joint_states") as graph:
        graph.until(lambda: len(graph.received) > 10, _UP_S)
        names = nodes_there()
        assert {"/anna/skeleton_solver", "/bert/skeleton_solver"} <= set(names)
        frame = re.search(r"frame_id: (\S+)", ros2("topic", "echo", "--once", "/bert/waist_front/landmarks"))
        assert frame is None or frame[1].startswith(("bert/", "map"))
        assert "child_frame_id: anna/" in ros2("topic", "echo", "--once", "/anna/odometry")
        assert "left: [] []" in graph.output, graph.output
        assert graph.end() in (0, 130)


def test_nodes_are_managed_and_their_parameters_changed(tmp_path: Path) -> None:
    given = {"cameras": TWO, "registrations": 1, "bagfile": BAG, "rate": 0.2, "loop": "true", "autostart": "false"}
    managed = ["/tracker_waist_front", "/tracker_thigh_left", "/registration", "/skeleton_solver"]
    with launched(tmp_path, **SAMPLE, **given) as graph:
        graph.until(lambda: set(managed) <= set(nodes_there()), _UP_S)
        for transition in ("configure", "activate"):
            for node in managed:
                assert "successful" in ros2("lifecycle", "set", node, transition).lower()
        graph.until(lambda: len(graph.received) > 5, _UP_S)
        assert "active" in ros2("lifecycle", "get", "/registration")
        assert "successful" in ros2("param", "set", "/registration", "registrar.min_inliers", 25).lower()
        assert ros2("param", "get", "/registration", "registrar.min_inliers").split()[-1] == "25"
        dumped = ros2("param", "dump", "/registration")
        assert yaml.safe_load(dumped)["/registration"]["ros__parameters"]["registrar"]["min_inliers"] == 25
        (tmp_path / "one.yaml").write_text("/registration:\n  ros__parameters:\n    registrar.min_inliers: 15\n")
        ros2("param", "load", "/registration", tmp_path / "one.yaml")
        assert ros2("param", "get", "/registration", "registrar.min_inliers").split()[-1] == "15"
        starts = len(graph.processes())
        assert "successful" in ros2("lifecycle", "set", "/tracker_thigh_left", "shutdown").lower()
        assert "finalized" in ros2("lifecycle", "get", "/tracker_thigh_left")
        time.sleep(3.0)
        assert len(graph.processes()) == starts  # not started again
        assert graph.end() in (0, 130)


def test_a_node_prints_its_parameters() -> None:
    assert "most_ahead" in ros2("run", "bodycam_ros", "tracker", "--help")


def test_a_package_that_depends_on_the_messages_is_built() -> None:
    """In the same workspace, where msg_defs/ is linked beside this package."""
    assert ros2("run", "message_consumer", "message_consumer").strip() == "9f86d081884c7d65"
    assert "string map_identity" in ros2("interface", "show", "bodycam_msgs/msg/LandmarkMatches")


def test_sixteen_cameras_with_drivers_in_processes_of_their_own(tmp_path: Path) -> None:
    """22 processes of the graph, 16 of drivers, a listener and a tool: more than Fast DDS finds by itself."""
    cameras = [*read_body(SAMPLE["body"]).mounts]
    profile = {"FASTRTPS_DEFAULT_PROFILES_FILE": str(Path(__file__).parents[1] / "config/fastdds-shm.xml")}
    drivers = []
    with pytest.MonkeyPatch.context() as patch:
        for name, value in profile.items():
            patch.setenv(name, value)
        with launched(tmp_path, **SAMPLE) as graph:
            try:
                for camera in cameras:
                    given = {"bagfile": BAG, "cameras": f"[{camera}]", "rate": 0.05, "readers": 3, "reader_wait": 240.0}
                    words = [word for name, value in given.items() for word in ("-p", f"{name}:={value}")]
                    node = ["--ros-args", "-r", f"__node:=driver_{camera}", *words]
                    drivers.append(subprocess.Popen(["ros2", "run", "bodycam_ros", "player", *node]))
                graph.until(lambda: len(graph.received) > 5, 2 * _PLAYED_S)
                graph.until(
                    lambda: float(graph.statuses["skeleton_solver: body"]["cameras used per frame"]) > 14.0, _PLAYED_S
                )
                assert graph.end() in (0, 130)
            finally:
                for driver in drivers:
                    driver.terminate()
                    driver.wait()
