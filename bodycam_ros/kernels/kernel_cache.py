"""numba's cache of compiled functions, in the folder of the kernels instead of one per source file."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

from numba.core.caching import CompileResultCacheImpl, FunctionCache, UserProvidedCacheLocator

from bodycam_ros.kernels.kernel_folder import KERNEL_FILES, PACKAGE, kernel_folder

_KNOWN = {PACKAGE / file for file in KERNEL_FILES}
_unsaved: list[str] = []


def keep(dispatcher: Any, function: Callable[..., Any]) -> None:
    """Have numba keep what it compiles of a function, if there is a folder, whose name changes with its source."""
    if Path(function.__code__.co_filename) in _KNOWN and kernel_folder() is not None:
        dispatcher._cache = _KernelCache(function)


def all_saved() -> bool:
    """Whether the disk took all that was compiled by this process."""
    return not _unsaved


class _KernelLocator(UserProvidedCacheLocator):  # type: ignore[misc]
    """Places a kernel in ``kernel_folder``, which may be read-only."""

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
