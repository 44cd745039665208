"""A recording that is solved in stretches is that of one go: states, figures and verdict."""

import dataclasses
import json
import os
import signal
import threading
import time
from pathlib import Path

import numpy as np
import pytest
from helpers.altered_sample import Alter, write_altered_sample
from helpers.naming import naming

from benchmarks.loop_recording import loop_bag
from bodycam_ros.cli.main import main
from bodycam_ros.errors import BodycamError, MapError, RecordingError, SettingsError
from bodycam_ros.estimation.estimator_settings import EstimatorSettings
from bodycam_ros.messages.factory import Message
from bodycam_ros.pipeline.settings import PipelineSettings
from bodycam_ros.recording.bag_file import BagFile
from bodycam_ros.recording.bag_reader import open_recording
from bodycam_ros.recording.bag_records import read_bag_records
from bodycam_ros.replaying.first_pass import FirstPass, block_bounds
from bodycam_ros.replaying.make_first_pass import make_first_pass
from bodycam_ros.replaying.merge import merge_stretches
from bodycam_ros.replaying.replay import replay
from bodycam_ros.replaying.replay_request import ReplayRequest
from bodycam_ros.replaying.stretches import replay_in_stretches
from bodycam_ros.results.provenance import VERDICT_FILE, Provenance
from bodycam_ros.results.solved_recording import SolvedRecording, read_solved

LEG = ("waist_front", "thigh_left", "shin_left")
BLOCK_S, LASTS_S = 2.0, 6.5
_OFF_NS = {"thigh_left": 11_000_000, "shin_left": -13_000_000}


