"""Clock offsets between the cameras of a body by their calibrated inertial sensors alone: no image, no sound.

Two segments that hang together have a joint in common. The specific force at the joint follows from each of the two
sensors: ``a + dw x r + w x (w x r)``, with the joint at r from the sensor (Seel, Schauer and Raisch 2012, "Joint axis
and position estimation from inertial measurement data"). Its magnitude does not depend on the frame, so both magnitudes
are the same function of time, and their lag is the offset between the clocks; a step or a clap is in both as well.
Sensors of one segment have any point in common.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray
from scipy.integrate import cumulative_trapezoid
from scipy.ndimage import gaussian_filter1d

from bodycam_ros.body.body_model import BodyModel, CameraMount
from bodycam_ros.geometry import Array, hat
from bodycam_ros.inertial.imu_samples import ImuSamples

_RATE = 100.0  # [Hz] of the compared magnitudes
_SMOOTHING_S = 0.01  # sigma of the filter, for the derivative of the angular velocity
_LONGEST_S = 60.0  # of the stretch that is compared: the drift of quartz is 3 ms in it at most
_LEAST_S = 2.0  # of motion in common
_MAX_OFFSET_S = 2.0  # clocks further apart are not searched for
_FORCE_SIGMA = 0.3  # [m/s^2] beyond which a difference counts less (Cauchy): soft tissue and noise
_LEAST_RESIDUAL = 0.06  # [m/s^2] scale errors of accelerometers, which a small residual does not show
_ROUNDS = 10
_CORRELATED = 3.0  # times the sigma of independent samples: filtering, and errors that last
_LEAST_COMMON = 0.5  # correlation of the slopes of both magnitudes
_LEAST_SIGMA_S = 5e-5
_LEAST_SLOPE = 1e-6  # [m/s^2 per sample] rounding
_MOST_SIGMA_S = 2e-3  # of a pair; larger, it did not move enough


@dataclass(frozen=True)
class InertialClock:
    """Clock of one camera.

    Attributes:
        offset: by how much its stamps are ahead of the reference's [s].
        sigma: [s].
    """

    offset: float
    sigma: float


def camera_clocks(body: BodyModel, imus: Mapping[str, ImuSamples]) -> dict[str, InertialClock]:
    """Clock offsets of cameras whose sensors moved enough, against the first on the root, or of all.

    Args:
        body: with the sensors' calibrations in its mounts.
        imus: camera -> samples of its sensor, by its own clock.

    Returns:
        Camera -> its clock, of the largest group of cameras that are linked by joints; empty if there is none.
    """
    mounts = {name: mount for name, mount in body.mounts.items() if mount.imu is not None and name in imus}
    start_ns = max((int(imus[name].stamps_ns[0]) for name in mounts if len(imus[name])), default=0)
    signals = {name: signal for name, mount in mounts.items() if (signal := _resample(imus[name], mount, start_ns))}
    # The root's have the most neighbours.
    cameras = sorted(signals, key=lambda camera: (mounts[camera].segment != body.root, camera))
    links = []
    for i, j in combinations(range(len(cameras)), 2):
        first, second = cameras[i], cameras[j]
        if (points := _common_point(body, mounts[first], mounts[second])) is not None:
            magnitudes = (
                signals[camera].magnitude(_in_camera(mounts[camera], point))
                for camera, point in zip((first, second), points, strict=True)
            )
            if (link := _pair_offset(*magnitudes)) is not None:
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
    # A sensor's stamps are late by its time offset: its error goes into the camera's clock.
    delays = [imu.time_offset_sigma for i in group if (imu := mounts[cameras[i]].imu) is not None]
    sigmas = np.append(0.0, np.sqrt(np.diag(covariance) + np.square(delays[1:]) + delays[0] ** 2))
    return {cameras[i]: InertialClock(float(offsets[k]), float(sigmas[k])) for i, k in row.items()}


def _common_point(body: BodyModel, first: CameraMount, second: CameraMount) -> tuple[Array, Array] | None:
    """A point (3,) that the segments of two cameras have in common, in the frame of each [m]; None without a joint."""
    if first.segment == second.segment:
        middle = 0.5 * (first.segment_T_camera[:3, 3] + second.segment_T_camera[:3, 3])
        return middle, middle
    for joint in body.tree_joints:
        places = {joint.parent: joint.parent_T_joint[:3, 3], joint.child: joint.child_T_joint[:3, 3]}
        if joint.type != "free" and places.keys() == {first.segment, second.segment}:
            return places[first.segment], places[second.segment]
    return None


def _in_camera(mount: CameraMount, point: Array) -> Array:
    """A point (3,) of a segment in the frame of a camera on it [m]."""
    located: Array = mount.segment_T_camera[:3, :3].T @ (point - mount.segment_T_camera[:3, 3])
    return located


@dataclass(frozen=True, eq=False)
class _Signal:
    """Filtered samples at an even rate, along the camera's axes.

    Attributes:
        force: (N, 3) specific force at the sensor [m/s^2].
        by_place: (N, 3, 3) how that of a point grows with its place from the sensor [1/s^2].
        sensor: (3,) place of the sensor in the camera's frame [m].
    """

    force: Array
    by_place: Array
    sensor: Array

    def magnitude(self, point: Array) -> Array:
        """Magnitude (N,) of the specific force at a point (3,) of the camera's frame [m/s^2]."""
        return np.asarray(np.linalg.norm(self.force + self.by_place @ (point - self.sensor), axis=1))


