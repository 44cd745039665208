"""The command, its files and its picture."""

import json
import os
import subprocess
import sys
from pathlib import Path

import cv2
import numpy as np
import pytest
from helpers.known_walk import LOST, START_NS, Walk, write_images, write_solved
from helpers.naming import naming
from numpy.typing import NDArray

import bodycam_ros
from bodycam_ros.cli import main as command_line
from bodycam_ros.errors import OutputError
from bodycam_ros.evaluate import report
from bodycam_ros.evaluate.anatomical_angles import planes_of
from bodycam_ros.evaluate.evaluation import evaluate
from bodycam_ros.evaluate.report import write_report
from bodycam_ros.evaluate.summary_picture import sight_table
from bodycam_ros.geometry import exp_so3
from bodycam_ros.registration.landmark_matches import CameraSight
from bodycam_ros.results.colours import LEFT, RIGHT, WARNING

SMALL_SHARE = 1e-4  # of the picture's pixels


def bodycam(*arguments: object) -> "subprocess.CompletedProcess[str]":
    """The command line as a person meets it."""
    command = [sys.executable, "-m", "bodycam_ros.cli.main", *map(str, arguments)]
    environment = {**os.environ, "PYTHONPATH": str(Path(bodycam_ros.__file__).parent.parent)}
    return subprocess.run(command, capture_output=True, text=True, check=False, env=environment)


def share_of(colour: str, picture: Path) -> float:
    """Share of a picture's pixels that have a colour."""
    pixels: NDArray[np.uint8] = np.asarray(cv2.imread(str(picture)), dtype=np.uint8)
    blue_green_red = [int(colour[at : at + 2], 16) for at in (5, 3, 1)]
    return float(np.all(pixels == blue_green_red, axis=2).mean())


def test_the_command_prints_and_writes(solved: Path, truth: Path, tmp_path: Path) -> None:
    result = bodycam("evaluate", solved, "--truth", truth, "-o", tmp_path / "report")
    assert (result.returncode, result.stderr) == (0, "")
    for text in (
        "shin",
        "93.3%",
        "position [cm]",
        "coverage 100.0%",
        "scale 1.00000",
        "same motion as walk: correlation 1.000",
        f"written to {tmp_path / 'report'}",
    ):
        assert text in result.stdout.replace("\n", "") or text in result.stdout
    figures = json.loads((tmp_path / "report" / "summary.json").read_text())
    assert figures["truth"]["position_cm"]["mean"] < 1e-6
    assert figures["cameras"]["shin"]["registered"] == pytest.approx(1.0 - len(LOST["shin"]) / 60)
    assert sorted(p.name for p in (tmp_path / "report").iterdir()) == [
        "angles.png",
        "joints.png",
        "report.html",
        "summary.json",
        "summary.png",
    ]


@pytest.mark.long
def test_the_recording_adds_pixels(solved: Path, tmp_path: Path) -> None:
    recording = write_images(tmp_path / "recording", ("waist", "shin"))
    result = bodycam("evaluate", solved, "--recording", recording, "-o", tmp_path / "report")
    assert (result.returncode, result.stderr) == (0, "")
    assert "of landmarks in the solved pose" in " ".join(result.stdout.split())
    assert sorted(p.name for p in (tmp_path / "report").iterdir()) == [
        "angles.png",
        "overlay.png",
        "report.html",
        "summary.json",
        "summary.png",
    ]


def test_another_recording_of_the_same_cameras_is_refused(solved: Path, tmp_path: Path) -> None:
    other = write_images(tmp_path / "other", ("waist", "shin"), START_NS + 3_600_000_000_000)
    result = bodycam("evaluate", solved, "--recording", other, "-o", tmp_path / "report")
    assert result.returncode == 1
    assert f"{other}: is not what {solved} was solved from" in result.stderr
    assert not (tmp_path / "report").exists()


def test_errors_are_one_line(tmp_path: Path) -> None:
    result = bodycam("evaluate", tmp_path / "nowhere", "-o", tmp_path / "report")
    assert result.returncode == 1
    assert result.stderr == f"bodycam: error: {tmp_path / 'nowhere'}: does not exist\n"
    assert not (tmp_path / "report").exists()


