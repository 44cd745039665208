"""The trail of a joint: where the joint was and will be, and no line across a gap of time."""

from pathlib import Path

import numpy as np
import pytest
from helpers.known_walk import FRAMES, Walk, standing, write_solved
from numpy.testing import assert_allclose

from bodycam_ros.geometry import transform_points
from bodycam_ros.viewer.motion import Motion, read_motion
from bodycam_ros.viewer.trail import trail_pieces, way_of


@pytest.fixture(scope="module")
def walk() -> Walk:
    return standing(0.1)


@pytest.fixture(scope="module")
def motion(walk: Walk, tmp_path_factory: pytest.TempPathFactory) -> Motion:
    return read_motion(write_solved(walk, tmp_path_factory.mktemp("trail") / "out"), walk.body)


def test_a_joint_s_way_is_that_of_the_segments(walk: Walk, motion: Motion) -> None:
    joint = next(joint for joint in walk.body.joints if joint.child == "shin_left")
    poses = walk.world_T_segment[:, walk.body.segment_index[joint.parent]]
    expected = transform_points(poses, joint.parent_T_joint[None, :3, 3])[:, 0]
    assert_allclose(way_of(motion, walk.body, joint.name), expected, atol=1e-9)


def test_a_trail_is_as_long_as_it_is_asked_for_and_begins_where_the_joint_is(motion: Motion) -> None:
    way = np.arange(3.0 * FRAMES).reshape(-1, 3)
    pieces, is_past = trail_pieces(way, motion, 20, 0.5)
    assert len(pieces) == 30 and is_past.tolist() == [True] * 15 + [False] * 15
    assert_allclose(pieces[:, 0], way[5:35])
    assert_allclose(pieces[:, 1], way[6:36])
    pieces, is_past = trail_pieces(way, motion, 3, 0.5)
    assert is_past.sum() == 3 and len(pieces) == 18
    assert len(trail_pieces(way, motion, 20, 0.0)[0]) == 0
    assert len(trail_pieces(np.zeros((0, 3)), motion, 20, 0.5)[0]) == 0


def test_a_gap_of_time_has_no_piece(walk: Walk, tmp_path: Path) -> None:
    motion = read_motion(write_solved(walk.without([*range(10, 20)]), tmp_path / "out"), walk.body)
    way = np.arange(3.0 * len(motion.stamps_ns)).reshape(-1, 3)
    pieces, _ = trail_pieces(way, motion, 9, 1.0)
    assert_allclose(pieces[:9, 1], way[1:10])
    assert_allclose(pieces[9, 0], way[10])
