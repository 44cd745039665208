"""Every supplied file can be used by a person of ordinary size, and says what to change."""

from functools import cache
from itertools import product

import numpy as np
import pytest
from helpers.closed_joint import closed_pose, joint_information
from helpers.known_motion import BODY, START_NS
from helpers.registered_pose import registered_pose
from scipy.optimize import least_squares

from bodycam_ros.body.coupled_body import coupled_body
from bodycam_ros.body.equipment import Equipment
from bodycam_ros.body.equipment_yaml import read_equipment
from bodycam_ros.body_state import BodyOutput
from bodycam_ros.camera import camera_from_info
from bodycam_ros.geometry import Array, exp_se3, inverse, log_se3, transform_points
from bodycam_ros.pipeline.settings import PipelineSettings
from bodycam_ros.pipeline.skeleton import SkeletonPipeline

FRAME_NS = 33_333_333
LENS = camera_from_info("any", 640, 480, "equidistant", [0.0] * 4, [240.0, 0, 319.5, 0, 240.0, 239.5, 0, 0, 1])
NAMES = ("barbell", "bicycle", "bicycle_rolling", "crutch", "rowing", "snowboard", "wheelchair")
ORDINARY = 1.5
"""[rad], [m] how far a joint may well be from the N-pose, and a machine from the pelvis."""

BENDS = {"knee": (0.0, 2.6), "elbow": (-2.6, 0.0)}
"""[rad] about y: the sides to which people's joints bend."""

BENT_WRONG = 0.15
"""[rad] by how much they may do otherwise."""

SITTING_LEAN_RAD = 0.35
"""Lean of a pelvis back on a seat, or forward on a saddle."""


@pytest.mark.parametrize("name", NAMES)
def test_it_is_named_as_its_file_and_couples_with_a_body(name: str) -> None:
    equipment = read_equipment(name)
    assert equipment.name == name
    coupled = coupled_body(BODY, equipment)
    assert len(coupled.segments) == len(BODY.segments) + len(equipment.segments)
    assert {each.name for each in equipment.attachments} <= {joint.name for joint in coupled.loop_joints}


@pytest.mark.parametrize("name", NAMES)
def test_a_person_can_hold_all_of_it_at_once(name: str) -> None:
    """Some pose that is not far from ordinary brings all points together, as near as weights and unknowns allow."""
    holding, poses = held(name)
    for attachment, gaps in holding.gaps(poses).items():
        assert np.sqrt(np.mean(gaps**2)) < 0.7, (attachment, gaps)


@pytest.mark.parametrize("name", NAMES)
def test_the_solver_finds_it_in_the_hands_of_that_person(name: str) -> None:
    """All of it is seen to be held, and nobody is bent for it."""
    _, poses = held(name)
    last = solved(read_equipment(name), poses)[-1].state
    assert last.equipment is not None and last.equipment.placed
    assert last.equipment.engaged.all(), dict(zip(last.equipment.attachments, last.equipment.deviations, strict=True))
    assert bent_m(last.world_T_segment, poses) < 0.01


def test_a_rowers_seat_is_on_its_rail_wherever_it_slides() -> None:
    _, poses = held("rowing")
    rowing = read_equipment("rowing")
    index = coupled_body(BODY, rowing).segment_index
    for output in solved(rowing, poses):
        rail_T_seat = inverse(output.state.world_T_segment[index["rail"]]) @ output.state.world_T_segment[index["seat"]]
        np.testing.assert_allclose(rail_T_seat[1:3, 3], 0.0, atol=2e-3)
        np.testing.assert_allclose(rail_T_seat[:3, :3], np.eye(3), atol=0.01)


