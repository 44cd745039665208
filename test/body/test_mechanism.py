from dataclasses import replace

import numpy as np
import pytest
from helpers.athletes import bicycle
from helpers.known_motion import BODY
from numpy.typing import NDArray

from bodycam_ros.body.coupled_body import coupled_body
from bodycam_ros.body.equipment import Equipment, SegmentMotion
from bodycam_ros.body.mechanism import Mechanism
from bodycam_ros.geometry import exp_se3
from bodycam_ros.kinematics.joint import Joint

Array = NDArray[np.float64]


def with_unknowns() -> Equipment:
    """The bicycle with every kind of freedom: unknown lengths of joints and attachments, a saddle post that slides."""
    bike = bicycle()
    slides = Joint("post", "frame", "saddle", "weld", exp_se3(np.full(6, 0.1)), sigmas=(1e-3,) * 5 + (10.0,))
    attachments = tuple(replace(a, unknown=np.array([0.01, 0.0, 0.02])) for a in bike.attachments)
    seat = replace(attachments[-1], equipment_segment="saddle")
    return replace(
        bike,
        segments={**bike.segments, "saddle": SegmentMotion()},
        joints=(*bike.joints, slides),
        attachments=(*attachments[:-1], seat),
        unknown={"spindle_left": np.array([0.01, 0.0, 0.0]), "crank_axle": np.array([0.0, 0.0, 0.03])},
        upright_sigma=0.05,
    )


@pytest.fixture
def mechanism() -> Mechanism:
    equipment = with_unknowns()
    return Mechanism(coupled_body(BODY, equipment), equipment)


def anywhere(mechanism: Mechanism, seed: int) -> Array:
    """Nothing closed, everything turned, lengths other than said."""
    random = np.random.default_rng(seed)
    return mechanism.tangent.moved(mechanism.resting(), 0.5 * random.normal(size=mechanism.tangent.count))


def rows(mechanism: Mechanism, configuration: Array) -> tuple[Array, Array]:
    constraints = mechanism.constraints(configuration)
    priors, by_priors = mechanism.priors(configuration)
    return np.append(constraints.residuals, priors), np.vstack([constraints.jacobian, by_priors])


@pytest.mark.parametrize("seed", range(3))
def test_the_jacobian_is_the_numeric_one_in_every_column(mechanism: Mechanism, seed: int) -> None:
    configuration = anywhere(mechanism, seed)
    _, analytic = rows(mechanism, configuration)
    assert analytic.shape[1] == mechanism.tangent.count == 6 + 36 + 6 + 3 + 1 + 2 + 2 * 5
    assert len(mechanism.moving) == mechanism.tangent.count - 2 - 2 * 5
    h = 1e-6
    for column in range(mechanism.tangent.count):
        step = np.zeros(mechanism.tangent.count)
        step[column] = h
        after, _ = rows(mechanism, mechanism.tangent.moved(configuration, step))
        before, _ = rows(mechanism, mechanism.tangent.moved(configuration, -step))
        numeric = (after - before) / (2.0 * h)
        scale = 1.0 + np.abs(numeric)
        np.testing.assert_allclose(analytic[:, column] / scale, numeric / scale, atol=3e-6, err_msg=str(column))
