"""Functions that are compiled to machine code when the package is built.

A kernel is written in plain loops over float64, in a file ``*_kernels.py``; tests compare it with NumPy, numeric
derivatives or another library. It states the types that it is compiled for. ``compile_kernels.py``, beside
``setup.py``, compiles all of them by numba into one library, so that no process needs numba or a compiler.
"""

import functools
import importlib
import operator
import re
from collections.abc import Callable
from types import ModuleType
from typing import Any, TypeVar, cast

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.errors import KernelError

F = TypeVar("F", bound=Callable[..., Any])
LIBRARY = "bodycam_ros.compiled_kernels"
_REMEDY = "install bodycam_ros (docs/install.md), or run `make kernels` in its sources"
_ARGUMENT = re.compile(r"([biuf]\d)(\[[:, ]*::1\])?")


def kernel(signature: str | None = None) -> Callable[[F], F]:
    """Compile a function when the package is built; decorator.

    Divisions by zero and the like give infinity and NaN as in NumPy, and other threads of Python run meanwhile. An
    array that is not as the signature states is copied first; TypeError if it has other dimensions or a type that
    loses digits.

    Args:
        signature: types of the arguments that Python calls it with, such as ``"(f8[::1], f8[:, ::1])"``: C-contiguous,
            writable. Without one it is called by other kernels, which are compiled together with it; from Python it
            runs as Python.
    """

    def compiled(function: F) -> F:
        return function if signature is None else cast(F, Kernel(function, signature))

    return compiled


class Kernel:
    """A function and its machine code.

    Args:
        function: plain Python.
        signature: types of its arguments.
    """

    def __init__(self, function: Callable[..., Any], signature: str) -> None:
        functools.update_wrapper(self, function)
        self._checks = argument_checks(signature)
        self._symbol = symbol(function)

    def __call__(self, *arguments: Any) -> Any:
        """Call the compiled function."""
        # It would take the memory of any array for one of its own types.
        return self._compiled(*[check(value) for check, value in zip(self._checks, arguments, strict=True)])

    @functools.cached_property
    def _compiled(self) -> Callable[..., Any]:
        library = load_kernels()
        if not hasattr(library, self._symbol):
            raise KernelError(f"{library.__file__} is older than {self._symbol}; {_REMEDY}")
        return cast(Callable[..., Any], getattr(library, self._symbol))


def symbol(function: Callable[..., Any]) -> str:
    """Name of a kernel in the library."""
    return f"{function.__module__}.{function.__name__}".replace(".", "_")


@functools.cache
def load_kernels() -> ModuleType:
    """Load the library into this process, so that it is not loaded while images wait.

    Raises:
        KernelError: there is none, or it cannot be loaded.
    """
    try:
        return importlib.import_module(LIBRARY)
    except ImportError as error:
        raise KernelError(f"the compiled kernels cannot be loaded ({error}); {_REMEDY}") from error


def as_rows(values: NDArray[Any]) -> NDArray[np.float64]:
    """An array as the kernels are compiled for it: float64, row by row, writable; itself if it is that already."""
    if isinstance(values, np.ndarray) and values.dtype == np.float64 and values.flags.carray:
        return values
    return np.array(values, np.float64, order="C")


def as_bytes(values: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """An array of bytes as the kernels are compiled for it; itself if it is that already."""
    return np.require(values, np.uint8, ("C", "A", "W", "E"))


def argument_checks(signature: str) -> list[Callable[[Any], Any]]:
    """For each argument of a signature what returns it, fit for the library, or raises TypeError."""
    found = _ARGUMENT.findall(signature)
    return [_array_check(kind, shape.count(":") - 1) if shape else _SCALARS[kind] for kind, shape in found]


def _array_check(kind: str, dimensions: int) -> Callable[[Any], Any]:
    dtype = np.dtype(kind)

    def check(value: Any) -> Any:
        # In rows, aligned, writable.
        if isinstance(value, np.ndarray) and value.dtype == dtype and value.ndim == dimensions and value.flags.carray:
            return value
        array = np.asarray(value)
        if array.ndim != dimensions:
            raise TypeError(f"a kernel wants an array of {dimensions} dimensions, not one of {array.shape}")
        return array.astype(dtype, order="C", casting="same_kind")

    return check


_SCALARS: dict[str, Callable[[Any], Any]] = {"f8": float, "i8": operator.index}
