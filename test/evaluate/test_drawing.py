"""What the panels draw: directions, gaps, bones."""

from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
from known_walk import FOCAL, FRAME_NS, FRAMES, LANDMARKS, Walk, write_images, write_solved

from bodycam_ros.body.body_model import CameraMount
from bodycam_ros.evaluate.evaluation import evaluate
from bodycam_ros.evaluate.overlay_picture import draw_overlays, overlay_views
from bodycam_ros.evaluate.report_folder import write_report
from bodycam_ros.evaluate.time_panels import broken_at_gaps
from bodycam_ros.geometry import rigid
from bodycam_ros.solved.solved_recording import read_solved


def test_curves_break_where_instants_are_missing(walk: Walk, tmp_path: Path) -> None:
    solved = read_solved(write_solved(walk.without([20, 21, 40]), tmp_path / "out"))
    values = np.arange(2.0 * (FRAMES - 3)).reshape(-1, 2)
    seconds, curves = broken_at_gaps(solved, solved.stamps_ns, values)
    assert np.flatnonzero(np.isnan(seconds)).tolist() == [20, 39]
    assert np.isnan(curves[[20, 39]]).all()
    np.testing.assert_array_equal(curves[~np.isnan(seconds)], values)
    assert seconds[21] == pytest.approx(22e-9 * FRAME_NS)


def test_landmarks_of_a_good_solution_fall_on_their_tracks(walk: Walk, tmp_path: Path) -> None:
    noise_px = 0.3
    solved = read_solved(write_solved(walk, tmp_path / "out", pixel_noise=noise_px))
    waist, shin = overlay_views(solved, write_images(tmp_path / "recording", ("waist", "shin", "elsewhere")))
    for view, camera in ((waist, "waist"), (shin, "shin")):
        assert (view.camera, view.registered, view.image.shape) == (camera, True, (480, 640))
        assert view.seconds == pytest.approx(1.0, abs=0.04)
        assert len(view.overlay.errors) == LANDMARKS
        assert 0.5 * noise_px < np.median(view.overlay.errors) < 2.0 * noise_px
        assert [segment for segment, _ in view.overlay.limbs].count("shin_left") == 1
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
    thigh = dict(view.overlay.limbs)["thigh_left"]
    # The knee is straight ahead; the hip 0.4 m above it at 0.5 m: equidistant, focal length times the angle.
    np.testing.assert_allclose(thigh[-1], (319.5, 239.5), atol=1e-6)
    np.testing.assert_allclose(thigh[0], (319.5, 239.5 - FOCAL * np.arctan2(0.4, 0.5)), atol=1e-6)


def test_equipment_is_drawn_apart_from_the_wearer(ride: Walk, tmp_path: Path) -> None:
    solved = read_solved(write_solved(ride, tmp_path / "out"))
    views = overlay_views(solved, write_images(tmp_path / "recording", ("waist", "shin", "stem")))
    assert [view.camera for view in views] == ["waist", "shin", "stem"]
    for view in views:
        assert [segment for segment, _ in view.overlay.limbs].count("pelvis") == 2
        assert "frame" not in dict(view.overlay.limbs) and len(view.overlay.equipment) == 1
    draw_overlays(views, tmp_path / "overlay.png")
    assert cv2.imread(str(tmp_path / "overlay.png")) is not None


def test_places_of_equipment_are_no_angles_and_its_jitter_is_not_the_body_s(ride: Walk, tmp_path: Path) -> None:
    shaken, shakes = ride.world_T_segment.copy(), np.random.default_rng(2).normal(scale=0.05, size=(FRAMES, 3))
    for segment in ("frame", "crank"):
        shaken[:, ride.body.segment_index[segment], :3, 3] += shakes
    out = write_solved(replace(ride, world_T_segment=shaken), tmp_path / "out")
    evaluation = evaluate(out)
    assert set(evaluation.angle_ranges) >= {"crank", "bicycle_y"} and "bicycle_at_x" not in evaluation.angle_ranges
    assert evaluation.jitter.shape[1] == len(ride.body.segments) - 2
    assert np.nanmax(evaluation.jitter) < 0.01
    write_report(evaluation, tmp_path / "report")
    assert cv2.imread(str(tmp_path / "report" / "summary.png")) is not None
