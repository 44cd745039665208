"""The layout of an instant's work on cores, where it can be told by hand."""

import pytest

from bodycam_ros.evaluate.latency import ProcessorTime
from bodycam_ros.evaluate.machine_estimate import estimate_machine

_COST = ProcessorTime(tracker_s=0.004, registration_s=0.002, solver_s=0.005)


@pytest.mark.parametrize(
    "cores, cameras, registrations, latency_s",
    [
        (1, 4, 4, 4 * 0.006 + 0.005),
        (100, 4, 4, 0.004 + 0.002 + 0.005),
        (100, 4, 1, 0.004 + 4 * 0.002 + 0.005),
        # Two rounds of trackers; then each registration has its two of the second round.
        (4, 8, 4, 2 * 0.004 + 2 * 0.002 + 0.005),
    ],
)
def test_latency(cores: int, cameras: int, registrations: int, latency_s: float) -> None:
    estimate = estimate_machine(_COST, cores, cameras, registrations, rate_hz=30.0)
    assert estimate.latency_s == pytest.approx(latency_s)
    assert estimate.chain_s == pytest.approx(0.011)


def test_who_keeps_up() -> None:
    estimate = estimate_machine(_COST, cores=8, cameras=16, registrations=4, rate_hz=30.0)
    assert estimate.busy == pytest.approx(30 * (16 * 0.006 + 0.005) / 8)
    assert estimate.busiest == pytest.approx(30 * 4 * 0.002)
    assert estimate.keeps_up
    assert not estimate_machine(_COST, cores=2, cameras=16, registrations=4, rate_hz=30.0).keeps_up
    # Cores enough, but one process has all cameras.
    assert not estimate_machine(_COST, cores=32, cameras=20, registrations=1, rate_hz=30.0).keeps_up
