"""A gait in figures: its part of ``summary.json``."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from bodycam_ros.evaluate.gait import JOINTS, SIDES, Gait, Stride

CM_PER_M = 100.0


@dataclass(frozen=True)
class Measure:
    """What is said of every stride.

    Attributes:
        name: as people read it, with the unit.
        key: in ``summary.json``.
        of: a stride -> its value in that unit.
        is_symmetric: whether the two sides of a healthy person are alike in it, so that the index says something.
    """

    name: str
    key: str
    of: Callable[[Stride], float]
    is_symmetric: bool = True


def _range_of(joint: str) -> Callable[[Stride], float]:
    return lambda stride: float(np.degrees(stride.range_of(joint)))


MEASURES: Sequence[Measure] = (
    Measure("stride time [s]", "stride_s", lambda stride: stride.duration),
    Measure("cadence [steps/min]", "cadence_per_min", lambda stride: 120.0 / stride.duration),
    Measure("stride length [m]", "stride_m", lambda stride: stride.length),
    Measure("step length [m]", "step_m", lambda stride: stride.step_length),
    Measure("step width [cm]", "step_width_cm", lambda stride: CM_PER_M * stride.step_width, is_symmetric=False),
    Measure("walking speed [m/s]", "speed_m_s", lambda stride: stride.speed, is_symmetric=False),
    Measure("stance [%]", "stance_percent", lambda stride: 100.0 * stride.stance),
    Measure("swing [%]", "swing_percent", lambda stride: 100.0 * (1.0 - stride.stance)),
    Measure(
        "double support [%]", "double_support_percent", lambda stride: 100.0 * stride.double_support,
        is_symmetric=False,
    ),
    Measure("clearance of the ball [cm]", "clearance_cm", lambda stride: CM_PER_M * stride.clearance),
    Measure("rise of the heel [cm]", "heel_rise_cm", lambda stride: CM_PER_M * stride.heel_rise),
    *(Measure(f"{joint}, range [deg]", f"{joint}_range_deg", _range_of(joint)) for joint in JOINTS),
)  # fmt: skip


@dataclass(frozen=True)
class MeanAndSd:
    """Mean and standard deviation over strides; NaN of none."""

    mean: float
    sd: float

    @classmethod
    def of(cls, strides: Sequence[Stride], measure: Measure) -> "MeanAndSd":
        """Of a measure of strides; those of which it is not known do not count."""
        values = np.array([measure.of(stride) for stride in strides])
        known = values[np.isfinite(values)]
        return cls(float(known.mean()), float(known.std())) if known.size else cls(np.nan, np.nan)


def symmetry_index(gait: Gait, measure: Measure) -> float:
    """Left less right over the mean of both [%] (Robinson, Herzog and Nigg 1987); 0 is symmetric."""
    left, right = (MeanAndSd.of(gait.of(side), measure).mean for side in SIDES)
    middle = (left + right) / 2.0
    return 100.0 * (left - right) / middle if middle else np.nan


def gait_figures(gait: Gait) -> Mapping[str, Any]:
    """Figures by name, the unit at the end of the name: of all strides, of each side, and how symmetric they are."""
    return {
        "strides": {side: len(gait.of(side)) for side in SIDES},
        **{
            measure.key: {
                "mean": MeanAndSd.of(gait.strides, measure).mean,
                "sd": MeanAndSd.of(gait.strides, measure).sd,
                **{side: MeanAndSd.of(gait.of(side), measure).mean for side in SIDES},
                **({"symmetry_percent": symmetry_index(gait, measure)} if measure.is_symmetric else {}),
            }
            for measure in MEASURES
        },
    }
