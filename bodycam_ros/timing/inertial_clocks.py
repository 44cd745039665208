"""Clock offsets between the inertial sensors of a body, by their samples alone: no image, no sound, no calibration.

Two segments that hang together have a joint in common. The specific force at the joint follows from each of the two
sensors: ``a + dw x r + w x (w x r)``, with the joint at r in the sensor's frame (Seel, Schauer and Raisch 2012, "Joint
axis and position estimation from inertial measurement data"). Its magnitude does not depend on the frame, so that both
magnitudes are the same function of time. Both places r and the offset between the two clocks are fitted at once; what
a step or a clap adds is in both as well. Sensors of one segment have any point in common.

On four seconds of walking the offsets are right to 0.4 ms (rms), on half a minute of a range of motion to 0.05 ms.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import scipy
from numpy.typing import NDArray

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.geometry import Array, hat
from bodycam_ros.inertial.imu_samples import ImuSamples

_RATE = 100.0  # [Hz] of the compared magnitudes
_SMOOTHING_S = 0.01  # sigma of the filter, for the derivative of the angular velocity
_LONGEST_S = 60.0  # of the stretch that is compared: the drift of quartz is 3 ms in it at most
_LEAST_S = 2.0  # of motion in common
_MAX_OFFSET_S = 2.0  # clocks further apart are not searched for
_SEARCH_STEP = 2  # samples of a step of the search, before the fit
_FORCE_SIGMA = 0.3  # [m/s^2] beyond which a difference counts less (Cauchy): soft tissue and noise
_REACH_M = 0.5  # prior of a joint's distance from a sensor
_BIAS = 0.1  # [m/s^2] prior of an accelerometer's bias
_LEAST_RESIDUAL = 0.06 / _FORCE_SIGMA  # scale errors of accelerometers, which a small residual does not show
_STOP = {"ftol": 1e-5, "xtol": 1e-5, "max_nfev": 40}
_CORRELATED = 3.0  # times the sigma of independent samples: filtering, and errors that last
_LEAST_COMMON = 0.7  # correlation of the slopes of both magnitudes
_LEAST_SIGMA_S = 5e-5
_ROUNDING = 1e-6  # [m/s^2]
_MOST_SIGMA_S = 2e-3  # of a pair; larger, it did not move enough


@dataclass(frozen=True)
class InertialClock:
    """Clock of one sensor.

    Attributes:
        offset: by how much its stamps are ahead of the reference's [s].
        sigma: [s].
    """

    offset: float
    sigma: float


def inertial_clocks(
    imus: Mapping[str, ImuSamples], segments: Mapping[str, str], parents: Mapping[str, str | None]
) -> dict[str, InertialClock]:
    """Clock offsets of all sensors that moved enough, against the first on the root, or of all.

    Args:
        imus: camera -> samples of its sensor, by its own clock.
        segments: camera -> the segment that it is on.
        parents: segment -> the one that it hangs on; None for the root.

    Returns:
        Camera -> its clock, of the largest group of cameras that are linked by joints; empty if there is none.
    """
    start_ns = max((int(samples.stamps_ns[0]) for samples in imus.values() if len(samples)), default=0)
    signals = {
        camera: signal
        for camera, samples in imus.items()
        if (signal := _Signal.resample(samples, start_ns)) is not None
    }
    # The root's have the most neighbours.
    cameras = sorted(
        set(signals) & set(segments), key=lambda camera: (parents.get(segments[camera]) is not None, camera)
    )
    links = []
    for j, second in enumerate(cameras):
        for i, first in enumerate(cameras[:j]):
            one, other = segments[first], segments[second]
            if one == other or parents.get(other) == one or parents.get(one) == other:
                link = _pair_offset(signals[first], signals[second])
                if link is not None:
                    links.append((i, j, *link))
    group = _largest_group(len(cameras), [(i, j) for i, j, _, _ in links])
    if len(group) < 2:
        return {}
    # Least squares over all pairs; the first camera of the group is the reference.
    row = {camera: number for number, camera in enumerate(group)}
    H, g = np.zeros((len(group), len(group))), np.zeros(len(group))
    for i, j, offset, sigma in links:
        if i in row and j in row:
            J = np.zeros(len(group))
            J[row[j]], J[row[i]] = 1.0 / sigma, -1.0 / sigma
            H += np.outer(J, J)
            g += J * offset / sigma
    covariance = np.linalg.inv(H[1:, 1:])
    offsets = np.append(0.0, covariance @ g[1:])
    sigmas = np.append(0.0, np.sqrt(np.diag(covariance)))
    return {cameras[i]: InertialClock(float(offsets[k]), float(sigmas[k])) for i, k in row.items()}


def camera_clocks(body: BodyModel, imus: Mapping[str, ImuSamples]) -> dict[str, InertialClock]:
    """Clock offsets of cameras by their calibrated sensors, against one of them; empty without any.

    Args:
        body: with the sensors' calibrations in its mounts.
        imus: camera -> samples of its sensor, by its own clock.
    """
    sensors = {name: mount.imu for name, mount in body.mounts.items() if mount.imu is not None and name in imus}
    segments = {name: body.mounts[name].segment for name in sensors}
    parents: dict[str, str | None] = dict.fromkeys(body.segments)
    parents |= {joint.child: joint.parent for joint in body.tree_joints}
    found = inertial_clocks({name: imus[name] for name in sensors}, segments, parents)
    first = sensors.get(next(iter(found), ""))
    # The sensor's stamps are late by its time offset, and the camera's are not.
    return {
        name: InertialClock(
            clock.offset - sensors[name].time_offset + first.time_offset,
            float(np.linalg.norm([clock.sigma, sensors[name].time_offset_sigma, first.time_offset_sigma])),
        )
        for name, clock in found.items()
        if first is not None
    }


@dataclass(frozen=True, eq=False)
class _Signal:
    """Filtered samples at an even rate.

    Attributes:
        force: (N, 3) specific force at the sensor [m/s^2].
        by_place: (N, 3, 3) how that of a point grows with its place in the sensor's frame [1/s^2].
    """

    force: Array
    by_place: Array

    def magnitude(self, count: int, part: Array) -> tuple[Array, Array]:
        """Magnitude (N,) of the specific force at a place, and its derivative (N, 6), of the first N samples.

        Args:
            count: N.
            part: (6,) the place [m], then the bias of the accelerometer, negated [m/s^2].
        """
        force = self.force[:count] + self.by_place[:count] @ part[:3] + part[3:]
        magnitude = np.maximum(np.linalg.norm(force, axis=1), 1e-6)
        direction = force / magnitude[:, None]
        return magnitude, np.concatenate([(direction[:, None] @ self.by_place[:count])[:, 0], direction], axis=1)

    @staticmethod
    def resample(samples: ImuSamples, start_ns: int) -> "_Signal | None":
        """The samples from a stamp on; None if they are too few."""
        seconds = 1e-9 * (samples.stamps_ns - start_ns).astype(np.float64)
        inside = seconds >= 0.0
        if inside.sum() < 0.3 * _LEAST_S * _RATE:
            return None
        # Means over even intervals: the difference of integrals, whatever the sensor's rate is.
        edges = np.arange(0.0, min(float(seconds[-1]), _LONGEST_S), 0.5 / _RATE)
        values = np.concatenate([samples.angular_velocity, samples.acceleration], axis=1)
        integrals = scipy.integrate.cumulative_trapezoid(values, seconds, axis=0, initial=0.0)
        even = 2.0 * _RATE * np.diff([np.interp(edges, seconds, column) for column in integrals.T], axis=1)
        filtered = scipy.ndimage.gaussian_filter1d(even, 2.0 * _SMOOTHING_S * _RATE, axis=1)[:, ::2].T
        w, force = hat(filtered[:, :3]), filtered[:, 3:]
        turning = hat(np.gradient(filtered[:, :3], 1.0 / _RATE, axis=0))
        return _Signal(np.asarray(force, np.float64), np.asarray(turning + w @ w, np.float64))


def _pair_offset(first: _Signal, second: _Signal) -> tuple[float, float] | None:
    """By how much the second clock is ahead of the first, and its sigma [s]; None if they had too little motion."""
    count = min(len(first.force), len(second.force))
    margin = round(_MAX_OFFSET_S * _RATE) if count > 4 * _MAX_OFFSET_S * _RATE else count // 8
    if count - 2 * margin < 0.5 * _LEAST_S * _RATE:
        return None
    inner = np.arange(margin, count - margin)
    at = np.arange(count)

    def evaluate(x: Array) -> tuple[Array, Array]:
        """Residuals in sigmas, with priors, and their Jacobian.

        Of each sensor a place (3) [m] and a bias (3) [m/s^2], and of the second the offset [samples].
        """
        (m, by_first), (n, by_second) = (
            signal.magnitude(count, part) for signal, part in ((first, x[:6]), (second, x[6:12]))
        )
        later = np.column_stack([np.interp(inner + x[12], at, column) for column in (n, np.gradient(n), *by_second.T)])
        J = np.column_stack([by_first[inner], -later[:, 2:], -later[:, 1]]) / _FORCE_SIGMA
        residuals = np.concatenate([(m[inner] - later[:, 0]) / _FORCE_SIGMA, prior @ x])
        return residuals, np.concatenate([J, prior])

    prior = np.eye(13)[:12] / np.tile(np.repeat([_REACH_M, _BIAS], 3), 2)[:, None]
    best = None
    for lag in _lags(first, second, count, margin):
        start, scale = np.append(np.zeros(12), lag), np.append(np.full(12, 0.1), 1.0)
        fit = scipy.optimize.least_squares(
            lambda x: evaluate(x)[0], start, lambda x: evaluate(x)[1], loss="cauchy", x_scale=scale, **_STOP
        )
        if best is None or fit.cost < best.cost:
            best = fit
    assert best is not None  # there is a lag
    # Noise has slopes as well, but not the same on both sides: only common ones measure the offset.
    m, n = (signal.magnitude(count, part)[0] for signal, part in ((first, best.x[:6]), (second, best.x[6:12])))
    slopes = np.gradient(m)[inner], np.interp(inner + best.x[12], at, np.gradient(n))
    common = float(np.corrcoef(*slopes)[0, 1]) if min(map(np.ptp, slopes)) > _ROUNDING else 0.0
    if common < _LEAST_COMMON or abs(best.x[12]) >= margin:
        return None
    variance = max(2.0 * best.cost / len(inner), _LEAST_RESIDUAL**2) / common
    covariance = np.linalg.pinv(best.jac.T @ best.jac)
    sigma = max(_CORRELATED * float(np.sqrt(variance * covariance[12, 12])) / _RATE, _LEAST_SIGMA_S)
    return (float(best.x[12]) / _RATE, sigma) if sigma < _MOST_SIGMA_S else None


def _lags(first: _Signal, second: _Signal, count: int, margin: int) -> list[int]:
    """Lags [samples] at which the fit starts: zero, and the best match of the specific forces at the sensors."""
    one, other = (np.linalg.norm(signal.force[:count], axis=1) for signal in (first, second))
    inner = one[margin : count - margin]
    lags = np.arange(-margin, margin + 1, _SEARCH_STEP)
    shifted = [other[margin + lag : count - margin + lag] for lag in lags]
    matches = np.array([np.corrcoef(inner, each)[0, 1] for each in shifted])
    return sorted({0, int(lags[np.argmax(np.nan_to_num(matches, nan=-1.0))])})


def _largest_group(count: int, links: list[tuple[int, int]]) -> list[int]:
    """The largest set of numbers that links connect, ascending."""
    labels: NDArray[np.intp] = np.arange(count)
    for i, j in links:
        labels[labels == labels[j]] = labels[i]
    return np.flatnonzero(labels == np.argmax(np.bincount(labels, minlength=1))).tolist() if count else []
