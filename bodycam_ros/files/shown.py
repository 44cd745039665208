"""Values and texts that came from a file, as they may be shown to a person: short, and without control characters."""

import reprlib
import string
import unicodedata
from collections.abc import Iterable
from difflib import get_close_matches
from typing import Any

_HIDDEN = {"Cc", "Cf", "Cs", "Co", "Cn", "Zl", "Zp"}
"""Unicode's categories of what a terminal obeys, or cannot show: controls, direction marks, lone surrogates."""


class _Shortened(reprlib.Repr):
    def __init__(self) -> None:
        super().__init__()
        self.maxlevel = 2
        self.maxdict = 3
        self.maxlist = 7
        self.maxtuple = 7
        self.maxset = 3
        self.maxstring = self.maxlong = self.maxother = 60

    def repr_int(self, x: int, level: int) -> str:
        # Python refuses to write out more than some thousand digits.
        return f"a number of {x.bit_length()} bits" if x.bit_length() > 4 * self.maxlong else repr(x)


_shortened = _Shortened()


def shown(value: Any) -> str:
    """A value as Python writes it, shortened: a message must not be as long as the file that it is about."""
    return _shortened.repr(value)


def few(names: Iterable[object], most: int = 3) -> str:
    """The first names, and the number of the others, short enough for one line."""
    listed = [str(name) for name in names]
    return ", ".join(listed[:most]) + (f" and {len(listed) - most} more" if len(listed) > most else "")


def other_than(name: object, known: Iterable[str], most: int = 24) -> str:
    """What follows on a name that is unknown: the one that was probably meant, else those that there are."""
    names = list(known)
    if alike := get_close_matches(str(name), names, n=1):
        return f"did you mean {printable(alike[0])}?"
    return f"there are {printable(few(names, most))}" if names else "there are none"


def shortened(text: str, most: int = 3500) -> str:
    """A message without its middle, if it is longer than anybody reads; the ends of a long path say which it is."""
    return text if len(text) <= most else f"{text[: most // 2]} [...] {text[-most // 2 :]}"


def printable(text: str) -> str:
    r"""Text whose control characters (all but line feed and tab) are written as escapes, as in ``\x1b[31m``.

    A topic's name could otherwise clear a terminal, or write to it what no program printed.
    """
    if text.isascii() and text.isprintable():
        return text
    return "".join(character if _harmless(character) else _escaped(character) for character in text)


def markdown_text(text: str) -> str:
    """Text as Markdown that shows it as it is, in one line.

    viser's page renders HTML in Markdown, scripts included; every sign of punctuation is written as a character
    reference, which neither Markdown nor HTML takes for markup.
    """
    line = " ".join(printable(text).split())
    return "".join(f"&#{ord(sign)};" if sign in string.punctuation else sign for sign in line)


def _harmless(character: str) -> bool:
    return character in "\n\t" or unicodedata.category(character) not in _HIDDEN


def _escaped(character: str) -> str:
    return character.encode("unicode_escape").decode("ascii")
