"""Static cameras that say exactly where segments are, beside worn ones and alone, in the solver and by themselves."""

from collections.abc import Collection
from dataclasses import dataclass, field

import numpy as np
import pytest
from moving_body import STEP_NS, body_with_cameras, lenses, position_errors, seen_by, true_poses

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.camera.camera_image import CameraImage
from bodycam_ros.geometry import Array, exp_so3, log_so3
from bodycam_ros.solving.body_frame import BodyFrame
from bodycam_ros.solving.body_smoother import BodySmoother
from bodycam_ros.solving.body_state import BodyState
from bodycam_ros.solving.camera_evidence import SegmentPose
from bodycam_ros.solving.expected_joints import ExpectedJoints
from bodycam_ros.solving.looking_on import LookingOn
from bodycam_ros.solving.seen_body import SeenBody
from bodycam_ros.solving.smoother_settings import OFFLINE, SmootherSettings

FRAMES = 40
SURE = np.diag(np.repeat([0.003, 0.003], 3) ** 2)
DELAYED = SmootherSettings()
ARM = ("upper_arm", "forearm")


@dataclass
class ExactOnlookers:
    """Knows where some segments are.

    Attributes:
        body: the small one that moves.
        sees: segments that the one camera, ``door``, sees.
        places: segments that somebody placed by hand in the first image.
        spun_rad: how far evidence is turned about the z axis of what it sees, which it says it does not know.
        asked: for each image what was expected, the seconds before it, and the segments that worn cameras know.
    """

    body: BodyModel
    sees: tuple[str, ...]
    places: tuple[str, ...] = ()
    spun_rad: float = 0.0
    asked: list[tuple[Array, float, set[str]]] = field(default_factory=list)

    def begin(self, frame: BodyFrame) -> list[SegmentPose]:
        return self._poses(self.places, true_poses(self.body, number_of(frame)), SURE)

    def look(self, frame: BodyFrame, expected: Array, dt_s: float, known: Collection[SegmentPose]) -> SeenBody:
        self.asked.append((expected.copy(), dt_s, {each.segment for each in known}))
        poses = true_poses(self.body, number_of(frame))
        spun, covariance = poses.copy(), SURE.copy()
        if self.spun_rad:
            spun[:, :3, :3] @= exp_so3(np.array([0.0, 0.0, self.spun_rad]))
            covariance[2, 2] = 1.0
        said = self._poses(self.sees, spun, covariance)
        return SeenBody({"door": said}, said, poses, {"door": np.ones(len(poses))})

    def _poses(self, segments: Collection[str], poses: Array, covariance: Array) -> list[SegmentPose]:
        return [SegmentPose(segment, poses[self.body.segment_index[segment]], covariance) for segment in segments]


def number_of(frame: BodyFrame) -> int:
    return frame.images["door"].stamp_ns // STEP_NS - 1


@pytest.fixture(scope="module")
def body() -> BodyModel:
    return body_with_cameras()


def frame_at(body: BodyModel, number: int, worn: Collection[str], looks: bool, rng: np.random.Generator) -> BodyFrame:
    stamp_ns = (number + 1) * STEP_NS
    matches = {camera: seen_by(body, camera, number, rng) for camera in worn}
    return BodyFrame(stamp_ns, matches, {"door": CameraImage("door", stamp_ns, b"")} if looks else {})


