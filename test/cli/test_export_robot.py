"""``bodycam export --to robot``: what it writes as rosbags reads it, and what it refuses, leaving nothing behind."""

import shutil
from pathlib import Path

import numpy as np
import pytest
import yourdfpy
from helpers.mcap_doctor import doctor, read_beside_messages
from helpers.talos import MAPPING, talos_urdf
from numpy.typing import NDArray
from rosbags.highlevel import AnyReader

from bodycam_ros.cli.main import main
from bodycam_ros.errors import BodyError
from bodycam_ros.recording.bag_writer import write_recording
from bodycam_ros.results.provenance import Provenance
from bodycam_ros.results.topics import MOTION_TOPICS, ROBOT, ROBOT_TYPE
from bodycam_ros.robot.retargeting import Retargeting, RobotState

Array = NDArray[np.float64]
KEPT = 12  # instants of the sample, so that it takes no longer than it must


@pytest.fixture(scope="module")
def solved(sample_out: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The body and its first instants."""
    path = tmp_path_factory.mktemp("short") / "out"
    with AnyReader([sample_out]) as bag, write_recording(path) as writer:
        Provenance.read(sample_out).copy_to(writer, 0)
        for topic, kind in {ROBOT: ROBOT_TYPE, **MOTION_TOPICS}.items():
            wanted = [connection for connection in bag.connections if connection.topic == topic]
            for row, (_, stamp_ns, cdr) in enumerate(bag.messages(wanted)):
                if row < KEPT:
                    writer.write_serialized(topic, kind, stamp_ns, cdr)
    return path


def robot_flags() -> list[str]:
    return ["--urdf", str(talos_urdf()), "--mapping", str(MAPPING)]


def exported(*given: str | Path) -> int:
    return main(["export", "--to", "robot", *map(str, given)])


@pytest.fixture(scope="module")
def written(solved: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("robot") / "talos"
    assert exported(solved, *robot_flags(), "-o", path) == 0
    return path


def test_it_carries_what_the_motion_was_made_from(sample_out: Path, written: Path) -> None:
    metadata, attachments = read_beside_messages(written / "talos.mcap")
    source, files = read_beside_messages(next(sample_out.glob("*.mcap")))
    assert {name: metadata[name] for name in ("map", "body", "recording")} == {
        name: source[name] for name in ("map", "body", "recording")
    }
    assert metadata["bodycam_ros"]["command"] == "bodycam export --to robot"
    assert attachments == {"body.yaml": files["body.yaml"], "mapping.yaml": Path(MAPPING).read_bytes()}
    assert doctor(written / "talos.mcap") == []


def test_what_is_written_moves_the_robot_that_is_described(solved: Path, written: Path) -> None:
    seconds: list[float] = []
    positions, velocities, feet = [], [], []
    with AnyReader([written]) as bag:
        assert {topic: of.msgcount for topic, of in bag.topics.items()} == {
            "/robot_description": 1,
            "/joint_states": KEPT,
            "/tf": KEPT,
        }
        told = {c.topic: [bag.deserialize(cdr, c.msgtype) for _, _, cdr in bag.messages([c])] for c in bag.connections}
        stamps = [stamp for _, stamp, _ in bag.messages([c for c in bag.connections if c.topic == "/joint_states"])]
    assert told["/robot_description"][0].data == talos_urdf().read_text()
    robot = yourdfpy.URDF.load(str(talos_urdf()), load_meshes=False, build_scene_graph=True)
    for state, moved in zip(told["/joint_states"], told["/tf"], strict=True):
        assert sorted(state.name) == sorted(robot.actuated_joint_names)
        seconds.append(state.header.stamp.sec + 1e-9 * state.header.stamp.nanosec)
        positions.append(state.position)
        velocities.append(state.velocity)
        (placed,) = moved.transforms
        assert (placed.header.frame_id, placed.child_frame_id) == ("map", "base_link")
        assert placed.header.stamp == state.header.stamp
        robot.update_cfg(dict(zip(state.name, state.position, strict=True)))
        foot = robot.get_transform("left_sole_link", "base_link")[:3, 3]
        rotation, at = placed.transform.rotation, placed.transform.translation
        feet.append(turned([rotation.x, rotation.y, rotation.z, rotation.w], foot)[2] + at.z)
    np.testing.assert_allclose(seconds, 1e-9 * np.array(stamps), atol=1e-6)
    with AnyReader([solved]) as bag:
        assert stamps == [stamp for c, stamp, _ in bag.messages() if c.topic == "/joint_states"]
    # Nobody knows how fast it was before the first instant; later ones say how it went on.
    np.testing.assert_array_equal(velocities[0], 0.0)
    np.testing.assert_allclose(velocities[1:], np.diff(positions, axis=0) / np.diff(stamps)[:, None] * 1e9, atol=1e-6)
    assert np.abs(velocities[1:]).max() > 0.1
    assert -0.03 < min(feet) and max(feet) < 0.5


def turned(xyzw: list[float], vector: Array) -> Array:
    """A vector turned by a quaternion."""
    axis = np.array(xyzw[:3])
    across: Array = 2.0 * np.cross(axis, vector)
    return np.asarray(vector + xyzw[3] * across + np.cross(axis, across))


@pytest.mark.parametrize(
    ("given", "complaint"),
    [
        (["--mapping", "m.yaml"], "--to robot needs --urdf: the robot"),
        ([], "needs --urdf and --mapping"),
        (["again", "--urdf", "r.urdf", "--mapping", "m.yaml"], "takes one recording a call, not 2"),
        (["--urdf", "r.urdf", "--mapping", "m.yaml", "--rate", "30"], "--rate has no effect on robot"),
        (["--urdf", "r.urdf", "--mapping", "nothing.yaml"], "nothing.yaml"),
        (["--urdf", "nothing.urdf", "--mapping", str(MAPPING)], "nothing.urdf"),
        (["--to", "bvh", "--mapping", "m.yaml"], "--mapping: has no effect on bvh, only on robot"),
    ],
)
def test_what_cannot_be_is_refused_and_leaves_nothing(
    capsys: pytest.CaptureFixture[str], solved: Path, tmp_path: Path, given: list[str], complaint: str
) -> None:
    assert exported(solved, *given, "-o", tmp_path / "talos") == 1
    error = capsys.readouterr().err
    assert error.strip().startswith("bodycam: error: ") and complaint in " ".join(error.split())
    assert not list(tmp_path.iterdir())


def contents(folder: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in folder.iterdir()}


def test_only_robots_are_replaced(
    capsys: pytest.CaptureFixture[str], solved: Path, written: Path, tmp_path: Path
) -> None:
    there = Path(shutil.copytree(written, tmp_path / "talos"))
    before, times = contents(there), {path.name: path.stat().st_mtime_ns for path in there.iterdir()}
    assert exported(solved, *robot_flags(), "-o", there) == 1
    assert "exists already" in capsys.readouterr().err
    assert contents(there) == before
    assert exported(solved, *robot_flags(), "-o", there, "--force") == 0
    assert {path.name: path.stat().st_mtime_ns for path in there.iterdir()} != times
    capsys.readouterr()

    person = Path(shutil.copytree(solved, tmp_path / "person"))
    assert exported(solved, *robot_flags(), "-o", person, "--force") == 1
    assert "is no bag that 'bodycam export --to robot' wrote" in " ".join(capsys.readouterr().err.split())
    assert contents(person) == contents(solved)


def test_what_ends_half_way_leaves_nothing(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, solved: Path, tmp_path: Path
) -> None:
    follow, done = Retargeting.follow, []

    def breaks(self: Retargeting, stamp_ns: int, world_T_segment: Array) -> RobotState:
        done.append(stamp_ns)
        if len(done) > KEPT // 2:
            raise BodyError("the robot fell")
        return follow(self, stamp_ns, world_T_segment)

    monkeypatch.setattr(Retargeting, "follow", breaks)
    assert exported(solved, *robot_flags(), "-o", tmp_path / "talos") == 1
    assert "the robot fell" in capsys.readouterr().err
    assert len(done) > KEPT // 2 and not list(tmp_path.iterdir())
