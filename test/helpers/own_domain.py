"""A DDS domain that two tests on one machine never share."""

import os
import socket
from collections.abc import Iterator
from contextlib import contextmanager
from itertools import cycle

_DOMAINS = range(1, 102)
"""Those whose ports are outside of what Linux hands out to anybody who asks for a port."""

_FIRST = 37 * os.getpid() % len(_DOMAINS)
_TURN = cycle((*_DOMAINS[_FIRST:], *_DOMAINS[:_FIRST]))
"""Nobody takes soon what this process has just given back, for a participant may stay until the process ends."""


@contextmanager
def own_domain() -> Iterator[int]:
    """A DDS domain that no other test on this machine has, as long as the context lasts, or the process."""
    for domain in (next(_TURN) for _ in _DOMAINS):
        with socket.socket(socket.AF_UNIX) as claim:
            try:
                claim.bind(f"\0bodycam_ros/test/domain/{domain}")
            except OSError:
                continue  # somebody else's
            yield domain
            return
    raise RuntimeError("all DDS domains are taken by other tests on this machine")
