"""Builds the kernels, and what ament and colcon want; name, version, dependencies and scripts are in pyproject.toml.

colcon and rosdep look for no package beneath a package, so they see msg_defs/, the package bodycam_msgs, only by a link
beside this one (docs/install.md). Without the link this file builds it too under colcon, into the same prefix; pip
installs it on its own.
"""

import os
import subprocess
import sys
from glob import glob
from pathlib import Path

from setuptools import setup
from setuptools.command.develop import develop
from setuptools.command.install import install

NAME = "bodycam_ros"
# Beneath `colcon build --symlink-install` this file is a link in the build space.
SOURCES = Path(__file__).resolve().parent
INTERFACES = SOURCES / "msg_defs"
sys.path.insert(0, str(SOURCES))  # which builds from pyproject.toml leave out

from compile_kernels import LIBRARY, CompileKernels  # noqa: E402


class InstallWithInterfaces(install):
    """``colcon build``."""

    def run(self):
        """Install the interfaces as well."""
        super().run()
        install_interfaces(self)


class DevelopWithInterfaces(develop):
    """``colcon build --symlink-install``."""

    def run(self):
        """Install the interfaces as well."""
        super().run()
        if not self.uninstall:
            install_interfaces(self)


def install_interfaces(command):
    """Configure, build and install bodycam_msgs where colcon installs this package; without colcon do nothing."""
    if "COLCON" not in os.environ:
        return
    own = Path(command.get_finalized_command("install").install_data).resolve()
    if any(is_built_beside(prefix, own) for prefix in ament_prefixes()):
        return
    build = Path(command.get_finalized_command("build").build_base).resolve() / INTERFACES.name
    # Beneath it are the marker and the share folder of this package: the data files below.
    configure = ["cmake", "-S", str(INTERFACES), "-B", str(build), f"-DCMAKE_INSTALL_PREFIX={own}"]
    configure += ["-DBUILD_TESTING=OFF", f"-DCMAKE_PREFIX_PATH={';'.join(ament_prefixes())}"]
    for step in (
        configure,
        ["cmake", "--build", str(build), "--parallel", cores()],
        ["cmake", "--install", str(build)],
    ):
        try:
            subprocess.run(step, check=True)
        except FileNotFoundError:
            sys.exit("building bodycam_msgs needs CMake and a C++ compiler: sudo apt install cmake g++")
        except subprocess.CalledProcessError as error:
            sys.exit(f"bodycam_msgs could not be built ({' '.join(step[:2])} ended with {error.returncode}); see above")


def is_built_beside(prefix, own):
    """Whether the workspace has bodycam_msgs as a package of its own, by a link to msg_defs/, installed beside this."""
    return Path(prefix).resolve() == own.parent / "bodycam_msgs"


def ament_prefixes():
    """Where the ROS installation and the workspaces beneath this one are."""
    return [prefix for prefix in os.environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep) if prefix]


def cores():
    """How many compilers run at a time, as text."""
    return os.environ.get("CMAKE_BUILD_PARALLEL_LEVEL") or str(os.cpu_count() or 1)


built = setup(
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{NAME}"]),
        (f"share/{NAME}", ["package.xml"]),
        (f"share/{NAME}/config", [f for kind in ("yaml", "xml", "rviz", "json") for f in glob(f"config/*.{kind}")]),
        *((f"share/{NAME}/config/{kind}", glob(f"config/{kind}/*.yaml")) for kind in ("equipment", "robot")),
        (f"share/{NAME}/launch", glob("launch/*.launch.py")),
    ],
    zip_safe=False,
    ext_modules=[LIBRARY],
    cmdclass={"build_ext": CompileKernels, "install": InstallWithInterfaces, "develop": DevelopWithInterfaces},
)
# colcon evaluates what the distribution prints, and setuptools makes an object of requires-python.
built.python_requires = built.metadata.python_requires = str(built.python_requires)
