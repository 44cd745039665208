"""Configurations are found from the sources and from every kind of installation."""

import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from bodycam_ros.share_folder import share_folder

REPOSITORY = Path(__file__).parent.parent


def found_by(package: Path) -> "subprocess.CompletedProcess[str]":
    """By a process of its own that knows that package alone."""
    package.mkdir(parents=True)
    for file in ("__init__.py", "errors.py", "share_folder.py"):
        shutil.copy(REPOSITORY / "bodycam_ros" / file, package)
    look = "from bodycam_ros.share_folder import share_folder; print(share_folder())"
    return subprocess.run([sys.executable, "-c", look], cwd=package.parent, capture_output=True, text=True)


def test_the_sources_have_them() -> None:
    assert share_folder() == REPOSITORY
    assert (share_folder() / "launch/bodycam.launch.py").is_file()


@pytest.mark.parametrize("place", ["lib/python3.12/site-packages", "lib/python3.12/dist-packages", ""])
def test_whatever_installed_them(tmp_path: Path, place: str) -> None:
    """A prefix of pip, of colcon, of the system; and ``pip install --target``."""
    share = tmp_path / "prefix/share/bodycam_ros"
    (share / "config").mkdir(parents=True)
    (share / "config/all_settings.yaml").touch()
    found = found_by(tmp_path / "prefix" / place / "bodycam_ros")
    assert found.stdout.strip() == str(share), found.stderr


def test_an_installation_without_them_is_named(tmp_path: Path) -> None:
    found = found_by(tmp_path / "bodycam_ros")
    assert "install the package anew" in found.stderr
