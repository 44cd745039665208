"""Every piece of supplied equipment is found from anywhere, by nothing but where a body holds it."""

from dataclasses import replace

import numpy as np
import pytest
from known_motion import BODY

from bodycam_ros.equipment.coupled_body import coupled_body
from bodycam_ros.equipment.equipment import Equipment
from bodycam_ros.equipment.equipment_yaml import read_equipment
from bodycam_ros.equipment.supplied_equipment import supplied_equipment
from bodycam_ros.geometry import Array, exp_se3, exp_so3, inverse, log_se3, rigid
from bodycam_ros.solving.equipment_fit import EquipmentFit, HeldPoints, Prior
from bodycam_ros.solving.equipment_place import EquipmentPlace

BODY_M = 0.003


class Found:
    """A piece of equipment that stands anywhere, its joints as they like, lengths as far off as they may be.

    Attributes:
        truth: (E, 4, 4) where it is.
        held: where a body would be seen to hold it.
    """

    def __init__(self, equipment: Equipment, seed: int, noisy: bool = True) -> None:
        random = np.random.default_rng(seed)
        own = {joint.name for joint in equipment.joints}
        tree = [joint for joint in coupled_body(BODY, equipment).tree_joints if joint.name in own]
        self.equipment, self.fit = equipment, EquipmentFit(equipment, tree)
        self.place = EquipmentPlace(equipment, tree, self.fit)
        leans = min(equipment.upright_sigma, np.pi) * random.standard_normal(2)
        R = exp_so3(np.array([0.0, 0.0, random.uniform(-np.pi, np.pi)])) @ exp_so3(np.array([*leans, 0.0]))
        root = rigid(R, random.normal(0.0, 5.0, 3))[None]
        motions = []
        for f in self.fit.chain.freedoms:
            turns = f.joint.type == "hinge"
            spread = np.pi if turns else np.where(np.isinf(f.sigmas), 0.2, f.sigmas)
            motions.append(exp_se3((random.uniform(-1.0, 1.0, (1, len(f.columns))) * spread) @ f.twists.T))
        off = self.fit.lengths.priors * random.uniform(-1.0, 1.0, len(self.fit.lengths))
        self.truth = self.fit.chain.poses(root, motions, off)[0][0]
        points = {}
        for a in equipment.attachments:
            there = self.truth[self.fit.row[a.equipment_segment]]
            on_equipment = self.fit.lengths.attachment(a, off).on_equipment @ there[:3, :3].T + there[:3, 3]
            noise = np.hypot(a.sigmas, BODY_M)[:, None] * random.standard_normal(on_equipment.shape)
            points[a.name] = (on_equipment + noisy * noise)[None]
        self.held = HeldPoints(points, {name: np.ones(1, bool) for name in points})

    def normalised_gaps(self, poses: Array) -> Array:
        """What is between each pair of points, in sigmas of what may be."""
        gaps = []
        for a in self.equipment.attachments:
            there = poses[self.fit.row[a.equipment_segment]]
            off = (self.held.points[a.name][0] - there[:3, 3]) @ there[:3, :3] - a.on_equipment
            unknown = np.sqrt(BODY_M**2 + a.sigmas[:, None] ** 2 + a.unknown**2)
            gaps.append((off / unknown).ravel())
        return np.concatenate(gaps)


@pytest.mark.parametrize("name", supplied_equipment())
def test_it_is_found_from_anywhere(name: str) -> None:
    normalised = []
    for seed in range(4):
        found = Found(read_equipment(name), seed)
        placed = found.place.anywhere(found.held, np.zeros(len(found.fit.lengths)))
        assert placed is not None, seed
        # No farther from what holds it than play, noise and unknown lengths are.
        assert np.abs(found.normalised_gaps(placed.poses)).max() < 3.5
        root = found.fit.chain.root
        normalised.append(log_se3(inverse(found.truth[root]) @ placed.poses[root]) / placed.root_sigmas)
        assert (placed.root_sigmas < 0.35).all()
    assert np.abs(normalised).max() < 4.0
    # 24 numbers of which one is as large as its sigma in the mean; half as sure they would be 4.
    assert 0.4 < np.mean(np.square(normalised)) < 2.2


