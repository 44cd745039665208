"""Links of a robot for the joints of a person: a YAML file, written once per robot.

    root: base_link                     # follows the pelvis
    trunk: torso_2_link                 # rotates as the torso does; optional, as are head and arms
    head: head_2_link
    legs:
      left: {hip: leg_left_3_link, knee: leg_left_4_link, ankle: leg_left_6_link, sole: left_sole_link}
      right: {hip: leg_right_3_link, knee: leg_right_4_link, ankle: leg_right_6_link, sole: right_sole_link}
    arms:
      left: {shoulder: arm_left_2_link, elbow: arm_left_4_link, wrist: arm_left_7_link}
      right: {shoulder: arm_right_2_link, elbow: arm_right_4_link, wrist: arm_right_7_link}
    n_pose: {}                          # joint: angle [rad] in the N-pose; 0 by default
    feet_apart: 0.045                   # [m] outward shift of each foot: a robot's are wider than a person's

A link is mapped by the joint at its origin. In the N-pose x of the robot's root is forward, z is up.
"""

from math import pi
from pathlib import Path
from typing import Annotated, Literal

from msgspec import Meta
from msgspec.structs import astuple, replace

from bodycam_ros.body.checked_fields import Entry, Name, read_entry
from bodycam_ros.errors import BodyError
from bodycam_ros.files.yaml_file import read_yaml

Side = Literal["left", "right"]
SIDES: tuple[Side, ...] = ("left", "right")


class Leg(Entry):
    """Links of a leg."""

    hip: Name
    knee: Name
    ankle: Name
    sole: Name


class Arm(Entry):
    """Links of an arm."""

    shoulder: Name
    elbow: Name
    wrist: Name


class RobotMapping(Entry):
    """Links of a robot and the parts of a person that they follow.

    Attributes:
        root: link that follows the pelvis.
        legs, arms: by their side; arms are optional.
        trunk: link that rotates as the torso; None if there is none.
        head: link that rotates as the head; None if there is none.
        n_pose: joint -> angle [rad] in the N-pose; others are 0, or at their limit.
        feet_apart: outward shift of each foot [m].
        path: of the file, which sets it when it is read.
    """

    root: Name
    legs: Annotated[dict[Side, Leg], Meta(min_length=2)]
    arms: dict[Side, Arm] = {}
    trunk: Name | None = None
    head: Name | None = None
    n_pose: dict[Name, Annotated[float, Meta(ge=-2.0 * pi, le=2.0 * pi)]] = {}
    feet_apart: Annotated[float, Meta(ge=0.0, le=0.3)] = 0.0
    path: str = ""

    @property
    def links(self) -> tuple[str, ...]:
        """All mapped links."""
        single = [link for link in (self.root, self.trunk, self.head) if link is not None]
        return (*single, *(link for limb in (*self.legs.values(), *self.arms.values()) for link in astuple(limb)))


def read_mapping(path: Path) -> RobotMapping:
    """Read a mapping.

    Raises:
        BodyError: not a mapping; the message names the file and the key.
    """
    mapping: RobotMapping = read_entry(RobotMapping, read_yaml(path, "mapping to a robot", BodyError), str(path))
    return replace(mapping, path=str(path))
