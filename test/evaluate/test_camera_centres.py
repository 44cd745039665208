"""Centres of cameras before and after the optimisation, against a truth of their own."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from helpers.known_walk import START_NS, Walk, write_truth
from helpers.naming import naming

from bodycam_ros.errors import RecordingError
from bodycam_ros.evaluate.camera_centres import centre_errors, draw_centres
from bodycam_ros.evaluate.evaluation import evaluate
from bodycam_ros.geometry import quaternion_xyzw, rigid
from bodycam_ros.results.solved_recording import read_solved

OFF_M = np.array([0.0, 0.003, 0.004])


@pytest.fixture
def with_cameras(walk: Walk, tmp_path: Path) -> Path:
    """The truth of the walk and of both cameras, in a world that is turned and shifted."""
    folder = write_truth(walk, tmp_path / "walk")
    (folder / "truth/cameras").mkdir()
    true_T_world = rigid(np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]), np.array([3.0, -1.0, 0.5]))
    for camera, mount in walk.body.mounts.items():
        row = walk.body.segment_index[mount.segment]
        lines = []
        for stamp_ns, world_T_segment in zip(walk.stamps_ns.tolist(), walk.world_T_segment[:, row], strict=True):
            pose = true_T_world @ world_T_segment @ mount.segment_T_camera
            numbers = [*pose[:3, 3], *quaternion_xyzw(pose[:3, :3])]
            lines.append(" ".join([f"{stamp_ns // 10**9}.{stamp_ns % 10**9:09d}", *map(repr, map(float, numbers))]))
        (folder / f"truth/cameras/{camera}.tum").write_text("\n".join(lines) + "\n")
    return folder


def test_errors_before_are_those_of_each_camera_alone(solved: Path, with_cameras: Path, tmp_path: Path) -> None:
    recording = read_solved(solved)
    waist, *others = recording.cameras
    off = replace(waist, world_T_camera=waist.world_T_camera + np.pad(OFF_M[:, None], ((0, 1), (3, 0))))
    shifted = replace(recording, cameras=(off, *others))
    errors = centre_errors(shifted, with_cameras / "truth")
    assert set(errors) == {"waist", "shin"}
    assert errors["waist"].stamps_ns[0] >= START_NS
    np.testing.assert_allclose(errors["waist"].before, 0.005, atol=1e-6)
    for never in (errors["waist"].after, errors["shin"].before, errors["shin"].after):
        assert never.max() < 1e-6
    draw_centres(shifted, errors, tmp_path / "centres.png")
    assert (tmp_path / "centres.png").stat().st_size > 10_000


def test_a_truth_without_cameras_has_no_such_figures(solved: Path, truth: Path) -> None:
    assert evaluate(solved, truth).figures.camera_centres_mm is None


def test_figures_are_those_of_the_truth_s_cameras(solved: Path, with_cameras: Path) -> None:
    figures = evaluate(solved, with_cameras).figures.camera_centres_mm
    assert figures is not None and figures["shin"].after.max < 1e-3


def test_a_camera_that_never_moves_in_its_truth_cannot_be_aligned(solved: Path, with_cameras: Path) -> None:
    for file in (with_cameras / "truth/cameras").glob("*.tum"):
        first, *rest = file.read_text().splitlines()
        fixed = first.split()[1:]
        file.write_text("\n".join(" ".join([line.split()[0], *fixed]) for line in [first, *rest]) + "\n")
    with naming(RecordingError, with_cameras / "truth/cameras", "aligned"):
        centre_errors(read_solved(solved), with_cameras / "truth")
