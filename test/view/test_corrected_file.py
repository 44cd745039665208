"""Writing a corrected body: whole or not at all, with a note, and with what was there kept."""

from pathlib import Path

import numpy as np
import pytest
import yaml

from bodycam_ros.body.body_file import read_body
from bodycam_ros.errors import BodyError, OutputError
from bodycam_ros.view.correction import BodyFile, Correction, Move, Part

KNEE, HEAD = Part("joint", "knee_left"), Part("camera", "head")
MOVE = Move(np.array([1.0, 0.0, -3.0]), np.array([0.0, 0.5, 0.0]))
SHIFT = Move(np.array([1.0, 0.0, -3.0]), np.zeros(3))


def test_a_write_corrects_the_file_notes_it_and_keeps_the_file_that_was_there(body_file: Path) -> None:
    before = body_file.read_bytes()
    report = dict(read_body(body_file).report)
    file = BodyFile(body_file)
    written = file.write(Correction(file.read()).moved_by(KNEE, SHIFT).moved_by(HEAD, MOVE))
    assert file.original_path.read_bytes() == before
    assert file.original_path.name == "body.yaml.orig"
    again = read_body(body_file)
    assert again.report == written.report
    assert {key: again.report[key] for key in report} == report
    assert again.report["corrections"] == [
        {"camera": "head", "moved_mm": [1.0, 0.0, -3.0], "turned_deg": [0.0, 0.5, 0.0]},
        {"joint": "knee_left", "moved_mm": [1.0, 0.0, -3.0], "turned_deg": [0.0, 0.0, 0.0]},
    ]
    was = yaml.safe_load(before)["joints"]["knee_left"]["origin_in_parent"]
    now = yaml.safe_load(body_file.read_text())["joints"]["knee_left"]["origin_in_parent"]
    assert np.subtract(now, was) == pytest.approx([0.001, 0.0, -0.003], abs=2e-9)


def test_later_writes_add_to_the_notes_and_leave_the_original_alone(body_file: Path) -> None:
    before = body_file.read_bytes()
    file = BodyFile(body_file)
    once = file.write(Correction(file.read()).moved_by(KNEE, SHIFT))
    assert not list(Correction(once).moves())
    file.write(Correction(once).moved_by(KNEE, SHIFT))
    assert [note["joint"] for note in read_body(body_file).report["corrections"]] == ["knee_left"] * 2
    assert file.original_path.read_bytes() == before


def test_a_file_that_somebody_else_changed_is_not_replaced(body_file: Path) -> None:
    file = BodyFile(body_file)
    correction = Correction(file.read()).moved_by(KNEE, SHIFT)
    body_file.write_text(body_file.read_text() + "# measured again\n")
    changed = body_file.read_bytes()
    with pytest.raises(BodyError, match=r"body\.yaml: changed since it was read"):
        file.write(correction)
    assert body_file.read_bytes() == changed
    assert sorted(path.name for path in body_file.parent.iterdir()) == ["body.yaml"]


def test_a_failed_write_leaves_the_file_whole(body_file: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    before = body_file.read_bytes()
    file = BodyFile(body_file)
    correction = Correction(file.read()).moved_by(KNEE, SHIFT)

    def full_disk(self: Path, target: Path) -> Path:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(Path, "replace", full_disk)
    with pytest.raises(OutputError, match="No space left"):
        file.write(correction)
    assert body_file.read_bytes() == before
    assert sorted(path.name for path in body_file.parent.iterdir()) == ["body.yaml"]


def test_a_missing_file_is_named(tmp_path: Path) -> None:
    with pytest.raises(BodyError, match=r"none\.yaml: cannot read"):
        BodyFile(tmp_path / "none.yaml").read()
