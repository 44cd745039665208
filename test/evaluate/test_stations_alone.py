"""A recording that was solved from static cameras alone, or with worn ones."""

import json
from pathlib import Path

import cv2
import numpy as np
import pytest
from known_walk import FRAMES, Walk, write_solved
from station_words import said

from bodycam_ros.errors import RecordingError
from bodycam_ros.evaluate.evaluation import evaluate
from bodycam_ros.evaluate.report_folder import write_report
from bodycam_ros.evaluate.station_panel import segment_table
from bodycam_ros.solved.solved_recording import read_solved

WORN = tuple(f"/{camera}/{topic}" for camera in ("waist", "shin") for topic in ("landmarks", "tracks"))
UNSEEN = range(20, 30)


def test_static_cameras_alone_are_evaluated(walk: Walk, truth: Path, tmp_path: Path) -> None:
    more = [*said(walk, "door", UNSEEN), *said(walk, "window", range(25, 35))]
    evaluation = evaluate(write_solved(walk, tmp_path / "out", leave_out=WORN, more=more), truth)
    assert not evaluation.cameras and evaluation.image_coverage == 1.0 and not evaluation.gaps
    assert np.flatnonzero(evaluation.blind).tolist() == [25, 26, 27, 28, 29]  # neither of them sees it
    write_report(evaluation, tmp_path / "report")
    figures = json.loads((tmp_path / "report" / "summary.json").read_text())
    assert figures["stations"]["door"] == {
        "images": FRAMES,
        "seen": pytest.approx(1.0 - len(UNSEEN) / FRAMES),
        "segments": pytest.approx(2.0 - 2.0 * len(UNSEEN) / FRAMES),
        "confidence": pytest.approx(0.5 - 0.5 * len(UNSEEN) / FRAMES),
    }
    assert figures["truth"]["position_cm"]["mean"] < 1e-6
    assert cv2.imread(str(tmp_path / "report" / "summary.png")) is not None


def test_the_strip_shows_when_a_static_camera_sees_nothing(walk: Walk, tmp_path: Path) -> None:
    more = said(walk, "door", UNSEEN)
    solved = read_solved(write_solved(walk, tmp_path / "out", leave_out=WORN, more=more))
    assert np.flatnonzero(segment_table(solved, 900)[0] == 0).tolist() == list(UNSEEN)
    assert segment_table(solved, 6)[0].tolist() == [2, 2, 0, 2, 2, 2]


def test_static_cameras_fill_what_worn_ones_do_not_see(walk: Walk, tmp_path: Path) -> None:
    shin_alone = WORN[:2]  # which is lost in four images
    blind = [
        int(evaluate(write_solved(walk, tmp_path / name, leave_out=shin_alone, more=more)).blind.sum())
        for name, more in (("worn", []), ("both", said(walk, "door")))
    ]
    assert blind == [4, 0]


def test_a_bag_without_any_camera_is_refused(walk: Walk, tmp_path: Path) -> None:
    with pytest.raises(RecordingError, match="no topic /<camera>/landmarks"):
        read_solved(write_solved(walk, tmp_path / "out", leave_out=WORN))
