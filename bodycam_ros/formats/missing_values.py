"""How other programs write that a value is missing: one table for all readers of points.

A cell is missing where it is empty or a word such as NaN. A point is missing where one of its coordinates is, where it
lies exactly at the origin (Vicon, Qualisys, MATLAB scripts), or where it has a number that stands for "none" (9999999).
"""

import math
import re

import numpy as np

from bodycam_ros.files.shown import shown
from bodycam_ros.geometry import Array

_WORDS = frozenset(
    ("", "-", "nan", "na", "n/a", "#n/a", "#num!", "#value!", "#div/0!", "none", "null", "nil", "missing",
     "-nan", "nan(ind)", "-nan(ind)", "1.#ind", "-1.#ind", "1.#qnan", "-1.#qnan", "1.#inf", "-1.#inf")
)  # fmt: skip
_DECIMAL_COMMA = re.compile(r"[-+]?\d*,\d+([eE][-+]?\d+)?")
_LARGEST = 9_999_999.0  # in millimetres, ten kilometres
_PLACEHOLDERS = (-9999.0, 9999.0, -99999.0, 99999.0, -999999.0, 999999.0)
"""Numbers that stand for "none" where all three coordinates are the same one."""


def cell_value(cell: str) -> float:
    """The number in a cell of a table; NaN where it says that there is none.

    Raises:
        ValueError: it is something else.
    """
    word = cell.strip().strip('"').strip()
    if word.lower() in _WORDS:
        return math.nan
    try:
        return float(word)
    except ValueError as error:
        remedy = "; write decimals with a point" if _DECIMAL_COMMA.fullmatch(word) else ""
        raise ValueError(f"{shown(word)} is no number{remedy}") from error


def without_missing(points: Array) -> Array:
    """Points (..., 3) in a file's unit, of which the missing ones are NaN."""
    missing = ~(np.abs(points) < _LARGEST).all(axis=-1)
    missing |= (points == 0.0).all(axis=-1)
    first = points[..., :1]
    missing |= (points == first).all(axis=-1) & np.isin(first[..., 0], _PLACEHOLDERS)
    return np.where(missing[..., None], np.nan, points)
