"""A body placed by hand: segments that are moved reach where they are moved to, within limits; all else stays."""

from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose
from static_cameras.dressed_body import MIDDLE, looking_at, small_motion, static_cameras_around
from static_cameras.painted_bag import dressed_body

from bodycam_ros.body.average_person import with_hands
from bodycam_ros.body.body_file import read_body
from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.body.surface import BodySurface
from bodycam_ros.geometry import Array, exp_se3, exp_so3, log_so3, rigid
from bodycam_ros.kinematics.joint_angles import JointLimits
from bodycam_ros.static_cameras.limb_search import with_usual_limits
from bodycam_ros.static_cameras.placement import Placement, standing_in_view
from bodycam_ros.static_cameras.region_settings import RegionSettings
from bodycam_ros.static_cameras.region_tracker import RegionTracker
from bodycam_ros.static_cameras.start_file import read_start, write_start
from bodycam_ros.static_cameras.static_camera import StaticCamera

REACHED_M = 0.002
STANDS = exp_se3(np.array([0.0, 0.0, 0.7, 1.0, -2.0, 0.9]))


@pytest.fixture(scope="module")
def body(sample: Path) -> BodyModel:
    return with_usual_limits(with_hands(read_body(sample / "body.yaml")))


@pytest.fixture
def standing(body: BodyModel) -> Placement:
    return Placement(body, body.n_pose(STANDS))


def shifted(placement: Placement, segment: str, shift: tuple[float, float, float]) -> Array:
    """Where a segment would be so far along the pelvis' axes."""
    pose = placement.pose_of(segment).copy()
    pose[:3, 3] += STANDS[:3, :3] @ shift
    return pose


def assert_sound(placement: Placement) -> None:
    """Joints are closed, and no angle is beyond its limits."""
    body, poses = placement.body, placement.poses
    closed = body.forward_kinematics(poses[body.segment_index[body.root]], body.joint_rotations(poses))
    assert_allclose(poses, closed, rtol=0.0, atol=1e-9)
    limits = JointLimits(body)
    assert np.abs(limits.excess(limits.nearest_angles(body.joint_poses(poses)))).max() < 1e-6


def assert_only_moved(before: Placement, after: Placement, *segments: str) -> None:
    others = ~before.body.named(segments)
    assert_allclose(after.poses[others], before.poses[others], rtol=0.0, atol=1e-9)


def test_the_pelvis_moves_the_whole_body(standing: Placement) -> None:
    bent = standing.moved_to("foot_left", shifted(standing, "foot_left", (0.2, 0.0, 0.2)))
    move = exp_se3(np.array([0.1, -0.2, 0.4, 0.3, 0.2, -0.1]))
    assert_allclose(bent.moved_to("pelvis", move @ STANDS).poses, move @ bent.poses, rtol=0.0, atol=1e-12)


@pytest.mark.parametrize(
    ("segment", "shift", "moved"),
    [
        ("foot_left", (0.25, -0.1, 0.12), ("thigh_left", "shin_left", "foot_left")),
        ("foot_right", (-0.2, 0.05, 0.3), ("thigh_right", "shin_right", "foot_right")),
        ("hand_left", (0.25, 0.1, 0.25), ("upper_arm_left", "forearm_left", "hand_left")),
        ("forearm_right", (-0.1, -0.1, 0.0413), ("upper_arm_right", "forearm_right", "hand_right")),
    ],
)
def test_the_end_of_a_limb_reaches_its_place_and_keeps_its_direction(
    standing: Placement, segment: str, shift: tuple[float, float, float], moved: tuple[str, ...]
) -> None:
    target = shifted(standing, segment, shift)
    placed = standing.moved_to(segment, target)
    if segment == "forearm_right":  # an elbow moves on a sphere: nearest to the place
        parent = standing.pose_of("upper_arm_right")[:3, 3]
        length = np.linalg.norm(standing.pose_of(segment)[:3, 3] - parent)
        target[:3, 3] = parent + length * (target[:3, 3] - parent) / np.linalg.norm(target[:3, 3] - parent)
    assert_allclose(placed.pose_of(segment)[:3, 3], target[:3, 3], rtol=0.0, atol=REACHED_M)
    assert_sound(placed)
    assert_only_moved(standing, placed, *moved)
    if segment == "foot_left":
        assert_allclose(placed.pose_of(segment)[:3, :3], target[:3, :3], rtol=0.0, atol=1e-9)


