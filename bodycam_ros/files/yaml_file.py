"""The one reader of YAML: bodies, rigs, maps, settings, cameras and boards.

A file may come from anybody, so it is looked at event by event before anything is made of it. What could take a
program's memory, time or stack is refused with the line that it is in: a device or pipe, megabytes, nesting by the
thousand, aliases that multiply, numbers of thousands of digits.
"""

import os
import re
import stat
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final

import yaml

from bodycam_ros.errors import BodycamError
from bodycam_ros.files.shown import shown

MOST_BYTES = 16_000_000
MOST_NODES = 200_000  # a body has a thousand, the map of a thousand photographs six thousand
DEEPEST = 50
_OPENCV_FIRST = "%YAML:1.0"
"""First line of OpenCV's files, which YAML has not."""

_LONGEST_NUMBER = 300  # characters; the largest float has 309 digits

_KINDS: Final[Mapping[str, Callable[[dict[Any, Any]], bool]]] = {
    "body file": lambda table: isinstance(table.get("segments"), list) and "joints" in table,
    "rig file": lambda table: set(table) == {"cameras", "segments"} and isinstance(table["segments"], dict),
    "equipment file": lambda table: {"segments", "attachments"} <= set(table),
    "camera_info YAML": lambda table: {"image_width", "camera_matrix"} <= set(table),
    "board description": lambda t: {"family", "corners_in_board"} <= set(t) or {"columns", "square_size_m"} <= set(t),
    "settings file": lambda table: "/**" in table,
    "study file": lambda table: {"recordings", "subjects"} <= set(table),
    "summary of a map": lambda table: {"metric", "gravity_aligned"} <= set(table),
}
"""Kind -> whether a document is of it. No two kinds share what they are recognised by. One key is not enough: cameras,
segments and points have names of a user's choice."""

_BaseLoader: Any = getattr(yaml, "CSafeLoader", yaml.SafeLoader)  # libyaml, some ten times faster


def read_yaml(path: Path | str, what: str, error_type: type[BodycamError]) -> Any:
    """The document in a YAML file, made of plain values only.

    Args:
        path: the file.
        what: it is, for messages: "rig file".
        error_type: of what is raised.

    Raises:
        BodycamError: of ``error_type``: the file cannot be read, is not YAML, is of another kind than ``what``, or not
            of a size that a person's file could have; the message names the file and the line.
    """
    text = read_text(path, what, error_type)
    try:
        return yaml_document(text, what, error_type)
    except error_type as error:
        raise error_type(f"{path}: {error}") from error


def read_text(path: Path | str, what: str, error_type: type[BodycamError], most_bytes: int = MOST_BYTES) -> str:
    """The text of a regular file of at most ``most_bytes``.

    Raises:
        BodycamError: of ``error_type``; the message names the file.
    """
    content = read_bytes(path, what, error_type, most_bytes)
    try:
        return content.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = content.count(b"\n", 0, error.start) + 1
        raise error_type(f"{path}: cannot read this {what}: line {line} is not UTF-8") from error


def read_bytes(path: Path | str, what: str, error_type: type[BodycamError], most_bytes: int) -> bytes:
    """The content of a regular file; raises as ``read_text`` does."""
    try:
        # Without waiting until a pipe is written to.
        descriptor = os.open(path, os.O_RDONLY | os.O_NONBLOCK | os.O_CLOEXEC)
        with open(descriptor, "rb") as file:
            status = os.fstat(descriptor)
            if not stat.S_ISREG(status.st_mode):
                raise error_type(f"{path}: cannot read this {what}: it is a folder, pipe or device, not a file")
            # Python makes room for all that is asked for before it reads.
            content = file.read(min(most_bytes, status.st_size) + 1)
    except IsADirectoryError as error:
        raise error_type(f"{path}: cannot read this {what}: it is a folder, not a file") from error
    except (OSError, ValueError) as error:  # ValueError: a name with a null character
        raise error_type(f"{path}: cannot read this {what}: {getattr(error, 'strerror', None) or error}") from error
    if len(content) > most_bytes:
        raise error_type(f"{path}: cannot read this {what}: it has more than {most_bytes // 1_000_000} MB")
    return content


def yaml_document(text: str, what: str, error_type: type[BodycamError]) -> Any:
    """The document in a YAML text; raises as ``read_yaml`` does, without the file's name."""
    if text.startswith(_OPENCV_FIRST):
        text = "#" + text
    try:
        _Inspection().inspect(text)
        document = yaml.load(text, Loader=_Loader)
    except yaml.YAMLError as error:
        raise error_type(f"this {what} is not YAML: {_told(error, text)}") from error
    if isinstance(document, dict):
        kind = next((kind for kind, is_of_it in _KINDS.items() if is_of_it(document)), what)
        if kind != what:
            raise error_type(f"expected {_one(what)}, but this is {_one(kind)}")
    return document


