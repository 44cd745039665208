"""``bodycam doctor`` on real recordings: the sample, whole and with faults, the range of motion, videos."""

import json
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
import yaml
from helpers.altered_sample import write_altered_sample
from helpers.made_video import make_video, write_lens

from bodycam_ros.cli.main import main
from bodycam_ros.ingest.ingest_camera import find_cameras
from bodycam_ros.messages.factory import Message


def doctor(capsys: pytest.CaptureFixture[str], *arguments: str | Path) -> tuple[int, dict[str, Any]]:
    code = main(["doctor", *map(str, arguments), "--json"])
    return code, json.loads(capsys.readouterr().out)


def problems(report: dict[str, Any]) -> set[tuple[str, str, str]]:
    """Check, level and subject of all that is not good."""
    return {(f["check"], f["level"], f["subject"]) for f in report["findings"] if f["level"] != "good"}


def dimmed(message: Message) -> Message:
    grey = cv2.imdecode(np.asarray(message.data), cv2.IMREAD_GRAYSCALE)
    message.data = cv2.imencode(".jpg", (0.05 * grey).astype(np.uint8))[1].reshape(-1)
    return message


def test_a_good_recording_is_good(capsys: pytest.CaptureFixture[str], sample: Path, tmp_path: Path) -> None:
    bag = write_altered_sample(sample, tmp_path / "bag", frames=30)
    code, report = doctor(capsys, bag, "--map", sample / "map")
    assert (code, report["level"], problems(report)) == (0, "good", set())
    checks = {f["check"] for f in report["findings"]}
    assert checks == {"cameras", "rate", "gaps", "span", "clocks", "lens", "exposure", "blur", "features", "registered"}


def test_every_fault_is_named_and_the_exit_code_says_so(
    capsys: pytest.CaptureFixture[str], sample: Path, tmp_path: Path
) -> None:
    def alter(topic: str, number: int, message: Message) -> Message | None:
        if topic == "/torso_front/image_raw/compressed":
            return dimmed(message)
        if topic == "/waist_front/camera_info":
            message.width = 1280
        return None if topic.startswith("/thigh_left/image") and 5 <= number < 42 else message

    bag = write_altered_sample(sample, tmp_path / "bag", alter, frames=60)
    code, report = doctor(capsys, bag, "--body", sample / "body.yaml")
    assert (code, report["level"]) == (3, "wrong")
    assert {
        ("exposure", "wrong", "torso_front"),
        ("lens", "wrong", "waist_front"),
        ("gaps", "wrong", "thigh_left"),
        ("cameras", "wrong", "head"),
    } <= problems(report)


def test_a_range_of_motion_is_judged_by_its_rig(capsys: pytest.CaptureFixture[str], sample: Path) -> None:
    rom = sample / "rom"
    flags = ("--map", sample / "map", "--rig", rom / "rig.yaml")
    code, report = doctor(capsys, rom / "bag", *flags)
    assert code == 0
    assert {"N-pose", "exercise"} <= {f["check"] for f in report["findings"]}
    assert not {p for p in problems(report) if p[0] != "exercise"}


def test_exchanged_cameras_are_wrong_in_a_range_of_motion(
    capsys: pytest.CaptureFixture[str], sample: Path, tmp_path: Path
) -> None:
    rom, other = sample / "rom", {"thigh_left": "thigh_right", "thigh_right": "thigh_left"}
    given = yaml.safe_load((rom / "rig.yaml").read_text())
    cameras = {camera: other.get(segment, segment) for camera, segment in given["cameras"].items()}
    rig = tmp_path / "rig.yaml"
    rig.write_text(yaml.safe_dump({**given, "cameras": cameras}))
    code, report = doctor(capsys, rom / "bag", "--map", sample / "map", "--rig", rig)
    assert code == 3
    (found,) = [finding for finding in report["findings"] if finding["check"] == "rig"]
    assert found["level"] == "wrong" and "cameras are exchanged" in found["what"]


