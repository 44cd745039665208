"""Targets of a robot's links: the measured motion of a person, scaled to the robot's bones.

Feet and pelvis keep their positions in the world, scaled by the leg lengths, so feet in stance do not slide. Elbows and
wrists are in the direction of the person's arms, scaled by the arm lengths, from shoulders on the robot's own trunk.
Links rotate as segments do since the N-pose.
"""

from collections.abc import Collection, Mapping
from dataclasses import dataclass

import numpy as np
from msgspec.structs import astuple

from bodycam_ros.body.body_model import BodyModel, sole_points
from bodycam_ros.errors import BodyError
from bodycam_ros.formats.markers import bone_tip
from bodycam_ros.geometry import Array, rigid, transform_points
from bodycam_ros.robot.mapping import SIDES, Side
from bodycam_ros.robot.robot_model import Robot

_LEG, _ARM = ("thigh", "shin", "foot"), ("upper_arm", "forearm")


@dataclass(frozen=True)
class LinkTarget:
    """Target of a link.

    Attributes:
        world_T_link: (4, 4) [m].
        position_counts, rotation_counts: whether its position, its rotation have a weight.
        is_end: whether it is a hand or a foot, which must follow.
    """

    world_T_link: Array
    position_counts: bool
    rotation_counts: bool
    is_end: bool = False


