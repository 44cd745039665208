"""What a command writes to: never its input, and never what it did not make."""

import os
import re
from pathlib import Path

import pytest
from helpers.naming import naming

from bodycam_ros.errors import OutputError
from bodycam_ros.files.output_place import check_file, check_folder, check_output


@pytest.fixture
def place(tmp_path: Path) -> Path:
    """A recording in a folder with other things, and other names for it."""
    (tmp_path / "walk").mkdir()
    (tmp_path / "walk" / "walk.mcap").write_text("recording")
    (tmp_path / "link").symlink_to("walk", target_is_directory=True)
    os.link(tmp_path / "walk" / "walk.mcap", tmp_path / "second_name.mcap")
    return tmp_path


@pytest.mark.parametrize(
    ("output", "read", "relation"),
    [
        ("walk", "walk", "is"),
        ("walk/", "link", "is"),
        ("link", "walk", "is"),
        ("link/../walk", "walk", "is"),
        ("second_name.mcap", "walk/walk.mcap", "is"),
        ("walk/out", "walk", "lies within"),
        ("link/deep/out", "walk", "lies within"),
        (".", "walk", "contains"),
        ("link", "walk/walk.mcap", "contains"),
        ("not_there", "not_there", "is"),
    ],
)
def test_an_output_has_nothing_to_do_with_an_input(
    place: Path, monkeypatch: pytest.MonkeyPatch, output: str, read: str, relation: str
) -> None:
    monkeypatch.chdir(place)
    with naming(OutputError, relation, Path(read)):
        check_output(Path(output), (None, Path(read)))


def test_places_of_their_own_are_free(place: Path) -> None:
    for output in ("out", "walk2", "new/deep/out", "walk.mcap", "second_name.mcap"):
        check_output(place / output, (place / "walk", None, place / "missing"))
    assert sorted(os.listdir(place)) == ["link", "second_name.mcap", "walk"], "it left nothing of its trial"


def test_what_cannot_be_written_is_named_before_the_work(place: Path) -> None:
    for output in ("second_name.mcap/out", "x" * 300, "x" * 300 + "/out"):
        with naming(OutputError, place / output):
            check_output(place / output, ())
    with naming(OutputError, "/proc/out"):
        check_output(Path("/proc/out"), ())
    with naming(OutputError, "UTF-8"):
        check_output(place / os.fsdecode(b"\xff\xfeout"), ())


def test_only_files_of_the_same_kind_are_replaced(place: Path) -> None:
    robot, thesis, empty = place / "body.urdf", place / "thesis.txt", place / "empty"
    robot.write_text("<?xml version='1.0'?>\n<robot name='x'/>")
    thesis.write_text("ten years of work")
    empty.write_text("\n")
    os.mkfifo(place / "pipe")
    for path in (robot, empty):
        with naming(OutputError, path, "--force"):
            check_file(path, False, b"<robot", "URDF")
        check_file(path, True, b"<robot", "URDF")
    check_file(place / "new.urdf", False, b"<robot", "URDF")
    for path, named in (
        (thesis, "URDF"),
        (place / "walk", "folder"),
        (place / "pipe", "pipe or device"),
        (Path("/dev/null"), "pipe or device"),
        (place / ("x" * 300), "File name too long"),
    ):
        with naming(OutputError, path, named):
            check_file(path, True, b"<robot", "URDF")


def test_only_folders_that_are_all_ours_are_replaced(place: Path) -> None:
    parts = re.compile(r"map\.yaml|sparse/[a-z]+\.bin")
    folder = place / "map"
    (folder / "sparse").mkdir(parents=True)
    check_folder(folder, True, "map.yaml", parts, "map")
    (folder / "sparse" / "images.bin").write_text("")
    with naming(OutputError, folder, "map.yaml"):
        check_folder(folder, True, "map.yaml", parts, "map")
    (folder / "map.yaml").write_text("")
    check_folder(folder, True, "map.yaml", parts, "map")
    with naming(OutputError, folder):
        check_folder(folder, False, "map.yaml", parts, "map")
    (folder / "sparse" / "notes.txt").write_text("dear")
    with naming(OutputError, folder, "sparse/notes.txt"):
        check_folder(folder, True, "map.yaml", parts, "map")
    with naming(OutputError, place / "second_name.mcap"):
        check_folder(place / "second_name.mcap", True, "map.yaml", parts, "map")
