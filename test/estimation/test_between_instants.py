"""What is measured of two instants: Jacobians by differences, and turns that are told."""

import numpy as np
import pytest

from bodycam_ros.estimation.between_factors import Between, RestingPoint, SegmentTurn
from bodycam_ros.geometry import exp_se3, exp_so3

SMALL = 1e-6
RNG = np.random.default_rng(2)
PLACE, WHITENING = RNG.normal(size=3), RNG.normal(size=(3, 3))
BEFORE, STEP = exp_se3(RNG.normal(size=6)), RNG.normal(scale=0.2, size=6)


@pytest.mark.parametrize(
    "measured",
    [
        SegmentTurn(0, exp_so3(STEP[:3]), 0.01),
        RestingPoint(0, PLACE, WHITENING, None),
        RestingPoint(0, PLACE, WHITENING, RNG.normal(size=3)),
    ],
)
def test_residuals_lessen_as_their_jacobians_say(measured: Between) -> None:
    after = BEFORE @ exp_se3(STEP)
    if isinstance(measured, SegmentTurn):
        after[:3, :3] = BEFORE[:3, :3] @ exp_so3(-STEP[:3])  # exact where nothing is left of the turn
        measured = SegmentTurn(0, BEFORE[:3, :3].T @ after[:3, :3], 0.01)
    _, by_after, by_before = measured.residual(BEFORE, after)
    for axis in range(6):
        step = SMALL * np.eye(6)[axis]
        for by, ends in (
            (by_after, [(BEFORE, after @ exp_se3(sign * step)) for sign in (1.0, -1.0)]),
            (by_before, [(BEFORE @ exp_se3(sign * step), after) for sign in (1.0, -1.0)]),
        ):
            late, early = (measured.residual(*end)[0] for end in ends)
            np.testing.assert_allclose(by[:, axis], -(late - early) / (2.0 * SMALL), atol=1e-5)
