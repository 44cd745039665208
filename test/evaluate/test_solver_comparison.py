"""Every way to solve the same registrations, on a body whose truth is known."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import standing_leg
from moving_body import STEP_NS, body_with_cameras, lenses, seen_by, true_poses

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.errors import RecordingError
from bodycam_ros.evaluate.solver_comparison import SolverComparison, compare_solvers
from bodycam_ros.evaluate.solver_errors import solver_errors
from bodycam_ros.evaluate.solver_picture import draw_solvers
from bodycam_ros.evaluate.solver_runs import Way, body_frames, dark_in_turn, run_solver
from bodycam_ros.evaluate.true_motion import TrueMotion
from bodycam_ros.pipeline import PipelineSettings, SkeletonPipeline
from bodycam_ros.registration.landmark_matches import LandmarkMatches
from bodycam_ros.solving.contact_settings import ContactSettings
from bodycam_ros.solving.smoother_settings import OFFLINE

FRAMES = 75


@pytest.fixture(scope="module")
def body() -> BodyModel:
    return body_with_cameras()


@pytest.fixture(scope="module")
def truth(body: BodyModel) -> TrueMotion:
    poses = np.array([true_poses(body, frame) for frame in range(FRAMES)])
    stamps_ns = np.array([(frame + 1) * STEP_NS for frame in range(FRAMES)], np.int64)
    parents = {joint.child: joint.parent for joint in body.joints}
    return TrueMotion(
        Path("walk"), stamps_ns, body.root, parents, dict(zip(body.segments, poses.swapaxes(0, 1), strict=True))
    )


@pytest.fixture(scope="module")
def registered(body: BodyModel) -> list[LandmarkMatches]:
    rng = np.random.default_rng(5)
    return [seen_by(body, camera, frame, rng) for frame in range(FRAMES) for camera in body.mounts]


@pytest.fixture(scope="module")
def compared(body: BodyModel, truth: TrueMotion, registered: list[LandmarkMatches]) -> SolverComparison:
    return compare_solvers(body, lenses(body), registered, PipelineSettings(), truth)


def test_the_whole_recording_is_as_good_as_the_full_batch(compared) -> None:
    for runs in (compared.as_recorded, compared.dark):
        offline, batch, window = (runs[way].errors for way in (Way.OFFLINE, Way.BATCH, Way.WINDOW))
        for of in (lambda e: e.positions.mean(), lambda e: e.rotations.mean()):
            assert of(offline) < 1.05 * of(batch) and of(offline) < 1.005 * of(window)
        gaps = np.abs(runs[Way.OFFLINE].run.world_T_segment - runs[Way.BATCH].run.world_T_segment)
        assert gaps.max() < 5e-4


def test_what_came_after_tells_of_what_is_dark(compared) -> None:
    alone, window, offline = (compared.dark[way].errors for way in (Way.ALONE, Way.WINDOW, Way.OFFLINE))
    assert offline.rotations.mean() < 0.7 * min(window.rotations.mean(), alone.rotations.mean())
    assert offline.positions.mean() < 0.95 * window.positions.mean() < 0.9 * alone.positions.mean()
    assert all(len(one.run.stamps_ns) == FRAMES for one in compared.as_recorded.values())
    assert all((one.run.solve_ms > 0.0).all() for one in compared.dark.values())


def test_cameras_take_turns_in_the_dark(body, registered) -> None:
    dark = dark_in_turn(registered, each_s=0.5)
    assert [matches.stamp_ns for matches in dark] == [matches.stamp_ns for matches in registered]
    seen = np.array([matches.world_T_camera is not None for matches in dark]).reshape(FRAMES, -1)
    assert (seen.sum(axis=1) == len(body.mounts) - 1).all() and (~seen).any(axis=0).all()


def test_the_picture_is_drawn(compared, body, truth, tmp_path: Path) -> None:
    path = tmp_path / "solvers.png"
    draw_solvers(body, truth, compared, path)
    assert path.read_bytes().startswith(b"\x89PNG") and path.stat().st_size > 50_000


def test_the_truth_of_another_recording_is_refused(body, truth) -> None:
    later = TrueMotion(truth.path, truth.stamps_ns + 10**12, truth.root, truth.parents, truth.world_T_segment)
    registered = [
        seen_by(body, camera, frame, np.random.default_rng(0)) for frame in range(9) for camera in body.mounts
    ]
    with pytest.raises(RecordingError, match="walk is the truth of another recording"):
        compare_solvers(body, lenses(body), registered, PipelineSettings(), later)


def test_a_truth_that_shares_no_joint_with_the_body_is_refused(body, truth, compared) -> None:
    apart = [s for s in body.segments if s != body.root and body.joint_to_parent(s).parent != body.root][0]
    alone = {segment: truth.world_T_segment[segment] for segment in (body.root, apart)}
    run = compared.as_recorded[Way.ALONE].run
    with pytest.raises(RecordingError, match="walk: no joint of body .* has both of its segments in this truth"):
        solver_errors(run, body, TrueMotion(truth.path, truth.stamps_ns, truth.root, truth.parents, alone))


def test_offline_is_what_replay_solves_with_the_same_settings_of_feet() -> None:
    walker = standing_leg.leg()
    rng = np.random.default_rng(5)
    frames = [standing_leg.frame_of(walker, frame, rng, ("shin", "foot"), 0.0) for frame in range(standing_leg.FRAMES)]
    registered = [matches for frame in frames for matches in frame.matches.values()]
    of = PipelineSettings()
    of = replace(of, smoother=replace(of.smoother, output_delay=OFFLINE), contact=ContactSettings(enabled=False))
    pipeline = SkeletonPipeline(walker, lenses(walker), of)
    states = [output.state for matches in registered for output in pipeline.add(matches)]
    states += [output.state for output in pipeline.flush()]
    run = run_solver(Way.OFFLINE, walker, lenses(walker), body_frames(walker, lenses(walker), registered, of), of)
    np.testing.assert_array_equal(run.stamps_ns, [state.stamp_ns for state in states])
    np.testing.assert_allclose(run.world_T_segment, [state.world_T_segment for state in states], atol=1e-9)
