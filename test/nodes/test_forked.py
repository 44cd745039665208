"""The graph whose processes come of one that has loaded what they need is the same graph."""

import os
import signal
from contextlib import suppress
from pathlib import Path
from typing import Any

import pytest
from altered_sample import write_altered_sample
from by_one_command import GraphProcess, refused

CAMERAS = ("waist_front", "torso_front")
NODES = {*(f"tracker_{camera}" for camera in CAMERAS), "registration", "skeleton_solver", "player"}
FRAMES = 20

_LONGEST_S, _SOON_S = 90.0, 20.0


@pytest.fixture
def begun(graph: Any, sample: Path, tmp_path: Path) -> Any:
    """The process that all others come of, once joint states do."""
    bag = write_altered_sample(sample, tmp_path / "bag", cameras=CAMERAS, frames=FRAMES)
    flags = ["--map", str(sample / "map"), "--body", str(sample / "body.yaml"), "--cameras", *CAMERAS]
    flags += ["--bag", str(bag), "--processes", "--respawn", "0.5"]
    flags += ["--ros-args", "-p", "longest_wait:=0.0", "-p", "settle:=3.0"]
    graph.listen({"/joint_states": "sensor_msgs/msg/JointState", "/diagnostics": "diagnostic_msgs/msg/DiagnosticArray"})
    (begun,) = graph.start(GraphProcess("graph", "graph", flags=tuple(flags)))
    graph.until(lambda: begun.process.poll() is not None or graph.heard["/joint_states"], _LONGEST_S, "joint states")
    assert begun.process.poll() is None, graph.report()
    return begun


def test_every_node_has_a_process_and_is_started_again(graph: Any, begun: Any) -> None:
    pid = begun.process.pid
    # The player may have played it all by now.
    assert _short(NODES - {"player"}) <= _children(pid).keys() <= _short(NODES)
    tracker = f"tracker_{CAMERAS[0]}"
    (shortened,) = _short({tracker})
    before = _children(pid)[shortened]
    os.kill(before, signal.SIGKILL)
    graph.until(lambda: _children(pid).get(shortened, before) != before, _SOON_S, "a tracker in its place")
    heard = len(graph.heard["/diagnostics"])
    said = lambda: {s.name for m in graph.messages("/diagnostics", heard) for s in m.status}  # noqa: E731
    graph.until(lambda: any(name.startswith(f"{tracker}:") for name in said()), _SOON_S, "the tracker reports again")
    family = _children(pid)
    assert graph.end() == {"graph": 0}, graph.report()
    assert not any(Path(f"/proc/{child}").exists() for child in family.values())
    assert f"{tracker}: killed by signal 9" in begun.printed and "Traceback" not in begun.printed


def test_nobody_outlives_the_one_they_come_of(graph: Any, begun: Any) -> None:
    family = _children(begun.process.pid)
    begun.process.kill()
    begun.process.wait()
    graph.until(lambda: not any(_is_alive(child) for child in family.values()), _SOON_S, "all of them leave")


def test_each_says_why_it_cannot_run(sample: Path) -> None:
    for package in ("rclpy", "bodycam_msgs"):
        pytest.importorskip(package, reason=f"{package} is not installed; 'make test' installs it")
    said = refused(
        *("--processes", "--nodes", "tracker", "--map", "nowhere", "--body", str(sample / "body.yaml")),
        *("--cameras", *CAMERAS),
    )
    missing = "error: nowhere: there is no map folder; make one with"
    assert {line.split(missing)[0] for line in said} == {f"tracker_{each}: " for each in CAMERAS}


def test_each_has_keys_of_its_own_where_the_graph_has_some() -> None:
    pytest.importorskip("rclpy", reason="rclpy is not installed; 'make test' installs it")
    from bodycam_ros.nodes.forked import own_enclave

    launched = ["graph", "--processes", "--ros-args", "--enclave", "/anna/graph", "--ros-args", "-r", "__ns:=/anna"]
    assert own_enclave(launched, "tracker_left") == ["--ros-args", "--enclave", "/anna/tracker_left"]
    assert own_enclave(["graph", "--processes"], "tracker_left") == []


def _short(names: set[str]) -> set[str]:
    """Names of processes, as long as Linux lets them be."""
    return {name[:15] for name in names}


def _children(pid: int) -> dict[str, int]:
    """Name -> pid of those who live."""
    pids = Path(f"/proc/{pid}/task/{pid}/children").read_text().split()
    found = {}
    for child in map(int, pids):
        with suppress(OSError):
            found[Path(f"/proc/{child}/comm").read_text().strip()] = child
    return found


def _is_alive(pid: int) -> bool:
    try:
        return Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()[0] != "Z"
    except OSError:
        return False
