"""bodycam body check as a user calls it."""

from pathlib import Path

import pytest
import yaml

from bodycam_ros.body.equipment_yaml import equipment_path, read_equipment, supplied_equipment
from bodycam_ros.cli.main import main

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
    {body: [180, 40, -85], equipment: [180, -100, 0]}, {body: [-50, 0, -85], equipment: [-50, -100, 0]}]}
"""


def board(folder: Path) -> str:
    path = folder / "board.yaml"
    path.write_text(BOARD)
    return str(path)


def check(capsys: pytest.CaptureFixture[str], *arguments: str) -> tuple[int, str]:
    code = main(["body", "check", *arguments])
    captured = capsys.readouterr()
    return code, " ".join((captured.out + captured.err).split())


def test_a_body_alone_is_counted(capsys: pytest.CaptureFixture[str]) -> None:
    code, said = check(capsys, BODY)
    assert code == 0
    assert "6 x 13 segments - 36 constraints of joints = 42 degrees of freedom" in said
    assert "by rank: 42 degrees of freedom, 6 of them as a whole" in said
    assert "verdict: all constraints can be satisfied" in said


def test_a_board_takes_freedoms(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    code, said = check(capsys, BODY, "--equipment", board(tmp_path))
    assert code == 0
    # Three points weld a foot, six rows; two let it turn about their line, five.
    assert "6 x 14 segments - 47 constraints of joints = 37 degrees of freedom" in said
    assert "loops and ground: 11 rows, 11 of them independent" in said


def test_equipment_that_is_not_supplied_is_an_error_that_says_what_is(capsys: pytest.CaptureFixture[str]) -> None:
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
    said = " ".join(capsys.readouterr().out.split())
    assert "--equipment" in said and all(name in said for name in supplied_equipment())
    assert "3 if not" in said


def reaching(folder: Path, bar_mm: int, *, saddle: bool = True) -> str:
    """The supplied bicycle with its bar so far in front of the crank, with or without a saddle."""
    document = yaml.safe_load(equipment_path("bicycle").read_text())
    for name in ("hand_left", "hand_right"):
        for point in document["attachments"][name]["points"]:
            point["equipment"][0] = bar_mm
    if not saddle:
        del document["attachments"]["saddle"]
    path = folder / "bicycle.yaml"
    path.write_text(yaml.safe_dump(document))
    return str(path)


@pytest.mark.long
@pytest.mark.parametrize(("bar_mm", "saddle"), [(1600, True), (2000, True), (3400, False)])
def test_a_bar_out_of_reach_is_not_held_by_arms_and_lengths_that_nobody_has(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, bar_mm: int, saddle: bool
) -> None:
    code, said = check(capsys, BODY, "--equipment", reaching(tmp_path, bar_mm, saddle=saddle))
    assert code == 3
    named = {part.split(" stays ")[0] for part in said.split("conflict: ")[1:]}
    # Where the bar is, is unknown to 150 mm, so that 1500 mm are still reached from the saddle.
    # Leaning forward as far as can be, one lets go of the saddle; further away than that, of the bar.
    assert named == ({"saddle"} if saddle else {"hand_left", "hand_right"})
    assert " mm apart" in said and " while all other constraints hold" in said
    assert f"or leave {', '.join(sorted(named))} out" in said


@pytest.mark.parametrize("name", supplied_equipment())
def test_all_supplied_equipment_is_held_by_the_body_of_the_sample(
    capsys: pytest.CaptureFixture[str], name: str
) -> None:
    code, said = check(capsys, BODY, "--equipment", name)
    assert code == 0, said
    assert f"subject with {read_equipment(name).name}" in said
    assert "verdict: all constraints can be satisfied" in said
