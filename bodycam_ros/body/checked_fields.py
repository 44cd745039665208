"""Values of a body or equipment file, checked by msgspec; ``where`` begins the message: "joint spine: axis"."""

import re
from typing import Annotated, Any, get_args, get_type_hints

import msgspec
import numpy as np

from bodycam_ros.errors import BodyError
from bodycam_ros.files.shown import other_than, shown
from bodycam_ros.geometry import Array, rigid, rotation_from_xyzw

_FIELD = re.compile(r"unknown field (\S+)$")
_QUATERNION_TOLERANCE = 1e-3  # a length that differs more from 1 is a slip of the pen, not rounding
_LONGEST_MESSAGE = 200
_DECIMALS = 9  # of written numbers: 1 nm, 1 nrad

_UNPRINTABLE = r"\x00-\x1f\x7f-\x9f\u200b-\u200f\u2028-\u202e\u2066-\u2069"
Name = Annotated[str, msgspec.Meta(min_length=1, max_length=100, pattern=rf"^[^{_UNPRINTABLE}]*$")]
Number = Annotated[float, msgspec.Meta(ge=-1e15, le=1e15)]  # neither infinite nor NaN
Point = tuple[Number, Number, Number]
Quaternion = tuple[Number, Number, Number, Number]
ORIGIN: Point = (0.0, 0.0, 0.0)
UNTURNED: Quaternion = (0.0, 0.0, 0.0, 1.0)


class Entry(msgspec.Struct, forbid_unknown_fields=True, omit_defaults=True):
    """A table of a file; fields without a default are needed."""


def read_entry(kind: Any, value: Any, where: str) -> Any:
    """The value as a type that msgspec converts.

    Raises:
        BodyError: it is none.
    """
    try:
        return msgspec.convert(value, kind)
    except (msgspec.ValidationError, OverflowError) as error:
        problem, _, place = str(error)[:_LONGEST_MESSAGE].replace("`", "").partition(" - at $")
        if "matching regex" in problem:
            problem = "Expected printable characters"
        if problem.startswith("Expected str, got"):
            problem += " (put a number that is meant as a name in quotes)"
        problem += _remedy(kind, problem, place.lstrip("."))
        field = f"{where}: {place.lstrip('.')}" if place else where
        raise BodyError(f"{field}: {problem.replace('Object', 'table')}, in {shown(value)}") from error


def _remedy(kind: Any, problem: str, place: str) -> str:
    """What to do about some slips of the pen, after the problem; else nothing."""
    if (unknown := _FIELD.search(problem)) and not place:
        return f"; {other_than(unknown[1], getattr(kind, '__struct_fields__', ()))}"
    if problem.startswith("Expected array of length"):
        return " (numbers have a decimal point; commas are between them)"
    if problem.startswith(("Expected float, got str", "Expected int, got str")):
        return " (a number alone, without its unit)"
    if problem.startswith("Invalid enum value") and (allowed := get_args(get_type_hints(kind).get(place))):
        return f"; expected {' or '.join(map(str, allowed))}"
    return ""


def pose_of(origin: Point, quaternion: Quaternion, where: str) -> Array:
    """The pose (4, 4) of an origin [m] and a quaternion x y z w.

    Raises:
        BodyError: not a unit quaternion.
    """
    length = float(np.linalg.norm(quaternion))
    if abs(length - 1.0) > _QUATERNION_TOLERANCE:
        raise BodyError(f"{where} must be a unit quaternion x y z w, but its length is {length:.4g}")
    return rigid(rotation_from_xyzw(np.array(quaternion)), np.array(origin))


def rounded(values: Array) -> Any:
    """Numbers as a file has them, a tuple."""
    # Adding zero turns -0.0 into 0.0.
    return tuple(round(float(value), _DECIMALS) + 0.0 for value in values)


def numbers_of(value: Any, count: int, where: str) -> Array:
    """Return finite numbers (count).

    Raises:
        BodyError: not that many finite numbers.
    """
    kind = Annotated[list[Number], msgspec.Meta(min_length=count, max_length=count)]
    return np.array(read_entry(kind, value, f"{where} must be {count} finite numbers"), np.float64)
