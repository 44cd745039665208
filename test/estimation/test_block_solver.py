"""Many instants at once: against gtsam's own optimiser, from far off, and where nothing tells of a pose."""

import gtsam
import numpy as np
import pytest
from bodycam_ros.estimation.back_end import BackEndError
from bodycam_ros.estimation.block_solver import Block, solve_block
from bodycam_ros.estimation.body_factors import BodyFactors
from bodycam_ros.estimation.expected_joints import ExpectedJoints
from bodycam_ros.estimation.smooth_motion import MotionLimits, SmoothMotion
from full_batch import levenberg_marquardt
from moving_body import STEP_NS, body_with_cameras, true_poses

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.estimation.camera_evidence import SegmentPose
from bodycam_ros.estimation.motion_model import MotionSettings
from bodycam_ros.geometry import exp_se3

FRAMES = 30
NOTHING = ExpectedJoints(np.zeros(0, int), np.zeros((0, 3, 3)), np.zeros((0, 3)), np.zeros((0, 3, 3)), np.zeros(0))


@pytest.fixture(scope="module")
def body() -> BodyModel:
    return body_with_cameras()


@pytest.fixture(scope="module")
def truth(body: BodyModel) -> np.ndarray:
    return np.array([true_poses(body, frame) for frame in range(FRAMES)])


def block(body: BodyModel, truth: np.ndarray, seen: tuple[str, ...]) -> Block:
    """Some segments are seen at every instant, with noise; nobody says where it begins."""
    rng, covariance = np.random.default_rng(1), np.diag(np.repeat([0.002, 0.004], 3) ** 2)
    factors = BodyFactors(body, 4.0)
    fixed = gtsam.NonlinearFactorGraph()
    for frame, poses in enumerate(truth):
        evidence = [
            SegmentPose(
                s, poses[body.segment_index[s]] @ exp_se3(np.diag(covariance) ** 0.5 * rng.normal(size=6)), covariance
            )
            for s in seen
        ]
        fixed.push_back(factors.cameras(frame, evidence))

    def joints(around: np.ndarray) -> gtsam.NonlinearFactorGraph:
        graph = gtsam.NonlinearFactorGraph()
        for frame, poses in enumerate(around):
            graph.push_back(factors.joints(frame, poses, NOTHING))
        return graph

    motion = MotionLimits.of(MotionSettings(), len(body.segments))
    return Block(0, fixed, joints, SmoothMotion(motion, STEP_NS * np.arange(FRAMES, dtype=np.int64)))


@pytest.mark.parametrize("off", [0.01, 0.3])
def test_finds_what_levenberg_marquardt_finds(body, truth, off: float) -> None:
    known = block(body, truth, body.segments)
    start = truth @ exp_se3(off * np.random.default_rng(2).normal(size=(*truth.shape[:2], 6)))
    ours, theirs = solve_block(known, start, 15), levenberg_marquardt(known, start, 15)
    assert np.abs(ours - theirs).max() < 2e-4
    assert np.linalg.norm((ours - truth)[..., :3, 3], axis=-1).mean() < 0.004


def test_a_limb_that_nothing_tells_of_is_no_failure(body, truth) -> None:
    """A ball joint without a camera beyond it may point anywhere; what is seen is where it is."""
    known = block(body, truth, ("trunk",))
    poses = solve_block(known, truth @ exp_se3(np.full(6, 0.05)), 15)
    assert np.isfinite(poses).all()
    assert np.linalg.norm((poses - truth)[:, 0, :3, 3], axis=-1).mean() < 0.006


def test_what_cannot_be_solved_says_so(body, truth) -> None:
    known = block(body, truth, body.segments)
    known.fixed.add(gtsam.PriorFactorPose3(10**6, gtsam.Pose3(), gtsam.noiseModel.Unit.Create(6)))
    with pytest.raises(BackEndError):
        solve_block(known, truth, 15)
