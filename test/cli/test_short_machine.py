"""A machine that is short of something: the output is whole where it can be, else an error says what is missing."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from helpers.altered_sample import write_altered_sample

from bodycam_ros.body.urdf_xml import xml_elements

COMMAND = [sys.executable, "-m", "bodycam_ros.cli.main"]
PHOTOGRAPHS = ("ref_0099.jpg", "ref_0101.jpg", "ref_0103.jpg", "ref_0105.jpg", "camera.yaml", "board.yaml")


def run(
    *words: str | Path, shell: str = "", cwd: Path | None = None, **environment: str
) -> subprocess.CompletedProcess[str]:
    """Run a command behind some words of a shell, as "ulimit -n 12;", with redirections in the place of {}."""
    before, _, after = (shell or "{}").partition("{}")
    script = f'{before} "$0" "$@" {after}'
    surroundings = {**os.environ, "COLUMNS": "400", **environment}
    command = ["bash", "-c", script, *COMMAND, *map(str, words)]
    return subprocess.run(command, capture_output=True, text=True, timeout=120, cwd=cwd, env=surroundings)


@pytest.fixture(scope="module")
def short(sample: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Four frames of the sample."""
    folder = tmp_path_factory.mktemp("short") / "bag"
    write_altered_sample(sample, folder, frames=4)
    return folder


@pytest.fixture
def export(sample: Path, tmp_path: Path) -> list[str | Path]:
    return ["export", sample / "body.yaml", "--to", "urdf", "-o", tmp_path / "made.urdf"]


@pytest.fixture
def replay(sample: Path, short: Path, tmp_path: Path) -> list[str | Path]:
    return ["replay", short, "--map", sample / "map", "--body", sample / "body.yaml", "-o", tmp_path / "out"]


@pytest.mark.parametrize("closed", [">&-", "2>&-", "<&-", "<&- >&- 2>&-"])
def test_streams_that_are_closed_cost_no_output(export: list[str | Path], tmp_path: Path, closed: str) -> None:
    done = run(*export, shell="{} " + closed)
    assert (done.returncode, done.stderr) == (0, "")
    assert xml_elements((tmp_path / "made.urdf").read_text()).tag == "robot"


def test_a_full_standard_output_is_named(export: list[str | Path]) -> None:
    done = run(*export, shell="{} > /dev/full")
    assert (done.returncode, done.stderr) == (1, "bodycam: error: standard output: No space left on device\n")


def test_a_reader_that_has_gone_costs_no_output(replay: list[str | Path], tmp_path: Path) -> None:
    done = run(*replay, shell="{} | true; exit ${PIPESTATUS[0]}")
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "out" / "metadata.yaml").is_file()


def test_a_working_folder_that_is_gone_is_named(sample: Path) -> None:
    relative = ["export", "body.yaml", "--to", "urdf", "-o", "made.urdf"]
    done = run(*relative, shell='d=$(mktemp -d) && cd "$d" && rmdir "$d" && {}')
    assert done.returncode == 1
    assert done.stderr == "bodycam: error: the folder that this was started in is gone; change to another one (cd)\n"


@pytest.mark.parametrize("files", [8, 12, 16])
def test_few_open_files_are_named_with_what_to_do(replay: list[str | Path], files: int) -> None:
    done = run(*replay, shell=f"ulimit -n {files};" + " {}")
    assert done.returncode == 1 and "Traceback" not in done.stderr
    assert "ulimit -n" in done.stderr.splitlines()[-1]


@pytest.mark.parametrize("megabytes", [150, 300, 400])
def test_little_memory_is_named_with_its_limit(sample_out: Path, tmp_path: Path, megabytes: int) -> None:
    done = run("evaluate", sample_out, "-o", tmp_path / "report", shell=f"ulimit -v {megabytes << 10};" + " {}")
    assert done.returncode == 1 and "Traceback" not in done.stderr
    assert f"not enough memory for this within the {megabytes} MB" in done.stderr.splitlines()[-1]


@pytest.mark.parametrize("mounted", ["-o size=4k", "-o ro"])
def test_shared_memory_that_cannot_be_used_is_named(replay: list[str | Path], mounted: str) -> None:
    if subprocess.run(["unshare", "-rm", "mount", "-t", "tmpfs", "none", "/dev/shm"], capture_output=True).returncode:
        pytest.skip("this machine lets nobody mount a file system of his own")
    inner = f'mount -t tmpfs {mounted} none /dev/shm && exec "$0" "$@"'
    done = run(*replay, shell=f"unshare -rm bash -c '{inner}'" + " {}")
    assert done.returncode == 1
    assert "tracking processes cannot be started" in done.stderr and "/dev/shm" in done.stderr.splitlines()[-1]


def test_a_long_name_of_the_temporary_folder_is_no_hindrance(replay: list[str | Path], tmp_path: Path) -> None:
    (long := tmp_path / ("x" * 90)).mkdir()
    done = run(*replay, TMPDIR=str(long))
    assert done.returncode == 0, done.stderr
    assert not list(long.iterdir())


@pytest.mark.parametrize("kilobytes", [4, 300, 1200])
def test_a_temporary_folder_without_room_is_named(sample: Path, tmp_path: Path, kilobytes: int) -> None:
    (photographs := tmp_path / "photographs").mkdir()
    for name in PHOTOGRAPHS:
        shutil.copyfile(sample / "reference" / name, photographs / name)
    done = run(
        "map", photographs, "-o", tmp_path / "map", shell=f"ulimit -f {kilobytes};" + " {}", TMPDIR=str(tmp_path)
    )
    assert done.returncode == 1 and "Traceback" not in done.stderr
    message = done.stderr.splitlines()[-1]
    assert message.startswith(f"bodycam: error: {tmp_path}: temporary files") and message.endswith("with TMPDIR")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["photographs"]