def test_a_straight_leg_whose_foot_is_lifted_bends_its_knee_forwards(standing: Placement) -> None:
    placed = standing.moved_to("foot_left", shifted(standing, "foot_left", (0.0, 0.0, 0.25)))
    knee = STANDS[:3, :3].T @ (placed.pose_of("shin_left")[:3, 3] - placed.pose_of("thigh_left")[:3, 3])
    assert knee[0] > 0.15


@pytest.mark.parametrize(
    ("hand", "elbow", "shift"),
    [("hand_left", "forearm_left", (0.2, 0.1, 0.3)), ("foot_right", "shin_right", (0.2, 0.0, 0.2))],
)
def test_an_elbow_or_knee_swings_around_while_the_end_of_the_limb_stays(
    standing: Placement, hand: str, elbow: str, shift: tuple[float, float, float]
) -> None:
    bent = standing.moved_to(hand, shifted(standing, hand, shift))
    upper = bent.body.tree_joints[bent._limb(hand)[0]].child
    shoulder, wrist = bent.pose_of(upper)[:3, 3], bent.pose_of(hand)[:3, 3]
    axis = (wrist - shoulder) / np.linalg.norm(wrist - shoulder)
    target = bent.pose_of(elbow).copy()
    target[:3, 3] = shoulder + exp_so3(0.3 * axis) @ (target[:3, 3] - shoulder)
    swung = bent.moved_to(elbow, target)
    assert np.linalg.norm(target[:3, 3] - bent.pose_of(elbow)[:3, 3]) > 0.02
    assert_allclose(swung.pose_of(elbow)[:3, 3], target[:3, 3], rtol=0.0, atol=REACHED_M)
    assert_allclose(swung.pose_of(hand)[:3, 3], wrist, rtol=0.0, atol=0.01)
    assert_sound(swung)


def test_a_place_out_of_reach_is_approached(standing: Placement) -> None:
    hip = standing.pose_of("thigh_left")[:3, 3]
    reach = np.linalg.norm(standing.pose_of("foot_left")[:3, 3] - hip)
    target = shifted(standing, "foot_left", (1.0, 0.0, 0.0))
    placed = standing.moved_to("foot_left", target)
    along = (target[:3, 3] - hip) / np.linalg.norm(target[:3, 3] - hip)
    assert_allclose(placed.pose_of("foot_left")[:3, 3], hip + reach * along, rtol=0.0, atol=0.01)
    assert_sound(placed)


def test_a_segment_turns_about_its_joint_and_no_further_than_its_limits(standing: Placement) -> None:
    shin = standing.pose_of("shin_left")
    bent = standing.moved_to("shin_left", shin @ rigid(exp_so3(np.array([0.0, 0.9, 0.0])), np.zeros(3)))
    assert_allclose(bent.pose_of("shin_left")[:3, 3], shin[:3, 3], rtol=0.0, atol=1e-9)
    turn = log_so3(shin[:3, :3].T @ bent.pose_of("shin_left")[:3, :3])
    assert_allclose(turn, [0.0, 0.9, 0.0], rtol=0.0, atol=1e-6)
    overstretched = standing.moved_to("shin_left", shin @ rigid(exp_so3(np.array([0.0, -0.9, 0.0])), np.zeros(3)))
    assert -0.2 < log_so3(shin[:3, :3].T @ overstretched.pose_of("shin_left")[:3, :3])[1] < 0.0
    assert_sound(overstretched)


