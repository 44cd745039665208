"""Recordings that somebody has spoilt, through the real commands: what is wrong is said, and the exit code is 3."""

import json
import subprocess
import sys
from pathlib import Path

import cv2
import numpy as np
import pytest
from helpers.altered_sample import write_altered_sample

from bodycam_ros.evaluate.evaluation import evaluate
from bodycam_ros.messages.factory import Message
from bodycam_ros.recording.bag_file import BagFile
from bodycam_ros.results.verdict import Level

pytestmark = pytest.mark.long

LEFT_LEG = ("waist_front", "thigh_left", "shin_left", "foot_left")
ARMS = ("torso_front", "upper_arm_left", "forearm_left", "upper_arm_right", "forearm_right")
FRAMES = 51
WRONG_RESULT = 3


def bodycam(*arguments: object) -> "subprocess.CompletedProcess[str]":
    command = [sys.executable, "-m", "bodycam_ros.cli.main", *map(str, arguments)]
    return subprocess.run(command, capture_output=True, text=True, timeout=120, check=False)


def longer_lens(topic: str, number: int, message: Message) -> Message:
    """camera_info of one camera with fx and fy 20 % too long."""
    if topic == "/shin_left/camera_info":
        message.k = message.k * np.array([1.2, 1.0, 1.0, 1.0, 1.2, 1.0, 1.0, 1.0, 1.0])
    return message


@pytest.fixture(scope="module")
def wrong_lens(sample: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_altered_sample(sample, tmp_path_factory.mktemp("lens") / "bag", longer_lens, LEFT_LEG, FRAMES)


def test_mirrored_images_are_named_by_the_doctor(sample: Path, tmp_path: Path) -> None:
    def mirror(topic: str, number: int, message: Message) -> Message:
        if topic == "/shin_left/image_raw/compressed":
            image = cv2.imdecode(np.frombuffer(message.data, np.uint8), cv2.IMREAD_GRAYSCALE)
            message.data = cv2.imencode(".jpg", image[:, ::-1], [cv2.IMWRITE_JPEG_QUALITY, 95])[1].ravel()
        return message

    bag = write_altered_sample(sample, tmp_path / "bag", mirror, ("waist_front", "thigh_left", "shin_left"))
    checked = bodycam("doctor", bag, "--map", sample / "map", "--json")
    assert checked.returncode == WRONG_RESULT, checked.stderr
    wrong = [each for each in json.loads(checked.stdout)["findings"] if each["level"] == "wrong"]
    assert [(each["subject"], each["check"]) for each in wrong] == [("shin_left", "registered")], wrong
    assert "mirrored" in wrong[0]["what"]


def test_a_wrong_lens_is_named_by_replay_and_evaluate(sample: Path, wrong_lens: Path, tmp_path: Path) -> None:
    out, report = tmp_path / "out", tmp_path / "report"
    replayed = bodycam("replay", wrong_lens, "--map", sample / "map", "--body", sample / "body.yaml", "-o", out)
    assert replayed.returncode == WRONG_RESULT, replayed.stderr
    assert "verdict: wrong: do not use this result; shin_left" in replayed.stdout
    assert "its images do not fit its calibration" in replayed.stdout
    with BagFile(out) as bag:
        *_, (_, _, last) = bag.messages(["/diagnostics"])
    verdict = next(status for status in last.status if status.name == "verdict")
    assert (verdict.level, [value.key for value in verdict.values][0]) == (2, "shin_left")

    evaluated = bodycam("evaluate", out, "--recording", wrong_lens, "-o", report)
    assert evaluated.returncode == WRONG_RESULT, evaluated.stderr
    assert "verdict: wrong: do not use this result; shin_left" in evaluated.stdout
    verdict = json.loads((report / "summary.json").read_text())["verdict"]
    assert verdict["level"] == "wrong"
    assert [finding["subject"] for finding in verdict["findings"] if finding["level"] == "wrong"] == ["shin_left"]
    assert "its images do not fit its calibration" in verdict["findings"][0]["why"]


def test_exchanged_forearms_are_named(sample: Path, tmp_path: Path) -> None:
    names = {"forearm_left": "forearm_right", "forearm_right": "forearm_left"}
    bag = write_altered_sample(sample, tmp_path / "bag", cameras=ARMS, frames=FRAMES, names=names)
    replayed = bodycam("replay", bag, "--map", sample / "map", "--body", sample / "body.yaml", "-o", tmp_path / "out")
    assert replayed.returncode == WRONG_RESULT, replayed.stderr
    for camera, other in names.items():
        line = next(line for line in replayed.stdout.splitlines() if line.startswith(f"wrong: camera {camera}:"))
        assert f"its name is exchanged with {other}" in line


def test_the_sample_is_good(sample: Path, sample_out: Path) -> None:
    verdict = evaluate(sample_out, recording_path=sample / "sample" / "bag").verdict
    assert (verdict.level, verdict.findings) == (Level.GOOD, ())
