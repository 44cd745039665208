"""Static cameras that measure segments exactly, beside body cameras and alone, in the solver and by themselves."""

from collections.abc import Collection
from dataclasses import dataclass, field

import numpy as np
import pytest
from helpers.moving_body import STEP_NS, body_with_cameras, lenses, position_errors, seen_by, true_poses

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.body_state import BodyFrame, BodyState, SegmentPose
from bodycam_ros.camera.camera_image import CameraImage
from bodycam_ros.estimation.estimator import BodyEstimator
from bodycam_ros.estimation.estimator_settings import OFFLINE, EstimatorSettings
from bodycam_ros.estimation.static_evidence import StaticMeasurement
from bodycam_ros.geometry import Array, exp_so3, log_so3

FRAMES = 40
SURE = np.diag(np.repeat([0.003, 0.003], 3) ** 2)
DELAYED = EstimatorSettings()
ARM = ("upper_arm", "forearm")


@dataclass
class ExactCameras:
    """Knows where some segments are.

    Attributes:
        body: the small one that moves.
        sees: segments that the one camera, ``door``, sees.
        places: segments that somebody placed by hand in the first image.
        spun_rad: how far evidence is turned about the z axis of what it sees, which it says it does not know.
        asked: for each image what was expected, the seconds before it, and the segments that body cameras know.
    """

    body: BodyModel
    sees: tuple[str, ...]
    places: tuple[str, ...] = ()
    spun_rad: float = 0.0
    asked: list[tuple[Array, float, set[str]]] = field(default_factory=list)

    def place(self, frame: BodyFrame) -> list[SegmentPose]:
        return self._poses(self.places, true_poses(self.body, number_of(frame)), SURE)

    def measure(
        self, frame: BodyFrame, expected: Array, dt_s: float, known: Collection[SegmentPose]
    ) -> StaticMeasurement:
        self.asked.append((expected.copy(), dt_s, {each.segment for each in known}))
        poses = true_poses(self.body, number_of(frame))
        spun, covariance = poses.copy(), SURE.copy()
        if self.spun_rad:
            spun[:, :3, :3] @= exp_so3(np.array([0.0, 0.0, self.spun_rad]))
            covariance[2, 2] = 1.0
        said = self._poses(self.sees, spun, covariance)
        return StaticMeasurement({"door": said}, poses, {"door": np.ones(len(poses))})

    def _poses(self, segments: Collection[str], poses: Array, covariance: Array) -> list[SegmentPose]:
        return [SegmentPose(segment, poses[self.body.segment_index[segment]], covariance) for segment in segments]


def number_of(frame: BodyFrame) -> int:
    return frame.images["door"].stamp_ns // STEP_NS - 1


@pytest.fixture(scope="module")
def body() -> BodyModel:
    return body_with_cameras()


def frame_at(
    body: BodyModel, number: int, body_cameras: Collection[str], looks: bool, rng: np.random.Generator
) -> BodyFrame:
    stamp_ns = (number + 1) * STEP_NS
    matches = {camera: seen_by(body, camera, number, rng) for camera in body_cameras}
    return BodyFrame(stamp_ns, matches, {"door": CameraImage("door", stamp_ns, b"")} if looks else {})


def solved(
    body: BodyModel,
    body_cameras: Collection[str],
    static_cameras: ExactCameras | None,
    looks: bool = True,
    settings: EstimatorSettings = DELAYED,
) -> dict[int, BodyState]:
    """States by frame number."""
    rng, estimator = (
        np.random.default_rng(0),
        BodyEstimator(body, lenses(body), settings, static_cameras=static_cameras),
    )
    states: list[BodyState] = []
    for number in range(FRAMES):
        states += estimator.update(frame_at(body, number, body_cameras, looks, rng))
    return {state.stamp_ns // STEP_NS - 1: state for state in states + estimator.flush()}


def test_limbs_without_a_worn_camera_come_out_where_static_ones_have_them(body: BodyModel) -> None:
    trunk = ("chest", "back")
    without, static_cameras = solved(body, trunk, None), ExactCameras(body, ARM)
    states = solved(body, trunk, static_cameras)
    assert list(states) == list(range(FRAMES))
    errors, lost = position_errors(body, states), position_errors(body, without)
    assert errors[:, 1:].max() < 0.015
    assert lost[10:, 2].mean() > 0.05  # a forearm that nobody sees
    rotation = np.array([state.world_T_segment[2, :3, :3] for state in states.values()])
    truth = np.array([true_poses(body, number)[2, :3, :3] for number in states])
    assert np.arccos(np.clip(0.5 * (np.einsum("nij,nij->n", rotation, truth) - 1.0), -1.0, 1.0)).max() < 0.02
    assert all(state.cameras_used == 3 and state.observed.all() for state in states.values())


@pytest.mark.parametrize(
    ("settings", "most_deg"),
    [(DELAYED, 6.0), (EstimatorSettings(output_delay=OFFLINE), 2.0)],
    ids=["delayed", "offline"],
)
def test_joints_tell_what_no_contour_does(body: BodyModel, settings: EstimatorSettings, most_deg: float) -> None:
    """How a limb is turned about its long axis, also where the recording is solved as a whole."""
    states = solved(body, ("chest", "back"), ExactCameras(body, ("upper_arm",), spun_rad=0.5), settings=settings)
    of = body.segment_index["upper_arm"]
    solved_R = np.array([state.world_T_segment[of, :3, :3] for state in states.values()])
    true_R = np.array([true_poses(body, number)[of, :3, :3] for number in states])
    turned = log_so3(np.swapaxes(true_R, -1, -2) @ solved_R)
    assert len(states) == FRAMES and np.degrees(np.linalg.norm(turned, axis=1)).max() < most_deg


def test_static_cameras_alone_follow_a_body_that_was_placed_by_hand(body: BodyModel) -> None:
    static_cameras = ExactCameras(body, body.segments, places=("trunk",))
    states = solved(body, (), static_cameras)
    assert list(states) == list(range(FRAMES))
    # Colours that were estimated from one image are poor: what was placed stays known for a tenth of a second.
    latest = [number for number, (_, _, known) in enumerate(static_cameras.asked) if known == {"trunk"}]
    assert latest == list(range(len(latest))) and 0.08 < latest[-1] * STEP_NS * 1e-9 < 0.101
    assert position_errors(body, states).max() < 0.01
    assert all(state.cameras_used == 1 for state in states.values())


def test_without_a_start_static_cameras_alone_say_nothing(body: BodyModel) -> None:
    static_cameras = ExactCameras(body, body.segments)
    assert solved(body, (), static_cameras) == {} and not static_cameras.asked


def test_without_images_the_states_are_those_without_static_cameras(body: BodyModel) -> None:
    """To the last bit: who has no static cameras gets what they got before there were any."""
    body_cameras, static_cameras = ("chest", "arm"), ExactCameras(body, ARM, places=ARM)
    before, states = solved(body, body_cameras, None), solved(body, body_cameras, static_cameras, looks=False)
    assert not static_cameras.asked and list(states) == list(before)
    for number, state in states.items():
        np.testing.assert_array_equal(state.world_T_segment, before[number].world_T_segment)
        np.testing.assert_array_equal(state.observed, before[number].observed)
        assert state.cameras_used == before[number].cameras_used == 2
