"""The ament_python package bodycam_ros; also installs with plain pip."""

from glob import glob

from setuptools import find_packages, setup

NAME = "bodycam_ros"

setup(
    name=NAME,
    version="0.1.0",
    description="Motion capture from body-mounted cameras: images in, a metric skeleton in the world out.",
    license="Apache-2.0",
    python_requires=">=3.11",
    packages=find_packages(include=[NAME, f"{NAME}.*"]),
    # bodycam_ros/msg links to msg_defs/msg: recordings are read and written without ROS, but with its messages.
    package_data={NAME: ["msg/*.msg", "py.typed"]},
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{NAME}"]),
        (f"share/{NAME}", ["package.xml"]),
        (f"share/{NAME}/config", glob("config/*.yaml") + glob("config/*.xml")),
        (f"share/{NAME}/launch", glob("launch/*.launch.py")),
    ],
    install_requires=[
        "gtsam>=4.3",
        "matplotlib>=3.6",
        "numpy>=1.26",
        "opencv-python-headless>=4.6",
        "pycolmap>=4",
        "PyYAML>=6",
        "rich>=13",
        "rosbags>=0.11",
        "scipy>=1.11",
        "threadpoolctl>=3",
        "viser>=1.1",
    ],
    extras_require={"test": ["pytest"]},
    zip_safe=False,
    entry_points={
        "console_scripts": [
            "bodycam = bodycam_ros.cli.main:main",
            "tracker = bodycam_ros.nodes.start:tracker",
            "registration = bodycam_ros.nodes.start:registration",
            "skeleton_solver = bodycam_ros.nodes.start:skeleton_solver",
            "player = bodycam_ros.nodes.start:player",
        ],
    },
)