def solved(
    body: BodyModel,
    worn: Collection[str],
    onlookers: ExactOnlookers | None,
    looks: bool = True,
    settings: SmootherSettings = DELAYED,
) -> dict[int, BodyState]:
    """States by frame number."""
    rng, smoother = np.random.default_rng(0), BodySmoother(body, lenses(body), settings, onlookers=onlookers)
    states: list[BodyState] = []
    for number in range(FRAMES):
        states += smoother.update(frame_at(body, number, worn, looks, rng))
    return {state.stamp_ns // STEP_NS - 1: state for state in states + smoother.flush()}


def test_limbs_without_a_worn_camera_come_out_where_static_ones_have_them(body: BodyModel) -> None:
    trunk = ("chest", "back")
    without, onlookers = solved(body, trunk, None), ExactOnlookers(body, ARM)
    states = solved(body, trunk, onlookers)
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
    [(DELAYED, 6.0), (SmootherSettings(output_delay=OFFLINE), 2.0)],
    ids=["delayed", "offline"],
)
def test_joints_tell_what_no_contour_does(body: BodyModel, settings: SmootherSettings, most_deg: float) -> None:
    """How a limb is turned about its long axis, also where the recording is solved as a whole."""
    states = solved(body, ("chest", "back"), ExactOnlookers(body, ("upper_arm",), spun_rad=0.5), settings=settings)
    of = body.segment_index["upper_arm"]
    solved_R = np.array([state.world_T_segment[of, :3, :3] for state in states.values()])
    true_R = np.array([true_poses(body, number)[of, :3, :3] for number in states])
    turned = log_so3(np.swapaxes(true_R, -1, -2) @ solved_R)
    assert len(states) == FRAMES and np.degrees(np.linalg.norm(turned, axis=1)).max() < most_deg


def test_images_are_asked_with_what_the_worn_cameras_know(body: BodyModel) -> None:
    onlookers = ExactOnlookers(body, ARM)
    solved(body, ("chest", "arm"), onlookers)
    assert len(onlookers.asked) == FRAMES
    assert [dt_s for _, dt_s, _ in onlookers.asked] == pytest.approx([0.0] + [1e-9 * STEP_NS] * (FRAMES - 1))
    assert all(known == {"trunk", "upper_arm"} for _, _, known in onlookers.asked)
    for number, (expected, _, _) in enumerate(onlookers.asked[2:], 2):  # once the velocity is known
        off = np.linalg.norm(expected[:, :3, 3] - true_poses(body, number)[:, :3, 3], axis=1)
        assert off.max() < 0.04, number


def test_images_between_those_of_worn_cameras_are_asked_with_what_these_have_just_said(body: BodyModel) -> None:
    """Nothing triggers both kinds together, so that each has instants of its own."""
    worn, onlookers, rng = ("chest", "back"), ExactOnlookers(body, ARM), np.random.default_rng(0)
    smoother = BodySmoother(body, lenses(body), onlookers=onlookers)
    for number in range(12):
        looks = number % 2 == 1 or number > 8  # at last worn cameras are blind
        smoother.update(frame_at(body, number, () if looks else worn, looks, rng))
    assert [known for _, _, known in onlookers.asked[:5]] == [{"trunk"}] * 5
    assert onlookers.asked[-1][2] == {"trunk"}, "a tenth of a second after they spoke"
    for number in range(12, 16):
        smoother.update(frame_at(body, number, (), True, rng))
    assert onlookers.asked[-1][2] == set(), "nobody knows it by now"


def test_static_cameras_alone_follow_a_body_that_was_placed_by_hand(body: BodyModel) -> None:
    states = solved(body, (), ExactOnlookers(body, body.segments, places=("trunk",)))
    assert list(states) == list(range(FRAMES))
    assert position_errors(body, states).max() < 0.01
    assert all(state.cameras_used == 1 for state in states.values())


def test_without_a_start_static_cameras_alone_say_nothing(body: BodyModel) -> None:
    onlookers = ExactOnlookers(body, body.segments)
    assert solved(body, (), onlookers) == {} and not onlookers.asked


def test_without_images_the_states_are_those_without_static_cameras(body: BodyModel) -> None:
    """To the last bit: who has no static cameras gets what they got before there were any."""
    worn, onlookers = ("chest", "arm"), ExactOnlookers(body, ARM, places=ARM)
    before, states = solved(body, worn, None), solved(body, worn, onlookers, looks=False)
    assert not onlookers.asked and list(states) == list(before)
    for number, state in states.items():
        np.testing.assert_array_equal(state.world_T_segment, before[number].world_T_segment)
        np.testing.assert_array_equal(state.observed, before[number].observed)
        assert state.cameras_used == before[number].cameras_used == 2


