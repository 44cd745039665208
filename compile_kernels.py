"""Compiles the kernels of bodycam_ros by numba into one library, ``bodycam_ros.compiled_kernels``: a step of setup.py.

It is for all x86-64 processors since 2013 (AVX2), where the one that builds is such. ``BODYCAM_KERNELS_CPU`` names
another, as LLVM calls it, or is ``native``. numba, a C compiler and Python's headers are needed here alone.
"""

import importlib
import os
import platform
import sys
import tempfile
import warnings
from pathlib import Path
from types import ModuleType
from unittest import mock

from setuptools import Extension
from setuptools.command.build_ext import build_ext
from setuptools.errors import CompileError, LinkError

SOURCES = Path(__file__).resolve().parent
PACKAGE = SOURCES / "bodycam_ros"
LIBRARY = Extension("bodycam_ros.compiled_kernels", [])
CONSTANT_FILES = (PACKAGE / "camera/readout.py", PACKAGE / "kernels.py")
"""What kernels import beside one another."""

_FAST = {"reassoc", "contract", "arcp", "nsz"}  # sums become vectors; NaN and infinity keep their meaning


class CompileKernels(build_ext):
    """``build_ext``, with the kernels as its one extension."""

    def build_extension(self, extension):
        """Compile the library, unless it is newer than all that it is made from."""
        file = Path(self.get_ext_fullpath(extension.name)).absolute()
        newest = max(source.stat().st_mtime for source in (*kernel_files(), *CONSTANT_FILES, Path(__file__)))
        if self.force or not file.exists() or file.stat().st_mtime < newest:
            file.parent.mkdir(parents=True, exist_ok=True)
            compile_kernels(file)


def kernel_files():
    """All that hold kernels."""
    return sorted(PACKAGE.rglob("*_kernels.py"))


def compile_kernels(file):
    """Write the library."""
    cpu = os.environ.get("BODYCAM_KERNELS_CPU") or _usual_cpu()
    if cpu != "native":  # numba reads both when it is imported
        os.environ.update(NUMBA_CPU_NAME=cpu, NUMBA_CPU_FEATURES="")
    try:
        import numba
        from numba.core.compiler import Flags
        from numba.core.cpu_options import FastMathOptions
    except ImportError as error:
        sys.exit(f"building bodycam_ros needs numba, to compile its kernels ({error}); see docs/install.md")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # that it will be replaced one day
        from numba.pycc import CC

    try:
        library = CC(file.name.partition(".")[0], source_module=sys.modules[__name__])
    except RuntimeError as error:  # no compiler
        _refuse(error)
    library.target_cpu = "host" if cpu == "native" else cpu

    def kernel(signature=None):
        def compiled(function):
            if signature is not None:
                library.export(symbol(function), signature)(function)
            return numba.njit(nogil=True, error_model="numpy", fastmath=_FAST)(function)

        return compiled

    def flags():
        # pycc has no way to say these of the functions that Python calls.
        made = Flags()
        made.release_gil = True
        made.error_model = "numpy"
        made.fastmath = FastMathOptions(_FAST)
        return made

    sys.path.insert(0, str(SOURCES))
    symbol = importlib.import_module("bodycam_ros.kernels").symbol
    with mock.patch("bodycam_ros.kernels.kernel", kernel), mock.patch("numba.pycc.compiler.Flags", flags):
        for source in kernel_files():
            _import_alone(source)
        with tempfile.TemporaryDirectory(dir=file.parent) as folder:
            library.output_dir, library.output_file = folder, file.name
            try:
                library.compile()
            except (CompileError, LinkError) as error:
                _refuse(error)
            (Path(folder) / file.name).replace(file)


def _refuse(error):
    sys.exit(
        f"the kernels could not be compiled ({error}); that needs a C compiler and Python's headers: "
        "sudo apt install build-essential python3-dev"
    )


def _import_alone(source):
    """Import a file without the ``__init__.py`` of its folder, which may import what is not installed yet."""
    name = ".".join(source.relative_to(SOURCES).with_suffix("").parts)
    folder = source.parent
    while folder != PACKAGE:
        package = ModuleType(".".join(folder.relative_to(SOURCES).parts))
        package.__path__ = [str(folder)]
        sys.modules.setdefault(package.__name__, package)
        folder = folder.parent
    importlib.import_module(name)


def _usual_cpu():
    if platform.machine() != "x86_64":
        return "generic"
    features = Path("/proc/cpuinfo")
    return "x86-64-v3" if not features.exists() or " avx2 " in features.read_text() else "x86-64"
