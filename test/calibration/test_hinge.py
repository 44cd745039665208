"""A eq. 16-17: the straight limb of the N-pose places a hinge's joint on its axis."""

import numpy as np
import pytest

from bodycam_ros.calibration.hinge import shift_to_line

HIP, ANKLE = np.array([0.1, 0.09, 0.9]), np.array([0.12, 0.1, 0.06])
KNEE = HIP + 0.48 * (ANKLE - HIP)
AXIS = np.array([0.1, 0.98, 0.05]) / np.linalg.norm([0.1, 0.98, 0.05])


@pytest.mark.parametrize("away", [-0.3, 0.0, 0.07])
def test_exact(away: float) -> None:
    shift = shift_to_line(KNEE + away * AXIS, AXIS, ANKLE, HIP - ANKLE)
    np.testing.assert_allclose(KNEE + (away + shift) * AXIS, KNEE, atol=1e-9)


def test_it_solves_the_printed_equation_by_least_squares() -> None:
    """A eq. 17, [H - A]x (K - A) = 0 with K = V c, by numpy's least squares; here for an axis that misses the line."""
    on_axis = KNEE + np.array([0.01, 0.2, -0.02])
    cross = np.cross(HIP - ANKLE, np.eye(3)).T
    c = np.linalg.lstsq((cross @ AXIS)[:, None], -cross @ (on_axis - ANKLE), rcond=None)[0][0]
    assert shift_to_line(on_axis, AXIS, ANKLE, HIP - ANKLE) == pytest.approx(c, abs=1e-12)
