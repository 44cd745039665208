"""TRC: virtual markers over time, in millimetres with y up, for OpenSim, with a model that carries them.

A gap is interpolated, as in MOT: OpenSim's inverse kinematics fails at a frame without any marker. C3D leaves it empty.
"""

import math
from collections import Counter
from pathlib import Path

import numpy as np

from bodycam_ros.errors import RecordingError
from bodycam_ros.files.shown import shown
from bodycam_ros.files.yaml_file import read_text
from bodycam_ros.formats.captured_motion import MOST_BYTES, Y_UP_TO_Z_UP, CapturedMotion, checked_stamps
from bodycam_ros.formats.markers import marker_positions, place_markers
from bodycam_ros.formats.opensim import MODEL_SUFFIX, OPENSIM_R_OURS, model_text
from bodycam_ros.formats.sampled_motion import MotionOptions, SampledMotion

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


_UNITS_M = {"m": 1.0, "cm": 0.01, "mm": 0.001, "inches": 0.0254}
_TYPE, _KEYS, _VALUES, _NAMES, _FIRST_ROW = 0, 1, 2, 3, 5
_AXES = 3
_MOST_CELLS, _SMALL = 20, 1_000_000
"""Most cells per character of the file: cells missing at the end of a row take memory too. Small tables are exempt."""


def read_trc(path: Path) -> CapturedMotion:
    """Markers by name; the world of a TRC has y up. Empty cells are missing values.

    Raises:
        RecordingError: it cannot be read.
        ValueError: it is no TRC.
    """
    lines = read_text(path, "TRC file", RecordingError, MOST_BYTES).splitlines()
    if len(lines) <= _FIRST_ROW or not lines[_TYPE].startswith("PathFileType"):
        raise ValueError("expected 'PathFileType' on the first line, four header lines, and rows")
    header = dict(zip(lines[_KEYS].split(), lines[_VALUES].split(), strict=False))
    unit = _UNITS_M.get(header.get("Units", "mm").lower())
    if unit is None:
        raise ValueError(f"line 3: unknown unit {shown(header['Units'])}; known are {', '.join(_UNITS_M)}")
    names = [name.strip() for name in lines[_NAMES].split("\t")[2:]]
    columns = {name: 2 + column for column, name in enumerate(names) if name}
    if not columns:
        raise ValueError("line 4: expected Frame#, Time and the markers' names, separated by tabs")
    if twice := next((name for name, count in Counter(filter(None, names)).items() if count > 1), ""):
        raise ValueError(f"line 4: two markers have the same name, {shown(twice)}")
    listed = [(number, line) for number, line in enumerate(lines[_FIRST_ROW:], _FIRST_ROW + 1) if line.strip()]
    width = max(columns.values()) + _AXES
    if len(listed) * width > _SMALL + _MOST_CELLS * sum(map(len, lines)):
        raise ValueError(f"line 4 names {len(columns)} markers, of which almost none is in the {len(listed)} rows")
    table = np.array([_numbers(line, number, width) for number, line in listed])
    stamps_ns = checked_stamps(table[:, 1] if len(table) else np.zeros(0))
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
