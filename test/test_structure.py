"""The shape of the package: who may import whom, and how long a file may be."""

import ast
import re
from collections import defaultdict
from collections.abc import Iterator
from pathlib import Path

PACKAGE = Path(__file__).parent.parent / "bodycam_ros"
MOST_LINES = 300
ROS = {"rclpy", "builtin_interfaces", "bodycam_msgs", "ament_index_python", "launch", "launch_ros", "tf2_ros"}
MESSAGES = re.compile(r"\w+_(msgs|srvs|interfaces)")


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


def test_no_folders_import_in_a_circle() -> None:
    assert circle({"a": {"b"}, "b": {"c", "d"}, "d": {"b"}}) == ["b", "d", "b"]
    graph = rooms_imported()
    assert graph["estimation"] >= {"registration", "body"}
    assert not circle(graph), " imports ".join(circle(graph))


def test_what_shows_does_not_import_what_measures() -> None:
    graph = rooms_imported()
    for folder in ("calibration", "view", "drawing", "solved"):
        assert "evaluate" not in graph[folder], folder


def test_ros_is_imported_by_nodes_alone() -> None:
    found = defaultdict(set)
    for file in files():
        for top in (module.split(".")[0] for module in imports(file)):
            if top in ROS or MESSAGES.fullmatch(top):
                found[room(file)].add(top)
    assert "rclpy" in found["nodes"]
    assert set(found) == {"nodes"}, found
