"""Checks of inertial sensors: unit, gaps, saturation, a frozen reading, noise and bias."""

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np

from bodycam_ros.geometry import Array
from bodycam_ros.inertial.imu_samples import GRAVITY, ImuSamples
from bodycam_ros.quality.recording_checks import good
from bodycam_ros.verdict import Finding, Level, limit_level

_CHECK = "sensors"
_LEAST_SAMPLES = 100
_MIN_RATE_HZ = 90.0  # below it a stride is not integrated to a centimetre
_GAP_S, _LONG_GAP_S = 0.03, 0.2  # a gyroscope is integrated over the first; in the second a limb turns by a radian
_FROZEN = 0.5  # share of samples that repeat the one before
_G_OFF, _UNIT_OFF = 0.5, 0.5  # share by which the median acceleration may differ: arms in swing read a third more
_FASTEST = 60.0  # [rad/s] nothing on a body turns faster; 35 is the range of usual gyroscopes
_REST_S = 1.0  # length of the quietest stretch, in which the bias shows
_REST_RAD_S = 0.05  # spread of its angular velocity at which a body is at rest
_NOISY_GYRO, _NOISY_ACCELEROMETER = 2e-3, 2e-2  # ten times consumer grade [rad/s/sqrt(Hz)], [m/s^2/sqrt(Hz)]
_BIASED = 0.09  # [rad/s], 5 deg/s: ten times consumer grade


@dataclass(frozen=True)
class SensorQuality:
    """How good one inertial sensor is.

    Attributes:
        rate_hz: samples a second.
        longest_gap_s: between two samples [s].
        gyro_noise, accelerometer_noise: spectral densities at rest [rad/s/sqrt(Hz)], [m/s^2/sqrt(Hz)].
        bias: size of the gyroscope's bias [rad/s]; like the noise NaN if the body was never at rest.
        gravity: median size of the acceleration [m/s^2].
        frozen: share of samples that equal the one before.
        saturated: samples at the end of the range.
    """

    rate_hz: float
    longest_gap_s: float
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
    at_rest = bool(w[rest].std(axis=0).max() < _REST_RAD_S)
    return SensorQuality(
        rate_hz=1.0 / period_s,
        longest_gap_s=float(steps_s.max()),
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


def check_sensors(sensors: Mapping[str, ImuSamples]) -> Iterator[Finding]:
    """Find sensors that are slow, have gaps, are frozen, saturated, noisy or in another unit; nothing without any."""
    found: dict[str, SensorQuality] = {}
    for camera, samples in sorted(sensors.items()):
        if len(samples) < _LEAST_SAMPLES:
            what, remedy = f"its inertial sensor has {len(samples)} samples", "it will be left out"
            yield Finding(camera, Level.DOUBTFUL, what, remedy=remedy, check=_CHECK)
            continue
        found[camera] = quality = sensor_quality(samples)
        for level, what, remedy in _faults(quality, samples):
            yield Finding(camera, level, what, remedy=remedy, check=_CHECK)
    if found:
        yield good(_CHECK, _summary(list(found.values())))


def _faults(quality: SensorQuality, samples: ImuSamples) -> Iterator[tuple[Level, str, str]]:
    fastest = float(np.percentile(np.linalg.norm(samples.angular_velocity, axis=1), 99.0))
    if fastest > _FASTEST:
        yield Level.WRONG, f"its gyroscope turns by {fastest:.0f} rad/s", "in deg/s? REP-145 has rad/s"
    if abs(quality.gravity - 1.0) < _UNIT_OFF:
        yield Level.WRONG, f"its accelerometer reads {quality.gravity:.2f} m/s^2", "in g? REP-145 has m/s^2"
    elif abs(quality.gravity / GRAVITY - 1.0) > _G_OFF:
        what = f"its accelerometer reads {quality.gravity:.1f} m/s^2, gravity is {GRAVITY:.1f}"
        yield Level.DOUBTFUL, what, "what is its unit, its range, its scale?"
    if quality.frozen > _FROZEN:
        what = f"{quality.frozen:.0%} of its samples repeat the one before"
        yield Level.WRONG, what, "it is frozen; restart the camera"
    elif quality.saturated:
        what = f"{quality.saturated} samples are at the end of its range"
        yield Level.DOUBTFUL, what, "set a larger range, if it has one"
    if quality.rate_hz < _MIN_RATE_HZ:
        yield Level.DOUBTFUL, f"{quality.rate_hz:.0f} samples a second", "set it to 200 or more"
    if level := limit_level(quality.longest_gap_s, max(_GAP_S, 2.5 / quality.rate_hz), _LONG_GAP_S):
        worst = int(np.argmax(np.diff(samples.stamps_ns)))
        at_s = 1e-9 * float(samples.stamps_ns[worst] - samples.stamps_ns[0])
        what = f"{quality.longest_gap_s:.2f} s without a sample, {at_s:.1f} s after its first"
        yield level, what, "its limb goes on by images alone there"
    if quality.gyro_noise > _NOISY_GYRO or quality.accelerometer_noise > _NOISY_ACCELEROMETER:
        yield Level.DOUBTFUL, f"its noise is {_noise([quality])}", "is it loose on the camera, or a fan beside it?"
    if quality.bias > _BIASED:
        yield Level.DOUBTFUL, f"turns by {np.degrees(quality.bias):.1f} deg/s at rest", "let it warm up"


def _summary(qualities: list[SensorQuality]) -> str:
    rates = [each.rate_hz for each in qualities]
    text = f"{len(qualities)} inertial sensors, {min(rates):.0f} to {max(rates):.0f} samples a second"
    at_rest = [each for each in qualities if not math.isnan(each.bias)]
    if not at_rest:
        return f"{text}; never at rest, so noise and bias do not show"
    bias = np.degrees(max(each.bias for each in at_rest))
    return f"{text}; at rest noise up to {_noise(at_rest)}, bias up to {bias:.2f} deg/s"


def _noise(qualities: list[SensorQuality]) -> str:
    gyro = np.degrees(max(each.gyro_noise for each in qualities))
    accelerometer = 1e6 * max(each.accelerometer_noise for each in qualities) / GRAVITY
    return f"{gyro:.3f} deg/s and {accelerometer:.0f} micro-g per root hertz"