def _one(kind: str) -> str:
    return f"an {kind}" if kind[0] in "aeiou" else f"a {kind}"


class _Loader(_BaseLoader):  # type: ignore[misc]
    """Makes dicts, lists, texts, numbers, dates; nothing else."""

    def construct_object(self, node: yaml.Node, deep: bool = False) -> Any:
        kind = node.tag.rpartition(":")[2]
        if kind in ("int", "float") and len(node.value) > _LONGEST_NUMBER:
            raise _fault(f"a number of {len(node.value)} characters", node.start_mark)
        try:
            return super().construct_object(node, deep)
        except yaml.YAMLError:
            raise
        except Exception as error:  # PyYAML checks the forms of dates and tags by nothing but what goes wrong
            raise _fault(f"{shown(node.value)} makes no {kind}", node.start_mark) from error


# Matrices of OpenCV are tables of rows, cols, dt and data.
_Loader.add_constructor("tag:yaml.org,2002:opencv-matrix", _BaseLoader.construct_yaml_map)

# PyYAML takes 1e-4 for text, as it has no point.
_Loader.add_implicit_resolver(
    "tag:yaml.org,2002:float", re.compile(r"[-+]?\d+[eE][-+]?\d+$", re.ASCII), [*"-+0123456789"]
)


@dataclass
class _Open:
    """A list or table that was opened.

    Attributes:
        anchor: its name for aliases, if any.
        before: nodes counted before it.
        keys: of a table, those so far; None in a list.
        key_comes: of a table, whether a key comes next, not a value.
    """

    anchor: str | None
    before: int
    keys: set[str] | None
    key_comes: bool = True


@dataclass
class _Inspection:
    """Goes through a document's events; nodes that an alias repeats count each time."""

    nodes: int = 0
    size_of: dict[str, int] = field(default_factory=dict)
    open: list[_Open] = field(default_factory=list)

    def inspect(self, text: str) -> None:
        """Refuse a document that is too deep or too large, or in which a table has one name twice.

        Raises:
            yaml.YAMLError: it is, or it is not YAML.
        """
        for event in yaml.parse(text, Loader=_Loader):
            if isinstance(event, yaml.ScalarEvent):
                self._take(event, event.value)
                self._count(1, event)
                if event.anchor:
                    self.size_of[event.anchor] = 1
            elif isinstance(event, yaml.AliasEvent):
                self._take(event, None)
                if event.anchor not in self.size_of:
                    raise _fault(f"*{event.anchor} stands for nothing before it, or for itself", event.start_mark)
                self._count(self.size_of[event.anchor], event)
            elif isinstance(event, yaml.CollectionStartEvent):
                self._take(event, None)
                keys: set[str] | None = set() if isinstance(event, yaml.MappingStartEvent) else None
                self.open.append(_Open(event.anchor, self.nodes, keys))
                self._count(1, event)
                if len(self.open) > DEEPEST:
                    raise _fault(f"lists or tables more than {DEEPEST} deep", event.start_mark)
            elif isinstance(event, yaml.CollectionEndEvent):
                ended = self.open.pop()
                if ended.anchor:
                    self.size_of[ended.anchor] = self.nodes - ended.before

    def _take(self, event: yaml.NodeEvent, name: str | None) -> None:
        """Note a key or a value of the table that it is in; PyYAML would keep the last of two without a word."""
        if not self.open or (table := self.open[-1]).keys is None:
            return
        if table.key_comes and name is not None:
            if name in table.keys:
                raise _fault(f"{shown(name)} is listed twice; names must differ", event.start_mark)
            table.keys.add(name)
        table.key_comes = not table.key_comes

    def _count(self, nodes: int, event: yaml.Event) -> None:
        self.nodes += nodes
        if self.nodes > MOST_NODES:
            raise _fault(f"more than {MOST_NODES} values, those that aliases repeat included", event.start_mark)


def _fault(problem: str, mark: Any) -> yaml.MarkedYAMLError:
    return yaml.MarkedYAMLError(problem=problem, problem_mark=mark)


def _yaml_remedy(problem: str, text: str, line: int) -> str:
    """What to do about the slips that people who are new to YAML make; else nothing."""
    lines = text.splitlines()
    if "\t" in "".join(lines[line : line + 1]):
        return "; the line has a tab: indent it with spaces"
    if problem.startswith("mapping values are not allowed") and line > 0:
        return "; end the name in the line before with a colon, or indent this line less"
    return ""


def _told(error: Exception, text: str) -> str:
    """Where and what in one line."""
    if isinstance(error, yaml.MarkedYAMLError) and error.problem_mark is not None:
        context = f"{error.context}: " if error.context else ""
        line = error.problem_mark.line
        return f"line {line + 1}: {context}{error.problem}{_yaml_remedy(str(error.problem), text, line)}"
    return " ".join(str(error).split())
