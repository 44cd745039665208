"""Damage to a YAML file that stays YAML, or nearly: bombs, numbers, types, keys, and what a terminal would obey."""

import re
from collections.abc import Callable, Mapping

import numpy as np

Damage = Callable[[str, np.random.Generator], str]
"""(text, random) -> damaged text."""

_NUMBER = re.compile(r"(?<![\w.+-])[-+]?\d+\.?\d*(?:e[-+]?\d+)?(?![\w.])")
_WORD = re.compile(r"(?<=: )[a-z_]{3,}(?=[,}\n\]])")
_KEY = re.compile(r"[A-Za-z_]{3,}(?=: )")
_LIST = re.compile(r"\[[^\[\]]*\]")

ESCAPE = "\x1b]0;owned\x07\x1b[31m"
"""Names a terminal's window and turns it red, where a terminal gets it raw."""


def replaced(pattern: "re.Pattern[str]", replacement: str) -> Damage:
    """A damage that replaces one match, or appends where there is none."""

    def damage(text: str, random: np.random.Generator) -> str:
        found = list(pattern.finditer(text))
        if not found:
            return f"{text}\nodd: {replacement}\n"
        match = found[int(random.integers(len(found)))]
        return text[: match.start()] + replacement + text[match.end() :]

    return damage


def _bomb(levels: int) -> str:
    """Aliases of aliases: 9^levels values in a kilobyte."""
    lines = ["b0: &b0 [lol, lol, lol, lol, lol, lol, lol, lol, lol]"]
    for level in range(1, levels):
        lines.append(f"b{level}: &b{level} [{', '.join([f'*b{level - 1}'] * 9)}]")
    return "\n".join(lines)


def _bomb_as_value(text: str, random: np.random.Generator) -> str:
    """The bomb where the program expects something else, which it may want to print."""
    key = _top_key(text, random)
    body = re.sub(rf"(?ms)^{re.escape(key)}:.*?(?=^\S|\Z)", "", text)
    return f"{_bomb(8)}\n{key}: *b7\n{body}"


def _top_key(text: str, random: np.random.Generator) -> str:
    keys = re.findall(r"(?m)^(/?[\w*/]+):", text) or ["odd"]
    return str(keys[int(random.integers(len(keys)))])


def _top_value(value: str) -> Damage:
    """A damage that gives one key of the top another value."""

    def damage(text: str, random: np.random.Generator) -> str:
        key = _top_key(text, random)
        body = re.sub(rf"(?ms)^{re.escape(key)}:.*?(?=^\S|\Z)", "", text)
        return f"{body}\n{key}: {value}\n"

    return damage


def _many_keys(text: str, random: np.random.Generator) -> str:
    key = "report" if "cameras" in text and "joints" in text else "odd"
    lines = "\n".join(f"  key_{number}: {number}" for number in range(60_000))
    return re.sub(rf"(?ms)^{key}:.*?(?=^\S|\Z)", "", text) + f"\n{key}:\n{lines}\n"


def _twice(text: str, random: np.random.Generator) -> str:
    lines = text.splitlines(keepends=True)
    place = int(random.integers(len(lines)))
    return "".join(lines[: place + 1] + lines[place:])


def _a_line_less(text: str, random: np.random.Generator) -> str:
    lines = text.splitlines(keepends=True)
    del lines[int(random.integers(len(lines)))]
    return "".join(lines)


DAMAGES: Mapping[str, Damage] = {
    "deep lists": _top_value("[" * 3000 + "]" * 3000),
    "deep tables": _top_value("{a: " * 3000 + "1" + "}" * 3000),
    "deep and open": lambda text, random: "[" * 50_000,
    "alias bomb": _bomb_as_value,
    "alias of itself": _top_value("&self [*self]"),
    "table of itself": _top_value("&self {a: *self}"),
    "unknown alias": _top_value("*nobody"),
    "number of 5000 digits": replaced(_NUMBER, "9" * 5000),
    "number beyond float": replaced(_NUMBER, "1.0e+999"),
    "large number": replaced(_NUMBER, "1.0e+300"),
    "nan": replaced(_NUMBER, ".nan"),
    "inf": replaced(_NUMBER, "-.inf"),
    "text for a number": replaced(_NUMBER, "'many'"),
    "truth for a number": replaced(_NUMBER, "true"),
    "date for a number": replaced(_NUMBER, "2026-02-30"),
    "sixties for a number": replaced(_NUMBER, "190:20:30"),
    "null for a word": replaced(_WORD, "null"),
    "number for a word": replaced(_WORD, "7"),
    "table for a word": replaced(_WORD, "{a: b}"),
    "escape for a word": replaced(_WORD, f'"{ESCAPE}"'.replace("\x1b", "\\e").replace("\x07", "\\a")),
    "long word": replaced(_WORD, "x" * 300_000),
    "bytes for a word": replaced(_WORD, "!!binary /9j/4AAQ"),
    "a number as key": replaced(_KEY, "7"),
    "null as key": replaced(_KEY, "null"),
    "a date as key": replaced(_KEY, "2026-01-01"),
    "a list as key": replaced(_KEY, "? [a, b]\n"),
    "an escape as key": replaced(_KEY, '"\\e[31mred\\a"'),
    "empty list": replaced(_LIST, "[]"),
    "longer list": replaced(_LIST, "[0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0]"),
    "list of lists": replaced(_LIST, "[[[1]]]"),
    "null on top": _top_value("null"),
    "list on top": _top_value("[1, 2]"),
    "text on top": _top_value("nothing"),
    "object": _top_value("!!python/object/apply:os.getcwd []"),
    "tag": _top_value("!odd {a: b}"),
    "sixty thousand keys": _many_keys,
    "line twice": _twice,
    "line less": _a_line_less,
    "tabs": lambda text, random: text.replace("  ", "\t"),
    "two documents": lambda text, random: f"{text}\n---\n{text}",
    "only a number": lambda text, random: "42",
    "only a comment": lambda text, random: "# nothing",
    "UTF-16": lambda text, random: text.encode("utf-16").decode("latin-1"),
    "control characters": lambda text, random: text.replace(":", ":\x00", 1),
    "unclosed": lambda text, random: f"{text}\nodd: [1, 2",
}
