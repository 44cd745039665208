"""Markers in OpenSim's TRC: a table separated by tabs, as Vicon, Pose2Sim and Cortex write it."""

import math
from pathlib import Path

import numpy as np

from bodycam_ros.errors import RecordingError
from bodycam_ros.other_systems.captured_motion import Y_UP_TO_Z_UP, CapturedMotion
from bodycam_ros.other_systems.motion_text import checked_stamps, read_motion_text
from bodycam_ros.shown import shown

_METRES = {"m": 1.0, "cm": 0.01, "mm": 0.001, "inches": 0.0254}
_TYPE, _KEYS, _VALUES, _NAMES, _FIRST_ROW = 0, 1, 2, 3, 5
_AXES = 3
_MOST_CELLS, _SMALL = 20, 1_000_000
"""Of a table, for each letter of the file: cells that are missing at the end of a row take a tab less, but as much
memory. A small table may be as it likes."""


def captured_trc(path: Path) -> CapturedMotion:
    """Markers by name; the world of a TRC has y up. Empty cells are times at which a marker was not seen.

    Raises:
        RecordingError: it cannot be read, or is no TRC.
    """
    lines = read_motion_text(path, "TRC").splitlines()
    try:
        if len(lines) <= _FIRST_ROW or not lines[_TYPE].startswith("PathFileType"):
            raise ValueError("expected 'PathFileType' on the first line, four lines that say what is in it, and rows")
        header = dict(zip(lines[_KEYS].split(), lines[_VALUES].split(), strict=False))
        unit = _METRES.get(header.get("Units", "mm").lower())
        if unit is None:
            raise ValueError(f"line 3: unknown unit {shown(header['Units'])}; known are {', '.join(_METRES)}")
        names = [name.strip() for name in lines[_NAMES].split("\t")[2:]]
        columns = {name: 2 + column for column, name in enumerate(names) if name}
        if not columns:
            raise ValueError("line 4: expected Frame#, Time and the markers' names, separated by tabs")
        if len(columns) != sum(map(bool, names)):
            raise ValueError("line 4: two markers have the same name")
        listed = [(number, line) for number, line in enumerate(lines[_FIRST_ROW:], _FIRST_ROW + 1) if line.strip()]
        width = max(columns.values()) + _AXES
        if len(listed) * width > _SMALL + _MOST_CELLS * sum(map(len, lines)):
            raise ValueError(f"line 4 names {len(columns)} markers, of which next to none is in the {len(listed)} rows")
        rows = [_numbers(line, number, width) for number, line in listed]
        table = np.array(rows)
        stamps_ns = checked_stamps(table[:, 1] if len(table) else np.zeros(0))
    except ValueError as error:
        raise RecordingError(f"{path}: cannot be read as TRC: {error}") from error
    points = {
        name: unit * table[:, column : column + _AXES] @ Y_UP_TO_Z_UP.T
        for name, column in columns.items()
        if np.isfinite(table[:, column : column + _AXES]).any()
    }
    return CapturedMotion(path, "TRC", stamps_ns, points)


def _numbers(line: str, number: int, columns: int) -> list[float]:
    """The cells of a row; NaN for empty ones and those that are missing at its end.

    Raises:
        ValueError: a cell that is no number.
    """
    cells = line.rstrip("\r\n").split("\t")[:columns]
    try:
        values = [float(cell) if cell.strip() else math.nan for cell in cells]
    except ValueError as error:
        raise ValueError(f"line {number}: {error}") from error
    return [*values, *[math.nan] * (columns - len(values))]
