"""A preview solves parts of a long recording, and everybody is told."""

import dataclasses
from pathlib import Path

import numpy as np
import pytest
from helpers.altered_sample import write_altered_sample

from benchmarks.loop_recording import loop_bag
from bodycam_ros.cli.main import main
from bodycam_ros.errors import SettingsError
from bodycam_ros.evaluate.evaluation import evaluate
from bodycam_ros.recording.time_span import TimeSpan
from bodycam_ros.replaying.preview import preview_windows
from bodycam_ros.replaying.replay import replay
from bodycam_ros.replaying.replay_request import ReplayRequest
from bodycam_ros.results.solved_part import recording_start_ns
from bodycam_ros.results.solved_recording import read_solved
from bodycam_ros.results.verdict import Level

LEG = ("waist_front", "thigh_left", "shin_left")
SECOND_NS = 10**9


def test_parts_are_in_the_middle_of_equal_shares() -> None:
    hour = preview_windows((0, 3600 * SECOND_NS), 36)
    assert len(hour) == 36 and hour[0] == (49 * SECOND_NS, 51 * SECOND_NS)
    assert {after[0] - before[0] for before, after in zip(hour, hour[1:], strict=False)} == {100 * SECOND_NS}
    # A tenth of the recording at most; what is shorter than a part is one.
    assert len(preview_windows((0, 60 * SECOND_NS), 36)) == 3
    assert preview_windows((5, 5 + SECOND_NS), 36) == ((5, 5 + SECOND_NS),)


def test_a_preview_is_part_of_the_whole_and_says_so(
    sample: Path, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    short = write_altered_sample(sample, tmp_path / "short", cameras=LEG, frames=45)
    loop_bag(short, tmp_path / "bag", 40.0)
    asked = ReplayRequest(tmp_path / "bag", sample / "map", sample / "body.yaml", tmp_path / "preview", jobs=2)
    shares = list[float]()
    summary = replay(dataclasses.replace(asked, preview=36), lambda step, share: shares.append(share))
    solved = read_solved(asked.output)
    seconds = 1e-9 * (solved.stamps_ns - recording_start_ns(solved))
    assert len(seconds) == summary.solved == 120 and summary.recorded_s == pytest.approx(4.0)
    assert np.all((abs(seconds - 10.0) <= 1.01) | (abs(seconds - 30.0) <= 1.01))
    assert shares == sorted(shares) and 0.95 < shares[-1] <= 1.0
    # The verdict, the record and the report; that no camera was registered between the parts says nothing of it.
    assert [finding.check for finding in summary.verdict.findings] == ["preview"]
    assert summary.verdict.level is Level.DOUBTFUL and "4.0 of 40.0 s, in 2 places" in summary.verdict.findings[0].what
    evaluation = evaluate(asked.output)
    assert "a preview: 4.0 of 40.0 s, in 2 places" in evaluation.made_from.lines
    assert main(["export", str(asked.output), "--to", "csv", "-o", str(tmp_path / "motion.csv")]) == 0
    assert "is a preview, not the result: 4.0 of 40.0 s" in caplog.text
    # The same time out of all of the recording.
    part = TimeSpan(8.0, 11.0)
    replay(dataclasses.replace(asked, output=tmp_path / "part", span=part))
    whole = read_solved(tmp_path / "part")
    _, ours, theirs = np.intersect1d(solved.stamps_ns, whole.stamps_ns, return_indices=True)
    seen = [whole.body.segments.index(name) for name in ("pelvis", "thigh_left", "shin_left")]
    apart = (solved.world_T_segment[ours] - whole.world_T_segment[theirs])[:, seen, :3, 3]
    assert len(ours) == 60 and np.linalg.norm(apart, axis=-1).max() < 0.004


def test_what_needs_the_whole_recording_has_no_preview(sample: Path, tmp_path: Path) -> None:
    asked = ReplayRequest(tmp_path / "bag", sample / "map", sample / "body.yaml", tmp_path / "out", preview=1)
    for changes in ({"passes": 3}, {"imus": (Path("imu"),)}):
        with pytest.raises(SettingsError, match=r"there is no preview w.*needs the whole recording"):
            replay(dataclasses.replace(asked, **changes))  # type: ignore[arg-type]


def test_a_preview_in_stretches_is_refused(sample: Path, tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    bag = write_altered_sample(sample, tmp_path / "bag")
    inputs = [str(bag), "--map", str(sample / "map"), "--body", str(sample / "body.yaml"), "-o", str(tmp_path / "out")]
    assert main(["replay", *inputs, "--preview", "--stretches", "auto"]) == 1
    assert "leave --stretches out" in " ".join(capfd.readouterr().err.split())
