"""A replay with equipment: what it writes, and a camera that sits on the equipment instead of the body."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from helpers.altered_sample import write_altered_sample

from bodycam_ros.body.body_file import read_body, write_body
from bodycam_ros.cli.main import main
from bodycam_ros.geometry import Array, quaternion_xyzw
from bodycam_ros.recording.bag_file import BagFile
from bodycam_ros.results.solved_recording import SolvedRecording, read_solved

PLATE = """
name: plate
root: plate
segments: {{plate: {{}}}}
attachments:
  strapped:
    body: thigh_left
    equipment: plate
    weight: 1
    points:
      - {{body: [0, 80, -100], equipment: [0, 0, 100]}}
      - {{body: [0, 80, -300], equipment: [0, 0, -100]}}
      - {{body: [60, 80, -200], equipment: [60, 0, 0]}}
  held: {{body: hand_left, equipment: plate, weight: 40, optional: true,
    points: [{{body: [0, 0, 0], equipment: [0, 0, 0]}}]}}
cameras:
  thigh_left: {{segment: plate, position: {position}, quaternion_xyzw: {quaternion}}}
"""
"""A plate on the thigh, its middle 80 mm beside the thigh's axis and 200 mm below the hip; all axes are the thigh's."""

IN_THIGH = np.array([0.0, 0.08, -0.2])


@pytest.fixture(scope="module")
def bag(sample: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_altered_sample(sample, tmp_path_factory.mktemp("short") / "bag")


def replayed(sample: Path, bag: Path, out: Path, body: Path, *more: str) -> SolvedRecording:
    arguments = [str(bag), "--map", str(sample / "map"), "--body", str(body), "-o", str(out), "--jobs", "1", *more]
    assert main(["replay", *arguments]) == 0
    return read_solved(out)


def thigh(solved: SolvedRecording) -> Array:
    return solved.world_T_link["thigh_left"]


def test_a_camera_of_the_equipment_holds_the_limb_that_it_is_strapped_to(
    sample: Path, bag: Path, tmp_path: Path, capfd: pytest.CaptureFixture[str], caplog: pytest.LogCaptureFixture
) -> None:
    body = read_body(sample / "body.yaml")
    mount = body.mounts["thigh_left"].segment_T_camera
    written = PLATE.format(
        position=(mount[:3, 3] - IN_THIGH).tolist(), quaternion=quaternion_xyzw(mount[:3, :3]).tolist()
    )
    (tmp_path / "plate.yaml").write_text(written)
    bare = replace(body, mounts={c: m for c, m in body.mounts.items() if c != "thigh_left"})
    write_body(bare, tmp_path / "bare.yaml")

    worn = replayed(sample, bag, tmp_path / "worn", sample / "body.yaml")
    capfd.readouterr()
    plate = replayed(
        sample, bag, tmp_path / "plate", tmp_path / "bare.yaml", "--equipment", str(tmp_path / "plate.yaml")
    )
    printed = capfd.readouterr()
    assert caplog.text.count("not used, since body subject does not have their segments: held (to hand_left)") == 1
    assert "equipment plate" in printed.out and "strapped" in printed.out
    assert [record.camera for record in plate.cameras] == [record.camera for record in worn.cameras]
    assert plate.parents["plate"] == "pelvis"

    said = plate.equipment
    assert said is not None and (said.name, said.attachments) == ("plate", ("strapped",))
    np.testing.assert_array_equal(said.stamps_ns, plate.stamps_ns)
    assert said.held.all() and said.deviations.max() < 2e-3
    off_m = np.linalg.norm((thigh(plate) - thigh(worn))[:, :3, 3], axis=1)
    assert off_m.max() < 5e-3
    turned = np.swapaxes(thigh(worn)[:, :3, :3], 1, 2) @ thigh(plate)[:, :3, :3]
    assert np.degrees(np.arccos((np.trace(turned, axis1=1, axis2=2) - 1.0) / 2.0)).max() < 1.0
    on_thigh = np.swapaxes(thigh(plate)[:, :3, :3], 1, 2) @ (plate.world_T_link["plate"] - thigh(plate))[:, :3, 3:]
    np.testing.assert_allclose(on_thigh[:, :, 0], np.tile(IN_THIGH, (len(on_thigh), 1)), atol=2e-3)


def test_without_equipment_there_is_no_such_topic(sample: Path, bag: Path, tmp_path: Path) -> None:
    assert replayed(sample, bag, tmp_path / "out", sample / "body.yaml").equipment is None
    with BagFile(tmp_path / "out") as opened:
        assert "/equipment" not in opened.topics


@pytest.mark.parametrize(
    ("given", "text", "complaint"),
    [
        ("unicycle", None, "equipment unicycle: none of that name is supplied; did you mean bicycle?"),
        ("trampoline", None, "equipment trampoline: none of that name is supplied; there are barbell, bicycle,"),
        ("mine.yaml", None, "mine.yaml: cannot read this equipment file: No such file"),
        ("mine.yaml", "name: mine", "mine.yaml: an equipment file: table missing required field root"),
        (
            "mine.yaml",
            "{name: m, root: r, segments: {r: {}}, attachments: {a: {body: tail, equipment: r, weight: 9, points: "
            "[{body: [0, 0, 0], equipment: [0, 0, 0]}]}}}",
            "mine.yaml: equipment m: attachment a is to segment tail, which body subject does not have; it has pelvis",
        ),
    ],
)
def test_what_is_no_equipment_of_this_body_is_refused(
    sample: Path,
    bag: Path,
    tmp_path: Path,
    capfd: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
    given: str,
    text: str | None,
    complaint: str,
) -> None:
    monkeypatch.chdir(tmp_path)
    if text:
        Path(given).write_text(text)
    inputs = [str(bag), "--map", str(sample / "map"), "--body", str(sample / "body.yaml"), "--equipment", given]
    assert main(["replay", *inputs, "-o", "out", "--jobs", "1"]) == 1
    errors = capfd.readouterr().err
    assert complaint in " ".join(errors.split()) and "Traceback" not in errors
    assert not Path("out").exists()


def test_the_output_is_not_written_over_the_equipment(
    sample: Path, bag: Path, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    mine = tmp_path / "mine.yaml"
    mine.write_text("name: mine")
    inputs = [str(bag), "--map", str(sample / "map"), "--body", str(sample / "body.yaml"), "--equipment", str(mine)]
    assert main(["replay", *inputs, "-o", str(mine), "--force", "--jobs", "1"]) == 1
    assert mine.read_text() == "name: mine"
    assert "mine.yaml" in capfd.readouterr().err
