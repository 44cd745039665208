"""Progress for programs: a line of JSON on standard output whenever another hundredth of a step is done."""

import json
import sys
from collections.abc import Iterator
from contextlib import contextmanager

from bodycam_ros.mapping.progress import Advance


class ToldProgress:
    """Tells how far every step is, with ``step`` and ``share``."""

    def __init__(self) -> None:
        self._told: tuple[str, float] | None = None

    def tell(self, step: str, share: float) -> None:
        """So much of a step is done, 0 to 1."""
        now = step, round(share, 2)
        if now != self._told:
            self._told = now
            sys.stdout.write(json.dumps({"step": step, "share": now[1]}) + "\n")
            sys.stdout.flush()

    @contextmanager
    def step(self, name: str, total: int) -> Iterator[Advance]:
        """A step of ``total`` units."""
        done = 0

        def advance(units: int = 1) -> None:
            nonlocal done
            done += units
            self.tell(name, done / max(1, total))

        yield advance
