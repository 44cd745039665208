"""pycolmap, loaded so that SIGTERM still means what it meant before.

The logging library within it answers SIGTERM by a stack trace from the moment that it is loaded.
"""

import signal
import threading

_before = signal.getsignal(signal.SIGTERM)

import pycolmap  # noqa: E402

if threading.current_thread() is threading.main_thread() and _before is not None:
    signal.signal(signal.SIGTERM, _before)

__all__ = ["pycolmap"]
