"""A clone beneath src/ of an ordinary workspace: ``colcon build`` without flags makes both packages."""

import os
import shutil
import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path

import pytest

REPOSITORY = Path(__file__).parent.parent
NOT_CLONED = (".git", ".venv*", ".*_cache", "__pycache__", "*.egg-info", "build", "install", "log", "out", "bags")
_BUILD_S, _SOON_S = 300.0, 60.0

LOOK = """
import bodycam_msgs, bodycam_ros, rclpy
from ament_index_python.packages import get_package_prefix, get_package_share_directory
from bodycam_msgs.msg import FeatureTracks
from rclpy.serialization import deserialize_message, serialize_message
sent = FeatureTracks(keyframe=True)
assert deserialize_message(serialize_message(sent), FeatureTracks) == sent
print(bodycam_msgs.__file__, bodycam_ros.__file__, get_package_prefix("bodycam_msgs"), sep="\\n")
print(get_package_share_directory("bodycam_ros") + "/launch/bodycam.launch.py")
from bodycam_ros.equipment.equipment_yaml import read_equipment
from bodycam_ros.equipment.supplied_equipment import equipment_path, supplied_equipment
assert [read_equipment(name).name for name in supplied_equipment()] == list(supplied_equipment())
print(get_package_share_directory("bodycam_ros") + "/config/equipment/bicycle.yaml")
print(get_package_share_directory("bodycam_ros") + "/config/robot/talos.yaml")
print(equipment_path("bicycle"))
"""


def _clean(**more: str) -> dict[str, str]:
    """An environment that knows the virtual environment's ROS and nothing else."""
    return {"PATH": f"{sys.prefix}/bin:/usr/bin:/bin", "HOME": "/nonexistent", "VIRTUAL_ENV": sys.prefix, **more}


def test_a_clone_under_src_builds_both_packages_without_flags(tmp_path: Path) -> None:
    for package in ("rclpy", "colcon_ros", "ament_package"):
        if find_spec(package) is None:
            pytest.skip(f"{package} is not installed; 'make test' installs it")
    shutil.copytree(REPOSITORY, tmp_path / "src" / "clone", symlinks=True, ignore=shutil.ignore_patterns(*NOT_CLONED))
    of_ros = _clean(AMENT_PREFIX_PATH=sys.prefix, CMAKE_PREFIX_PATH=sys.prefix)
    built = subprocess.run(
        ["nice", sys.executable, "-m", "colcon", "build"],
        cwd=tmp_path, env=of_ros, capture_output=True, text=True, timeout=_BUILD_S,
    )  # fmt: skip
    assert built.returncode == 0, built.stdout + built.stderr
    assert sorted(path.name for path in (tmp_path / "src" / "clone").iterdir()) == sorted(
        path.name for path in REPOSITORY.iterdir() if not any(path.match(pattern) for pattern in NOT_CLONED)
    ), "the sources stay clean"

    def sourced(command: str) -> "subprocess.CompletedProcess[str]":
        text = f'. "{tmp_path}/install/setup.bash" && {command}'
        return subprocess.run(
            ["bash", "-c", text], cwd="/", env=_clean(), capture_output=True, text=True, timeout=_SOON_S
        )

    looked = sourced(f"python3 -c '{LOOK}'")
    assert looked.returncode == 0, looked.stderr
    found = [Path(line) for line in looked.stdout.splitlines()]
    assert len(found) == 7 and all(path.is_relative_to(tmp_path / "install") and path.exists() for path in found)

    # Where `ros2 run` and launch files look; a node gets as far as its parameters.
    executables = tmp_path / "install/bodycam_ros/lib/bodycam_ros"
    assert {"tracker", "registration", "skeleton_solver", "player"} <= set(os.listdir(executables))
    refused = sourced(f'"{executables}/tracker"')
    assert refused.returncode == 1 and "the parameter 'camera' is missing" in refused.stderr, refused.stderr
