"""The shape of the package: who may import whom."""

import ast
import re
import sys
import tomllib
from collections import defaultdict
from collections.abc import Iterator
from importlib.metadata import packages_distributions
from pathlib import Path
from xml.etree import ElementTree

PACKAGE = Path(__file__).parent.parent / "bodycam_ros"
ROS = {"rclpy", "builtin_interfaces", "bodycam_msgs", "ament_index_python", "launch", "launch_ros", "tf2_ros"}
MESSAGES = re.compile(r"\w+_(msgs|srvs|interfaces)")


OTHER_NAMES = {"pinocchio": "pin", "coal": "coal", "ai_edge_litert": "ai-edge-litert"}
"""Modules -> distributions of which Python's records do not say it: in a folder of their own, or not installed."""

USED_BY_OTHERS = {
    "daqp": "the solver that pin-pink is given by name",
    "fast-simplification": "trimesh decimates scans with it",
    "networkx": "trimesh turns the faces of scans outward with it",
    "snakemake-executor-plugin-slurm": "Snakemake submits to Slurm with it",
}
"""Dependencies that no file imports, and why."""


def files() -> list[Path]:
    return sorted(PACKAGE.rglob("*.py"))


def room(file: Path) -> str:
    """The folder beneath the package that a file is in, or the file itself."""
    return file.relative_to(PACKAGE).parts[0].removesuffix(".py")


def imports(file: Path) -> Iterator[str]:
    """Modules, in functions too, as dotted names; of ``from a import b`` it is ``a.b``."""
    for node in ast.walk(ast.parse(file.read_text())):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{file}: relative import"
            yield from (f"{node.module}.{alias.name}" for alias in node.names)


def rooms_imported() -> dict[str, set[str]]:
    graph: dict[str, set[str]] = defaultdict(set)
    for file in files():
        for module in imports(file):
            top, _, rest = module.partition(".")
            if top == PACKAGE.name and rest and rest.split(".")[0] != room(file):
                graph[room(file)].add(rest.split(".")[0])
    return graph


def circle(graph: dict[str, set[str]]) -> list[str]:
    """A path that ends where it began, if there is one."""
    done: set[str] = set()

    def search(path: list[str]) -> list[str]:
        for following in sorted(graph.get(path[-1], ())):
            if following in path:
                return [*path[path.index(following) :], following]
            if following not in done and (found := search([*path, following])):
                return found
        done.add(path[-1])
        return []

    return next((found for start in sorted(graph) if start not in done and (found := search([start]))), [])


def files_imported() -> dict[str, set[str]]:
    """Module -> the modules of the package that it imports, in functions too; the package itself is none."""
    modules = {
        ".".join(file.relative_to(PACKAGE.parent).with_suffix("").parts).removesuffix(".__init__"): file
        for file in files()
    }
    del modules[PACKAGE.name]
    graph = {}
    for module, file in modules.items():
        longest = ((name, name.rpartition(".")[0]) for name in imports(file))
        graph[module] = {next((n for n in names if n in modules), module) for names in longest} - {module}
    return graph


def test_no_folders_import_in_a_circle() -> None:
    assert circle({"a": {"b"}, "b": {"c", "d"}, "d": {"b"}}) == ["b", "d", "b"]
    graph = rooms_imported()
    assert graph["estimation"] >= {"registration", "body"}
    assert not circle(graph), " imports ".join(circle(graph))


def test_no_files_import_in_a_circle() -> None:
    graph = files_imported()
    assert "bodycam_ros.estimation.estimator" in graph["bodycam_ros.pipeline.skeleton"]
    assert not circle(graph), " imports ".join(circle(graph))


def test_what_shows_does_not_import_what_measures() -> None:
    graph = rooms_imported()
    for folder in ("calibration", "viewer", "results"):
        assert "evaluate" not in graph[folder], folder


def test_ros_is_imported_by_nodes_alone() -> None:
    found = defaultdict(set)
    for file in files():
        for top in (module.split(".")[0] for module in imports(file)):
            if top in ROS or MESSAGES.fullmatch(top):
                found[room(file)].add(top)
    assert "rclpy" in found["nodes"]
    assert set(found) == {"nodes"}, found
    manifest = ElementTree.parse(PACKAGE.parent / "package.xml").getroot()
    assert found["nodes"] <= {each.text for each in manifest if each.tag.endswith("depend")} | {"bodycam_msgs"}


def declared(section: list[str]) -> set[str]:
    """Names of distributions in a list of requirements."""
    return {re.split("[<>=; ]", each)[0].lower() for each in section}


def project() -> dict[str, dict[str, list[str]]]:
    """Dependencies as pyproject.toml has them: of the package, of its extras and of groups, and those of its build."""
    read = tomllib.loads((PACKAGE.parent / "pyproject.toml").read_text())
    return {
        "extras": {"": read["project"]["dependencies"], **read["project"]["optional-dependencies"]},
        "groups": {**read["dependency-groups"], "build": read["build-system"]["requires"]},
    }


def test_what_is_imported_is_declared_and_what_is_declared_is_imported() -> None:
    dependencies = {name for section in project()["extras"].values() for name in declared(section)}
    distributions = {module: {name.lower() for name in names} for module, names in packages_distributions().items()}
    imported, undeclared = set(), set()
    for file in files():
        for top in {module.split(".")[0] for module in imports(file)}:
            if top in sys.stdlib_module_names | ROS | {PACKAGE.name} or MESSAGES.fullmatch(top):
                continue
            known = distributions.get(top, {OTHER_NAMES.get(top, top)}) & dependencies
            imported |= known
            undeclared |= set() if known else {f"{file.relative_to(PACKAGE)} imports {top}"}
    assert undeclared == set()
    assert dependencies - imported == set(USED_BY_OTHERS)


def test_ubuntu_has_every_package_from_apt_or_from_pypi() -> None:
    """As docs/install.md and the Dockerfile install them: by package.xml, and by the group ``ubuntu``."""
    needed = declared(project()["extras"][""]) | declared(project()["groups"]["build"]) - {"setuptools"}
    manifest = ElementTree.parse(PACKAGE.parent / "package.xml").getroot()
    other_names = {"yaml": "pyyaml", "opencv": "opencv-python-headless"}
    of_apt = {str(each.text).removeprefix("python3-") for each in manifest if str(each.text).startswith("python3-")}
    of_pypi = declared(project()["groups"]["ubuntu"])
    assert needed == ({other_names.get(each, each) for each in of_apt} - {"pytest"}) | of_pypi
    page = (PACKAGE.parent / "docs/install.md").read_text()
    assert {each for each in of_pypi if f"`{each}`" not in page} == set()
    build = project()["groups"]["build"]
    assert {each for each in build if each.startswith("numba")} <= {*project()["groups"]["ubuntu"]}


def test_the_pipeline_knows_nothing_of_verdicts_and_messages_nothing_of_the_estimator() -> None:
    graph = rooms_imported()
    assert "quality" not in graph["pipeline"] | graph["estimation"]
    assert "estimation" not in graph["messages"]
    drawing = {"matplotlib", "jinja2"}
    for file in files():
        if room(file) in ("calibration", "mapping", "estimation", "registration", "static_cameras"):
            assert not drawing & {module.split(".")[0] for module in imports(file)}, file


def test_tests_are_in_the_folder_of_the_room_that_they_test() -> None:
    rooms = {folder.name for folder in PACKAGE.iterdir() if folder.is_dir()} | {"docs", "faults", "helpers"}
    folders = {folder.name for folder in Path(__file__).parent.iterdir() if folder.is_dir()} - {"__pycache__"}
    assert folders <= rooms, folders - rooms
