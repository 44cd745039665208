"""Settings of the motion prior; apart from it, for what reads settings need not load gtsam."""

from dataclasses import dataclass

from bodycam_ros.settings import setting


@dataclass(frozen=True)
class MotionSettings:
    """How suddenly a body changes its motion."""

    acceleration_sigma: float = setting(
        15.0,
        unit="m/s^2",
        limits=(0.1, 1000.0),
        reason="of a segment's origin; walking feet reach 30, heel strikes more",
    )
    angular_acceleration_sigma: float = setting(
        60.0, unit="rad/s^2", limits=(0.1, 5000.0), reason="of a segment; forearms and shins in quick motion reach 100"
    )