def solved(equipment: Equipment, poses: Array, frames: int = 12) -> list[BodyOutput]:
    """What the solver makes of a person who keeps still in a pose (S, 4, 4)."""
    pipeline = SkeletonPipeline(BODY, dict.fromkeys(BODY.mounts, LENS), PipelineSettings(), equipment=equipment)
    outputs = []
    for frame, (camera, mount) in product(range(frames), BODY.mounts.items()):
        outputs += pipeline.add(
            registered_pose(
                camera,
                START_NS + frame * FRAME_NS,
                START_NS + (frame - 1) * FRAME_NS if frame else 0,
                poses[BODY.segment_index[mount.segment]] @ mount.segment_T_camera,
            )
        )
    return outputs + pipeline.flush()


def bent_m(world_T_segment: Array, poses: Array) -> float:
    """The greatest error of the person's segments [m]."""
    of_person = slice(0, len(BODY.segments))
    return float(np.linalg.norm((world_T_segment - poses)[of_person, :3, 3], axis=1).max())


@cache
def held(name: str) -> "tuple[Holding, Array]":
    """A person with a piece of equipment, and poses (S, 4, 4) in which all of it is held."""
    holding = Holding(read_equipment(name))
    return holding, holding.poses(least_squares(holding.residuals, holding.crouched(), max_nfev=60).x)


class Holding:
    """Poses of a person with equipment; what is unknown counts as play."""

    def __init__(self, equipment: Equipment) -> None:
        self.equipment = equipment
        self.coupled = coupled_body(BODY, equipment)
        held = {each.name for each in equipment.attachments}
        self.own_loops = [joint for joint in self.coupled.loop_joints if joint.name not in held]

    def poses(self, x: Array) -> Array:
        """(S, 4, 4) of a tangent for each joint of the tree, of which its type takes what it permits."""
        motion = exp_se3(x.reshape(-1, 6))
        for pose, joint in zip(motion, self.coupled.tree_joints, strict=True):
            pose[:3, :3] = joint.permitted_rotation(pose[:3, :3])
            if joint.type != "free":
                pose[:3, 3] = 0.0
        return self.coupled.forward_kinematics(np.eye(4), motion)

    def gaps(self, poses: Array) -> dict[str, Array]:
        """Attachment -> (N, 3) what is between the points of its pairs, in the equipment's axes and in sigmas."""
        index, gaps = self.coupled.segment_index, {}
        for each in self.equipment.attachments:
            equipment_T_body = inverse(poses[index[each.equipment_segment]]) @ poses[index[each.body_segment]]
            play = np.sqrt(each.sigmas[:, None] ** 2 + each.unknown**2)
            gaps[each.name] = (transform_points(equipment_T_body, each.on_body) - each.on_equipment) / play
        return gaps

    def residuals(self, x: Array) -> Array:
        poses, index = self.poses(x), self.coupled.segment_index
        parts = [gaps.ravel() for gaps in self.gaps(poses).values()]
        for joint in self.own_loops:
            parent_T_child = inverse(poses[index[joint.parent]]) @ poses[index[joint.child]]
            off = log_se3(inverse(closed_pose(joint, parent_T_child)) @ parent_T_child)
            parts.append(np.linalg.cholesky(joint_information(joint)).T @ off)
        for turn, joint in zip(x.reshape(-1, 6)[:, :3], self.coupled.tree_joints, strict=True):
            if bends := BENDS.get(joint.name.partition("_")[0]):
                beyond = turn[1] - np.clip(turn[1], *bends)
                parts.append(np.array([turn[0], beyond, turn[2]]) / BENT_WRONG)
        if np.isfinite(self.equipment.upright_sigma):
            leans = poses[index[self.equipment.root]][:2, 2]
            parts.append(leans / max(self.equipment.upright_sigma, SITTING_LEAN_RAD))
        return np.concatenate([*parts, x / ORDINARY])

    def crouched(self) -> Array:
        """Tangents of joints from which knees and elbows bend to the right side."""
        x = np.zeros((len(self.coupled.tree_joints), 6))
        for row, joint in enumerate(self.coupled.tree_joints):
            x[row, 1] = {"hip": -1.0, "knee": 1.2, "elbow": -0.6}.get(joint.name.partition("_")[0], 0.0)
        return x.ravel()
