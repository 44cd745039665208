"""Which frames are taken, from what is known of all of them."""

import numpy as np
import pytest

from bodycam_ros.errors import MapError
from bodycam_ros.mapping.frame_choice import FrameChoiceSettings, choose_frames
from bodycam_ros.mapping.frame_motion import FrameMotion

RATE_HZ = 30.0
SETTINGS = FrameChoiceSettings()


def motion(path_deg: np.ndarray, sharpness: np.ndarray | None = None) -> FrameMotion:
    seconds = np.arange(len(path_deg)) / RATE_HZ
    return FrameMotion(
        seconds, np.full(len(path_deg), 5.0) if sharpness is None else sharpness, path_deg, np.zeros((len(path_deg), 3))
    )


def test_they_are_spread_over_the_change_of_view_not_over_time() -> None:
    """A camera that stands still for most of the time, and moves at its own pace in between."""
    path_deg = np.concatenate([np.zeros(600), np.linspace(0.0, 500.0, 300), np.full(900, 500.0)])
    rows = choose_frames(motion(path_deg), "walk.mp4", SETTINGS)
    steps = np.diff(path_deg[rows])
    assert len(rows) == 60
    assert steps.min() > 2.0 and steps.max() < 15.0


def test_sharp_ones_are_taken_and_blurred_ones_are_not() -> None:
    rng = np.random.default_rng(1)
    sharpness = np.where(np.arange(2000) % 7 == 3, 5.0, 3.5) + rng.normal(0.0, 0.05, 2000)
    sharpness[500:540] = 0.5
    path_deg = np.linspace(0.0, 1000.0, 2000)
    rows = choose_frames(motion(path_deg, sharpness), "walk.mp4", SETTINGS)
    assert np.mean(rows % 7 == 3) > 0.9
    assert not np.any((rows >= 500) & (rows < 540))
    assert np.diff(path_deg[rows]).max() < 35.0


def test_what_stands_still_makes_no_map() -> None:
    with pytest.raises(MapError, match=r"walk\.mp4: the view changes by 0 deg .* 1 photographs"):
        choose_frames(motion(np.zeros(900)), "walk.mp4", SETTINGS)
