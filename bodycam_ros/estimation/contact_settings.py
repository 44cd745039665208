"""Settings of contact: whether feet stand, and how firmly they are held."""

from dataclasses import dataclass

from bodycam_ros.settings import setting


@dataclass(frozen=True)
class ContactSettings:
    """Whether feet stand, and how firmly they are held."""

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
    max_height: float = setting(
        0.1,
        unit="m",
        limits=(0.001, 100.0),
        reason="of a point that has just become slow, over the level that feet stood on last, at first z = 0: pedals "
        "are higher; a point that stays slow stands at any height",
    )
