"""A value of a study file with its way to it, so that every message says which key of which file is meant."""

import re
from collections.abc import Collection, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NoReturn

from bodycam_ros.errors import StudyError
from bodycam_ros.shown import shown

PLAIN_NAME = re.compile(r"[\w-][\w.-]{0,99}")
"""What may be a folder's name everywhere, and needs no quotes in a shell."""


@dataclass(frozen=True)
class StudyField:
    """A value.

    Attributes:
        file: the study file.
        key: of the value, as "recordings[2].place"; "" of the whole document.
        value: as it was read.
    """

    file: Path
    key: str
    value: Any

    def refuse(self, problem: str) -> NoReturn:
        """Say what is wrong with it.

        Raises:
            StudyError: always.
        """
        raise StudyError(f"{self.file}: {self.key}: {problem}" if self.key else f"{self.file}: {problem}")

    def table(self, known: Collection[str], needed: Collection[str] = ()) -> dict[str, "StudyField"]:
        """Its fields.

        Raises:
            StudyError: it is no table, lacks a key, or has one that nobody reads.
        """
        fields = dict(self.named())
        for key, field in fields.items():
            if key not in known:
                field.refuse(f"is no key of a study file here; known are {', '.join(known)}")
        for key in needed:
            if key not in fields:
                self.refuse(f"lacks {key}")
        return fields

    def named(self) -> Iterator[tuple[str, "StudyField"]]:
        """Its fields, whatever their names are; those without a value are left out.

        Raises:
            StudyError: it is no table of names.
        """
        if not isinstance(self.value, dict):
            self.refuse(f"must be a table, not {shown(self.value)}")
        for key, value in self.value.items():
            field = StudyField(self.file, f"{self.key}.{key}" if self.key else str(key), value)
            if not isinstance(key, str):
                field.refuse(f"{shown(key)} is no name; put a number that is meant as a name in quotes")
            if value is not None:
                yield key, field

    def listed(self) -> Iterator["StudyField"]:
        """Its entries.

        Raises:
            StudyError: it is no list, or an empty one.
        """
        if not isinstance(self.value, list) or not self.value:
            self.refuse(f"must be a list with one entry at least, not {shown(self.value)}")
        for at, value in enumerate(self.value):
            yield StudyField(self.file, f"{self.key}[{at}]", value)

    def text(self) -> str:
        """The value as text.

        Raises:
            StudyError: it is none.
        """
        if not isinstance(self.value, str) or not self.value or not self.value.isprintable():
            self.refuse(f"must be text, not {shown(self.value)}")
        return self.value

    def name(self) -> str:
        """The value as a name.

        Raises:
            StudyError: it is none that may be a folder's.
        """
        if not isinstance(self.value, str) or not PLAIN_NAME.fullmatch(self.value):
            self.refuse(f"must be a name of letters, digits, '_', '-' and '.', not {shown(self.value)}")
        return self.value

    def one_of(self, known: Collection[str], what: str) -> str:
        """The value as one of some names.

        Raises:
            StudyError: it is none of them.
        """
        if not isinstance(self.value, str) or self.value not in known:
            self.refuse(f"{shown(self.value)} is no {what}; there are {', '.join(known) or 'none'}")
        return self.value

    def number(self, most: int) -> int:
        """The value as a whole number from 1 on.

        Raises:
            StudyError: it is none.
        """
        if not isinstance(self.value, int) or isinstance(self.value, bool) or not 1 <= self.value <= most:
            self.refuse(f"must be a whole number from 1 to {most}, not {shown(self.value)}")
        return self.value

    def place(self) -> Path:
        """The value as the path of something that is there; from the folder of the study file on.

        Raises:
            StudyError: nothing is there.
        """
        path = self.file.parent / self.text()
        try:
            is_there = path.exists()
        except OSError:
            is_there = False
        if not is_there:
            self.refuse(f"{path} is not there")
        return path
