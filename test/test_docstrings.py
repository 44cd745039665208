"""Docstrings begin with their subject."""

import ast
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).parent.parent
FOLDERS = ("bodycam_ros", "benchmarks", "launch", "test", "test_ros")
HEADLESS = ("Of ", "That of", "Those of", "By how")
"""Beginnings of half a sentence, whose subject is in the name that the docstring is to explain."""


def docstrings(source: str) -> Iterator[tuple[int, str]]:
    """Line and text of each docstring of a module, its classes, functions and attributes."""
    for node in ast.walk(ast.parse(source)):
        for statement in getattr(node, "body", ()) if not isinstance(node, ast.Lambda | ast.IfExp) else ():
            value = getattr(statement, "value", None)
            if isinstance(statement, ast.Expr) and isinstance(value, ast.Constant) and isinstance(value.value, str):
                yield statement.lineno, value.value.strip()


def test_docstrings_are_found_wherever_they_are() -> None:
    source = '"""Module."""\nA = 1\n"""Of A."""\nclass B:\n    """B."""\n    def c(self):\n        """That of B."""\n'
    assert [text for _, text in sorted(docstrings(source))] == ["Module.", "Of A.", "B.", "That of B."]


def test_no_docstring_begins_without_its_subject() -> None:
    files = [file for folder in FOLDERS for file in sorted((ROOT / folder).rglob("*.py"))]
    assert len(files) > 500
    headless = [
        f"{file.relative_to(ROOT)}:{line}: {text.splitlines()[0]}"
        for file in files
        for line, text in docstrings(file.read_text())
        if text.startswith(HEADLESS)
    ]
    assert not headless, "\n".join(headless)
