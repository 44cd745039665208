"""Whatever goes wrong, what was there is there, and nothing else is."""

import os
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from helpers.naming import naming

from bodycam_ros.errors import OutputError
from bodycam_ros.files.whole_file import SCRATCH_PREFIX, whole_file, whole_files, whole_folder, write_whole

OLD, NEW = {"a": "old", "b/c": "old"}, {"a": "new", "b/d": "new"}


def names(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.iterdir())


def make(folder: Path, files: dict[str, str]) -> None:
    for name, text in files.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text(text)


def contents(folder: Path) -> dict[str, str]:
    return {str(path.relative_to(folder)): path.read_text() for path in folder.rglob("*") if path.is_file()}


def replaceable(path: Path) -> None:
    """Anything is."""


@contextmanager
def raised(error: BaseException, at_call: int, after: bool) -> Iterator[list[int]]:
    """``error`` out of the n-th call to the disk, before it is made or after; gives a list with the number of calls."""
    calls = [0]
    patch = pytest.MonkeyPatch()

    def counted(call: Callable[..., object]) -> Callable[..., object]:
        def wrapper(*arguments: object, **keywords: object) -> object:
            calls[0] += 1
            if calls[0] == at_call and not after:
                raise error
            result = call(*arguments, **keywords)
            if calls[0] == at_call:
                raise error
            return result

        return wrapper

    for where, name in ((Path, "mkdir"), (Path, "rename"), (Path, "replace"), (os, "fsync")):
        patch.setattr(where, name, counted(getattr(where, name)))
    try:
        yield calls
    finally:
        patch.undo()


def test_text_and_bytes_replace_what_was_there(tmp_path: Path) -> None:
    path = tmp_path / "file"
    write_whole(path, "knee 30°")
    assert path.read_text(encoding="utf-8") == "knee 30°"
    write_whole(path, b"\x00\xff")
    assert path.read_bytes() == b"\x00\xff"
    assert names(tmp_path) == ["file"]


def test_what_cannot_be_written_leaves_nothing_behind(tmp_path: Path) -> None:
    occupied = tmp_path / "folder"
    (occupied / "inside").mkdir(parents=True)
    os.mkfifo(tmp_path / "pipe")
    for path in (occupied, tmp_path / "pipe" / "file", tmp_path / "pipe", tmp_path / ("long" * 80)):
        with naming(OutputError, path):
            write_whole(path, "text")
    assert names(tmp_path) == ["folder", "pipe"]
    assert (tmp_path / "pipe").is_fifo()
    assert (occupied / "inside").is_dir()


def test_a_name_as_long_as_the_disk_allows_is_written(tmp_path: Path) -> None:
    write_whole(tmp_path / ("n" * 255), "text")
    assert (tmp_path / ("n" * 255)).read_text() == "text"


def test_a_link_stays_a_link_to_what_is_written(tmp_path: Path) -> None:
    (tmp_path / "kept").mkdir()
    (tmp_path / "link").symlink_to(tmp_path / "kept" / "file")
    write_whole(tmp_path / "link", "text")
    assert (tmp_path / "link").is_symlink()
    assert (tmp_path / "kept" / "file").read_text() == "text"


def test_files_appear_together_and_leave_others_alone(tmp_path: Path) -> None:
    make(tmp_path / "out", {"a": "old", "mine": "dear"})
    with whole_files(tmp_path / "out") as unfinished:
        make(unfinished, {"a": "new", "b": "new"})
        assert contents(tmp_path / "out") == {"a": "old", "mine": "dear"}
    assert contents(tmp_path / "out") == {"a": "new", "b": "new", "mine": "dear"}
    with naming(OutputError, tmp_path / "out", "disk full"), whole_files(tmp_path / "out") as files:
        make(files, {"a": "half"})
        raise OSError(28, "disk full")
    assert contents(tmp_path / "out") == {"a": "new", "b": "new", "mine": "dear"}
    assert names(tmp_path) == ["out"]


