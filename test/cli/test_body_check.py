"""bodycam body check as a user calls it."""

from pathlib import Path

import pytest

from bodycam_ros.cli.main import main
from bodycam_ros.equipment.equipment_yaml import read_equipment

BODY = str(Path(__file__).parents[2] / "bags" / "body.yaml")
BOARD = """
name: board
root: board
segments: {board: {}}
attachments:
  left: {body: foot_left, equipment: board, weight: 3, points: [
    {body: [180, 40, -85], equipment: [180, 140, 0]}, {body: [180, -40, -85], equipment: [180, 60, 0]},
    {body: [-50, 0, -85], equipment: [-50, 100, 0]}]}
  right: {body: foot_right, equipment: board, weight: 3, points: [
    {body: [180, 40, -85], equipment: [180, RIGHT, 0]}, {body: [-50, 0, -85], equipment: [-50, RIGHT, 0]}]}
"""


def board(folder: Path, right_mm: int) -> str:
    path = folder / "board.yaml"
    path.write_text(BOARD.replace("RIGHT", str(right_mm)))
    return str(path)


def check(capsys: pytest.CaptureFixture[str], *arguments: str) -> tuple[int, str]:
    code = main(["body", "check", *arguments])
    captured = capsys.readouterr()
    return code, " ".join((captured.out + captured.err).split())


def test_a_body_alone_is_counted(capsys: pytest.CaptureFixture[str]) -> None:
    code, said = check(capsys, BODY)
    assert code == 0
    assert "6 x 13 segments - 36 that the joints hold = 42 freedoms" in said
    assert "in truth: 42 freedoms, 6 of them of all together" in said
    assert "verdict: everything can be held together" in said


def test_a_board_takes_freedoms_and_says_in_words_what_is_left(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    code, said = check(capsys, BODY, "--equipment", board(tmp_path, -100))
    assert code == 0
    # Three points weld a foot, six rows; two let it turn about their line, five.
    assert "6 x 14 segments - 47 that the joints hold = 37 freedoms" in said
    assert "loops and ground: 11 rows, 11 of them independent; along motions 11" in said
    assert "else, within the loops 13" in said
    assert "each on its own 18 spine, neck, shoulder_left" in said


def test_what_contradicts_is_named_and_the_exit_code_says_so(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    code, said = check(capsys, BODY, "--equipment", board(tmp_path, -4000))
    assert code == 3
    (name,) = {"left", "right"} & set(said.split("contradicts: ")[1].split(" stays ")[:1])
    assert " mm apart" in said and "while all else is held; it holds without " in said
    assert f"verdict: cannot be held together; measure the points of {name} again" in said


def test_supplied_equipment_is_known_by_name(capsys: pytest.CaptureFixture[str]) -> None:
    code, said = check(capsys, BODY, "--equipment", "snowboard")
    assert code == 0
    assert f"subject with {read_equipment('snowboard').name}" in said
    code, said = check(capsys, BODY, "--equipment", "skis")
    assert code == 1 and "skis" in said and "snowboard" in said


def test_what_is_not_a_body_is_an_error_with_its_name(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    missing = tmp_path / "nobody.yaml"
    code, said = check(capsys, str(missing))
    assert code == 1 and "nobody.yaml" in said


def test_the_command_of_one_word_is_still_there(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as ended:
        main(["body", "--help"])
    assert ended.value.code == 0
    assert "--rig" in capsys.readouterr().out
    with pytest.raises(SystemExit):
        main(["body", "check", "--help"])
    assert "--equipment" in capsys.readouterr().out
