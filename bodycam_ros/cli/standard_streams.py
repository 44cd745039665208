"""Standard input, output and error of a command: closed ones, full ones, and those whose reader has gone."""

import os
import sys
from contextlib import suppress
from io import BufferedWriter, FileIO, TextIOWrapper
from typing import Any

_OUTPUT, _ERROR = 1, 2


class _Stream(FileIO):
    """A standard stream. What cannot be written because nobody reads it any more is no failure of the work."""

    def __init__(self, descriptor: int) -> None:
        super().__init__(descriptor, "w", closefd=False)

    def write(self, content: Any) -> int:
        """Write bytes.

        Raises:
            OSError: standard output cannot be written to, as on a full disk; with its name.
        """
        try:
            return super().write(content)
        except OSError as error:
            discard(self.fileno())  # what is buffered would fail again when the program ends
            if isinstance(error, BrokenPipeError) or self.fileno() == _ERROR:
                return len(memoryview(content).cast("B"))
            raise OSError(error.errno, error.strerror, "standard output") from error


def secure_streams() -> None:
    """Make print() work whatever standard output and error are; names that are not UTF-8 can be printed.

    A descriptor that was closed is given to the null device: the next file that is opened would have it, and a library
    that prints would write into that file.
    """
    while (descriptor := os.open(os.devnull, os.O_RDWR)) <= _ERROR:
        os.set_inheritable(descriptor, True)
    os.close(descriptor)
    for number, name in ((_OUTPUT, "stdout"), (_ERROR, "stderr")):
        before = getattr(sys, name)
        if before is not None:
            with suppress(OSError):
                before.flush()
        encoding = "utf-8" if before is None else before.encoding
        stream = _Stream(number)
        # As Python has them: lines at once in a terminal, and of errors always.
        at_once = number == _ERROR or stream.isatty()
        text = TextIOWrapper(BufferedWriter(stream), encoding, "backslashreplace", line_buffering=at_once)
        setattr(sys, name, text)


def discard(descriptor: int) -> None:
    """Send what is still to be written to a descriptor nowhere."""
    with suppress(OSError):
        nowhere = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nowhere, descriptor)
        os.close(nowhere)


def discard_output() -> None:
    """Send what is still to be printed nowhere: the terminal, or the reader of a pipe, is gone."""
    discard(_OUTPUT)
    discard(_ERROR)