def test_files_for_a_folder_of_the_users_need_nothing_above_it(tmp_path: Path) -> None:
    folder = tmp_path / "disk"
    make(folder, {"mine": "dear"})
    with whole_files(folder, inside=True) as unfinished:
        assert folder in unfinished.parents and names(tmp_path) == ["disk"]
        make(unfinished, {"a": "new"})
    assert contents(folder) == {"a": "new", "mine": "dear"} and names(folder) == ["a", "mine"]


def test_a_folder_replaces_only_what_may_be_replaced(tmp_path: Path) -> None:
    def refuse(path: Path) -> None:
        raise ValueError(f"{path.name} stays")

    with whole_folder(tmp_path / "above" / "out", refuse) as unfinished:
        make(unfinished, OLD)
    out = tmp_path / "above" / "out"
    with naming(ValueError, "out stays"), whole_folder(out, refuse) as unfinished:
        pytest.fail("asked before the work")
    with naming(ValueError, "late stays"), whole_folder(tmp_path / "late", refuse) as unfinished:
        make(unfinished, NEW)
        make(tmp_path / "late", {"somebody": "else"})
    assert contents(tmp_path / "late") == {"somebody": "else"}
    with whole_folder(out, replaceable) as unfinished:
        make(unfinished, NEW)
        assert contents(out) == OLD
    assert contents(out) == NEW
    assert (names(tmp_path), names(out.parent)) == (["above", "late"], ["out"])


