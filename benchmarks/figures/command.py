"""A command of the package as a whole process: its output, and what it costs."""

import os
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

_SAMPLE_S = 0.3
_MB = 1.0 / (1 << 20)


@dataclass(frozen=True)
class Ran:
    """What came of a process with its children.

    Attributes:
        output: what it printed.
        code: its exit code.
        wall_s, cpu_s: time from start to end, and processor time of the first process, of those that it waited for, and
            of those that others started, up to a third of a second before their end [s].
        peak_mb: largest sum of proportional set sizes that was sampled [MB].
    """

    output: str
    code: int
    wall_s: float
    cpu_s: float
    peak_mb: float


def bodycam(*arguments: object) -> Ran:
    """Run ``bodycam`` with arguments.

    Raises:
        RuntimeError: its exit code is neither 0 nor 3, which means that the result is wrong.
    """
    return run([str(Path(sys.executable).with_name("bodycam")), *map(str, arguments)])


def run(command: list[str]) -> Ran:
    """Run a command.

    Raises:
        RuntimeError: its exit code is neither 0 nor 3.
    """
    began_s = time.perf_counter()
    process = subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, start_new_session=True,
        env=os.environ | {"COLUMNS": "200"},
    )  # fmt: skip
    assert process.stdout is not None
    with _sampled(process.pid) as (peak, others_s):
        output = process.stdout.read()
        _, status, usage = os.wait4(process.pid, 0)
    wall_s, code = time.perf_counter() - began_s, os.waitstatus_to_exitcode(status)
    process.returncode = code
    if code not in (0, 3):
        raise RuntimeError(f"{' '.join(command)}\nended with {code}:\n{output[-2000:]}")
    own_s = usage.ru_utime + usage.ru_stime
    return Ran(output, code, wall_s, own_s + sum(others_s.values()), _MB * max(peak))


@contextmanager
def _sampled(session: int) -> Iterator[tuple[list[int], dict[str, float]]]:
    """Bytes of all processes of a session, sampled on a thread, and processor time [s] of those others started."""
    samples = [0]
    seconds = dict[str, float]()
    ended = threading.Event()

    def sample() -> None:
        while not ended.wait(_SAMPLE_S):
            processes = list(_processes(session))
            samples.append(sum(_bytes(pid) for pid, _, _ in processes))
            seconds.update({pid: spent_s for pid, parent, spent_s in processes if parent and parent != session})

    thread = threading.Thread(target=sample)
    thread.start()
    try:
        yield samples, seconds
    finally:
        ended.set()
        thread.join()


def _processes(session: int) -> Iterator[tuple[str, int, float]]:
    """Processes of a session, the parent of each, 0 of the first's, and its processor time [s]."""
    for entry in os.scandir("/proc"):
        if entry.name.isdigit():
            try:
                fields = Path(entry.path, "stat").read_text().rsplit(")", 1)[1].split()
            except OSError:
                continue
            if int(fields[3]) == session:
                parent = 0 if entry.name == str(session) else int(fields[1])
                yield entry.name, parent, (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def _bytes(pid: str) -> int:
    """Memory of a process; of pages that it shares with others its share."""
    try:
        rollup = Path("/proc", pid, "smaps_rollup").read_text()
    except OSError:
        return 0
    return 1024 * next((int(line.split()[1]) for line in rollup.splitlines() if line.startswith("Pss:")), 0)
