"""The fit of a machine to what holds it: exact where nothing errs, and as sure of itself as it may be where it does."""

from dataclasses import replace

import numpy as np
import pytest
from athletes import CRANK_M, bicycle, cyclist

from bodycam_ros.body.equipment import Equipment, SegmentMotion
from bodycam_ros.estimation.equipment_fit import AttachedPoints, EquipmentFit, FittedEquipment
from bodycam_ros.geometry import Array, exp_se3, inverse, log_se3

BODY_M = 0.003
"""By so much a seen segment errs, as the fit has it."""

LENGTHS = {"spindle_left": (0.02, 0.0, 0.0), "spindle_right": (0.02, 0.015, 0.0)}
"""What is unknown: both cranks, and by how much the right pedal is farther out."""


def unmeasured(bike: Equipment, prior_m: float | None = None) -> Equipment:
    """A bicycle of which lengths are unknown, by as much as ``LENGTHS`` says or some [m]."""
    unknown = {name: np.array(off) for name, off in LENGTHS.items()}
    if prior_m is not None:
        unknown = {name: prior_m * np.sign(off) for name, off in unknown.items()}
    return replace(bike, unknown=unknown)


def ridden(equipment: Equipment, off: Array, instants: int) -> Array:
    """Poses (T, E, 4, 4) of a bicycle whose lengths are off by some (L) [m], one turn long."""
    fit = EquipmentFit(equipment, equipment.joints)
    cycled = cyclist(1.0, 60.0)
    every = cycled.equipment_poses[np.linspace(0, len(cycled.times) - 1, instants).astype(int)]
    poses, _ = fit.chain.poses(every[:, 0], fit.chain.motions(every, np.zeros(len(off))), off)
    return poses


def held(equipment: Equipment, poses: Array, noise: np.random.Generator | None = None) -> AttachedPoints:
    """Where a body holds poses (T, E, 4, 4): exactly, or as far off as its play and its cameras have it."""
    row = {name: row for row, name in enumerate(equipment.segments)}
    points = {}
    for a in equipment.attachments:
        pose = poses[:, row[a.equipment_segment]]
        points[a.name] = a.on_equipment @ np.swapaxes(pose[:, :3, :3], 1, 2) + pose[:, None, :3, 3]
        if noise is not None:
            sigmas = np.hypot(a.sigmas, BODY_M)[:, None]
            points[a.name] = points[a.name] + sigmas * noise.standard_normal(points[a.name].shape)
    return points


def elsewhere(poses: Array, random: np.random.Generator) -> Array:
    """Each segment by some centimetres and degrees."""
    return poses @ exp_se3(random.normal(0.0, 0.05, (*poses.shape[:2], 6)))


@pytest.mark.parametrize("stands", [True, False])
def test_without_noise_centre_radius_and_lateral_offset_are_exact(stands: bool) -> None:
    bike = unmeasured(bicycle(), prior_m=10.0)
    bike = replace(bike, segments={**bike.segments, "frame": SegmentMotion(stands=stands)})
    off = np.array([0.013, 0.011, -0.009])
    truth = ridden(bike, off, 12)
    fitted = EquipmentFit(bike, bike.joints).solve(
        elsewhere(truth, np.random.default_rng(2)), np.zeros(3), held(bike, truth)
    )
    np.testing.assert_allclose(fitted.lengths, off, atol=1e-6)
    np.testing.assert_allclose(fitted.poses, truth, atol=1e-6)
    assert np.linalg.norm(fitted.poses[0, 2, :3, 3] - fitted.poses[0, 1, :3, 3]) == pytest.approx(
        np.hypot(CRANK_M + off[0], 0.125), abs=1e-6
    )


@pytest.fixture(scope="module")
def trials() -> list[tuple[Array, FittedEquipment, Array, Array]]:
    """Bicycles as unlike what they are said to be as they may be, each seen with noise."""
    made = []
    for seed in range(60):
        random = np.random.default_rng(seed)
        bike = unmeasured(bicycle())
        fit = EquipmentFit(bike, bike.joints)
        off = fit.lengths.priors * random.standard_normal(3)
        truth = ridden(bike, off, 10)
        fitted = fit.solve(truth @ exp_se3(np.full(6, 0.02)), np.zeros(3), held(bike, truth, random))
        made.append((off, fitted, truth, fit.lengths.priors))
    return made


def test_with_noise_lengths_are_as_far_off_as_their_sigmas_say(
    trials: list[tuple[Array, FittedEquipment, Array, Array]],
) -> None:
    normalised = np.array([(fitted.lengths - off) / fitted.length_sigmas for off, fitted, _, _ in trials])
    # The mean of 60 squares errs by 0.18; of a sigma that is half or twice what it should be it is 4 or 0.25.
    assert (np.abs(np.mean(normalised**2, axis=0) - 1.0) < 0.6).all()
    assert (np.abs(normalised) < 4.0).all()
    for _, fitted, _, priors in trials:
        assert (fitted.length_sigmas < 0.15 * priors).all()


def test_with_noise_it_stands_as_near_to_the_truth_as_its_sigmas_say(
    trials: list[tuple[Array, FittedEquipment, Array, Array]],
) -> None:
    normalised = np.array(
        [log_se3(inverse(truth[0, 0]) @ fitted.poses[0, 0]) / fitted.root_sigmas for _, fitted, truth, _ in trials]
    )
    assert (np.abs(np.mean(normalised**2, axis=0) - 1.0) < 0.6).all()
    for _, fitted, _, _ in trials:
        assert np.ptp(fitted.poses[:, 0], axis=0).max() < 1e-9
        assert fitted.root_sigmas[3:].max() < 0.006
