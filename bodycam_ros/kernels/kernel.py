"""A function that is compiled to machine code by numba.

A kernel is written in plain loops over float64, and has a twin in NumPy that tests hold it to. It states the types that
it is compiled for, so that all kernels can be compiled beforehand, and once.
"""

from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar, cast

import numba
import numpy as np
from numba.core.caching import CompileResultCacheImpl, FunctionCache, UserProvidedCacheLocator
from numba.core.sigutils import normalize_signature
from numpy.typing import NDArray

from bodycam_ros.kernels.kernel_folder import KERNEL_FILES, PACKAGE, kernel_folder

F = TypeVar("F", bound=Callable[..., Any])

_entries: list[tuple[Any, tuple[str, ...]]] = []
_unsaved: list[str] = []


def kernel(*signatures: str) -> Callable[[F], F]:
    """Compile a function; decorator.

    Divisions by zero and the like give infinity and NaN as in NumPy, and other threads of Python run meanwhile.

    Args:
        signatures: types of the arguments that Python calls it with, such as ``"(f8[::1], f8[:, ::1])"``: C-contiguous,
            writable. Without any it is called by other kernels alone, which are compiled together with it.
    """

    def compiled(function: F) -> F:
        dispatcher = numba.njit(function, nogil=True, error_model="numpy")
        if signatures and dispatcher is not function:  # as it is under NUMBA_DISABLE_JIT
            _entries.append((dispatcher, signatures))
            if _is_kept(function):
                dispatcher._cache = _KernelCache(function)
        return cast(F, dispatcher)

    return compiled


def as_rows(values: NDArray[Any]) -> NDArray[np.float64]:
    """An array as the kernels are compiled for it: float64, row by row, writable; itself if it is that already."""
    return np.require(values, np.float64, ("C", "A", "W", "E"))


def as_bytes(values: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """An array of bytes as the kernels are compiled for it; itself if it is that already."""
    return np.require(values, np.uint8, ("C", "A", "W", "E"))


def compile_all() -> None:
    """Compile, or load from where they were kept, all kernels of the modules imported so far."""
    for dispatcher, signatures in _entries:
        for signature in signatures:
            arguments, _ = normalize_signature(signature)
            dispatcher.compile(tuple(arguments))


def all_saved() -> bool:
    """Whether the disk took all that was compiled by this process."""
    return not _unsaved


def _is_kept(function: Callable[..., Any]) -> bool:
    """Whether there is a folder, whose name changes with the kernel's source."""
    known = {PACKAGE / file for file in KERNEL_FILES}
    return Path(function.__code__.co_filename) in known and kernel_folder() is not None


class _KernelLocator(UserProvidedCacheLocator):  # type: ignore[misc]
    """Says that a kernel is kept in ``kernel_folder``, which may be read-only."""

    def __init__(self, function: Callable[..., Any], file: str) -> None:
        super().__init__(function, file)
        folder = kernel_folder()
        assert folder is not None
        self._cache_path = str(folder / Path(file).parent.name)

    @classmethod
    def from_function(cls, function: Callable[..., Any], file: str) -> "_KernelLocator":
        return cls(function, file)


class _KernelCacheFiles(CompileResultCacheImpl):  # type: ignore[misc]
    _locator_classes = [_KernelLocator]


class _KernelCache(FunctionCache):  # type: ignore[misc]
    """Files that are damaged, and a disk that is full, cost time and nothing else."""

    _impl_class = _KernelCacheFiles

    def load_overload(self, signature: Any, target_context: Any) -> Any:
        try:
            return super().load_overload(signature, target_context)
        except Exception:  # what a damaged file makes of unpickling
            return None

    def save_overload(self, signature: Any, data: Any) -> None:
        try:
            super().save_overload(signature, data)
        except OSError as error:
            _unsaved.append(str(error))
