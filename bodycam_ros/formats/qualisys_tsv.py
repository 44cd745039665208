"""Qualisys Track Manager's TSV: markers (3D) or rigid bodies (6D) over time, of a world with z up, in millimetres.

Lines of a key and its values come first: NO_OF_FRAMES, FREQUENCY, MARKER_NAMES or BODY_NAMES. A line of column titles
may follow, and columns of frame and time before the markers'.
"""

import logging
import re
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from bodycam_ros.files.shown import shown
from bodycam_ros.formats.captured_motion import CapturedMotion, checked_stamps
from bodycam_ros.formats.foreign_text import is_last_row_cut, read_foreign
from bodycam_ros.formats.missing_values import cell_value, without_missing
from bodycam_ros.geometry import Array, nearest_rotation

logger = logging.getLogger(__name__)

_MM = 1e-3
_AXES = 3
_MATRIX = 9
_FRAME, _TIME = "frame", "time"
_KEY = re.compile(r"[A-Z][A-Z0-9_]+")
"""A word, where titles of columns are ``X``, indented, or two words: ``HEAD X``."""


def read_qualisys(path: Path) -> CapturedMotion:
    """Markers or rigid bodies by name; rotations of bodies that are never missing. Time counts from the first frame.

    Raises:
        RecordingError: it cannot be read.
        ValueError: it is no such TSV.
    """
    text = read_foreign(path, "TSV file")
    lines = text.rstrip("\n").split("\n")
    header: dict[str, list[str]] = {}
    first = 0
    for first, line in enumerate(lines):  # noqa: B007
        key, *values = line.split("\t")
        if not _KEY.fullmatch(key.rstrip()):
            break
        header[key.rstrip()] = [value.strip() for value in values]
    if "NO_OF_FRAMES" not in header:
        raise ValueError("expected Qualisys' TSV, whose first lines have NO_OF_FRAMES, FREQUENCY and MARKER_NAMES")
    is_bodies = "BODY_NAMES" in header
    if not is_bodies and "MARKER_NAMES" not in header:
        included = " ".join(header.get("DATA_INCLUDED", [])) or "neither"
        raise ValueError(
            f"it has {shown(included)}, and neither MARKER_NAMES (3D) nor BODY_NAMES (6D); export one of these"
        )
    names = [name for name in header.get("BODY_NAMES" if is_bodies else "MARKER_NAMES", []) if name]
    if not names or len(set(names)) < len(names):
        raise ValueError("MARKER_NAMES (or BODY_NAMES): expected a name of its own for each")
    if is_last_row_cut(path, text, [line.count("\t") for line in lines[first + 1 :]]):
        del lines[-1]
    titles, rows = _rows(lines[first:], first + 1)
    rate = _number(header, "FREQUENCY")
    before = _fixed_columns(titles, rows, len(names), is_bodies)
    each, left = divmod(rows.shape[1] - before, len(names))
    if left or each < _AXES:
        raise ValueError(
            f"{len(names)} names and {rows.shape[1]} columns contradict each other: expected "
            f"{'16 to a body' if is_bodies else '3 to a marker'}, with frame and time before them or without"
        )
    parts = rows[:, before:].reshape(len(rows), len(names), each)
    places = _MM * without_missing(parts[:, :, :_AXES])
    points = {name: places[:, k] for k, name in enumerate(names) if np.isfinite(places[:, k]).any()}
    rotations = dict[str, Array]()
    if is_bodies and each >= 2 * _AXES + _MATRIX:
        # After position, three angles and a residual: columns of the matrix, one after the other.
        matrices = np.swapaxes(parts[:, :, -_MATRIX:].reshape(len(rows), len(names), 3, 3), 2, 3)
        for k, name in enumerate(names):
            if name in points and np.isfinite(places[:, k]).all() and np.isfinite(matrices[:, k]).all():
                rotations[name] = np.stack([nearest_rotation(R) for R in matrices[:, k]])
    if not points:
        raise ValueError("it has no marker that was seen")
    if (expected := _number(header, "NO_OF_FRAMES")) != len(rows):
        logger.warning("%s: its header says %g frames, it has %d; these are read", path, expected, len(rows))
    return CapturedMotion(path, "Qualisys TSV", checked_stamps(np.arange(len(rows)) / rate), points, rotations)


def _number(header: Mapping[str, Sequence[str]], key: str) -> float:
    try:
        value = float((header.get(key) or [""])[0])
    except ValueError:
        value = 0.0
    if not value > 0.0:
        raise ValueError(f"{key}: expected a number, not {shown((header.get(key) or [''])[0])}")
    return value


def _rows(lines: Sequence[str], first: int) -> tuple[list[str], Array]:
    """Titles of the columns, if the first line has some, and the numbers (K, columns)."""
    titles: list[str] = []
    values: list[list[float]] = []
    for number, line in enumerate(lines, first):
        cells = line.rstrip("\t").split("\t")
        if not line.strip():
            continue
        try:
            values.append([cell_value(cell) for cell in cells])
        except ValueError as error:
            if values or titles:
                raise ValueError(f"line {number}: {error}") from error
            titles = [cell.strip().lower() for cell in cells]
    width = max(map(len, values), default=0)
    width = max(width, len(titles))
    rows = np.array([[*row, *[np.nan] * (width - len(row))] for row in values]).reshape(-1, width)
    # Between two bodies is a column that has neither a title nor a number.
    kept = [k for k in range(width) if not titles or "".join(titles[k : k + 1]) or np.isfinite(rows[:, k]).any()]
    return [titles[k] for k in kept if k < len(titles)], rows[:, kept]


def _fixed_columns(titles: Sequence[str], rows: Array, count: int, is_bodies: bool) -> int:
    """Columns before the first marker: frame and time, or none."""
    if titles:
        return sum(title in (_FRAME, _TIME) for title in titles[:2])
    left = int(rows.shape[1]) % count if is_bodies else int(rows.shape[1]) - _AXES * count
    if left in (1, 2) and len(rows) > 1 and (np.diff(rows[:, 0]) > 0.0).all():
        return left
    return 0
