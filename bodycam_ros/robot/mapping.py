"""Which links of a robot stand for which joints of a person: a YAML file that the user writes once for a robot.

    root: base_link                     # follows the pelvis
    trunk: torso_2_link                 # turns as the torso does; may be left out, as may head, legs and arms
    head: head_2_link
    legs:
      left: {hip: leg_left_3_link, knee: leg_left_4_link, ankle: leg_left_6_link, sole: left_sole_link}
      right: {hip: leg_right_3_link, knee: leg_right_4_link, ankle: leg_right_6_link, sole: right_sole_link}
    arms:
      left: {shoulder: arm_left_2_link, elbow: arm_left_4_link, wrist: arm_left_7_link}
      right: {shoulder: arm_right_2_link, elbow: arm_right_4_link, wrist: arm_right_7_link}
    n_pose: {}                          # joint: angle [rad] of the robot that stands as in the N-pose; else 0
    feet_apart: 0.045                   # [m] each foot is moved outward so far: a robot's are wider than a person's

A link stands for the joint at its origin. In the N-pose the robot's root looks along x, z is up.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from math import pi
from pathlib import Path
from typing import Any

from bodycam_ros.body.checked_fields import check_keys, name_of, number_of, table_of
from bodycam_ros.errors import BodyError
from bodycam_ros.yaml_file import read_yaml

SIDES = ("left", "right")
_LEG, _ARM = ("hip", "knee", "ankle", "sole"), ("shoulder", "elbow", "wrist")
_MOST_JOINTS = 500
_WIDEST_M = 0.3


@dataclass(frozen=True)
class RobotMapping:
    """What of a robot follows what of a person.

    Attributes:
        path: of the file.
        root: link that follows the pelvis.
        trunk: link that turns as the torso does; None if there is none.
        head: link that turns as the head does; None if there is none.
        legs: side -> links at hip, knee, ankle and sole.
        arms: side -> links at shoulder, elbow and wrist.
        n_pose: joint -> angle [rad] in the N-pose; those that are not named are 0, or as near as they can be.
        feet_apart: how far each foot is moved outward, where those of the robot are wider than a person's [m].
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
        """All links that are named."""
        single = [link for link in (self.root, self.trunk, self.head) if link is not None]
        return (*single, *(link for limbs in (self.legs, self.arms) for limb in limbs.values() for link in limb))


def read_mapping(path: Path) -> RobotMapping:
    """Read a mapping.

    Raises:
        BodyError: not a mapping; the message names the file and the key.
    """
    document = read_yaml(path, "mapping to a robot", BodyError)
    try:
        check_keys(document, "mapping", {"root", "legs"}, {"trunk", "head", "arms", "n_pose", "feet_apart"})
        single = {key: name_of(document[key], key) for key in ("trunk", "head") if key in document}
        angles = table_of(document.get("n_pose", {}), "n_pose", _MOST_JOINTS)
        return RobotMapping(
            path,
            name_of(document["root"], "root"),
            **single,
            legs=_limbs(document["legs"], "legs", _LEG),
            arms=_limbs(document.get("arms", {}), "arms", _ARM),
            feet_apart=number_of(document.get("feet_apart", 0.0), "feet_apart", 0.0, _WIDEST_M),
            n_pose={
                name_of(joint, "n_pose"): number_of(angle, f"n_pose: {joint}", -2.0 * pi, 2.0 * pi)
                for joint, angle in angles.items()
            },
        )
    except BodyError as error:
        raise BodyError(f"{path}: {error}") from error


def _limbs(value: Any, where: str, joints: tuple[str, ...]) -> dict[str, tuple[str, ...]]:
    """Side -> links at the joints of a limb."""
    check_keys(value, where, set(SIDES) if where == "legs" else set(), set(SIDES))
    for side, limb in value.items():
        check_keys(limb, f"{where}: {side}", set(joints), set())
    return {
        side: tuple(name_of(value[side][joint], f"{where}: {side}: {joint}") for joint in joints)
        for side in SIDES
        if side in value
    }
