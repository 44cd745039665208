"""What a check finds: a light, what is seen, and what to do."""

from collections.abc import Sequence
from dataclasses import dataclass
from enum import IntEnum


class Light(IntEnum):
    """How a recording does by one check."""

    GREEN = 0
    AMBER = 1
    RED = 2

    @property
    def word(self) -> str:
        """As people say it."""
        return self.name.lower()


@dataclass(frozen=True)
class Finding:
    """What one check says, of one camera or joint or of the recording as a whole.

    Attributes:
        check: its name, as "gaps".
        light: green, amber or red.
        what: is seen.
        remedy: what to do; empty where there is nothing.
        of: the camera or joint; empty where it is the recording.
    """

    check: str
    light: Light
    what: str
    remedy: str = ""
    of: str = ""

    @property
    def text(self) -> str:
        """Who, what and what to do in one line."""
        said = f"{self.of}: {self.what}" if self.of else self.what
        return f"{said}; {self.remedy}" if self.remedy else said


def worst(findings: Sequence[Finding]) -> Light:
    """The worst light of all."""
    return max((finding.light for finding in findings), default=Light.GREEN)


def by_limits(value: float, amber: float, red: float) -> Light:
    """The light of a value whose limits are passed upwards, or downwards where red is below amber."""
    sign = 1.0 if red >= amber else -1.0
    if sign * value > sign * red:
        return Light.RED
    return Light.AMBER if sign * value > sign * amber else Light.GREEN
