"""Where compiled kernels are kept: in a folder that is named after all that they were made from.

numba looks at the file of a kernel alone to see whether what it kept is stale, not at those of the kernels that it
calls. So the name holds the sources of all kernels, and what compiled them for which processor. A folder is complete
once it holds all kernels; from then on nothing in it changes, and it may be read-only.
"""

import hashlib
import json
import os
import platform
import stat
import sys
import tempfile
from collections.abc import Iterator
from contextlib import suppress
from functools import cache
from importlib.metadata import version
from pathlib import Path

import numpy as np

PACKAGE = Path(__file__).parent.parent

KERNEL_FILES = (
    "camera/lens_kernels.py",
    "geometry_kernels.py",
    "mapping/epipolar_kernels.py",
    "registration/residual_scale.py",
    "registration/pose_kernels.py",
    "registration/landmark_choice_kernels.py",
    "registration/local_landmark_kernels.py",
    "registration/descriptor_kernels.py",
    "registration/giver_kernels.py",
    "registration/patch_kernels.py",
    "tracking/rotation_kernels.py",
    "outside/contour_kernels.py",
    "outside/region_kernels.py",
)
"""All that hold kernels, in the order in which they are compiled."""

CONSTANT_FILES = (
    "camera/limits.py",
    "camera/readout.py",
    "kernels/kernel.py",
    "kernels/kernel_cache.py",
    "kernels/kernel_library.py",
)
"""All else that is compiled into them."""

_CONTENTS = "complete.json"
_COMPILED = (".so", ".nbc", ".nbi")


@cache
def kernel_folder() -> Path | None:
    """Where this process keeps compiled kernels; None if it can write nowhere.

    The first place that has all of them, be it read-only; else the first that can be written to: numba's own folder, if
    NUMBA_CACHE_DIR is set, the package's, the user's cache, the user's own among temporary files.
    """
    folders = [place / folder_name() for place in _places()]
    for folder in folders:
        if is_complete(folder):
            return folder
    for folder in folders:
        if _is_writable(folder):
            return folder
    temporary = Path(tempfile.gettempdir()) / f"bodycam_ros-{os.getuid()}"
    folder = temporary / folder_name()
    return folder if _is_made_own(temporary) and _is_writable(folder) else None


@cache
def folder_name() -> str:
    """What compiles, and what is compiled, as two short hashes."""
    # Not by asking numba, whose import takes longer than all else that a tracker loads.
    # Features that are empty (what the processor's name implies) are not the same as features that are not given.
    given = [os.environ.get(variable) for variable in ("NUMBA_CPU_NAME", "NUMBA_CPU_FEATURES")]
    processor = [_this_processor() if text is None else text for text in given]
    machine = (sys.version, version("numba"), version("llvmlite"), np.__version__, *processor)
    sources = [(PACKAGE / file).read_bytes() for file in (*KERNEL_FILES, *CONSTANT_FILES)]
    return f"{_short_hash(*(text.encode() for text in machine))}-{_short_hash(*sources)}"


def _this_processor() -> str:
    """What Linux says of the first processor, but for what changes from one moment to the next."""
    try:
        lines = Path("/proc/cpuinfo").read_text().partition("\n\n")[0].splitlines()
    except OSError:
        return platform.processor()
    kept = ("vendor_id", "cpu family", "model", "stepping", "flags", "Features", "CPU")
    return "\n".join(line for line in lines if line.startswith(kept))


def stale_folders(folder: Path) -> Iterator[Path]:
    """What the same machine compiled from other sources."""
    machine = folder.name.split("-")[0]
    with suppress(OSError):
        yield from (other for other in folder.parent.glob(f"{machine}-*") if other != folder and other.is_dir())


def is_complete(folder: Path) -> bool:
    """Whether a folder has all kernels, none of them cut short."""
    try:
        contents: dict[str, int] = json.loads((folder / _CONTENTS).read_bytes())
        return bool(contents) and all((folder / file).stat().st_size == size for file, size in contents.items())
    except (OSError, ValueError, AttributeError):
        return False


def complete(folder: Path) -> None:
    """Say that a folder has all kernels now; raises OSError."""
    files = [file for file in sorted(folder.rglob("*")) if file.suffix in _COMPILED]
    contents = {str(file.relative_to(folder)): file.stat().st_size for file in files}
    unfinished = folder / f"{_CONTENTS}.{os.getpid()}"
    unfinished.write_text(json.dumps(contents))
    unfinished.replace(folder / _CONTENTS)


def _places() -> Iterator[Path]:
    if folder := os.environ.get("NUMBA_CACHE_DIR"):
        yield Path(folder) / "bodycam_ros"
    yield PACKAGE / "__pycache__" / "kernels"
    with suppress(RuntimeError):  # no home
        place = _short_hash(bytes(PACKAGE))  # several installations do not clear each other's
        yield Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "bodycam_ros" / place


def _is_made_own(folder: Path) -> bool:
    """Whether a folder is there, or was made, that nobody else can write to: code will be loaded from it."""
    try:
        folder.mkdir(mode=0o700, exist_ok=True)
        status = folder.lstat()
    except OSError:
        return False
    return stat.S_ISDIR(status.st_mode) and status.st_uid == os.getuid() and not status.st_mode & 0o022


def _is_writable(folder: Path) -> bool:
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            return True
    except OSError:
        return False


def _short_hash(*contents: bytes) -> str:
    return hashlib.sha256(b"\0".join(contents)).hexdigest()[:12]
