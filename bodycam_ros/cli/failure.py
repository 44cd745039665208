"""What a command prints of an exception that ends it: its cause, and what to do."""

import errno
import os
import resource

from bodycam_ros.errors import BodycamError

_UNMAPPED = ("failed to map segment", "cannot allocate memory")
_OPENCV_NO_MEMORY = -4


def failure_message(error: BaseException) -> str | None:
    """What to print; None for a defect of ours, whose traceback is needed."""
    if isinstance(error, BodycamError):
        return str(error)
    if _lacks_memory(error):
        limit = _memory_limit()
        within = "" if limit is None else f" within the {limit >> 20} MB that are set (ulimit -v)"
        return f"there is not enough memory for this{within}; give fewer processes (--jobs), or smaller input"
    if not isinstance(error, OSError) or error.errno is None:
        return None
    if error.errno in (errno.EMFILE, errno.ENFILE):
        return f"{_named(error)}; allow more of them (ulimit -n 1024), or give fewer processes (--jobs)"
    if error.filename is None and error.errno == errno.ENOENT and not _has_working_folder():
        return "the folder that this was started in is gone; change to another one (cd)"
    return _named(error)


def _named(error: OSError) -> str:
    return f"{error.filename}: {error.strerror}" if error.filename is not None else str(error.strerror)


def _lacks_memory(error: BaseException) -> bool:
    if isinstance(error, ImportError):
        return any(text in str(error) for text in _UNMAPPED)
    # Of C code that is out of memory without saying so.
    if isinstance(error, SystemError):
        return _memory_limit() is not None
    if type(error).__module__ == "cv2":
        return getattr(error, "code", 0) == _OPENCV_NO_MEMORY
    return isinstance(error, MemoryError) or (isinstance(error, OSError) and error.errno == errno.ENOMEM)


def _memory_limit() -> int | None:
    """What this process may map at most [bytes]; None without a limit."""
    limit, _ = resource.getrlimit(resource.RLIMIT_AS)
    return None if limit == resource.RLIM_INFINITY else limit


def _has_working_folder() -> bool:
    try:
        os.getcwd()
    except OSError:
        return False
    return True
