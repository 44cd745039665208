"""The window of iSAM2 against gtsam's batch solution of the same graph, with every kind of factor; and its failures."""

from dataclasses import replace
from typing import Any

import gtsam
import numpy as np
import pytest
from helpers.moving_body import COVARIANCE, STEP_NS, body_with_cameras, lenses, position_errors, seen_by, true_poses

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.body_state import BodyFrame, BodyState
from bodycam_ros.estimation import solved_state as solved_state_module
from bodycam_ros.estimation import state_solution, whole_recording
from bodycam_ros.estimation import window as window_module
from bodycam_ros.estimation.coordinates import Chart, Coordinates
from bodycam_ros.estimation.estimator import BodyEstimator
from bodycam_ros.estimation.estimator_settings import EstimatorSettings
from bodycam_ros.estimation.factors.camera_poses import SegmentPoses
from bodycam_ros.estimation.factors.factor import on_state, on_step, state_key
from bodycam_ros.estimation.factors.inertial_step import InertialStep
from bodycam_ros.estimation.factors.joint_rotations import SLIDES_M, JointRotations
from bodycam_ros.estimation.factors.motion import MotionModel
from bodycam_ros.estimation.factors.resting_point import RestingPoint
from bodycam_ros.estimation.factors.segment_steps import SegmentSteps
from bodycam_ros.estimation.factors.segment_turn import SegmentTurn
from bodycam_ros.estimation.motion_settings import MotionSettings
from bodycam_ros.estimation.solved_state import Measurements
from bodycam_ros.estimation.state_factors import StateFactors
from bodycam_ros.estimation.state_link import Initial, StateLink
from bodycam_ros.estimation.window import Window, WindowError
from bodycam_ros.geometry import exp_se3, exp_so3
from bodycam_ros.kinematics.joint import Joint
from bodycam_ros.kinematics.tangent import TreeTangent

STATES, DT_S = 12, 1e-9 * STEP_NS
JOINTS = ("elbow", "shoulder")


def tethered_body() -> BodyModel:
    """The small body, its forearm tied to its trunk by a joint that closes a loop and gives by decimetres."""
    body = body_with_cameras()
    place = np.eye(4)
    place[:3, 3] = [0.2, 0.2, 0.0]
    tether = Joint("tether", "trunk", "forearm", "ball", place, sigmas=(10.0, 10.0, 10.0, 0.3, 0.3, 0.3))
    return replace(body, joints=(*body.joints, tether))


class Graph:
    """States with noisy charts, and all factors between them."""

    def __init__(self) -> None:
        rng, body = np.random.default_rng(3), tethered_body()
        self.body, self.tangent = body, TreeTangent(body, SLIDES_M)
        factors, model = StateFactors(self.tangent), MotionModel(self.tangent, MotionSettings())
        self.charts: list[Chart] = []
        self.factors: list[gtsam.NonlinearFactorGraph] = []
        for number in range(STATES):
            poses, graph = true_poses(body, number), gtsam.NonlinearFactorGraph()
            true = Coordinates(self.tangent, body.motion_of(poses), np.zeros(self.tangent.count))
            chart = Chart(true.moved(rng.normal(scale=0.003, size=self.tangent.count)))
            # The forearm's camera is blind at times: its joint is expected, its rotation measured.
            rows = np.array([0, 0, 1] if number % 4 == 1 else [0, 0, 1, 2])
            noise = rng.standard_normal((len(rows), 6)) * np.sqrt(np.diag(COVARIANCE))
            cameras = SegmentPoses(rows, poses[rows] @ exp_se3(noise), np.tile(COVARIANCE, (len(rows), 1, 1)))
            elbow = np.array([body.joint_row["elbow"]] if number % 4 == 1 else [], np.int64)
            expected = JointRotations(elbow, np.tile(np.eye(3), (len(elbow), 1, 1)), np.full((len(elbow), 3), 0.4))
            graph.add(on_state(state_key(number), chart, factors.of(Measurements(cameras, expected))))
            if number == 0:
                graph.add(Initial(chart.origin, model.first_sigmas).factor(state_key(0), chart))
            else:
                keys, charts = (state_key(number - 1), state_key(number)), (self.charts[-1], chart)
                graph.add(model.between(charts[0].origin, DT_S).factor(keys, charts))
                before = true_poses(body, number - 1)
                turned = before[2, :3, :3].T @ poses[2, :3, :3] @ exp_so3(rng.normal(scale=0.003, size=3))
                spins = np.zeros((2, 3))
                gravity = before[0, :3, :3].T @ np.array([0.0, 0.0, 9.81]) * DT_S
                steps = [
                    SegmentTurn(2, turned, 0.01),
                    RestingPoint(1, np.array([0.0, 0.0, -0.1]), 0.05),
                    InertialStep(
                        0, np.array([0.1, 0.0, 0.2]), DT_S, gravity, 0.5 * DT_S * gravity, *spins, 1.0, 0.05, True
                    ),
                ]
                graph.add(on_step(keys, charts, SegmentSteps(steps)))
            self.charts.append(chart)
            self.factors.append(graph)

    def window(self, length: int) -> tuple[Window, list[Coordinates]]:
        """A window after all states, and each state as it was when it left."""
        window, left = Window(self.tangent.count), list[Coordinates]()
        for number, (chart, graph) in enumerate(zip(self.charts, self.factors, strict=True)):
            window.add(number, chart, graph, max(0, number - length + 1))
            left += [window.at(each) for each in [number - length + 1] if each >= 0]
        return window, left

    def batch(self) -> tuple[list[Coordinates], gtsam.Marginals]:
        """Levenberg-Marquardt over all states, and its marginals."""
        graph, values = gtsam.NonlinearFactorGraph(), gtsam.Values()
        for number, (chart, factors) in enumerate(zip(self.charts, self.factors, strict=True)):
            graph.push_back(factors)
            values.insert(state_key(number), np.zeros(2 * chart.size))
        parameters = gtsam.LevenbergMarquardtParams()
        parameters.setRelativeErrorTol(1e-12)
        found = gtsam.LevenbergMarquardtOptimizer(graph, values, parameters).optimize()
        at = [chart.at(found.atVector(state_key(number))) for number, chart in enumerate(self.charts)]
        return at, gtsam.Marginals(graph, found)


