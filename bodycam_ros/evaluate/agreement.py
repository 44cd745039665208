"""A solved recording beside what another system captured of the same motion."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.body.urdf import CAMERA_SUFFIX
from bodycam_ros.evaluate.clock_search import Clock
from bodycam_ros.geometry import Array

SIMILARITY, RIGID, NONE = ALIGNMENTS = ("similarity", "rigid", "none")
"""How our world is brought to the other system's: with a scale (A section 5.1), without, or not at all."""

_LEAST_LEAD = 2.5
"""Of a match that is none of chance: one search in fifty reaches it by chance, by nine rates and some 20 offsets."""

_LARGEST_SIGMA_S = 0.05
"""Of the clock offset: joints that move alike leave some milliseconds, noisy markers 20 ms."""

_LARGEST_SCALE = 0.05
"""Two systems that measured one person differ by less: a board printed wrong by 1 or 2 %."""


@dataclass(frozen=True, eq=False)
class PointAgreement:
    """A joint, a marker or a camera over T instants, in the other system's world.

    Attributes:
        name: in the other system.
        link: of ours that it is on.
        is_fitted: where on the link it is was fitted, so that no constant error shows.
        ours, theirs: (T, 3) [m]; theirs NaN where it was not seen.
    """

    name: str
    link: str
    is_fitted: bool
    ours: Array
    theirs: Array

    @property
    def is_camera(self) -> bool:
        """Whether it is the centre of a worn camera."""
        return self.link.endswith(CAMERA_SUFFIX)

    @property
    def errors(self) -> Array:
        """(T,) [m] distance; NaN where it was not seen."""
        distance: Array = np.linalg.norm(self.ours - self.theirs, axis=1)
        return distance


@dataclass(frozen=True, eq=False)
class AngleAgreement:
    """A joint over T instants.

    Attributes:
        segment: that hangs on it.
        ours, theirs: (T, 3) angles [rad] in the anatomical planes; NaN where they are not known.
        ours_turned, theirs_turned: (T,) [rad] by how much it has turned since the first instant (A figure 7a).
        from_points: told by centres of joints alone, not by rotations of bones.
    """

    segment: str
    ours: Array
    theirs: Array
    ours_turned: Array
    theirs_turned: Array
    from_points: bool


@dataclass(frozen=True, eq=False)
class Agreement:
    """Ours and theirs at the T instants that both have.

    Attributes:
        name: of what it is compared with.
        kind: its format: "TRC".
        stamps_ns: (T,) of ours [ns].
        clock: of theirs by ours.
        align: which of ``ALIGNMENTS`` brought our world to theirs.
        scale: of theirs over ours, as a similarity has it; errors are free of it only with that alignment.
        unit_m: metres of the unit that the file was found to be in; None where it says.
        points: joints, markers and cameras.
        angles: joints.
        left_out: names of theirs that nobody knows.
        rigid_error: mean position error of joints [m] without a scale; NaN with ``none``.
    """

    name: str
    kind: str
    stamps_ns: NDArray[np.int64]
    clock: Clock
    align: str
    scale: float
    unit_m: float | None
    points: tuple[PointAgreement, ...]
    angles: tuple[AngleAgreement, ...]
    left_out: tuple[str, ...]
    rigid_error: float

    @property
    def doubts(self) -> tuple[str, ...]:
        """Why the two may not be of the same motion, and what to do; empty where nothing speaks against it."""
        found = []
        if self.clock.start_sigma_s > 0.0 and self.clock.lead < _LEAST_LEAD:
            found.append(
                f"the best clock offset is hardly better than the second best (by {self.clock.lead:.1f} standard "
                f"deviations of chance, expected {_LEAST_LEAD:g} or more)"
            )
        if self.clock.start_sigma_s > _LARGEST_SIGMA_S:
            found.append(
                f"the clock offset is known to +-{1e3 * self.clock.start_sigma_s:.0f} ms only, expected "
                f"{1e3 * _LARGEST_SIGMA_S:.0f} ms or less"
            )
        if abs(self.scale - 1.0) > _LARGEST_SCALE:
            found.append(
                f"the scale is {100.0 * (self.scale - 1.0):+.1f} %, expected {100.0 * _LARGEST_SCALE:.0f} % or less"
            )
        remedy = "is it of the same recording and person, and is each point the right one (--points)?"
        return tuple(f"{self.name}: {doubt}; {remedy}" for doubt in found)

    @property
    def joints(self) -> tuple[PointAgreement, ...]:
        """Centres of joints, of which constant errors show, too; without any, markers, and without these cameras."""
        body = tuple(point for point in self.points if not point.is_camera)
        return tuple(point for point in body if not point.is_fitted) or body or self.points

    @property
    def position_errors(self) -> Array:
        """(T, N) [m] of ``joints``."""
        return np.stack([point.errors for point in self.joints], axis=1)

    @property
    def angle_errors(self) -> Mapping[str, Array]:
        """Segment -> (T,) [rad] the paper's measure: of by how much a joint has turned since the first instant."""
        return {angle.segment: np.abs(angle.ours_turned - angle.theirs_turned) for angle in self.angles}


