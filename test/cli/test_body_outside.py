"""bodycam body with static cameras: a painted person in a bag, and what a user may have got wrong."""

from collections.abc import Sequence
from pathlib import Path

import pytest
import yaml
from helpers.shared_by_workers import made_once
from static_cameras.painted_bag import FRAMES, dressed_body, write_painted

from bodycam_ros.body.body_file import read_body
from bodycam_ros.cli.main import main


@pytest.fixture(scope="module")
def painted(sample: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Folder of a bag, ``cameras.yaml`` and ``start.yaml``."""
    return made_once(tmp_path_factory, "painted", lambda folder: write_painted(dressed_body(sample), folder))


def run(painted: Path, out: Path, *flags: object) -> int:
    return main(["body", str(painted / "bag"), "-o", str(out), *map(str, flags)])


def stationed(painted: Path) -> list[object]:
    return ["--stations", painted / "cameras.yaml", "--start", painted / "start.yaml"]


def test_a_body_is_measured_and_its_file_says_how_well(
    sample: Path, painted: Path, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    """From a body that wears cameras: these, its limits and its name stay; it gets hands."""
    out = tmp_path / "jo.yaml"
    flags = ["--initial-body", sample / "body.yaml"]
    assert run(painted, out, *stationed(painted), *flags) == 0
    printed = " ".join(capfd.readouterr().out.split())
    before, body = read_body(sample / "body.yaml"), read_body(out)
    assert body.name == "jo" and set(body.mounts) == set(before.mounts)
    assert body.segments == (*before.segments, "hand_left", "hand_right")
    assert set(body.girths) == set(body.segments)
    report = yaml.safe_load(out.read_text())["report"]
    assert report["source"] == "static cameras" and 0 < report["instants"] <= FRAMES and report["rounds"] >= 1
    for joint in before.joints:
        if joint.name in ("knee_left", "elbow_right"):
            after = next(other for other in body.joints if other.name == joint.name)
            said = report["lengths"][f"{joint.name}_z"]
            assert said["initial"] == pytest.approx(joint.parent_T_joint[2, 3], abs=1e-4)
            assert said["found"] == pytest.approx(after.parent_T_joint[2, 3], abs=1e-4)
            assert after.parent_T_joint[2, 3] == pytest.approx(joint.parent_T_joint[2, 3], rel=0.06)
            assert after.limits == joint.limits
    assert not report["lengths"]["spine_z"]["is_measured"]
    assert "does not measure the lengths at" in printed and "spine" in printed
    assert "knee_left" in printed and f"body written to {out}" in printed.replace("\n", "")
    assert run(painted, out, *stationed(painted), *flags) == 1
    assert "--force" in capfd.readouterr().err


@pytest.mark.parametrize(
    ("flags", "complaint"),
    [
        ([], "a body is measured by body cameras, with --map and --rig, or by static ones"),
        (["--height", "1.8"], "--height needs --stations"),
        (["--start", "start.yaml"], "--start needs --stations"),
        (["--initial-body", "body.yaml"], "--initial-body needs --stations"),
        (["STATIONS"], "give --height in metres, or --initial-body BODY"),
        (["STATIONS", "--height", "178"], "178 m is no person's height"),
        (["STATIONS", "--initial-body", "nobody.yaml"], "nobody.yaml"),
        (["STATIONS", "--height", "1.8", "--rig", "rig.yaml"], "--rig is for body cameras"),
        (["STATIONS", "--height", "1.8", "--facing", "90"], "--facing is for body cameras"),
        (["--stations", "CAMERAS", "--height", "1.8"], "give the file that it writes with --start"),
        (["--stations", "none.yaml", "--start", "START", "--height", "1.8"], "none.yaml"),
        (["--stations", "CAMERAS", "--start", "CAMERAS", "--height", "1.8"], "places no segment of body"),
    ],
)
def test_what_cannot_be_is_said_in_one_line(
    painted: Path, tmp_path: Path, capfd: pytest.CaptureFixture[str], flags: Sequence[str], complaint: str
) -> None:
    files: dict[str, list[object]] = {
        "STATIONS": stationed(painted),
        "CAMERAS": [painted / "cameras.yaml"],
        "START": [painted / "start.yaml"],
    }
    given = [each for flag in flags for each in files.get(flag, [flag])]
    assert run(painted, tmp_path / "jo.yaml", *given) == 1
    errors = capfd.readouterr().err
    assert complaint in " ".join(errors.split("bodycam: error:")[1].split()) and "Traceback" not in errors
    assert not list(tmp_path.iterdir())


def test_it_takes_an_output_that_is_a_body_and_no_input(
    painted: Path, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    assert run(painted, tmp_path / "jo.urdf", *stationed(painted), "--height", 1.8) == 1
    assert "a body is a YAML file" in " ".join(capfd.readouterr().err.split())
    before = (painted / "start.yaml").read_bytes()
    assert run(painted, painted / "start.yaml", *stationed(painted), "--height", 1.8, "--force") == 1
    assert "is what this command reads" in " ".join(capfd.readouterr().err.split())
    assert (painted / "start.yaml").read_bytes() == before