@pytest.fixture(scope="module")
def graph() -> Graph:
    return Graph()


@pytest.mark.parametrize(("threshold", "apart", "share"), [(0.05, 1.5e-3, 0.2), (1e-7, 1e-5, 1e-3)])
def test_an_unlimited_window_is_the_batch_solution(
    graph: Graph, monkeypatch: pytest.MonkeyPatch, threshold: float, apart: float, share: float
) -> None:
    """Exactly where all is relinearised, and within the cameras' 2 mrad and 4 mm with the usual threshold.

    With that the weights of cameras stay those of the charts, by which variances differ.
    """
    monkeypatch.setattr(window_module, "_RELINEARISE", threshold)
    monkeypatch.setattr(window_module, "_ITERATIONS", 20 if threshold < 0.01 else 3)
    window, _ = graph.window(STATES)
    batch, marginals = graph.batch()
    for number, at in enumerate(batch):
        assert np.abs(window.at(number).step_to(at)).max() < apart
        assert np.abs(window.at(number).velocity - at.velocity).max() < 100.0 * apart
    root = window.square_root(STATES - 1)
    theirs = marginals.marginalCovariance(state_key(STATES - 1))
    np.testing.assert_allclose(np.linalg.inv(root.T @ root), theirs, atol=2e-2 * np.abs(np.diag(theirs)).max())
    assert np.abs(np.diag(np.linalg.inv(root.T @ root)) / np.diag(theirs) - 1.0).max() < share


def test_a_window_keeps_what_left_it_in_its_marginal(graph: Graph) -> None:
    """The newest state is the same for any length; older ones left with fewer later measurements."""
    whole, _ = graph.window(STATES)
    for length in (1, 3, 6):
        window, left = graph.window(length)
        newest = STATES - 1
        assert [number in window for number in range(STATES)] == [number > newest - length for number in range(STATES)]
        assert np.abs(window.at(newest).step_to(whole.at(newest))).max() < 1e-3
        root, unlimited = window.square_root(newest), whole.square_root(newest)
        np.testing.assert_allclose(np.diag(root), np.diag(unlimited), rtol=0.02)
        assert len(left) == STATES - length + 1


def states_of(frames: list[BodyFrame], body: BodyModel, **settings: int | str) -> tuple[list[BodyState], BodyEstimator]:
    estimator = BodyEstimator(body, lenses(body), EstimatorSettings(**settings))
    states = [state for frame in frames for state in estimator.update(frame)]
    return states + estimator.flush(), estimator


def seen_frames(body: BodyModel, count: int, wrong_share: float = 0.0, seed: int = 12) -> list[BodyFrame]:
    rng = np.random.default_rng(seed)
    frames = []
    for number in range(count):
        wrong = {camera: rng.random() < wrong_share for camera in body.mounts}
        matches = {camera: seen_by(body, camera, number, rng, wrong=wrong[camera]) for camera in body.mounts}
        frames.append(BodyFrame((number + 1) * STEP_NS, matches))
    return frames


