"""A registrar whose camera is doubted searches anew, and does not fall for the same place again at once."""

from dataclasses import replace

import numpy as np
import pytest

from bodycam_ros.geometry import exp_se3
from bodycam_ros.registration.doubted_place import DoubtedPlace, DoubtSettings

SETTINGS = DoubtSettings()
FRAME_NS = 33_333_333
DOUBTED = DoubtedPlace(FRAME_NS, np.eye(4), 40, SETTINGS)


def moved(metres: float, radians: float = 0.0) -> np.ndarray:
    return exp_se3(np.array([radians, 0.0, 0.0, metres, 0.0, 0.0]))


@pytest.mark.parametrize(
    "after_s, pose, landmarks, refused",
    [
        (0.03, moved(0.05), 40, True),
        (0.03, moved(0.05), 59, True),
        (0.03, moved(0.05), 60, False),
        (0.03, moved(1.0), 40, False),
        (0.03, moved(0.0, 1.0), 40, False),
        (0.5, moved(1.0, 1.0), 40, True),
        (1.1, moved(0.0), 40, False),
    ],
)
def test_what_is_refused(after_s: float, pose: np.ndarray, landmarks: int, refused: bool) -> None:
    assert DOUBTED.refuses(FRAME_NS + round(1e9 * after_s), pose, landmarks) == refused


def test_without_time_nothing_is_refused() -> None:
    short = replace(DOUBTED, settings=DoubtSettings(lasting=0.0))
    assert not short.refuses(FRAME_NS, np.eye(4), 1)
