"""A solved walk against the same walk as other systems have it, by clocks, units and worlds of their own."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from helpers.captured_files import origins, seconds, write_bvh, write_c3d, write_trc, write_tum
from helpers.known_walk import FRAME_NS, START_NS, Walk, write_solved
from helpers.naming import naming
from scipy.ndimage import gaussian_filter1d

from bodycam_ros.errors import RecordingError
from bodycam_ros.evaluate.agreement import (
    Agreement,
    AgreementOptions,
    compare_with_captured,
    rate_same_motion,
)
from bodycam_ros.evaluate.clock_search import Clock, Signals, find_clock
from bodycam_ros.evaluate.comparison import read_true_motion
from bodycam_ros.formats.read_captured import read_captured
from bodycam_ros.geometry import exp_so3, rigid, transform_points
from bodycam_ros.results.solved_recording import SolvedRecording, read_solved

FRAME_S = 1e-9 * FRAME_NS
ELSEWHERE = rigid(exp_so3(np.array([0.0, 0.0, 2.0])), np.array([5.0, -3.0, 0.2]))
"""Where the other system has its world: on the same floor, turned."""


@pytest.fixture(scope="module")
def recording(solved: Path) -> SolvedRecording:
    return read_solved(solved)


def some(walk: Walk, first: int = 0, last: int = 60) -> Walk:
    return Walk(walk.body, walk.stamps_ns[first:last], walk.world_T_segment[first:last])


def against(recording: SolvedRecording, path: Path, with_scale: bool = True, **options: object) -> Agreement:
    return compare_with_captured(recording, read_captured(path), AgreementOptions(with_scale, **options))


@pytest.mark.parametrize("kind", ["trc", "c3d", "bvh"])
def test_a_perfect_solution_agrees_whatever_clock_world_and_unit(
    recording: SolvedRecording, walk: Walk, tmp_path: Path, kind: str
) -> None:
    """They began 9 frames later than we, and their clock is fast by 1 %."""
    other = some(walk.moved(ELSEWHERE), 9, 57)
    times = seconds(other) * 1.01
    if kind == "trc":
        path = write_trc(tmp_path / "other.trc", times, origins(other))
    elif kind == "c3d":
        path = write_c3d(tmp_path / "other.c3d", 1.0 / (FRAME_S * 1.01), origins(other))
    else:
        path = write_bvh(tmp_path / "other.bvh", other, FRAME_S * 1.01, per_m=1.0 / 0.0254)
    found = against(recording, path)
    assert found.clock.start_s == pytest.approx(9 * FRAME_S, abs=2e-3)
    assert found.clock.rate == pytest.approx(1.0 / 1.01, abs=1e-3)
    assert abs(found.clock.start_s - 9 * FRAME_S) < 4.0 * max(found.clock.start_sigma_s, 1e-5)
    assert found.scale == pytest.approx(1.0, abs=1e-3)
    assert found.unit_m == (0.0254 if kind == "bvh" else None)
    assert np.nanmax(found.position_errors) < 2e-3
    assert max(np.nanmax(errors) for errors in found.angle_errors.values()) < np.radians(0.3)
    assert len(found.angles) == (4 if kind == "bvh" else 1)


def test_a_scale_is_a_similaritys_to_find_and_an_error_without(
    recording: SolvedRecording, walk: Walk, tmp_path: Path
) -> None:
    larger = {name: 1.02 * points for name, points in origins(walk.moved(ELSEWHERE)).items()}
    path = write_trc(tmp_path / "other.trc", seconds(walk), larger)
    similar, stiff = (against(recording, path, with_scale) for with_scale in (True, False))
    assert [of.scale for of in (similar, stiff)] == pytest.approx([1.02, 1.02], abs=1e-4)
    assert np.nanmax(similar.position_errors) < 1e-3
    assert similar.rigid_error == pytest.approx(float(np.nanmean(stiff.position_errors)), rel=1e-6)
    assert 0.005 < np.nanmean(stiff.position_errors) < 0.05


def test_a_bend_that_only_one_has_is_told_in_its_plane(walk: Walk, tmp_path: Path) -> None:
    """The knee bends 6 deg too far in the middle of the recording: 3 on average, all in the sagittal plane."""
    bend = 6.0 * np.sin(np.linspace(0.0, np.pi, 60)) ** 2
    recording = read_solved(write_solved(walk.bent("knee_left", bend), tmp_path / "out"))
    bvh = write_bvh(tmp_path / "other.bvh", walk, FRAME_S)
    trc = write_trc(tmp_path / "other.trc", seconds(walk), origins(walk))
    for path in (bvh, trc):
        figures = against(recording, path).figures().joints["knee left"]
        sagittal = figures.planes["sagittal"]
        assert sagittal.error_deg.max > 2.5
        if path is trc:
            assert sagittal.bias == pytest.approx(3.0, abs=0.1)
            assert sagittal.high == pytest.approx(3.0 + 1.96 * np.std(bend), abs=0.2)
            assert figures.angle_deg.max == pytest.approx(6.0, abs=0.6)
            assert set(figures.planes) == {"sagittal"}
        else:
            assert max(figures.planes[plane].error_deg.max for plane in ("frontal", "transverse")) < 0.4


def test_markers_are_placed_by_the_motion_and_constant_errors_do_not_show(
    recording: SolvedRecording, walk: Walk, tmp_path: Path
) -> None:
    places = {"LKNE": ("thigh_left", [0.02, 0.06, -0.4]), "LTOE": ("foot_left", [0.15, 0.0, -0.05])}
    places |= {"LASI": ("pelvis", [0.1, 0.12, 0.05]), "C7": ("torso", [-0.05, 0.0, 0.4])}
    world_T = {s: walk.world_T_segment[:, row] for s, row in walk.body.segment_index.items()}
    points = {name: transform_points(ELSEWHERE @ world_T[s], np.array([at]))[:, 0] for name, (s, at) in places.items()}
    points["LTOE"][20:] += [0.0, 0.0, 0.01]
    with_centres = {**points, **origins(walk.moved(ELSEWHERE))}
    found = against(recording, write_trc(tmp_path / "other.trc", seconds(walk), with_centres))
    errors = {point.name: float(np.nanmean(point.errors)) for point in found.points if point.is_fitted}
    assert set(errors) == set(places)
    assert max(errors[name] for name in places if name != "LTOE") < 1e-3
    assert 2e-3 < errors["LTOE"] < 8e-3
    alone = against(recording, write_trc(tmp_path / "alone.trc", seconds(walk), points), False)
    assert abs(alone.clock.start_s) < 0.02 and not alone.angles  # LTOE's leap pulls
    assert np.nanmean(alone.position_errors) < 0.01


def test_noise_draws_no_clock_between_frames(recording: SolvedRecording, walk: Walk, tmp_path: Path) -> None:
    """A curve through noisy points is quietest between them, half a frame off."""
    random = np.random.default_rng(1)
    noisy = {name: points + random.normal(0.0, 0.015, points.shape) for name, points in origins(walk).items()}
    found = against(recording, write_trc(tmp_path / "noisy.trc", seconds(walk), noisy), False)
    assert abs(found.clock.start_s) < 0.2 * FRAME_S and found.clock.rate == 1.0
    assert abs(found.clock.start_s) < 4.0 * found.clock.start_sigma_s
    assert np.nanmean(found.position_errors) == pytest.approx(0.015 * np.sqrt(8.0 / np.pi), rel=0.15)


def test_one_body_of_a_robot_is_enough(recording: SolvedRecording, walk: Walk, tmp_path: Path) -> None:
    times = 1e-9 * START_NS + 0.5 * FRAME_S + seconds(walk)
    path = write_tum(tmp_path / "foot_left.tum", times, walk.moved(ELSEWHERE).world_T_segment[:, 4])
    found = against(recording, path, False)
    assert found.clock.start_s == pytest.approx(0.0, abs=5e-3)
    assert np.nanmean(found.position_errors) < 3e-3
    shared = against(recording, path, False, shares_clock=True)
    assert shared.clock.start_s == pytest.approx(0.5 * FRAME_S, abs=1e-6)
    assert np.nanmean(shared.position_errors) > 3.0 * np.nanmean(found.position_errors)


def test_what_is_another_motion_is_refused(recording: SolvedRecording, walk: Walk, tmp_path: Path) -> None:
    random = np.random.default_rng(5)
    moved = {
        name: points + np.cumsum(random.normal(0.0, 0.05, points.shape), axis=0)
        for name, points in origins(walk).items()
    }
    path = write_trc(tmp_path / "other.trc", seconds(walk), moved)
    with naming(RecordingError, path):
        against(recording, path)
    late = write_trc(tmp_path / "late.trc", 100.0 + seconds(walk), origins(walk))
    with naming(RecordingError, late):
        against(recording, late, shares_clock=True)


@pytest.mark.filterwarnings("error")
def test_a_recording_too_short_for_a_clock_is_refused_without_a_warning_of_numpy(walk: Walk, tmp_path: Path) -> None:
    short = read_solved(write_solved(some(walk, 0, 6), tmp_path / "short"))
    path = write_trc(tmp_path / "short.trc", seconds(some(walk, 0, 6)), origins(some(walk, 0, 6)))
    with naming(RecordingError, path):
        against(short, path)


def test_a_match_with_another_walk_is_doubted(recording: SolvedRecording, walk: Walk, tmp_path: Path) -> None:
    """The same steps, 1.3 times as fast."""
    for faster, doubts in ((1.0, 0), (1.3, 2)):
        path = write_trc(tmp_path / "other.trc", seconds(walk) / faster, origins(walk))
        found = against(recording, path)
        assert len(found.doubts) == doubts and all("other.trc" in doubt for doubt in found.doubts)
        assert found.figures().doubts == list(found.doubts)


def test_what_motions_share_by_chance_has_no_lead_over_the_next_best() -> None:
    def smooth(seed: int, count: int) -> np.ndarray:
        return gaussian_filter1d(np.random.default_rng(seed).normal(size=(4, count)), 12, axis=1)

    def clock(ours: np.ndarray, theirs: np.ndarray) -> Clock | None:
        def signals(values: np.ndarray) -> Signals:
            return lambda at: np.stack([np.interp(at, 0.02 * np.arange(values.shape[1]), row) for row in values])

        return find_clock(signals(ours), (0.0, 11.98), signals(theirs), 0.02 * (theirs.shape[1] - 1))

    chance = [found for seed in range(40) if (found := clock(smooth(seed, 600), smooth(1000 + seed, 150)))]
    assert len(chance) > 10 and sum(found.lead > 2.5 for found in chance) <= 1
    same = clock(smooth(1, 600), smooth(1, 600)[:, 200:350])
    assert same is not None and same.start_s == pytest.approx(4.0) and same.lead > 5.0


def test_a_truth_of_another_motion_at_the_same_time_is_refused(sample_out: Path, sample: Path) -> None:
    solved, truth = read_solved(sample_out), read_true_motion(sample / "sample")
    same = rate_same_motion(solved, truth)
    assert same.likeness > 0.99 and same.chance < 0.02
    with naming(RecordingError, "clock"):
        rate_same_motion(solved, replace(truth, stamps_ns=truth.stamps_ns + 300_000_000))
