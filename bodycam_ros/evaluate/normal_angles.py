"""Joint angles of healthy people over the gait cycle, as a table that the user has.

    joint,percent,mean,sd
    knee,0,5.2,4.1
    knee,2,7.9,4.3

None comes with this package: those that are published have another zero, or no licence to pass them on.
"""

import csv
import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from bodycam_ros.errors import RecordingError
from bodycam_ros.evaluate.anatomical_angles import LEG_JOINTS
from bodycam_ros.evaluate.gait_cycle import CYCLE_PERCENT
from bodycam_ros.files.shown import shown
from bodycam_ros.files.yaml_file import read_text
from bodycam_ros.geometry import Array

_COLUMNS = ("joint", "percent", "mean", "sd")
_EXPECTED = f"expected a CSV file with the columns {','.join(_COLUMNS)}"
_LARGEST_DEG = 360.0


@dataclass(frozen=True, eq=False)
class NormalAngle:
    """The normal flexion of a joint over the gait cycle; NaN where the table does not have it.

    Attributes:
        mean: (101,) [deg], with the sign and the zero of ``gait_cycle``.
        sd: (101,) standard deviation between people [deg].
    """

    mean: Array
    sd: Array


@dataclass(frozen=True, eq=False)
class NormalAngles:
    """A table of normal angles.

    Attributes:
        name: of its file.
        joints: hip, knee or ankle -> its angle.
    """

    name: str
    joints: Mapping[str, NormalAngle]


def read_normal_angles(path: Path) -> NormalAngles:
    """Read a table; between its rows angles are interpolated.

    Raises:
        RecordingError: it cannot be read, a joint is unknown or has one row, a number is none that can be, or the
            percents of a joint do not increase; the message names the line.
    """
    try:
        rows = list(csv.reader(read_text(path, "table of normal angles", RecordingError).splitlines()))
    except csv.Error as error:
        raise RecordingError(f"{path}: cannot be read as CSV: {error}") from error
    if not rows or tuple(name.strip().lower() for name in rows[0]) != _COLUMNS:
        raise RecordingError(f"{path}: {_EXPECTED}, not {shown(','.join(rows[0]) if rows else '')}")
    found: dict[str, list[tuple[float, float, float]]] = {}
    for line, row in enumerate(rows[1:], 2):
        if not any(field.strip() for field in row):
            continue
        joint = row[0].strip().lower()
        if joint not in LEG_JOINTS:
            raise RecordingError(f"{path}: line {line}: joint {shown(row[0])} is none of {', '.join(LEG_JOINTS)}")
        numbers = _numbers(row[1:])
        if numbers is None:
            raise RecordingError(
                f"{path}: line {line}: expected a percent from 0 to 100, a mean and a standard deviation in degrees, "
                f"not {shown(','.join(row[1:]))}"
            )
        known = found.setdefault(joint, [])
        if known and numbers[0] <= known[-1][0]:
            raise RecordingError(f"{path}: line {line}: percents of the {joint} must increase")
        known.append(numbers)
    if short := [joint for joint, known in found.items() if len(known) < 2]:
        raise RecordingError(f"{path}: has one row for the {short[0]}; a curve needs two or more")
    if not found:
        raise RecordingError(f"{path}: has no angle; {_EXPECTED}")
    return NormalAngles(path.name, {joint: _interpolated(np.array(known)) for joint, known in found.items()})


def _numbers(fields: list[str]) -> tuple[float, float, float] | None:
    """Percent, mean and standard deviation; None where they cannot be."""
    try:
        percent, mean, sd = map(float, fields)
    except ValueError:
        return None
    is_possible = 0.0 <= percent <= 100.0 and abs(mean) <= _LARGEST_DEG and 0.0 <= sd <= _LARGEST_DEG
    return (percent, mean, sd) if is_possible and not math.isnan(mean) else None


def _interpolated(rows: Array) -> NormalAngle:
    percent, *columns = rows.T
    return NormalAngle(*(np.interp(CYCLE_PERCENT, percent, each, left=np.nan, right=np.nan) for each in columns))