def test_the_command_is_known() -> None:
    assert "evaluate" in command_line.COMMANDS


def test_the_picture_shows_both_sides_and_what_is_lost(solved: Path, truth: Path, tmp_path: Path) -> None:
    write_report(evaluate(solved, truth), tmp_path)
    assert share_of(LEFT, tmp_path / "summary.png") > SMALL_SHARE
    assert share_of(WARNING, tmp_path / "summary.png") > SMALL_SHARE


def test_red_is_nothing_but_a_warning(walk: Walk, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The same without a lost image: of the key's patch alone something stays red."""
    write_report(evaluate(write_solved(walk, tmp_path / "lost")), tmp_path / "a")
    monkeypatch.setitem(LOST, "shin", ())
    write_report(evaluate(write_solved(walk, tmp_path / "found")), tmp_path / "b")
    with_lost, without = (share_of(WARNING, tmp_path / name / "summary.png") for name in ("a", "b"))
    assert without < SMALL_SHARE < with_lost


def test_a_body_without_arms_and_a_walk_of_one_instant_can_be_drawn(walk: Walk, tmp_path: Path) -> None:
    write_report(evaluate(write_solved(walk.without(list(range(1, 60))), tmp_path / "out")), tmp_path / "report")
    assert share_of(RIGHT, tmp_path / "report" / "summary.png") < share_of(LEFT, tmp_path / "report" / "summary.png")


def test_no_figure_is_nan(walk: Walk, tmp_path: Path) -> None:
    """One instant has no jitter; JSON has no NaN."""
    write_report(evaluate(write_solved(walk.without(list(range(1, 60))), tmp_path / "out")), tmp_path / "report")
    figures = json.loads((tmp_path / "report" / "summary.json").read_text(), parse_constant=pytest.fail)
    assert figures["jitter_mm"]["mean"] is None


def test_the_strip_shows_the_worst_of_the_images_that_share_a_column(solved: Path) -> None:
    landmarks, sights = sight_table(evaluate(solved).solved, 900)
    assert landmarks.shape == (2, 60)
    assert np.flatnonzero(sights[1] == CameraSight.BLIND).tolist() == list(LOST["shin"])
    _, sights = sight_table(evaluate(solved).solved, 6)
    assert np.flatnonzero(sights[1] == CameraSight.BLIND).tolist() == [1, 4]


def test_flexion_is_positive_where_a_joint_bends() -> None:
    forward = np.array([-40.0, 0.0, 30.0, 100.0])
    # About y, which points left: a limb that hangs swings forward by a negative turn.
    turned = exp_so3(-np.radians(forward)[:, None] * np.array([0.0, 1.0, 0.0]))
    np.testing.assert_allclose(np.degrees(planes_of("thigh_left", turned)[:, 0]), forward, atol=1e-9)
    np.testing.assert_allclose(np.degrees(planes_of("shin_left", turned)[:, 0]), -forward, atol=1e-9)


def test_a_report_that_fails_leaves_the_old_one(solved: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    evaluation = evaluate(solved)
    folder = tmp_path / "report"
    folder.mkdir()
    (folder / "summary.json").write_text("old")

    def full(*arguments: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(report, "draw_summary", full)
    with naming(OutputError, folder, "No space left on device"):
        write_report(evaluation, folder)
    assert [p.name for p in tmp_path.iterdir()] == ["report"]
    assert [p.name for p in folder.iterdir()] == ["summary.json"]
    assert (folder / "summary.json").read_text() == "old"


@pytest.mark.long
def test_a_report_never_goes_into_a_bag_or_over_a_file(solved: Path, tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    for place, complaint in ((solved, "is a ros2 bag folder"), (tmp_path / "file", "is a file")):
        result = bodycam("evaluate", solved, "-o", place)
        assert result.returncode == 1
        assert complaint in result.stderr
    assert not (solved / "summary.json").exists()


def test_start_of_the_recording_is_its_first_image(walk: Walk, tmp_path: Path) -> None:
    solved = evaluate(write_solved(walk.without([0, 1]), tmp_path / "out")).solved
    assert solved.start_ns == START_NS
    assert solved.seconds(solved.stamps_ns)[0] == pytest.approx(2 / 30, abs=1e-6)
