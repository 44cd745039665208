"""All cameras at once: one process per core, their results merged in order of time."""

import queue
import signal
from collections import deque
from collections.abc import Callable, Collection, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field, replace
from multiprocessing.context import ForkServerProcess
from multiprocessing.queues import Queue

from bodycam_ros.errors import BodycamError, RecordingError
from bodycam_ros.mapping.map_settings import ExtensionSettings
from bodycam_ros.recording.bag_reader import LAST_NS, open_recording
from bodycam_ros.registration.reference_map import ReferenceMap
from bodycam_ros.replaying.camera_worker import (
    BATCH,
    AwaitedUpdate,
    RegisteredImage,
    RegistrationTask,
    Result,
    UnusableCount,
    UnusableImages,
    WorkerItem,
    run_camera_worker,
)
from bodycam_ros.replaying.map_updates import MapUpdate, MapUpdateSource
from bodycam_ros.replaying.worker_process import ready_to_start, refusal_named, warm_up

_QUEUE_LENGTH = 256 // BATCH
"""Batches a worker may be ahead of the solver: bounds the memory of a long recording to some megabytes."""

_POLL_S = 1.0


def registered_images(
    task: RegistrationTask,
    cameras: Collection[str],
    jobs: int,
    on_progress: Callable[[float], None] = lambda share: None,
) -> Iterator[RegisteredImage]:
    """Register all images of a recording in ``jobs`` processes; unusable ones are warned of, as ``UnusableCount``.

    Args:
        task: what is to be done.
        cameras: names.
        jobs: processes.
        on_progress: called with the share that is done.

    Raises:
        BodycamError: what went wrong for the user in a worker.
        RecordingError: a worker was killed.
    """
    warm_up()
    with open_recording(task.recording_path, task.names) as recording:
        start_ns, duration_s = recording.first_stamp_ns, max(recording.duration_s, 1e-9)
    unusable = UnusableCount()
    with start_workers(task, cameras, jobs) as workers:
        for item in merged_results(workers, task.settings.extension, ReferenceMap.load(task.map_path)):
            if isinstance(item, RegisteredImage):
                yield item
                on_progress(1e-9 * (item.stamp_ns - start_ns) / duration_s)
            elif isinstance(item, UnusableImages):
                unusable.add(item)
    unusable.warn_of_others()


def merged_results(
    workers: Sequence["Worker"], extension: ExtensionSettings, reference_map: ReferenceMap
) -> Iterator[Result]:
    """Results of all workers in order of recording, whatever the number of processes and the pace of each.

    Images recorded at one time are in the order of their cameras' names, as each worker has them.

    Args:
        workers: as they were started.
        extension: of the map; where it is enabled, workers are sent what all cameras add to it.
        reference_map: in which they are registered.

    Raises:
        BodycamError: as ``registered_images``.
    """
    listening = dict(enumerate(workers))

    def send(update: MapUpdate) -> None:
        for worker in listening.values():
            worker.inbox.put(update)

    updates = MapUpdateSource(reference_map, extension.capacity, send) if extension.enabled else None
    pending = {number: item for number, worker in enumerate(workers) if (item := worker.next_result())}
    while pending:
        earliest = min(pending, key=lambda number: (pending[number].recorded_ns, pending[number].camera))
        item = pending.pop(earliest)
        if updates is not None and item.recorded_ns < LAST_NS:
            updates.advance(item.recorded_ns)
            if isinstance(item, RegisteredImage) and item.keyframe is not None:
                updates.mapper.wait_for_turn(item.keyframe)
        if not isinstance(item, AwaitedUpdate):
            yield item
        if following := workers[earliest].next_result():
            pending[earliest] = following
        else:
            del listening[earliest]  # or its inbox would fill until the others are done


@contextmanager
def start_workers(task: RegistrationTask, cameras: Collection[str], jobs: int) -> Iterator[list["Worker"]]:
    """Processes that register an equal share of the cameras each, until the end of the block.

    Raises:
        RecordingError: the system refuses them.
    """
    shares = [tuple(cameras)[start::jobs] for start in range(min(jobs, len(cameras)))]
    workers: list[Worker] = []
    try:
        with refusal_named(), ready_to_start() as context:
            for share in shares:
                own = replace(task, turns={camera: task.turns[camera] for camera in share if camera in task.turns})
                outbox: Queue[list[WorkerItem]] = context.Queue(_QUEUE_LENGTH)
                inbox: Queue[MapUpdate] = context.Queue()
                process = context.Process(target=run_camera_worker, args=(own, share, outbox, inbox), daemon=True)
                process.start()
                # Else the queue has no end after the worker's, and half a batch of one that was killed is waited for.
                outbox._writer.close()  # type: ignore[attr-defined]
                workers.append(Worker(process, outbox, inbox))
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


@dataclass(frozen=True)
class Worker:
    """A process with its queues."""

    process: ForkServerProcess
    outbox: "Queue[list[WorkerItem]]"
    inbox: "Queue[MapUpdate]"
    received: deque[WorkerItem] = field(default_factory=deque)

    def next_result(self) -> Result | AwaitedUpdate | None:
        """The worker's next result, or None after its last; raises as ``registered_images``."""
        if not self.received:
            self.received.extend(self._receive())
        item = self.received.popleft()
        if isinstance(item, BodycamError):
            raise item
        return item

    def _receive(self) -> list[WorkerItem]:
        # The end of the process is the end of the queue, after all that it has sent.
        with suppress(EOFError, OSError):
            while True:
                with suppress(queue.Empty):
                    return self.outbox.get(timeout=_POLL_S)  # so that signals are handled
        self.process.join(_POLL_S)
        killed = self.process.exitcode == -signal.SIGKILL
        memory = (
            "; the system killed it, most likely because memory ran out: give fewer processes (--jobs)"
            if killed
            else ""
        )
        raise RecordingError(f"a tracking process ended with exit code {self.process.exitcode}{memory}")
