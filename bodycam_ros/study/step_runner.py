"""Runs steps as processes, each when its inputs are ready; a failed step stops only those that depend on it."""

import fcntl
import os
import signal
import subprocess
import sys
import time
from collections.abc import Collection, Generator, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ThreadPoolExecutor, wait
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from threading import Lock

from bodycam_ros.errors import StudyError
from bodycam_ros.files.whole_file import failure_named
from bodycam_ros.results.verdict import WRONG_RESULT
from bodycam_ros.study.done_steps import DoneSteps, state_of
from bodycam_ros.study.parent_pipe import ParentPipe
from bodycam_ros.study.study import Step

LOCK = ".bodycam-study"
_MAX_CLEANUP_S = 60.0  # a replay needs two seconds to clean up after an interruption
_POLL_S = 0.5  # a signal that comes just before a thread sleeps does not wake it
_ERROR = "bodycam: error: "
_MAX_LOG_TAIL = 20_000  # [bytes]


@dataclass(frozen=True)
class StepEnd:
    """How a step ended.

    Attributes:
        seconds: how long it took.
        failure: why it failed, or could not run; None if it is done.
    """

    step: Step
    seconds: float
    failure: str | None


class StepRunner:
    """Runs steps.

    Args:
        notes: of the steps that are done.
        cores: to be used by all processes together.
        logs: folder for what the steps print, a file each; without it they print to the terminal, one after another.
        lock: descriptor that every process inherits; it stays locked as long as one of them lives.
    """

    def __init__(self, notes: DoneSteps, cores: int, logs: Path | None, lock: int) -> None:
        self._notes = notes
        self._cores = cores
        self._logs = logs
        self._lock = lock
        self._processes: list[subprocess.Popen[bytes]] = []
        self._starting, self._is_ending = Lock(), False
        self._parent = ParentPipe()

    def run(self, steps: Sequence[Step]) -> Generator[Step | StepEnd, None, None]:
        """Run steps; yields each when it starts and its ``StepEnd``. An interruption ends all processes."""
        waiting, failed = list(steps), dict[Path, Step]()
        running: dict[Future[StepEnd], tuple[Step, int]] = {}
        pool = ThreadPoolExecutor(max(1, self._cores))
        try:
            while waiting or running:
                for step in [step for step in waiting if failed.keys() & set(step.inputs)]:
                    first = next(failed[path] for path in step.inputs if path in failed)
                    waiting.remove(step)
                    failed[step.output] = first
                    yield StepEnd(step, 0.0, f"not run, because step '{first.name}' failed")
                unfinished = {step.output for step in (*waiting, *(step for step, _ in running.values()))}
                ready = [step for step in waiting if not unfinished & set(step.inputs)]
                # A process is waited for by its own threads, not by others, so many share the cores.
                for number, step in enumerate(ready):
                    free = self._cores - sum(cores for _, cores in running.values())
                    if free < 1 or (self._logs is None and running):
                        break
                    sharing = 1 if self._logs is None else len(ready) - number
                    cores = max(1, free // sharing) if step.is_parallel else 1
                    waiting.remove(step)
                    yield step
                    running[pool.submit(self._run, step, cores)] = step, cores
                for future in wait(running, _POLL_S, return_when=FIRST_COMPLETED).done:
                    step, _ = running.pop(future)
                    end = future.result()
                    if end.failure is not None:
                        failed[step.output] = step
                    yield end
        finally:
            self._end_processes(running)
            pool.shutdown()
            self._parent.close()

    def _run(self, step: Step, cores: int) -> StepEnd:
        """Run one step to its end; on a thread of its own, which no signal interrupts."""
        state, started = state_of(step), time.monotonic()
        step.output.parent.mkdir(parents=True, exist_ok=True)
        jobs = ("--jobs", str(cores)) if step.is_parallel else ()
        command = [sys.executable, "-m", "bodycam_ros.cli.main", *step.words, *jobs]
        with ExitStack() as opened:
            log = None
            if self._logs is not None:
                self._logs.mkdir(parents=True, exist_ok=True)
                log = opened.enter_context(self._log(step).open("wb"))
            with self._starting:
                if self._is_ending:
                    return StepEnd(step, 0.0, "not run")
                # In a session of its own: a terminal's Ctrl-C reaches it through us, once.
                process = subprocess.Popen(
                    command,
                    stdin=subprocess.DEVNULL,
                    stdout=log,
                    stderr=log,
                    pass_fds=(self._lock, self._parent.descriptor),
                    env=self._parent.environment(),
                    start_new_session=True,
                )
                self._processes.append(process)
            code, seconds = process.wait(), time.monotonic() - started
        if code not in (0, WRONG_RESULT):
            return StepEnd(step, seconds, self._failure(step, code))
        self._notes.write(step, state, code, seconds)
        return StepEnd(step, seconds, None)

    def _failure(self, step: Step, code: int) -> str:
        if code < 0:
            return f"was killed by signal {-code}; if memory was short, use fewer --jobs"
        if self._logs is None:
            return f"ended with code {code}"
        with self._log(step).open("rb") as file:
            file.seek(max(0, file.seek(0, os.SEEK_END) - _MAX_LOG_TAIL))
            text = file.read().decode("utf-8", "replace")
        _, error, message = text.rpartition(_ERROR)
        lines = [line.strip() for line in (message if error else text).splitlines() if line.strip()]
        return " ".join(lines) if error else (lines or [f"ended with code {code}"])[-1]

    def _log(self, step: Step) -> Path:
        assert self._logs is not None
        return self._logs / f"{step.name.replace(': ', '_').replace(' ', '_')}.log"

    def _end_processes(self, running: Collection[Future[StepEnd]]) -> None:
        with self._starting:
            self._is_ending = True
        # Not SIGINT: a Python that is still starting would print a traceback.
        for number in (signal.SIGTERM, signal.SIGKILL):
            for process in self._processes:
                if process.poll() is None:
                    with suppress(ProcessLookupError):
                        os.killpg(process.pid, number)
            wait(running, _MAX_CLEANUP_S)


@contextmanager
def study_lock(folder: Path) -> Iterator[int]:
    """Lock the folder of results, which is made if it is missing; gives the lock's descriptor.

    The system releases the lock when this process and all that inherited the descriptor have ended.

    Raises:
        StudyError: another run uses the folder.
        OutputError: the folder cannot be written to.
    """
    with failure_named(folder / LOCK):
        folder.mkdir(parents=True, exist_ok=True)
        descriptor = os.open(folder / LOCK, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o666)
    try:
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError as error:
            raise StudyError(f"{folder}: another 'bodycam study' or 'bodycam run' is at work in it; wait") from error
        yield descriptor
    finally:
        os.close(descriptor)
