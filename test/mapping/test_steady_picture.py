"""Rows that were read out while the camera turned, against the picture that it would have taken all at once."""

import numpy as np
import pytest
from helpers.turned_view import CAMERA, rolled_view, turned_view

from bodycam_ros.mapping.frame_choice import steady_picture
from bodycam_ros.tracking.angular_speed import angular_speed

READOUT_S = 0.02


@pytest.mark.parametrize("rate_deg", [(100.0, 0.0), (70.0, -60.0)])
@pytest.mark.parametrize("readout_s", [(0.0, READOUT_S), (0.0, -READOUT_S), (READOUT_S, 0.0), (-READOUT_S, 0.0)])
def test_a_picture_is_straightened(rate_deg: tuple[float, float], readout_s: tuple[float, float]) -> None:
    shown, wanted = rolled_view(0.0, 0.0, rate_deg, readout_s), turned_view(0.0)
    velocity = np.radians([rate_deg[1], rate_deg[0], 0.0])
    straight = steady_picture(shown, CAMERA, velocity, readout_s)
    inner = np.s_[30:-30, 30:-30]
    off = [np.abs(picture[inner].astype(int) - wanted[inner]).mean() for picture in (shown, straight)]
    assert off[1] < 0.2 * off[0]


@pytest.mark.parametrize("turned_deg", [(1.5, 0.0), (0.0, -2.0), (-3.0, 1.0)])
def test_the_turn_from_one_picture_to_the_next(turned_deg: tuple[float, float]) -> None:
    """To the right is about y, which points down; upwards is about x."""
    (found,) = angular_speed(CAMERA, [(2.0, turned_view(0.0)), (3.0, turned_view(*turned_deg))]).omega
    assert np.degrees(found) == pytest.approx([turned_deg[1], turned_deg[0], 0.0], abs=0.05)
