"""What is expensive to make, made by one of the workers that test side by side, for all of them."""

import fcntl
import os
from collections.abc import Callable
from pathlib import Path

import pytest


def made_once(factory: pytest.TempPathFactory, name: str, make: Callable[[Path], object]) -> Path:
    """A folder of this run of pytest, the same in every worker. Whoever comes first makes it while the others wait.

    Args:
        factory: of pytest.
        name: of the folder.
        make: writes into the empty folder that it is given. If it fails, the next who asks tries again.
    """
    root = factory.getbasetemp()
    if "PYTEST_XDIST_WORKER" in os.environ:
        root = root.parent  # each worker has a folder of its own in that of the run
    folder = root / name
    with (root / f".{name}.lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        if not folder.exists():
            scratch = factory.mktemp(name)
            make(scratch)
            scratch.rename(folder)
    return folder
