"""What is said of the messages of a camera on another computer."""

import pytest

from bodycam_ros.messages.status import HealthLevel
from bodycam_ros.nodes.way_of_messages import WayOfMessages

MS = 1_000_000


def way_of(delays_ms: list[float], ahead_ms: float) -> WayOfMessages:
    """A computer whose clock is ahead, and whose messages take so long."""
    way = WayOfMessages()
    ahead_ns = int(ahead_ms * MS)
    way.answered("worn", 0, 4 * MS + ahead_ns, 4 * MS + ahead_ns, 8 * MS)
    for number, delay_ms in enumerate(delays_ms):
        sent_ns = number * 33 * MS
        way.came(sent_ns + ahead_ns, sent_ns + int(delay_ms * MS))
    return way


@pytest.mark.parametrize("ahead_ms", [-250.0, 0.0, 6.0])
def test_delays_are_told_by_one_clock(ahead_ms: float) -> None:
    values = way_of([10.0] * 98 + [50.0] * 2, ahead_ms).report("way").values
    assert float(str(values["delay, median [ms]"])) == pytest.approx(10.0, abs=0.01)
    assert float(str(values["delay, 99 % [ms]"])) == pytest.approx(50.0, abs=0.01)
    assert float(str(values["clock ahead by [ms]"])) == pytest.approx(ahead_ms, abs=0.01)
    assert (values["computer"], values["messages per second"]) == ("worn", 100)


@pytest.mark.parametrize(
    ("ahead_ms", "said"), [(12.0, "12.0 ms ahead of"), (-12.0, "12.0 ms behind"), (8.5, ""), (0.0, "")]
)
def test_clocks_that_differ_by_more_than_is_uncertain_are_warned_of(ahead_ms: float, said: str) -> None:
    """8.5 ms, known to 4 ms, may be 4.5: less than matters."""
    health = way_of([5.0], ahead_ms).report("way")
    assert (health.level is HealthLevel.WARN) == bool(said)
    assert said in health.text


def test_losses_are_counted_and_warned_of_once() -> None:
    way = way_of([5.0], 0.0)
    way.lost()
    first, second = way.report("way"), way.report("way")
    assert (first.level, second.level) == (HealthLevel.WARN, HealthLevel.OK)
    assert (first.values["times lost"], second.values["times lost"]) == (1, 1)


def test_another_computer_has_another_clock() -> None:
    way = way_of([5.0], 300.0)
    way.answered("spare", 0, 4 * MS, 4 * MS, 8 * MS)
    values = way.report("way").values
    assert (values["computer"], values["clock ahead by [ms]"]) == ("spare", "0.00")


def test_nothing_is_known_before_anything_came() -> None:
    values = WayOfMessages().report("way").values
    assert (values["computer"], values["delay, median [ms]"], values["clock ahead by [ms]"]) == (
        "unknown",
        "none",
        "unknown",
    )
