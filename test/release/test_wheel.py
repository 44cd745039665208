"""What setup.py packs is all that a user needs, and says what it is. `make wheel-check` installs and runs it."""

import re
import shutil
import subprocess
import sys
from collections.abc import Iterator
from email import message_from_bytes
from email.message import Message
from pathlib import Path
from zipfile import ZipFile

import pytest
from wheel_check import shared_by

import bodycam_ros
from bodycam_ros.nodes.start import NODES

REPOSITORY = Path(__file__).parents[2]
NOT_IN_AN_IMAGE = ("CHANGELOG.md", "MANIFEST.in", "constraints.txt", "requirements.txt", "requirements-ros.txt")
"""Of what the archive of the sources has."""

BUILD = "import setuptools.build_meta as made; made.build_sdist('dist'); made.build_wheel('dist')"


@pytest.fixture(scope="module")
def dist(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The archive and the wheel, of a copy of what Docker sees: building leaves traces beside the sources."""
    copy = tmp_path_factory.mktemp("sources")
    let_through = re.findall(r"^!(\S+)$", (REPOSITORY / ".dockerignore").read_text(), re.MULTILINE)
    for name in (*let_through, *NOT_IN_AN_IMAGE):
        if (REPOSITORY / name).is_dir():
            ignored = shutil.ignore_patterns("__pycache__", "build")
            shutil.copytree(REPOSITORY / name, copy / name, symlinks=True, ignore=ignored)
        else:
            (copy / name).parent.mkdir(exist_ok=True)
            shutil.copy(REPOSITORY / name, copy / name)
    subprocess.run([sys.executable, "-c", BUILD], cwd=copy, check=True, capture_output=True, timeout=120)
    return copy / "dist"


@pytest.fixture(scope="module")
def wheel(dist: Path) -> Iterator[ZipFile]:
    with ZipFile(next(dist.glob("*.whl"))) as opened:
        yield opened


@pytest.fixture(scope="module")
def metadata(wheel: ZipFile) -> Message:
    return message_from_bytes(wheel.read(f"bodycam_ros-{bodycam_ros.__version__}.dist-info/METADATA"))


def test_the_wheel_has_every_file_of_the_package(wheel: ZipFile) -> None:
    packed = set(wheel.namelist())
    package = REPOSITORY / "bodycam_ros"
    # Beneath links, too: messages and supplied equipment are there as files.
    linked = [package / "msg", package / "equipment/supplied"]
    own = {
        path.relative_to(REPOSITORY)
        for folder in (package, *linked)
        for path in folder.rglob("*")
        if "__pycache__" not in path.parts and path.is_file()
    }
    assert own and {str(path) for path in own} <= packed
    assert "bodycam_ros/py.typed" in packed and "bodycam_ros/msg/FeatureTracks.msg" in packed


def test_the_wheel_has_every_launch_file_and_configuration(wheel: ZipFile) -> None:
    packed = [name.partition("/share/bodycam_ros/")[2] for name in wheel.namelist()]
    assert {"launch/bodycam.launch.py", "config/equipment/bicycle.yaml"} <= shared_by(REPOSITORY) <= set(packed)


def test_nothing_else_is_packed(wheel: ZipFile) -> None:
    assert {name.split("/")[0].split("-")[0] for name in wheel.namelist()} == {"bodycam_ros"}
    assert not [name for name in wheel.namelist() if "__pycache__" in name or name.endswith(".pyc")]


def test_the_wheel_says_what_it_is(wheel: ZipFile, metadata: Message) -> None:
    assert metadata["Version"] == bodycam_ros.__version__
    assert metadata["License"] == "Apache-2.0" and metadata["License-File"] == "LICENSE"
    assert metadata["Requires-Python"] in (">=3.11,<3.14", "<3.14,>=3.11")
    assert metadata["Description-Content-Type"] == "text/markdown"
    assert {"ros", "robot", "test"} <= set(metadata.get_all("Provides-Extra", []))
    of_messages = [need for need in metadata.get_all("Requires-Dist", []) if need.startswith("bodycam-msgs")]
    assert of_messages == [f'bodycam-msgs=={bodycam_ros.__version__}; extra == "ros"']
    assert any(name.endswith(".dist-info/licenses/LICENSE") or name.endswith("/LICENSE") for name in wheel.namelist())


def test_every_node_has_a_program(wheel: ZipFile) -> None:
    text = wheel.read(f"bodycam_ros-{bodycam_ros.__version__}.dist-info/entry_points.txt").decode()
    assert {"bodycam", *NODES} <= set(re.findall(r"^(\w+) = bodycam_ros\.", text, re.MULTILINE))


def test_the_wheel_can_be_made_of_the_archive(dist: Path, wheel: ZipFile, tmp_path: Path) -> None:
    shutil.unpack_archive(next(dist.glob("*.tar.gz")), tmp_path)
    sources = next(tmp_path.iterdir())
    subprocess.run([sys.executable, "-c", BUILD], cwd=sources, check=True, capture_output=True, timeout=120)
    with ZipFile(next((sources / "dist").glob("*.whl"))) as again:
        assert set(again.namelist()) == set(wheel.namelist())
    assert (sources / "msg_defs/CMakeLists.txt").is_file(), "colcon builds the messages of it too"
