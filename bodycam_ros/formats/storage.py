"""OpenSim's STO and MOT as truth: positions of bodies or markers over time, of a world with y up, in metres.

Points are columns NAME_X, NAME_Y, NAME_Z (BodyKinematics, with rotations NAME_Ox to NAME_Oz), or NAME_tx to NAME_tz
(markers of inverse kinematics), or a column NAME of ``DataType=Vec3``. Joint angles alone place nothing: that takes
their model.
"""

import logging
import re
from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from bodycam_ros.files.shown import shown
from bodycam_ros.formats.captured_motion import Y_UP_TO_Z_UP, CapturedMotion, checked_stamps, own_times
from bodycam_ros.formats.foreign_text import is_last_row_cut, read_foreign
from bodycam_ros.formats.missing_values import cell_value, without_missing
from bodycam_ros.geometry import Array

logger = logging.getLogger(__name__)

_END = "endheader"
_ENDINGS = (("_X", "_Y", "_Z"), ("_tx", "_ty", "_tz"))
_TURNS = ("_Ox", "_Oy", "_Oz")
_OTHER = re.compile(r"(?i)\b(accelerations?|velocit(y|ies)|forces?|loads?|moment(um|a)s?)\b")
"""Words of a title, the first line, of numbers that are no positions; what follows describes all files of its kind."""

_ANGLES = re.compile(r"(?i)\bangles are in (degrees|radians)\b")

_LEAST_POINTS = 3  # a model may have coordinates tx, ty, tz of one or two joints
_LONGEST_HEADER = 200


def read_storage(path: Path) -> CapturedMotion:
    """Points by name, and rotations of bodies that have them.

    Raises:
        RecordingError: it cannot be read.
        ValueError: it is no such file, or has no points.
    """
    text = read_foreign(path, "file of OpenSim")
    lines = text.split("\n")
    end = next((k for k, line in enumerate(lines[:_LONGEST_HEADER]) if line.strip().lower() == _END), None)
    if end is None:
        raise ValueError("expected a line 'endheader', and below it names of columns and rows")
    header = {key.strip().lower(): value.strip() for key, _, value in (line.partition("=") for line in lines[:end])}
    listed = [(number, line) for number, line in enumerate(lines[end + 1 :], end + 2) if line.strip()]
    if len(listed) < 2 or len(_cells(listed[0][1])) < 2:
        raise ValueError("it has no columns or no rows below its header")
    if found := _OTHER.search(lines[0]):
        raise ValueError(f"by its title it has {found[0].lower()}, and not positions")
    names, rows = _cells(listed[0][1]), listed[1:]
    if is_last_row_cut(path, text, [len(_cells(line)) for _, line in rows]):
        del rows[-1]
    if not names or names[0].lower() != "time":
        raise ValueError(f"line {listed[0][0]}: expected 'time' and names of columns")
    data_type = header.get("datatype", "double").lower()
    if data_type not in ("double", "vec3"):
        raise ValueError(f"its data are {header['datatype']}: orientations alone place nothing; give positions")
    depth = 3 if data_type == "vec3" else 1
    table = np.array([_numbers(line, number, len(names), depth) for number, line in rows]).reshape(len(rows), -1)
    if header.get("nrows", "").isdecimal() and int(header["nrows"]) != len(rows):
        logger.warning("%s: its header says %s rows, it has %d; these are read", path, header["nrows"], len(rows))
    table = table[own_times(path, table[:, 0])]
    stamps_ns = checked_stamps(table[:, 0])
    columns = (
        {name: [1 + 3 * k, 2 + 3 * k, 3 + 3 * k] for k, name in enumerate(names[1:])} if depth == 3 else _points(names)
    )
    # Other columns may have a name twice, as the forces below both feet have in files of inverse kinematics.
    used = names[1:] if depth == 3 else [names[column] for at in columns.values() for column in at]
    if twice := next((name for name, count in Counter(names).items() if count > 1 and name in used), ""):
        raise ValueError(
            f"line {listed[0][0]}: two columns are named {shown(twice)}; expected a name of its own for each"
        )
    points = {
        name: values @ Y_UP_TO_Z_UP.T
        for name, at in columns.items()
        if np.isfinite(values := without_missing(table[:, at])).any()
    }
    if len(points) < _LEAST_POINTS:
        raise ValueError(
            f"it has {len(points)} points; joint angles or forces alone place nothing. Let OpenSim write positions "
            "(Analyze, BodyKinematics: ..._pos_global.sto)"
        )
    rotations = _rotations(names, table, points, _in_degrees(path, lines[:end], header)) if depth == 1 else {}
    return CapturedMotion(path, "STO", stamps_ns, points, rotations)


def _cells(line: str) -> list[str]:
    return [cell.strip() for cell in (line.rstrip().split("\t") if "\t" in line else line.split())]


def _numbers(line: str, number: int, columns: int, depth: int) -> list[float]:
    """The numbers of a row: the time, and ``depth`` of each other column."""
    cells = _cells(line)
    if len(cells) != columns:
        raise ValueError(f"line {number}: {len(cells)} columns, expected {columns}: one per name")
    try:
        first, *others = cells
        parts = [part for cell in others for part in (cell.split(",") if depth > 1 else [cell])]
        values = [cell_value(cell) for cell in (first, *parts)]
    except ValueError as error:
        raise ValueError(f"line {number}: {error}") from error
    if len(values) != 1 + depth * (columns - 1):
        raise ValueError(f"line {number}: expected {depth} numbers in each column, separated by commas")
    return values


def _points(names: Sequence[str]) -> dict[str, list[int]]:
    """Point -> its three columns."""
    columns = {name: column for column, name in enumerate(names)}
    found: dict[str, list[int]] = {}
    for first, second, third in _ENDINGS:
        for name in names:
            stem = name.removesuffix(first)
            if stem != name and stem + second in columns and stem + third in columns:
                found.setdefault(stem, [columns[stem + ending] for ending in (first, second, third)])
    return found


def _in_degrees(path: Path, head: Sequence[str], header: Mapping[str, str]) -> bool:
    """Whether angles are degrees: by the description of the file, else by ``inDegrees``, which OpenSim left at "no"."""
    by_key = header.get("indegrees", "no").lower() == "yes"
    described = next((found[1].lower() for line in head if (found := _ANGLES.search(line))), "")
    if described and (described == "degrees") != by_key:
        logger.warning(
            "%s: its header says inDegrees=%s and angles in %s; these are taken",
            path,
            header.get("indegrees"),
            described,
        )
    return described == "degrees" if described else by_key


def _rotations(names: Sequence[str], table: Array, points: Mapping[str, Array], in_degrees: bool) -> dict[str, Array]:
    """Rotations (K, 3, 3) of bodies, by angles about x, then y, then z of the body."""
    columns = {name: column for column, name in enumerate(names)}
    found: dict[str, Array] = {}
    for name in points:
        at = [columns[name + ending] for ending in _TURNS if name + ending in columns]
        if len(at) == len(_TURNS) and np.isfinite(angles := table[:, at]).all():
            R = Rotation.from_euler("XYZ", angles, degrees=in_degrees).as_matrix()
            found[name] = Y_UP_TO_Z_UP @ R
    return found
