"""A function that is compiled to machine code by numba.

A kernel is written in plain loops over float64, and has a twin in NumPy that tests hold it to. It states the types that
it is compiled for, so that all kernels can be compiled beforehand, and once. numba is imported with the first kernel
that is used: it takes 0.2 s, and half of what imports kernels, such as settings, uses none.
"""

import functools
from collections.abc import Callable
from pathlib import Path
from types import FunctionType
from typing import Any, TypeVar, cast

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.kernels.kernel_library import argument_checks, build_library, compiled_function

F = TypeVar("F", bound=Callable[..., Any])

_kernels: list["Kernel"] = []


def kernel(*signatures: str) -> Callable[[F], F]:
    """Compile a function; decorator.

    Divisions by zero and the like give infinity and NaN as in NumPy, and other threads of Python run meanwhile.

    Args:
        signatures: types of the arguments that Python calls it with, such as ``"(f8[::1], f8[:, ::1])"``: C-contiguous,
            writable. Without any it is called by other kernels alone, which are compiled together with it.
    """

    def compiled(function: F) -> F:
        made = Kernel(cast(FunctionType, function), signatures)
        if signatures:
            _kernels.append(made)
        return cast(F, made)

    return compiled


class Kernel:
    """A function, and what numba makes of it when it is first used.

    Args:
        function: plain Python.
        signatures: types of the arguments that it is compiled for beforehand.
    """

    def __init__(self, function: FunctionType, signatures: tuple[str, ...]) -> None:
        functools.update_wrapper(self, function)
        self._function, self.signatures = function, signatures

    def __call__(self, *arguments: Any) -> Any:
        """Call the compiled function."""
        return self._compiled(*arguments)

    @functools.cached_property
    def _compiled(self) -> Callable[..., Any]:
        return cast(Callable[..., Any], self._in_library or self.dispatcher)

    @functools.cached_property
    def _in_library(self) -> Callable[..., Any] | None:
        """The function out of the library of all kernels; None if it is not there."""
        compiled = compiled_function(self._function) if self.signatures else None
        if compiled is None:
            return None
        (signature,) = self.signatures
        checks = argument_checks(signature)

        def checked(*arguments: Any) -> Any:
            try:
                fitting = [check(value) for check, value in zip(checks, arguments, strict=True)]
            except (AttributeError, TypeError, ValueError):  # numba may still take them, or name what is wrong
                return self.dispatcher(*arguments)
            return compiled(*fitting)

        return checked

    @functools.cached_property
    def dispatcher(self) -> Any:
        """The function as numba's own object, its names of other kernels bound to theirs."""
        import numba

        from bodycam_ros.kernels.kernel_cache import keep

        code, known = self._function.__code__, self._function.__globals__
        others = {name: known[name].dispatcher for name in code.co_names if isinstance(known.get(name), Kernel)}
        function = FunctionType(code, known | others, self._function.__name__)
        dispatcher = numba.njit(function, nogil=True, error_model="numpy")
        if self.signatures and dispatcher is not function:  # as it is under NUMBA_DISABLE_JIT
            keep(dispatcher, function)
        return dispatcher

    def compile(self) -> None:
        """Compile it for its types, or load it from where it was kept."""
        if self._in_library is not None:
            return
        from numba.core.sigutils import normalize_signature

        if not isinstance(self.dispatcher, FunctionType):
            for signature in self.signatures:
                arguments, _ = normalize_signature(signature)
                self.dispatcher.compile(tuple(arguments))


def as_rows(values: NDArray[Any]) -> NDArray[np.float64]:
    """An array as the kernels are compiled for it: float64, row by row, writable; itself if it is that already."""
    return np.require(values, np.float64, ("C", "A", "W", "E"))


def as_bytes(values: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """An array of bytes as the kernels are compiled for it; itself if it is that already."""
    return np.require(values, np.uint8, ("C", "A", "W", "E"))


def build_all(folder: Path) -> bool:
    """Compile all kernels of the modules imported so far into a library in a folder; whether it could be done."""
    return build_library(folder, [(each.dispatcher.py_func, each.signatures[0]) for each in _kernels])


def compile_all() -> None:
    """Compile, or load from where they were kept, all kernels of the modules imported so far."""
    for each in _kernels:
        each.compile()
