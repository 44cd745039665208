"""A DDS domain that two tests on one machine never share."""

import os
import socket
from collections.abc import Iterator
from contextlib import contextmanager

_DOMAINS = range(1, 102)
"""Those whose ports are outside of what Linux hands out to anybody who asks for a port."""


@contextmanager
def own_domain() -> Iterator[int]:
    """A DDS domain that no other test on this machine has, as long as the context lasts, or the process."""
    start = os.getpid() % len(_DOMAINS)
    for domain in (*_DOMAINS[start:], *_DOMAINS[:start]):
        with socket.socket(socket.AF_UNIX) as claim:
            try:
                claim.bind(f"\0bodycam_ros/test/domain/{domain}")
            except OSError:
                continue  # somebody else's
            yield domain
            return
    raise RuntimeError("all DDS domains are taken by other tests on this machine")
