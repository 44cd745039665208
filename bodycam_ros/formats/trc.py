"""TRC: virtual markers over time, in millimetres with y up, for OpenSim, with a model that carries them.

A gap is interpolated, as in MOT: OpenSim's inverse kinematics fails at a frame without any marker. C3D leaves it empty.
"""

import logging
import math
import warnings
from collections import Counter
from collections.abc import Iterator, Mapping
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
from bodycam_ros.formats.markers import marker_positions, place_markers
from bodycam_ros.formats.missing_values import cell_value, without_missing
from bodycam_ros.formats.opensim import MODEL_SUFFIX, OPENSIM_R_OURS, model_text
from bodycam_ros.formats.sampled_motion import MotionOptions, SampledMotion

logger = logging.getLogger(__name__)

MARK = "PathFileType"
_TO_MM = 1000.0


def write_trc(motion: SampledMotion, options: MotionOptions) -> dict[str, str]:
    """The motion as a TRC file, and the model whose markers these are."""
    markers = place_markers(motion)
    count, frames = len(markers), len(motion.stamps_ns)
    positions = _TO_MM * marker_positions(motion, markers) @ OPENSIM_R_OURS.T
    rate = f"{motion.rate:.6f}"
    lines = [
        f"{MARK}\t4\t(X/Y/Z)\t{motion.name}.trc",
        "DataRate\tCameraRate\tNumFrames\tNumMarkers\tUnits\tOrigDataRate\tOrigDataStartFrame\tOrigNumFrames",
        f"{rate}\t{rate}\t{frames}\t{count}\tmm\t{rate}\t1\t{frames}",
        "\t".join(["Frame#", "Time", *(f"{marker.name}\t\t" for marker in markers)]),
        "\t".join(["", "", *(f"X{row}\tY{row}\tZ{row}" for row in range(1, count + 1))]),
        "",
    ]
    rows = zip(motion.seconds.tolist(), positions.reshape(frames, -1).tolist(), strict=True)
    for number, (second, row) in enumerate(rows, start=1):
        lines.append("\t".join([str(number), f"{second:.9f}", *map("{:.5f}".format, row)]))
    return {"": "\n".join(lines) + "\n", MODEL_SUFFIX: model_text(motion, markers)}


_UNITS_M = {"m": 1.0, "meters": 1.0, "cm": 0.01, "mm": 0.001, "millimeters": 0.001, "in": 0.0254, "inches": 0.0254}
_TYPE = 0
_KEYS = 1
_VALUES = 2
_NAMES = 3
_FIRST_ROW = 5
_AXES, _FIXED = 3, 2
_MOST_CELLS, _SMALL = 20, 1_000_000
"""Most cells per character of the file: cells missing at the end of a row take memory too. Small tables are exempt."""
_LEAST_M, _MOST_M = 0.02, 100.0  # between the farthest markers of a frame, where the unit is right


def read_trc(path: Path) -> CapturedMotion:
    """Markers by name; the world of a TRC has y up. Missing values are those of ``missing_values``.

    The k-th name has the columns 2 + 3 k to 4 + 3 k, wherever its own tabs put it. A header that contradicts the rows
    is refused where the columns of a marker are in doubt, and named in a warning where they are not.

    Raises:
        RecordingError: it cannot be read.
        ValueError: it is no TRC.
    """
    text = read_foreign(path, "TRC file")
    lines = text.split("\n")
    if len(lines) <= _FIRST_ROW or not lines[_TYPE].startswith("PathFileType"):
        raise ValueError("expected 'PathFileType' on the first line, four header lines, and rows")
    header = dict(zip(lines[_KEYS].split(), lines[_VALUES].split(), strict=False))
    unit = _UNITS_M.get(header.get("Units", "mm").lower())
    if unit is None:
        raise ValueError(f"line 3: unknown unit {shown(header['Units'])}; known are {', '.join(_UNITS_M)}")
    # The line of X1 Y1 Z1 may lack: rows begin where a line begins with a number.
    first = next((row for row in (_FIRST_ROW - 1, _FIRST_ROW) if _cells(lines[row])[0].strip().isdigit()), _FIRST_ROW)
    listed = [(number, line) for number, line in enumerate(lines[first:], first + 1) if line.strip()]
    if is_last_row_cut(path, text, [len(_cells(line)) for _, line in listed]):
        del listed[-1]
    width = max((len(_cells(line.rstrip())) for _, line in listed), default=0)
    columns = _columns(lines[_NAMES], width, header.get("NumMarkers", ""))
    if width == _FIXED + _AXES * len(columns) + 1:
        # Rows may have a tab too many after the time, as the names.
        if not any(cell.strip() for _, line in listed for cell in _cells(line)[_FIXED : _FIXED + 1]):
            columns = {name: column + 1 for name, column in columns.items()}
    wanted = max(columns.values()) + _AXES
    if len(listed) * wanted > _SMALL + _MOST_CELLS * sum(map(len, lines)):
        raise ValueError(f"line 4 names {len(columns)} markers, of which almost none is in the {len(listed)} rows")
    table = np.array([_numbers(line, number, wanted) for number, line in listed])
    table = table.reshape(-1, wanted)
    table = table[own_times(path, table[:, 1])]
    stamps_ns = checked_stamps(table[:, 1])
    found = {name: without_missing(table[:, column : column + _AXES]) for name, column in columns.items()}
    points = {name: unit * values @ Y_UP_TO_Z_UP.T for name, values in found.items() if np.isfinite(values).any()}
    captured = CapturedMotion(path, "TRC", stamps_ns, points)
    for contradiction in _contradictions(header, captured, len(columns)):
        logger.warning("%s: %s", path, contradiction)
    return captured


