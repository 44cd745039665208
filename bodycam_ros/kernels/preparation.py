"""Kernels are compiled before they are needed, by one process, which says so; all others load what it made."""

import fcntl
import logging
import shutil
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from functools import cache
from importlib import import_module
from pathlib import Path

from bodycam_ros.kernels.kernel import build_all, compile_all
from bodycam_ros.kernels.kernel_folder import KERNEL_FILES, complete, is_complete, kernel_folder, stale_folders

logger = logging.getLogger(__name__)

_HOW_LONG = "some 20 s"


def prepare_kernels() -> None:
    """Compile all kernels, unless that was done before; call it before processes are started that use them.

    Without a folder to keep them in they are compiled for this process.
    """
    folder = kernel_folder()
    if folder is None:
        _compile_for_this_process()
        return
    if is_complete(folder):
        return
    with _alone_in(folder):
        if is_complete(folder):
            return
        logger.warning("compiling the numerical kernels for this machine, once; takes %s", _HOW_LONG)
        _import_kernels()
        if not build_all(folder):
            compile_all()
            from bodycam_ros.kernels.kernel_cache import all_saved

            if not all_saved():
                return
        with suppress(OSError):
            complete(folder)
            for stale in stale_folders(folder):
                shutil.rmtree(stale, ignore_errors=True)


def load_kernels() -> None:
    """Load all kernels into this process, so that none is loaded while images wait."""
    _import_kernels()
    compile_all()


def _import_kernels() -> None:
    for file in KERNEL_FILES:
        import_module(f"bodycam_ros.{file.removesuffix('.py').replace('/', '.')}")


@cache
def _compile_for_this_process() -> None:
    logger.warning(
        "compiling the numerical kernels takes %s at every start, for there is no folder to keep them in; set "
        "NUMBA_CACHE_DIR to one that can be written to",
        _HOW_LONG,
    )
    load_kernels()


@contextmanager
def _alone_in(folder: Path) -> Iterator[None]:
    """While others wait; without a lock where there is none to be had: two may then do the same work."""
    try:
        lock = (folder / "lock").open("w")
    except OSError:
        yield
        return
    with lock:
        with suppress(OSError):
            fcntl.flock(lock, fcntl.LOCK_EX)
        yield
