"""What pages name of the code exists: functions of equations, files and folders, checks of a verdict, messages."""

import ast
import re
from pathlib import Path

REPOSITORY = Path(__file__).parents[2]
PAGE = (REPOSITORY / "docs/equations.md").read_text()
PACKAGE = REPOSITORY / "bodycam_ros"


def test_named_functions_exist() -> None:
    file, named = None, 0
    for word in re.findall(r"`([^`]+)`", PAGE):
        if word.endswith(".py"):
            file = PACKAGE / word
            assert file.is_file(), word
        elif word.endswith("/"):
            assert (PACKAGE / word).is_dir(), word
        else:
            assert file is not None, word
            assert re.search(rf"^ *(?:def|class) {word}\b", file.read_text(), re.MULTILINE), f"{file.name}: {word}"
            named += 1
    assert named > 20


def test_every_equation_of_both_papers_is_there() -> None:
    for section, last in zip(re.split(r"^## [AB]: ", PAGE, flags=re.MULTILINE)[1:], (17, 19), strict=True):
        found = set[int]()
        for cell in re.findall(r"^\| (\d[^|]*) \|", section, re.MULTILINE):
            numbers = [int(each) for each in re.findall(r"\d+", cell)]
            found |= set(range(numbers[0], numbers[-1] + 1)) if "to" in cell else set(numbers)
        assert found == set(range(1, last + 1))


def test_files_and_folders_of_the_architecture_exist() -> None:
    page = (REPOSITORY / "docs/architecture.md").read_text()
    named = {word for word in re.findall(r"`([\w/.]+)`", page) if word.endswith(".py") or "/" in word.lstrip("/")}
    there = {path.relative_to(root).as_posix() for root in (PACKAGE, REPOSITORY) for path in root.rglob("*.py")}
    there |= {file.rpartition("/")[2] for file in there}
    missing = {
        word
        for word in named
        if word not in there and not any((root / word).exists() for root in (REPOSITORY, PACKAGE)) and word[0] != "/"
    }
    assert len(named) > 30
    assert not missing


def test_messages_of_troubleshooting_are_in_the_code() -> None:
    sources = [ast.parse(path.read_text()) for path in PACKAGE.rglob("*.py")]
    texts = [
        "".join(part.value if isinstance(part, ast.Constant) else "…" for part in node.values)  # type: ignore[misc]
        if isinstance(node, ast.JoinedStr)
        else str(node.value)
        for source in sources
        for node in ast.walk(source)
        if isinstance(node, ast.Constant | ast.JoinedStr)
    ]
    code = "\n".join(texts)
    page = (REPOSITORY / "docs/troubleshooting.md").read_text()
    named = [
        word for line in re.findall(r"^\| (`.*?) \|", page, re.MULTILINE) for word in re.findall("`([^`]+)`", line)
    ]
    assert len(named) > 60
    assert {word for word in named if word not in code} == set()


def test_checks_of_a_result_are_on_the_page_for_programs() -> None:
    page = (REPOSITORY / "docs/roboticists.md").read_text()
    files = ("judge", "equipment_findings", "static_camera_findings")
    sources = "".join((PACKAGE / f"quality/{file}.py").read_text() for file in files)
    checks = set(re.findall(r'(?:check=|found\.append\(\()"(\w+)"', sources))
    assert len(checks) > 8
    assert {check for check in checks if f"`{check}`" not in page} == set()
