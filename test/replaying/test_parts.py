"""A part of a recording is solved as that part of the whole, and cameras that start one by one cost nothing."""

from pathlib import Path

import numpy as np
import pytest
from helpers.altered_sample import write_altered_sample

from bodycam_ros import Body, Map
from bodycam_ros import replay as solve_in_process
from bodycam_ros.errors import RecordingError
from bodycam_ros.recording.time_span import TimeSpan
from bodycam_ros.replaying.replay import replay
from bodycam_ros.replaying.replay_request import ReplayRequest
from bodycam_ros.replaying.replay_summary import ReplaySummary
from bodycam_ros.results.solved_part import part_of, recording_start_ns
from bodycam_ros.results.solved_recording import read_solved

LEG = ("waist_front", "thigh_left", "shin_left", "foot_left")
FRAMES, RATE_HZ = 45, 30.0


def solve(sample: Path, bag: Path, out: Path, **options: object) -> ReplaySummary:
    inputs = bag, sample / "map", sample / "body.yaml", out
    return replay(ReplayRequest(*inputs, jobs=2, **options))  # type: ignore[arg-type]


@pytest.fixture(scope="module")
def leg(sample: Path, tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    """The bag of a left leg, and what is solved of it as a whole."""
    folder = tmp_path_factory.mktemp("leg")
    bag = write_altered_sample(sample, folder / "bag", lambda topic, number, message: message, LEG, FRAMES)
    assert solve(sample, bag, folder / "out").solved == FRAMES
    return bag, folder / "out"


def test_a_part_is_that_part_of_the_whole(sample: Path, leg: tuple[Path, Path], tmp_path: Path) -> None:
    bag, whole_path = leg
    span = TimeSpan(0.4, 1.2)
    summary = solve(sample, bag, tmp_path / "part", span=span)
    part, whole = read_solved(tmp_path / "part"), part_of(read_solved(whole_path), span)
    assert part.stamps_ns.tolist() == whole.stamps_ns.tolist() and summary.solved == 24
    assert part.seconds(part.stamps_ns)[0] == pytest.approx(0.4, abs=1e-6)
    apart = np.linalg.norm((part.world_T_segment - whole.world_T_segment)[..., :3, 3], axis=-1)
    seen = [part.body.segments.index(name) for name in ("pelvis", "thigh_left", "shin_left", "foot_left")]
    assert np.median(apart[:, seen]) < 0.003 and apart[:, seen].max() < 0.02
    assert summary.recorded_s == pytest.approx(0.8, abs=0.01)


def test_a_part_outside_is_refused_with_what_there_is(sample: Path, leg: tuple[Path, Path], tmp_path: Path) -> None:
    with pytest.raises(RecordingError, match=r"has no image from 20 s to 30 s; it lasts from 0 to 1.5 s"):
        solve(sample, leg[0], tmp_path / "out", span=TimeSpan(20.0, 30.0))
    with pytest.raises(
        RecordingError, match=r"nothing was solved from 20 s to the end; it was solved from 0.0 to 1.5 s"
    ):
        part_of(read_solved(leg[1]), TimeSpan(20.0))


def test_cameras_that_start_one_by_one(sample: Path, tmp_path: Path) -> None:
    """Two of four begin half a second late: until then nothing is published, unless all of it is asked for."""
    late_ns = round(0.5e9)

    def started_by_hand(topic: str, number: int, message: object) -> object:
        is_late = topic.startswith(("/shin_left/image", "/foot_left/image")) and number < late_ns * RATE_HZ * 1e-9
        return None if is_late else message

    bag = write_altered_sample(sample, tmp_path / "bag", started_by_hand, LEG, FRAMES)
    summary = solve(sample, bag, tmp_path / "most")
    assert summary.notes[0].startswith(
        "not solved: the first 0.5 s, in which fewer than three quarters of the 4 cameras run"
    )
    solved = read_solved(tmp_path / "most")
    # The first frame may be left out until the cameras agree.
    assert 0.499 < 1e-9 * (int(solved.stamps_ns[0]) - recording_start_ns(solved)) < 0.54
    assert solved.seconds(solved.stamps_ns)[0] > 0.499
    states = solve_in_process(bag, Map.load(sample / "map"), Body.load(sample / "body.yaml"))
    assert [output.state.stamp_ns for output in states] == solved.stamps_ns.tolist()
    assert states.left_out and summary.notes[0].startswith(states.left_out)
    whole = solve(sample, bag, tmp_path / "all", whole=True)
    assert whole.solved == FRAMES and FRAMES - 16 <= summary.solved <= FRAMES - 15
    assert not any("not solved" in note for note in whole.notes)