def test_what_an_image_shows_is_brought_from_its_time_to_the_instants(body: BodyModel) -> None:
    """Six milliseconds are one instant, in which a wrist makes a centimetre."""
    late_ns, wrist = 6_000_000, body.segment_index["forearm"]

    class LateOnlookers(ExactOnlookers):
        def look(self, frame: BodyFrame, expected: Array, dt_s: float, known: Collection[SegmentPose]) -> SeenBody:
            then = true_poses(self.body, frame.images["door"].stamp_ns / STEP_NS - 1)
            return SeenBody({"door": self._poses(ARM, then, SURE)}, [], then, {"door": np.ones(len(then))})

    looking_on = LookingOn(body, LateOnlookers(body, ARM))
    apart, brought = [], []
    for number in range(20):
        stamp_ns = (number + 1) * STEP_NS
        frame = BodyFrame(stamp_ns, {}, {"door": CameraImage("door", stamp_ns + late_ns, b"")})
        truth = true_poses(body, number)
        looking_on.look(frame, truth, 1e-9 * STEP_NS if number else 0.0, [])
        shown = true_poses(body, number + late_ns / STEP_NS)
        apart.append(np.linalg.norm((shown - truth)[wrist, :3, 3]))
        brought.append(np.linalg.norm((looking_on.evidence[1].world_T_segment - truth)[:3, 3]))
    assert max(apart) > 0.01
    assert max(brought[1:]) < 0.4 * max(apart)
    assert np.mean(brought[1:]) < 0.3 * np.mean(apart)


@pytest.fixture
def expected() -> ExpectedJoints:
    """Of the shoulder and the elbow."""
    turns = np.tile(np.eye(3), (2, 1, 1))
    return ExpectedJoints(np.arange(2), turns, np.full((2, 3), 0.7), turns, np.full(2, 0.5))


@pytest.mark.parametrize(
    ("sees", "worn", "told"),
    [
        (ARM, (), [False, True]),
        (("upper_arm",), ("trunk",), [True, False]),
        (("upper_arm", "forearm"), ("trunk",), [True, True]),
        (("forearm",), ("trunk",), [False, False]),
    ],
)
def test_joints_are_expected_where_static_cameras_have_both_ends(
    body: BodyModel, expected: ExpectedJoints, sees: tuple[str, ...], worn: tuple[str, ...], told: list[bool]
) -> None:
    looking = LookingOn(body, ExactOnlookers(body, sees))
    looking.look(frame_at(body, 7, (), True, np.random.default_rng(0)), true_poses(body, 0), 0.03, [])
    observed = np.isin(body.segments, worn)
    ours, truth = expected.told(looking.told(observed)), body.joint_rotations(true_poses(body, 7))
    for row, is_told in enumerate(told):
        np.testing.assert_allclose(ours.rotations[row], truth[row] if is_told else np.eye(3), atol=1e-12)
        assert (ours.sigmas[row] < 0.7).all() == is_told
    np.testing.assert_array_equal(ours.lead, expected.lead)
    where = looking.path(true_poses(body, 0), observed)
    np.testing.assert_array_equal(where[observed], true_poses(body, 0)[observed])
    np.testing.assert_array_equal(where[~observed], true_poses(body, 7)[~observed])


def test_who_sees_nothing_changes_nothing(body: BodyModel, expected: ExpectedJoints) -> None:
    frame, path = frame_at(body, 7, (), True, np.random.default_rng(0)), true_poses(body, 0)
    for onlookers in (None, ExactOnlookers(body, ())):
        looking = LookingOn(body, onlookers)
        looking.look(frame, path, 0.03, [])
        same = expected.told(looking.told(np.ones(3, bool)))
        np.testing.assert_array_equal(same.rotations, expected.rotations)
        np.testing.assert_array_equal(same.sigmas, expected.sigmas)
        assert looking.path(path, np.zeros(3, bool)) is path
        assert looking.evidence == [] and looking.speaking == 0 and not looking.rows.any()


def test_worn_cameras_speak_for_their_own_segments(body: BodyModel) -> None:
    looking = LookingOn(body, ExactOnlookers(body, body.segments))
    looking.look(frame_at(body, 7, (), True, np.random.default_rng(0)), true_poses(body, 0), 0.03, [])
    worn = {"chest": SegmentPose("trunk", np.eye(4), SURE)}
    together = looking.with_worn(worn)
    assert {camera: each.segment for camera, each in together.items()} == {
        "chest": "trunk",
        "outside upper_arm": "upper_arm",
        "outside forearm": "forearm",
    }
    assert together["chest"] is worn["chest"]
