from pathlib import Path

import pytest

from bodycam_ros.whole_file import write_whole


def test_text_and_bytes_replace_what_was_there(tmp_path: Path) -> None:
    path = tmp_path / "file"
    write_whole(path, "knee 30°")
    assert path.read_text(encoding="utf-8") == "knee 30°"
    write_whole(path, b"\x00\xff")
    assert path.read_bytes() == b"\x00\xff"
    assert [file.name for file in tmp_path.iterdir()] == ["file"]


def test_what_cannot_be_written_leaves_nothing_behind(tmp_path: Path) -> None:
    occupied = tmp_path / "folder"
    (occupied / "inside").mkdir(parents=True)
    with pytest.raises(OSError):
        write_whole(occupied, "text")
    with pytest.raises(OSError):
        write_whole(tmp_path / "missing" / "file", "text")
    assert [file.name for file in tmp_path.iterdir()] == ["folder"]
    assert (occupied / "inside").is_dir()
