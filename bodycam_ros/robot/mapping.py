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

from collections.abc import Mapping
from dataclasses import dataclass, field
from math import pi
from pathlib import Path
from typing import Annotated, Literal

from msgspec import Meta
from msgspec.structs import astuple

from bodycam_ros.body.checked_fields import Entry, Name, read_entry
from bodycam_ros.errors import BodyError
from bodycam_ros.yaml_file import read_yaml

SIDES = ("left", "right")
_Side = Literal["left", "right"]


class _LegEntry(Entry):
    hip: Name
    knee: Name
    ankle: Name
    sole: Name


class _ArmEntry(Entry):
    shoulder: Name
    elbow: Name
    wrist: Name


class _MappingEntry(Entry):
    root: Name
    legs: Annotated[dict[_Side, _LegEntry], Meta(min_length=2)]
    arms: dict[_Side, _ArmEntry] = {}
    trunk: Name | None = None
    head: Name | None = None
    n_pose: dict[Name, Annotated[float, Meta(ge=-2.0 * pi, le=2.0 * pi)]] = {}
    feet_apart: Annotated[float, Meta(ge=0.0, le=0.3)] = 0.0


@dataclass(frozen=True)
class RobotMapping:
    """Links of a robot and the parts of a person that they follow.

    Attributes:
        path: of the file.
        root: link that follows the pelvis.
        trunk: link that rotates as the torso; None if there is none.
        head: link that rotates as the head; None if there is none.
        legs: side -> links at hip, knee, ankle and sole.
        arms: side -> links at shoulder, elbow and wrist.
        n_pose: joint -> angle [rad] in the N-pose; others are 0, or at their limit.
        feet_apart: outward shift of each foot [m].
    """

    path: Path
    root: str
    trunk: str | None = None
    head: str | None = None
    legs: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    arms: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    n_pose: Mapping[str, float] = field(default_factory=dict)
    feet_apart: float = 0.0

    @property
    def links(self) -> tuple[str, ...]:
        """All mapped links."""
        single = [link for link in (self.root, self.trunk, self.head) if link is not None]
        return (*single, *(link for limbs in (self.legs, self.arms) for limb in limbs.values() for link in limb))


def read_mapping(path: Path) -> RobotMapping:
    """Read a mapping.

    Raises:
        BodyError: not a mapping; the message names the file and the key.
    """
    entry: _MappingEntry = read_entry(_MappingEntry, read_yaml(path, "mapping to a robot", BodyError), str(path))
    legs, arms = ({str(side): astuple(limb) for side, limb in sorted(of.items())} for of in (entry.legs, entry.arms))
    return RobotMapping(path, entry.root, entry.trunk, entry.head, legs, arms, entry.n_pose, entry.feet_apart)
