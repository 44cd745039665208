"""What a solved recording says about itself, where we know what it ought to say."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from helpers.known_walk import (
    FRAME_NS,
    FRAMES,
    LANDMARKS,
    LOST,
    ROOT_SIGMA_M,
    ROOT_SIGMA_RAD,
    START_NS,
    Stamped,
    Walk,
    write_images,
    write_solved,
)
from helpers.naming import naming
from msgspec.structs import asdict

from bodycam_ros.body.body_model import CameraMount
from bodycam_ros.camera.readout import Readout
from bodycam_ros.errors import RecordingError
from bodycam_ros.evaluate.evaluation import evaluate
from bodycam_ros.geometry import exp_so3, rigid
from bodycam_ros.kinematics.joint_angles import JointAngleTracker
from bodycam_ros.messages.timing import timing_messages
from bodycam_ros.recording.typestore import recorded_messages
from bodycam_ros.timing.clock_state import ClockHistory, ClockState

FRAME_S = 1e-9 * FRAME_NS


def test_cameras(solved: Path) -> None:
    cameras = evaluate(solved).figures.cameras
    waist, shin = cameras["waist"], cameras["shin"]
    assert (waist.images, waist.registered, waist.longest_lost_s) == (FRAMES, 1.0, 0.0)
    assert shin.registered == pytest.approx(1.0 - len(LOST["shin"]) / FRAMES)
    assert shin.longest_lost_s == pytest.approx(3 * FRAME_S)
    assert waist.landmarks == LANDMARKS
    assert shin.landmarks == pytest.approx(LANDMARKS * (1.0 - len(LOST["shin"]) / FRAMES))
    for camera in (waist, shin):
        assert camera.position_gap_mm.max < 1e-5
        assert camera.rotation_gap_deg.max < 1e-5
        assert camera.reprojection_px is None


def test_a_camera_that_sits_elsewhere_than_the_body_says_shows_a_gap(walk: Walk, tmp_path: Path) -> None:
    """The registrations are of the true mount; the URDF has it 3 mm and half a degree off."""
    wrong = walk.body.mounts["shin"].segment_T_camera @ rigid(
        exp_so3(np.radians([0.0, 0.5, 0.0])), np.array([3e-3, 0, 0])
    )
    body = replace(walk.body, mounts={**walk.body.mounts, "shin": CameraMount("shin_left", wrong)})
    cameras = evaluate(write_solved(walk, tmp_path / "out", published=body)).figures.cameras
    assert cameras["shin"].position_gap_mm.median == pytest.approx(3.0, abs=1e-3)
    assert cameras["shin"].rotation_gap_deg.median == pytest.approx(0.5, abs=1e-4)
    assert cameras["waist"].position_gap_mm.max < 1e-5


def timing_of(camera: str, *clocks: ClockState) -> list[Stamped]:
    timing = ClockHistory(camera, clocks, Readout(0.012, 2e-4))
    return [(f"/{camera}/timing", ns, message) for ns, message in timing_messages(recorded_messages(), timing)]


def test_a_clock_that_was_off_is_told_and_costs_no_camera_its_agreement(walk: Walk, tmp_path: Path) -> None:
    """The shin's camera is 21 ms ahead: its poses fit the body where the bag says so, and not where it does not."""
    ahead_ns = 21_000_000
    clocks = {"shin": ahead_ns}
    clock = ClockState(START_NS + ahead_ns, START_NS + ahead_ns, 1e-9 * ahead_ns, 0.0, 4e-4, 1e-5)
    told = evaluate(write_solved(walk, tmp_path / "told", clocks_ns=clocks, more=timing_of("shin", clock)))
    untold = evaluate(write_solved(walk, tmp_path / "untold", clocks_ns=clocks))
    gaps = [evaluation.figures.cameras["shin"].position_gap_mm for evaluation in (told, untold)]
    assert gaps[0].max < 1e-3 and gaps[1].median > 10.0
    assert told.figures.image_coverage == 1.0 and not told.figures.gaps_s and not told.blind.any()
    assert told.figures.cameras["waist"].clock is None
    figures = told.figures.cameras["shin"].clock
    assert figures is not None and figures.held_from_s == []
    assert {name: value for name, value in asdict(figures).items() if name != "held_from_s"} == pytest.approx(
        {
            "is_off": True,
            "ahead_ms": 21.0,
            "ahead_sigma_ms": 0.4,
            "drift_ppm": 0.0,
            "drift_sigma_ppm": 10.0,
            "readout_ms": 12.0,
            "readout_sigma_ms": 0.2,
        }
    )
    assert untold.figures.cameras["shin"].landmarks == told.figures.cameras["shin"].landmarks


