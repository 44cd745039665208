"""Coupling of a body to its equipment, at one state and over a recording."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.geometry import Array


@dataclass(frozen=True, eq=False)
class EquipmentReport:
    """K attachments, and L lengths that the file leaves open.

    Attributes:
        name: of the equipment.
        placed: whether it is known where the equipment is; until then nothing is coupled to it.
        attachments: (K) names.
        engaged: (K,) whether each held at this time.
        deviations: (K,) distance between its points on the body and on the equipment, the mean over them [m]; NaN while
            the equipment is not placed.
        lengths: (L) what was unknown, ``<attachment or joint>_<x, y or z>``.
        priors: (L,) sigmas of the file [m].
        values: (L,) as far as it is known [m].
        sigmas: (L,) [m].
    """

    name: str
    placed: bool
    attachments: tuple[str, ...]
    engaged: NDArray[np.bool_]
    deviations: Array
    lengths: tuple[str, ...]
    priors: Array
    values: Array
    sigmas: Array


@dataclass(frozen=True, eq=False)
class EquipmentRecord(EquipmentReport):
    """T reports of the same equipment: engaged and deviations are (T, K), and lengths as they are known at last.

    Attributes:
        stamps_ns: (T,) increasing [ns].
        placed: (T,) whether it is known where the equipment is.
    """

    stamps_ns: NDArray[np.int64]
    placed: NDArray[np.bool_]  # type: ignore[assignment]

    @property
    def held(self) -> NDArray[np.bool_]:
        """(T, K) whether an attachment held, and it was known to what."""
        held: NDArray[np.bool_] = self.engaged & self.placed[:, None]
        return held

    def let_go(self, attachment: int) -> list[tuple[int, int]]:
        """First and last stamp [ns] of each stretch in which an attachment did not hold what was placed."""
        off = np.concatenate([[False], self.placed & ~self.held[:, attachment], [False]])
        starts, ends = np.flatnonzero(off[1:] & ~off[:-1]), np.flatnonzero(off[:-1] & ~off[1:]) - 1
        return [(int(self.stamps_ns[a]), int(self.stamps_ns[b])) for a, b in zip(starts, ends, strict=True)]


class EquipmentLog:
    """Collects reports in any order; ``record`` has them in order of time."""

    def __init__(self) -> None:
        self._reports: dict[int, EquipmentReport] = {}

    def add(self, stamp_ns: int, report: EquipmentReport) -> None:
        """Add the report of one state; of two with one stamp the later counts.

        Raises:
            ValueError: it is of other equipment than the ones before.
        """
        if self._reports:
            known = next(iter(self._reports.values()))
            if (report.name, report.attachments, report.lengths) != (known.name, known.attachments, known.lengths):
                raise ValueError(f"it is of {report.name}, and those before of another {known.name}")
        self._reports[stamp_ns] = report

    def record(self) -> EquipmentRecord | None:
        """All of it in the order of time; None if there was no report."""
        if not self._reports:
            return None
        stamps = sorted(self._reports)
        reports = [self._reports[stamp] for stamp in stamps]
        over_time = ("placed", "engaged", "deviations")
        columns = {name: np.array([getattr(report, name) for report in reports]) for name in over_time}
        return EquipmentRecord(stamps_ns=np.array(stamps, np.int64), **(vars(reports[-1]) | columns))
