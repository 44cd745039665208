"""Whatever is given as output, every command leaves what it reads, and what it did not make, as it was."""

import shutil
from pathlib import Path

import pytest

from bodycam_ros.cli.main import main


@pytest.fixture
def house(sample: Path, tiny_bag: Path, tmp_path: Path) -> Path:
    """A recording, a map, photographs, a body and a rig, and things that no command made."""
    house = tmp_path / "house"
    house.mkdir()
    tiny_bag.rename(house / "walk")
    shutil.copytree(sample / "map", house / "map", ignore=shutil.ignore_patterns("sparse"))
    shutil.copytree(sample / "reference", house / "photographs", ignore=shutil.ignore_patterns("ref_01*"))
    shutil.copy(sample / "body.yaml", house / "body.yaml")
    shutil.copy(sample / "rom" / "rig.yaml", house / "rig.yaml")
    (house / "album").mkdir()
    (house / "album" / "dear.jpg").write_text("dear")
    (house / "album" / "metadata.yaml").write_text("album: 1")
    (house / "album" / "map.yaml").write_text("album: 1")
    (house / "album" / "summary.png").write_text("dear")
    (house / "thesis.yaml").write_text("ten years of work")
    (house / "thesis.html").write_text("<title>Thesis</title>")
    return house


REPLAY = "replay walk --map map --body body.yaml --force -o"
BODY = "body walk --map map --rig rig.yaml --force -o"
MAP = "map photographs --force -o"
EVALUATE = "evaluate walk --recording walk -o"
STATIONS = "stations walk --map map --force -o"
EXPORT = "export body.yaml --to urdf --force -o"


@pytest.mark.parametrize(
    ("command", "output", "told"),
    [
        (REPLAY, "walk", "walk: is what this command reads (walk)"),
        (REPLAY, "walk/walk.mcap", "lies within what this command reads"),
        (REPLAY, "map", "is what this command reads (map)"),
        (REPLAY, ".", "contains what this command reads"),
        (REPLAY, "body.yaml", "is what this command reads (body.yaml)"),
        (REPLAY, "album", "holds dear.jpg, which is no part of a bag that 'bodycam replay' wrote"),
        (REPLAY, "thesis.yaml", "is no folder"),
        (REPLAY, "/dev/null", "is no folder"),
        (BODY, "rig.yaml", "is what this command reads (rig.yaml)"),
        (BODY, "walk/body.yaml", "lies within what this command reads (walk)"),
        (BODY, "thesis.yaml", "thesis.yaml: is no body file, so --force does not replace it"),
        (BODY, "legs.html", "a body is a YAML file; give a name such as legs.yaml"),
        (BODY, "legs.urdf", "a body is a YAML file"),
        (BODY, ".", "a body is a YAML file"),
        (BODY, "legs.yaml --name \x1b[2J", r"--name: Expected printable characters, in '\x1b[2J'"),
        (MAP, "photographs", "is what this command reads (photographs)"),
        (MAP, "photographs/map", "lies within what this command reads"),
        (MAP, ".", "contains what this command reads"),
        (MAP, "album", "holds dear.jpg, which is no part of a map"),
        (EVALUATE, "walk", "ros2 bag folder"),
        (EVALUATE, "album", "ros2 bag folder"),
        (STATIONS, "walk/cameras.yaml", "lies within what this command reads (walk)"),
        (STATIONS, "body.yaml", "body.yaml: is no file of static cameras that this command wrote, so --force"),
        (EXPORT, "body.yaml", "is what this command reads (body.yaml)"),
        (EXPORT, "thesis.yaml", "is no urdf, so --force does not replace it"),
        (EXPORT, ".", "contains what this command reads"),
        (EXPORT, "/dev/null", "is a pipe or device"),
        (EXPORT, "x" * 300, "File name too long"),
    ],
)
def test_it_is_refused_in_one_line(
    house: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    command: str,
    output: str,
    told: str,
) -> None:
    monkeypatch.chdir(house)
    before = contents(house)
    assert main([*command.split(), *output.split()]) == 1
    said = capsys.readouterr().err
    assert told in said and said.startswith("bodycam: error: ") and said.count("\n") == 1
    assert contents(house) == before


def test_pictures_of_others_are_no_report_of_ours(
    house: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    (house / "album" / "metadata.yaml").unlink()
    monkeypatch.chdir(house)
    assert main([*EVALUATE.split(), "album"]) == 1
    assert "summary.png: exists already" in capsys.readouterr().err
    assert (house / "album" / "summary.png").read_text() == "dear"


def contents(folder: Path) -> dict[str, bytes]:
    return {str(file.relative_to(folder)): file.read_bytes() for file in folder.rglob("*") if file.is_file()}
