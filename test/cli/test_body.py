"""bodycam body on a real range of motion: four cameras of a recording, in real processes."""

import os
import signal
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import yaml

from bodycam_ros.body.body_file import read_body
from bodycam_ros.registration.reference_map import ReferenceMap

THIGH_M, HIPS_M = 0.4257, 0.1906
"""Joints of the sample's subject, known from the program that moved it."""


def command(sample: Path, out: Path, *more: str | Path, bag: str = "rom") -> list[str]:
    return [
        *(sys.executable, "-m", "bodycam_ros.cli.main", "body", str(sample / bag / "bag")),
        *("--map", str(sample / "map"), "--rig", str(sample / bag / "rig.yaml"), "-o", str(out), *map(str, more)),
    ]


def run(sample: Path, out: Path, *more: str | Path, bag: str = "rom") -> "subprocess.CompletedProcess[str]":
    return subprocess.run(command(sample, out, *more, bag=bag), capture_output=True, text=True)


@pytest.fixture(scope="module")
def made(sample: Path, tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, str]:
    """The body file, and what was printed."""
    out = tmp_path_factory.mktemp("body") / "legs.yaml"
    done = run(sample, out)
    assert done.returncode == 0, done.stderr
    return out, done.stdout


def test_the_body_is_right(made: tuple[Path, str]) -> None:
    body = read_body(made[0])
    assert (body.name, body.root) == ("legs", "pelvis")
    offsets = {joint.name: joint.parent_T_joint[:3, 3] for joint in body.joints}
    assert np.linalg.norm(offsets["knee_left"]) == pytest.approx(THIGH_M, abs=0.008)
    assert np.linalg.norm(offsets["hip_left"] - offsets["hip_right"]) == pytest.approx(HIPS_M, abs=0.012)
    np.testing.assert_allclose(offsets["hip_left"], -offsets["hip_right"], atol=1e-9)
    knee = next(joint for joint in body.joints if joint.name == "knee_left")
    assert knee.limits is not None and knee.limits[0][1] > 1.5, "the knee was bent by 95 degrees"


def test_cameras_exchanged_in_the_rig_are_the_first_line(sample: Path, tmp_path: Path) -> None:
    rig = yaml.safe_load((sample / "rom" / "rig.yaml").read_text())
    cameras = rig["cameras"]
    cameras["thigh_left"], cameras["thigh_right"] = cameras["thigh_right"], cameras["thigh_left"]
    (tmp_path / "rig.yaml").write_text(yaml.safe_dump(rig))
    done = run(sample, tmp_path / "legs.yaml", "--rig", tmp_path / "rig.yaml")
    assert done.returncode == 3, done.stderr
    first = done.stdout.split("Mend the rig")[0]
    assert first.startswith("wrong: cameras thigh_left and thigh_right are exchanged")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["rig.yaml"]


def test_the_file_carries_the_figures(made: tuple[Path, str]) -> None:
    report = yaml.safe_load(made[0].read_text())["report"]
    assert report["source"] == "range of motion"
    assert report["joints"]["knee_left"]["freedom"] == "hinge"
    assert report["joints"]["hip_left"]["freedom"] == "ball"
    assert report["map"]["name"] == "map" and len(report["map"]["identity"]) == 16
    assert set(report["cameras"]) == {"waist_front", "thigh_left", "shin_left", "thigh_right"}


def test_a_person_reads_it_on_the_terminal_and_as_a_page(made: tuple[Path, str]) -> None:
    out, printed = made
    for word in ("hip_left", "knee_left", "hinge", "thigh_right"):
        assert word in printed
    page = out.with_suffix(".html").read_text()
    assert "knee_left" in page
    assert "data:image/png;base64," in page


def test_a_body_that_is_there_is_kept(sample: Path, made: tuple[Path, str]) -> None:
    before = made[0].read_bytes()
    done = run(sample, made[0])
    assert done.returncode == 1
    assert "--force" in done.stderr
    assert made[0].read_bytes() == before


def test_a_walk_is_no_range_of_motion(sample: Path, tmp_path: Path) -> None:
    out = tmp_path / "body.yaml"
    done = run(sample, out, "--rig", sample / "rom" / "rig.yaml", bag="sample")  # four cameras tell it as sixteen do
    assert done.returncode == 1
    assert "joint" in done.stderr and "Repeat it" in done.stderr
    assert "Traceback" not in done.stderr
    assert list(tmp_path.iterdir()) == []


def test_a_rig_of_other_cameras_is_refused(sample: Path, tmp_path: Path) -> None:
    rig = tmp_path / "rig.yaml"
    rig.write_text("cameras: {waist_front: pelvis, helmet: head}\nsegments: {pelvis: null, head: pelvis}\n")
    done = run(sample, tmp_path / "body.yaml", "--rig", rig)
    assert done.returncode == 1
    assert "camera helmet: is not in the recording" in done.stderr
    assert not (tmp_path / "body.yaml").exists()


def test_a_map_without_a_vertical_is_refused(sample: Path, tmp_path: Path) -> None:
    tilted = replace(ReferenceMap.load(sample / "map"), gravity_aligned=False)
    tilted.save(tmp_path / "map")
    done = run(sample, tmp_path / "body.yaml", "--map", tmp_path / "map")
    assert done.returncode == 1
    assert "the upward axis of this map is unknown" in done.stderr


def test_interrupting_leaves_nothing(sample: Path, tmp_path: Path) -> None:
    process = subprocess.Popen(
        command(sample, tmp_path / "body.yaml"), stderr=subprocess.PIPE, text=True, start_new_session=True
    )
    children = Path(f"/proc/{process.pid}/task/{process.pid}/children")
    deadline = time.monotonic() + 60
    while process.poll() is None and not children.read_text() and time.monotonic() < deadline:
        time.sleep(0.1)
    assert process.poll() is None and children.read_text(), "it never began to register"
    os.killpg(process.pid, signal.SIGINT)
    _, printed = process.communicate(timeout=60)
    assert process.returncode == 130
    assert "Traceback" not in printed
    assert list(tmp_path.iterdir()) == []
