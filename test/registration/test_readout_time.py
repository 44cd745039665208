"""The filter of one camera's read-out time, and what cameras of one make tell each other."""

import numpy as np
import pytest

from bodycam_ros.camera.readout import UNKNOWN_READOUT, Readout
from bodycam_ros.registration.readout_time import pooled

IMAGES_ALIKE = 6.0
SIZE = (640, 480)


def pool(**readouts: Readout) -> dict[str, Readout]:
    return pooled(readouts, dict.fromkeys(readouts, SIZE))


def test_the_filter_is_the_weighted_mean_of_what_images_say() -> None:
    random = np.random.default_rng(1)
    sigmas = random.uniform(0.001, 0.004, 50)
    said = 0.012 + sigmas * random.standard_normal(50)
    filtered = UNKNOWN_READOUT
    for value, sigma in zip(said, sigmas, strict=True):
        filtered = filtered.updated(value, sigma**-2)
    weights = np.append(sigmas**-2 / IMAGES_ALIKE, 0.015**-2)
    assert filtered.seconds == pytest.approx(np.average(np.append(said, 0.0), weights=weights))
    assert filtered.sigma == pytest.approx(weights.sum() ** -0.5)
    assert abs(filtered.seconds - 0.012) < 3.0 * filtered.sigma


def test_a_camera_that_hardly_moved_takes_the_others_readout_time() -> None:
    sure = {"a": Readout(0.01195, 0.0002), "b": Readout(0.0121, 0.0003), "c": Readout(0.0120, 0.0002)}
    found = pool(**sure, waist=Readout(0.0140, 0.0014), still=Readout(0.0, 0.015))
    for camera in ("waist", "still"):
        assert found[camera].seconds == pytest.approx(0.012, abs=2e-4)
        assert 1e-4 < found[camera].sigma < 3e-4


def test_one_of_another_make_keeps_its_own() -> None:
    other = Readout(0.0, 0.0003)
    found = pool(a=Readout(0.012, 0.0002), b=Readout(0.0121, 0.0003), c=Readout(0.0118, 0.0002), other=other)
    assert found["other"] == other
    assert found["a"].seconds == pytest.approx(0.012, abs=2e-4)


def test_sigmas_of_the_pool_are_honest() -> None:
    random = np.random.default_rng(7)
    square = []
    for _ in range(300):
        sigmas = random.uniform(0.0002, 0.0015, 6)
        truth = 0.012 + 1e-4 * random.standard_normal(6)
        readouts = {
            str(k): Readout(float(truth[k] + sigmas[k] * random.standard_normal()), float(sigmas[k])) for k in range(6)
        }
        found = pooled(readouts, dict.fromkeys(readouts, SIZE))
        square += [((found[str(k)].seconds - truth[k]) / found[str(k)].sigma) ** 2 for k in range(6)]
    assert np.mean(square) == pytest.approx(1.0, abs=0.25)


def test_a_camera_that_hardly_moved_joins_no_two_makes() -> None:
    short, long = Readout(0.0050, 0.0002), Readout(0.0160, 0.0002)
    found = pool(a=short, b=short, c=long, d=long, still=Readout(0.0, 0.015))
    assert found["a"].seconds == pytest.approx(0.005, abs=2e-4) and found["c"].seconds == pytest.approx(0.016, abs=2e-4)
