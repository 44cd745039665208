"""Scale and vertical of a map from simulated sensors on limbs that swing, in a map of another scale and rotation."""

import numpy as np
import pytest
from helpers.naming import naming
from numpy.typing import NDArray

from bodycam_ros.errors import MapError
from bodycam_ros.geometry import exp_so3, log_so3
from bodycam_ros.inertial.imu_samples import GRAVITY, ImuSamples
from bodycam_ros.inertial.map_alignment import align_to_gravity

START_NS = 1_700_000_000_000_000_000
SECONDS = 10.0
MAP_R_WORLD, UNITS_PER_METRE = exp_so3(np.array([0.7, -0.4, 0.3])), 1.25
LEVER_M = np.array([0.008, -0.01, 0.005])
Array = NDArray[np.float64]


def motion(t: Array, phase: float, swing: float) -> tuple[Array, Array]:
    """Orientation (T, 3, 3) and position (T, 3) [m] of a camera."""
    waves = np.sin(2.0 * np.pi * np.array([0.7, 0.9, 1.1]) * t[:, None] + phase * np.array([1.0, 2.0, 3.0]))
    return exp_so3(0.6 * waves) @ exp_so3(np.array([0.3 * phase, 1.0, 0.2])), swing * np.roll(waves, 1, axis=1)


def sensor(phase: float, swing: float, random: np.random.Generator) -> ImuSamples:
    """Samples at 200 Hz by finite differences, with biases, noise and a lever arm."""
    t = np.arange(0.0, SECONDS, 0.005)
    h = 1e-4
    R = [motion(t + step * h, phase, swing)[0] for step in (-1, 0, 1)]
    p = [motion(t + step * h, phase, swing)[1] + (R[step + 1] @ LEVER_M) for step in (-1, 0, 1)]
    w = log_so3(np.swapaxes(R[0], 1, 2) @ R[2]) / (2.0 * h)
    force = (p[0] - 2.0 * p[1] + p[2]) / h**2 + [0.0, 0.0, GRAVITY]
    a = np.einsum("nji,nj->ni", R[1], force)
    w += np.array([0.01, -0.005, 0.008]) + 0.003 * random.normal(size=w.shape)
    a += np.array([0.06, -0.05, 0.04]) + 0.03 * random.normal(size=a.shape)
    return ImuSamples((START_NS + np.round(1e9 * t)).astype(np.int64), w, a)


def registered(phase: float, swing: float, random: np.random.Generator) -> tuple[NDArray[np.int64], Array]:
    """Poses at 30 Hz in the map, which err by a millimetre."""
    t = np.arange(0.2, SECONDS - 0.2, 1.0 / 30.0)
    R, p = motion(t, phase, swing)
    poses = np.tile(np.eye(4), (len(t), 1, 1))
    poses[:, :3, :3] = MAP_R_WORLD @ R
    poses[:, :3, 3] = UNITS_PER_METRE * (p + 0.001 * random.normal(size=p.shape)) @ MAP_R_WORLD.T
    return (START_NS + np.round(1e9 * t)).astype(np.int64), poses


def test_scale_and_vertical_are_found() -> None:
    random = np.random.default_rng(1)
    phases = {"left": 0.3, "right": 1.1, "head": 2.0}
    poses = {camera: registered(phase, 0.25, random) for camera, phase in phases.items()}
    imus = {camera: sensor(phase, 0.25, random) for camera, phase in phases.items()}
    found = align_to_gravity(poses, imus)
    assert found.cameras == 3
    assert found.scale * UNITS_PER_METRE == pytest.approx(1.0, abs=min(0.01, 3.0 * found.scale_sigma))
    assert np.degrees(np.arccos(found.up @ MAP_R_WORLD[:, 2])) < 0.2


def test_cameras_that_only_turn_do_not_give_a_scale() -> None:
    random = np.random.default_rng(2)
    with naming(MapError, "scale"):
        align_to_gravity({"left": registered(0.3, 1e-4, random)}, {"left": sensor(0.3, 1e-4, random)})


def test_a_sensor_in_wrong_units_is_left_out() -> None:
    random = np.random.default_rng(3)
    samples = sensor(0.3, 0.25, random)
    degrees = ImuSamples(samples.stamps_ns, np.degrees(samples.angular_velocity), samples.acceleration)
    with naming(MapError, "inertial sensor"):
        align_to_gravity({"left": registered(0.3, 0.25, random)}, {"left": degrees})
