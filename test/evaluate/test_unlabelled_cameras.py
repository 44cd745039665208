"""Tracks of cameras without names, by another clock, in another world and unit (A section 5.1)."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from helpers.known_walk import Walk, write_solved
from helpers.naming import naming

from bodycam_ros.body.body_model import CameraMount
from bodycam_ros.camera.model import optical_frame
from bodycam_ros.cli.main import main
from bodycam_ros.errors import RecordingError
from bodycam_ros.evaluate.agreement import AgreementOptions, compare_with_captured
from bodycam_ros.evaluate.unlabelled_cameras import find_cameras
from bodycam_ros.formats.captured_motion import CapturedMotion
from bodycam_ros.geometry import exp_so3, rigid
from bodycam_ros.results.solved_recording import SolvedRecording, read_solved

PLACES = {
    "waist": ("pelvis", (0.1, 0.0, 0.0)),
    "back": ("torso", (-0.1, 0.05, 0.3)),
    "chest": ("torso", (0.15, 0.0, 0.25)),
    "thigh": ("thigh_left", (0.05, 0.1, -0.2)),
    "shin": ("shin_left", (0.06, 0.05, -0.15)),
    "foot": ("foot_left", (0.1, 0.0, -0.05)),
}
ORDER = ("shin", "chest", "waist", "foot", "back", "thigh")
"""Their first track is the shin's, and so on."""

LATE = 7
"""Frames by which they begin later."""


@pytest.fixture(scope="module")
def recording(walk: Walk, tmp_path_factory: pytest.TempPathFactory) -> SolvedRecording:
    """The walk with six cameras, solved without an error."""
    mounts = {name: CameraMount(segment, rigid(np.eye(3), np.array(at))) for name, (segment, at) in PLACES.items()}
    body = replace(walk.body, mounts=mounts)
    return read_solved(
        write_solved(Walk(body, walk.stamps_ns, walk.world_T_segment), tmp_path_factory.mktemp("w") / "o")
    )


def tracked(recording: SolvedRecording, noise_m: float = 0.003) -> CapturedMotion:
    """Their tracks: y is up, lengths are millimetres, the clock begins at zero."""
    turned = exp_so3(np.array([-np.pi / 2, 0.0, 0.0])) @ exp_so3(np.array([0.0, 0.0, 2.2]))
    random = np.random.default_rng(5)
    points = {}
    for number, camera in enumerate(ORDER):
        centres = recording.world_T_link[optical_frame(camera)][LATE:, :3, 3]
        noisy = centres + noise_m * random.normal(size=centres.shape)
        points[f"*{number}"] = 1e3 * (noisy @ turned.T + np.array([2.0, -1.0, 3.0]))
    stamps_ns = recording.stamps_ns[LATE:] - recording.stamps_ns[LATE]
    return CapturedMotion(Path("optical.trc"), "TRC", stamps_ns, points, has_unit=False)


def test_each_track_is_the_camera_that_it_follows(recording: SolvedRecording) -> None:
    places = find_cameras(recording, tracked(recording))
    assert {name: place.link for name, place in places.items()} == {
        f"*{number}": optical_frame(camera) for number, camera in enumerate(ORDER)
    }


def test_errors_are_the_noise_of_the_tracks(recording: SolvedRecording) -> None:
    agreement = compare_with_captured(recording, tracked(recording), AgreementOptions(by_places=True))
    figures = agreement.figures()
    assert figures.align == "icp" and figures.unit_m == 0.001
    assert figures.starts_at_s == pytest.approx(recording.seconds(recording.stamps_ns)[LATE], abs=0.01)
    # The mean length of three components of 3 mm is 1.6 times that.
    assert figures.position_cm.mean == pytest.approx(0.3 * 1.6, rel=0.15)
    assert any("*0 is shin" in line for line in agreement.lines())


def test_tracks_of_another_motion_are_refused(recording: SolvedRecording) -> None:
    captured = tracked(recording)
    still = {name: np.tile(points[:1], (len(points), 1)) for name, points in captured.points.items()}
    random = np.random.default_rng(2)
    for other in (
        {name: points + 40.0 * random.normal(size=points.shape).cumsum(axis=0) for name, points in still.items()},
        {name: points[::-1] for name, points in captured.points.items()},
    ):
        with naming(RecordingError, "optical.trc", "this recording"):
            find_cameras(recording, replace(captured, points=other))


def test_a_track_that_is_no_camera_is_refused(recording: SolvedRecording) -> None:
    captured = tracked(recording, 0.0)
    same = {**captured.points, "*1": captured.points["*4"] + 1e-3}
    with naming(RecordingError, "optical.trc", "one of its tracks"):
        find_cameras(recording, replace(captured, points=same))


@pytest.mark.parametrize("count", [3, 7])
def test_too_few_and_too_many_tracks_are_refused(recording: SolvedRecording, count: int) -> None:
    captured = tracked(recording)
    points = {f"*{number}": captured.points[f"*{number % len(ORDER)}"] for number in range(count)}
    with naming(RecordingError, "optical.trc", f"{count} tracks"):
        find_cameras(recording, replace(captured, points=points))


def test_names_are_not_given_twice(solved: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    captured = tmp_path / "optical.trc"
    captured.write_text("")
    table = tmp_path / "points.yaml"
    table.write_text("M0: waist\n")
    command = ["evaluate", str(solved), "--truth", str(captured), "--align", "icp", "--points", str(table)]
    assert main([*command, "-o", str(tmp_path / "report")]) == 1
    assert "--points: --align icp finds names and clock by itself" in capsys.readouterr().err
