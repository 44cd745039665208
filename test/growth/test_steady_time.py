"""One time for cameras with clocks of their own."""

from bodycam_ros.growth.steady_time import SteadyTime

_S = 1_000_000_000


def test_cameras_whose_clocks_are_apart_share_a_time() -> None:
    time = SteadyTime()
    for number in range(100):
        ours, theirs = time.at("ours", number * _S // 10), time.at("theirs", 40 * _S + number * _S // 10)
        assert ours == theirs == time.now_ns == number * _S // 10


def test_it_never_goes_back_and_takes_no_leap() -> None:
    time = SteadyTime()
    time.at("one", 3600 * _S)
    assert time.at("one", 3601 * _S) == _S
    assert time.at("one", 0) == _S, "a bag is played again"
    assert time.at("one", _S) == 2 * _S
    assert time.at("one", 10**6 * _S) == 12 * _S, "a clock was set"
