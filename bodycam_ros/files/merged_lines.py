"""Remarks of one kind on many cameras as one line with their number: a person reads the first and skips the rest."""

import re
from collections.abc import Iterable

_SUBJECT = re.compile(r"(?P<kind>camera|joint|segment) (?P<name>[^:;\n]+): (?P<text>.+)", re.DOTALL)
_FIGURE = re.compile(r"[-+]?\d+(\.\d+)?")
_LEAST_UNLIKE = 3  # lines that differ in their figures alone: of two, both are read


def merge_lines(lines: Iterable[str]) -> list[str]:
    """Lines in the order given, in which those of one kind are one line, where the first of them was.

    Equal remarks on several subjects, as ``camera head: has no sound``, become ``each of 3 cameras (head, shin_left,
    foot_left): has no sound``. Where three or more differ in their figures or in their own name alone, the first is
    kept and the others are counted and named after it, segments with their figures: when each was lost. Equal lines are
    one.

    Args:
        lines: each about one subject, named at its start, or about none.
    """
    groups: dict[object, list[tuple[str, str, str, str]]] = {}
    for line in dict.fromkeys(lines):
        found = _SUBJECT.fullmatch(line)
        if found is None:
            groups[line] = [("", "", "", line)]
            continue
        kind, name, text = found.group("kind", "name", "text")
        pattern = _FIGURE.sub("#", text.replace(name, "@"))
        groups.setdefault((kind, pattern), []).append((kind, name, text, line))
    return [merged for group in groups.values() for merged in _merged(group)]


def _merged(group: list[tuple[str, str, str, str]]) -> list[str]:
    kind, _, text, line = group[0]
    if len(group) == 1:
        return [line]
    names = [each[1] for each in group]
    if len({each[2] for each in group}) == 1:
        return [f"each of {len(names)} {kind}s ({', '.join(names)}): {text}"]
    if len(group) < _LEAST_UNLIKE:
        return [each[3] for each in group]
    others = [f"{name} ({_figures(text)})" if kind == "segment" else name for _, name, text, _ in group[1:]]
    return [f"{line}; likewise {len(names) - 1} more {kind}s: {', '.join(others)}"]


def _figures(text: str) -> str:
    """The words from the first figure of a text to the unit of the last one."""
    words = text.split(" ")
    figures = [row for row, word in enumerate(words) if _FIGURE.search(word)]
    return " ".join(words[figures[0] : figures[-1] + 2]).strip(".,:;")
