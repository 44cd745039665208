"""Values of a body or equipment file, checked one by one; ``where`` begins the message: "joint spine: axis"."""

import math
from contextlib import suppress
from typing import Any

import numpy as np

from bodycam_ros.errors import BodyError
from bodycam_ros.geometry import Array, rigid, rotation_from_xyzw
from bodycam_ros.shown import shown

_QUATERNION_TOLERANCE = 1e-3  # a length that differs more from 1 is a slip of the pen, not rounding
_LONGEST_NAME = 100
_MOST_SHOWN = 5  # of unknown keys


def check_keys(entry: Any, where: str, needed: set[str], optional: set[str]) -> None:
    """Refuse what is no table, lacks a needed key or has an unknown key.

    Raises:
        BodyError: so it is.
    """
    if not isinstance(entry, dict):
        raise BodyError(f"{where}: expected a table with {', '.join(sorted(needed))}, not {shown(entry)}")
    if missing := needed - set(entry):
        raise BodyError(f"{where}: lacks {', '.join(sorted(missing))}")
    if unknown := [key for key in entry if key not in needed | optional]:
        known = ", ".join(sorted(needed | optional))
        raise BodyError(f"{where}: has unknown {', '.join(map(shown, unknown[:_MOST_SHOWN]))}; known are {known}")


def name_of(value: Any, where: str) -> str:
    """Return a name.

    Raises:
        BodyError: it is not text, too long, or holds characters that cannot be printed.
    """
    if not isinstance(value, str) or not value:
        raise BodyError(f"{where} must be a name, not {shown(value)}; put a number that is meant as a name in quotes")
    if len(value) > _LONGEST_NAME or not value.isprintable():
        raise BodyError(f"{where} must be a name of at most {_LONGEST_NAME} printable characters, not {shown(value)}")
    return value


def number_of(value: Any, where: str, least: float, most: float) -> float:
    """Return a number from ``least`` to ``most``.

    Raises:
        BodyError: it is none.
    """
    number = math.nan
    if isinstance(value, int | float | str) and not isinstance(value, bool):
        with suppress(ValueError, OverflowError):
            number = float(value)  # PyYAML reads 1e-4 as text
    if not least <= number <= most:
        raise BodyError(f"{where} must be a number from {least:g} to {most:g}, not {shown(value)}")
    return number


def truth_of(value: Any, where: str) -> bool:
    """Return true or false.

    Raises:
        BodyError: it is neither.
    """
    if not isinstance(value, bool):
        raise BodyError(f"{where} must be true or false, not {shown(value)}")
    return value


def table_of(value: Any, where: str, most: int) -> dict[Any, Any]:
    """Return a table of at most so many names.

    Raises:
        BodyError: it is no table, or a larger one.
    """
    if not isinstance(value, dict):
        raise BodyError(f"{where} must be a table of names, not {shown(value)}")
    if len(value) > most:
        raise BodyError(f"{where}: {len(value)} are more than there can be; at most {most}")
    return value


def numbers_of(value: Any, count: int, where: str) -> Array:
    """Return finite numbers (count).

    Raises:
        BodyError: not that many finite numbers.
    """
    try:
        # PyYAML reads 1e-4 as text.
        numbers = np.array([float(v) for v in value if not isinstance(v, bool)])
    except (TypeError, ValueError, OverflowError):
        numbers = np.empty(0)
    if len(numbers) != count or isinstance(value, str) or not np.isfinite(numbers).all():
        raise BodyError(f"{where} must be a list of {count} finite numbers, not {shown(value)}")
    return numbers


def pose_of(entry: dict[str, Any], origin_key: str, quaternion_key: str, where: str) -> Array:
    """Return the pose (4, 4) of an origin [m] and a quaternion x y z w; absent ones are zero and the identity.

    Raises:
        BodyError: not finite numbers, or not a unit quaternion.
    """
    origin = numbers_of(entry.get(origin_key, [0.0, 0.0, 0.0]), 3, f"{where}: {origin_key}")
    quaternion = numbers_of(entry.get(quaternion_key, [0.0, 0.0, 0.0, 1.0]), 4, f"{where}: {quaternion_key}")
    length = float(np.linalg.norm(quaternion))
    if abs(length - 1.0) > _QUATERNION_TOLERANCE:
        raise BodyError(f"{where}: {quaternion_key} must be a unit quaternion x y z w, but its length is {length:.4g}")
    return rigid(rotation_from_xyzw(quaternion), origin)
