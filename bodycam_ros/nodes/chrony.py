"""What chrony says of this computer's clock, where it steers it. Imports no ROS."""

import shutil
import subprocess
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache

_COMMAND = ("chronyc", "-c", "tracking")
_FIELDS = 14
_PATIENCE_S = 5.0
_EVERY_S = 30.0


@dataclass(frozen=True)
class Steered:
    """How a clock is steered.

    Attributes:
        source: what by, a name or an address; empty if nothing is reached.
        ahead_s: by which it is ahead of NTP's time [s].
        bound_s: at most how wrong that is [s], by chrony's own reckoning.
        is_synchronised: whether it follows a source at all.
    """

    source: str
    ahead_s: float
    bound_s: float
    is_synchronised: bool

    def text(self) -> str:
        """In one line."""
        if not self.is_synchronised:
            return "chrony runs, but follows no source"
        return f"{1e3 * self.ahead_s:+.3f} +- {1e3 * self.bound_s:.3f} ms by {self.source}"


def tracking(line: str) -> Steered:
    """What a line of ``chronyc -c tracking`` says.

    Raises:
        ValueError: it is no such line.
    """
    fields = line.strip().split(",")
    if len(fields) != _FIELDS:
        raise ValueError(f"chronyc tracking has {_FIELDS} fields, not {len(fields)}")
    # Of chrony a clock that is behind has a positive offset.
    ahead_s, delay_s, dispersion_s = -float(fields[4]), float(fields[10]), float(fields[11])
    is_synchronised = fields[13] != "Not synchronised"
    return Steered(fields[1], ahead_s, abs(ahead_s) + dispersion_s + delay_s / 2, is_synchronised)


def ask_chrony() -> str:
    """How this computer's clock is steered, in one line; empty where chrony is not there or does not answer."""
    try:
        said = subprocess.run(_COMMAND, capture_output=True, text=True, timeout=_PATIENCE_S, check=True).stdout
        return tracking(said).text()
    except (OSError, subprocess.SubprocessError, ValueError):
        return ""


class ChronyWatch:
    """Asks chrony now and then beside everything else, for a node should not wait for another process.

    Args:
        ask: how, where chrony is installed.
        every_s: how often.

    Attributes:
        latest: what was said last; empty until then.
    """

    def __init__(self, ask: Callable[[], str] = ask_chrony, every_s: float = _EVERY_S) -> None:
        self._ask = ask
        self._every_s = every_s
        self.latest = ""
        if shutil.which(_COMMAND[0]):
            threading.Thread(target=self._watch, daemon=True).start()

    def _watch(self) -> None:
        while True:
            self.latest = self._ask()
            time.sleep(self._every_s)


@cache
def chrony_watch() -> ChronyWatch:
    """That of this process, however many nodes it has."""
    return ChronyWatch()
