"""What the panels draw: directions, gaps, bones."""

from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
from evaluate.known_walk import FOCAL, FRAME_NS, FRAMES, LANDMARKS, Walk, write_images, write_solved

from bodycam_ros.body.body_model import CameraMount
from bodycam_ros.evaluate.oblique_view import ObliqueView
from bodycam_ros.evaluate.overlay import overlay_views
from bodycam_ros.evaluate.overlay_picture import draw_overlays
from bodycam_ros.evaluate.read_solved import read_solved
from bodycam_ros.evaluate.stick_figure import bones
from bodycam_ros.evaluate.time_curve import broken_at_gaps
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


def test_curves_break_where_instants_are_missing(walk: Walk, tmp_path: Path) -> None:
    solved = read_solved(write_solved(walk.without([20, 21, 40]), tmp_path / "out"))
    values = np.arange(2.0 * (FRAMES - 3)).reshape(-1, 2)
    seconds, curves = broken_at_gaps(solved, solved.stamps_ns, values)
    assert np.flatnonzero(np.isnan(seconds)).tolist() == [20, 39]
    assert np.isnan(curves[[20, 39]]).all()
    np.testing.assert_array_equal(curves[~np.isnan(seconds)], values)
    assert seconds[21] == pytest.approx(22e-9 * FRAME_NS)


def test_bones_join_each_segment_with_its_children_and_end_in_tips(walk: Walk) -> None:
    poses = dict(zip(walk.body.segments, np.moveaxis(walk.world_T_segment, 1, 0), strict=True))
    parents = {joint.child: joint.parent for joint in walk.body.tree_joints}
    lines = bones(poses, parents)
    assert sorted(line.segment for line in lines) == ["foot_left", "pelvis", "pelvis", "shin_left", "thigh_left"]
    thigh = next(line for line in lines if line.segment == "thigh_left")
    np.testing.assert_allclose(np.linalg.norm(thigh.end - thigh.start, axis=1), 0.4)
    np.testing.assert_array_equal(thigh.end, poses["shin_left"][:, :3, 3])


def test_landmarks_of_a_good_solution_fall_on_their_tracks(walk: Walk, tmp_path: Path) -> None:
    noise_px = 0.3
    solved = read_solved(write_solved(walk, tmp_path / "out", pixel_noise=noise_px))
    waist, shin = overlay_views(solved, write_images(tmp_path / "recording", ("waist", "shin", "elsewhere")))
    for view, camera in ((waist, "waist"), (shin, "shin")):
        assert (view.camera, view.registered, view.image.shape) == (camera, True, (480, 640))
        assert view.seconds == pytest.approx(1.0, abs=0.04)
        assert len(view.errors) == LANDMARKS
        assert 0.5 * noise_px < np.median(view.errors) < 2.0 * noise_px
        assert [segment for segment, _ in view.limbs].count("shin_left") == 1
    draw_overlays((waist, shin), tmp_path / "overlay.png")
    assert cv2.imread(str(tmp_path / "overlay.png")) is not None


def test_limbs_are_drawn_where_the_camera_would_see_them(walk: Walk, tmp_path: Path) -> None:
    """A camera that looks back at the leg from half a metre to its left, along -y, in a body at rest in the N-pose."""
    looking_back = np.array([[-1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, -1.0, 0.0]])
    mount = CameraMount("thigh_left", rigid(looking_back, np.array([0.0, 0.5, -0.4])))
    body = replace(walk.body, mounts={"thigh": mount})
    rest = np.tile(np.eye(3), (FRAMES, len(body.tree_joints), 1, 1))
    still = Walk(body, walk.stamps_ns, body.forward_kinematics(np.tile(np.eye(4), (FRAMES, 1, 1)), rest))
    recording = write_images(tmp_path / "recording", ("thigh",))
    (view,) = overlay_views(read_solved(write_solved(still, tmp_path / "out")), recording)
    thigh = dict(view.limbs)["thigh_left"]
    # The knee is straight ahead; the hip 0.4 m above it at 0.5 m: equidistant, focal length times the angle.
    np.testing.assert_allclose(thigh[-1], (319.5, 239.5), atol=1e-6)
    np.testing.assert_allclose(thigh[0], (319.5, 239.5 - FOCAL * np.arctan2(0.4, 0.5)), atol=1e-6)
