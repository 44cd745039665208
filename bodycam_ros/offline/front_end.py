"""All cameras at once: one process per core, their results merged in order of time."""

import multiprocessing
import os
import queue
import signal
import threading
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from multiprocessing import forkserver, resource_tracker
from multiprocessing.context import ForkServerContext, ForkServerProcess
from multiprocessing.queues import Queue

from bodycam_ros.camera import CameraModel
from bodycam_ros.errors import RecordingError
from bodycam_ros.kernels import prepare_kernels
from bodycam_ros.offline.camera_worker import (
    AwaitedGrowth,
    RegisteredImage,
    RegistrationTask,
    Result,
    WorkerFailure,
    WorkerItem,
    run_camera_worker,
)
from bodycam_ros.offline.growth_epochs import Growth, GrowthOfAll
from bodycam_ros.registration.reference_map import ReferenceMap

_QUEUE_LENGTH = 64
"""Results a worker may be ahead of the solver: bounds the memory of a long recording to some megabytes."""

_POLL_S = 1.0
_WARM = "bodycam_ros.offline.warm_worker"
_ONE_THREAD = dict.fromkeys(("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"), "1")


def warm_up() -> None:
    """Begin to load what the processes need, while the caller goes on; compile kernels that are not there first."""
    prepare_kernels()
    context = _context()
    if context.get_start_method() == "forkserver":
        with _one_thread_each(), _signals_for_us_alone():
            context.set_forkserver_preload([_WARM])
            forkserver.ensure_running()


def register_recording(task: RegistrationTask, cameras: Mapping[str, CameraModel], jobs: int) -> Iterator[Result]:
    """Register all images of a recording in ``jobs`` processes.

    The results come in order of their stamps, whatever the number of processes and the pace of each.

    Args:
        task: what is to be done.
        cameras: models of the cameras by name.
        jobs: processes.

    Raises:
        BodycamError: what went wrong for the user in a worker.
        RecordingError: a worker was killed.
    """
    warm_up()
    shares = [tuple(cameras)[start::jobs] for start in range(min(jobs, len(cameras)))]
    with _workers(task, shares) as workers:
        listening = dict(enumerate(workers))
        growth = _growth(task, cameras, listening)
        pending = {number: item for number, worker in enumerate(workers) if (item := worker.next_result())}
        while pending:
            earliest = min(pending, key=lambda number: (pending[number].stamp_ns, number))
            item = pending.pop(earliest)
            if growth is not None:
                growth.reach(item.stamp_ns)
                if isinstance(item, RegisteredImage):
                    growth.hear(item.matches, item.keyframe)
            if not isinstance(item, AwaitedGrowth):
                yield item
            if following := workers[earliest].next_result():
                pending[earliest] = following
            else:
                del listening[earliest]  # or what it is told would heap up until the others are done


def _growth(
    task: RegistrationTask, cameras: Mapping[str, CameraModel], listening: Mapping[int, "_Worker"]
) -> GrowthOfAll | None:
    """The map that grows by what all workers' cameras see, told to those that listen; None where it should not."""
    if not task.settings.growth.enabled:
        return None

    def tell(growth: Growth) -> None:
        for worker in listening.values():
            worker.inbox.put(growth)

    return GrowthOfAll(ReferenceMap.load(task.map_path), cameras, task.settings.growth, tell)


@contextmanager
def _workers(task: RegistrationTask, shares: Sequence[tuple[str, ...]]) -> Iterator[list["_Worker"]]:
    context = _context()
    workers: list[_Worker] = []
    try:
        with _one_thread_each(), _signals_for_us_alone():
            for cameras in shares:
                outbox: Queue[WorkerItem] = context.Queue(_QUEUE_LENGTH)
                inbox: Queue[Growth] = context.Queue()
                process = context.Process(target=run_camera_worker, args=(task, cameras, outbox, inbox), daemon=True)
                process.start()
                workers.append(_Worker(process, outbox, inbox))
        yield workers
    except BaseException:
        for worker in workers:
            worker.process.kill()
        raise
    finally:
        for worker in workers:
            # What a worker has not heard when it ends is for nobody; else we would wait until it is read.
            worker.inbox.cancel_join_thread()
            worker.process.join()


def _context() -> ForkServerContext:
    return multiprocessing.get_context("forkserver")


@contextmanager
def _one_thread_each() -> Iterator[None]:
    """The processes share the cores among themselves; threads inside them would only get in each other's way."""
    before = {name: os.environ.get(name) for name in _ONE_THREAD}
    os.environ.update(_ONE_THREAD)
    try:
        yield
    finally:
        for name, value in before.items():
            os.environ.pop(name) if value is None else os.environ.update({name: value})


@contextmanager
def _signals_for_us_alone() -> Iterator[None]:
    """Processes that are started in this block never hear of what ends us, not even while they start.

    Ctrl-C and a closed terminal reach a whole group of processes; the parent alone answers, and kills the others. What
    is blocked here stays blocked there; here it comes when the block ends.
    """
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGHUP})
    try:
        with _answered_later():
            resource_tracker.ensure_running()  # it would unblock the others
            signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT, signal.SIGTERM})
            yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


@contextmanager
def _answered_later() -> Iterator[None]:
    """What ends us is answered when the block is over.

    A mask holds for a thread, and a library's other threads may take the signal: then Python would still answer it in
    this one, and a process that is half started would be left to complain about its parent.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    came: list[int] = []
    answers = {number: signal.getsignal(number) for number in (signal.SIGHUP, signal.SIGINT, signal.SIGTERM)}
    answers = {number: answer for number, answer in answers.items() if callable(answer)}
    for number in answers:
        signal.signal(number, lambda number, frame: came.append(number))
    try:
        yield
    finally:
        for number, answer in answers.items():
            signal.signal(number, answer)
        for first in came[:1]:
            signal.raise_signal(first)


@dataclass(frozen=True)
class _Worker:
    """A process, what it says, and what it is told."""

    process: ForkServerProcess
    outbox: "Queue[WorkerItem]"
    inbox: "Queue[Growth]"

    def next_result(self) -> Result | AwaitedGrowth | None:
        """The worker's next result, or None when it has sent its last.

        Raises:
            BodycamError: what went wrong for the user in the worker.
            RecordingError: the worker was killed.
        """
        item = self._receive()
        if isinstance(item, WorkerFailure):
            raise item.error
        return item

    def _receive(self) -> WorkerItem:
        while self.process.is_alive():
            with suppress(queue.Empty):
                return self.outbox.get(timeout=_POLL_S)
        # It may have sent its last word between the look at the queue and the look at the process.
        with suppress(queue.Empty):
            return self.outbox.get(timeout=_POLL_S)
        killed = self.process.exitcode == -signal.SIGKILL
        memory = (
            "; the system killed it, most likely for want of memory: give fewer processes (--jobs)" if killed else ""
        )
        raise RecordingError(f"a tracking process ended with exit code {self.process.exitcode}{memory}")
