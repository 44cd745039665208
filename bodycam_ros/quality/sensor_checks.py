"""Checks of inertial sensors: unit, gaps, saturation, a frozen reading, noise and bias."""

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np

from bodycam_ros.geometry import Array
from bodycam_ros.inertial.imu_samples import GRAVITY, ImuSamples
from bodycam_ros.results.verdict import Finding, Level, LimitCheck, check_limits, good

_CHECK = "sensors"
MIN_SAMPLES = 100  # of which the quality is computed
_REST_S = 1.0  # length of the quietest stretch, in which the bias shows
_REST_RAD_S = 0.05  # spread of its angular velocity at which a body is at rest
_FROZEN = 0.5  # share of samples that repeat the one before
_USUAL_GYRO, _USUAL_ACCELEROMETER = 2e-4, 2e-3  # noise of consumer grade [rad/s/sqrt(Hz)], [m/s^2/sqrt(Hz)]


@dataclass(frozen=True)
class SensorQuality:
    """How good one inertial sensor is.

    Attributes:
        rate_hz: samples a second.
        longest_gap_s: between two samples [s].
        gap_at_s: when that began, since the first sample [s].
        fastest: 99th percentile of the angular velocity [rad/s].
        gyro_noise, accelerometer_noise: spectral densities at rest [rad/s/sqrt(Hz)], [m/s^2/sqrt(Hz)].
        bias: size of the gyroscope's bias [rad/s]; like the noise NaN if the body was never at rest.
        gravity: median size of the acceleration [m/s^2].
        frozen: share of samples that equal the one before.
        saturated: samples at the end of the range.
    """

    rate_hz: float
    longest_gap_s: float
    gap_at_s: float
    fastest: float
    gyro_noise: float
    accelerometer_noise: float
    bias: float
    gravity: float
    frozen: float
    saturated: int


def sensor_quality(samples: ImuSamples) -> SensorQuality:
    """The quality of at least three samples."""
    steps_s = 1e-9 * np.diff(samples.stamps_ns)
    period_s = float(np.median(steps_s))
    w, a = samples.angular_velocity, samples.acceleration
    same = (np.diff(w, axis=0) == 0.0).all(axis=1) & (np.diff(a, axis=0) == 0.0).all(axis=1)
    rest = _quietest(w, max(3, round(_REST_S / period_s)))
    at_rest = bool(0.0 < w[rest].std(axis=0).max() < _REST_RAD_S)  # and not frozen
    return SensorQuality(
        rate_hz=1.0 / period_s,
        longest_gap_s=float(steps_s.max()),
        gap_at_s=1e-9 * float(samples.stamps_ns[np.argmax(steps_s)] - samples.stamps_ns[0]),
        fastest=float(np.percentile(np.linalg.norm(w, axis=1), 99.0)),
        gyro_noise=noise_density(w[rest], period_s) if at_rest else math.nan,
        accelerometer_noise=noise_density(a[rest], period_s) if at_rest else math.nan,
        bias=float(np.linalg.norm(w[rest].mean(axis=0))) if at_rest else math.nan,
        gravity=float(np.median(np.linalg.norm(a, axis=1))),
        frozen=float(same.mean()),
        saturated=_saturated(w) + _saturated(a),
    )


def noise_density(readings: Array, period_s: float) -> float:
    """Spectral density of white noise in readings (N, 3): their unit times sqrt(s).

    It is the Hadamard deviation at the shortest time (IEEE Std 1139), an Allan deviation of second differences that
    slow motion does not enter, times the root of that time.
    """
    variance = np.square(np.diff(readings, n=2, axis=0)).mean() / 6.0
    return float(np.sqrt(variance * period_s))


