"""An attachment as it is written: points and weights in millimetres, and when it holds (``equipment_yaml``)."""

import math
from typing import Any

import numpy as np

from bodycam_ros.body.checked_fields import check_keys, name_of, number_of, numbers_of, truth_of
from bodycam_ros.equipment.equipment import Attachment, Interval
from bodycam_ros.errors import BodyError
from bodycam_ros.geometry import Array
from bodycam_ros.kinematics.joint import FARTHEST_M, TIGHT_M
from bodycam_ros.shown import shown

LEAST_UNKNOWN_MM = 1.0
"""Less than a ruler tells is known, or was written in metres."""

_MOST_PAIRS = 100
_MOST_INTERVALS = 1000
_LEAST_WEIGHT_MM, _MOST_WEIGHT_MM = 1e3 * TIGHT_M, 1000.0
_LEAST_PLACE_MM = 2.0
_MOST_MM = 1e3 * FARTHEST_M
_HOLDS = {"detected": True, "always": False}


def attachment_of(name: str, entry: Any) -> Attachment:
    """The attachment that a table describes.

    Raises:
        BodyError: it describes none; the message names the attachment.
    """
    where = f"attachment {name}"
    check_keys(entry, where, {"body", "equipment", "points"}, {"weight", "unknown", "holds", "optional"})
    pairs = entry["points"]
    if not isinstance(pairs, list) or not 1 <= len(pairs) <= _MOST_PAIRS:
        raise BodyError(
            f"{where}: points must be a list of 1 to {_MOST_PAIRS} pairs such as "
            f"{{body: [125, 0, -82], equipment: [0, 0, 0]}}, not {shown(pairs)}"
        )
    of_all = _weight(entry["weight"], where) if "weight" in entry else None
    on_body, on_equipment, sigmas = zip(
        *(_pair(pair, f"{where}: pair {number}", of_all) for number, pair in enumerate(pairs, 1)), strict=True
    )
    intervals, detected = _holds(entry.get("holds", "detected"), f"{where}: holds")
    return Attachment(
        name=name,
        body_segment=name_of(entry["body"], f"{where}: body"),
        equipment_segment=name_of(entry["equipment"], f"{where}: equipment"),
        on_body=1e-3 * np.array(on_body),
        on_equipment=1e-3 * np.array(on_equipment),
        sigmas=1e-3 * np.array(sigmas),
        unknown=1e-3 * lengths_of(entry.get("unknown", [0, 0, 0]), f"{where}: unknown", LEAST_UNKNOWN_MM),
        intervals=intervals,
        detected=detected,
        optional=truth_of(entry.get("optional", False), f"{where}: optional"),
    )


def lengths_of(value: Any, where: str, least_mm: float) -> Array:
    """Lengths (3) [mm], 0 or at least ``least_mm``.

    Raises:
        BodyError: they are not; those that are too small look like metres.
    """
    lengths = numbers_of(value, 3, where)
    if (lengths < 0.0).any() or (lengths > _MOST_MM).any():
        raise BodyError(f"{where} must be 0 to {_MOST_MM:g} mm along each axis, not {shown(value)}")
    if ((lengths > 0.0) & (lengths < least_mm)).any():
        raise BodyError(f"{where} is in millimetres, 0 or at least {least_mm:g}; {shown(value)} looks like metres")
    return lengths


def _pair(pair: Any, where: str, of_all: float | None) -> tuple[Array, Array, float]:
    """Points on the body and on the equipment (3) [mm], and the pair's weight [mm]."""
    check_keys(pair, where, {"body", "equipment"}, {"weight"})
    if "weight" not in pair and of_all is None:
        raise BodyError(f"{where}: lacks weight, how far from each other its points may be [mm]")
    weight = _weight(pair["weight"], where) if "weight" in pair else of_all
    assert weight is not None
    return _place(pair["body"], f"{where}: body"), _place(pair["equipment"], f"{where}: equipment"), weight


def _place(value: Any, where: str) -> Array:
    place = numbers_of(value, 3, where)
    far_mm = float(np.linalg.norm(place))
    if 0.0 < far_mm < _LEAST_PLACE_MM:
        raise BodyError(
            f"{where} is in millimetres, but {shown(value)} is {far_mm:.2g} mm from the segment's origin; "
            "it looks like metres"
        )
    if far_mm > _MOST_MM:
        raise BodyError(f"{where} is {far_mm:g} mm from the segment's origin; at most {_MOST_MM:g}")
    return place


def _weight(value: Any, where: str) -> float:
    return number_of(value, f"{where}: weight [mm]", _LEAST_WEIGHT_MM, _MOST_WEIGHT_MM)


def _holds(value: Any, where: str) -> tuple[tuple[Interval, ...] | None, bool]:
    """When it holds, None for always, and whether it is detected."""
    if isinstance(value, str) and value in _HOLDS:
        return None, _HOLDS[value]
    if not isinstance(value, list) or not 1 <= len(value) <= _MOST_INTERVALS:
        raise BodyError(
            f"{where} must be detected, always, or a list of intervals such as [[0, 3.2], [5, .inf]] [s], "
            f"not {shown(value)}"
        )
    intervals = tuple(_interval(each, where) for each in value)
    for before, after in zip(intervals, intervals[1:], strict=False):
        if after[0] < before[1]:
            raise BodyError(
                f"{where}: its intervals must follow each other, but {after[0]:g} s is before {before[1]:g} s"
            )
    return intervals, False


def _interval(value: Any, where: str) -> Interval:
    try:
        start, end = (float(bound) for bound in value if not isinstance(bound, bool))
    except (TypeError, ValueError, OverflowError):
        start = end = math.nan
    if not (math.isfinite(start) and start < end):
        raise BodyError(f"{where}: an interval is [from, until] [s], the earlier one first, not {shown(value)}")
    return start, end
