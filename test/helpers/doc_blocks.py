"""Fenced blocks of the pages of docs/, and the mark in a comment above each that sets what tests do with it.

``<!-- run -->``: it is run on the sample. Without a mark its commands must be understood.
"""

import re
import shlex
from dataclasses import dataclass
from pathlib import Path

_BLOCK = re.compile(
    r"(?:^<!-- (?P<mark>[^\n]*?) -->\n)?^```(?P<language>\w+)\n(?P<text>.*?)^```$", re.MULTILINE | re.DOTALL
)
_RUN = "run"


@dataclass(frozen=True)
class DocBlock:
    """One block.

    Attributes:
        page: file name and line.
        language: after the fence.
        text: what is in it.
        is_run: whether it works as it stands, on the sample.
    """

    page: str
    language: str
    text: str
    is_run: bool

    @property
    def commands(self) -> list[list[str]]:
        """Words of each line."""
        lines = (shlex.split(line, comments=True) for line in self.text.splitlines())
        return [words for words in lines if words]


def doc_blocks(docs: Path) -> list[DocBlock]:
    """All blocks of shell commands and of Python.

    Raises:
        ValueError: a mark that is none.
    """
    blocks = []
    for path in sorted(docs.glob("*.md")):
        content = path.read_text()
        for found in _BLOCK.finditer(content):
            if found["language"] not in ("sh", "python"):
                continue
            where = f"{path.name}:{content[: found.start()].count(chr(10)) + 1}"
            if found["mark"] not in (None, _RUN):
                raise ValueError(f"{where}: {found['mark']} is no mark")
            blocks.append(DocBlock(where, found["language"], found["text"], found["mark"] == _RUN))
    return blocks


_FILE = re.compile(r"^```yaml\n# (?P<name>\w+\.yaml)\n(?P<text>.*?)^```$", re.MULTILINE | re.DOTALL)


def doc_files(docs: Path) -> dict[str, str]:
    """Name -> text of each block of YAML whose first line is a comment with the name of a file."""
    return {found["name"]: found["text"] for path in docs.glob("*.md") for found in _FILE.finditer(path.read_text())}
