"""Settings of contact: when a foot stands, and how firmly it is held."""

from dataclasses import dataclass

from bodycam_ros.settings import setting


@dataclass(frozen=True)
class ContactSettings:
    """When a foot stands, and how firmly it is held."""

    enabled: bool = setting(True, reason="a foot that stands does not slide; false leaves feet to the cameras alone")
    segments: str = setting(
        "foot_left foot_right", reason="names of the segments that stand, of which a body may lack some"
    )
    creep: float = setting(
        0.06,
        unit="m/s",
        limits=(0.0001, 10.0),
        reason="of a point that rests: 2 mm from image to image at 30 Hz; standing feet of motion capture creep by 1",
    )
    blind_creep: float = setting(
        0.12,
        unit="m/s",
        limits=(0.0001, 10.0),
        reason="the same of a foot whose camera is not registered: firmer, it turns feet that roll",
    )
    rest_speed: float = setting(
        0.06, unit="m/s", limits=(0.001, 10.0), reason="a slower point of the sole has come to rest"
    )
    leave_speed: float = setting(0.12, unit="m/s", limits=(0.001, 10.0), reason="a faster one rests no longer")
    speed_time: float = setting(
        0.04,
        unit="s",
        limits=(0.001, 1.0),
        reason="speeds are taken over this time, or from one image to the next; cameras that err by 5 mm need 0.1",
    )
    max_height: float = setting(
        0.1,
        unit="m",
        limits=(0.001, 100.0),
        reason="of a point that has just become slow, over the level that feet stood on last, at first z = 0: pedals "
        "are higher; a point that stays slow stands at any height",
    )
    blind_rest_speed: float = setting(
        0.1,
        unit="m/s",
        limits=(0.001, 10.0),
        reason="of the ankle of a foot that no camera sees: slower, the foot has come to rest, flat on the floor",
    )
    blind_leave_speed: float = setting(
        0.15,
        unit="m/s",
        limits=(0.001, 10.0),
        reason="by which such an ankle nears or leaves a point that rests: faster, it rests no longer",
    )
    blind_sigma: float = setting(
        0.01, unit="m", limits=(0.001, 1.0), reason="of where a point of such a foot rests: shoes are not flat"
    )
