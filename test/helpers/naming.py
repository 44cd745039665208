"""Tests of errors and findings by their type and by what they name (a camera, a file, a number), not by wording."""

import re
from collections.abc import Iterator
from contextlib import contextmanager

import pytest

_NUMBER = re.compile(r"(?<![\w.])[-+]?\d+(?:\.\d+)?(?:e[-+]?\d+)?(?!\w)")


def names(text: str, thing: object) -> bool:
    """Whether a text names a thing as a whole: ``left_knee`` does not name ``left``, nor does ``12.5`` name ``2``."""
    return re.search(rf"(?<!\w)(?<!\d\.){re.escape(str(thing))}(?!\w)(?!\.\w)", text) is not None


def numbers(text: str) -> list[float]:
    """The numbers in a text, in their order; digits of a name (``take_2``) are none."""
    return [float(number) for number in _NUMBER.findall(text)]


@contextmanager
def naming(
    error: type[BaseException] | tuple[type[BaseException], ...], *things: object
) -> Iterator[pytest.ExceptionInfo[BaseException]]:
    """An error of this type has to be raised, and its message has to name each thing.

    Raises:
        Failed: no such error was raised.
        AssertionError: the message does not name a thing; it is shown with those that are missing.
    """
    assert things, "what should the message name?"
    with pytest.raises(error) as caught:
        yield caught
    message = str(caught.value)
    missing = [thing for thing in things if not names(message, thing)]
    assert not missing, f"the message does not name {missing}: {message}"
