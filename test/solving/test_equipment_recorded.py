"""The way of a crank while nobody drives it: by the speeds before and after, and as many turns as fit best between."""

import numpy as np
import pytest

from bodycam_ros.geometry import Array
from bodycam_ros.solving.equipment_recorded import on_the_way

RATE_HZ = 30.0
SECONDS = np.arange(120) / RATE_HZ
TURN = 2.0 * np.pi


def lost(angles: Array, start_s: float, end_s: float) -> tuple[Array, Array]:
    """Angles as they come, within half a turn, of which a stretch is nonsense; and which are known."""
    driven = (SECONDS < start_s) | (SECONDS > end_s)
    seen = (angles + np.pi) % TURN - np.pi
    nonsense = np.random.default_rng(0).uniform(-np.pi, np.pi, len(angles))
    return np.unwrap(np.where(driven, seen, nonsense)), driven


@pytest.mark.parametrize("rpm", [-110.0, -60.0, 20.0, 60.0, 80.0, 110.0])
@pytest.mark.parametrize("gap_s", [0.1, 0.7, 1.5, 2.0])
def test_at_a_constant_speed_the_turns_are_as_many_as_it_made(rpm: float, gap_s: float) -> None:
    truth = 0.3 + rpm / 60.0 * TURN * SECONDS
    angles, driven = lost(truth, 1.0, 1.0 + gap_s)
    filled = on_the_way(angles, SECONDS, driven)
    np.testing.assert_allclose(filled - filled[0], truth - truth[0], atol=1e-9)


def test_a_crank_that_was_slowed_down_has_both_speeds_at_its_ends() -> None:
    """At a constant deceleration a cubic with the speeds at both ends is the truth."""
    truth = 9.0 * SECONDS - 1.2 * SECONDS**2
    angles, driven = lost(truth, 0.8, 2.4)
    filled = on_the_way(angles, SECONDS, driven)
    # The speeds at the ends are means over four steps beyond them.
    np.testing.assert_allclose(filled - filled[0], truth - truth[0], atol=0.1)
    assert np.diff(filled)[:90].min() > 0.0


def test_what_is_known_is_not_touched_but_for_whole_turns() -> None:
    truth = 8.0 * SECONDS + 0.4 * np.sin(3.0 * SECONDS)
    angles, driven = lost(truth, 1.2, 2.2)
    given = angles.copy()
    filled = on_the_way(angles, SECONDS, driven)
    np.testing.assert_array_equal(angles, given)
    whole = (filled - angles)[driven] / TURN
    np.testing.assert_allclose(whole, np.round(whole), atol=1e-12)
    np.testing.assert_allclose(np.diff(filled)[SECONDS[1:] < 1.2], np.diff(truth)[SECONDS[1:] < 1.2], atol=1e-12)


def test_two_stretches_are_both_on_the_way() -> None:
    truth = 8.0 * SECONDS
    driven = ~(((SECONDS > 0.5) & (SECONDS < 1.5)) | ((SECONDS > 2.0) & (SECONDS < 3.4)))
    filled = on_the_way(np.unwrap(np.where(driven, (truth + np.pi) % TURN - np.pi, 0.0)), SECONDS, driven)
    np.testing.assert_allclose(filled - filled[0], truth, atol=1e-9)


@pytest.mark.parametrize("gap_s", [0.3, 0.9, 1.3])
def test_an_instant_that_is_known_alone_goes_on_at_the_speed_of_the_others(gap_s: float) -> None:
    """A foot that touches its pedal once says where the crank is, and no speed."""
    truth = 8.0 * SECONDS
    touched = np.argmin(np.abs(SECONDS - 0.5 - gap_s))
    driven = (SECONDS < 0.5) | (SECONDS > 0.5 + 2.0 * gap_s)
    driven[touched] = True
    filled = on_the_way(np.where(driven, (truth + np.pi) % TURN - np.pi, 0.0), SECONDS, driven)
    np.testing.assert_allclose(filled - filled[0], truth, atol=1e-9)


def test_a_crank_that_stood_at_one_end_starts_slowly() -> None:
    """A speed of nothing is known, and not the same as an unknown one."""
    truth = np.where(SECONDS < 1.0, 0.0, np.where(SECONDS < 2.0, 4.0 * (SECONDS - 1.0) ** 2, 8.0 * SECONDS - 12.0))
    angles, driven = lost(truth, 1.0, 2.0)
    filled = on_the_way(angles, SECONDS, driven)
    np.testing.assert_allclose(filled - filled[0], truth, atol=0.3)


def test_before_and_after_all_that_is_known_it_stays_as_it_was_said() -> None:
    angles = np.linspace(0.0, 5.0, len(SECONDS))
    driven = (SECONDS > 1.0) & (SECONDS < 3.0)
    np.testing.assert_array_equal(on_the_way(angles, SECONDS, driven), angles)


def test_where_nobody_ever_drove_it_nothing_is_said() -> None:
    angles = np.random.default_rng(1).uniform(-np.pi, np.pi, len(SECONDS))
    np.testing.assert_array_equal(on_the_way(angles, SECONDS, np.zeros(len(SECONDS), bool)), angles)
