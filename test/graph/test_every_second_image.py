"""Under load half of the images go, the same of all cameras; when it is over they all come back."""

import numpy as np

from bodycam_ros.graph.every_second_image import EverySecondImage

_HZ = 30
_FRAME_NS = round(1e9 / _HZ)
_START_NS = 1_700_000_000_123_456_789
_LONGEST_S, _RECOVERY_S = 0.5, 2.0


def _offer(thinning: EverySecondImage, first: int, count: int, waited_s: float, shift_ns: int = 0) -> list[bool]:
    """Whether each of so many images is left out, which come at their rate."""
    return [
        thinning.leaves_out(_START_NS + shift_ns + number * _FRAME_NS, waited_s > _LONGEST_S, number / _HZ)
        for number in range(first, first + count)
    ]


def test_every_second_one_is_left_out_once_they_wait_for_longer() -> None:
    thinning = EverySecondImage(_RECOVERY_S)
    _offer(thinning, 0, 20, 0.0)
    left_out = _offer(thinning, 20, 60, _LONGEST_S + 0.01)
    assert thinning.active
    assert abs(sum(left_out) - 30) <= 1
    assert not any(one and following for one, following in zip(left_out, left_out[1:], strict=False))


def test_cameras_that_trigger_together_leave_out_the_same_images() -> None:
    one, other = EverySecondImage(_RECOVERY_S), EverySecondImage(_RECOVERY_S)
    # One has been at it for longer, and began with an odd number of images.
    of_one = _offer(one, 0, 90, 1.0)
    of_other = _offer(other, 41, 49, 1.0, shift_ns=200_000)
    np.testing.assert_array_equal(of_one[45:], of_other[4:])


def test_all_images_come_back_once_none_has_waited_for_the_recovery_time() -> None:
    thinning = EverySecondImage(_RECOVERY_S)
    _offer(thinning, 0, 30, 1.0)
    late_until = 29 / _HZ
    for number in range(30, 150):
        left_out = thinning.leaves_out(_START_NS + number * _FRAME_NS, False, number / _HZ)
        assert thinning.active == (number / _HZ < late_until + _RECOVERY_S)
        assert thinning.active or not left_out


def test_a_recording_that_starts_again_is_thinned_as_before() -> None:
    thinning = EverySecondImage(_RECOVERY_S)
    first = _offer(thinning, 0, 40, 1.0)
    again = _offer(thinning, 0, 40, 1.0)
    assert again[5:] == first[5:] and sum(again) >= 15


def test_nothing_is_left_out_without_load() -> None:
    assert not any(_offer(EverySecondImage(_RECOVERY_S), 0, 200, _LONGEST_S))
