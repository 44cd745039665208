"""What makes a function a kernel."""

import numpy as np

from bodycam_ros.kernels.kernel import compile_all, kernel


@kernel("(f8[::1],)")
def inverse_sum(values: np.ndarray) -> float:
    total = 0.0
    for value in values:
        total += _inverse(value)
    return total


@kernel()
def _inverse(value: float) -> float:
    return 1.0 / value


def test_a_kernel_is_compiled_for_the_types_it_states_alone() -> None:
    compile_all()
    before = list(inverse_sum.dispatcher.signatures)
    assert len(before) == 1
    assert inverse_sum(np.array([0.5, 0.25])) == 6.0
    assert inverse_sum.dispatcher.signatures == before
