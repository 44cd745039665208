"""What several files say about the packages must agree."""

import ast
import re
import tomllib
from collections.abc import Iterator
from importlib.resources import files
from pathlib import Path
from xml.etree import ElementTree

import bodycam_ros

REPOSITORY = Path(__file__).parent.parent
OF_APT = {
    "python3-cryptography": "cryptography",
    "python3-matplotlib": "matplotlib",
    "python3-numpy": "numpy",
    "python3-opencv": "opencv-python-headless",
    "python3-rich": "rich",
    "python3-scipy": "scipy",
    "python3-yaml": "PyYAML",
}
"""Keys that rosdistro's rosdep/python.yaml has for Ubuntu 24.04, without pip -> the package that setup.py asks for."""

OPTIONAL = {"foxglove_msgs", "hri_msgs"}
"""ROS packages that nodes do without."""

NOT_RUN = {"setuptools", "wheel"}


def test_one_version_everywhere() -> None:
    stated = {
        manifest: ElementTree.parse(REPOSITORY / manifest).findtext("version")
        for manifest in ("package.xml", "msg_defs/package.xml")
    }
    assert stated == dict.fromkeys(stated, bodycam_ros.__version__)


def test_what_the_interfaces_need_is_declared_where_rosdep_looks() -> None:
    """It sees no package beneath a package, and neither does colcon: the outer one builds the inner one."""

    def needed(manifest: str, *kinds: str) -> set[str]:
        root = ElementTree.parse(REPOSITORY / manifest).getroot()
        return {each.text or "" for kind in kinds for each in root.iter(kind)}

    for kinds in (("buildtool_depend",), ("build_depend", "depend"), ("exec_depend", "depend")):
        assert needed("msg_defs/package.xml", *kinds) <= needed("package.xml", *kinds)
    assert "bodycam_msgs" not in needed("package.xml", "build_depend", "exec_depend", "depend")


def test_the_package_carries_the_definitions_that_cmake_builds() -> None:
    built = set(re.findall(r'"msg/(\w+\.msg)"', (REPOSITORY / "msg_defs/CMakeLists.txt").read_text()))
    carried = {f.name: f.read_text() for f in files("bodycam_ros").joinpath("msg").iterdir()}
    assert carried.keys() == built
    assert carried == {name: (REPOSITORY / "msg_defs/msg" / name).read_text() for name in built}


def test_every_pinned_requirement_is_the_constraint() -> None:
    constraints = (REPOSITORY / "constraints.txt").read_text().lower().replace("_", "-").splitlines()
    for path in REPOSITORY.glob("requirements*.txt"):
        for line in path.read_text().lower().replace("_", "-").splitlines():
            requirement = re.sub(r"\[.*?\]", "", line)
            if requirement and not requirement.startswith("#"):
                assert requirement in constraints, path.name


def pins(file: str) -> dict[str, str]:
    """Package -> version of a list of them."""
    lines = (REPOSITORY / file).read_text().splitlines()
    return dict(line.split("==") for line in lines if line and not line.startswith("#"))


def needed_by_setup() -> set[str]:
    return set(re.findall(r'^        "([\w-]+)>=', (REPOSITORY / "setup.py").read_text(), re.MULTILINE))


def test_on_ubuntu_apt_and_pip_share_what_is_needed() -> None:
    manifest = ElementTree.parse(REPOSITORY / "package.xml").getroot()
    keys = {each.text or "" for each in manifest.iter("exec_depend")}
    assert {key for key in keys if key.startswith("python3-")} == OF_APT.keys()
    by_pip = pins("requirements-ubuntu.txt").keys()
    assert needed_by_setup() == pins("requirements.txt").keys() - NOT_RUN == by_pip | set(OF_APT.values())
    assert not by_pip & set(OF_APT.values())


def test_ubuntu_has_the_versions_that_are_tested() -> None:
    tested, on_ubuntu = pins("constraints.txt"), pins("constraints-ubuntu.txt")
    assert pins("requirements-ubuntu.txt").items() <= on_ubuntu.items()
    assert {name for name in on_ubuntu if on_ubuntu[name] != tested[name]} == set(OF_APT.values()) - {
        "opencv-python-headless"  # apt's has another name, so no wheel asks for it
    }


def imported(file: Path) -> Iterator[str]:
    """The packages that a file imports, in functions too, and those whose messages it names."""
    yield from re.findall(r'"(\w+)/(?:msg|srv|action)/\w+"', file.read_text())
    for node in ast.walk(ast.parse(file.read_text())):
        if isinstance(node, ast.Import):
            yield from (alias.name.split(".")[0] for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.module:
            yield node.module.split(".")[0]


def test_the_wheel_of_the_messages_asks_for_what_they_are_made_of() -> None:
    manifest = ElementTree.parse(REPOSITORY / "msg_defs/package.xml").getroot()
    declared = {f"ros-{each.text}".replace("_", "-") for each in manifest.iter("depend")}
    asked = tomllib.loads((REPOSITORY / "msg_defs/pyproject.toml").read_text())["project"]["dependencies"]
    tested, ranges = pins("constraints.txt"), dict(each.split("~=") for each in asked)
    assert ranges.keys() == declared
    assert {name: tested[name] for name in ranges} == ranges


def test_rosdep_finds_every_ros_package_that_is_imported() -> None:
    manifest = ElementTree.parse(REPOSITORY / "package.xml").getroot()
    declared = {each.text for kind in ("depend", "exec_depend") for each in manifest.iter(kind)}
    ros = re.compile(r"rclpy|launch\w*|tf2_ros|ament_index_python|\w+_(msgs|srvs|interfaces)")
    sources = [*(REPOSITORY / "bodycam_ros/nodes").rglob("*.py"), *(REPOSITORY / "launch").glob("*.py")]
    found = {package for file in sources for package in imported(file) if ros.fullmatch(package)}
    assert {"rclpy", "sensor_msgs", "launch_ros"} <= found
    assert found - {"bodycam_msgs"} - OPTIONAL <= declared
