"""Functions compiled to machine code by numba, all in one shared library in the user's cache folder.

A kernel is written in plain loops over float64; tests compare it with NumPy, numeric derivatives or another library. It
states the types that it is compiled for. A process loads the library in some milliseconds, where numba itself takes
0.6 s of its processor and 70 MB, so numba is imported by the process that compiles alone. The library is named after
all that it was made from, and ends with its checksum: one that was cut is made anew. ``python -m
bodycam_ros.kernels`` makes it as part of an installation. Where there is no C compiler, numba keeps the kernels in its
own cache.
"""

import functools
import hashlib
import importlib
import logging
import os
import platform
import re
import sys
import tempfile
import warnings
from collections.abc import Callable
from functools import cache
from importlib.machinery import EXTENSION_SUFFIXES, ExtensionFileLoader
from importlib.metadata import version
from importlib.util import module_from_spec, spec_from_file_location
from operator import index
from pathlib import Path
from types import FunctionType, ModuleType
from typing import Any, TypeVar, cast

import numpy as np
from numpy.typing import NDArray

logger = logging.getLogger(__name__)

F = TypeVar("F", bound=Callable[..., Any])

_PACKAGE = Path(__file__).parent
_NAME = "bodycam_kernels"
_CHECKSUM_BYTES = hashlib.sha256().digest_size
_FAST = {"reassoc", "contract", "arcp", "nsz"}  # sums become vectors; NaN and infinity keep their meaning
_ARGUMENT = re.compile(r"([biuf]\d)(\[[:, ]*::1\])?")

KERNEL_FILES = (
    "geometry_kernels.py",
    "camera/lens_kernels.py",
    "estimation/factors/camera_kernels.py",
    "inertial/preintegration_kernels.py",
    "kinematics/tree_kernels.py",
    "mapping/epipolar_matching.py",
    "registration/descriptor_kernels.py",
    "registration/landmark_choice_kernels.py",
    "registration/patch_kernels.py",
    "registration/pose_kernels.py",
    "registration/search_kernels.py",
    "static_cameras/contour_kernels.py",
    "static_cameras/region_kernels.py",
    "timing/camera_path.py",
)
"""All that hold kernels."""

_CONSTANT_FILES = ("camera/readout.py", "kernels.py")
"""All else that is compiled into them."""

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
    """A function and its machine code, which is loaded when it is first called.

    Args:
        function: plain Python.
        signatures: types of the arguments that it is compiled for.
    """

    def __init__(self, function: FunctionType, signatures: tuple[str, ...]) -> None:
        functools.update_wrapper(self, function)
        self._function, self.signatures = function, signatures

    def __call__(self, *arguments: Any) -> Any:
        """Call the compiled function."""
        return self._compiled(*arguments)

    @functools.cached_property
    def _compiled(self) -> Callable[..., Any]:
        library = _library() if self.signatures else None
        compiled = getattr(library, self.symbol, None)
        if compiled is None:
            return cast(Callable[..., Any], self.dispatcher)
        checks = argument_checks(self.signatures[0])

        def checked(*arguments: Any) -> Any:
            # A function of the library would take the memory of any array for one of its own types.
            try:
                fitting = [check(value) for check, value in zip(checks, arguments, strict=True)]
            except (AttributeError, TypeError, ValueError):  # numba may still take them, or name what is wrong
                return self.dispatcher(*arguments)
            return compiled(*fitting)

        return checked

    @property
    def symbol(self) -> str:
        """Its name in the library."""
        return f"{self._function.__module__}.{self._function.__name__}".replace(".", "_")

    @functools.cached_property
    def dispatcher(self) -> Any:
        """The function as numba's own object, its names of other kernels bound to theirs."""
        import numba

        code, known = self._function.__code__, self._function.__globals__
        others = {name: known[name].dispatcher for name in code.co_names if isinstance(known.get(name), Kernel)}
        function = FunctionType(code, known | others, self._function.__name__)
        return numba.njit(function, nogil=True, error_model="numpy", fastmath=_FAST)

    def load(self) -> None:
        """Load it from the library; without one compile it, or load it from numba's cache."""
        if hasattr(_library(), self.symbol) or not _uses_machine_code():
            return
        from numba.core.sigutils import normalize_signature

        dispatcher = self.dispatcher
        try:
            dispatcher.enable_caching()
        except RuntimeError as error:  # no folder for it
            logger.debug("%s is compiled at every start: %s", self.symbol, error)
        dispatcher.compile(tuple(normalize_signature(self.signatures[0])[0]))


def as_rows(values: NDArray[Any]) -> NDArray[np.float64]:
    """An array as the kernels are compiled for it: float64, row by row, writable; itself if it is that already."""
    if isinstance(values, np.ndarray) and values.dtype == np.float64 and values.flags.carray:
        return values
    return np.array(values, np.float64, order="C")