def test_hips_and_the_waist_only_turn_and_the_head_leans_the_torso(standing: Placement) -> None:
    cannot = {segment for segment in standing.body.segments if not standing.can_move(segment)}
    assert cannot == {"torso", "thigh_left", "thigh_right"}
    hip = standing.moved_to("thigh_left", shifted(standing, "thigh_left", (0.1, 0.0, 0.0)))
    assert_allclose(hip.poses, standing.poses, rtol=0.0, atol=1e-9)
    leant = standing.moved_to("head", shifted(standing, "head", (0.1, 0.05, -0.01)))
    assert_allclose(
        leant.pose_of("head")[:3, 3], shifted(standing, "head", (0.1, 0.05, -0.01))[:3, 3], rtol=0.0, atol=0.01
    )
    assert_only_moved(
        standing, leant, *(s for s in standing.body.segments if "arm" in s or "hand" in s), "torso", "head"
    )


def test_the_body_stands_upright_where_the_cameras_look(body: BodyModel) -> None:
    stations = [*static_cameras_around(3).values()]
    root = standing_in_view(body, stations)[body.segment_index[body.root]]
    assert_allclose(root[:3, 3], MIDDLE, rtol=0.0, atol=0.02)
    assert_allclose(root[:3, 2], [0.0, 0.0, 1.0], rtol=0.0, atol=1e-12)
    to_camera = stations[0].world_T_camera[:2, 3] - root[:2, 3]
    assert_allclose(root[:2, 0], to_camera / np.linalg.norm(to_camera), rtol=0.0, atol=1e-9)


def test_one_camera_has_the_body_before_it(body: BodyModel) -> None:
    place = np.array([4.0, 1.0, 1.5])
    station = StaticCamera("alone", looking_at(place, MIDDLE), static_cameras_around(1)["ext_00"].camera)
    root = standing_in_view(body, [station])[body.segment_index[body.root], :3, 3]
    assert_allclose(root, place + 3.0 * station.world_T_camera[:3, 2], rtol=0.0, atol=1e-9)


def test_what_is_written_is_the_start_that_is_read(standing: Placement, tmp_path: Path) -> None:
    placed = standing.moved_to("hand_left", shifted(standing, "hand_left", (0.1, 0.1, 0.3)))
    poses = dict(zip(placed.body.segments, placed.poses, strict=True))
    write_start(tmp_path / "start.yaml", poses)
    read = read_start(tmp_path / "start.yaml", placed.body)
    assert read.keys() == poses.keys()
    for segment, pose in read.items():
        assert_allclose(pose, poses[segment], rtol=0.0, atol=3e-5)


def test_a_fit_moves_a_placed_body_onto_its_images_and_support_names_the_limb_that_is_off(sample: Path) -> None:
    dressed = dressed_body(sample)
    body, true = dressed.body, small_motion(dressed.body, 1)[0]
    images = dressed.images(true, 1.0, 0)
    tracker = RegionTracker(body, BodySurface.of(body, dressed.surfaces), dressed.stations, RegionSettings())
    placed = Placement(tracker.body, tracker.initialise(images, true))
    good = tracker.support(images, placed.poses)
    off = placed.moved_to("forearm_left", placed.pose_of("forearm_left") @ rigid(np.eye(3), np.array([0.15, 0.1, 0.1])))
    support = tracker.support(images, off.poses)
    arm = body.named(["upper_arm_left", "forearm_left"])
    assert good.min() > 0.6 and support[arm].max() < 0.45
    away = placed.moved_to("pelvis", exp_se3(np.array([0.0, 0.0, 0.03, 0.03, 0.02, 0.0])) @ placed.pose_of("pelvis"))
    fitted = tracker.initialise(images, away.poses)
    errors = [np.linalg.norm(poses[:, :3, 3] - true[:, :3, 3], axis=1).mean() for poses in (away.poses, fitted)]
    assert errors[0] > 0.03 and errors[1] < 0.01
