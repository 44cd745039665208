"""The page on installing names files and targets that are there, and the Dockerfile does what it says."""

import os
import re
import subprocess
from pathlib import Path

import pytest

REPOSITORY = Path(__file__).parents[2]
PAGE, DOCKERFILE = REPOSITORY / "docs/install.md", REPOSITORY / "Dockerfile"
BLOCKS = re.findall(r"^```bash\n(.*?)^```$", PAGE.read_text(), re.MULTILINE | re.DOTALL)
NAMED = r"(?<![\w/.-])(?:src/bodycam_ros/)?([\w-]+\.(?:txt|xml|md))\b"


@pytest.mark.parametrize("block", BLOCKS)
def test_a_shell_understands_the_commands(block: str) -> None:
    read = subprocess.run(["bash", "-n"], input=block, capture_output=True, text=True)
    assert read.returncode == 0, read.stderr


@pytest.mark.parametrize("file", [PAGE, DOCKERFILE], ids=lambda file: file.name)
def test_files_that_are_named_are_there(file: Path) -> None:
    named = set(re.findall(NAMED, file.read_text())) - {"CMakeLists.txt"}
    assert {"requirements-ubuntu.txt", "constraints-ubuntu.txt"} <= named
    assert [name for name in named if not (REPOSITORY / name).exists() and not (PAGE.parent / name).exists()] == []


def test_targets_of_make_are_there() -> None:
    makefile = (REPOSITORY / "Makefile").read_text()
    asked = set(re.findall(r"\bmake ([a-z][a-z-]+)", PAGE.read_text()))
    assert {"wheels", "wheel-check", "release-check"} <= asked
    assert asked <= set(re.findall(r"^([a-z-]+):", makefile, re.MULTILINE))


def test_docker_does_what_the_page_says() -> None:
    image, page = DOCKERFILE.read_text(), PAGE.read_text()
    for step in (
        "rosdep install --from-paths src --ignore-src -y",
        "python3 -m venv --system-site-packages venv",
        "colcon build",
    ):
        assert step in image and step in page
    last_user = re.findall(r"^USER (\S+)$", image, re.MULTILINE)[-1]
    assert last_user.isdigit() and int(last_user) > 0, "nobody is root"


def said_by_entrypoint(folder: Path, home: Path) -> list[str]:
    """What it runs is told where its home is, and whether it can write there; of the image there are empty files."""
    entrypoint = (REPOSITORY / "docker/entrypoint.sh").read_text()
    for sourced in re.findall(r"^\. (/opt/\S+)$", entrypoint, re.MULTILINE):
        (folder / sourced.lstrip("/")).parent.mkdir(parents=True, exist_ok=True)
        (folder / sourced.lstrip("/")).touch()
    script = entrypoint.replace("/opt/", f"{folder}/opt/")
    look = ["sh", "-c", 'echo "$HOME"; touch "$HOME/log" && echo written']
    environment = {"PATH": os.environ["PATH"], "HOME": str(home), "TMPDIR": str(folder)}
    ran = subprocess.run(["bash", "-c", script, "entrypoint", *look], env=environment, capture_output=True, text=True)
    assert ran.returncode == 0, ran.stderr
    return ran.stdout.splitlines()


def test_a_user_without_a_home_has_one_in_the_image(tmp_path: Path) -> None:
    home, written = said_by_entrypoint(tmp_path, tmp_path / "nowhere")
    assert Path(home).parent == tmp_path and written == "written"


def test_a_user_with_a_home_keeps_it(tmp_path: Path) -> None:
    assert said_by_entrypoint(tmp_path, tmp_path) == [str(tmp_path), "written"]