def _resample(samples: ImuSamples, mount: CameraMount, start_ns: int) -> _Signal | None:
    """The samples of a camera from a stamp on; None if they are too few."""
    assert mount.imu is not None
    samples = mount.imu.correct(samples)
    seconds = 1e-9 * (samples.stamps_ns - start_ns).astype(np.float64)
    if np.sum(seconds >= 0.0) < 0.3 * _LEAST_S * _RATE:
        return None
    # Means over even intervals: the difference of integrals, whatever the sensor's rate is.
    edges = np.arange(0.0, min(float(seconds[-1]), _LONGEST_S), 0.5 / _RATE)
    values = np.concatenate([samples.angular_velocity, samples.acceleration], axis=1)
    integrals = cumulative_trapezoid(values, seconds, axis=0, initial=0.0)
    even = 2.0 * _RATE * np.diff([np.interp(edges, seconds, column) for column in integrals.T], axis=1)
    filtered = gaussian_filter1d(even, 2.0 * _SMOOTHING_S * _RATE, axis=1)[:, ::2].T
    w, turning = hat(filtered[:, :3]), hat(np.gradient(filtered[:, :3], 1.0 / _RATE, axis=0))
    return _Signal(filtered[:, 3:], turning + w @ w, mount.imu.camera_p_imu)


def _pair_offset(m: Array, n: Array) -> tuple[float, float] | None:
    """By how much the second clock is ahead of the first, and its sigma [s], from magnitudes (M,), (N,) [m/s^2].

    None if they have too little in common.
    """
    count = min(len(m), len(n))
    margin = round(_MAX_OFFSET_S * _RATE) if count > 4 * _MAX_OFFSET_S * _RATE else count // 8
    inner = np.arange(margin, count - margin)
    if len(inner) < 0.5 * _LEAST_S * _RATE:
        return None
    m, n = m[:count], n[:count]
    # Slopes, since a bias shifts a magnitude.
    wanted, slopes = np.gradient(m)[inner], np.gradient(n)
    if min(np.ptp(wanted), np.ptp(slopes)) < _LEAST_SLOPE:
        return None
    windows = sliding_window_view(slopes, len(inner))
    common = windows @ wanted / (np.linalg.norm(windows, axis=1) * np.linalg.norm(wanted) + _LEAST_SLOPE)
    best = int(np.argmax(common))
    if common[best] < _LEAST_COMMON or best in (0, 2 * margin):
        return None
    samples, lag = np.arange(count), float(best - margin)
    for _ in range(_ROUNDS):
        errors = m[inner] - np.interp(inner + lag, samples, n)
        errors -= np.median(errors)
        slope = np.interp(inner + lag, samples, slopes)
        weights = 1.0 / (1.0 + (errors / _FORCE_SIGMA) ** 2)
        information = float(np.sum(weights * slope**2))
        lag += float(np.clip(np.sum(weights * slope * errors) / information, -1.0, 1.0))
    variance = max(float(np.average(errors**2, weights=weights)), _LEAST_RESIDUAL**2) / float(common[best])
    sigma = max(_CORRELATED * float(np.sqrt(variance / information)) / _RATE, _LEAST_SIGMA_S)
    return (lag / _RATE, sigma) if sigma < _MOST_SIGMA_S else None


def _largest_group(count: int, links: list[tuple[int, int]]) -> list[int]:
    """The largest set of numbers that links connect, ascending."""
    labels: NDArray[np.intp] = np.arange(count)
    for i, j in links:
        labels[labels == labels[j]] = labels[i]
    return np.flatnonzero(labels == np.argmax(np.bincount(labels, minlength=1))).tolist() if count else []
