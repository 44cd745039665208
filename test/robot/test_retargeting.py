"""Talos does what the sample's person does; what it does is judged by readers that we did not write."""

from pathlib import Path

import numpy as np
import pytest
import yourdfpy
from helpers.naming import naming
from helpers.recorded_progress import Unshown
from helpers.talos import MAPPING, talos_urdf
from msgspec.structs import replace

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.errors import BodyError
from bodycam_ros.geometry import Array, exp_so3, rigid
from bodycam_ros.kinematics.joint_angles import JointAngles
from bodycam_ros.results.solved_body import SolvedBody, read_solved_body
from bodycam_ros.robot.mapping import Leg, read_mapping
from bodycam_ros.robot.retargeting import REACH, Retargeting, RobotState
from bodycam_ros.robot.robot_model import FLOATING, Robot
from bodycam_ros.robot.scaled_person import ScaledPerson

FEET = ("leg_left_6_link", "leg_right_6_link")
HANDS = ("arm_left_7_link", "arm_right_7_link")


@pytest.fixture(scope="module")
def robot() -> Robot:
    return Robot(talos_urdf(), read_mapping(MAPPING))


@pytest.fixture(scope="module")
def solved(sample_out: Path) -> SolvedBody:
    return read_solved_body(sample_out, Unshown())


@pytest.fixture(scope="module")
def poses(solved: SolvedBody) -> Array:
    """(T, S, 4, 4) of the sample's person."""
    joint_poses = JointAngles(solved.body).poses(solved.joint_angles)
    return solved.body.forward_kinematics(solved.world_T_root, joint_poses)


@pytest.fixture(scope="module")
def states(robot: Robot, solved: SolvedBody, poses: Array) -> list[RobotState]:
    following = Retargeting(solved.body, robot)
    return [following.follow(*each) for each in zip(solved.stamps_ns.tolist(), poses, strict=True)]


def at_rest(body: BodyModel) -> Array:
    return body.forward_kinematics(np.eye(4), np.tile(np.eye(3), (len(body.tree_joints), 1, 1)))


def test_hands_and_feet_follow_as_an_independent_reader_has_them(
    robot: Robot, solved: SolvedBody, poses: Array, states: list[RobotState]
) -> None:
    scaled = ScaledPerson(solved.body, robot, REACH)
    reader = yourdfpy.URDF.load(str(talos_urdf()), load_meshes=False, build_scene_graph=True)
    off: list[list[float]] = []
    for pose, state in list(zip(poses, states, strict=True))[::5]:
        reader.update_cfg(dict(zip(robot.joint_names, state.positions, strict=True)))
        targets = scaled.targets(pose)
        places = {link: (state.world_T_root @ reader.get_transform(link, "base_link"))[:3, 3] for link in FEET + HANDS}
        off.append([float(np.linalg.norm(places[link] - targets[link].world_T_link[:3, 3])) for link in places])
        assert [state.errors_m[link] for link in places] == pytest.approx(off[-1], abs=1e-6)
    assert np.mean(off) < 0.01 and np.max(off) < 0.03
    walked = [np.linalg.norm(each[-1].world_T_root[:3, 3] - each[0].world_T_root[:3, 3]) for each in (states,)]
    person = np.linalg.norm(poses[-1, 0, :3, 3] - poses[0, 0, :3, 3])
    assert walked[0] == pytest.approx(scaled.scale * person, abs=0.05)


def test_limits_of_angles_and_speeds_are_kept(robot: Robot, states: list[RobotState]) -> None:
    positions, speeds = (np.array([getattr(state, name) for state in states]) for name in ("positions", "velocities"))
    assert (positions >= robot.lowest).all() and (positions <= robot.highest).all()
    assert (np.abs(speeds[1:]) <= robot.fastest * (1.0 + 1e-6)).all()
    assert np.ptp(positions, axis=0).max() > 0.3  # it moves
    assert not any(state.blocked for state in states)


def test_its_own_links_stay_apart(robot: Robot, states: list[RobotState]) -> None:
    """By pinocchio's own test of the hulls, pair by pair."""
    import pinocchio as pin

    data, hulls = robot.model.createData(), robot.hulls.copy()
    hulls.removeAllCollisionPairs()
    for pair in robot.pairs.tolist():
        hulls.addCollisionPair(pin.CollisionPair(*pair))
    at = pin.GeometryData(hulls)
    for state in states[::10]:
        q = np.concatenate([pin.SE3ToXYZQUAT(pin.SE3(state.world_T_root)), state.positions])
        assert not pin.computeCollisions(robot.model, data, hulls, at, q, True)
    assert min(state.nearest_m for state in states) > 0.002


def test_legs_that_would_cross_are_kept_apart(robot: Robot, solved: SolvedBody, poses: Array) -> None:
    """With feet as near as the person's, which are narrower."""
    narrow = Robot(talos_urdf(), replace(robot.mapping, feet_apart=0.0))
    together = poses[:1].repeat(12, axis=0)
    left, right = (solved.body.segment_index[f"foot_{side}"] for side in ("left", "right"))
    across = together[0, right, :3, 3] - together[0, left, :3, 3]
    for row, share in zip(together, np.linspace(0.0, 0.5, len(together)), strict=True):
        row[left, :3, 3] += share * across
        row[right, :3, 3] -= share * across
    following = Retargeting(solved.body, narrow)
    states = [following.follow(33_333_333 * k, pose) for k, pose in enumerate(together)]
    assert min(state.nearest_m for state in states) > 0.0
    assert max(states[-1].errors_m[foot] for foot in FEET) > 0.02  # where it cannot be, it is not


