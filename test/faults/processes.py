"""The processes of a session, from /proc: whether they work, sleep or wait for a processor."""

import os
import signal
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

_TICKS = os.sysconf("SC_CLK_TCK")


@dataclass(frozen=True)
class Process:
    """A process: number, state letter of the kernel, and processor time [s], that of ended children included."""

    pid: int
    state: str
    cpu_s: float

    @property
    def waits_for_its_turn(self) -> bool:
        """Whether it could work at once if a processor were free, or waits for the disk."""
        return self.state in "RD"


def of_session(session: int) -> list[Process]:
    """The living processes of a session."""
    found = []
    for folder in Path("/proc").iterdir():
        if not folder.name.isdigit():
            continue
        with suppress(OSError):
            fields = (folder / "stat").read_text().rsplit(")", 1)[1].split()
            if int(fields[3]) == session and fields[0] not in "ZX":
                found.append(Process(int(folder.name), fields[0], sum(map(int, fields[11:15])) / _TICKS))
    return found


def cpu_of_session(session: int) -> float:
    """Processor time of a session's living processes and their ended children [s]."""
    return sum(process.cpu_s for process in of_session(session))


def end_session(session: int) -> None:
    """Kill all processes of a session."""
    for process in of_session(session):
        with suppress(ProcessLookupError):
            os.kill(process.pid, signal.SIGKILL)
