"""Contacts of a solved body: a foot that stands and then glides, and attachments that hold for a while."""

from dataclasses import replace
from pathlib import Path

import numpy as np
from helpers.known_walk import FRAMES, STANDS, Walk, standing, walking_body, write_solved
from helpers.ride_with_open_joints import OFF, UNPLACED, write_held
from numpy.testing import assert_allclose

from bodycam_ros.body.body_model import sole_points
from bodycam_ros.geometry import transform_points
from bodycam_ros.results.colours import EQUIPMENT, LEFT
from bodycam_ros.results.solved_body import read_solved_body
from bodycam_ros.viewer.contacts import find_contacts, touching_at
from bodycam_ros.viewer.motion import read_motion
from bodycam_ros.viewer.scene import CONTACTS, Scene
from bodycam_ros.viewer.server import LocalServer
from bodycam_ros.viewer.timeline import timeline_rows


def test_a_foot_touches_while_it_stands_where_it_stands(tmp_path: Path) -> None:
    walk = standing(0.0)
    motion = read_motion(write_solved(walk, tmp_path / "out"), walk.body)
    (foot,) = motion.contacts
    assert foot.name == "foot_left"
    assert np.array_equal(foot.touches, np.repeat(np.arange(FRAMES)[:, None] < STANDS, 2, axis=1))
    world_T_foot = walk.world_T_segment[5, walk.body.segment_index["foot_left"]]
    assert_allclose(touching_at(motion.contacts, 5), transform_points(world_T_foot, sole_points(0.4)), atol=1e-9)
    assert touching_at(motion.contacts, STANDS + 5).shape == (0, 3)
    assert timeline_rows(motion)[-1].colours.tolist() == [LEFT if t < STANDS else "" for t in range(FRAMES)]


def test_a_foot_that_is_held_up_touches_nothing(tmp_path: Path) -> None:
    walk = standing(0.0, height=0.3)
    (foot,) = read_motion(write_solved(walk, tmp_path / "out"), walk.body).contacts
    assert not foot.touches.any()


def test_a_gap_ends_a_stance_where_most_steps_are_gaps_as_well(tmp_path: Path) -> None:
    """The median step would be a gap; what lies between is unknown, and the evaluation says so too."""
    solved = read_solved_body(write_solved(standing(0.0), tmp_path / "out"))
    rows = np.array([0, 1, 2, 3, 4, *range(8, STANDS, 4)])
    few = replace(
        solved,
        stamps_ns=solved.stamps_ns[rows],
        joint_angles=solved.joint_angles[rows],
        world_T_root=solved.world_T_root[rows],
        root_covariance=solved.root_covariance[rows],
    )
    assert np.median(np.diff(few.stamps_ns)) > few.longest_step_ns
    (foot,) = find_contacts(few)
    assert np.array_equal(foot.touches, np.repeat(np.arange(len(rows))[:, None] < 5, 2, axis=1))


def test_an_attachment_touches_while_it_holds(ride: Walk, tmp_path: Path) -> None:
    motion = read_motion(write_held(ride, tmp_path / "out"), walking_body())
    contacts = {contact.name: contact for contact in motion.contacts}
    holds = [instant not in (*OFF, *UNPLACED) for instant in range(FRAMES)]
    assert contacts["pedal_left"].touches[:, 0].tolist() == holds
    assert not contacts["bar"].touches.any()
    rows = {row.name: row.colours.tolist() for row in timeline_rows(motion)}
    assert rows["pedal left"] == [EQUIPMENT if hold else "" for hold in holds]


def test_the_scene_marks_what_touches(tmp_path: Path) -> None:
    walk = standing(0.0)
    motion = read_motion(write_solved(walk, tmp_path / "out"), walk.body)
    server = LocalServer(0, "test")
    try:
        scene = Scene(server, walk.body, None, motion, lambda part: None)
        marks = server.scene.get_handle_by_name("/world/contacts/touching")
        scene.show(5, follow=False)
        assert marks is not None and marks.visible
        assert_allclose(marks.points, touching_at(motion.contacts, 5), atol=1e-6)
        scene.show(STANDS + 5, follow=False)
        assert not marks.visible
        assert scene.layers[CONTACTS]
    finally:
        server.stop()