def with_other_clocks(topic: str, number: int, message: Message) -> Message:
    """Stamps of free-running cameras."""
    stamp = message.header.stamp
    ns = stamp.sec * 10**9 + stamp.nanosec + _OFF_NS.get(topic.split("/")[1], 0)
    stamp = dataclasses.replace(stamp, sec=ns // 10**9, nanosec=ns % 10**9)
    return dataclasses.replace(message, header=dataclasses.replace(message.header, stamp=stamp))


def with_pauses(topic: str, number: int, message: Message) -> Message | None:
    """A camera without images for a second of every three, and so a segment that is predicted."""
    return None if topic.startswith("/shin_left/image") and number >= 30 else message


def as_it_is(topic: str, number: int, message: Message) -> Message:
    """The same message."""
    return message


def looped(sample: Path, folder: Path, alter: Alter = as_it_is) -> Path:
    """Three cameras for 6.5 s."""
    short = write_altered_sample(sample, folder / "short", alter, LEG, frames=45)
    loop_bag(short, folder / "bag", LASTS_S)
    return folder / "bag"


@pytest.fixture(scope="module", params=[as_it_is, with_other_clocks, with_pauses])
def in_one_go(
    request: pytest.FixtureRequest, sample: Path, tmp_path_factory: pytest.TempPathFactory
) -> tuple[ReplayRequest, FirstPass, object]:
    """What is asked for, its first pass, and the summary of the whole by that in one go."""
    folder = tmp_path_factory.mktemp("loop")
    bag = looped(sample, folder, request.param)
    asked = ReplayRequest(bag, sample / "map", sample / "body.yaml", folder / "whole", jobs=2)
    first = make_first_pass(asked, 3, BLOCK_S)
    return asked, first, replay(dataclasses.replace(asked, first=first))


def differences(one: SolvedRecording, other: SolvedRecording) -> tuple[float, float]:
    """Largest distance of the segments with a camera [m], and angle between them [rad].

    Where others are depends on how they moved before, for a second or two.
    """
    assert one.stamps_ns.tolist() == other.stamps_ns.tolist()
    seen = [one.body.segments.index(name) for name in ("pelvis", "thigh_left", "shin_left")]
    poses, others = one.world_T_segment[:, seen], other.world_T_segment[:, seen]
    apart = np.linalg.norm((poses - others)[..., :3, 3], axis=-1)
    turns = np.swapaxes(poses[..., :3, :3], -1, -2) @ others[..., :3, :3]
    return float(apart.max()), float(np.linalg.norm(turns - np.eye(3), axis=(-1, -2)).max() / np.sqrt(2.0))


@pytest.mark.long
def test_stretches_are_the_whole(in_one_go: tuple[ReplayRequest, FirstPass, object], tmp_path: Path) -> None:
    asked, first, whole = in_one_go
    assert first.count == 3 and len(first.anew_ns) == 2
    steps: list[tuple[str, float]] = []
    summary = replay_in_stretches(
        dataclasses.replace(asked, output=tmp_path / "out"), 3, BLOCK_S, lambda step, share: steps.append((step, share))
    )
    assert summary.notes == (
        "in stretches the map is not extended by what cameras see",
        "in stretches inertial sensors are not used",
    )
    one, many = read_solved(asked.output), read_solved(tmp_path / "out")
    metres, radians = differences(one, many)
    assert metres < 1e-5 and radians < np.radians(0.003)
    for name in ("images", "registered", "solved", "predicted", "frames", "late", "rejected", "lost", "readouts"):
        assert getattr(summary, name) == getattr(whole, name), name
    assert summary.remarks == whole.remarks  # type: ignore[attr-defined]
    assert many.stored_verdict == one.stored_verdict and len(one.stamps_ns) == summary.solved > 190
    assert Provenance.read(tmp_path / "out").sources == Provenance.read(asked.output).sources
    assert steps[-1] == ("3 stretches", 1.0)
    with BagFile(asked.output) as before, BagFile(tmp_path / "out") as after:
        counts = {topic: before.message_count(topic) for topic in before.topics if topic != "/diagnostics"}
        assert counts == {topic: after.message_count(topic) for topic in after.topics if topic != "/diagnostics"}
    assert sorted(each.name for each in tmp_path.iterdir()) == ["out"]


@pytest.mark.long
def test_any_number_of_processes_gives_equal_bytes(sample: Path, tmp_path: Path) -> None:
    bag = looped(sample, tmp_path)
    written = []
    for jobs in (1, 3):
        asked = ReplayRequest(bag, sample / "map", sample / "body.yaml", tmp_path / str(jobs) / "out", jobs=jobs)
        replay_in_stretches(asked, 3, BLOCK_S)
        written.append({file.name: file.read_bytes() for file in asked.output.iterdir()})
    assert len(written[0]) == 6 and written[0] == written[1]


def test_three_commands_make_a_bag(sample: Path, tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    bag = write_altered_sample(sample, tmp_path / "bag")
    inputs = [str(bag), "--map", str(sample / "map"), "--body", str(sample / "body.yaml"), "--jobs", "1"]
    first, part, out = (str(tmp_path / name) for name in ("first.json", "part", "out"))
    assert main(["replay", "first", *inputs, "--stretches", "4", "-o", first]) == 0
    assert "1 stretches of 0.2 s" in capfd.readouterr().out  # none is shorter than half a minute
    assert main(["replay", "stretch", *inputs, "--first", first, "--number", "1", "-o", part]) == 0
    main(["replay", "merge", *inputs, "--first", first, part, "-o", out])
    assert "0.2 s solved; written to" in " ".join(capfd.readouterr().out.split())  # it does not know for how long
    assert read_bag_records(Path(out)).attachments[VERDICT_FILE]
    assert len(read_solved(Path(out)).stamps_ns) == 8
    assert main(["replay", "stretch", *inputs, "--first", first, "--number", "2", "-o", f"{part}2"]) == 1
    assert "there is no stretch 2" in capfd.readouterr().err
    assert main(["replay", "merge", *inputs, "--first", first, part, part, "-o", f"{out}2"]) == 1
    assert "1 is there twice" in " ".join(capfd.readouterr().err.split()) and not Path(f"{out}2").exists()
    assert main(["replay", "merge", *inputs, "--first", first, out, "-o", f"{out}2"]) == 1
    assert "is not the bag of a stretch" in " ".join(capfd.readouterr().err.split())
    other = tmp_path / "other.yaml"
    other.write_text((sample / "body.yaml").read_text().replace("name: subject", "name: other"))
    inputs_with_other = [*inputs, "--body", str(other)]
    assert main(["replay", "merge", *inputs_with_other, "--first", first, part, "-o", f"{out}2"]) == 1
    assert str(other) in " ".join(capfd.readouterr().err.split()) and not Path(f"{out}2").exists()
    assert main(["replay", "first", *inputs, "--stretches", "1", "-o", first]) == 1
    assert "--force" in capfd.readouterr().err


def test_a_merge_wants_stretches_of_the_same_inputs(sample: Path, tmp_path: Path) -> None:
    bag = write_altered_sample(sample, tmp_path / "bag")
    asked = ReplayRequest(bag, sample / "map", sample / "body.yaml", tmp_path / "out")
    begin_ns, end_ns = (bounds := make_first_pass(asked, 1).bounds_ns)[0], bounds[-1]
    halves = dataclasses.replace(make_first_pass(asked, 1), bounds_ns=(begin_ns, (begin_ns + end_ns) // 2, end_ns))
    halves = dataclasses.replace(halves, count=2)
    parts = [tmp_path / "0", tmp_path / "1"]
    for number, part in enumerate(parts):
        replay(dataclasses.replace(asked, first=halves, stretch=number, output=part, slim=number == 1))
    with pytest.raises(RecordingError, match=r"was solved with another settings than the other stretches"):
        merge_stretches(asked, halves, parts)
    with pytest.raises(RecordingError, match=r"of the 2 stretches, 2 is missing among 1 bags"):
        merge_stretches(asked, halves, parts[:1])
    assert not asked.output.exists()


@pytest.mark.parametrize(
    ("changes", "expected"),
    [
        ({"passes": 3}, "while the map is extended"),
        ({"equipment": "bicycle"}, "with equipment"),
        ({"imus": (Path("imu"),)}, "with inertial sensors"),
        ({"settings": PipelineSettings(estimator=EstimatorSettings(output_delay="offline"))}, "'offline'"),
    ],
)
def test_what_needs_all_that_came_before_is_refused(
    sample: Path, tmp_path: Path, changes: dict[str, object], expected: str
) -> None:
    asked = ReplayRequest(tmp_path / "bag", sample / "map", sample / "body.yaml", tmp_path / "out")
    with pytest.raises(SettingsError, match=expected):
        replay_in_stretches(dataclasses.replace(asked, **changes), 2)  # type: ignore[arg-type]


def test_what_goes_wrong_in_a_stretch_is_said_and_leaves_nothing(sample: Path, tmp_path: Path) -> None:
    bag = write_altered_sample(sample, tmp_path / "bag")
    damaged = tmp_path / "map"
    damaged.mkdir()
    asked = ReplayRequest(bag, damaged, sample / "body.yaml", tmp_path / "out")
    with pytest.raises(MapError):
        replay_in_stretches(asked, 1)
    assert sorted(each.name for each in tmp_path.iterdir()) == ["bag", "map"]


@pytest.mark.long
def test_a_process_that_is_killed_is_named(sample: Path, tmp_path: Path) -> None:
    bag = looped(sample, tmp_path)
    asked = ReplayRequest(bag, sample / "map", sample / "body.yaml", tmp_path / "out" / "bag", jobs=1)

    def kill_a_stretch() -> None:
        held: set[int] = set()
        deadline = time.monotonic() + 120.0
        while not held and time.monotonic() < deadline:
            time.sleep(0.05)
            parts = list(tmp_path.glob("out/.bodycam.*/.bodycam.*/*"))
            held = {int(pid) for pid in os.listdir("/proc") if pid.isdigit() for each in parts if _holds(pid, each)}
        for pid in list(held)[:1]:
            os.kill(pid, signal.SIGKILL)

    killer = threading.Thread(target=kill_a_stretch)
    killer.start()
    with pytest.raises(RecordingError, match=r"the process of stretch \d ended with exit code -9"):
        replay_in_stretches(asked, 3, BLOCK_S)
    killer.join()
    assert list((tmp_path / "out").iterdir()) == []


def _holds(pid: str, folder: Path) -> bool:
    try:
        return any(Path(os.readlink(each)).is_relative_to(folder) for each in Path(f"/proc/{pid}/fd").iterdir())
    except OSError:
        return False


@pytest.mark.parametrize("text", ["", "[]", "{}", "null", '{"version": 1}', "[" * 100_000])
def test_another_file_is_no_first_pass(tmp_path: Path, text: str) -> None:
    path = tmp_path / "first.json"
    path.write_text(text)
    with pytest.raises(RecordingError, match=r"is not a first pass of this version"):
        FirstPass.read(path)
    with pytest.raises(BodycamError, match=r"cannot be read"):
        FirstPass.read(tmp_path)


def test_a_first_pass_is_read_as_it_was_written(sample: Path, tmp_path: Path) -> None:
    bag = write_altered_sample(sample, tmp_path / "bag", with_other_clocks)
    asked = ReplayRequest(bag, sample / "map", sample / "body.yaml", tmp_path / "out")
    first = make_first_pass(asked, 2)
    first.write(tmp_path / "first.json")
    assert FirstPass.read(tmp_path / "first.json") == first
    assert json.loads((tmp_path / "first.json").read_text())["count"] == 1


def test_a_first_pass_is_of_one_recording(sample: Path, tmp_path: Path) -> None:
    first = FirstPass(("bag", 5), (0, 10), 1, 0, None, {}, {}, {})
    first.check_recording(tmp_path / "bag", 5)
    for path, stamp_ns in ((tmp_path / "other", 5), (tmp_path / "bag", 6)):
        with naming(RecordingError, path, "bag", stamp_ns):
            first.check_recording(path, stamp_ns)
    bag = write_altered_sample(sample, tmp_path / "bag")
    asked = ReplayRequest(bag, sample / "map", sample / "body.yaml", tmp_path / "out")
    with naming(RecordingError, bag):
        replay(dataclasses.replace(asked, first=first, stretch=0))


def test_blocks_are_none_too_short() -> None:
    second = 10**9
    assert block_bounds((5 * second, 6 * second), 30.0) == (5 * second, 6 * second)
    assert block_bounds((0, 89 * second), 30.0) == (0, 30 * second, 89 * second)
    thirds = FirstPass(("bag", 0), block_bounds((0, 300 * second), 30.0), 3, 0, None, {}, {}, {})
    assert [thirds.stretch_ns(number)[0] // second for number in range(3)] == [0, 90, 180]


def test_a_part_is_read_near_its_time_alone(sample: Path, tmp_path: Path) -> None:
    bag = looped(sample, tmp_path)
    with open_recording(bag) as recording:
        first_ns = recording.first_stamp_ns
        window_ns = first_ns + 4 * 10**9, first_ns + 5 * 10**9
        ahead_ns = recording.recorded_ahead_ns
        near = [(image.camera, image.stamp_ns) for image in recording.images(LEG, window_ns, ahead_ns)]
        every = [(image.camera, image.stamp_ns) for image in recording.images(LEG, window_ns)]
    assert near == every and len(near) == 90
