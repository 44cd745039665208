"""The formats that ``bodycam export`` writes; a new one is a new line of the table."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

from bodycam_ros.export.robot_description import robot_description
from bodycam_ros.whole_file import write_whole


@dataclass(frozen=True)
class Format:
    """One format.

    Attributes:
        what: for whom it is, and what it holds.
        content: makes the file's content of a solved bag or a body file.
    """

    what: str
    content: Callable[[Path], str | bytes]


FORMATS: Mapping[str, Format] = {
    "urdf": Format("the body, for RViz and every tool that reads robots", robot_description),
}


def export(source: Path, format_name: str, output: Path) -> None:
    """Write a solved bag or a body file in a format, whole or not at all.

    Args:
        source: what to export.
        format_name: key of ``FORMATS``.
        output: file to write; an earlier one is replaced.

    Raises:
        BodycamError: the source cannot be read or lacks what the format needs, or the output cannot be written.
    """
    write_whole(output, FORMATS[format_name].content(source))
