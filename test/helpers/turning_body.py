"""A body whose segments turn, and how its cameras would measure that: truth for what aligns clocks by motion."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter1d
from scipy.spatial.transform import Rotation

from bodycam_ros.calibration.rig import Rig
from bodycam_ros.tracking.angular_speed import AngularSpeed

_FINE = 480  # [1/s]

RIG = Rig(
    cameras={"waist": "pelvis", "hip": "pelvis", "back": "torso", "chest": "torso", "thigh": "thigh", "shin": "shin"},
    parents={"pelvis": None, "torso": "pelvis", "thigh": "pelvis", "shin": "thigh"},
)


@dataclass(frozen=True)
class Clock:
    """A camera's true clock: body time = start_s + (1 + drift) media time."""

    start_s: float
    drift: float = 0.0
    rate: float = 30.0


def turning_body(seconds: float, seed: int = 0) -> dict[str, NDArray[np.float64]]:
    """Segment -> angular velocity (N, 3) [rad/s] in its own axes, 480 a second, beginning at body time 0."""
    rng = np.random.default_rng(seed)
    samples = int(seconds * _FINE)

    def swing(size: float) -> NDArray[np.float64]:
        """Movements of some tenths of a second, with rests between them."""
        wild = gaussian_filter1d(rng.normal(size=(samples, 3)), 0.12 * _FINE, axis=0)
        lively = np.clip(gaussian_filter1d(rng.normal(size=samples), 0.8 * _FINE) * np.sqrt(_FINE) * 2, 0.02, None)
        values: NDArray[np.float64] = wild / wild.std() * (lively / lively.std())[:, None] * size
        return values

    omega = {"pelvis": swing(0.6)}
    omega["torso"] = _through(omega["pelvis"], swing(0.2), swing(0.3))
    omega["thigh"] = _through(omega["pelvis"], swing(0.3), swing(0.6))
    omega["shin"] = _through(omega["thigh"], swing(0.3), swing(0.6) * [1.0, 0.0, 0.0])
    return omega


def camera_speed(
    name: str, omega: NDArray[np.float64], clock: Clock, duration: float, noise: float = 0.04
) -> AngularSpeed:
    """What a camera measures of its segment's angular velocity: means between images, in its own axes, and noise."""
    rng = np.random.default_rng(sum(map(ord, name)))
    media = np.arange(0.0, duration, 1.0 / clock.rate)
    body_s = clock.start_s + (1.0 + clock.drift) * media
    turned = np.concatenate([np.zeros((1, 3)), np.cumsum(omega, axis=0)]) / _FINE
    at = np.column_stack([np.interp(body_s, np.arange(len(turned)) / _FINE, axis) for axis in turned.T])
    measured = Rotation.random(random_state=rng).apply(np.diff(at, axis=0) / np.diff(body_s)[:, None])
    return AngularSpeed(name, 0.5 * (media[1:] + media[:-1]), measured + rng.normal(0.0, noise, measured.shape))


def _through(
    parent: NDArray[np.float64], joint_angle: NDArray[np.float64], joint: NDArray[np.float64]
) -> NDArray[np.float64]:
    """A child's angular velocity: its parent's, seen through a joint that is bent, and the joint's own."""
    bent = np.cumsum(joint_angle - joint_angle.mean(axis=0), axis=0) / _FINE
    through: NDArray[np.float64] = Rotation.from_rotvec(bent).apply(parent) + joint
    return through