class ScaledPerson:
    """Poses of a body as targets of a robot's links.

    Args:
        body: the person.
        robot: with its mapping.
        reach: share of its limbs' lengths that the robot uses, so that it need not stretch them.

    Attributes:
        scale: of leg lengths, robot to person.

    Raises:
        BodyError: the person lacks legs, or an arm that the robot has; or the robot does not stand on its legs.
    """

    def __init__(self, body: BodyModel, robot: Robot, reach: float) -> None:
        self._body, self._robot = body, robot
        self._index = body.segment_index
        mapping = robot.mapping
        wanted = ["pelvis", *(f"{kind}_{side}" for side in mapping.legs for kind in _LEG)]
        wanted += [f"{kind}_{side}" for side in mapping.arms for kind in _ARM]
        if missing := [segment for segment in wanted if segment not in self._index]:
            raise BodyError(f"body {body.name} has no {', '.join(missing)}, which {mapping.path} lets a robot follow")
        at_rest = body.n_pose(np.eye(4))
        self._in_n = {link: robot.link_in_n_pose(link) for link in mapping.links}
        limbs = mapping.legs.values()
        hips, ankles = (
            self._middle_in_n(links) for links in ([leg.hip for leg in limbs], [leg.ankle for leg in limbs])
        )
        if hips[2] <= ankles[2]:
            raise BodyError(
                f"{mapping.path}: in the N-pose the ankles of the robot are not below its hips: name the links from "
                "the hip down, and in n_pose the angles in which it stands"
            )
        legs = [self._bones(at_rest, side, _LEG) for side in SIDES]
        self.scale = float(reach * (hips - ankles)[2]) / float(np.mean([leg[0, 2] - leg[2, 2] for leg in legs]))
        self._hips = hips
        shin = float(np.mean([np.linalg.norm(leg[1] - leg[2]) for leg in legs]))
        soles = self._middle_in_n([leg.sole for leg in limbs])[2]
        # Where the person's soles are level with the floor, the robot's are.
        self._lift = float(ankles[2] - soles + self.scale * sole_points(shin)[0, 2])
        self._wrists = {side: bone_tip(body, f"forearm_{side}") for side in mapping.arms}
        self._arm_scales = {side: reach * self._arm_scale(at_rest, side) for side in mapping.arms}

    def targets(self, world_T_segment: Array) -> dict[str, LinkTarget]:
        """Link -> its target for a person at poses (S, 4, 4)."""
        mapping, of = self._robot.mapping, dict(zip(self._body.segments, world_T_segment, strict=True))
        place = {side: self._scaled(self._bones(world_T_segment, side, _LEG)) for side in mapping.legs}
        pelvis_R = of["pelvis"][:3, :3]
        hips = np.mean([leg[0] for leg in place.values()], axis=0)
        root = rigid(pelvis_R, hips - pelvis_R @ self._hips)
        targets = {mapping.root: LinkTarget(self._turned(root, mapping.root), True, True)}
        for link, segment in ((mapping.trunk, "torso"), (mapping.head, "head")):
            if link is not None and segment in of:
                turned = rigid(of[segment][:3, :3] @ self._in_n[link][:3, :3], np.zeros(3))
                targets[link] = LinkTarget(turned, False, True)
        for side, leg in mapping.legs.items():
            outward = mapping.feet_apart * (1.0 if side == "left" else -1.0) * _level(pelvis_R[:, 1])
            targets[leg.knee] = LinkTarget(rigid(np.eye(3), place[side][1] + 0.5 * outward), True, False)
            foot_R = of[f"foot_{side}"][:3, :3] @ self._in_n[leg.ankle][:3, :3]
            targets[leg.ankle] = LinkTarget(rigid(foot_R, place[side][2] + outward), True, True, is_end=True)
        torso_R = of["torso"][:3, :3] if "torso" in of else pelvis_R
        for side, arm in mapping.arms.items():
            places = self._arm(of, side) * self._arm_scales[side] + self._shoulder(root, torso_R, arm.shoulder)
            targets[arm.elbow] = LinkTarget(rigid(np.eye(3), places[1]), True, False)
            wrist_R = of[f"forearm_{side}"][:3, :3] @ self._in_n[arm.wrist][:3, :3]
            targets[arm.wrist] = LinkTarget(rigid(wrist_R, places[2]), True, True, is_end=True)
        return targets

    def _middle_in_n(self, links: Collection[str]) -> Array:
        """(3,) mean of the places of some links in the N-pose [m]."""
        middle: Array = np.mean([self._in_n[link][:3, 3] for link in links], axis=0)
        return middle

    def _bones(self, poses: Array, side: Side, kinds: tuple[str, ...]) -> Array:
        """(N, 3) origins of a limb's segments [m]."""
        origins: Array = poses[[self._index[f"{kind}_{side}"] for kind in kinds], :3, 3]
        return origins

    def _scaled(self, points: Array) -> Array:
        """Points (N, 3) of the person, scaled to the robot [m]."""
        placed: Array = self.scale * points + [0.0, 0.0, self._lift]
        return placed

    def _arm(self, of: Mapping[str, Array], side: Side) -> Array:
        """(3, 3) shoulder, elbow and wrist of the person, from the shoulder on [m]."""
        shoulder, forearm = of[f"upper_arm_{side}"][:3, 3], of[f"forearm_{side}"]
        wrist = transform_points(forearm, self._wrists[side][None])[0]
        return np.array([shoulder, forearm[:3, 3], wrist]) - shoulder

    def _arm_scale(self, at_rest: Array, side: Side) -> float:
        """Length of the robot's arm over the person's."""
        of = dict(zip(self._body.segments, at_rest, strict=True))
        ours = _length(self._arm(of, side))
        robots = [self._in_n[link][:3, 3] for link in astuple(self._robot.mapping.arms[side])]
        return _length(np.array(robots)) / ours

    def _shoulder(self, root: Array, torso_R: Array, shoulder: str) -> Array:
        """Position (3,) of the robot's shoulder if its trunk rotates as the person's."""
        trunk = self._robot.mapping.trunk
        waist = self._in_n[trunk][:3, 3] if trunk is not None else np.zeros(3)
        place: Array = transform_points(root, waist[None])[0] + torso_R @ (self._in_n[shoulder][:3, 3] - waist)
        return place

    def _turned(self, pose: Array, link: str) -> Array:
        """A pose whose rotation is that of a segment, as that of a link."""
        return rigid(pose[:3, :3] @ self._in_n[link][:3, :3], pose[:3, 3])


def _level(direction: Array) -> Array:
    """A direction (3,) without what is up in it, of length 1."""
    level = direction * [1.0, 1.0, 0.0]
    return np.asarray(level / max(float(np.linalg.norm(level)), 1e-9), np.float64)


def _length(points: Array) -> float:
    """Length of a chain through points (N, 3)."""
    return float(np.linalg.norm(np.diff(points, axis=0), axis=1).sum())