def test_landmarks_are_judged_at_the_time_at_which_they_were_seen(walk: Walk, tmp_path: Path) -> None:
    ahead_ns = 21_000_000
    clock = ClockState(START_NS + ahead_ns, START_NS + ahead_ns, 1e-9 * ahead_ns, 0.0, 4e-4, 1e-5)
    recording = write_images(tmp_path / "recording", ("shin",))
    for name, more, least_px, most_px in (
        ("told", timing_of("shin", clock), 0.0, 0.01),
        ("untold", [], 1.0, 1000.0),
    ):
        out = write_solved(walk, tmp_path / name, clocks_ns={"shin": ahead_ns}, more=more)
        reprojection = evaluate(out, recording_path=recording).figures.cameras["shin"].reprojection_px
        assert least_px <= reprojection.median < most_px


def test_reprojection_errors_are_the_noise_of_the_pixels(walk: Walk, tmp_path: Path) -> None:
    noise_px = 0.5
    out = write_solved(walk, tmp_path / "out", pixel_noise=noise_px)
    recording = write_images(tmp_path / "recording", ("shin", "elsewhere"))
    cameras = evaluate(out, recording_path=recording).figures.cameras
    assert cameras["waist"].reprojection_px is None
    # The length of two independent normal numbers: a Rayleigh distribution.
    assert cameras["shin"].reprojection_px.mean == pytest.approx(noise_px * np.sqrt(np.pi / 2.0), rel=0.05)


def test_the_recording_of_other_cameras_is_refused(solved: Path, tmp_path: Path) -> None:
    recording = write_images(tmp_path / "recording", ("dashboard",))
    with naming(RecordingError, solved, "waist", "shin", "dashboard"):
        evaluate(solved, recording_path=recording)


def test_gaps_and_coverage(walk: Walk, tmp_path: Path) -> None:
    """The images of frames 0, 20, 21, 22 and 59 have no solution."""
    evaluation = evaluate(write_solved(walk.without([0, 20, 21, 22, 59]), tmp_path / "out"))
    assert evaluation.figures.image_coverage == pytest.approx(1.0 - 5.0 / FRAMES)
    np.testing.assert_allclose(
        evaluation.figures.gaps_s,
        [(0.0, 0.0), (20 * FRAME_S, 22 * FRAME_S), (59 * FRAME_S, 59 * FRAME_S)],
        atol=1e-9,
    )


def test_a_whole_recording_has_no_gaps(solved: Path) -> None:
    figures = evaluate(solved).figures
    assert (figures.image_coverage, figures.gaps_s) == (1.0, [])


def test_instants_without_any_camera(walk: Walk, tmp_path: Path, solved: Path) -> None:
    assert not evaluate(solved).blind.any()
    alone = replace(walk, body=replace(walk.body, mounts={"shin": walk.body.mounts["shin"]}))
    blind = evaluate(write_solved(alone, tmp_path / "out")).blind
    assert np.flatnonzero(blind).tolist() == list(LOST["shin"])


def test_root_sigmas(solved: Path) -> None:
    evaluation = evaluate(solved)
    np.testing.assert_allclose(evaluation.position_sigma, np.sqrt(3.0) * ROOT_SIGMA_M)
    assert evaluation.figures.root_rotation_sigma_deg.mean == pytest.approx(np.degrees(np.sqrt(3.0) * ROOT_SIGMA_RAD))


def test_joint_ranges_are_those_of_the_motion(walk: Walk, solved: Path) -> None:
    tracker = JointAngleTracker(walk.body)
    angles = np.degrees([tracker.angles(poses) for poses in walk.world_T_segment])
    ranges = evaluate(solved).figures.joint_ranges_deg
    assert tuple(ranges) == tracker.names
    np.testing.assert_allclose(list(ranges.values()), np.stack([angles.min(axis=0), angles.max(axis=0)], axis=1))


def test_jitter_is_the_noise_and_not_the_motion(walk: Walk, solved: Path, tmp_path: Path) -> None:
    noise_m = 2e-3
    shift = rigid(np.eye(3), noise_m * np.random.default_rng(2).normal(size=(FRAMES, 3)))
    noisy = replace(walk, world_T_segment=shift[:, None] @ walk.world_T_segment)
    jitter = evaluate(write_solved(noisy, tmp_path / "out")).jitter
    assert np.isnan(jitter[[0, 1, -2, -1]]).all()
    assert np.sqrt(np.nanmean(jitter**2)) == pytest.approx(np.sqrt(3.0) * noise_m, rel=0.2)
    assert np.nanmax(evaluate(solved).jitter) < 0.02 * noise_m


def test_jitter_does_not_take_a_gap_for_noise(walk: Walk, tmp_path: Path) -> None:
    jitter = evaluate(write_solved(walk.without([30, 31]), tmp_path / "out")).jitter
    assert np.nanmax(jitter) < 1e-4
    assert np.flatnonzero(np.isnan(jitter[:, 0])).tolist() == [0, 1, 28, 29, 30, 31, 56, 57]
