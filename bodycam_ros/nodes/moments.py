"""When frames came and went in each process of the live graph, as a CSV file.

Times are of the steady clock, which all processes of a machine share, so that files of several can be laid side by
side. Imports no ROS.
"""

import csv
import time
from enum import Enum
from pathlib import Path
from typing import NamedTuple

from bodycam_ros.files.whole_file import failure_named

COLUMNS = ("moment", "camera", "stamp_ns", "steady_ns", "cpu_ns")
"""Columns of the file."""


class Moment(Enum):
    """What happened to a frame, in the order in which it happens."""

    PLAYED = "played"
    IMAGE_RECEIVED = "image received"
    TRACKING = "tracking"
    TRACKED = "tracked"
    TRACKS_RECEIVED = "tracks received"
    REGISTERED = "registered"
    LANDMARKS_RECEIVED = "landmarks received"
    SOLVING = "solving"
    SOLVED = "solved"


class ClockTimes(NamedTuple):
    """A time in a process: of the steady clock, and the processor time of all its threads so far [ns]."""

    steady_ns: int
    cpu_ns: int


class Moments:
    """Notes moments, if it is asked to.

    Args:
        path: file to be; None: not written.
    """

    def __init__(self, path: Path | None) -> None:
        self._path = path
        self._rows: list[tuple[str | int, ...]] = []

    def now(self) -> ClockTimes | None:
        """The time now; None where none is written."""
        return None if self._path is None else ClockTimes(time.monotonic_ns(), time.process_time_ns())

    def note(self, moment: Moment, camera: str, stamp_ns: int, at: ClockTimes | None = None) -> None:
        """Note what has happened to a frame, now unless it was before; ``camera`` is empty where all are concerned."""
        if (read := at or self.now()) is not None:
            self._rows.append((moment.value, camera, stamp_ns, *read))

    def write(self) -> None:
        """Write the file, if there is to be one.

        Raises:
            OutputError: it cannot be written.
        """
        if self._path is None:
            return
        with failure_named(self._path), self._path.open("w", newline="", encoding="utf-8") as file:
            lines = csv.writer(file)
            lines.writerow(COLUMNS)
            lines.writerows(self._rows)
