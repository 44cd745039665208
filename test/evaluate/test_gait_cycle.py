"""Mean and band of joint angles over the gait cycle, against numpy on a motion whose strides are known."""

import numpy as np
import pytest
from helpers.known_gait import KnownGait
from scipy.stats import t

from bodycam_ros.evaluate.anatomical_angles import flexion_angles
from bodycam_ros.evaluate.gait import MEASURES, Stride, find_strides, gait_figures
from bodycam_ros.evaluate.gait_cycle import CYCLE_PERCENT, cycle_angles
from bodycam_ros.geometry import exp_so3, rigid

STEP_S = 0.04


def test_mean_and_band_are_those_of_the_strides() -> None:
    seconds = np.arange(0.0, 6.0, 0.002)
    starts, durations, sizes = [0.5, 1.5, 2.7, 3.6], [1.0, 1.2, 0.9, 1.1], [50.0, 56.0, 62.0, 53.0]
    angle = np.full(len(seconds), 10.0)
    strides = []
    for start, duration, size in zip(starts, durations, sizes, strict=True):
        inside = (seconds >= start) & (seconds < start + duration)
        angle[inside] += size * np.sin(np.pi * (seconds[inside] - start) / duration) ** 2
        strides.append(Stride("left", start, start + duration, {}))
    found = cycle_angles(seconds, {("knee", "left"): angle, ("knee", "right"): angle}, strides)
    assert list(found) == [("knee", "left")]  # the right foot has no stride
    cycle, bump = found["knee", "left"], np.sin(np.pi * CYCLE_PERCENT / 100.0) ** 2
    assert cycle.strides == 4
    np.testing.assert_allclose(cycle.mean, 10.0 + np.mean(sizes) * bump, atol=0.02)
    np.testing.assert_allclose(cycle.sd, np.std(sizes, ddof=1) * bump, atol=0.02)
    assert cycle.peak == pytest.approx((10.0 + np.mean(sizes), 50.0), abs=0.02)


def test_a_single_stride_has_no_band() -> None:
    seconds = np.linspace(0.0, 2.0, 50)
    found = cycle_angles(seconds, {("hip", "right"): seconds}, [Stride("right", 0.2, 1.4, {})])
    assert np.isnan(found["hip", "right"].sd).all()


def test_a_known_walk_has_the_same_cycle_on_both_sides() -> None:
    seconds, world, soles = KnownGait().poses()
    strides = find_strides(seconds, world, soles, STEP_S)
    found = cycle_angles(seconds, flexion_angles(world), strides)
    assert set(found) == {(joint, side) for joint in ("hip", "knee", "ankle") for side in ("left", "right")}
    for joint in ("hip", "knee", "ankle"):
        np.testing.assert_allclose(found[joint, "left"].mean, found[joint, "right"].mean, atol=2.0)
    assert found["hip", "left"].mean[0] > 10.0  # the leg is ahead where its heel meets the floor
    assert found["knee", "left"].peak[1] > 60.0  # the knee bends most in the swing


@pytest.mark.parametrize("side", ["left", "right"])
def test_signs_are_those_of_the_isb(side: str) -> None:
    def turned(degrees: float) -> np.ndarray:
        return rigid(
            exp_so3(np.array([[0.0, np.radians(degrees), 0.0]])), np.zeros((1, 3))
        )  # about the axis to the left

    still = np.eye(4)[None]
    # A thigh ahead, a shin behind it, toes above the shin's right angle, an arm ahead, a bent elbow.
    world = {
        "pelvis": still, "torso": still, f"thigh_{side}": turned(-30.0), f"shin_{side}": turned(20.0),
        f"foot_{side}": turned(10.0), f"upper_arm_{side}": turned(-40.0), f"forearm_{side}": turned(-90.0),
    }  # fmt: skip
    found = {joint: float(angle[0]) for (joint, _), angle in flexion_angles(world).items()}
    expected = {"hip": 30.0, "knee": 50.0, "ankle": 10.0, "shoulder": 40.0, "elbow": 50.0}
    assert found == pytest.approx(expected, abs=1e-9)


def strides_of(left: list[float], right: list[float]) -> list[Stride]:

    sides = [("left", value) for value in left] + [("right", value) for value in right]
    return [Stride(side, float(at), at + 1.0, dict.fromkeys(MEASURES, value)) for at, (side, value) in enumerate(sides)]


def test_nothing_is_said_about_symmetry_by_few_strides() -> None:
    assert gait_figures(strides_of([1.0, 1.1], [1.3, 1.4, 1.5])).stride_s.symmetry_percent is None


def test_symmetry_has_its_interval_by_the_spread_of_strides() -> None:
    left, right = [1.0, 1.1, 0.9, 1.05], [1.1, 1.2, 1.0]
    found = gait_figures(strides_of(left, right)).stride_s
    a, b = np.array(left), np.array(right)
    va, vb = a.var(ddof=1) / a.size, b.var(ddof=1) / b.size
    freedom = (va + vb) ** 2 / (va**2 / (a.size - 1) + vb**2 / (b.size - 1))

    percent = 200.0 / (a.mean() + b.mean())
    reach = percent * float(t.ppf(0.975, freedom)) * np.sqrt(va + vb)
    middle = percent * (a.mean() - b.mean())
    assert found.symmetry_percent == pytest.approx(middle)
    assert (found.symmetry_low_percent, found.symmetry_high_percent) == pytest.approx((middle - reach, middle + reach))
