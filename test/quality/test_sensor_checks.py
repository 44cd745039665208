"""Checks of inertial sensors, on simulated ones whose faults are known."""

import numpy as np
import pytest
from helpers.naming import names, numbers
from numpy.typing import NDArray

from bodycam_ros.inertial.imu_samples import GRAVITY, ImuSamples
from bodycam_ros.quality.sensor_checks import check_sensors, noise_density, sensor_quality
from bodycam_ros.results.verdict import Level

RATE_HZ = 200.0
NOISE = (2.5e-4, 2.0e-3)  # [rad/s/sqrt(Hz)], [m/s^2/sqrt(Hz)]
BIAS = np.array([0.006, -0.002, 0.005])


def sensor(rest_s: float = 2.0, seconds: float = 6.0) -> ImuSamples:
    """A limb that rests, then swings."""
    rng = np.random.default_rng(3)
    t = np.arange(round(seconds * RATE_HZ)) / RATE_HZ
    swing = np.where(t > rest_s, np.sin(2.0 * np.pi * 1.5 * (t - rest_s)), 0.0)
    w = BIAS + np.outer(swing, [3.0, 1.0, 0.5]) + NOISE[0] * np.sqrt(RATE_HZ) * rng.standard_normal((len(t), 3))
    a = np.array([0.0, 0.0, GRAVITY]) + np.outer(swing, [2.0, 0.0, 1.0])
    a = a + NOISE[1] * np.sqrt(RATE_HZ) * rng.standard_normal((len(t), 3))
    return ImuSamples((1e9 * t).astype(np.int64), w, a)


def faults(samples: ImuSamples) -> list[tuple[Level, str]]:
    return [(each.level, each.what) for each in check_sensors({"shin": samples}) if each.level]


def test_noise_and_bias_of_a_sensor_at_rest() -> None:
    quality = sensor_quality(sensor())
    assert quality.gyro_noise == pytest.approx(NOISE[0], rel=0.1)
    assert quality.accelerometer_noise == pytest.approx(NOISE[1], rel=0.1)
    assert quality.bias == pytest.approx(np.linalg.norm(BIAS), rel=0.1)
    assert quality.rate_hz == pytest.approx(RATE_HZ)


def test_slow_motion_is_no_noise() -> None:
    t = np.arange(2000) / RATE_HZ
    noise = NOISE[0] * np.sqrt(RATE_HZ) * np.random.default_rng(0).standard_normal((len(t), 3))
    moving = noise + np.outer(np.sin(2.0 * np.pi * t), np.ones(3))
    assert noise_density(moving, 1.0 / RATE_HZ) == pytest.approx(NOISE[0], rel=0.1)


def test_a_good_sensor_has_no_fault() -> None:
    assert not faults(sensor())
    (finding,) = check_sensors({"shin": sensor()})
    sensors, slowest_hz, fastest_hz, *_, bias_deg = numbers(finding.what)
    assert (sensors, slowest_hz, fastest_hz) == (1, RATE_HZ, RATE_HZ)
    assert bias_deg == pytest.approx(np.degrees(np.linalg.norm(BIAS)), abs=0.02)


def test_a_sensor_that_never_rests_shows_no_noise() -> None:
    (finding,) = check_sensors({"shin": sensor(rest_s=0.0)})
    assert names(finding.what, "never at rest")


@pytest.mark.parametrize(
    ("fault", "level", "word"),
    [
        (lambda s: ImuSamples(s.stamps_ns, np.degrees(s.angular_velocity), s.acceleration), Level.WRONG, "rad/s"),
        (lambda s: ImuSamples(s.stamps_ns, s.angular_velocity, s.acceleration / GRAVITY), Level.WRONG, "m/s^2"),
        (
            lambda s: ImuSamples(s.stamps_ns, s.angular_velocity.clip(-2.0, 2.0), s.acceleration),
            Level.DOUBTFUL,
            "range",
        ),
        (lambda s: frozen(s), Level.WRONG, "repeat"),
        (lambda s: cut(s, 0.1), Level.DOUBTFUL, "without a sample"),
        (lambda s: cut(s, 0.5), Level.WRONG, "without a sample"),
        (lambda s: thinned(s, 4), Level.DOUBTFUL, "50 samples a second"),
    ],
)
def test_a_fault_is_named(fault, level, word) -> None:  # type: ignore[no-untyped-def]
    found = faults(fault(sensor()))
    assert any(each is level and word in what for each, what in found), found


def test_the_coarse_steps_of_a_sensor_at_rest_are_not_the_end_of_its_range() -> None:
    good = sensor(rest_s=6.0)
    steps = ImuSamples(good.stamps_ns, good.angular_velocity.round(1), good.acceleration.round(0))
    assert not [what for _, what in faults(steps) if "range" in what]


def test_few_samples_are_named_and_none_are_silent() -> None:
    assert "has 50 usable samples" in faults(thinned(sensor(), 24))[0][1]
    assert not list(check_sensors({}))


def frozen(samples: ImuSamples) -> ImuSamples:
    row = np.minimum(np.arange(len(samples)), 300)
    return ImuSamples(samples.stamps_ns, samples.angular_velocity[row], samples.acceleration[row])


def cut(samples: ImuSamples, seconds: float) -> ImuSamples:
    t = 1e-9 * samples.stamps_ns
    return chosen(samples, (t < 3.0) | (t >= 3.0 + seconds))


def thinned(samples: ImuSamples, step: int) -> ImuSamples:
    return chosen(samples, np.arange(len(samples)) % step == 0)


def chosen(samples: ImuSamples, rows: np.ndarray) -> ImuSamples:  # type: ignore[type-arg]
    return ImuSamples(samples.stamps_ns[rows], samples.angular_velocity[rows], samples.acceleration[rows])


@pytest.mark.parametrize(
    ("stamps_ns", "reading", "words"),
    [
        (np.arange(300) * 5_000_000, np.nan, "300 samples are not finite numbers"),
        (np.arange(300)[::-1] * 5_000_000, 1.0, "299 samples have a stamp that does not increase"),
    ],
)
def test_why_a_sensor_has_no_samples(stamps_ns: NDArray[np.int64], reading: float, words: str) -> None:
    samples = ImuSamples.from_rows([(stamp_ns, (reading,) * 6) for stamp_ns in stamps_ns.tolist()])
    ((level, what),) = faults(samples)
    assert level == Level.DOUBTFUL and what.endswith(words)