@pytest.mark.parametrize("delay", [0, 4])
def test_where_gtsam_fails_a_new_window_goes_on(monkeypatch: pytest.MonkeyPatch, delay: int) -> None:
    body = body_with_cameras()
    add = Window.add
    failed = list[int]()

    def failing(self: Window, number: int, *others: object) -> None:
        if number == 20 and not failed:
            failed.append(number)
            raise WindowError("Indeterminate linear system")
        add(self, number, *others)  # type: ignore[arg-type]

    monkeypatch.setattr(Window, "add", failing)
    states, estimator = states_of(seen_frames(body, 40), body, output_delay=delay)
    assert estimator.counts.restarted == 1 and "restarted" in estimator.counts.remarks()[0]
    by_frame = {state.stamp_ns // STEP_NS - 1: state for state in states}
    assert list(by_frame) == list(range(40))
    assert position_errors(body, by_frame).max() < 0.012


@pytest.mark.parametrize("number", [20, 45, 70])
def test_where_the_second_pass_fails_a_whole_recording_is_still_solved(
    monkeypatch: pytest.MonkeyPatch, number: int
) -> None:
    """In a block, in what follows it, and in the last block; an error of gtsam ended the recording before."""
    monkeypatch.setattr(solved_state_module, "_BLOCK_S", 1.3)
    monkeypatch.setattr(solved_state_module, "_OVERLAP_S", 0.5)
    failed = list[int]()

    class Failing(Window):
        def add(self, at: int, *others: Any) -> None:
            super().add(at, *others)
            if at == number and not failed:
                failed.append(at)
                raise WindowError("Indeterminate linear system")

    monkeypatch.setattr(whole_recording, "Window", Failing)
    body = body_with_cameras()
    states, estimator = states_of(seen_frames(body, 80), body, output_delay="offline")
    assert failed and estimator.counts.restarted == 1
    by_frame = {state.stamp_ns // STEP_NS - 1: state for state in states}
    assert list(by_frame) == list(range(80))
    assert position_errors(body, by_frame).max() < 0.012


def test_what_begins_anew_has_no_past_and_keeps_its_first_sigmas() -> None:
    """A rotation measured since before held a limb where it had been; a second restart took all sigmas of the first."""
    body = body_with_cameras()
    _, estimator = states_of(seen_frames(body, 10), body, output_delay=4)
    tangent, before = estimator._tangent, estimator._states[-1]
    motion = estimator._motion.between(estimator._window.at(before.number), DT_S)
    elbow, shoulder = np.eye(2, dtype=bool)[[body.joint_row[joint] for joint in JOINTS]]
    step = SegmentTurn(body.segment_index["forearm"], np.eye(3), 0.001)
    link = StateLink.after(estimator._window, before, motion, (step,))
    elsewhere = link.prediction.at.moved(np.where(tangent.columns_of(elbow), 0.8, 0.0))
    anew = estimator._restarted(link, elsewhere, tangent.columns_of(elbow))
    assert np.abs(anew.prediction.at.step_to(elsewhere)[tangent.columns_of(elbow)]).max() < 1e-6
    both = estimator._restarted(anew, anew.prediction.at, tangent.columns_of(shoulder))
    sigmas = np.sqrt(np.diag(np.linalg.inv(both.prediction.information)))
    np.testing.assert_allclose(sigmas[6:], 1.0, rtol=1e-6)
    assert sigmas[:6].max() < 0.05


def test_every_error_of_gtsam_is_one_of_the_window(graph: Graph) -> None:
    window, _ = graph.window(2)
    with pytest.raises(WindowError):
        window.square_root(0)


def test_a_third_of_wrong_registrations_makes_no_wrong_state() -> None:
    """Before it was judged by a moment's prediction a second wrong registration of a limb was accepted."""
    body = body_with_cameras()
    for seed in (12, 15):
        states, estimator = states_of(seen_frames(body, 90, 0.3, seed), body, output_delay=0)
        by_frame = {state.stamp_ns // STEP_NS - 1: state for state in states}
        assert len(states) + estimator.counts.contradictory == 90 and len(states) > 70
        assert position_errors(body, by_frame).max() < 0.05
        assert "contradict each other" in estimator.counts.remarks()[0]


def test_a_state_that_did_not_converge_is_counted_and_uncertain(monkeypatch: pytest.MonkeyPatch) -> None:
    body = body_with_cameras()
    frames = seen_frames(body, 30)
    good, _ = states_of(frames, body, output_delay=0)
    monkeypatch.setattr(state_solution, "STEPS", 0)
    states, estimator = states_of(frames, body, output_delay=0)
    assert estimator.counts.unconverged == len(states) == 30
    assert not any(state.converged for state in states) and all(state.converged for state in good)
    wide = np.array([np.trace(state.uncertainty.root[3:, 3:]) for state in states])
    narrow = np.array([np.trace(state.uncertainty.root[3:, 3:]) for state in good])
    assert (wide - narrow > 0.029).all()
    assert "did not converge" in estimator.counts.remarks()[0]
