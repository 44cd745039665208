"""A function that is compiled to machine code by numba.

A kernel is written in plain loops over float64, and has a twin in NumPy that tests hold it to. It states the types that
it is compiled for, so that all kernels can be compiled beforehand, and once.
"""

from collections.abc import Callable
from typing import Any, TypeVar, cast

import numba
from numba.core.sigutils import normalize_signature

F = TypeVar("F", bound=Callable[..., Any])

_entries: list[tuple[Any, tuple[str, ...]]] = []


def kernel(*signatures: str) -> Callable[[F], F]:
    """Compile a function; decorator.

    Divisions by zero and the like give infinity and NaN as in NumPy, and other threads of Python run meanwhile.

    Args:
        signatures: types of the arguments that Python calls it with, such as ``"(f8[::1], f8[:, ::1])"``: C-contiguous,
            writable. Without any it is called by other kernels alone, which are compiled together with it.
    """

    def compiled(function: F) -> F:
        dispatcher = numba.njit(function, cache=bool(signatures), nogil=True, error_model="numpy")
        if signatures:
            _entries.append((dispatcher, signatures))
        return cast(F, dispatcher)

    return compiled


def compile_all() -> None:
    """Compile, or load from where they were kept, all kernels of the modules imported so far."""
    for dispatcher, signatures in _entries:
        for signature in signatures:
            arguments, _ = normalize_signature(signature)
            dispatcher.compile(tuple(arguments))
