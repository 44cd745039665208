"""All kernels as one shared library, which a process loads in a millisecond: numba itself takes 0.6 s of its processor.

The library is made by numba's ahead-of-time compiler with the machine's C compiler. Where that fails, kernels come from
numba's cache. A function of the library takes exactly the types that it was compiled for and would take the memory of
any other array for one of these, so each call is checked, and what does not fit goes to numba.
"""

import logging
import os
import re
import tempfile
import warnings
from collections.abc import Callable, Iterable
from functools import cache
from importlib.machinery import EXTENSION_SUFFIXES, ExtensionFileLoader
from importlib.util import module_from_spec, spec_from_file_location
from operator import index
from pathlib import Path
from types import FunctionType, ModuleType
from typing import Any

import numpy as np

from bodycam_ros.kernels.kernel_folder import is_complete, kernel_folder

logger = logging.getLogger(__name__)

_NAME = "bodycam_kernels"
_FILE = _NAME + EXTENSION_SUFFIXES[0]
_ARGUMENT = re.compile(r"([biuf]\d)(\[[:, ]*::1\])?")


def compiled_function(function: FunctionType) -> Callable[..., Any] | None:
    """A kernel out of the library, unchecked; None if there is no library, or the function is not in it."""
    library = _library()
    return None if library is None else getattr(library, _symbol(function), None)


def argument_checks(signature: str) -> list[Callable[[Any], Any]]:
    """For each argument of a signature what returns it, fit for the library, or raises TypeError."""
    found = _ARGUMENT.findall(signature)
    return [_array_check(kind, shape.count(":") - 1) if shape else _SCALARS[kind] for kind, shape in found]


def build_library(folder: Path, kernels: Iterable[tuple[FunctionType, str]]) -> bool:
    """Compile kernels, whose names of others are bound to numba's objects, into a folder; whether it could be done."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # that it will be replaced one day
            from numba.pycc import CC, compiler
        with tempfile.TemporaryDirectory(dir=folder) as place:
            library = CC(_NAME)
            library.output_dir, library.output_file = place, _FILE
            library.target_cpu = os.environ.get("NUMBA_CPU_NAME", "host")
            for function, signature in kernels:
                library.export(_symbol(function), signature)(function)
            usual = compiler.Flags
            compiler.Flags = _flags
            try:
                library.compile()
            finally:
                compiler.Flags = usual
            (Path(place) / _FILE).replace(folder / _FILE)
    except Exception as error:  # no compiler, no headers of Python, no room
        logger.info("kernels are kept in numba's cache: %s", error)
        return False
    return True


def _flags() -> Any:
    from numba.core.compiler import Flags

    flags = Flags()
    flags.release_gil, flags.error_model = True, "numpy"
    return flags


@cache
def _library() -> ModuleType | None:
    folder = kernel_folder() if os.environ.get("NUMBA_DISABLE_JIT", "0") == "0" else None
    if folder is None or not (folder / _FILE).exists() or not is_complete(folder):
        return None
    loader = ExtensionFileLoader(_NAME, str(folder / _FILE))
    spec = spec_from_file_location(_NAME, folder / _FILE, loader=loader)
    assert spec is not None
    try:
        module = module_from_spec(spec)
        loader.exec_module(module)
    except ImportError:
        return None
    return module


def _symbol(function: FunctionType) -> str:
    module: str = function.__globals__["__name__"]
    return f"{module}.{function.__name__}".replace(".", "_")


def _array_check(kind: str, dimensions: int) -> Callable[[Any], Any]:
    dtype = np.dtype(kind)

    def check(value: Any) -> Any:
        if value.dtype is dtype and value.ndim == dimensions and value.flags.carray:  # in rows, aligned, writable
            return value
        raise TypeError

    return check


def _whole(value: Any) -> int:
    return index(value)


def _real(value: Any) -> float:
    return float(value)


_SCALARS: dict[str, Callable[[Any], Any]] = {"f8": _real, "i8": _whole}
