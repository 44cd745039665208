"""Motive (OptiTrack) CSV: bones, rigid bodies and markers over time, of a world with y up.

The first line has pairs of a key and a value: units, kind of rotation, rates. Then come lines of types, names and IDs,
of "Rotation" or "Position", and of axes; lines of parents and other things may be between them.
"""

import csv
import logging
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from bodycam_ros.files.shown import shown
from bodycam_ros.formats.captured_motion import (
    Y_UP_TO_Z_UP,
    CapturedMotion,
    checked_stamps,
    header_contradictions,
    own_times,
)
from bodycam_ros.formats.foreign_text import is_last_row_cut, read_foreign
from bodycam_ros.formats.missing_values import cell_value, without_missing
from bodycam_ros.geometry import Array, rotation_from_xyzw

logger = logging.getLogger(__name__)

MARK = "Format Version"

_UNITS_M = {"meters": 1.0, "centimeters": 0.01, "millimeters": 0.001, "inches": 0.0254}
_TITLES = 12  # lines above the rows, at most
_FIXED = 2  # columns: frame and time
_KINDS = ("bone", "rigid body", "marker", "rigid body marker", "bone marker")
"""Types in order of preference, where two things have the same name."""


def is_motive(path: Path) -> bool:
    """Whether a CSV begins as Motive writes it."""
    try:
        with path.open("rb") as file:
            return MARK.encode() in file.read(len(MARK) + 4)  # after a byte-order mark or quotes
    except OSError:
        return False


def read_motive(path: Path) -> CapturedMotion:
    """Bones, rigid bodies and markers by name, with rotations where they are quaternions and never missing.

    Raises:
        RecordingError: it cannot be read.
        ValueError: it is no such CSV.
    """
    text = read_foreign(path, "CSV file")
    try:
        rows = list(csv.reader(text.split("\n")))
    except csv.Error as error:
        raise ValueError(str(error)) from error
    keys = dict(zip(rows[0][::2], rows[0][1::2], strict=False)) if rows else {}
    unit = _UNITS_M.get(keys.get("Length Units", "Meters").strip().lower())
    if MARK not in keys or unit is None:
        raise ValueError(
            f"line 1: expected 'Format Version', and 'Length Units' of {', '.join(_UNITS_M)}, not "
            f"{shown(keys.get('Length Units'))}"
        )
    axes_row = next((k for k, row in enumerate(rows[:_TITLES]) if row and row[0].strip().lower() == "frame"), None)
    if axes_row is None:
        raise ValueError("expected a line that begins with 'Frame', above the rows")
    titles = [row for row in rows[1:axes_row] if any(map(str.strip, row))]
    if len(titles) < 3:
        raise ValueError("expected lines of types, names and of Rotation or Position above that of the axes")
    types, names = (_title(titles, word, place) for word, place in (("type", 0), ("name", 1)))
    columns = _columns(types, names, titles[-1], rows[axes_row])
    if is_last_row_cut(path, text, [len(row) for row in rows[axes_row + 1 :]]):
        del rows[-1]
    table = _table(rows[axes_row + 1 :], len(rows[axes_row]), axes_row + 2)
    table = table[own_times(path, table[:, 1])]
    stamps_ns = checked_stamps(table[:, 1])
    points, rotations = dict[str, Array](), dict[str, Array]()
    is_quaternion = keys.get("Rotation Type", "Quaternion").strip().lower() == "quaternion"
    for name, axes in columns.items():
        if not all(f"Position {axis}" in axes for axis in "XYZ"):
            continue
        values = unit * without_missing(table[:, [axes[f"Position {axis}"] for axis in "XYZ"]]) @ Y_UP_TO_Z_UP.T
        if np.isfinite(values).any():
            points[name] = values
        if is_quaternion and all(f"Rotation {axis}" in axes for axis in "XYZW"):
            quaternions = table[:, [axes[f"Rotation {axis}"] for axis in "XYZW"]]
            if name in points and (np.abs(quaternions).sum(axis=1) > 0.0).all():
                rotations[name] = Y_UP_TO_Z_UP @ rotation_from_xyzw(quaternions)
    if not points:
        raise ValueError("it has no bone, rigid body or marker with a position that was seen")
    captured = CapturedMotion(path, "Motive CSV", stamps_ns, points, rotations)
    frames, rate = keys.get("Total Exported Frames", ""), keys.get("Export Frame Rate", "")
    for contradiction in header_contradictions(captured, frames, rate):
        logger.warning("%s: %s", path, contradiction)
    return captured


def _title(titles: Sequence[Sequence[str]], word: str, place: int) -> Sequence[str]:
    """The line that has a word in its second cell, else the one at a place."""
    named = (row for row in titles if any(cell.strip().lower() == word for cell in row[:_FIXED]))
    return next(named, titles[place])


def _columns(
    types: Sequence[str], names: Sequence[str], parts: Sequence[str], axes: Sequence[str]
) -> dict[str, dict[str, int]]:
    """Name -> "Position X" and so on -> column; of two of one name that of the kind that comes first."""
    found: dict[str, tuple[str, dict[str, int]]] = {}
    for column in range(_FIXED, min(map(len, (types, names, parts, axes)))):
        name, kind = names[column].strip(), types[column].strip().lower()
        if not name or kind not in _KINDS:
            continue
        known_kind, known = found.setdefault(name, (kind, {}))
        if _KINDS.index(kind) < _KINDS.index(known_kind):
            known_kind, known = found[name] = kind, {}
        if kind == known_kind:
            known.setdefault(f"{parts[column].strip()} {axes[column].strip().upper()}", column)
    return {name: columns for name, (_, columns) in found.items()}


def _table(rows: Sequence[Sequence[str]], width: int, first: int) -> Array:
    """Numbers (K, width); NaN where missing, and at the end of rows that are shorter."""
    table = np.full((len(rows), width), np.nan)
    kept = np.ones(len(rows), bool)
    for number, row in enumerate(rows):
        kept[number] = any(map(str.strip, row))
        try:
            values = [cell_value(cell) for cell in row[:width]]
        except ValueError as error:
            raise ValueError(f"line {first + number}: {error}") from error
        table[number, : len(values)] = values
    whole: Array = table[kept]
    return whole
