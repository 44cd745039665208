"""The body of the solver's latest instant, through a message and back."""

import numpy as np
import pytest
from static_cameras.dressed_body import small_motion

from bodycam_ros.body.body_file import read_body
from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.body_state import LatestState
from bodycam_ros.messages.factory import Message
from bodycam_ros.messages.segment_poses import latest_state, latest_state_message
from bodycam_ros.recording.typestore import recorded_messages

STAMP_NS = 1_234_567_890


@pytest.fixture(scope="module")
def body(sample) -> BodyModel:
    return read_body(sample / "body.yaml")


@pytest.fixture
def now(body: BodyModel) -> LatestState:
    count = len(body.segments)
    covariances = np.arange(1, count + 1)[:, None, None] * np.diag([1e-4] * 3 + [1e-5] * 3)
    return LatestState(STAMP_NS, small_motion(body, 1)[0], covariances, np.arange(count) % 3 > 0)


@pytest.fixture
def message(body: BodyModel, now: LatestState) -> Message:
    return latest_state_message(recorded_messages(), now, body)


def test_a_body_comes_back_as_it_was(body: BodyModel, now: LatestState, message: Message) -> None:
    heard = latest_state(message, body)
    assert heard.stamp_ns == STAMP_NS
    np.testing.assert_allclose(heard.world_T_segment, now.world_T_segment, atol=1e-9)
    np.testing.assert_array_equal(heard.covariances, now.covariances)
    np.testing.assert_array_equal(heard.observed, now.observed)


def test_another_body_is_refused(body: BodyModel, message: Message) -> None:
    message.segments[3] = "tail"
    with pytest.raises(ValueError, match="tail.*pelvis"):
        latest_state(message, body)