def as_bytes(values: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """An array of bytes as the kernels are compiled for it; itself if it is that already."""
    return np.require(values, np.uint8, ("C", "A", "W", "E"))


def prepare_kernels() -> None:
    """Compile all kernels, unless that was done before; call it before processes are started that use them."""
    file = library_file()
    if not _uses_machine_code() or _is_whole(file):
        return
    logger.warning("compiling the numerical kernels for this machine, once; takes some 20 s")
    _import_kernels()
    try:
        _build_library(file)
    except Exception as error:  # no compiler, no headers of Python, no room; whatever pycc raises
        logger.warning("the kernels are kept in numba's cache, which makes starts slower: %s: %s", file, error)
        load_kernels()
    _library.cache_clear()


def load_kernels() -> None:
    """Load all kernels into this process, so that none is loaded while images wait."""
    _import_kernels()
    for each in _kernels:
        each.load()


@cache
def library_file() -> Path:
    """The library of this machine and these sources, made or not: in NUMBA_CACHE_DIR or the user's cache folder."""
    # Not by asking numba, whose import takes longer than all else that a tracker loads.
    # Features that are empty (what the processor's name implies) are not the same as features that are not given.
    given = [os.environ.get(variable) for variable in ("NUMBA_CPU_NAME", "NUMBA_CPU_FEATURES")]
    processor = [_this_processor() if text is None else text for text in given]
    machine = (sys.version, version("numba"), version("llvmlite"), np.__version__, *processor)
    sources = [(_PACKAGE / file).read_bytes() for file in (*KERNEL_FILES, *_CONSTANT_FILES)]
    made_from = hashlib.sha256(b"\0".join([text.encode() for text in machine] + sources)).hexdigest()[:16]
    return _cache_folder() / f"{_NAME}-{made_from}{EXTENSION_SUFFIXES[0]}"


def argument_checks(signature: str) -> list[Callable[[Any], Any]]:
    """For each argument of a signature what returns it, fit for the library, or raises TypeError."""
    found = _ARGUMENT.findall(signature)
    return [_array_check(kind, shape.count(":") - 1) if shape else _SCALARS[kind] for kind, shape in found]


def _cache_folder() -> Path:
    for variable, inside in (("NUMBA_CACHE_DIR", ""), ("XDG_CACHE_HOME", "bodycam_ros")):
        if folder := os.environ.get(variable):
            return Path(folder) / inside
    try:
        return Path.home() / ".cache" / "bodycam_ros"
    except RuntimeError:  # a user without a home
        return Path(os.devnull) / "bodycam_ros"


def _this_processor() -> str:
    """What Linux states about the first processor, without what changes from one moment to the next."""
    try:
        lines = Path("/proc/cpuinfo").read_text().partition("\n\n")[0].splitlines()
    except OSError:
        return platform.processor()
    kept = ("vendor_id", "cpu family", "model", "stepping", "flags", "Features", "CPU")
    return "\n".join(line for line in lines if line.startswith(kept))


def _uses_machine_code() -> bool:
    return os.environ.get("NUMBA_DISABLE_JIT", "0") == "0"


def _import_kernels() -> None:
    for file in KERNEL_FILES:
        importlib.import_module(f"bodycam_ros.{file.removesuffix('.py').replace('/', '.')}")


def _build_library(file: Path) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # that it will be replaced one day
        from numba.pycc import CC, compiler
    file.parent.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(dir=file.parent) as place:
        library = CC(_NAME)
        library.output_dir, library.output_file = place, file.name
        library.target_cpu = os.environ.get("NUMBA_CPU_NAME", "host")
        for each in _kernels:
            library.export(each.symbol, each.signatures[0])(each.dispatcher.py_func)
        usual = compiler.Flags
        compiler.Flags = _flags
        try:
            library.compile()
        finally:
            compiler.Flags = usual
        _seal(Path(place) / file.name)
        (Path(place) / file.name).replace(file)


def _seal(file: Path) -> None:
    """Append the checksum of a library to it, which the loader overlooks, and bring both to the disk."""
    with file.open("r+b") as opened:
        opened.write(hashlib.sha256(opened.read()).digest())
        opened.flush()
        os.fsync(opened.fileno())


def _is_whole(file: Path) -> bool:
    """Whether a library can be read, and has the checksum that it was written with.

    One that a crash or a full disk has cut kills the process that runs it.
    """
    try:
        content = memoryview(file.read_bytes())
    except OSError:  # a folder that may not be entered, too
        return False
    return hashlib.sha256(content[:-_CHECKSUM_BYTES]).digest() == content[-_CHECKSUM_BYTES:]


def _flags() -> Any:
    from numba.core.compiler import Flags
    from numba.core.cpu_options import FastMathOptions

    flags = Flags()
    flags.release_gil, flags.error_model = True, "numpy"
    flags.fastmath = FastMathOptions(_FAST)
    return flags


@cache
def _library() -> ModuleType | None:
    file = library_file()
    if not _uses_machine_code() or not _is_whole(file):
        return None
    loader = ExtensionFileLoader(_NAME, str(file))
    spec = spec_from_file_location(_NAME, file, loader=loader)
    assert spec is not None
    try:
        module = module_from_spec(spec)
        loader.exec_module(module)
    except ImportError as error:
        logger.warning("%s: %s; without it commands start slower", file, error)
        return None
    return module


def _array_check(kind: str, dimensions: int) -> Callable[[Any], Any]:
    dtype = np.dtype(kind)

    def check(value: Any) -> Any:
        if value.dtype == dtype and value.ndim == dimensions and value.flags.carray:  # in rows, aligned, writable
            return value
        raise TypeError

    return check


_SCALARS: dict[str, Callable[[Any], Any]] = {"f8": float, "i8": index}


if __name__ == "__main__":
    logging.basicConfig(level=logging.WARNING, format="%(message)s")
    importlib.import_module("bodycam_ros.kernels").prepare_kernels()  # not of __main__, which has no kernels
