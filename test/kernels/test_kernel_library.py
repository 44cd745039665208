"""Kernels out of the library of all kernels: real ones, which an installation has compiled."""

import threading

import numpy as np
import pytest

from bodycam_ros import geometry_kernels
from bodycam_ros.kernels.kernel_library import argument_checks, compiled_function
from bodycam_ros.kernels.preparation import prepare_kernels
from bodycam_ros.tracking import rotation_kernels


@pytest.fixture(autouse=True)
def library() -> None:
    prepare_kernels()
    if compiled_function(geometry_kernels.exp_se3._function) is None:
        pytest.skip("kernels are in numba's cache here")


def test_what_the_library_does_not_take_goes_to_numba() -> None:
    xi = np.array([0.1, -0.2, 0.3, 1.0, 2.0, 3.0])
    expected = geometry_kernels.exp_se3(xi)
    strided = np.column_stack([xi, xi])[:, 0]
    read_only = xi.copy()
    read_only.flags.writeable = False
    for other in (strided, read_only):
        np.testing.assert_array_equal(geometry_kernels.exp_se3(other), expected)
    np.testing.assert_allclose(geometry_kernels.exp_se3(xi.astype(np.float32)), expected, atol=1e-6)


@pytest.mark.parametrize("wrong", [None, 1.0, "x"])
def test_what_nobody_takes_is_an_error(wrong: object) -> None:
    with pytest.raises(Exception, match="."):
        geometry_kernels.exp_se3(wrong)
    with pytest.raises(TypeError):
        geometry_kernels.exp_se3()


def test_checks_of_a_signature() -> None:
    array, real, whole = argument_checks("(u2[:, ::1], f8, i8)")
    image = np.zeros((2, 3), np.uint16)
    assert array(image) is image and real(2) == 2.0 and whole(np.int64(3)) == 3
    for check, wrong in ((array, image.T), (array, image[0]), (array, image.astype("u1")), (whole, 1.5)):
        with pytest.raises(TypeError):
            check(wrong)


def test_other_threads_run_meanwhile() -> None:
    rng = np.random.default_rng(0)
    bearings = rng.normal(size=(30_000, 3))
    bearings /= np.linalg.norm(bearings, axis=1, keepdims=True)
    samples = rng.integers(0, len(bearings), (2, 500))
    kernel = threading.Thread(target=rotation_kernels.agreed_rotation, args=(bearings, bearings, samples, 0.01, 5))
    counted = 0
    kernel.start()
    while kernel.is_alive():
        counted += 1
    assert counted > 10_000  # it would be switched to once or twice
