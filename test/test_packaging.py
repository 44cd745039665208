"""What several files say about the packages must agree."""

import re
import tomllib
from importlib.resources import files
from pathlib import Path
from xml.etree import ElementTree

import bodycam_ros

REPOSITORY = Path(__file__).parent.parent


def test_one_version_everywhere() -> None:
    stated = {
        "setup.py": re.findall(r'version="([^"]+)"', (REPOSITORY / "setup.py").read_text())[0],
        "msg_defs/pyproject.toml": tomllib.loads((REPOSITORY / "msg_defs/pyproject.toml").read_text())["project"][
            "version"
        ],
    }
    for manifest in ("package.xml", "msg_defs/package.xml"):
        stated[manifest] = ElementTree.parse(REPOSITORY / manifest).findtext("version") or ""
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