def _cells(line: str) -> list[str]:
    """The cells of a line: between tabs, or words where it has none."""
    return line.rstrip("\r\n").split("\t") if "\t" in line else line.split() or [""]


def _columns(line: str, width: int, count: str) -> dict[str, int]:
    """Marker -> its first column, by the line of names, the columns of the widest row and NumMarkers.

    Raises:
        ValueError: names and columns contradict each other.
    """
    cells = [cell.strip() for cell in _cells(line)]
    titles = [row for row, cell in enumerate(cells) if cell][:_FIXED]
    named = [(row, cell) for row, cell in enumerate(cells) if cell and row not in titles]
    if not named:
        raise ValueError("line 4: expected Frame#, Time and the markers' names, separated by tabs")
    names = [name for _, name in named]
    if twice := next((name for name, times in Counter(names).items() if times > 1), ""):
        raise ValueError(f"line 4: two markers have the same name, {shown(twice)}")
    if width > _FIXED + _AXES * len(names) + 1:
        # Markers without a name: the tabs alone tell which, and only where they leave three columns to each.
        at = [row for row, _ in named]
        if any((row - _FIXED) % _AXES for row in at) or at[-1] + _AXES > width:
            raise ValueError(
                f"line 4 names {len(names)} markers, which have {_FIXED + _AXES * len(names)} columns, but rows have "
                f"{width}; name all markers"
            )
        return {name: row for row, name in named}
    declared = int(count) if count.isdecimal() else len(names)
    if declared != len(names) and width > _FIXED and abs(width - _FIXED - _AXES * declared) <= 1:
        raise ValueError(
            f"line 4 names {len(names)} markers, but NumMarkers is {declared}, and rows have {width} columns for "
            "as many; mend the names"
        )
    return {name: _FIXED + _AXES * k for k, name in enumerate(names)}


def _contradictions(header: Mapping[str, str], captured: CapturedMotion, markers: int) -> Iterator[str]:
    """What the header says of the rows that is not so, each with what is taken."""
    frames, names = len(captured.stamps_ns), len(captured.points)
    yield from header_contradictions(captured, header.get("NumFrames", ""), header.get("DataRate", ""))
    declared = header.get("NumMarkers", "")
    if declared.isdecimal() and int(declared) != markers:
        yield f"its header says {declared} markers, it names {markers}; these are read"
    if names < 2:
        return
    places = np.stack([*captured.points.values()])[:, :: max(1, frames // 50)]
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)  # a frame without any marker
        spans = np.linalg.norm(np.nanmax(places, axis=0) - np.nanmin(places, axis=0), axis=1)
        span = float(np.nanmedian(spans))
    if span and not _LEAST_M < span < _MOST_M:
        unit = header.get("Units", "mm")
        yield f"by its unit ({unit}) its markers are {span:.3g} m apart, which no person is; mend Units in line 3"


def _numbers(line: str, number: int, columns: int) -> list[float]:
    """The cells of a row; NaN for missing ones and those that are not there at its end.

    Raises:
        ValueError: a cell that is no number.
    """
    try:
        values = [cell_value(cell) for cell in _cells(line)[:columns]]
    except ValueError as error:
        raise ValueError(f"line {number}: {error}") from error
    return [*values, *[math.nan] * (columns - len(values))]