_WITHIN = 1.96


@dataclass(frozen=True)
class LimitsOfAgreement:
    """Bland and Altman 1986: the mean difference of two ways to measure, and where 95 % of the differences lie.

    Attributes:
        bias: mean of ours less theirs.
        low, high: bias less and more 1.96 standard deviations.
        rmse: root of the mean square of the differences.
    """

    bias: float
    low: float
    high: float
    rmse: float

    @classmethod
    def of(cls, ours: Array, theirs: Array) -> "LimitsOfAgreement":
        """The agreement of values of the same shape; those that are NaN in either do not count."""
        difference = (ours - theirs)[np.isfinite(ours - theirs)]
        if not difference.size:
            return cls(*[np.nan] * 4)
        bias, sd = float(difference.mean()), float(difference.std())
        return cls(bias, bias - _WITHIN * sd, bias + _WITHIN * sd, float(np.sqrt((difference**2).mean())))


_UNITS = {1.0: "m", 0.01: "cm", 0.001: "mm", 0.0254: "inches"}


def agreement_lines(agreement: Agreement) -> list[str]:
    """How the two were compared, in sentences."""
    clock = agreement.clock
    when = f"Their first frame is at {clock.start_s:.3f} s of this recording"
    if clock.start_sigma_s == 0.0:
        when += ", as its stamps say."
    else:
        rate = "counts as ours"
        if clock.rate != 1.0:
            rate = f"counts seconds of {clock.rate:.5f} s (+-{clock.rate_sigma:.5f})"
        when += f" (+-{1e3 * clock.start_sigma_s:.1f} ms), and their clock {rate}."
    scale = f"{agreement.scale:.4f} ({100.0 * (agreement.scale - 1.0):+.2f} %)"
    if agreement.align == NONE:
        where = f"Worlds are taken to be the same; a similarity would have a scale of {scale}."
    elif agreement.align == SIMILARITY:
        rigid = f"{100.0 * agreement.rigid_error:.2f} cm"
        where = f"Worlds are aligned by a similarity of scale {scale}; without it joints are {rigid} off on average."
    else:
        where = f"Worlds are aligned rigidly; a similarity would have a scale of {scale}."
    lines = [f"{when} {where} {len(agreement.stamps_ns)} frames are compared."]
    if agreement.unit_m is not None:
        unit = _UNITS.get(agreement.unit_m, f"{agreement.unit_m:.4f} m")
        lines.append(f"The file does not say its unit; by the size of the body it is {unit}.")
    if agreement.left_out:
        some = ", ".join(agreement.left_out[:12]) + (" ..." if len(agreement.left_out) > 12 else "")
        lines.append(f"Not compared, because their names are unknown (--points maps them): {some}.")
    return lines
