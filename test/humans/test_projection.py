"""REP-155's humans: what their joints can say comes back, what they cannot is told."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.body.joint import Joint
from bodycam_ros.body.joint_angles import JointAngles
from bodycam_ros.errors import BodyError, SettingsError
from bodycam_ros.geometry import Array, rigid
from bodycam_ros.humans.axis_angles import composed, nearest_angles
from bodycam_ros.humans.bent_limb import hinge_towards, turned_to_bend
from bodycam_ros.humans.human_urdf import human_urdf
from bodycam_ros.humans.kinematic_model import CHAINS
from bodycam_ros.humans.projection import HumanSkeleton

PLACES = {
    "torso": ("pelvis", (0.0, 0.0, 0.1)),
    "head": ("torso", (0.0, 0.0, 0.5)),
    "upper_arm_left": ("torso", (0.0, 0.2, 0.4)),
    "forearm_left": ("upper_arm_left", (0.0, 0.0, -0.3)),
    "hand_left": ("forearm_left", (0.0, 0.0, -0.25)),
    "upper_arm_right": ("torso", (0.0, -0.2, 0.4)),
    "forearm_right": ("upper_arm_right", (0.0, 0.0, -0.3)),
    "thigh_left": ("pelvis", (0.0, 0.1, 0.0)),
    "shin_left": ("thigh_left", (0.0, 0.0, -0.4)),
    "foot_left": ("shin_left", (0.0, 0.0, -0.4)),
    "thigh_right": ("pelvis", (0.0, -0.1, 0.0)),
    "shin_right": ("thigh_right", (0.0, 0.0, -0.4)),
}
NAMES = {joint for chain in CHAINS for joint in chain.joints}


def person(*without: str) -> BodyModel:
    there = {segment: at for segment, at in PLACES.items() if segment not in without}
    joints = tuple(
        Joint(f"to_{segment}", parent, segment, "ball", rigid(np.eye(3), np.array(place)))
        for segment, (parent, place) in there.items()
    )
    return BodyModel("p", "pelvis", ("pelvis", *there), joints, {})


def poses_of(body: BodyModel, root: Array, **rotations: Rotation) -> Array:
    """world_T_segment (S, 4, 4) with some joints turned."""
    turns = np.array([rotations.get(joint.child, Rotation.identity()).as_matrix() for joint in body.tree_joints])
    return body.forward_kinematics(root, turns)


@pytest.fixture
def root() -> Array:
    return rigid(Rotation.from_rotvec([0.3, -0.2, 1.0]).as_matrix(), np.array([1.0, 2.0, 0.9]))


def test_names_and_order_are_those_of_the_rep() -> None:
    skeleton = HumanSkeleton(person())
    assert skeleton.joint_names[:8] == (
        "waist", "r_head", "y_head", "p_head", "l_y_shoulder", "l_p_shoulder", "l_r_shoulder", "l_elbow",
    )  # fmt: skip
    assert set(skeleton.joint_names) == NAMES and len(NAMES) == 20


@pytest.mark.parametrize("chain", [c for c in CHAINS if len(c.axes) == 3], ids=lambda c: c.link)
def test_three_axes_reach_every_rotation_and_never_jump(chain: object) -> None:
    axes, previous = np.array(chain.axes), np.zeros(3)  # type: ignore[attr-defined]
    ends = Rotation.random(6, random_state=4)
    for start, end in zip(ends[:-1], ends[1:], strict=True):
        step = (start.inv() * end).as_rotvec() / 200
        for number in range(200):
            wanted = (start * Rotation.from_rotvec(number * step)).as_matrix()
            angles = nearest_angles(wanted, axes, previous)
            assert np.abs(composed(axes, angles) - wanted).max() < 0.03  # exact but where the first angle is frozen
            if number:
                assert np.abs(angles - previous).max() < 1.0
            previous = angles


def test_an_arm_that_hangs_does_not_spin() -> None:
    axes = np.array(next(chain.axes for chain in CHAINS if chain.segment == "upper_arm_left"))
    noise = np.random.default_rng(3)
    angles = np.array([0.4, 0.0, -0.4])
    for _ in range(200):
        wanted = Rotation.from_rotvec(noise.normal(0.0, 0.003, 3)).as_matrix()
        angles = nearest_angles(wanted, axes, angles)
        assert angles[0] == pytest.approx(0.4)


def test_what_the_joints_can_say_comes_back(root: Array) -> None:
    body = person()
    skeleton = HumanSkeleton(body)
    y = [0.0, 1.0, 0.0]
    poses = poses_of(
        body, root,
        torso=Rotation.from_rotvec(0.4 * np.array(y)),
        head=Rotation.from_rotvec([0.1, 0.3, -0.5]),
        upper_arm_left=Rotation.from_rotvec([0.9, -0.2, 0.3]), forearm_left=Rotation.from_rotvec(-1.1 * np.array(y)),
        upper_arm_right=Rotation.from_rotvec([-0.8, -0.6, 0.0]), forearm_right=Rotation.from_rotvec(-0.7 * np.array(y)),
        thigh_left=Rotation.from_rotvec([0.2, -0.9, 0.1]), shin_left=Rotation.from_rotvec(1.3 * np.array(y)),
    )  # fmt: skip
    laid = skeleton.lay(poses)
    assert max(laid.off_rad.values()) < 1e-9 and max(laid.off_m.values()) < 1e-9
    angle = dict(zip(skeleton.joint_names, laid.angles, strict=True))
    assert angle["waist"] == pytest.approx(0.4)
    assert angle["l_elbow"] == pytest.approx(1.1) and angle["r_elbow"] == pytest.approx(0.7)
    assert angle["l_knee"] == pytest.approx(-1.3) and angle["r_knee"] == pytest.approx(0.0, abs=1e-9)
    np.testing.assert_allclose(laid.world_T_body, root, atol=1e-12)


def test_raised_arms_count_alike_on_both_sides(root: Array) -> None:
    body = person()
    up = {
        "upper_arm_left": Rotation.from_rotvec([1.2, 0.0, 0.0]),
        "upper_arm_right": Rotation.from_rotvec([-1.2, 0, 0]),
    }
    skeleton = HumanSkeleton(body)
    angle = dict(zip(skeleton.joint_names, skeleton.lay(poses_of(body, root, **up)).angles, strict=True))
    assert angle["l_p_shoulder"] == pytest.approx(1.2) and angle["r_p_shoulder"] == pytest.approx(1.2)


def test_what_they_cannot_say_is_told(root: Array) -> None:
    """A waist that turns about the long axis: shoulders follow on their circle, arms keep their direction."""
    body = person()
    laid = HumanSkeleton(body).lay(poses_of(body, root, torso=Rotation.from_rotvec([0.0, 0.0, 0.5])))
    assert laid.off_rad["waist"] == pytest.approx(0.5)
    assert laid.off_m["l_shoulder"] == pytest.approx(2 * 0.2 * np.sin(0.25))
    assert laid.off_rad["l_shoulder"] < 1e-9 and laid.off_m["l_hip"] < 1e-9


def test_a_wrist_is_where_it_is_however_the_forearm_is_turned(root: Array) -> None:
    """Our upper arm says that the elbow bends sideways; the human's turns until its hinge does it."""
    body = person()
    bent = {"forearm_left": Rotation.from_rotvec([1.0, 0.0, 0.0]) * Rotation.from_rotvec([0.0, 0.0, 0.7])}
    skeleton = HumanSkeleton(body)
    laid = skeleton.lay(poses_of(body, root, **bent))
    assert laid.off_m["l_wrist"] < 1e-9 and laid.off_m["l_elbow"] < 1e-9
    assert laid.off_rad["l_shoulder"] > 1.0
    assert dict(zip(skeleton.joint_names, laid.angles, strict=True))["l_elbow"] == pytest.approx(1.0)


