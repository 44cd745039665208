"""Runs commands, each in a process of its own that may crash, swell or hang without harm to the campaign.

Most are forked from this process, which has everything imported, so that a run costs milliseconds of start-up; some are
started anew, as a user starts them.
"""

import atexit
import os
import pkgutil
import resource
import signal
import sys
import tempfile
import time
import traceback
from dataclasses import dataclass, field
from importlib import import_module
from pathlib import Path

from faults.limits import limit, obey_permissions
from faults.opened import OpenedFiles
from faults.processes import cpu_of_session, end_session, of_session
from faults.work import Attempt

import bodycam_ros

_NOT_IMPORTED = ("bodycam_ros.nodes", "bodycam_ros.viewer", "bodycam_ros.cli.view")
"""They need ROS, or a server."""
_MEMORY_BYTES = 2 << 30
"""Above what the libraries map: a run on such small input needs a tenth of it."""
_LONGEST_S, _LONGEST_CPU_S, _ASLEEP_S = 600.0, 60.0, 12.0
_LOOK_S = 1.0
_MOST_PRINTED = 1 << 20


def warm_up() -> None:
    """Import all that the commands need."""
    for module in pkgutil.walk_packages(bodycam_ros.__path__, "bodycam_ros."):
        if not module.name.startswith(_NOT_IMPORTED):
            import_module(module.name)


def _mapped_bytes() -> int:
    return int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()


@dataclass
class Run:
    """A run, under way or over.

    Attributes:
        exit_code: as the shell has it; negative for the signal that ended it; None while it runs.
        printed: on standard output and error.
        memory_mb: of its largest process.
        hung: why it was ended from outside; empty if it was not.
        left: processes that it left behind.
        opened: files that were in its folder before, and that it opened.
    """

    attempt: Attempt
    folder: Path
    fresh: bool
    exit_code: int | None = None
    printed: bytes = b""
    memory_mb: float = 0.0
    hung: str = ""
    left: int = 0
    opened: set[Path] = field(default_factory=set)
    _watch: OpenedFiles | None = None
    _pid: int = 0
    _pipe: int = -1
    _started_s: float = field(default_factory=time.monotonic)
    _looked_s: float = 0.0
    _cpu_s: float = 0.0
    _awake_s: float = field(default_factory=time.monotonic)
    _to_stop: bool = False

    @classmethod
    def started(cls, attempt: Attempt, folder: Path, fresh: bool) -> "Run":
        """Start a command in a folder; afresh, or forked from this process."""
        run = cls(attempt, folder, fresh, _to_stop=attempt.stop is not None)
        run._watch = OpenedFiles(folder)
        (folder / "tmp").mkdir(exist_ok=True)
        run._pipe, theirs = os.pipe()
        run._pid = os.fork()
        if run._pid == 0:
            _become(attempt, folder, fresh, theirs)
        os.close(theirs)
        os.set_blocking(run._pipe, False)
        return run

    def is_over(self) -> bool:
        """Look after it: read what it prints, stop it when it is time, end it when it hangs."""
        self._read()
        pid, status, usage = os.wait4(self._pid, os.WNOHANG)
        now = time.monotonic()
        if pid:
            self.exit_code = os.waitstatus_to_exitcode(status)
            self.memory_mb = usage.ru_maxrss / 1024
            self._clear_up()
            return True
        if self._to_stop and self.attempt.stop and now - self._started_s >= self.attempt.stop[1]:
            self._to_stop = False
            os.killpg(self._pid, self.attempt.stop[0])
        if now - self._looked_s >= _LOOK_S:
            self._looked_s = now
            self._check_alive(now)
        return False

    def end(self) -> None:
        """End it, whatever it does."""
        end_session(self._pid)
        os.waitpid(self._pid, 0)
        os.close(self._pipe)

    def _check_alive(self, now: float) -> None:
        cpu_s = cpu_of_session(self._pid)
        if cpu_s > self._cpu_s:
            self._cpu_s, self._awake_s = cpu_s, now
        if cpu_s > _LONGEST_CPU_S:
            self.hung = f"busy for {cpu_s:.0f} s"
        elif now - self._awake_s > _ASLEEP_S and not any(p.waits_for_its_turn for p in of_session(self._pid)):
            self.hung = f"asleep for {_ASLEEP_S:.0f} s"
        elif now - self._started_s > _LONGEST_S:
            self.hung = f"not over after {_LONGEST_S:.0f} s"
        if self.hung:
            end_session(self._pid)

    def _read(self) -> None:
        while len(self.printed) < _MOST_PRINTED:
            try:
                piece = os.read(self._pipe, 1 << 16)
            except BlockingIOError:
                return
            if not piece:
                return
            self.printed += piece

    def _clear_up(self) -> None:
        """What it left behind: workers get a moment to notice that their parent has gone."""
        deadline_s = time.monotonic() + 5.0
        while (left := of_session(self._pid)) and time.monotonic() < deadline_s:
            time.sleep(0.05)
        self.left = len(left)
        if self._watch is not None:
            self.opened = self._watch.read()
        end_session(self._pid)
        self._read()
        os.close(self._pipe)


def _become(attempt: Attempt, folder: Path, fresh: bool, output: int) -> None:
    """The forked process turns into the command. Never returns."""
    code = 70
    try:
        os.setsid()
        os.chdir(folder)
        nothing = os.open(os.devnull, os.O_RDONLY)
        for target, source in ((0, nothing), (1, output), (2, output)):
            os.dup2(source, target)
        os.environ |= {"TMPDIR": str(folder / "tmp"), "COLUMNS": "120", "NO_COLOR": "1"}
        tempfile.tempdir = None
        for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
            signal.signal(number, signal.default_int_handler if number == signal.SIGINT else signal.SIG_DFL)
        if attempt.ordinary_user:
            obey_permissions()
        limit(_mapped_bytes() + _MEMORY_BYTES, attempt.largest_file)
        if fresh:
            command = [sys.executable, "-m", "bodycam_ros.cli.main", *attempt.arguments]
            os.execv(sys.executable, [os.fsencode(part) for part in command])
        code = _called(attempt.arguments)
    except BaseException:
        traceback.print_exc()
    finally:
        os._exit(code)


def _called(arguments: tuple[str, ...]) -> int:
    """The command in this process, and its end as the interpreter makes it."""
    import multiprocessing
    from multiprocessing import forkserver

    from bodycam_ros.cli.main import main

    # A worker forked from a warm process, for the same reason.
    context = multiprocessing.get_context
    multiprocessing.get_context = lambda method=None: context("fork")  # type: ignore[assignment]
    forkserver.ensure_running = lambda: None  # that of the campaign is no child of this process
    try:
        code = main(arguments)
    except SystemExit as end:
        code = end.code if isinstance(end.code, int) else 1
    except BaseException:
        traceback.print_exc()
        code = 1
    atexit._run_exitfuncs()
    sys.stdout.flush()
    sys.stderr.flush()
    return code
