"""What a user may say about how a body and its motion are written for other programs."""

import math
from dataclasses import dataclass, fields

from bodycam_ros.errors import SettingsError
from bodycam_ros.formats.axes import UP_AXES
from bodycam_ros.formats.bone_names import BONE_NAMES
from bodycam_ros.formats.rest_pose import REST_POSES

HIGHEST_RATE = 1000.0  # [1/s] beyond it a minute fills gigabytes, and nobody moves so quickly
_LARGEST_SCALE = 1e6
_HEAVIEST_KG = 1000.0


@dataclass(frozen=True)
class MotionOptions:
    """How a body and its motion are written; None: as the format has it.

    Attributes:
        rate: instants a second; None: those that were solved.
        pose: rest pose, a key of ``REST_POSES``.
        up: axis that is up, a key of ``UP_AXES``.
        scale: units of the file to a metre.
        names: of the bones, a key of ``BONE_NAMES``.
        segment: segment or camera whose trajectory is wanted, or "all".
        mass: of the whole person [kg].

    Raises:
        SettingsError: a value that cannot be.
    """

    rate: float | None = None
    pose: str | None = None
    up: str | None = None
    scale: float | None = None
    names: str | None = None
    segment: str | None = None
    mass: float | None = None

    def __post_init__(self) -> None:
        if self.rate is not None and not 0.0 < self.rate <= HIGHEST_RATE:
            raise SettingsError(f"--rate must be above 0 and at most {HIGHEST_RATE:g} a second, not {self.rate:g}")
        if self.scale is not None and not (math.isfinite(self.scale) and 0.0 < self.scale <= _LARGEST_SCALE):
            raise SettingsError(f"--scale must be above 0 and at most {_LARGEST_SCALE:g}, not {self.scale:g}")
        if self.mass is not None and not 0.0 < self.mass <= _HEAVIEST_KG:
            raise SettingsError(f"--mass must be above 0 and at most {_HEAVIEST_KG:g} kg, not {self.mass:g}")
        for flag, value, known in (
            ("pose", self.pose, REST_POSES),
            ("up", self.up, UP_AXES),
            ("names", self.names, BONE_NAMES),
        ):
            if value is not None and value not in known:
                raise SettingsError(f"--{flag} must be one of {', '.join(known)}, not {value}")

    @property
    def given(self) -> tuple[str, ...]:
        """Names of those that the user gave."""
        return tuple(field.name for field in fields(self) if getattr(self, field.name) is not None)
