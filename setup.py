"""The ament_python package bodycam_ros; also installs with plain pip.

colcon and rosdep look for no package beneath a package, so they never see msg_defs/, the package bodycam_msgs. Under
colcon this file builds it too, into the same prefix; pip installs it on its own.
"""

import os
import re
import subprocess
import sys
from glob import glob
from pathlib import Path

from setuptools import find_packages, setup
from setuptools.command.develop import develop
from setuptools.command.install import install

NAME = "bodycam_ros"
# Beneath `colcon build --symlink-install` this file is a link in the build space.
SOURCES = Path(__file__).resolve().parent
INTERFACES = SOURCES / "msg_defs"
# The version is written in the package; the manifests of ROS, which compute nothing, repeat it (test_packaging.py).
VERSION = re.findall(r'^__version__ = "([^"]+)"$', (SOURCES / NAME / "__init__.py").read_text(), re.MULTILINE)[0]


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
    build = Path(command.get_finalized_command("build").build_base).resolve() / INTERFACES.name
    # Beneath it are the marker and the share folder of this package: the data files below.
    prefix = Path(command.get_finalized_command("install").install_data).resolve()
    configure = ["cmake", "-S", str(INTERFACES), "-B", str(build), f"-DCMAKE_INSTALL_PREFIX={prefix}"]
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


def ament_prefixes():
    """Where the ROS installation and the workspaces beneath this one are."""
    return [prefix for prefix in os.environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep) if prefix]


def cores():
    """How many compilers run at a time, as text."""
    return os.environ.get("CMAKE_BUILD_PARALLEL_LEVEL") or str(os.cpu_count() or 1)


setup(
    name=NAME,
    version=VERSION,
    description="Motion capture from body-mounted cameras: images in, a metric skeleton in the world out.",
    long_description=(SOURCES / "README.md").read_text(),
    long_description_content_type="text/markdown",
    author="bodycam_ros developers",
    author_email="bodycam_ros@example.org",
    license="Apache-2.0",
    license_files=["LICENSE"],
    python_requires=">=3.11,<3.14",
    keywords=["motion capture", "body-worn cameras", "skeleton", "ROS 2"],
    classifiers=[
        "Development Status :: 4 - Beta",
        "Environment :: Console",
        "Intended Audience :: Science/Research",
        "Operating System :: POSIX :: Linux",
        *(f"Programming Language :: Python :: {version}" for version in ("3", "3.11", "3.12", "3.13")),
        "Topic :: Multimedia :: Graphics :: 3D Modeling",
        "Topic :: Scientific/Engineering :: Image Processing",
        "Typing :: Typed",
    ],
    packages=find_packages(include=[NAME, f"{NAME}.*"]),
    # bodycam_ros/msg links to msg_defs/msg: recordings are read and written without ROS, but with its messages.
    # bodycam_ros/body/supplied links to config/equipment: what is supplied is found by its name.
    package_data={
        NAME: ["msg/*.msg", "py.typed"],
        f"{NAME}.body": ["supplied/*.yaml"],
        f"{NAME}.study": ["Snakefile"],
    },
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{NAME}"]),
        (f"share/{NAME}", ["package.xml"]),
        (f"share/{NAME}/config", [f for kind in ("yaml", "xml", "rviz", "json") for f in glob(f"config/*.{kind}")]),
        *((f"share/{NAME}/config/{kind}", glob(f"config/{kind}/*.yaml")) for kind in ("equipment", "robot")),
        (f"share/{NAME}/launch", glob("launch/*.launch.py")),
    ],
    install_requires=[
        "av>=17.1",
        "ezc3d>=1.7",
        "fast-simplification>=0.1.7",
        "matplotlib>=3.6",
        "numba>=0.68",
        "numpy>=1.26",
        "opencv-python-headless>=4.6",
        "pycolmap>=4",
        "PyYAML>=6",
        "rich>=13",
        "rosbags>=0.11",
        "scipy>=1.11",
        "setuptools>=65",
        "threadpoolctl>=3",
        "trimesh>=5",
        "viser>=1.1",
    ],
    extras_require={
        "test": ["pytest"],
        "robot": ["pin>=3", "pin-pink>=3", "daqp"],
        "study": ["snakemake>=9.15,<10"],
        "slurm": ["snakemake>=9.15,<10", "snakemake-executor-plugin-slurm>=2.8"],
        # ROS 2 Jazzy's wheels, where there is no ROS installation; a later distribution's do not fit bodycam_msgs.
        "ros": [f"bodycam-msgs=={VERSION}", "ros-rclpy[fastrtps]>=7.1.6,<8", "ros-common-interfaces>=5.3.6,<6"],
    },
    zip_safe=False,
    cmdclass={"install": InstallWithInterfaces, "develop": DevelopWithInterfaces},
    entry_points={
        "console_scripts": [
            "bodycam = bodycam_ros.cli.main:main",
            "tracker = bodycam_ros.nodes.start:tracker",
            "region_tracker = bodycam_ros.nodes.start:region_tracker",
            "registration = bodycam_ros.nodes.start:registration",
            "skeleton_solver = bodycam_ros.nodes.start:skeleton_solver",
            "retarget = bodycam_ros.nodes.start:retarget",
            "player = bodycam_ros.nodes.start:player",
            "graph = bodycam_ros.nodes.start:graph",
        ],
    },
)
