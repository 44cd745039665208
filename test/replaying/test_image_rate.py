"""Fewer images a second than were recorded."""

import dataclasses
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from helpers.altered_sample import CAMERAS, write_altered_sample

from bodycam_ros.cli.main import main
from bodycam_ros.results.solved_recording import read_solved
from bodycam_ros.tracking.image_rate import ImageRateLimit


def test_a_replay_uses_as_many_images_as_it_is_asked_to(
    sample: Path, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    bag = write_altered_sample(sample, tmp_path / "bag")
    given = ["replay", str(bag), "--map", str(sample / "map"), "--body", str(sample / "body.yaml"), "-o"]
    assert main([*given, str(tmp_path / "all")]) == 0
    assert "not wanted" not in capfd.readouterr().out.split("camera ")[1].split("frames solved")[0]
    for jobs in ("1", "2"):
        flags = ["--images.max_rate", "15", "--jobs", jobs, "--force"]
        assert main([*given, str(tmp_path / "half"), *flags]) == 0
        rows = [line.split() for line in capfd.readouterr().out.splitlines() if line.split()[:1] and "%" in line]
        assert [row[:4] for row in rows[: len(CAMERAS)]] == [[each, "4", "100.0%", "4"] for each in sorted(CAMERAS)]
    whole, half = (read_solved(tmp_path / name) for name in ("all", "half"))
    assert np.array_equal(half.stamps_ns, whole.stamps_ns[::2])
    for link in ("pelvis", "torso", "thigh_left"):  # that carry the cameras
        apart_m = np.abs(half.world_T_link[link] - whole.world_T_link[link][::2])[:, :3, 3]
        assert apart_m.max() < 0.003, link


@pytest.mark.parametrize("begin", range(8))
@pytest.mark.parametrize("recorded_hz, asked_hz, used", [(30, 0, 300), (60, 30, 300), (50, 30, 300), (25, 30, 250)])
def test_cameras_of_one_trigger_leave_out_the_same_images(
    begin: int, recorded_hz: int, asked_hz: float, used: int
) -> None:
    jitter_s = np.random.default_rng(1).normal(0.0, 2e-4, (2, 10 * recorded_hz))
    stamps_ns = np.rint(
        1e9 * (1_000_000.0 + 0.0042 * begin + np.arange(10 * recorded_hz) / recorded_hz + jitter_s)
    ).astype(np.int64)
    limit = ImageRateLimit(asked_hz)
    left, right = ([limit.is_due(camera, int(ns)) for ns in row] for camera, row in zip("lr", stamps_ns, strict=True))
    assert left == right
    assert abs(sum(left) - used) <= 1
    assert limit.left_out == {camera: left.count(False) for camera in "lr" if False in left}


def test_the_next_image_stands_in_for_one_that_cannot_be_decoded(
    sample: Path, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    def alter(topic: str, number: int, message: Any) -> Any:
        is_damaged = topic == "/waist_front/image_raw/compressed" and number == 2
        return dataclasses.replace(message, data=np.frombuffer(b"no picture", np.uint8)) if is_damaged else message

    bag = write_altered_sample(sample, tmp_path / "bag", alter)
    given = ["replay", str(bag), "--map", str(sample / "map"), "--body", str(sample / "body.yaml"), "--jobs", "1"]
    assert main([*given, "--images.max_rate", "15", "-o", str(tmp_path / "half")]) == 0
    row = next(line.split() for line in capfd.readouterr().out.splitlines() if line.split()[:1] == ["waist_front"])
    assert row[:5] == ["waist_front", "5", "80.0%", "1", "3"]  # the third image is dropped, the fourth used for it
