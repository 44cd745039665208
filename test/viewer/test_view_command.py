"""The command as a person meets it: its address, its end, its errors."""

import os
import signal
import socket
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from helpers.owned_processes import ended_with_us

from bodycam_ros.cli.main import main
from bodycam_ros.viewer.motion import mounted_camera
from bodycam_ros.viewer.sources import Sources

REPOSITORY = Path(__file__).parent.parent.parent


def bodycam_view(*arguments: str | Path) -> "subprocess.CompletedProcess[str]":
    command = [sys.executable, "-m", "bodycam_ros.cli.main", "view", *map(str, arguments)]
    return subprocess.run(
        ended_with_us(command), capture_output=True, text=True, check=False, cwd=REPOSITORY, timeout=120
    )


@pytest.mark.parametrize(("signal_number", "exit_code"), [(signal.SIGINT, 130), (signal.SIGTERM, 143)])
def test_it_prints_its_address_and_ends_cleanly(
    sample: Path, body_file: Path, signal_number: int, exit_code: int
) -> None:
    shown_until(signal_number, exit_code, "--map", sample / "map", "--body", body_file)


@pytest.mark.long
def test_out_alone_is_shown(sample_out: Path) -> None:
    shown_until(signal.SIGINT, 130, sample_out)


def shown_until(signal_number: int, exit_code: int, *arguments: str | Path) -> None:
    command = [sys.executable, "-m", "bodycam_ros.cli.main", "view", *map(str, arguments), "--port", "0"]
    pipe = subprocess.PIPE
    with subprocess.Popen(
        ended_with_us(command), stdout=pipe, stderr=pipe, text=True, cwd=REPOSITORY, process_group=0
    ) as process:
        assert process.stdout is not None and process.stderr is not None
        address = process.stdout.readline()
        assert address.startswith("open http://127.0.0.1:")
        os.killpg(process.pid, signal_number)
        out, err = process.communicate(timeout=60)
    assert process.returncode == exit_code
    assert out == ""
    assert err == ("bodycam: interrupted\n" if signal_number == signal.SIGINT else "")


@pytest.mark.long
def test_what_is_missing_is_named(sample: Path, sample_out: Path, body_file: Path, tmp_path: Path) -> None:
    nowhere = tmp_path / "nowhere"
    good = {"--map": sample / "map", "--body": body_file}
    for option, said in (("--map", "there is no map folder"), ("--body", "cannot read this body file")):
        given = {**good, option: nowhere}
        result = bodycam_view(*(word for pair in given.items() for word in pair))
        assert (result.returncode, result.stdout) == (1, "")
        assert result.stderr.startswith(f"bodycam: error: {nowhere}") and said in result.stderr
    for arguments in ((nowhere,), (sample_out, "--recording", nowhere)):
        result = bodycam_view("--map", sample / "map", "--body", body_file, *arguments)
        assert (result.returncode, result.stdout) == (1, "")
        assert result.stderr.startswith(f"bodycam: error: {nowhere}: does not exist")


@pytest.mark.long
def test_a_recording_that_does_not_fit_is_refused(
    sample: Path, sample_out: Path, body_file: Path, tiny_bag: Path
) -> None:
    given = ["--map", sample / "map", "--body", body_file, "--recording", tiny_bag]
    result = bodycam_view(sample_out, *given)
    assert result.returncode == 1
    assert "has none of the body's cameras; it has left, right, the body waist_front" in result.stderr
    result = bodycam_view(*given)
    assert result.returncode == 1
    assert "without OUT the body's motion in these images is unknown" in result.stderr


def test_a_port_in_use_is_one_line(sample: Path, body_file: Path) -> None:
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        result = bodycam_view("--map", sample / "map", "--body", body_file, "--port", str(port))
    assert (result.returncode, result.stdout) == (1, "")
    assert result.stderr.startswith(f"bodycam: error: port {port} of this machine is in use")
    assert len(result.stderr.splitlines()) == 1


def test_the_body_of_out_is_that_of_its_file(sample: Path, sample_out: Path) -> None:
    of_file = Sources(sample_out, None, sample / "body.yaml", None).body
    of_out = Sources(sample_out, None, None, None).body
    assert of_out.segments == of_file.segments and set(of_out.mounts) == set(of_file.mounts)
    standing = [body.n_pose(np.eye(4)) for body in (of_file, of_out)]
    np.testing.assert_allclose(standing[1], standing[0], atol=1e-6)
    for camera in of_file.mounts:
        poses = [mounted_camera(body, own, camera) for body, own in zip((of_file, of_out), standing, strict=True)]
        np.testing.assert_allclose(poses[1], poses[0], atol=1e-6)


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["--place", "BAG"], "--place needs --stations CAMERAS.YAML and -o START.yaml"),
        (["--place", "BAG", "--stations", "C.yaml", "-o", "start.yaml"], "either --body BODY.yaml or --height METRES"),
        (["--place", "BAG", "OUT"], "leave out OUT"),
        (["--start", "start.yaml"], "--start needs --place"),
        (["body.yaml"], "body.yaml: is not a solved bag; give a body's file with --body"),
        (["--map", "MAP"], "the body is unknown: give its file with --body"),
        (["OUT", "-o", "walk.mp4"], "walk.mp4: 'bodycam view' writes no film; 'bodycam film OUT -o walk.mp4' does"),
        (
            ["--place", "BAG", "--stations", "C.yaml", "--height", "1.8", "-o", "start.yaml"],
            "error: BAG: does not exist",
        ),
    ],
)
def test_what_is_lacking_or_too_much_is_said(
    arguments: list[str], said: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    try:
        assert main(["view", *arguments]) != 0
    except SystemExit as left:
        assert left.code == 2
    assert said in " ".join(capfd.readouterr().err.split())


def test_a_start_is_replaced_if_asked_for_and_nothing_else_is(
    tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    given = ["view", "--place", str(tmp_path / "bag"), "--stations", str(tmp_path / "c.yaml"), "--height", "1.8", "-o"]
    start, other = tmp_path / "start.yaml", tmp_path / "other.yaml"
    start.write_text("pelvis: [0, 0, 1, 0, 0, 0, 1]\n")
    other.write_text("name: me\n")
    for path, flags, said in (
        (start, [], "--force"),
        (other, ["--force"], "is no start"),
        (start, ["--force"], "bag: does"),
    ):
        assert main([*given, str(path), *flags]) == 1
        assert said in " ".join(capfd.readouterr().err.split())
