"""Who is believed where cameras contradict each other, or the body."""

import numpy as np
import pytest

from bodycam_ros.body.body_model import BodyModel, CameraMount
from bodycam_ros.body.joint import Joint
from bodycam_ros.geometry import exp_se3, rigid
from bodycam_ros.solving.camera_evidence import SegmentPose
from bodycam_ros.solving.camera_trust import CameraTrust, TrustSettings
from bodycam_ros.solving.motion import MotionSettings

FRAME_NS = 33_333_333
SEGMENTS = ("trunk", "upper_arm", "forearm")
CAMERAS = {"front": "trunk", "left": "trunk", "right": "trunk", "arm": "upper_arm", "wrist": "forearm"}
COVARIANCE = np.diag(np.repeat([0.002, 0.004], 3) ** 2)


@pytest.fixture
def body() -> BodyModel:
    joints = (
        Joint("shoulder", "trunk", "upper_arm", "ball", rigid(np.eye(3), np.array([0.0, 0.2, 0.4]))),
        Joint("elbow", "upper_arm", "forearm", "ball", rigid(np.eye(3), np.array([0.0, 0.0, -0.3]))),
    )
    mounts = {camera: CameraMount(segment, np.eye(4)) for camera, segment in CAMERAS.items()}
    return BodyModel("test", "trunk", SEGMENTS, joints, mounts)


@pytest.fixture
def poses(body) -> np.ndarray:
    return body.forward_kinematics(np.eye(4), np.stack([np.eye(3)] * 2))


def trust(body: BodyModel) -> CameraTrust:
    return CameraTrust(body, 4.0, TrustSettings(), MotionSettings())


def seen(poses: np.ndarray, wrong: dict[str, list[float]], cameras: tuple[str, ...] = tuple(CAMERAS)) -> dict:
    """Registrations of cameras, some of them off by a tangent."""
    return {
        camera: SegmentPose(
            CAMERAS[camera],
            poses[SEGMENTS.index(CAMERAS[camera])] @ exp_se3(np.array(wrong.get(camera, [0.0] * 6))),
            COVARIANCE,
        )
        for camera in cameras
    }


@pytest.mark.parametrize("camera", CAMERAS)
@pytest.mark.parametrize("offset", [[0.0, 0.0, 0.0, 0.4, 0.0, 0.0], [0.0, 0.0, 0.0, 0.0, -0.15, 0.0]])
def test_whoever_is_contradicted_by_all_others_is_refused(body, poses, camera: str, offset: list[float]) -> None:
    judge = trust(body)
    for frame in range(1, 40):
        outcome = judge.judge(seen(poses, {camera: offset}), poses, frame * FRAME_NS)
        assert outcome.refused == {camera} and set(outcome.evidence) == set(CAMERAS) - {camera}
    assert not outcome.seats


def test_a_turn_is_seen_by_the_cameras_of_the_same_segment(body, poses) -> None:
    assert trust(body).judge(seen(poses, {"left": [0.0, 0.0, 0.5, 0.0, 0.0, 0.0]}), poses, 1).refused == {"left"}


def test_two_wrong_ones_do_not_win_against_three(body, poses) -> None:
    wrong = {"left": [0.0, 0.0, 0.0, 0.4, 0.0, 0.0], "wrist": [0.0, 0.0, 0.0, 0.0, 0.5, 0.0]}
    assert trust(body).judge(seen(poses, wrong), poses, 1).refused == {"left", "wrist"}


def test_of_two_alone_the_one_goes_that_surprises(body, poses) -> None:
    cameras = ("arm", "wrist")
    judge = trust(body)
    judge.judge(seen(poses, {}, cameras), poses, FRAME_NS)
    wrong = {"wrist": [0.0, 0.0, 0.0, 0.0, 0.5, 0.0]}
    assert judge.judge(seen(poses, wrong, cameras), poses, 2 * FRAME_NS).refused == {"wrist"}


def test_a_lone_camera_that_insists_is_believed_and_its_segment_starts_there(body, poses) -> None:
    judge = trust(body)
    for frame in range(1, 4):
        judge.judge(seen(poses, {}, ("wrist",)), poses, frame * FRAME_NS)
    jumped = seen(poses, {"wrist": [0.0, 0.0, 0.0, 2.0, 0.0, 0.0]}, ("wrist",))
    outcomes = [judge.judge(jumped, poses, (4 + frame) * FRAME_NS) for frame in range(4)]
    assert [outcome.refused for outcome in outcomes] == [{"wrist"}] * TrustSettings().max_refusals + [frozenset()]
    assert np.allclose(outcomes[-1].seats[2], jumped["wrist"].world_T_segment)


def test_after_a_while_unseen_a_limb_may_be_anywhere(body, poses) -> None:
    judge = trust(body)
    judge.judge(seen(poses, {}, ("wrist",)), poses, FRAME_NS)
    jumped = seen(poses, {"wrist": [0.8, 0.0, 0.0, 0.3, 0.0, 0.0]}, ("wrist",))
    assert not judge.judge(jumped, poses, FRAME_NS + 500_000_000).refused


def test_neighbours_that_agree_are_believed_against_the_prediction(body, poses) -> None:
    judge = trust(body)
    judge.judge(seen(poses, {}), poses, FRAME_NS)
    moved = exp_se3(np.array([0.0, 0.0, 0.6, 0.5, 0.0, 0.0])) @ poses
    outcome = judge.judge(seen(moved, {}), poses, 2 * FRAME_NS)
    assert not outcome.refused and set(outcome.seats) == {0, 1, 2}