def test_who_stands_in_the_n_pose_lets_the_robot_stand_so(robot: Robot, solved: SolvedBody) -> None:
    state = Retargeting(solved.body, robot).follow(0, at_rest(solved.body))
    joints = dict(zip(robot.joint_names, state.positions - robot.n_pose[FLOATING:], strict=True))
    turned = {name: angle for name, angle in joints.items() if abs(angle) > 0.5}
    # Limbs that reach less than their lengths bend a little; all else is as it stands.
    assert set(turned) <= {"leg_left_4_joint", "leg_right_4_joint", "arm_left_4_joint", "arm_right_4_joint"}
    assert max(state.errors_m.values()) < 0.01


def test_what_a_robot_lacks_is_named(robot: Robot, tmp_path: Path) -> None:
    with naming(BodyError, "talos.yaml", "talos_reduced.urdf", "link tail"):
        Robot(talos_urdf(), replace(robot.mapping, head="tail"))
    with naming(BodyError, "n_pose", "talos_reduced.urdf", "joint wing"):
        Robot(talos_urdf(), replace(robot.mapping, n_pose={"wing": 0.1}))
    with naming(BodyError, "n_pose", "talos_reduced.urdf", "joint root_joint"):
        Robot(talos_urdf(), replace(robot.mapping, n_pose={"root_joint": 0.1}))
    with naming(BodyError, "n_pose", "leg_left_4_joint", "0 to 2.618", -0.5):
        Robot(talos_urdf(), replace(robot.mapping, n_pose={"leg_left_4_joint": -0.5}))
    (tmp_path / "robot.urdf").write_text("<robot name='r'><link name='a'/>")
    with naming(BodyError, tmp_path / "robot.urdf"):
        Robot(tmp_path / "robot.urdf", robot.mapping)
    meshless = tmp_path / "meshless.urdf"
    meshless.write_text(
        "<robot name='r'><link name='a'><collision><geometry><mesh filename='package://nowhere/a.stl'/></geometry>"
        "</collision></link></robot>"
    )
    with naming(BodyError, meshless, "nowhere"):
        Robot(meshless, robot.mapping)


def test_a_flat_mesh_is_refused(robot: Robot, tmp_path: Path) -> None:
    """A hull of it would crash the process."""
    (tmp_path / "flat.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nv 1 1 0\nf 1 2 3\nf 2 4 3\n")
    mesh = f"<collision><geometry><mesh filename='{tmp_path / 'flat.obj'}'/></geometry></collision>"
    text, link = talos_urdf().read_text(), '<link name="base_link">'
    assert link in text
    (tmp_path / "flat.urdf").write_text(text.replace(link, link + mesh).replace("package://", f"{_share()}/"))
    with naming(BodyError, "flat.urdf", "base_link_0"):
        Robot(tmp_path / "flat.urdf", robot.mapping)


def _share() -> Path:
    """Where the packages of Talos's meshes are."""
    return next(folder for folder in talos_urdf().parents if folder.name == "share")


def test_a_robot_that_stands_on_its_head_is_refused(robot: Robot, solved: SolvedBody) -> None:
    upside_down = {side: Leg(leg.sole, leg.ankle, leg.knee, leg.hip) for side, leg in robot.mapping.legs.items()}
    with naming(BodyError, "talos.yaml", "ankles", "hips"):
        Retargeting(solved.body, Robot(talos_urdf(), replace(robot.mapping, legs=upside_down)))


def test_what_all_links_hang_on_is_placed_even_if_another_follows_the_pelvis(
    robot: Robot, solved: SolvedBody, poses: Array, tmp_path: Path
) -> None:
    """Many robots have a footprint above their base; who publishes a tree of transforms begins with it."""
    hung = (
        '<link name="footprint"/><joint name="above" type="fixed"><parent link="footprint"/><child link="base_link"/>'
        '<origin xyz="0.1 0 1.0" rpy="0 0 0.5"/></joint></robot>'
    )
    path = tmp_path / "hung.urdf"
    path.write_text(talos_urdf().read_text().replace("</robot>", hung).replace("package://", f"{_share()}/"))
    other = Robot(path, robot.mapping)
    assert (robot.tree_root, other.tree_root) == ("base_link", "footprint")
    base, under = (Retargeting(solved.body, of).follow(0, poses[0]).world_T_root for of in (robot, other))
    footprint_T_base = rigid(exp_so3(np.array([0.0, 0.0, 0.5])), np.array([0.1, 0.0, 1.0]))
    np.testing.assert_allclose(under @ footprint_T_base, base, atol=1e-6)


def test_a_person_without_an_arm_is_refused(robot: Robot, solved: SolvedBody) -> None:
    kept = tuple(segment for segment in solved.body.segments if segment != "forearm_left")
    joints = tuple(joint for joint in solved.body.joints if joint.child != "forearm_left")
    mounts = {camera: mount for camera, mount in solved.body.mounts.items() if mount.segment != "forearm_left"}
    body = BodyModel("r", solved.body.root, kept, joints, mounts)
    with naming(BodyError, "forearm_left"):
        Retargeting(body, robot)