def test_videos_are_looked_at_before_they_are_ingested(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    for camera in ("head", "foot", "shin"):
        make_video(tmp_path / f"{camera}.mp4", frames=60)
        if camera != "head":
            write_lens(tmp_path / f"{camera}.yaml")
    code, report = doctor(capsys, tmp_path)
    assert code == 3  # without a lens
    assert {("lens", "wrong", "head"), ("clocks", "doubtful", "foot")} <= problems(report)
    assert not {p for p in problems(report) if p[0] in ("cameras", "rate", "gaps")}


def test_a_video_that_ingest_leaves_out_is_wrong_for_the_same_reason(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    for camera in ("head", "foot", "2nd-knee"):
        make_video(tmp_path / f"{camera}.mp4")
        write_lens(tmp_path / f"{camera}.yaml")
    _, causes = find_cameras([tmp_path], None)
    code, report = doctor(capsys, tmp_path)
    assert code == 3 and "2nd-knee.mp4" in causes["2nd-knee"]
    wrong = [finding for finding in report["findings"] if finding["check"] == "cameras" and finding["level"] == "wrong"]
    assert [(each["subject"], each["what"]) for each in wrong] == [("2nd-knee", f"left out: {causes['2nd-knee']}")]


def test_a_single_video_is_looked_at(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    for camera in ("head", "foot"):
        make_video(tmp_path / f"{camera}.mp4")
    _, report = doctor(capsys, tmp_path / "head.mp4")
    assert {of for _, _, of in problems(report) if of} == {"head"}


def test_people_read_a_line_for_each_check(capsys: pytest.CaptureFixture[str], tiny_bag: Path) -> None:
    assert main(["doctor", str(tiny_bag)]) == 3
    out = capsys.readouterr().out
    assert "features" in out and "turn it away from bare walls" in " ".join(out.split())
    assert "not checked: share of registered images (needs --map)" in out
    assert out.rstrip().endswith("wrong: correct what is marked as wrong above, then record again")


@pytest.mark.parametrize("flag", ["--map", "--body", "--rig", "--board"])
def test_what_cannot_be_read_is_an_error_with_its_name(
    capsys: pytest.CaptureFixture[str], tiny_bag: Path, tmp_path: Path, flag: str
) -> None:
    missing = tmp_path / "nowhere"
    assert main(["doctor", str(tiny_bag), flag, str(missing)]) == 1
    assert f"bodycam: error: {missing}" in capsys.readouterr().err


@pytest.mark.parametrize("flag", ["--rate", "--lenses", "--prefix"])
def test_what_the_recording_has_no_use_for_is_refused(
    capsys: pytest.CaptureFixture[str], tiny_bag: Path, tmp_path: Path, flag: str
) -> None:
    (tmp_path / "videos").mkdir()
    recording = tmp_path / "videos" if flag == "--prefix" else tiny_bag
    value = {"--rate": "30", "--lenses": str(tmp_path), "--prefix": "/anna"}[flag]
    assert main(["doctor", str(recording), flag, value]) == 1
    assert flag in capsys.readouterr().err


def test_no_recording_is_an_error(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    assert main(["doctor", str(tmp_path / "nowhere")]) == 1
    assert "does not exist" in capsys.readouterr().err


def test_a_part_is_checked_alone(capsys: pytest.CaptureFixture[str], sample: Path, tmp_path: Path) -> None:
    """A camera that stops at half of the time is no fault of the first half."""

    def stopped(topic: str, number: int, message: Message) -> Message | None:
        return None if topic.startswith("/thigh_left/image") and number >= 20 else message

    bag = write_altered_sample(sample, tmp_path / "bag", stopped, frames=60)
    assert "thigh_left" in " ".join(str(problem) for problem in problems(doctor(capsys, bag)[1]))
    code, report = doctor(capsys, bag, "--to", "0.6")
    assert (code, problems(report)) == (0, set())
    assert main(["doctor", str(bag), "--from", "50"]) == 1
    assert "there is no image from 50 s to the end; the recording lasts 2.0 s" in capsys.readouterr().err
