"""All cameras at once: one process per core, their results merged in order of time."""

import multiprocessing
import os
import queue
import signal
import threading
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, replace
from multiprocessing import forkserver, resource_tracker
from multiprocessing.context import ForkServerContext, ForkServerProcess
from multiprocessing.queues import Queue

from bodycam_ros.camera import CameraModel
from bodycam_ros.errors import RecordingError
from bodycam_ros.kernels import prepare_kernels
from bodycam_ros.offline.camera_worker import (
    AwaitedUpdate,
    RegisteredImage,
    RegistrationTask,
    Result,
    WorkerFailure,
    WorkerItem,
    run_camera_worker,
)
from bodycam_ros.offline.map_updates import MapUpdate, MapUpdateSource
from bodycam_ros.registration.reference_map import ReferenceMap

_QUEUE_LENGTH = 64
"""Results a worker may be ahead of the solver: bounds the memory of a long recording to some megabytes."""

_POLL_S = 1.0
_WARM = "bodycam_ros.offline.warm_worker"
_ONE_THREAD = dict.fromkeys(("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"), "1")


def warm_up() -> None:
    """Start to load what the processes need, in the background; compile missing kernels first."""
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
        updates = _update_source(task, cameras, listening)
        pending = {number: item for number, worker in enumerate(workers) if (item := worker.next_result())}
        while pending:
            earliest = min(pending, key=lambda number: (pending[number].stamp_ns, number))
            item = pending.pop(earliest)
            if updates is not None:
                updates.advance(item.stamp_ns)
                if isinstance(item, RegisteredImage):
                    updates.add(item.matches, item.keyframe)
            if not isinstance(item, AwaitedUpdate):
                yield item
            if following := workers[earliest].next_result():
                pending[earliest] = following
            else:
                del listening[earliest]  # or its inbox would fill until the others are done


def _update_source(
    task: RegistrationTask, cameras: Mapping[str, CameraModel], listening: Mapping[int, "_Worker"]
) -> MapUpdateSource | None:
    """Extends the map by the images of all workers, and sends the changes to those that listen; None if disabled."""
    growth = task.settings.growth
    if not growth.enabled:
        return None

    def send(update: MapUpdate) -> None:
        for worker in listening.values():
            worker.inbox.put(update)

    return MapUpdateSource(ReferenceMap.load(task.map_path), cameras, growth.capacity, send)


@contextmanager
def _workers(task: RegistrationTask, shares: Sequence[tuple[str, ...]]) -> Iterator[list["_Worker"]]:
    context = _context()
    workers: list[_Worker] = []
    try:
        with _one_thread_each(), _signals_for_us_alone():
            for cameras in shares:
                own = replace(task, turns={camera: task.turns[camera] for camera in cameras if camera in task.turns})
                outbox: Queue[WorkerItem] = context.Queue(_QUEUE_LENGTH)
                inbox: Queue[MapUpdate] = context.Queue()
                process = context.Process(target=run_camera_worker, args=(own, cameras, outbox, inbox), daemon=True)
                process.start()
                workers.append(_Worker(process, outbox, inbox))
        yield workers
    except BaseException:
        for worker in workers:
            worker.process.kill()
        raise
    finally:
        for worker in workers:
            # A worker that has ended reads no more; without this we would wait for it to do so.
            worker.inbox.cancel_join_thread()
            worker.process.join()


def _context() -> ForkServerContext:
    return multiprocessing.get_context("forkserver")


@contextmanager
def _one_thread_each() -> Iterator[None]:
    """The processes share the cores; more threads inside them would compete."""
    before = {name: os.environ.get(name) for name in _ONE_THREAD}
    os.environ.update(_ONE_THREAD)
    try:
        yield
    finally:
        for name, value in before.items():
            os.environ.pop(name) if value is None else os.environ.update({name: value})


@contextmanager
def _signals_for_us_alone() -> Iterator[None]:
    """Processes that are started in this block never receive the signals that end us, not even while they start.

    Ctrl-C and a closed terminal signal a whole group of processes; the parent alone handles them, and kills the others.
    Signals that are blocked here stay blocked there; here they are delivered when the block ends.
    """
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGHUP})
    try:
        with _handled_later():
            resource_tracker.ensure_running()  # it would unblock the others
            signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT, signal.SIGTERM})
            yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


@contextmanager
def _handled_later() -> Iterator[None]:
    """Signals that end us are handled when the block is over.

    A mask holds for a thread, and a library's other threads may receive the signal: Python would still handle it in
    this one, and leave a process that is half started.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    received: list[int] = []
    handlers = {number: signal.getsignal(number) for number in (signal.SIGHUP, signal.SIGINT, signal.SIGTERM)}
    handlers = {number: handler for number, handler in handlers.items() if callable(handler)}
    for number in handlers:
        signal.signal(number, lambda number, frame: received.append(number))
    try:
        yield
    finally:
        for number, handler in handlers.items():
            signal.signal(number, handler)
        for first in received[:1]:
            signal.raise_signal(first)


@dataclass(frozen=True)
class _Worker:
    """A process with its queues."""

    process: ForkServerProcess
    outbox: "Queue[WorkerItem]"
    inbox: "Queue[MapUpdate]"

    def next_result(self) -> Result | AwaitedUpdate | None:
        """The worker's next result, or None after its last; raises as ``register_recording``."""
        item = self._receive()
        if isinstance(item, WorkerFailure):
            raise item.error
        return item

    def _receive(self) -> WorkerItem:
        while self.process.is_alive():
            with suppress(queue.Empty):
                return self.outbox.get(timeout=_POLL_S)
        # It may have sent its last item between the two checks.
        with suppress(queue.Empty):
            return self.outbox.get(timeout=_POLL_S)
        killed = self.process.exitcode == -signal.SIGKILL
        memory = (
            "; the system killed it, most likely for want of memory: give fewer processes (--jobs)" if killed else ""
        )
        raise RecordingError(f"a tracking process ended with exit code {self.process.exitcode}{memory}")
