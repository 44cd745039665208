"""Joint points of another system's file by name: TRC, C3D, or CSV with columns NAME_x, NAME_y, NAME_z."""

import csv
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from bodycam_ros.errors import BodyError, RecordingError
from bodycam_ros.formats.read_captured import read_captured
from bodycam_ros.geometry import Array

_SUFFIXES = (".trc", ".c3d", ".csv")


def read_joint_points(path: Path) -> Mapping[str, Array] | None:
    """Name -> points (K, 3) in the file's axes and unit, NaN where unknown; None of a file that has none by its name.

    Raises:
        BodyError: the file cannot be read.
    """
    if path.suffix.lower() not in _SUFFIXES:
        return None
    try:
        return _read_csv(path) if path.suffix.lower() == ".csv" else read_captured(path).points
    except RecordingError as error:
        raise BodyError(str(error)) from error


def _read_csv(path: Path) -> dict[str, Array]:
    try:
        with path.open(newline="") as file:
            header, *lines = csv.reader(file)
    except (OSError, ValueError, csv.Error) as error:
        raise RecordingError(f"{path}: cannot be read as CSV with a line of names: {error}") from error
    columns = {name.strip().lower(): column for column, name in enumerate(header)}
    points = {}
    for name in header:
        stem = name.strip()[:-2]
        axes = [columns.get(f"{stem}{name.strip()[-2:-1]}{axis}".lower()) for axis in "xyz"]
        if name.strip()[-1:].lower() == "x" and None not in axes:
            points[stem] = np.array([[_number(line, axis) for axis in axes] for line in lines]).reshape(-1, 3)
    return points


def _number(line: list[str], column: int | None) -> float:
    try:
        return float(line[column or 0])
    except (ValueError, IndexError):
        return float("nan")
