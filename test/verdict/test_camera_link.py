"""Links between cameras: exact on the true motion, and as far off as a camera is."""

import numpy as np
import pytest
from known_motion import BODY, segment_poses

from bodycam_ros.geometry import Array, exp_so3, rigid
from bodycam_ros.verdict.camera_link import LEVER_M, CameraLink, camera_links

TIMES = np.linspace(0.0, 3.0, 13)


def poses_of(camera: str) -> Array:
    mount = BODY.mounts[camera]
    row = BODY.segment_index[mount.segment]
    return np.stack([segment_poses(time)[row] @ mount.segment_T_camera for time in TIMES])


def link(first: str, second: str, *between: str) -> CameraLink:
    """The one between two cameras if these and some others are all that there are."""
    links = camera_links(BODY, BODY.mounts, [first, second, *between])
    return next(link for link in links if {link.first, link.second} == {first, second})


def test_every_link_of_the_true_motion_is_closed() -> None:
    links = camera_links(BODY, BODY.mounts, tuple(BODY.mounts))
    assert {(one.first, one.second) for one in links} >= {("waist_front", "waist_left"), ("torso_front", "head")}
    for one in links:
        assert one.is_exact
        assert one.gap(poses_of(one.first), poses_of(one.second)).max() < 1e-9


@pytest.mark.parametrize(
    ("first", "second", "joints"),
    [
        ("waist_left", "waist_right", []),
        ("thigh_left", "shin_left", ["knee_left"]),
        ("waist_front", "foot_left", ["hip_left", "knee_left", "ankle_left"]),
        ("forearm_left", "forearm_right", ["elbow_left", "shoulder_left", "shoulder_right", "elbow_right"]),
    ],
)
def test_the_way_goes_over_the_segments_without_a_camera(first: str, second: str, joints: list[str]) -> None:
    one = link(first, second)
    assert [joint.name for joint in one.way] == joints
    assert len(one.lengths) == max(0, len(joints) - 1)
    assert one.gap(poses_of(first), poses_of(second)).max() < 1e-9


def test_a_camera_between_two_others_parts_them() -> None:
    links = camera_links(BODY, BODY.mounts, ["thigh_left", "shin_left", "foot_left"])
    assert {(one.first, one.second) for one in links} == {("thigh_left", "shin_left"), ("shin_left", "foot_left")}


def test_the_gap_is_how_far_a_camera_is_off() -> None:
    elsewhere = rigid(np.eye(3), np.array([0.0, 0.3, 0.4])) @ poses_of("shin_left")
    np.testing.assert_allclose(link("thigh_left", "shin_left").gap(poses_of("thigh_left"), elsewhere), 0.5)


def test_a_turn_on_the_same_segment_counts_at_an_arms_length() -> None:
    about_itself = poses_of("waist_left") @ rigid(exp_so3(np.array([0.0, 0.0, 0.4])), np.zeros(3))
    gaps = link("waist_left", "waist_right").gap(about_itself, poses_of("waist_right"))
    assert gaps.min() >= 0.4 * LEVER_M - 1e-9


def test_over_a_segment_without_camera_only_the_distance_tells() -> None:
    one = link("waist_front", "shin_left")
    thigh = BODY.segment_index["thigh_left"]
    hip = np.stack([segment_poses(time)[thigh][:3, 3] for time in TIMES])
    turn = rigid(exp_so3(np.array([0.0, 0.5, 0.0])), np.zeros(3))
    about_hip = rigid(np.eye(3), hip) @ turn @ rigid(np.eye(3), -hip) @ poses_of("shin_left")
    assert one.gap(poses_of("waist_front"), about_hip).max() < 1e-9
    farther = poses_of("shin_left")
    away = one.place("shin_left", farther) - hip
    farther[:, :3, 3] += 0.2 * away / np.linalg.norm(away, axis=1, keepdims=True)
    np.testing.assert_allclose(one.gap(poses_of("waist_front"), farther), 0.2, atol=1e-9)


def test_what_is_unknown_has_no_gap() -> None:
    unknown = np.full((len(TIMES), 4, 4), np.nan)
    for pair in (("waist_left", "waist_right"), ("thigh_left", "shin_left"), ("waist_front", "foot_left")):
        assert np.isnan(link(*pair).gap(poses_of(pair[0]), unknown)).all()
