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
        reason="standard deviation of the acceleration of a segment's origin; raise it for faster motion, lower it for "
        "a smoother body. Feet reach 30 in walking, more in heel strikes",
    )
    angular_acceleration_sigma: float = setting(
        60.0,
        unit="rad/s^2",
        limits=(0.1, 5000.0),
        reason="standard deviation of the angular acceleration of a segment; raise it for faster motion, lower it for "
        "a smoother body. Forearms and shins reach 100 in quick motion",
    )