def test_a_straight_limb_does_not_turn_the_bone_above_it() -> None:
    down, axis = np.array([0.0, 0.0, -1.0]), np.array([0.0, -1.0, 0.0])
    sideways = np.array([0.0, np.sin(0.05), -np.cos(0.05)])
    np.testing.assert_array_equal(turned_to_bend(np.eye(3), down, axis, 1.0, sideways), np.eye(3))
    assert hinge_towards(np.eye(3), axis, down, sideways) == pytest.approx(0.0, abs=1e-12)


def test_wrists_and_ankles_without_hands_and_feet_are_where_people_have_them(root: Array) -> None:
    body = person("hand_left", "foot_left")
    skeleton = HumanSkeleton(body)
    assert skeleton.origins["l_wrist"] == pytest.approx([0.0, 0.0, -0.3 * 0.957], abs=1e-3)
    assert 0.35 < -skeleton.origins["l_ankle"][2] < 0.5
    assert "l_wrist" not in skeleton.lay(poses_of(body, root)).off_m


def test_a_body_without_a_segment_has_a_human_without_its_joints(root: Array) -> None:
    body = person("upper_arm_left", "forearm_left", "hand_left", "head")
    skeleton = HumanSkeleton(body)
    assert NAMES - set(skeleton.joint_names) == {
        "l_y_shoulder", "l_p_shoulder", "l_r_shoulder", "l_elbow", "r_head", "y_head", "p_head",
    }  # fmt: skip
    assert max(skeleton.lay(poses_of(body, root)).off_m.values()) < 1e-9
    with pytest.raises(BodyError, match="none of the segments that REP-155 knows: torso, head"):
        HumanSkeleton(BodyModel("cart", "pelvis", ("pelvis",), (), {}))


def test_the_urdf_moves_as_was_laid(root: Array) -> None:
    """By yourdfpy, which is not ours: every link is where the projection says that the segment nearly is."""
    yourdfpy = pytest.importorskip("yourdfpy")
    import io

    body = person()
    skeleton = HumanSkeleton(body)
    robot = yourdfpy.URDF.load(io.BytesIO(human_urdf(skeleton, "b3bd5").encode()), load_meshes=False)
    assert robot.actuated_joint_names == [f"{name}_b3bd5" for name in skeleton.joint_names]
    assert robot.base_link == "body_b3bd5"
    noise = np.random.default_rng(1)
    angles = JointAngles(body)
    poses = body.forward_kinematics(root, angles.poses(noise.normal(0.0, 0.4, len(angles.names))))
    laid = skeleton.lay(poses)
    robot.update_cfg(laid.angles)
    for chain in skeleton.chains:
        if chain.link not in laid.off_m:
            continue
        world_T_link = laid.world_T_body @ robot.get_transform(f"{chain.link}_b3bd5", "body_b3bd5")
        segment = poses[body.segment_index[chain.segment]]
        assert np.linalg.norm(world_T_link[:3, 3] - segment[:3, 3]) == pytest.approx(laid.off_m[chain.link], abs=1e-6)
    assert {"torso_b3bd5", "head_b3bd5", "l_wrist_b3bd5", "r_ankle_b3bd5"} <= set(robot.link_map)


@pytest.mark.parametrize("body_id", ["", "a b", "../x", "é", "23bd5", "a__b"])
def test_ids_that_make_no_names_are_refused(body_id: str) -> None:
    with pytest.raises(SettingsError, match="such as b3bd5"):
        human_urdf(HumanSkeleton(person()), body_id)
