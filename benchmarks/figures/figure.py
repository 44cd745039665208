"""One figure of the table, and the limit that it must hold."""

import math
from dataclasses import dataclass
from pathlib import Path

import yaml

LIMITS = Path(__file__).with_name("limits.yaml")

Value = float | str


@dataclass(frozen=True)
class Figure:
    """A measured number, or a word such as a verdict.

    Attributes:
        name: ``GROUP: WHAT [UNIT]``; a figure keeps its name from run to run.
        value: what was measured; NaN where the measurement failed.
    """

    name: str
    value: Value

    @property
    def group(self) -> str:
        """What it is a figure of."""
        return self.name.partition(": ")[0]


@dataclass(frozen=True)
class Limit:
    """What a figure must hold, and how far two runs of the same code differ.

    Attributes:
        sign: ``<=``, ``>=``, ``=``, or ``open``: it holds nothing yet.
        bound: the number or word; where it is open, by which issue it is to get one.
        noise: largest difference between two runs of the same code, as a share of the value.
    """

    sign: str
    bound: Value
    noise: float

    def is_held_by(self, value: Value) -> bool:
        """Whether a value is within the limit; NaN never is."""
        if self.sign in ("=", "open"):
            return self.sign == "open" or value == self.bound
        if isinstance(value, str) or isinstance(self.bound, str) or math.isnan(value):
            return False
        return value <= self.bound if self.sign == "<=" else value >= self.bound

    def __str__(self) -> str:
        bound = self.bound if isinstance(self.bound, str) else f"{self.bound:g}"
        return f"{self.sign} {bound}"


def read_limits() -> dict[str, Limit]:
    """Name of a figure -> its limit, from ``limits.yaml`` (``NAME: [SIGN, BOUND, NOISE]``)."""
    return {name: Limit(*entry) for name, entry in yaml.safe_load(LIMITS.read_text()).items()}
