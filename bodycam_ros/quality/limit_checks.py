"""Checks that hold one number of each camera against two limits."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Generic, TypeVar

import numpy as np

from bodycam_ros.verdict import Finding, Level, limit_level

T = TypeVar("T")


@dataclass(frozen=True)
class LimitCheck(Generic[T]):
    """A number of a camera, and its limits.

    Attributes:
        check: name of the check; several rows may share one.
        measure: of what was read of a camera; NaN where it cannot be computed.
        doubtful, wrong: limits, see ``verdict.limit_level``.
        what: observation, a format of the number and of what was read.
        remedy: what to do.
        summary: of the whole recording, a format of the least and the greatest number; empty for none.
    """

    check: str
    measure: Callable[[T], float]
    doubtful: float
    wrong: float
    what: str
    remedy: str
    summary: str = ""


def good(check: str, what: str) -> Finding:
    """The finding of a check of the whole recording without a fault."""
    return Finding("", Level.GOOD, what, part="recording", check=check)


def check_limits(cameras: Mapping[str, T], rows: Sequence[LimitCheck[T]]) -> Iterator[Finding]:
    """Findings of the cameras beyond a limit, and the summaries.

    Args:
        cameras: name -> what was read of it.
        rows: of the table of checks.
    """
    for row in rows:
        values = {name: float(row.measure(camera)) for name, camera in cameras.items()}
        values = {name: value for name, value in values.items() if np.isfinite(value)}
        for name, value in values.items():
            if level := limit_level(value, row.doubtful, row.wrong):
                yield Finding(name, level, row.what.format(value, cameras[name]), remedy=row.remedy, check=row.check)
        if row.summary and values:
            yield good(row.check, row.summary.format(min(values.values()), max(values.values())))