def test_the_working_folder_can_be_replaced(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    make(tmp_path / "out", OLD)
    monkeypatch.chdir(tmp_path / "out")
    with whole_folder(Path("."), replaceable) as unfinished:
        assert unfinished.name == "out"
        make(unfinished, NEW)
    assert contents(tmp_path / "out") == NEW


@pytest.mark.parametrize("after", [False, True])
@pytest.mark.parametrize("error", [KeyboardInterrupt(), OSError(5, "Input/output error")])
def test_a_failure_at_any_moment_leaves_one_whole_folder(tmp_path: Path, error: BaseException, after: bool) -> None:
    def replace() -> None:
        with whole_folder(tmp_path / "out", replaceable) as unfinished:
            make(unfinished, NEW)

    make(tmp_path / "out", OLD)
    with raised(error, 0, after) as calls:
        replace()
    seen = []
    for moment in range(1, calls[0] + 1):
        with whole_folder(tmp_path / "out", replaceable) as unfinished:
            make(unfinished, OLD)
        with raised(error, moment, after):
            try:
                replace()
            except (OutputError, OSError, KeyboardInterrupt):
                pass
        seen.append(contents(tmp_path / "out"))
        assert seen[-1] in (OLD, NEW), moment
        assert names(tmp_path) == ["out"], moment
    assert OLD in seen


def test_an_old_folder_that_cannot_be_put_back_is_kept_and_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    make(tmp_path / "out", OLD)
    rename = Path.rename

    def once(self: Path, target: Path) -> Path:
        monkeypatch.setattr(Path, "rename", gone)
        return rename(self, target)

    def gone(self: Path, target: Path) -> Path:
        raise OSError(5, "the disk is gone")

    monkeypatch.setattr(Path, "rename", once)
    with (
        naming(OutputError, "the disk is gone") as caught,
        whole_folder(tmp_path / "out", replaceable) as unfinished,
    ):
        make(unfinished, NEW)
    monkeypatch.undo()
    (kept,) = tmp_path.glob(".bodycam-replaced.*")
    os.utime(kept, (0, 0))
    write_whole(tmp_path / "next", "it clears what is stale")
    assert str(kept) in str(caught.value)
    assert contents(kept) == OLD


@pytest.mark.parametrize("error", [KeyboardInterrupt(), OSError(28, "disk full"), RuntimeError("a defect")])
def test_a_block_that_fails_leaves_what_was_there(tmp_path: Path, error: BaseException) -> None:
    make(tmp_path / "out", OLD)
    (tmp_path / "file").write_text("old")
    with pytest.raises((OutputError, type(error))), whole_file(tmp_path / "file") as unfinished:
        unfinished.write_text("half")
        raise error
    with pytest.raises(type(error)), whole_folder(tmp_path / "out", replaceable) as unfinished:
        make(unfinished, NEW)
        raise error
    assert contents(tmp_path / "out") == OLD
    assert (tmp_path / "file").read_text() == "old"
    assert names(tmp_path) == ["file", "out"]


def test_what_a_killed_process_left_is_cleared_and_what_a_living_one_holds_is_not(tmp_path: Path) -> None:
    long_ago = time.time() - 3600
    code = "import sys, time; from pathlib import Path; from bodycam_ros.files.whole_file import scratch_folder\n"
    code += "with scratch_folder(Path(sys.argv[1])): print(); sys.stdout.flush(); time.sleep(600)"
    processes = [
        subprocess.Popen([sys.executable, "-c", code, str(tmp_path)], stdout=subprocess.PIPE) for _ in range(2)
    ]
    for process in processes:
        assert process.stdout is not None
        process.stdout.readline()
    try:
        (tmp_path / f"{SCRATCH_PREFIX}new").mkdir()  # nobody holds it yet
        held = {path for path in tmp_path.iterdir() if not path.name.endswith("new")}
        assert len(held) == 2
        for path in held:
            (path / "half").write_text("half a file")
            os.utime(path, (long_ago, long_ago))
        write_whole(tmp_path / "file", "text")
        assert held < set(tmp_path.iterdir())
        processes[0].kill()
        processes[0].wait()
        write_whole(tmp_path / "file", "text")
        left = set(tmp_path.iterdir()) - {tmp_path / "file"}
        assert len(left & held) == 1 and tmp_path / f"{SCRATCH_PREFIX}new" in left
    finally:
        for process in processes:
            process.kill()
            process.communicate()
    write_whole(tmp_path / "file", "text")
    assert names(tmp_path) == [f"{SCRATCH_PREFIX}new", "file"]


def test_a_users_folder_that_is_named_like_ours_stays(tmp_path: Path) -> None:
    users = [tmp_path / f"{SCRATCH_PREFIX}{name}" for name in ("backup", "0" * 32, "0" * 31, "g" * 32, "A" * 32)]
    for folder in users:
        make(folder, OLD)
        os.utime(folder, (0, 0))
    write_whole(tmp_path / "file", "text")
    with whole_files(tmp_path / "folder") as unfinished:
        make(unfinished, {"x": "y"})
    with whole_folder(tmp_path / "out", replaceable) as unfinished:
        make(unfinished, NEW)
    assert all(contents(folder) == OLD for folder in users)
    assert contents(tmp_path / "folder") == {"x": "y"}


_REPLACES = """
import sys, time
from pathlib import Path
from bodycam_ros.files.whole_file import whole_folder
end = time.monotonic() + 2.0
while time.monotonic() < end:
    with whole_folder(Path(sys.argv[1]), lambda path: None) as unfinished:
        unfinished.mkdir()
        for name in "ab":
            (unfinished / name).write_text(sys.argv[2])
"""


def test_two_processes_replace_one_folder_and_the_last_stays(tmp_path: Path) -> None:
    """As two graphs that save what they have added to one map."""
    commands = [[sys.executable, "-c", _REPLACES, str(tmp_path / "map"), word] for word in ("one", "two")]
    processes = [subprocess.Popen(command, stderr=subprocess.PIPE, text=True) for command in commands]
    for process in processes:
        _, printed = process.communicate(timeout=60)
        assert process.returncode == 0, printed
    assert names(tmp_path) == ["map"]
    assert contents(tmp_path / "map") in ({"a": "one", "b": "one"}, {"a": "two", "b": "two"})


def test_what_is_unfinished_is_seen_by_nobody_else(tmp_path: Path) -> None:
    """Keys and pictures are copied there before they have the modes that they will have."""
    with whole_folder(tmp_path / "made", replaceable) as unfinished:
        make(unfinished, NEW)
        assert unfinished.parent.stat().st_mode & 0o077 == 0
    assert (tmp_path / "made").stat().st_mode & 0o777 == 0o777 & ~_umask()


def _umask() -> int:
    os.umask(mask := os.umask(0))
    return mask