def _quietest(w: Array, count: int) -> slice:
    """The ``count`` samples of angular velocities (N, 3) that vary least."""
    starts = range(0, max(1, len(w) - count + 1), max(1, count // 4))
    start = min(starts, key=lambda start: float(w[start : start + count].std(axis=0).max()))
    return slice(start, start + count)


def _saturated(readings: Array) -> int:
    """Samples that stay at the largest reading of their axis while another axis goes on: noise would move them.

    At rest the steps of a coarse sensor repeat as well, on all axes.
    """
    largest, same = np.abs(readings).max(axis=0), np.diff(readings, axis=0) == 0.0
    stays = same & (np.abs(readings[1:]) == largest) & (largest > 0.0)
    return int((stays.any(axis=1) & ~same.all(axis=1)).sum())


SENSOR_CHECKS: tuple[LimitCheck[SensorQuality], ...] = (
    # Nothing on a body turns faster; 35 rad/s is the range of usual gyroscopes.
    LimitCheck(
        _CHECK, lambda q: q.fastest, 60.0, 60.0, "its gyroscope turns by {:.0f} rad/s", "its unit must be rad/s"
    ),
    # Arms in swing read a third more than gravity; readings in g are off by 0.9.
    LimitCheck(
        _CHECK, lambda q: abs(q.gravity / GRAVITY - 1.0), 0.5, 0.85, "its accelerometer reads {1.gravity:.1f} m/s^2",
        "check its unit (REP-145 needs m/s^2, gravity is 9.8), its range and its scale",
    ),
    LimitCheck(
        _CHECK, lambda q: q.frozen, _FROZEN, _FROZEN, "{:.0%} of its samples repeat the one before",
        "it is frozen; restart the camera",
    ),
    LimitCheck(
        _CHECK, lambda q: 0 if q.frozen > _FROZEN else q.saturated, 0, np.inf,
        "{:.0f} samples are at the end of its range", "set a larger range, if it has one",
    ),
    # Below 90 Hz a stride is not integrated to a centimetre.
    LimitCheck(_CHECK, lambda q: q.rate_hz, 90.0, 0.0, "{:.0f} samples a second", "set its rate to 200 Hz or more"),
    # A gyroscope is integrated over 0.03 s, or some samples; in 0.2 s a limb turns by a radian.
    LimitCheck(
        _CHECK, lambda q: q.longest_gap_s if q.longest_gap_s > 2.5 / q.rate_hz else 0.0, 0.03, 0.2,
        "{0:.2f} s without a sample, {1.gap_at_s:.1f} s after its first", "only images measure its limb in that time",
    ),
    LimitCheck(
        _CHECK, lambda q: max(q.gyro_noise / _USUAL_GYRO, q.accelerometer_noise / _USUAL_ACCELEROMETER), 10.0, np.inf,
        "its noise is {:.0f} times that of consumer sensors", "check that it is not loose, and that no fan is near",
    ),
    LimitCheck(
        _CHECK, lambda q: np.degrees(q.bias), 5.0, np.inf, "its gyroscope reads {:.1f} deg/s at rest", "let it warm up"
    ),
)  # fmt: skip
"""Numbers of an inertial sensor, and their limits."""


def check_sensors(sensors: Mapping[str, ImuSamples]) -> Iterator[Finding]:
    """Find sensors that are slow, have gaps, are frozen, saturated, noisy or in another unit; nothing without any."""
    found: dict[str, SensorQuality] = {}
    for camera, samples in sorted(sensors.items()):
        if len(samples) < MIN_SAMPLES:
            why = f": {samples.left_out}" if samples.left_out else ""
            what, remedy = f"its inertial sensor has {len(samples)} usable samples{why}", "it will not be used"
            yield Finding(camera, Level.DOUBTFUL, what, remedy=remedy, check=_CHECK)
        else:
            found[camera] = sensor_quality(samples)
    yield from check_limits(found, SENSOR_CHECKS)
    if found:
        yield good(_CHECK, _summary(list(found.values())))


def _summary(qualities: list[SensorQuality]) -> str:
    rates = [each.rate_hz for each in qualities]
    text = f"{len(qualities)} inertial sensors, {min(rates):.0f} to {max(rates):.0f} samples a second"
    at_rest = [each for each in qualities if not math.isnan(each.bias)]
    if not at_rest:
        return f"{text}; never at rest, so noise and bias do not show"
    gyro, bias = (np.degrees(max(getattr(each, name) for each in at_rest)) for name in ("gyro_noise", "bias"))
    micro_g = 1e6 * max(each.accelerometer_noise for each in at_rest) / GRAVITY
    noise = f"{gyro:.3f} deg/s and {micro_g:.0f} micro-g per root hertz"
    return f"{text}; at rest noise up to {noise}, bias up to {bias:.2f} deg/s"