@pytest.mark.parametrize("name", supplied_equipment())
def test_measured_equipment_that_is_seen_without_noise_is_found_to_a_millimetre(name: str) -> None:
    equipment = read_equipment(name)
    known = [replace(a, unknown=np.zeros(3)) for a in equipment.attachments]
    found = Found(replace(equipment, attachments=tuple(known), unknown={}, upright_sigma=np.inf), 5, noisy=False)
    placed = found.place.anywhere(found.held, np.zeros(0))
    assert placed is not None
    for a in found.equipment.attachments:
        there = placed.poses[found.fit.row[a.equipment_segment]]
        points = a.on_equipment @ there[:3, :3].T + there[:3, 3]
        np.testing.assert_allclose(points, found.held.points[a.name][0], atol=1e-3)


@pytest.mark.parametrize("holding", [(), ("hand_left",), ("foot_left",)])
def test_of_a_bicycle_on_which_hardly_anything_is_held_nobody_knows_where_it_is(holding: tuple[str, ...]) -> None:
    found = Found(read_equipment("bicycle"), 1)
    for name, holds in found.held.holds.items():
        holds[0] = name in holding
    assert found.place.anywhere(found.held, np.zeros(len(found.fit.lengths))) is None


def test_near_a_prediction_it_is_as_it_is_held() -> None:
    found = Found(read_equipment("bicycle"), 2, noisy=False)
    random = np.random.default_rng(0)
    predicted = found.truth @ exp_se3(random.normal(0.0, [0.05] * 3 + [0.02] * 3, (len(found.truth), 6)))
    prior = Prior(predicted, np.tile(np.repeat([0.3, 0.1], 3), (len(predicted), 1)))
    near = found.place.near(found.held, np.zeros(len(found.fit.lengths)), prior)
    crank, pedals = found.fit.row["crank"], [found.fit.row[f"pedal_{side}"] for side in ("left", "right")]
    np.testing.assert_allclose(near[[crank, *pedals], :3, 3], found.truth[[crank, *pedals], :3, 3], atol=0.003)
    for holds in found.held.holds.values():
        holds[0] = False
    np.testing.assert_array_equal(found.place.near(found.held, np.zeros(len(found.fit.lengths)), prior), predicted)


@pytest.mark.parametrize("turned", [1.0, 2.5, np.pi, -1.7])
def test_around_a_prediction_the_crank_may_have_turned_by_anything(turned: float) -> None:
    """After a second without images; a small step would find the nearest angle, if any."""
    found = Found(read_equipment("bicycle"), 3, noisy=False)
    fit, lengths = found.fit, np.zeros(len(found.fit.lengths))
    motions = fit.chain.motions(found.truth[None], lengths)
    motions[0] = motions[0] @ rigid(exp_so3(np.array([0.0, turned, 0.0])), np.zeros(3))
    motions[1:] = [np.eye(4)[None]] * 2
    before = fit.chain.poses(found.truth[None, fit.chain.root], motions, lengths)[0][0]
    prior = Prior(before, np.tile(np.repeat([0.1, 0.01], 3), (len(before), 1)))
    around = found.place.around(found.held, lengths, prior)
    crank = fit.row["crank"]
    # The saddle is not where it is said to be, and tips the frame a little.
    angle = np.linalg.norm(log_se3(inverse(found.truth[crank]) @ around[crank])[:3])
    assert angle < np.radians(3.0)


def test_nominal_is_the_machine_with_its_joints_at_rest() -> None:
    found = Found(read_equipment("bicycle"), 4)
    there = exp_se3(np.array([0.1, 0.2, 0.3, 1.0, 2.0, 3.0]))
    poses = inverse(there) @ found.place.nominal(there, {"crank_axle": 0.5 * np.pi})
    row = found.fit.row
    np.testing.assert_allclose(poses[row["frame"]], np.eye(4), atol=1e-12)
    # A quarter of a turn forwards, the left pedal is below.
    np.testing.assert_allclose(poses[row["pedal_left"], :3, 3], [0.0, 0.125, -0.17], atol=1e-12)
    np.testing.assert_allclose(poses[row["pedal_right"], :3, 3], [0.0, -0.125, 0.17], atol=1e-12)
