"""Lines of a body, and from where they are seen."""

import numpy as np
import pytest
from known_walk import Walk

from bodycam_ros.drawing.stick_figure import ObliqueView, body_bones, bones
from bodycam_ros.geometry import exp_so3, rigid


@pytest.mark.parametrize("heading_deg", [0.0, 75.0, 180.0, -120.0])
def test_who_walks_goes_to_the_right_and_shows_the_right_side(heading_deg: float) -> None:
    forward = np.array([np.cos(np.radians(heading_deg)), np.sin(np.radians(heading_deg)), 0.0])
    path = rigid(np.eye(3), np.linspace(0.0, 4.0, 30)[:, None] * forward)
    view = ObliqueView.of_path(path)
    across = view.project(path[:, :3, 3])[:, 0]
    assert (np.diff(across) > 0.0).all()
    right_hand = np.cross(forward, [0.0, 0.0, 1.0])
    assert view.depth(right_hand) < view.depth(-right_hand)
    assert view.project(np.array([0.0, 0.0, 1.0]))[1] > 0.9
    # They come a little nearer, so that the face is seen rather than the back.
    assert view.depth(path[-1, :3, 3]) < view.depth(path[0, :3, 3])


def test_who_stands_is_seen_from_the_front() -> None:
    facing = exp_so3(np.array([0.0, 0.0, 1.0]))
    view = ObliqueView.of_path(rigid(facing, np.zeros((10, 3))))
    nose = facing @ np.array([0.1, 0.0, 0.0])
    assert view.depth(nose) < view.depth(np.zeros(3))


def test_bones_join_each_segment_with_its_children_and_end_in_tips(walk: Walk) -> None:
    poses = dict(zip(walk.body.segments, np.moveaxis(walk.world_T_segment, 1, 0), strict=True))
    parents = {joint.child: joint.parent for joint in walk.body.tree_joints}
    lines = bones(poses, parents)
    assert sorted(line.segment for line in lines) == ["foot_left", "pelvis", "pelvis", "shin_left", "thigh_left"]
    thigh = next(line for line in lines if line.segment == "thigh_left")
    np.testing.assert_allclose(np.linalg.norm(thigh.end - thigh.start, axis=1), 0.4)
    np.testing.assert_array_equal(thigh.end, poses["shin_left"][:, :3, 3])


def test_equipment_is_lines_of_its_own_and_hangs_on_no_limb(ride: Walk) -> None:
    instant = 7
    world_T_segment = ride.world_T_segment[instant]
    lines = body_bones(ride.body, world_T_segment)
    assert sorted(line.segment for line in lines if not line.is_equipment) == [
        "foot_left", "pelvis", "pelvis", "shin_left", "thigh_left",
    ]  # fmt: skip
    (crank,) = (line for line in lines if line.is_equipment)
    foot = world_T_segment[ride.body.segment_index["foot_left"]]
    np.testing.assert_allclose(crank.end[0], foot[:3, 3] + foot[:3, :3] @ [0.12, 0.0, -0.08], atol=1e-9)
    np.testing.assert_allclose(crank.start[0], world_T_segment[ride.body.segment_index["crank"], :3, 3], atol=1e-9)
