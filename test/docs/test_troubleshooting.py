"""What troubleshooting quotes is what the program says."""

import ast
import re
from pathlib import Path

REPOSITORY = Path(__file__).parents[2]
NOT_SAID = {"--force"}


def said_by_the_program() -> list[str]:
    """Every text in the code, and every piece of one between what is filled in."""
    said = []
    for path in (REPOSITORY / "bodycam_ros").rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, ast.Constant) and isinstance(node.value, str):
                said.append(node.value)
    return said


def test_every_message_is_in_the_code() -> None:
    text = (REPOSITORY / "docs/troubleshooting.md").read_text()
    rows = [line for line in text.splitlines() if line.startswith("| `")]
    quoted = [quote for row in rows for quote in re.findall(r"`([^`]+)`", row.split(" | ")[0])]
    assert len(rows) > 40
    said = said_by_the_program()
    unknown = [quote for quote in quoted if quote not in NOT_SAID and not any(quote in each for each in said)]
    assert unknown == []


def test_every_cause_of_the_verdict_is_explained() -> None:
    """A new cause needs a line, by what it says is the matter or by what to do."""
    quotes = re.findall(r"`([^`]+)`", (REPOSITORY / "docs/troubleshooting.md").read_text())
    tree = ast.parse((REPOSITORY / "bodycam_ros/verdict/cause.py").read_text())
    causes = [node for node in ast.walk(tree) if isinstance(node, ast.Call) and getattr(node.func, "id", "") == "Cause"]
    assert len(causes) >= 7
    for cause in causes:
        texts = [node.value for node in ast.walk(cause) if isinstance(node, ast.Constant)]
        assert any(len(quote) > 8 and quote in text for text in texts for quote in quotes), texts
